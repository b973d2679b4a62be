//! Small scenes with one feature each against Mitsuba 3: `tests/mitsuba/NAME.xml` and what `compare.py` there made of
//! it. Materials, lights, shapes, filters, camera and roulette by somebody else's hand.

use relt::path::MappingKind;
use relt::render::{LadderChoice, MappingChoice, Method, Settings};

use crate::support::{Agreement, Expected, load, repository, runs, settings};

fn check(names: &[&str]) {
    check_with("path", &settings(Method::Path, 1024.0, 0), 0.01, names);
}

fn check_with(how: &str, settings: &Settings, precision: f64, names: &[&str]) {
    for name in names {
        let folder = repository("tests/mitsuba");
        let scene = load(&folder.join(name).with_extension("xml"), &[]);
        let expected = Expected::read(&folder.join(name).with_extension("exr"));
        let runs = runs(&scene, settings, 8);
        Agreement { name: &format!("mitsuba-{name}-{how}"), tiles: [24, 16], precision, filter: scene.film.filter }
            .check(&runs, &expected);
    }
}

/// Many kinds of lights, materials, surfaces, cameras and filters. (Not `everything`, where a point light throws caustics
/// through a glass ball: no camera path finds those, Mitsuba's neither.)
const DIVERSE: [&str; 16] = [
    "brushed-glass",
    "crop",
    "gaussian",
    "glass",
    "instances",
    "mixtures",
    "orthographic",
    "picture-lights",
    "plastics",
    "principled-varied",
    "relief",
    "sky",
    "smooth",
    "sphere-light",
    "spots",
    "thin-lens",
];

/// A method with a mapping.
fn with(method: Method, mapping: MappingKind, mutations_per_pixel: f64) -> Settings {
    Settings { mapping: MappingChoice::Fixed(mapping), ..settings(method, mutations_per_pixel, 0) }
}

#[test]
fn paths_from_both_ends_are_what_mitsuba_makes_of_them() {
    check_with("bidirectional", &with(Method::Path, MappingKind::Bidirectional, 256.0), 0.02, &DIVERSE);
}

#[test]
fn one_technique_a_point_gives_what_mitsuba_makes_of_all() {
    // what each technique gives is tested by the bidirectional mapping on all scenes
    let names = ["crop", "glass", "mixtures", "picture-lights", "principled-varied", "sky", "spots", "thin-lens"];
    check_with("multiplexed", &with(Method::Path, MappingKind::Multiplexed, 512.0), 0.02, &names);
}

#[test]
#[ignore = "minutes: what other tests leave out, as it tells less for its time"]
fn one_technique_a_point_gives_what_mitsuba_makes_of_all_everywhere() {
    check_with("multiplexed", &with(Method::Path, MappingKind::Multiplexed, 512.0), 0.02, &DIVERSE);
}

#[test]
fn light_tracing_beside_camera_paths_is_what_mitsuba_makes_of_both() {
    check_with("two-way", &with(Method::Path, MappingKind::TwoWay, 256.0), 0.02, &["mixtures", "sky", "spots"]);
}

/// Light tracing alone, where the camera sees no mirror, no smooth glass and no sky. (Nor lamps whose shading normals lean:
/// what shines behind their geometric normals is found from the camera only.)
#[test]
fn light_tracing_is_what_mitsuba_makes_of_paths() {
    let names = ["crop", "cylinder-light", "disk-light", "flipped", "picture-lights", "point", "sphere-light", "spots"];
    check_with("light", &with(Method::Path, MappingKind::Light, 512.0), 0.02, &names);
}

/// Chains on paths of both ends, of one point many splats.
#[test]
fn chains_on_all_mappings_give_what_mitsuba_makes_of_paths() {
    for (method, mapping) in [
        (Method::ReplicaExchange, MappingKind::Bidirectional),
        (Method::ReplicaExchange, MappingKind::Multiplexed),
        (Method::Mlt, MappingKind::Bidirectional),
        (Method::Mlt, MappingKind::Multiplexed),
    ] {
        let how = format!("{}-{}", method.name(), mapping.name());
        let settings = Settings { ladder: LadderChoice::Replicas(3), ..with(method, mapping, 512.0) };
        check_with(&how, &settings, 0.03, &["gaussian", "glass", "mixtures"]);
    }
}

#[test]
fn chains_that_change_techniques_give_what_mitsuba_makes_of_paths() {
    for method in [Method::ReplicaExchange, Method::Mlt] {
        let settings = Settings {
            ladder: LadderChoice::Replicas(3),
            technique_changes: true,
            ..with(method, MappingKind::Multiplexed, 512.0)
        };
        let how = format!("{}-techniques", method.name());
        check_with(&how, &settings, 0.03, &["disk-light", "everything", "rough-metal", "sphere-light"]);
    }
}

#[test]
fn materials_are_what_mitsuba_makes_of_them() {
    check(&["gold", "glass", "twosided", "pane", "plastics", "mixtures"]);
}

#[test]
fn rough_materials_are_what_mitsuba_makes_of_them() {
    check(&["rough-metal", "rough-glass", "rough-plastics", "brushed-metal", "brushed-glass"]);
}

#[test]
fn principled_materials_are_what_mitsuba_makes_of_them() {
    check(&["principled", "principled-glass", "principled-varied"]);
}

#[test]
fn textures_are_what_mitsuba_makes_of_them() {
    check(&["textures", "relief", "picture-lights"]);
}

#[test]
fn thin_sheets_are_what_mitsuba_makes_of_them() {
    check(&["thin"]);
}

#[test]
fn lights_are_what_mitsuba_makes_of_them() {
    check(&["point", "spots", "constant", "sky", "sphere-light", "disk-light", "cylinder-light"]);
}

#[test]
fn shapes_are_what_mitsuba_makes_of_them() {
    check(&["smooth", "flipped", "cylinder", "serialized"]);
}

#[test]
fn instances_are_what_mitsuba_makes_of_them() {
    check(&["instances"]);
}

#[test]
fn meshes_with_shading_normals_shine_where_mitsubas_do() {
    check(&["smooth-emitter", "smooth-emitter-light"]);
}

#[test]
fn the_camera_sees_what_mitsubas_sees() {
    check(&["fov-y", "fov-diagonal", "fov-smaller", "fov-larger", "focal-length", "clip"]);
}

#[test]
fn other_cameras_see_what_mitsubas_see() {
    check(&["principal-point", "crop", "thin-lens", "orthographic"]);
}

#[test]
fn filters_spread_as_mitsubas_do() {
    check(&["gaussian", "tent"]);
}

#[test]
fn filters_with_negative_lobes_spread_as_mitsubas_do() {
    check(&["mitchell", "catmullrom", "lanczos"]);
}

#[test]
fn roulette_begins_where_mitsubas_does_and_changes_no_brightness() {
    check(&["roulette", "roulette-late"]);
}

#[test]
fn a_scene_with_everything_is_what_mitsuba_makes_of_it() {
    check(&["everything"]);
}
