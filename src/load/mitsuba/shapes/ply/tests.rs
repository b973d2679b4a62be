//! Files of all encodings against ply-rs, which reads them whole, and against damage.

use ply_rs_bw::ply::{Encoding, Property, PropertyAccess};
use ply_rs_bw::writer::Writer;

use super::*;

fn read(bytes: &[u8]) -> Result<RawMesh, String> {
    parse(&mut &bytes[..], bytes.len() as u64)
}

/// A file whose vertices and faces hold every type of number, and other elements before, between and behind them.
fn file(encoding: &str) -> Vec<u8> {
    let header = format!(
        "ply\nformat {encoding} 1.0\ncomment by hand\nelement cell 2\nproperty short a\nproperty list ushort double b\n\
         element vertex 4\nproperty uchar red\nproperty float x\nproperty double y\nproperty short z\n\
         property list uchar int tags\nproperty float nx\nproperty char ny\nproperty float nz\nproperty float s\n\
         property float t\nelement edge 1\nproperty uint from\nelement face 3\nproperty char kind\n\
         property list uint ushort vertex_index\nproperty double weight\nelement end 1\nproperty list uchar uchar rest\n\
         end_header\n"
    );
    let rows = "-3 2 0.5 -1e100\n7 0\n\
        255 0 0 -5 0 0 0 1 0 1\n1 1.5 0.25 7 2 -9 9 0.5 -1 2 0.125 1\n2 3 1e3 0 1 4 0 0 1 0 0\n0 4 5 6 0 1 0 0 1 1\n\
        4000000000\n\
        -1 3 0 1 2 0.5\n0 4 3 2 1 0 -0.5\n1 0 1e9\n\
        3 1 2 3\n";
    let mut bytes = header.into_bytes();
    if encoding == "ascii" {
        bytes.extend(rows.bytes());
        return bytes;
    }
    // the same numbers with the types of the header
    let types = |row: usize| match row {
        0..2 => "i16 [u16 f64]",
        2..6 => "u8 f32 f64 i16 [u8 i32] f32 i8 f32 f32 f32",
        6 => "u32",
        7..10 => "i8 [u32 u16] f64",
        _ => "[u8 u8]",
    };
    let is_big = encoding == "binary_big_endian";
    for (row, line) in rows.lines().enumerate() {
        let mut words = line.split(' ').map(|word| word.parse::<f64>().unwrap());
        let mut next = |bytes: &mut Vec<u8>, kind: &str| {
            let value = words.next().unwrap();
            let mut number = match kind {
                "i8" => (value as i8).to_be_bytes().to_vec(),
                "u8" => (value as u8).to_be_bytes().to_vec(),
                "i16" => (value as i16).to_be_bytes().to_vec(),
                "u16" => (value as u16).to_be_bytes().to_vec(),
                "i32" => (value as i32).to_be_bytes().to_vec(),
                "u32" => (value as u32).to_be_bytes().to_vec(),
                "f32" => (value as f32).to_be_bytes().to_vec(),
                _ => value.to_be_bytes().to_vec(),
            };
            if !is_big {
                number.reverse();
            }
            bytes.extend(number);
            value
        };
        let mut kinds = types(row).split(' ');
        while let Some(kind) = kinds.next() {
            match kind.strip_prefix('[') {
                None => {
                    next(&mut bytes, kind);
                }
                Some(length) => {
                    let count = next(&mut bytes, length) as usize;
                    let kind = kinds.next().unwrap().trim_end_matches(']');
                    for _ in 0..count {
                        next(&mut bytes, kind);
                    }
                }
            }
        }
    }
    bytes
}

const ENCODINGS: [&str; 3] = ["ascii", "binary_little_endian", "binary_big_endian"];

#[test]
fn every_encoding_gives_the_numbers_that_were_written() {
    for encoding in ENCODINGS {
        let raw = read(&file(encoding)).unwrap();
        let positions = [[0., 0., -5.], [1.5, 0.25, 7.], [3., 1e3, 0.], [4., 5., 6.]].map(Vec3::from);
        assert_eq!(raw.positions, positions, "{encoding}");
        assert_eq!(raw.normals[1], Vec3::new(0.5, -1.0, 2.0), "{encoding}");
        assert_eq!(raw.uvs[1], Vec2::new(0.125, 1.0), "{encoding}");
        assert_eq!(raw.triangles, [[0, 1, 2], [3, 2, 1], [3, 1, 0]], "{encoding}");
    }
}

#[test]
fn ply_rs_reads_the_same_from_the_same_files() {
    for encoding in ENCODINGS {
        let bytes = file(encoding);
        let ply = Parser::<DefaultElement>::new().read_ply(&mut &bytes[..]).unwrap();
        let raw = read(&bytes).unwrap();
        for (i, vertex) in ply.payload["vertex"].iter().enumerate() {
            let get = |name: &str| vertex[name].to_f32_lossy().unwrap();
            assert_eq!(raw.positions[i], Vec3::new(get("x"), get("y"), get("z")), "{encoding}");
            assert_eq!(raw.normals[i], Vec3::new(get("nx"), get("ny"), get("nz")), "{encoding}");
            assert_eq!(raw.uvs[i], Vec2::new(get("s"), get("t")), "{encoding}");
        }
        let faces = ply.payload["face"].iter().map(|face| face["vertex_index"].to_u32_list().unwrap());
        let fans = faces.flat_map(|c| (2..c.len()).map(|i| [c[0], c[i - 1], c[i]]).collect::<Vec<_>>());
        assert_eq!(raw.triangles, fans.collect::<Vec<_>>(), "{encoding}");
    }
}

#[test]
fn files_that_ply_rs_writes_are_read() {
    struct Row(Vec<(&'static str, Property)>);
    impl PropertyAccess for Row {
        fn new() -> Self {
            Row(Vec::new())
        }
        fn get_float(&self, name: &str) -> Option<f32> {
            self.0.iter().find_map(|(n, p)| if *n == name { p.to_f32_lossy() } else { None })
        }
        fn get_list_int(&self, name: &str) -> Option<&[i32]> {
            self.0.iter().find_map(|(n, p)| match p {
                Property::ListInt(list) if *n == name => Some(&list[..]),
                _ => None,
            })
        }
    }
    let vertex =
        |x: f32, y: f32| Row(vec![("x", Property::Float(x)), ("y", Property::Float(y)), ("z", Property::Float(2.0))]);
    let mut ply = ply_rs_bw::ply::Ply::<Row>::new();
    let mut define = |name: &str, properties: &[(&str, PropertyType)]| {
        let mut element = ElementDef::new(name.into());
        for (name, kind) in properties {
            element.properties.insert((*name).into(), PropertyDef::new((*name).into(), kind.clone()));
        }
        ply.header.elements.insert(name.into(), element);
    };
    let float = PropertyType::Scalar(ScalarType::Float);
    define("vertex", &[("x", float.clone()), ("y", float.clone()), ("z", float)]);
    define("face", &[("vertex_indices", PropertyType::List(ScalarType::UChar, ScalarType::Int))]);
    ply.payload.insert("vertex".into(), vec![vertex(0.0, 0.0), vertex(1.0, 0.0), vertex(0.25, 1.0)]);
    ply.payload.insert("face".into(), vec![Row(vec![("vertex_indices", Property::ListInt(vec![2, 0, 1]))])]);
    for encoding in [Encoding::Ascii, Encoding::BinaryLittleEndian, Encoding::BinaryBigEndian] {
        ply.header.encoding = encoding;
        let mut bytes = Vec::new();
        Writer::new().write_ply(&mut bytes, &mut ply).unwrap();
        let raw = read(&bytes).unwrap();
        assert_eq!(raw.positions, [Vec3::new(0., 0., 2.), Vec3::new(1., 0., 2.), Vec3::new(0.25, 1., 2.)]);
        assert_eq!((raw.triangles, raw.normals.len(), raw.uvs.len()), (vec![[2, 0, 1]], 0, 0));
    }
}

#[test]
fn a_file_that_ends_early_is_a_fault_wherever_it_ends() {
    for encoding in ENCODINGS {
        let bytes = file(encoding);
        // the line break at the end of a text may be missing, and a digit more or less of its last number
        let most = bytes.len() - if encoding == "ascii" { 2 } else { 1 };
        for end in 0..most {
            let error = read(&bytes[..end]).expect_err(encoding);
            assert!(error.starts_with("it is no readable PLY: "), "{encoding}, {end} bytes: {error}");
        }
    }
}

#[test]
fn lines_with_too_much_or_too_little_are_named() {
    let text = |vertex: &str, face: &str| {
        format!(
            "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\n\
             property list uchar int vertex_index\nend_header\n0 0 0\n{vertex}\n0 1 0\n{face}\n"
        )
    };
    assert!(read(text("1 0 0", "3 0 1 2").as_bytes()).is_ok());
    assert!(read(text("\n1\t0 0 \r", "3 0 1 2").as_bytes()).is_ok(), "blank lines and other blanks");
    for (vertex, face, expected) in [
        ("1 0", "3 0 1 2", "vertex 2 of 3: line 11 holds less than the header says"),
        ("1 0 0 0", "3 0 1 2", "vertex 2 of 3: line 11 holds more than the header says"),
        ("1 0 far", "3 0 1 2", "vertex 2 of 3: line 11: \"far\" is no number of the type in the header"),
        ("1 0 0", "3 0 1", "face 1 of 1: line 13 holds less than the header says"),
        ("1 0 0", "3 0 1 2.5", "face 1 of 1: line 13: \"2.5\" is no number of the type in the header"),
        ("1 0 0", "300 0 1 2", "face 1 of 1: line 13: \"300\" is no number of the type in the header"),
    ] {
        assert_eq!(read(text(vertex, face).as_bytes()).unwrap_err(), format!("it is no readable PLY: {expected}"));
    }
}
