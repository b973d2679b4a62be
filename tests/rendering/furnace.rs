//! Furnaces: scenes whose image is the same everywhere and known by a formula.

use relt::path::MappingKind;
use relt::render::{LadderChoice, MappingChoice, Method, Settings};

use crate::support::{Agreement, Expected, runs, scene_of, settings};

/// 24 × 16 pixels seen from `origin`, with limits on path length.
fn view(origin: &str, target: &str, max_depth: i32, rr_depth: u32) -> String {
    format!(
        "<integrator type='path'><integer name='max_depth' value='{max_depth}'/>
           <integer name='rr_depth' value='{rr_depth}'/></integrator>
         <sensor type='perspective'><float name='fov' value='80'/><float name='near_clip' value='0.001'/>
           <transform name='to_world'><lookat origin='{origin}' target='{target}' up='0, 1, 0'/></transform>
           <film type='hdrfilm'><integer name='width' value='24'/><integer name='height' value='16'/>
             <rfilter type='box'/></film></sensor>"
    )
}

/// A closed surface seen from inside, whose walls reflect `albedo` and emit 1.
fn closed(shape: &str, albedo: f64, max_depth: i32, rr_depth: u32) -> String {
    format!(
        "{}<shape type='{shape}'><boolean name='flip_normals' value='true'/>
           <bsdf type='diffuse'><rgb name='reflectance' value='{albedo}'/></bsdf>
           <emitter type='area'><rgb name='radiance' value='1'/></emitter></shape>",
        view("0.2, -0.1, 0.3", "-0.5, 0.2, -1", max_depth, rr_depth)
    )
}

/// Methods, those first that tell most for their time, and a ladder of two rungs.
fn methods() -> Vec<(&'static str, Settings)> {
    let of = |method| settings(method, 512.0, 0);
    let ladder = |k| Settings { ladder: LadderChoice::Replicas(k), ..of(Method::ReplicaExchange) };
    vec![("path", of(Method::Path)), ("re", of(Method::ReplicaExchange)), ("mlt", of(Method::Mlt)), ("re-2", ladder(2))]
}

/// All mappings with several ways to make a path, by path tracing, and the two with most by chains.
fn mappings() -> Vec<(&'static str, Settings)> {
    let of = |method, mapping| Settings {
        mapping: MappingChoice::Fixed(mapping),
        ladder: LadderChoice::Replicas(3),
        ..settings(method, 256.0, 0)
    };
    use {MappingKind::*, Method::*};
    vec![
        ("two-way", of(Path, TwoWay)),
        ("bidirectional", of(Path, Bidirectional)),
        ("multiplexed", of(Path, Multiplexed)),
        ("re-bidirectional", of(ReplicaExchange, Bidirectional)),
        ("mlt-multiplexed", of(Mlt, Multiplexed)),
    ]
}

fn check(methods: &[(&str, Settings)], name: &str, scene: &str, radiance: f64, precision: f64) {
    let scene = scene_of(scene);
    let expected = Expected::constant(24, 16, [radiance as f32; 3]);
    for (method, settings) in methods {
        let name = format!("furnace-{name}-{method}");
        Agreement { name: &name, tiles: [24, 16], precision, filter: scene.film.filter }
            .check(&runs(&scene, settings, 8), &expected);
    }
}

/// The walls emit 1 and return a of what they get: L = 1 + a L, so L = 1/(1 − a), at every point and direction.
#[test]
fn closed_rooms_that_glow_are_as_bright_as_their_series() {
    for shape in ["cube", "sphere"] {
        for albedo in [0.2, 0.5, 0.9] {
            let (name, scene) = (format!("{shape}-{albedo}"), closed(shape, albedo, -1, 5));
            // What else there is tells no more of longer and shorter series, which take most of the time.
            let count = if albedo == 0.5 { 4 } else { 2 };
            check(&methods()[..count], &name, &scene, 1.0 / (1.0 - albedo), 0.005);
        }
    }
}

/// Whatever the techniques, their weights make a whole of them: walls that glow, roulette from the start, a wide lens;
/// glass and mirrors in a sky.
#[test]
fn closed_rooms_and_clear_bodies_are_as_bright_by_all_mappings() {
    check(&mappings(), "cube", &closed("cube", 0.5, -1, 2), 2.0, 0.01);
    check(&mappings(), "sphere", &closed("sphere", 0.5, 5, 5), 1.9375, 0.01);
    let lens = "type='thinlens'><float name='aperture_radius' value='0.3'/><float name='focus_distance' value='1'/>";
    let scene = closed("cube", 0.5, 4, 5).replace("type='perspective'>", lens);
    check(&mappings()[1..3], "lens", &scene, 1.875, 0.01);
    let sky = "<emitter type='constant'><rgb name='radiance' value='1'/></emitter>";
    for (name, bsdf) in [("glass", "<bsdf type='dielectric'/>"), ("mirror", "<bsdf type='conductor'/>")] {
        let ball = format!("<shape type='sphere'><float name='radius' value='0.9'/>{bsdf}</shape>");
        let scene = format!("{}{ball}{sky}", view("0, 0, 2.5", "0, 0, 0", -1, 5));
        check(&mappings()[..3], name, &scene, 1.0, 0.02);
    }
}

/// Roulette from the first bounce on changes noise and nothing else.
#[test]
fn closed_rooms_are_as_bright_with_roulette_from_the_start() {
    check(&methods()[..3], "roulette", &closed("cube", 0.5, -1, 1), 2.0, 0.005);
}

/// However wide the lens, a room that is equally bright everywhere looks it.
#[test]
fn closed_rooms_are_as_bright_through_a_lens() {
    let lens = "type='thinlens'><float name='aperture_radius' value='0.3'/><float name='focus_distance' value='1'/>";
    let scene = closed("cube", 0.5, -1, 5).replace("type='perspective'>", lens);
    assert!(scene.contains(lens));
    check(&methods()[..2], "lens", &scene, 2.0, 0.005);
}

/// Weights of either sign make a constant of a constant.
#[test]
fn closed_rooms_are_as_bright_through_a_filter_with_negative_lobes() {
    let scene = closed("cube", 0.5, -1, 5).replace("<rfilter type='box'/>", "<rfilter type='lanczos'/>");
    assert!(scene.contains("lanczos"));
    check(&methods()[..3], "lanczos", &scene, 2.0, 0.005);
}

/// Paths of up to n edges meet n emitting walls: Σ aⁱ over i < n, which is (1 − aⁿ)/(1 − a).
#[test]
fn closed_rooms_of_finite_depth_are_as_bright_as_the_finite_series() {
    for depth in [1, 2, 3, 7] {
        let radiance = (1.0 - 0.8f64.powi(depth)) / (1.0 - 0.8);
        let count = if depth == 7 { 4 } else { 2 };
        let (name, scene) = (format!("depth-{depth}"), closed("cube", 0.8, depth, 5));
        check(&methods()[..count], &name, &scene, radiance, 0.005);
    }
}

/// What reflects or transmits all light shows, in a world of the same radiance everywhere, that radiance: a diffuse
/// ball of albedo 1, a perfect mirror, glass that absorbs nothing (its radiance is n² times as large inside and comes
/// out as it was). Convex bodies, so that diffuse ones are left after one bounce.
#[test]
fn bodies_that_absorb_nothing_vanish_in_a_uniform_world() {
    let sphere = |bsdf: &str| format!("<shape type='sphere'><float name='radius' value='0.9'/>{bsdf}</shape>");
    let cube = |bsdf: &str| {
        format!(
            "<shape type='cube'><transform name='to_world'><scale value='0.6'/><rotate x='1' angle='40'/><rotate y='1' angle='25'/></transform>
               {bsdf}</shape>"
        )
    };
    let white = "<bsdf type='diffuse'><rgb name='reflectance' value='1'/></bsdf>";
    let glass = "<bsdf type='dielectric'/>";
    for (name, body) in [
        ("white-ball", sphere(white)),
        ("white-cube", cube(white)),
        ("mirror-ball", sphere("<bsdf type='conductor'/>")),
        ("glass-ball", sphere(glass)),
        ("pane-ball", sphere("<bsdf type='thindielectric'/>")),
        ("glass-cube", cube(glass)),
        (
            "air-bubble",
            sphere(
                "<bsdf type='dielectric'><float name='int_ior' value='1'/><float name='ext_ior' value='1.5'/></bsdf>",
            ),
        ),
    ] {
        let sky = "<emitter type='constant'><rgb name='radiance' value='1'/></emitter>";
        check(&methods(), name, &format!("{}{body}{sky}", view("0, 0, 2.5", "0, 0, 0", -1, 5)), 1.0, 0.005);
    }
}
