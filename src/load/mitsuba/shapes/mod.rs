//! `<shape>`, one file a plugin.
//!
//! Reading an element only checks its parameters and gives a [`Build`]; builds, which read mesh files, then run in
//! parallel.

mod cube;
mod cylinder;
mod disk;
mod instances;
mod mesh;
mod obj;
mod ply;
mod rectangle;
mod serialized;
mod sphere;

use std::io::Cursor;
use std::path::Path;

use glam::Affine3A;
use rayon::prelude::*;

use super::Folder;
use super::bsdfs::{Bare, Library};
use super::document::Element;
use super::emitters;
use super::ids::Ids;
use super::parameters::ElementParameters;
use super::registry::Registry;
use super::textures::Textures;
use crate::load::Watch;
use crate::load::faults::{Faults, Span};
use crate::load::watch::{self, Source};
use crate::scene::Mesh;
use crate::scene::description::{GroupDescription, InstanceDescription, ShapeDescription, ShapeGeometry, Sides};
use crate::scene::parameters::Parameters;
use crate::scene::textures::Varying;
use mesh::{Placement, Repairs};

pub use mesh::RawMesh;
pub use ply::parse_bytes as parse_ply;

/// What a `type` of shape is.
#[derive(Clone, Copy)]
enum Plugin {
    /// A surface, and what reads it.
    Surface(fn(&mut ElementParameters, &Folder) -> Option<Build>),
    /// Not a surface but surfaces elsewhere: see [`instances`].
    Layout,
}

const SHAPES: Registry<Plugin> = Registry {
    tag: "shape",
    plugins: &[
        ("cube", Plugin::Surface(cube::read)),
        ("cylinder", Plugin::Surface(cylinder::read)),
        ("disk", Plugin::Surface(disk::read)),
        (instances::INSTANCE, Plugin::Layout),
        ("obj", Plugin::Surface(obj::read)),
        ("ply", Plugin::Surface(ply::read)),
        ("rectangle", Plugin::Surface(rectangle::read)),
        ("serialized", Plugin::Surface(serialized::read)),
        (instances::GROUP, Plugin::Layout),
        ("sphere", Plugin::Surface(sphere::read)),
    ],
};

/// A shape yet to be made.
pub struct Build {
    /// Size of the file that it reads.
    bytes: u64,
    make: Make,
}

/// Makes the geometry, or says in a sentence why it cannot.
type Make = Box<dyn FnOnce(&Watch) -> Result<Built, String> + Send>;

impl Build {
    /// Of a geometry that is made already.
    pub fn ready(geometry: ShapeGeometry) -> Build {
        Build::new(|| Ok(geometry.into()))
    }

    /// Of a geometry that is still to be computed.
    pub fn new(make: impl FnOnce() -> Result<Built, String> + Send + 'static) -> Build {
        Build { bytes: 0, make: Box::new(|_| make()) }
    }

    /// Of a geometry that a file holds.
    fn of_file(path: &Path, make: impl FnOnce(&Watch) -> Result<Built, String> + Send + 'static) -> Build {
        Build { bytes: std::fs::metadata(path).map_or(0, |found| found.len()), make: Box::new(make) }
    }
}

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

/// All that the shapes of a scene say.
pub struct Shapes {
    /// Surfaces in the world.
    pub world: Vec<ShapeDescription>,
    /// Surfaces elsewhere.
    pub groups: Vec<GroupDescription>,
    /// Where those are placed.
    pub instances: Vec<InstanceDescription>,
    /// One sentence each.
    pub warnings: Vec<String>,
}

/// Reads all shapes. `None` where one is faulty.
pub fn read<'a>(
    elements: &[&'a Element],
    folder: &Folder,
    ids: &Ids<'a>,
    bsdfs: &mut Library<'a>,
    textures: &'a Textures<'a>,
    watch: &Watch,
    faults: &'a Faults,
) -> Option<Shapes> {
    let layout = instances::layout(elements, ids, faults);
    let mut read = |elements: &[&'a Element]| pending_all(elements, folder, bsdfs, textures, faults);
    let mut pending = vec![read(elements)];
    pending.extend(layout.groups.iter().map(|group| read(&instances::members(group, faults))));

    let mut repairs = Repairs::default();
    let mut described = build_all(pending, watch, &mut repairs, faults)?.into_iter();
    let world = described.next()?;
    let group = |(element, shapes): (&&Element, _)| {
        let name = element.attribute("id").map_or(instances::GROUP, |id| &id.value);
        GroupDescription { name: name.to_owned(), shapes }
    };
    let groups = layout.groups.iter().zip(described).map(group).collect();
    let mut warnings = repairs.warnings();
    warnings.extend(layout.warnings);
    Some(Shapes { world, groups, instances: layout.instances, warnings })
}

/// The surfaces among some elements; `None` for each that is faulty.
fn pending_all<'a>(
    elements: &[&'a Element],
    folder: &Folder,
    bsdfs: &mut Library<'a>,
    textures: &'a Textures<'a>,
    faults: &'a Faults,
) -> Vec<Option<Pending>> {
    let is_surface = |element: &Element| !matches!(element.value("type"), instances::GROUP | instances::INSTANCE);
    let surfaces = elements.iter().enumerate().filter(|(_, element)| is_surface(element));
    surfaces.map(|(i, element)| pending(i, element, folder, bsdfs, textures, faults)).collect()
}

/// Builds the shapes of all lists together, in parallel, and keeps the lists. `None` where a shape is faulty.
fn build_all(
    lists: Vec<Vec<Option<Pending>>>,
    watch: &Watch,
    repairs: &mut Repairs,
    faults: &Faults,
) -> Option<Vec<Vec<ShapeDescription>>> {
    let lengths: Vec<usize> = lists.iter().map(Vec::len).collect();
    let pending: Vec<_> = lists.into_iter().flatten().collect();
    watch.expect(pending.iter().flatten().map(|shape| shape.build.bytes).sum());
    let build = |shape: Pending| (shape.name, shape.span, shape.parts, (shape.build.make)(watch));
    let built: Vec<_> = pending.into_par_iter().map(|shape| shape.map(build)).collect();

    let mut shapes = Some(Vec::new());
    for shape in built {
        let described = shape.and_then(|(name, span, parts, result)| {
            let built = result.map_err(|message| faults.at(&span, message)).ok()?;
            *repairs += built.repairs;
            let (sides, emission) = parts?;
            Some(ShapeDescription { name, geometry: built.geometry, sides, emission })
        });
        shapes = shapes.zip(described).map(|(mut shapes, shape)| {
            shapes.push(shape);
            shapes
        });
    }
    let mut shapes = shapes?.into_iter();
    Some(lengths.into_iter().map(|length| shapes.by_ref().take(length).collect()).collect())
}

/// Reads one element.
fn pending<'a>(
    index: usize,
    element: &'a Element,
    folder: &Folder,
    bsdfs: &mut Library<'a>,
    textures: &'a Textures<'a>,
    faults: &'a Faults,
) -> Option<Pending> {
    let mut p = ElementParameters::new(element, faults);
    let build = match SHAPES.find(element, faults) {
        Some(Plugin::Surface(read)) => Some(read(&mut p, folder)),
        _ => None,
    };
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

/// The mesh in the content of a file, in its own coordinates.
pub fn mesh(kind: &str, content: &[u8]) -> Result<Mesh, String> {
    let raw = match kind {
        "obj" => obj::parse(&mut &content[..]),
        "ply" => parse_ply(content),
        "serialized" => serialized::parse(&mut Cursor::new(content), 0),
        _ => return Err(format!("no mesh file is {kind:?}; known: obj, ply, serialized")),
    };
    let placement = Placement { to_world: Affine3A::IDENTITY, flip_normals: false, smooth: true };
    raw?.place(placement).map(|(mesh, _)| mesh)
}

/// A shape whose mesh a file holds: reads the parameters that all such shapes have; the file is read, by `parse`, by
/// what this returns. `flip_tex_coords` is what the format does by default, if it lets that be chosen.
fn mesh_file(
    p: &mut ElementParameters,
    folder: &Folder,
    flip_tex_coords: Option<bool>,
    parse: impl FnOnce(&mut Source) -> Result<RawMesh, String> + Send + 'static,
) -> Option<Build> {
    let path = p.file("filename", folder);
    let flip_normals = p.boolean("flip_normals").unwrap_or(false);
    let face_normals = p.boolean("face_normals").unwrap_or(false);
    let flip_tex_coords = flip_tex_coords.is_some_and(|by_default| p.boolean("flip_tex_coords").unwrap_or(by_default));
    let placement = Placement { to_world: p.to_world(), flip_normals, smooth: !face_normals };
    let path = path?;
    Some(Build::of_file(&path.clone(), move |watch| {
        let in_file = |message: String| format!("{}: {message}", path.display());
        let source = watch::open(&path, watch);
        let mut source = source.map_err(|error| in_file(format!("cannot be read: {error}")))?;
        let mut raw = parse(&mut source).map_err(in_file)?;
        drop(source);
        if face_normals {
            raw.normals = Vec::new();
        }
        if flip_tex_coords {
            raw.uvs.iter_mut().for_each(|uv| uv.y = 1.0 - uv.y);
        }
        raw.place(placement).map(Into::into).map_err(in_file)
    }))
}
