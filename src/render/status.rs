//! Where a run stands, and who wants to know.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::checkpoint::Checkpoint;
use super::health::Health;
use super::output::Picture;
use super::settings::Settings;
use crate::chain::TechniqueChanges;
use crate::path::{Faults, MappingKind};
use crate::tempering::RoundReport;

/// What is known once a run begins.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RunStart {
    /// The scene file.
    pub scene: String,
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// What was asked for.
    pub settings: Settings,
    /// Worker threads, in fact.
    pub threads: usize,
    /// The mapping, in fact.
    pub mapping: MappingKind,
    /// Why that one, where it was left to a trial.
    pub mapping_trial: Option<String>,
    /// Inverse temperatures of the rungs, in fact; empty where there is no ladder.
    pub betas: Vec<f64>,
    /// What the scene uses, one short phrase each.
    pub features: Vec<String>,
    /// Embree's version, `4.3.1`.
    pub embree: String,
    /// The file that Embree was loaded from.
    pub embree_library: String,
    /// Rays in a packet.
    pub packets: Packets,
    /// Mutations that were done before, where a checkpoint is gone on with.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub resumed_at: Option<u64>,
}

/// Packet widths that were chosen, by kind of ray.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Packets {
    /// For camera rays.
    pub camera: usize,
    /// For rays after a bounce.
    pub bounce: usize,
    /// For rays that ask whether a light is seen.
    pub shadow: usize,
}

/// Where a run stands.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Status {
    /// Wall time since rendering began, without pauses ([`Observer::stops_the_clock`]).
    pub elapsed: Duration,
    /// Processor time of all threads of the process in the same span; `None` where the system does not tell.
    pub cpu: Option<Duration>,
    /// The part of `elapsed` before the run worked at full pace.
    pub set_up: SetUp,
    /// Mutations done, independent samples included.
    pub mutations: u64,
    /// Mutations to do, where that is a budget.
    pub target_mutations: Option<u64>,
    /// Wall time to spend, where that is a budget.
    pub time_budget: Option<Duration>,
    /// Rays traced, both kinds.
    pub rays: u64,
    /// Mean acceptance probability of each tempered rung, coldest last; empty without chains.
    pub acceptance: Vec<f64>,
    /// Mean swap probability of each pair of neighbours, hottest first; empty without a ladder.
    pub swap: Vec<f64>,
    /// What became of changes of technique; of the round, on a ladder.
    pub technique_changes: TechniqueChanges,
    /// Contributions that could not be used and were taken as zero.
    pub non_finite: u64,
    /// Why, and which was the first.
    pub faults: Faults,
    /// The estimate of c = ∫ g and its standard error, once there is one.
    pub normalisation: Option<(f64, f64)>,
    /// The last round that ended; absent before that, and for methods without rounds.
    pub last_round: Option<Arc<RoundReport>>,
}

/// Wall time of a run before it works at full pace.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SetUp {
    /// Starting threads, trying mappings and measuring packet widths.
    pub calibration: Duration,
    /// Independent samples before chains start.
    pub bootstrap: Duration,
    /// Rounds whose settings are not frozen yet.
    pub adaptation: Duration,
}

/// What a run is at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Independent samples before chains start.
    Bootstrap,
    /// Rounds whose settings are not frozen yet.
    Adaptation,
    /// Nothing is learnt any more.
    Steady,
}

/// A moment at which a run is to be interrupted for a look.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// The first end of a sweep with so many mutations done: the same moment in every run of a job.
    Mutations(u64),
    /// The first end of a slice at or after that time.
    Time(Duration),
}

impl Status {
    /// Share of the budget that is spent, 0 to 1; of the budget that ends first where there are two.
    pub fn fraction(&self) -> f64 {
        let share = |done: f64, all: f64| if all > 0.0 { (done / all).clamp(0.0, 1.0) } else { 1.0 };
        let mutations = self.target_mutations.map(|all| share(self.mutations as f64, all as f64));
        let time = self.time_budget.map(|all| share(self.elapsed.as_secs_f64(), all.as_secs_f64()));
        mutations.unwrap_or(0.0).max(time.unwrap_or(0.0))
    }

    /// Mutations per second so far; 0 before the clock has moved.
    pub fn mutations_per_second(&self) -> f64 {
        match self.elapsed.as_secs_f64() {
            0.0 => 0.0,
            seconds => self.mutations as f64 / seconds,
        }
    }

    /// Time until the first budget is spent at the pace so far; unknown before anything is done.
    pub fn time_left(&self) -> Option<Duration> {
        let by_clock = self.time_budget.map(|all| all.saturating_sub(self.elapsed));
        let pace = self.mutations_per_second();
        let by_mutations = self.target_mutations.filter(|_| pace > 0.0).and_then(|all| {
            Duration::try_from_secs_f64(all.saturating_sub(self.mutations) as f64 / pace).ok() // `None` past all ages
        });
        match (by_clock, by_mutations) {
            (Some(a), Some(b)) => Some(a.min(b)),
            (a, b) => a.or(b),
        }
    }
}

/// How a run ended.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Summary {
    /// Where it stood at the end.
    pub status: Status,
    /// The files written.
    pub outputs: Vec<PathBuf>,
    /// A signal ended it before its budget was spent.
    pub interrupted: bool,
    /// What the person should know about the image, one sentence each.
    pub warnings: Vec<String>,
    /// Whether it can be trusted.
    pub health: Health,
}

/// Somebody who follows a run. The render loop calls these from one thread at a time; each returns soon.
pub trait Observer: Sync {
    /// Rendering begins.
    fn started(&self, _start: &RunStart) {}

    /// Some blocks later; as often as it comes handy to the render loop.
    fn progress(&self, _status: &Status) {}

    /// A round is over; follows the [`progress`](Observer::progress) of the moment in which that was noticed.
    fn round(&self, _report: &RoundReport) {}

    /// Where the run should come to its next [`progress`](Observer::progress) at the latest; no such wish by default.
    fn next_stop(&self) -> Option<Stop> {
        None
    }

    /// Whether the clock stands still while pictures are made and looked at, so that looking often makes no run slower.
    fn stops_the_clock(&self) -> bool {
        false
    }

    /// Whether [`snapshot`](Observer::snapshot) should follow, for which a picture has to be made.
    fn wants_picture(&self, _status: &Status) -> bool {
        false
    }

    /// The picture so far.
    fn snapshot(&self, _status: &Status, _picture: &Picture) {}

    /// Whether [`checkpoint`](Observer::checkpoint) should follow.
    fn wants_checkpoint(&self, _status: &Status) -> bool {
        false
    }

    /// The run as it is now, to be written and gone on with later.
    fn checkpoint(&self, _checkpoint: &Checkpoint) {}

    /// The run as it ends, before anything is made of it.
    fn ended(&self, _checkpoint: &Checkpoint) {}

    /// All is over, files are written. The render loop does not call this; whoever wrote the files does.
    fn finished(&self, _summary: &Summary) {}
}

/// Nobody.
impl Observer for () {}

#[cfg(test)]
mod tests {
    use super::*;

    fn status(seconds: f64, mutations: u64) -> Status {
        Status { elapsed: Duration::from_secs_f64(seconds), mutations, ..Status::default() }
    }

    #[test]
    fn the_budget_that_ends_first_counts() {
        let run =
            Status { target_mutations: Some(1000), time_budget: Some(Duration::from_secs(100)), ..status(10.0, 250) };
        assert_eq!(run.fraction(), 0.25);
        assert_eq!(run.mutations_per_second(), 25.0);
        assert_eq!(run.time_left(), Some(Duration::from_secs(30)));
        let run = Status { target_mutations: Some(1_000_000), ..run };
        assert_eq!(run.fraction(), 0.1);
        assert_eq!(run.time_left(), Some(Duration::from_secs(90)));
    }

    #[test]
    fn nothing_is_promised_before_anything_is_done() {
        let run = Status { target_mutations: Some(1000), ..status(0.0, 0) };
        assert_eq!((run.fraction(), run.mutations_per_second(), run.time_left()), (0.0, 0.0, None));
        let slow = Status { target_mutations: Some(u64::MAX), ..status(1e9, 1) };
        assert_eq!(slow.time_left(), None);
    }

    #[test]
    fn going_past_a_budget_is_the_whole_of_it() {
        let run = Status { target_mutations: Some(10), ..status(1.0, 12) };
        assert_eq!((run.fraction(), run.time_left()), (1.0, Some(Duration::ZERO)));
    }
}
