//! Choosing a mapping by trying them.

use rayon::prelude::*;

use crate::{
    chain::Evaluator,
    embree::Width,
    path::{Mapping, MappingKind, Whole, Widths, luminance},
    rng::{Counter, Purpose, Rng},
    sample::{Move, Points},
    scene::{Features, Scene},
};

/// What a trial came to.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    /// The mapping to render with.
    pub chosen: MappingKind,
    /// The squared error of each mapping that was tried, at equal cost, by that of the unidirectional one.
    pub errors: Vec<(MappingKind, f64)>,
}

/// Points of each mapping.
const POINTS: u64 = 1 << 15;
/// Points that are evaluated together.
const LANES: u64 = 256;
/// Tiles of the film a side, at most.
const TILES: u32 = 16;
/// How much less the error of another mapping must be for it to take the unidirectional one's place. Errors of mappings
/// that are alike differ by as much from trial to trial.
const CLEARLY_LESS: f64 = 0.6;
/// What a point costs beside its rays, in rays: random numbers, camera, recording.
const COST_OF_A_POINT: f64 = 3.0;
/// Luminance, by the mean, below which errors count in absolute terms; as in [`Measure`](crate::chain::Measure).
const FLOOR: f64 = 0.5;

/// The mappings that could serve a scene.
fn candidates(features: &Features) -> Vec<MappingKind> {
    let all_is_seen = !features.delta_lobes && features.infinite_lights == 0;
    let serves = |kind: &MappingKind| match kind {
        MappingKind::Light => all_is_seen,
        MappingKind::Multiplexed => false, // one technique a point: never less noise than all, and seldom less error
        _ => true,
    };
    MappingKind::ALL.into_iter().filter(serves).collect()
}

/// Tries all mappings that could serve the scene on some thousand uniform points each. A function of scene and seed alone:
/// costs are counted in rays, not in seconds.
pub fn try_mappings(scene: &Scene, seed: u64) -> Trial {
    let kinds = candidates(&scene.features);
    let found: Vec<Found> = kinds.iter().map(|kind| Found::new(scene, *kind, Rng::new(seed))).collect();
    let sharpest = found
        .iter()
        .min_by(|a, b| a.spread().total_cmp(&b.spread()))
        .expect("the unidirectional mapping serves every scene");
    let errors: Vec<f64> = found.iter().map(|found| found.error(sharpest) * found.cost).collect();
    let unidirectional = errors[0];
    let errors: Vec<(MappingKind, f64)> = kinds
        .into_iter()
        .zip(errors)
        .map(|(kind, error)| (kind, if unidirectional > 0.0 { error / unidirectional } else { 1.0 }))
        .collect();
    let best = errors.iter().min_by(|a, b| a.1.total_cmp(&b.1)).expect("some mapping was tried");
    let chosen = if best.1 < CLEARLY_LESS { best.0 } else { MappingKind::Unidirectional };
    Trial { chosen, errors }
}

impl Trial {
    /// Why the choice is what it is, in a sentence.
    pub fn why(&self) -> String {
        let others: Vec<String> = self
            .errors
            .iter()
            .filter(|(kind, _)| *kind != MappingKind::Unidirectional)
            .map(|(kind, error)| format!("{} {error:.2}", kind.name()))
            .collect();
        format!(
            "{} mapping; squared errors at equal cost, by that of unidirectional: {}",
            self.chosen.name(),
            others.join(", ")
        )
    }
}

/// What the points of a mapping found, tile by tile.
struct Found {
    /// Mean luminance, and the variance of that mean.
    tiles: Vec<[f64; 2]>,
    /// Of a point, in rays.
    cost: f64,
}

/// Sums over one tile.
#[derive(Clone, Copy, Default)]
struct Tile {
    /// Points whose main position it has, Σ of what they contribute there, and of its square.
    main: [f64; 3],
    /// The same of what all points contribute to it elsewhere, but for the first.
    elsewhere: [f64; 2],
}

impl Found {
    fn new(scene: &Scene, kind: MappingKind, rng: Rng) -> Found {
        let widths = Widths { camera: Width::W8, bounce: Width::W8, shadow: Width::W8 };
        let mapping = Mapping::new(scene, kind, widths);
        let side = [scene.film.width.min(TILES), scene.film.height.min(TILES)];
        let batches: Vec<(Vec<Tile>, u64)> =
            (0..POINTS / LANES).into_par_iter().map(|batch| one_batch(&mapping, rng, batch, side)).collect();
        let mut sums = vec![Tile::default(); (side[0] * side[1]) as usize];
        for (tiles, _) in &batches {
            for (sum, tile) in sums.iter_mut().zip(tiles) {
                sum.main.iter_mut().zip(tile.main).for_each(|(a, b)| *a += b);
                sum.elsewhere.iter_mut().zip(tile.elsewhere).for_each(|(a, b)| *a += b);
            }
        }
        let rays: u64 = batches.iter().map(|(_, rays)| rays).sum();
        let (n, tiles) = (POINTS as f64, sums.len() as f64);
        let of_tile = |tile: &Tile| {
            let [points, sum, squares] = tile.main;
            let mean = if points > 0.0 { sum / points } else { 0.0 };
            let variance = if points > 0.0 { (squares / points - mean * mean).max(0.0) / points } else { 0.0 };
            let [more, more_squares] = tile.elsewhere;
            [mean + more * tiles / n, variance + more_squares * (tiles / n).powi(2)]
        };
        Found { tiles: sums.iter().map(of_tile).collect(), cost: rays as f64 / n + COST_OF_A_POINT }
    }

    fn mean(&self) -> f64 {
        self.tiles.iter().map(|[mean, _]| mean).sum::<f64>() / self.tiles.len() as f64
    }

    /// Squared error by the mapping's own account.
    fn spread(&self) -> f64 {
        match self.mean() {
            0.0 => f64::INFINITY,
            _ => self.error(self),
        }
    }

    /// Squared relative error: the variance, and what is missing beside the mapping that knows best, beyond what both
    /// may err. (Where light is hard to find, what has not been found does not show in the variance.)
    fn error(&self, best: &Found) -> f64 {
        let floor = (FLOOR * best.mean()).powi(2);
        let of_tile = |([mean, variance], [known, its_variance]): (&[f64; 2], &[f64; 2])| {
            let missing = ((mean - known).powi(2) - variance - its_variance).max(0.0);
            (variance + missing) / (known * known + floor)
        };
        self.tiles.iter().zip(&best.tiles).map(of_tile).sum()
    }
}

/// What one batch of points adds to each tile, and its rays.
fn one_batch(mapping: &Mapping, rng: Rng, batch: u64, side: [u32; 2]) -> (Vec<Tile>, u64) {
    let counter = |lane: u64| Counter { ladder: lane as u32, replica: 0, step: batch, purpose: Purpose::Trial };
    let mut evaluator = Evaluator::new(rng, (0..LANES).map(counter).collect());
    evaluator.moves.fill(Move::Fresh);
    evaluator.evaluate(mapping, &Points::new(0));
    let mut tiles = vec![Tile::default(); (side[0] * side[1]) as usize];
    let at = |film: [f32; 2]| {
        let [x, y] = [0, 1].map(|i| ((film[i] * side[i] as f32) as u32).min(side[i] - 1));
        (y * side[0] + x) as usize
    };
    for lane in 0..LANES as usize {
        let Whole { main, elsewhere } = evaluator.out.whole(lane);
        let value = f64::from(luminance(main.rgb));
        let tile = &mut tiles[at(main.film)];
        tile.main.iter_mut().zip([1.0, value, value * value]).for_each(|(a, b)| *a += b);
        for splat in elsewhere {
            let value = f64::from(luminance(splat.rgb));
            let tile = &mut tiles[at(splat.film)];
            tile.elsewhere.iter_mut().zip([value, value * value]).for_each(|(a, b)| *a += b);
        }
    }
    (tiles, evaluator.out.rays)
}
