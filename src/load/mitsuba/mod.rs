//! Mitsuba 3 scene files (XML, version 3).
//!
//! Text becomes a tree of known elements ([`document`]); plugins, one file each, read the elements through
//! [`parameters`]; meshes load last, in parallel. Every step goes on after a fault.
//!
//! To add a plugin: a new file and one line in the registry of its folder.

mod bsdfs;
mod document;
mod emitters;
mod films;
mod ids;
mod integrators;
mod parameters;
mod registry;
mod rfilters;
mod samplers;
mod sensors;
mod shapes;
mod textures;
mod transforms;
mod values;

use std::path::{Path, PathBuf};

use super::access::Access;
use super::faults::{Faults, did_you_mean};
use super::{LoadError, Reach, Watch};
use crate::scene::SceneDescription;
use crate::scene::lights::Light;
use document::{Attribute, Element};
use ids::Ids;
use parameters::ElementParameters;
use sensors::View;
pub use shapes::{mesh, parse_ply};
use textures::Textures;

/// Reads the text of the scene file at `path`.
pub fn read(
    path: &Path,
    text: String,
    defines: &[(String, String)],
    reach: Reach,
    watch: &Watch,
) -> Result<SceneDescription, LoadError> {
    let faults = Faults::default();
    let folder = Folder::new(path.parent().unwrap_or(Path::new("")), reach);
    let description =
        document::read(&text, defines, &faults).and_then(|scene| describe(&scene, &folder, watch, &faults));
    faults.settle(path, text, description)
}

/// Reads the elements of the scene.
fn describe(scene: &Element, folder: &Folder, watch: &Watch, faults: &Faults) -> Option<SceneDescription> {
    let ids = Ids::new(scene, faults);
    let textures = Textures::new(scene, &ids, folder, faults);
    let mut bsdfs = bsdfs::Library::new(&ids, &textures, faults);
    let mut p = ElementParameters::new(scene, faults);

    let integrator = match p.single("integrator") {
        Some(element) => integrators::read(element, faults),
        None => Some(integrators::DEFAULT),
    };
    let sensor = p.single("sensor");
    if sensor.is_none() {
        faults.at(&scene.span, "the scene has no <sensor>");
    }
    let view = sensor.and_then(|element| sensors::read(element, faults));
    let shape_elements = p.nested(&["shape"]);
    let shapes = shapes::read(&shape_elements, folder, &ids, &mut bsdfs, &textures, watch, faults);
    for element in p.nested(&["bsdf"]) {
        bsdfs.bsdf(element, element); // those that no shape uses have faults as well
    }
    for element in p.nested(&["texture"]) {
        textures.get(element);
    }
    let light_elements = p.nested(&["emitter"]);
    let lights = lights(&light_elements, &textures, faults);
    let is_lit = !light_elements.is_empty() || shape_elements.iter().any(|shape| shape.children.iter().any(is_emitter));
    if !is_lit {
        faults.at(&scene.span, "nothing in the scene emits light: there is no <emitter>");
    }
    p.finish();

    let View { camera, film, mut warnings } = view?;
    let shapes = shapes?;
    warnings.extend(shapes.warnings);
    Some(SceneDescription {
        integrator: integrator?,
        camera,
        film,
        appearances: bsdfs.appearances,
        shapes: shapes.world,
        groups: shapes.groups,
        instances: shapes.instances,
        lights,
        warnings,
    })
}

/// Where the scene's files are.
pub struct Folder {
    path: PathBuf,
    access: Access,
}

impl Folder {
    fn new(path: &Path, reach: Reach) -> Folder {
        Folder { path: path.to_owned(), access: Access::new(path, reach) }
    }

    /// The file that an attribute names, or in a sentence why it is not read.
    pub fn file(&self, name: &Attribute) -> Result<PathBuf, String> {
        self.access.file(&self.path, &name.value, name.is_plain)
    }
}

/// Whether an element is an emitter.
fn is_emitter(element: &Element) -> bool {
    element.tag == "emitter"
}

/// Emitters that are not part of shapes; only one of them can be all around.
fn lights<'a>(elements: &[&'a Element], textures: &'a Textures<'a>, faults: &'a Faults) -> Vec<Light> {
    let mut lights = Vec::new();
    let mut is_surrounded = false;
    for element in elements {
        let Some(light) = emitters::of_scene(element, textures, faults) else { continue };
        if light.is_surrounding() && std::mem::replace(&mut is_surrounded, true) {
            faults.at(&element.span, "the scene has more than one emitter that surrounds it");
        }
        lights.push(light);
    }
    lights
}
