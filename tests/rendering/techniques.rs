//! Changes of technique: the same path, another technique, and a distribution that stays.

use relt::chain::{Evaluator, Walkers};
use relt::embree::Width;
use relt::path::{Mapping, MappingKind, Workspace, bidirectional::Chosen};
use relt::rng::{Counter, Purpose, Rng, open_unit_f64};
use relt::sample::{Move, Points, StepLaw};
use relt::scene::Scene;

use crate::support::{OWN, fixed_widths, load, own, repository, scene_of, statistics::t_test};

const LANES: usize = 256;

fn scenes() -> Vec<(&'static str, Scene)> {
    let other =
        ["cylinder-light", "disk-light", "everything", "instances", "point", "rough-metal", "smooth", "sphere-light"];
    let own = OWN.into_iter().map(|name| (name, own(name, &[("res", "64")])));
    let other =
        other.into_iter().map(|name| (name, load(&repository("tests/mitsuba").join(name).with_extension("xml"), &[])));
    let lens = "thinlens'><float name='fov' value='50'/><float name='aperture_radius' value='0.2'/>
        <float name='focus_distance' value='4'/>";
    own.chain(other).chain([("lens", table(lens)), ("parallel", table("orthographic'>"))]).collect()
}

/// A glass sphere and one of rough metal between a floor, a lamp of many triangles and a point light.
fn table(sensor: &str) -> Scene {
    scene_of(&format!(
        "<integrator type='path'><integer name='max_depth' value='7'/></integrator>
         <sensor type='{sensor}<transform name='to_world'>
           <lookat origin='0, 2, 4' target='0, 0.5, 0' up='0, 1, 0'/></transform>
           <film type='hdrfilm'><integer name='width' value='32'/><integer name='height' value='32'/></film></sensor>
         <shape type='rectangle'><transform name='to_world'><rotate x='1' angle='-90'/><scale value='3'/></transform>
           <bsdf type='diffuse'/></shape>
         <shape type='sphere'><point name='center' x='-0.4' y='0.5' z='0'/><float name='radius' value='0.4'/>
           <bsdf type='dielectric'/></shape>
         <shape type='sphere'><point name='center' x='0.5' y='0.5' z='0.2'/><float name='radius' value='0.4'/>
           <bsdf type='roughconductor'><string name='material' value='Au'/><float name='alpha' value='0.3'/></bsdf></shape>
         <shape type='cube'><transform name='to_world'><scale value='0.4'/><translate y='2.5'/></transform>
           <emitter type='area'><rgb name='radiance' value='9'/></emitter></shape>
         <emitter type='point'><point name='position' x='1' y='3' z='1'/><rgb name='intensity' value='4'/></emitter>"
    ))
}

fn multiplexed(scene: &Scene) -> Mapping<'_> {
    Mapping::new(scene, MappingKind::Multiplexed, fixed_widths(Width::W8)).with_technique_changes(true)
}

fn counters(ladder: u32, step: u64) -> Vec<Counter> {
    (0..LANES).map(|lane| Counter { ladder, replica: lane as u16, step, purpose: Purpose::Primary }).collect()
}

fn technique(mapping: &Mapping, points: &Points, lane: usize) -> Chosen {
    let block = mapping.layout().light_choices().expect("points choose");
    mapping.lengths().choose(points.block(block, lane))
}

/// Evaluates uniform points and puts the lit ones into chains; which these are.
fn start(mapping: &Mapping, evaluator: &mut Evaluator<Workspace>, walkers: &mut Walkers) -> Vec<usize> {
    evaluator.moves.fill(Move::Fresh);
    evaluator.evaluate(mapping, &walkers.points);
    let lit: Vec<usize> = (0..LANES).filter(|lane| !evaluator.out.lanes[*lane].is_dark()).collect();
    for &lane in &lit {
        walkers.replace(lane, (&evaluator.points, lane), &evaluator.out, &mut |_, _| {});
    }
    lit
}

/// Where on the film a state contributes: its own place or the one elsewhere.
fn place(whole: relt::path::Whole) -> [f32; 2] {
    whole.parts().find(|splat| splat.luminance() > 0.0).expect("a lit state").film
}

/// Of what is expected, all but those whose paths rounding leads elsewhere.
#[test]
fn another_technique_contributes_at_the_same_place_what_densities_say() {
    for (name, scene) in scenes() {
        let mapping = multiplexed(&scene);
        let mut evaluator = Evaluator::<Workspace>::new(Rng::new(5), counters(0, 0));
        let (mut all, mut same) = (0, 0);
        let mut worst = Vec::new();
        for round in 0..120 {
            let mut walkers = Walkers::new(LANES);
            evaluator.counters = counters(round, 0);
            let lit = start(&mapping, &mut evaluator, &mut walkers);
            evaluator.moves.fill(Move::Rest);
            for &lane in &lit {
                evaluator.change_technique(&mapping, &walkers.points, lane, [0.0, 0.5, 1.0][round as usize % 3]);
            }
            evaluator.evaluate(&mapping, &walkers.points);
            for lane in lit.into_iter().filter(|lane| evaluator.moves[*lane] == Move::Given) {
                all += 1;
                let change = evaluator.out.lanes[lane].ln_g - walkers.states[lane].ln_g;
                let error = (change - evaluator.expected[lane]).abs();
                let moved = if evaluator.out.lanes[lane].is_dark() {
                    1.0
                } else {
                    let [a, b] = [place(walkers.whole(lane)), place(evaluator.out.whole(lane))];
                    (a[0] - b[0]).abs().max((a[1] - b[1]).abs())
                };
                if error < 0.01 && moved < 1e-4 {
                    same += 1;
                } else {
                    let [from, to] = [&walkers.points, &evaluator.points].map(|p| technique(&mapping, p, lane));
                    worst.push(format!(
                        "({}, {}) to ({}, {}): {change} for {}, moved by {moved}",
                        from.light, from.camera, to.light, to.camera, evaluator.expected[lane]
                    ));
                }
            }
        }
        println!("{name}: {same} of {all}");
        worst.truncate(20);
        assert!(all > 50, "{name}: only {all} changes");
        assert!(same as f64 > 0.98 * f64::from(all), "{name}: {same} of {all};\n{}", worst.join("\n"));
    }
}

/// Batches that tests of stationarity compare, and their parts of up to 256 chains.
const BATCHES: u32 = 32;
const PARTS: u32 = 12;
/// Of each comparison; there are fewer than 500.
const LEVEL: f64 = 1e-6;

/// Uniform points that weigh g^β are exact draws from g^β, and stay so along a chain that leaves g^β unchanged: the
/// weighed frequency of techniques, and of ranges of ln g, is the same after steps as before, in expectation exactly.
/// Half of the steps change techniques. t-tests over 32 batches of their differences; on cold rungs, whose weights have
/// heavy tails, they would tell nothing. That the step ignores what is expected of ln g they notice in every scene.
#[test]
fn chains_that_change_techniques_stay_in_their_distribution() {
    for (name, scene) in scenes() {
        for beta in [0.3, 0.6] {
            stay(name, &multiplexed(&scene), beta);
        }
    }
}

fn stay(name: &str, mapping: &Mapping, beta: f64) {
    let classes = |points: &Points, lane: usize, ln_g: f64| {
        let Chosen { light, camera, .. } = technique(mapping, points, lane);
        let class = match (light, camera) {
            (0 | 1, _) => usize::from(light),
            (_, 1) => 2,
            (_, 2) => 3,
            _ => 4,
        };
        [class, 5 + usize::from(light + camera).min(9) - 2, 13 + (ln_g.clamp(-8.0, 7.9) + 8.0) as usize / 2]
    };
    let mut differences = vec![Vec::new(); 21];
    let mut evaluator = Evaluator::<Workspace>::new(Rng::new(9), counters(0, 0));
    let (mut changed, mut proposed) = (0.0, 0);
    for batch in 0..BATCHES {
        let mut sums = [0.0; 21];
        for part in 0..PARTS {
            let mut walkers = Walkers::new(LANES);
            let ladder = PARTS * batch + part;
            evaluator.counters = counters(ladder, 0);
            let lit = start(mapping, &mut evaluator, &mut walkers);
            let weights: Vec<f64> = walkers.states.iter().map(|state| (beta * state.ln_g).exp()).collect();
            let of = |walkers: &Walkers, lane: usize| classes(&walkers.points, lane, walkers.states[lane].ln_g);
            let before: Vec<[usize; 3]> =
                (0..LANES).map(|l| if lit.contains(&l) { of(&walkers, l) } else { [0; 3] }).collect();
            for step in 1..7 {
                evaluator.counters = counters(ladder, step);
                evaluator.moves.fill(Move::Rest);
                let decide = |lane: usize| {
                    let counter = Counter { purpose: Purpose::Step, ..evaluator.counters[lane] };
                    evaluator.rng().words(counter, 0).map(open_unit_f64)
                };
                let decisions: Vec<[f64; 4]> = (0..LANES).map(decide).collect();
                for &lane in &lit {
                    evaluator.moves[lane] = Move::Small(StepLaw::new(1.0 / 1024.0, 1.0 / 16.0));
                    if decisions[lane][1] < 0.5 {
                        evaluator.change_technique(mapping, &walkers.points, lane, beta);
                    }
                }
                evaluator.evaluate(mapping, &walkers.points);
                for &lane in lit.iter().filter(|lane| evaluator.moves[**lane] != Move::Rest) {
                    if evaluator.moves[lane] == Move::Given {
                        let alpha = evaluator.settle_change(&mut walkers, lane, beta, &mut |_, _| {});
                        (changed, proposed) = (changed + alpha.expect("a change"), proposed + 1);
                    } else {
                        let (from, u) = ((&evaluator.points, lane), decisions[lane][0]);
                        walkers.step(lane, beta, from, &evaluator.out, u, &mut |_, _| {});
                    }
                }
            }
            for &lane in &lit {
                for (from, to) in before[lane].into_iter().zip(of(&walkers, lane)).filter(|(from, to)| from != to) {
                    sums[from] -= weights[lane];
                    sums[to] += weights[lane];
                }
            }
        }
        differences.iter_mut().zip(sums).for_each(|(list, sum)| list.push(sum));
    }
    println!("{name}, β = {beta}: {proposed} changes, accepted {:.4}", changed / f64::from(proposed));
    for (class, list) in differences.iter().enumerate().filter(|(_, list)| list.iter().any(|d| *d != 0.0)) {
        let (t, p) = t_test(list, 0.0, 0.0);
        assert!(p > LEVEL, "{name}, β = {beta}, class {class}: t = {t}, p = {p}; {list:?}");
    }
}
