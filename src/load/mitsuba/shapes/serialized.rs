//! `serialized`: a mesh of Mitsuba's own binary format, versions 3 and 4; `filename`, `shape_index`, `to_world`,
//! `flip_normals`, `face_normals`.
//!
//! A file is a row of meshes and ends with a dictionary: the place of each mesh in bytes (u64; u32 in version 3), then
//! their number (u32). A mesh is the number 0x041C and the version (u16 each), then, compressed by zlib: flags (u32); in
//! version 4 a name that ends with a zero; the number of vertices and of triangles (u64 each); arrays of positions, and as
//! the flags say normals, texture coordinates and colours (skipped), in single or double precision; corners (u32 each).
//! All is little endian. Without normals in the file they are computed, unless `face_normals` or a flag of the file says
//! that faces are flat. What is compressed can only be read from its beginning, so one thread does.
//! Source: the manual of Mitsuba 0.6, section 8.2.3.

use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom};

use flate2::bufread::ZlibDecoder;
use glam::{DVec2, DVec3};

use super::super::Folder;
use super::super::parameters::ElementParameters;
use super::mesh::RawMesh;
use super::{Build, mesh_file};
use crate::scene::parameters::Parameters;

/// The first two bytes of a mesh.
const MAGIC: u16 = 0x041c;
/// From this version on meshes have names, and places in the file are u64.
const NAMED: u16 = 4;

/// What the flags of a mesh say.
mod flag {
    pub const NORMALS: u32 = 0x0001;
    pub const UVS: u32 = 0x0002;
    pub const COLOURS: u32 = 0x0008;
    pub const FACE_NORMALS: u32 = 0x0010;
    pub const SINGLE: u32 = 0x1000;
    pub const DOUBLE: u32 = 0x2000;
}

/// Reads the element; the file is read by what it returns.
pub fn read(p: &mut ElementParameters, folder: &Folder) -> Option<Build> {
    let index = p.integer("shape_index").unwrap_or(0);
    if index < 0 {
        p.fault("shape_index", format!("shape_index is {index}; the first mesh of a file is 0"));
    }
    mesh_file(p, folder, None, move |source| parse(source, index.unsigned_abs()))
}

/// The mesh of that number in a file.
pub fn parse(source: &mut (impl BufRead + Seek), index: u64) -> Result<RawMesh, String> {
    let version = header(source)?;
    if index > 0 {
        let place = place(source, version, index)?;
        source.seek(SeekFrom::Start(place)).map_err(|error| error.to_string())?;
        header(source)?;
    }
    let at = source.stream_position().map_err(|error| error.to_string())?;
    let packed = source.seek(SeekFrom::End(0)).map_err(|error| error.to_string())? - at;
    source.seek(SeekFrom::Start(at)).map_err(|error| error.to_string())?;
    let left = LEAST_UNPACKED.max(MOST_UNPACKED.saturating_mul(packed));
    // many small reads: a second buffer, behind the decoder
    mesh(&mut BufReader::new(Bounded { source: ZlibDecoder::new(source), left }), version)
}

/// Most bytes that one of the file may unpack to. zlib itself can make a thousand of it, of zeros; meshes have numbers
/// that differ, and come to less than ten.
const MOST_UNPACKED: u64 = 256;
/// Bytes that any file may unpack to.
const LEAST_UNPACKED: u64 = 1 << 20;

/// A source of which no more than so many bytes are read.
struct Bounded<R> {
    source: R,
    left: u64,
}

impl<R: Read> Read for Bounded<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.source.read(buffer)?;
        self.left = self.left.checked_sub(count as u64).ok_or_else(|| {
            io::Error::other(format!("it unpacks to more than {MOST_UNPACKED} times its size, which no mesh does"))
        })?;
        Ok(count)
    }
}

/// The version of the mesh that begins here.
fn header(source: &mut impl Read) -> Result<u16, String> {
    let [magic, version] = [u16::from_le_bytes(bytes(source)?), u16::from_le_bytes(bytes(source)?)];
    match version {
        _ if magic != MAGIC => Err(format!("it is no serialized mesh: it begins with {magic:#06x}, not {MAGIC:#06x}")),
        3 | NAMED => Ok(version),
        _ => Err(format!("it is a serialized mesh of version {version}; accepted: 3, 4")),
    }
}

/// Where in the file the mesh of that number begins.
fn place(source: &mut (impl Read + Seek), version: u16, index: u64) -> Result<u64, String> {
    seek_back(source, 4)?;
    let count = u64::from(u32::from_le_bytes(bytes(source)?));
    if index >= count {
        return Err(format!("shape_index is {index}, but the file holds {count} meshes, numbered from 0"));
    }
    let after = count - index;
    match version {
        NAMED => {
            seek_back(source, 4 + 8 * after)?;
            Ok(u64::from_le_bytes(bytes(source)?))
        }
        _ => {
            seek_back(source, 4 + 4 * after)?;
            Ok(u32::from_le_bytes(bytes(source)?).into())
        }
    }
}

/// Goes to that many bytes before the end.
fn seek_back(source: &mut impl Seek, bytes: u64) -> Result<(), String> {
    let found = i64::try_from(bytes).ok().and_then(|bytes| source.seek(SeekFrom::End(-bytes)).ok());
    found.map(drop).ok_or_else(|| "its dictionary is longer than the file".into())
}

/// A mesh, decompressed.
fn mesh(source: &mut impl BufRead, version: u16) -> Result<RawMesh, String> {
    let flags = u32::from_le_bytes(bytes(source)?);
    let is_double = flags & flag::DOUBLE != 0;
    if is_double && flags & flag::SINGLE != 0 {
        return Err(format!("its flags {flags:#06x} say single and double precision at once"));
    }
    if version >= NAMED {
        source.skip_until(0).map_err(broken)?;
    }
    let [vertices, triangles] = [u64::from_le_bytes(bytes(source)?), u64::from_le_bytes(bytes(source)?)];
    if vertices > u32::MAX.into() || triangles > u32::MAX.into() {
        return Err(format!("it has {vertices} vertices and {triangles} triangles; accepted: fewer than 2³² of each"));
    }
    let has = |which: u32, count: u64| if flags & which != 0 { count } else { 0 };
    let mut raw = RawMesh {
        positions: array(vertices, || vector(source, is_double).map(|v| DVec3::from(v).as_vec3()))?,
        normals: array(has(flag::NORMALS, vertices), || vector(source, is_double).map(|v| DVec3::from(v).as_vec3()))?,
        uvs: array(has(flag::UVS, vertices), || vector(source, is_double).map(|v| DVec2::from(v).as_vec2()))?,
        triangles: Vec::new(),
    };
    for _ in 0..has(flag::COLOURS, vertices) {
        vector::<3>(source, is_double)?;
    }
    raw.triangles = array(triangles, || {
        Ok([u32::from_le_bytes(bytes(source)?), u32::from_le_bytes(bytes(source)?), u32::from_le_bytes(bytes(source)?)])
    })?;
    if flags & flag::FACE_NORMALS != 0 {
        raw.normals = Vec::new();
    }
    Ok(raw)
}

/// That many values. Memory is taken as they come: a number in a file may be false.
fn array<T>(count: u64, mut next: impl FnMut() -> Result<T, String>) -> Result<Vec<T>, String> {
    /// Values for which memory is taken in advance.
    const LIKELY: u64 = 1 << 16;
    let mut values = Vec::with_capacity(count.min(LIKELY) as usize);
    for _ in 0..count {
        values.push(next()?);
    }
    values.shrink_to_fit();
    Ok(values)
}

/// As many numbers.
#[inline]
fn vector<const N: usize>(source: &mut impl Read, is_double: bool) -> Result<[f64; N], String> {
    let mut vector = [0.0; N];
    for number in &mut vector {
        *number =
            if is_double { f64::from_le_bytes(bytes(source)?) } else { f32::from_le_bytes(bytes(source)?).into() };
    }
    Ok(vector)
}

#[inline]
fn bytes<const N: usize>(source: &mut impl Read) -> Result<[u8; N], String> {
    let mut bytes = [0; N];
    source.read_exact(&mut bytes).map_err(broken)?;
    Ok(bytes)
}

fn broken(error: std::io::Error) -> String {
    match error.kind() {
        std::io::ErrorKind::UnexpectedEof => "it is no whole serialized mesh: the file ends within it".into(),
        _ => format!("it is no whole serialized mesh: {error}"),
    }
}

#[cfg(test)]
mod tests;
