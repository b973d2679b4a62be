//! `<shape>`, one file a plugin.
//!
//! Reading an element only checks its parameters and gives a [`Build`]; builds, which read mesh files, then run in
//! parallel.

mod cube;
mod disk;
mod mesh;
mod obj;
mod ply;
mod rectangle;
mod sphere;

use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::bsdfs::{Bare, Library};
use super::document::Element;
use super::emitters;
use super::parameters::ElementParameters;
use super::registry::Registry;
use super::textures::Textures;
use crate::load::faults::{Faults, Span};
use crate::scene::description::{ShapeDescription, ShapeGeometry, Sides};
use crate::scene::parameters::Parameters;
use crate::scene::textures::Varying;
use mesh::{Placement, Repairs};

pub use mesh::RawMesh;
pub use ply::parse as parse_ply;

const SHAPES: Registry<fn(&mut ElementParameters, &Path) -> Option<Build>> = Registry {
    tag: "shape",
    plugins: &[
        ("cube", cube::read),
        ("disk", disk::read),
        ("obj", obj::read),
        ("ply", ply::read),
        ("rectangle", rectangle::read),
        ("sphere", sphere::read),
    ],
};

/// Makes the geometry, or says in a sentence why it cannot.
pub type Build = Box<dyn FnOnce() -> Result<Built, String> + Send>;

/// Geometry in world space, and what had to be repaired for it.
pub struct Built {
    geometry: ShapeGeometry,
    repairs: Repairs,
}

impl From<ShapeGeometry> for Built {
    fn from(geometry: ShapeGeometry) -> Built {
        Built { geometry, repairs: Repairs::default() }
    }
}

/// A shape but for its geometry.
struct Pending {
    name: String,
    /// Where faults of the geometry are shown.
    span: Span,
    /// Sides and emission, unless one of them is faulty.
    parts: Option<(Sides, Option<Varying>)>,
    build: Build,
}

/// Reads all shapes; gives warnings as well. `None` where one is faulty.
pub fn read<'a>(
    elements: &[&'a Element],
    folder: &Path,
    bsdfs: &mut Library<'a>,
    textures: &'a Textures<'a>,
    faults: &'a Faults,
) -> Option<(Vec<ShapeDescription>, Vec<String>)> {
    let pending: Vec<_> =
        elements.iter().enumerate().map(|(i, e)| pending(i, e, folder, bsdfs, textures, faults)).collect();
    let built: Vec<_> =
        pending.into_par_iter().map(|shape| shape.map(|s| (s.name, s.span, s.parts, (s.build)()))).collect();

    let mut shapes = Some(Vec::new());
    let mut repairs = Repairs::default();
    for shape in built {
        let described = shape.and_then(|(name, span, parts, result)| {
            let built = result.map_err(|message| faults.at(&span, message)).ok()?;
            repairs += built.repairs;
            let (sides, emission) = parts?;
            Some(ShapeDescription { name, geometry: built.geometry, sides, emission })
        });
        shapes = shapes.zip(described).map(|(mut shapes, shape)| {
            shapes.push(shape);
            shapes
        });
    }
    Some((shapes?, repairs.warnings()))
}

/// Reads one element.
fn pending<'a>(
    index: usize,
    element: &'a Element,
    folder: &Path,
    bsdfs: &mut Library<'a>,
    textures: &'a Textures<'a>,
    faults: &'a Faults,
) -> Option<Pending> {
    let mut p = ElementParameters::new(element, faults);
    let build = SHAPES.find(element, faults).map(|read| read(&mut p, folder));
    let surface = p.nested(&["bsdf", "ref"]);
    for surplus in surface.iter().skip(1) {
        faults.at(&surplus.span, "the shape has more than one <bsdf>");
    }
    let emitter = p.single("emitter");
    let emission = emitter.map(|emitter| emitters::of_shape(emitter, textures, faults));
    let sides = match surface.first() {
        Some(surface) => bsdfs.sides(surface),
        None if emitter.is_some() => Some(bsdfs.bare_sides(Bare::Black)),
        None => Some(bsdfs.bare_sides(Bare::Grey)),
    };
    if build.is_some() {
        p.finish(); // of an unknown shape, the parameters are unknown as well
    }
    let parts = match (sides, emission) {
        (Some(sides), None) => Some((sides, None)),
        (Some(sides), Some(Some(emission))) => Some((sides, Some(emission))),
        _ => None,
    };
    let file = element.children.iter().find(|c| c.attribute("name").is_some_and(|a| a.value == "filename"));
    let span = file.map_or(element.span_of("type"), |file| file.span_of("value")).clone();
    let name = match element.attribute("id") {
        Some(id) => id.value.clone(),
        None => format!("{} {}", element.value("type"), index + 1),
    };
    Some(Pending { name, span, parts, build: build?? })
}

/// The mesh file that `filename` names, beside the scene file.
fn file(p: &mut ElementParameters, folder: &Path) -> Option<PathBuf> {
    p.required_string("filename").map(|name| folder.join(name))
}

/// A shape whose mesh a file holds: reads the parameters that all such shapes have; the file is read, by `parse`, by
/// what this returns. `flip_tex_coords` is what the format does by default.
fn mesh_file(
    p: &mut ElementParameters,
    folder: &Path,
    flip_tex_coords: bool,
    parse: fn(&[u8]) -> Result<RawMesh, String>,
) -> Option<Build> {
    let path = file(p, folder);
    let flip_normals = p.boolean("flip_normals").unwrap_or(false);
    let face_normals = p.boolean("face_normals").unwrap_or(false);
    let flip_tex_coords = p.boolean("flip_tex_coords").unwrap_or(flip_tex_coords);
    let placement = Placement { to_world: p.to_world(), flip_normals };
    let path = path?;
    Some(Box::new(move || {
        let in_file = |message: String| format!("{}: {message}", path.display());
        let bytes = std::fs::read(&path).map_err(|error| in_file(format!("cannot be read: {error}")))?;
        let mut raw = parse(&bytes).map_err(in_file)?;
        if face_normals {
            raw.normals.clear();
        }
        if flip_tex_coords {
            raw.uvs.iter_mut().for_each(|uv| uv.y = 1.0 - uv.y);
        }
        raw.place(placement).map(Into::into).map_err(in_file)
    }))
}
