//! Groups of shapes in other places: what an instance does to the rays that reach into it and to the points they hit.

use std::sync::Arc;

use glam::{Affine3A, Mat3A, Vec3, Vec3A};

use super::SceneDescription;
use super::description::GroupDescription;
use super::parametrisation::Place;
use crate::embree;

/// All instances of a scene, ready for look-up by the number of their Embree geometry.
#[derive(Clone, Debug, Default)]
pub(super) struct Instances {
    /// Number of the first one, behind those of the shapes in the world.
    first: u32,
    instances: Vec<Instance>,
}

/// One instance.
#[derive(Clone, Debug)]
pub(super) struct Instance {
    /// Place of the group's first shape among those of the scene.
    pub first_shape: u32,
    to_world: Affine3A,
    to_group: Affine3A,
    /// The inverse transpose of the linear part.
    normal_to_world: Mat3A,
    /// |M|, entry by entry, of the linear part M of `to_world`.
    magnitude: Mat3A,
    /// |M| |M⁻¹|: what the way to the group and back makes of errors.
    round_trip: Mat3A,
}

/// Rounding errors of a point of the world that was hit in a group, in units of 2⁻²⁴ of the magnitudes that
/// [`Instance::error`] sums: 6 for the point in the group, 4 for its way to the world, and as many as both for the way of
/// the next ray's origin back into the group, where Embree inverts the matrix and applies it in single precision.
const ROUNDINGS: f32 = 20.0;

/// The hierarchies of groups.
pub(super) fn trace_groups(
    device: &embree::Device,
    groups: &[GroupDescription],
) -> Result<Vec<Arc<embree::Scene>>, embree::EmbreeError> {
    let build = |group: &GroupDescription| embree::Scene::new(device, super::geometries(&group.shapes)).map(Arc::new);
    groups.iter().map(build).collect()
}

impl Instances {
    pub fn new(description: &SceneDescription) -> Instances {
        let mut next = description.shapes.len();
        let mut first_shapes = Vec::new();
        for group in &description.groups {
            first_shapes.push(next);
            next += group.shapes.len();
        }
        let instance = |group: usize, to_world| Instance::new(first_shapes[group] as u32, to_world);
        Instances {
            first: description.shapes.len() as u32,
            instances: description.instances.iter().map(|i| instance(i.group, i.to_world)).collect(),
        }
    }

    /// The instance that a hit names.
    #[inline(always)]
    pub fn get(&self, geometry: u32) -> &Instance {
        &self.instances[(geometry - self.first) as usize]
    }
}

impl Instance {
    fn new(first_shape: u32, to_world: Affine3A) -> Instance {
        let to_group = to_world.inverse();
        let magnitude = to_world.matrix3.abs();
        Instance {
            first_shape,
            to_world,
            to_group,
            normal_to_world: to_group.matrix3.transpose(),
            magnitude,
            round_trip: magnitude * to_group.matrix3.abs(),
        }
    }

    /// A ray in the coordinates of the group; t stays.
    #[inline(always)]
    pub fn ray_to_group(&self, origin: Vec3, direction: Vec3) -> (Vec3, Vec3) {
        (self.to_group.transform_point3(origin), self.to_group.transform_vector3(direction))
    }

    #[inline(always)]
    pub fn point_to_world(&self, p: Vec3) -> Vec3 {
        self.to_world.transform_point3(p)
    }

    /// Tangents in the world; surface coordinates stay.
    pub fn place_to_world(&self, place: &Place) -> Place {
        let [du, dv] = [place.du, place.dv].map(|tangent| self.to_world.transform_vector3(tangent));
        Place { uv: place.uv, du, dv }
    }

    /// A unit normal in the world; where the front is stays the same even if the transform mirrors.
    #[inline(always)]
    pub fn normal_to_world(&self, n: Vec3) -> Vec3 {
        Vec3::from(self.normal_to_world * Vec3A::from(n)).normalize()
    }

    /// Bound on how far, in each coordinate, the next ray from the point `p` of the world may miss the surface that was
    /// hit, before it is lifted off. In the group, coordinates of the surface near the hit are at most `extent`.
    ///
    /// |δp| ≤ n u (|M| q + |M| |M⁻¹| (|p| + |t|)) with u = 2⁻²⁴ and n = [`ROUNDINGS`]: the running error analysis of
    /// p = M q + t and of the way back (Higham 2002, section 3.1), to first order.
    #[inline(always)]
    pub fn error(&self, p: Vec3, extent: Vec3) -> Vec3 {
        let sizes = Vec3A::from(p.abs()) + self.to_world.translation.abs();
        let sum = self.magnitude * Vec3A::from(extent) + self.round_trip * sizes;
        Vec3::from(sum) * (ROUNDINGS * 0.5 * f32::EPSILON)
    }
}

#[cfg(test)]
mod tests {
    use glam::{DMat3, Mat3};

    use super::*;
    use crate::math::{offset_origin, warp};
    use crate::rng::{Counter, Purpose, Rng, unit_f32};
    use crate::scene::description::{InstanceDescription, ShapeDescription, ShapeGeometry, Sides, tests::with_lights};
    use crate::scene::materials::{Diffuse, Material};
    use crate::scene::{FullProfile, Mesh, Rgb, Scene, Surface};

    /// Numbers in [0, 1).
    struct Random(u64);

    impl Random {
        fn four(&mut self) -> [f32; 4] {
            self.0 += 1;
            let counter = Counter { ladder: 0, replica: 0, step: self.0, purpose: Purpose::Primary };
            Rng::new(3).words(counter, 0).map(unit_f32)
        }

        fn direction(&mut self) -> Vec3 {
            let [a, b, ..] = self.four();
            warp::sphere([a, b])
        }

        /// A rotation times a stretch of up to `stretch` in each direction times a rotation; half of them mirror.
        fn matrix(&mut self, stretch: f32) -> Mat3A {
            let mut rotation = || {
                let axis = self.direction();
                Mat3A::from_axis_angle(axis, 6.0 * self.four()[0])
            };
            let (first, second) = (rotation(), rotation());
            let scale = Vec3::from_slice(&self.four()) * 2.0 - 1.0;
            let scale = Vec3::new(stretch.powf(scale.x), stretch.powf(scale.y), stretch.powf(scale.z));
            second
                * Mat3A::from_diagonal(scale * scale.x.signum())
                * first
                * if self.four()[0] < 0.5 { -1.0 } else { 1.0 }
        }
    }

    fn shape(geometry: ShapeGeometry) -> ShapeDescription {
        ShapeDescription { name: "a".into(), geometry, sides: Sides::One(0), emission: None }
    }

    /// A scene of shapes in the world and one group in one place.
    fn scene(world: Vec<ShapeGeometry>, group: Vec<ShapeGeometry>, to_world: Affine3A) -> Scene {
        let mut description = with_lights(Vec::new());
        description.appearances.push(Material::Diffuse(Diffuse { reflectance: Rgb::ONE }).into());
        description.shapes = world.into_iter().map(shape).collect();
        let shapes: Vec<_> = group.into_iter().map(shape).collect();
        if !shapes.is_empty() {
            description.groups.push(GroupDescription { name: "group".into(), shapes });
            description.instances.push(InstanceDescription { group: 0, to_world });
        }
        Scene::new(&embree::Device::new("").unwrap(), description).unwrap()
    }

    fn surface(scene: &Scene, origin: Vec3, direction: Vec3) -> Option<Surface<'_>> {
        let hit = scene.tracer.closest_one(origin, direction, f32::INFINITY)?;
        Some(scene.surface::<FullProfile>(hit, origin, direction))
    }

    /// A bowl of 2 × 16 × 16 triangles over [−1, 1]² with the normals of its paraboloid.
    fn bowl() -> Mesh {
        let grid = |i: u32| i as f32 / 8.0 - 1.0;
        let points = (0..17 * 17).map(|i| (grid(i % 17), grid(i / 17)));
        let mut triangles = Vec::new();
        for (i, j) in (0..16).flat_map(|i| (0..16).map(move |j| (i, j))) {
            let a = 17 * j + i;
            triangles.extend([[a, a + 1, a + 18], [a, a + 18, a + 17]]);
        }
        let mut mesh =
            Mesh::new(points.clone().map(|(x, y)| Vec3::new(x, y, 0.5 * (x * x + y * y))).collect(), triangles);
        mesh.normals = points.map(|(x, y)| Vec3::new(-x, -y, 1.0).normalize()).collect();
        mesh
    }

    /// The bowl in the world with what an inverse transpose in f64 makes of its normals.
    fn transformed(mesh: &Mesh, to_world: Affine3A) -> Mesh {
        let matrix: DMat3 = to_world.matrix3.as_dmat3();
        let normals = matrix.inverse().transpose();
        let mut triangles = mesh.triangles.clone();
        if matrix.determinant() < 0.0 {
            triangles.iter_mut().for_each(|t| t.swap(1, 2)); // the front stays
        }
        let mut moved = Mesh::new(mesh.positions().iter().map(|p| to_world.transform_point3(*p)).collect(), triangles);
        // not of unit length: what lies between two normals is transformed as they are
        moved.normals = mesh.normals.iter().map(|n| (normals * n.as_dvec3()).as_vec3()).collect();
        moved
    }

    #[test]
    fn surfaces_in_groups_are_those_of_the_transformed_shapes() {
        let mut random = Random(0);
        for _ in 0..20 {
            let to_world = Affine3A { matrix3: random.matrix(2.0), translation: (3.0 * random.direction()).into() };
            let placed = scene(Vec::new(), vec![ShapeGeometry::Mesh(bowl().into())], to_world);
            let flat = scene(vec![ShapeGeometry::Mesh(transformed(&bowl(), to_world).into())], Vec::new(), to_world);
            let (mut compared, mut neighbours) = (0, 0);
            for _ in 0..2000 {
                let [x, y, ..] = random.four().map(|u| 2.0 * u - 1.0);
                let target = to_world.transform_point3(Vec3::new(x, y, 0.5 * (x * x + y * y)));
                let direction = random.direction();
                let origin = target - 5.0 * direction;
                let found = [&placed, &flat].map(|scene| surface(scene, origin, direction));
                let [Some(found), Some(expected)] = found else { continue };
                if found.p.distance(expected.p) > 1e-3 {
                    continue; // past an edge
                }
                compared += 1;
                let context = || format!("{to_world:?}: {found:?}, not {expected:?}");
                assert!(found.frame.n.distance(expected.frame.n) < 1e-3, "{}", context());
                neighbours += usize::from(found.ng.distance(expected.ng) > 1e-4);
                assert!((found.lift.normalize() - found.ng).length() < 1e-5 && found.lift.length() > 0.9999);
            }
            assert!(compared > 500, "{compared} of 2000 rays were compared");
            assert!(neighbours < 20, "{neighbours} of {compared} rays hit a triangle's neighbour");
        }
    }

    #[test]
    fn quadrics_in_groups_are_where_their_equations_put_them() {
        let mut random = Random(1 << 20);
        let start = Vec3::new(0.5, -1.0, 0.0);
        let axes = Mat3::from_euler(glam::EulerRot::XYZ, 0.3, -0.8, 1.4);
        let sphere = Vec3::new(-1.0, 0.5, 0.2);
        let shapes = [
            ShapeGeometry::Sphere { center: sphere, radius: 0.7, axes, flipped: false },
            ShapeGeometry::Disk { center: Vec3::new(0.0, 2.0, 0.0), radius: 1.0, axes },
            ShapeGeometry::Cylinder { start, length: 2.1, radius: 0.4, axes, flipped: true },
        ];
        for (which, shape) in shapes.into_iter().enumerate() {
            let mut hits = 0;
            for _ in 0..20 {
                let to_world = Affine3A { matrix3: random.matrix(2.0), translation: (3.0 * random.direction()).into() };
                let scene = scene(Vec::new(), vec![shape.clone()], to_world);
                let to_group = to_world.inverse();
                for _ in 0..500 {
                    let direction = random.direction();
                    let target = to_world.transform_point3(3.0 * Vec3::from_slice(&random.four()) - 1.5);
                    let Some(found) = surface(&scene, target - 20.0 * direction, direction) else { continue };
                    hits += 1;
                    let (q, n) =
                        (to_group.transform_point3(found.p), to_world.matrix3.transpose() * Vec3A::from(found.ng));
                    let n = Vec3::from(n).normalize();
                    let (off, normal) = match which {
                        0 => (q.distance(sphere) - 0.7, q - sphere),
                        1 => ((q - Vec3::new(0.0, 2.0, 0.0)).dot(axes.z_axis), axes.z_axis),
                        _ => {
                            let across = (q - start).reject_from(axes.z_axis);
                            (across.length() - 0.4, -across)
                        }
                    };
                    assert!(off.abs() < 1e-4, "shape {which} at {q} in the group, {off} off the surface");
                    assert!(n.distance(normal.normalize()) < 2e-3, "shape {which}: normal {n}, not {normal}");
                }
            }
            assert!(hits > 500, "shape {which} was hit {hits} times");
        }
    }

    /// Rays that leave a plane, or the outside of a sphere, cannot meet it again, wherever the group is and whatever the
    /// transform makes of it. Without the lift some do: the control.
    #[test]
    fn rays_leave_instances_without_meeting_them_again() {
        let mut random = Random(1 << 40);
        let (mut again, mut again_without_lift, mut tried) = (0, 0, 0);
        for round in 0..400 {
            let far = [0.0, 1.0, 100.0, 1e4][round % 4];
            let place = far * random.direction();
            let stretch = [1.0f32, 3.0, 30.0][round / 4 % 3];
            let matrix3 = random.matrix(stretch);
            // every second group is brought back to where the world's numbers are small
            let back = if round % 2 == 0 { matrix3 * Vec3A::from(place) } else { Vec3A::ZERO };
            let to_world = Affine3A { matrix3, translation: Vec3A::from(random.direction()) - back };
            let size = 1.0 + 0.01 * far;
            let group = if round % 5 == 0 {
                ShapeGeometry::Sphere { center: place, radius: size, axes: Mat3::IDENTITY, flipped: false }
            } else {
                let corners = [0, 1, 2].map(|_| place + size * random.direction());
                ShapeGeometry::Mesh(Mesh::new(corners.to_vec(), vec![[0, 1, 2]]).into())
            };
            let scene = scene(Vec::new(), vec![group.clone()], to_world);
            for _ in 0..200 {
                let on = match &group {
                    ShapeGeometry::Mesh(mesh) => {
                        let [u, v, ..] = random.four();
                        let ([b, c], corners) = (warp::triangle([u, v]), mesh.corners(0));
                        corners[0] * (1.0 - b - c) + corners[1] * b + corners[2] * c
                    }
                    _ => place + size * random.direction(),
                };
                let direction = random.direction();
                let origin = to_world.transform_point3(on) - 10.0 * size * stretch * direction;
                let Some(surface) = surface(&scene, origin, direction) else { continue };
                let next = random.direction();
                let front = if round % 5 == 0 || surface.ng.dot(next) >= 0.0 { 1.0 } else { -1.0 };
                let next = if surface.ng.dot(next) * front < 0.0 { -next } else { next };
                if surface.ng.dot(next).abs() < 1e-3 {
                    continue; // parallel for single precision
                }
                tried += 1;
                let meets = |normal: Vec3| {
                    scene.tracer.occluded_one(offset_origin(surface.p, normal * front), next, f32::INFINITY)
                };
                again += usize::from(meets(surface.lift));
                again_without_lift += usize::from(meets(surface.ng));
            }
        }
        assert!(tried > 40_000, "{tried} rays");
        assert_eq!(again, 0, "of {tried} rays {again} met what they had left, without the lift {again_without_lift}");
        assert!(again_without_lift > 100, "the control: {again_without_lift}");
    }

    #[test]
    fn instances_near_the_origin_are_left_as_closely_as_other_shapes() {
        let mut random = Random(1 << 50);
        for _ in 0..100 {
            let to_world = Affine3A { matrix3: random.matrix(1.0), translation: random.direction().into() };
            let placed = scene(Vec::new(), vec![ShapeGeometry::Mesh(bowl().into())], to_world);
            let origin = to_world.transform_point3(Vec3::new(0.1, 0.2, 0.0)) - 3.0 * random.direction();
            let target = to_world.transform_point3(Vec3::new(0.1, 0.2, 0.025));
            let Some(found) = surface(&placed, origin, target - origin) else { continue };
            assert!(found.lift.length() < 8.0, "{found:?}");
        }
    }

    #[test]
    fn errors_of_points_in_the_world_are_within_their_bound() {
        let mut random = Random(1 << 60);
        for _ in 0..1000 {
            let to_world = Affine3A { matrix3: random.matrix(10.0), translation: (100.0 * random.direction()).into() };
            let instance = Instance::new(0, to_world);
            let q = 100.0 * random.direction();
            let p = instance.point_to_world(q);
            let exact = to_world.matrix3.as_dmat3() * q.as_dvec3() + to_world.translation.as_dvec3();
            let error = (p.as_dvec3() - exact).abs();
            assert!(error.cmple(instance.error(p, q.abs()).as_dvec3()).all(), "{to_world:?}: {error} at {q}");
        }
    }
}
