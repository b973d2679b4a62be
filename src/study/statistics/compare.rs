//! Methods against one another and against the truth.

use super::curves::{Against, Curve, Time, error};
use super::numbers::{Interval, NORMAL, RESAMPLES, Spread, median, resampled, standard_deviation};
use crate::study::results::{MethodResults, Run, SceneResults};

/// How many times as good as the baseline, by medians over runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ratio {
    /// The quotient.
    pub value: Bounded,
    /// Ends of its bootstrap interval at 95 %: runs of both are drawn with replacement and the quotient of medians is
    /// taken, so with few runs the interval is coarse. None where one of the two has one run alone.
    pub interval: Option<[Bounded; 2]>,
}

/// A number or a bound of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bounded {
    /// This or less.
    AtMost(f64),
    /// This.
    Exactly(f64),
    /// This or more.
    AtLeast(f64),
}

impl Bounded {
    /// The number, or the bound.
    pub fn value(self) -> f64 {
        match self {
            Bounded::AtMost(value) | Bounded::Exactly(value) | Bounded::AtLeast(value) => value,
        }
    }

    /// What it is not less than, if that is known.
    pub fn at_least(self) -> Option<f64> {
        match self {
            Bounded::AtMost(_) => None,
            Bounded::Exactly(value) | Bounded::AtLeast(value) => Some(value),
        }
    }

    /// What it is not more than, if that is known.
    pub fn at_most(self) -> Option<f64> {
        match self {
            Bounded::AtLeast(_) => None,
            Bounded::Exactly(value) | Bounded::AtMost(value) => Some(value),
        }
    }

    /// For orders: bounds are beyond all numbers.
    fn key(self) -> f64 {
        match self {
            Bounded::AtMost(_) => f64::NEG_INFINITY,
            Bounded::Exactly(value) => value,
            Bounded::AtLeast(_) => f64::INFINITY,
        }
    }
}

/// Errors for which times are told, greatest first: those of the study, or four times, twice and once what the baseline
/// reaches at its end, rounded up to two digits. Empty where neither is known.
pub fn target_errors(scene: &SceneResults, baseline: &str) -> Vec<f64> {
    if !scene.target_errors.is_empty() {
        return scene.target_errors.clone();
    }
    let runs = method(scene, baseline).map_or(&[][..], |method| &method.runs);
    match end_error(runs) {
        Some(end) => [4.0, 2.0, 1.0].map(|factor| rounded_up(factor * end.median)).to_vec(),
        None => Vec::new(),
    }
}

/// To two significant digits.
fn rounded_up(value: f64) -> f64 {
    let unit = 10f64.powf(value.log10().floor() - 1.0);
    // The quotient of a value that has two digits already may be a little more than whole.
    let digits = (value / unit - 1e-9).ceil();
    if unit < 1.0 { digits / (1.0 / unit).round() } else { digits * unit }
}

/// The method of that name.
pub fn method<'a>(scene: &'a SceneResults, name: &str) -> Option<&'a MethodResults> {
    scene.methods.iter().find(|method| method.name == name)
}

/// √relMSE at the end over runs.
pub fn end_error(runs: &[Run]) -> Option<Spread> {
    let known: Vec<f64> = runs.iter().filter_map(|run| error(&run.end().errors)).collect();
    let spread = Spread::of_logarithms(known)?;
    (2 * spread.count >= runs.len()).then_some(spread)
}

/// When each run reached the error.
pub fn times_to(runs: &[Run], target: f64) -> Vec<Time> {
    runs.iter().filter_map(|run| Curve::of(run, Against::Seconds)).map(|curve| curve.time_to(target)).collect()
}

/// How many times as fast as the baseline runs reach an error: quotient of median times, the baseline's over ours.
pub fn speed_up(baseline: &[Time], ours: &[Time]) -> Option<Ratio> {
    let quotient = |baseline: &[Time], ours: &[Time]| time_quotient(Time::median(baseline)?, Time::median(ours)?);
    let value = quotient(baseline, ours)?;
    let resamples: Vec<Bounded> =
        resampled([baseline, ours], |[baseline, ours]| quotient(baseline, ours)).into_iter().flatten().collect();
    let several = baseline.len() > 1 && ours.len() > 1;
    Some(Ratio { value, interval: if several { central(resamples) } else { None } })
}

/// None where neither was seen to reach it, or both had before the first look.
fn time_quotient(baseline: Time, ours: Time) -> Option<Bounded> {
    let value = baseline.bound() / ours.bound();
    match (baseline, ours) {
        (Time::At(_), Time::At(_)) => Some(Bounded::Exactly(value)),
        (Time::After(_), Time::At(_) | Time::Before(_)) | (Time::At(_), Time::Before(_)) => {
            Some(Bounded::AtLeast(value))
        }
        (Time::Before(_), Time::At(_) | Time::After(_)) | (Time::At(_), Time::After(_)) => Some(Bounded::AtMost(value)),
        (Time::After(_), Time::After(_)) | (Time::Before(_), Time::Before(_)) => None,
    }
}

/// The middle 95 % of resamples. None where more than that share of them had no quotient.
fn central(mut resamples: Vec<Bounded>) -> Option<[Bounded; 2]> {
    const TAIL: usize = RESAMPLES / 40;
    if resamples.len() < RESAMPLES - TAIL {
        return None;
    }
    resamples.sort_by(|a, b| a.key().total_cmp(&b.key()).then(a.value().total_cmp(&b.value())));
    Some([resamples[TAIL], resamples[resamples.len() - 1 - TAIL]])
}

/// Quotient of medians of positive numbers, ours over the baseline's.
pub fn ratio_of_medians(baseline: &[f64], ours: &[f64]) -> Option<Ratio> {
    let quotient = |baseline: &[f64], ours: &[f64]| {
        let quotient = median(ours.iter().copied())? / median(baseline.iter().copied())?;
        quotient.is_finite().then_some(Bounded::Exactly(quotient))
    };
    let value = quotient(baseline, ours)?;
    let resamples = resampled([baseline, ours], |[baseline, ours]| quotient(baseline, ours));
    let several = baseline.len() > 1 && ours.len() > 1;
    Some(Ratio { value, interval: if several { central(resamples.into_iter().flatten().collect()) } else { None } })
}

/// 1/(relMSE · seconds) at the end of runs whose error is known: how much a second is worth, whenever it is spent.
pub fn efficiencies(runs: &[Run]) -> Vec<f64> {
    let of = |run: &Run| Some(1.0 / (error(&run.end().errors)?.powi(2) * run.end().seconds));
    runs.iter().filter_map(of).filter(|efficiency| efficiency.is_finite()).collect()
}

/// Mutations per second of wall time, over whole runs.
pub fn speeds(runs: &[Run]) -> Vec<f64> {
    let of = |run: &Run| run.end().mutations as f64 / run.end().wall_seconds;
    runs.iter().map(of).filter(|speed| speed.is_finite()).collect()
}

/// How much too bright images are on average: what remains when all noise is averaged away.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Brightness {
    /// Mean over runs of Σ x/Σ r − 1, with an interval of √(t² s²/n + 1.96² v): spread over runs, and the standard
    /// error √v of the reference itself.
    pub error: Interval,
    /// Standard deviation of Σ x/Σ r over runs; none of one.
    pub deviation: Option<f64>,
    /// √v.
    pub reference_error: f64,
}

impl Brightness {
    /// At the end of runs.
    pub fn of(runs: &[Run]) -> Option<Brightness> {
        let ratios: Vec<f64> = runs.iter().map(|run| run.end().errors.mean_ratio).collect();
        let over_runs = Interval::of_mean(&ratios)?;
        let errors = runs.iter().map(|run| run.end().errors.mean_ratio_error);
        let reference_error = errors.sum::<f64>() / runs.len() as f64;
        let half = over_runs.half.hypot(NORMAL * reference_error);
        Some(Brightness {
            error: Interval { mean: over_runs.mean - 1.0, half },
            deviation: standard_deviation(&ratios),
            reference_error,
        })
    }

    /// Whether the interval excludes the truth. One of twenty does so by chance.
    pub fn biased(&self) -> bool {
        self.error.misses(0.0, 0.0)
    }
}

/// How runs that differ in their seeds alone differ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BetweenSeeds {
    /// Standard deviation of √relMSE at the end over its mean; none of one run, and where one error is not known.
    pub error: Option<f64>,
    /// Greatest over median error at the end: how unlucky a single run may be.
    pub largest: Option<f64>,
}

impl BetweenSeeds {
    /// Of runs.
    pub fn of(runs: &[Run]) -> BetweenSeeds {
        let errors: Option<Vec<f64>> = runs.iter().map(|run| error(&run.end().errors)).collect();
        let relative = |errors: Vec<f64>| {
            standard_deviation(&errors).map(|deviation| deviation * errors.len() as f64 / errors.iter().sum::<f64>())
        };
        let largest = (runs.len() > 1).then(|| end_error(runs)).flatten().map(|spread| spread.largest / spread.median);
        BetweenSeeds { error: errors.and_then(relative), largest }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::metrics::Errors;
    use crate::study::results::Snapshot;

    fn ended(rel_mse: f64, mean_ratio: f64, mean_ratio_error: f64) -> Run {
        let errors = Errors { rel_mse, mean_ratio, mean_ratio_error, ..Errors::default() };
        let end = Snapshot { seconds: 10.0, wall_seconds: 20.0, mutations: 4000, errors, ..Snapshot::default() };
        Run { snapshots: vec![end], ..Run::default() }
    }

    #[test]
    fn targets_are_the_studys_or_follow_the_baseline() {
        let baseline = MethodResults {
            name: "mlt".into(),
            runs: vec![ended(0.0123f64.powi(2), 1.0, 0.0)],
            ..MethodResults::default()
        };
        let mut scene = SceneResults { methods: vec![baseline], ..SceneResults::default() };
        assert_eq!(target_errors(&scene, "mlt"), [0.05, 0.025, 0.013]);
        assert!(target_errors(&scene, "none").is_empty());
        scene.target_errors = vec![0.3];
        assert_eq!(target_errors(&scene, "mlt"), [0.3]);
        assert_eq!([rounded_up(0.05), rounded_up(123.0), rounded_up(1.0)], [0.05, 130.0, 1.0]);
    }

    #[test]
    fn a_speed_up_is_known_as_far_as_times_are() {
        use Time::{After, At, Before};
        let all = |time: Time| vec![time; 5];
        let ratio = speed_up(&all(At(20.0)), &all(At(5.0))).unwrap();
        assert_eq!(ratio.value, Bounded::Exactly(4.0));
        assert_eq!(ratio.interval, Some([Bounded::Exactly(4.0); 2]));
        assert_eq!(speed_up(&all(After(30.0)), &all(At(5.0))).unwrap().value, Bounded::AtLeast(6.0));
        assert_eq!(speed_up(&all(At(5.0)), &all(After(30.0))).unwrap().value, Bounded::AtMost(1.0 / 6.0));
        assert_eq!(speed_up(&all(After(30.0)), &all(After(30.0))), None);
        assert_eq!(speed_up(&all(Before(1.0)), &all(Before(1.0))), None);
        assert_eq!(speed_up(&[At(1.0)], &all(At(1.0))).unwrap().interval, None, "one run tells no spread");
        let bounds = [Bounded::AtMost(2.0), Bounded::Exactly(2.0), Bounded::AtLeast(2.0)].map(Bounded::at_least);
        assert_eq!(bounds, [None, Some(2.0), Some(2.0)]);
        assert_eq!((Bounded::AtLeast(2.0).at_most(), Bounded::AtMost(2.0).at_most()), (None, Some(2.0)));
        // Two of five never reach it: some resamples have medians that are bounds, and the interval is open above.
        let open = [After(30.0), After(30.0), At(10.0), At(11.0), At(12.0)];
        let ratio = speed_up(&open, &all(At(5.0))).unwrap();
        assert_eq!(ratio.value, Bounded::Exactly(2.4));
        assert!(matches!(ratio.interval, Some([Bounded::Exactly(_), Bounded::AtLeast(_)])), "{ratio:?}");
    }

    #[test]
    fn bootstrap_intervals_hold_the_true_ratio_about_as_often_as_they_say() {
        // 200 studies of 10 runs each, log-normal with σ = 0.3 and a true ratio of 2. Percentile intervals of medians
        // of few runs are somewhat too wide or narrow; 88 % to 100 % is ±3.2 σ of 200 trials around 95 % and some more.
        let rng = crate::rng::Rng::new(7);
        let normal = |trial: u64, i: u32| {
            let counter =
                crate::rng::Counter { ladder: i, replica: 0, step: trial, purpose: crate::rng::Purpose::Step };
            let [a, b, ..] = rng.words(counter, 0).map(crate::rng::open_unit_f64);
            (-2.0 * a.ln()).sqrt() * (std::f64::consts::TAU * b).cos()
        };
        let held = (0..200).filter(|trial| {
            let baseline: Vec<f64> = (0..10).map(|i| (0.3 * normal(*trial, i)).exp()).collect();
            let ours: Vec<f64> = (10..20).map(|i| 2.0 * (0.3 * normal(*trial, i)).exp()).collect();
            let [low, high] = ratio_of_medians(&baseline, &ours).unwrap().interval.unwrap();
            low.value() <= 2.0 && 2.0 <= high.value()
        });
        let held = held.count();
        assert!((176..=200).contains(&held), "{held} of 200");
    }

    #[test]
    fn brightness_errors_count_the_references_own() {
        let runs = |reference: f64| [0.98, 1.0, 1.02, 1.04].map(|ratio| ended(0.01, ratio, reference));
        let exact = Brightness::of(&runs(0.0)).unwrap();
        // s = √(0.002/3), t of 3 degrees of freedom 3.182446
        let half = 3.182_446 * (0.002f64 / 3.0 / 4.0).sqrt();
        assert!((exact.error.mean - 0.01).abs() < 1e-12 && (exact.error.half - half).abs() < 1e-6, "{exact:?}");
        assert!(!exact.biased());
        let noisy = Brightness::of(&runs(0.1)).unwrap();
        assert!((noisy.error.half - half.hypot(0.195_996_4)).abs() < 1e-6);
        assert!(Brightness::of(&[0.98, 0.981, 0.979].map(|ratio| ended(0.01, ratio, 0.001))).unwrap().biased());
        assert!(!Brightness::of(&[ended(0.01, 0.5, 0.0)]).unwrap().biased(), "one run has no spread");
        assert_eq!(Brightness::of(&[]), None);
    }

    #[test]
    fn ends_of_runs_give_efficiency_speed_and_spread() {
        let runs = [ended(0.01, 1.0, 0.0), ended(0.04, 1.0, 0.0), ended(-0.1, 1.0, 0.0)];
        let efficiencies = efficiencies(&runs);
        assert!((efficiencies[0] - 10.0).abs() < 1e-9 && efficiencies.len() == 2);
        assert_eq!(speeds(&runs), [200.0; 3]);
        let between = BetweenSeeds::of(&runs);
        assert_eq!(between.error, None, "one is not known");
        assert!((between.largest.unwrap() - 0.2 / (0.1f64 * 0.2).sqrt()).abs() < 1e-9);
        let of_two = BetweenSeeds::of(&runs[..2]).error.unwrap();
        assert!((of_two - (0.005f64).sqrt() / 0.15).abs() < 1e-9, "{of_two}");
        assert_eq!(BetweenSeeds::of(&runs[..1]), BetweenSeeds { error: None, largest: None });
    }
}
