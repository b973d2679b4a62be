//! `obj`: a Wavefront OBJ mesh; `filename`, `to_world`, `flip_normals`, `face_normals`, `flip_tex_coords`.
//!
//! All groups and objects of the file are one mesh; materials, points, lines and curves in it are ignored. Polygons become
//! fans of triangles from their first corner, as in Mitsuba. A face refers to vertices before it, by their number from 1 or
//! backwards from −1. Without any normals in the file smooth ones are computed, as in Mitsuba, unless `face_normals`. Among
//! faces with normals one without is flat, and among corners with texture coordinates one without has (0, 0); of that
//! Mitsuba makes nothing.

mod corners;

use std::io::BufRead;
use std::path::Path;

use glam::{Vec2, Vec3};

use super::super::parameters::ElementParameters;
use super::mesh::RawMesh;
use super::{Build, mesh_file};
use corners::{Corner, Corners};

/// Reads the element; the file is read by what it returns.
pub fn read(p: &mut ElementParameters, folder: &Path) -> Option<Build> {
    mesh_file(p, folder, Some(true), |source| parse(source))
}

/// The text of a file as one mesh.
fn parse(source: &mut impl BufRead) -> Result<RawMesh, String> {
    let mut file = Content::default();
    let mut line = Vec::new();
    let mut number = 0;
    loop {
        line.clear();
        match read_line(source, &mut line) {
            Ok(0) => break,
            Ok(lines) => {
                file.line(&line).map_err(|message| format!("line {}: {message}: {:?}", number + 1, shown(&line)))?;
                number += lines;
            }
            Err(error) => return Err(error.to_string()),
        }
    }
    Ok(file.corners.finish(file.positions, file.normals, file.uvs, file.triangles))
}

/// Appends the next line, with those that a backslash at its end joins to it; how many these are, 0 at the end.
fn read_line(source: &mut impl BufRead, line: &mut Vec<u8>) -> std::io::Result<usize> {
    let mut lines = 0;
    while source.read_until(b'\n', line)? > 0 {
        lines += 1;
        let text = line.trim_ascii_end().len();
        if !line[..text].ends_with(b"\\") {
            break;
        }
        line.truncate(text - 1);
        line.push(b' ');
    }
    Ok(lines)
}

/// A line in a message.
fn shown(line: &[u8]) -> String {
    String::from_utf8_lossy(line.trim_ascii()).chars().filter(|c| !c.is_control()).take(80).collect()
}

/// What the lines so far say.
#[derive(Default)]
struct Content {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    uvs: Vec<Vec2>,
    corners: Corners,
    triangles: Vec<[u32; 3]>,
}

impl Content {
    /// Takes in a line, or says in a few words what is wrong with it.
    fn line(&mut self, line: &[u8]) -> Result<(), String> {
        let mut words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
        match words.next() {
            Some(b"v") => {
                let position = numbers(&mut words, 3, "the vertex")?;
                push(&mut self.positions, Vec3::from(position))
            }
            Some(b"vn") => {
                let normal = numbers(&mut words, 3, "the normal")?;
                push(&mut self.normals, Vec3::from(normal))
            }
            Some(b"vt") => {
                let [u, v, _] = numbers(&mut words, 1, "the texture coordinate")?;
                push(&mut self.uvs, Vec2::new(u, v))
            }
            Some(b"f") => self.face(words),
            _ => Ok(()),
        }
    }

    fn face<'l>(&mut self, words: impl Iterator<Item = &'l [u8]>) -> Result<(), String> {
        let mut count = 0;
        let mut fan = [0; 2]; // the first corner and the last
        for word in words {
            let corner = self.corner(word)?;
            let index = self.corners.vertex(corner, self.positions.len())?;
            if count > 1 {
                self.triangles.push([fan[0], fan[1], index]);
            }
            fan[count.min(1)] = index;
            count += 1;
        }
        if count > 2 { Ok(()) } else { Err(format!("the face has {count} corners; it must have 3 or more")) }
    }

    /// `v`, `v/vt`, `v//vn` or `v/vt/vn`.
    #[inline]
    fn corner(&self, word: &[u8]) -> Result<Corner, String> {
        let mut parts = word.split(|b| *b == b'/');
        let position = index(parts.next().unwrap_or_default(), self.positions.len(), "vertex")?;
        let mut optional = |count: usize, what: &str| match parts.next() {
            None | Some(b"") => Ok(None),
            Some(part) => index(part, count, what).map(Some),
        };
        let uv = optional(self.uvs.len(), "texture coordinate")?;
        let normal = optional(self.normals.len(), "normal")?;
        match parts.next() {
            None => Ok(Corner { position, uv, normal }),
            Some(_) => Err("a corner is v, v/vt, v//vn or v/vt/vn".into()),
        }
    }
}

/// Numbers are u32 throughout.
fn push<T>(array: &mut Vec<T>, value: T) -> Result<(), String> {
    array.push(value);
    if array.len() < u32::MAX as usize { Ok(()) } else { Err("the file has more than 2³² of these".into()) }
}

/// The first three numbers on a line, of which as many as `least` must be there and 0 stands for the others.
#[inline]
fn numbers<'l>(words: &mut impl Iterator<Item = &'l [u8]>, least: usize, what: &str) -> Result<[f32; 3], String> {
    let mut numbers = [0.0; 3];
    for (i, number) in numbers.iter_mut().enumerate() {
        let Some(word) = words.next() else {
            return if i < least { Err(format!("{what} has {i} numbers; it needs {least}")) } else { Ok(numbers) };
        };
        let value = std::str::from_utf8(word).ok().and_then(|word| word.parse::<f32>().ok());
        *number = value.ok_or_else(|| format!("{:?} is not a number", shown(word)))?;
        if !number.is_finite() {
            return Err(format!("{what} must be finite"));
        }
    }
    Ok(numbers)
}

/// The place, from 0, that a number from 1 or backwards from −1 stands for among `count`.
#[inline]
fn index(word: &[u8], count: usize, what: &str) -> Result<u32, String> {
    let number = std::str::from_utf8(word).ok().and_then(|word| word.parse::<i64>().ok());
    let number = number.ok_or_else(|| format!("{:?} is not a whole number", shown(word)))?;
    let place = if number > 0 { Some(number - 1) } else { (number < 0).then(|| count as i64 + number) };
    match place.filter(|place| (0..count as i64).contains(place)) {
        Some(place) => Ok(place as u32),
        None if number == 0 => Err(format!("{what} 0: numbers begin at 1")),
        None => Err(format!("{what} {number} of {count}")),
    }
}

#[cfg(test)]
mod tests;
