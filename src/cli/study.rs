//! `relt study`: error against run time of many methods on many scenes, from a small file to a report.

use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

use clap::Args;

use super::display::{Display, in_words};
use super::failure::Failure;
use super::{render, signals};
use crate::film::file::{FileError, write_whole};
use crate::load::Reach;
use crate::render::{Observer, Settings, Status};
use crate::study::collect::collect;
use crate::study::file::{self, Budget, Study};
use crate::study::forecast;
use crate::study::jobs::{Prepared, StudyJob, jobs, prepare, quoted};
use crate::study::report;
use crate::study::runner::{Folder, RunError, Runner, this_program};

/// Renders scenes by methods and seeds as a study file says, and reports error against run time
#[derive(Args)]
#[command(after_help = super::EXIT_CODES)]
pub(super) struct StudyArguments {
    /// Study file, TOML, such as those in scenes/studies
    #[arg(value_name = "STUDY")]
    file: PathBuf,

    /// Folder for the report, tables, plots, runs and images; with a part of the study in it the rest is done
    /// [default: the file's name without .toml, in the current folder]
    #[arg(short, long, value_name = "FOLDER")]
    output: Option<PathBuf>,

    /// Reads files of each scene's own folder only; without, also others that the scene names plainly
    #[arg(long)]
    confine: bool,

    /// Starts runs of methods with `ranks`, such as "mpirun -n {ranks}"; a relt with the feature mpi follows
    #[arg(long, value_name = "COMMAND")]
    launch: Option<String>,

    /// Lists the runs with the time they should take, and does none
    #[arg(long)]
    dry_run: bool,

    /// Shows nothing but errors
    #[arg(short, long)]
    quiet: bool,
}

/// Runs the subcommand.
pub(super) fn run(arguments: StudyArguments) -> Result<(), Failure> {
    let mut study = file::read(&arguments.file, &parse_options).map_err(|error| match error {
        file::StudyError::Content(faults) => Failure::Input(faults),
        file::StudyError::File(error) => Failure::input(error),
    })?;
    study.launch_by(arguments.launch.as_deref()).map_err(Failure::input)?;
    study.reach = Reach::confined(arguments.confine);
    let prepared = prepare(&study).map_err(Failure::Input)?;
    let jobs = jobs(&study, &prepared);
    let output = arguments.output();
    if arguments.dry_run {
        return list(&study, &jobs, &output);
    }
    let folder = Folder::open(&output).map_err(Failure::input)?;
    folder.keep_references(&study, &prepared).map_err(Failure::running)?;
    let stop = signals::stop_flag()?;
    let runner = Runner { study: &study, prepared: &prepared, folder: &folder, program: this_program(), stop: &stop };
    let ended = work(&runner, &jobs, &Display::new(arguments.quiet));
    // what there is by now is worth a report, whatever came after
    let summary = write_report(&study, &prepared, &jobs, &folder)?;
    ended?;
    if !arguments.quiet {
        drop(writeln!(io::stdout(), "{summary}\n{}", folder.path().join(REPORT).display()));
    }
    Ok(())
}

/// The page.
const REPORT: &str = "report.html";

impl StudyArguments {
    fn output(&self) -> PathBuf {
        self.output.clone().unwrap_or_else(|| {
            let name = self.file.file_stem().filter(|_| self.file.extension().is_some());
            let name = name.map(|name| name.to_owned()).unwrap_or_else(|| "study".into());
            PathBuf::from(name)
        })
    }
}

/// From options of a method to settings, by the command line of `relt render` itself.
fn parse_options(words: &[String]) -> Result<Settings, String> {
    let line = ["scene.xml".to_owned()].into_iter().chain(words.iter().cloned());
    render::Render::of_words(line)?.settings(None).map_err(|failure| failure.plain())
}

/// All runs that are not finished yet.
fn work(runner: &Runner, jobs: &[StudyJob], display: &Display) -> Result<(), Failure> {
    let left: Vec<&StudyJob> = jobs.iter().filter(|job| !runner.is_done(job)).collect();
    let finished = jobs.len() - left.len();
    if finished > 0 {
        display.say(&format!("{finished} of {} runs are finished already", jobs.len()));
    }
    let mut pace = Pace::default();
    for (i, job) in left.iter().enumerate() {
        let what = name(runner.study, job);
        let number = finished + i + 1;
        let heading = format!("{number}/{} {what}", jobs.len());
        let coming = pace.time_of(runner.study, &left[i + 1..]);
        let begin = Instant::now();
        let line = Line { display, heading: &heading, coming, stop: runner.stop };
        match runner.run(job, &line) {
            Ok(()) => {
                pace.took(job, begin.elapsed());
                display.done(&format!("{heading}: {:.1} s", begin.elapsed().as_secs_f64()));
            }
            Err(RunError::Stopped) => {
                return Err(Failure::Interrupted("the same command goes on where this one stopped".into()));
            }
            Err(RunError::Failed(reason)) => return Err(Failure::running(format_args!("{what}: {reason}"))),
        }
    }
    Ok(())
}

fn name(study: &Study, job: &StudyJob) -> String {
    let (scene, method) = (&study.scenes[job.scene].name, &study.methods[job.method].name);
    format!("{scene}, {method}, seed {}", job.seed)
}

/// How long runs take, from those that are done.
#[derive(Default)]
struct Pace {
    done: Vec<(usize, usize, Duration)>,
}

impl Pace {
    fn took(&mut self, job: &StudyJob, time: Duration) {
        self.done.push((job.scene, job.method, time));
    }

    /// Time of some runs: as those of the same scene and method took, else of the same scene, else as all did; unknown
    /// before any is done, unless time is what runs are given.
    fn time_of(&self, study: &Study, jobs: &[&StudyJob]) -> Option<Duration> {
        let mean = |like: &dyn Fn(&(usize, usize, Duration)) -> bool| {
            let times: Vec<Duration> = self.done.iter().filter(|done| like(done)).map(|(_, _, time)| *time).collect();
            (!times.is_empty()).then(|| times.iter().sum::<Duration>() / times.len() as u32)
        };
        let given = match study.budget {
            Budget::Time(time) => Some(time),
            Budget::Mutations(_) => None,
        };
        let time = |job: &&StudyJob| {
            mean(&|(scene, method, _)| (*scene, *method) == (job.scene, job.method))
                .or_else(|| mean(&|(scene, ..)| *scene == job.scene))
                .or_else(|| mean(&|_| true))
                .or(given)
        };
        jobs.iter().map(time).sum()
    }
}

/// Writes the page and all that goes beside it; returns the summary.
fn write_report(study: &Study, prepared: &[Prepared], jobs: &[StudyJob], folder: &Folder) -> Result<String, Failure> {
    let command = std::env::args().skip(1).map(|word| quoted(&word)).fold("relt".to_owned(), |a, b| a + " " + &b);
    let results = collect(study, prepared, jobs, folder, &command).map_err(Failure::running)?;
    let path = folder.path();
    report::write(&results, path).map_err(Failure::running)?;
    let folders = ["plots", "pictures"];
    for folder in folders.map(|name| path.join(name)) {
        std::fs::create_dir_all(&folder).map_err(|error| Failure::running(FileError::write(&folder, error)))?;
    }
    let tables = [("results.csv".to_owned(), report::csv(&results)), ("study.toml".into(), study.text.clone())];
    let plots = report::plots(&results).into_iter().map(|(name, svg)| (format!("plots/{name}"), svg));
    let texts = plots.chain(tables).map(|(name, text)| (name, text.into_bytes()));
    let pictures = report::images(&results).into_iter().map(|(name, png)| (format!("pictures/{name}"), png));
    for (name, bytes) in texts.chain(pictures) {
        write_whole(&path.join(name), |file| file.write_all(&bytes).map_err(|error| error.to_string()))
            .map_err(Failure::running)?;
    }
    Ok(report::text(&results))
}

/// The runs and the time they should take.
fn list(study: &Study, jobs: &[StudyJob], folder: &Path) -> Result<(), Failure> {
    let is_done = |job: &StudyJob| job.record(folder).is_file();
    let left: Vec<&StudyJob> = jobs.iter().filter(|job| !is_done(job)).collect();
    let times = forecast::times(study, &left).map_err(Failure::running)?;
    let mut text = String::new();
    let mut forecasts = times.iter();
    for (number, job) in (1..).zip(jobs) {
        let time = match is_done(job) {
            true => "finished".to_owned(),
            false => in_words(*forecasts.next().expect("one for each run that is left")),
        };
        text += &format!("{number:4}  {time:>9}  {}\n      {}\n", name(study, job), job.command(study));
    }
    let all: Duration = times.iter().sum();
    text += &format!(
        "{} runs, {} of them finished; the others take about {}\n",
        jobs.len(),
        jobs.len() - left.len(),
        in_words(all)
    );
    drop(write!(io::stdout(), "{text}")); // whoever reads may have read enough
    Ok(())
}

/// Shows the run at work.
struct Line<'a> {
    display: &'a Display,
    heading: &'a str,
    /// Time of the runs that come after it.
    coming: Option<Duration>,
    stop: &'a AtomicBool,
}

impl Observer for Line<'_> {
    fn progress(&self, status: &Status) {
        if !matches!(self.display, Display::Terminal(_)) {
            return;
        }
        let left = self
            .coming
            .zip(status.time_left())
            .map(|(coming, now)| format!("\n{} left in all", in_words(coming + now)));
        let stopping = if self.stop.load(Relaxed) { ", stopping" } else { "" };
        let words = format!("{}{stopping}{}", self.heading, left.unwrap_or_default());
        self.display.show(status.fraction(), words);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::Method;

    #[test]
    fn methods_of_a_study_speak_the_language_of_render() {
        let words = |text: &str| text.split(' ').map(str::to_owned).collect::<Vec<_>>();
        let settings = parse_options(&words("--method mlt --large-steps 0.5 --kelemen-weights")).unwrap();
        assert_eq!((settings.method, settings.mlt.large_steps, settings.mlt.kelemen_weights), (Method::Mlt, 0.5, true));
        let message = parse_options(&words("--method mtl")).unwrap_err();
        assert!(message.starts_with("invalid value 'mtl' for '--method") && !message.contains("Usage"), "{message}");
        let message = parse_options(&words("--method path --replicas 2")).unwrap_err();
        assert!(message.starts_with("--replicas: --method path has no ladder"), "{message}");
    }

    #[test]
    fn studies_that_ship_can_be_run() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/studies");
        let mut studies = 0;
        for entry in std::fs::read_dir(folder).unwrap() {
            let study = file::read(&entry.unwrap().path(), &parse_options).unwrap_or_else(|error| panic!("{error}"));
            let prepared = prepare(&study).unwrap_or_else(|faults| panic!("{faults:?}"));
            assert_eq!(jobs(&study, &prepared).len(), study.scenes.len() * study.methods.len() * study.seeds.len());
            studies += 1;
        }
        assert!(studies >= 4);
    }

    #[test]
    fn times_left_are_those_of_runs_alike() {
        let job = |scene, method| StudyJob { scene, method, seed: 1, id: String::new() };
        let [a, b, c] = [job(0, 0), job(0, 1), job(1, 0)];
        let text = "title = \"t\"\nmpp = 1\n[[scene]]\nfile = \"a/b.xml\"\n[[method]]\nmethod = \"re\"\n";
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("s.toml");
        std::fs::write(&path, text).unwrap();
        let study = file::read(&path, &parse_options).unwrap();
        let mut pace = Pace::default();
        assert_eq!(pace.time_of(&study, &[&a]), None);
        pace.took(&a, Duration::from_secs(4));
        pace.took(&a, Duration::from_secs(6));
        pace.took(&c, Duration::from_secs(20));
        assert_eq!(pace.time_of(&study, &[&a, &b, &c]), Some(Duration::from_secs(30)));
    }
}
