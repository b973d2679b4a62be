//! Where on the film chains are wanted: a weight that the scalar contribution carries.

use serde::{Deserialize, Serialize};

use crate::path::Whole;

/// The error that a run is to make small.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Measure {
    /// Error relative to the luminance, absolute where it is darker than half the mean: about the square root of relMSE.
    #[default]
    Relative,
    /// The same absolute error everywhere counts the same: RMSE.
    Absolute,
}

impl Measure {
    /// Both.
    pub const ALL: [Measure; 2] = [Measure::Relative, Measure::Absolute];

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Measure::Relative => "relative",
            Measure::Absolute => "absolute",
        }
    }

    /// What squared errors count where the luminance is `luminance`, in an image of mean `mean`: 1/(I² + (c/2)²), or 1.
    pub fn weight(self, luminance: f64, mean: f64) -> f64 {
        match self {
            Measure::Relative => 1.0 / (luminance * luminance + (FLOOR * mean).powi(2)),
            Measure::Absolute => 1.0,
        }
    }
}

/// Luminance, by the mean, below which errors count in absolute terms. The three scenes of the project have means near
/// 0.16, so that this is the 0.1 of relMSE.
const FLOOR: f64 = 0.5;

/// Importance W of film positions, by which chains follow W · g in the place of g: W = 1/(I + c/2), I a rough image.
///
/// Chains on g visit a pixel in proportion to its luminance I, which makes the sum of squared errors least. The relative
/// error is least where they visit all pixels alike: with g/I (Veach 1997, section 11.5.1, and Hoberock & Hart 2010 do
/// so for the same reason). On the scenes of the project half of all light is a lamp that is seen directly, on which
/// chains would waste half of their time. The image is right for any W > 0. Of a point that contributes in several
/// places every part is weighed by where it is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Importance {
    size: [f32; 2],
    /// Pixels a side of a tile.
    tile: u32,
    columns: u32,
    /// ln W by tile.
    ln_weights: Vec<f64>,
}

/// Samples that a tile should have.
const SAMPLES_A_TILE: f64 = 128.0;

impl Importance {
    /// From what uniform points found in every pixel of a film: Σ luminance and number of points. What points found
    /// elsewhere than at their own film positions is part of the luminance there, without a number of points.
    ///
    /// Tiles are as large as they must be to have some 128 points. A tile's luminance is the median of its rows' means, so
    /// that a sample that is much too bright does not speak for it.
    pub fn new([width, height]: [u32; 2], found: &[[f64; 2]]) -> Importance {
        let [sum, points] = found.iter().fold([0.0; 2], |[s, n], [sum, points]| [s + sum, n + points]);
        let mean = sum / points;
        let a_pixel = points / found.len() as f64;
        let tile = ((SAMPLES_A_TILE / a_pixel).sqrt().ceil() as u32).clamp(1, width.max(height));
        let (columns, rows) = (width.div_ceil(tile), height.div_ceil(tile));
        let ln_weights = (0..columns * rows).map(|number| {
            let [left, top] = [number % columns * tile, number / columns * tile];
            let row = |y: u32| {
                let pixels = (left..(left + tile).min(width)).map(|x| found[(y * width + x) as usize]);
                let [sum, points] = pixels.fold([0.0; 2], |[s, n], [sum, points]| [s + sum, n + points]);
                (points > 0.0).then(|| sum / points)
            };
            let mut means: Vec<f64> = (top..(top + tile).min(height)).filter_map(row).collect();
            means.sort_by(f64::total_cmp);
            let luminance = means.get(means.len() / 2).copied().unwrap_or(mean);
            // filters with negative lobes may leave a dark tile beside a bright one below 0
            -libm::log((luminance / mean).max(0.0) + FLOOR)
        });
        Importance { size: [width as f32, height as f32], tile, columns, ln_weights: ln_weights.collect() }
    }

    /// Whether every position on a film of that size has an importance.
    pub fn fits(&self, [width, height]: [u32; 2]) -> bool {
        let of_size = self.size == [width as f32, height as f32] && self.tile > 0;
        of_size && {
            let [columns, rows] = [width, height].map(|extent| extent.div_ceil(self.tile));
            self.columns == columns && self.ln_weights.len() as u64 == u64::from(columns) * u64::from(rows)
        }
    }

    /// ln Σ W · luminance over all parts of a contribution whose ln g is the luminance of the whole; −∞ where there is
    /// none.
    #[inline(always)]
    pub fn ln_weighed(&self, whole: Whole) -> f64 {
        if whole.elsewhere.is_empty() {
            return whole.main.ln_g + self.ln_at(whole.main.film);
        }
        // of the sum, not of its terms: one of them may be 0
        libm::log(whole.parts().map(|part| libm::exp(self.ln_at(part.film)) * part.luminance()).sum())
    }

    /// ln W at a film position, given as fractions of width and height.
    #[inline(always)]
    pub fn ln_at(&self, film: [f32; 2]) -> f64 {
        let [x, y] = [0, 1].map(|i| ((film[i] * self.size[i]) as u32).min(self.size[i] as u32 - 1) / self.tile);
        self.ln_weights[(y * self.columns + x) as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        path::{Contribution, Elsewhere, FilmSplat},
        scene::Rgb,
    };

    /// A filter with negative lobes swings below 0 beside a lamp; chains must not be told NaN there.
    #[test]
    fn tiles_below_zero_are_wanted_as_dark_ones_are() {
        let mut found = vec![[1.0, 1.0]; 256];
        (0..256).filter(|i| i % 16 >= 12).for_each(|i| found[i] = [100.0, 1.0]);
        (0..256).filter(|i| i % 16 < 12).for_each(|i| found[i] = [-30.0, 1.0]);
        let importance = Importance::new([16, 16], &found);
        assert_eq!(importance.ln_at([0.1, 0.1]), -(0.5f64).ln());
    }

    #[test]
    fn bright_tiles_count_less_and_single_bright_samples_nothing() {
        // 16 × 16 pixels of one point each: tiles of 12; the right ones are a lamp, the left have a firefly
        let mut found = vec![[1.0, 1.0]; 256];
        (0..256).filter(|i| i % 16 >= 12).for_each(|i| found[i] = [100.0, 1.0]);
        found[3] = [1e6, 1.0];
        let importance = Importance::new([16, 16], &found);
        assert_eq!(importance.tile, 12);
        let mean = found.iter().map(|f| f[0]).sum::<f64>() / 256.0;
        for (x, luminance) in [(0.1, 1.0), (0.9, 100.0)] {
            let expected = -(luminance / mean + 0.5).ln();
            assert!((importance.ln_at([x, 0.1]) - expected).abs() < 1e-12, "at {x}");
        }
    }

    #[test]
    fn parts_of_a_contribution_are_weighed_where_they_are() {
        let mut found = vec![[1.0, 1000.0]; 4];
        found[3][0] = 9.0; // the tile on the lower right is bright
        let importance = Importance::new([2, 2], &found);
        let splat = |x: f32, value: f32| FilmSplat { film: [x, 0.75], rgb: Rgb::splat(value) };
        let [left, right] = [0.25, 0.75].map(|x| importance.ln_at([x, 0.75]).exp());
        assert!(left > right);
        for (main, others, expected) in [
            (2.0, vec![], 2.0 * left),
            (2.0, vec![splat(0.75, 3.0), splat(0.25, 5.0)], 7.0 * left + 3.0 * right),
            (0.0, vec![splat(0.75, 3.0)], 3.0 * right),
            (2.0, vec![splat(0.75, 0.0)], 2.0 * left),
            (0.0, vec![splat(0.75, 0.0)], 0.0),
        ] {
            let mut elsewhere = Elsewhere::new(1);
            others.iter().for_each(|splat| elsewhere.push(0, *splat));
            let (main, _) = Contribution::settle_whole([0.25, 0.75], Rgb::splat(main), &mut elsewhere, 0);
            let got = importance.ln_weighed(Whole { main: &main, elsewhere: &others });
            assert!(got == f64::NEG_INFINITY && expected == 0.0 || (got - expected.ln()).abs() < 1e-6, "{got}");
        }
    }

    #[test]
    fn every_film_position_has_an_importance() {
        let importance = Importance::new([5, 3], &[[1.0, 1000.0]; 15]);
        for x in [0.0, 0.5, 0.999_999_9, 1.0] {
            assert!(importance.ln_at([x, 1.0]).is_finite());
        }
    }
}
