//! Job files, TOML or CSV: which images are to be rendered, each with options of its own.
//!
//! ```toml
//! [defaults]                       # for all jobs
//! scene = "lattice/scene.xml"      # from the job file's folder on, as all paths
//! mpp = 256
//! define = { res = 512 }           # values of the scene's parameters, as by -D
//!
//! [[job]]
//! output = "lattice-{method}-{seed}.exr"
//! method = ["path", "re"]          # a list of values makes a job of each
//! seed = [1, 2, 3]
//!
//! [[job]]
//! output = "turn/{frame:04}.exr"
//! frames = "1..100"                # a job of each, the last one included; "1..100/5" every fifth
//! define.angle = { from = 0, to = 357 }   # evenly from the first frame to the last
//! define.sky = "sky-{frame}.exr"
//! ```
//!
//! All keys but `frames`, `scene`, `output` and `define` are options of `relt render` without their dashes. `{key}` in any
//! text stands for the value that the key of that name has in the job, of an option, a parameter of the scene or `frame`;
//! `{key:04}` fills it up with zeros.
//!
//! In a CSV file the first row has the keys, parameters as `define.NAME`, and each further row is a job; an empty cell is a
//! key that is not given. Texts have placeholders there as well, and `frames` makes several jobs of a row.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use toml::{Spanned, Value};

use crate::film::file::FileError;
use crate::load::faults::{did_you_mean, list};
use crate::study::words::{Choice, grid, place, tidy, values, word};

/// A job as the file has it, with all its placeholders filled in.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Entry {
    /// The image's path as the file has it: what the job is called.
    pub name: String,
    /// The scene as the file has it.
    pub scene_name: String,
    /// The scene's file.
    pub scene: PathBuf,
    /// `-D` names and values, by name.
    pub defines: Vec<(String, String)>,
    /// The image's file.
    pub output: PathBuf,
    /// Further options, as on a command line.
    pub options: Vec<String>,
    /// Where it is in the file.
    pub place: String,
}

/// An option of `relt render` that jobs may have.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Known {
    /// Its name without dashes.
    pub name: String,
    /// It is given or not, and has no value.
    pub is_flag: bool,
}

/// Why there are no jobs: everything that is wrong with the file, a line each.
#[derive(Debug, thiserror::Error)]
pub enum BatchError {
    /// The file cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// Its content is not what it should be.
    #[error("{}", .0.join("\n"))]
    Content(Vec<String>),
}

/// Keys that are no options of `relt render`.
const OWN: [&str; 4] = ["scene", "output", "frames", "define"];
/// What stands for the number of a frame.
const FRAME: &str = "frame";
/// What parameters of the scene are called in the file's own list of keys.
const DEFINE: &str = "define.";
/// Options that name files.
const FILES: [&str; 2] = ["log", "checkpoint-file"];
/// Jobs of a file at most: more are surely a slip of the keyboard, and would fill the memory.
const MOST_JOBS: usize = 1_000_000;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    #[serde(default)]
    defaults: Table,
    #[serde(default, rename = "job")]
    jobs: Vec<Spanned<Table>>,
}

type Table = BTreeMap<Spanned<String>, Spanned<Value>>;

/// A key with its value and the place to name where something is wrong with it.
#[derive(Clone, Debug)]
struct Given {
    key: String,
    value: Value,
    place: String,
}

/// Reads a file; `known` are the options that jobs may have.
pub fn read(path: &Path, known: &[Known]) -> Result<Vec<Entry>, BatchError> {
    let text = std::fs::read_to_string(path).map_err(|error| FileError::read(path, error))?;
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    let mut reader = Reader { path, text: &text, known, faults: Vec::new() };
    let rows = match extension.as_str() {
        "toml" => reader.toml(),
        "csv" => reader.csv(),
        _ => return Err(FileError::read(path, "job files are .toml or .csv").into()),
    };
    let mut entries = Vec::new();
    for row in rows {
        entries.extend(reader.entries(&row));
        if entries.len() > MOST_JOBS {
            reader.faults.push(format!("{}: more than {MOST_JOBS} jobs", row.place));
            break;
        }
    }
    if entries.is_empty() && reader.faults.is_empty() {
        reader.faults.push(format!("{}: there is no job", path.display()));
    }
    if reader.faults.is_empty() { Ok(entries) } else { Err(BatchError::Content(reader.faults)) }
}

/// A `[[job]]`, or a row of a table.
struct Row {
    given: Vec<Given>,
    place: String,
}

/// Gathers all that is wrong with a file.
struct Reader<'a> {
    path: &'a Path,
    text: &'a str,
    known: &'a [Known],
    faults: Vec<String>,
}

impl Reader<'_> {
    fn toml(&mut self) -> Vec<Row> {
        let document: Document = match toml::from_str(self.text) {
            Ok(document) => document,
            Err(error) => {
                let place = self.place(error.span().unwrap_or_default());
                self.faults.push(format!("{place}: {}", error.message().replace('\n', ", ")));
                return Vec::new();
            }
        };
        let defaults = self.table(&document.defaults);
        let row = |job: &Spanned<Table>| {
            let place = self.place(job.span());
            let own = self.table(job.get_ref());
            let is_own = |key: &str| own.iter().any(|given| given.key == key);
            let mut given: Vec<Given> = defaults.iter().filter(|given| !is_own(&given.key)).cloned().collect();
            given.extend(own);
            Row { given, place }
        };
        document.jobs.iter().map(row).collect()
    }

    /// The keys of a table in the order of the file, those of `define` with its name before theirs.
    fn table(&self, table: &Table) -> Vec<Given> {
        let mut entries: Vec<_> = table.iter().collect();
        entries.sort_by_key(|(key, _)| key.span().start);
        let mut given = Vec::new();
        for (key, value) in entries {
            let place = self.place(key.span());
            match (key.get_ref().as_str(), value.get_ref()) {
                ("define", Value::Table(defines)) => given.extend(defines.iter().map(|(name, value)| Given {
                    key: format!("{DEFINE}{name}"),
                    value: value.clone(),
                    place: place.clone(),
                })),
                (key, value) => given.push(Given { key: key.to_owned(), value: value.clone(), place }),
            }
        }
        given
    }

    fn csv(&mut self) -> Vec<Row> {
        let mut table = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(self.text.as_bytes());
        let path = self.path.display();
        let headers = match table.headers() {
            Ok(headers) => headers.clone(),
            Err(error) => {
                self.faults.push(format!("{path}: {error}"));
                return Vec::new();
            }
        };
        let mut rows = Vec::new();
        for record in table.records() {
            match record {
                Ok(record) => {
                    let line = record.position().map_or(0, csv::Position::line);
                    let place = format!("{path}:{line}");
                    let cells = headers.iter().zip(&record).filter(|(_, cell)| !cell.is_empty());
                    let given = cells.map(|(key, cell)| Given {
                        key: key.to_owned(),
                        value: Value::String(cell.to_owned()),
                        place: place.clone(),
                    });
                    rows.push(Row { given: given.collect(), place });
                }
                Err(error) => self.faults.push(format!("{path}: {error}")),
            }
        }
        rows
    }

    fn place(&self, span: Range<usize>) -> String {
        place(self.path, self.text, span)
    }

    /// All jobs that a row stands for: one for each frame and each combination of the values in its lists.
    fn entries(&mut self, row: &Row) -> Vec<Entry> {
        let before = self.faults.len();
        let mut axes = Vec::new();
        for given in &row.given {
            match self.axis(given) {
                Ok(axis) => axes.push(axis),
                Err(what) => self.faults.push(format!("{}: {what}", given.place)),
            }
        }
        for needed in ["scene", "output"].iter().filter(|needed| row.given.iter().all(|given| given.key != **needed)) {
            self.faults.push(format!("{}: the job has no `{needed}`", row.place));
        }
        let jobs = axes.iter().try_fold(1_usize, |jobs, (_, values)| jobs.checked_mul(values.len()));
        if jobs.is_none_or(|jobs| jobs > MOST_JOBS) {
            self.faults.push(format!("{}: more than {MOST_JOBS} jobs", row.place));
        }
        if self.faults.len() > before {
            self.faults.dedup();
            return Vec::new();
        }
        let frames = axes.iter().find(|(key, _)| key == FRAME).map(|(_, frames)| frames.clone()).unwrap_or_default();
        let mut entries = Vec::new();
        for choices in grid(&axes) {
            match self.entry(row, &choices, &frames) {
                Ok(entry) => entries.push(entry),
                // what is wrong with one is mostly wrong with all
                Err(what) => {
                    self.faults.push(format!("{}: {what}", row.place));
                    break;
                }
            }
        }
        entries
    }

    /// The values that a key is to take.
    fn axis(&self, given: &Given) -> Result<(String, Vec<Value>), String> {
        let Given { key, value, .. } = given;
        let no_value = || format!("`{key}` must be a number, a text, true or false, or a list of them");
        if key == "frames" {
            return Ok((FRAME.into(), frames(value)?));
        }
        if let Some(name) = key.strip_prefix(DEFINE).filter(|name| !name.is_empty()) {
            return match value {
                Value::Table(span) => Ok((key.clone(), vec![Value::Table(checked_span(name, span)?)])),
                value => Ok((key.clone(), values(name, value).ok_or_else(no_value)?)),
            };
        }
        if key == "define" {
            return Err("`define` is a table of parameters of the scene, such as { res = 512 }".into());
        }
        if let Some(known) = self.known.iter().find(|known| known.name == *key) {
            let values = values(key, value).ok_or_else(no_value)?;
            let flag = |value: &Value| known.is_flag.then(|| truth(value)).flatten().map(Value::Boolean);
            return match known.is_flag {
                true => {
                    let values = values.iter().map(flag).collect::<Option<_>>();
                    Ok((key.clone(), values.ok_or_else(|| format!("`{key}` is true or false"))?))
                }
                false => Ok((key.clone(), values)),
            };
        }
        if OWN.contains(&key.as_str()) {
            return Ok((key.clone(), values(key, value).ok_or_else(no_value)?));
        }
        let accepted: Vec<&str> = OWN.into_iter().chain(self.known.iter().map(|known| known.name.as_str())).collect();
        Err(format!("unknown key `{key}`{}; {}", did_you_mean(key, &accepted), list(&accepted)))
    }

    /// The job of one value of each key.
    fn entry(&self, row: &Row, choices: &[Choice], frames: &[Value]) -> Result<Entry, String> {
        let frame = choices.iter().find(|choice| choice.name == FRAME).map(|choice| &choice.value);
        let mut named: Vec<(String, String)> = Vec::new();
        for Choice { name, value, .. } in choices {
            let value = match value {
                Value::Table(span) => number(between(span, frame, frames).ok_or_else(|| {
                    format!("`{name}` goes from a first frame to a last one; give `frames`, two at least")
                })?),
                value => word(value).expect("axes have values that are words"),
            };
            named.push((name.clone(), value));
        }
        let value_of = |wanted: &str| {
            let is = |name: &str| name == wanted || name.strip_prefix(DEFINE) == Some(wanted);
            named.iter().find(|(name, _)| is(name)).map(|(_, value)| value.as_str())
        };
        let folder = self.path.parent().unwrap_or(Path::new(""));
        let path = |text: &str| tidy(&folder.join(text)).display().to_string();
        let mut entry = Entry { place: row.place.clone(), ..Entry::default() };
        for (Choice { name, value, .. }, (_, text)) in choices.iter().zip(&named) {
            let filled = filled(text, &value_of).map_err(|what| format!("`{name}`: {what}"))?;
            match (name.as_str(), name.strip_prefix(DEFINE)) {
                (FRAME, _) => {}
                ("scene", _) => (entry.scene, entry.scene_name) = (path(&filled).into(), filled),
                ("output", _) => (entry.output, entry.name) = (path(&filled).into(), filled),
                (_, Some(parameter)) => entry.defines.push((parameter.to_owned(), filled)),
                (name, _) if FILES.contains(&name) => entry.options.push(format!("--{name}={}", path(&filled))),
                (name, _) => match value {
                    Value::Boolean(true) => entry.options.push(format!("--{name}")),
                    Value::Boolean(false) => {}
                    _ => entry.options.push(format!("--{name}={filled}")),
                },
            }
        }
        entry.defines.sort();
        entry.name = tidy(Path::new(&entry.name)).display().to_string();
        entry.scene_name = tidy(Path::new(&entry.scene_name)).display().to_string();
        Ok(entry)
    }
}

/// The numbers of `"1..100"`, `"1..100/5"`, `7` or a list of numbers.
fn frames(value: &Value) -> Result<Vec<Value>, String> {
    let wrong = || "`frames` is a text such as \"1..100\" or \"1..100/5\", a number or a list of numbers".to_owned();
    let numbers: Vec<i64> = match value {
        Value::Integer(frame) => vec![*frame],
        Value::Array(frames) => frames.iter().map(Value::as_integer).collect::<Option<_>>().ok_or_else(wrong)?,
        Value::String(text) => {
            let (range, step) = text.split_once('/').unwrap_or((text, "1"));
            let (first, last) = range.split_once("..").unwrap_or((range, range));
            let number = |text: &str| text.trim().parse::<i64>().ok();
            let (first, last) = number(first).zip(number(last)).ok_or_else(wrong)?;
            let step = number(step).and_then(|step| usize::try_from(step).ok()).filter(|step| *step > 0);
            let most = i64::try_from(MOST_JOBS).expect("a small number");
            if last.checked_sub(first).is_none_or(|frames| frames > most) {
                return Err(format!("`frames`: more than {MOST_JOBS} frames"));
            }
            (first..=last).step_by(step.ok_or_else(wrong)?).collect()
        }
        _ => return Err(wrong()),
    };
    if numbers.is_empty() {
        return Err("`frames`: there are none; the first must not be above the last".into());
    }
    if let Some(twice) = (1..numbers.len()).find(|i| numbers[*i - 1] == numbers[*i]) {
        return Err(format!("`frames`: {} is given twice", numbers[twice]));
    }
    Ok(numbers.into_iter().map(Value::Integer).collect())
}

fn truth(value: &Value) -> Option<bool> {
    match value {
        Value::Boolean(flag) => Some(*flag),
        Value::String(text) => text.parse().ok(),
        _ => None,
    }
}

/// The ends that a parameter goes between, if they are two numbers.
fn checked_span(name: &str, span: &toml::Table) -> Result<toml::Table, String> {
    let fits = span.len() == 2 && ["from", "to"].iter().all(|end| span.get(*end).and_then(real).is_some());
    fits.then(|| span.clone()).ok_or_else(|| format!("`define.{name}` goes over frames as {{ from = 0, to = 1 }}"))
}

fn real(value: &Value) -> Option<f64> {
    value.as_float().or_else(|| value.as_integer().map(|number| number as f64)).filter(|number| number.is_finite())
}

/// The value at a frame of what goes evenly from the first to the last: a + (b − a)(f − f₀)/(f₁ − f₀).
fn between(span: &toml::Table, frame: Option<&Value>, frames: &[Value]) -> Option<f64> {
    let [from, to] = ["from", "to"].map(|end| span.get(end).and_then(real));
    let [first, last, frame] = [frames.first(), frames.last(), frame].map(|frame| frame.and_then(real));
    let (first, last) = first.zip(last).filter(|(first, last)| first != last)?;
    Some(from? + (to? - from?) * (frame? - first) / (last - first))
}

/// A number of at most 9 decimals, without those that are 0: what is between is no more exact.
fn number(value: f64) -> String {
    let text = format!("{value:.9}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".into() } else { text.to_owned() }
}

/// The text with values in the place of `{key}` and `{key:04}`.
fn filled<'a>(text: &str, value_of: &dyn Fn(&str) -> Option<&'a str>) -> Result<String, String> {
    let mut result = String::new();
    let mut rest = text;
    while let Some((before, behind)) = rest.split_once('{') {
        let (inside, after) = behind.split_once('}').ok_or("a { has no }")?;
        let (key, width) = inside.split_once(':').unwrap_or((inside, ""));
        let value = value_of(key).ok_or_else(|| format!("{{{inside}}}: the job has no value called `{key}`"))?;
        if value.contains('{') {
            return Err(format!("{{{inside}}}: the value has placeholders of its own"));
        }
        let zeros =
            match (width.strip_prefix('0'), width) {
                (_, "") => 0,
                (Some(number), _) => number.parse::<usize>().ok().filter(|zeros| *zeros <= 20).ok_or_else(|| {
                    format!("{{{inside}}}: behind the colon is a number of digits, such as {{{key}:04}}")
                })?,
                (None, _) => return Err(format!("{{{inside}}}: write {{{key}:04}} for four digits")),
            };
        result += before;
        let (sign, digits) = value.strip_prefix('-').map_or(("", value), |digits| ("-", digits));
        result += &format!("{sign}{digits:0>zeros$}");
        rest = after;
    }
    Ok(result + rest)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn known() -> Vec<Known> {
        let known = |(name, is_flag): (&str, bool)| Known { name: name.into(), is_flag };
        [("mpp", false), ("seed", false), ("method", false), ("betas", false), ("log", false), ("layers", true)]
            .map(known)
            .into()
    }

    fn read_text(name: &str, text: &str) -> Result<Vec<Entry>, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        let plain = |text: String| text.replace(&format!("{}/", folder.path().display()), "");
        let entries = read(&path, &known()).map_err(|error| plain(error.to_string()))?;
        let relative = |mut entry: Entry| {
            entry.scene = plain(entry.scene.display().to_string()).into();
            entry.output = plain(entry.output.display().to_string()).into();
            entry.options = entry.options.into_iter().map(plain).collect();
            entry.place = plain(entry.place);
            entry
        };
        Ok(entries.into_iter().map(relative).collect())
    }

    fn texts(words: &[&str]) -> Vec<String> {
        words.iter().map(|word| (*word).to_owned()).collect()
    }

    #[test]
    fn lists_and_frames_make_jobs_of_all_their_combinations() {
        let text = "[defaults]\nscene = \"box/../box/s.xml\"\nmpp = 8\nlayers = true\ndefine = { res = 64, a = 1 }\n\
                    [[job]]\noutput = \"{method}-{seed}-{res}.exr\"\nmethod = [\"path\", \"re\"]\nseed = [3, 4]\n\
                    define.a = 2\nlayers = false\nlog = \"{seed}.jsonl\"\n\
                    [[job]]\noutput = \"f/{frame:03}.exr\"\nframes = \"8..12/2\"\nmpp = 16\n\
                    define.turn = { from = 0, to = 90 }\ndefine.sky = \"{frame}.png\"\nbetas = [0, 0.5, 1]\n";
        let jobs = read_text("j.toml", text).unwrap();
        assert_eq!(jobs.len(), 7);
        let define = |pairs: &[(&str, &str)]| -> Vec<(String, String)> {
            pairs.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned())).collect()
        };
        let first = Entry {
            name: "path-3-64.exr".into(),
            scene_name: "box/s.xml".into(),
            scene: "box/s.xml".into(),
            defines: define(&[("a", "2"), ("res", "64")]),
            output: "path-3-64.exr".into(),
            options: texts(&["--mpp=8", "--method=path", "--seed=3", "--log=3.jsonl"]),
            place: "j.toml:6:1".into(),
        };
        assert_eq!(jobs[0], first);
        let names: Vec<&str> = jobs.iter().map(|job| job.name.as_str()).collect();
        let expected = ["path-3-64", "path-4-64", "re-3-64", "re-4-64", "f/008", "f/010", "f/012"];
        assert_eq!(names, expected.map(|name| format!("{name}.exr")));
        assert_eq!(jobs[5].options, texts(&["--layers", "--mpp=16", "--betas=0,0.5,1"]));
        assert_eq!(jobs[5].defines, define(&[("a", "1"), ("res", "64"), ("sky", "10.png"), ("turn", "45")]));
    }

    #[test]
    fn rows_of_a_table_are_jobs() {
        let text = "scene, output, mpp, define.res, layers, frames\n\
                    s.xml, a-{res}.exr, 4, 32, true,\n\
                    s.xml,\"b,{frame}.exr\", , , , -1..0\n";
        let jobs = read_text("j.csv", text).unwrap();
        let names: Vec<&str> = jobs.iter().map(|job| job.name.as_str()).collect();
        assert_eq!(names, ["a-32.exr", "b,-1.exr", "b,0.exr"]);
        assert_eq!(jobs[0].options, texts(&["--mpp=4", "--layers"]));
        assert_eq!((jobs[0].place.as_str(), jobs[2].place.as_str()), ("j.csv:2", "j.csv:3"));
        assert!(jobs[1].options.is_empty() && jobs[1].defines.is_empty());
    }

    #[test]
    fn all_that_is_wrong_is_told_with_its_place() {
        let text = "[[job]]\nscene = \"s.xml\"\noutput = \"a.exr\"\nmmp = 4\nlayers = 3\n\
                    [[job]]\noutput = \"{nobody}.exr\"\n[[job]]\nscene = \"s.xml\"\noutput = \"{nobody}.exr\"\n";
        let faults = read_text("j.toml", text).unwrap_err();
        let lines: Vec<&str> = faults.lines().collect();
        assert_eq!(lines.len(), 4, "{faults}");
        assert!(lines[0].starts_with("j.toml:4:1: unknown key `mmp` (did you mean \"mpp\"?); known: betas, define"));
        assert_eq!(lines[1], "j.toml:5:1: `layers` is true or false");
        assert_eq!(lines[2], "j.toml:6:1: the job has no `scene`");
        assert_eq!(lines[3], "j.toml:8:1: `output`: {nobody}: the job has no value called `nobody`");
        for (name, text, what) in [
            ("j.toml", "[[jobs]]\n", "j.toml:1:3: unknown field `jobs`, expected `defaults` or `job`"),
            ("j.toml", "", "j.toml: there is no job"),
            ("j.txt", "", "job files are .toml or .csv"),
            ("j.csv", "scene,output\na.xml\n", "found record with 1 fields"),
            ("j.csv", "scene,outputs\na.xml,b\n", "j.csv:2: unknown key `outputs` (did you mean \"output\"?)"),
        ] {
            let faults = read_text(name, text).unwrap_err();
            assert!(faults.contains(what), "{text:?}: {faults}");
        }
        let job = |more: &str| read_text("j.toml", &format!("[[job]]\nscene = \"s.xml\"\noutput = \"a.exr\"\n{more}"));
        for (more, what) in [
            ("frames = \"5..1\"", "`frames`: there are none"),
            ("frames = \"1-5\"", "`frames` is a text such as"),
            ("frames = \"1..99999999999\"", "more than 1000000 frames"),
            ("define.x = { from = 0, to = 1 }", "`define.x` goes from a first frame to a last one"),
            ("define.x = { from = 0 }", "{ from = 0, to = 1 }"),
            ("define = 3", "`define` is a table"),
            ("mpp = { a = 1 }", "`mpp` must be a number"),
            ("seed = 3\nlog = \"{seed:4}\"", "write {seed:04} for four digits"),
            ("log = \"{seed\"", "a { has no }"),
        ] {
            let faults = job(more).unwrap_err();
            assert!(faults.contains(what), "{more:?}: {faults}");
        }
    }

    #[test]
    fn what_goes_over_frames_reaches_both_ends() {
        let text = "[[job]]\nscene = \"s.xml\"\noutput = \"{frame}.exr\"\nframes = \"0..10\"\n\
                    define.x = { from = -1, to = 2.5 }\n";
        let jobs = read_text("j.toml", text).unwrap();
        let values: Vec<&str> = jobs.iter().map(|job| job.defines[0].1.as_str()).collect();
        assert_eq!((values[0], values[1], values[10]), ("-1", "-0.65", "2.5"));
    }
}
