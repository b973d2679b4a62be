//! `obj`: a Wavefront OBJ mesh; `filename`, `to_world`, `flip_normals`, `face_normals`, `flip_tex_coords`.
//!
//! Polygons become fans of triangles; materials, points and lines in the file are ignored. Without normals in the
//! file the faces are flat.

use std::path::Path;

use glam::{Vec2, Vec3};

use super::super::parameters::ElementParameters;
use super::mesh::RawMesh;
use super::{Build, mesh_file};

/// Reads the element; the file is read by what it returns.
pub fn read(p: &mut ElementParameters, folder: &Path) -> Option<Build> {
    mesh_file(p, folder, true, parse)
}

/// The text of a file as one mesh.
fn parse(mut bytes: &[u8]) -> Result<RawMesh, String> {
    let whole = bytes;
    report_non_finite(whole)?;
    let options = tobj::LoadOptions { single_index: true, triangulate: true, ignore_points: true, ignore_lines: true };
    let no_materials = |_: &Path| Ok((Vec::new(), Default::default()));
    let (models, _) = tobj::load_obj_buf(&mut bytes, &options, no_materials).map_err(|error| explain(error, whole))?;
    let mut raw = RawMesh::default();
    let has_normals = models.iter().any(|m| !m.mesh.normals.is_empty());
    let has_uvs = models.iter().any(|m| !m.mesh.texcoords.is_empty());
    for model in models {
        append(&mut raw, &model.mesh, has_normals, has_uvs)?;
    }
    Ok(raw)
}

/// Adds one group of the file.
fn append(raw: &mut RawMesh, group: &tobj::Mesh, has_normals: bool, has_uvs: bool) -> Result<(), String> {
    let count = group.positions.len() / 3;
    let first = u32::try_from(raw.positions.len()).map_err(|_| "it has more than 2³² vertices".to_string())?;
    if has_normals && group.normals.len() != 3 * count {
        return Err("some of its faces have normals and some have none; give all of them or set face_normals".into());
    }
    raw.positions.extend(group.positions.chunks_exact(3).map(Vec3::from_slice));
    raw.normals.extend(group.normals.chunks_exact(3).map(Vec3::from_slice));
    if has_uvs && group.texcoords.len() == 2 * count {
        raw.uvs.extend(group.texcoords.chunks_exact(2).map(Vec2::from_slice));
    } else if has_uvs {
        return Err("some of its faces have texture coordinates and some have none; give all or none".into());
    }
    raw.triangles.extend(group.indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]].map(|i| first + i)));
    Ok(())
}

/// Numbers of vertices that are not finite, found before vertices are renumbered; the line is worth a pass.
fn report_non_finite(bytes: &[u8]) -> Result<(), String> {
    let mut vertex = 0;
    for (i, line) in lines(bytes).enumerate() {
        let Some(rest) = line.strip_prefix("v ") else { continue };
        vertex += 1;
        let is_finite = |word: &str| word.parse::<f32>().map_or(true, f32::is_finite);
        if !rest.split_ascii_whitespace().take(3).all(is_finite) {
            let rest = rest.trim();
            return Err(format!("line {}: vertex {vertex} is \"{rest}\"; it must be finite", i + 1));
        }
    }
    Ok(())
}

/// tobj's error with the line that caused it, where that can be told.
fn explain(error: tobj::LoadError, bytes: &[u8]) -> String {
    let is_bad_number = |line: &str, keyword: &str, least: usize| {
        line.strip_prefix(keyword).is_some_and(|rest| {
            let words: Vec<_> = rest.split_ascii_whitespace().collect();
            words.len() < least || words.iter().any(|word| word.parse::<f32>().is_err())
        })
    };
    let count = |keyword: &str| lines(bytes).filter(|line| line.starts_with(keyword)).count() as i64;
    let is_bad_index = |line: &str, part: usize, count: i64| {
        let indices = line.strip_prefix("f ").unwrap_or_default().split_ascii_whitespace();
        let mut indices = indices.filter_map(|word| word.split('/').nth(part)?.parse::<i64>().ok());
        indices.any(|index| index == 0 || index.abs() > count)
    };
    let culprit: Box<dyn Fn(&str) -> bool> = match error {
        tobj::LoadError::PositionParseError => Box::new(|line| is_bad_number(line, "v ", 3)),
        tobj::LoadError::NormalParseError => Box::new(|line| is_bad_number(line, "vn ", 3)),
        tobj::LoadError::TexcoordParseError => Box::new(|line| is_bad_number(line, "vt ", 2)),
        tobj::LoadError::FaceParseError => Box::new(|line| line.starts_with("f ") && !is_face(line)),
        tobj::LoadError::FaceVertexOutOfBounds => Box::new(move |line| is_bad_index(line, 0, count("v "))),
        tobj::LoadError::FaceTexCoordOutOfBounds => Box::new(move |line| is_bad_index(line, 1, count("vt "))),
        tobj::LoadError::FaceNormalOutOfBounds => Box::new(move |line| is_bad_index(line, 2, count("vn "))),
        _ => Box::new(|_| false),
    };
    match lines(bytes).enumerate().find(|(_, line)| culprit(line)) {
        Some((i, line)) => format!("line {}: {error}: \"{}\"", i + 1, line.trim()),
        None => format!("it is no Wavefront OBJ: {error}"),
    }
}

/// Whether a line `f …` has three or more corners of whole numbers.
fn is_face(line: &str) -> bool {
    let mut corners = line[2..].split_ascii_whitespace().peekable();
    corners.peek().is_some()
        && corners.all(|corner| corner.split('/').all(|index| index.is_empty() || index.parse::<i64>().is_ok()))
}

/// Lines without leading blanks; what is not UTF-8 is left out.
fn lines(bytes: &[u8]) -> impl Iterator<Item = &str> {
    bytes.split(|b| *b == b'\n').map(|line| std::str::from_utf8(line).unwrap_or_default().trim_start())
}
