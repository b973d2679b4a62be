//! `cylinder`: `p0`, `p1`, `radius`, `to_world`, `flip_normals`; its front is outside, its ends are open.

use glam::{Mat3, Vec3};

use super::super::Folder;
use super::super::parameters::ElementParameters;
use super::Build;
use crate::math::Frame;
use crate::scene::description::ShapeGeometry;
use crate::scene::parameters::Parameters;

/// Largest relative deviation from a circle and from a right angle; covers matrices written with four digits.
const CIRCLE_TOLERANCE: f32 = 1e-3;

/// Reads the cylinder.
pub fn read(p: &mut ElementParameters, _folder: &Folder) -> Option<Build> {
    let flip_normals = p.boolean("flip_normals").unwrap_or(false);
    let p0 = p.point("p0").unwrap_or(Vec3::ZERO);
    let p1 = p.point("p1").unwrap_or(Vec3::Z);
    let radius = p.float("radius").unwrap_or(1.0);
    let to_world = p.to_world();
    let Some(axis) = (p1 - p0).try_normalize() else {
        p.fault("p1", "p0 and p1 are the same point, or too far apart: the cylinder has no axis".into());
        return None;
    };
    let across = Frame::new(axis);
    let [x, y, along] = [across.s, across.t, axis].map(|v| to_world.transform_vector3(v));
    let scale = x.length();
    let is_right = |a: Vec3, b: Vec3| a.dot(b).abs() <= CIRCLE_TOLERANCE * a.length() * b.length();
    let is_circle = (y.length() - scale).abs() <= CIRCLE_TOLERANCE * scale && is_right(x, y);
    if !is_circle || !is_right(x, along) || !is_right(y, along) {
        let message =
            "a cylinder must stay one: to_world must scale alike in all directions across its axis, without shear";
        p.fault("to_world", message.into());
        return None;
    }
    let world_radius = radius * scale;
    if radius <= 0.0 || !world_radius.is_normal() {
        p.fault("radius", format!("radius is {radius} ({world_radius} in the world); it must be above 0"));
        return None;
    }
    // straightened, since four digits leave axes askew
    let (z, length) = along.normalize_and_length();
    let length = length * p0.distance(p1);
    let x = (x - z * z.dot(x)).normalize();
    let y = z.cross(x) * z.cross(x).dot(y).signum();
    Some(Build::ready(ShapeGeometry::Cylinder {
        start: to_world.transform_point3(p0),
        length,
        radius: world_radius,
        axes: Mat3::from_cols(x, y, z),
        flipped: flip_normals, // its front stays outside even if mirrored, unlike that of spheres
    }))
}
