//! Swaps and round trips against what is known of them.

use relt::{
    rng::Rng,
    tempering::{Block, Combine, Ladder},
};

use crate::{
    statistics::t_test,
    support::{Square, Stage, betas, exact_draws, replicas, runs},
};

/// Range of ln g of the exponential target e^{s y}.
const S: f64 = 12.0;

/// Rejection of swaps between independent states of two rungs of the exponential target:
/// 1 − ∫∫ π_a(ℓ) π_b(ℓ′) min(1, e^{(b − a)(ℓ − ℓ′)}), by the midpoint rule.
fn rejection(a: f64, b: f64) -> f64 {
    const N: usize = 1000;
    let place = |i: usize| (i as f64 + 0.5) / N as f64;
    let rung = |beta: f64| -> Vec<f64> {
        let density: Vec<f64> = (0..N).map(|i| (beta * S * (place(i) - 1.0)).exp()).collect();
        let sum: f64 = density.iter().sum();
        density.into_iter().map(|d| d / sum).collect()
    };
    let (hot, cold) = (rung(a), rung(b));
    let mut accepted = 0.0;
    for (i, h) in hot.iter().enumerate() {
        for (j, c) in cold.iter().enumerate() {
            accepted += h * c * ((b - a) * S * (place(i) - place(j))).min(0.0).exp();
        }
    }
    1.0 - accepted
}

/// Rejections of the last reported round of 16 runs, measured and predicted: t-tests, 8 in all, level 10⁻³ together;
/// 0.002 and 0.005 beside them for bins and for what rounds begin with.
#[test]
fn rejections_are_those_of_independent_states() {
    let ladder = [0.0, 0.1, 0.3, 0.6, 1.0];
    let target = Square(|_: f32, y: f32| (S as f32 * y).exp());
    let reports: Vec<_> = runs(&target, &betas(&ladder), 16, 1 << 17, 16)
        .iter()
        .map(|run| run.reports.last().expect("rounds ended").clone())
        .collect();
    for (k, pair) in ladder.windows(2).enumerate() {
        let exact = rejection(pair[0], pair[1]);
        let measured: Vec<f64> = reports.iter().map(|report| report.rejection[k]).collect();
        let predicted: Vec<f64> = reports.iter().map(|report| report.predicted_rejection[k]).collect();
        for (what, values, tolerance) in [("measured", measured, 0.005), ("predicted", predicted, 0.002f64)] {
            let (t, p) = t_test(&values, exact, tolerance.powi(2));
            assert!(p > 1.25e-4, "pair {k}, {what}: t = {t}, p = {p}, exact {exact}: {values:?}");
        }
    }
}

/// Rungs that the sampler places itself reject equally (within the 0.05 that it does not mind, and what its density of
/// states did not know).
#[test]
fn rungs_are_placed_at_equal_rejection() {
    let target = Square(|_: f32, y: f32| (S as f32 * y).exp());
    for k in [3, 5, 9] {
        for run in runs(&target, &replicas(k, Combine::Balance), 16, 1 << 16, 4) {
            let rejections: Vec<f64> = run.ladder.betas().windows(2).map(|pair| rejection(pair[0], pair[1])).collect();
            let [least, most] = [f64::min, f64::max].map(|f| rejections.iter().copied().reduce(f).expect("pairs"));
            assert!(most - least < 0.08, "{:?}: {rejections:?}", run.ladder);
        }
    }
}

/// Restarts and round trips of a block of ladders on a constant target after `sweeps`.
fn trips(ladders: usize, rungs: usize, sweeps: u64) -> [u64; 2] {
    let (target, rng) = (Square(|_, _| 3.0), Rng::new(1));
    let ladder = Ladder::even(rungs);
    let stage = Stage::new(ladder, &vec![0.0; rungs], 1, false);
    let (canvas, round) = (stage.canvas(), &stage.round);
    let starts = exact_draws(&target, 1.0, 3.1, ladders, rng, 0);
    let mut block = Block::new(rng, (0, ladders), rungs, 1, 512, stage.layers.count, [1, 1]);
    block.start(&target, &vec![&starts[..]; rungs - 1]);
    block.advance(&target, sweeps, &canvas, round);
    let mut counts = vec![Default::default(); rungs];
    block.add_counts(&mut counts);
    for (k, counts) in counts.iter().enumerate().skip(1) {
        let acceptance = counts.swaps.acceptance();
        let not_yet = sweeps == 1 && k % 2 == 1 && k > 1; // the turn of the other pairs comes in the second sweep
        assert!(not_yet || acceptance == 1.0, "rung {k}: {acceptance}");
    }
    [block.trips().restarts, block.trips().round_trips]
}

/// On a constant every swap is accepted, so that carriers move by even–odd parity alone and all can be counted. With
/// C = K − 1 ≥ 2 tempered rungs, what is offered in an even sweep climbs a rung a sweep from that sweep on, and is on the
/// target after sweep C − 1; a fresh one follows every second sweep: ⌊(t − C + 3)/2⌋ restarts after t sweeps. It takes
/// C − 1 sweeps up and as many down until the next offer replaces it: ⌊(t − 2(C − 1))/2⌋ round trips. For C = 1 every
/// offer is a restart and the end of the one before.
#[test]
fn round_trips_on_a_constant_are_counted_exactly() {
    for ladders in [1, 3] {
        for rungs in 2..=9 {
            for sweeps in [1u64, 2, 3, 4, 5, 6, 7, 8, 9, 15, 16, 17, 40, 41] {
                let chains = rungs as u64 - 1;
                let a_ladder = match chains {
                    1 => [sweeps, sweeps - 1],
                    _ => [(sweeps + 3).saturating_sub(chains) / 2, sweeps.saturating_sub(2 * (chains - 1)) / 2],
                };
                let counted = trips(ladders, rungs, sweeps);
                assert_eq!(
                    counted,
                    a_ladder.map(|n| n * ladders as u64),
                    "{ladders} ladders, K = {rungs}, {sweeps} sweeps"
                );
            }
        }
    }
}
