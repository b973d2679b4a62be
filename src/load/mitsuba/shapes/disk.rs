//! `disk`: radius 1 around the origin with its front towards +z; `to_world`, `flip_normals`.

use glam::{Mat3, Vec3};

use super::super::Folder;
use super::super::parameters::ElementParameters;
use super::Build;
use crate::scene::description::ShapeGeometry;
use crate::scene::parameters::Parameters;

/// Largest relative deviation from a circle; covers matrices written with four digits.
const CIRCLE_TOLERANCE: f32 = 1e-3;

/// Reads the disk.
pub fn read(p: &mut ElementParameters, _folder: &Folder) -> Option<Build> {
    let flip_normals = p.boolean("flip_normals").unwrap_or(false);
    let to_world = p.to_world();
    let [x, y] = [Vec3::X, Vec3::Y].map(|axis| to_world.transform_vector3(axis));
    let radius = x.length();
    let is_circle = (y.length() - radius).abs() <= CIRCLE_TOLERANCE * radius
        && x.dot(y).abs() <= CIRCLE_TOLERANCE * radius * radius;
    if !is_circle {
        p.fault("to_world", "a disk must stay a circle: to_world must scale its x and y alike, without shear".into());
        return None;
    }
    // x × y is the normal but for its sign: the front stays on the side that +z goes to.
    let upright = x.cross(y).normalize();
    let is_mirrored = to_world.matrix3.determinant() < 0.0;
    let normal = if is_mirrored != flip_normals { -upright } else { upright };
    let x = x / radius;
    let axes = Mat3::from_cols(x, (y - x * x.dot(y)).normalize(), normal);
    Some(Build::ready(ShapeGeometry::Disk { center: to_world.translation.into(), radius, axes }))
}
