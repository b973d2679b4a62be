//! Small, point-like and hidden lights.

use super::{
    Bench, Case, Check,
    bench::{Effort, Goal, camera_ways},
    check::ROUNDING,
    scenes::{SKY, diffuse, film, glowing, integrating_sphere, rectangle, series, sphere, view, without_roulette},
};

const ALBEDO: f64 = 0.5;
const EDGES: i32 = 4;
const EFFORT: Effort = Effort { runs: 16, mutations_per_pixel: 96.0 };
/// Where the spheres are: not at the origin, where coordinates are finer than elsewhere.
const CENTER: [f64; 3] = [0.3, -0.2, 0.6];

/// The cases.
pub(super) fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for (radius, area) in [(1e-2, "10⁻⁴"), (1e-4, "10⁻⁸"), (1e-6, "10⁻¹²")] {
        cases.push(
            Case::new(
                format!("light/area-{:e}", radius * radius),
                format!("a lamp of {area} of the area of the integrating sphere about it, as bright in all, lights it by E a/π"),
                move |bench| small(bench, radius),
            )
            .quick_if(radius == 1e-6),
        );
    }
    cases
        .push(Case::new("light/point", "a point of intensity 1 lights the sphere about it by a/π Σ aⁱ", point).quick());
    cases.push(Case::new(
        "light/keyhole",
        "the sky through a square hole of 1/100 of a lid lights the floor below by Lambert's formula",
        keyhole,
    ));
    cases.push(Case::new(
        "light/nearly-closed",
        "a white sphere that glows and that light leaves with probability 10⁻⁵ a bounce looks like Σ (1 − 10⁻⁵)ⁱ, i < 1000",
        nearly_closed,
    ));
    cases
}

/// A view from within the sphere about the centre.
fn from_inside(edges: i32) -> String {
    let place = |p: [f64; 3]| [0, 1, 2].map(|i| p[i] + CENTER[i]);
    view(1.0, [place([0.5, 0.3, -0.2]), place([0.9, 0.1, -0.5])], 80.0, edges)
}

fn small(bench: &Bench, radius: f64) -> Vec<Check> {
    let radiance = 1.0 / (radius * radius);
    let scene = bench.scene(
        &(from_inside(EDGES)
            + &sphere(CENTER, 1.0, true, &diffuse(ALBEDO))
            + &sphere(CENTER, radius, false, &(diffuse(0.0) + &glowing(radiance)))),
    );
    bench.all_ways_give(&scene, Goal::new(radiance * integrating_sphere(ALBEDO, radius, EDGES), 0.3), EFFORT)
}

/// E = 1 everywhere directly, Σ aⁱ with all reflections.
fn point(bench: &Bench) -> Vec<Check> {
    let light = format!(
        "<emitter type='point'><point name='position' value='{}'/><rgb name='intensity' value='1'/></emitter>",
        super::scenes::point(CENTER)
    );
    let scene = bench.scene(&(from_inside(EDGES) + &sphere(CENTER, 1.0, true, &diffuse(ALBEDO)) + &light));
    let expected = ALBEDO / std::f64::consts::PI * series(ALBEDO, EDGES - 1);
    bench.all_ways_give(&scene, Goal::new(expected, 0.3), EFFORT)
}

/// A box with black walls, a floor of albedo a, and a lid at height 1 with a hole; seen is the middle of the floor, directly
/// lit only.
fn keyhole(bench: &Bench) -> Vec<Check> {
    /// Half the width of the hole.
    const HOLE: f64 = 0.1;
    /// Half the width of what is seen.
    const SEEN: f64 = 0.005;
    let black = diffuse(0.0);
    let middle = 0.5 * (1.0 + HOLE);
    let strip = 0.5 * (1.0 - HOLE);
    let mut scene = format!(
        "<integrator type='path'><integer name='max_depth' value='2'/></integrator>
         <sensor type='orthographic'><float name='near_clip' value='0.001'/><transform name='to_world'>
           <scale value='{SEEN}'/><lookat origin='0, 0, 0.5' target='0, 0, 0' up='0, 1, 0'/></transform>{}</sensor>{SKY}",
        film(12, 8)
    );
    scene += &rectangle([1.0, 1.0], "", [0.0; 3], &diffuse(ALBEDO));
    for (size, place) in [
        ([strip, 1.0], [middle, 0.0, 1.0]),
        ([strip, 1.0], [-middle, 0.0, 1.0]),
        ([HOLE, strip], [0.0, middle, 1.0]),
        ([HOLE, strip], [0.0, -middle, 1.0]),
    ] {
        scene += &rectangle(size, "", place, &black);
    }
    for (turn, place) in [
        ("<rotate y='1' angle='90'/>", [-1.0, 0.0, 0.5]),
        ("<rotate y='1' angle='90'/>", [1.0, 0.0, 0.5]),
        ("<rotate x='1' angle='90'/>", [0.0, -1.0, 0.5]),
        ("<rotate x='1' angle='90'/>", [0.0, 1.0, 0.5]),
    ] {
        scene += &rectangle([1.0, 1.0], turn, place, &black);
    }
    // form factor of a rectangle a corner of which is above the point (Lambert 1760), four times
    let part = |a: f64, b: f64| a / (1.0 + a * a).sqrt() * (b / (1.0 + a * a).sqrt()).atan();
    let form_factor = 4.0 * (part(HOLE, HOLE) + part(HOLE, HOLE)) / std::f64::consts::TAU;
    let scene = bench.scene(&scene);
    // at the edge of what is seen, d further out, both cosines have fallen: by 1 − 2 d² at most
    let rounding = ROUNDING + 4.0 * SEEN * SEEN;
    let goal = Goal { expected: ALBEDO * form_factor, rounding, precision: 0.5 };
    bench.all_ways_give(&scene, goal, Effort { runs: 16, mutations_per_pixel: 1024.0 })
}

/// Radiance of a wall that glows by 1 and reflects all, where the part f of the light meets a black sphere on its way.
fn nearly_closed(bench: &Bench) -> Vec<Check> {
    const EDGES: i32 = 1000;
    const LOST: f64 = 1e-5;
    let scene = bench.scene(
        &(without_roulette(&from_inside(EDGES))
            + &sphere(CENTER, 1.0, true, &(diffuse(1.0) + &glowing(1.0)))
            + &sphere(CENTER, LOST.sqrt(), false, &diffuse(0.0))),
    );
    let goal = Goal { expected: series(1.0 - LOST, EDGES), rounding: long_rounding(EDGES), precision: 0.1 };
    bench.ways_give(&scene, &camera_ways(), goal, Effort { runs: 16, mutations_per_pixel: 1.0 })
}

/// Rounding of paths of that many edges, each of which multiplies the throughput and adds to the sum.
pub(super) fn long_rounding(edges: i32) -> f64 {
    ROUNDING + 4.0 * f64::from(edges) * 0.5 * f64::from(f32::EPSILON)
}
