//! Spheres, disks and cylinders, whole or in part: as Mitsuba's own where they are whole, as meshes otherwise.

use std::f64::consts::PI;

use glam::{DAffine2, DAffine3, DMat2, DVec2, DVec3};

use super::parameters::Parameters;
use super::world::Shape;
use crate::convert::meshes::Mesh;
use crate::convert::notes::Notes;
use crate::convert::xml::Element;

/// Steps of a mesh around the axis and along it.
const AROUND: u32 = 128;
const ALONG: u32 = 64;

/// What a quadric becomes.
pub enum Quadric {
    /// A shape of Mitsuba's, with its area in the world and the map from its texture coordinates to pbrt's.
    Exact(Element, f64, DAffine2),
    /// A mesh in the quadric's own coordinates, normals outwards, with pbrt's texture coordinates.
    Mesh(Mesh),
}

/// The plugin of a shape, or a mesh; nothing where its parameters make no sense, which is a fault.
pub fn convert(shape: &Shape, is_textured: bool, notes: &Notes) -> Option<Quadric> {
    let p = &shape.parameters;
    let radius = p.float("radius").unwrap_or(1.0);
    if radius <= 0.0 {
        notes.fault(p.place_of("radius"), format!("a radius of {radius}; it must be above 0"));
        return None;
    }
    let turn = p.float("phimax").unwrap_or(360.0).clamp(0.0, 360.0);
    let quadric = match &p.kind[..] {
        "sphere" => sphere(shape, radius, turn),
        "disk" => disk(shape, radius, turn),
        _ => cylinder(shape, radius, turn, is_textured),
    };
    if let Quadric::Mesh(mesh) = &quadric {
        let message = format!(
            "a {} that is partial, stretched or textured in its own way becomes a mesh of {} triangles",
            p.kind,
            mesh.triangles.len()
        );
        notes.changed(&p.place, message);
    }
    Some(quadric)
}

/// The scale of a map that only turns, moves, mirrors and scales evenly.
fn even_scale(map: DAffine3) -> Option<f64> {
    let columns = [map.matrix3.x_axis, map.matrix3.y_axis, map.matrix3.z_axis];
    let scale = columns[0].length();
    let is_even = columns.iter().all(|column| (column.length() / scale - 1.0).abs() < 1e-4);
    let is_square =
        [(0, 1), (1, 2), (2, 0)].iter().all(|(i, j)| columns[*i].dot(columns[*j]).abs() < 1e-4 * scale * scale);
    (is_even && is_square).then_some(scale)
}

/// A map that does not mirror and does the same to what is round about z, and what it does to pbrt's u.
///
/// Mitsuba turns mirrored spheres inside out and mirrored disks not; without mirrors there is nothing to mind.
fn without_mirror(map: DAffine3) -> (DAffine3, DAffine2) {
    if map.matrix3.determinant() > 0.0 {
        return (map, DAffine2::IDENTITY);
    }
    let backwards = DAffine2 { matrix2: DMat2::from_diagonal(DVec2::new(-1.0, 1.0)), translation: DVec2::X };
    (map * DAffine3::from_scale(DVec3::new(1.0, -1.0, 1.0)), backwards)
}

fn sphere(shape: &Shape, radius: f64, turn: f64) -> Quadric {
    let p = &shape.parameters;
    let (z_min, z_max) = z_range(p, -radius, radius);
    let is_whole = turn == 360.0 && z_min <= -radius && z_max >= radius;
    if let (true, Some(scale)) = (is_whole, even_scale(shape.to_world)) {
        let (to_world, u) = without_mirror(shape.to_world);
        let element = Element::plugin("shape", "sphere")
            .transform("to_world", to_world * DAffine3::from_scale(DVec3::splat(radius)));
        // pbrt's v runs from −z to +z, Mitsuba's from +z to −z
        let v = DAffine2 { matrix2: DMat2::from_diagonal(DVec2::new(1.0, -1.0)), translation: DVec2::Y };
        let world_radius = radius * scale;
        return Quadric::Exact(element, 4.0 * PI * world_radius * world_radius, u * v);
    }
    let [low, high] = [z_min, z_max].map(|z| libm::acos((z / radius).clamp(-1.0, 1.0)));
    Quadric::Mesh(grid(turn, |around, v| {
        let theta = low + (high - low) * v;
        let normal = DVec3::new(around.x * libm::sin(theta), around.y * libm::sin(theta), libm::cos(theta));
        (normal * radius, normal)
    }))
}

fn disk(shape: &Shape, radius: f64, turn: f64) -> Quadric {
    let p = &shape.parameters;
    let (height, inner) = (p.float("height").unwrap_or(0.0), p.float("innerradius").unwrap_or(0.0));
    let is_whole = turn == 360.0 && inner <= 0.0;
    if let (true, Some(scale)) = (is_whole, even_scale(shape.to_world)) {
        let (to_world, u) = without_mirror(shape.to_world);
        let own = DAffine3::from_translation(DVec3::Z * height) * DAffine3::from_scale(DVec3::splat(radius));
        let element = Element::plugin("shape", "disk").transform("to_world", to_world * own);
        // pbrt's u is the angle and v the way inwards, Mitsuba's u the way outwards and v the angle
        let swapped = DAffine2 { matrix2: DMat2::from_cols(DVec2::new(0.0, -1.0), DVec2::X), translation: DVec2::Y };
        let world_radius = radius * scale;
        return Quadric::Exact(element, PI * world_radius * world_radius, u * swapped);
    }
    Quadric::Mesh(grid(turn, |around, v| {
        let r = radius + (inner - radius) * v;
        (DVec3::new(around.x * r, around.y * r, height), DVec3::Z)
    }))
}

fn cylinder(shape: &Shape, radius: f64, turn: f64, is_textured: bool) -> Quadric {
    let (z_min, z_max) = z_range(&shape.parameters, -1.0, 1.0);
    if let (true, false, Some(scale)) = (turn == 360.0, is_textured, even_scale(shape.to_world)) {
        let [p0, p1] = [z_min, z_max].map(|z| shape.to_world.transform_point3(DVec3::Z * z));
        let element =
            Element::plugin("shape", "cylinder").point("p0", p0).point("p1", p1).float("radius", radius * scale);
        return Quadric::Exact(element, 2.0 * PI * radius * scale * (p1 - p0).length(), DAffine2::IDENTITY);
    }
    Quadric::Mesh(grid(turn, |around, v| {
        let normal = DVec3::new(around.x, around.y, 0.0);
        (normal * radius + DVec3::Z * (z_min + (z_max - z_min) * v), normal)
    }))
}

/// `zmin` and `zmax`, the lower one first.
fn z_range(p: &Parameters, low: f64, high: f64) -> (f64, f64) {
    let (a, b) = (p.float("zmin").unwrap_or(low), p.float("zmax").unwrap_or(high));
    (a.min(b), a.max(b))
}

/// A grid of u, a part of a turn of so many degrees, and v; the surface gives position and normal at the direction from
/// the axis and v.
fn grid(turn: f64, surface: impl Fn(DVec2, f64) -> (DVec3, DVec3)) -> Mesh {
    let mut mesh = Mesh::default();
    for j in 0..=ALONG {
        for i in 0..=AROUND {
            let (u, v) = (f64::from(i) / f64::from(AROUND), f64::from(j) / f64::from(ALONG));
            let phi = u * turn.to_radians();
            let (position, normal) = surface(DVec2::new(libm::cos(phi), libm::sin(phi)), v);
            mesh.positions.push(position);
            mesh.normals.push(normal);
            mesh.uvs.push(DVec2::new(u, v));
        }
    }
    let at = |i: u32, j: u32| j * (AROUND + 1) + i;
    for j in 0..ALONG {
        for i in 0..AROUND {
            let corners = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            for [a, b, c] in [[0, 1, 2], [0, 2, 3]] {
                let triangle = [corners[a], corners[b], corners[c]];
                let [p, q, r] = triangle.map(|k| mesh.positions[k as usize]);
                // at a pole one side of the cell is a point
                if (q - p).cross(r - p).length() > 1e-12 * (q - p).length().max((r - p).length()).powi(2) {
                    mesh.triangles.push(triangle);
                }
            }
        }
    }
    mesh.follow_normals();
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grids_have_the_area_of_what_they_stand_for() {
        let whole = grid(360.0, |around, v| {
            let theta = PI * (1.0 - v);
            let n = DVec3::new(around.x * theta.sin(), around.y * theta.sin(), theta.cos());
            (2.0 * n, n)
        });
        let area: f64 = whole.areas().iter().sum();
        assert!((area / (16.0 * PI) - 1.0).abs() < 1e-3, "{area}");
        let half = grid(180.0, |around, v| (DVec3::new(around.x, around.y, v), around.extend(0.0)));
        let area: f64 = half.areas().iter().sum();
        assert!((area / PI - 1.0).abs() < 1e-3, "{area}");
    }

    #[test]
    fn only_even_maps_have_a_scale() {
        let turned =
            DAffine3::from_axis_angle(DVec3::ONE.normalize(), 1.0) * DAffine3::from_scale(DVec3::new(2.0, -2.0, 2.0));
        assert!((even_scale(turned).unwrap() - 2.0).abs() < 1e-12);
        assert_eq!(even_scale(DAffine3::from_scale(DVec3::new(1.0, 1.0, 1.1))), None);
    }
}
