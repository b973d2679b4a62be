//! Which mapping a trial chooses, and when there is one.

use std::time::Duration;

use rayon::ThreadPoolBuilder;
use relt::path::MappingKind;
use relt::render::trial::{Trial, try_mappings};
use relt::render::{MappingChoice, Method, Settings};
use relt::scene::Scene;

use crate::support::{own, render, settings};

/// The trial of a run that leaves it as many points as it wants, or with so many mutations a pixel.
fn trial(scene: &Scene, seed: u64, mutations_per_pixel: Option<f64>, threads: usize) -> Trial {
    let settings = Settings { seed, mutations_per_pixel, ..Settings::default() };
    let pool = ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
    pool.install(|| try_mappings(scene, &settings))
}

/// What trials with seeds 0 to 4 choose.
fn choices(scene: &str, mutations_per_pixel: Option<f64>) -> Vec<MappingKind> {
    let scene = own(scene, &[("res", "64")]);
    (0..5).map(|seed| trial(&scene, seed, mutations_per_pixel, 1).chosen).collect()
}

/// By `path`, 256 × 256 for 6 seconds on one thread, two-way had 0.97 times the squared relative error of unidirectional,
/// and 1.9 times the absolute one.
#[test]
fn camera_paths_keep_the_cornell_box() {
    assert_eq!(choices("cornell-box", None), [MappingKind::Unidirectional; 5]);
}

#[test]
fn a_hidden_lamp_wants_paths_from_the_lamp() {
    let chosen = choices("lattice", Some(64.0)); // a quarter of the points of a whole trial
    assert!(!chosen.contains(&MappingKind::Unidirectional), "{chosen:?}");
}

/// Light tracing alone would lack the balls; and what mirrors and glass do is found by few paths, which weigh least where all
/// techniques are compared.
#[test]
fn caustics_want_all_techniques() {
    let scene = own("caustic", &[("res", "64")]);
    for (method, kind) in [
        (Method::Path, MappingKind::Bidirectional),
        (Method::Mlt, MappingKind::Multiplexed),
        (Method::ReplicaExchange, MappingKind::Multiplexed),
    ] {
        for seed in 0..3 {
            let settings = Settings { method, seed, mutations_per_pixel: None, ..Settings::default() };
            let trial = try_mappings(&scene, &settings);
            assert!(trial.chosen == kind && trial.rare_paths, "{method:?}: {trial:?}");
        }
    }
}

/// Nothing but camera paths that happen to hit the lamp makes the light that the water is looked through for.
#[test]
fn water_never_loses_its_camera_paths() {
    let scene = own("water", &[("res", "64")]);
    for seed in 0..2 {
        let trial = trial(&scene, seed, None, 2);
        assert!(trial.chosen.techniques().hit, "{trial:?}");
        assert!(trial.errors.iter().all(|(kind, _)| kind.techniques().hit), "{trial:?}");
    }
}

#[test]
fn threads_do_not_change_a_bit_of_a_trial() {
    for name in ["caustic", "lattice"] {
        let scene = own(name, &[("res", "64")]);
        let expected = trial(&scene, 7, Some(64.0), 1);
        assert!(!expected.errors.is_empty());
        assert_eq!(trial(&scene, 7, Some(64.0), 2), expected, "{name}");
        assert_ne!(trial(&scene, 8, Some(64.0), 2), expected, "{name}: another seed");
    }
}

#[test]
fn small_budgets_are_not_spent_on_trials() {
    let scene = own("lattice", &[("res", "16")]);
    let small = trial(&scene, 0, Some(1.0), 1);
    assert_eq!(small, Trial { chosen: MappingKind::Unidirectional, errors: Vec::new(), rare_paths: false });
    assert!(small.why().contains("no room for a trial"), "{}", small.why());
    let short = Settings { mutations_per_pixel: None, time: Some(Duration::from_millis(20)), ..Settings::default() };
    assert_eq!(try_mappings(&scene, &short), small);
}

#[test]
fn a_trial_is_part_of_the_set_up() {
    let scene = own("lattice", &[("res", "64")]);
    let settings = Settings { mapping: MappingChoice::Auto, ..settings(Method::Path, 32.0, 0) };
    let set_up = render(&scene, &settings, &()).status.set_up;
    // 16,384 points, each of them many microseconds
    assert!(set_up.calibration > Duration::from_millis(5), "{set_up:?}");
}

#[test]
fn what_light_tracing_lacks_is_told() {
    let warnings = |name: &str, kind| {
        let scene = own(name, &[("res", "16")]);
        let settings = Settings { mapping: MappingChoice::Fixed(kind), ..settings(Method::Path, 64.0, 0) };
        render(&scene, &settings, &()).warnings.join("\n")
    };
    let told = warnings("caustic", MappingKind::Light);
    assert!(told.contains("the image lacks whatever is seen in perfect mirrors") && told.contains("--mapping light"));
    assert!(!warnings("caustic", MappingKind::TwoWay).contains("lacks"));
    assert!(!warnings("cornell-box", MappingKind::Light).contains("lacks"));
}
