//! Study files, TOML: which scenes, which methods, how long, how often.
//!
//! ```toml
//! title = "How many replicas"
//! time = "30s"                    # for each run; or mpp = 1000, mutations per pixel
//! seeds = 5                       # 1 to 5 (the default); or a list of seeds
//! snapshots = 12                  # errors are taken that often, evenly spaced in the logarithm
//! baseline = "mlt"                # what others are compared with; otherwise the first method
//!
//! [options]                       # of `relt render`, for all methods
//! threads = 2
//!
//! [[scene]]
//! file = "../lattice/scene.xml"   # from the study file's folder on, as all paths
//!
//! [[method]]
//! name = "mlt"
//! method = "mlt"
//!
//! [[method]]
//! name = "re, K = {replicas}"     # a list of values makes a method of each
//! method = "re"
//! replicas = [2, 4, 8]
//! ```
//!
//! All keys of `[[method]]` but `name`, and those of `[options]`, are options of `relt render` without their dashes, as
//! TOML numbers, strings or, for flags, `true`. So a study can vary whatever a run can.
//!
//! Two more keys are about how a run is done. `ranks = [1, 2, 4]`: on so many ranks, by the launcher that the person at the
//! keyboard names (`relt study --launch "mpirun -n {ranks}"`; a file starts no programs), in front of a `relt render` that must
//! be built with the feature `mpi`; their processor time is not known, only wall time. `per-worker = true`: the budget in mutations is that of each worker, threads times ranks
//! (weak scaling), and not of all together (strong scaling).

use std::collections::{BTreeMap, HashSet};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::Duration;

use serde::Deserialize;
use toml::{Spanned, Table, Value};

use super::results::{Clock, Stage};
use super::words::{Choice, grid, place, tidy, values, word};
use crate::film::file::FileError;
use crate::load::{self, LoadError, Reach, Watch};
use crate::render::Settings;
use crate::scene::SceneDescription;

/// A study file as it was read, all methods spelled out.
#[derive(Clone, Debug, PartialEq)]
pub struct Study {
    /// What it is called.
    pub title: String,
    /// What it is for; may be empty.
    pub note: String,
    /// What each run is given.
    pub budget: Budget,
    /// Of the runs of each method on each scene; none twice.
    pub seeds: Vec<u64>,
    /// Times at which errors are taken in a run, the end included.
    pub snapshots: usize,
    /// The first of them, in seconds or mutations per pixel.
    pub first_snapshot: f64,
    /// What errors are plotted against.
    pub clock: Clock,
    /// What is left out of it.
    pub excluded: Vec<Stage>,
    /// Index of the method that others are compared with.
    pub baseline: usize,
    /// One at least; names are unique.
    pub scenes: Vec<StudyScene>,
    /// One at least; names are unique.
    pub methods: Vec<StudyMethod>,
    /// How far the names in its scenes may lead; the file says nothing of it.
    pub reach: Reach,
    /// The file itself.
    pub text: String,
}

/// What a run is given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Budget {
    /// Wall time, from the moment the scene's file is opened.
    Time(Duration),
    /// Mutations per pixel.
    Mutations(f64),
}

/// A scene of a study.
#[derive(Clone, Debug, PartialEq)]
pub struct StudyScene {
    /// What it is called.
    pub name: String,
    /// Its file.
    pub file: PathBuf,
    /// `-D` names and values.
    pub defines: Vec<(String, String)>,
    /// The image that counts as the truth.
    pub reference: PathBuf,
    /// √relMSE for which the time to reach it is told; chosen by the report where empty.
    pub target_errors: Vec<f64>,
}

/// A method of a study.
#[derive(Clone, Debug, PartialEq)]
pub struct StudyMethod {
    /// What it is called.
    pub name: String,
    /// Words of a command line: `--method`, `re`, …
    pub options: Vec<String>,
    /// What starts `relt render` on several ranks, word by word; nothing where the study's own process renders, and until it is
    /// [named](Study::launch_by).
    pub launch: Vec<String>,
    /// Ranks that it starts.
    pub ranks: Option<u32>,
    /// Each worker has the study's budget in mutations, not all of them together.
    pub per_worker: bool,
    /// What was varied: values by option.
    pub variant: Vec<(String, String)>,
    /// What the options say; seed and budget are the run's.
    pub settings: Settings,
}

/// Why a study cannot be run: everything that is wrong with its file, a line each.
#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    /// The file cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// Its content is not what it should be.
    #[error("{}", .0.join("\n"))]
    Content(Vec<String>),
}

/// From words of a `relt render` command line to settings, or what is wrong with them.
pub type ParseOptions = dyn Fn(&[String]) -> Result<Settings, String>;

#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct Document {
    title: String,
    #[serde(default)]
    note: String,
    mpp: Option<Spanned<f64>>,
    time: Option<Spanned<String>>,
    seeds: Option<Spanned<Seeds>>,
    snapshots: Option<Spanned<usize>>,
    first_snapshot: Option<Spanned<First>>,
    #[serde(default)]
    clock: Clock,
    #[serde(default)]
    exclude: Vec<Stage>,
    baseline: Option<Spanned<String>>,
    #[serde(default)]
    options: Table,
    #[serde(default, rename = "scene")]
    scenes: Vec<Spanned<SceneEntry>>,
    #[serde(default, rename = "method")]
    methods: Vec<Spanned<Table>>,
}

#[derive(Deserialize)]
#[serde(untagged, expecting = "a number of seeds or a list of them")]
enum Seeds {
    Number(u64),
    List(Vec<u64>),
}

#[derive(Deserialize)]
#[serde(untagged, expecting = "a time such as \"0.5s\", or mutations per pixel, as the budget is")]
enum First {
    Time(String),
    Mutations(f64),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct SceneEntry {
    file: PathBuf,
    name: Option<String>,
    #[serde(default)]
    define: BTreeMap<String, Value>,
    reference: Option<PathBuf>,
    #[serde(default)]
    target_errors: Vec<f64>,
}

/// Seeds of a study that names none.
const SEEDS: u64 = 5;
/// Most seeds of a study.
const MOST_SEEDS: usize = 10_000;
/// Most methods that the lists of one entry make.
const MOST_COMBINATIONS: usize = 10_000;
/// Snapshots of a run where the study does not say.
const SNAPSHOTS: usize = 12;
/// Errors are first taken after this part of the budget where the study does not say.
const FIRST_SNAPSHOT: f64 = 1.0 / 64.0;
/// Options that the study itself sees to, or that have no meaning in it.
const NOT_OPTIONS: [&str; 14] = [
    "seed",
    "mpp",
    "time",
    "output",
    "snapshot",
    "log",
    "checkpoint",
    "checkpoint-file",
    "confine",
    "resume",
    "part",
    "quiet",
    "verbose",
    "layers",
];
/// Options of a method that say how a run is done and are none of `relt render`.
const HOW: [&str; 2] = ["ranks", "per-worker"];
/// Most ranks of a run.
const MOST_RANKS: u32 = 1 << 20;

/// Reads a study file; `parse` knows the options of methods.
pub fn read(path: &Path, parse: &ParseOptions) -> Result<Study, StudyError> {
    let text = std::fs::read_to_string(path).map_err(|error| FileError::read(path, error))?;
    let document: Document = toml::from_str(&text).map_err(|error| {
        let place = place(path, &text, error.span().unwrap_or_default());
        StudyError::Content(vec![format!("{place}: {}", error.message().replace('\n', ", "))])
    })?;
    let mut reader = Reader { path, text: &text, faults: Vec::new() };
    let study = reader.study(document, parse);
    match (study, reader.faults) {
        (Some(study), faults) if faults.is_empty() => Ok(study),
        (_, faults) => Err(StudyError::Content(faults)),
    }
}

/// Gathers all that is wrong with a file.
struct Reader<'a> {
    path: &'a Path,
    text: &'a str,
    faults: Vec<String>,
}

impl Reader<'_> {
    fn fault(&mut self, span: Range<usize>, what: impl std::fmt::Display) {
        self.faults.push(format!("{}: {what}", place(self.path, self.text, span)));
    }

    /// The study, unless it lacks what nothing can be made of; with what is wrong it is of no use either way.
    fn study(&mut self, document: Document, parse: &ParseOptions) -> Option<Study> {
        let scenes: Vec<_> = document.scenes.into_iter().filter_map(|entry| self.scene(entry)).collect();
        let mut methods: Vec<StudyMethod> = Vec::new();
        let mut names = HashSet::new();
        for entry in &document.methods {
            if methods.len() > MOST_COMBINATIONS {
                let what = format!("there are more than {MOST_COMBINATIONS} methods, which is the most accepted");
                self.fault(entry.span(), what);
                break;
            }
            for method in self.methods(entry, &document.options, parse) {
                if !names.insert(method.name.clone()) {
                    let what = format!(
                        "two methods are called `{}`; give a `name`, with {{option}} in it where lists are varied",
                        method.name
                    );
                    self.fault(entry.span(), what);
                }
                methods.push(method);
            }
        }
        let mut names = HashSet::new();
        for scene in &scenes {
            if !names.insert(&scene.name) {
                let what = format!("two scenes are called `{}`; give one a `name`", scene.name);
                self.fault(0..0, what);
            }
        }
        let nowhere = 0..0;
        if scenes.is_empty() && self.faults.is_empty() {
            self.fault(nowhere.clone(), "there is no scene; add [[scene]] with its `file`");
        }
        if document.methods.is_empty() {
            self.fault(nowhere, "there is no method; add [[method]] with `method` = \"path\", \"mlt\" or \"re\"");
        }
        let seeds = self.seeds(document.seeds);
        let budget = self.budget(document.mpp, document.time)?;
        let snapshots = document.snapshots.map_or(SNAPSHOTS, |given| {
            if !(2..=1000).contains(given.get_ref()) {
                self.fault(given.span(), format!("`snapshots` is {}; accepted are 2 to 1000", given.get_ref()));
            }
            *given.get_ref()
        });
        let first_snapshot = self.first_snapshot(document.first_snapshot, budget);
        let baseline = match &document.baseline {
            None => 0,
            Some(name) => methods.iter().position(|method| method.name == *name.get_ref()).unwrap_or_else(|| {
                let known = methods.iter().map(|method| format!("`{}`", method.name)).collect::<Vec<_>>().join(", ");
                self.fault(name.span(), format!("no method is called `{}`; there are {known}", name.get_ref()));
                0
            }),
        };
        Some(Study {
            title: document.title,
            note: document.note,
            budget,
            seeds,
            snapshots,
            first_snapshot,
            clock: document.clock,
            excluded: document.exclude,
            baseline,
            scenes,
            methods,
            reach: Reach::default(),
            text: self.text.to_owned(),
        })
    }

    fn seeds(&mut self, seeds: Option<Spanned<Seeds>>) -> Vec<u64> {
        let Some(given) = seeds else { return (1..=SEEDS).collect() };
        let span = given.span();
        let seeds: Vec<u64> = match given.into_inner() {
            Seeds::Number(n) => (1..=n.min(MOST_SEEDS as u64 + 1)).collect(),
            Seeds::List(list) => list,
        };
        if seeds.len() > MOST_SEEDS {
            self.fault(span, format!("`seeds` are more than {MOST_SEEDS}, which is the most accepted"));
            return Vec::new();
        }
        if seeds.is_empty() {
            self.fault(span.clone(), "`seeds` are none; one at least is needed, five tell how results spread");
        }
        let mut before = HashSet::new();
        if let Some(twice) = seeds.iter().find(|seed| !before.insert(**seed)) {
            self.fault(span, format!("seed {twice} is given twice"));
        }
        seeds
    }

    fn budget(&mut self, mpp: Option<Spanned<f64>>, time: Option<Spanned<String>>) -> Option<Budget> {
        match (mpp, time) {
            (Some(mpp), None) => {
                if !(mpp.get_ref() > &0.0 && mpp.get_ref() <= &1e9) {
                    let what = format!("`mpp` is {}; accepted are numbers above 0, up to 1e9", mpp.get_ref());
                    self.fault(mpp.span(), what);
                }
                Some(Budget::Mutations(mpp.into_inner()))
            }
            (None, Some(time)) => match humantime::parse_duration(time.get_ref()) {
                Ok(duration) if !duration.is_zero() => Some(Budget::Time(duration)),
                _ => {
                    let what =
                        format!("`time` is \"{}\"; accepted are times such as \"30s\" or \"5m\"", time.get_ref());
                    self.fault(time.span(), what);
                    None
                }
            },
            (None, None) => {
                self.fault(0..0, "give `time`, such as \"30s\", or `mpp`, mutations per pixel: what each run is given");
                None
            }
            (Some(_), Some(time)) => {
                self.fault(time.span(), "give `time` or `mpp`, not both: runs are compared at equal time or mutations");
                None
            }
        }
    }

    fn first_snapshot(&mut self, first: Option<Spanned<First>>, budget: Budget) -> f64 {
        let whole = match budget {
            Budget::Time(time) => time.as_secs_f64(),
            Budget::Mutations(mpp) => mpp,
        };
        let Some(given) = first else { return whole * FIRST_SNAPSHOT };
        let span = given.span();
        let value = match (given.into_inner(), budget) {
            (First::Time(text), Budget::Time(_)) => humantime::parse_duration(&text).ok().map(|t| t.as_secs_f64()),
            (First::Mutations(mpp), Budget::Mutations(_)) => Some(mpp),
            _ => None,
        };
        match value.filter(|value| *value > 0.0 && *value < whole) {
            Some(value) => value,
            None => {
                let like = match budget {
                    Budget::Time(_) => "a time such as \"500ms\", above 0 and below `time`",
                    Budget::Mutations(_) => "a number of mutations per pixel, above 0 and below `mpp`",
                };
                self.fault(span, format!("`first-snapshot` must be {like}"));
                whole * FIRST_SNAPSHOT
            }
        }
    }

    fn scene(&mut self, entry: Spanned<SceneEntry>) -> Option<StudyScene> {
        let span = entry.span();
        let entry = entry.into_inner();
        let folder = self.path.parent().unwrap_or(Path::new(""));
        let file = tidy(&folder.join(&entry.file));
        let reference = match &entry.reference {
            Some(reference) => tidy(&folder.join(reference)),
            None => file.with_file_name("reference.exr"),
        };
        if entry.target_errors.iter().any(|error| !(*error > 0.0 && error.is_finite())) {
            self.fault(span.clone(), "`target-errors` must be above 0");
        }
        let named = file.parent().and_then(Path::file_name).or(file.file_stem());
        let name = entry.name.or_else(|| named.map(|name| name.to_string_lossy().into_owned()));
        let Some(name) = name.filter(|name| !name.is_empty()) else {
            self.fault(span, "the scene needs a `name`");
            return None;
        };
        let mut target_errors = entry.target_errors;
        target_errors.sort_by(|a, b| b.total_cmp(a));
        let mut defines = Vec::new();
        for (name, value) in &entry.define {
            match word(value) {
                Some(value) => defines.push((name.clone(), value)),
                None => self.fault(span.clone(), format!("`define.{name}` must be a number, a text or true or false")),
            }
        }
        Some(StudyScene { name, file, defines, reference, target_errors })
    }

    /// All methods that an entry stands for: one for each combination of the values in its lists.
    fn methods(&mut self, entry: &Spanned<Table>, common: &Table, parse: &ParseOptions) -> Vec<StudyMethod> {
        let (span, mut own) = (entry.span(), entry.get_ref().clone());
        let name = match own.remove("name") {
            None => None,
            Some(Value::String(name)) if !name.is_empty() => Some(name),
            Some(_) => {
                self.fault(span.clone(), "a method's `name` is a text");
                None
            }
        };
        let mut options = common.clone();
        options.extend(own);
        for name in NOT_OPTIONS.iter().filter(|name| options.contains_key(**name)) {
            self.fault(span.clone(), format!("`{name}` is no option of a method: the study sees to that"));
        }
        // the method itself stands first, the others by name
        let (first, others): (Vec<_>, Vec<_>) = options.iter().partition(|(name, _)| *name == "method");
        let axes: Option<Vec<(String, Vec<Value>)>> = first
            .into_iter()
            .chain(others)
            .map(|(name, value)| match values(name, value) {
                Some(values) => Some((name.clone(), values)),
                None => {
                    self.fault(span.clone(), format!("`{name}` must be a number, a text, true or false, or a list"));
                    None
                }
            })
            .collect();
        let Some(axes) = axes else { return Vec::new() };
        let count = axes.iter().try_fold(1usize, |count, (_, values)| count.checked_mul(values.len()));
        if count.is_none_or(|count| count > MOST_COMBINATIONS) {
            self.fault(
                span,
                format!("its lists make more than {MOST_COMBINATIONS} methods, which is the most accepted"),
            );
            return Vec::new();
        }
        let combinations = grid(&axes);
        combinations.iter().filter_map(|options| self.method(span.clone(), name.as_deref(), options, parse)).collect()
    }

    fn method(
        &mut self,
        span: Range<usize>,
        name: Option<&str>,
        options: &[Choice],
        parse: &ParseOptions,
    ) -> Option<StudyMethod> {
        let of_run = options.iter().filter(|option| !HOW.contains(&option.name.as_str()));
        let words: Vec<String> = of_run.flat_map(Choice::words).collect();
        let how = HOW.map(|name| options.iter().find(|option| option.name == name).map(|option| &option.value));
        let ranks = match how[0] {
            None => None,
            Some(Value::Integer(n)) if (1..=i64::from(MOST_RANKS)).contains(n) => Some(*n as u32),
            Some(other) => {
                self.fault(span.clone(), format!("`ranks` is {other}; accepted are 1 to {MOST_RANKS}"));
                None
            }
        };
        let per_worker = how[1].is_some_and(|value| value.as_bool() == Some(true));
        let variant: Vec<(String, String)> = options
            .iter()
            .filter(|option| option.varied)
            .map(|option| (option.name.clone(), word(&option.value).unwrap_or_default()))
            .collect();
        let chosen = options.iter().find(|option| option.name == "method").and_then(|option| word(&option.value));
        let name = full_name(name, chosen.as_deref().unwrap_or("re"), options, &variant);
        match parse(&words) {
            Ok(settings) if per_worker && settings.threads.is_none() => {
                let what = "`per-worker` wants `threads`, without which nobody knows how many workers there are";
                self.fault(span, format!("method `{name}`: {what}"));
                None
            }
            Ok(settings) => {
                let launch = Vec::new();
                Some(StudyMethod { name, options: words, launch, ranks, per_worker, variant, settings })
            }
            Err(what) => {
                let lines = what.lines().map(str::trim).filter(|line| !line.is_empty()).collect::<Vec<_>>().join("; ");
                self.fault(span, format!("method `{name}`: {lines}"));
                None
            }
        }
    }
}

/// The name with `{option}` filled in; varied options that it does not mention stand behind it.
fn full_name(name: Option<&str>, method: &str, options: &[Choice], variant: &[(String, String)]) -> String {
    let template = name.unwrap_or(method);
    let mut full = template.to_owned();
    for option in options {
        full = full.replace(&format!("{{{}}}", option.name), &word(&option.value).unwrap_or_default());
    }
    let unmentioned = variant.iter().filter(|(option, _)| !template.contains(&format!("{{{option}}}")));
    let unmentioned = unmentioned.filter(|(option, value)| !(option == "method" && value == template));
    unmentioned.fold(full, |full, (option, value)| format!("{full}, {option} {value}"))
}

impl StudyMethod {
    /// Options as results have them: those of `relt render` and how it is run.
    pub fn all_options(&self) -> Vec<String> {
        let ranks = self.ranks.iter().flat_map(|ranks| ["--ranks".to_owned(), ranks.to_string()]);
        let per_worker = self.per_worker.then(|| "--per-worker".to_owned());
        self.options.iter().cloned().chain(ranks).chain(per_worker).collect()
    }

    /// By how much the study's budget in mutations is multiplied.
    pub fn budgets(&self) -> f64 {
        match self.per_worker {
            true => (self.settings.threads.unwrap_or(1) as u64 * u64::from(self.ranks.unwrap_or(1))) as f64,
            false => 1.0,
        }
    }
}

impl StudyScene {
    /// Reads its file.
    pub fn describe(&self, reach: Reach) -> Result<SceneDescription, LoadError> {
        load::watched(&self.file, &self.defines, reach, &Watch::default())
    }
}

impl Study {
    /// Names what starts methods on ranks, with `{ranks}` where their number belongs; a fault where that is missing.
    pub fn launch_by(&mut self, launcher: Option<&str>) -> Result<(), String> {
        for method in &mut self.methods {
            let Some(ranks) = method.ranks else { continue };
            let words = launcher.unwrap_or_default().split_whitespace();
            method.launch = words.map(|word| word.replace("{ranks}", &ranks.to_string())).collect();
            if method.launch.is_empty() {
                return Err(format!(
                    "method `{}` is for {ranks} ranks: give --launch, such as --launch \"mpirun -n {{ranks}}\"",
                    method.name
                ));
            }
        }
        Ok(())
    }

    /// What each run is given, in words.
    pub fn budget_in_words(&self) -> String {
        match self.budget {
            Budget::Time(time) => format!("{} of wall time", humantime::format_duration(time)),
            Budget::Mutations(mpp) => format!("{mpp} mutations per pixel"),
        }
    }

    /// When errors are taken but for the end: in seconds or mutations per pixel, evenly spaced in the logarithm.
    pub fn snapshot_times(&self) -> Vec<f64> {
        let whole = match self.budget {
            Budget::Time(time) => time.as_secs_f64(),
            Budget::Mutations(mpp) => mpp,
        };
        let steps = (self.snapshots - 1) as f64;
        let ratio = whole / self.first_snapshot;
        (0..self.snapshots - 1).map(|i| self.first_snapshot * ratio.powf(i as f64 / steps)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::LadderChoice;

    const SCENE: &str = "[[scene]]\nfile = \"../box/scene.xml\"\n";
    const PATH: &str = "[[method]]\nmethod = \"path\"\n";

    /// Knows two options, as a command line would.
    fn parse(words: &[String]) -> Result<Settings, String> {
        let mut settings = Settings::default();
        let mut words = words.iter();
        while let Some(option) = words.next() {
            match option.as_str() {
                "--method" | "--betas" | "--threads" => drop(words.next()),
                "--kelemen-weights" => {}
                "--replicas" => {
                    let k = words.next().and_then(|k| k.parse().ok()).ok_or("a number is missing")?;
                    settings.ladder = LadderChoice::Replicas(k);
                }
                _ => return Err(format!("unexpected argument '{option}' found\n\nmore")),
            }
        }
        Ok(settings)
    }

    fn read_text(text: &str) -> Result<Study, String> {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("studies")).unwrap();
        let path = folder.path().join("studies/s.toml");
        std::fs::write(&path, text).unwrap();
        let plain = |text: String| text.replace(&format!("{}/", folder.path().display()), "");
        let mut study = read(&path, &parse).map_err(|error| plain(error.to_string()))?;
        for scene in &mut study.scenes {
            scene.file = plain(scene.file.display().to_string()).into();
            scene.reference = plain(scene.reference.display().to_string()).into();
        }
        Ok(study)
    }

    #[test]
    fn a_short_study_has_defaults() {
        let study = read_text(&format!("title = \"t\"\ntime = \"64s\"\n{SCENE}{PATH}")).unwrap();
        assert_eq!((study.seeds, study.snapshots, study.first_snapshot), (vec![1, 2, 3, 4, 5], 12, 1.0));
        assert_eq!((study.clock, study.baseline, study.excluded.len()), (Clock::Wall, 0, 0));
        let scene = &study.scenes[0];
        assert_eq!((scene.name.as_str(), scene.file.to_str()), ("box", Some("box/scene.xml")));
        assert_eq!(scene.reference.to_str(), Some("box/reference.exr"));
        assert_eq!(
            (study.methods[0].name.as_str(), &study.methods[0].options[..]),
            ("path", &["--method".into(), "path".into()][..])
        );
    }

    #[test]
    fn lists_make_a_method_of_each_combination() {
        let text = format!(
            "title = \"t\"\nmpp = 10\nseeds = [7, 9]\nbaseline = \"K = 2 on 1\"\n{SCENE}define = {{ res = 64 }}\n\
             [options]\nthreads = [1, 2]\n[[method]]\nname = \"K = {{replicas}} on {{threads}}\"\nmethod = \"re\"\n\
             replicas = [2, 4]\nkelemen-weights = true\n[[method]]\nmethod = \"re\"\nbetas = [[0, 1], [0, 0.5, 1]]\n"
        );
        let study = read_text(&text).unwrap();
        let names: Vec<_> = study.methods.iter().map(|method| method.name.as_str()).collect();
        assert_eq!(
            names[..4],
            ["K = 2 on 1", "K = 2 on 2", "K = 4 on 1", "K = 4 on 2"],
            "options in the order of their names: replicas before threads"
        );
        assert_eq!(
            names[4..],
            [
                "re, betas 0,1, threads 1",
                "re, betas 0,1, threads 2",
                "re, betas 0,0.5,1, threads 1",
                "re, betas 0,0.5,1, threads 2"
            ]
        );
        let last = &study.methods[3];
        assert_eq!(last.options.join(" "), "--method re --kelemen-weights --replicas 4 --threads 2");
        assert_eq!(last.settings.ladder, LadderChoice::Replicas(4));
        assert_eq!(last.variant, [("replicas".to_owned(), "4".to_owned()), ("threads".into(), "2".into())]);
        assert_eq!(
            (study.seeds.as_slice(), study.scenes[0].defines.as_slice()),
            (&[7, 9][..], &[("res".to_owned(), "64".to_owned())][..])
        );
        assert_eq!(study.baseline, 0);
    }

    #[test]
    fn snapshots_are_evenly_spaced_in_the_logarithm() {
        let study =
            read_text(&format!("title = \"t\"\nmpp = 1000\nfirst-snapshot = 1\nsnapshots = 4\n{SCENE}{PATH}")).unwrap();
        let times = study.snapshot_times();
        assert_eq!(times.len(), 3);
        assert!(times.iter().zip([1.0, 10.0, 100.0]).all(|(a, b)| (a - b).abs() < 1e-9), "{times:?}");
    }

    #[test]
    fn faults_are_told_with_their_place_all_in_one_go() {
        let one = |text: &str, expected: &str| {
            let message = read_text(text).unwrap_err();
            assert!(message.contains(expected), "{message}");
        };
        one("title = 3\n", "studies/s.toml:1:9: invalid type: integer `3`, expected a string");
        one(&format!("titel = \"t\"\nmpp = 1\n{SCENE}{PATH}"), "s.toml:1:1: unknown field `titel`, expected one of");
        one(&format!("title = \"t\"\n{SCENE}{PATH}"), "give `time`, such as");
        one(
            &format!("title = \"t\"\nmpp = 1\ntime = \"1s\"\n{SCENE}{PATH}"),
            "s.toml:3:8: give `time` or `mpp`, not both",
        );
        let message = read_text(&format!(
            "title = \"t\"\nmpp = -1\nseeds = []\nsnapshots = 1\nfirst-snapshot = \"1s\"\nbaseline = \"mlt\"\n{SCENE}{SCENE}\
             [[method]]\nreplicas = \"two\"\nseed = 3\n[[method]]\nwidth = 3\n[[method]]\nmethod = {{ a = 1 }}\n{PATH}{PATH}"
        ))
        .unwrap_err();
        for part in [
            "s.toml:2:7: `mpp` is -1; accepted",
            "s.toml:3:9: `seeds` are none",
            "s.toml:4:13: `snapshots` is 1; accepted are 2 to 1000",
            "`first-snapshot` must be a number of mutations",
            "s.toml:6:12: no method is called `mlt`; there are `path`",
            "two scenes are called `box`",
            "s.toml:11:1: `seed` is no option of a method",
            "method `re`: a number is missing",
            "method `re`: unexpected argument '--width' found; more",
            "`method` must be a number, a text",
            "two methods are called `path`",
        ] {
            assert!(message.contains(part), "{part:?} is not in\n{message}");
        }
    }
}
