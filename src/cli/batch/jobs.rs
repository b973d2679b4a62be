//! From entries of a job file to runs, and what makes a list of them impossible.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf, absolute};

use super::super::failure::Failure;
use super::super::render::{self, Render};
use crate::batch::file::{self, BatchError, Entry, Known};
use crate::batch::queue::Standing;
use crate::batch::summary::Line;
use crate::checksum::Checksum;
use crate::render::{Output, PacketChoice, Settings};
use crate::study::jobs::quoted;
use crate::study::words::tidy;

/// A job that can be run.
pub(super) struct BatchJob {
    /// Its number in the order of the file, from 1.
    pub number: usize,
    pub entry: Entry,
    pub settings: Settings,
    /// Number of all that the image depends on, in hexadecimal digits, as far as it can be had without reading meshes and
    /// textures: options, parameters, the text of the scene file, the version of relt.
    pub digest: String,
    /// Where its checkpoints go, if there are to be any.
    pub keep: Option<PathBuf>,
}

/// Options that the batch itself sees to, or that have no meaning in it.
const NOT_OPTIONS: [&str; 9] = ["help", "version", "define", "output", "resume", "part", "quiet", "verbose", "confine"];

/// Reads a file of jobs; everything that is wrong with it, or with jobs that would write one another's files or those that
/// are `taken`. Where they are to be confined, scenes are read from their own folders only.
pub(super) fn read(path: &Path, taken: &[&Path], confine: bool) -> Result<Vec<BatchJob>, Failure> {
    let options = render::options().into_iter().filter(|(name, _)| !NOT_OPTIONS.contains(&name.as_str()));
    let known: Vec<Known> = options.map(|(name, is_flag)| Known { name, is_flag }).collect();
    let mut entries = file::read(path, &known).map_err(|error| match error {
        BatchError::Content(faults) => Failure::Input(faults),
        BatchError::File(error) => Failure::input(error),
    })?;
    if confine {
        entries.iter_mut().for_each(|entry| entry.options.push("--confine".into()));
    }
    let place = |path: &Path| tidy(&absolute(path).unwrap_or_else(|_| path.to_owned()));
    let mut written: BTreeMap<PathBuf, String> =
        taken.iter().map(|path| (place(path), "the batch itself needs it".into())).collect();
    for entry in &entries {
        written.insert(place(&entry.scene), "that is a scene".into());
    }
    let mut texts = BTreeMap::new();
    let (mut jobs, mut faults) = (Vec::new(), Vec::new());
    for (number, entry) in (1..).zip(entries) {
        let text = texts.entry(entry.scene.clone()).or_insert_with(|| fs::read(&entry.scene).unwrap_or_default());
        match BatchJob::new(number, entry, text) {
            Err(fault) => faults.push(fault),
            Ok((job, files)) => {
                let Entry { name, place: line, .. } = &job.entry;
                for file in files {
                    if let Some(why) = written.get(&place(&file)) {
                        faults.push(format!("{line}: {name} would write {}: {why}", file.display()));
                    }
                    let why = format!("{name} ({line}) does; put what differs into the names, such as {{seed}}");
                    written.entry(place(&file)).or_insert(why);
                }
                jobs.push(job);
            }
        }
    }
    faults.dedup();
    if faults.is_empty() { Ok(jobs) } else { Err(Failure::Input(faults)) }
}

impl BatchJob {
    /// The job with the files that it writes, or what is wrong with it.
    fn new(number: usize, entry: Entry, scene_text: &[u8]) -> Result<(BatchJob, Vec<PathBuf>), String> {
        let fault = |what: String| {
            let lines: Vec<&str> = what.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
            format!("{}: {}: {}", entry.place, entry.name, lines.join("; "))
        };
        let arguments = Render::of_words(words(&entry, false)).map_err(fault)?;
        let settings = arguments.settings(None).map_err(|failure| fault(failure.plain()))?;
        let digest = digest(&entry, &settings, arguments.strict, scene_text);
        let images = Output::new(&entry.output).map_err(fault)?.files();
        let keep = arguments.keep();
        let files = images.into_iter().chain(arguments.log).chain(keep.clone()).collect();
        Ok((BatchJob { number, settings, digest, keep, entry }, files))
    }

    /// The run that it is, going on from its checkpoint or from the beginning.
    pub fn arguments(&self, goes_on: bool) -> Result<Render, Failure> {
        Render::of_words(words(&self.entry, goes_on && self.keep.is_some())).map_err(Failure::input)
    }

    /// What its scene is read from.
    pub fn scene_key(&self) -> (&Path, &[(String, String)]) {
        (&self.entry.scene, &self.entry.defines)
    }

    /// A command that makes the same image.
    pub fn command(&self) -> String {
        let words = words(&self.entry, false).into_iter().filter(|word| word != "--");
        words.fold("relt render".into(), |command, word| command + " " + &quoted(&word))
    }

    /// Its line of the summary.
    pub fn line(&self, standing: Option<Standing>) -> Line {
        let Entry { scene_name, defines, name, .. } = &self.entry;
        let defines = defines.iter().map(|(name, value)| format!(" -D {}", quoted(&format!("{name}={value}"))));
        let scene = quoted(scene_name) + &defines.collect::<String>();
        Line { number: self.number, scene, output: name.clone(), standing }
    }
}

/// Words of the command line of `relt render`.
fn words(entry: &Entry, goes_on: bool) -> Vec<String> {
    let defines = entry.defines.iter().flat_map(|(name, value)| ["-D".to_owned(), format!("{name}={value}")]);
    let mut words: Vec<String> = defines.chain(entry.options.iter().cloned()).collect();
    words.push(format!("--output={}", entry.output.display()));
    if goes_on {
        words.push("--resume=auto".into());
    }
    words.extend(["--".into(), entry.scene.display().to_string()]);
    words
}

fn digest(entry: &Entry, settings: &Settings, strict: bool, scene_text: &[u8]) -> String {
    // what changes no bit of the image may differ
    let settings = Settings { threads: None, pin: false, packet: PacketChoice::Auto, ..settings.clone() };
    let mut checksum = Checksum::default();
    let parts = (env!("CARGO_PKG_VERSION"), &entry.scene_name, &entry.defines, &settings, strict);
    write!(checksum, "{parts:?}").expect("checksums take all");
    checksum.add(scene_text);
    format!("{:08x}", checksum.finish())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_text(text: &str) -> Result<Vec<BatchJob>, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("j.toml");
        fs::write(&path, text).unwrap();
        let plain = |text: String| text.replace(&format!("{}/", folder.path().display()), "");
        read(&path, &[&path], false).map_err(|failure| plain(failure.plain()))
    }

    #[test]
    fn every_option_of_a_job_is_one_of_render() {
        let text = "[defaults]\nscene = \"s.xml\"\n[[job]]\noutput = \"a.exr\"\nmethod = \"mlt\"\n\
                    kelemen-weights = true\nlarge-steps = 0.5\ntime = \"5s\"\nparts = 2\nsnapshot = \"1s\"\n\
                    checkpoint = \"5m\"\ndefine.a = -1\n";
        let jobs = read_text(text).unwrap_or_else(|faults| panic!("{faults}"));
        assert!(jobs[0].settings.mlt.kelemen_weights && jobs[0].settings.parts.of == 2);
        assert!(jobs[0].keep.as_ref().is_some_and(|keep| keep.ends_with("a.checkpoint")));
        assert!(jobs[0].command().starts_with("relt render -D a=-1 --method=mlt --kelemen-weights"));
        for (more, what) in [
            ("mpp = 0", "j.toml:1:1: a.exr: --mpp 0: the number of mutations per pixel must be above 0"),
            ("mpp = \"many\"", "a.exr: invalid value 'many' for '--mpp"),
            ("part = \"1/2\"", "unknown key `part`"),
            ("resume = \"auto\"", "unknown key `resume`"),
            ("replicas = 2\nmethod = \"path\"", "--method path has no ladder"),
        ] {
            let faults = read_text(&format!("[[job]]\nscene = \"s.xml\"\noutput = \"a.exr\"\n{more}\n"));
            let faults = faults.err().expect(more);
            assert!(faults.contains(what), "{more}: {faults}");
        }
    }

    #[test]
    fn jobs_that_would_write_one_file_are_refused() {
        for (first, second, what) in [
            (
                "output = \"a.exr\"\nseed = [1, 2]",
                "output = \"b.exr\"",
                "a.exr would write a.exr: a.exr (j.toml:3:1) does",
            ),
            ("output = \"x/../a.exr\"", "output = \"a.png\"", "a.png would write a.png: a.exr (j.toml:3:1) does"),
            ("output = \"a.exr\"\nlog = \"l\"", "output = \"b.exr\"\nlog = \"l\"", "b.exr would write l"),
            ("output = \"a.exr\"\ncheckpoint = \"1m\"", "output = \"a.png\"\ncheckpoint = \"1m\"", "a.checkpoint"),
            ("output = \"a.exr\"\nlog = \"j.toml\"", "output = \"b.exr\"", "the batch itself needs it"),
            ("output = \"a.exr\"\nlog = \"s.xml\"", "output = \"b.exr\"", "that is a scene"),
            ("output = \"a.jpg\"", "output = \"b.exr\"", "supported are .exr"),
        ] {
            let text = format!("[defaults]\nscene = \"s.xml\"\n[[job]]\n{first}\n[[job]]\n{second}\n");
            let faults = read_text(&text).err().expect(first);
            assert!(faults.contains(what), "{first}, {second}: {faults}");
        }
    }

    #[test]
    fn jobs_are_others_when_their_images_would_be() {
        let digest = |more: &str| {
            let text = format!("[[job]]\nscene = \"s.xml\"\noutput = \"a.exr\"\n{more}\n");
            read_text(&text).unwrap_or_else(|faults| panic!("{faults}"))[0].digest.clone()
        };
        let plain = digest("");
        for same in ["threads = 1", "packet = 8", "log = \"l\"", "mpp = 64.0", "checkpoint = \"1m\""] {
            assert_eq!(digest(same), plain, "{same}");
        }
        for other in ["seed = 1", "mpp = 65", "define.a = 1", "layers = true", "parts = 2", "strict = true"] {
            assert_ne!(digest(other), plain, "{other}");
        }
    }
}
