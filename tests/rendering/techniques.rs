//! The techniques of making a path against one another: the mean of the uniform points' contributions over parts of the
//! film is the same by every mapping.

use relt::chain::Evaluator;
use relt::embree::Width;
use relt::path::{Mapping, MappingKind, Workspace, luminance};
use relt::rng::{Counter, Purpose, Rng};
use relt::sample::{Move, Points};
use relt::scene::Scene;

use crate::support::{fixed_widths, load, own, repository};

/// Parts of the film a side.
const PARTS: usize = 4;
/// Points that are evaluated together.
const LANES: usize = 256;

/// Mean luminance over each part of the film, and the variance of that mean, from independent uniform points.
fn means(scene: &Scene, kind: MappingKind, batches: u64, seed: u64) -> Vec<[f64; 2]> {
    let mapping = Mapping::new(scene, kind, fixed_widths(Width::W8));
    let counter = |lane| Counter { ladder: lane as u32, replica: 0, step: 0, purpose: Purpose::Primary };
    let mut evaluator = Evaluator::<Workspace>::new(Rng::new(seed), (0..LANES).map(counter).collect());
    evaluator.moves.fill(Move::Fresh);
    let part = |[x, y]: [f32; 2]| {
        let [x, y] = [x, y].map(|v| ((v * PARTS as f32) as usize).min(PARTS - 1));
        y * PARTS + x
    };
    let mut sums = vec![[0.0; 2]; PARTS * PARTS];
    for step in 0..batches {
        evaluator.counters.iter_mut().for_each(|c| c.step = step);
        evaluator.evaluate(&mapping, &Points::new(0));
        for lane in 0..LANES {
            let whole = evaluator.out.whole(lane);
            let mut of_part = [0.0; PARTS * PARTS];
            of_part[part(whole.main.film)] += f64::from(luminance(whole.main.rgb));
            for splat in whole.elsewhere {
                of_part[part(splat.film)] += f64::from(luminance(splat.rgb));
            }
            for (sum, value) in sums.iter_mut().zip(of_part) {
                *sum = [sum[0] + value, sum[1] + value * value];
            }
        }
    }
    let n = (batches * LANES as u64) as f64;
    sums.into_iter().map(|[sum, squares]| [sum / n, (squares / n - (sum / n).powi(2)) / n]).collect()
}

#[test]
fn scratch() {
    let names = std::env::var("SCENES").unwrap_or("cornell-box caustic lattice".into());
    for name in names.split_whitespace() {
        let scene = match name {
            "cornell-box" | "caustic" | "lattice" => own(name, &[("res", "64")]),
            _ => load(&repository("tests/mitsuba").join(name).with_extension("xml"), &[]),
        };
        let batches = std::env::var("BATCHES").map_or(1000, |b| b.parse().unwrap());
        let base = means(&scene, MappingKind::Unidirectional, batches, 1);
        println!("{name}: {}", scene.features.in_words().join(", "));
        for kind in MappingKind::ALL.into_iter().skip(1) {
            let start = std::time::Instant::now();
            let other = means(&scene, kind, batches, 2);
            let z: Vec<f64> =
                base.iter().zip(&other).map(|(a, b)| (b[0] - a[0]) / (a[1] + b[1]).sqrt().max(1e-30)).collect();
            let total = |m: &[[f64; 2]]| m.iter().map(|m| m[0]).sum::<f64>();
            let sd = |m: &[[f64; 2]]| m.iter().map(|m| m[1]).sum::<f64>().sqrt();
            println!(
                "  {:14} total {:.5} ± {:.5} for {:.5} ± {:.5}; {:.2} s; z {:?}",
                kind.name(),
                total(&other),
                sd(&other),
                total(&base),
                sd(&base),
                start.elapsed().as_secs_f64(),
                z.iter().map(|z| (z * 10.0).round() / 10.0).collect::<Vec<_>>()
            );
        }
    }
}
