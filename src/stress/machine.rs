//! Threads, instruction sets, denormal numbers.

use super::{
    Bench, Case, Check,
    bench::{Effort, Goal, described, means, render, way},
    check::ROUNDING,
    scenes::{diffuse, glowing, room, series, sphere, view},
};
use crate::embree::Device;
use crate::path::MappingKind;
use crate::render::{FLUSHED, Method, Settings};
use crate::scene::{Scene, SceneDescription};

/// The cases.
pub(super) fn cases() -> Vec<Case> {
    vec![
        Case::new(
            "machine/threads",
            "one thread, two, and eight times as many as the machine runs give the same bits: values that differ",
            threads,
        )
        .quick(),
        Case::new(
            "machine/instruction-sets",
            "Embree confined to SSE2 or AVX2 gives the same image but for noise",
            instruction_sets,
        ),
        Case::new(
            "machine/denormals",
            "a sphere that glows by 10⁻³⁸, below the least normal number, looks like 10⁻³⁸ Σ aⁱ, and threads keep denormal \
             numbers as they trace",
            faint,
        )
        .quick(),
    ]
}

/// A room with a lamp.
fn description() -> SceneDescription {
    described(
        &(view(1.0, [[0.5, 0.3, -0.2], [0.9, 0.1, -0.5]], 80.0, 5)
            + &room([0.0; 3], 1.0, &diffuse(0.7))
            + &sphere([-0.2, 0.3, 0.1], 0.1, false, &(diffuse(0.0) + &glowing(10.0)))),
    )
}

fn threads(bench: &Bench) -> Vec<Check> {
    let scene = bench.scene_of(description());
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let mut checks = Vec::new();
    for way in bench.ways(&scene) {
        let image = |threads: usize| {
            let settings =
                Settings { threads: Some(threads), mutations_per_pixel: Some(128.0), ..way.settings.clone() };
            render(&scene, settings).picture.image
        };
        let one = image(1);
        for threads in [2, 8 * cores] {
            let other = image(threads);
            let pairs = one.pixels.as_flattened().iter().zip(other.pixels.as_flattened());
            let differ = pairs.filter(|(a, b)| a.to_bits() != b.to_bits()).count();
            let name = if threads == 2 { "two" } else { "many" };
            checks.push(Check::none(format!("{name} threads, {}", way.name), differ));
        }
    }
    checks
}

fn instruction_sets(bench: &Bench) -> Vec<Check> {
    let effort = Effort { runs: 16, mutations_per_pixel: 192.0 };
    let as_it_is = bench.scene_of(description());
    let ways = [
        way(Method::Path, MappingKind::Unidirectional),
        way(Method::Mlt, MappingKind::Bidirectional),
        way(Method::ReplicaExchange, MappingKind::Bidirectional),
    ];
    let mut checks = Vec::new();
    for isa in ["sse2", "avx2"] {
        let device = Device::new(&format!("isa={isa}")).unwrap_or_else(|error| panic!("{error}"));
        let scene = Scene::new(&device, description()).unwrap_or_else(|error| panic!("{error}"));
        for way in &ways {
            let [a, b] = [&scene, &as_it_is].map(|scene| means(&bench.runs(scene, way, effort)));
            checks.push(Check::same(format!("mean with {isa} by {}", way.name), &a, &b, ROUNDING, 0.4));
        }
    }
    checks
}

/// Contributions are as small as 10⁻³⁸/8 and known to 2⁻¹⁴⁹, a millionth of that.
fn faint(bench: &Bench) -> Vec<Check> {
    const RADIANCE: f64 = 1e-38;
    const ALBEDO: f64 = 0.5;
    const EDGES: i32 = 4;
    let scene = bench.scene(
        &(view(1.0, [[0.5, 0.3, -0.2], [0.9, 0.1, -0.5]], 80.0, EDGES)
            + &sphere([0.0; 3], 1.0, true, &(diffuse(ALBEDO) + &glowing(RADIANCE)))),
    );
    let goal = Goal::new(RADIANCE * series(ALBEDO, EDGES), 0.6);
    let mut checks = bench.all_ways_give(&scene, goal, Effort { runs: 16, mutations_per_pixel: 192.0 });
    for way in bench.ways(&scene) {
        let outcome = render(&scene, Settings { mutations_per_pixel: Some(1.0), threads: Some(2), ..way.settings });
        let kept = !outcome.warnings.iter().any(|warning| warning == FLUSHED);
        checks.push(Check::holds(format!("denormal numbers are kept by {}", way.name), kept));
    }
    checks
}
