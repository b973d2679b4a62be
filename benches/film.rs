//! What a splat costs, spreading it over pixels and depositing it, and what combining two images costs.

use std::hint::black_box;
use std::time::Duration;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use relt::film::{Accumulator, Filter, Footprint, Heuristic, Image, Splat, Splats};

/// Time before and while a benchmark is measured: enough for nanoseconds.
const WARM_UP: Duration = Duration::from_millis(200);
const MEASUREMENT: Duration = Duration::from_millis(800);
/// Few enough for plots to be drawn in a moment (`benches/support`).
const RESAMPLES: usize = 10_000;

/// Splats a worker brings at a time.
const BATCH: usize = 4096;

/// Batches before the first comes again: together they reach far more pixels than a core's cache holds.
const BATCHES: usize = 64;

fn deposit(c: &mut Criterion) {
    let mut group = c.benchmark_group("film/deposit");
    group.warm_up_time(WARM_UP).measurement_time(MEASUREMENT).nresamples(RESAMPLES);
    group.throughput(Throughput::Elements(BATCH as u64));
    for size in [256, 1024] {
        let film = Accumulator::new(size, size, 1, 20.0);
        let splats: Vec<Splat> = (0..(BATCH * BATCHES) as u32)
            .map(|i| {
                let hash = i.wrapping_mul(0x9E37_79B9).rotate_left(13).wrapping_mul(0x85EB_CA6B);
                let value = 2f32.powi((hash >> 29) as i32 - 4) * 1.3;
                Splat { pixel: hash % (size * size), rgb: [value, value * 0.7, value * 0.1], weight: 0.3 }
            })
            .collect();
        let mut batches = splats.chunks(BATCH).cycle();
        let mut waiting = Splats::new(1);
        group.bench_function(BenchmarkId::from_parameter(format!("{size}²")), |b| {
            b.iter(|| {
                for splat in batches.next().expect("it goes round and round") {
                    waiting.push(0, *splat);
                }
                film.deposit(&mut waiting);
            });
        });
    }
}

fn spread(c: &mut Criterion) {
    let mut group = c.benchmark_group("film/spread");
    group.warm_up_time(WARM_UP).measurement_time(MEASUREMENT).nresamples(RESAMPLES);
    group.throughput(Throughput::Elements(1));
    let lanczos = Filter::Lanczos { lobes: 3 };
    for filter in [Filter::Box, Filter::Tent { radius: 1.0 }, Filter::Gaussian { stddev: 0.5 }, lanczos] {
        let footprint = Footprint::new(filter, 256, 256);
        group.bench_function(BenchmarkId::from_parameter(format!("{filter:?}")), |b| {
            let mut x = 0.1;
            b.iter(|| {
                x = (x * 1.37 + 3.1) % 255.0;
                let mut sum = 0.0;
                footprint.spread(black_box(x), black_box(255.0 - x), &mut |pixel, weight| sum += pixel as f32 * weight);
                sum
            });
        });
    }
}

/// The paper's heuristics on images of 512 × 512 pixels; throughput in pixels.
fn combine(c: &mut Criterion) {
    let mut group = c.benchmark_group("film/combine");
    group.warm_up_time(WARM_UP).measurement_time(MEASUREMENT).nresamples(RESAMPLES).sample_size(10);
    const SIZE: u32 = 512;
    group.throughput(Throughput::Elements(u64::from(SIZE * SIZE)));
    let [uniform, target] = [1, 2].map(|image: u32| {
        let value = |i: u32| (i.wrapping_mul(0x9E37_79B9).wrapping_mul(image) >> 8) as f32;
        Image::new(SIZE, SIZE, (0..SIZE * SIZE).map(|i| [3 * i, 3 * i + 1, 3 * i + 2].map(value)).collect())
    });
    for heuristic in Heuristic::ALL {
        group.bench_function(heuristic.name(), |b| b.iter(|| heuristic.combine(black_box(&uniform), &target)));
    }
}

criterion_group!(benches, deposit, spread, combine);
criterion_main!(benches);
