//! One scene at all scales, and far from the origin.
//!
//! Radiance does not change with the unit of length. Two scenes with known radiance are scaled: a room with slanted walls
//! that glow, where whatever leaves the room or meets its own wall is missing; and an integrating sphere, where light
//! comes by a shadow ray from a small light. (By light subpaths it does so too, and the two take lengths differently.)
//! Scaling by a power of two is exact in floating point, so that path tracing comes to the same bits.

use super::{
    Bench, Case, Check,
    bench::{Effort, Goal, described, way},
    scenes::{diffuse, glowing, integrating_sphere, room, series, sphere, view},
};
use crate::path::MappingKind;
use crate::render::Method;

/// Longest paths.
const EDGES: i32 = 4;
const ALBEDO: f64 = 0.5;
/// Radius of the light in the integrating sphere, in radii of that.
const LIGHT: f64 = 0.1;
const EFFORT: Effort = Effort { runs: 16, mutations_per_pixel: 96.0 };

/// The cases.
pub(super) fn cases() -> Vec<Case> {
    let scales = [1e-5, 1e-4, 1e-3, 1e-2, 1.0, 1e2, 1e4, 1e6];
    let mut cases = Vec::new();
    for unit in scales {
        cases.push(
            Case::new(
                format!("scale/{unit:e}"),
                format!("glowing room and integrating sphere of size {unit:e} look like Σ aⁱ and like E a/π"),
                move |bench| of_unit(bench, unit, 0.0),
            )
            .quick_if([1e-5, 1e6].contains(&unit)),
        );
    }
    cases.push(Case::new(
        "scale/far-away",
        "the same scenes of size 10⁵, 10⁶ from the origin, where coordinates are known to 1/16",
        |bench| of_unit(bench, 1e5, 1e6),
    ));
    cases.push(
        Case::new(
            "scale/powers-of-two",
            "path tracing gives the same bits at sizes 2⁻¹⁷, 2⁻⁹ and 1: pixels that differ",
            powers_of_two,
        )
        .quick(),
    );
    cases
}

/// The two scenes of a size and at a distance.
fn scenes(unit: f64, distance: f64) -> [(String, f64); 2] {
    let place = |p: [f64; 3]| p.map(|x| x + distance / unit);
    let center = [distance; 3];
    let [eye, target] = [place([0.5, 0.3, -0.2]), place([0.9, 0.1, -0.5])];
    [
        (
            view(unit, [eye, target], 80.0, EDGES) + &room(center, unit, &(diffuse(ALBEDO) + &glowing(1.0))),
            series(ALBEDO, EDGES),
        ),
        (
            view(unit, [eye, target], 80.0, EDGES)
                + &sphere(center, unit, true, &diffuse(ALBEDO))
                + &sphere(center, LIGHT * unit, false, &(diffuse(0.0) + &glowing(100.0))),
            100.0 * integrating_sphere(ALBEDO, LIGHT, EDGES),
        ),
    ]
}

fn of_unit(bench: &Bench, unit: f64, distance: f64) -> Vec<Check> {
    let mut checks = Vec::new();
    for ((elements, expected), name) in scenes(unit, distance).into_iter().zip(["room", "sphere"]) {
        let scene = bench.scene(&elements);
        checks.extend(
            bench.all_ways_give(&scene, Goal::new(expected, 0.3), EFFORT).into_iter().map(|check| check.of(name)),
        );
    }
    checks
}

/// Path tracing by all mappings, with the same seed, at sizes that are powers of two.
fn powers_of_two(bench: &Bench) -> Vec<Check> {
    let mut checks = Vec::new();
    let effort = Effort { runs: 1, mutations_per_pixel: 64.0 };
    for mapping in MappingKind::ALL {
        let way = way(Method::Path, mapping);
        let pixels = |power: i32, which: usize| {
            // scaled after loading, where all numbers are rounded already
            let scaled = described(&scenes(1.0, 0.0)[which].0).scaled(2f32.powi(power));
            let outcomes = bench.runs(&bench.scene_of(scaled), &way, effort);
            outcomes.into_iter().flat_map(|outcome| outcome.picture.image.pixels).collect::<Vec<_>>()
        };
        for (which, scene) in ["room", "sphere"].into_iter().enumerate() {
            let as_it_is = pixels(0, which);
            for power in [-17, -9] {
                let scaled = pixels(power, which);
                let differ = as_it_is.iter().zip(&scaled).filter(|(a, b)| a != b).count();
                checks.push(Check::none(format!("size 2^{power}, {}", way.name), differ).of(scene));
            }
        }
    }
    checks
}
