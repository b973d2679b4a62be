use super::*;

fn read(text: &str) -> Result<RawMesh, String> {
    parse(&mut text.as_bytes())
}

/// Triangles as their corners: position, texture coordinate, normal.
fn corners(raw: &RawMesh) -> Vec<[(Vec3, Vec2, Vec3); 3]> {
    let or_zero = |array: &[Vec3], i: u32| array.get(i as usize).copied().unwrap_or_default();
    let uv = |i: u32| raw.uvs.get(i as usize).copied().unwrap_or_default();
    let corner = |i: u32| (or_zero(&raw.positions, i), uv(i), or_zero(&raw.normals, i));
    raw.triangles.iter().map(|triangle| triangle.map(corner)).collect()
}

const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

#[test]
fn a_face_refers_to_what_stands_before_it() {
    for (face, expected) in [
        ("f 1 2 3", Ok(1)),
        ("f 1 2 3 4", Ok(2)),
        ("  f\t1  2\t3 \r", Ok(1)),
        ("f -4 -3 -2", Ok(1)),
        ("f 1 -3 3", Ok(1)),
        ("f 1 \\\n2 3", Ok(1)),
        ("f 1/ 2// 3", Ok(1)),
        ("f 1 2", Err("line 5: the face has 2 corners; it must have 3 or more: \"f 1 2\"")),
        ("f", Err("line 5: the face has 0 corners; it must have 3 or more: \"f\"")),
        ("f 1 2 5", Err("line 5: vertex 5 of 4: \"f 1 2 5\"")),
        ("f 1 2 -5", Err("line 5: vertex -5 of 4: \"f 1 2 -5\"")),
        ("f 0 1 2", Err("line 5: vertex 0: numbers begin at 1: \"f 0 1 2\"")),
        ("f 1 2 x", Err("line 5: \"x\" is not a whole number: \"f 1 2 x\"")),
        ("f 1 2 2.5", Err("line 5: \"2.5\" is not a whole number: \"f 1 2 2.5\"")),
        ("f 1 2 /3", Err("line 5: \"\" is not a whole number: \"f 1 2 /3\"")),
        ("f 1/1 2/1 3/1", Err("line 5: texture coordinate 1 of 0: \"f 1/1 2/1 3/1\"")),
        ("f 1//1 2//1 3//1", Err("line 5: normal 1 of 0: \"f 1//1 2//1 3//1\"")),
        ("f 1///4 2 3", Err("line 5: a corner is v, v/vt, v//vn or v/vt/vn: \"f 1///4 2 3\"")),
        ("v 2 0 0\nf 1 2 99999999999999999999", Err("line 6: \"99999999999999999999\" is not a whole number")),
    ] {
        let got = read(&format!("{SQUARE}{face}\n")).map(|raw| raw.triangles.len());
        match expected {
            Ok(count) => assert_eq!(got, Ok(count), "{face}"),
            Err(message) => assert!(got.as_ref().is_err_and(|e| e.starts_with(message)), "{face}: {got:?}"),
        }
    }
}

#[test]
fn numbers_are_finite_and_all_there() {
    for (line, expected) in [
        ("v 1 2", "line 1: the vertex has 2 numbers; it needs 3: \"v 1 2\""),
        ("v 1 2 x", "line 1: \"x\" is not a number: \"v 1 2 x\""),
        ("v 1 2 nan", "line 1: the vertex must be finite: \"v 1 2 nan\""),
        ("v 1 2 1e39", "line 1: the vertex must be finite"),
        ("vn 0 0", "line 1: the normal has 2 numbers; it needs 3"),
        ("vn 0 0 inf", "line 1: the normal must be finite"),
        ("vt", "line 1: the texture coordinate has 0 numbers; it needs 1"),
        ("vt 1 -inf", "line 1: the texture coordinate must be finite"),
    ] {
        let error = read(line).expect_err(line);
        assert!(error.starts_with(expected), "{line}: {error}");
    }
    // weights, colours and third texture coordinates are no faults
    let raw = read("v 1 2 3 0.5\nv 4 5 6 1 0 0\nv 7 8 9\nvt 0.25 0.5 0.75\nvt 0.5\nf 1/1 2/2 3/1\n").unwrap();
    assert_eq!(raw.positions, [Vec3::new(1., 2., 3.), Vec3::new(4., 5., 6.), Vec3::new(7., 8., 9.)]);
    assert_eq!(raw.uvs, [Vec2::new(0.25, 0.5), Vec2::new(0.5, 0.0), Vec2::new(0.25, 0.5)]);
}

#[test]
fn polygons_are_fans_from_their_first_corner() {
    let raw = read("v 0 0 0\nv 2 0 0\nv 2 2 0\nv 1 0.5 0\nv 0 2 0\nf 3 4 5 1 2\n").unwrap();
    let fan = [[2, 3, 4], [2, 4, 0], [2, 0, 1]];
    assert_eq!(raw.triangles, fan);
}

#[test]
fn equal_corners_are_one_vertex_and_unused_ones_are_gone() {
    // alike throughout, and with a vertex that nothing uses in the middle
    let raw = read("v 9 9 9\nv 0 0 0\nv 8 8 8\nv 1 0 0\nv 0 1 0\nf 2 4 5\nf 5 4 2\n").unwrap();
    assert_eq!((raw.positions.len(), raw.triangles), (3, vec![[0, 1, 2], [2, 1, 0]]));
    assert!(raw.normals.is_empty() && raw.uvs.is_empty());
    // two normals for a position, the second one after faces that were alike
    let text = format!(
        "{SQUARE}vn 0 0 1\nvn 0 0 1\nvn 0 0 1\nvn 0 1 0\nf 1//1 2//2 3//3\nf 1//4 2//2 3//3\nf 1//4 3//3 4//4\n"
    );
    let raw = read(&text).unwrap();
    assert_eq!(raw.triangles, [[0, 1, 2], [4, 1, 2], [4, 2, 3]]);
    assert_eq!((raw.positions[4], raw.normals[4]), (Vec3::ZERO, Vec3::Y));
}

#[test]
fn faces_without_normals_are_flat_among_others_that_have_some() {
    let text = format!("{SQUARE}vn 0.6 0 0.8\nvt 0.5 0.25\nf 1/1/1 2/1/1 3/1/1\nf 1 3 4\nf 4 3 2//1\n");
    let raw = read(&text).unwrap();
    let normals: Vec<_> = corners(&raw).into_iter().map(|triangle| triangle.map(|(_, _, normal)| normal)).collect();
    let tilted = Vec3::new(0.6, 0.0, 0.8);
    assert_eq!(normals, [[tilted; 3], [Vec3::Z; 3], [-Vec3::Z, -Vec3::Z, tilted]]);
    let uvs: Vec<_> = corners(&raw).into_iter().map(|triangle| triangle.map(|(_, uv, _)| uv)).collect();
    assert_eq!(uvs, [[Vec2::new(0.5, 0.25); 3], [Vec2::ZERO; 3], [Vec2::ZERO; 3]]);
}

#[test]
fn what_is_no_mesh_is_passed_over() {
    let text =
        "# v 1\nmtllib a.mtl\no thing\ng one two\nusemtl red\ns 1\nl 1 2\np 1\nvp 1 2\ncurv 0 1\nfoo\n\n\u{e4}\n";
    assert!(read(text).unwrap().triangles.is_empty());
    let text = format!("{text}{SQUARE}usemtl blue\nf 1 2 3\nusemtl green\nf 1 3 4\n");
    assert_eq!(read(&text).unwrap().triangles.len(), 2, "faces of all materials");
    assert!(parse(&mut &b"v 0 0 0\n\xff\xfe v\nv 1 \xff 0\n"[..]).unwrap_err().starts_with("line 3: "));
}

/// Another reader (tobj) sees the same corners in files of every layout.
#[test]
fn another_reader_sees_the_same_corners() {
    let options = tobj::LoadOptions { single_index: true, triangulate: true, ignore_points: true, ignore_lines: true };
    let mut state = 1u32;
    let mut below = |n: u32| {
        state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        (state >> 16) % n
    };
    for layout in ["v", "v/t", "v//n", "v/t/n", "same", "mixed"] {
        let mut text = String::new();
        for i in 0..50 {
            let mut number = || f64::from(below(2000)) / 100.0 - 10.0;
            let [x, y, z, s, t, a, b, c] = [0; 8].map(|_| number());
            text += &format!("v {x} {y} {z}\nvt {s} {t}\nvn {a} {b} {c}\n");
            if i < 10 {
                continue;
            }
            text += "f";
            for _ in 0..3 + below(3) {
                let mut any = || i64::from(below(i + 1)) + 1;
                let [v, t, n] = [any(), any(), any() - i64::from(i) - 2];
                text += &match layout {
                    "v" => format!(" {v}"),
                    "v/t" => format!(" {v}/{t}"),
                    "v//n" => format!(" {v}//{n}"),
                    "v/t/n" => format!(" {v}/{t}/{n}"),
                    "same" => format!(" {v}/{v}/{v}"),
                    _ if i < 30 => format!(" {v}/{v}/{v}"),
                    _ => format!(" {v}/{t}/{v}"),
                };
            }
            text += "\n";
        }
        let (models, _) = tobj::load_obj_buf(&mut text.as_bytes(), &options, |_| Ok(Default::default())).unwrap();
        let mesh = &models[0].mesh;
        let expected = RawMesh {
            positions: mesh.positions.chunks_exact(3).map(Vec3::from_slice).collect(),
            normals: mesh.normals.chunks_exact(3).map(Vec3::from_slice).collect(),
            uvs: mesh.texcoords.chunks_exact(2).map(Vec2::from_slice).collect(),
            triangles: mesh.indices.as_chunks().0.to_vec(),
        };
        let raw = read(&text).unwrap();
        assert_eq!(corners(&raw), corners(&expected), "{layout}");
        assert_eq!(raw.positions.len(), expected.positions.len(), "{layout}: as many vertices");
    }
}

/// What the same lines give one after the other.
fn read_line_by_line(text: &str) -> Result<RawMesh, String> {
    let (mut file, mut source, mut line, mut number) = (Content::default(), text.as_bytes(), Vec::new(), 1);
    loop {
        line.clear();
        match read_line(&mut source, &mut line).unwrap() {
            0 => return Ok(file.corners.finish(file.positions, file.normals, file.uvs, file.triangles)),
            lines => {
                file.line(&line).map_err(|message| format!("line {number}: {message}: {:?}", shown(&line)))?;
                number += lines;
            }
        }
    }
}

#[test]
fn pieces_of_any_size_give_the_mesh_or_the_first_fault_of_the_whole() {
    const LINES: [&str; 26] = [
        "v 1 2 3",
        "v 0.5 -1e2 7 1",
        "v 4 5 -6",
        "v 7 \\\n 8 9",
        "vt 0.5 0.25",
        "vn 0 0 1",
        "vn 1 0 0 \\\n\\\n",
        "f 1 2 3",
        "f -1 -2 -3",
        "# \\\\ \n \n",
        "f 3 2 1 \\",
        "f 1 \\\n-1 2 3",
        "f 1//1 2//1 -1//-1",
        "f 1/1/1 2/1/1 3/1/1 1/1/1",
        "f 1/1 2/-1 3",
        "f 1/ 2// +3",
        "# f 1 \\",
        "o thing",
        "",
        // faults, or some if there is too little before them
        "f 9 2 30",
        "f 1/1/1/1 2 3",
        "f 0 1 2",
        "f 1 2 9999999999",
        "f 1 2",
        "v 1 2",
        "vn 0 0 inf",
    ];
    let mut state = 1u32;
    let mut below = |n: usize| {
        state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        (state >> 8) as usize % n
    };
    let mut whole = 0;
    for round in 0..600 {
        let kinds = if round % 2 == 0 { LINES.len() - 7 } else { LINES.len() };
        let mut text = format!("{SQUARE}vt 0 1\nvn 0 1 0\n");
        for _ in 0..below(40) {
            text += LINES[below(kinds)];
            text += if below(5) == 0 { "\r\n" } else { "\n" };
        }
        let expected = read_line_by_line(&text);
        whole += usize::from(expected.is_ok());
        for bytes in [1, 10, 100, PIECE] {
            let got = parse_in_pieces(&mut text.as_bytes(), bytes);
            assert_eq!(format!("{got:?}"), format!("{expected:?}"), "in pieces of {bytes} bytes:\n{text}");
        }
    }
    assert!((100..500).contains(&whole), "{whole} of 600 texts have no fault");
}
