//! The toy table: root mean square error of every method on six analytic targets at the same number of evaluations.
//!
//! `cargo run --release --example toys` prints RMSE/c, c the mean of the image, with its standard error over the runs,
//! then the mean brightness of the images, what `auto` chose, and how it compares with the best of each column.
//! `--runs 32` makes errors half as large as the default 8, `--only golf peaks` takes some of the toys, `--shallow` puts
//! their coordinates among the first primary samples, where the points of K = 1 are low-discrepancy.
//! The toys are described in `tests/support/toys.rs`.

use clap::Parser;
use rayon::prelude::*;
use relt::{
    chain::{Evaluator, LARGE_STEP_PROBABILITY, LargeSteps, Measure},
    film::{Filter, Footprint, Heuristic, Image, Plane},
    path::Contribution,
    rng::{Counter, Purpose, Rng},
    sample::{Move, Points},
    tempering::{Choices, Combine, Development, LadderChoice, Sampler, Setup},
};

#[path = "../tests/support/pssmlt.rs"]
mod pssmlt;
#[path = "../tests/support/toys.rs"]
mod toys;

use pssmlt::pssmlt;
use toys::Toy;

/// Error of every method on analytic targets.
#[derive(Parser)]
struct Arguments {
    /// Independent runs of each method on each toy, at least 2.
    #[arg(long, default_value_t = 8, value_parser = clap::value_parser!(u64).range(2..))]
    runs: u64,
    /// Evaluations of a run, at least 4096.
    #[arg(long, default_value_t = 1 << 20, value_parser = clap::value_parser!(u64).range(4096..))]
    evaluations: u64,
    /// The toys to take: smooth, dark, islands, peaks, golf, heavy.
    #[arg(long, num_args = 1.., value_parser = toys::table().map(|toy| toy.name))]
    only: Vec<String>,
    /// Make the coordinates the first primary samples.
    #[arg(long)]
    shallow: bool,
}

/// Columns of the image.
const COLUMNS: u32 = 128;

/// Rows of the table that one run gives at once.
#[derive(Clone, Copy)]
enum Method {
    /// Independent uniform points.
    Plain,
    /// Uniform points in the order of a path tracer: K = 1.
    Path,
    /// Chains without temperatures, with both estimates of c.
    Pssmlt,
    /// The same with Kelemen's weights.
    Kelemen,
    /// K = 2 combined as the paper does.
    Paper,
    /// K replicas and the balance heuristic.
    Balance(u32),
    /// All chosen by the sampler.
    Auto,
}

const METHODS: [Method; 10] = [
    Method::Plain,
    Method::Path,
    Method::Pssmlt,
    Method::Kelemen,
    Method::Paper,
    Method::Balance(2),
    Method::Balance(4),
    Method::Balance(8),
    Method::Balance(16),
    Method::Auto,
];

impl Method {
    /// Names of the rows.
    fn rows(self) -> Vec<String> {
        match self {
            Method::Plain => vec!["plain Monte Carlo".into()],
            Method::Path => vec!["K = 1, stratified".into()],
            Method::Pssmlt => vec!["PSSMLT two-pass".into(), "PSSMLT pooled".into()],
            Method::Kelemen => vec!["PSSMLT pooled, MIS".into()],
            Method::Paper => ["target", "max", "power"].map(|how| format!("K = 2 {how}")).into(),
            Method::Balance(k) => vec![format!("K = {k} balance")],
            Method::Auto => vec!["auto".into()],
        }
    }

    /// One run's images, as means of g over the columns.
    fn run(self, toy: &Toy, evaluations: u64, seed: u64) -> Run {
        let ladder = |ladder, combine| sample(toy, ladder, combine, evaluations, seed);
        let baseline = |kelemen_weights| {
            let large_steps = LargeSteps { probability: LARGE_STEP_PROBABILITY, kelemen_weights };
            // the renderer's first pass of 100,000 samples is a tenth of the default number of evaluations
            pssmlt(toy, COLUMNS, large_steps, [evaluations / 10, evaluations], 1.0, seed)
        };
        match self {
            Method::Plain => Run::of(vec![plain(toy, evaluations, seed)]),
            Method::Pssmlt => Run::of(baseline(false).into()),
            Method::Kelemen => {
                let [_, pooled] = baseline(true);
                Run::of(vec![pooled])
            }
            Method::Path => ladder(LadderChoice::Replicas(1), Combine::Balance),
            Method::Paper => ladder(LadderChoice::Replicas(2), Combine::Max),
            Method::Balance(k) => ladder(LadderChoice::Replicas(k), Combine::Balance),
            Method::Auto => ladder(LadderChoice::Auto, Combine::Balance),
        }
    }
}

/// What one run gave.
struct Run {
    images: Vec<Vec<f64>>,
    warned: bool,
    /// Replicas and share of uniform points in the last round that was reported.
    chosen: (usize, f64),
}

impl Run {
    fn of(images: Vec<Vec<f64>>) -> Run {
        Run { images, warned: false, chosen: (0, 0.0) }
    }
}

/// Mean of g over the columns from independent uniform points.
fn plain(toy: &Toy, evaluations: u64, seed: u64) -> Vec<f64> {
    const LANES: u64 = 1024;
    let mut sums = vec![0.0; COLUMNS as usize];
    let counter = |step| Counter { ladder: 0, replica: 0, step, purpose: Purpose::Bootstrap };
    let mut batch = Evaluator::<Vec<u32>>::new(Rng::new(seed), vec![counter(0); LANES as usize]);
    batch.moves.fill(Move::Fresh);
    for done in (0..evaluations).step_by(LANES as usize) {
        batch.counters.iter_mut().zip(done..).for_each(|(c, step)| *c = counter(step));
        batch.evaluate(toy, &Points::new(0));
        for point in &batch.out.lanes {
            sums[(point.film[0] * COLUMNS as f32) as usize] += Contribution::luminance(point);
        }
    }
    let a_column = evaluations.next_multiple_of(LANES) as f64 / f64::from(COLUMNS);
    sums.into_iter().map(|sum| sum / a_column).collect()
}

/// A run of replica exchange; of the paper's combinations all three at once.
fn sample(toy: &Toy, ladder: LadderChoice, combine: Combine, evaluations: u64, seed: u64) -> Run {
    let paper = combine != Combine::Balance;
    let mut sampler = Sampler::new(Setup {
        rng: Rng::new(seed),
        choices: Choices { ladder, combine, uniform_share: None, measure: Measure::Absolute, layers: paper },
        footprint: Footprint::new(Filter::Box, COLUMNS, 1),
        size: [COLUMNS, 1],
        unit: toy.c(),
        elsewhere: false,
        outcomes: false,
        evaluations: Some(evaluations),
    });
    while sampler.sweeps_left() != Some(0) {
        sampler.advance(toy, u64::MAX, None);
    }
    let Development { image, layers, learnt, .. } = sampler.develop();
    let layer = |name: &str| match layers.iter().find(|layer| layer.0 == name) {
        Some((_, Plane::Rgb(image))) => image,
        _ => panic!("no layer {name}"),
    };
    let images = if paper {
        let (uniform, target) = (layer("uniform"), layer("target"));
        vec![target.clone(), image, Heuristic::Power.combine(uniform, target)]
    } else {
        vec![image]
    };
    let grey = |image: &Image| image.luminance().into_iter().map(f64::from).collect();
    let chosen = sampler.take_reports().last().map_or((1, 1.0), |report| match report.ladders {
        0 => (1, 1.0),
        _ => (report.replicas, report.uniform_share),
    });
    Run { images: images.iter().map(grey).collect(), warned: !learnt.warnings().is_empty(), chosen }
}

/// An entry of the table: a row's runs on one toy.
#[derive(Clone, Copy)]
struct Entry {
    /// √(mean over runs and columns of (x − I)²)/c and its standard error.
    rmse: [f64; 2],
    /// Mean of the images over c and its standard error.
    brightness: [f64; 2],
}

impl Entry {
    fn new(toy: &Toy, images: &[&Vec<f64>]) -> Entry {
        let (truth, c) = (toy.columns(COLUMNS), toy.c());
        let square = |image: &&Vec<f64>| {
            let sum: f64 = image.iter().zip(&truth).map(|(x, exact)| (x / c - exact / c).powi(2)).sum();
            sum / f64::from(COLUMNS)
        };
        let [square, error] = mean_and_error(&images.iter().map(square).collect::<Vec<_>>());
        let brightness = |image: &&Vec<f64>| image.iter().sum::<f64>() / f64::from(COLUMNS) / c;
        Entry {
            rmse: [square.sqrt(), 0.5 * error / square.sqrt()],
            brightness: mean_and_error(&images.iter().map(brightness).collect::<Vec<_>>()),
        }
    }
}

/// Mean of independent numbers and its standard error.
fn mean_and_error(values: &[f64]) -> [f64; 2] {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    [mean, (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0) / n).sqrt()]
}

fn main() {
    let Arguments { runs, evaluations, only, shallow } = Arguments::parse();
    let wanted = |toy: &Toy| only.is_empty() || only.iter().any(|name| name == toy.name);
    let toys: Vec<Toy> =
        toys::table().into_iter().filter(wanted).map(|toy| if shallow { toy } else { toy.deep() }).collect();
    let mut rows: Vec<(String, Vec<Entry>)> = Vec::new();
    let mut warned: Vec<(String, Vec<usize>)> = Vec::new();
    let mut chosen = Vec::new();
    for method in METHODS {
        let of_toy = |toy: &Toy| -> Vec<Run> {
            (0..runs).into_par_iter().map(|seed| method.run(toy, evaluations, seed)).collect()
        };
        let all: Vec<Vec<Run>> = toys.iter().map(of_toy).collect();
        for (i, name) in method.rows().into_iter().enumerate() {
            let entry = |(toy, runs): (&Toy, &Vec<Run>)| {
                Entry::new(toy, &runs.iter().map(|run| &run.images[i]).collect::<Vec<_>>())
            };
            rows.push((name, toys.iter().zip(&all).map(entry).collect()));
        }
        let count = |runs: &Vec<Run>| runs.iter().filter(|run| run.warned).count();
        warned.push((method.rows()[0].clone(), all.iter().map(count).collect()));
        if matches!(method, Method::Auto) {
            chosen = all.iter().map(|runs| runs.iter().map(|run| run.chosen).collect::<Vec<_>>()).collect();
        }
    }
    for toy in &toys {
        println!("{:8} c = {:.3e}, lit {:.4} of the cube", toy.name, toy.c(), toy.lit_share());
    }
    print(&format!("\nRMSE/c after {evaluations} evaluations, {runs} runs"), &toys, &rows, |entry| entry.rmse);
    print("\nbrightness: mean of the image/c", &toys, &rows, |entry| entry.brightness);
    println!("\nruns of {runs} that warn of missing light");
    for (name, counts) in warned.iter().filter(|(_, counts)| counts.iter().any(|count| *count > 0)) {
        println!("{name:20}{}", counts.iter().map(|count| format!("{count:>17}")).collect::<String>());
    }
    compare(&toys, &rows, &chosen);
}

/// One table.
fn print(title: &str, toys: &[Toy], rows: &[(String, Vec<Entry>)], value: impl Fn(&Entry) -> [f64; 2]) {
    println!("{title}\n{:20}{}", "", toys.iter().map(|toy| format!("{:>17}", toy.name)).collect::<String>());
    for (name, entries) in rows {
        let cells = entries.iter().map(&value).map(|[v, e]| format!("{v:>9.4} ±{e:>6.4}")).collect::<String>();
        println!("{name:20}{cells}");
    }
}

/// What `auto` chose, and its error beside the least of each column.
fn compare(toys: &[Toy], rows: &[(String, Vec<Entry>)], chosen: &[Vec<(usize, f64)>]) {
    let Some((auto, others)) = rows.split_last() else { return };
    println!("\nauto");
    for (i, toy) in toys.iter().enumerate() {
        let of = |row: &&(String, Vec<Entry>)| row.1[i].rmse[0];
        let best = others.iter().min_by(|a, b| of(a).total_cmp(&of(b))).expect("other methods");
        let count = |k: usize| chosen[i].iter().filter(|run| run.0 == k).count();
        let replicas = (1..=16).filter(|k| count(*k) > 0).map(|k| format!("{} × K = {k}", count(k)));
        println!(
            "{:8} {:.2} times the error of {}; chose {}, {:.0} % uniform points",
            toy.name,
            auto.1[i].rmse[0] / of(&best),
            best.0,
            replicas.collect::<Vec<_>>().join(", "),
            100.0 * chosen[i].iter().map(|run| run.1).sum::<f64>() / chosen[i].len() as f64
        );
    }
}
