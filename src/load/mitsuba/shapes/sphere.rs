//! `sphere`: `center`, `radius`, `to_world`, `flip_normals`; its front is outside.

use std::path::Path;

use glam::{Mat3A, Vec3};

use super::super::parameters::ElementParameters;
use super::Build;
use crate::scene::description::ShapeGeometry;
use crate::scene::parameters::Parameters;

/// Largest entry of MᵀM/s² − 1 that still is a uniform scale s; covers matrices written with four digits.
const SCALE_TOLERANCE: f32 = 1e-3;

/// Reads the sphere.
pub fn read(p: &mut ElementParameters, _folder: &Path) -> Option<Build> {
    let flip_normals = p.boolean("flip_normals").unwrap_or(false);
    let center = p.point("center").unwrap_or(Vec3::ZERO);
    let radius = p.float("radius").unwrap_or(1.0);
    let to_world = p.to_world();
    let matrix = to_world.matrix3;
    let scale = matrix.determinant().abs().cbrt();
    let error = matrix.transpose() * matrix * (scale * scale).recip() + Mat3A::IDENTITY * -1.0;
    if error.to_cols_array().iter().any(|entry| entry.abs() > SCALE_TOLERANCE) {
        p.fault("to_world", "a sphere must stay one: to_world must scale all directions alike".into());
        return None;
    }
    let world_radius = radius * scale;
    if radius <= 0.0 || !world_radius.is_normal() {
        p.fault("radius", format!("radius is {radius} ({world_radius} in the world); it must be above 0"));
        return None;
    }
    let geometry = ShapeGeometry::Sphere {
        center: to_world.transform_point3(center),
        radius: world_radius,
        // Mitsuba turns a mirrored sphere inside out, unlike rectangles, disks and cubes.
        flipped: flip_normals != (matrix.determinant() < 0.0),
    };
    Some(Build::ready(geometry))
}
