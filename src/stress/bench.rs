//! What cases run on: a device, and runs of the renderer.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use rayon::prelude::*;

use super::check::{Check, ROUNDING};
use crate::embree::{Device, EmbreeError, Width};
use crate::load;
use crate::path::MappingKind;
use crate::render::{self, Job, LadderChoice, MappingChoice, Method, Outcome, PacketChoice, Settings};
use crate::scene::{Scene, SceneDescription};

/// What cases run on.
pub struct Bench {
    device: Device,
    quick: bool,
}

/// A method on a mapping.
#[derive(Clone, Debug)]
pub struct Way {
    /// Such as `re, bidirectional`.
    pub name: String,
    /// Settings but for budget and seed.
    pub settings: Settings,
}

/// What a mean should be.
#[derive(Clone, Copy, Debug)]
pub struct Goal {
    /// The mean.
    pub expected: f64,
    /// By what part of it rounding may change it.
    pub rounding: f64,
    /// By what part of it it is to be known at least.
    pub precision: f64,
}

impl Goal {
    /// A mean with the rounding that all images are allowed.
    pub fn new(expected: f64, precision: f64) -> Goal {
        Goal { expected, rounding: ROUNDING, precision }
    }
}

/// How many runs there are of what is compared by means, and how long they are.
#[derive(Clone, Copy, Debug)]
pub struct Effort {
    /// Independent runs.
    pub runs: u64,
    /// Mutations per pixel of each.
    pub mutations_per_pixel: f64,
}

impl Bench {
    /// A bench for the quick suite or the full one.
    pub fn new(quick: bool) -> Result<Bench, EmbreeError> {
        Ok(Bench { device: Device::new("")?, quick })
    }

    /// Embree.
    pub fn device(&self) -> &Device {
        &self.device
    }

    /// Whether this is the quick suite.
    pub fn is_quick(&self) -> bool {
        self.quick
    }

    /// The scene of these elements in Mitsuba's XML, which names no files.
    ///
    /// # Panics
    /// If the text is not one of a scene, or memory runs out.
    pub fn scene(&self, elements: &str) -> Scene {
        self.scene_of(described(elements))
    }

    /// The scene of that description.
    ///
    /// # Panics
    /// If memory runs out.
    pub fn scene_of(&self, description: SceneDescription) -> Scene {
        Scene::new(&self.device, description).unwrap_or_else(|error| panic!("{error}"))
    }

    /// Methods and mappings that make all light of a scene: each with each, or in the quick suite three that share neither.
    pub fn ways(&self, scene: &Scene) -> Vec<Way> {
        use {MappingKind::*, Method::*};
        let all = Method::ALL.into_iter().flat_map(|method| MappingKind::ALL.map(|mapping| (method, mapping)));
        let wanted = |(method, mapping): &(Method, MappingKind)| {
            let in_quick =
                [(Path, Light), (Path, Unidirectional), (Mlt, Multiplexed), (ReplicaExchange, Bidirectional)];
            mapping.misses(&scene.features).is_empty() && (!self.quick || in_quick.contains(&(*method, *mapping)))
        };
        all.filter(wanted).map(|(method, mapping)| way(method, mapping)).collect()
    }

    /// What a way comes to with the seeds 1, 2, …
    pub fn runs(&self, scene: &Scene, way: &Way, effort: Effort) -> Vec<Outcome> {
        (1..=effort.runs)
            .into_par_iter()
            .map(|seed| {
                let mutations_per_pixel = Some(effort.mutations_per_pixel);
                render(scene, Settings { seed, mutations_per_pixel, ..way.settings.clone() })
            })
            .collect()
    }

    /// Checks that the mean luminance of a scene is as it should be by all ways that make all of its light, and that no
    /// contribution was other than a number.
    pub fn all_ways_give(&self, scene: &Scene, goal: Goal, effort: Effort) -> Vec<Check> {
        self.ways_give(scene, &self.ways(scene), goal, effort)
    }

    /// The same by some ways.
    pub fn ways_give(&self, scene: &Scene, ways: &[Way], goal: Goal, effort: Effort) -> Vec<Check> {
        let of_way = |way: &Way| {
            let outcomes = self.runs(scene, way, effort);
            let Goal { expected, rounding, precision } = goal;
            [
                Check::mean(format!("mean by {}", way.name), &means(&outcomes), expected, rounding, precision),
                Check::none(format!("paths that are no numbers by {}", way.name), non_finite(&outcomes)),
            ]
        };
        ways.iter().flat_map(of_way).collect()
    }
}

/// All methods on camera paths.
pub fn camera_ways() -> Vec<Way> {
    Method::ALL.map(|method| way(method, MappingKind::Unidirectional)).into()
}

/// A method on a mapping, on one thread, without calibration.
pub fn way(method: Method, mapping: MappingKind) -> Way {
    Way {
        name: format!("{}, {}", method.name(), mapping.name()),
        settings: Settings {
            method,
            mapping: MappingChoice::Fixed(mapping),
            threads: Some(1),
            packet: PacketChoice::Fixed(Width::W8),
            ladder: LadderChoice::Replicas(3),
            ..Settings::default()
        },
    }
}

/// Renders.
///
/// # Panics
/// If the system gives no threads.
pub fn render(scene: &Scene, settings: Settings) -> Outcome {
    debug_assert_eq!(settings.validate(), Ok(()));
    let stop = AtomicBool::new(false);
    let job = Job { scene, scene_name: "stress".into(), settings, stop: &stop };
    render::run(&job, &()).unwrap_or_else(|error| panic!("{error}"))
}

/// The description of these elements in Mitsuba's XML, which names no files.
///
/// # Panics
/// If the text is not one of a scene.
pub fn described(elements: &str) -> SceneDescription {
    let text = format!("<scene version='3.0.0'>{elements}</scene>");
    load::text(Path::new("stress.xml"), text).unwrap_or_else(|error| panic!("{error}"))
}

/// Mean luminance of each image.
pub fn means(outcomes: &[Outcome]) -> Vec<f64> {
    let mean = |outcome: &Outcome| {
        let luminance = outcome.picture.image.luminance();
        luminance.iter().map(|v| f64::from(*v)).sum::<f64>() / luminance.len() as f64
    };
    outcomes.iter().map(mean).collect()
}

/// Contributions that were no numbers, in all runs.
pub fn non_finite(outcomes: &[Outcome]) -> usize {
    outcomes.iter().map(|outcome| outcome.status.non_finite as usize).sum()
}
