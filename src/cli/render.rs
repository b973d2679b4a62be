//! `relt render`: from a scene file to an image.

use std::path::{Path, PathBuf, absolute};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use clap::{Arg, ArgAction, Args, CommandFactory, Parser};

use super::failure::Failure;
use super::run_options::RunOptions;
use super::scene::{Opened, SceneArguments, number_of_threads};
use super::{signals, values};
use crate::film::file::{Claim, check_writable, claim, write_somewhere};
use crate::ranks::{self, Company, Talk};
use crate::render::log::{self, Log};
use crate::render::memory::{self, FilmMemory};
use crate::render::progress::{Progress, Teller, Verbosity};
use crate::render::{
    self, Checkpoint, Health, Job, Observer, Outcome, Output, PacketChoice, Parts, Picture, Resumed, RunStart,
    Settings, Status, Summary, Verdict, allocation, checkpoint, replay,
};
use crate::scene::description::FilmDescription;
use crate::tempering::RoundReport;

/// Renders a scene to an OpenEXR image with a PNG preview
#[derive(Args)]
#[command(after_help = super::EXIT_CODES)]
pub(super) struct Render {
    #[command(flatten)]
    pub(super) scene: SceneArguments,

    #[command(flatten)]
    run: RunOptions,

    /// Image to write: .exr (32-bit floats, with a .png preview beside it) or .png (preview only)
    /// [default: the scene's folder's name with .exr, in the current folder]
    #[arg(short, long, value_name = "FILE", help_heading = "Files")]
    output: Option<PathBuf>,

    /// Writes the image so far at this interval, such as 10s
    #[arg(long, value_name = "TIME", value_parser = values::interval, allow_hyphen_values = true, help_heading = "Files")]
    snapshot: Option<Duration>,

    /// Writes a log, one JSON object a line; with --resume it goes on in the file that is there
    #[arg(long, value_name = "FILE", help_heading = "Files")]
    pub(super) log: Option<PathBuf>,

    /// Ends with exit code 3 where the picture cannot be trusted (verdict bad); it is written all the same
    #[arg(long, help_heading = "Files")]
    pub(super) strict: bool,

    /// Writes all that it takes to go on later, at this interval, such as 5m, on SIGUSR1, and at the end, early or not
    #[arg(long, value_name = "TIME", value_parser = values::interval, allow_hyphen_values = true, help_heading = "Files")]
    checkpoint: Option<Duration>,

    /// Where that goes; alone, it is written on SIGUSR1 and at the end only [default: the image's name with .checkpoint, or
    /// the file that --resume names]
    #[arg(long, value_name = "FILE", help_heading = "Files")]
    checkpoint_file: Option<PathBuf>,

    /// Goes on from a checkpoint, with its settings; budgets are those of the whole run. auto: from the file that
    /// --checkpoint writes, or from the beginning where there is none yet
    #[arg(long, value_name = "FILE", help_heading = "Files")]
    resume: Option<PathBuf>,

    /// Shows nothing but errors
    #[arg(short, long, help_heading = "Files")]
    quiet: bool,

    /// Shows a table of the rounds of --method re: barrier, swaps, round trips, normalisation, and what was chosen
    #[arg(short, long, help_heading = "Files")]
    verbose: bool,

    /// Adds to the .exr of --method re the images of the uniform and the coldest replica, and each rung's part
    #[arg(long, help_heading = "Files")]
    layers: bool,

    /// Renders one of N independent parts of the job, each with its own random numbers and 1/N of --mpp, into a file that
    /// relt merge makes the image of; slurm: the task of a SLURM job array that this process is; slurm/N, hq/N, auto/N: the
    /// part with the number of the task of SLURM, of HyperQueue, of either
    #[arg(long, value_name = "I/N", value_parser = values::part, allow_hyphen_values = true, help_heading = "Parts")]
    part: Option<values::Part>,

    /// Renders all of N independent parts and makes one image of them, the same that relt merge would
    #[arg(long, value_name = "N", allow_negative_numbers = true, help_heading = "Parts")]
    parts: Option<u32>,

    /// Keeps every worker thread on a core of its own
    #[arg(long, help_heading = "Machine")]
    pin: bool,

    /// Rays that go to Embree at a time; auto measures at start; the image does not depend on it
    #[arg(long, value_name = "RAYS", default_value = "auto", value_parser = values::packet(), help_heading = "Machine")]
    packet: PacketChoice,
}

/// Memory of a film from which on it is told at the start.
const WORTH_TELLING: u64 = 1 << 30;

/// Runs the subcommand.
pub(super) fn run(arguments: Render) -> Result<(), Failure> {
    if let Some(count) = ranks::out_of_reach().filter(|_| arguments.part.is_none()) {
        return Err(Failure::input(format_args!(
            "this is one of {count} processes of MPI, and relt is built without the feature mpi: all would make the same \
             image; build it with cargo build --release --features mpi, or give each a --part"
        )));
    }
    let company = Company::of_processes();
    let done = on_ranks(arguments, company.clone());
    if let (Err(failure), Some(company)) = (&done, &company) {
        eprint!("{failure}");
        company.abort(failure.number().into());
    }
    done
}

/// The run, together with other ranks where there are any.
fn on_ranks(mut arguments: Render, company: Option<Arc<Company>>) -> Result<(), Failure> {
    if company.as_ref().is_some_and(|company| !company.is_first()) {
        arguments.quieten();
    }
    let (verbosity, strict) = (arguments.verbosity(), arguments.strict);
    let planned = arguments.plan(company)?;
    // from now on, also while the scene is read, the signal is no longer the end
    let asked = planned.keep.as_ref().map(|_| signals::checkpoint_flag()).transpose()?;
    let (threads, quiet) = (planned.settings.threads, verbosity == Verbosity::Quiet);
    let description = planned.arguments.scene.describe(threads, quiet)?;
    let scene_digest = if planned.is_kept() { checkpoint::scene_digest(&description) } else { String::new() };
    planned.fits(&description.film, &scene_digest)?;
    let opened = Opened::of(description, threads, quiet)?;
    let stop = signals::stop_flag()?;
    let progress = Progress::new(verbosity, stop.clone());
    let Some(rendered) = planned.render(&opened, &scene_digest, asked, &stop, &progress)? else { return Ok(()) };
    let summary = rendered.finish()?;
    strict.then(|| untrusted(&summary.health)).flatten().map_or(Ok(()), Err)
}

/// A run of which all is known but the scene. Its files are nobody else's as long as this lives.
pub(super) struct Planned {
    pub arguments: Render,
    /// Where checkpoints go, if there are to be any.
    pub keep: Option<PathBuf>,
    resumed: Option<Resumed>,
    /// What the person should know of that checkpoint.
    told: Option<String>,
    pub settings: Settings,
    output: Output,
    /// The ranks that do it together, where there are others.
    company: Option<Arc<Company>>,
    _claims: Vec<Claim>,
}

/// A run that is over, with files yet to be written.
pub(super) struct Rendered<'a> {
    pub outcome: Outcome,
    audience: Audience<'a>,
    is_part: bool,
    /// What was known before it began.
    warnings: Vec<String>,
    _claims: Vec<Claim>,
}

impl Planned {
    /// Whether the run leaves a checkpoint, goes on from one or has company, so that its scene must be told from others.
    pub fn is_kept(&self) -> bool {
        self.keep.is_some() || self.resumed.is_some() || self.company.is_some()
    }

    /// That the scene's film has room, and that the scene is that of the checkpoint.
    pub fn fits(&self, film: &FilmDescription, scene_digest: &str) -> Result<(), Failure> {
        let memory = FilmMemory::of(film, &self.settings);
        if let Some(fault) = memory::available().and_then(|available| memory.fault(available)) {
            return Err(Failure::input(fault));
        }
        let threads = number_of_threads(self.settings.threads);
        if let Some(fault) = memory::space_left().and_then(|left| memory.fault_of_space(threads, left)) {
            return Err(Failure::input(fault));
        }
        self.resumed.iter().try_for_each(|resumed| resumed.agrees(scene_digest, &self.settings)).map_err(Failure::input)
    }

    /// Renders. `asked` is raised when a signal asks for a checkpoint, `stop` to end the run early. Nothing comes of it on
    /// other ranks than the first.
    pub fn render<'a>(
        self,
        opened: &'a Opened,
        scene_digest: &str,
        asked: Option<Arc<AtomicBool>>,
        stop: &AtomicBool,
        progress: &'a dyn Teller,
    ) -> Result<Option<Rendered<'a>>, Failure> {
        let Planned { arguments, keep, resumed, told, settings, output, company, _claims } = self;
        let is_part = settings.parts.only.is_some();
        let done = resumed.as_ref().map(|resumed| resumed.header.done.clone());
        let log = arguments.log.as_deref().map(|path| match &done {
            Some(done) => Log::resume(path, done.mutations, done.elapsed),
            None => Log::create(path),
        });
        let log = log.transpose().map_err(Failure::input)?;
        let arithmetic = resumed.as_ref().map(|resumed| elsewhere(resumed, opened)).transpose()?.flatten();
        let memory = FilmMemory::of(&opened.scene.film, &settings);
        if memory.most >= WORTH_TELLING {
            progress.say(&format!("film: {}", memory.in_words()));
        }
        if let Some(values::Part { parts, by: Some(by) }) = &arguments.part {
            progress.say(&format!("{} by {by}", parts.in_words().unwrap_or_default()));
        }
        for warning in opened.warnings.iter().chain(&told).chain(&arithmetic) {
            progress.say(&format!("warning: {warning}"));
        }
        let began = done.as_ref().map_or(Duration::ZERO, |done| done.elapsed);
        let keeper = keep.zip(asked).map(|(path, asked)| Keeper::new(path, asked, arguments.checkpoint, began));
        let snapshots = arguments.snapshot.map(|interval| Interval::from(began, interval));
        let audience = Audience { snapshots, keeper, output, log, progress };

        let scene_name = arguments.scene.path.display().to_string();
        let job = Job { scene: &opened.scene, scene_name, settings, stop };
        let company = company.as_ref();
        let outcome = render::run_on(company, &job, scene_digest, resumed, &audience).map_err(Failure::running)?;
        let Some(mut outcome) = outcome else { return Ok(None) };
        if let Some(company) = company {
            audience.progress.say(&talk_in_words(company, outcome.status.elapsed));
        }
        if let Some(fault) = outcome.status.faults.first() {
            let (scene, width) = (arguments.scene.in_words(), opened.scene.film.width);
            let command = replay::command(&scene, &job.settings, outcome.mapping, width, &fault.evaluation);
            outcome.warnings.push(format!("the first of those paths: {command}"));
        }
        let warnings = opened.warnings.iter().cloned().chain(told).collect();
        Ok(Some(Rendered { outcome, audience, is_part, warnings, _claims }))
    }
}

impl Rendered<'_> {
    /// Writes the image and tells how the run ended.
    pub fn finish(self) -> Result<Summary, Failure> {
        let Rendered { outcome, audience, is_part, warnings, _claims } = self;
        let (mut outputs, mut failures) = (Vec::new(), Vec::new());
        let kept = audience.keeper.as_ref().and_then(Keeper::written);
        if is_part {
            failures.extend(audience.keeper.as_ref().and_then(Keeper::failure));
        } else {
            (outputs, failures) = audience.output.write_somewhere(&outcome.picture);
            if let (Some(kept), true) = (&kept, outputs.is_empty()) {
                let how =
                    format!("the picture is made again, and nothing else, by --resume {} -o FILE", kept.display());
                failures.push(how);
            }
        }
        if let Some(agreement) = &outcome.agreement {
            audience.progress.say(&agreement.in_words());
        }
        let summary = Summary {
            status: outcome.status,
            health: outcome.health,
            outputs: outputs.into_iter().chain(kept).collect(),
            interrupted: outcome.interrupted,
            warnings: warnings.into_iter().chain(outcome.warnings).collect(),
        };
        audience.finished(&summary);
        if failures.is_empty() { Ok(summary) } else { Err(Failure::Running(failures)) }
    }
}

/// `on 4 ranks: rank 0 spent 0.21 s (3 %) talking and waiting, in 120 exchanges of 12.3 MB`
fn talk_in_words(company: &Company, elapsed: Duration) -> String {
    let Talk { time, bytes, messages } = company.talk();
    format!(
        "on {} ranks: rank 0 spent {:.2} s ({:.0} %) talking and waiting, in {messages} exchanges of {:.1} MB",
        company.count(),
        time.as_secs_f64(),
        100.0 * time.as_secs_f64() / elapsed.as_secs_f64(),
        bytes as f64 / 1e6
    )
}

/// What --strict has to say of a bad run.
pub(super) fn untrusted(health: &Health) -> Option<Failure> {
    let bad = health.findings.iter().filter(|finding| finding.verdict == Verdict::Bad);
    let reasons: Vec<String> = bad.map(|finding| format!("--strict: {}", finding.what)).collect();
    (!reasons.is_empty()).then_some(Failure::Exceeded(reasons))
}

/// A warning where a run is gone on with on a machine that computes otherwise than the one before. Chains that are yet to
/// start would not find again there what was found here.
fn elsewhere(resumed: &Resumed, opened: &Opened) -> Result<Option<String>, Failure> {
    let (before, now) = (&resumed.header.arithmetic, opened.device.arithmetic());
    if *before == now {
        return Ok(None);
    }
    if resumed.header.chains_are_to_start() {
        return Err(Failure::input(format_args!(
            "{}: it was taken before chains started, by {before}; here it is {now}. Go on with it where it began, or begin \
             anew",
            resumed.path.display()
        )));
    }
    Ok(Some(format!(
        "the run was begun by {before} and goes on by {now}: the picture is as good, but last bits may differ"
    )))
}

/// The command line as other subcommands' files have it.
#[derive(Parser)]
#[command(name = "relt render", no_binary_name = true)]
struct Line {
    #[command(flatten)]
    render: Render,
}

/// Names of all options without their dashes, and whether each is given or not rather than having a value.
pub(super) fn options() -> Vec<(String, bool)> {
    let flag = |option: &Arg| matches!(option.get_action(), ArgAction::SetTrue);
    let option = |option: &Arg| Some((option.get_long()?.to_owned(), flag(option)));
    Line::command().get_arguments().filter_map(option).collect()
}

impl Render {
    /// What these words of a command line ask for, the scene among them; or what is wrong with them, without hints about the
    /// command line, of which there is none.
    pub(super) fn of_words(words: impl IntoIterator<Item = String>) -> Result<Render, String> {
        let first = |error: clap::Error| {
            let text = error.render().to_string();
            let end = ["\n\nUsage:", "\n\nFor more information"].iter().filter_map(|hint| text.find(hint)).min();
            text[..end.unwrap_or(text.len())].trim_start_matches("error: ").trim().to_owned()
        };
        Line::try_parse_from(words).map(|line| line.render).map_err(first)
    }

    /// All that can be settled before the scene is read; the run's files are claimed. They are the first rank's where it has
    /// company.
    pub(super) fn plan(self, company: Option<Arc<Company>>) -> Result<Planned, Failure> {
        let leads = company.as_ref().is_none_or(|company| company.is_first());
        let keep = self.keep();
        let (resumed, told) = self.resumed(keep.as_deref())?;
        let settings = self.settings(resumed.as_ref().map(|resumed| &resumed.header.start.settings))?;
        let is_part = settings.parts.only.is_some();
        // a part has nothing to show but what it keeps
        let keep = keep.or_else(|| resumed.as_ref().filter(|_| is_part).map(|resumed| resumed.path.clone()));
        let output = self.output(keep.as_deref(), resumed.is_some(), is_part || !leads)?;
        let images = output.files().into_iter().filter(|_| !is_part);
        let claims =
            images.chain(keep.clone()).filter(|_| leads).map(|file| claim(&file)).collect::<Result<Vec<_>, _>>();
        let claims = claims.map_err(Failure::input)?.into_iter().flatten().collect();
        Ok(Planned { arguments: self, keep, resumed, told, settings, output, company, _claims: claims })
    }

    /// Leaves to the first rank what it alone does: to talk and to write.
    fn quieten(&mut self) {
        (self.quiet, self.verbose, self.strict) = (true, false, false);
        (self.snapshot, self.log) = (None, None);
    }

    fn verbosity(&self) -> Verbosity {
        match (self.quiet, self.verbose) {
            (true, _) => Verbosity::Quiet,
            (_, true) => Verbosity::Verbose,
            _ => Verbosity::Normal,
        }
    }

    /// Where checkpoints go, if there are to be any.
    pub(super) fn keep(&self) -> Option<PathBuf> {
        let wanted = self.checkpoint.is_some() || self.checkpoint_file.is_some() || self.part.is_some();
        let resumed = self.resume.clone().filter(|path| *path != *Path::new(AUTO));
        let beside = || {
            let of = self.part.as_ref().and_then(|part| Some((part.parts.only?, part.parts.of)));
            let extension = of.map_or("checkpoint".into(), |(part, of)| format!("{part}-of-{of}.part"));
            self.output_name().with_extension(extension)
        };
        wanted.then(|| self.checkpoint_file.clone().or(resumed).unwrap_or_else(beside))
    }

    /// The checkpoint to go on from, with a warning where it is not the last one.
    fn resumed(&self, keep: Option<&Path>) -> Result<(Option<Resumed>, Option<String>), Failure> {
        let path = match (&self.resume, keep) {
            (None, None) => return Ok((None, None)),
            (None, Some(keep)) if keep.exists() => {
                return Err(Failure::input(format_args!(
                    "{}: there is a checkpoint already; go on from it with --resume {}, or delete it to begin anew",
                    keep.display(),
                    keep.display()
                )));
            }
            (None, Some(_)) => return Ok((None, None)),
            (Some(path), None) if path == Path::new(AUTO) => {
                return Err(Failure::input("--resume auto: give --checkpoint or --checkpoint-file, or name the file"));
            }
            (Some(path), Some(keep)) if path == Path::new(AUTO) => {
                if !keep.exists() && !checkpoint::previous(keep).exists() {
                    return Ok((None, None));
                }
                keep
            }
            (Some(path), _) => path,
        };
        let (resumed, warning) = checkpoint::open(path).map_err(Failure::input)?;
        Ok((Some(resumed), warning))
    }

    /// The run that is asked for, or everything that is wrong with it. What is not given is as `before`, in a checkpoint
    /// that is gone on with, had it, or as it usually is.
    pub(super) fn settings(&self, before: Option<&Settings>) -> Result<Settings, Failure> {
        let base = before.cloned().unwrap_or_default();
        let settings = Settings {
            parts: match (&self.part, self.parts) {
                (Some(part), _) => part.parts,
                (None, Some(of)) => Parts { of, only: None },
                (None, None) => base.parts,
            },
            layers: self.layers || base.layers,
            pin: self.pin,
            packet: self.packet,
            ..self.run.settings(before)
        };
        let mut faults = self.contradictions(&settings);
        faults.extend(settings.faults());
        if faults.is_empty() { Ok(settings) } else { Err(Failure::Input(faults)) }
    }

    /// What is wrong with the options beside one another, which the settings no longer tell.
    fn contradictions(&self, settings: &Settings) -> Vec<String> {
        let mut faults = self.scene.faults();
        if self.quiet && self.verbose {
            faults.push("--quiet and --verbose: give one of them".into());
        }
        let of_a_ladder = [("--layers", self.layers), ("--verbose", self.verbose)];
        faults.extend(self.run.contradictions(settings, &of_a_ladder));
        if self.part.is_some() && self.parts.is_some() {
            faults.push("--part and --parts: give one of them; one of the parts is run, or all".into());
        }
        if settings.parts.only.is_some() && self.snapshot.is_some() {
            faults.push("--snapshot: a part has no image; relt merge makes one of its file at any time".into());
        }
        let cores = allocation::threads();
        if let Some(threads) = self.run.threads.filter(|threads| self.pin && *threads > cores) {
            faults.push(format!("--pin: {threads} threads cannot have a core each, relt may use {cores}"));
        }
        faults
    }

    /// The image's name.
    fn output_name(&self) -> PathBuf {
        self.output.clone().unwrap_or_else(|| default_output(&self.scene.path))
    }

    /// Where the image goes; all files of the run are known to be writable afterwards.
    fn output(&self, keep: Option<&Path>, goes_on: bool, is_part: bool) -> Result<Output, Failure> {
        let output = Output::new(&self.output_name()).map_err(Failure::input)?;
        let place = |path: &Path| absolute(path).unwrap_or_else(|_| path.to_owned());
        let mut taken: Vec<(PathBuf, &str)> =
            output.files().iter().map(|file| (place(file), "the image goes there")).collect();
        taken.push((place(&self.scene.path), "that is the scene"));
        let others = [("--log", self.log.as_deref()), ("--checkpoint-file", keep)];
        for (option, path) in others.into_iter().filter_map(|(option, path)| Some((option, path?))) {
            if let Some((_, why)) = taken.iter().find(|(other, _)| *other == place(path)) {
                return Err(Failure::input(format_args!("{option} {}: {why}", path.display())));
            }
            taken.push((place(path), "the log goes there"));
        }
        if let Some(log) = &self.log {
            log::check(log).map_err(Failure::input)?;
            if goes_on {
                log::check_resumable(log).map_err(Failure::input)?;
            }
        }
        if !is_part {
            output.check().map_err(Failure::input)?;
        }
        keep.map_or(Ok(()), check_writable).map_err(Failure::input)?;
        Ok(output)
    }
}

/// What `--resume` says where the checkpoint may not be there yet.
const AUTO: &str = "auto";

/// The scene's folder's name with `.exr`, in the current folder: scene files are mostly named alike.
fn default_output(scene: &Path) -> PathBuf {
    let scene = absolute(scene).unwrap_or_else(|_| scene.to_owned());
    let name = scene.parent().and_then(Path::file_name).or(scene.file_stem()).unwrap_or("relt".as_ref());
    let mut file = name.to_owned();
    file.push(".exr");
    PathBuf::from(file)
}

/// All who follow a run: the person, the log, and the image file of snapshots.
struct Audience<'a> {
    progress: &'a dyn Teller,
    log: Option<Log>,
    snapshots: Option<Interval>,
    keeper: Option<Keeper>,
    output: Output,
}

/// When something that happens at an interval is due.
struct Interval {
    length: Duration,
    due: Mutex<Duration>,
}

impl Interval {
    /// First so long after `begin`.
    fn from(begin: Duration, length: Duration) -> Interval {
        Interval { length, due: Mutex::new(begin + length) }
    }

    fn is_due(&self, elapsed: Duration) -> bool {
        elapsed >= *self.due.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Counts from now, so that slow files do not follow one another without a pause.
    fn taken(&self, elapsed: Duration) {
        *self.due.lock().unwrap_or_else(PoisonError::into_inner) = elapsed + self.length;
    }
}

/// Who writes checkpoints.
struct Keeper {
    path: PathBuf,
    interval: Option<Interval>,
    /// A signal asks for one.
    asked: Arc<AtomicBool>,
    /// Where the last one is, if it could be written.
    written: Mutex<Option<PathBuf>>,
    /// Why it is not where it should be.
    failure: Mutex<Option<String>>,
}

impl Keeper {
    fn new(path: PathBuf, asked: Arc<AtomicBool>, interval: Option<Duration>, begin: Duration) -> Keeper {
        let interval = interval.map(|interval| Interval::from(begin, interval));
        Keeper { path, interval, asked, written: Mutex::default(), failure: Mutex::default() }
    }

    fn is_due(&self, elapsed: Duration) -> bool {
        self.asked.load(Relaxed) || self.interval.as_ref().is_some_and(|interval| interval.is_due(elapsed))
    }

    /// Where the last one is, if it could be written.
    fn written(&self) -> Option<PathBuf> {
        self.written.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Why the last one is not where it should be.
    fn failure(&self) -> Option<String> {
        self.failure.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Writes a checkpoint, or tells why not: the disk may have room again at the next, but the `last` one is put somewhere
    /// else then. Returns whether a signal asked for it.
    fn write(&self, checkpoint: &Checkpoint, last: bool) -> (bool, Result<(), String>) {
        let asked = self.asked.swap(false, Relaxed);
        let (written, result) = if last {
            match write_somewhere(&self.path, |path| checkpoint.write(path)) {
                Ok(()) => (Some(self.path.clone()), Ok(())),
                Err(misplaced) => (misplaced.instead.as_ref().ok().cloned(), Err(misplaced.to_string())),
            }
        } else {
            let result = checkpoint.write(&self.path).map_err(|error| error.to_string());
            (result.is_ok().then(|| self.path.clone()), result)
        };
        *self.written.lock().unwrap_or_else(PoisonError::into_inner) = written;
        *self.failure.lock().unwrap_or_else(PoisonError::into_inner) = result.as_ref().err().cloned();
        (asked, result)
    }
}

impl Audience<'_> {
    fn keep(&self, checkpoint: &Checkpoint, last: bool) {
        let Some(keeper) = &self.keeper else { return };
        let begin = Instant::now();
        let (asked, written) = keeper.write(checkpoint, last);
        match written {
            Ok(()) => {
                self.log.iter().for_each(|log| log.checkpoint(checkpoint.status, &keeper.path, begin.elapsed()));
                if asked {
                    self.progress.say(&format!("wrote {}", keeper.path.display()));
                }
            }
            Err(error) => self.progress.say(&format!("warning: no checkpoint: {error}")),
        }
        // from its end on, as the run stands still for it
        let now = checkpoint.status.elapsed + begin.elapsed();
        keeper.interval.iter().for_each(|interval| interval.taken(now));
    }
}

impl Observer for Audience<'_> {
    fn started(&self, start: &RunStart) {
        self.progress.started(start);
        self.log.iter().for_each(|log| log.started(start));
    }

    fn progress(&self, status: &Status) {
        self.progress.progress(status);
        self.log.iter().for_each(|log| log.progress(status));
        if let Some(failure) = self.log.as_ref().and_then(Log::new_failure) {
            self.progress.say(&format!("warning: log: {failure}; its lines are kept and written when there is room"));
        }
    }

    fn round(&self, report: &RoundReport) {
        self.progress.round(report);
        self.log.iter().for_each(|log| log.round(report));
    }

    fn wants_picture(&self, status: &Status) -> bool {
        self.snapshots.as_ref().is_some_and(|snapshots| snapshots.is_due(status.elapsed))
    }

    fn snapshot(&self, status: &Status, picture: &Picture) {
        self.snapshots.iter().for_each(|snapshots| snapshots.taken(status.elapsed));
        match self.output.write(picture) {
            Ok(()) => self.log.iter().for_each(|log| log.snapshot(status, picture)),
            // The disk may have room again when the run is over.
            Err(error) => self.progress.say(&format!("warning: {error}")),
        }
    }

    fn wants_checkpoint(&self, status: &Status) -> bool {
        self.keeper.as_ref().is_some_and(|keeper| keeper.is_due(status.elapsed))
    }

    fn checkpoint(&self, checkpoint: &Checkpoint) {
        self.keep(checkpoint, false);
    }

    fn ended(&self, checkpoint: &Checkpoint) {
        self.keep(checkpoint, true);
        self.progress.ended(checkpoint);
    }

    fn finished(&self, summary: &Summary) {
        self.log.iter().for_each(|log| log.finished(summary));
        self.progress.finished(summary);
        if let Some(failure) = self.log.as_ref().and_then(Log::failure) {
            self.progress.say(&format!("warning: the log is incomplete: {failure}"));
        }
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;
    use crate::render::{Combine, LadderChoice, MappingChoice, Measure, Method, MltSettings, Normalisation};

    #[derive(Parser)]
    struct Only {
        #[command(flatten)]
        render: Render,
    }

    fn settings(arguments: &[&str]) -> Result<Settings, String> {
        let arguments = ["relt", "scene.xml"].iter().chain(arguments);
        Only::try_parse_from(arguments).unwrap().render.settings(None).map_err(|failure| failure.to_string())
    }

    #[test]
    fn without_options_the_settings_are_the_defaults() {
        assert_eq!(settings(&[]), Ok(Settings::default()));
    }

    #[test]
    fn every_option_reaches_the_settings() {
        let given = "--method re --betas 0,0.25,1 --combine target --uniform-share 0.25 --error absolute --layers \
                     --mpp 10 --time 5m --seed 7 --part 3/8 --threads 1 --pin";
        let given: Vec<_> = given.split(' ').collect();
        let expected = Settings {
            mapping: MappingChoice::Auto,
            method: Method::ReplicaExchange,
            seed: 7,
            parts: Parts { of: 8, only: Some(3) },
            threads: Some(1),
            pin: true,
            mutations_per_pixel: Some(10.0),
            time: Some(Duration::from_secs(300)),
            ladder: LadderChoice::Betas(vec![0.0, 0.25, 1.0]),
            combine: Combine::Target,
            uniform_share: Some(0.25),
            measure: Measure::Absolute,
            layers: true,
            technique_changes: false,
            mlt: MltSettings::default(),
            packet: PacketChoice::Auto,
        };
        assert_eq!(settings(&given), Ok(expected));
        let mlt = settings(&["--method", "mlt", "--packet", "8", "--replicas"][..4]).unwrap();
        assert_eq!((mlt.method, mlt.packet), (Method::Mlt, PacketChoice::Fixed(crate::embree::Width::W8)));
        let given = "--method mlt --large-steps 0.5 --normalisation pooled --kelemen-weights";
        let expected = MltSettings { large_steps: 0.5, normalisation: Normalisation::Pooled, kelemen_weights: true };
        assert_eq!(settings(&given.split(' ').collect::<Vec<_>>()).unwrap().mlt, expected);
        let given = ["--mapping", "multiplexed", "--technique-changes", "on"];
        assert!(settings(&given).unwrap().technique_changes);
        assert_eq!(settings(&["--replicas", "6"]).unwrap().ladder, LadderChoice::Replicas(6));
        assert_eq!(settings(&["--replicas", "auto"]).unwrap().ladder, LadderChoice::Auto);
    }

    #[test]
    fn a_time_alone_has_no_limit_in_mutations() {
        assert_eq!(settings(&["--time", "1s"]).unwrap().mutations_per_pixel, None);
    }

    #[test]
    fn options_that_contradict_one_another_are_all_told() {
        let text = settings(&["--method", "path", "--betas", "0,1", "--replicas", "1", "--mpp", "0"]).unwrap_err();
        for part in ["--betas and --replicas", "--betas: --method path has no ladder", "--replicas: ", "--mpp 0"] {
            assert!(text.contains(part), "{part:?} is not in:\n{text}");
        }
        assert_eq!(text.lines().count(), 4, "{text}");
    }

    #[test]
    fn only_chains_that_have_techniques_change_them() {
        for given in [&["--technique-changes", "on"][..], &["--mapping", "light", "--technique-changes", "on"]] {
            let text = settings(given).unwrap_err();
            assert!(text.contains("--technique-changes on: only chains"), "{text}");
        }
        assert!(settings(&["--technique-changes", "off"]).is_ok());
    }

    #[test]
    fn the_image_is_named_after_the_scenes_folder() {
        assert_eq!(default_output(Path::new("scenes/cornell-box/scene.xml")), Path::new("cornell-box.exr"));
        assert_eq!(default_output(Path::new("/scene.xml")), Path::new("scene.exr"));
        let here = std::env::current_dir().unwrap();
        let mut here = here.file_name().unwrap().to_owned();
        here.push(".exr");
        assert_eq!(default_output(Path::new("scene.xml")), Path::new(&here));
    }

    #[test]
    fn snapshots_keep_their_distance() {
        let snapshots = Interval::from(Duration::ZERO, Duration::from_secs(10));
        assert!(!snapshots.is_due(Duration::from_secs(9)));
        assert!(snapshots.is_due(Duration::from_secs(25)));
        snapshots.taken(Duration::from_secs(25));
        assert!(!snapshots.is_due(Duration::from_secs(34)));
        assert!(snapshots.is_due(Duration::from_secs(35)));
    }
}
