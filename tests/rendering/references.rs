//! Scenes that Mitsuba rendered to little noise (`reference.exr`, with the variance of each value beside it).

use std::path::{Path, PathBuf};

use relt::render::{Combine, LadderChoice, Method, MltSettings, Normalisation, Settings};
use relt::scene::Scene;

use crate::support::{Agreement, Expected, load, repository, runs, settings};

/// Independent runs of each method.
const RUNS: u64 = 16;
/// Mutations a pixel of each of them, on 64 × 64 pixels.
const MUTATIONS: f64 = 160.0;

/// The methods, and ladders and combinations that are not the defaults.
fn methods() -> Vec<(&'static str, Settings)> {
    let of = |method| settings(method, MUTATIONS, 0);
    let re = || of(Method::ReplicaExchange);
    let all_of_mlt = MltSettings { large_steps: 0.5, normalisation: Normalisation::Pooled, kelemen_weights: true };
    vec![
        ("path", of(Method::Path)),
        ("mlt", of(Method::Mlt)),
        ("mlt-pooled-kelemen", Settings { mlt: all_of_mlt, ..of(Method::Mlt) }),
        ("re", re()),
        ("re-target", Settings { combine: Combine::Target, ..re() }),
        ("re-2", Settings { ladder: LadderChoice::Replicas(2), ..re() }),
    ]
}

/// All methods against the reference in `folder`. Tiles of a 64² picture are compared with those of the 256²
/// reference, which with a box filter is exact: both are means over the same part of the film. The brightness of `mlt`
/// is by default that of its first pass, 100,000 samples whatever follows, so it cannot be as precise as others'.
fn check(name: &str, scene: &Scene, folder: &Path, precision: f64) {
    let expected = Expected::read(&folder.join("reference.exr"));
    for (method, settings) in methods() {
        let name = format!("reference-{name}-{method}");
        let precision = if method == "mlt" { 3.0 * precision } else { precision };
        Agreement { name: &name, tiles: [16, 16], precision }.check(&runs(scene, &settings, RUNS), &expected);
    }
}

fn own(name: &str, precision: f64) {
    let folder = repository("scenes").join(name);
    check(name, &load(&folder.join("scene.xml"), &[("res", "64")]), &folder, precision);
}

#[test]
fn the_cornell_box_agrees_with_its_reference() {
    own("cornell-box", 0.005);
}

#[test]
fn the_caustic_agrees_with_its_reference() {
    own("caustic", 0.01);
}

#[test]
fn the_lattice_agrees_with_its_reference() {
    own("lattice", 0.02);
}

/// Folder of the scenes of others, which are test data and not part of the repository: `RELT_SCENES`, or
/// `../shared/scenes` beside the checkout.
fn scenes_of_others() -> Option<PathBuf> {
    let named = std::env::var_os("RELT_SCENES").map(PathBuf::from);
    let folder = named.unwrap_or_else(|| repository("../shared/scenes"));
    folder.is_dir().then_some(folder)
}

#[test]
fn a_scene_of_somebody_else_agrees_with_its_reference() {
    let Some(folder) = scenes_of_others().map(|folder| folder.join("bitterli-cornell-box")) else {
        println!("skipped: there is no folder of scenes of others; RELT_SCENES names one");
        return;
    };
    let scene = load(&folder.join("scene.xml"), &[("resx", "64"), ("resy", "64")]);
    check("bitterli-cornell-box", &scene, &folder, 0.005);
}
