//! A run's error as it falls: at a given time, to a given error, and how steep.

use std::cmp::Ordering;

use super::numbers::{Interval, Spread};
use crate::study::metrics::Errors;
use crate::study::results::{Results, Run, Stage};

/// √relMSE, if the reference can tell it.
pub fn error(errors: &Errors) -> Option<f64> {
    (errors.rel_mse > 0.0 && errors.rel_mse.is_finite()).then(|| errors.rel_mse.sqrt())
}

/// What errors are plotted against.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Against {
    /// Seconds on the study's clock.
    Seconds,
    /// Mutations.
    Mutations,
}

/// A run's error over its progress.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Progress, positive and ascending, with [`error`]. Never empty.
    points: Vec<(f64, Option<f64>)>,
}

impl Curve {
    /// Of a run; none where no snapshot has made progress.
    pub fn of(run: &Run, against: Against) -> Option<Curve> {
        let mut points: Vec<(f64, Option<f64>)> = Vec::new();
        for snapshot in &run.snapshots {
            let at = match against {
                Against::Seconds => snapshot.seconds,
                Against::Mutations => snapshot.mutations as f64,
            };
            if at > points.last().map_or(0.0, |last| last.0) && at.is_finite() {
                points.push((at, error(&snapshot.errors)));
            } else if points.last().is_some_and(|last| last.0 == at) {
                // Two at the same moment, such as a snapshot right before the end: the later one counts.
                points.last_mut().expect("just seen").1 = error(&snapshot.errors);
            }
        }
        (!points.is_empty()).then_some(Curve { points })
    }

    /// Progress of first and last snapshot.
    pub fn ends(&self) -> [f64; 2] {
        [self.points[0].0, self.points[self.points.len() - 1].0]
    }

    /// Progress of all snapshots.
    pub fn places(&self) -> impl Iterator<Item = f64> {
        self.points.iter().map(|point| point.0)
    }

    /// Error at some progress, on the straight line of logarithms between the two snapshots around it; none before the
    /// first, after the last, and where one of the two is not known.
    pub fn at(&self, progress: f64) -> Option<f64> {
        let right = self.points.partition_point(|point| point.0 < progress);
        let (after, error_after) = *self.points.get(right)?;
        if after == progress {
            return error_after;
        }
        let (before, error_before) = *self.points.get(right.checked_sub(1)?)?;
        Some(log_log([before, after], [error_before?, error_after?], progress))
    }

    /// When the error first was `target` or less, on the straight line of logarithms from the snapshot before. Where an
    /// error is not known it is below what the reference can tell, and counts as reached by then.
    pub fn time_to(&self, target: f64) -> Time {
        let reached = |point: &(f64, Option<f64>)| point.1.is_none_or(|error| error <= target);
        match self.points.iter().position(reached) {
            None => Time::After(self.ends()[1]),
            Some(0) => Time::Before(self.ends()[0]),
            Some(i) => match (self.points[i - 1], self.points[i]) {
                ((before, Some(higher)), (after, Some(lower))) => {
                    Time::At(log_log([higher, lower], [before, after], target))
                }
                (_, (after, _)) => Time::At(after),
            },
        }
    }

    /// Slope of ln error over ln progress by least squares over the snapshots from `start` on; none of fewer than
    /// [`SLOPE_POINTS`] snapshots, of less than [`SLOPE_SPAN`], or where an error among them is not known.
    pub fn slope(&self, start: f64) -> Option<f64> {
        let points: Vec<_> = self.points.iter().filter(|point| point.0 >= start).collect();
        let span = points.last()?.0 / points.first()?.0;
        if points.len() < SLOPE_POINTS || span < SLOPE_SPAN {
            return None;
        }
        let x = points.iter().map(|point| point.0.ln());
        let y = points.iter().map(|point| point.1.map(f64::ln)).collect::<Option<Vec<f64>>>()?;
        let n = y.len() as f64;
        let (x_mean, y_mean) = (x.clone().sum::<f64>() / n, y.iter().sum::<f64>() / n);
        let covariance: f64 = x.clone().zip(&y).map(|(x, y)| (x - x_mean) * (y - y_mean)).sum();
        Some(covariance / x.map(|x| (x - x_mean).powi(2)).sum::<f64>())
    }
}

/// y at x on the straight line between two points in logarithms.
fn log_log(xs: [f64; 2], ys: [f64; 2], x: f64) -> f64 {
    let share = (x / xs[0]).ln() / (xs[1] / xs[0]).ln();
    (ys[0].ln() + share * (ys[1] / ys[0]).ln()).exp()
}

/// Fewest snapshots that tell a slope.
pub const SLOPE_POINTS: usize = 3;
/// Least quotient of last and first time that tells a slope.
pub const SLOPE_SPAN: f64 = 2.0;
/// A slope is told over the last so much of a run: from its end divided by this.
pub const SLOPE_DECADE: f64 = 10.0;
/// Slopes that independent runs of a converging method have: error falls as 1/√time, with as much to either side as
/// a decade with a few snapshots of correlated noise may bend it.
pub const SLOPE_EXPECTED: [f64; 2] = [-0.6, -0.4];

/// Mean slope of error over time of runs, each over its last decade without the part in which it was set up.
pub fn slope(results: &Results, runs: &[Run]) -> Option<Interval> {
    let slopes: Option<Vec<f64>> = runs
        .iter()
        .map(|run| {
            let curve = Curve::of(run, Against::Seconds)?;
            curve.slope(set_up(results, run).max(curve.ends()[1] / SLOPE_DECADE))
        })
        .collect();
    Interval::of_mean(&slopes?)
}

/// Seconds on the study's clock at which a run is set up: all its stages are over. On the clock of processors from the
/// snapshots around that moment.
pub fn set_up(results: &Results, run: &Run) -> f64 {
    let seconds = |stages: &[Stage]| -> f64 {
        Stage::ALL.iter().zip(run.stages).filter(|(stage, _)| stages.contains(stage)).map(|(_, seconds)| seconds).sum()
    };
    let (wall, excluded) = (seconds(&Stage::ALL), seconds(&results.excluded));
    let start = (excluded, 0.0);
    let moments: Vec<(f64, f64)> = std::iter::once(start)
        .chain(run.snapshots.iter().map(|snapshot| (snapshot.wall_seconds, snapshot.seconds)))
        .filter(|moment| moment.0.is_finite() && moment.1.is_finite() && moment.0 >= excluded)
        .collect();
    let right = moments.partition_point(|moment| moment.0 < wall);
    match (right.checked_sub(1).map(|left| moments[left]), moments.get(right)) {
        (Some(a), Some(b)) if b.0 > a.0 => a.1 + (b.1 - a.1) * (wall - a.0) / (b.0 - a.0),
        (Some(last), None) => last.1,
        _ => 0.0,
    }
}

/// A place of the horizontal axis with the errors of all runs that are known there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// Seconds or mutations.
    pub at: f64,
    /// Of √relMSE over runs.
    pub error: Spread,
}

/// Median error with its spread over runs: at the snapshots of the first run that all runs reach, and at the ends of
/// what they share. Places where fewer than half of the runs are known are left out.
pub fn spread_over(runs: &[Run], against: Against) -> Vec<Moment> {
    let curves: Vec<Curve> = runs.iter().filter_map(|run| Curve::of(run, against)).collect();
    let Some(first) = curves.first() else { return Vec::new() };
    let low = curves.iter().map(|curve| curve.ends()[0]).fold(0.0, f64::max);
    let high = curves.iter().map(|curve| curve.ends()[1]).fold(f64::INFINITY, f64::min);
    let inner = first.places().filter(|at| *at > low && *at < high);
    let places = std::iter::once(low).chain(inner).chain((high > low).then_some(high));
    places.filter_map(|at| spread_at(&curves, at).map(|error| Moment { at, error })).collect()
}

/// Spread of the errors of curves at a place; none where fewer than half of them are known.
pub fn spread_at(curves: &[Curve], at: f64) -> Option<Spread> {
    let spread = Spread::of_logarithms(curves.iter().filter_map(|curve| curve.at(at)))?;
    (2 * spread.count >= curves.len()).then_some(spread)
}

/// When something was reached.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Time {
    /// Before the first look.
    Before(f64),
    /// At that time.
    At(f64),
    /// Not by then.
    After(f64),
}

impl Time {
    /// The time, or the bound of it.
    pub fn bound(self) -> f64 {
        match self {
            Time::Before(time) | Time::At(time) | Time::After(time) => time,
        }
    }

    /// Order in time, as far as it is known.
    fn order(&self, other: &Time) -> Ordering {
        let rank = |time: &Time| match time {
            Time::Before(_) => 0,
            Time::At(_) => 1,
            Time::After(_) => 2,
        };
        rank(self).cmp(&rank(other)).then(self.bound().total_cmp(&other.bound()))
    }

    /// The one in the middle; of two in the middle the geometric mean, a bound if one of them is. None of none, and
    /// where one of the two is a bound from above and one from below.
    pub fn median(times: &[Time]) -> Option<Time> {
        let mut times = times.to_vec();
        times.sort_by(Time::order);
        let (a, b) = (*times.get(times.len().checked_sub(1)? / 2)?, times[times.len() / 2]);
        let mean = (a.bound() * b.bound()).sqrt();
        Some(match (a, b) {
            _ if a == b => a,
            (Time::At(_), Time::At(_)) => Time::At(mean),
            (Time::Before(_), Time::After(_)) => return None,
            (_, Time::After(_)) => Time::After(mean),
            _ => Time::Before(mean),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::results::{Clock, Snapshot};

    /// A run whose √relMSE at given times is `error`; 1000 mutations a second.
    fn run(times: &[f64], error: impl Fn(f64) -> f64) -> Run {
        let snapshot = |&seconds: &f64| Snapshot {
            seconds,
            wall_seconds: seconds,
            mutations: (1000.0 * seconds) as u64,
            errors: Errors { rel_mse: error(seconds).powi(2), ..Errors::default() },
            ..Snapshot::default()
        };
        Run { snapshots: times.iter().map(snapshot).collect(), ..Run::default() }
    }

    fn doublings(count: i32) -> Vec<f64> {
        (0..count).map(|i| 0.5 * 2f64.powi(i)).collect()
    }

    fn close(a: f64, b: f64) -> bool {
        (a / b - 1.0).abs() < 1e-9
    }

    #[test]
    fn a_power_law_is_interpolated_exactly_and_never_extrapolated() {
        let curve = Curve::of(&run(&doublings(6), |t| 0.3 * t.powf(-0.5)), Against::Seconds).unwrap();
        assert!(close(curve.at(3.0).unwrap(), 0.3 / 3f64.sqrt()));
        assert!(close(curve.at(16.0).unwrap(), 0.3 / 4.0));
        assert_eq!((curve.at(0.4), curve.at(16.1)), (None, None));
        let Time::At(time) = curve.time_to(0.1) else { panic!("reached inside") };
        assert!(close(time, 9.0));
        assert_eq!(curve.time_to(0.01), Time::After(16.0));
        assert_eq!(curve.time_to(5.0), Time::Before(0.5));
        let mutations = Curve::of(&run(&doublings(6), |t| 0.3 * t.powf(-0.5)), Against::Mutations).unwrap();
        assert!(close(mutations.at(3000.0).unwrap(), 0.3 / 3f64.sqrt()));
    }

    #[test]
    fn errors_below_what_the_reference_tells_are_not_known_but_count_as_reached() {
        let mut run = run(&doublings(4), |t| 0.4 / t);
        run.snapshots[2].errors.rel_mse = -1e-6;
        let curve = Curve::of(&run, Against::Seconds).unwrap();
        assert_eq!((curve.at(1.5), curve.at(2.0), curve.at(3.0)), (None, None, None));
        assert!(curve.at(4.0).is_some());
        assert_eq!(curve.time_to(0.3), Time::At(2.0));
        assert_eq!(curve.slope(0.0), None);
        run.snapshots.iter_mut().for_each(|snapshot| snapshot.errors.rel_mse = f64::NAN);
        assert!(spread_over(&[run], Against::Seconds).is_empty());
    }

    #[test]
    fn a_known_slope_is_found_with_and_without_noise() {
        let results = Results::default();
        for power in [-0.5, -0.25, -1.0] {
            let exact = run(&doublings(8), |t| 0.3 * t.powf(power));
            let slope = slope(&results, &vec![exact; 3]).unwrap();
            assert!((slope.mean - power).abs() < 1e-9 && slope.half < 1e-9, "{slope:?} instead of {power}");
        }
        // ±5 % of noise in turns by seed and snapshot: the last decade of doublings has 4 points over a factor of 8,
        // which makes an alternating ±ε of it a slope of at most 0.03.
        let noisy = |seed: usize| {
            let times = doublings(8);
            run(&times, |t| 0.3 * t.powf(-0.5) * (1.0 + 0.05 * (t.log2() + seed as f64 * 1.3).sin()))
        };
        let runs: Vec<Run> = (0..8).map(noisy).collect();
        let slope = slope(&results, &runs).unwrap();
        assert!((slope.mean + 0.5).abs() < slope.half.max(0.03) && slope.half < 0.05, "{slope:?}");
        assert!(!slope.misses(SLOPE_EXPECTED[0], SLOPE_EXPECTED[1]));
    }

    #[test]
    fn a_slope_is_told_after_setting_up_and_from_enough_only() {
        // Flat until 8 s, when the run is set up, and a power law from there on: the last decade starts at 6.4.
        let mut set_up = run(&doublings(8), |t| if t < 8.0 { 1.0 } else { t.powf(-0.5) });
        set_up.stages = [1.0, 0.0, 0.0, 2.0, 5.0];
        let results = Results { excluded: vec![Stage::Load], ..Results::default() };
        assert!((slope(&results, &[set_up.clone()]).unwrap().mean + 0.5).abs() < 0.2);
        let found = slope(&Results::default(), &[set_up]).unwrap();
        assert!((found.mean + 0.5).abs() < 1e-9, "{found:?}");
        assert_eq!(slope(&Results::default(), &[run(&[1.0, 2.0], |t| 1.0 / t)]), None, "two points");
        assert_eq!(slope(&Results::default(), &[]), None);
    }

    #[test]
    fn the_end_of_setting_up_is_on_the_studys_clock() {
        let mut run = run(&[4.0, 8.0], |_| 1.0);
        run.stages = [1.0, 0.5, 0.5, 1.0, 1.0];
        assert!((set_up(&Results::default(), &run) - 4.0).abs() < 1e-12);
        run.snapshots.iter_mut().for_each(|snapshot| snapshot.wall_seconds += 2.0);
        let excluded = vec![Stage::Load, Stage::Build, Stage::Calibration];
        let results = Results { excluded, ..Results::default() };
        assert!((set_up(&results, &run) - 2.0).abs() < 1e-12);
        // half of the processors' time is waited for
        run.snapshots.iter_mut().for_each(|snapshot| snapshot.seconds *= 0.5);
        assert!((set_up(&Results { clock: Clock::Cpu, ..results }, &run) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn spread_is_over_what_all_runs_share() {
        let runs = [run(&[1.0, 2.0, 4.0], |t| 0.1 / t), run(&[1.5, 3.0, 5.0], |t| 0.4 / t)];
        let moments = spread_over(&runs, Against::Seconds);
        let places: Vec<f64> = moments.iter().map(|moment| moment.at).collect();
        assert_eq!(places, [1.5, 2.0, 4.0]);
        let Spread { median, low, high, .. } = moments[1].error;
        assert!(close(low, 0.05) && close(high, 0.2) && close(median, 0.1));
    }

    #[test]
    fn medians_of_times_know_what_was_not_seen() {
        use Time::{After, At, Before};
        assert_eq!(Time::median(&[After(30.0), At(10.0), At(20.0)]), Some(At(20.0)));
        assert_eq!(Time::median(&[After(30.0), At(10.0), After(31.0)]), Some(After(30.0)));
        let Some(After(bound)) = Time::median(&[At(10.0), After(40.0)]) else { panic!("a bound") };
        assert!(close(bound, 20.0));
        assert_eq!(Time::median(&[Before(1.0), After(2.0)]), None);
        assert_eq!(Time::median(&[]), None);
    }
}
