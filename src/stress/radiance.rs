//! Lights of all magnitudes.
//!
//! All that relt computes is linear in the light, and products with powers of two are exact: a light 2ⁿ times as bright
//! gives 2ⁿ times the image, bit by bit where no logarithm is involved. Chains take ln g, which is then another number by
//! n ln 2, so that acceptances differ in their last digits.

use super::{
    Bench, Case, Check,
    bench::{Effort, Goal, Way, means, non_finite, render, way},
    check::ROUNDING,
    scenes::{diffuse, film, glowing, series, sphere, view},
};
use crate::path::MappingKind;
use crate::render::{Combine, Method, Outcome, Settings};
use crate::scene::Scene;

const ALBEDO: f64 = 0.5;
const EDGES: i32 = 4;
const EFFORT: Effort = Effort { runs: 16, mutations_per_pixel: 96.0 };

/// The cases.
pub(super) fn cases() -> Vec<Case> {
    vec![
        Case::new("radiance/path", "a light 2^±100 times as bright gives as many times the image by path tracing: pixels that differ", exact)
            .quick(),
        Case::new(
            "radiance/mlt",
            "a light 2^±100 times as bright leaves the decisions of chains as they are, and gives as many times the image",
            metropolis,
        )
        .quick(),
        Case::new(
            "radiance/re",
            "a light 2^±100 times as bright gives as many times the image by replica exchange, whatever the combination, and \
             the same acceptance",
            ladders,
        ),
        Case::new(
            "radiance/range",
            "lamps of radiance 1 and 10¹² side by side are seen as 1 and 10¹²",
            range,
        )
        .quick(),
        Case::new(
            "radiance/overflow",
            "contributions beyond 3·10³⁸ are left out, counted and told of; all else stays finite",
            overflow,
        )
        .quick(),
    ]
}

/// A sphere about a lamp of that radiance.
fn scene(bench: &Bench, radiance: f64) -> Scene {
    bench.scene(
        &(view(1.0, [[0.5, 0.3, -0.2], [0.9, 0.1, -0.5]], 80.0, EDGES)
            + &sphere([0.0; 3], 1.0, true, &diffuse(ALBEDO))
            + &sphere([0.0; 3], 0.1, false, &(diffuse(0.0) + &glowing(radiance)))),
    )
}

/// Factors for lights.
const FACTORS: [(&str, i32); 2] = [("2^-100", -100), ("2^100", 100)];

/// Values of all pixels, over a factor.
fn pixels(outcomes: &[Outcome], factor: f64) -> Vec<f64> {
    let images = outcomes.iter().flat_map(|outcome| outcome.picture.image.pixels.as_flattened());
    images.map(|v| f64::from(*v) / factor).collect()
}

fn exact(bench: &Bench) -> Vec<Check> {
    let effort = Effort { runs: 1, ..EFFORT };
    let mut checks = Vec::new();
    for mapping in MappingKind::ALL {
        let way = way(Method::Path, mapping);
        let pixels = |factor: f64| pixels(&bench.runs(&scene(bench, factor), &way, effort), factor);
        let as_it_is = pixels(1.0);
        for (name, power) in FACTORS {
            let differ = as_it_is.iter().zip(pixels(2f64.powi(power))).filter(|(a, b)| **a != *b).count();
            checks.push(Check::none(format!("light × {name}, {}", way.name), differ));
        }
    }
    checks
}

fn metropolis(bench: &Bench) -> Vec<Check> {
    let effort = Effort { runs: 1, ..EFFORT };
    let mut checks = Vec::new();
    for mapping in MappingKind::ALL {
        let way = way(Method::Mlt, mapping);
        let run = |factor: f64| bench.runs(&scene(bench, factor), &way, effort);
        let as_it_is = run(1.0);
        let mean = means(&as_it_is)[0];
        for (name, power) in FACTORS {
            let factor = 2f64.powi(power);
            let scaled = run(factor);
            let differences =
                pixels(&as_it_is, 1.0).into_iter().zip(pixels(&scaled, factor)).map(|(a, b)| (a - b).abs());
            // ten thousand splats, each rounded to f32 from weights that differ in the last digits of f64
            let most = 1e-6 * mean;
            checks.push(Check::at_most(
                format!("largest difference of a pixel, light × {name}, {}", way.name),
                most,
                differences.fold(0.0, f64::max),
            ));
            // 10⁴ differences of logarithms as large as 100, each known to 2⁻⁵²
            let [a, b] = [&as_it_is, &scaled].map(|outcomes| outcomes[0].status.acceptance.iter().sum());
            checks.push(Check::about(format!("acceptance, light × {name}, {}", way.name), a, b, 1e-10));
        }
    }
    checks
}

fn ladders(bench: &Bench) -> Vec<Check> {
    let mut checks = Vec::new();
    for mapping in [MappingKind::Unidirectional, MappingKind::Bidirectional] {
        for combine in Combine::ALL {
            let of_mapping = way(Method::ReplicaExchange, mapping);
            let way = Way { settings: Settings { combine, ..of_mapping.settings }, ..of_mapping };
            let run = |factor: f64| bench.runs(&scene(bench, factor), &way, EFFORT);
            let as_it_is = run(1.0);
            let acceptances = |outcomes: &[Outcome]| -> Vec<f64> {
                outcomes.iter().map(|outcome| outcome.status.acceptance.iter().sum()).collect()
            };
            for (name, power) in FACTORS {
                let factor = 2f64.powi(power);
                let scaled = run(factor);
                let values: Vec<f64> = means(&scaled).iter().map(|mean| mean / factor).collect();
                let what = format!("{}, {}, light × {name}", way.name, combine.name());
                checks.push(Check::same(format!("mean by {what}"), &values, &means(&as_it_is), ROUNDING, 0.3));
                let [a, b] = [&scaled, &as_it_is].map(|outcomes| acceptances(outcomes));
                checks.push(Check::same(format!("acceptance by {what}"), &a, &b, 1e-9, 0.3));
                checks.push(Check::none(format!("paths that are no numbers by {what}"), non_finite(&scaled)));
            }
        }
    }
    checks
}

/// Two lamps that fill a half of the picture each.
fn range(bench: &Bench) -> Vec<Check> {
    const BRIGHT: f64 = 1e12;
    let lamp = |x: f64, radiance: f64| {
        format!(
            "<shape type='rectangle'><transform name='to_world'><scale x='0.5'/><translate x='{x}'/></transform>{}{}</shape>",
            diffuse(0.0),
            glowing(radiance)
        )
    };
    // parallel rays see −1 to 1; x runs to the left
    let scene = bench.scene(
        &("<sensor type='orthographic'><transform name='to_world'><lookat origin='0, 0, 1' target='0, 0, 0' up='0, 1, 0'/>
             </transform>"
            .to_owned()
            + &film(8, 8)
            + "</sensor>"
            + &lamp(-0.5, 1.0)
            + &lamp(0.5, BRIGHT)),
    );
    let mut checks = Vec::new();
    for method in [Method::Path, Method::ReplicaExchange] {
        let way = way(method, MappingKind::Unidirectional);
        let outcomes = bench.runs(&scene, &way, EFFORT);
        for (name, columns, expected) in [("dim", 0..4, 1.0), ("bright", 4..8, BRIGHT)] {
            let half = |outcome: &Outcome| {
                let rows = outcome.picture.image.pixels.chunks(8);
                rows.flat_map(|row| row[columns.clone()].iter()).map(|rgb| f64::from(rgb[1])).sum::<f64>() / 32.0
            };
            let values: Vec<f64> = outcomes.iter().map(half).collect();
            checks.push(Check::mean(format!("{name} half by {}", way.name), &values, expected, ROUNDING, 0.1));
        }
    }
    checks
}

fn overflow(bench: &Bench) -> Vec<Check> {
    let scene = scene(bench, 3e38);
    let mut checks = Vec::new();
    for way in bench.ways(&scene) {
        let outcome = render(&scene, Settings { mutations_per_pixel: Some(64.0), ..way.settings });
        let wrong = outcome.picture.image.pixels.as_flattened().iter().filter(|v| !v.is_finite() || **v < 0.0).count();
        checks.push(Check::none(format!("values that are no numbers by {}", way.name), wrong));
        let told = outcome.warnings.iter().any(|warning| warning.contains("not finite"));
        let counted = outcome.status.non_finite > 0;
        checks.push(Check::holds(format!("told where any are counted, {}", way.name), told == counted));
        checks.push(Check::holds(
            format!("c and rates are numbers, {}", way.name),
            outcome.status.normalisation.is_some_and(|(c, error)| c.is_finite() && error.is_finite())
                && outcome.status.acceptance.iter().all(|rate| rate.is_finite()),
        ));
    }
    // 3·10³⁸ times anything above 1.14 is beyond the numbers; such products occur where a light subpath meets a wall
    let light = bench.runs(&scene, &way(Method::Path, MappingKind::Light), EFFORT);
    checks.push(Check::at_least("contributions counted by path, light", 1.0, non_finite(&light) as f64));
    let dim = bench.scene(
        &(view(1.0, [[0.5, 0.3, -0.2], [0.9, 0.1, -0.5]], 80.0, EDGES)
            + &sphere([0.0; 3], 1.0, true, &(diffuse(ALBEDO) + &glowing(1e30)))),
    );
    let goal = Goal::new(1e30 * series(ALBEDO, EDGES), 0.3);
    checks.extend(bench.ways_give(&dim, &[way(Method::Path, MappingKind::Unidirectional)], goal, EFFORT));
    checks
}
