//! Triangles and places that make trouble.

use std::fmt::Write;
use std::sync::Arc;

use glam::Vec3;

use super::{
    Bench, Case, Check,
    bench::{Effort, Goal, camera_ways, described, means},
    check::ROUNDING,
    scenes::{SKY, diffuse, film, glowing, integrating_sphere, room, series, sphere, view},
};
use crate::load;
use crate::scene::{Mesh, SceneDescription, description::ShapeGeometry};

const ALBEDO: f64 = 0.5;
const EDGES: i32 = 4;
const EFFORT: Effort = Effort { runs: 16, mutations_per_pixel: 96.0 };
const INSIDE: [[f64; 3]; 2] = [[0.3, 0.2, -0.2], [0.9, 0.1, -0.5]];

/// The cases.
pub(super) fn cases() -> Vec<Case> {
    vec![
        Case::new(
            "geometry/coincident",
            "walls and floor that are there twice, at the same place, look as if they were there once",
            coincident,
        )
        .quick(),
        Case::new(
            "geometry/needles",
            "a glowing room whose walls have strips of 2 by 2·10⁻⁷ looks like Σ aⁱ",
            |bench| glowing_mesh(bench, room_with_needles()),
        )
        .quick(),
        Case::new(
            "geometry/degenerate",
            "a glowing room from a file with triangles of no area looks like Σ aⁱ, and what was left out is told",
            degenerate,
        ),
        Case::new(
            "geometry/single-triangles",
            "a glowing octahedron of meshes of one triangle each looks like Σ aⁱ",
            single_triangles,
        ),
        Case::new(
            "geometry/ten-million",
            "a glowing sphere of ten million triangles (some 2 GB with its hierarchy) looks like Σ aⁱ",
            |bench| glowing_mesh(bench, tessellated_sphere(2236)),
        ),
        Case::new(
            "geometry/lamp-in-glass",
            "a lamp in the middle of a glass ball lights the wall about it by what Fresnel lets out",
            lamp_in_glass,
        ),
        Case::new(
            "geometry/camera-in-glass",
            "a camera in a glass ball sees a white sky with n² times its radiance",
            camera_in_glass,
        )
        .quick(),
        Case::new("geometry/camera-on-wall", "a camera on the wall of a glowing sphere sees Σ aⁱ", camera_on_wall)
            .quick(),
    ]
}

/// A room that is a diffuse cube with a floor inside, lit by a ball, once and twice.
fn coincident(bench: &Bench) -> Vec<Check> {
    let surfaces = room([0.0; 3], 1.0, &diffuse(ALBEDO))
        + &super::scenes::rectangle([0.7, 0.7], "<rotate x='1' angle='-60'/>", [0.0, -0.5, 0.0], &diffuse(ALBEDO));
    let lamp = sphere([-0.2, 0.3, 0.1], 0.1, false, &(diffuse(0.0) + &glowing(10.0)));
    let once = bench.scene(&(view(1.0, INSIDE, 80.0, EDGES) + &surfaces + &lamp));
    let twice = bench.scene(&(view(1.0, INSIDE, 80.0, EDGES) + &surfaces + &surfaces + &lamp));
    let compare = |way: super::bench::Way| {
        let [a, b] = [&twice, &once].map(|scene| means(&bench.runs(scene, &way, EFFORT)));
        Check::same(format!("mean by {}", way.name), &a, &b, ROUNDING, 0.4)
    };
    bench.ways(&once).into_iter().map(compare).collect()
}

/// A closed mesh seen from inside, which glows.
fn glowing_mesh(bench: &Bench, mesh: Mesh) -> Vec<Check> {
    let scene = bench.scene_of(with_mesh(mesh));
    bench.all_ways_give(&scene, Goal::new(series(ALBEDO, EDGES), 0.4), EFFORT)
}

fn with_mesh(mesh: Mesh) -> SceneDescription {
    let text = view(1.0, INSIDE, 80.0, EDGES) + &room([0.0; 3], 1.0, &(diffuse(ALBEDO) + &glowing(1.0)));
    let mut description = described(&text);
    description.shapes[0].geometry = ShapeGeometry::Mesh(Arc::new(mesh));
    description
}

/// The cube from −1 to 1, facing inwards, whose sides are cut into strips along one of their edges at these places.
fn room_with_needles() -> Mesh {
    const CUTS: [f32; 8] = [-1.0, -0.4, -0.399_999_8, 0.2, 0.200_000_2, 0.7, 0.700_000_2, 1.0];
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for axis in 0..3 {
        for side in [-1.0f32, 1.0] {
            let first = positions.len() as u32;
            for cut in CUTS {
                for end in [-1.0, 1.0] {
                    let mut p = [0.0; 3];
                    (p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3]) = (side, cut, end);
                    positions.push(Vec3::from(p));
                }
            }
            for strip in 0..CUTS.len() as u32 - 1 {
                let [a, b, c, d] = [0, 1, 2, 3].map(|i| first + 2 * strip + i);
                // (cut, end) run counter-clockwise about the axis
                let inwards = if side < 0.0 { [[a, c, d], [a, d, b]] } else { [[a, d, c], [a, b, d]] };
                triangles.extend(inwards);
            }
        }
    }
    Mesh::new(positions, triangles)
}

/// A sphere of radius 1 facing inwards, of n rings of 2n triangles each (but n at the poles).
fn tessellated_sphere(n: u32) -> Mesh {
    let mut positions = Vec::with_capacity(((n + 1) * n) as usize);
    for ring in 0..=n {
        let (sin, cos) = (std::f64::consts::PI * f64::from(ring) / f64::from(n)).sin_cos();
        for i in 0..n {
            let (y, x) = (std::f64::consts::TAU * f64::from(i) / f64::from(n)).sin_cos();
            positions.push(glam::DVec3::new(sin * x, sin * y, cos).as_vec3());
        }
    }
    let mut triangles = Vec::with_capacity((2 * n * n) as usize);
    for ring in 0..n {
        for i in 0..n {
            let next = (i + 1) % n;
            let [a, b, c, d] = [ring * n + i, ring * n + next, (ring + 1) * n + i, (ring + 1) * n + next];
            if ring > 0 {
                triangles.push([a, b, c]);
            }
            if ring + 1 < n {
                triangles.push([b, d, c]);
            }
        }
    }
    Mesh::new(positions, triangles)
}

/// The octahedron with corners at distance 1.5, facing inwards.
fn octahedron() -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let corners = [Vec3::X, -Vec3::X, Vec3::Y, -Vec3::Y, Vec3::Z, -Vec3::Z].map(|p| 1.5 * p).into();
    let mut faces = Vec::new();
    for x in [0, 1] {
        for y in [2, 3] {
            for z in [4, 5] {
                let even = (x + y + z) % 2 == 0; // of the signs, two of which are counted from even numbers
                faces.push(if even { [x, z, y] } else { [x, y, z] });
            }
        }
    }
    (corners, faces)
}

fn single_triangles(bench: &Bench) -> Vec<Check> {
    let (corners, faces) = octahedron();
    let mut description = with_mesh(Mesh::new(corners.clone(), vec![faces[0]]));
    for (number, face) in faces[1..].iter().enumerate() {
        let mut shape = description.shapes[0].clone();
        shape.name = format!("face {number}");
        let triangle = face.map(|i| corners[i as usize]).into();
        shape.geometry = ShapeGeometry::Mesh(Arc::new(Mesh::new(triangle, vec![[0, 1, 2]])));
        description.shapes.push(shape);
    }
    bench.all_ways_give(&bench.scene_of(description), Goal::new(series(ALBEDO, EDGES), 0.4), EFFORT)
}

/// A room from an OBJ file, in which triangles without area stand among the others: points, and lines.
fn degenerate(bench: &Bench) -> Vec<Check> {
    let (corners, faces) = octahedron();
    let mut obj = String::new();
    let mut line = |text: std::fmt::Arguments| writeln!(obj, "{text}").expect("a string");
    for Vec3 { x, y, z } in &corners {
        line(format_args!("v {x} {y} {z}"));
    }
    line(format_args!("v 0 0 0"));
    for [a, b, c] in faces {
        let [a, b, c] = [a + 1, b + 1, c + 1];
        line(format_args!("f {a} {b} {c}\nf {a} {a} {a}\nf {a} {b} {b}\nf 1 7 2"));
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    std::fs::write(folder.path().join("a.obj"), obj).expect("a file in it");
    let shape = format!(
        "<shape type='obj'><string name='filename' value='a.obj'/><boolean name='face_normals' value='true'/>{}{}</shape>",
        diffuse(ALBEDO),
        glowing(1.0)
    );
    let text = format!("<scene version='3.0.0'>{}{shape}</scene>", view(1.0, INSIDE, 80.0, EDGES));
    let description = load::text(&folder.path().join("a.xml"), text).unwrap_or_else(|error| panic!("{error}"));
    let told = description.warnings.iter().any(|warning| warning.contains("24"));
    let scene = bench.scene_of(description);
    let mut checks = bench.all_ways_give(&scene, Goal::new(series(ALBEDO, EDGES), 0.4), EFFORT);
    checks.push(Check::holds("the 24 triangles without area are told of", told));
    checks
}

/// A lamp of radius r about which there is glass of radius g, in the middle of a sphere of radius 1. Of the power
/// 4 π² r² L the part T leaves the glass at once; the rest comes back to the lamp, which is black. Rays leave the lamp with
/// cos-distributed directions, so that at the glass sin² is uniform from 0 to (r/g)², of which T is the mean of 1 − F.
/// Paths of three edges see a T L r² of that: camera, wall, glass, lamp.
fn lamp_in_glass(bench: &Bench) -> Vec<Check> {
    const LAMP: f64 = 0.2;
    const GLASS: f64 = 0.5;
    const INDEX: f64 = 1.5;
    let scene = bench.scene(
        &(view(1.0, [[0.6, 0.3, -0.2], [0.9, 0.1, -0.5]], 80.0, 3)
            + &sphere([0.0; 3], 1.0, true, &diffuse(ALBEDO))
            + &sphere(
                [0.0; 3],
                GLASS,
                false,
                &format!(
                    "<bsdf type='dielectric'><float name='int_ior' value='{INDEX}'/><float name='ext_ior' value='1'/></bsdf>"
                ),
            )
            + &sphere([0.0; 3], LAMP, false, &(diffuse(0.0) + &glowing(1.0)))),
    );
    const STEPS: u32 = 1000;
    let transmitted = |i: u32| {
        let sin2 = (LAMP / GLASS).powi(2) * (f64::from(i) + 0.5) / f64::from(STEPS);
        1.0 - super::materials::fresnel((1.0 - sin2).sqrt(), 1.0 / INDEX)
    };
    let mean = (0..STEPS).map(transmitted).sum::<f64>() / f64::from(STEPS);
    let expected = mean * integrating_sphere(ALBEDO, LAMP, 2);
    bench.all_ways_give(&scene, Goal::new(expected, 0.4), Effort { runs: 16, mutations_per_pixel: 256.0 })
}

/// Rays that leave the eye, at a third of the radius, meet the glass at less than the critical angle, so that all light
/// gets in after some reflections.
fn camera_in_glass(bench: &Bench) -> Vec<Check> {
    let glass = "<bsdf type='dielectric'><float name='int_ior' value='1.5'/><float name='ext_ior' value='1'/></bsdf>";
    let scene = bench.scene(
        &(view(1.0, [[0.2, 0.1, -0.2], [0.9, 0.1, -0.5]], 80.0, -1) + &sphere([0.0; 3], 1.0, false, glass) + SKY),
    );
    bench.ways_give(&scene, &camera_ways(), Goal::new(2.25, 0.3), EFFORT)
}

fn camera_on_wall(bench: &Bench) -> Vec<Check> {
    let text = view(1.0, [[0.6, 0.0, 0.8], [-0.5, 0.2, 0.1]], 60.0, EDGES).replace(&film(12, 8), &film(6, 4));
    let scene = bench.scene(&(text + &sphere([0.0; 3], 1.0, true, &(diffuse(ALBEDO) + &glowing(1.0)))));
    bench.all_ways_give(&scene, Goal::new(series(ALBEDO, EDGES), 0.4), Effort { runs: 16, mutations_per_pixel: 256.0 })
}
