//! Detailed balance and stationarity of every kernel: small steps, large steps, swaps, offers, and whole sweeps.

use relt::{
    chain::{Evaluator, Start, Target, Walkers, replay},
    rng::{Counter, Purpose, Rng, open_unit_f64, unit_f32},
    sample::{Move, StepLaw},
    tempering::{Block, Histogram, Ladder, StepMix, swap_acceptance},
};
use statrs::distribution::{ContinuousCDF, Normal};

use crate::{
    statistics::f_test,
    support::{CELLS, Square, Stage, cell_shares, cells, exact_draws},
};

/// Cell of a point.
fn cell(y: f32) -> usize {
    ((y * CELLS.len() as f32) as usize).min(CELLS.len() - 1)
}

/// The moves that chains make: small steps of several sizes, and large steps.
fn moves() -> Vec<(&'static str, Move)> {
    let small = |smallest: f32, largest: f32| Move::Small(StepLaw::new(smallest, largest));
    vec![
        ("steps of Kelemen's sizes", Move::Small(StepLaw::KELEMEN)),
        ("steps of 1/8 to 1/2", small(0.125, 0.5)),
        ("steps of 2⁻¹³ to 1/2", small(2f32.powi(-13), 0.5)),
        ("large steps", Move::Fresh),
    ]
}

/// Puts a chain into each start and makes `steps` moves at inverse temperature `beta`; the second coordinates before and
/// after.
fn walk<T: Target>(target: &T, starts: &[Start], beta: f64, step: Move, steps: u64, rng: Rng) -> Vec<[f32; 2]> {
    let counter = |lane: usize| Counter { ladder: lane as u32, replica: 0, step: 0, purpose: Purpose::Primary };
    let mut evaluator = Evaluator::<T::Workspace>::new(rng, (0..starts.len()).map(counter).collect());
    let mut walkers = Walkers::new(starts.len());
    replay(target, starts, &mut walkers, &mut evaluator);
    let places = |walkers: &Walkers| -> Vec<f32> {
        (0..starts.len()).map(|lane| unit_f32(walkers.points.block(0, lane)[1])).collect()
    };
    let before = places(&walkers);
    for number in 0..steps {
        evaluator.moves.fill(step);
        evaluator.counters.iter_mut().for_each(|c| c.step = number);
        evaluator.evaluate(target, &walkers.points);
        for lane in 0..starts.len() {
            let decision = Counter { purpose: Purpose::Step, ..evaluator.counters[lane] };
            let u = open_unit_f64(rng.words(decision, 0)[0]);
            walkers.step(lane, beta, (&evaluator.points, lane), &evaluator.out, u, &mut |_, _| {});
        }
    }
    before.into_iter().zip(places(&walkers)).map(|(before, after)| [before, after]).collect()
}

/// The flow from cell i to cell j in one step, π_i P_ij, from steps of 200,000 exact draws is that from j to i: for each
/// pair the difference of two Poisson numbers against its error; 4 moves × 3 β × 6 pairs, level 0.01 together. And no
/// step enters the dark.
#[test]
fn flows_between_cells_balance_for_every_move() {
    let (target, rng) = (Square(cells), Rng::new(11));
    let alarm = Normal::standard().inverse_cdf(1.0 - 0.01 / (2.0 * 72.0));
    for (stream, (name, step)) in moves().into_iter().enumerate() {
        for (i, beta) in [0.2, 0.6, 1.0].into_iter().enumerate() {
            let starts = exact_draws(&target, beta, 16.0, 200_000, rng, (3 * stream + i) as u32);
            let mut flows = [[0.0f64; CELLS.len()]; CELLS.len()];
            for [from, to] in walk(&target, &starts, beta, step, 1, rng) {
                flows[cell(from)][cell(to)] += 1.0;
            }
            for from in 0..CELLS.len() {
                for to in 0..from {
                    let (there, back) = (flows[from][to], flows[to][from]);
                    let z = (there - back) / (there + back).max(1.0).sqrt();
                    assert!(z.abs() < alarm, "{name}, β = {beta}, cells {from} and {to}: {there} and {back}");
                    let is_dark = CELLS[from] == 0.0 || CELLS[to] == 0.0;
                    assert!(!is_dark || there + back == 0.0, "{name}: into the dark {flows:?}");
                }
            }
            let moved: f64 = flows.iter().enumerate().map(|(i, row)| row.iter().sum::<f64>() - row[i]).sum();
            assert!(moved > 0.0, "{name}, β = {beta}: nothing moves between cells");
        }
    }
}

/// By enumeration: π_h(i) π_c(j) α(i, j) = π_h(j) π_c(i) α(j, i) for swaps of tempered rungs, and the same with the uniform
/// distribution, dark cell included, as the hotter: an offer may be refused, but nothing dark climbs.
#[test]
fn swaps_and_offers_balance_exactly() {
    let ln_g = CELLS.map(|g| f64::from(g).ln());
    let uniform = vec![1.0 / CELLS.len() as f64; CELLS.len()];
    for (hotter, colder) in [(0.0, 0.3), (0.0, 1.0), (0.1, 0.2), (0.3, 1.0)] {
        let hot = if hotter == 0.0 { uniform.clone() } else { cell_shares(hotter) };
        let cold = cell_shares(colder);
        for i in 0..CELLS.len() {
            for j in (0..CELLS.len()).filter(|j| cold[*j] > 0.0) {
                let there = hot[i] * cold[j] * swap_acceptance(hotter, ln_g[i], colder, ln_g[j]);
                let back = match cold[i] > 0.0 {
                    true => hot[j] * cold[i] * swap_acceptance(hotter, ln_g[j], colder, ln_g[i]),
                    false => 0.0,
                };
                assert!((there - back).abs() < 1e-14, "β = {hotter} and {colder}, {i} and {j}: {there} and {back}");
            }
        }
    }
}

/// √n D of the sample against a distribution function, and the probability of one as large by chance
/// (Kolmogorov 1933; Stephens 1970 for finite n).
fn kolmogorov_smirnov(mut sample: Vec<f64>, cdf: impl Fn(f64) -> f64) -> (f64, f64) {
    sample.sort_by(f64::total_cmp);
    let n = sample.len() as f64;
    let gap = |(i, x): (usize, &f64)| (cdf(*x) - i as f64 / n).abs().max(((i + 1) as f64 / n - cdf(*x)).abs());
    let d = sample.iter().enumerate().map(gap).fold(0.0, f64::max);
    let x = d * (n.sqrt() + 0.12 + 0.11 / n.sqrt());
    let terms = (1..=100).map(f64::from).map(|k| (-1f64).powf(k - 1.0) * (-2.0 * (k * x).powi(2)).exp());
    (d * n.sqrt(), (2.0 * terms.sum::<f64>()).clamp(0.0, 1.0))
}

/// Range of ln g of the exponential target.
const S: f64 = 6.0;

fn exponential(_: f32, y: f32) -> f32 {
    (S as f32 * y).exp()
}

/// F(y) on the rung at β of the exponential target.
fn exponential_cdf(beta: f64) -> impl Fn(f64) -> f64 {
    move |y| (beta * S * y).exp_m1() / (beta * S).exp_m1()
}

/// 50,000 exact draws, before and after 1 and 30 moves of each kind: Kolmogorov–Smirnov, 24 tests, level 0.01 together.
#[test]
fn exact_draws_stay_distributed_as_the_rung_under_every_move() {
    let (target, rng) = (Square(exponential), Rng::new(5));
    for (stream, (name, step)) in moves().into_iter().enumerate() {
        for (i, (beta, steps)) in [(0.3, 1), (1.0, 1), (1.0, 30)].into_iter().enumerate() {
            let largest = S.exp() as f32;
            let starts = exact_draws(&target, beta, f64::from(largest), 50_000, rng, (10 * stream + i) as u32);
            let walked = walk(&target, &starts, beta, step, steps, rng);
            for (when, of) in ["before", "after"].into_iter().zip(0..) {
                let places: Vec<f64> = walked.iter().map(|pair| f64::from(pair[of])).collect();
                let (d, p) = kolmogorov_smirnov(places, exponential_cdf(beta));
                assert!(p > 0.01 / 24.0, "{name}, β = {beta}, {when} {steps} steps: √n D = {d}, p = {p}");
            }
        }
    }
}

/// What a rung of a group of ladders saw: shares of the cells.
fn shares(histogram: &Histogram) -> Vec<f64> {
    let mut sums = vec![0.0; CELLS.len()];
    for (ln_g, weight) in histogram.lit() {
        let nearest = (0..CELLS.len()).min_by(|a, b| {
            let distance = |i: usize| (f64::from(CELLS[i]).ln() - ln_g).abs();
            distance(*a).total_cmp(&distance(*b))
        });
        sums[nearest.expect("some cell")] += weight;
    }
    sums.iter().map(|sum| sum / histogram.total()).collect()
}

/// Whole sweeps, offers and swaps included, leave every rung where it was: ladders that start from exact draws are seen
/// at π_β in the first sweep, the second and the ninth. 256 groups of 32 ladders; shape and all by F, 3 ladders and sweeps
/// of up to 4 rungs with one and five offers: 54 tests, level 0.01 together.
#[test]
fn sweeps_leave_every_rung_as_it_was() {
    const GROUPS: u32 = 256;
    const LADDERS: usize = 32;
    let (target, rng) = (Square(cells), Rng::new(2));
    for (offers, betas) in [(1, vec![0.0, 1.0]), (1, vec![0.0, 0.4, 1.0]), (5, vec![0.0, 0.1, 0.3, 0.6, 1.0])] {
        let ladder = Ladder::new(betas);
        let rungs = ladder.rungs();
        let mut stage = Stage::new(ladder, &vec![0.0; rungs], 1, false);
        // with shorter steps a chain at another β would not leave its cell within nine sweeps
        stage.round.mixes.iter_mut().for_each(|mixes| mixes.fill(StepMix::about(5.0)));
        let (canvas, round) = (stage.canvas(), &stage.round);
        let draws: Vec<Vec<Start>> = (1..rungs)
            .map(|k| {
                exact_draws(&target, round.ladder.betas()[k], 16.0, GROUPS as usize * LADDERS, rng, 100 + k as u32)
            })
            .collect();
        // by sweep, rung and group: the shares of the cells
        let mut seen = vec![vec![Vec::new(); rungs]; 9];
        for group in 0..GROUPS as usize {
            let own = group * LADDERS..(group + 1) * LADDERS;
            let starts: Vec<&[Start]> = draws.iter().map(|of_rung| &of_rung[own.clone()]).collect();
            let mut block = Block::new(rng, (group, LADDERS), rungs, offers, 512, stage.layers.count, [1, 1]);
            block.start(&target, &starts);
            for of_sweep in &mut seen {
                block.forget_tempered();
                block.advance(&target, 1, &canvas, round);
                block.flush(&canvas, round);
                let mut histograms = vec![Histogram::default(); rungs];
                block.add_histograms(&mut histograms);
                of_sweep.iter_mut().zip(&histograms).for_each(|(of_rung, h)| of_rung.push(shares(h)));
            }
        }
        for sweep in [0, 1, 8] {
            for (k, &beta) in round.ladder.betas().iter().enumerate().skip(1) {
                let exact = cell_shares(beta);
                // what all cells have in common is the number of states; the lit cells but one say all
                let lit =
                    |values: &[f64]| -> Vec<f64> { (0..4).filter(|i| CELLS[*i] > 0.0).map(|i| values[i]).collect() };
                let groups: Vec<Vec<f64>> = seen[sweep][k].iter().map(|values| lit(values)).collect();
                let (f, p) = f_test(&groups, &lit(&exact), &[0.0; 3]);
                let mean: Vec<f64> = (0..5)
                    .map(|i| seen[sweep][k].iter().map(|values| values[i]).sum::<f64>() / f64::from(GROUPS))
                    .collect();
                assert!(p > 0.01 / 54.0, "sweep {sweep}, β = {beta}: F = {f}, p = {p}, {mean:?} for {exact:?}");
            }
        }
    }
}
