//! Cameras: a pinhole, a thin lens, parallel rays.

use glam::{Affine3A, DMat3, Mat3, Vec3, Vec3A, Vec3Swizzles};

use super::description::{CameraDescription, FilmDescription, FovAxis, Lens, Projection};
use crate::math::warp;

/// Maps film positions to rays.
#[derive(Clone, Copy, Debug)]
pub struct Camera {
    to_world: Affine3A,
    /// Upper left corner of the picture, as x and y in the camera's coordinates: at distance 1 along the optical axis
    /// for rays from an eye, at any distance for parallel ones.
    corner: [f32; 2],
    /// What x and y fall by from there to the lower right corner.
    extent: [f32; 2],
    near: f32,
    far: f32,
    eye: Eye,
    /// The translation of `to_world`, its linear part M and the inverse of that, in vectors that loops over lanes can have
    /// several of side by side.
    position: Vec3,
    linear: Mat3,
    to_local: Mat3,
    /// What all densities have in common: 1/(|det M|·A), with the area A of the film in the coordinates of `corner`.
    density: f32,
}

/// Where a camera's rays come from.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Eye {
    /// A point.
    Pinhole,
    /// A thin lens.
    Lens(Lens),
    /// Infinitely far: rays are parallel.
    Infinite,
}

/// How a point is seen.
#[derive(Clone, Copy, Debug)]
pub struct Sight {
    /// Position on the film as fractions of its width (from the left) and height (from the top), within [0, 1)².
    pub film: [f32; 2],
    /// Unit direction from the point to the eye.
    pub direction: Vec3,
    /// Distance from the point to the near plane along it: the length of a shadow ray, > 0.
    pub distance: f32,
    /// Density with which rays of the camera (film position uniform over the unit square, this place on the lens) reach
    /// a surface at the point that faces the eye, per area; see [`Camera::density`].
    pub density: f32,
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
    /// The camera of that description, for that film.
    pub fn new(description: &CameraDescription, film: &FilmDescription) -> Camera {
        let size = film.window.whole.map(f64::from);
        let aspect = size[0] / size[1];
        let (half_width, principal_point, eye) = match description.projection {
            Projection::Perspective { fov, fov_axis, principal_point, lens } => {
                (half_width(fov, fov_axis, aspect), principal_point, lens.map_or(Eye::Pinhole, Eye::Lens))
            }
            Projection::Orthographic => (1.0, [0.0; 2], Eye::Infinite),
        };
        let half = [half_width, half_width / aspect];
        let corner = |i: usize| {
            let fraction = f64::from(film.window.offset[i]) / size[i] + f64::from(principal_point[i]);
            (half[i] * (1.0 - 2.0 * fraction)) as f32
        };
        let extent = |i: usize, pixels: u32| (2.0 * half[i] * f64::from(pixels) / size[i]) as f32;
        let extent = [extent(0, film.width), extent(1, film.height)];
        let m = DMat3::from_cols_array(&description.to_world.matrix3.to_cols_array().map(f64::from));
        let area = f64::from(extent[0] * extent[1]);
        Camera {
            to_world: description.to_world,
            corner: [corner(0), corner(1)],
            extent,
            near: description.near_clip,
            far: description.far_clip,
            eye,
            position: description.to_world.translation.into(),
            linear: description.to_world.matrix3.into(),
            to_local: Mat3::from_cols_array(&m.inverse().to_cols_array().map(|x| x as f32)),
            density: (1.0 / (m.determinant() * area).abs()) as f32,
        }
    }

    /// The ray that belongs to a point of the picture, given as fractions of its width (from the left) and height (from
    /// the top), between the clipping planes. `lens` is the place on the lens as a point of the unit square, of no
    /// account where there is none.
    ///
    /// The measurement of a film position is the mean of the radiance along its rays, `lens` uniform.
    #[inline(always)]
    pub fn ray(&self, [x, y]: [f32; 2], lens: [f32; 2]) -> Ray {
        let [x, y] = [self.corner[0] - x * self.extent[0], self.corner[1] - y * self.extent[1]];
        match self.eye {
            Eye::Pinhole => self.ray_from(self.to_world.translation, Vec3A::new(x, y, 1.0)),
            Eye::Lens(of) => self.ray_through(of, [x, y], lens),
            Eye::Infinite => self.parallel_ray([x, y]),
        }
    }

    /// The ray that starts at a point in the plane of the eye in a direction of the camera's coordinates, whose z is 1.
    #[inline(always)]
    fn ray_from(&self, eye: Vec3A, local: Vec3A) -> Ray {
        let length = local.length(); // also 1/cos of the angle to the optical axis
        let direction = (self.to_world.matrix3 * local).normalize();
        let origin = eye + direction * (self.near * length);
        Ray { origin: origin.into(), direction: direction.into(), tfar: (self.far - self.near) * length }
    }

    /// The ray from a place on the lens to the point in the plane of focus where the ray through its centre goes.
    fn ray_through(&self, lens: Lens, [x, y]: [f32; 2], place: [f32; 2]) -> Ray {
        let on_lens = Vec3A::from(on_lens(lens, place));
        let local = Vec3A::new(x, y, 1.0) - on_lens / lens.focus_distance;
        self.ray_from(self.to_world.transform_point3a(on_lens), local)
    }

    /// The ray along the optical axis from a point of the near plane. As in Mitsuba, `to_world` scales the distance of
    /// that plane but not the one that rays go beyond it.
    fn parallel_ray(&self, [x, y]: [f32; 2]) -> Ray {
        let origin = self.to_world.transform_point3a(Vec3A::new(x, y, self.near));
        Ray {
            origin: origin.into(),
            direction: self.to_world.matrix3.z_axis.normalize().into(),
            tfar: self.far - self.near,
        }
    }
}

/// The way back: from points to the film.
impl Camera {
    /// How the point `p` is seen through that place on the lens: the inverse of [`ray`](Camera::ray). `None` where it lies
    /// outside the film, behind the eye or beyond the clipping planes.
    #[inline]
    pub fn sight(&self, p: Vec3, lens: [f32; 2]) -> Option<Sight> {
        let (sight, visible) = self.sight_anyhow(self.eye, p, lens);
        visible.then_some(sight)
    }

    /// Where the rays come from.
    #[inline(always)]
    pub(crate) fn eye(&self) -> Eye {
        self.eye
    }

    /// What [`sight`](Camera::sight) gives, and whether it gives it: without a branch for a given kind of `eye`, which must be
    /// the camera's own, for loops over lanes.
    #[inline(always)]
    pub(crate) fn sight_anyhow(&self, eye: Eye, p: Vec3, lens: [f32; 2]) -> (Sight, bool) {
        let seen = self.seen(eye, p, lens);
        let [x, y] = seen.picture;
        let film = [(self.corner[0] - x) / self.extent[0], (self.corner[1] - y) / self.extent[1]];
        let clipped = (seen.from_near > 0.0) & (seen.from_near <= seen.reach);
        let inside = (film[0] >= 0.0) & (film[0] < 1.0) & (film[1] >= 0.0) & (film[1] < 1.0);
        let visible = seen.in_front & clipped & inside;
        let sight =
            Sight { film, direction: seen.to_eye, distance: seen.from_near, density: self.density * seen.spread };
        (sight, visible)
    }

    /// [`Sight::density`] at a point that is known to be seen through that place on the lens: how many rays, of one in
    /// all over the film, pass through an area at `p` perpendicular to them.
    ///
    /// With M the linear part of `to_world`, A the area of the film at distance 1 and l the ray's direction in the
    /// camera's coordinates, whose z is 1, rays from an eye leave it with the density |M l|³/(|det M| A) per solid angle,
    /// the Jacobian of l ↦ M l/|M l|; the square of the distance makes that one per area. Of parallel rays, z being the
    /// unit vector along the axis, it is |M z|/(|det M| A) everywhere.
    #[inline]
    pub fn density(&self, p: Vec3, lens: [f32; 2]) -> f32 {
        self.density_from(self.eye, p, lens)
    }

    /// The same for the camera's own kind of `eye`: without a branch, for loops over lanes.
    #[inline(always)]
    pub(crate) fn density_from(&self, eye: Eye, p: Vec3, lens: [f32; 2]) -> f32 {
        self.density * self.seen(eye, p, lens).spread
    }

    #[inline(always)]
    fn seen(&self, eye: Eye, p: Vec3, lens: [f32; 2]) -> Seen {
        match eye {
            Eye::Pinhole => self.seen_from(p, Vec3::ZERO, 0.0),
            Eye::Lens(of) => self.seen_from(p, on_lens(of, lens), 1.0 / of.focus_distance),
            Eye::Infinite => self.seen_from_afar(p),
        }
    }

    /// From a place in the plane of the eye, in the camera's coordinates; `per_focus` is 1 over the distance where all
    /// places see alike.
    #[inline(always)]
    fn seen_from(&self, p: Vec3, place: Vec3, per_focus: f32) -> Seen {
        let to_eye = self.position + self.linear * place - p;
        let local = -(self.to_local * to_eye);
        let distance = to_eye.length();
        let along = local / local.z;
        let length = along.length();
        let stretched = distance / local.z; // |M l|
        Seen {
            picture: (along + place * per_focus).xy().into(),
            in_front: local.z > 0.0,
            to_eye: to_eye / distance,
            from_near: distance - self.near * length,
            reach: (self.far - self.near) * length,
            spread: stretched / (local.z * local.z), // |M l|³/distance²
        }
    }

    /// By a parallel ray.
    #[inline(always)]
    fn seen_from_afar(&self, p: Vec3) -> Seen {
        let local = self.to_local * (p - self.position);
        let axis = self.linear.z_axis;
        let stretched = axis.length();
        Seen {
            picture: local.xy().into(),
            in_front: true,
            to_eye: -axis / stretched,
            from_near: (local.z - self.near) * stretched,
            reach: self.far - self.near,
            spread: stretched,
        }
    }
}

/// A point seen by a camera whose film has no border.
struct Seen {
    /// Where in the picture, in the coordinates of [`Camera::corner`].
    picture: [f32; 2],
    /// Whether it is on the side of the eye that rays go to.
    in_front: bool,
    /// Unit direction.
    to_eye: Vec3,
    /// How far the ray that reaches it has come from the near plane, and how far it goes.
    from_near: f32,
    reach: f32,
    /// The density of rays over what is common to all of the camera.
    spread: f32,
}

/// A place on the lens in the camera's coordinates, of one in the unit square.
#[inline(always)]
fn on_lens(lens: Lens, place: [f32; 2]) -> Vec3 {
    (warp::disk(place) * lens.aperture_radius).extend(0.0)
}

/// Half the width of the whole picture at distance 1, from the extent that the field of view spans.
fn half_width(fov: f32, axis: FovAxis, aspect: f64) -> f64 {
    let tangent = libm::tan(0.5 * f64::from(fov).to_radians());
    match axis {
        FovAxis::X => tangent,
        FovAxis::Y => tangent * aspect,
        FovAxis::Diagonal => tangent * aspect / (aspect * aspect + 1.0).sqrt(),
        FovAxis::Smaller => tangent * aspect.max(1.0),
        FovAxis::Larger => tangent * aspect.min(1.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::{Filter, Window};

    /// A place on the lens for cameras that have none.
    const ANY: [f32; 2] = [0.3, 0.8];

    fn perspective(fov_axis: FovAxis) -> Projection {
        Projection::Perspective { fov: 90.0, fov_axis, principal_point: [0.0; 2], lens: None }
    }

    /// Clipping planes at 0.5 and 10.
    fn camera(projection: Projection, film: FilmDescription) -> Camera {
        seen_from(Affine3A::IDENTITY, projection, film)
    }

    fn seen_from(to_world: Affine3A, projection: Projection, film: FilmDescription) -> Camera {
        Camera::new(&CameraDescription { to_world, projection, near_clip: 0.5, far_clip: 10.0 }, &film)
    }

    fn film(width: u32, height: u32) -> FilmDescription {
        FilmDescription::new(width, height, Filter::Box)
    }

    /// 16 × 16 places on the lens.
    fn places() -> impl Iterator<Item = [f32; 2]> {
        (0..256).map(|i| [i % 16, i / 16].map(|j| (j as f32 + 0.5) / 16.0))
    }

    /// Where a ray meets the plane at that distance from the origin along z.
    fn at_distance(ray: Ray, z: f32) -> Vec3 {
        ray.origin + ray.direction * ((z - ray.origin.z) / ray.direction.z)
    }

    fn assert_near(a: Vec3, b: Vec3, what: &str) {
        assert!((a - b).length() < 2e-5, "{what}: {a} is not {b}");
    }

    #[test]
    fn the_field_of_view_spans_the_extent_it_names() {
        let tangents = |axis, w, h| {
            let c = camera(perspective(axis), film(w, h));
            let (left, top) = (c.ray([0.0, 0.5], ANY).direction, c.ray([0.5, 0.0], ANY).direction);
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
        let lens = Some(Lens { aperture_radius: 0.2, focus_distance: 3.0 });
        let with_lens = Projection::Perspective { fov: 90.0, fov_axis: FovAxis::X, principal_point: [0.1, -0.2], lens };
        for projection in [perspective(FovAxis::X), with_lens, Projection::Orthographic] {
            let c = camera(projection, film(100, 100));
            for film in [[0.5, 0.5], [0.0, 0.0], [0.9, 0.3]] {
                for place in places() {
                    let ray = c.ray(film, place);
                    assert!((ray.origin.z - 0.5).abs() < 1e-6, "{projection:?}: {ray:?}");
                    assert!(((ray.origin + ray.direction * ray.tfar).z - 10.0).abs() < 1e-4, "{projection:?}: {ray:?}");
                    assert!((ray.direction.length() - 1.0).abs() < 1e-6, "{projection:?}: {ray:?}");
                }
            }
        }
    }

    #[test]
    fn left_is_positive_x_and_up_is_positive_y() {
        let d = camera(perspective(FovAxis::X), film(100, 100)).ray([0.1, 0.2], ANY).direction;
        assert!(d.x > 0.0 && d.y > 0.0);
        let o = camera(Projection::Orthographic, film(100, 100)).ray([0.1, 0.2], ANY).origin;
        assert!(o.x > 0.0 && o.y > 0.0);
    }

    #[test]
    fn the_optical_axis_passes_through_the_principal_point() {
        for [x, y] in [[0.0, 0.0], [0.25, 0.0], [0.0, -0.125], [-0.3, 0.4], [-1.5, 2.0]] {
            let projection =
                Projection::Perspective { fov: 60.0, fov_axis: FovAxis::X, principal_point: [x, y], lens: None };
            let d = camera(projection, film(300, 200)).ray([0.5 - x, 0.5 - y], ANY).direction;
            assert_near(d, Vec3::Z, &format!("principal point {x}, {y}"));
        }
    }

    #[test]
    fn a_part_of_a_picture_is_seen_as_in_the_whole() {
        let whole = film(40, 30);
        let part = FilmDescription { window: Window { whole: [40, 30], offset: [9, 5] }, ..film(24, 16) };
        let lens = Some(Lens { aperture_radius: 0.2, focus_distance: 3.0 });
        for projection in [
            perspective(FovAxis::Smaller),
            Projection::Perspective { fov: 50.0, fov_axis: FovAxis::Diagonal, principal_point: [0.2, -0.1], lens },
            Projection::Orthographic,
        ] {
            let [whole, part] = [whole, part].map(|film| camera(projection, film));
            for [x, y] in [[0.0, 0.0], [1.0, 1.0], [0.25, 0.875]] {
                let (a, b) =
                    (part.ray([x, y], ANY), whole.ray([(9.0 + 24.0 * x) / 40.0, (5.0 + 16.0 * y) / 30.0], ANY));
                assert_near(a.origin, b.origin, &format!("{projection:?}, origin"));
                assert_near(a.direction, b.direction, &format!("{projection:?}, direction"));
            }
        }
    }

    #[test]
    fn rays_of_a_film_point_meet_in_the_plane_of_focus_alone() {
        let lens = Lens { aperture_radius: 0.25, focus_distance: 4.0 };
        let projection =
            |lens| Projection::Perspective { fov: 70.0, fov_axis: FovAxis::X, principal_point: [0.0; 2], lens };
        let [pinhole, thin] = [None, Some(lens)].map(|lens| camera(projection(lens), film(30, 20)));
        for film in [[0.5, 0.5], [0.0, 1.0], [0.7, 0.2]] {
            let sharp = at_distance(pinhole.ray(film, ANY), 4.0);
            for place in places() {
                let ray = thin.ray(film, place);
                assert_near(at_distance(ray, 4.0), sharp, "in focus");
                // at twice the distance the ray is as far from the middle as it was on the lens, on the other side
                let middle = at_distance(pinhole.ray(film, ANY), 8.0);
                assert_near(at_distance(ray, 8.0) - middle, -at_distance(ray, 0.0), "out of focus");
            }
        }
    }

    /// Mean of the square of the distance from the centre of a uniform disk: r²/2. The midpoint rule with 256 points errs
    /// by less than a hundredth.
    #[test]
    fn rays_fill_the_aperture() {
        let lens = Some(Lens { aperture_radius: 0.25, focus_distance: 4.0 });
        let turned = Affine3A::from_rotation_translation(glam::Quat::from_rotation_y(0.7), Vec3::new(3.0, -2.0, 1.0));
        let projection = Projection::Perspective { fov: 70.0, fov_axis: FovAxis::X, principal_point: [0.0; 2], lens };
        let camera = seen_from(turned, projection, film(30, 20));
        let back = turned.inverse();
        let on_lens: Vec<Vec3> = places()
            .map(|place| {
                let ray = camera.ray([0.2, 0.9], place);
                let [origin, direction] = [back.transform_point3(ray.origin), back.transform_vector3(ray.direction)];
                origin - direction * (origin.z / direction.z)
            })
            .collect();
        let mean_square = on_lens.iter().map(|p| p.length_squared()).sum::<f32>() / 256.0;
        assert!((mean_square / (0.25 * 0.25 / 2.0) - 1.0).abs() < 0.01, "{mean_square}");
        assert!(on_lens.iter().all(|p| p.length() <= 0.25 + 1e-5));
    }

    #[test]
    fn parallel_rays_are_as_far_apart_as_the_transform_says() {
        let to_world = Affine3A::from_scale_rotation_translation(
            Vec3::new(3.0, 3.0, 2.0),
            glam::Quat::from_rotation_x(0.5),
            Vec3::new(1.0, 2.0, 3.0),
        );
        let camera = seen_from(to_world, Projection::Orthographic, film(200, 100));
        let forward = to_world.transform_vector3(Vec3::Z).normalize();
        let [left, right] = [[0.0, 0.5], [1.0, 0.5]].map(|film| camera.ray(film, ANY));
        let [top, bottom] = [[0.5, 0.0], [0.5, 1.0]].map(|film| camera.ray(film, ANY));
        for ray in [left, right, top, bottom] {
            assert_near(ray.direction, forward, "direction");
        }
        assert!(((left.origin - right.origin).length() - 6.0).abs() < 1e-5);
        assert!(((top.origin - bottom.origin).length() - 3.0).abs() < 1e-5);
    }

    /// Cameras of every kind, with what can be given to them: a principal point, a part of the picture, a transform that
    /// scales, shears, mirrors.
    fn cameras() -> Vec<Camera> {
        let moved = Affine3A::from_scale_rotation_translation(
            Vec3::new(1.5, 0.7, 2.0),
            glam::Quat::from_rotation_x(0.5) * glam::Quat::from_rotation_y(-1.1),
            Vec3::new(1.0, -2.0, 3.0),
        );
        let sheared = Affine3A::from_cols_array_2d(&[
            [-1.2, 0.1, 0.0], // a mirror, as files have it
            [0.3, 0.9, 0.2],
            [0.2, -0.4, 1.1],
            [0.5, 0.0, -1.0],
        ]);
        let part = FilmDescription { window: Window { whole: [40, 30], offset: [9, 5] }, ..film(24, 16) };
        let lens = Some(Lens { aperture_radius: 0.25, focus_distance: 4.0 });
        let eye = |principal_point, lens| Projection::Perspective {
            fov: 70.0,
            fov_axis: FovAxis::Smaller,
            principal_point,
            lens,
        };
        let mut cameras = Vec::new();
        for to_world in [Affine3A::IDENTITY, moved, sheared] {
            for film in [film(30, 20), part] {
                for projection in
                    [eye([0.0; 2], None), eye([0.2, -0.1], None), eye([-0.1, 0.15], lens), Projection::Orthographic]
                {
                    cameras.push(seen_from(to_world, projection, film));
                }
            }
        }
        cameras
    }

    /// Uniform numbers, eight at a time.
    fn numbers(count: u64) -> impl Iterator<Item = [f32; 8]> {
        use crate::rng::{Counter, Purpose, Rng, unit_f32};
        let rng = Rng::new(5);
        (0..count).map(move |step| {
            let words = |block| {
                rng.words(Counter { ladder: 0, replica: 0, step, purpose: Purpose::Primary }, block).map(unit_f32)
            };
            let ([a, b, c, d], [e, f, g, h]) = (words(0), words(1));
            [a, b, c, d, e, f, g, h]
        })
    }

    #[test]
    fn a_point_is_seen_where_the_ray_to_it_comes_from() {
        for camera in cameras() {
            for [x, y, a, b, t, ..] in numbers(1000) {
                let ray = camera.ray([x, y], [a, b]);
                let distance = ray.tfar * (0.001 + 0.998 * t);
                let p = ray.origin + ray.direction * distance;
                let Some(sight) = camera.sight(p, [a, b]) else {
                    // but for rounding at the border
                    assert!([x, y].iter().any(|f| (f - 0.5).abs() > 0.4999), "{p} at ({x}, {y}) unseen by {camera:?}");
                    continue;
                };
                let off = (sight.film[0] - x).abs().max((sight.film[1] - y).abs());
                assert!(off < 2e-4, "({x}, {y}) seen at {:?} by {camera:?}", sight.film);
                assert_near(sight.direction, -ray.direction, "direction to the eye");
                let error = (sight.distance - distance).abs();
                assert!(error < 2e-5 * (1.0 + distance), "{} for {distance} by {camera:?}", sight.distance);
                assert_eq!(sight.density, camera.density(p, [a, b]));
            }
        }
    }

    #[test]
    fn what_is_out_of_view_is_not_seen() {
        for camera in cameras() {
            for [x, y, a, b, t, ..] in numbers(100) {
                let ray = camera.ray([x, y], [a, b]);
                let at = |distance: f32| camera.sight(ray.origin + ray.direction * distance, [a, b]);
                assert!(at(-0.01).is_none(), "before the near plane of {camera:?}");
                assert!(at(1.01 * ray.tfar).is_none(), "beyond the far plane of {camera:?}");
                let behind = at(-3.0 - 5.0 * t);
                assert!(behind.is_none(), "behind {camera:?}: {behind:?}");
                for film in [[x - 1.001, y], [x + 1.001, y], [x, y - 1.001], [x, y + 1.001]] {
                    let ray = camera.ray(film, [a, b]);
                    let sight = camera.sight(ray.origin + ray.direction * (0.5 * ray.tfar), [a, b]);
                    assert!(sight.is_none(), "{film:?} seen at {sight:?} by {camera:?}");
                }
            }
        }
    }

    /// One over the area of the cross-section that rays to a unit of the film have, by central differences, whose error
    /// goes with the square of the step; bound 0.3 %.
    #[test]
    fn the_density_is_that_of_the_rays() {
        /// Half the step; the error of second order is some 10⁻⁴ of the area, that of rounding 10⁻⁴ of a side.
        const STEP: f32 = 0.01;
        for camera in cameras() {
            for [x, y, a, b, t, ..] in numbers(100) {
                let ray = camera.ray([x, y], [a, b]);
                let p = ray.origin + ray.direction * (ray.tfar * (0.1 + 0.8 * t));
                let across = |film: [f32; 2]| {
                    let other = camera.ray(film, [a, b]);
                    let n = ray.direction;
                    other.origin + other.direction * ((p - other.origin).dot(n) / other.direction.dot(n)) - p
                };
                let along_x = (across([x + STEP, y]) - across([x - STEP, y])) / (2.0 * STEP);
                let along_y = (across([x, y + STEP]) - across([x, y - STEP])) / (2.0 * STEP);
                let (got, expected) = (camera.density(p, [a, b]), 1.0 / along_x.cross(along_y).length());
                assert!((got / expected - 1.0).abs() < 3e-3, "{got} for {expected} at ({x}, {y}) by {camera:?}");
            }
        }
    }
}
