//! `ply`: a PLY mesh, text or binary; `filename`, `to_world`, `flip_normals`, `face_normals`, `flip_tex_coords`.
//!
//! Vertices have `x y z`, optionally `nx ny nz` and `u v` or `s t`; faces have `vertex_indices` or `vertex_index`.
//! Polygons become fans of triangles (Mitsuba reads triangles only). Without normals the faces are flat.

use std::path::Path;

use glam::{Vec2, Vec3};
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{DefaultElement, ElementDef, Property, PropertyAccess, PropertyAccessResult};

use super::super::parameters::ElementParameters;
use super::mesh::RawMesh;
use super::{Build, mesh_file};

/// Reads the element; the file is read by what it returns.
pub fn read(p: &mut ElementParameters, folder: &Path) -> Option<Build> {
    mesh_file(p, folder, false, parse)
}

/// The content of a file as one mesh.
pub fn parse(bytes: &[u8]) -> Result<RawMesh, String> {
    let mut reader = Reader::new(bytes);
    let fault = |error: &dyn std::fmt::Display| format!("it is no readable PLY: {}", one_line(&error.to_string()));
    let header = Parser::<DefaultElement>::new().read_header(&mut reader).map_err(|e| fault(&e))?;
    let mut raw = RawMesh::default();
    for element in header.elements.values() {
        match element.name.as_str() {
            "vertex" => {
                let vertices = Parser::<Vertex>::new().read_payload_for_element(&mut reader, element, &header);
                add_vertices(&mut raw, element, &vertices.map_err(|e| fault(&e))?)?;
            }
            "face" => {
                let faces = Parser::<Face>::new().read_payload_for_element(&mut reader, element, &header);
                add_faces(&mut raw, &faces.map_err(|e| fault(&e))?)?;
            }
            _ => {
                let skipped = Parser::<Skipped>::new().read_payload_for_element(&mut reader, element, &header);
                skipped.map_err(|e| fault(&e))?;
            }
        }
    }
    Ok(raw)
}

/// The parser's message up to where it gives its grammar, which says nothing to those who have no parser to write.
fn one_line(message: &str) -> String {
    let words: Vec<_> = message.split_whitespace().take_while(|word| *word != "Error:").collect();
    words.join(" ").chars().filter(|c| !c.is_control()).take(200).collect()
}

/// Positions, and normals and texture coordinates where the header names all of their parts.
fn add_vertices(raw: &mut RawMesh, element: &ElementDef, vertices: &[Vertex]) -> Result<(), String> {
    let has = |names: &[&str]| names.iter().all(|name| element.properties.contains_key(*name));
    if !has(&["x", "y", "z"]) {
        return Err("its vertices have no x, y and z".into());
    }
    raw.positions = vertices.iter().map(|v| v.position).collect();
    if has(&["nx", "ny", "nz"]) {
        raw.normals = vertices.iter().map(|v| v.normal).collect();
    }
    if has(&["u", "v"]) || has(&["s", "t"]) {
        raw.uvs = vertices.iter().map(|v| v.uv).collect();
    }
    Ok(())
}

/// Fans of triangles.
fn add_faces(raw: &mut RawMesh, faces: &[Face]) -> Result<(), String> {
    for (i, face) in faces.iter().enumerate() {
        let Some(corners) = &face.corners else {
            return Err(format!("face {} has no list vertex_indices of whole numbers that are not negative", i + 1));
        };
        let fan = corners.windows(2).skip(1).map(|pair| [corners[0], pair[0], pair[1]]);
        raw.triangles.extend(fan);
    }
    Ok(())
}

/// An element of "vertex".
struct Vertex {
    position: Vec3,
    normal: Vec3,
    uv: Vec2,
}

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Vertex { position: Vec3::ZERO, normal: Vec3::ZERO, uv: Vec2::ZERO }
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let place = match name {
            "x" => &mut self.position.x,
            "y" => &mut self.position.y,
            "z" => &mut self.position.z,
            "nx" => &mut self.normal.x,
            "ny" => &mut self.normal.y,
            "nz" => &mut self.normal.z,
            "u" | "s" => &mut self.uv.x,
            "v" | "t" => &mut self.uv.y,
            _ => return PropertyAccessResult::Ignored,
        };
        let Some(value) = property.to_f32_lossy() else { return PropertyAccessResult::UnsupportedType };
        *place = value;
        PropertyAccessResult::Set
    }
}

/// An element of "face"; `None` where its corners are missing or no vertex numbers.
struct Face {
    corners: Option<Vec<u32>>,
}

impl PropertyAccess for Face {
    fn new() -> Self {
        Face { corners: None }
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        if !matches!(name, "vertex_indices" | "vertex_index") {
            return PropertyAccessResult::Ignored;
        }
        self.corners = property.to_u32_list();
        PropertyAccessResult::Set
    }
}

/// An element of any other name.
struct Skipped;

impl PropertyAccess for Skipped {
    fn new() -> Self {
        Skipped
    }
}
