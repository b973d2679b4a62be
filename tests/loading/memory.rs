//! Loading a mesh takes little more memory than the mesh: at most 1.5 times its arrays, at any moment.
//!
//! A process of its own loads a file and tells how much memory it has ever held, which Linux knows.
#![cfg(target_os = "linux")]

use std::fmt::Write;
use std::path::Path;
use std::process::Command;

use crate::files::{Folder, around, mesh};

/// Triangles of the tests; [`by_hand`] takes another number.
const TRIANGLES: usize = 400_000;
/// Memory that is not the mesh's: buffers, the stacks of threads, what the allocator rounds up to.
const SLACK: usize = 3 << 20;

#[test]
fn a_plain_mesh_is_loaded_within_one_and_a_half_times_its_size() {
    for kind in ["ply", "obj", "serialized"] {
        assert_within_bound(kind, Parts { normals: false, uvs: false, alike: true }, TRIANGLES);
    }
}

#[test]
fn a_mesh_with_normals_and_texture_coordinates_is_loaded_within_one_and_a_half_times_its_size() {
    for kind in ["ply", "obj", "serialized"] {
        assert_within_bound(kind, Parts { normals: true, uvs: true, alike: true }, TRIANGLES);
    }
    // numbered apart, as modellers do
    assert_within_bound("obj", Parts { normals: true, uvs: true, alike: false }, TRIANGLES);
}

/// Millions of triangles by hand, as in `RELT_TRIANGLES=10000000 cargo test --release --test loading by_hand -- --ignored
/// --nocapture`.
#[test]
#[ignore = "gigabytes: the same with RELT_TRIANGLES triangles; prints figures"]
fn by_hand() {
    let triangles = std::env::var("RELT_TRIANGLES").expect("a number of triangles").parse().expect("a number");
    for kind in ["ply", "obj", "serialized"] {
        assert_within_bound(kind, Parts { normals: false, uvs: false, alike: true }, triangles);
        assert_within_bound(kind, Parts { normals: true, uvs: true, alike: true }, triangles);
    }
    assert_within_bound("obj", Parts { normals: true, uvs: true, alike: false }, triangles);
}

/// What a file holds beside positions and triangles, and whether all of it has the same numbers.
#[derive(Clone, Copy, Debug)]
struct Parts {
    normals: bool,
    uvs: bool,
    alike: bool,
}

fn assert_within_bound(kind: &str, parts: Parts, triangles: usize) {
    let folder = Folder::new(&[]);
    let grid = Grid { side: (triangles as f64 / 2.0).sqrt() as usize };
    std::fs::write(folder.path(&format!("grid.{kind}")), grid.file(kind, parts)).expect("room for a large file");
    let text = around(&format!("<shape type='{kind}'><string name='filename' value='grid.{kind}'/></shape>"));
    std::fs::write(folder.path("scene.xml"), text).expect("a file in the folder");

    let mut child = Command::new(std::env::current_exe().expect("a running test"));
    child.args(["--exact", "memory::child_loads_a_scene", "--ignored", "--nocapture", "--test-threads", "1"]);
    let output = child.env("RELT_LOADED", folder.path("scene.xml")).output().expect("a child");
    let said = String::from_utf8_lossy(&output.stdout);
    let numbers = said.lines().find_map(|line| line.strip_prefix("memory: ")).unwrap_or_else(|| panic!("{said}"));
    let [size, peak] = [0, 1].map(|i| numbers.split(' ').nth(i).unwrap().parse::<usize>().unwrap());
    let ratio = peak as f64 / size as f64;
    println!(
        "{kind} {parts:?}: {} triangles, arrays {size} bytes, at most {peak} bytes, {ratio:.2} times",
        2 * grid.side * grid.side
    );
    assert!(2 * peak <= 3 * size + 2 * SLACK, "{kind} {parts:?}: {peak} bytes for a mesh of {size}, {ratio:.2} times");
}

#[test]
#[ignore = "the child of the tests above"]
fn child_loads_a_scene() {
    let path = std::env::var("RELT_LOADED").expect("the path of a scene");
    // threads that read are not part of the mesh
    rayon_is_up();
    let before = memory("VmRSS:");
    let scene = relt::load::scene(Path::new(&path), &[]).unwrap_or_else(|error| panic!("{error}"));
    let peak = memory("VmHWM:") - before;
    let mesh = mesh(&scene.shapes[0]);
    let size = size_of_val(mesh.positions())
        + size_of_val(&mesh.normals[..])
        + size_of_val(&mesh.uvs[..])
        + size_of_val(&mesh.triangles[..]);
    println!("\nmemory: {size} {peak}");
}

/// Loads something small, which starts all that loading starts.
fn rayon_is_up() {
    let folder = Folder::new(&[("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")]);
    let text = around("<shape type='obj'><string name='filename' value='a.obj'/></shape>");
    folder.load(&text, &[]).unwrap_or_else(|error| panic!("{error}"));
}

/// A line of the process's own status, in bytes.
fn memory(line: &str) -> usize {
    let status = std::fs::read_to_string("/proc/self/status").expect("Linux");
    let value = status.lines().find_map(|l| l.strip_prefix(line)).expect(line);
    1024 * value.trim().trim_end_matches(" kB").parse::<usize>().expect("a number of kB")
}

/// A square of `side`² squares, halved.
struct Grid {
    side: usize,
}

impl Grid {
    fn corners(&self) -> impl Iterator<Item = [f32; 2]> {
        let (count, side) = (self.side + 1, self.side as f32);
        (0..count * count).map(move |i| [(i % count) as f32 / side, (i / count) as f32 / side])
    }

    fn triangles(&self) -> impl Iterator<Item = [u32; 3]> {
        let (side, row) = (self.side, self.side as u32 + 1);
        (0..side * side).flat_map(move |i| {
            let a = (i / side) as u32 * row + (i % side) as u32;
            [[a, a + 1, a + row + 1], [a, a + row + 1, a + row]]
        })
    }

    fn file(&self, kind: &str, parts: Parts) -> Vec<u8> {
        match kind {
            "ply" => self.ply(parts),
            "obj" => self.obj(parts),
            _ => self.serialized(parts),
        }
    }

    fn ply(&self, parts: Parts) -> Vec<u8> {
        let (normals, uvs) = (
            if parts.normals { "property float nx\nproperty float ny\nproperty float nz\n" } else { "" },
            if parts.uvs { "property float u\nproperty float v\n" } else { "" },
        );
        let mut file = format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\n\
             property float z\n{normals}{uvs}element face {}\nproperty list uchar int vertex_indices\nend_header\n",
            (self.side + 1) * (self.side + 1),
            2 * self.side * self.side
        )
        .into_bytes();
        for [x, y] in self.corners() {
            let mut numbers = vec![x, y, 0.25];
            numbers.extend([0.0, 0.6, 0.8].into_iter().filter(|_| parts.normals));
            numbers.extend([x, y].into_iter().filter(|_| parts.uvs));
            file.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
        }
        for corners in self.triangles() {
            file.push(3);
            file.extend(corners.map(u32::to_le_bytes).concat());
        }
        file
    }

    fn obj(&self, parts: Parts) -> Vec<u8> {
        let mut text = String::new();
        for [x, y] in self.corners() {
            writeln!(text, "v {x} {y} 0.25").unwrap();
        }
        for [x, y] in self.corners().filter(|_| parts.uvs) {
            writeln!(text, "vt {x} {y}").unwrap();
        }
        for _ in self.corners().filter(|_| parts.normals) {
            writeln!(text, "vn 0 0.6 0.8").unwrap();
        }
        let count = (self.side + 1) * (self.side + 1);
        for corners in self.triangles() {
            text += "f";
            for i in corners {
                let i = i as usize + 1;
                match (parts.normals, parts.alike) {
                    (false, _) => write!(text, " {i}").unwrap(),
                    (true, true) => write!(text, " {i}/{i}/{i}").unwrap(),
                    (true, false) => write!(text, " {i}/{}/{i}", count + 1 - i).unwrap(),
                }
            }
            text += "\n";
        }
        text.into_bytes()
    }

    fn serialized(&self, parts: Parts) -> Vec<u8> {
        let mut content = (0x1000u32 + u32::from(parts.normals) + 2 * u32::from(parts.uvs)).to_le_bytes().to_vec();
        content.push(0); // no name
        content.extend(((self.side + 1) * (self.side + 1)).to_le_bytes());
        content.extend((2 * self.side * self.side).to_le_bytes());
        let mut add = |numbers: &[f32]| content.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
        self.corners().for_each(|[x, y]| add(&[x, y, 0.25]));
        self.corners().filter(|_| parts.normals).for_each(|_| add(&[0.0, 0.6, 0.8]));
        self.corners().filter(|_| parts.uvs).for_each(|uv| add(&uv));
        self.triangles().for_each(|corners| content.extend(corners.map(u32::to_le_bytes).concat()));
        let mut file = vec![0x1c, 4, 4, 0];
        let mut compressed = flate2::write::ZlibEncoder::new(&mut file, flate2::Compression::fast());
        std::io::Write::write_all(&mut compressed, &content).expect("memory");
        compressed.finish().expect("memory");
        file
    }
}
