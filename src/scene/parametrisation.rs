//! Surface coordinates (u, v) of shapes and how positions change with them, as in Mitsuba.

use std::f32::consts::{PI, TAU};

use glam::{Mat3, Vec2, Vec3};

use super::Mesh;
use crate::math::Frame;

/// Where a point lies on its surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Surface coordinates.
    pub uv: Vec2,
    /// ∂p/∂u.
    pub du: Vec3,
    /// ∂p/∂v.
    pub dv: Vec3,
}

impl Place {
    /// Some tangents, where coordinates tell none.
    fn without_direction(uv: Vec2, normal: Vec3) -> Place {
        let frame = Frame::new(normal);
        Place { uv, du: frame.s, dv: frame.t }
    }
}

/// On triangle `t` at barycentric coordinates (1 − b − c, b, c); without texture coordinates those are (b, c), and tangents
/// are edges.
pub(super) fn of_mesh(mesh: &Mesh, t: u32, b: f32, c: f32, normal: Vec3) -> Place {
    let uv = mesh.uv(t, b, c);
    let [p0, p1, p2] = mesh.corners(t);
    if mesh.uvs.is_empty() {
        return Place { uv, du: p1 - p0, dv: p2 - p0 };
    }
    let [uv0, uv1, uv2] = mesh.triangles[t as usize].map(|i| mesh.uvs[i as usize]);
    let (a, b) = (uv1 - uv0, uv2 - uv0);
    let determinant = a.perp_dot(b);
    let (along_a, along_b) = (p1 - p0, p2 - p0);
    let du = (along_a * b.y - along_b * a.y) / determinant;
    let dv = (along_b * a.x - along_a * b.x) / determinant;
    if du.is_finite() && dv.is_finite() { Place { uv, du, dv } } else { Place::without_direction(uv, normal) }
}

/// On a sphere of that radius, in the direction `outside` from its centre; the columns of `axes` are its own axes in the
/// world. u goes around the z axis from the x axis on, v from the pole at +z to the other.
pub(super) fn of_sphere(axes: &Mat3, radius: f32, outside: Vec3) -> Place {
    let local = axes.transpose() * outside;
    let around = local.truncate();
    let sin = around.length();
    let (cos_phi, sin_phi) = if sin > 0.0 { (around.x / sin, around.y / sin) } else { (1.0, 0.0) };
    let du = TAU * radius * Vec3::new(-local.y, local.x, 0.0);
    let dv = PI * radius * Vec3::new(local.z * cos_phi, local.z * sin_phi, -sin);
    let uv = sphere_uv(axes, outside);
    if sin == 0.0 {
        return Place::without_direction(uv, outside);
    }
    Place { uv, du: *axes * du, dv: *axes * dv }
}

/// The surface coordinates of [`of_sphere`].
pub(super) fn sphere_uv(axes: &Mat3, outside: Vec3) -> Vec2 {
    let local = axes.transpose() * outside;
    Vec2::new(turn(local.truncate()), libm::acosf(local.z.clamp(-1.0, 1.0)) / PI)
}

/// On a flat disk, at `from_centre` in the world; `axes` as for spheres, with the normal as the third. u is the distance
/// from the centre over the radius, v the part of a turn from the x axis on.
pub(super) fn of_disk(axes: &Mat3, radius: f32, from_centre: Vec3) -> Place {
    let local = (axes.transpose() * from_centre).truncate() / radius;
    let r = local.length();
    let uv = disk_uv(axes, radius, from_centre);
    let (cos, sin) = if r > 0.0 { (local.x / r, local.y / r) } else { (1.0, 0.0) };
    let du = radius * Vec3::new(cos, sin, 0.0);
    let dv = TAU * radius * Vec3::new(-local.y, local.x, 0.0);
    Place { uv, du: *axes * du, dv: *axes * dv }
}

/// The surface coordinates of [`of_disk`].
pub(super) fn disk_uv(axes: &Mat3, radius: f32, from_centre: Vec3) -> Vec2 {
    let local = (axes.transpose() * from_centre).truncate() / radius;
    Vec2::new(local.length(), turn(local))
}

/// On a cylinder of that length, at `from_start` in the world; `axes` as for spheres, with its own axis as the third. u is
/// the part of a turn from the x axis on, v the part of the length.
pub(super) fn of_cylinder(axes: &Mat3, length: f32, from_start: Vec3) -> Place {
    let local = axes.transpose() * from_start;
    let du = TAU * Vec3::new(-local.y, local.x, 0.0);
    Place { uv: cylinder_uv(axes, length, from_start), du: *axes * du, dv: axes.z_axis * length }
}

/// The surface coordinates of [`of_cylinder`].
pub(super) fn cylinder_uv(axes: &Mat3, length: f32, from_start: Vec3) -> Vec2 {
    let local = axes.transpose() * from_start;
    Vec2::new(turn(local.truncate()), local.z / length)
}

/// The part of a turn, within [0, 1), from the x axis to a vector.
fn turn(v: Vec2) -> f32 {
    let turn = libm::atan2f(v.y, v.x) / TAU;
    if turn < 0.0 { turn + 1.0 } else { turn }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Differences of positions over differences of coordinates against the stated derivatives.
    fn check(point: impl Fn(Vec2) -> Vec3, place: Place) {
        let h = 1e-3;
        let du = (point(place.uv + Vec2::X * h) - point(place.uv - Vec2::X * h)) / (2.0 * h);
        let dv = (point(place.uv + Vec2::Y * h) - point(place.uv - Vec2::Y * h)) / (2.0 * h);
        assert!((du - place.du).length() < 2e-3 * (1.0 + du.length()), "{du} for {place:?}");
        assert!((dv - place.dv).length() < 2e-3 * (1.0 + dv.length()), "{dv} for {place:?}");
    }

    fn axes() -> Mat3 {
        Mat3::from_euler(glam::EulerRot::XYZ, 0.3, -0.8, 1.4)
    }

    #[test]
    fn tangents_of_spheres_follow_their_coordinates() {
        let (axes, radius) = (axes(), 2.5);
        let outside = |uv: Vec2| {
            let (theta, phi) = (uv.y * PI, uv.x * TAU);
            axes * Vec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos())
        };
        for uv in [Vec2::new(0.1, 0.3), Vec2::new(0.7, 0.9), Vec2::new(0.45, 0.5)] {
            let place = of_sphere(&axes, radius, outside(uv));
            assert!((place.uv - uv).length() < 1e-5, "{place:?} for {uv}");
            check(|uv| outside(uv) * radius, place);
        }
        let pole = of_sphere(&axes, radius, axes * Vec3::Z);
        assert!(pole.du.is_finite() && pole.dv.is_finite() && pole.du.cross(pole.dv).length() > 0.1, "{pole:?}");
    }

    #[test]
    fn tangents_of_triangles_follow_their_coordinates() {
        let corners = [Vec3::new(1.0, 0.0, 0.5), Vec3::new(0.0, 2.0, 1.0), Vec3::new(-1.0, 0.3, 0.0)];
        let uvs = [Vec2::new(0.2, 0.1), Vec2::new(0.9, 0.3), Vec2::new(0.4, 1.2)];
        let mut mesh = Mesh::new(corners.to_vec(), vec![[0, 1, 2]]);
        mesh.uvs = uvs.to_vec();
        let to_barycentric = glam::Mat2::from_cols(uvs[1] - uvs[0], uvs[2] - uvs[0]).inverse();
        let point = |uv: Vec2| {
            let b = to_barycentric * (uv - uvs[0]);
            corners[0] + (corners[1] - corners[0]) * b.x + (corners[2] - corners[0]) * b.y
        };
        check(point, of_mesh(&mesh, 0, 0.3, 0.2, Vec3::Z));
        mesh.uvs = vec![Vec2::ONE; 3];
        let flat = of_mesh(&mesh, 0, 0.3, 0.2, Vec3::Z);
        assert_eq!((flat.uv, flat.du.z, flat.dv.z), (Vec2::ONE, 0.0, 0.0), "tangents although coordinates tell none");
        mesh.uvs.clear();
        let bare = of_mesh(&mesh, 0, 0.3, 0.2, Vec3::Z);
        assert_eq!(bare.uv, Vec2::new(0.3, 0.2));
        check(|uv| corners[0] + (corners[1] - corners[0]) * uv.x + (corners[2] - corners[0]) * uv.y, bare);
    }

    #[test]
    fn disks_are_measured_from_their_centre() {
        let (axes, radius) = (axes(), 3.0);
        let place = of_disk(&axes, radius, axes * Vec3::new(0.0, 1.5, 0.0));
        assert!((place.uv - Vec2::new(0.5, 0.25)).length() < 1e-6, "{place:?}");
        assert!((place.du - axes * Vec3::Y * radius).length() < 1e-5);
        let point = |uv: Vec2| {
            let (sin, cos) = (TAU * uv.y).sin_cos();
            axes * Vec3::new(cos, sin, 0.0) * (radius * uv.x)
        };
        check(point, of_disk(&axes, radius, point(Vec2::new(0.7, 0.4))));
    }

    #[test]
    fn tangents_of_cylinders_follow_their_coordinates() {
        let (axes, radius, length) = (axes(), 0.7, 3.0);
        let point = |uv: Vec2| {
            let (sin, cos) = (TAU * uv.x).sin_cos();
            axes * Vec3::new(radius * cos, radius * sin, length * uv.y)
        };
        for uv in [Vec2::new(0.1, 0.3), Vec2::new(0.7, 0.9), Vec2::new(0.45, 0.5)] {
            let place = of_cylinder(&axes, length, point(uv));
            assert!((place.uv - uv).length() < 1e-5, "{place:?} for {uv}");
            check(point, place);
        }
    }

    /// By Mitsuba 3.9.1, of the cylinder from the origin to (1, 2, 0.5) of radius 0.4: it has the axes of Duff's frame.
    #[test]
    fn coordinates_of_cylinders_are_those_of_mitsuba() {
        let axis = Vec3::new(1.0, 2.0, 0.5);
        let Frame { s, t, n } = Frame::new(axis.normalize());
        let place = of_cylinder(&Mat3::from_cols(s, t, n), axis.length(), Vec3::new(0.5, 1.0, 0.6599));
        let near = |a: Vec3, b: [f32; 3]| (a - Vec3::from(b)).length() < 2e-3;
        assert!((place.uv - Vec2::new(0.6762, 0.539)).length() < 1e-4, "{place:?}");
        assert!(near(place.du, [2.248, -1.124, 0.0]) && near(place.dv, [1.0, 2.0, 0.5]), "{place:?}");
    }

    /// By Mitsuba 3.9.1, of a unit sphere, disk scaled by 2 in all directions.
    #[test]
    fn coordinates_are_those_of_mitsuba() {
        let close = |a: Vec3, b: [f32; 3]| assert!((a - Vec3::from(b)).length() < 2e-3, "{a} for {b:?}");
        let p = Vec3::new(0.5, 0.3, -1.9131);
        let place = of_sphere(&Mat3::IDENTITY, 2.0, p.normalize());
        assert!((place.uv - Vec2::new(0.086, 0.9058)).length() < 1e-4, "{place:?}");
        close(place.du, [-1.885, PI, 0.0]);
        close(place.dv, [-5.1537, -3.0922, -1.8318]);
        let place = of_disk(&Mat3::IDENTITY, 2.0, Vec3::new(0.5, 0.3, 0.0));
        assert!((place.uv - Vec2::new(0.2915, 0.086)).length() < 1e-4, "{place:?}");
        close(place.du, [1.715, 1.029, 0.0]);
        close(place.dv, [-1.885, PI, 0.0]);
    }
}
