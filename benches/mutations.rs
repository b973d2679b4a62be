//! Mutations per second of whole methods on one thread, as the render loop runs them.
//!
//! `mutations/ladders/SCENE` puts replica exchange beside what it has to stand up to:
//! - `embree` traces, at the widths that calibration chose, the rays that uniform points of the cube give, and is told
//!   in *paths* a second: `path` divided by `embree` is the share of its time that a path tracer spends in Embree;
//! - `path` is the path tracer;
//! - `mlt` is Metropolis as the paper has it, `best-mlt` at the settings that served best;
//! - `re/K` is replica exchange on ladders of K rungs, with half of the evaluations for uniform points whatever K is, so
//!   that ladders are compared and not what a run would have made of them (on `cornell-box` it gives chains up);
//! - `re-auto` is replica exchange as it comes, which chooses rungs and that share itself.
//!
//! `mutations/packets/SCENE` has `mlt/W` and `re/W`, the latter with four rungs, with all rays in packets of W.
//!
//! `mutations/mappings/SCENE` has, for each mapping M, `path/M`, the path tracer by it, and `embree/M`, which traces the rays
//! of that mapping's uniform points and is told in paths a second as well: `path/M` divided by `embree/M` is the share of
//! its time in Embree. Each mapping has the packet widths that calibration chose for its own rays.
//!
//! Chains prefer some points to others, so their paths are longer or shorter: the numbers of rays that are printed
//! allow for that.

use std::cell::OnceCell;
use std::hint::black_box;
use std::time::Instant;

use criterion::measurement::WallTime;
use criterion::{
    Bencher, BenchmarkGroup, BenchmarkId, Criterion, SamplingMode, Throughput, criterion_group, criterion_main,
};
use relt::embree::{Hits, Rays, Width};
use relt::film::Footprint;
use relt::path::{MappingKind, Widths};
use relt::render::calibration::{LANES, record_rays};
use relt::render::engine::{Engine, Stage};
use relt::render::{self, LadderChoice, Method, MltSettings, Normalisation, Settings};
use relt::rng::Rng;
use relt::scene::Scene;

use support::Subject;

mod support;

/// Rungs of the ladders.
const RUNGS: [u32; 5] = [2, 4, 8, 16, 32];
/// Rungs where packet widths are compared.
const RUNGS_FOR_PACKETS: u32 = 4;
/// Mutations of replica exchange before the measurement: past the rounds in which it learns.
const LEARNING: u64 = 9 << 20;
/// Mutations that are measured at a time, about those of a slice of the render loop: splats are deposited at its end.
const SLICE: u64 = 1 << 17;
/// Mutations of a whole job, rounds and all, that stands for a measurement where criterion only tries everything once.
const SMOKE: u64 = 1 << 14;
/// Batches of paths whose rays are recorded.
const BATCHES: u64 = 64;

fn mutations(criterion: &mut Criterion) {
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global().expect("nobody started threads before");
    for subject in support::SCENES.map(Subject::new) {
        let mut runs = runs();
        ladders(criterion, &subject, &mut runs);
        packets(criterion, &subject, &mut runs);
        mappings(criterion, &subject);
    }
}

fn group<'c>(criterion: &'c mut Criterion, name: &str) -> BenchmarkGroup<'c, WallTime> {
    let mut group = criterion.benchmark_group(name);
    group.sampling_mode(SamplingMode::Flat).sample_size(10).nresamples(support::RESAMPLES);
    group.warm_up_time(support::WARM_UP).measurement_time(2 * support::MEASUREMENT);
    group
}

fn ladders(criterion: &mut Criterion, subject: &Subject, runs: &mut [Run]) {
    let mut group = group(criterion, &format!("mutations/ladders/{}", subject.name));
    bare_embree(&mut group, BenchmarkId::from_parameter("embree"), subject, MappingKind::Unidirectional);
    group.throughput(Throughput::Elements(SLICE));
    for run in runs {
        let id = match run.rungs {
            Some(rungs) => BenchmarkId::new(run.name, rungs),
            None => BenchmarkId::from_parameter(run.name),
        };
        group.bench_function(id, |bencher| run.measure(bencher, subject.scene(), subject.widths(run.mapping)));
    }
}

fn packets(criterion: &mut Criterion, subject: &Subject, runs: &mut [Run]) {
    let mut group = group(criterion, &format!("mutations/packets/{}", subject.name));
    group.throughput(Throughput::Elements(SLICE));
    // what a run has learnt does not depend on widths: it goes on with others
    for run in runs.iter_mut().filter(|run| run.name == "mlt" || run.rungs == Some(RUNGS_FOR_PACKETS)) {
        for width in Width::ALL {
            let widths = Widths { camera: width, bounce: width, shadow: width };
            group.bench_function(BenchmarkId::new(run.name, width), |bencher| {
                run.measure(bencher, subject.scene(), widths);
            });
        }
    }
}

fn mappings(criterion: &mut Criterion, subject: &Subject) {
    let mut group = group(criterion, &format!("mutations/mappings/{}", subject.name));
    for mapping in MappingKind::ALL {
        bare_embree(&mut group, BenchmarkId::new("embree", mapping.name()), subject, mapping);
        let settings = Settings { method: Method::Path, ..Settings::default() };
        let mut run = Run { name: "path", rungs: None, mapping, settings, engine: None };
        group.throughput(Throughput::Elements(SLICE));
        group.bench_function(BenchmarkId::new("path", mapping.name()), |bencher| {
            run.measure(bencher, subject.scene(), subject.widths(mapping));
        });
    }
}

/// A method, set up and past its beginnings as soon as it is first measured.
struct Run {
    name: &'static str,
    rungs: Option<u32>,
    mapping: MappingKind,
    settings: Settings,
    engine: Option<Box<dyn Engine>>,
}

fn runs() -> Vec<Run> {
    let run = |name, method, change: &dyn Fn(&mut Settings)| {
        let mut settings = Settings { method, ..Settings::default() };
        change(&mut settings);
        Run { name, rungs: None, mapping: MappingKind::Unidirectional, settings, engine: None }
    };
    let best = MltSettings { large_steps: 0.1, normalisation: Normalisation::Pooled, kelemen_weights: true };
    let mut all = vec![
        run("path", Method::Path, &|_| ()),
        run("mlt", Method::Mlt, &|_| ()),
        run("best-mlt", Method::Mlt, &|settings| settings.mlt = best),
        run("re-auto", Method::ReplicaExchange, &|_| ()),
    ];
    all.extend(RUNGS.map(|rungs| Run {
        rungs: Some(rungs),
        ..run("re", Method::ReplicaExchange, &|settings| {
            settings.ladder = LadderChoice::Replicas(rungs);
            settings.uniform_share = Some(0.5);
        })
    }));
    all
}

impl Run {
    fn measure(&mut self, bencher: &mut Bencher, scene: &Scene, widths: Widths) {
        let [width, height] = [scene.film.width, scene.film.height].map(f64::from);
        let planned = is_smoke_test().then_some(SMOKE as f64 / (width * height));
        let stage = Stage {
            mapping: self.settings.mapping(scene, self.mapping, widths, planned),
            footprint: Footprint::new(scene.film.filter, scene.film.width, scene.film.height),
            rng: Rng::new(self.settings.seed),
        };
        if is_smoke_test() {
            return bencher.iter(|| whole(render::engine(&stage, &self.settings, Some(SMOKE)).as_mut(), &stage));
        }
        if self.engine.is_none() {
            self.engine = Some(self.begin(&stage, scene));
        }
        let engine = self.engine.as_deref_mut().expect("it has begun");
        // sweeps differ in length from round to round: the time of those that were done, scaled to those asked for
        bencher.iter_custom(|slices| {
            let begin = Instant::now();
            let done = work(engine, &stage, slices * SLICE);
            begin.elapsed().mul_f64((slices * SLICE) as f64 / done as f64)
        });
    }

    fn begin(&self, stage: &Stage, scene: &Scene) -> Box<dyn Engine> {
        let mut engine = render::engine(stage, &self.settings, None);
        if self.settings.method == Method::ReplicaExchange {
            work(engine.as_mut(), stage, LEARNING);
        }
        let before = engine.counts();
        work(engine.as_mut(), stage, SLICE);
        let after = engine.counts();
        let rays = (after.rays - before.rays) as f64 / (after.mutations - before.mutations) as f64;
        let [width, height] = [scene.film.width, scene.film.height];
        println!("{width} × {height} pixels, {rays:.2} rays a mutation");
        engine
    }
}

/// Goes through all that a limited run has left.
fn whole(engine: &mut dyn Engine, stage: &Stage) {
    while engine.sweeps_left() != Some(0) {
        engine.advance(stage, u64::MAX, None);
    }
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

/// Whether criterion only tries every benchmark once (`cargo bench -- --test`).
fn is_smoke_test() -> bool {
    std::env::args().any(|argument| argument == "--test")
}

/// Traces the rays of uniform points of that mapping and does nothing else.
fn bare_embree(group: &mut BenchmarkGroup<WallTime>, id: BenchmarkId, subject: &Subject, mapping: MappingKind) {
    let recorded = OnceCell::new();
    let (mut hits, mut occluded) = (Hits::default(), Vec::new());
    group.throughput(Throughput::Elements(BATCHES * LANES));
    group.bench_function(id, |bencher| {
        let (tracer, widths) = (&subject.scene().tracer, subject.widths(mapping));
        let rays = recorded.get_or_init(|| {
            let rays = record_rays(subject.scene(), mapping, BATCHES);
            let total: usize = [&rays.camera, &rays.bounce, &rays.shadow].into_iter().flatten().map(Rays::len).sum();
            println!("{:.2} rays a path", total as f64 / (BATCHES * LANES) as f64);
            rays
        });
        bencher.iter(|| {
            for (width, batches) in [(widths.camera, &rays.camera), (widths.bounce, &rays.bounce)] {
                batches.iter().for_each(|rays| tracer.closest(width, rays, &mut hits));
            }
            rays.shadow.iter().for_each(|rays| tracer.occluded(widths.shadow, rays, &mut occluded));
            black_box((&hits, &occluded));
        });
    });
}

criterion_group!(benches, mutations);
criterion_main!(benches);
