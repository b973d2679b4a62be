//! Choosing packet widths by trying them.

use std::time::{Duration, Instant};

use crate::{
    chain::Evaluator,
    embree::{Hits, Rays, Width},
    path::{Mapping, MappingKind, RecordedRays, Widths, Workspace},
    rng::{Counter, Purpose, Rng},
    sample::{Move, Points},
    scene::Scene,
};

/// Lanes of the trial batch, and paths whose rays it records; those of a block.
pub const LANES: u64 = 256;
/// Batches of rays that are tried.
const BATCHES: u64 = 8;
/// Each width's time is the least of this many repetitions.
const REPETITIONS: usize = 3;

/// The rays that a mapping makes of `batches` batches of uniform points.
pub fn record_rays(scene: &Scene, kind: MappingKind, batches: u64) -> RecordedRays {
    let widths = Widths { camera: Width::W8, bounce: Width::W8, shadow: Width::W8 };
    let mapping = Mapping::new(scene, kind, widths);
    let counters = (0..LANES)
        .map(|lane| Counter { ladder: lane as u32, replica: 0, step: 0, purpose: Purpose::Primary })
        .collect();
    let mut evaluator = Evaluator::with_workspace(Rng::new(0), counters, Workspace::recording());
    evaluator.moves.fill(Move::Fresh);
    let nowhere = Points::new(0);
    for batch in 0..batches {
        evaluator.counters.iter_mut().for_each(|c| c.step = batch);
        evaluator.evaluate(&mapping, &nowhere);
    }
    evaluator.workspace().take_recorded()
}

/// The fastest width for each kind of ray that a mapping of that scene has, from a few thousand rays. Hits do not depend on it, so
/// neither does the image.
pub fn calibrate(scene: &Scene, kind: MappingKind) -> Widths {
    fastest_for(scene, &record_rays(scene, kind, BATCHES))
}

/// The fastest width for each kind of these rays.
pub fn fastest_for(scene: &Scene, rays: &RecordedRays) -> Widths {
    let mut hits = Hits::default();
    let mut occluded = Vec::new();
    let mut closest = |batches: &[Rays]| {
        fastest(|width| batches.iter().for_each(|rays| scene.tracer.closest(width, rays, &mut hits)))
    };
    let (camera, bounce) = (closest(&rays.camera), closest(&rays.bounce));
    let shadow = fastest(|width| rays.shadow.iter().for_each(|r| scene.tracer.occluded(width, r, &mut occluded)));
    Widths { camera, bounce, shadow }
}

fn fastest(mut trace: impl FnMut(Width)) -> Width {
    let mut best = (Duration::MAX, Width::W1);
    for width in Width::ALL {
        for _ in 0..REPETITIONS {
            let start = Instant::now();
            trace(width);
            best = std::cmp::min_by_key(best, (start.elapsed(), width), |(time, _)| *time);
        }
    }
    best.1
}
