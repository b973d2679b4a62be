//! What ladders cost beside their target, which costs next to nothing here, so that everything else shows.
//!
//! - `ladders/free/re/K` is whole sweeps of replica exchange on ladders of K rungs, on one thread and with about the same
//!   number of chains for all K; `ladders/free/mlt` as many chains of the baseline: what is between them is offers, swaps,
//!   weights of the combination, histograms and records. In mutations a second.
//! - `stages/ladders/swap/THREADS/K` is the swap phase of a sweep, told in the mutations of that sweep a second. States
//!   have gathered nothing between phases, so recording them is not part of it.

use std::time::Duration;

use criterion::{
    BenchmarkGroup, BenchmarkId, Criterion, Throughput, criterion_group, criterion_main, measurement::WallTime,
};
use rayon::prelude::*;
use relt::{
    chain::{Baseline, LARGE_STEP_PROBABILITY, LargeSteps, Recorder, Start, Target, resample},
    film::{Accumulator, Filter, Footprint, Splats},
    path::{Contribution, Contributions},
    rng::{Counter, Purpose, Rng, unit_f32},
    sample::Proposals,
    scene::Rgb,
    tempering::{Block, Canvas, Choices, Combine, Ladder, Layers, PointGroups, Round, StepMix, Weights},
};

/// Time that criterion runs each benchmark for before it measures, and while.
const WARM_UP: Duration = Duration::from_millis(200);
const MEASUREMENT: Duration = Duration::from_millis(800);
/// Few enough for plots to be drawn in a moment (`benches/support`).
const RESAMPLES: usize = 10_000;
/// Chains of a block, on ladders of any length.
const CHAINS: usize = 192;
/// Blocks that threads share.
const BLOCKS: usize = 8;
const FILM: u32 = 256;
/// Centre of the sizes of steps, in scales.
const STEPS: f64 = 2.0;

/// g(x) = 4 x², in grey; the film position is the rest of the block.
struct Free;

impl Target for Free {
    type Workspace = Vec<u32>;

    fn evaluate(&self, proposals: &mut Proposals, out: &mut Contributions, live: &mut Vec<u32>) {
        proposals.begin(live);
        proposals.draw(0, live);
        for &lane in &*live {
            let [x, column, row, _] = proposals.block(0, lane as usize).map(unit_f32);
            out.lanes[lane as usize] = Contribution::settle([column, row], Rgb::splat(4.0 * x * x)).0;
        }
    }
}

/// Blocks of ladders of `rungs` replicas that have gone through some sweeps.
struct Ladders {
    footprint: Footprint,
    film: Accumulator,
    layers: Layers,
    groups: PointGroups,
    round: Round,
    blocks: Vec<Block<Vec<u32>>>,
}

impl Ladders {
    fn new(rungs: usize, blocks: usize) -> Ladders {
        let ladder = Ladder::even(rungs);
        // g^β has the normaliser 4^β/(2β + 1)
        let ln_z: Vec<f64> = ladder.betas().iter().map(|beta| beta * 4f64.ln() - (2.0 * beta + 1.0).ln()).collect();
        let layers = Layers::of(&Choices { combine: Combine::Balance, ..Choices::default() }, rungs, false);
        let round = Round {
            weights: Weights::new(&ladder, &ln_z, 1.0, 0.0),
            mixes: std::array::from_fn(|_| vec![StepMix::about(STEPS); rungs]),
            effort: [1.0; 2],
            only_offers: true,
            open: false,
            half: u64::MAX,
            ladder,
        };
        let ladders = ladders_a_block(rungs);
        let mut all = Ladders {
            footprint: Footprint::new(Filter::Box, FILM, FILM),
            film: Accumulator::new(FILM, FILM, layers.count, 4.0),
            layers,
            groups: PointGroups::new(blocks),
            blocks: (0..blocks)
                .map(|i| Block::new(Rng::new(0), (i, ladders), rungs, 1, 512, layers.count, [FILM; 2]))
                .collect(),
            round,
        };
        let starts: Vec<Vec<Start>> = (1..rungs).map(|_| resample(&samples(), 1.0, ladders, Rng::new(0), 0)).collect();
        let starts: Vec<&[Start]> = starts.iter().map(Vec::as_slice).collect();
        all.blocks.iter_mut().for_each(|block| block.start(&Free, &starts));
        all.work(|block, canvas, round| block.advance(&Free, 16, canvas, round));
        all
    }

    /// Does something with every block in parallel, and empties their splats.
    fn work(&mut self, work: impl Fn(&mut Block<Vec<u32>>, &Canvas, &Round) + Sync) {
        let Ladders { footprint, film, layers, groups, round, blocks } = self;
        let canvas = Canvas { footprint, size: [FILM; 2], film, unit: 4.0, layers: *layers, probes: None, groups };
        blocks.par_iter_mut().for_each(|block| {
            work(block, &canvas, round);
            block.deposit(&canvas);
        });
    }
}

/// Uniform points of the target.
fn samples() -> Vec<Start> {
    let counter = |step| Counter { ladder: 0, replica: 0, step, purpose: Purpose::Bootstrap };
    let ln_g = |counter| {
        let x = unit_f32(Rng::new(0).words(counter, 0)[0]);
        Contribution::settle([0.0; 2], Rgb::splat(4.0 * x * x)).0.ln_g
    };
    (0..256).map(|step| Start { counter: counter(step), ln_g: ln_g(counter(step)) }).collect()
}

fn all(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("stages/ladders");
    group.warm_up_time(WARM_UP).measurement_time(MEASUREMENT).nresamples(RESAMPLES);
    for threads in [1, 2] {
        for rungs in [4, 8, 16, 32, 256] {
            swap(&mut group, rungs, threads);
        }
    }
    group.finish();
    let mut group = criterion.benchmark_group("ladders/free");
    group.warm_up_time(WARM_UP).measurement_time(MEASUREMENT).nresamples(RESAMPLES);
    baseline(&mut group);
    for rungs in [2, 4, 8, 16, 32, 64] {
        replica_exchange(&mut group, rungs);
    }
    group.finish();
}

/// Ladders of so many rungs in a block.
fn ladders_a_block(rungs: usize) -> usize {
    (CHAINS / (rungs - 1)).max(1)
}

/// Mutations of a sweep of a block: every chain moves, and every ladder is offered a point.
fn a_sweep(rungs: usize) -> u64 {
    (ladders_a_block(rungs) * rungs) as u64
}

fn swap(group: &mut BenchmarkGroup<WallTime>, rungs: usize, threads: usize) {
    let mut prepared = None;
    group.throughput(Throughput::Elements(BLOCKS as u64 * a_sweep(rungs)));
    group.bench_function(BenchmarkId::new(format!("swap/{threads}"), rungs), |bencher| {
        let (pool, ladders) = prepared.get_or_insert_with(|| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            let ladders = pool.install(|| Ladders::new(rungs, BLOCKS));
            (pool, ladders)
        });
        bencher.iter(|| pool.install(|| ladders.work(|block, canvas, round| block.swap(canvas, round))));
    });
}

fn replica_exchange(group: &mut BenchmarkGroup<WallTime>, rungs: usize) {
    let mut prepared = None;
    group.throughput(Throughput::Elements(a_sweep(rungs)));
    group.bench_function(BenchmarkId::new("re", rungs), |bencher| {
        let ladders = prepared.get_or_insert_with(|| Ladders::new(rungs, 1));
        bencher.iter(|| ladders.work(|block, canvas, round| block.advance(&Free, 1, canvas, round)));
    });
}

fn baseline(group: &mut BenchmarkGroup<WallTime>) {
    let large_steps = LargeSteps { probability: LARGE_STEP_PROBABILITY, kelemen_weights: false };
    let starts = resample(&samples(), 1.0, CHAINS, Rng::new(0), 0);
    let mut chains = Baseline::new(&Free, Rng::new(0), 0, &starts, large_steps);
    let (footprint, film) = (Footprint::new(Filter::Box, FILM, FILM), Accumulator::new(FILM, FILM, 1, 4.0));
    let mut splats = Splats::new(1);
    group.throughput(Throughput::Elements(CHAINS as u64));
    group.bench_function("mlt", |bencher| {
        bencher.iter(|| {
            let mut recorder = Recorder { footprint: &footprint, size: [FILM as f32; 2], splats: &mut splats };
            chains.advance(&Free, 1, 1.0, &mut recorder);
            film.deposit(&mut splats);
        });
    });
}

criterion_group!(benches, all);
criterion_main!(benches);
