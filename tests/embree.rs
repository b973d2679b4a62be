//! Does Embree, behind our wall, do what the renderer relies on?

use glam::{DVec3, Vec3};
use relt::embree::{Device, Geometry, Hit, Hits, MISS, Rays, Scene, Width};
use relt::scene::Mesh;
use std::path::Path;
use std::sync::Arc;

const SCENES: [&str; 3] = ["cornell-box", "caustic", "lattice"];

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
            let primitive = hits.geometry[i] == single.geometry[i] && hits.primitive[i] == single.primitive[i];
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
#[ignore = "a minute a scene: a table of how hits depend on width and instruction set"]
fn widths_over_tens_of_millions_of_rays() {
    let batches: usize = std::env::var("BATCHES").ok().and_then(|n| n.parse().ok()).unwrap_or(160);
    for isa in ["", "isa=avx2", "isa=avx", "isa=sse4.2"] {
        let device = Device::new(isa).unwrap();
        println!("{} {isa} native {:?}", device.description(), device.native_widths());
        for name in SCENES.into_iter().chain(["quadrics"]) {
            let geometries = if name == "quadrics" { quadrics() } else { meshes(name) };
            let scene = Scene::new(&device, geometries).unwrap();
            for (kind, make) in RAY_KINDS {
                let mut random = Random(1);
                let mut differences: [Differences; 4] = Default::default();
                for _ in 0..batches {
                    compare_widths(&scene, &make(&scene, &mut random, 1 << 16), &mut differences);
                }
                for (width, d) in Width::ALL.into_iter().zip(&differences) {
                    println!(
                        "{name:12} {kind:8} width {width:>2}: {} rays, {} hits, differ: primitive {}, u v {}, t {}, occluded {}  {}",
                        d.rays, d.hits, d.primitive, d.u_v, d.t, d.occluded, d.first
                    );
                }
            }
        }
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
        let normal = normal_of(&scene.geometries()[hit.geometry as usize], hit.primitive, point);
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
        let target = match geometry {
            Geometry::Triangles(mesh) => {
                let [a, b, _] = mesh.corners(random.below(mesh.triangles.len()) as u32);
                if random.below(4) == 0 { a } else { a + (b - a) * random.unit() }
            }
            Geometry::Sphere { center, radius } => center + *radius * random.direction(),
            Geometry::Disk { center, normal, radius } => {
                center + *radius * normal.cross(random.direction()).normalize()
            }
        };
        rays.push(origin, (target - origin).normalize(), f32::INFINITY);
    }
    rays
}

fn normal_of(geometry: &Geometry, primitive: u32, point: Vec3) -> Vec3 {
    match geometry {
        Geometry::Triangles(mesh) => {
            let [a, b, c] = mesh.corners(primitive);
            (b - a).cross(c - a).normalize()
        }
        Geometry::Sphere { center, .. } => (point - center).normalize(),
        Geometry::Disk { normal, .. } => normal.normalize(),
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

/// Spheres and disks of all sizes, some within others, in a box of triangles.
fn quadrics() -> Vec<Geometry> {
    let mut random = Random(7);
    let mut geometries = meshes("cornell-box");
    for i in 0..40 {
        let (center, radius) = (2.0 * random.cube() - 1.0, 0.02 + 0.3 * random.unit());
        geometries.push(if i % 2 == 0 {
            Geometry::Sphere { center, radius }
        } else {
            Geometry::Disk { center, normal: random.direction() * (0.1 + random.unit()), radius }
        });
    }
    geometries
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
