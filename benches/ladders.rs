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
use relt::{
    chain::{Baseline, LARGE_STEP_PROBABILITY, LargeSteps, Recorder, Target, resample},
    film::{Accumulator, Filter, Footprint, Splats},
    path::{Contribution, Contributions},
    rng::{Rng, unit_f32},
    sample::Proposals,
    scene::Rgb,
    tempering::Ladder,
};
use support::ladders::{CHAINS, Film, Ladders, ladders_a_block, samples};

mod support;

/// Time that criterion runs each benchmark for before it measures, and while.
const WARM_UP: Duration = Duration::from_millis(200);
const MEASUREMENT: Duration = Duration::from_millis(800);
/// Few enough for plots to be drawn in a moment (`benches/support`).
const RESAMPLES: usize = 10_000;
/// Blocks that threads share.
const BLOCKS: usize = 8;
const FILM: u32 = 256;

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

/// Mutations of a sweep of a block: every chain moves, and every ladder is offered a point.
fn a_sweep(rungs: usize) -> u64 {
    (ladders_a_block(rungs) * rungs) as u64
}

/// Ladders on the target that costs nothing, whose normalisers are 4^β/(2β + 1).
fn ladders(rungs: usize, blocks: usize) -> Ladders<Vec<u32>> {
    let ladder = Ladder::even(rungs);
    let ln_z: Vec<f64> = ladder.betas().iter().map(|beta| beta * 4f64.ln() - (2.0 * beta + 1.0).ln()).collect();
    let film = Film { footprint: Footprint::new(Filter::Box, FILM, FILM), size: [FILM; 2], brightest: 4.0 };
    Ladders::new(&Free, film, (ladder, &ln_z), &samples(&Free), (blocks, 1))
}

fn swap(group: &mut BenchmarkGroup<WallTime>, rungs: usize, threads: usize) {
    let mut prepared = None;
    group.throughput(Throughput::Elements(BLOCKS as u64 * a_sweep(rungs)));
    group.bench_function(BenchmarkId::new(format!("swap/{threads}"), rungs), |bencher| {
        let (pool, ladders) = prepared.get_or_insert_with(|| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            let ladders = pool.install(|| ladders(rungs, BLOCKS));
            (pool, ladders)
        });
        bencher.iter(|| pool.install(|| ladders.work(|block, canvas, round| block.swap(canvas, round))));
    });
}

fn replica_exchange(group: &mut BenchmarkGroup<WallTime>, rungs: usize) {
    let mut prepared = None;
    group.throughput(Throughput::Elements(a_sweep(rungs)));
    group.bench_function(BenchmarkId::new("re", rungs), |bencher| {
        let ladders = prepared.get_or_insert_with(|| ladders(rungs, 1));
        bencher.iter(|| ladders.work(|block, canvas, round| block.advance(&Free, 1, canvas, round)));
    });
}

fn baseline(group: &mut BenchmarkGroup<WallTime>) {
    let large_steps = LargeSteps { probability: LARGE_STEP_PROBABILITY, kelemen_weights: false };
    let starts = resample(&samples(&Free), 1.0, CHAINS, Rng::new(0), 0);
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
