//! Scene files, as every subcommand takes them.

use std::path::{Path, PathBuf};

use clap::Args;

use super::failure::Failure;
use super::values;
use crate::embree::Device;
use crate::scene::{Scene, SceneDescription};

/// A scene file and values for its parameters.
#[derive(Args)]
pub(super) struct SceneArguments {
    /// Scene file, Mitsuba 3 XML
    #[arg(value_name = "SCENE")]
    pub path: PathBuf,

    /// Sets a parameter that the file declares with <default name="…">; may be repeated
    #[arg(short = 'D', long = "define", value_name = "NAME=VALUE", value_parser = values::define)]
    pub defines: Vec<(String, String)>,
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

    /// Reads the file and builds the scene.
    pub fn open(&self) -> Result<Opened, Failure> {
        let description = describe(&self.path, &self.defines)?;
        let device = Device::new("").map_err(Failure::input)?;
        let warnings = description.warnings.clone();
        let scene = Scene::new(&device, description).map_err(Failure::running)?;
        Ok(Opened { device, scene, warnings })
    }
}

/// CONNECT: `crate::load::scene(path, defines).map_err(Failure::shown)`.
fn describe(path: &Path, _defines: &[(String, String)]) -> Result<SceneDescription, Failure> {
    Err(Failure::input(format_args!("{}: this build does not read scene files yet", path.display())))
}
