//! `relt batch`: many jobs from a file, one scene after another, with a queue that survives whatever happens.

mod jobs;
mod runner;
mod scenes;

use std::collections::BTreeSet;
use std::io::{self, Write};
use std::path::PathBuf;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Instant;

use clap::Args;

use self::jobs::BatchJob;
use self::runner::Runner;
use super::display::{Display, in_words};
use super::failure::Failure;
use super::signals;
use crate::batch::queue::{self, Event, Queue, Standing, Standings};
use crate::batch::summary::{self, Line};
use crate::film::file::write_whole;

/// Renders all jobs of a file: scenes, frames, and sweeps over options and parameters of scenes
///
/// The file is TOML, with a table `defaults` and one `job` for each image or each list of values, or CSV with a row for each
/// image; keys are the options of relt render. What happened to each job is kept in JOBS.queue, and the same command goes on
/// where it was stopped or killed. A job that fails keeps no other from being done
#[derive(Args)]
#[command(after_help = super::EXIT_CODES)]
pub(super) struct Batch {
    /// Job file, .toml or .csv
    #[arg(value_name = "JOBS")]
    file: PathBuf,

    /// Tries again the jobs that failed before, too
    #[arg(long)]
    retry_failed: bool,

    /// Jobs that render at once, each with as many threads as its job says; beside them the next one is prepared and the last
    /// one written
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1024))]
    at_once: u32,

    /// Renders in the order of the file, instead of all jobs of a scene one after another
    #[arg(long)]
    keep_order: bool,

    /// Reads files of each scene's own folder only; without, also others that the scene names plainly
    #[arg(long)]
    confine: bool,

    /// Table of all jobs to write, CSV [default: the job file's name with .summary.csv]
    #[arg(long, value_name = "FILE")]
    summary: Option<PathBuf>,

    /// Lists the jobs and where they stand, and does none
    #[arg(long, visible_alias = "list")]
    dry_run: bool,

    /// Shows nothing but errors
    #[arg(short, long)]
    quiet: bool,
}

/// Runs the subcommand.
pub(super) fn run(arguments: Batch) -> Result<(), Failure> {
    let begin = Instant::now();
    let (queue_path, summary_path) = (Queue::path_of(&arguments.file), arguments.summary_path());
    let jobs = jobs::read(&arguments.file, &[&arguments.file, &queue_path, &summary_path], arguments.confine)?;
    if arguments.dry_run {
        let (standings, _) = queue::read(&queue_path).map_err(Failure::input)?;
        list(&jobs, &standings);
        return Ok(());
    }
    let one_by_one = jobs.iter().any(|job| job.settings.time.is_some());
    if one_by_one && arguments.at_once > 1 {
        return Err(Failure::input("--at-once: a job has a budget in time, which jobs at work at once would share"));
    }
    let (queue, standings) = Queue::open(&queue_path).map_err(Failure::input)?;
    let stop = signals::stop_flag()?;
    let display = Display::new(arguments.quiet);
    let due = due(&jobs, &standings, &arguments, &display);
    if one_by_one && due.len() > 1 {
        display.say("a job has a budget in time: one job after another, and nothing beside them");
    }
    let runner = Runner::new(&jobs, due, arguments.at_once as usize, &queue, standings, &display, &stop);
    let rendering = runner.run(one_by_one)?;

    let lines: Vec<Line> = jobs.iter().map(|job| job.line(runner.standing(job))).collect();
    let table = summary::csv(&lines);
    let written = write_whole(&summary_path, |file| file.write_all(table.as_bytes()).map_err(|e| e.to_string()));
    display.finish();
    if !arguments.quiet {
        let [whole, rendering] = [begin.elapsed(), rendering].map(|time| time.as_secs_f64());
        let share = match arguments.at_once {
            1 if whole > 0.0 => format!(" ({:.1} %)", 100.0 * rendering / whole),
            _ => String::new(),
        };
        let text = summary::text(&lines);
        // whoever reads may have read enough
        drop(writeln!(io::stdout(), "{text}{}; {whole:.2} s, {rendering:.2} s of rendering{share}", totals(&lines)));
    }
    written.map_err(Failure::running)?;
    let failed: Vec<&Line> = lines.iter().filter(|line| line.failure().is_some()).collect();
    if stop.load(Relaxed) && lines.iter().any(|line| !matches!(line.status(), "done" | "failed")) {
        return Err(Failure::Interrupted("the same command goes on where this one stopped".into()));
    }
    match failed.len() {
        0 => Ok(()),
        failed => {
            Err(Failure::running(format_args!("{failed} of {} jobs failed; --retry-failed tries again", lines.len())))
        }
    }
}

impl Batch {
    fn summary_path(&self) -> PathBuf {
        self.summary.clone().unwrap_or_else(|| {
            let mut name = self.file.as_os_str().to_owned();
            name.push(".summary.csv");
            name.into()
        })
    }
}

/// `100 jobs: 98 done, 2 failed`
fn totals(lines: &[Line]) -> String {
    let words = ["done", "failed", "interrupted", "begun", "waiting"].into_iter().filter_map(|status| {
        let count = lines.iter().filter(|line| line.status() == status).count();
        (count > 0).then(|| format!("{count} {status}"))
    });
    format!("{} jobs: {}", lines.len(), words.collect::<Vec<_>>().join(", "))
}

/// What is to be done about a job.
enum Verdict {
    Finished,
    /// It failed before, and is not tried again.
    GivenUp,
    /// It is due, for a reason worth telling if there is one.
    Due(Option<&'static str>),
}

fn verdict(job: &BatchJob, standing: Option<&Standing>, retry_failed: bool) -> Verdict {
    match standing {
        None => Verdict::Due(None),
        Some(standing) if standing.digest != job.digest => Verdict::Due(Some("changed, so it is rendered anew")),
        Some(standing) => match standing.last {
            Event::Done(_) if job.entry.output.is_file() => Verdict::Finished,
            Event::Done(_) => Verdict::Due(Some("its image is gone, so it is rendered anew")),
            Event::Failed { .. } if retry_failed => Verdict::Due(Some("it failed before and is tried again")),
            Event::Failed { .. } => Verdict::GivenUp,
            Event::Begun | Event::Interrupted => Verdict::Due(None),
        },
    }
}

/// The jobs that are to be done, by index, in the order in which they are; tells of the others.
fn due(jobs: &[BatchJob], standings: &Standings, arguments: &Batch, display: &Display) -> Vec<usize> {
    let (mut finished, mut given_up) = (0, 0);
    let mut due = Vec::new();
    for (index, job) in jobs.iter().enumerate() {
        match verdict(job, standings.get(&job.entry.name), arguments.retry_failed) {
            Verdict::Finished => finished += 1,
            Verdict::GivenUp => given_up += 1,
            Verdict::Due(reason) => {
                reason.iter().for_each(|reason| display.say(&format!("{}: {reason}", job.entry.name)));
                due.push(index);
            }
        }
    }
    if finished > 0 {
        display.say(&format!("{finished} of {} jobs are finished already", jobs.len()));
    }
    if given_up > 0 {
        display.say(&format!("{given_up} of {} jobs failed before; --retry-failed tries them again", jobs.len()));
    }
    let known: BTreeSet<&str> = jobs.iter().map(|job| job.entry.name.as_str()).collect();
    let strangers = standings.keys().filter(|name| !known.contains(name.as_str())).count();
    if strangers > 0 {
        display.say(&format!("{strangers} images of the queue are no longer in the job file"));
    }
    if !arguments.keep_order {
        let group = |index: &usize| jobs.iter().position(|job| job.scene_key() == jobs[*index].scene_key());
        due.sort_by_cached_key(group);
    }
    due
}

/// All jobs with where they stand and the command that does the same.
fn list(jobs: &[BatchJob], standings: &Standings) {
    let mut text = String::new();
    for job in jobs {
        let state = match verdict(job, standings.get(&job.entry.name), false) {
            Verdict::Finished => "done",
            Verdict::GivenUp => "failed",
            Verdict::Due(Some(_)) => "anew",
            Verdict::Due(None) => "waiting",
        };
        text += &format!("{:5}  {state:7}  {}\n       {}\n", job.number, job.entry.name, job.command());
    }
    let scenes: BTreeSet<_> = jobs.iter().map(BatchJob::scene_key).collect();
    text += &format!("{} jobs on {} scenes\n", jobs.len(), scenes.len());
    drop(write!(io::stdout(), "{text}")); // whoever reads may have read enough
}

/// `12/100 jobs, 1 failed, 37 s left`
fn progress_in_words(done: usize, failed: usize, all: usize, part: f64, begin: Instant) -> String {
    let failed = if failed > 0 { format!(", {failed} failed") } else { String::new() };
    let left = (part > 0.0 && part < 1.0).then(|| begin.elapsed().mul_f64((1.0 - part) / part));
    let left = left.map_or(String::new(), |left| format!(", about {} left", in_words(left)));
    format!("{done}/{all} jobs{failed}{left}")
}
