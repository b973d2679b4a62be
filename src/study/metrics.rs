//! How far an image is from a reference.

use serde::{Deserialize, Serialize};

use crate::film::Image;

/// Keeps dark pixels from deciding relMSE alone (PEERS.md's constant, so that figures compare).
const FLOOR: f64 = 0.01;

/// An image that counts as the truth, with what is known of its own noise.
#[derive(Clone, Debug, PartialEq)]
pub struct Reference {
    /// The mean.
    pub image: Image,
    /// Variance of each value of [`image`](Reference::image); absent where the file does not tell.
    pub variance: Option<Image>,
}

/// Errors of an image x against a reference r, over pixels and channels.
///
/// Where the reference's variance v is known, squared errors are corrected by it: E[(x − r)²] is the true squared error
/// plus v for independent x and r. Corrected errors near 0 may come out negative, and say only that they are below what
/// the reference can tell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Errors {
    /// mean((x − r)² − v).
    pub mse: f64,
    /// mean(((x − r)² − v) / (r² + 0.01)).
    pub rel_mse: f64,
    /// Symmetric mean absolute percentage error as a fraction, mean(2 |x − r| / (|x| + |r|)), 0 to 2, a pair of zeros
    /// counting 0; not corrected.
    pub smape: f64,
    /// Σ x / Σ r: brightness.
    pub mean_ratio: f64,
    /// Standard error of [`mean_ratio`](Errors::mean_ratio) that comes of the reference's own noise; 0 where that is
    /// not known.
    pub mean_ratio_error: f64,
    /// What the reference's own variance adds to an uncorrected relMSE: mean(v / (r² + 0.01)); 0 where not known.
    pub reference_rel_mse: f64,
}

impl Errors {
    /// Errors of `image`.
    ///
    /// # Panics
    /// If sizes differ.
    pub fn of(image: &Image, reference: &Reference) -> Errors {
        let truth = &reference.image;
        assert_eq!((image.width, image.height), (truth.width, truth.height), "images of different sizes");
        let variances = reference.variance.as_ref().map(|image| image.pixels.as_flattened());
        let mut sums = Errors::default();
        let (mut ours, mut theirs, mut variance) = (0.0, 0.0, 0.0);
        for (i, (&x, &r)) in image.pixels.as_flattened().iter().zip(truth.pixels.as_flattened()).enumerate() {
            let (x, r) = (f64::from(x), f64::from(r));
            let v = variances.map_or(0.0, |variances| f64::from(variances[i]));
            let (square, weight) = ((x - r).powi(2) - v, 1.0 / (r * r + FLOOR));
            sums.mse += square;
            sums.rel_mse += square * weight;
            sums.reference_rel_mse += v * weight;
            if x != r {
                sums.smape += 2.0 * (x - r).abs() / (x.abs() + r.abs());
            }
            ours += x;
            theirs += r;
            variance += v;
        }
        let n = truth.pixels.as_flattened().len() as f64;
        Errors {
            mse: sums.mse / n,
            rel_mse: sums.rel_mse / n,
            smape: sums.smape / n,
            mean_ratio: ours / theirs,
            mean_ratio_error: ours / theirs * variance.sqrt() / theirs,
            reference_rel_mse: sums.reference_rel_mse / n,
        }
    }
}
