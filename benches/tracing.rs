//! Bare Embree tracing: rays a second for each packet width, on one thread.
//!
//! Rays leave diffuse surfaces, as a path tracer's do after a bounce; shadow rays go from there to points on a lamp.
//! `quadrics` is a box with 40 spheres and disks.

use criterion::{BenchmarkId, Criterion, SamplingMode, Throughput, criterion_group, criterion_main};
use glam::Vec3;
use relt::embree::{Device, Geometry, Hits, Rays, Scene, Width};
use relt::scene::Mesh;
use std::path::Path;
use std::sync::Arc;

/// Rays of one measurement, about as many as a batch of chains has; rays and hits take 0.8 MB. Millisecond samples let
/// the fastest ones tell the speed even on a busy machine.
const RAYS: usize = 1 << 14;

fn tracing(criterion: &mut Criterion) {
    let device = Device::new(&std::env::var("ISA").unwrap_or_default()).unwrap_or_else(|error| panic!("{error}"));
    println!("{}, native widths {:?}", device.description(), device.native_widths());
    for (name, lamp) in [("cornell-box", "light"), ("caustic", "lamp"), ("lattice", "lamp"), ("quadrics", "light")] {
        let folder = if name == "quadrics" { "cornell-box" } else { name };
        let mut geometries = meshes(folder);
        if name == "quadrics" {
            geometries.extend(quadrics(&mut Random(7)));
        }
        let scene = Scene::new(&device, geometries).unwrap();
        let (bounce, shadow) = rays(&scene, &mesh(folder, lamp));

        let mut group = criterion.benchmark_group(format!("{name}/closest"));
        group.sampling_mode(SamplingMode::Flat).throughput(Throughput::Elements(RAYS as u64));
        let mut hits = Hits::default();
        for width in Width::ALL {
            group.bench_function(BenchmarkId::from_parameter(width), |bencher| {
                bencher.iter(|| scene.closest(width, &bounce, &mut hits));
            });
        }
        group.finish();

        let mut group = criterion.benchmark_group(format!("{name}/shadow"));
        group.sampling_mode(SamplingMode::Flat).throughput(Throughput::Elements(RAYS as u64));
        let mut occluded = Vec::new();
        for width in Width::ALL {
            group.bench_function(BenchmarkId::from_parameter(width), |bencher| {
                bencher.iter(|| scene.occluded(width, &shadow, &mut occluded));
            });
        }
        group.finish();
    }
}

/// Bounced rays, and shadow rays from the same points.
fn rays(scene: &Scene, lamp: &Mesh) -> (Rays, Rays) {
    let mut random = Random(1);
    let (lower, upper) = scene.bounds().unwrap();
    let (mut bounce, mut shadow) = (Rays::with_capacity(RAYS), Rays::with_capacity(RAYS));
    while bounce.len() < RAYS {
        let origin = lower + (upper - lower) * random.cube();
        let direction = random.direction();
        let Some(hit) = scene.closest_one(origin, direction, f32::INFINITY) else { continue };
        let point = origin + hit.t * direction;
        let normal = match &scene.geometries()[hit.geometry as usize] {
            Geometry::Triangles(mesh) => {
                let [a, b, c] = mesh.corners(hit.primitive);
                (b - a).cross(c - a).normalize()
            }
            Geometry::Sphere { center, .. } => (point - center).normalize(),
            Geometry::Disk { normal, .. } => normal.normalize(),
        };
        let normal = if normal.dot(direction) > 0.0 { -normal } else { normal };
        let start = point + 1e-4 * normal;
        bounce.push(start, (normal + random.direction()).normalize_or(normal), f32::INFINITY);

        let [a, b, c] = lamp.corners((random.unit() * lamp.triangles.len() as f32) as u32);
        let (s, t) = (random.unit().sqrt(), random.unit());
        shadow.push(start, a + s * (1.0 - t) * (b - a) + s * t * (c - a) - start, 0.999);
    }
    (bounce, shadow)
}

fn meshes(scene: &str) -> Vec<Geometry> {
    let mut files: Vec<_> = std::fs::read_dir(folder(scene)).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files.iter().map(|file| Geometry::Triangles(Arc::new(load(file)))).collect()
}

fn mesh(scene: &str, name: &str) -> Mesh {
    load(&folder(scene).join(name).with_extension("obj"))
}

fn folder(scene: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(scene).join("meshes")
}

fn load(file: &Path) -> Mesh {
    let (models, _) = tobj::load_obj(file, &tobj::GPU_LOAD_OPTIONS).unwrap();
    let mesh = &models[0].mesh;
    let positions = mesh.positions.as_chunks().0.iter().map(|&p: &[f32; 3]| Vec3::from(p)).collect();
    Mesh::new(positions, mesh.indices.as_chunks().0.to_vec())
}

fn quadrics(random: &mut Random) -> Vec<Geometry> {
    let mut shape = |i| {
        let (center, radius) = (2.0 * random.cube() - 1.0, 0.02 + 0.3 * random.unit());
        match i % 2 {
            0 => Geometry::Sphere { center, radius },
            _ => Geometry::Disk { center, normal: random.direction(), radius },
        }
    };
    (0..40).map(&mut shape).collect()
}

/// SplitMix64 (Steele, Lea and Flood, 2014).
struct Random(u64);

impl Random {
    /// In [0, 1).
    fn unit(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 40) as f32 * (-24f32).exp2()
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

criterion_group!(benches, tracing);
criterion_main!(benches);
