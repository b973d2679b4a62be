//! Open points: all that a point of the multiplexed mapping may turn out to be, at once.

use relt::embree::Width;
use relt::path::{Contributions, Mapping, MappingKind, Outcome, Workspace};
use relt::render::{Combine, Method, Settings};
use relt::rng::{Counter, Purpose, Rng};
use relt::sample::{Move, PixelOrder, Points, Proposals};
use relt::scene::Scene;

use crate::support::{fixed_widths, load, own, repository};

const LANES: usize = 64;

/// Scenes whose paths have no more edges than [`LONGEST`].
fn scenes() -> Vec<(&'static str, Scene)> {
    let depth = [("res", "32"), ("max_depth", "6"), ("rr_depth", "3")];
    let of_mitsuba = ["cylinder-light", "everything", "rough-metal", "sphere-light"];
    let own = ["caustic", "lattice"].into_iter().map(|name| (name, own(name, &depth)));
    let others = of_mitsuba
        .into_iter()
        .map(|name| (name, load(&repository("tests/mitsuba").join(name).with_extension("xml"), &[])));
    own.chain(others).collect()
}

/// Edges of the longest paths that are compared.
const LONGEST: usize = 6;

/// Evaluates uniform points, whose choice is the given block where there is one.
fn evaluate(mapping: &Mapping, choice: Option<[u32; 2]>, open: bool) -> Contributions {
    let rng = Rng::new(9);
    let counters: Vec<Counter> = (0..LANES)
        .map(|lane| Counter { ladder: 3, replica: lane as u16, step: 0, purpose: Purpose::Primary })
        .collect();
    let (mut given, mut points) = (Points::new(LANES), Points::new(LANES));
    if let Some([length, technique]) = choice {
        let block = mapping.layout().light_choices().expect("points choose");
        given.reserve(block);
        for (lane, counter) in counters.iter().enumerate() {
            let [light, _, _, last] = rng.words(*counter, block);
            given.set(block, lane, [light, length, technique, last]);
        }
    }
    let (mut out, mut workspace) = (Contributions::new(LANES), Workspace::default());
    let mut proposals = Proposals {
        rng,
        current: &given,
        given: &given,
        points: &mut points,
        counters: &counters,
        moves: &[Move::Given; LANES],
        film: [1, 1],
    };
    if open {
        mapping.evaluate_open(&mut proposals, &mut out, &mut workspace);
    } else {
        mapping.evaluate(&mut proposals, &mut out, &mut workspace);
    }
    out
}

/// A word by which paths of so many edges are chosen.
fn length_word(mapping: &Mapping, edges: usize) -> u32 {
    (0..1 << 12)
        .map(|i| i << 20)
        .find(|word| {
            let chosen = mapping.lengths().choose([0, *word, 0, 0]);
            usize::from(chosen.light + chosen.camera) - 1 == edges
        })
        .expect("paths of that length are chosen")
}

/// What a point contributes that chooses technique after technique is what its outcomes say, over their chances; and
/// points that choose contribute nothing that is no outcome, but where roulette ends open ones.
#[test]
fn outcomes_are_what_points_contribute_that_choose_them() {
    for (name, scene) in scenes() {
        let mapping = Mapping::new(&scene, MappingKind::Multiplexed, fixed_widths(Width::W8));
        let outcomes = evaluate(&mapping, None, true).outcomes;
        let longest = usize::from(mapping.layout().max_depth()).min(LONGEST);
        let mut open: Vec<Vec<Outcome>> = (0..LANES).map(|lane| outcomes.of(lane).to_vec()).collect();
        let all = open.iter().flatten().filter(|outcome| outcome.splat.luminance() > 0.0).count();
        let (mut found, mut lost) = (0, 0);
        for edges in 1..=longest {
            let length = length_word(&mapping, edges);
            for light in 0..=if edges == 1 { 0 } else { edges } {
                let technique = mapping.lengths().technique_word(edges, light, 1 << 31);
                let chosen = evaluate(&mapping, Some([length, technique]), false);
                for (lane, open) in open.iter_mut().enumerate() {
                    let whole = chosen.whole(lane);
                    let Some(part) = whole.parts().find(|part| part.luminance() > 0.0) else { continue };
                    let same = |outcome: &Outcome| {
                        let value = outcome.splat.luminance() / f64::from(outcome.chance);
                        outcome.splat.film == part.film
                            && (value / part.luminance() - 1.0).abs() < 1e-3
                            && (outcome.ln_g - whole.main.ln_g).abs() < 1e-3
                    };
                    match open.iter().position(same) {
                        Some(i) => {
                            let outcome = open.swap_remove(i);
                            assert_eq!(outcome.own, light != edges || edges == 1, "{name}: {edges} edges, {light}");
                            found += 1;
                        }
                        None => lost += 1,
                    }
                }
            }
        }
        let left = open.iter().flatten().filter(|outcome| outcome.splat.luminance() > 0.0).count();
        assert!(found > LANES / 4, "{name}: {found} outcomes found");
        assert_eq!(found + left, all, "{name}");
        if usize::from(mapping.layout().max_depth()) <= LONGEST {
            assert_eq!(left, 0, "{name}: outcomes that no choice leads to, of {all}");
        }
        let plays = mapping.layout().roulette_from().is_some_and(|bounce| usize::from(bounce) + 2 <= longest);
        assert!(lost == 0 || plays && lost < found / 2, "{name}: {lost} choices are no outcomes, {found} are");
    }
}

/// Luminance that a pass of stratified points has as its outcomes: of those that points may choose, and of others.
fn passes(mapping: &Mapping, count: usize) -> Vec<[f64; 2]> {
    let film = [mapping.scene().film.width, mapping.scene().film.height];
    let pixels = (film[0] * film[1]) as usize;
    let (nowhere, mut points) = (Points::new(0), Points::new(pixels));
    let (mut out, mut workspace) = (Contributions::new(pixels), Workspace::default());
    let mut pass = |number: usize| {
        let counters: Vec<Counter> = PixelOrder::new(film).points_from((number * pixels) as u64).take(pixels).collect();
        let mut proposals = Proposals {
            rng: Rng::new(4),
            current: &nowhere,
            given: &nowhere,
            points: &mut points,
            counters: &counters,
            moves: &vec![Move::Stratified; pixels],
            film,
        };
        mapping.evaluate_open(&mut proposals, &mut out, &mut workspace);
        let mut sums = [0.0; 2];
        for (lane, counter) in counters.iter().enumerate() {
            for outcome in out.outcomes.of(lane) {
                sums[usize::from(outcome.chance == 0.0)] += outcome.splat.luminance();
                if outcome.own {
                    let [x, y] = [0, 1].map(|i| (outcome.splat.film[i] * film[i] as f32) as u32);
                    assert_eq!(y * film[0] + x, counter.ladder, "in the pixel of its point");
                }
            }
        }
        sums
    };
    (0..count).map(&mut pass).collect()
}

/// Lamps and sky that are seen directly or by way of perfect lobes only are no longer among what points choose; what open points
/// find of them by looks of their own has the same mean, and all else is the same to the bit.
#[test]
fn light_in_plain_view_is_left_to_looks() {
    let depth = [("res", "16"), ("max_depth", "6")];
    let scenes = [("glass", load(&repository("tests/mitsuba/glass.xml"), &[])), ("caustic", own("caustic", &depth))];
    for (name, scene) in &scenes {
        let mapping = || Mapping::new(scene, MappingKind::Multiplexed, fixed_widths(Width::W8));
        let (chosen, left) = (mapping(), mapping().with_views_left_open(true));
        let mut differences = Vec::new();
        let (mut among, mut looked) = (0.0, 0.0);
        for ([all, none], [others, views]) in passes(&chosen, PASSES).into_iter().zip(passes(&left, PASSES)) {
            assert_eq!(none, 0.0, "{name}");
            (among, looked) = (among + all - others, looked + views);
            differences.push(all - others - views);
        }
        let mean = differences.iter().sum::<f64>() / PASSES as f64;
        let square = differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (PASSES - 1) as f64;
        let z = mean / (square / PASSES as f64).sqrt();
        // level 6·10⁻⁵ for each scene
        assert!(z.abs() < 4.0 && looked > 0.0, "{name}: {among} among all, {looked} by looks, z = {z:.2}");
    }
    let (_, glass) = &scenes[0];
    let mapping = || Mapping::new(glass, MappingKind::Multiplexed, fixed_widths(Width::W8));
    let [chosen, left] = [mapping(), mapping().with_views_left_open(true)].map(|mapping| {
        let technique = mapping.lengths().technique_word(1, 0, 1 << 31);
        let points = evaluate(&mapping, Some([length_word(&mapping, 1), technique]), false);
        points.lanes.iter().filter(|lane| !lane.is_dark()).count()
    });
    assert!(
        chosen > 0 && left == 0,
        "{chosen} points that choose an edge see the sky, {left} where that is left to looks"
    );
}

const PASSES: usize = 200;

/// What only open points find is left to them where there are any, and where no image is made without them.
#[test]
fn views_are_left_to_open_points_only_where_there_are_any() {
    let scene = own("caustic", &[("res", "16")]);
    let left = |settings: Settings, planned: Option<f64>| {
        let mapping = settings.mapping(&scene, MappingKind::Multiplexed, fixed_widths(Width::W8), planned);
        mapping.views_left_open()
    };
    assert!(left(Settings::default(), None) && left(Settings::default(), Some(1000.0)));
    assert!(!left(Settings::default(), Some(16.0)), "too short a run");
    assert!(!left(Settings { method: Method::Path, ..Settings::default() }, None));
    assert!(!left(Settings { method: Method::Mlt, ..Settings::default() }, None));
    assert!(!left(Settings { layers: true, ..Settings::default() }, None));
    assert!(!left(Settings { combine: Combine::Power, ..Settings::default() }, None));
    let unidirectional =
        Settings::default().mapping(&scene, MappingKind::Unidirectional, fixed_widths(Width::W8), None);
    assert!(!unidirectional.views_left_open(), "points that choose nothing");
}

#[test]
fn other_mappings_have_one_outcome() {
    let scene = own("caustic", &[("res", "16")]);
    for kind in MappingKind::ALL {
        let mapping = Mapping::new(&scene, kind, fixed_widths(Width::W8));
        assert_eq!(mapping.has_outcomes(), kind == MappingKind::Multiplexed, "{kind:?}");
    }
}
