//! How far an image is from a reference.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::film::exr_file::{self, Contents};
use crate::film::{Image, Plane};

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

/// Layer of a reference's file with the variance of its mean.
pub const VARIANCE: &str = "variance";

impl Reference {
    /// Reads an OpenEXR file: the mean in `R`, `G`, `B` and, where they are there, the variance of that mean in
    /// `variance.R`, `.G`, `.B`.
    ///
    /// # Errors
    /// Everything that keeps the file from counting as the truth, one sentence each with the file in front: it cannot be
    /// read, it has no pixels, values of the mean are not finite, variances are not finite or negative.
    pub fn read(path: &Path) -> Result<Reference, Vec<String>> {
        let contents = exr_file::read_file(path).map_err(|error| vec![error.to_string()])?;
        let (faults, reference) = Reference::of(contents);
        if faults.is_empty() {
            Ok(reference)
        } else {
            Err(faults.iter().map(|fault| format!("{}: {fault}", path.display())).collect())
        }
    }

    /// What a file's contents amount to, with what is wrong about that.
    fn of(contents: Contents) -> (Vec<String>, Reference) {
        let mut faults = faults(&contents.image);
        let mut variance = None;
        for (name, plane) in contents.layers {
            match plane {
                Plane::Rgb(layer) if name == VARIANCE => {
                    faults.extend(variance_faults(&layer));
                    variance = Some(layer);
                }
                Plane::Gray(_) if name == VARIANCE || name.starts_with("variance.") => {
                    faults.push(format!(
                        "layer {name} has one channel; a variance has variance.R, variance.G, variance.B"
                    ));
                }
                _ => {}
            }
        }
        (faults, Reference { image: contents.image, variance })
    }

    /// The reference with fewer pixels, where it is larger by the same whole factor k across and down; itself for k = 1.
    ///
    /// A pixel is the mean over k × k of ours: what the same renderer had made at that size with the box filter. Its
    /// variance is the mean of their variances over k², their noise being independent.
    pub fn shrunk_to(&self, width: u32, height: u32) -> Option<Reference> {
        let k = self.image.width.checked_div(width)?;
        let fits = |whole, part| k > 0 && k.checked_mul(part) == Some(whole);
        (fits(self.image.width, width) && fits(self.image.height, height)).then(|| Reference {
            image: tile_means(&self.image, k, 1.0),
            variance: self.variance.as_ref().map(|variance| tile_means(variance, k, f64::from(k * k).recip())),
        })
    }
}

/// Means over tiles of k × k pixels, `factor` times each.
fn tile_means(image: &Image, k: u32, factor: f64) -> Image {
    let (width, height) = (image.width / k, image.height / k);
    let factor = factor / f64::from(k * k);
    let row = |y: u32| &image.pixels[y as usize * image.width as usize..][..image.width as usize];
    let tile = |x: u32, y: u32, c: usize| {
        let rows = (k * y..k * (y + 1)).map(row);
        let sum: f64 = rows.flat_map(|row| &row[(k * x) as usize..][..k as usize]).map(|rgb| f64::from(rgb[c])).sum();
        (factor * sum) as f32
    };
    let places = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    Image { width, height, pixels: places.map(|(x, y)| [0, 1, 2].map(|c| tile(x, y, c))).collect() }
}

/// The first value that is not finite, row by row from the top: x, y (from 0, at the upper left), channel, value.
pub fn non_finite(image: &Image) -> Option<(u32, u32, char, f32)> {
    first_value(image, |value| !value.is_finite())
}

fn first_value(image: &Image, wanted: impl Fn(f32) -> bool) -> Option<(u32, u32, char, f32)> {
    let values = image.pixels.as_flattened();
    let i = values.iter().position(|value| wanted(*value))?;
    let pixel = i / 3;
    let (x, y) = (pixel % image.width as usize, pixel / image.width as usize);
    Some((x as u32, y as u32, ['R', 'G', 'B'][i % 3], values[i]))
}

/// Why an image cannot be compared with anything: it has no pixels, or values that are not finite.
pub fn faults(image: &Image) -> Vec<String> {
    if image.pixels.is_empty() {
        return vec!["it has no pixels".into()];
    }
    non_finite(image)
        .map(|place| fault_at(image, "", place, "not finite", |value| !value.is_finite()))
        .into_iter()
        .collect()
}

fn variance_faults(variance: &Image) -> Vec<String> {
    let wrong = |value: f32| !value.is_finite() || value < 0.0;
    let place = first_value(variance, wrong);
    place.map(|place| fault_at(variance, "variance.", place, "not finite or below 0", wrong)).into_iter().collect()
}

/// The first of some faulty values and how many there are.
fn fault_at(
    image: &Image,
    layer: &str,
    (x, y, channel, value): (u32, u32, char, f32),
    what: &str,
    wrong: impl Fn(f32) -> bool,
) -> String {
    let count = image.pixels.as_flattened().iter().filter(|value| wrong(**value)).count();
    let others = match count {
        1 => String::new(),
        _ => format!(" (the first of {count} such values)"),
    };
    format!("pixel ({x}, {y}), channel {layer}{channel}: {value} is {what}{others}")
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

#[cfg(test)]
mod tests {
    use super::*;

    fn reference(width: u32, height: u32, variance: impl Fn(usize) -> f32) -> Reference {
        let n = (width * height) as usize;
        let image = Image::new(width, height, (0..n).map(|i| [i as f32, 2.0 * i as f32, 0.5]).collect());
        let variance = Image::new(width, height, (0..n).map(|i| [variance(i), 1.0, 0.0]).collect());
        Reference { image, variance: Some(variance) }
    }

    #[test]
    fn a_reference_shrinks_by_the_same_whole_factor_in_both_directions() {
        let large = reference(4, 2, |i| i as f32);
        let small = large.shrunk_to(2, 1).unwrap();
        // tiles of pixels 0 1 4 5 and 2 3 6 7
        assert_eq!(small.image, Image::new(2, 1, vec![[2.5, 5.0, 0.5], [4.5, 9.0, 0.5]]));
        assert_eq!(small.variance, Some(Image::new(2, 1, vec![[2.5 / 4.0, 0.25, 0.0], [4.5 / 4.0, 0.25, 0.0]])));
        assert_eq!(large.shrunk_to(4, 2), Some(large.clone()));
        for (width, height) in [(2, 2), (4, 1), (1, 1), (8, 4), (3, 2), (0, 0), (2, 0), (0, 1)] {
            assert_eq!(large.shrunk_to(width, height), None, "{width} × {height}");
        }
    }
}
