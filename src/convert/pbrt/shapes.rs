//! `Shape`: meshes and quadrics with their material and their light.
//!
//! The front of a shape, where an area light shines, is where pbrt's normal points: for triangles along their corners'
//! order in their own coordinates, whatever the transform mirrors, and along vertex normals where there are any;
//! `ReverseOrientation` turns it. Meshes that are written stand in the world, corners and all. Mitsuba orders corners
//! after the transform.

use std::path::{Path, PathBuf};

use glam::{DAffine2, DVec2, DVec3};

use super::Converter;
use super::materials::masked;
use super::parameters::Parameters;
use super::quadrics::{self, Quadric};
use super::world::{Shape, TextureKind};
use crate::convert::meshes::Mesh;
use crate::convert::xml::Element;
use crate::load::faults::{did_you_mean, list};
use crate::load::parse_ply;

const KNOWN: &[&str] = &["bilinearmesh", "cylinder", "disk", "loopsubdiv", "plymesh", "sphere", "trianglemesh"];

/// How far behind the front the back of a two-sided light is put, in parts of its size: far enough for single precision.
const BACK_OFFSET: f64 = 1e-4;

/// A shape before it has a material.
struct Geometry {
    element: Element,
    /// Area in the world that one of pbrt's lights has.
    area: f64,
    /// Its texture coordinates to pbrt's.
    map: DAffine2,
    /// The back, where a light shines on both sides.
    back: Option<Element>,
}

impl Converter<'_> {
    /// The elements of a shape; two for a light with two sides.
    pub fn shape(&self, shape: &Shape, is_in_object: bool) -> Vec<Element> {
        let p = &shape.parameters;
        if !KNOWN.contains(&&p.kind[..]) {
            let message =
                format!("shape {:?}{}: it has no counterpart; {}", p.kind, did_you_mean(&p.kind, KNOWN), list(KNOWN));
            self.notes.left_out(&p.place, message);
            return Vec::new();
        }
        let mut light = shape.area_light.map(|light| &self.world.area_lights[light]);
        if is_in_object && let Some(light) = light.take() {
            self.notes.left_out(&light.place, "the light of an object: neither renderer has instances that shine");
        }
        let is_textured = self.is_textured(&shape.material)
            || p.get("alpha", &["texture"]).is_some()
            || light.is_some_and(|light| light.string("filename").is_some());
        let Some(geometry) = self.geometry(shape, light, is_textured) else { return Vec::new() };
        let surface = self.shared_material(shape, geometry.map);
        let emitter = light.and_then(|light| self.area_light(light, geometry.area, geometry.map));
        p.quiet(&["S", "faceIndices", "edgelength", "levels"]);
        for name in ["displacement", "emissionfilename"] {
            p.left_out(name, "not supported", self.notes);
        }
        p.finish(self.notes);
        [Some(geometry.element), geometry.back]
            .into_iter()
            .flatten()
            .map(|element| emitter.iter().cloned().fold(element.holding(surface.clone()), Element::holding))
            .collect()
    }

    /// A reference to the shape's material, masked by its `alpha`; written once for all shapes that have the same.
    fn shared_material(&self, shape: &Shape, map: DAffine2) -> Element {
        let alpha = self
            .texture(&shape.parameters, "alpha", TextureKind::Float)
            .filter(|alpha| alpha.constant().is_none_or(|[value, ..]| value < 1.0));
        let index = match &shape.material {
            super::world::MaterialReference::Named(name, _) => self.world.named_materials.get(name).copied(),
            super::world::MaterialReference::Index(index) => Some(*index),
            super::world::MaterialReference::Default => None,
        };
        let parameter = shape.parameters.get("alpha", &["float", "texture"]).map(|p| format!("{:?}", p.values));
        let map_key =
            if self.is_textured(&shape.material) || alpha.is_some() { format!("{map:?}") } else { String::new() };
        let key = format!("{index:?} {map_key} {:?}", alpha.as_ref().and(parameter));
        self.used.borrow_mut().extend(index);
        if let Some(id) = self.materials.borrow().get(&key) {
            return Element::reference(id);
        }
        let mut element = self.material(&shape.material, map);
        if let Some(alpha) = alpha {
            element = masked(&alpha.placed(map), element, self);
        }
        let name = match &shape.material {
            super::world::MaterialReference::Named(name, _) => name.clone(),
            _ => "material".into(),
        };
        let id = self.unique(&name);
        self.bsdfs.borrow_mut().push(element.with("id", &id[..]));
        self.materials.borrow_mut().insert(key, id.clone());
        Element::reference(&id)
    }

    fn geometry(&self, shape: &Shape, light: Option<&Parameters>, is_textured: bool) -> Option<Geometry> {
        let p = &shape.parameters;
        let shines_behind = light.is_some_and(|light| light.boolean("twosided") == Some(true));
        let mesh = match &p.kind[..] {
            "trianglemesh" | "loopsubdiv" => self.triangles(p),
            "bilinearmesh" => self.patches(p),
            "plymesh" => {
                let path = p.file("filename", self.notes)?;
                let mesh = self.ply(&path, p)?;
                if let Some(element) = self.as_it_is(&path, &mesh, shape, is_textured || shines_behind) {
                    return Some(Geometry {
                        element,
                        area: self.area(&mesh, shape, light),
                        map: DAffine2::IDENTITY,
                        back: None,
                    });
                }
                Some(mesh)
            }
            _ => {
                let is_flipped = shape.is_reversed != (shape.to_world.matrix3.determinant() < 0.0);
                match quadrics::convert(shape, is_textured, self.notes)? {
                    Quadric::Exact(element, area, map) if !shines_behind => {
                        let element = if is_flipped { element.boolean("flip_normals", true) } else { element };
                        return Some(Geometry { element, area, map, back: None });
                    }
                    Quadric::Exact(element, area, map) => {
                        return Some(self.two_quadrics(shape, element, area, map, is_flipped));
                    }
                    Quadric::Mesh(mut mesh) => {
                        mesh.transform(shape.to_world);
                        mesh.follow_normals();
                        if is_flipped {
                            mesh.flip();
                        }
                        let area = mesh.areas().iter().sum();
                        return Some(self.written(mesh, area, shines_behind, &p.kind));
                    }
                }
            }
        };
        let mut mesh = mesh?;
        if mesh.uvs.is_empty() && is_textured {
            mesh.separate([DVec2::ZERO, DVec2::X, DVec2::ONE]); // what pbrt takes where there are none
        }
        let area = self.area(&mesh, shape, light);
        self.orient(&mut mesh, shape);
        let stem = match p.string("filename") {
            Some(name) => Path::new(name).file_stem().unwrap_or_default().to_string_lossy().into_owned(),
            None => p.kind.clone(),
        };
        Some(self.written(mesh, area, shines_behind, &stem))
    }

    /// Puts a mesh into the world with its front where pbrt has it.
    fn orient(&self, mesh: &mut Mesh, shape: &Shape) {
        let is_mirrored = shape.to_world.matrix3.determinant() < 0.0;
        mesh.transform(shape.to_world);
        if mesh.normals.is_empty() {
            if shape.is_reversed != is_mirrored {
                mesh.flip();
            }
            return;
        }
        if shape.is_reversed {
            mesh.normals.iter_mut().for_each(|n| *n = -*n);
        }
        mesh.follow_normals();
    }

    /// A mesh in a file of its own, and its back where that shines as well.
    fn written(&self, mesh: Mesh, area: f64, shines_behind: bool, stem: &str) -> Geometry {
        let element = |mesh: &Mesh, stem: &str| {
            let ply = Element::plugin("shape", "ply").string("filename", &self.files.mesh(stem, mesh));
            flat_without_normals(ply, mesh)
        };
        let front = element(&mesh, stem);
        let back = shines_behind.then(|| {
            let mut back = mesh;
            back.grow(-BACK_OFFSET * back.extent());
            back.flip();
            element(&back, &format!("{stem}-back"))
        });
        Geometry { element: front, area, map: DAffine2::IDENTITY, back }
    }

    /// A quadric whose back shines as well: the same a little smaller or further back, turned over.
    fn two_quadrics(&self, shape: &Shape, element: Element, area: f64, map: DAffine2, is_flipped: bool) -> Geometry {
        let mut behind = shape.clone();
        let own = match &shape.parameters.kind[..] {
            "disk" => glam::DAffine3::from_translation(DVec3::Z * if is_flipped { BACK_OFFSET } else { -BACK_OFFSET }),
            _ => {
                glam::DAffine3::from_scale(DVec3::splat(if is_flipped { 1.0 + BACK_OFFSET } else { 1.0 - BACK_OFFSET }))
            }
        };
        behind.to_world *= own;
        let back = match quadrics::convert(&behind, false, self.notes) {
            Some(Quadric::Exact(back, ..)) => Some(back.boolean("flip_normals", !is_flipped)),
            _ => None,
        };
        let front = if is_flipped { element.boolean("flip_normals", true) } else { element };
        Geometry { element: front, area, map, back }
    }

    /// The area of what pbrt takes for one light: a triangle, not a mesh.
    fn area(&self, mesh: &Mesh, shape: &Shape, light: Option<&Parameters>) -> f64 {
        let Some(light) = light.filter(|light| light.float("power").is_some()) else { return 0.0 };
        let mut placed = mesh.clone();
        placed.transform(shape.to_world);
        let areas = placed.areas();
        let mean = areas.iter().sum::<f64>() / areas.len().max(1) as f64;
        if areas.iter().any(|area| (area / mean - 1.0).abs() > 0.01) {
            let message = "power: pbrt gives it to each triangle by itself; the mesh shines evenly with the same power as a whole of equal triangles would";
            self.notes.changed(light.place_of("power"), message);
        }
        mean
    }

    /// A reference to a PLY file where both renderers make of it what pbrt does.
    fn as_it_is(&self, path: &Path, mesh: &Mesh, shape: &Shape, is_needy: bool) -> Option<Element> {
        let is_mirrored = shape.to_world.matrix3.determinant() < 0.0;
        let turns = shape.is_reversed != is_mirrored;
        let is_plain = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("ply"))
            && self.has_triangles_only(path, mesh)
            && !(is_needy && mesh.uvs.is_empty())
            && (mesh.normals.is_empty() || !turns);
        if !is_plain || (is_needy && shape.area_light.is_some()) {
            return None;
        }
        let element = Element::plugin("shape", "ply").string("filename", &self.files.reference(path));
        let element = flat_without_normals(element, mesh).transform("to_world", shape.to_world);
        // Mitsuba orders corners after the transform, so a mirror turns what has no normals over there and not in pbrt
        Some(if turns { element.boolean("flip_normals", true) } else { element })
    }

    /// Whether every face of the file is a triangle: then there are as many as its header says.
    fn has_triangles_only(&self, path: &Path, mesh: &Mesh) -> bool {
        let Ok(bytes) = std::fs::read(path) else { return false };
        let header = String::from_utf8_lossy(&bytes[..bytes.len().min(4096)]);
        let count = header.lines().find_map(|line| line.trim().strip_prefix("element face ")?.trim().parse().ok());
        count == Some(mesh.triangles.len())
    }

    /// The mesh of a PLY file, in its own coordinates.
    fn ply(&self, path: &PathBuf, p: &Parameters) -> Option<Mesh> {
        let place = p.place_of("filename");
        if path.extension().is_some_and(|extension| extension == "gz") {
            self.notes
                .fault(place, format!("{} is packed; unpack it with gunzip and name what that gives", path.display()));
            return None;
        }
        let read = std::fs::read(path).map_err(|error| format!("cannot be read: {error}"));
        match read.and_then(|bytes| parse_ply(&bytes)) {
            Ok(raw) => {
                let mesh = Mesh {
                    positions: raw.positions.iter().map(|v| v.as_dvec3()).collect(),
                    normals: raw.normals.iter().map(|v| v.as_dvec3()).collect(),
                    uvs: raw.uvs.iter().map(|v| v.as_dvec2()).collect(),
                    triangles: raw.triangles,
                };
                self.sound(mesh, place)
            }
            Err(message) => {
                self.notes.fault(place, format!("{}: {message}", path.display()));
                None
            }
        }
    }

    /// `trianglemesh`, and the control mesh of `loopsubdiv`.
    fn triangles(&self, p: &Parameters) -> Option<Mesh> {
        if p.kind == "loopsubdiv" {
            self.notes.left_out(&p.place, "subdivision: the control mesh is written");
        }
        let positions = self.positions(p)?;
        let indices = match p.integers("indices") {
            Some(indices) => indices,
            None if positions.len() == 3 => vec![0, 1, 2],
            None => {
                self.notes.fault(&p.place, format!("{} points without indices; only three need none", positions.len()));
                return None;
            }
        };
        let corners = self.corners(p, &indices, 3)?;
        let triangles = corners.as_chunks().0.to_vec();
        self.attributes(p, Mesh { positions, triangles, ..Mesh::default() })
    }

    /// `bilinearmesh`: each patch of corners 00, 10, 01, 11 as two triangles.
    fn patches(&self, p: &Parameters) -> Option<Mesh> {
        let positions = self.positions(p)?;
        let indices = p.integers("indices").unwrap_or(vec![0, 1, 2, 3]);
        let corners = self.corners(p, &indices, 4)?;
        let mut mesh = Mesh { positions, ..Mesh::default() };
        let mut is_flat = true;
        for [p00, p10, p01, p11] in corners.as_chunks().0 {
            mesh.triangles.extend([[*p00, *p10, *p11], [*p00, *p11, *p01]]);
            let [a, b, c, d] = [p00, p10, p01, p11].map(|i| mesh.positions[*i as usize]);
            let volume = (b - a).cross(c - a).dot(d - a).abs();
            is_flat &= volume <= 1e-4 * ((b - a).length() + (c - a).length()).powi(3);
        }
        if !is_flat {
            self.notes.changed(&p.place, "a bilinear patch whose corners are not in one plane becomes two triangles");
        }
        let mut mesh = self.attributes(p, mesh)?;
        if mesh.uvs.is_empty() && indices.len() == 4 && mesh.positions.len() == 4 {
            mesh.uvs = vec![DVec2::ZERO, DVec2::X, DVec2::Y, DVec2::ONE];
        }
        Some(mesh)
    }

    fn positions(&self, p: &Parameters) -> Option<Vec<DVec3>> {
        let positions = p.points("P");
        if positions.is_none() {
            self.notes.fault(&p.place, format!("{} needs points, \"point3 P\"", p.described()));
        }
        positions
    }

    /// Vertex indices in groups.
    fn corners(&self, p: &Parameters, indices: &[i64], size: usize) -> Option<Vec<u32>> {
        if indices.is_empty() || !indices.len().is_multiple_of(size) {
            let message = format!("{} indices; expected a multiple of {size}", indices.len());
            self.notes.fault(p.place_of("indices"), message);
            return None;
        }
        let count = p.points("P").map_or(0, |points| points.len()) as i64;
        if let Some(index) = indices.iter().find(|index| !(0..count).contains(index)) {
            self.notes.fault(p.place_of("indices"), format!("the index {index} of {count} points"));
            return None;
        }
        Some(indices.iter().map(|index| *index as u32).collect())
    }

    /// `N` and `uv`, one for each point.
    fn attributes(&self, p: &Parameters, mut mesh: Mesh) -> Option<Mesh> {
        mesh.normals = p.points("N").unwrap_or_default();
        mesh.uvs = p.points_2("uv").or_else(|| p.points_2("st")).unwrap_or_default();
        for (name, count) in [("N", mesh.normals.len()), ("uv", mesh.uvs.len())] {
            if count != 0 && count != mesh.positions.len() {
                self.notes.fault(p.place_of(name), format!("{count} of {name} for {} points", mesh.positions.len()));
                return None;
            }
        }
        Some(mesh)
    }

    /// A mesh with something in it and no index out of range.
    fn sound(&self, mesh: Mesh, place: &crate::convert::notes::Place) -> Option<Mesh> {
        let count = mesh.positions.len();
        if mesh.triangles.is_empty() {
            self.notes.fault(place, "the mesh has no triangle");
            return None;
        }
        if let Some(index) = mesh.triangles.iter().flatten().find(|index| **index as usize >= count) {
            self.notes.fault(place, format!("a face refers to vertex {index} of {count}"));
            return None;
        }
        Some(mesh)
    }
}

/// Where a mesh has no normals, pbrt shades its triangles and Mitsuba, unless told so, makes some up.
fn flat_without_normals(element: Element, mesh: &Mesh) -> Element {
    if mesh.normals.is_empty() { element.boolean("face_normals", true) } else { element }
}
