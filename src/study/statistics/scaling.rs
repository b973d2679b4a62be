//! What changes with the number of threads, of ranks, of parts, and of replicas.

use super::compare::{efficiencies, end_error, speeds};
use super::curves::{Against, Curve, spread_at};
use super::numbers::{Spread, median};
use crate::study::results::{LadderEnd, MethodResults, Run, SceneResults};

/// What is varied.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Varied {
    /// Worker threads.
    Threads,
    /// Processes that share a run.
    Ranks,
    /// Parts of a job.
    Parts,
    /// Replicas a ladder, K.
    Replicas,
}

impl Varied {
    /// All.
    pub const ALL: [Varied; 4] = [Varied::Threads, Varied::Ranks, Varied::Parts, Varied::Replicas];

    /// Whether it is a number of those who work side by side.
    pub fn is_of_workers(self) -> bool {
        matches!(self, Varied::Threads | Varied::Ranks)
    }

    /// The option that varies it, without dashes.
    pub fn option(self) -> &'static str {
        match self {
            Varied::Threads => "threads",
            Varied::Ranks => "ranks",
            Varied::Parts => "parts",
            Varied::Replicas => "replicas",
        }
    }

    fn of(self, method: &MethodResults) -> Option<usize> {
        let run = method.runs.first()?;
        match self {
            Varied::Threads => Some(run.threads),
            Varied::Ranks | Varied::Parts => option(method, self.option())?.parse().ok(),
            Varied::Replicas => {
                let ladders = method.runs.iter().find_map(|run| run.ladder.as_ref());
                ladders.map(|ladder| ladder.replicas).or_else(|| option(method, "replicas")?.parse().ok())
            }
        }
    }
}

/// The value of an option in what was varied or among all options.
fn option(method: &MethodResults, name: &str) -> Option<String> {
    let varied = method.variant.iter().find(|(option, _)| option == name).map(|(_, value)| value.clone());
    let mut words = method.options.split_whitespace();
    varied.or_else(|| {
        let prefix = format!("--{name}");
        words
            .find_map(|word| match word.strip_prefix(&prefix)? {
                "" => Some(None),
                rest => rest.strip_prefix('=').map(|value| Some(value.to_owned())),
            })?
            .or_else(|| words.next().map(str::to_owned))
    })
}

/// Methods of a scene that differ in one number alone.
#[derive(Clone, Debug, PartialEq)]
pub struct Scaling {
    /// That number.
    pub varied: Varied,
    /// Options that all of them share.
    pub shared: String,
    /// By that number, ascending; two at least.
    pub rows: Vec<Row>,
}

/// A method of a [`Scaling`]. Numbers of runs are medians over them.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Of what is varied.
    pub number: usize,
    /// Name of the method.
    pub method: String,
    /// Mutations per second of wall time.
    pub speed: Option<Spread>,
    /// [`speed`](Row::speed) over that of the first row.
    pub speed_up: Option<f64>,
    /// Speed-up over the quotient of workers: 1 where every one is worth as much as the first. Of threads and ranks only.
    pub parallel_efficiency: Option<f64>,
    /// √relMSE at the end.
    pub end_error: Option<Spread>,
    /// √relMSE at the time that all methods of the scene reach.
    pub equal_time_error: Option<Spread>,
    /// 1/(relMSE · seconds) at the end.
    pub efficiency: Option<f64>,
    /// Of the ladders, where there are any.
    pub ladder: Option<Ladder>,
}

/// Ladders at the end of runs: medians over runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ladder {
    /// Mean over pairs of the acceptance of swaps.
    pub swap_rate: f64,
    /// In the last round, on all ladders.
    pub round_trips: f64,
    /// What swaps alone would let expect.
    pub predicted: f64,
    /// Independent ladders.
    pub ladders: f64,
    /// In the last round, on all ladders.
    pub restarts: f64,
    /// Λ.
    pub barrier: f64,
    /// Of uniform points among evaluations.
    pub uniform_share: f64,
}

/// All groups of methods of a scene that differ in threads alone, or in replicas alone.
pub fn scalings(scene: &SceneResults, equal_time: Option<f64>) -> Vec<Scaling> {
    Varied::ALL.into_iter().flat_map(|varied| groups(scene, varied, equal_time)).collect()
}

/// Options that methods of a group share, and what else was varied.
type Shared = (String, Vec<(String, String)>);

fn groups(scene: &SceneResults, varied: Varied, equal_time: Option<f64>) -> Vec<Scaling> {
    let mut groups: Vec<(Shared, Vec<(usize, &MethodResults)>)> = Vec::new();
    for method in &scene.methods {
        let Some(number) = varied.of(method) else { continue };
        let others = method.variant.iter().filter(|(option, _)| option != varied.option()).cloned().collect();
        let key = (without(&method.options, varied.option()), others);
        match groups.iter_mut().find(|group| group.0 == key) {
            Some(group) => group.1.push((number, method)),
            None => groups.push((key, vec![(number, method)])),
        }
    }
    let several = groups.into_iter().filter(|(_, methods)| methods.iter().any(|method| method.0 != methods[0].0));
    several
        .map(|((options, others), mut methods)| {
            methods.sort_by_key(|(number, _)| *number);
            let lacking = others.iter().filter(|(option, _)| !options.contains(&format!("--{option}")));
            let lacking = lacking.map(|(option, value)| format!(" --{option} {value}")).collect::<String>();
            Scaling { varied, shared: options + &lacking, rows: rows(varied, &methods, equal_time) }
        })
        .collect()
}

/// Options without one of them and its value.
fn without(options: &str, name: &str) -> String {
    let (alone, joined) = (format!("--{name}"), format!("--{name}="));
    let mut words = options.split_whitespace();
    let mut kept = Vec::new();
    while let Some(word) = words.next() {
        if word == alone {
            words.next();
        } else if !word.starts_with(&joined) {
            kept.push(word);
        }
    }
    kept.join(" ")
}

fn rows(varied: Varied, methods: &[(usize, &MethodResults)], equal_time: Option<f64>) -> Vec<Row> {
    let speed = |runs: &[Run]| Spread::of(speeds(runs));
    let (fewest, first) = methods[0];
    let first_speed = speed(&first.runs);
    let row = |(number, method): &(usize, &MethodResults)| {
        let runs = &method.runs[..];
        let speed = speed(runs);
        let speed_up = speed.zip(first_speed).map(|(speed, first)| speed.median / first.median);
        let curves: Vec<Curve> = runs.iter().filter_map(|run| Curve::of(run, Against::Seconds)).collect();
        Row {
            number: *number,
            method: method.name.clone(),
            speed,
            speed_up,
            parallel_efficiency: speed_up
                .filter(|_| varied.is_of_workers())
                .map(|speed_up| speed_up * fewest as f64 / *number as f64),
            end_error: end_error(runs),
            equal_time_error: equal_time.and_then(|time| spread_at(&curves, time)),
            efficiency: median(efficiencies(runs)),
            ladder: ladder(runs),
        }
    };
    methods.iter().map(row).collect()
}

/// Medians over those runs that have ladders at their end.
pub fn ladder(runs: &[Run]) -> Option<Ladder> {
    let over = |value: &dyn Fn(&LadderEnd) -> f64| median(runs.iter().filter_map(|run| run.ladder.as_ref()).map(value));
    let mean = |rates: &[f64]| rates.iter().sum::<f64>() / rates.len() as f64;
    let or_nan = |value: Option<f64>| value.unwrap_or(f64::NAN);
    Some(Ladder {
        ladders: over(&|ladder| ladder.ladders as f64)?,
        swap_rate: or_nan(over(&|ladder| mean(&ladder.swap_rates))),
        round_trips: or_nan(over(&|ladder| ladder.round_trips as f64)),
        predicted: or_nan(over(&|ladder| ladder.round_trips_predicted)),
        restarts: or_nan(over(&|ladder| ladder.restarts as f64)),
        barrier: or_nan(over(&|ladder| ladder.barrier)),
        uniform_share: or_nan(over(&|ladder| ladder.uniform_share)),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::metrics::Errors;
    use crate::study::results::Snapshot;

    fn method(name: &str, options: &str, variant: &[(&str, &str)], threads: usize, speed: u64) -> MethodResults {
        let errors = Errors { rel_mse: 0.01, ..Errors::default() };
        let end = Snapshot { seconds: 10.0, wall_seconds: 10.0, mutations: 10 * speed, errors, ..Snapshot::default() };
        let run = Run { threads, snapshots: vec![end], ..Run::default() };
        let variant = variant.iter().map(|(option, value)| (option.to_string(), value.to_string())).collect();
        MethodResults { name: name.into(), options: options.into(), variant, runs: vec![run] }
    }

    fn scene(methods: Vec<MethodResults>) -> SceneResults {
        SceneResults { methods, ..SceneResults::default() }
    }

    #[test]
    fn threads_scale_within_equal_options() {
        let scene = scene(vec![
            method("mlt", "--method mlt", &[], 2, 50),
            method("re 4", "--method re --threads 4", &[("threads", "4")], 4, 300),
            method("re 1", "--method re --threads 1", &[("threads", "1")], 1, 100),
            method("path", "--method path", &[], 2, 70),
        ]);
        let scalings = scalings(&scene, Some(10.0));
        assert_eq!(scalings.len(), 1, "{scalings:?}");
        let Scaling { varied, shared, rows } = &scalings[0];
        assert_eq!((*varied, shared.as_str()), (Varied::Threads, "--method re"));
        assert_eq!(
            rows.iter().map(|row| (row.number, &row.method[..])).collect::<Vec<_>>(),
            [(1, "re 1"), (4, "re 4")]
        );
        assert_eq!((rows[1].speed_up, rows[1].parallel_efficiency), (Some(3.0), Some(0.75)));
        assert!((rows[1].equal_time_error.unwrap().median - 0.1).abs() < 1e-12);
    }

    #[test]
    fn replicas_are_told_by_ladders_or_by_options() {
        let with = |k: usize| {
            let mut method = method(&format!("re {k}"), &format!("--method re --replicas={k}"), &[], 2, 100);
            let ladder = LadderEnd {
                replicas: k,
                swap_rates: vec![0.2, 0.4],
                round_trips: 30,
                ladders: 3,
                ..LadderEnd::default()
            };
            method.runs[0].ladder = (k != 2).then_some(ladder);
            method
        };
        let scalings = scalings(&scene(vec![with(8), with(2), with(4)]), None);
        assert_eq!(scalings.len(), 1);
        let rows = &scalings[0].rows;
        assert_eq!(rows.iter().map(|row| row.number).collect::<Vec<_>>(), [2, 4, 8]);
        assert_eq!(rows[0].ladder, None);
        let ladder = rows[1].ladder.unwrap();
        assert!((ladder.swap_rate - 0.3).abs() < 1e-12 && ladder.round_trips == 30.0 && ladder.ladders == 3.0);
        assert_eq!(rows[1].parallel_efficiency, None);
    }

    #[test]
    fn methods_without_runs_scale_nothing() {
        let mut empty = method("re 4", "--threads 4", &[], 4, 1);
        empty.runs.clear();
        assert!(scalings(&scene(vec![method("re 1", "--threads 1", &[], 1, 1), empty]), None).is_empty());
    }
}
