//! Scenes, and runs on them.

use std::path::{Path, PathBuf};
use std::sync::{OnceLock, atomic::AtomicBool};

use rayon::iter::{IntoParallelIterator, ParallelIterator};
use relt::embree::{Device, Width};
use relt::film::Image;
use relt::path::{MappingKind, Widths};
use relt::render::{Job, MappingChoice, Method, Observer, Outcome, PacketChoice, Settings, run};
use relt::scene::Scene;

/// The repository's own scenes that have references.
pub const OWN: [&str; 3] = ["cornell-box", "caustic", "lattice"];

/// A place in the repository.
pub fn repository(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

/// The scene of a file.
pub fn load(path: &Path, defines: &[(&str, &str)]) -> Scene {
    static DEVICE: OnceLock<Device> = OnceLock::new();
    let defines: Vec<_> = defines.iter().map(|(name, value)| (name.to_string(), value.to_string())).collect();
    let description = relt::load::scene(path, &defines).unwrap_or_else(|error| panic!("{error}"));
    let device = DEVICE.get_or_init(|| Device::new("").unwrap_or_else(|error| panic!("{error}")));
    Scene::new(device, description).unwrap_or_else(|error| panic!("{error}"))
}

/// A scene of the repository.
pub fn own(name: &str, defines: &[(&str, &str)]) -> Scene {
    load(&repository("scenes").join(name).join("scene.xml"), defines)
}

/// The scene of these elements; it has no meshes in files.
pub fn scene_of(elements: &str) -> Scene {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("scene.xml");
    std::fs::write(&path, format!("<scene version='3.0.0'>{elements}</scene>")).expect("a file in it");
    load(&path, &[])
}

/// The same packet width for all rays.
pub fn fixed_widths(width: Width) -> Widths {
    Widths { camera: width, bounce: width, shadow: width }
}

/// One thread, since tests run side by side; no calibration.
pub fn settings(method: Method, mutations_per_pixel: f64, seed: u64) -> Settings {
    Settings {
        method,
        seed,
        mapping: MappingChoice::Fixed(MappingKind::Unidirectional),
        threads: Some(1),
        mutations_per_pixel: Some(mutations_per_pixel),
        packet: PacketChoice::Fixed(Width::W8),
        ..Settings::default()
    }
}

/// Renders.
pub fn render(scene: &Scene, settings: &Settings, observer: &dyn Observer) -> Outcome {
    assert_eq!(settings.validate(), Ok(()));
    let stop = AtomicBool::new(false);
    let job = Job { scene, scene_name: "test".into(), settings: settings.clone(), stop: &stop };
    run(&job, observer).unwrap_or_else(|error| panic!("{error}"))
}

/// The images of `n` independent runs, with seeds 1, 2, … Side by side, so that no core is without work while a long
/// test is the last.
pub fn runs(scene: &Scene, settings: &Settings, n: u64) -> Vec<Image> {
    let image = |seed| render(scene, &Settings { seed, ..settings.clone() }, &()).picture.image;
    (1..=n).into_par_iter().map(image).collect()
}
