//! Parts of a job: runs of their own, on as many machines or in one process, of which one picture is made.
//!
//! A job in N parts is defined as N independent runs of the same scene and settings, each with 1/N of the budget in
//! mutations and with random numbers of its own ([`Parts::rng`]); its picture is what [`Pool`] makes of them, whoever ran
//! them and wherever. So one process that goes through all parts ([`Several`]) and N files that are merged come to the same
//! bits, and parts may be pooled at any time, however far each of them has come.
//!
//! What is pooled:
//!
//! - `path`: the sums. Points of all parts are points of one path tracer: Σ f and number of points of every pixel are added,
//!   as integers, and divided once. Nothing else would treat a pixel right that some parts have no point in yet.
//! - `mlt`, `re`: pictures, weighed by mutations, Î = Σ n_i Î_i / Σ n_i. The sums of a part's chains mean something only with
//!   what that part alone has: the c that its chains were resampled with (for `mlt` in two passes, Î_i is unbiased
//!   because c and first states come of the same samples, Veach & Guibas 1997; with a c of all parts it would not be), or its
//!   own ladder, importance, weights ζ and normalisers, which refer to one another. The n_i are set by the budget and not by
//!   what was found, so the mean of unbiased pictures is unbiased; of pictures with a bias of O(1/n_i), as of `re`, it keeps
//!   that of its parts, and so parts should be long rather than many. As a mean of independent equals its variance falls like
//!   1/N.

use std::io::{self, Write};
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::{
    engine::{Counts, Development, Diagnostics, Engine, Phase, Sheet, Stage},
    progress::significant,
};
use crate::{
    film::{Image, Plane, Value},
    path::{Workspace, luminance},
    ranks::Company,
    rng::{Counter, Purpose, Rng},
    scene::Rgb,
    tempering::{Estimate, RoundReport, Sampler},
};

/// Into how many parts a job is cut, and which of them a run is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Parts {
    /// Number of parts, from 1.
    pub of: u32,
    /// The part that is run, from 1; all of them where absent.
    pub only: Option<u32>,
}

impl Default for Parts {
    /// The whole in one.
    fn default() -> Parts {
        Parts { of: 1, only: None }
    }
}

impl Parts {
    /// Parts at most.
    pub const MOST: u32 = 1 << 20;

    /// Those that are run.
    pub fn numbers(self) -> impl Iterator<Item = u32> {
        let (first, last) = self.only.map_or((1, self.of), |only| (only, only));
        first..=last
    }

    /// Random numbers of a part, of those of the job: the same where there is one part only, or else of a seed drawn from
    /// them.
    pub fn rng(self, job: Rng, part: u32) -> Rng {
        match self.of {
            1 => job,
            of => Rng::new(job.seed(Counter { ladder: of, replica: 0, step: part.into(), purpose: Purpose::Part })),
        }
    }

    /// Mutations of a part, of the whole's mutations per pixel.
    pub fn mutations(self, mutations_per_pixel: Option<f64>, pixels: u64) -> Option<u64> {
        mutations_per_pixel.map(|mpp| (mpp * pixels as f64 / f64::from(self.of)).ceil() as u64)
    }

    /// `part 3 of 8`, `8 parts`; nothing for the whole in one.
    pub fn in_words(self) -> Option<String> {
        match self {
            Parts { of: 1, only: None } => None,
            Parts { of, only: None } => Some(format!("{of} parts")),
            Parts { of, only: Some(part) } => Some(format!("part {part} of {of}")),
        }
    }
}

/// Makes one picture of parts, in the order in which they come; see the [module](self).
pub struct Pool {
    sheet: Sheet,
    parts: Vec<Told>,
    /// Sums of path tracers.
    points: Option<Sampler<Workspace>>,
    /// Sums of pictures times mutations.
    mean: Mean,
}

/// What is kept of a part.
struct Told {
    number: u32,
    mutations: u64,
    normalisation: Option<Estimate>,
    /// Mean luminances of tiles of the picture.
    tiles: Vec<f64>,
    warnings: Vec<String>,
}

/// A weighted mean of pictures and their layers, while it is made.
#[derive(Default)]
struct Mean {
    image: Vec<[f64; 3]>,
    layers: Vec<(String, Layer)>,
    weight: f64,
}

/// Sums of one layer, and of the weights of the parts that have it.
struct Layer {
    is_gray: bool,
    sums: Vec<[f64; 3]>,
    weight: f64,
}

/// Tiles of a picture a side, at most.
const TILES: u32 = 16;

impl Pool {
    /// Nothing yet, of that sheet.
    pub fn new(sheet: Sheet) -> Pool {
        Pool { sheet, parts: Vec::new(), points: None, mean: Mean::default() }
    }

    /// Adds a part.
    pub fn add(&mut self, number: u32, engine: &dyn Engine) {
        let Development { image, layers, normalisation, warnings, .. } = engine.develop();
        let mutations = engine.counts().mutations;
        self.parts.push(Told { number, mutations, normalisation, tiles: tiles(&image), warnings });
        match engine.points() {
            Some(points) => self.points.get_or_insert_with(|| points.empty()).pool(points),
            None => self.mean.add(&image, layers, mutations as f64),
        }
    }

    /// The picture of all.
    pub fn develop(self) -> Development {
        let agreement = (self.parts.len() > 1).then(|| Agreement::of(&self.parts));
        let mut warnings = Vec::new();
        for part in &self.parts {
            warnings.extend(part.warnings.iter().map(|warning| match self.parts.len() {
                1 => warning.clone(),
                _ => format!("part {}: {warning}", part.number),
            }));
        }
        warnings.extend(agreement.iter().flat_map(|agreement| &agreement.warnings).cloned());
        let [width, height] = self.sheet.size();
        let (image, layers) = match self.points {
            Some(points) => {
                let developed = points.develop();
                (developed.image, developed.layers)
            }
            None => self.mean.finish([width, height]),
        };
        Development {
            image,
            layers,
            normalisation: mean_of(self.parts.iter()),
            warnings,
            diagnostics: Diagnostics::default(),
            agreement,
        }
    }
}

impl Mean {
    fn add(&mut self, image: &Image, layers: Vec<(String, Plane)>, weight: f64) {
        self.image.resize(image.pixels.len(), [0.0; 3]);
        add(&mut self.image, &image.pixels, weight);
        for (name, plane) in layers {
            let at = self.layers.iter().position(|(known, _)| *known == name).unwrap_or_else(|| {
                let is_gray = matches!(plane, Plane::Gray(_));
                self.layers.push((name, Layer { is_gray, sums: vec![[0.0; 3]; image.pixels.len()], weight: 0.0 }));
                self.layers.len() - 1
            });
            let layer = &mut self.layers[at].1;
            layer.weight += weight;
            match plane {
                Plane::Rgb(more) => add(&mut layer.sums, &more.pixels, weight),
                // numbers of samples: they add up
                Plane::Gray(more) => layer.sums.iter_mut().zip(more).for_each(|(sum, v)| sum[0] += f64::from(v)),
            }
        }
        self.weight += weight;
    }

    fn finish(self, [width, height]: [u32; 2]) -> (Image, Vec<(String, Plane)>) {
        let image = |sums: &[[f64; 3]], weight: f64| {
            let scale = |sum: f64| if weight > 0.0 { (sum / weight) as f32 } else { 0.0 };
            Image::new(width, height, sums.iter().map(|sum| sum.map(scale)).collect())
        };
        let layers = self.layers.iter().map(|(name, layer)| {
            // what a part has no such rung for is 0 there, so that rungs still sum to the picture
            let weight = if name.starts_with("rung") { self.weight } else { layer.weight };
            let plane = match layer.is_gray {
                true => Plane::Gray(layer.sums.iter().map(|sum| sum[0] as f32).collect()),
                false => Plane::Rgb(image(&layer.sums, weight)),
            };
            (name.clone(), plane)
        });
        (image(&self.image, self.weight), layers.collect())
    }
}

fn add(sums: &mut [[f64; 3]], pixels: &[[f32; 3]], weight: f64) {
    for (sum, pixel) in sums.as_flattened_mut().iter_mut().zip(pixels.as_flattened()) {
        *sum += weight * f64::from(*pixel);
    }
}

/// The mean of parts' normalisations by mutations, with the standard error of a mean of independent ones.
fn mean_of<'a>(parts: impl Iterator<Item = &'a Told>) -> Option<Estimate> {
    let mut sums = [0.0; 3];
    for part in parts {
        let (estimate, weight) = (part.normalisation?, part.mutations as f64);
        let error = weight * estimate.standard_error;
        sums = [sums[0] + weight, sums[1] + weight * estimate.value, sums[2] + error * error];
    }
    let [weight, sum, squares] = sums;
    (weight > 0.0).then(|| Estimate::from_ln(libm::log(sum / weight), squares.sqrt() / sum))
}

/// Mean luminance of each tile of a picture.
fn tiles(image: &Image) -> Vec<f64> {
    let [columns, rows] = [image.width, image.height].map(|extent| extent.min(TILES));
    let mut sums = vec![[0.0; 2]; (columns * rows) as usize];
    for (i, [r, g, b]) in image.pixels.iter().enumerate() {
        let (x, y) = (i as u64 % u64::from(image.width), i as u64 / u64::from(image.width));
        let [column, row] =
            [x * u64::from(columns) / u64::from(image.width), y * u64::from(rows) / u64::from(image.height)];
        let sum = &mut sums[(row * u64::from(columns) + column) as usize];
        *sum = [sum[0] + f64::from(luminance(Rgb::new(*r, *g, *b))), sum[1] + 1.0];
    }
    sums.iter().map(|[sum, pixels]| sum / pixels).collect()
}

/// Whether parts, which are independent, tell the same: what a run alone cannot know of itself.
#[derive(Clone, Debug, PartialEq)]
pub struct Agreement {
    /// Number and mutations of each part.
    pub parts: Vec<(u32, u64)>,
    /// χ²/(N − 1) of the parts' normalisations, by their own standard errors: about 1 where these are right, more where
    /// runs miss different light. NaN where a part does not know its error.
    pub normalisation: f64,
    /// √ of the mean relative variance of the pooled picture's tiles (at most 16 × 16), from how those of the parts differ.
    /// Relative to a tile's luminance, or half of the mean where that is more.
    pub tiles: f64,
    /// Parts that are unlike the others, one sentence each.
    pub warnings: Vec<String>,
}

/// Standard errors by which a part's normalisation may differ from that of the others.
const ALARMING: f64 = 3.0;
/// The same for the deviation of its tiles, in terms of the median part's.
const FAR_OFF: f64 = 3.0;
/// Parts from which on there is a median to speak of.
const FEWEST_FOR_MEDIAN: usize = 4;

impl Agreement {
    fn of(parts: &[Told]) -> Agreement {
        let mut warnings = Vec::new();
        let mut chi_squared = 0.0;
        for (i, part) in parts.iter().enumerate() {
            let others = parts.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, other)| other);
            let (all, others) = (mean_of(parts.iter()), mean_of(others));
            let (Some(all), Some(others), Some(own)) = (all, others, part.normalisation) else { continue };
            chi_squared += ((own.value - all.value) / own.standard_error).powi(2);
            let deviation = (own.value - others.value) / own.standard_error.hypot(others.standard_error);
            if deviation.abs() > ALARMING {
                warnings.push(format!(
                    "part {}: its brightness is {} standard errors from that of the others ({} ± {} and {} ± {})",
                    part.number,
                    significant(deviation.abs(), 2),
                    significant(own.value, 4),
                    significant(own.standard_error, 2),
                    significant(others.value, 4),
                    significant(others.standard_error, 2),
                ));
            }
        }
        let tiles = Tiles::of(parts);
        if let (Some(median), true) = (tiles.median(), parts.len() >= FEWEST_FOR_MEDIAN) {
            for (part, deviation) in parts.iter().zip(&tiles.deviations) {
                let ratio = (deviation / median).sqrt();
                if ratio > FAR_OFF {
                    warnings.push(format!(
                        "part {}: its picture is {} times as far from the others as parts usually are",
                        part.number,
                        significant(ratio, 2)
                    ));
                }
            }
        }
        Agreement {
            parts: parts.iter().map(|part| (part.number, part.mutations)).collect(),
            normalisation: chi_squared / (parts.len() - 1) as f64,
            tiles: tiles.variance.sqrt(),
            warnings,
        }
    }

    /// What an image file says about its parts: texts `parts` and `part_mutations` (a space between numbers), numbers
    /// `parts_normalisation` and `parts_tiles` ([`normalisation`](Self::normalisation) and [`tiles`](Self::tiles)).
    pub fn metadata(&self) -> Vec<(String, Value)> {
        let list = |of: fn(&(u32, u64)) -> String| self.parts.iter().map(of).collect::<Vec<_>>().join(" ");
        vec![
            ("parts".into(), list(|(number, _)| number.to_string()).into()),
            ("part_mutations".into(), list(|(_, mutations)| mutations.to_string()).into()),
            ("parts_normalisation".into(), self.normalisation.into()),
            ("parts_tiles".into(), self.tiles.into()),
        ]
    }

    /// `8 parts: …`, in a line.
    pub fn in_words(&self) -> String {
        format!(
            "{} parts: brightness scatters by {} of its standard errors, tiles of the picture are known to {} %",
            self.parts.len(),
            significant(self.normalisation.sqrt(), 2),
            significant(100.0 * self.tiles, 2)
        )
    }
}

/// How parts' tiles scatter about their mean.
struct Tiles {
    /// Mean over tiles of the relative variance of that mean.
    variance: f64,
    /// For each part, the same of its deviation, times its mutations: equal parts of any length have about the same.
    deviations: Vec<f64>,
}

impl Tiles {
    fn of(parts: &[Told]) -> Tiles {
        let tiles = parts[0].tiles.len();
        let all: f64 = parts.iter().map(|part| part.mutations as f64).sum();
        let weights: Vec<f64> = parts.iter().map(|part| part.mutations as f64 / all).collect();
        let mean = |tile: usize| parts.iter().zip(&weights).map(|(part, w)| w * part.tiles[tile]).sum::<f64>();
        let means: Vec<f64> = (0..tiles).map(mean).collect();
        let floor = 0.5 * means.iter().sum::<f64>() / tiles as f64;
        let relative = |part: &Told| {
            let of_tile = |(value, mean): (&f64, &f64)| (value - mean).powi(2) / (mean * mean).max(floor * floor);
            let sum: f64 = part.tiles.iter().zip(&means).map(of_tile).sum();
            if floor > 0.0 { sum / tiles as f64 } else { 0.0 }
        };
        let deviations: Vec<f64> = parts.iter().map(|part| relative(part) * part.mutations as f64).collect();
        // each part's deviation times its mutations estimates the variance of one mutation, but for the share of the mean
        // that is the part itself
        let variance = deviations.iter().sum::<f64>() / (parts.len() - 1) as f64 / all;
        Tiles { variance, deviations }
    }

    /// Of the deviations; nothing where all is alike.
    fn median(&self) -> Option<f64> {
        let mut sorted = self.deviations.clone();
        sorted.sort_by(f64::total_cmp);
        Some(sorted[sorted.len() / 2]).filter(|median| *median > 0.0)
    }
}

/// All parts of a job in one process: the part that has done least goes on.
pub struct Several {
    sheet: Sheet,
    engines: Vec<Box<dyn Engine>>,
}

impl Several {
    /// A job's parts, each made by `make` from its random numbers: one alone, or several in one.
    pub fn engine<E>(
        parts: Parts,
        sheet: Sheet,
        job: Rng,
        mut make: impl FnMut(Rng) -> Result<Box<dyn Engine>, E>,
    ) -> Result<Box<dyn Engine>, E> {
        let mut engines = parts.numbers().map(|part| make(parts.rng(job, part))).collect::<Result<Vec<_>, E>>()?;
        if engines.len() == 1 {
            return Ok(engines.remove(0));
        }
        Ok(Box::new(Several::new(sheet, engines)))
    }

    /// These parts, the first of which is number 1.
    fn new(sheet: Sheet, engines: Vec<Box<dyn Engine>>) -> Several {
        assert!(!engines.is_empty(), "no parts");
        Several { sheet, engines }
    }

    /// The part to go on with: of those with something left, the one with the fewest mutations.
    fn next(&self) -> usize {
        let open = |i: &usize| self.engines[*i].sweeps_left() != Some(0);
        let fewest = (0..self.engines.len()).filter(open).min_by_key(|i| self.engines[*i].counts().mutations);
        fewest.unwrap_or(0)
    }
}

impl Engine for Several {
    fn sweeps_left(&self) -> Option<u64> {
        self.engines.iter().map(|engine| engine.sweeps_left()).sum()
    }

    fn mutations_wanted(&self) -> Option<u64> {
        self.engines.iter().map(|engine| engine.mutations_wanted()).sum()
    }

    fn advance(&mut self, stage: &Stage, sweeps: u64, until: Option<u64>) -> u64 {
        let next = self.next();
        let others: u64 = self.engines.iter().map(|engine| engine.counts().mutations).sum::<u64>()
            - self.engines[next].counts().mutations;
        self.engines[next].advance(stage, sweeps, until.map(|until| until.saturating_sub(others)))
    }

    fn phase(&self) -> Phase {
        self.engines[self.next()].phase()
    }

    /// Rates are those of the first part, whose ladder the others' need not be.
    fn counts(&self) -> Counts {
        let mut counts = self.engines[0].counts();
        for more in self.engines[1..].iter().map(|engine| engine.counts()) {
            counts.mutations += more.mutations;
            counts.rays += more.rays;
            counts.faults.merge(&more.faults);
            counts.technique_changes.merge(&more.technique_changes);
        }
        counts
    }

    fn develop(&self) -> Development {
        let mut pool = Pool::new(self.sheet);
        (1..).zip(&self.engines).for_each(|(number, engine)| pool.add(number, engine.as_ref()));
        pool.develop()
    }

    /// All ranks work on each of the parts in turn.
    fn share(&mut self, company: &Arc<Company>) {
        self.engines.iter_mut().for_each(|engine| engine.share(company));
    }

    fn gather(&mut self) {
        self.engines.iter_mut().for_each(|engine| engine.gather());
    }

    fn set_wanted(&mut self, mutations: Option<u64>) {
        self.engines.iter_mut().for_each(|engine| engine.set_wanted(mutations));
    }

    fn save(&self, out: &mut dyn Write) -> io::Result<()> {
        self.engines.iter().try_for_each(|engine| engine.save(out))
    }

    /// Of the first part: the others have rounds of the same numbers.
    fn take_reports(&mut self) -> Vec<RoundReport> {
        let reports = self.engines[0].take_reports();
        self.engines[1..].iter_mut().for_each(|engine| drop(engine.take_reports()));
        reports
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::open_unit_f64;

    /// A part with that brightness, told to have a standard error of 2 % at 10,000 mutations, and with four tiles that are
    /// off by some of that.
    fn told(number: u32, mutations: u64, brightness: f64) -> Told {
        let error = 0.02 * (1e4 / mutations as f64).sqrt();
        let off = |tile: u64| {
            let counter = Counter { ladder: number, replica: 0, step: tile, purpose: Purpose::Primary };
            let word = Rng::new(1).words(counter, 0)[0];
            1.0 + error * 12f64.sqrt() * (open_unit_f64(word) - 0.5)
        };
        Told {
            number,
            mutations,
            normalisation: Some(Estimate::from_ln(brightness.ln(), error)),
            tiles: (0..64).map(|tile| brightness * off(tile)).collect(),
            warnings: Vec::new(),
        }
    }

    /// Tiles are off by 2 % each, those of parts with four times the mutations by half of that: the mean of Σ n = 110,000
    /// mutations by 2 %/√11 = 0.60 %. With 64 tiles and 4 degrees of freedom that is found to some 6 %.
    #[test]
    fn parts_that_agree_are_not_warned_of() {
        let mutations = [10_000, 40_000, 10_000, 40_000, 10_000];
        let parts: Vec<Told> = (1..).zip(mutations).map(|(number, n)| told(number, n, 0.5)).collect();
        let agreement = Agreement::of(&parts);
        assert_eq!(agreement.warnings, Vec::<String>::new());
        assert!((agreement.tiles / 0.00603 - 1.0).abs() < 0.25, "{}", agreement.tiles);
        assert!(agreement.normalisation < 1e-6, "they are all the same: {}", agreement.normalisation);
        let all = mean_of(parts.iter()).unwrap();
        assert!((all.value - 0.5).abs() < 1e-12 && (all.relative_error / 0.00603 - 1.0).abs() < 0.01, "{all:?}");
    }

    #[test]
    fn a_part_that_found_other_light_is_named() {
        let mut parts: Vec<Told> = (1..=5).map(|number| told(number, 10_000, 0.5)).collect();
        parts[3] = told(4, 10_000, 0.6); // 0.1 is 7.7 times √((2 % · 0.6)² + (1 % · 0.5)²)
        let agreement = Agreement::of(&parts);
        assert!(agreement.normalisation > 4.0, "{}", agreement.normalisation);
        let [brightness, tiles] = &agreement.warnings[..] else { panic!("{:?}", agreement.warnings) };
        assert!(brightness.contains("part 4: its brightness is 7.7 standard errors from"), "{brightness}");
        assert!(tiles.starts_with("part 4: its picture is "), "{tiles}");
    }

    #[test]
    fn tiles_cover_pictures_of_any_size() {
        for (width, height) in [(1, 1), (3, 40), (17, 16), (100, 1)] {
            let tiles = tiles(&Image::constant(width, height, [0.5; 3]));
            assert_eq!(tiles.len(), (width.min(16) * height.min(16)) as usize);
            assert!(tiles.iter().all(|tile| (tile - 0.5).abs() < 1e-6), "{width} × {height}: {tiles:?}");
        }
    }

    /// Two of three parts have the second rung, and one of them weighs twice as much as either of the others.
    #[test]
    fn pictures_are_weighed_by_mutations_and_missing_rungs_are_black() {
        let mut mean = Mean::default();
        for (value, weight) in [(1.0, 1.0), (3.0, 2.0), (5.0, 1.0)] {
            let image = Image::constant(2, 1, [value; 3]);
            let gray = Plane::Gray(vec![value; 2]);
            let mut layers = vec![("density".into(), gray), ("target".into(), Plane::Rgb(image.clone()))];
            if value != 5.0 {
                layers.push(("rung2".into(), Plane::Rgb(image.clone())));
                layers.push(("uniform".into(), Plane::Rgb(image.clone())));
            }
            mean.add(&image, layers, weight);
        }
        let (image, layers) = mean.finish([2, 1]);
        assert_eq!(image, Image::constant(2, 1, [3.0; 3]));
        let expected = [
            ("density", Plane::Gray(vec![9.0; 2])),
            ("target", Plane::Rgb(Image::constant(2, 1, [3.0; 3]))),
            ("rung2", Plane::Rgb(Image::constant(2, 1, [1.75; 3]))),
            ("uniform", Plane::Rgb(Image::constant(2, 1, [(7.0f64 / 3.0) as f32; 3]))),
        ];
        assert_eq!(layers, expected.map(|(name, plane)| (name.to_owned(), plane)));
    }
}
