//! Bare Embree tracing: rays a second for each kind of ray and packet width, on one thread. What widths make of whole
//! mutations is in `mutations.rs`.
//!
//! The rays are those of uniform points of the cube, as a path tracer's. `quadrics` is the Cornell box with 40 spheres
//! and disks in it.

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, SamplingMode, Throughput, criterion_group, criterion_main};
use relt::embree::{Hits, Rays, Width};
use relt::path::MappingKind;
use relt::render::calibration::record_rays;

mod support;

/// Batches of paths whose rays are traced in one measurement: some ten thousand rays. Millisecond samples let the
/// fastest ones tell the speed even on a busy machine.
const BATCHES: u64 = 16;

fn tracing(criterion: &mut Criterion) {
    let plain = support::SCENES.map(|name| (name, support::describe(name)));
    for (name, description) in plain.into_iter().chain([("quadrics", support::quadrics())]) {
        let scene = support::build(description);
        let rays = record_rays(&scene, MappingKind::Unidirectional, BATCHES);
        let mut hits = Hits::default();
        for (kind, batches) in [("camera", &rays.camera), ("bounce", &rays.bounce)] {
            all_widths(criterion, &format!("tracing/packets/{name}/{kind}"), batches, |width, rays| {
                scene.tracer.closest(width, rays, &mut hits);
                black_box(&hits);
            });
        }
        let mut occluded = Vec::new();
        all_widths(criterion, &format!("tracing/packets/{name}/shadow"), &rays.shadow, |width, rays| {
            scene.tracer.occluded(width, rays, &mut occluded);
            black_box(&occluded);
        });
    }
}

fn all_widths(criterion: &mut Criterion, name: &str, batches: &[Rays], mut trace: impl FnMut(Width, &Rays)) {
    let rays: usize = batches.iter().map(Rays::len).sum();
    let mut group = criterion.benchmark_group(name);
    group.sampling_mode(SamplingMode::Flat).throughput(Throughput::Elements(rays as u64));
    group
        .sample_size(20)
        .nresamples(support::RESAMPLES)
        .warm_up_time(support::WARM_UP)
        .measurement_time(support::MEASUREMENT);
    for width in Width::ALL {
        group.bench_function(BenchmarkId::from_parameter(width), |bencher| {
            bencher.iter(|| batches.iter().for_each(|rays| trace(width, rays)));
        });
    }
    group.finish();
}

criterion_group!(benches, tracing);
criterion_main!(benches);
