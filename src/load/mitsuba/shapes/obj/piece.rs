//! What lines say by themselves.

use std::io::BufRead;

use glam::{Vec2, Vec3};

use super::corners::Corner;
use super::{Counts, goes_on, numbers, place, words};

/// Some whole lines of a file.
#[derive(Clone, Debug, Default)]
pub struct Piece {
    pub text: Vec<u8>,
    /// Number of lines.
    pub lines: usize,
    /// Where lines that say something begin, and what it is.
    pub said: Vec<(u32, Said)>,
    /// The corners of all faces.
    pub corners: Vec<Numbers>,
}

/// What a line says.
#[derive(Clone, Copy, Debug)]
pub enum Said {
    Position(Vec3),
    Normal(Vec3),
    Uv(Vec2),
    /// A face of that many corners, 3 or more.
    Face(u32),
    /// Something that takes a closer look, with what stands before it.
    Unclear,
}

/// The numbers of a corner's position, texture coordinate and normal as they stand in the file; 0 where there is none.
#[derive(Clone, Copy, Debug)]
pub struct Numbers([i32; 3]);

impl Piece {
    /// Finds out what the text says.
    pub fn read(&mut self) {
        let Piece { text, lines, said, corners } = self;
        *lines = 0;
        said.clear();
        corners.clear();
        let mut rest = &text[..];
        let mut is_joined = false; // by a backslash to the line before, which is unclear
        while !rest.is_empty() {
            let start = text.len() - rest.len();
            let length = rest.skip_until(b'\n').expect("memory can be read");
            let line = &text[start..start + length];
            let goes_on = goes_on(line);
            if goes_on && !is_joined {
                said.push((start as u32, Said::Unclear));
            } else if !is_joined && let Some(what) = said_by(line, corners) {
                said.push((start as u32, what));
            }
            is_joined = goes_on;
            *lines += 1;
        }
    }
}

/// What a line says, or `None` of one that says nothing about a mesh.
#[inline]
fn said_by(line: &[u8], corners: &mut Vec<Numbers>) -> Option<Said> {
    let mut words = words(line);
    let said = match words.next()? {
        b"v" => numbers(&mut words, 3, "").map(|position| Said::Position(position.into())),
        b"vn" => numbers(&mut words, 3, "").map(|normal| Said::Normal(normal.into())),
        b"vt" => numbers(&mut words, 1, "").map(|[u, v, _]| Said::Uv(Vec2::new(u, v))),
        b"f" => {
            let before = corners.len();
            let count = face(words, corners).filter(|count| *count > 2);
            if count.is_none() {
                corners.truncate(before);
            }
            return Some(count.map_or(Said::Unclear, Said::Face));
        }
        _ => return None,
    };
    Some(said.unwrap_or(Said::Unclear))
}

/// Adds the corners of a face; how many there are, unless one is odd.
#[inline]
fn face<'l>(words: impl Iterator<Item = &'l [u8]>, corners: &mut Vec<Numbers>) -> Option<u32> {
    let mut count = 0;
    for word in words {
        corners.push(Numbers::read(word)?);
        count += 1;
    }
    Some(count)
}

impl Numbers {
    /// Of a word `v`, `v/vt`, `v//vn` or `v/vt/vn`.
    #[inline]
    fn read(word: &[u8]) -> Option<Numbers> {
        let mut numbers = [0; 3];
        for (i, part) in word.split(|b| *b == b'/').enumerate() {
            let number = numbers.get_mut(i)?;
            if i == 0 || !part.is_empty() {
                *number = std::str::from_utf8(part).ok()?.parse().ok().filter(|number| *number != 0)?;
            }
        }
        Some(Numbers(numbers))
    }

    /// What they refer to, if that is there.
    #[inline]
    pub fn corner(self, counts: Counts) -> Option<Corner> {
        let Numbers([position, uv, normal]) = self;
        let optional = |number: i32, count: usize| match number {
            0 => Some(None),
            _ => place(number.into(), count).map(Some),
        };
        Some(Corner {
            position: place(position.into(), counts[0])?,
            uv: optional(uv, counts[1])?,
            normal: optional(normal, counts[2])?,
        })
    }
}
