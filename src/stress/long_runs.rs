//! What sums and counters are after a very long time, by few additions of large weights.

use std::time::Duration;

use super::{Bench, Case, Check};
use crate::chain::Plan;
use crate::film::{Accumulator, Splat, Splats};
use crate::render::{Settings, Status};
use crate::tempering::Histogram;

/// The cases.
pub(super) fn cases() -> Vec<Case> {
    vec![
        Case::new(
            "long-runs/film",
            "after 10¹² splats of 1 a pixel takes a million more without losing any of them",
            film,
        )
        .quick(),
        Case::new(
            "long-runs/histogram",
            "a histogram of ln g holds 10¹² states in one bin, and a million more, and its powers sum to as much",
            histogram,
        )
        .quick(),
        Case::new("long-runs/plan", "budgets of 10¹⁵ mutations and of 300 days make sense and are planned for", plan)
            .quick(),
    ]
}

const MILLION: u32 = 1_000_000;

fn film(_: &Bench) -> Vec<Check> {
    let film = Accumulator::new(2, 1, 1, 1.0);
    let mut splats = Splats::new(1);
    let mut deposit = |count: u32, value: f32| {
        for _ in 0..count {
            splats.push(0, Splat { pixel: 1, rgb: [value, 0.1 * value, 1e-6 * value], weight: value });
        }
        film.deposit(&mut splats);
    };
    // 10¹² in 10⁶ splats: 10⁶ is a number that f32 holds, of a tenth and a millionth the nearest
    deposit(MILLION, 1e6);
    deposit(MILLION, 1.0);
    let [red, green, blue, weight] = film.layer(0)[1];
    let sum = |factor: f32| 1e6 * (f64::from(factor * 1e6) + f64::from(factor));
    let half_a_step = f64::EPSILON;
    vec![
        Check::about("Σ of 1", sum(1.0), red, sum(1.0) * half_a_step),
        Check::about("Σ of 0.1", sum(0.1), green, sum(0.1) * half_a_step),
        // of 10⁻⁶ the film keeps 2⁻⁷⁰, half of which each splat may lose
        Check::about("Σ of 10⁻⁶", sum(1e-6), blue, sum(1e-6) * half_a_step + 2e6 * 2f64.powi(-71)),
        Check::about("Σ of weights", sum(1.0), weight, sum(1.0) * half_a_step),
        Check::none("splats beyond the range", film.overflowed() as usize),
    ]
}

fn histogram(_: &Bench) -> Vec<Check> {
    let mut histogram = Histogram::default();
    (0..MILLION).for_each(|_| histogram.add(0.5, 1e6));
    (0..MILLION).for_each(|_| histogram.add(0.5, 1.0));
    (0..MILLION).for_each(|_| histogram.add(f64::NEG_INFINITY, 1e6));
    let lit = 1e12 + 1e6;
    let in_bin = histogram.lit().map(|(_, weight)| weight).sum();
    vec![
        Check::about("states in the bin", lit, in_bin, lit * f64::EPSILON),
        Check::about("dark states", 1e12, histogram.dark(), 1e12 * f64::EPSILON),
        Check::about("all states", lit + 1e12, histogram.total(), 2.0 * lit * f64::EPSILON),
        Check::about("ln Σ g", lit.ln() + 0.5, histogram.ln_sum_of_powers(1.0), 1e-8),
    ]
}

fn plan(_: &Bench) -> Vec<Check> {
    const MUTATIONS: u64 = 1_000_000_000_000_000;
    let mut checks = Vec::new();
    for lanes in [1, 4, 256] {
        let plan = Plan::new(Some(MUTATIONS), lanes);
        let planned = plan.sweeps.unwrap_or(0) as f64 * plan.a_sweep() as f64;
        checks.push(Check::about(
            format!("mutations planned in groups of {lanes}"),
            MUTATIONS as f64,
            planned,
            plan.a_sweep() as f64,
        ));
    }
    let days = |text: &str| humantime::parse_duration(text).unwrap_or_default();
    let time = days("300days 5h");
    checks.push(Check::exactly("seconds of 300days 5h", (300.0 * 24.0 + 5.0) * 3600.0, time.as_secs_f64()));
    let settings = Settings { time: Some(time), mutations_per_pixel: None, ..Settings::default() };
    checks.push(Check::none("faults of such a budget", settings.faults().len()));
    let status = Status {
        elapsed: Duration::from_secs(24 * 3600),
        mutations: MUTATIONS / 300,
        target_mutations: Some(MUTATIONS),
        ..Status::default()
    };
    let left = status.time_left().unwrap_or_default().as_secs_f64();
    checks.push(Check::about("seconds left after a day of 300", 299.0 * 24.0 * 3600.0, left, 1.0));
    checks
}
