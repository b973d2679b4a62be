use std::io::{Cursor, Write};

use flate2::Compression;
use flate2::write::ZlibEncoder;
use glam::{Vec2, Vec3};

use super::*;

/// One mesh of a file: a triangle that is shifted by `x`, with all that the flags name.
fn mesh_bytes(version: u16, flags: u32, x: f64) -> Vec<u8> {
    let mut content = flags.to_le_bytes().to_vec();
    if version == 4 {
        content.extend("a näme\0".bytes());
    }
    content.extend([3u64, 2].map(u64::to_le_bytes).concat());
    let mut numbers = vec![x, 0.0, 0.5, x + 1.0, 0.0, 0.5, x, 1.0, 0.5];
    if flags & flag::NORMALS != 0 {
        numbers.extend([0.0, 0.6, 0.8].repeat(3));
    }
    if flags & flag::UVS != 0 {
        numbers.extend([0.0, 0.25, 1.0, 0.25, 0.0, 0.75]);
    }
    if flags & flag::COLOURS != 0 {
        numbers.extend([9.0; 9]);
    }
    for number in numbers {
        match flags & flag::DOUBLE {
            0 => content.extend((number as f32).to_le_bytes()),
            _ => content.extend(number.to_le_bytes()),
        }
    }
    content.extend([0u32, 1, 2, 2, 1, 0].map(u32::to_le_bytes).concat());
    let mut compressed = ZlibEncoder::new(Vec::new(), Compression::default());
    compressed.write_all(&content).unwrap();
    [MAGIC.to_le_bytes(), version.to_le_bytes()].concat().into_iter().chain(compressed.finish().unwrap()).collect()
}

/// Meshes in a row and their dictionary.
fn file(version: u16, meshes: &[Vec<u8>]) -> Vec<u8> {
    let mut places = Vec::new();
    let mut file = Vec::new();
    for mesh in meshes {
        match version {
            4 => places.extend((file.len() as u64).to_le_bytes()),
            _ => places.extend((file.len() as u32).to_le_bytes()),
        }
        file.extend(mesh);
    }
    file.extend(places);
    file.extend((meshes.len() as u32).to_le_bytes());
    file
}

fn read(file: &[u8], index: u64) -> Result<RawMesh, String> {
    parse(&mut Cursor::new(file), index)
}

#[test]
fn meshes_of_both_versions_precisions_and_all_flags_are_read() {
    for version in [3, 4] {
        for precision in [flag::SINGLE, flag::DOUBLE] {
            for parts in 0..8 {
                let has = |bit: u32, which: u32| if parts & bit != 0 { which } else { 0 };
                let flags = precision | has(1, flag::NORMALS) | has(2, flag::UVS) | has(4, flag::COLOURS);
                let raw = read(&file(version, &[mesh_bytes(version, flags, 2.0)]), 0).unwrap();
                let context = format!("version {version}, flags {flags:#06x}");
                let positions = [(2.0, 0.0), (3.0, 0.0), (2.0, 1.0)].map(|(x, y)| Vec3::new(x, y, 0.5));
                assert_eq!(raw.positions, positions, "{context}");
                let normals = if parts & 1 != 0 { vec![Vec3::new(0.0, 0.6, 0.8); 3] } else { Vec::new() };
                assert_eq!(raw.normals, normals, "{context}");
                let uvs = [(0.0, 0.25), (1.0, 0.25), (0.0, 0.75)].map(|(u, v)| Vec2::new(u, v));
                assert_eq!(raw.uvs, if parts & 2 != 0 { uvs.to_vec() } else { Vec::new() }, "{context}");
                assert_eq!(raw.triangles, [[0, 1, 2], [2, 1, 0]], "{context}");
            }
        }
    }
}

#[test]
fn the_dictionary_leads_to_every_mesh() {
    for version in [3, 4] {
        let meshes: Vec<_> = (0..5)
            .map(|i| {
                mesh_bytes(version, if i % 2 == 0 { flag::SINGLE } else { flag::DOUBLE | flag::UVS }, f64::from(i))
            })
            .collect();
        let file = file(version, &meshes);
        for i in 0..5 {
            let raw = read(&file, i).unwrap();
            assert_eq!((raw.positions[0].x, raw.uvs.len()), (i as f32, 3 * (i % 2) as usize), "version {version}");
        }
        let expected = "shape_index is 5, but the file holds 5 meshes, numbered from 0";
        assert_eq!(read(&file, 5).unwrap_err(), expected);
        assert!(read(&file, u64::MAX).is_err());
    }
}

#[test]
fn other_files_are_told_apart() {
    let good = mesh_bytes(4, flag::SINGLE, 0.0);
    let with = |at: usize, byte: u8| {
        let mut bytes = good.clone();
        bytes[at] = byte;
        read(&bytes, 0).unwrap_err()
    };
    assert_eq!(with(0, 0x1d), "it is no serialized mesh: it begins with 0x041d, not 0x041c");
    assert_eq!(with(2, 7), "it is a serialized mesh of version 7; accepted: 3, 4");
    assert!(with(4, 0).starts_with("it is no whole serialized mesh: "), "no zlib");
    let both = mesh_bytes(4, flag::SINGLE | flag::DOUBLE, 0.0);
    assert_eq!(read(&both, 0).unwrap_err(), "its flags 0x3000 say single and double precision at once");
}

#[test]
fn a_file_that_ends_early_or_promises_too_much_is_a_fault() {
    let good = mesh_bytes(4, flag::SINGLE | flag::NORMALS, 0.0);
    for end in 0..good.len() - 8 {
        // behind the content stand the mark of its end and zlib's checksum
        assert!(read(&good[..end], 0).unwrap_err().starts_with("it is no whole serialized mesh: "), "{end} bytes");
    }
    let counts = |vertices: u64, triangles: u64| {
        let mut content = flag::SINGLE.to_le_bytes().to_vec();
        content.extend([vertices, triangles].map(u64::to_le_bytes).concat());
        let mut compressed = ZlibEncoder::new(Vec::new(), Compression::default());
        compressed.write_all(&content).unwrap();
        let header = [MAGIC.to_le_bytes(), 3u16.to_le_bytes()].concat();
        read(&[header, compressed.finish().unwrap()].concat(), 0).unwrap_err()
    };
    assert!(counts(u32::MAX.into(), 1).starts_with("it is no whole serialized mesh: "));
    assert!(counts(1 << 40, 1).contains("accepted: fewer than 2³² of each"));
    let dictionary = file(4, &[good]);
    let mut wrong = dictionary.clone();
    let at = wrong.len() - 4;
    wrong[at..].copy_from_slice(&u32::MAX.to_le_bytes());
    assert_eq!(read(&wrong, 1).unwrap_err(), "its dictionary is longer than the file");
}

#[test]
fn meshes_that_ask_for_face_normals_get_them() {
    let raw = read(&mesh_bytes(4, flag::SINGLE | flag::NORMALS | flag::FACE_NORMALS, 0.0), 0).unwrap();
    assert!(raw.normals.is_empty());
}
