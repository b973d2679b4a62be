//! Probes: a part of the pixels where the image is made several times over, to learn which weights serve it best.
//!
//! Separate halves of the samples fill separate films, so the difference of the halves shows the error of the image as it
//! is, correlations of chains and evenness of points included. Ladders are halved by blocks, stratified points by time:
//! halves of a sequence of low discrepancy that follow one another are as even as the whole.
//!
//! What a point gives elsewhere than at its own film position counts in the probe there, as if it were of another point:
//! squares of what one point adds to one pixel in several parts lack the products of these parts. The number of points
//! that it is divided by, in the end, is that of the probe's own, which differs from the mean over all pixels by its
//! noise only.

use std::io::{self, Write};

use crate::film::{Accumulator, Splat, Splats};
use crate::saved::{Source, Unfit};

/// What a chain state may count for beside a uniform point, ρ, from 0 (path tracing) on.
pub const RATIOS: [f64; 8] = [0.0, 1.0 / 1024.0, 1.0 / 256.0, 1.0 / 64.0, 1.0 / 16.0, 1.0 / 4.0, 1.0, 4.0];

/// The ratio of the most evenly weighed image, 1.
pub const EVEN: usize = RATIOS.len() - 2;

/// The first of the layers of states; those of uniform points come before.
const STATES: usize = RATIOS.len();

/// The layer that has the numbers of uniform points, for all.
const COUNTS: usize = 0;

/// Ways to move that are tried side by side, on a third of the ladders each.
pub const TRIALS: usize = 3;

/// Pixels that are probed, at most.
const MOST_PROBES: usize = 1 << 14;

/// Which pixels are probed.
#[derive(Clone, Debug)]
pub struct ProbeMap {
    pixels: u32,
    stride: u32,
}

impl ProbeMap {
    /// Probes for a film of that size, evenly spread.
    pub fn new([width, height]: [u32; 2]) -> ProbeMap {
        let pixels = width * height;
        let fewest = (pixels as usize).div_ceil(MOST_PROBES) as u32;
        // a stride that shares a divisor with the width would probe some columns only
        let common = |mut a: u32, mut b: u32| {
            while b > 0 {
                (a, b) = (b, a % b);
            }
            a
        };
        let stride = (fewest..).find(|s| *s == 1 || common(*s, width) == 1).expect("one above the width is coprime");
        ProbeMap { pixels, stride }
    }

    /// Number of probes.
    pub fn count(&self) -> usize {
        self.pixels.div_ceil(self.stride) as usize
    }

    /// The probe of a pixel.
    #[inline(always)]
    pub fn of_pixel(&self, pixel: u32) -> Option<u32> {
        pixel.is_multiple_of(self.stride).then(|| pixel / self.stride)
    }

    /// The pixel of a probe.
    pub fn pixel(&self, probe: usize) -> usize {
        probe * self.stride as usize
    }
}

/// Luminance gathered by the probes in each half of the blocks, and its squares: of uniform points one layer for each ratio
/// that is tried, and of states as many.
pub struct Probes {
    halves: [Accumulator; 2],
    trials: [[Accumulator; 2]; TRIALS],
}

impl Probes {
    /// Empty probes; `unit` as for the film.
    pub fn new(map: &ProbeMap, unit: f64) -> Probes {
        let film = |layers: usize| [(); 2].map(|()| Accumulator::new(map.count() as u32, 1, layers, unit));
        Probes { halves: film(2 * RATIOS.len()), trials: [(); TRIALS].map(|()| film(1)) }
    }

    /// All films, in a fixed order.
    fn films(&self) -> impl Iterator<Item = &Accumulator> {
        self.halves.iter().chain(self.trials.as_flattened())
    }

    /// Writes all sums.
    pub fn save(&self, out: &mut dyn Write) -> io::Result<()> {
        self.films().try_for_each(|film| film.save(out))
    }

    /// Takes the sums that [`save`](Self::save) wrote.
    pub fn restore(&mut self, from: &mut Source) -> Result<(), Unfit> {
        let mut films = self.halves.iter_mut().chain(self.trials.as_flattened_mut());
        films.try_for_each(|film| film.restore(from))
    }

    /// Adds the sums of other probes of the same pixels.
    pub fn merge(&self, other: &Probes) {
        self.films().zip(other.films()).for_each(|(film, other)| film.merge(other));
    }

    /// Splats for [`deposit`](Self::deposit).
    pub fn splats() -> Splats {
        Splats::new(2 * RATIOS.len())
    }

    /// What a uniform point adds for each ratio, and what its square counts in the most evenly weighed mean. `points` is
    /// the number of points that this counts for: 1, or 0 for what comes from a point elsewhere.
    #[inline(always)]
    pub fn uniform(splats: &mut Splats, probe: u32, value: impl Fn(f64) -> f64, even: f64, points: f32) {
        for (layer, ratio) in RATIOS.into_iter().enumerate() {
            let value = value(ratio);
            let weight = if layer == COUNTS { points } else { 0.0 };
            if value != 0.0 || weight != 0.0 {
                let rgb = [value, value * value, even * value * value].map(|v| v as f32);
                splats.push(layer, Splat { pixel: probe, rgb, weight });
            }
        }
    }

    /// What a state of a chain of expected weight `weight` adds for each ratio, were its weight one.
    ///
    /// `uniform` is what a uniform point in its place would add, and `even` what a state counts in the most evenly weighed
    /// mean.
    #[inline(always)]
    pub fn tempered(
        splats: &mut Splats,
        probe: u32,
        weight: f64,
        value: impl Fn(f64) -> f64,
        uniform: impl Fn(f64) -> f64,
        even: f64,
    ) {
        for (layer, ratio) in RATIOS.into_iter().enumerate() {
            let (value, point) = (value(ratio), uniform(ratio));
            let rgb = [value, value * value, even * point * point].map(|v| (weight * v) as f32);
            splats.push(STATES + layer, Splat { pixel: probe, rgb, weight: 0.0 });
        }
    }

    /// Adds splats to a half, and those of states to a trial as well, if they belong to one.
    pub fn deposit(&self, half: usize, trial: Option<usize>, splats: &mut Splats) {
        if let Some(trial) = trial {
            let mut even = Splats::new(1);
            splats.layer(STATES + EVEN).iter().for_each(|splat| even.push(0, *splat));
            self.trials[trial][half].deposit(&mut even);
        }
        self.halves[half].deposit(splats);
    }

    /// Σ over the states of a trial in both halves of every probe, as they are weighed most evenly.
    pub fn trial(&self, trial: usize) -> Vec<[f64; 2]> {
        let [a, b] = [0, 1].map(|half: usize| self.trials[trial][half].layer(0));
        a.into_iter().zip(b).map(|(a, b)| [a[0], b[0]]).collect()
    }

    /// What every probe has for a ratio: in both halves Σ over uniform points, Σ over states, number of uniform points, and Σ of
    /// squares over states; and of both together Σ of squares of what uniform points add, over uniform points and as the two
    /// parts of the most evenly weighed mean, that of uniform points and that of states.
    pub fn sums(&self, ratio: usize) -> (Vec<[[f64; 4]; 2]>, Vec<[f64; 3]>) {
        let layers =
            [0, 1].map(|half: usize| [ratio, STATES + ratio, COUNTS].map(|layer| self.halves[half].layer(layer)));
        let of_probe = |i: usize| {
            let halves = layers.each_ref().map(|layers| layers.each_ref().map(|layer| layer[i]));
            let [[a, a_states, _], [b, b_states, _]] = halves;
            let squares = [a[1] + b[1], a[2] + b[2], a_states[2] + b_states[2]];
            (halves.map(|[points, states, counts]| [points[0], states[0], counts[3], states[1]]), squares)
        };
        (0..layers[0][0].len()).map(of_probe).unzip()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn probes_are_spread_over_rows_and_columns() {
        for size in [[1, 1], [128, 1], [256, 256], [1920, 1080], [1, 70000], [4096, 4096]] {
            let map = ProbeMap::new(size);
            let pixels = size[0] * size[1];
            assert!(
                map.count() <= MOST_PROBES.max(1) && map.count() >= (pixels as usize).min(MOST_PROBES) / 4,
                "{size:?}"
            );
            let mut columns = vec![0; size[0] as usize];
            for probe in 0..map.count() {
                let pixel = map.pixel(probe);
                assert_eq!(map.of_pixel(pixel as u32), Some(probe as u32));
                columns[pixel % size[0] as usize] += 1;
            }
            let (least, most) = (columns.iter().min().unwrap(), columns.iter().max().unwrap());
            assert!(most - least <= 1 + size[0] as i32 / 1000, "{size:?}: {least} to {most} probes a column");
        }
    }
}
