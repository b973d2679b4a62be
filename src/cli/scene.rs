//! Scene files, as every subcommand takes them.

use std::path::PathBuf;

use clap::Args;

use super::failure::Failure;
use super::loading::{self, Building};
use super::values;
use crate::embree::Device;
use crate::load::{self, Reach, Watch};
use crate::render::allocation;
use crate::scene::{Features, Scene, SceneDescription};

/// A scene file and values for its parameters.
#[derive(Args)]
pub(super) struct SceneArguments {
    /// Scene file, Mitsuba 3 XML
    #[arg(value_name = "SCENE")]
    pub path: PathBuf,

    /// Sets a parameter that the file declares as a `default`; may be repeated
    #[arg(short = 'D', long = "define", value_name = "NAME=VALUE", value_parser = values::define)]
    pub defines: Vec<(String, String)>,

    /// Reads files of the scene's own folder only; without, also others that the scene names plainly
    #[arg(long)]
    pub confine: bool,
}

/// A scene that is ready.
pub(super) struct Opened {
    pub device: Device,
    pub scene: Scene,
    /// What the person should know about the file, one sentence each.
    pub warnings: Vec<String>,
}

impl SceneArguments {
    /// What is wrong with the arguments alone.
    pub fn faults(&self) -> Vec<String> {
        let defined_before = |i: usize| self.defines[..i].iter().any(|(name, _)| *name == self.defines[i].0);
        (0..self.defines.len())
            .filter(|i| defined_before(*i))
            .map(|i| format!("-D {}: given more than once", self.defines[i].0))
            .collect()
    }

    /// The words of the command line that name the same scene.
    pub fn in_words(&self) -> String {
        let defines = self.defines.iter().map(|(name, value)| format!(" -D {name}={value}"));
        let confine = self.confine.then(|| " --confine".to_owned());
        std::iter::once(self.path.display().to_string()).chain(defines).chain(confine).collect()
    }

    /// Reads the file and builds the scene, on so many threads or as many as it may use; shows how far that
    /// is, unless `quiet`.
    pub fn open(&self, threads: Option<usize>, quiet: bool) -> Result<Opened, Failure> {
        Opened::of(self.describe(threads, quiet)?, threads, quiet)
    }

    /// The first half of [`open`](Self::open): reads the file.
    pub fn describe(&self, threads: Option<usize>, quiet: bool) -> Result<SceneDescription, Failure> {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(number_of_threads(threads))
            .thread_name(|i| format!("load {i}"));
        let pool = pool.build().map_err(Failure::running)?;
        let watch = Watch::default();
        let load = || pool.install(|| load::watched(&self.path, &self.defines, Reach::confined(self.confine), &watch));
        loading::shown(!quiet, &watch, load).map_err(Failure::shown)
    }
}

impl Opened {
    /// The second half of [`SceneArguments::open`]: builds the scene.
    pub fn of(description: SceneDescription, threads: Option<usize>, quiet: bool) -> Result<Opened, Failure> {
        let device = Device::on_threads(number_of_threads(threads), "").map_err(Failure::input)?;
        let warnings = description.warnings.clone();
        let building = Building::new(Features::of(&description).triangles);
        let scene =
            loading::shown(!quiet, &building, || Scene::watched(&device, description, &|part| building.tell(part)));
        let scene = scene.map_err(Failure::running)?;
        Ok(Opened { device, scene, warnings })
    }
}

/// The threads that are asked for, or as many as there are for this process.
pub(super) fn number_of_threads(threads: Option<usize>) -> usize {
    threads.unwrap_or_else(allocation::threads)
}
