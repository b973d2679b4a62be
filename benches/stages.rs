//! What the stages of a mutation cost, each alone, in mutations a second on one thread.
//!
//! - `propose`: random words and points, fresh, stratified or by small steps, as many blocks as paths of that scene use;
//! - `evaluate`: points to contributions, with `propose` and tracing;
//! - `trace`: Embree alone, on the rays of those points;
//! - `splat`: contributions through the filter onto the film;
//! - `ladder`: all that replica exchange adds to the evaluation (acceptance, swaps, weights, histograms, records of
//!   states), on a target that costs nothing.

use std::hint::black_box;

use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use relt::chain::{Evaluator, Recorder, Target};
use relt::embree::Hits;
use relt::film::{Accumulator, Footprint, Splats};
use relt::path::Contributions;
use relt::path::unidirectional::{Mapping, Widths, Workspace};
use relt::render::calibration::{LANES, calibrate, record_rays};
use relt::rng::{Counter, Purpose, Rng};
use relt::sample::{Move, Points, Proposals, StepLaw};
use relt::scene::Scene;

mod support;

fn scenes(criterion: &mut Criterion) {
    for name in support::SCENES {
        let scene = support::build(support::describe(name));
        let widths = calibrate(&scene);
        let mut group = group(criterion, &format!("stages/{name}"));
        propose(&mut group, &scene, widths);
        trace(&mut group, &scene, widths);
        evaluate(&mut group, &scene, widths);
        splat(&mut group, &scene, widths);
        group.finish();
    }
}

fn group<'c>(criterion: &'c mut Criterion, name: &str) -> BenchmarkGroup<'c, WallTime> {
    let mut group = criterion.benchmark_group(name);
    group.throughput(Throughput::Elements(LANES)).sample_size(20);
    group.warm_up_time(support::WARM_UP).measurement_time(support::MEASUREMENT);
    group
}

/// A batch of lanes at uniform points.
fn evaluator<W: Default>() -> Evaluator<W> {
    let counter = |lane| Counter { ladder: lane as u32, replica: 0, step: 0, purpose: Purpose::Primary };
    let mut evaluator = Evaluator::new(Rng::new(0), (0..LANES).map(counter).collect());
    evaluator.moves.fill(Move::Fresh);
    evaluator
}

fn next_step<W>(evaluator: &mut Evaluator<W>) {
    evaluator.counters.iter_mut().for_each(|counter| counter.step += 1);
}

/// Draws as many blocks in every lane as a path at some point used there, and contributes nothing.
struct DrawOnly {
    /// By block: the lanes that get so far.
    lanes: Vec<Vec<u32>>,
}

impl DrawOnly {
    fn like(points: &Points) -> DrawOnly {
        let lanes = |block| (0..LANES as u32).filter(|&lane| points.used(lane as usize) > block).collect();
        DrawOnly { lanes: (0..).map(lanes).take_while(|lanes: &Vec<u32>| !lanes.is_empty()).collect() }
    }
}

impl Target for DrawOnly {
    type Workspace = Vec<u32>;

    fn evaluate(&self, proposals: &mut Proposals, _: &mut Contributions, live: &mut Vec<u32>) {
        proposals.begin(live);
        for (block, lanes) in (0..).zip(&self.lanes) {
            proposals.draw(block, lanes);
        }
    }
}

fn propose(group: &mut BenchmarkGroup<WallTime>, scene: &Scene, widths: Widths) {
    let mut paths = evaluator::<Workspace>();
    paths.evaluate(&Mapping::new(scene, widths), &Points::new(0));
    let draw = DrawOnly::like(&paths.points);
    let small = Move::Small(StepLaw::KELEMEN);
    for (name, how) in [("fresh", Move::Fresh), ("stratified", Move::Stratified), ("small", small)] {
        let mut proposals = evaluator();
        proposals.moves.fill(how);
        group.bench_function(BenchmarkId::new("propose", name), |bencher| {
            bencher.iter(|| {
                next_step(&mut proposals);
                proposals.evaluate(&draw, &paths.points);
            });
        });
    }
}

fn trace(group: &mut BenchmarkGroup<WallTime>, scene: &Scene, widths: Widths) {
    let rays = record_rays(scene, 1);
    let (mut hits, mut occluded) = (Hits::default(), Vec::new());
    group.bench_function("trace", |bencher| {
        bencher.iter(|| {
            rays.camera.iter().for_each(|rays| scene.tracer.closest(widths.camera, rays, &mut hits));
            rays.bounce.iter().for_each(|rays| scene.tracer.closest(widths.bounce, rays, &mut hits));
            rays.shadow.iter().for_each(|rays| scene.tracer.occluded(widths.shadow, rays, &mut occluded));
            black_box((&hits, &occluded));
        });
    });
}

fn evaluate(group: &mut BenchmarkGroup<WallTime>, scene: &Scene, widths: Widths) {
    let mapping = Mapping::new(scene, widths);
    let mut paths = evaluator::<Workspace>();
    let nowhere = Points::new(0);
    group.bench_function("evaluate", |bencher| {
        bencher.iter(|| {
            next_step(&mut paths);
            paths.evaluate(&mapping, &nowhere);
        });
    });
}

fn splat(group: &mut BenchmarkGroup<WallTime>, scene: &Scene, widths: Widths) {
    let mut paths = evaluator::<Workspace>();
    paths.evaluate(&Mapping::new(scene, widths), &Points::new(0));
    let [width, height] = [scene.film.width, scene.film.height];
    let film = Accumulator::new(width, height, 1, f64::from(scene.emitters.brightest()));
    let footprint = Footprint::new(scene.film.filter, width, height);
    let mut splats = Splats::new(1);
    group.bench_function("splat", |bencher| {
        bencher.iter(|| {
            let size = [width as f32, height as f32];
            let mut recorder = Recorder { footprint: &footprint, size, splats: &mut splats };
            paths.out.lanes.iter().for_each(|contribution| recorder.splat(0, contribution, 1.0, 1.0));
            film.deposit(&mut splats);
        });
    });
}

criterion_group!(benches, scenes);
criterion_main!(benches);
