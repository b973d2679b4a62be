//! From corners with separate numbers for position, texture coordinate and normal to vertices that have one for all.
//!
//! Most files need nothing of the kind: they have positions only, or number everything alike. As long as that is so, a
//! vertex is what has its number, and no table is kept. The first corner that is different makes one.

use std::collections::HashMap;

use glam::{Vec2, Vec3};

use super::super::mesh::RawMesh;

/// What a corner of a face refers to, from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Corner {
    pub position: u32,
    pub uv: Option<u32>,
    pub normal: Option<u32>,
}

/// The vertices that corners have made so far.
#[derive(Debug, Default)]
pub enum Corners {
    /// There is no face yet.
    #[default]
    None,
    /// All corners have the same numbers for all that they have.
    Alike { uvs: bool, normals: bool },
    /// A table.
    Different(Table),
}

/// Vertices, and by position those that share it, as linked lists.
#[derive(Debug, Default)]
pub struct Table {
    vertices: Vec<[u32; 3]>,
    /// By position: its first vertex.
    first: Vec<u32>,
    /// By vertex: the next one with the same position.
    next: Vec<u32>,
    /// Vertices of positions that have [`LONG`] others already, by their numbers.
    far: HashMap<[u32; 3], u32>,
}

/// Vertices with the same position that are looked at one after the other. A fan around a point has a few; a file that gives
/// all corners the same position would take the square of their number.
const LONG: usize = 32;

/// No number.
const NONE: u32 = u32::MAX;

impl Corners {
    /// The vertex for a corner of a file that has had that many positions so far.
    #[inline]
    pub fn vertex(&mut self, corner: Corner, positions: usize) -> Result<u32, String> {
        let alike = |has: bool| has.then_some(corner.position);
        let is_alike = |uvs: bool, normals: bool| corner.uv == alike(uvs) && corner.normal == alike(normals);
        match *self {
            Corners::None => {
                let (uvs, normals) = (corner.uv.is_some(), corner.normal.is_some());
                if is_alike(uvs, normals) {
                    *self = Corners::Alike { uvs, normals };
                    return Ok(corner.position);
                }
                *self = Corners::Different(Table::default());
            }
            Corners::Alike { uvs, normals } if is_alike(uvs, normals) => return Ok(corner.position),
            Corners::Alike { uvs, normals } => *self = Corners::Different(Table::alike(positions, uvs, normals)),
            Corners::Different(_) => {}
        }
        let Corners::Different(table) = self else { unreachable!("made above or before") };
        table.vertex(corner)
    }

    /// The mesh of triangles between vertices.
    pub fn finish(self, positions: Vec<Vec3>, normals: Vec<Vec3>, uvs: Vec<Vec2>, triangles: Vec<[u32; 3]>) -> RawMesh {
        let mut raw = RawMesh { positions, normals: Vec::new(), uvs: Vec::new(), triangles };
        match self {
            Corners::None => raw.triangles.clear(),
            Corners::Alike { uvs: has_uvs, normals: has_normals } => {
                let count = raw.positions.len();
                // positions without a number for the rest are used by no face
                raw.uvs = if has_uvs { resized(uvs, count) } else { Vec::new() };
                raw.normals = if has_normals { resized(normals, count) } else { Vec::new() };
            }
            Corners::Different(table) => table.finish(&mut raw, normals, uvs),
        }
        drop_unused(&mut raw);
        raw
    }
}

impl Table {
    /// Of positions that all are vertices, alike in what they have.
    fn alike(positions: usize, uvs: bool, normals: bool) -> Table {
        let has = |has: bool, i: u32| if has { i } else { NONE };
        let numbers = 0..positions as u32;
        Table {
            vertices: numbers.clone().map(|i| [i, has(uvs, i), has(normals, i)]).collect(),
            first: numbers.collect(),
            next: vec![NONE; positions],
            far: HashMap::new(),
        }
    }

    fn vertex(&mut self, corner: Corner) -> Result<u32, String> {
        let key = [corner.position, corner.uv.unwrap_or(NONE), corner.normal.unwrap_or(NONE)];
        let position = corner.position as usize;
        if position >= self.first.len() {
            self.first.resize(position + 1, NONE);
        }
        let (mut last, mut length) = (None, 0);
        let mut vertex = self.first[position];
        while vertex != NONE {
            if self.vertices[vertex as usize] == key {
                return Ok(vertex);
            }
            last = Some(vertex as usize);
            vertex = self.next[vertex as usize];
            length += 1;
        }
        if length == LONG
            && let Some(vertex) = self.far.get(&key)
        {
            return Ok(*vertex);
        }
        let new = u32::try_from(self.vertices.len()).ok().filter(|new| *new < NONE);
        let new = new.ok_or("the file makes more than 2³² vertices")?;
        self.vertices.push(key);
        self.next.push(NONE);
        if length == LONG {
            self.far.insert(key, new);
        } else {
            *last.map_or(&mut self.first[position], |last| &mut self.next[last]) = new;
        }
        Ok(new)
    }

    /// Gives each vertex what it refers to; one array after the other, so that few are there at once.
    fn finish(self, raw: &mut RawMesh, normals: Vec<Vec3>, uvs: Vec<Vec2>) {
        let Table { vertices, first, next, far } = self;
        drop((first, next, far));
        let has = |part: usize| vertices.iter().any(|vertex| vertex[part] != NONE);
        raw.positions = vertices.iter().map(|vertex| raw.positions[vertex[0] as usize]).collect();
        // a number beyond the array is that of a position without a face, from when all were alike
        if has(1) {
            raw.uvs = vertices.iter().map(|vertex| uvs.get(vertex[1] as usize).copied().unwrap_or_default()).collect();
        }
        drop(uvs);
        if has(2) {
            raw.normals = vertices.iter().map(|v| normals.get(v[2] as usize).copied().unwrap_or_default()).collect();
            drop(normals);
            flatten(raw, |vertex| vertices[vertex as usize][2] == NONE);
        }
    }
}

/// Gives corners without a normal, of faces in a mesh with normals, vertices of their own with that of the face.
fn flatten(raw: &mut RawMesh, lacks_normal: impl Fn(u32) -> bool) {
    let RawMesh { positions, normals, uvs, triangles } = raw;
    for triangle in triangles {
        let [a, b, c] = triangle.map(|i| positions[i as usize]);
        for i in triangle {
            if lacks_normal(*i) {
                let vertex = *i as usize;
                *i = positions.len() as u32;
                positions.push(positions[vertex]);
                normals.push((b - a).cross(c - a).normalize_or_zero());
                if !uvs.is_empty() {
                    uvs.push(uvs[vertex]);
                }
            }
        }
    }
}

fn resized<T: Default + Clone>(mut array: Vec<T>, count: usize) -> Vec<T> {
    array.resize(count, T::default());
    array
}

/// Leaves vertices out that no triangle has, in place, and gives back what arrays hold beyond their length.
fn drop_unused(raw: &mut RawMesh) {
    let mut numbers = vec![NONE; raw.positions.len()];
    raw.triangles.iter().flatten().for_each(|i| numbers[*i as usize] = 0);
    if numbers.contains(&NONE) {
        let used: Vec<bool> = numbers.iter().map(|number| *number != NONE).collect();
        for (new, number) in (0..).zip(numbers.iter_mut().filter(|number| **number != NONE)) {
            *number = new;
        }
        keep(&mut raw.positions, &used);
        keep(&mut raw.normals, &used);
        keep(&mut raw.uvs, &used);
        raw.triangles.iter_mut().flatten().for_each(|i| *i = numbers[*i as usize]);
    }
    raw.positions.shrink_to_fit();
    raw.normals.shrink_to_fit();
    raw.uvs.shrink_to_fit();
    raw.triangles.shrink_to_fit();
}

fn keep<T>(array: &mut Vec<T>, used: &[bool]) {
    let mut used = used.iter();
    array.retain(|_| used.next().is_some_and(|used| *used));
}
