//! What a study has found: what reports, tables and plots are made of.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::metrics::Errors;

/// A study with the runs that are finished.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Results {
    /// What the study is called.
    pub title: String,
    /// What it is for, in the author's words; paragraphs are parted by empty lines. May be empty.
    pub note: String,
    /// The command line that made it.
    pub command: String,
    /// Text of the study file.
    pub study_file: String,
    /// Programs that made the runs, such as `relt 0.1.0 (executable 1a2b3c4d), Embree 4.4.0`; one, unless runs of
    /// different builds are mixed.
    pub programs: Vec<String>,
    /// Machines that made the runs: processor, cores, operating system; one, unless runs of several are mixed.
    pub machines: Vec<String>,
    /// What [`Snapshot::seconds`] counts.
    pub clock: Clock,
    /// What is left out of [`Snapshot::seconds`]; normally nothing.
    pub excluded: Vec<Stage>,
    /// What every run was given: `30 s` or `1000 mutations per pixel`.
    pub budget: String,
    /// Name of the method that others are compared with.
    pub baseline: String,
    /// The scenes, in the order of the study file; one at least.
    pub scenes: Vec<SceneResults>,
    /// What the reader should know, one sentence each: runs that lack, mixed machines, and so on.
    pub warnings: Vec<String>,
}

/// Which clock errors are plotted against.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Clock {
    /// Wall time.
    #[default]
    Wall,
    /// Processor time of all threads over their number: what wall time were on a machine with nothing else to do and no
    /// thread that waits.
    Cpu,
}

/// Parts of a run's time before it works at full pace.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Stage {
    /// Reading the scene's files.
    Load,
    /// Building Embree's BVH and all else of the scene.
    Build,
    /// Measuring packet widths.
    Calibration,
    /// Independent samples before chains start; they enter c and, for `path` and `re`, the image.
    Bootstrap,
    /// Rounds in which replica exchange learns its settings; their samples enter the image.
    Adaptation,
}

impl Stage {
    /// All, in the order of a run.
    pub const ALL: [Stage; 5] = [Stage::Load, Stage::Build, Stage::Calibration, Stage::Bootstrap, Stage::Adaptation];

    /// Name in study files and reports.
    pub fn name(self) -> &'static str {
        match self {
            Stage::Load => "load",
            Stage::Build => "build",
            Stage::Calibration => "calibration",
            Stage::Bootstrap => "bootstrap",
            Stage::Adaptation => "adaptation",
        }
    }
}

/// All runs on one scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SceneResults {
    /// Unique within the study.
    pub name: String,
    /// The scene file with its definitions, as it would stand in a command line.
    pub scene: String,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// A copy of the reference, with the size above.
    pub reference: PathBuf,
    /// Errors (√relMSE) for which the time to reach them is told, greatest first; empty: as the report sees fit.
    pub target_errors: Vec<f64>,
    /// The methods, in the order of the study file; one at least.
    pub methods: Vec<MethodResults>,
}

/// All runs of a method on a scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MethodResults {
    /// Unique within the study.
    pub name: String,
    /// Its options for `relt render`, such as `--method re --replicas 4`.
    pub options: String,
    /// What was varied: the study's lists by option, such as `("replicas", "4")`; empty where nothing was.
    pub variant: Vec<(String, String)>,
    /// The finished runs in order of their seeds; may be empty while the study is at work.
    pub runs: Vec<Run>,
}

/// One finished run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Run {
    /// Seed of the run.
    pub seed: u64,
    /// Worker threads.
    pub threads: usize,
    /// A command that repeats it.
    pub command: String,
    /// Wall seconds by stage, in the order of [`Stage::ALL`].
    pub stages: [f64; 5],
    /// By time, the last at the end of the run; one at least.
    pub snapshots: Vec<Snapshot>,
    /// Where the ladder stood at the end; absent for other methods and where chains were given up.
    pub ladder: Option<LadderEnd>,
    /// What the run warned of, one sentence each.
    pub warnings: Vec<String>,
}

impl Run {
    /// The end of the run.
    pub fn end(&self) -> &Snapshot {
        self.snapshots.last().expect("a run has one snapshot at least")
    }
}

/// A moment of a run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Snapshot {
    /// On the study's clock, without what it leaves out. Time spent on snapshots themselves counts nowhere.
    pub seconds: f64,
    /// Wall time of everything.
    pub wall_seconds: f64,
    /// Processor time of all threads; NaN where the system does not tell.
    pub cpu_seconds: f64,
    /// Mutations so far, independent samples included.
    pub mutations: u64,
    /// Rays so far.
    pub rays: u64,
    /// Of the image of this moment.
    pub errors: Errors,
    /// Standard error over value of c, as the run itself states it; NaN where it states none.
    pub stated_brightness_error: f64,
    /// The image (OpenEXR), where it is kept: always at the end, for the first seed at every snapshot.
    pub image: Option<PathBuf>,
}

/// What is left of a ladder at the end of a run: of its last round that was whole.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LadderEnd {
    /// Rungs, the uniform one included.
    pub replicas: usize,
    /// Inverse temperatures.
    pub betas: Vec<f64>,
    /// Mean acceptance probability of swaps by pair, hottest first.
    pub swap_rates: Vec<f64>,
    /// In the last round.
    pub round_trips: u64,
    /// What swaps alone would let expect.
    pub round_trips_predicted: f64,
    /// Times that a fresh uniform state reached the target, in the last round.
    pub restarts: u64,
    /// Independent ladders, over which the two numbers are sums.
    pub ladders: usize,
    /// Λ.
    pub barrier: f64,
    /// Share of uniform points among evaluations.
    pub uniform_share: f64,
}
