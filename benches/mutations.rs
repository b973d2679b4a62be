//! Mutations per second of every method on one thread, and bare Embree tracing of the rays of as many paths.
//!
//! `embree` traces, at the widths that calibration chose, the rays that uniform points of the cube give, and is told
//! in *paths* a second: `path` divided by `embree` is the share of its time that a path tracer spends in Embree.
//! Chains prefer some points to others, so their paths are longer or shorter: the numbers of rays that are printed
//! allow for that.

use std::hint::black_box;
use std::time::Instant;

use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, Criterion, SamplingMode, Throughput, criterion_group, criterion_main};
use relt::embree::{Hits, Rays};
use relt::film::Footprint;
use relt::path::unidirectional::{Mapping, Widths};
use relt::render::calibration::{LANES, calibrate, record_rays};
use relt::render::engine::{Engine, Stage};
use relt::render::{self, LadderChoice, Method, Settings};
use relt::rng::Rng;
use relt::scene::Scene;

mod support;

/// Mutations before the measurement: past the rounds in which replica exchange learns.
const WARM_START: u64 = 9 << 20;
/// Mutations that are measured at a time, about those of a slice of the render loop: splats are deposited at its end.
const SLICE: u64 = 1 << 17;
/// Batches of paths whose rays are recorded.
const BATCHES: u64 = 64;

fn mutations(criterion: &mut Criterion) {
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global().expect("nobody started threads before");
    for name in support::SCENES {
        let scene = support::build(support::describe(name));
        let widths = calibrate(&scene);
        let mut group = criterion.benchmark_group(format!("mutations/{name}"));
        group.sampling_mode(SamplingMode::Flat).sample_size(10);
        group.warm_up_time(support::WARM_UP).measurement_time(2 * support::MEASUREMENT);
        bare_embree(&mut group, &scene, widths);
        for (name, settings) in methods() {
            method(&mut group, &name, &settings, &scene, widths);
        }
        group.finish();
    }
}

fn methods() -> Vec<(String, Settings)> {
    let settings = |method| Settings { method, ..Settings::default() };
    let ladder = |k| Settings { ladder: LadderChoice::Replicas(k), ..settings(Method::ReplicaExchange) };
    let mut all: Vec<_> = [Method::Path, Method::Mlt].map(|m| (m.name().to_owned(), settings(m))).into();
    all.extend([2, 4, 8].map(|k| (format!("re/{k}"), ladder(k))));
    all
}

fn method(group: &mut BenchmarkGroup<WallTime>, name: &str, settings: &Settings, scene: &Scene, widths: Widths) {
    let stage = Stage {
        mapping: Mapping::new(scene, widths),
        footprint: Footprint::new(scene.film.filter, scene.film.width, scene.film.height),
        rng: Rng::new(settings.seed),
    };
    let mut engine = render::engine(&stage, settings, None);
    group.throughput(Throughput::Elements(SLICE));
    let mut cold = true;
    group.bench_function(name, |bencher| {
        if std::mem::take(&mut cold) {
            warm_up(engine.as_mut(), &stage, name);
        }
        // sweeps differ in length from round to round: the time of those that were done, scaled to those asked for
        bencher.iter_custom(|slices| {
            let begin = Instant::now();
            let done = work(engine.as_mut(), &stage, slices * SLICE);
            begin.elapsed().mul_f64((slices * SLICE) as f64 / done as f64)
        });
    });
}

/// Goes through at least so many mutations, and tells how many they were.
fn work(engine: &mut dyn Engine, stage: &Stage, mutations: u64) -> u64 {
    let begin = engine.counts().mutations;
    loop {
        engine.advance(stage, 1, None);
        let done = engine.counts().mutations - begin;
        if done >= mutations {
            return done;
        }
    }
}

fn warm_up(engine: &mut dyn Engine, stage: &Stage, name: &str) {
    if !is_smoke_test() {
        work(engine, stage, WARM_START);
    }
    let before = engine.counts();
    work(engine, stage, SLICE);
    let after = engine.counts();
    println!("{name}: {:.2} rays a mutation", ratio(after.rays - before.rays, after.mutations - before.mutations));
}

/// Whether criterion only tries every benchmark once (`cargo bench -- --test`).
fn is_smoke_test() -> bool {
    std::env::args().any(|argument| argument == "--test")
}

fn bare_embree(group: &mut BenchmarkGroup<WallTime>, scene: &Scene, widths: Widths) {
    let rays = record_rays(scene, BATCHES);
    let total: usize = [&rays.camera, &rays.bounce, &rays.shadow].into_iter().flatten().map(Rays::len).sum();
    let paths = BATCHES * LANES;
    println!("embree: {:.2} rays a path; widths {widths:?}", ratio(total as u64, paths));
    let (mut hits, mut occluded) = (Hits::default(), Vec::new());
    group.throughput(Throughput::Elements(paths));
    group.bench_function("embree", |bencher| {
        bencher.iter(|| {
            for (width, batches) in [(widths.camera, &rays.camera), (widths.bounce, &rays.bounce)] {
                batches.iter().for_each(|rays| scene.tracer.closest(width, rays, &mut hits));
            }
            rays.shadow.iter().for_each(|rays| scene.tracer.occluded(widths.shadow, rays, &mut occluded));
            black_box((&hits, &occluded));
        });
    });
}

fn ratio(a: u64, b: u64) -> f64 {
    a as f64 / b as f64
}

criterion_group!(benches, mutations);
criterion_main!(benches);
