//! What the stages of a mutation cost, each alone, in mutations a second on one thread.
//!
//! `stages/SCENE` has, for uniform points of the cube:
//! - `propose`: random words and points, fresh, stratified or by small steps, as many blocks as paths of that scene use;
//! - `trace`: Embree alone, on the rays of those points;
//! - `shade`: points to contributions with the hits known beforehand: vertices, lights, scattering, compaction of the
//!   paths that go on, and the drawing of blocks (`propose/fresh`), which goes on between bounces;
//! - `evaluate`: `trace` and `shade` together, on ever new points;
//! - `accept`: the Metropolis step with the expected weights of both states, along steps recorded from chains on the
//!   luminance, so that as many are accepted as in a render; weights are summed and not splatted;
//! - `splat`: contributions through the filter onto the film.
//!
//! What knows no scene is in `ladders.rs`: `stages/ladders/swap`, the stage `swap`, and whole sweeps on a target that
//! costs nothing.

use std::cell::OnceCell;
use std::hint::black_box;

use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use relt::chain::{Evaluator, Recorder, Start, Target, Walkers, replay, resample};
use relt::embree::Hits;
use relt::film::{Accumulator, Footprint, Splats};
use relt::path::{Contribution, Contributions, Mapping, MappingKind, Whole, Workspace};
use relt::render::calibration::{LANES, record_rays};
use relt::rng::{Counter, Purpose, Rng, open_unit_f64};
use relt::sample::{Move, Points, Proposals, StepLaw};

use support::Subject;

mod support;

/// Batches whose rays and hits are recorded: so many paths that no branch of theirs can be learnt by heart.
const BATCHES: u64 = 32;
/// Uniform points that the chains of `accept` start from, in batches, and steps that they make before they are recorded.
const STARTS: u64 = 64;
const FORGET: u64 = 64;
/// Steps that are recorded; more would not fit the nearer caches, where a render has what it has just proposed.
const STEPS: u64 = 16;

fn scenes(criterion: &mut Criterion) {
    for subject in support::SCENES.map(Subject::new) {
        let mut group = criterion.benchmark_group(format!("stages/{}", subject.name));
        group.throughput(Throughput::Elements(LANES)).sample_size(20).nresamples(support::RESAMPLES);
        group.warm_up_time(support::WARM_UP).measurement_time(support::MEASUREMENT);
        propose(&mut group, &subject);
        evaluate(&mut group, &subject);
        accept(&mut group, &subject);
        splat(&mut group, &subject);
        group.throughput(Throughput::Elements(BATCHES * LANES));
        trace(&mut group, &subject);
        shade(&mut group, &subject);
    }
}

/// A batch of lanes at uniform points, those whose rays are recorded.
fn evaluator<W: Default>(workspace: W) -> Evaluator<W> {
    let counter = |lane| Counter { ladder: lane as u32, replica: 0, step: 0, purpose: Purpose::Primary };
    let mut evaluator = Evaluator::with_workspace(Rng::new(0), (0..LANES).map(counter).collect(), workspace);
    evaluator.moves.fill(Move::Fresh);
    evaluator
}

/// The batch after its first evaluation.
fn evaluated(subject: &Subject) -> Evaluator<Workspace> {
    let mut paths = evaluator(Workspace::default());
    paths.evaluate(
        &Mapping::new(subject.scene(), MappingKind::Unidirectional, subject.widths(MappingKind::Unidirectional)),
        &Points::new(0),
    );
    paths
}

fn set_step<W>(evaluator: &mut Evaluator<W>, step: u64) {
    evaluator.counters.iter_mut().for_each(|counter| counter.step = step);
}

/// Draws as many blocks in every lane as a path at some point used there, and contributes nothing.
struct DrawOnly {
    /// By block: the lanes that get so far.
    lanes: Vec<Vec<u32>>,
}

impl DrawOnly {
    fn like(points: &Points) -> DrawOnly {
        let lanes = |block| (0..LANES as u32).filter(|&lane| points.has(block, lane as usize)).collect();
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

fn propose(group: &mut BenchmarkGroup<WallTime>, subject: &Subject) {
    let prepared = OnceCell::new();
    let small = Move::Small(StepLaw::KELEMEN);
    for (name, how) in [("fresh", Move::Fresh), ("stratified", Move::Stratified), ("small", small)] {
        let mut proposals = evaluator(Vec::new());
        proposals.moves.fill(how);
        let mut step = 0;
        group.bench_function(BenchmarkId::new("propose", name), |bencher| {
            let (points, draw) = prepared.get_or_init(|| {
                let points = evaluated(subject).points;
                let draw = DrawOnly::like(&points);
                (points, draw)
            });
            bencher.iter(|| {
                step += 1;
                set_step(&mut proposals, step);
                proposals.evaluate(draw, points);
            });
        });
    }
}

fn evaluate(group: &mut BenchmarkGroup<WallTime>, subject: &Subject) {
    let mut paths = evaluator(Workspace::default());
    let mut step = 0;
    group.bench_function("evaluate", |bencher| {
        let mapping =
            Mapping::new(subject.scene(), MappingKind::Unidirectional, subject.widths(MappingKind::Unidirectional));
        bencher.iter(|| {
            step += 1;
            set_step(&mut paths, step);
            paths.evaluate(&mapping, &Points::new(0));
        });
    });
}

fn trace(group: &mut BenchmarkGroup<WallTime>, subject: &Subject) {
    let recorded = OnceCell::new();
    let (mut hits, mut occluded) = (Hits::default(), Vec::new());
    group.bench_function("trace", |bencher| {
        let (tracer, widths) = (&subject.scene().tracer, subject.widths(MappingKind::Unidirectional));
        let rays = recorded.get_or_init(|| record_rays(subject.scene(), MappingKind::Unidirectional, BATCHES));
        bencher.iter(|| {
            rays.camera.iter().for_each(|rays| tracer.closest(widths.camera, rays, &mut hits));
            rays.bounce.iter().for_each(|rays| tracer.closest(widths.bounce, rays, &mut hits));
            rays.shadow.iter().for_each(|rays| tracer.occluded(widths.shadow, rays, &mut occluded));
            black_box((&hits, &occluded));
        });
    });
}

fn shade(group: &mut BenchmarkGroup<WallTime>, subject: &Subject) {
    let mut replayed = None;
    group.bench_function("shade", |bencher| {
        let mapping =
            Mapping::new(subject.scene(), MappingKind::Unidirectional, subject.widths(MappingKind::Unidirectional));
        let paths = replayed.get_or_insert_with(|| {
            evaluator(Workspace::replaying(record_rays(subject.scene(), MappingKind::Unidirectional, BATCHES)))
        });
        bencher.iter(|| {
            for step in 0..BATCHES {
                set_step(paths, step);
                paths.evaluate(&mapping, &Points::new(0));
            }
        });
        let mut traced = evaluator(Workspace::default());
        set_step(&mut traced, BATCHES - 1);
        traced.evaluate(&mapping, &Points::new(0));
        assert_eq!(paths.out.lanes, traced.out.lanes, "hits of other points were replayed");
    });
}

/// A step that chains made: what was proposed to them and the numbers that decided.
struct Step {
    points: Points,
    proposed: Contributions,
    decisions: Vec<f64>,
}

fn accept(group: &mut BenchmarkGroup<WallTime>, subject: &Subject) {
    let mut recorded = None;
    group.bench_function("accept", |bencher| {
        let (chains, steps) = recorded.get_or_insert_with(|| record_steps(subject));
        let mut next = (0..steps.len()).cycle();
        bencher.iter(|| {
            let step = &steps[next.next().expect("it goes round and round")];
            make(chains, step)
        });
    });
}

/// Every chain makes that step; returns the sum of the weights that states would have been splatted with, and of the
/// probabilities of acceptance.
fn make(chains: &mut Walkers, step: &Step) -> [f64; 2] {
    let [mut recorded, mut accepted] = [0.0; 2];
    for (lane, u) in step.decisions.iter().enumerate() {
        let mut record = |state: Whole, weight: f64| recorded += weight * f64::from(state.main.rgb.x);
        accepted += chains.step(lane, 1.0, (&step.points, lane), &step.proposed, *u, &mut record);
    }
    [recorded, accepted]
}

/// Chains on the luminance some time after their start, and their next steps.
fn record_steps(subject: &Subject) -> (Walkers, Vec<Step>) {
    let mapping =
        Mapping::new(subject.scene(), MappingKind::Unidirectional, subject.widths(MappingKind::Unidirectional));
    let mut paths = evaluator(Workspace::default());
    let mut samples = Vec::new();
    for number in 0..STARTS {
        set_step(&mut paths, number);
        paths.evaluate(&mapping, &Points::new(0));
        let sample = |(counter, state): (&Counter, &Contribution)| Start { counter: *counter, ln_g: state.ln_g };
        samples.extend(paths.counters.iter().zip(&paths.out.lanes).map(sample));
    }
    let mut chains = Walkers::new(LANES as usize);
    replay(&mapping, &resample(&samples, 1.0, LANES as usize, paths.rng(), 0), &mut chains, &mut paths);
    paths.moves.fill(Move::Small(StepLaw::KELEMEN));
    let mut steps = Vec::new();
    let mut accepted = 0.0;
    for number in STARTS..STARTS + FORGET + STEPS {
        set_step(&mut paths, number);
        paths.evaluate(&mapping, &chains.points);
        let decision = |counter: &Counter| Counter { purpose: Purpose::Step, ..*counter };
        let step = Step {
            points: paths.points.clone(),
            proposed: paths.out.clone(),
            decisions: paths.counters.iter().map(|c| open_unit_f64(paths.rng().words(decision(c), 0)[0])).collect(),
        };
        let [_, alphas] = make(&mut chains, &step);
        if number >= STARTS + FORGET {
            accepted += alphas;
            steps.push(step);
        }
    }
    println!("{:.2} of the steps are accepted", accepted / (STEPS * LANES) as f64);
    (chains, steps)
}

fn splat(group: &mut BenchmarkGroup<WallTime>, subject: &Subject) {
    let prepared = OnceCell::new();
    let mut splats = Splats::new(1);
    group.bench_function("splat", |bencher| {
        let (out, film, footprint, size) = prepared.get_or_init(|| {
            let scene = subject.scene();
            let [width, height] = [scene.film.width, scene.film.height];
            let film = Accumulator::new(width, height, 1, f64::from(scene.emitters.brightest()));
            let footprint = Footprint::new(scene.film.filter, width, height);
            (evaluated(subject).out, film, footprint, [width as f32, height as f32])
        });
        bencher.iter(|| {
            let mut recorder = Recorder { footprint, size: *size, splats: &mut splats };
            (0..out.lanes.len()).for_each(|lane| recorder.splat(0, out.whole(lane), 1.0, 1.0));
            film.deposit(&mut splats);
        });
    });
}

criterion_group!(benches, scenes);
criterion_main!(benches);
