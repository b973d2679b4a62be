//! What the render loop asks of a method.

use std::io::{self, Write};
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::parts::Agreement;
use crate::{
    chain::{Recorder, TechniqueChanges},
    film::{Accumulator, Footprint, Image, Plane, Splats},
    path::{Faults, Mapping, Workspace},
    ranks::Company,
    rng::Rng,
    scene::description::FilmDescription,
    tempering::{Estimate, RoundReport, Sampler},
};

use super::health::ChainReport;
pub use super::status::Phase;

/// What all blocks of a run share.
pub struct Stage<'s> {
    /// From primary samples to contributions.
    pub mapping: Mapping<'s>,
    /// From film positions to pixels.
    pub footprint: Footprint,
    /// Random numbers of the job.
    pub rng: Rng,
}

impl Stage<'_> {
    /// What is recorded to.
    pub fn sheet(&self) -> Sheet {
        let scene = self.mapping.scene();
        Sheet {
            film: scene.film,
            brightest: f64::from(scene.emitters.brightest()),
            elsewhere: crate::chain::Target::splats_elsewhere(&self.mapping),
            outcomes: self.mapping.has_outcomes(),
        }
    }

    /// Number of pixels.
    pub fn pixels(&self) -> u64 {
        self.sheet().pixels()
    }

    /// A recorder into `splats`.
    pub fn recorder<'a>(&'a self, splats: &'a mut Splats) -> Recorder<'a> {
        self.sheet().recorder(&self.footprint, splats)
    }
}

/// All that sums on the film depend on of the scene and the mapping that they are of: what it takes to make a picture of
/// saved ones.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sheet {
    /// The film.
    pub film: FilmDescription,
    /// Typical magnitude of the brightest f.
    pub brightest: f64,
    /// Whether points may contribute elsewhere than at their own film positions.
    pub elsewhere: bool,
    /// Whether points choose among outcomes that can be had all at once.
    pub outcomes: bool,
}

impl Sheet {
    /// Width and height of the film in pixels.
    pub fn size(&self) -> [u32; 2] {
        [self.film.width, self.film.height]
    }

    /// Number of pixels.
    pub fn pixels(&self) -> u64 {
        let [width, height] = self.size();
        u64::from(width) * u64::from(height)
    }

    /// From film positions to pixels.
    pub fn footprint(&self) -> Footprint {
        Footprint::new(self.film.filter, self.film.width, self.film.height)
    }

    /// A recorder into `splats`.
    pub fn recorder<'a>(&self, footprint: &'a Footprint, splats: &'a mut Splats) -> Recorder<'a> {
        Recorder { footprint, size: self.size().map(|n| n as f32), splats }
    }

    /// An accumulator for the film.
    pub fn accumulator(&self, layers: usize) -> Accumulator {
        let [width, height] = self.size();
        Accumulator::new(width, height, layers, self.brightest)
    }

    /// An image of f64 colours, each divided and scaled by the caller already.
    pub fn image(&self, colour: impl Fn(usize) -> [f64; 3]) -> Image {
        let [width, height] = self.size();
        let pixels = (0..self.pixels() as usize).map(|i| colour(i).map(|v| v as f32)).collect();
        Image::new(width, height, pixels)
    }
}

/// What a method has to show at some moment.
pub struct Development {
    /// The picture.
    pub image: Image,
    /// Further layers.
    pub layers: Vec<(String, Plane)>,
    /// c, the mean luminance of the picture.
    pub normalisation: Option<Estimate>,
    /// What the person should know about the picture, one sentence each.
    pub warnings: Vec<String>,
    /// Whether the parts that it is made of tell the same, where there are several.
    pub agreement: Option<Agreement>,
    /// What the run is judged by.
    pub diagnostics: Diagnostics,
}

/// What a method knows about how well it works.
#[derive(Default)]
pub struct Diagnostics {
    /// The round at work, as far as it has come, where there are rounds.
    pub round: Option<RoundReport>,
    /// Chains without a ladder.
    pub chains: Option<ChainReport>,
    /// Uniform points contradict all samples together.
    pub contradiction: bool,
}

/// What a method counts.
#[derive(Clone, Debug, Default)]
pub struct Counts {
    /// Evaluations of all kinds.
    pub mutations: u64,
    /// Rays traced.
    pub rays: u64,
    /// Contributions settled.
    pub faults: Faults,
    /// Mean acceptance probability by tempered rung, coldest last.
    pub acceptance: Vec<f64>,
    /// Mean swap probability by pair of rungs, hottest first.
    pub swap: Vec<f64>,
    /// Changes of technique; of the round, on a ladder.
    pub technique_changes: TechniqueChanges,
}

/// A method at work. All state is a function of the job and the sweeps done, never of the threads or of how the sweeps
/// were sliced.
pub trait Engine: Send {
    /// Sweeps still to go through, as long as sweeps are now; `None`: for as long as time allows.
    fn sweeps_left(&self) -> Option<u64>;
    /// Evaluations that the whole run takes, where it is limited.
    fn mutations_wanted(&self) -> Option<u64>;
    /// Goes through `sweeps` more sweeps, or those left, in parallel over blocks on the current thread pool; through
    /// fewer where the first end of a sweep with `until` mutations done, or the end of a phase, comes before.
    /// Returns how many they were; none where a phase ends before the first.
    fn advance(&mut self, stage: &Stage, sweeps: u64, until: Option<u64>) -> u64;
    /// What the next sweep belongs to.
    fn phase(&self) -> Phase;
    /// Counts so far.
    fn counts(&self) -> Counts;
    /// The picture so far; changes nothing.
    fn develop(&self) -> Development;
    /// Changes how many evaluations the whole run takes; how it goes about them stays as it was planned.
    fn set_wanted(&mut self, mutations: Option<u64>);
    /// Writes all that it takes to go on from here: see [`restored`](super::run::restored). Reports that nobody has taken
    /// yet are not kept.
    fn save(&self, out: &mut dyn Write) -> io::Result<()>;
    /// Shares the work with ranks that all have the same method in the same state.
    fn share(&mut self, company: &Arc<Company>);
    /// Brings what all ranks have to the first one, where the work is shared; all must have done the same sweeps.
    fn gather(&mut self);
    /// The sampler of a path tracer, whose sums may be added to those of others of the same job; nothing for methods whose sums
    /// mean something to themselves only.
    fn points(&self) -> Option<&Sampler<Workspace>> {
        None
    }
    /// Reports of the rounds that ended since this was last called, in order; none where there are no rounds.
    fn take_reports(&mut self) -> Vec<RoundReport> {
        Vec::new()
    }
}

/// What the person should know about a film: sums beyond its range, which stay at its end.
pub fn film_warnings(film: &Accumulator) -> Vec<String> {
    match film.overflowed() {
        0 => Vec::new(),
        n => vec![format!("{n} splats were beyond the range of the film, whose brightest pixels are too dark by that")],
    }
}

/// A mean that is 0 where there is nothing.
pub fn mean(sum: f64, n: u64) -> f64 {
    if n == 0 { 0.0 } else { sum / n as f64 }
}
