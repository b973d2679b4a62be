//! `obj`: a Wavefront OBJ mesh; `filename`, `to_world`, `flip_normals`, `face_normals`, `flip_tex_coords`.
//!
//! All groups and objects of the file are one mesh; materials, points, lines and curves in it are ignored. Polygons become
//! fans of triangles from their first corner, as in Mitsuba. A face refers to vertices before it, by their number from 1 or
//! backwards from −1. Without any normals in the file smooth ones are computed, as in Mitsuba, unless `face_normals`. Among
//! faces with normals one without is flat, and among corners with texture coordinates one without has (0, 0); of that
//! Mitsuba makes nothing.
//!
//! The text is read in pieces of whole lines. What a line says by itself is found out in parallel; what it means among
//! those before it, one line after the other. Lines that are not plain — faulty, or joined by backslashes — are left to
//! the second step altogether, so that faults are found in their order.

mod corners;
mod piece;

use std::io::{self, BufRead, Read};

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::super::Folder;
use super::super::parameters::ElementParameters;
use super::mesh::RawMesh;
use super::{Build, mesh_file};
use corners::{Corner, Corners};
use piece::{Numbers, Piece, Said};

/// Reads the element; the file is read by what it returns.
pub fn read(p: &mut ElementParameters, folder: &Folder) -> Option<Build> {
    mesh_file(p, folder, Some(true), |source| parse(source))
}

/// Bytes of a piece: many lines, and so few that pieces for all threads are little beside a large mesh.
const PIECE: usize = 1 << 15;
/// Pieces at once, for each thread: so that none waits long for the last.
const PIECES_A_THREAD: usize = 4;

/// The text of a file as one mesh.
pub fn parse(source: &mut impl BufRead) -> Result<RawMesh, String> {
    parse_in_pieces(source, PIECE)
}

/// The same with pieces of that many bytes or little more.
fn parse_in_pieces(source: &mut impl BufRead, bytes: usize) -> Result<RawMesh, String> {
    let mut file = Content::default();
    let mut pieces = vec![Piece::default(); PIECES_A_THREAD * rayon::current_num_threads()];
    let mut lines = 0;
    loop {
        let mut count = 0;
        while count < pieces.len() && fill(&mut pieces[count].text, source, bytes).map_err(|e| e.to_string())? {
            count += 1;
        }
        if count == 0 {
            return Ok(file.corners.finish(file.positions, file.normals, file.uvs, file.triangles));
        }
        pieces[..count].par_iter_mut().for_each(Piece::read);
        for piece in &pieces[..count] {
            file.take(piece, lines)?;
            lines += piece.lines;
        }
    }
}

/// Replaces a text by that many next bytes of a source, and those up to the end of the line; false where there is none.
fn fill(text: &mut Vec<u8>, source: &mut impl BufRead, bytes: usize) -> io::Result<bool> {
    text.clear();
    source.by_ref().take(bytes as u64).read_to_end(text)?;
    let mut line = text.iter().rposition(|b| *b == b'\n').map_or(0, |end| end + 1);
    while source.read_until(b'\n', text)? > 0 && goes_on(&text[line..]) {
        line = text.len();
    }
    Ok(!text.is_empty())
}

/// Appends the next line, with those that a backslash at its end joins to it; how many these are, 0 at the end.
fn read_line(source: &mut impl BufRead, line: &mut Vec<u8>) -> io::Result<usize> {
    let mut lines = 0;
    let mut start = 0;
    while source.read_until(b'\n', line)? > 0 {
        lines += 1;
        if !goes_on(&line[start..]) {
            break;
        }
        line.truncate(line.trim_ascii_end().len() - 1);
        line.push(b' ');
        start = line.len();
    }
    Ok(lines)
}

/// Whether a backslash at its end joins a line to the next.
fn goes_on(line: &[u8]) -> bool {
    line.trim_ascii_end().ends_with(b"\\")
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

/// Numbers of positions, texture coordinates and normals so far.
type Counts = [usize; 3];

impl Content {
    /// Adds what a piece says behind that many lines.
    fn take(&mut self, piece: &Piece, lines_before: usize) -> Result<(), String> {
        let mut corners = piece.corners.iter();
        for (start, said) in &piece.said {
            if !self.add(*said, &mut corners) {
                let (before, mut text) = piece.text.split_at(*start as usize);
                let mut line = Vec::new();
                read_line(&mut text, &mut line).map_err(|error| error.to_string())?;
                let number = || lines_before + before.iter().filter(|b| **b == b'\n').count() + 1;
                self.line(&line).map_err(|message| format!("line {}: {message}: {:?}", number(), shown(&line)))?;
            }
        }
        Ok(())
    }

    /// Adds what a line says, with its corners, which are the next ones; false where the line must be looked at again.
    #[inline]
    fn add(&mut self, said: Said, corners: &mut std::slice::Iter<Numbers>) -> bool {
        match said {
            Said::Position(position) => push(&mut self.positions, position).is_ok(),
            Said::Normal(normal) => push(&mut self.normals, normal).is_ok(),
            Said::Uv(uv) => push(&mut self.uvs, uv).is_ok(),
            Said::Face(count) => {
                let (face, rest) = corners.as_slice().split_at(count as usize);
                *corners = rest.iter();
                let counts = self.counts();
                let known = face.iter().map(|numbers| numbers.corner(counts));
                known.clone().all(|corner| corner.is_some())
                    && self.face(known.map(|corner| corner.ok_or_else(String::new))).is_ok()
            }
            Said::Unclear => false,
        }
    }

    /// Takes in a line, or says in a few words what is wrong with it.
    fn line(&mut self, line: &[u8]) -> Result<(), String> {
        let mut words = words(line);
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
            Some(b"f") => {
                let counts = self.counts();
                self.face(words.map(|word| corner(word, counts)))
            }
            _ => Ok(()),
        }
    }

    fn counts(&self) -> Counts {
        [self.positions.len(), self.uvs.len(), self.normals.len()]
    }

    #[inline]
    fn face(&mut self, corners: impl Iterator<Item = Result<Corner, String>>) -> Result<(), String> {
        let mut count = 0;
        let mut fan = [0; 2]; // the first corner and the last
        for corner in corners {
            let index = self.corners.vertex(corner?, self.positions.len())?;
            if count > 1 {
                self.triangles.push([fan[0], fan[1], index]);
            }
            fan[count.min(1)] = index;
            count += 1;
        }
        if count > 2 { Ok(()) } else { Err(format!("the face has {count} corners; it must have 3 or more")) }
    }
}

/// `v`, `v/vt`, `v//vn` or `v/vt/vn`.
fn corner(word: &[u8], [positions, uvs, normals]: Counts) -> Result<Corner, String> {
    let mut parts = word.split(|b| *b == b'/');
    let position = index(parts.next().unwrap_or_default(), positions, "vertex")?;
    let mut optional = |count: usize, what: &str| match parts.next() {
        None | Some(b"") => Ok(None),
        Some(part) => index(part, count, what).map(Some),
    };
    let uv = optional(uvs, "texture coordinate")?;
    let normal = optional(normals, "normal")?;
    match parts.next() {
        None => Ok(Corner { position, uv, normal }),
        Some(_) => Err("a corner is v, v/vt, v//vn or v/vt/vn".into()),
    }
}

/// The words of a line.
#[inline]
fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty())
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
fn index(word: &[u8], count: usize, what: &str) -> Result<u32, String> {
    let number = std::str::from_utf8(word).ok().and_then(|word| word.parse::<i64>().ok());
    let number = number.ok_or_else(|| format!("{:?} is not a whole number", shown(word)))?;
    match place(number, count) {
        Some(place) => Ok(place),
        None if number == 0 => Err(format!("{what} 0: numbers begin at 1")),
        None => Err(format!("{what} {number} of {count}")),
    }
}

/// The same of a number that has been read.
#[inline]
fn place(number: i64, count: usize) -> Option<u32> {
    let place = if number > 0 { Some(number - 1) } else { (number < 0).then(|| count as i64 + number) };
    place.filter(|place| (0..count as i64).contains(place)).map(|place| place as u32)
}

#[cfg(test)]
mod tests;
