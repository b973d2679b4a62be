//! Does Embree, behind our wall, do what the renderer relies on?

use glam::{Affine3A, DVec3, Mat3A, Vec3};
use relt::embree::{Device, Geometry, Hit, Hits, MISS, Rays, Scene, Width};
use relt::scene::Mesh;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::Path;
use std::process::Command;
use std::sync::Arc;

const SCENES: [&str; 3] = ["cornell-box", "caustic", "lattice"];

/// Embree's default, which is the best this processor has, and older ones.
const INSTRUCTION_SETS: [&str; 4] = ["", "isa=avx2", "isa=avx", "isa=sse4.2"];

#[test]
fn hits_do_not_depend_on_the_width() {
    for isa in INSTRUCTION_SETS {
        assert_same_hits_for_all_widths(&Device::new(isa).unwrap(), 1 << 16);
    }
}

#[test]
#[ignore = "minutes: the same over millions of rays a scene, kind and instruction set; prints a table"]
fn hits_do_not_depend_on_the_width_over_millions_of_rays() {
    for isa in INSTRUCTION_SETS {
        let device = Device::new(isa).unwrap();
        println!("{} {isa}, native {:?}", device.description(), device.native_widths());
        assert_same_hits_for_all_widths(&device, 10 << 20);
    }
}

fn assert_same_hits_for_all_widths(device: &Device, rays: usize) {
    const BATCH: usize = 1 << 16;
    for name in SCENES.into_iter().chain(["quadrics", "instances"]) {
        let scene = Scene::new(device, geometries(device, name)).unwrap();
        for (kind, make) in RAY_KINDS {
            let mut random = Random(1);
            let mut differences: [Differences; 4] = Default::default();
            for _ in 0..rays.div_ceil(BATCH) {
                compare_widths(&scene, &make(&scene, &mut random, BATCH), &mut differences);
            }
            for (width, found) in Width::ALL.into_iter().zip(&differences) {
                println!("{name:12} {kind:7} width {width:>2}: {}", found.table());
            }
            let total: usize = differences.iter().map(Differences::total).sum();
            assert_eq!(total, 0, "{name}, {kind} rays: see the table above");
        }
    }
}

/// How a comparison of widths came out.
#[derive(Default)]
struct Differences {
    rays: usize,
    hits: usize,
    primitive: usize,
    u_v: usize,
    t: usize,
    occluded: usize,
    first: String,
}

impl Differences {
    fn total(&self) -> usize {
        self.primitive + self.u_v + self.t + self.occluded
    }

    fn table(&self) -> String {
        let Differences { rays, hits, primitive, u_v, t, occluded, first } = self;
        format!(
            "{rays} rays, {hits} hits; differ: primitive {primitive}, uv {u_v}, t {t}, occlusion {occluded} {first}"
        )
    }
}

/// Traces the same rays with every width and counts where they differ from single rays.
fn compare_widths(scene: &Scene, rays: &Rays, differences: &mut [Differences; 4]) {
    let (mut single, mut hits) = (Hits::default(), Hits::default());
    let (mut single_occluded, mut occluded) = (Vec::new(), Vec::new());
    scene.closest(Width::W1, rays, &mut single);
    scene.occluded(Width::W1, rays, &mut single_occluded);
    for (width, found) in Width::ALL.into_iter().zip(differences) {
        scene.closest(width, rays, &mut hits);
        scene.occluded(width, rays, &mut occluded);
        found.rays += rays.len();
        for i in 0..rays.len() {
            let same = |a: &[f32], b: &[f32]| a[i].to_bits() == b[i].to_bits();
            let primitive = hits.geometry[i] == single.geometry[i]
                && hits.primitive[i] == single.primitive[i]
                && hits.instance.get(i) == single.instance.get(i);
            let u_v = same(&hits.u, &single.u) && same(&hits.v, &single.v);
            let t = same(&hits.t, &single.t);
            let occlusion = occluded[i] == single_occluded[i];
            found.hits += usize::from(single.geometry[i] != MISS);
            if primitive && u_v && t && occlusion {
                continue;
            }
            found.primitive += usize::from(!primitive);
            found.u_v += usize::from(primitive && !u_v);
            found.t += usize::from(primitive && !t);
            found.occluded += usize::from(!occlusion);
            if found.first.is_empty() {
                let (o, d) = (rays.origin(i), rays.direction(i));
                found.first = format!(
                    "width {width}, ray {o} {d} to {}: {:?} {}, alone {:?} {}",
                    rays.tfar[i],
                    hits.get(i),
                    occluded[i],
                    single.get(i),
                    single_occluded[i]
                );
            }
        }
    }
}

#[test]
fn closest_hits_are_those_of_a_brute_force_search_in_f64() {
    for (name, n) in [("cornell-box", 20_000), ("lattice", 20_000), ("caustic", 500)] {
        let scene = Scene::new(&device(), meshes(name)).unwrap();
        let rays = random_rays(&scene, &mut Random(2), n);
        let mut hits = Hits::default();
        scene.closest(Width::W8, &rays, &mut hits);
        let mut near_an_edge = 0;
        for i in 0..rays.len() {
            let (origin, direction) = (rays.origin(i).as_dvec3(), rays.direction(i).as_dvec3());
            let oracle = brute_force(scene.geometries(), origin, direction);
            if oracle.is_some_and(|oracle| oracle.margin < 1e-4) {
                near_an_edge += 1; // either neighbour may be hit there
                continue;
            }
            let found = hits.get(i);
            let context = format!("{name}, ray {i} from {origin} to {direction}: {found:?}, expected {oracle:?}");
            let (Some(found), Some(oracle)) = (found, oracle) else {
                assert!(found.is_none() && oracle.is_none(), "{context}");
                continue;
            };
            let expected_t = oracle.t as f32;
            assert!((found.t - expected_t).abs() < 1e-4 * expected_t.max(0.1), "{context}");
            if found.primitive != oracle.primitive || found.geometry != oracle.geometry {
                assert!(oracle.gap < 1e-4, "{context}"); // two surfaces in one place
                continue;
            }
            let [a, b, c] = corners(&scene, found);
            let point = a + f64::from(found.u) * (b - a) + f64::from(found.v) * (c - a);
            let distance = (point - origin - oracle.t * direction).length();
            assert!(distance < 1e-4 * oracle.t.max(0.1), "{context}: (u, v) is {distance} away from the hit");
        }
        assert!(near_an_edge < n / 10, "{name}: {near_an_edge} of {n} rays went uncompared");
    }
}

/// The nearest triangle on a ray.
#[derive(Clone, Copy, Debug)]
struct Oracle {
    t: f64,
    geometry: u32,
    primitive: u32,
    /// Smallest barycentric coordinate of the hit, or how far outside the nearest miss before it was: ≥ 0.
    margin: f64,
    /// How far behind it the next triangle is.
    gap: f64,
}

fn brute_force(geometries: &[Geometry], origin: DVec3, direction: DVec3) -> Option<Oracle> {
    let mut best: Option<Oracle> = None;
    let mut doubtful = f64::INFINITY; // margin of the doubtful triangles
    for (geometry, shape) in (0..).zip(geometries) {
        let Geometry::Triangles(mesh) = shape else { panic!("only triangles") };
        for primitive in 0..mesh.triangles.len() as u32 {
            let [a, b, c] = mesh.corners(primitive).map(|p| p.as_dvec3());
            let normal = (b - a).cross(c - a);
            let t = (a - origin).dot(normal) / direction.dot(normal);
            let point = origin + t * direction;
            let area = normal.length_squared();
            let v = (b - a).cross(point - a).dot(normal) / area;
            let u = (point - a).cross(c - a).dot(normal) / area;
            let inside = u.min(v).min(1.0 - u - v);
            if t.is_nan() || t <= 0.0 || inside.is_nan() {
                continue;
            }
            if inside.abs() < doubtful && best.is_none_or(|best| t < best.t * 1.001) {
                doubtful = inside.abs();
            }
            if inside < 0.0 {
                continue;
            }
            let gap = best.map_or(f64::INFINITY, |best| (best.t - t).abs());
            if best.is_none_or(|best| t < best.t) {
                best = Some(Oracle { t, geometry, primitive, margin: 0.0, gap });
            } else if let Some(best) = &mut best {
                best.gap = best.gap.min(gap);
            }
        }
    }
    best.map(|best| Oracle { margin: doubtful, ..best })
}

fn corners(scene: &Scene, hit: Hit) -> [DVec3; 3] {
    let Geometry::Triangles(mesh) = &scene.geometries()[hit.geometry as usize] else { panic!("only triangles") };
    mesh.corners(hit.primitive).map(|p| p.as_dvec3())
}

#[test]
fn packets_of_every_fill_give_the_hits_of_single_rays() {
    for name in ["quadrics", "instances"] {
        assert_same_hits_for_every_fill(&Scene::new(&device(), geometries(&device(), name)).unwrap());
    }
}

fn assert_same_hits_for_every_fill(scene: &Scene) {
    let mut random = Random(3);
    let (mut hits, mut occluded) = (Hits::default(), Vec::new());
    for n in 0..=40 {
        let mut rays = random_rays(scene, &mut random, n);
        for i in 0..n {
            rays.tfar[i] = 2.0 * random.unit(); // some end before anything
        }
        for width in Width::ALL {
            scene.closest(width, &rays, &mut hits);
            scene.occluded(width, &rays, &mut occluded);
            assert_eq!((hits.t.len(), hits.geometry.len(), occluded.len()), (n, n, n));
            for (i, &occluded) in occluded.iter().enumerate() {
                let (origin, direction, tfar) = (rays.origin(i), rays.direction(i), rays.tfar[i]);
                let context = format!("ray {i} of {n}, width {width}");
                assert_eq!(hits.get(i), scene.closest_one(origin, direction, tfar), "{context}");
                assert_eq!(occluded, scene.occluded_one(origin, direction, tfar), "{context}");
            }
        }
    }
}

#[test]
fn a_ray_that_hits_nothing_leaves_nothing_behind_in_its_lane() {
    let scene = Scene::new(&device(), meshes("cornell-box")).unwrap();
    let mut rays = random_rays(&scene, &mut Random(4), 64);
    let mut hits = Hits::default();
    scene.closest(Width::W16, &rays, &mut hits);
    for i in 0..rays.len() {
        rays.set(i, Vec3::splat(100.0), Vec3::X, 7.0);
    }
    for width in Width::ALL {
        scene.closest(width, &rays, &mut hits);
        let n = rays.len();
        let nothing = Hits {
            geometry: vec![MISS; n],
            primitive: vec![MISS; n],
            u: vec![0.0; n],
            v: vec![0.0; n],
            t: vec![7.0; n],
            instance: Vec::new(),
        };
        assert_eq!(hits, nothing, "width {width}");
    }
}

#[test]
fn a_nan_hits_nothing_and_disturbs_no_other_ray() {
    let scene = Scene::new(&device(), quadrics()).unwrap();
    let sound = random_rays(&scene, &mut Random(5), 96);
    let (mut expected, mut hits) = (Hits::default(), Hits::default());
    let (mut expected_occluded, mut occluded) = (Vec::new(), Vec::new());
    for width in Width::ALL {
        scene.closest(width, &sound, &mut expected);
        scene.occluded(width, &sound, &mut expected_occluded);
        for broken in [Vec3::NAN, Vec3::new(f32::NAN, 0.0, 1.0), Vec3::new(0.5, 0.5, f32::NAN)] {
            let mut rays = sound.clone();
            for i in (0..rays.len()).step_by(5) {
                match i % 3 {
                    0 => rays.set(i, broken, Vec3::X, f32::INFINITY),
                    1 => rays.set(i, sound.origin(i), broken, f32::INFINITY),
                    _ => rays.set(i, sound.origin(i), sound.direction(i), f32::NAN),
                }
            }
            scene.closest(width, &rays, &mut hits);
            scene.occluded(width, &rays, &mut occluded);
            for i in 0..rays.len() {
                let (hit, shadow) = if i % 5 == 0 { (None, false) } else { (expected.get(i), expected_occluded[i]) };
                assert_eq!((hits.get(i), occluded[i]), (hit, shadow), "ray {i}, width {width}, {broken}");
            }
        }
    }
}

#[test]
fn occlusion_is_a_closest_hit_before_the_end_of_the_ray() {
    for name in SCENES.into_iter().chain(["quadrics", "instances"]) {
        let scene = Scene::new(&device(), geometries(&device(), name)).unwrap();
        let rays = random_rays(&scene, &mut Random(6), 20_000);
        let (mut hits, mut occluded) = (Hits::default(), Vec::new());
        for width in Width::ALL {
            scene.closest(width, &rays, &mut hits);
            for scale in [0.999, 1.001] {
                let mut short = rays.clone();
                for i in 0..rays.len() {
                    short.tfar[i] = scale * hits.t[i];
                }
                scene.occluded(width, &short, &mut occluded);
                for (i, &occluded) in occluded.iter().enumerate() {
                    let expected = hits.get(i).is_some() && scale > 1.0;
                    assert_eq!(occluded, expected, "{name}, width {width}, ray {i}, hit {:?} × {scale}", hits.get(i));
                }
            }
        }
    }
}

#[test]
fn spheres_are_hit_from_outside_and_from_inside_where_the_quadratic_says() {
    let mut random = Random(8);
    for _ in 0..200 {
        let (center, radius) = (10.0 * random.cube() - 5.0, (4.0 * random.unit() - 3.0).exp());
        let scene = Scene::new(&device(), vec![Geometry::Sphere { center, radius }]).unwrap();
        for _ in 0..50 {
            let inside = random.below(2) == 0;
            let origin =
                center + radius * random.direction() * if inside { random.unit() } else { 1.0 + 5.0 * random.unit() };
            let direction = random.direction() * (0.5 + random.unit());
            let (o, d, r) = (origin.as_dvec3() - center.as_dvec3(), direction.as_dvec3(), f64::from(radius));
            let (a, b, c) = (d.length_squared(), 2.0 * o.dot(d), o.length_squared() - r * r);
            let discriminant = b * b - 4.0 * a * c;
            let roots = [-1.0, 1.0].map(|sign: f64| (-b + sign * discriminant.sqrt()) / (2.0 * a));
            let grazing = discriminant.abs() < 1e-9 * b * b || c.abs() < 1e-6 * r * r;
            let expected = roots.into_iter().find(|&t| t > 0.0);
            let hit = scene.closest_one(origin, direction, f32::INFINITY);
            let agrees = match (hit, expected) {
                (Some(hit), Some(t)) => (f64::from(hit.t) - t).abs() < 1e-6 * t && (hit.u, hit.v) == (0.0, 0.0),
                (hit, expected) => hit.is_none() && expected.is_none(),
            };
            assert!(
                agrees || grazing,
                "sphere {center} {radius}, ray {origin} {direction}: {hit:?}, expected {expected:?}"
            );
        }
    }
}

#[test]
fn disks_are_hit_from_both_sides_within_their_radius() {
    let mut random = Random(9);
    for round in 0..200 {
        let (center, radius) = (10.0 * random.cube() - 5.0, (4.0 * random.unit() - 3.0).exp());
        let normal = if round % 4 == 0 { Vec3::Y } else { random.direction() } * (0.1 + 3.0 * random.unit());
        let scene = Scene::new(&device(), vec![Geometry::Disk { center, normal, radius }]).unwrap();
        let side = normal.normalize().any_orthonormal_vector();
        for _ in 0..50 {
            let distance = 2.0 * random.unit();
            let turned = glam::Quat::from_axis_angle(normal.normalize(), std::f32::consts::TAU * random.unit()) * side;
            let target = center + distance * radius * turned;
            let origin = target + random.direction() * (0.1 + radius);
            let hit = scene.closest_one(origin, target - origin, f32::INFINITY);
            let in_the_plane = ((target - origin).normalize().dot(normal.normalize())).abs() < 0.01;
            let agrees = hit.is_some() == (distance < 1.0) && hit.is_none_or(|hit| (hit.t - 1.0).abs() < 1e-3);
            let on_the_rim = (distance - 1.0).abs() < 1e-3;
            assert!(
                agrees || in_the_plane || on_the_rim,
                "disk {center} {normal} {radius}: {hit:?}, distance {distance}"
            );
        }
    }
}

#[test]
fn cylinders_are_hit_from_both_sides_between_their_ends() {
    let mut random = Random(14);
    let mut excused = 0;
    for round in 0..200 {
        let (start, radius) = (10.0 * random.cube() - 5.0, (4.0 * random.unit() - 3.0).exp());
        let along = if round % 4 == 0 { Vec3::Y } else { random.direction() };
        let length = (4.0 * random.unit() - 3.0).exp();
        let end = start + length * along;
        let scene = Scene::new(&device(), vec![Geometry::Cylinder { start, end, radius }]).unwrap();
        for _ in 0..50 {
            // from anywhere near to a point of the wall, or of its continuation beyond the ends
            let height = length * (2.0 * random.unit() - 0.5);
            let across = along.cross(random.direction()).normalize();
            let target = start + height * along + radius * across;
            let origin = target + (radius + length) * (0.1 + random.unit()) * random.direction();
            let direction = (target - origin) * (0.5 + random.unit());
            let hit = scene.closest_one(origin, direction, f32::INFINITY);
            let ray = [origin, direction].map(Vec3::as_dvec3);
            let [expected, margin] = cylinder_oracle([start, end].map(Vec3::as_dvec3), radius.into(), ray);
            let agrees = match hit {
                Some(hit) => (f64::from(hit.t) - expected).abs() < 1e-6 * expected && (hit.u, hit.v) == (0.0, 0.0),
                None => expected.is_infinite(),
            };
            let context =
                format!("cylinder {start} along {along}, {length} long, radius {radius}; {origin} {direction}");
            assert!(agrees || margin < 1e-4, "{context}: {hit:?}, expected {expected}");
            excused += usize::from(!agrees);
            let shadow = scene.occluded_one(origin, direction, f32::INFINITY);
            assert_eq!(shadow, hit.is_some(), "{context}");
        }
    }
    assert!(excused < 100, "{excused} of 10000 rays grazed the wall or an end, and another answer was let pass");
}

/// The t at which a ray meets a cylinder, or infinity, by a search for changes of sign of the distance to the wall; and how
/// near it comes to an end or to grazing the wall, relative to the size of the cylinder.
fn cylinder_oracle([start, end]: [DVec3; 2], radius: f64, [origin, direction]: [DVec3; 2]) -> [f64; 2] {
    const STEPS: usize = 4000;
    let (axis, length) = (end - start).normalize_and_length();
    let at = |t: f64| {
        let p = origin + t * direction - start;
        let height = p.dot(axis);
        ((p - height * axis).length() - radius, height)
    };
    let step = 6.0 * (length + radius) / direction.length() / STEPS as f64;
    let mut margin = f64::INFINITY;
    for i in 0..STEPS {
        let [mut low, mut high] = [i, i + 1].map(|i| i as f64 * step);
        let ((before, height), (after, _)) = (at(low), at(high));
        let off_the_ends = height.abs().min((height - length).abs());
        if before.abs() < 2.0 * step * direction.length() {
            // near the wall: a chord may hide within a step, and the end of the wall may be just here
            let grazing = (at(low + step).0 - before).abs() < 0.1 * step * direction.length();
            margin = margin.min(if grazing { 0.0 } else { off_the_ends / (length + radius) });
        }
        if (before < 0.0) == (after < 0.0) {
            continue;
        }
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if (at(middle).0 < 0.0) == (before < 0.0) { low = middle } else { high = middle }
        }
        let (_, height) = at(low);
        margin = margin.min(height.abs().min((height - length).abs()) / (length + radius));
        if (0.0..=length).contains(&height) {
            return [low, margin];
        }
    }
    [f64::INFINITY, margin]
}

#[test]
fn spheres_disks_and_cylinders_are_hit_alike_on_all_instruction_sets() {
    let shapes: Vec<_> = quadrics().into_iter().filter(|shape| !matches!(shape, Geometry::Triangles(_))).collect();
    let reference = Scene::new(&device(), shapes.clone()).unwrap();
    let rays = random_rays(&reference, &mut Random(10), 100_000);
    let (mut expected, mut hits) = (Hits::default(), Hits::default());
    reference.closest(Width::W1, &rays, &mut expected);
    for isa in ["isa=sse2", "isa=sse4.2", "isa=avx", "isa=avx2"] {
        let scene = Scene::new(&Device::new(isa).unwrap(), shapes.clone()).unwrap();
        scene.closest(Width::W8, &rays, &mut hits);
        assert!(hits == expected, "{isa}");
    }
}

#[test]
fn shapes_keep_their_place_and_the_box_holds_them_all() {
    let sphere = |x: f32| Geometry::Sphere { center: Vec3::new(x, 0.0, 0.0), radius: 0.25 };
    let triangle = Mesh::new(
        vec![Vec3::new(1.0, -1.0, -1.0), Vec3::new(1.0, 2.0, -1.0), Vec3::new(1.0, -1.0, 2.0)],
        vec![[0, 1, 2]],
    );
    let disk = Geometry::Disk { center: 2.0 * Vec3::X, normal: Vec3::X, radius: 0.5 };
    let shapes = vec![sphere(0.0), Geometry::Triangles(Arc::new(triangle)), disk, sphere(3.0)];
    let scene = Scene::new(&device(), shapes).unwrap();
    for (x, place) in [(-1.0, 0), (0.5, 1), (1.5, 2), (2.5, 3)] {
        let hit = scene.closest_one(Vec3::new(x, 0.0, 0.0), Vec3::X, f32::INFINITY);
        assert_eq!(hit.map(|hit| hit.geometry), Some(place));
    }
    let (lower, upper) = scene.bounds().unwrap();
    assert!(lower.abs_diff_eq(Vec3::new(-0.25, -1.0, -1.0), 1e-4), "{lower}");
    assert!(upper.abs_diff_eq(Vec3::new(3.25, 2.0, 2.0), 1e-4), "{upper}");
}

#[test]
fn an_instance_is_hit_where_the_transformed_shapes_are() {
    let device = device();
    let mut random = Random(15);
    let group = Arc::new(Scene::new(&device, meshes("lattice")).unwrap());
    for _ in 0..8 {
        let to_world = random_transform(&mut random);
        let instance = Geometry::Instance { of: group.clone(), to_world };
        let placed = Scene::new(&device, vec![Geometry::Sphere { center: Vec3::splat(1e6), radius: 1.0 }, instance]);
        let flat = Scene::new(&device, meshes("lattice").iter().map(|g| transformed(g, to_world)).collect()).unwrap();
        let (placed, mut hits, mut expected) = (placed.unwrap(), Hits::default(), Hits::default());
        let rays = random_rays(&flat, &mut random, 20_000);
        placed.closest(Width::W8, &rays, &mut hits);
        flat.closest(Width::W8, &rays, &mut expected);
        let mut differ = 0;
        for i in 0..rays.len() {
            match (hits.get(i), expected.get(i)) {
                (Some(hit), Some(expected))
                    if (hit.geometry, hit.primitive) == (expected.geometry, expected.primitive) =>
                {
                    assert_eq!((hit.instance, expected.instance), (1, MISS));
                    let near = (hit.t - expected.t).abs() <= 1e-3 * expected.t.max(0.01);
                    let same_place = (hit.u - expected.u).abs().max((hit.v - expected.v).abs()) < 1e-2;
                    assert!(near && same_place, "ray {i}: {hit:?}, expected {expected:?}");
                }
                (None, None) => {}
                // where two surfaces or triangles meet either may be hit
                (Some(hit), Some(expected)) if (hit.t - expected.t).abs() <= 1e-3 * expected.t.max(0.01) => {}
                _ => differ += 1, // past an edge
            }
        }
        assert!(differ < 40, "{differ} of 20000 rays hit something elsewhere, {to_world:?}");
    }
}

#[test]
fn hits_in_groups_name_the_instance_and_the_shape_in_the_group() {
    let device = device();
    let sphere = |x: f32| Geometry::Sphere { center: Vec3::new(x, 0.0, 0.0), radius: 0.25 };
    let group = Arc::new(Scene::new(&device, vec![sphere(0.0), sphere(1.0)]).unwrap());
    let at = |x: f32| Geometry::Instance { of: group.clone(), to_world: Affine3A::from_translation(x * Vec3::X) };
    let scene = Scene::new(&device, vec![at(10.0), sphere(0.0), at(20.0)]).unwrap();
    drop(group);
    let mut rays = Rays::default();
    for x in [-1.0, 0.5, 10.5, 15.0, 20.5, 22.0] {
        rays.push(Vec3::new(x, 0.0, 0.0), Vec3::X, f32::INFINITY);
    }
    for width in Width::ALL {
        let mut hits = Hits::default();
        scene.closest(width, &rays, &mut hits);
        let found: Vec<_> = (0..rays.len()).map(|i| hits.get(i).map(|hit| (hit.instance, hit.geometry))).collect();
        let expected = [Some((MISS, 1)), Some((0, 0)), Some((0, 1)), Some((2, 0)), Some((2, 1)), None];
        assert_eq!(found, expected, "width {width}");
        let one = |i: usize| scene.closest_one(rays.origin(i), rays.direction(i), f32::INFINITY);
        assert!((0..rays.len()).all(|i| one(i) == hits.get(i)), "width {width}");
    }
    let (lower, upper) = scene.bounds().unwrap();
    assert!(lower.abs_diff_eq(Vec3::splat(-0.25), 1e-4) && upper.abs_diff_eq(Vec3::new(21.25, 0.25, 0.25), 1e-4));
}

#[test]
fn a_build_tells_how_far_it_is() {
    let told = std::sync::Mutex::new(Vec::new());
    let watch = |part: f64| told.lock().unwrap().push(part);
    let scene = Scene::watched(&device(), meshes("caustic"), &watch).unwrap();
    let told = told.into_inner().unwrap();
    assert!(!told.is_empty() && told.iter().all(|part| (0.0..=1.0).contains(part)), "{told:?}");
    assert!(scene.closest_one(Vec3::ZERO, Vec3::X, f32::INFINITY).is_some());
}

#[test]
fn scenes_and_meshes_may_be_empty() {
    let nothing = Scene::new(&device(), Vec::new()).unwrap();
    assert_eq!(nothing.bounds(), None);
    assert_eq!(nothing.closest_one(Vec3::ZERO, Vec3::X, f32::INFINITY), None);
    assert!(!nothing.occluded_one(Vec3::ZERO, Vec3::X, f32::INFINITY));

    let empty = Geometry::Triangles(Arc::new(Mesh::new(Vec::new(), Vec::new())));
    let beside = Scene::new(&device(), vec![empty, Geometry::Sphere { center: Vec3::ZERO, radius: 1.0 }]).unwrap();
    let hit = beside.closest_one(-2.0 * Vec3::X, Vec3::X, f32::INFINITY).unwrap();
    assert_eq!((hit.geometry, hit.primitive, hit.t), (1, 0, 1.0));
}

#[test]
fn a_scene_outlives_its_device_and_serves_many_threads() {
    let scene = Scene::new(&Device::new("").unwrap(), meshes("lattice")).unwrap();
    let rays = random_rays(&scene, &mut Random(11), 10_000);
    let mut expected = Hits::default();
    scene.closest(Width::W8, &rays, &mut expected);
    std::thread::scope(|threads| {
        for width in Width::ALL {
            let (scene, rays, expected) = (&scene, &rays, &expected);
            threads.spawn(move || {
                let mut hits = Hits::default();
                scene.closest(width, rays, &mut hits);
                assert!(hits == *expected, "width {width}");
            });
        }
    });
}

#[test]
fn building_twice_gives_the_same_hits_on_edges() {
    let scenes = [0, 1].map(|_| Scene::new(&Device::new("").unwrap(), meshes("caustic")).unwrap());
    let rays = edge_rays(&scenes[0], &mut Random(12), 100_000);
    let hits = scenes.map(|scene| {
        let mut hits = Hits::default();
        scene.closest(Width::W8, &rays, &mut hits);
        hits
    });
    assert!(hits[0] == hits[1]);
}

/// Each number of threads in a process of its own: devices of one process share their threads.
#[test]
fn hits_do_not_depend_on_the_number_of_threads_that_build() {
    let child = |threads: usize| {
        let mut command = Command::new(std::env::current_exe().unwrap());
        command.args(["--exact", "child_builds_and_traces", "--ignored", "--nocapture"]);
        let output = command.env("RELT_BUILD_THREADS", threads.to_string()).output().unwrap();
        let said = String::from_utf8_lossy(&output.stdout).into_owned();
        said.lines().filter(|line| line.starts_with("hits: ")).map(str::to_owned).collect::<Vec<_>>()
    };
    let expected = child(1);
    assert_eq!(expected.len(), 18, "six scenes, three kinds of rays");
    for threads in [2, 3, 8, 2] {
        assert_eq!(child(threads), expected, "built on {threads} threads");
    }
}

#[test]
#[ignore = "the child of the test above"]
fn child_builds_and_traces() {
    let threads = std::env::var("RELT_BUILD_THREADS").unwrap().parse().unwrap();
    let device = Device::on_threads(threads, "").unwrap();
    let (mut hits, mut occluded) = (Hits::default(), Vec::new());
    for name in SCENES.into_iter().chain(["quadrics", "instances", "layers"]) {
        let scene = Scene::new(&device, geometries(&device, name)).unwrap();
        for (kind, make) in RAY_KINDS {
            let rays = make(&scene, &mut Random(16), 100_000);
            scene.closest(Width::W8, &rays, &mut hits);
            scene.occluded(Width::W8, &rays, &mut occluded);
            let bits = |values: &[f32]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
            let mut hasher = DefaultHasher::new();
            (&hits.geometry, &hits.primitive, &hits.instance, &occluded).hash(&mut hasher);
            (bits(&hits.t), bits(&hits.u), bits(&hits.v)).hash(&mut hasher);
            println!("\nhits: {name} {kind} {:x}", hasher.finish());
        }
    }
}

#[test]
fn building_and_tracing_leave_arithmetic_on_denormal_numbers_alone() {
    let scene = Scene::new(&device(), meshes("cornell-box")).unwrap();
    scene.closest_one(Vec3::ZERO, Vec3::X, f32::INFINITY);
    let smallest = std::hint::black_box(f32::MIN_POSITIVE);
    assert!(smallest * 0.5 > 0.0, "Embree left the processor flushing denormal numbers to zero");
}

#[test]
fn warm_buffers_are_used_again() {
    let scene = Scene::new(&device(), meshes("cornell-box")).unwrap();
    let rays = random_rays(&scene, &mut Random(13), 100);
    let (mut hits, mut occluded) = (Hits::default(), Vec::new());
    scene.closest(Width::W8, &rays, &mut hits);
    scene.occluded(Width::W8, &rays, &mut occluded);
    let places = |hits: &Hits, occluded: &Vec<bool>| (hits.t.as_ptr(), hits.geometry.as_ptr(), occluded.as_ptr());
    let before = places(&hits, &occluded);
    for n in [50, 0, 100] {
        let mut fewer = rays.clone();
        fewer.truncate(n);
        scene.closest(Width::W8, &fewer, &mut hits);
        scene.occluded(Width::W8, &fewer, &mut occluded);
    }
    assert_eq!(places(&hits, &occluded), before);
}

#[test]
fn an_unknown_instruction_set_is_an_error_or_ignored_but_no_crash() {
    if let Err(error) = Device::new("isa=abacus") {
        assert!(error.to_string().contains("isa=abacus"), "{error}");
    }
}

#[test]
fn a_width_is_written_as_its_number_of_lanes() {
    for width in Width::ALL {
        assert_eq!(width.lanes().to_string().parse(), Ok(width));
    }
    assert_eq!("2".parse::<Width>(), Err("unknown packet width \"2\"; known: 1, 4, 8, 16".to_owned()));
}

/// What a person sees who points `RELT_EMBREE` at the wrong thing, in a process of its own.
#[test]
fn a_wrong_variable_is_named_in_the_message() {
    let child = |value: &str| {
        let mut command = Command::new(std::env::current_exe().unwrap());
        command.args(["--exact", "child_opens_a_device", "--ignored", "--nocapture"]).env("RELT_EMBREE", value);
        String::from_utf8_lossy(&command.output().unwrap().stdout).into_owned()
    };
    let said = child("/nowhere/at/all");
    assert!(said.contains("RELT_EMBREE=/nowhere/at/all: there is no such file or folder"), "{said}");
    let said = child(env!("CARGO_MANIFEST_DIR"));
    assert!(said.contains("the folder holds no libembree4"), "{said}");
    let said = child(concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml"));
    assert!(said.contains("it cannot be loaded"), "{said}");
}

#[test]
#[ignore = "the child of the test above, and a way to see which library is found"]
fn child_opens_a_device() {
    match Device::new("") {
        Ok(device) => println!("{}", device.description()),
        Err(error) => println!("{error}"),
    }
}

fn device() -> Device {
    Device::new("").unwrap_or_else(|error| panic!("{error}"))
}

fn geometries(device: &Device, name: &str) -> Vec<Geometry> {
    match name {
        "quadrics" => quadrics(),
        "instances" => instances(device),
        "layers" => layers(),
        _ => meshes(name),
    }
}

type MakeRays = fn(&Scene, &mut Random, usize) -> Rays;
const RAY_KINDS: [(&str, MakeRays); 3] = [("random", random_rays), ("bounce", bounce_rays), ("edges", edge_rays)];

/// From anywhere in the scene's box to anywhere.
fn random_rays(scene: &Scene, random: &mut Random, n: usize) -> Rays {
    let (lower, upper) = scene.bounds().unwrap();
    let mut rays = Rays::with_capacity(n);
    for _ in 0..n {
        let origin = lower + (upper - lower) * random.cube();
        rays.push(origin, random.direction(), f32::INFINITY);
    }
    rays
}

/// From points on the surfaces, as after a diffuse bounce: what a path tracer asks for.
fn bounce_rays(scene: &Scene, random: &mut Random, n: usize) -> Rays {
    let from = random_rays(scene, random, n);
    let mut hits = Hits::default();
    scene.closest(Width::W1, &from, &mut hits);
    let mut rays = Rays::with_capacity(n);
    for i in 0..n {
        let Some(hit) = hits.get(i) else {
            rays.push(from.origin(i), random.direction(), f32::INFINITY);
            continue;
        };
        let point = from.origin(i) + hit.t * from.direction(i);
        let normal = normal_of(scene, hit, point);
        let facing = if normal.dot(from.direction(i)) > 0.0 { -normal } else { normal };
        let direction = (facing + random.direction()).normalize_or(facing);
        rays.push(point + 1e-4 * facing, direction, f32::INFINITY);
    }
    rays
}

/// Aimed at points of edges and at corners, where two or more triangles are hit at nearly the same distance.
fn edge_rays(scene: &Scene, random: &mut Random, n: usize) -> Rays {
    let (lower, upper) = scene.bounds().unwrap();
    let mut rays = Rays::with_capacity(n);
    for _ in 0..n {
        let origin = lower + (upper - lower) * random.cube();
        let geometry = &scene.geometries()[random.below(scene.geometries().len())];
        let target = point_on_edge(geometry, random);
        rays.push(origin, (target - origin).normalize(), f32::INFINITY);
    }
    rays
}

/// On an edge, a corner or a rim.
fn point_on_edge(geometry: &Geometry, random: &mut Random) -> Vec3 {
    match geometry {
        Geometry::Triangles(mesh) => {
            let [a, b, _] = mesh.corners(random.below(mesh.triangles.len()) as u32);
            if random.below(4) == 0 { a } else { a + (b - a) * random.unit() }
        }
        Geometry::Sphere { center, radius } => center + *radius * random.direction(),
        Geometry::Disk { center, normal, radius } => center + *radius * normal.cross(random.direction()).normalize(),
        Geometry::Cylinder { start, end, radius } => {
            let middle = if random.below(2) == 0 { start } else { end };
            middle + *radius * (end - start).cross(random.direction()).normalize()
        }
        Geometry::Instance { of, to_world } => {
            to_world.transform_point3(point_on_edge(&of.geometries()[random.below(of.geometries().len())], random))
        }
    }
}

fn normal_of(scene: &Scene, hit: Hit, point: Vec3) -> Vec3 {
    if hit.instance != MISS {
        let Geometry::Instance { of, to_world } = &scene.geometries()[hit.instance as usize] else { panic!("{hit:?}") };
        let inverse = to_world.inverse();
        let normal = normal_of(of, Hit { instance: MISS, ..hit }, inverse.transform_point3(point));
        return (inverse.matrix3.transpose() * normal).normalize();
    }
    match &scene.geometries()[hit.geometry as usize] {
        Geometry::Triangles(mesh) => {
            let [a, b, c] = mesh.corners(hit.primitive);
            (b - a).cross(c - a).normalize()
        }
        Geometry::Sphere { center, .. } => (point - center).normalize(),
        Geometry::Disk { normal, .. } => normal.normalize(),
        Geometry::Cylinder { start, end, .. } => (point - start).reject_from(end - start).normalize(),
        Geometry::Instance { .. } => panic!("{hit:?} names no instance"),
    }
}

/// The meshes of one of our scenes, in the order of their names.
fn meshes(scene: &str) -> Vec<Geometry> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(scene).join("meshes");
    let mut files: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files.iter().map(|file| Geometry::Triangles(Arc::new(load(file)))).collect()
}

fn load(file: &Path) -> Mesh {
    let (models, _) = tobj::load_obj(file, &tobj::GPU_LOAD_OPTIONS).unwrap();
    let mesh = &models[0].mesh;
    let positions = mesh.positions.as_chunks().0.iter().map(|&p: &[f32; 3]| Vec3::from(p)).collect();
    Mesh::new(positions, mesh.indices.as_chunks().0.to_vec())
}

/// Triangles anywhere in two meshes, each of them eight times and in no order: every ray that hits one hits eight at
/// once, and only the hierarchy says which of them counts.
fn layers() -> Vec<Geometry> {
    const TRIANGLES: usize = 160_000;
    const LAYERS: usize = 8;
    let mut random = Random(17);
    let mut positions = Vec::new();
    for _ in 0..TRIANGLES / LAYERS {
        let center = random.cube();
        positions.extend([0; 3].map(|_| center + 0.05 * random.direction()));
    }
    let mut triangles: Vec<_> = (0..TRIANGLES as u32)
        .map(|i| 3 * (i % (TRIANGLES / LAYERS) as u32))
        .map(|first| [first, first + 1, first + 2])
        .collect();
    for i in (1..TRIANGLES).rev() {
        triangles.swap(i, random.below(i + 1));
    }
    let mesh = |triangles: &[_]| Geometry::Triangles(Arc::new(Mesh::new(positions.clone(), triangles.to_vec())));
    triangles.chunks(TRIANGLES / 2).map(mesh).collect()
}

/// Spheres, disks and cylinders of all sizes, some within others, in a box of triangles.
fn quadrics() -> Vec<Geometry> {
    let mut random = Random(7);
    let mut geometries = meshes("cornell-box");
    for i in 0..60 {
        let (center, radius) = (2.0 * random.cube() - 1.0, 0.02 + 0.3 * random.unit());
        let along = random.direction() * (0.1 + random.unit());
        geometries.push(match i % 3 {
            0 => Geometry::Sphere { center, radius },
            1 => Geometry::Disk { center, normal: along, radius },
            _ => Geometry::Cylinder { start: center, end: center + along, radius },
        });
    }
    geometries
}

/// Many places of meshes and of quadrics, turned, stretched, sheared and mirrored, in a box of triangles.
fn instances(device: &Device) -> Vec<Geometry> {
    let mut random = Random(16);
    let quadrics = quadrics().into_iter().filter(|shape| !matches!(shape, Geometry::Triangles(_))).collect();
    let groups = [meshes("lattice"), quadrics].map(|shapes| Arc::new(Scene::new(device, shapes).unwrap()));
    let mut geometries = meshes("cornell-box");
    for i in 0..24 {
        let mut to_world = random_transform(&mut random);
        to_world.matrix3 *= 0.3;
        geometries.push(Geometry::Instance { of: groups[i % 2].clone(), to_world });
    }
    geometries
}

/// Anything but singular.
fn random_transform(random: &mut Random) -> Affine3A {
    loop {
        let columns = [0; 3].map(|_| 2.0 * random.cube() - 1.0).map(Into::into);
        let matrix3 = Mat3A::from_cols(columns[0], columns[1], columns[2]);
        if matrix3.determinant().abs() > 0.1 {
            return Affine3A { matrix3, translation: (2.0 * random.cube() - 1.0).into() };
        }
    }
}

/// A mesh elsewhere.
fn transformed(geometry: &Geometry, to_world: Affine3A) -> Geometry {
    let Geometry::Triangles(mesh) = geometry else { panic!("only triangles") };
    let positions = mesh.positions().iter().map(|p| to_world.transform_point3(*p)).collect();
    Geometry::Triangles(Arc::new(Mesh::new(positions, mesh.triangles.clone())))
}

/// SplitMix64 (Steele, Lea and Flood, 2014).
struct Random(u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// In [0, 1).
    fn unit(&mut self) -> f32 {
        (self.bits() >> 40) as f32 * (-24f32).exp2()
    }

    fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }

    fn cube(&mut self) -> Vec3 {
        Vec3::new(self.unit(), self.unit(), self.unit())
    }

    /// Uniform on the sphere.
    fn direction(&mut self) -> Vec3 {
        let (z, phi) = (1.0 - 2.0 * self.unit(), std::f32::consts::TAU * self.unit());
        let r = (1.0 - z * z).max(0.0).sqrt();
        Vec3::new(r * phi.cos(), r * phi.sin(), z)
    }
}
