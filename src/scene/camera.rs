//! The pinhole camera.

use glam::{Affine3A, Vec3};

use super::description::{CameraDescription, FilmDescription, FovAxis};

/// Maps film positions to rays.
#[derive(Clone, Copy, Debug)]
pub struct Camera {
    to_world: Affine3A,
    /// Half extents of the film at distance 1 along the optical axis.
    half: [f32; 2],
    near: f32,
    far: f32,
}

/// A ray; the direction has unit length, `tfar` is a distance along it.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// Start.
    pub origin: Vec3,
    /// Unit direction.
    pub direction: Vec3,
    /// How far it goes.
    pub tfar: f32,
}

impl Camera {
    /// The camera of that description, for a film of that shape.
    pub fn new(description: &CameraDescription, film: &FilmDescription) -> Camera {
        let aspect = f64::from(film.width) / f64::from(film.height);
        let tangent = libm::tan(0.5 * f64::from(description.fov).to_radians());
        // half width at distance 1, from the extent that the field of view spans
        let half_width = match description.fov_axis {
            FovAxis::X => tangent,
            FovAxis::Y => tangent * aspect,
            FovAxis::Diagonal => tangent * aspect / (aspect * aspect + 1.0).sqrt(),
            FovAxis::Smaller => tangent * aspect.max(1.0),
            FovAxis::Larger => tangent * aspect.min(1.0),
        };
        Camera {
            to_world: description.to_world,
            half: [half_width as f32, (half_width / aspect) as f32],
            near: description.near_clip,
            far: description.far_clip,
        }
    }

    /// The ray through a point of the film, given as fractions of its width (from the left) and height (from the
    /// top), between the clipping planes.
    #[inline(always)]
    pub fn ray(&self, x: f32, y: f32) -> Ray {
        let local = Vec3::new((1.0 - 2.0 * x) * self.half[0], (1.0 - 2.0 * y) * self.half[1], 1.0);
        let length = local.length(); // also 1/cos of the angle to the optical axis
        let direction = (self.to_world.matrix3 * glam::Vec3A::from(local)).normalize();
        let origin = Vec3::from(self.to_world.translation + direction * (self.near * length));
        Ray { origin, direction: direction.into(), tfar: (self.far - self.near) * length }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Filter;

    fn camera(fov_axis: FovAxis, width: u32, height: u32) -> Camera {
        let description =
            CameraDescription { to_world: Affine3A::IDENTITY, fov: 90.0, fov_axis, near_clip: 0.5, far_clip: 10.0 };
        Camera::new(&description, &FilmDescription { width, height, filter: Filter::Box })
    }

    #[test]
    fn the_field_of_view_spans_the_extent_it_names() {
        let tangents = |axis, w, h| {
            let c = camera(axis, w, h);
            let (left, top) = (c.ray(0.0, 0.5).direction, c.ray(0.5, 0.0).direction);
            [left.x / left.z, top.y / top.z]
        };
        let close = |a: [f32; 2], b: [f32; 2]| assert!((a[0] - b[0]).abs() + (a[1] - b[1]).abs() < 1e-5, "{a:?} {b:?}");
        close(tangents(FovAxis::X, 200, 100), [1.0, 0.5]);
        close(tangents(FovAxis::Y, 200, 100), [2.0, 1.0]);
        close(tangents(FovAxis::Smaller, 200, 100), [2.0, 1.0]);
        close(tangents(FovAxis::Larger, 200, 100), [1.0, 0.5]);
        close(tangents(FovAxis::Smaller, 100, 200), [1.0, 2.0]);
        close(tangents(FovAxis::Diagonal, 300, 400), [0.6, 0.8]);
    }

    #[test]
    fn rays_lie_between_the_clipping_planes() {
        let c = camera(FovAxis::X, 100, 100);
        for (x, y) in [(0.5, 0.5), (0.0, 0.0), (0.9, 0.3)] {
            let ray = c.ray(x, y);
            assert!((ray.origin.z - 0.5).abs() < 1e-6);
            assert!(((ray.origin + ray.direction * ray.tfar).z - 10.0).abs() < 1e-4);
            assert!((ray.direction.length() - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn left_is_positive_x_and_up_is_positive_y() {
        let d = camera(FovAxis::X, 100, 100).ray(0.1, 0.2).direction;
        assert!(d.x > 0.0 && d.y > 0.0);
    }
}
