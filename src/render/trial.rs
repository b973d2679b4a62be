//! Choosing a mapping by trying them.

use rayon::prelude::*;

use super::settings::{MappingChoice, Method, Settings};
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
    /// The squared error of each mapping that was tried, at equal cost, by that of the unidirectional one; none where the
    /// budget had no room for a trial.
    pub errors: Vec<(MappingKind, f64)>,
    /// There are mirrors or clear glass, which may lead light on paths too rare for trials.
    pub rare_paths: bool,
}

/// Points of each mapping, at most.
const POINTS: u64 = 1 << 15;
/// Points of each mapping that tell something; with fewer the errors themselves err by more than mappings differ.
const FEWEST_POINTS: u64 = 1 << 12;
/// The part of a run's budget that its trial may take.
const SHARE: f64 = 1.0 / 8.0;
/// A trial ends with the fewest points where no other mapping has less than this part of the error of the unidirectional
/// one, or no other than the best has less than this many times the best's error.
const NO_BETTER: f64 = 0.75;
const FAR_WORSE: f64 = 3.0;
/// How much more error than others the mapping that makes all connections may have in a scene with mirrors or clear glass.
///
/// There a few paths that are hard to find carry much of the error, more than a trial's points can show; the more
/// techniques are weighed against each other, the less such paths can weigh. Trials give `two-way` half and 0.8 times the
/// error of `bidirectional` on `caustic` and `veach-bidir`. Pictures have 1.6 and five times as much: relMSE 0.149 and 0.091
/// (relt study scenes/studies/mappings-specular.toml), 0.20 and 0.038 (`relt render --method path` on the scene of Bitterli,
/// `--mpp 13` and `10` for the same processor time, two seeds).
const UNSEEN: f64 = 4.0;
/// How many times less error than others `multiplexed` must have in other scenes.
///
/// Its error is told by points that take all techniques at once, as its uniform points do; its chains take one at a time, and pay
/// where that one is not the best. On `lattice` trials of up to 2¹⁵ points give it 1 to 1.6 times the error of `light`, and so do
/// pictures of `--method path` (relMSE 0.031 against 0.027 with `--time 5s --seed 0`, 256 × 256 pixels, two
/// threads); those of `re` have 0.097 against 0.035.
const PAID_BY_CHAINS: f64 = 2.0;
/// Points a second that a budget in time is taken for: half of what one thread makes of the shipped scenes, all mappings
/// together, for there are slower ones. A number, not a measurement: the choice must not depend on the machine's mood.
const PACE: f64 = 2e5;
/// Points that are evaluated together.
const LANES: u64 = 256;
/// Tiles of the film a side, at most.
const TILES: u32 = 16;
/// Cells of a tile a side, at most.
const CELLS: u32 = 4;
/// Points of a cell on the average, at the least.
const POINTS_A_CELL: u64 = 8;
/// How much less the error of another mapping must be for it to take the unidirectional one's place. Errors of mappings
/// that are alike differ by as much from trial to trial.
const CLEARLY_LESS: f64 = 0.6;
/// Luminance, by the mean, below which errors count in absolute terms; as in [`Measure`](crate::chain::Measure).
const FLOOR: f64 = 0.5;

/// The mapping with all techniques that serves runs of those settings.
///
/// Chains want points that are cheap: one technique each, and all at once only where points are uniform. So `re` gets
/// `multiplexed` where its stratified points are [open](crate::tempering::Choices::opens), and are then those of `bidirectional`. `mlt` has no
/// such points and gets it only where there are mirrors or clear glass (without, it has twelve times the squared error of
/// `light` on `lattice`; relt study scenes/studies/mappings.toml).
fn of_all_techniques(scene: &Scene, settings: &Settings, pixels: u64) -> MappingKind {
    let cheap = match settings.method {
        Method::Path => false,
        Method::Mlt => scene.features.delta_lobes,
        Method::ReplicaExchange => settings.leaves_open(settings.mutations_per_pixel, pixels),
    };
    if cheap { MappingKind::Multiplexed } else { MappingKind::Bidirectional }
}

/// The mappings that could serve a scene, `all` being the one with all techniques.
pub fn candidates(features: &Features, all: MappingKind) -> Vec<MappingKind> {
    [MappingKind::Unidirectional, MappingKind::Light, MappingKind::TwoWay, all]
        .into_iter()
        .filter(|kind| kind.misses(features).is_empty())
        .collect()
}

/// The mapping that settings ask for, and where that is left to a trial, why it is that one.
pub fn settle(scene: &Scene, settings: &Settings) -> (MappingKind, Option<String>) {
    match settings.mapping {
        MappingChoice::Auto => {
            let trial = try_mappings(scene, settings);
            (trial.chosen, Some(trial.why()))
        }
        MappingChoice::Fixed(mapping) => (mapping, None),
    }
}

/// Tries all mappings that could serve the scene on some thousand uniform points each, as far as the budget has room for
/// that. A function of scene, seed and budget alone: costs are counted in rays, not in seconds.
pub fn try_mappings(scene: &Scene, settings: &Settings) -> Trial {
    let rare_paths = scene.features.delta_lobes;
    let pixels = u64::from(scene.film.width) * u64::from(scene.film.height);
    let candidates = candidates(&scene.features, of_all_techniques(scene, settings, pixels));
    let points = points_of_each(settings, pixels, candidates.len());
    if points < FEWEST_POINTS {
        return Trial { chosen: MappingKind::Unidirectional, errors: Vec::new(), rare_paths };
    }
    let rng = Rng::new(settings.seed);
    let errors = errors(scene, &candidates, rng, FEWEST_POINTS);
    let clear = !rare_paths && is_clear(&errors);
    let errors = if clear || points == FEWEST_POINTS { errors } else { self::errors(scene, &candidates, rng, points) };
    let counts = |(kind, error): &(MappingKind, f64)| match kind {
        MappingKind::Bidirectional | MappingKind::Multiplexed if rare_paths => error / UNSEEN,
        MappingKind::Multiplexed => error * PAID_BY_CHAINS,
        _ => *error,
    };
    let best = errors.iter().min_by(|a, b| counts(a).total_cmp(&counts(b))).expect("some mapping was tried");
    let chosen = if counts(best) < CLEARLY_LESS { best.0 } else { MappingKind::Unidirectional };
    Trial { chosen, errors, rare_paths }
}

/// Whether a trial with few points has told which mapping is best: errors by that of the unidirectional one, the first.
fn is_clear(errors: &[(MappingKind, f64)]) -> bool {
    let mut sorted: Vec<f64> = errors.iter().map(|(_, error)| *error).collect();
    sorted.sort_by(f64::total_cmp);
    let far_better = sorted.get(1).is_none_or(|second| *second >= FAR_WORSE * sorted[0]);
    far_better || errors[1..].iter().all(|(_, error)| *error >= NO_BETTER)
}

/// Squared errors at equal cost, by that of the unidirectional mapping, which is the first, after so many points of each.
fn errors(scene: &Scene, candidates: &[MappingKind], rng: Rng, points: u64) -> Vec<(MappingKind, f64)> {
    let told_by = |kind: MappingKind| match kind {
        MappingKind::Multiplexed => MappingKind::Bidirectional,
        kind => kind,
    };
    let found: Vec<Found> = candidates.iter().map(|kind| Found::new(scene, told_by(*kind), rng, points)).collect();
    let sharpest = found
        .iter()
        .min_by(|a, b| a.spread().total_cmp(&b.spread()))
        .expect("the unidirectional mapping serves every scene");
    let errors: Vec<f64> = found.iter().map(|found| found.error(sharpest) * found.cost).collect();
    let unidirectional = errors[0];
    let relative = |error: f64| if unidirectional > 0.0 { error / unidirectional } else { 1.0 };
    candidates.iter().copied().zip(errors.into_iter().map(relative)).collect()
}

/// Points for each of so many mappings, in whole batches.
fn points_of_each(settings: &Settings, pixels: u64, mappings: usize) -> u64 {
    let mutations = settings.mutations_per_pixel.map(|mpp| mpp * pixels as f64);
    let in_time = settings.time.map(|time| time.as_secs_f64() * PACE);
    let budget = mutations.into_iter().chain(in_time).fold(f64::INFINITY, f64::min);
    let each = (SHARE * budget / mappings as f64) as u64; // all of u64 where there is no end
    each.min(POINTS) / LANES * LANES
}

impl Trial {
    /// Why the choice is what it is, in a line.
    pub fn why(&self) -> String {
        let chosen = self.chosen.name();
        if self.errors.is_empty() {
            return format!("{chosen} mapping: the budget leaves no room for a trial of others; --mapping names one");
        }
        let others: Vec<String> = self
            .errors
            .iter()
            .filter(|(kind, _)| *kind != MappingKind::Unidirectional)
            .map(|(kind, error)| format!("{} {error:.2}", kind.name()))
            .collect();
        let others = others.join(", ");
        let own = self.errors.iter().find(|(kind, _)| *kind == self.chosen).map_or(0.0, |(_, error)| *error);
        let rare = if self.rare_paths && self.errors.iter().any(|(_, error)| *error < own) {
            ", not counting what mirrors and glass do too rarely for a trial, where most connections help most"
        } else {
            ""
        };
        format!("{chosen} mapping: squared errors at equal cost in a trial, unidirectional 1, {others}{rare}")
    }
}

/// What the points of a mapping found, tile by tile.
struct Found {
    /// Mean luminance, and the variance of that mean.
    tiles: Vec<[f64; 2]>,
    /// Of a point, in rays. By `path` on the shipped scenes a ray with all that hangs on it takes as long in any of these
    /// mappings, within a fifth or so either way (a quarter less with `bidirectional`, whose rays are mostly shadow rays).
    cost: f64,
}

/// The film in tiles, for which errors are known, and those in cells, within which points' main contributions are taken to
/// vary by chance alone: methods stratify film positions, so that an edge across a tile makes no error.
#[derive(Clone, Copy)]
struct Grid {
    /// Tiles a row, and rows.
    tiles: [u32; 2],
    /// Cells of a tile a side.
    cells: u32,
}

/// Sums over one cell of the film.
#[derive(Clone, Copy, Default)]
struct Cell {
    /// Points whose main position it has, Σ of what they contribute there, and of its square.
    main: [f64; 3],
    /// The same of what all points contribute to it elsewhere, but for the first.
    elsewhere: [f64; 2],
}

impl Grid {
    fn new(scene: &Scene, points: u64) -> Grid {
        let tiles = [scene.film.width.min(TILES), scene.film.height.min(TILES)];
        let [columns, rows] = tiles;
        let fits = |cells: &u32| {
            let all = u64::from(columns * rows * cells * cells);
            // no finer than pixels
            scene.film.width.min(scene.film.height) / TILES >= *cells && points / all >= POINTS_A_CELL
        };
        Grid { tiles, cells: (1..=CELLS).rev().find(fits).unwrap_or(1) }
    }

    fn side(&self) -> [u32; 2] {
        self.tiles.map(|n| n * self.cells)
    }

    /// The cell with that place of the film.
    fn cell(&self, film: [f32; 2]) -> usize {
        let side = self.side();
        let [x, y] = [0, 1].map(|i| ((film[i] * side[i] as f32) as u32).min(side[i] - 1));
        (y * side[0] + x) as usize
    }

    /// The tile that a cell is in.
    fn tile(&self, cell: usize) -> usize {
        let columns = self.side()[0];
        let [x, y] = [cell as u32 % columns, cell as u32 / columns].map(|n| n / self.cells);
        (y * self.tiles[0] + x) as usize
    }
}

impl Found {
    fn new(scene: &Scene, kind: MappingKind, rng: Rng, points: u64) -> Found {
        let widths = Widths { camera: Width::W8, bounce: Width::W8, shadow: Width::W8 };
        let mapping = Mapping::new(scene, kind, widths);
        let grid = Grid::new(scene, points);
        let batches: Vec<(Vec<Cell>, u64)> =
            (0..points / LANES).into_par_iter().map(|batch| one_batch(&mapping, rng, batch, grid)).collect();
        let [columns, rows] = grid.side();
        let mut sums = vec![Cell::default(); (columns * rows) as usize];
        for (cells, _) in &batches {
            for (sum, cell) in sums.iter_mut().zip(cells) {
                sum.main.iter_mut().zip(cell.main).for_each(|(a, b)| *a += b);
                sum.elsewhere.iter_mut().zip(cell.elsewhere).for_each(|(a, b)| *a += b);
            }
        }
        let rays: u64 = batches.iter().map(|(_, rays)| rays).sum();
        Found { tiles: tiles(grid, &sums, points as f64), cost: rays as f64 / points as f64 }
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

    /// Squared relative error: the variance, or the distance from the mapping that knows best, beyond what that one may
    /// err, where this is more. (Where light is hard to find, what has not been found does not show in the variance.)
    /// Compared in sum: tile by tile, distances that chance made large would count and small ones would not.
    fn error(&self, best: &Found) -> f64 {
        let floor = (FLOOR * best.mean()).powi(2);
        let [mut by_variance, mut by_distance] = [0.0; 2];
        for ([mean, variance], [known, its_variance]) in self.tiles.iter().zip(&best.tiles) {
            let unit = known * known + floor;
            by_variance += variance / unit;
            by_distance += ((mean - known).powi(2) - its_variance) / unit;
        }
        by_distance.max(by_variance)
    }
}

/// Means of tiles, each with its variance, from the sums of their cells over so many points.
fn tiles(grid: Grid, cells: &[Cell], points: f64) -> Vec<[f64; 2]> {
    /// Of a tile: points, Σ of what they contribute, Σ of squared distances from their cells' means, degrees of freedom.
    #[derive(Clone, Copy, Default)]
    struct Tile {
        main: [f64; 4],
        elsewhere: [f64; 2],
    }
    let [columns, rows] = grid.tiles;
    let mut tiles = vec![Tile::default(); (columns * rows) as usize];
    for (i, cell) in cells.iter().enumerate() {
        let tile = &mut tiles[grid.tile(i)];
        let [n, sum, squares] = cell.main;
        let within = if n > 0.0 { (squares - sum * sum / n).max(0.0) } else { 0.0 };
        tile.main.iter_mut().zip([n, sum, within, (n - 1.0).max(0.0)]).for_each(|(a, b)| *a += b);
        tile.elsewhere.iter_mut().zip(cell.elsewhere).for_each(|(a, b)| *a += b);
    }
    let of_chance = |a: f64, n: f64| if n > 0.0 { a / n } else { 0.0 };
    let number = tiles.len() as f64;
    let of_tile = |tile: &Tile| {
        let [n, sum, within, freedom] = tile.main;
        let [more, more_squares] = tile.elsewhere;
        let variance = of_chance(of_chance(within, freedom), n);
        [of_chance(sum, n) + more * number / points, variance + more_squares * (number / points).powi(2)]
    };
    tiles.iter().map(of_tile).collect()
}

/// What one batch of points adds to each cell, and its rays.
fn one_batch(mapping: &Mapping, rng: Rng, batch: u64, grid: Grid) -> (Vec<Cell>, u64) {
    let counter = |lane: u64| Counter { ladder: lane as u32, replica: 0, step: batch, purpose: Purpose::Trial };
    let mut evaluator = Evaluator::new(rng, (0..LANES).map(counter).collect());
    evaluator.moves.fill(Move::Fresh);
    evaluator.evaluate(mapping, &Points::new(0));
    let [columns, rows] = grid.side();
    let mut cells = vec![Cell::default(); (columns * rows) as usize];
    for lane in 0..LANES as usize {
        let Whole { main, elsewhere } = evaluator.out.whole(lane);
        let value = f64::from(luminance(main.rgb));
        let cell = &mut cells[grid.cell(main.film)];
        cell.main.iter_mut().zip([1.0, value, value * value]).for_each(|(a, b)| *a += b);
        for splat in elsewhere {
            let value = f64::from(luminance(splat.rgb));
            let cell = &mut cells[grid.cell(splat.film)];
            cell.elsewhere.iter_mut().zip([value, value * value]).for_each(|(a, b)| *a += b);
        }
    }
    (cells, evaluator.out.rays)
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn a_trial_takes_an_eighth_of_the_budget_at_most() {
        let points = |mutations_per_pixel, time| {
            let settings = Settings { mutations_per_pixel, time, ..Settings::default() };
            points_of_each(&settings, 100 * 100, 4)
        };
        assert_eq!(points(Some(1e6), None), POINTS);
        assert_eq!(points(None, Some(Duration::from_secs(3600))), POINTS);
        assert_eq!(points(Some(32.0), None), 10_000 / LANES * LANES);
        assert_eq!(points(Some(1e6), Some(Duration::from_millis(500))), 3125 / LANES * LANES);
        assert_eq!(points(Some(1e-3), Some(Duration::from_secs(3600))), 0);
    }

    #[test]
    fn a_trial_goes_on_where_two_mappings_are_alike() {
        let clear = |others: [f64; 2]| {
            let [light, two_way] = others;
            let unidirectional = (MappingKind::Unidirectional, 1.0);
            is_clear(&[unidirectional, (MappingKind::Light, light), (MappingKind::TwoWay, two_way)])
        };
        assert!(clear([0.8, 2.0]) && clear([0.1, 0.31]) && clear([4.0, 0.2]));
        assert!(!clear([0.5, 2.0]) && !clear([0.1, 0.12]) && !clear([0.12, 0.06]));
    }

    #[test]
    fn an_edge_between_cells_is_no_error() {
        // one tile of two cells a side: dark at the left, bright at the right, three points each
        let grid = Grid { tiles: [1, 1], cells: 2 };
        let cell = |value: f64| Cell { main: [3.0, 3.0 * value, 3.0 * value * value], elsewhere: [0.0; 2] };
        assert_eq!(tiles(grid, &[cell(0.0), cell(4.0), cell(0.0), cell(4.0)], 12.0), [[2.0, 0.0]]);
        // in one cell 0, 1 and 2 about a mean of 1: Σ of squared distances 2, with 8 degrees of freedom, over 12 points
        let noisy = Cell { main: [3.0, 3.0, 5.0], elsewhere: [0.0; 2] };
        let [[mean, variance]] = tiles(grid, &[noisy, cell(4.0), cell(0.0), cell(4.0)], 12.0)[..] else { panic!() };
        assert!((mean - 2.25).abs() < 1e-12 && (variance - 2.0 / 8.0 / 12.0).abs() < 1e-12, "{mean} {variance}");
    }

    #[test]
    fn cells_are_within_their_tiles() {
        let grid = Grid { tiles: [3, 2], cells: 4 };
        for (film, tile) in [([0.0, 0.0], 0), ([0.34, 0.1], 1), ([0.99, 0.49], 2), ([0.3, 0.6], 3), ([1.0, 1.0], 5)] {
            assert_eq!(grid.tile(grid.cell(film)), tile, "{film:?}");
        }
    }
}
