//! `ply`: a PLY mesh, text or binary; `filename`, `to_world`, `flip_normals`, `face_normals`, `flip_tex_coords`.
//!
//! Vertices have `x y z`, optionally `nx ny nz` and `u v` or `s t`; faces have `vertex_indices` or `vertex_index`.
//! Polygons become fans of triangles (Mitsuba reads triangles only). Without normals in the file smooth ones are computed,
//! as in Mitsuba, unless `face_normals`.
//!
//! The header is read by ply-rs. The elements are read here, one after the other into the arrays of the mesh: ply-rs
//! keeps an object for each, which for a mesh of 10 million triangles is three times the size of the mesh. One thread
//! does: where each element has a length of its own, the others would have to wait for it, and a binary file takes
//! 8 ns a number, which is a tenth of what the hierarchy over its triangles takes.

mod values;

use std::io::BufRead;

use glam::{Vec2, Vec3};
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{DefaultElement, ElementDef, PropertyDef, PropertyType, ScalarType};

use super::super::Folder;
use super::super::parameters::ElementParameters;
use super::mesh::RawMesh;
use super::{Build, mesh_file};
use values::Values;

/// Reads the element; the file is read by what it returns.
pub fn read(p: &mut ElementParameters, folder: &Folder) -> Option<Build> {
    mesh_file(p, folder, Some(false), |source| {
        let size = source.get_ref().size().unwrap_or(0);
        parse(source, size)
    })
}

/// The content of a file in memory as one mesh.
pub fn parse_bytes(bytes: &[u8]) -> Result<RawMesh, String> {
    parse(&mut &bytes[..], bytes.len() as u64)
}

/// The content of a file of that many bytes as one mesh.
fn parse(source: &mut impl BufRead, size: u64) -> Result<RawMesh, String> {
    let fault = |message: String| format!("it is no readable PLY: {message}");
    let mut reader = Reader::new(source);
    let header = Parser::<DefaultElement>::new().read_header(&mut reader);
    let header = header.map_err(|error| fault(one_line(&error.to_string())))?;
    let lines = reader.line().saturating_sub(1); // it stands at the next one
    let mut values = Values::new(reader.into_inner(), &header.encoding, lines);
    let mut raw = RawMesh::default();
    for element in header.elements.values() {
        // a header may promise anything, but an element takes a byte at least
        let likely = element.count.min(usize::try_from(size).unwrap_or(usize::MAX));
        match element.name.as_str() {
            "vertex" => vertices(&mut raw, element, likely, &mut values)?,
            "face" => faces(&mut raw, element, likely, &mut values)?,
            _ => skip(element, &mut values).map_err(fault)?,
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
fn vertices(
    raw: &mut RawMesh,
    element: &ElementDef,
    likely: usize,
    values: &mut Values<impl BufRead>,
) -> Result<(), String> {
    /// Places of what a vertex has.
    const NAMES: [(&str, usize); 10] =
        [("x", 0), ("y", 1), ("z", 2), ("nx", 3), ("ny", 4), ("nz", 5), ("u", 6), ("v", 7), ("s", 6), ("t", 7)];
    let has = |names: &[&str]| names.iter().all(|name| element.properties.contains_key(*name));
    if !has(&["x", "y", "z"]) {
        return Err("its vertices have no x, y and z".into());
    }
    let place = |name: &str| NAMES.iter().find(|(known, _)| *known == name).map(|(_, place)| *place);
    let properties: Vec<_> = element.properties.values().map(|property| (place(&property.name), property)).collect();
    let (has_normals, has_uvs) = (has(&["nx", "ny", "nz"]), has(&["u", "v"]) || has(&["s", "t"]));
    reserve(&mut raw.positions, likely);
    reserve(&mut raw.normals, if has_normals { likely } else { 0 });
    reserve(&mut raw.uvs, if has_uvs { likely } else { 0 });
    for i in 0..element.count {
        let vertex = vertex(&properties, values).map_err(|message| in_element(element, i, message))?;
        let [x, y, z, nx, ny, nz, u, v] = vertex;
        raw.positions.push(Vec3::new(x, y, z));
        if has_normals {
            raw.normals.push(Vec3::new(nx, ny, nz));
        }
        if has_uvs {
            raw.uvs.push(Vec2::new(u, v));
        }
    }
    Ok(())
}

/// The next vertex; 0 for what it does not have.
#[inline]
fn vertex(properties: &[(Option<usize>, &PropertyDef)], values: &mut Values<impl BufRead>) -> Result<[f32; 8], String> {
    let mut vertex = [0.0; 8];
    values.begin()?;
    for (place, property) in properties {
        match (place, &property.data_type) {
            (Some(place), PropertyType::Scalar(kind)) => vertex[*place] = values.next(kind)? as f32,
            (_, kind) => skip_property(kind, values)?,
        }
    }
    values.end()?;
    Ok(vertex)
}

/// Fans of triangles.
fn faces(
    raw: &mut RawMesh,
    element: &ElementDef,
    likely: usize,
    values: &mut Values<impl BufRead>,
) -> Result<(), String> {
    reserve(&mut raw.triangles, likely);
    for i in 0..element.count {
        let is_usable = face(raw, element, values).map_err(|message| in_element(element, i, message))?;
        if !is_usable {
            return Err(format!("face {} has no list vertex_indices of whole numbers that are not negative", i + 1));
        }
    }
    Ok(())
}

/// Adds the next face; false where it has no corners that could be vertices.
#[inline]
fn face(raw: &mut RawMesh, element: &ElementDef, values: &mut Values<impl BufRead>) -> Result<bool, String> {
    let mut has_corners = false;
    values.begin()?;
    for property in element.properties.values() {
        match &property.data_type {
            PropertyType::List(length, kind) if matches!(&*property.name, "vertex_indices" | "vertex_index") => {
                has_corners = !matches!(kind, ScalarType::Float | ScalarType::Double);
                let mut fan = [0; 2]; // the first corner and the last
                for i in 0..values.length(length)? {
                    let corner = values.next(kind)?;
                    let index = corner as u32;
                    has_corners &= f64::from(index) == corner;
                    if i > 1 {
                        raw.triangles.push([fan[0], fan[1], index]);
                    }
                    fan[i.min(1)] = index;
                }
            }
            kind => skip_property(kind, values)?,
        }
    }
    values.end()?;
    Ok(has_corners)
}

/// Makes room for what is likely to come. Without it arrays grow as they are filled, to up to twice the size.
fn reserve<T>(array: &mut Vec<T>, likely: usize) {
    drop(array.try_reserve_exact(likely)); // a false promise is found out when the file ends
}

/// Passes over elements of another name.
fn skip(element: &ElementDef, values: &mut Values<impl BufRead>) -> Result<(), String> {
    if element.properties.values().next().is_none() {
        return Ok(()); // any number of them takes no place
    }
    for _ in 0..element.count {
        values.begin()?;
        for property in element.properties.values() {
            skip_property(&property.data_type, values)?;
        }
        values.end()?;
    }
    Ok(())
}

fn skip_property(kind: &PropertyType, values: &mut Values<impl BufRead>) -> Result<(), String> {
    match kind {
        PropertyType::Scalar(kind) => values.next(kind).map(drop),
        PropertyType::List(length, kind) => {
            let length = values.length(length)?;
            (0..length).try_for_each(|_| values.next(kind).map(drop))
        }
    }
}

/// What is wrong with an element.
fn in_element(element: &ElementDef, index: usize, message: String) -> String {
    format!("it is no readable PLY: {} {} of {}: {message}", element.name, index + 1, element.count)
}

#[cfg(test)]
mod tests;
