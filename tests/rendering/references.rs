//! Scenes that Mitsuba rendered to little noise (`reference.exr`, with the variance of each value beside it).

use std::path::{Path, PathBuf};

use relt::path::MappingKind;
use relt::render::{Combine, LadderChoice, MappingChoice, Method, MltSettings, Normalisation, Settings};
use relt::scene::Scene;

use crate::support::{Agreement, Expected, load, repository, runs, settings};

/// Independent runs of each method.
const RUNS: u64 = 16;
/// Mutations a pixel of each of them, on 64 × 64 pixels.
const MUTATIONS: f64 = 160.0;

/// The methods as they come.
fn methods<const N: usize>(methods: [Method; N]) -> Vec<(&'static str, Settings)> {
    methods.map(|method| (method.name(), settings(method, MUTATIONS, 0))).into()
}

const ALL: [Method; 3] = [Method::Path, Method::Mlt, Method::ReplicaExchange];

/// Ladders, combinations and normalisations that are not the defaults.
fn variants() -> Vec<(&'static str, Settings)> {
    let of = |method| settings(method, MUTATIONS, 0);
    let re = || of(Method::ReplicaExchange);
    let all_of_mlt = MltSettings { large_steps: 0.5, normalisation: Normalisation::Pooled, kelemen_weights: true };
    vec![
        ("mlt-pooled-kelemen", Settings { mlt: all_of_mlt, ..of(Method::Mlt) }),
        ("re-target", Settings { combine: Combine::Target, ..re() }),
        ("re-2", Settings { ladder: LadderChoice::Replicas(2), ..re() }),
    ]
}

/// Each method against the reference in `folder`. Tiles of a picture of fewer pixels are compared with those of the
/// reference, which with a box filter is exact: both are means over the same part of the film. The brightness of `mlt`
/// is by default that of its first pass, 100,000 samples whatever follows, so it cannot be as precise as others'.
fn check(methods: &[(&str, Settings)], name: &str, scene: &Scene, folder: &Path, tiles: [u32; 2], precision: f64) {
    let expected = Expected::read(&folder.join("reference.exr"));
    for (method, settings) in methods {
        let name = format!("reference-{name}-{method}");
        let precision = if *method == "mlt" { 3.0 * precision } else { precision };
        Agreement { name: &name, tiles, precision, filter: scene.film.filter }
            .check(&runs(scene, settings, RUNS), &expected);
    }
}

/// One of our own scenes.
fn own(name: &str, methods: &[(&str, Settings)], precision: f64) {
    let folder = repository("scenes").join(name);
    check(methods, name, &load(&folder.join("scene.xml"), &[("res", "64")]), &folder, [16, 16], precision);
}

/// Path tracing with paths from both ends, and chains on them and on one technique a point.
fn methods_on_mappings() -> [(&'static str, Settings); 3] {
    let of = |method, mapping, mutations| Settings {
        mapping: MappingChoice::Fixed(mapping),
        ..settings(method, mutations, 0)
    };
    [
        ("path-bidirectional", of(Method::Path, MappingKind::Bidirectional, 40.0)),
        ("re-multiplexed", of(Method::ReplicaExchange, MappingKind::Multiplexed, MUTATIONS)),
        ("re-bidirectional", of(Method::ReplicaExchange, MappingKind::Bidirectional, 40.0)),
    ]
}

#[test]
fn the_caustic_and_the_lattice_agree_with_their_references_by_mappings_from_both_ends() {
    for name in ["caustic", "lattice"] {
        own(name, &methods_on_mappings()[..2], 0.03);
    }
}

#[test]
fn the_cornell_box_agrees_with_its_reference() {
    own("cornell-box", &methods(ALL), 0.005);
}

#[test]
fn the_cornell_box_agrees_with_its_reference_by_variants() {
    own("cornell-box", &variants(), 0.005);
}

#[test]
fn the_caustic_agrees_with_its_reference() {
    own("caustic", &methods(ALL), 0.01);
}

#[test]
fn the_lattice_agrees_with_its_reference() {
    own("lattice", &methods(ALL), 0.02);
}

#[test]
#[ignore = "minutes: what other tests leave out, as it tells less for its time"]
fn scenes_agree_with_their_references_by_all_there_is() {
    own("caustic", &variants(), 0.01);
    own("lattice", &variants(), 0.02);
    own("cornell-box", &methods_on_mappings(), 0.03);
    own("caustic", &methods_on_mappings()[2..], 0.03);
    own("lattice", &methods_on_mappings()[2..], 0.03);
    if let Some((scene, folder)) = scene_of_others("bitterli-cornell-box", [64, 64]) {
        let methods = methods([Method::ReplicaExchange, Method::Mlt]);
        check(&methods, "bitterli-cornell-box", &scene, &folder, [16, 16], 0.005);
        check(&variants(), "bitterli-cornell-box", &scene, &folder, [16, 16], 0.005);
    }
    if let Some((scene, folder)) = scene_of_others("veach-mis", [96, 54]) {
        check(&methods([Method::ReplicaExchange]), "veach-mis", &scene, &folder, [16, 9], 0.02);
    }
}

/// Folder of the scenes of others, which are test data and not part of the repository: `RELT_SCENES`, or
/// `../shared/scenes` beside the checkout.
fn scenes_of_others() -> Option<PathBuf> {
    let named = std::env::var_os("RELT_SCENES").map(PathBuf::from);
    let folder = named.unwrap_or_else(|| repository("../shared/scenes"));
    folder.is_dir().then_some(folder)
}

/// The scene of that name at that size, with its folder; nothing where there are no scenes of others.
fn scene_of_others(name: &str, [width, height]: [u32; 2]) -> Option<(Scene, PathBuf)> {
    let Some(folder) = scenes_of_others().map(|folder| folder.join(name)) else {
        println!("skipped: there is no folder of scenes of others; RELT_SCENES names one");
        return None;
    };
    let [width, height] = [width, height].map(|extent| extent.to_string());
    Some((load(&folder.join("scene.xml"), &[("resx", &width), ("resy", &height)]), folder))
}

#[test]
fn a_scene_of_somebody_else_agrees_with_its_reference() {
    if let Some((scene, folder)) = scene_of_others("bitterli-cornell-box", [64, 64]) {
        check(&methods([Method::Path]), "bitterli-cornell-box", &scene, &folder, [16, 16], 0.005);
    }
}

/// Rough metal from nearly smooth to rough, spheres as lights from small to large.
#[test]
fn veachs_plates_agree_with_their_reference() {
    if let Some((scene, folder)) = scene_of_others("veach-mis", [96, 54]) {
        check(&methods([Method::Path]), "veach-mis", &scene, &folder, [16, 9], 0.02);
        check(&methods_on_mappings()[..1], "veach-mis", &scene, &folder, [16, 9], 0.02);
    }
}

/// A room lit through a door that is ajar, with pictures on all walls. The reference is by `tests/mitsuba/compare.py`.
#[test]
fn veachs_door_agrees_with_mitsuba() {
    if let Some((scene, _)) = scene_of_others("veach-door", [32, 18]) {
        let expected = Expected::read(&repository("tests/mitsuba/veach-door.exr"));
        let settings = settings(Method::Path, 256.0, 0);
        let filter = scene.film.filter;
        Agreement { name: "reference-veach-door", tiles: [8, 3], precision: 0.02, filter }
            .check(&runs(&scene, &settings, RUNS), &expected);
    }
}

/// A lamp in its shade, a glass egg, rough metal.
#[test]
fn veachs_room_agrees_with_its_reference() {
    if let Some((scene, folder)) = scene_of_others("veach-bidir", [64, 64]) {
        check(&methods([Method::Path, Method::ReplicaExchange]), "veach-bidir", &scene, &folder, [16, 16], 0.04);
    }
}
