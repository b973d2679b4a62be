//! Small scenes with one feature each against Mitsuba 3: `tests/mitsuba/NAME.xml` and what `compare.py` there made of
//! it. Materials, lights, shapes, filters, camera and roulette by somebody else's hand.

use relt::render::Method;

use crate::support::{Agreement, Expected, load, repository, runs, settings};

fn check(names: &[&str]) {
    for name in names {
        let folder = repository("tests/mitsuba");
        let scene = load(&folder.join(name).with_extension("xml"), &[]);
        let expected = Expected::read(&folder.join(name).with_extension("exr"));
        let runs = runs(&scene, &settings(Method::Path, 1024.0, 0), 8);
        Agreement { name: &format!("mitsuba-{name}"), tiles: [24, 16], precision: 0.01, filter: scene.film.filter }
            .check(&runs, &expected);
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
