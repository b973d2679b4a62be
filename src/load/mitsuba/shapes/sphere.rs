//! `sphere`: `center`, `radius`, `to_world`, `flip_normals`; its front is outside.

use glam::Vec3;

use super::super::Folder;
use super::super::parameters::ElementParameters;
use super::Build;
use crate::scene::description::ShapeGeometry;
use crate::scene::parameters::{Parameters, similarity};

/// Reads the sphere.
pub fn read(p: &mut ElementParameters, _folder: &Folder) -> Option<Build> {
    let flip_normals = p.boolean("flip_normals").unwrap_or(false);
    let center = p.point("center").unwrap_or(Vec3::ZERO);
    let radius = p.float("radius").unwrap_or(1.0);
    let to_world = p.to_world();
    let Some((axes, scale)) = similarity(&to_world) else {
        p.fault("to_world", "a sphere must stay one: to_world must scale all directions alike".into());
        return None;
    };
    let world_radius = radius * scale;
    if radius <= 0.0 || !world_radius.is_normal() {
        p.fault("radius", format!("radius is {radius} ({world_radius} in the world); it must be above 0"));
        return None;
    }
    let geometry = ShapeGeometry::Sphere {
        center: to_world.transform_point3(center),
        radius: world_radius,
        axes,
        // Mitsuba turns a mirrored sphere inside out, unlike rectangles, disks and cubes.
        flipped: flip_normals != (axes.determinant() < 0.0),
    };
    Some(Build::ready(geometry))
}
