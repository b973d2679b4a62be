//! `relt render`: from a scene file to an image.

use std::path::{Path, PathBuf, absolute};
use std::sync::Mutex;
use std::sync::PoisonError;
use std::thread::available_parallelism;
use std::time::Duration;

use clap::Args;

use super::failure::Failure;
use super::scene::{Opened, SceneArguments};
use super::{signals, values};
use crate::path::MappingKind;
use crate::render::log::{self, Log};
use crate::render::memory::{self, FilmMemory};
use crate::render::progress::{Progress, Verbosity};
use crate::render::settings::DEFAULT_MUTATIONS_PER_PIXEL;
use crate::render::{
    self, Combine, Job, LadderChoice, MappingChoice, Measure, Method, MltSettings, Normalisation, Observer, Output,
    PacketChoice, Picture, RunStart, Settings, Status, Summary,
};
use crate::tempering::RoundReport;

/// Renders a scene to an OpenEXR image with a PNG preview
#[derive(Args)]
#[command(after_help = super::EXIT_CODES)]
pub(super) struct Render {
    #[command(flatten)]
    scene: SceneArguments,

    /// Image to write: .exr (32-bit floats, with a .png preview beside it) or .png (preview only)
    /// [default: the scene's folder's name with .exr, in the current folder]
    #[arg(short, long, value_name = "FILE", help_heading = "Files")]
    output: Option<PathBuf>,

    /// Writes the image so far at this interval, such as 10s
    #[arg(long, value_name = "TIME", value_parser = values::interval, allow_hyphen_values = true, help_heading = "Files")]
    snapshot: Option<Duration>,

    /// Writes a log, one JSON object a line
    #[arg(long, value_name = "FILE", help_heading = "Files")]
    log: Option<PathBuf>,

    /// Shows nothing but errors
    #[arg(short, long, help_heading = "Files")]
    quiet: bool,

    /// Shows a table of the rounds of --method re: barrier, swaps, round trips, normalisation, and what was chosen
    #[arg(short, long, help_heading = "Files")]
    verbose: bool,

    /// path: independent samples; mlt: Metropolis light transport; re: replica exchange
    #[arg(long, default_value = "re", value_parser = values::method(), help_heading = "Method")]
    method: Method,

    /// Replicas on a ladder for --method re, 1 to 1024, the uniform one included, placed at equal rejection of swaps;
    /// auto: as many as pay, none but the uniform one where path tracing is best [default: auto]
    #[arg(long, value_name = "K", value_parser = values::replicas, allow_hyphen_values = true, help_heading = "Method")]
    replicas: Option<LadderChoice>,

    /// From random numbers to light paths; unidirectional: camera paths; light: light subpaths seen by the camera;
    /// two-way: both; bidirectional: both, and every vertex of one joined to every vertex of the other; multiplexed: one of
    /// those ways for each mutation; auto: a short trial on the scene decides
    #[arg(long, value_name = "HOW", default_value = "auto", value_parser = values::mapping(), help_heading = "Method")]
    mapping: MappingChoice,

    /// Lets chains on --mapping multiplexed change the technique of a path and keep the path [default: off]
    #[arg(long, value_name = "WHETHER", value_parser = values::switch(), help_heading = "Method")]
    technique_changes: Option<bool>,

    /// Inverse temperatures for --method re in place of --replicas, rising from 0 to 1, such as 0,0.3,1
    #[arg(long, value_name = "0,…,1", value_delimiter = ',', allow_negative_numbers = true, help_heading = "Method")]
    betas: Option<Vec<f64>>,

    /// Share of evaluations of --method re that are uniform points, between 0 and 1 [default: tuned to the scene]
    #[arg(long, value_name = "F", allow_negative_numbers = true, help_heading = "Method")]
    uniform_share: Option<f64>,

    /// How --method re makes one image of its replicas; balance: all samples of all, weighed; target: the coldest's;
    /// uniform: the uniform one's; max, power, median, median-printed: the paper's heuristics of the latter two, biased
    /// [default: balance]
    #[arg(long, value_parser = values::combine(), help_heading = "Method")]
    combine: Option<Combine>,

    /// The error that --method re makes small: relative to the luminance of a pixel, or absolute [default: relative]
    #[arg(long, value_parser = values::measure(), help_heading = "Method")]
    error: Option<Measure>,

    /// Adds to the .exr of --method re the images of the uniform and the coldest replica, and each rung's part
    #[arg(long, help_heading = "Files")]
    layers: bool,

    /// Probability of a large step for --method mlt, between 0 and 1 [default: 0.3]
    #[arg(long, value_name = "P", allow_negative_numbers = true, help_heading = "Method")]
    large_steps: Option<f64>,

    /// Samples that --method mlt takes the mean luminance from; two-pass: those before the chains start; pooled: those
    /// and all large steps [default: two-pass]
    #[arg(long, value_parser = values::normalisation(), help_heading = "Method")]
    normalisation: Option<Normalisation>,

    /// Lets --method mlt use large steps in the image also as independent samples, by Kelemen's weights
    #[arg(long, help_heading = "Method")]
    kelemen_weights: bool,

    /// Mutations per pixel, above 0; the same seed and number give the same image, bit by bit
    /// [default: 64 unless --time is given; with both, whichever ends first]
    #[arg(long, value_name = "N", allow_negative_numbers = true, help_heading = "Budget")]
    mpp: Option<f64>,

    /// Wall time to render for, such as 60s or 5m
    #[arg(long, value_parser = values::duration, allow_hyphen_values = true, help_heading = "Budget")]
    time: Option<Duration>,

    /// Seed of all random numbers
    #[arg(long, value_name = "N", default_value_t = 0, allow_negative_numbers = true, help_heading = "Budget")]
    seed: u64,

    /// Worker threads, from 1 [default: as many as the machine runs at once]; the image does not depend on it
    #[arg(long, value_name = "N", allow_negative_numbers = true, help_heading = "Machine")]
    threads: Option<usize>,

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
    let settings = arguments.settings()?;
    let output = arguments.output()?;
    let description = arguments.scene.describe(arguments.threads, arguments.quiet)?;
    let memory = FilmMemory::of(&description.film, &settings);
    if let Some(fault) = memory::available().and_then(|available| memory.fault(available)) {
        return Err(Failure::input(fault));
    }
    let opened = Opened::of(description, arguments.threads, arguments.quiet)?;
    let log = arguments.log.as_deref().map(Log::create).transpose().map_err(Failure::input)?;
    let stop = signals::stop_flag()?;
    let progress = Progress::new(arguments.verbosity(), stop.clone());
    if memory.most >= WORTH_TELLING {
        progress.say(&format!("film: {}", memory.in_words()));
    }
    for warning in &opened.warnings {
        progress.say(&format!("warning: {warning}"));
    }
    let audience = Audience { snapshots: arguments.snapshot.map(Snapshots::every), output: &output, log, progress };

    let scene_name = arguments.scene.path.display().to_string();
    let job = Job { scene: &opened.scene, scene_name, settings, stop: &stop };
    let outcome = render::run(&job, &audience).map_err(Failure::running)?;

    output.write(&outcome.picture).map_err(Failure::running)?;
    audience.finished(&Summary {
        status: outcome.status,
        outputs: output.files(),
        interrupted: outcome.interrupted,
        warnings: opened.warnings.iter().cloned().chain(outcome.warnings).collect(),
    });
    Ok(())
}

impl Render {
    fn verbosity(&self) -> Verbosity {
        match (self.quiet, self.verbose) {
            (true, _) => Verbosity::Quiet,
            (_, true) => Verbosity::Verbose,
            _ => Verbosity::Normal,
        }
    }

    /// The run that is asked for, or everything that is wrong with it.
    pub(super) fn settings(&self) -> Result<Settings, Failure> {
        let no_budget = self.mpp.is_none() && self.time.is_none();
        let settings = Settings {
            method: self.method,
            mapping: self.mapping,
            seed: self.seed,
            threads: self.threads,
            pin: self.pin,
            mutations_per_pixel: if no_budget { Some(DEFAULT_MUTATIONS_PER_PIXEL) } else { self.mpp },
            time: self.time,
            ladder: match (&self.betas, &self.replicas) {
                (Some(betas), _) => LadderChoice::Betas(betas.clone()),
                (None, Some(replicas)) => replicas.clone(),
                (None, None) => LadderChoice::default(),
            },
            combine: self.combine.unwrap_or_default(),
            uniform_share: self.uniform_share,
            measure: self.error.unwrap_or_default(),
            layers: self.layers,
            technique_changes: self.technique_changes.unwrap_or(Settings::default().technique_changes),
            mlt: MltSettings {
                large_steps: self.large_steps.unwrap_or(MltSettings::default().large_steps),
                normalisation: self.normalisation.unwrap_or_default(),
                kelemen_weights: self.kelemen_weights,
            },
            packet: self.packet,
        };
        let mut faults = self.contradictions();
        faults.extend(settings.faults());
        if faults.is_empty() { Ok(settings) } else { Err(Failure::Input(faults)) }
    }

    /// What is wrong with the options beside one another, which the settings no longer tell.
    fn contradictions(&self) -> Vec<String> {
        let mut faults = self.scene.faults();
        if self.quiet && self.verbose {
            faults.push("--quiet and --verbose: give one of them".into());
        }
        if self.betas.is_some() && self.replicas.is_some() {
            faults.push("--betas and --replicas: give one of them; the number of replicas is that of the betas".into());
        }
        let of_a_ladder = [
            ("--replicas", self.replicas.is_some()),
            ("--betas", self.betas.is_some()),
            ("--combine", self.combine.is_some()),
            ("--uniform-share", self.uniform_share.is_some()),
            ("--error", self.error.is_some()),
            ("--layers", self.layers),
            ("--verbose", self.verbose),
        ];
        if self.method != Method::ReplicaExchange {
            let method = self.method.name();
            let given = of_a_ladder.iter().filter(|(_, given)| *given);
            faults.extend(given.map(|(name, _)| format!("{name}: --method {method} has no ladder; only re has")));
        }
        let multiplexed = self.mapping == MappingChoice::Fixed(MappingKind::Multiplexed);
        if self.technique_changes == Some(true) && !(multiplexed && self.method != Method::Path) {
            faults.push(
                "--technique-changes on: only chains of --method mlt or re on --mapping multiplexed have a technique to change"
                    .into(),
            );
        }
        let of_large_steps = [
            ("--large-steps", self.large_steps.is_some()),
            ("--normalisation", self.normalisation.is_some()),
            ("--kelemen-weights", self.kelemen_weights),
        ];
        if self.method != Method::Mlt {
            let method = self.method.name();
            let given = of_large_steps.iter().filter(|(_, given)| *given);
            faults.extend(given.map(|(name, _)| format!("{name}: --method {method} has no large steps; only mlt has")));
        }
        let cores = available_parallelism().map_or(1, usize::from);
        if let Some(threads) = self.threads.filter(|threads| self.pin && *threads > cores) {
            faults.push(format!("--pin: {threads} threads cannot have a core each, relt may use {cores}"));
        }
        faults
    }

    /// Where the image goes; all files of the run are known to be writable afterwards.
    fn output(&self) -> Result<Output, Failure> {
        let path = self.output.clone().unwrap_or_else(|| default_output(&self.scene.path));
        let output = Output::new(&path).map_err(Failure::input)?;
        if let Some(log) = &self.log {
            let place = |path: &Path| absolute(path).unwrap_or_else(|_| path.to_owned());
            if output.files().iter().any(|file| place(file) == place(log)) {
                return Err(Failure::input(format_args!("--log {}: the image goes there", log.display())));
            }
            if place(log) == place(&self.scene.path) {
                return Err(Failure::input(format_args!("--log {}: that is the scene", log.display())));
            }
            log::check(log).map_err(Failure::input)?;
        }
        output.check().map_err(Failure::input)?;
        Ok(output)
    }
}

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
    progress: Progress,
    log: Option<Log>,
    snapshots: Option<Snapshots>,
    output: &'a Output,
}

/// When the next snapshot is due.
struct Snapshots {
    interval: Duration,
    due: Mutex<Duration>,
}

impl Snapshots {
    fn every(interval: Duration) -> Snapshots {
        Snapshots { interval, due: Mutex::new(interval) }
    }

    fn is_due(&self, elapsed: Duration) -> bool {
        elapsed >= *self.due.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Counts from now, so that slow files do not make snapshots follow one another without a pause.
    fn taken(&self, elapsed: Duration) {
        *self.due.lock().unwrap_or_else(PoisonError::into_inner) = elapsed + self.interval;
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

    #[derive(Parser)]
    struct Only {
        #[command(flatten)]
        render: Render,
    }

    fn settings(arguments: &[&str]) -> Result<Settings, String> {
        let arguments = ["relt", "scene.xml"].iter().chain(arguments);
        Only::try_parse_from(arguments).unwrap().render.settings().map_err(|failure| failure.to_string())
    }

    #[test]
    fn without_options_the_settings_are_the_defaults() {
        assert_eq!(settings(&[]), Ok(Settings::default()));
    }

    #[test]
    fn every_option_reaches_the_settings() {
        let given = "--method re --betas 0,0.25,1 --combine target --uniform-share 0.25 --error absolute --layers \
                     --mpp 10 --time 5m --seed 7 --threads 1 --pin";
        let given: Vec<_> = given.split(' ').collect();
        let expected = Settings {
            mapping: MappingChoice::Auto,
            method: Method::ReplicaExchange,
            seed: 7,
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
        let snapshots = Snapshots::every(Duration::from_secs(10));
        assert!(!snapshots.is_due(Duration::from_secs(9)));
        assert!(snapshots.is_due(Duration::from_secs(25)));
        snapshots.taken(Duration::from_secs(25));
        assert!(!snapshots.is_due(Duration::from_secs(34)));
        assert!(snapshots.is_due(Duration::from_secs(35)));
    }
}
