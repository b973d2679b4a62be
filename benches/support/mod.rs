//! Scenes for benchmarks.

#![allow(dead_code, reason = "no benchmark uses all of it")]

use std::cell::OnceCell;
use std::path::Path;
use std::time::Duration;

use relt::embree::Device;
use relt::path::{MappingKind, Widths};
use relt::render::calibration::calibrate;
use relt::scene::{Scene, SceneDescription};

/// The scenes that come with relt.
pub const SCENES: [&str; 3] = ["cornell-box", "caustic", "lattice"];

/// A scene that comes with relt, made when it is first needed: what a filter leaves out must not be waited for.
pub struct Subject {
    pub name: &'static str,
    scene: OnceCell<Scene>,
    widths: [OnceCell<Widths>; MappingKind::ALL.len()],
}

impl Subject {
    pub fn new(name: &'static str) -> Subject {
        Subject { name, scene: OnceCell::new(), widths: Default::default() }
    }

    pub fn scene(&self) -> &Scene {
        self.scene.get_or_init(|| build(describe(self.name)))
    }

    /// The packet widths that calibration finds fastest for that mapping.
    pub fn widths(&self, mapping: MappingKind) -> Widths {
        *self.widths[mapping as usize].get_or_init(|| {
            let widths = calibrate(self.scene(), mapping);
            println!("{}, {}: {widths:?}", self.name, mapping.name());
            widths
        })
    }
}

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
/// Resamples behind criterion's confidence intervals: 250 of them lie beyond either end of one of 95 %. With criterion's
/// own 100,000, drawing the plots of a benchmark takes five seconds, with these 0.3.
pub const RESAMPLES: usize = 10_000;
