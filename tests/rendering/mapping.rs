//! The batched mappings against the scalar ones, to the bit.

use relt::chain::Evaluator;
use relt::embree::Width;
use relt::path::{
    Cause, Contribution, Evaluation, Event, Faults, Mapping, MappingKind, Narration, Retraced, Workspace,
};
use relt::rng::{Counter, Purpose, Rng};
use relt::sample::{LIGHT_STREAM, Move, Points, Proposals, StepLaw};
use relt::scene::{Kernel, Scene};

use crate::support::{OWN, fixed_widths, load, own, repository};

/// No multiple of any packet width.
const LANES: usize = 61;
const STEPS: u64 = 60;
/// The film of stratified points, whose pixels are numbered as the lanes.
const FILM: [u32; 2] = [8, 8];

/// Steps large enough that paths change their length.
fn law() -> StepLaw {
    StepLaw::new(1.0 / 1024.0, 1.0 / 8.0)
}

/// Fresh points at first, then small steps from the last lit point, fresh points, stratified ones and rest,
/// in an order that differs from lane to lane: runs of stratified lanes fill whole chunks of lanes, or not.
fn moves(step: u64) -> Vec<Move> {
    let of_lane = |lane: u64| match (step + lane) % 8 {
        _ if step % 4 == 1 && lane % 32 < 20 => Move::Stratified,
        _ if step == 0 => Move::Fresh,
        0 => Move::Rest,
        1 => Move::Fresh,
        2 => Move::Stratified,
        _ => Move::Small(law()),
    };
    (0..LANES as u64).map(of_lane).collect()
}

fn counters(step: u64) -> Vec<Counter> {
    (0..LANES).map(|lane| Counter { ladder: lane as u32, replica: 3, step, purpose: Purpose::Primary }).collect()
}

fn bits(c: &Contribution) -> ([u32; 2], [u32; 3], u64) {
    (c.film.map(f32::to_bits), c.rgb.to_array().map(f32::to_bits), c.ln_g.to_bits())
}

/// The sum that a retraced path ends its camera's subpath with; black where it found nothing.
fn told_sum(events: &[Event]) -> [f64; 3] {
    let own = |event: &&Event| event.quantities.iter().all(|q| q.name != "film");
    let mut sums = events.iter().filter(own).flat_map(|event| &event.quantities).filter(|q| q.name == "sum so far");
    sums.next_back().map_or([0.0; 3], |sum| sum.values[..].try_into().expect("three channels"))
}

/// What that should be.
fn told_sum_of(got: &Contribution, retraced: &Retraced) -> [f64; 3] {
    match retraced.causes.is_none() {
        true => got.rgb.to_array().map(f64::from),
        false => told_sum(&retraced.events), // replaced by black
    }
}

/// All contributions and points that `STEPS` steps of the batch give, each compared with the scalar mapping.
fn compare(name: &str, scene: &Scene, kind: MappingKind, kernel: Kernel, width: Width) -> Vec<Contribution> {
    let mapping = Mapping::with_kernel(scene, kind, fixed_widths(width), kernel);
    let rng = Rng::new(7);
    let mut evaluator = Evaluator::<Workspace>::new(rng, counters(0));
    let mut current = Points::new(LANES);
    let mut all = Vec::new();
    let mut faults = Faults::default();
    for step in 0..STEPS {
        let moves = moves(step);
        evaluator.counters = counters(step);
        evaluator.moves = moves.clone();
        evaluator.film = FILM;
        let before = evaluator.out.lanes.clone();
        evaluator.evaluate(&mapping, &current);

        let mut points = Points::new(LANES);
        let counters = counters(step);
        let mut proposals = Proposals {
            rng,
            current: &current,
            given: &current,
            points: &mut points,
            counters: &counters,
            moves: &moves,
            film: FILM,
        };
        let mut live = Vec::new();
        proposals.begin(&mut live);
        for lane in (0..LANES).filter(|lane| moves[*lane] == Move::Rest) {
            assert_eq!(evaluator.out.lanes[lane], before[lane], "{name}: lane {lane} rests in step {step}");
        }
        let mut lit = Vec::new();
        for lane in live.into_iter().map(|lane| lane as usize) {
            let replay =
                format!("{name}, {} mapping, {kernel:?} kernel, width {width}, step {step}, lane {lane}", kind.name());
            let (expected, elsewhere, causes) = mapping.walk(&mut proposals, (lane, false), &mut Narration::unheard());
            let got = evaluator.out.lanes[lane];
            assert_eq!(bits(&got), bits(&expected), "{replay}: {got:?} for {expected:?}");
            let got_elsewhere = evaluator.out.elsewhere.of(lane);
            assert_eq!(got_elsewhere, elsewhere.of(0), "{replay}: elsewhere");
            faults.count(causes);
            let used = proposals.points.used(lane);
            assert_eq!(evaluator.points.used(lane), used, "{replay}: blocks");
            for block in (0..used[0]).chain(LIGHT_STREAM..LIGHT_STREAM + used[1]) {
                assert_eq!(evaluator.points.block(block, lane), proposals.block(block, lane), "{replay}: {block}");
            }
            if step % 8 == 0 {
                let evaluation = Evaluation::of(&proposals, lane).expect("the lane does not rest");
                let retraced = mapping.retrace(&evaluation);
                assert_eq!(bits(&retraced.contribution), bits(&got), "{replay}: retraced");
                assert_eq!(retraced.elsewhere.of(0), got_elsewhere, "{replay}: retraced elsewhere");
                assert_eq!(told_sum(&retraced.events), told_sum_of(&got, &retraced), "{replay}: {:?}", retraced.events);
            }
            all.push(got);
            if !got.is_dark() {
                lit.push(lane);
            }
        }
        for lane in lit {
            current.copy(lane, &points, lane);
        }
    }
    let by_cause = |faults: &Faults| Cause::ALL.map(|cause| faults.of(cause));
    assert_eq!(by_cause(&evaluator.out.faults), by_cause(&faults), "{name}: faults");
    all
}

fn every_width(name: &str, scene: &Scene, kernel: Kernel) -> Vec<Contribution> {
    for kind in MappingKind::ALL.into_iter().filter(|kind| *kind != MappingKind::Unidirectional) {
        let points = compare(name, scene, kind, kernel, Width::W8);
        let lit = points.iter().filter(|c| !c.is_dark()).count();
        assert!(lit >= 10, "{name}, {}: only {lit} of {} points are lit", kind.name(), points.len());
    }
    let uni = MappingKind::Unidirectional;
    let mut of_widths = Width::ALL.map(|width| compare(name, scene, uni, kernel, width)).into_iter();
    let first = of_widths.next().expect("there are widths");
    for other in of_widths {
        assert!(first.iter().zip(&other).all(|(a, b)| bits(a) == bits(b)), "{name}: widths differ");
    }
    let lit = first.iter().filter(|c| !c.is_dark()).count();
    assert!(lit >= 80, "{name}: only {lit} of {} points are lit, which says little", first.len());
    first
}

#[test]
fn every_lane_of_a_batch_is_what_the_scalar_mapping_says() {
    for name in OWN {
        let scene = own(name, &[("res", "64")]);
        let full = every_width(name, &scene, Kernel::Full);
        let plain = every_width(name, &scene, Kernel::Plain);
        let flat = every_width(name, &scene, Kernel::Flat);
        for other in [&plain, &flat] {
            assert!(full.iter().zip(other).all(|(a, b)| bits(a) == bits(b)), "{name}: kernels differ");
        }
        if scene.features.kernel() == Kernel::Diffuse {
            let diffuse = every_width(name, &scene, Kernel::Diffuse);
            assert!(full.iter().zip(&diffuse).all(|(a, b)| bits(a) == bits(b)), "{name}: kernels differ");
        }
    }
}

#[test]
fn batch_and_scalar_agree_where_a_scene_has_everything() {
    for name in [
        "everything",
        "mixtures",
        "orthographic",
        "picture-lights",
        "relief",
        "roulette",
        "roulette-late",
        "sky",
        "smooth",
        "smooth-emitter-light",
        "sphere-light",
        "textures",
        "thin-lens",
    ] {
        let scene = load(&repository("tests/mitsuba").join(name).with_extension("xml"), &[]);
        every_width(name, &scene, Kernel::Full);
    }
}

#[test]
fn the_small_kernel_is_chosen_where_it_is_enough() {
    let kernels = OWN.map(|name| own(name, &[]).features.kernel());
    assert_eq!(kernels, [Kernel::Diffuse, Kernel::Flat, Kernel::Diffuse], "{OWN:?}");
}

#[test]
fn replayed_hits_give_what_they_were_recorded_from() {
    for name in OWN {
        let scene = own(name, &[("res", "64")]);
        let mapping = Mapping::new(&scene, MappingKind::Unidirectional, fixed_widths(Width::W8));
        let evaluate = |evaluator: &mut Evaluator<Workspace>, step| {
            evaluator.moves.fill(Move::Fresh);
            evaluator.counters = counters(step);
            evaluator.evaluate(&mapping, &Points::new(0));
            evaluator.out.lanes.iter().map(bits).collect::<Vec<_>>()
        };
        let mut recording = Evaluator::with_workspace(Rng::new(7), counters(0), Workspace::recording());
        let traced = [0, 1, 2].map(|step| evaluate(&mut recording, step));
        let replay = Workspace::replaying(recording.workspace().take_recorded());
        let mut replaying = Evaluator::with_workspace(Rng::new(7), counters(0), replay);
        for round in 0..2 {
            let replayed = [0, 1, 2].map(|step| evaluate(&mut replaying, step));
            assert!(replayed == traced, "{name}, round {round}");
        }
    }
}
