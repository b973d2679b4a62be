//! All statistics of a scene in one place, for page and terminal alike.

use super::compare::{
    BetweenSeeds, Brightness, Ratio, efficiencies, end_error, method, ratio_of_medians, speed_up, speeds,
    target_errors, times_to,
};
use super::curves::{Against, Curve, SLOPE_EXPECTED, Time, set_up, slope, spread_at};
use super::numbers::{Interval, Spread, median};
use super::scaling::{Ladder, Scaling, ladder, scalings};
use crate::study::results::{MethodResults, Results, Run, SceneResults, Stage};

/// What was found on a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneSummary<'a> {
    /// The scene.
    pub scene: &'a SceneResults,
    /// Errors for which times are told, greatest first.
    pub targets: Vec<f64>,
    /// The one of them for summaries: the least that all runs of the baseline reach, or the greatest where there is
    /// none.
    pub headline: Option<usize>,
    /// The latest time that all runs reach; none without runs.
    pub equal_time: Option<f64>,
    /// The same in mutations.
    pub equal_mutations: Option<f64>,
    /// The methods in their order.
    pub methods: Vec<MethodSummary<'a>>,
    /// Methods that differ in threads or replicas alone.
    pub scalings: Vec<Scaling>,
}

/// What was found of a method on a scene. Numbers of runs are medians over them.
#[derive(Clone, Debug, PartialEq)]
pub struct MethodSummary<'a> {
    /// The method.
    pub method: &'a MethodResults,
    /// Whether others are compared with it.
    pub is_baseline: bool,
    /// √relMSE at the end.
    pub end_error: Option<Spread>,
    /// √relMSE at the time that all runs reach.
    pub equal_time_error: Option<Spread>,
    /// √relMSE at the number of mutations that all runs reach.
    pub equal_mutations_error: Option<Spread>,
    /// Time to each target, and how many runs reach it.
    pub times: Vec<(Option<Time>, usize)>,
    /// How many times as fast as the baseline, for each target.
    pub speed_ups: Vec<Option<Ratio>>,
    /// How much too bright.
    pub brightness: Option<Brightness>,
    /// How much runs differ.
    pub between_seeds: BetweenSeeds,
    /// Of ln error over ln seconds.
    pub slope: Option<Interval>,
    /// 1/(relMSE · seconds) at the end.
    pub efficiency: Option<Spread>,
    /// That over the baseline's.
    pub efficiency_ratio: Option<Ratio>,
    /// Mutations per second of wall time.
    pub speed: Option<Spread>,
    /// Rays per mutation.
    pub rays_per_mutation: Option<f64>,
    /// Seconds by stage, in the order of [`Stage::ALL`].
    pub stages: [Option<f64>; 5],
    /// Seconds on the study's clock at which runs are set up.
    pub set_up: Option<f64>,
    /// Standard error over value of c at the end, as runs state it themselves.
    pub stated_brightness_error: Option<f64>,
    /// Of the ladders, where there are any.
    pub ladder: Option<Ladder>,
}

impl MethodSummary<'_> {
    /// Whether the slope's interval holds none of [`SLOPE_EXPECTED`].
    pub fn slope_is_odd(&self) -> bool {
        self.slope.is_some_and(|slope| slope.misses(SLOPE_EXPECTED[0], SLOPE_EXPECTED[1]))
    }
}

/// Of all scenes.
pub fn summaries(results: &Results) -> Vec<SceneSummary<'_>> {
    results.scenes.iter().map(|scene| summary(results, scene)).collect()
}

fn summary<'a>(results: &Results, scene: &'a SceneResults) -> SceneSummary<'a> {
    let targets = target_errors(scene, &results.baseline);
    let baseline = method(scene, &results.baseline).map_or(&[][..], |method| &method.runs);
    let reached_by_all = |target: &f64| reaching(&times_to(baseline, *target)) == baseline.len();
    let headline = targets.iter().rposition(reached_by_all).or((!targets.is_empty()).then_some(0));
    let equal_time = shared_end(scene, Against::Seconds);
    let equal_mutations = shared_end(scene, Against::Mutations);
    let methods = scene.methods.iter().map(|method| {
        let runs = &method.runs[..];
        let at = |against, place: Option<f64>| {
            let curves: Vec<Curve> = runs.iter().filter_map(|run| Curve::of(run, against)).collect();
            spread_at(&curves, place?)
        };
        let times: Vec<Vec<Time>> = targets.iter().map(|target| times_to(runs, *target)).collect();
        let speed_ups = targets.iter().zip(&times).map(|(target, times)| speed_up(&times_to(baseline, *target), times));
        MethodSummary {
            method,
            is_baseline: method.name == results.baseline,
            end_error: end_error(runs),
            equal_time_error: at(Against::Seconds, equal_time),
            equal_mutations_error: at(Against::Mutations, equal_mutations),
            speed_ups: speed_ups.collect(),
            times: times.iter().map(|times| (Time::median(times), reaching(times))).collect(),
            brightness: Brightness::of(runs),
            between_seeds: BetweenSeeds::of(runs),
            slope: slope(results, runs),
            efficiency: Spread::of(efficiencies(runs)),
            efficiency_ratio: ratio_of_medians(&efficiencies(baseline), &efficiencies(runs)),
            speed: Spread::of(speeds(runs)),
            rays_per_mutation: median(runs.iter().map(|run| run.end().rays as f64 / run.end().mutations as f64)),
            stages: Stage::ALL.map(|stage| median(runs.iter().map(|run| run.stages[stage as usize]))),
            set_up: median(runs.iter().map(|run| set_up(results, run))),
            stated_brightness_error: median(runs.iter().map(|run| run.end().stated_brightness_error)),
            ladder: ladder(runs),
        }
    });
    SceneSummary {
        scene,
        headline,
        equal_time,
        equal_mutations,
        methods: methods.collect(),
        scalings: scalings(scene, equal_time),
        targets,
    }
}

fn reaching(times: &[Time]) -> usize {
    times.iter().filter(|time| !matches!(time, Time::After(_))).count()
}

/// The least of all runs' ends.
fn shared_end(scene: &SceneResults, against: Against) -> Option<f64> {
    let runs = || scene.methods.iter().flat_map(|method| &method.runs);
    let ends = runs().filter_map(|run: &Run| Curve::of(run, against)).map(|curve| curve.ends()[1]);
    ends.reduce(f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::metrics::Errors;
    use crate::study::results::Snapshot;

    /// √relMSE = scale · t^power times 1 ± 5 % by seed, at 0.25 s, 0.5 s … `end`.
    fn method(name: &str, scale: f64, power: f64, end: f64) -> MethodResults {
        let run = |seed: u64| {
            let luck = 1.0 + 0.05 * (seed as f64 - 2.0) / 2.0;
            let times = (0..).map(|i| 0.25 * 2f64.powi(i)).take_while(|time| *time <= end);
            let snapshots = times.map(|seconds| Snapshot {
                seconds,
                wall_seconds: seconds,
                mutations: (1e6 * seconds) as u64,
                rays: (5e6 * seconds) as u64,
                errors: Errors {
                    rel_mse: (luck * scale * seconds.powf(power)).powi(2),
                    mean_ratio: 1.0 + 0.001 * (seed as f64 - 2.0),
                    ..Errors::default()
                },
                ..Snapshot::default()
            });
            Run { seed, threads: 1, snapshots: snapshots.collect(), ..Run::default() }
        };
        MethodResults { name: name.into(), runs: (0..5).map(run).collect(), ..MethodResults::default() }
    }

    #[test]
    fn a_study_gives_back_the_laws_it_was_made_of() {
        let methods = vec![
            method("mlt", 0.2, -0.5, 16.0),
            method("re", 0.1, -0.5, 16.0),
            method("stuck", 0.2, -0.1, 8.0),
            MethodResults { name: "to come".into(), ..MethodResults::default() },
        ];
        let scene = SceneResults { methods, ..SceneResults::default() };
        let results = Results { baseline: "mlt".into(), scenes: vec![scene], ..Results::default() };
        let found = &summaries(&results)[0];
        // 0.2/√16 = 0.05, and the unluckiest of five is 5 % above, so that 0.1 is the least that all reach
        assert_eq!(found.targets, [0.2, 0.1, 0.05]);
        assert_eq!((found.headline, found.equal_time), (Some(1), Some(8.0)));
        let [mlt, re, stuck, to_come] = &found.methods[..] else { panic!("four methods") };
        assert!(mlt.is_baseline && !re.is_baseline);
        let ratio = re.speed_ups[1].unwrap();
        assert!((ratio.value.value() - 4.0).abs() < 1e-6, "half the error is a quarter of the time: {ratio:?}");
        let [low, high] = ratio.interval.unwrap();
        assert!(low.value() < 4.0 && 4.0 < high.value());
        assert!((re.efficiency_ratio.unwrap().value.value() - 4.0).abs() < 1e-6);
        assert!((mlt.slope.unwrap().mean + 0.5).abs() < 1e-6 && !mlt.slope_is_odd());
        assert!((stuck.slope.unwrap().mean + 0.1).abs() < 1e-6 && stuck.slope_is_odd());
        assert_eq!(stuck.times[1], (Some(Time::After(8.0)), 0));
        assert!((mlt.equal_time_error.unwrap().median - 0.2 / 8f64.sqrt()).abs() < 1e-6);
        assert!((mlt.between_seeds.largest.unwrap() - 1.05).abs() < 1e-6);
        assert!((mlt.speed.unwrap().median - 1e6).abs() < 1.0 && mlt.rays_per_mutation == Some(5.0));
        assert!(!mlt.brightness.unwrap().biased());
        assert!(to_come.end_error.is_none() && to_come.slope.is_none() && to_come.speed_ups == [None, None, None]);
    }

    #[test]
    fn a_study_without_its_baseline_still_tells_the_rest() {
        let scene = SceneResults { methods: vec![method("re", 0.1, -0.5, 16.0)], ..SceneResults::default() };
        let results = Results { baseline: "mlt".into(), scenes: vec![scene], ..Results::default() };
        let found = &summaries(&results)[0];
        assert!(found.targets.is_empty() && found.headline.is_none());
        assert!(found.methods[0].end_error.is_some() && found.methods[0].efficiency_ratio.is_none());
    }
}
