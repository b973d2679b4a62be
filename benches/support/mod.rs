//! Scenes for benchmarks.

#![allow(dead_code, reason = "no benchmark uses all of it")]

use std::path::Path;
use std::sync::OnceLock;
use std::time::Duration;

use glam::{Mat3, Vec3};
use relt::embree::Device;
use relt::math::{Frame, warp};
use relt::path::{MappingKind, Widths};
use relt::render::calibration::calibrate;
use relt::rng::{Counter, Purpose, Rng, unit_f32};
use relt::scene::description::{ShapeDescription, ShapeGeometry, Sides};
use relt::scene::{Scene, SceneDescription};

pub mod ladders;

/// The scenes that come with relt.
pub const SCENES: [&str; 3] = ["cornell-box", "caustic", "lattice"];

/// A scene that comes with relt, made when it is first needed: what a filter leaves out must not be waited for.
pub struct Subject {
    pub name: &'static str,
    scene: OnceLock<Scene>,
    widths: [OnceLock<Widths>; MappingKind::ALL.len()],
}

impl Subject {
    pub fn new(name: &'static str) -> Subject {
        Subject { name, scene: OnceLock::new(), widths: Default::default() }
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

/// The Cornell box with spheres and disks anywhere in it.
pub fn quadrics() -> SceneDescription {
    let mut description = describe("cornell-box");
    let shape = |i: u64| {
        let words = |block| {
            let counter = Counter { ladder: 0, replica: 0, step: i, purpose: Purpose::Primary };
            Rng::new(7).words(counter, block).map(unit_f32)
        };
        let ([x, y, z, r], [s, t, ..]) = (words(0), words(1));
        let (center, radius) = (2.0 * Vec3::new(x, y, z) - 1.0, 0.02 + 0.3 * r);
        let geometry = match i % 2 {
            0 => ShapeGeometry::Sphere { center, radius, axes: Mat3::IDENTITY, flipped: false },
            _ => {
                let Frame { s, t, n } = Frame::new(warp::sphere([s, t]));
                ShapeGeometry::Disk { center, radius, axes: Mat3::from_cols(s, t, n) }
            }
        };
        ShapeDescription {
            name: format!("quadric {i}"),
            geometry,
            sides: Sides::Two { front: 0, back: 0 },
            emission: None,
        }
    };
    description.shapes.extend((0..40).map(shape));
    description
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
