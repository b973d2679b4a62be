//! Scenes for benchmarks.

use std::path::Path;
use std::time::Duration;

use relt::embree::Device;
use relt::scene::{Scene, SceneDescription};

/// The scenes that come with relt.
pub const SCENES: [&str; 3] = ["cornell-box", "caustic", "lattice"];

/// A scene that comes with relt, as its file describes it.
pub fn describe(name: &str) -> SceneDescription {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name).join("scene.xml");
    relt::load::scene(&path, &[]).unwrap_or_else(|error| panic!("{error:?}"))
}

/// A described scene on Embree with its usual options, or those of `EMBREE`, such as `EMBREE=isa=avx2`.
pub fn build(description: SceneDescription) -> Scene {
    let device = Device::new(&std::env::var("EMBREE").unwrap_or_default()).unwrap_or_else(|error| panic!("{error}"));
    Scene::new(&device, description).unwrap_or_else(|error| panic!("{error}"))
}

/// Time that criterion runs a benchmark for before it measures, and while: all benchmarks together take some minutes.
pub const WARM_UP: Duration = Duration::from_millis(200);
/// See [`WARM_UP`].
pub const MEASUREMENT: Duration = Duration::from_millis(800);
