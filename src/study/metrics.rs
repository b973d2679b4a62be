//! How far an image is from a reference.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::film::exr_file::{self, Contents};
use crate::film::{Image, Plane};

/// Keeps dark pixels from deciding relMSE alone (the constant that is customary, so that figures compare).
pub(super) const FLOOR: f64 = 0.01;

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
    /// Standard error of [`mean_ratio`](Errors::mean_ratio) that comes of the reference's own noise, 0 where that is not
    /// known. Pixels are taken as independent and the channels of a pixel as varying together, as they do where it is
    /// the amount of light that is noisy: Var Σ r = Σ over pixels of (√v_R + √v_G + √v_B)².
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
        let deviation = |pixel: usize| -> f64 {
            let variance = reference.variance.as_ref().map_or([0.0; 3], |variance| variance.pixels[pixel]);
            variance.map(|v| f64::from(v).sqrt()).iter().sum()
        };
        let [mse, rel_mse, smape, ours, theirs, variance, noise] = means(reference, |i, r, v| {
            let x = f64::from(image.pixels.as_flattened()[i]);
            let (square, weight) = ((x - r).powi(2) - v, 1.0 / (r * r + FLOOR));
            let smape = if x == r { 0.0 } else { 2.0 * (x - r).abs() / (x.abs() + r.abs()) };
            [square, square * weight, smape, x, r, v.sqrt() * deviation(i / 3), v * weight]
        });
        let n = truth.pixels.as_flattened().len() as f64;
        Errors {
            mse,
            rel_mse,
            smape,
            mean_ratio: ours / theirs,
            mean_ratio_error: ours / theirs * (variance / n).sqrt() / theirs,
            reference_rel_mse: noise,
        }
    }

    /// Root of the mean squared error; 0 where the corrected square is below 0.
    pub fn rmse(&self) -> f64 {
        self.mse.max(0.0).sqrt()
    }
}

/// Errors of a reference by its own variance: what they amount to for an image that is exactly right.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// mean(v).
    pub mse: f64,
    /// mean(v / (r² + 0.01)).
    pub rel_mse: f64,
}

impl Reference {
    /// Its own noise, where the file tells it.
    pub fn noise(&self) -> Option<Noise> {
        self.variance.as_ref()?;
        let [mse, rel_mse] = means(self, |_, r, v| [v, v / (r * r + FLOOR)]);
        Some(Noise { mse, rel_mse })
    }
}

/// Means over pixels and channels of what `terms` makes of a value's number, the reference there and its variance (0
/// where that is not known).
///
/// Sums are taken a row at a time and then over rows, so that rounding grows with the sides of an image and not with its
/// area.
fn means<const N: usize>(reference: &Reference, terms: impl Fn(usize, f64, f64) -> [f64; N]) -> [f64; N] {
    let add = |mut sums: [f64; N], terms: [f64; N]| {
        sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
        sums
    };
    let truth = reference.image.pixels.as_flattened();
    let variances = reference.variance.as_ref().map(|image| image.pixels.as_flattened());
    let row = 3 * reference.image.width as usize;
    let of = |i: usize| terms(i, f64::from(truth[i]), variances.map_or(0.0, |variances| f64::from(variances[i])));
    let of_row = |y: usize| (y * row..(y + 1) * row).map(of).fold([0.0; N], add);
    let sums = (0..reference.image.height as usize).map(of_row).fold([0.0; N], add);
    sums.map(|sum| sum / truth.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{Counter, Purpose, Rng, unit_f32};

    fn reference(width: u32, height: u32, variance: impl Fn(usize) -> f32) -> Reference {
        let n = (width * height) as usize;
        let image = Image::new(width, height, (0..n).map(|i| [i as f32, 2.0 * i as f32, 0.5]).collect());
        let variance = Image::new(width, height, (0..n).map(|i| [variance(i), 1.0, 0.0]).collect());
        Reference { image, variance: Some(variance) }
    }

    /// One row of two pixels, with every term of the formulas written out.
    #[test]
    fn errors_are_what_their_formulas_say() {
        let image = Image::new(2, 1, vec![[1.5, 0.5, 0.0], [1.0, 0.25, 0.0]]);
        let truth = Image::new(2, 1, vec![[1.0, 0.5, 0.0], [2.0, 0.0, 0.5]]);
        let squares = [0.25, 0.0, 0.0, 1.0, 0.0625, 0.25];
        let floors = [1.01, 0.26, 0.01, 4.01, 0.01, 0.26];
        let mean = |terms: [f64; 6]| terms.iter().sum::<f64>() / 6.0;
        let over = |terms: [f64; 6]| mean(std::array::from_fn(|i| terms[i] / floors[i]));

        let plain = Errors::of(&image, &Reference { image: truth.clone(), variance: None });
        assert!((plain.mse - mean(squares)).abs() < 1e-15);
        assert!((plain.rmse() - mean(squares).sqrt()).abs() < 1e-15);
        assert!((plain.rel_mse - over(squares)).abs() < 1e-14);
        assert!((plain.smape - mean([0.4, 0.0, 0.0, 2.0 / 3.0, 2.0, 2.0])).abs() < 1e-15, "a pair of zeros counts 0");
        assert!((plain.mean_ratio - 3.25 / 4.0).abs() < 1e-15);
        assert_eq!((plain.mean_ratio_error, plain.reference_rel_mse), (0.0, 0.0));

        let variances = [0.125, 0.0, 0.0625, 0.25, 0.0, 0.5];
        let variance = Image::new(2, 1, vec![[0.125, 0.0, 0.0625], [0.25, 0.0, 0.5]]);
        let reference = Reference { image: truth, variance: Some(variance) };
        let corrected = Errors::of(&image, &reference);
        assert!((corrected.mse - (mean(squares) - mean(variances))).abs() < 1e-15);
        assert!((corrected.rel_mse - (over(squares) - over(variances))).abs() < 1e-14);
        assert!((corrected.reference_rel_mse - over(variances)).abs() < 1e-14);
        assert_eq!((corrected.smape, corrected.mean_ratio), (plain.smape, plain.mean_ratio), "these are not corrected");
        // Σ r = 4; channels vary together
        let of_sum = (0.125f64.sqrt() + 0.25).powi(2) + (0.5 + 0.5f64.sqrt()).powi(2);
        assert!((corrected.mean_ratio_error - 3.25 / 4.0 * of_sum.sqrt() / 4.0).abs() < 1e-15);
        let noise = reference.noise().unwrap();
        assert!((noise.mse - mean(variances)).abs() < 1e-15 && noise.rel_mse == corrected.reference_rel_mse);
    }

    #[test]
    fn an_equal_image_has_no_error() {
        let reference = reference(3, 2, |_| 0.0);
        let errors = Errors::of(&reference.image, &Reference { variance: None, ..reference.clone() });
        assert_eq!(errors, Errors { mean_ratio: 1.0, ..Errors::default() });
        let corrected = Errors::of(&reference.image, &reference);
        assert!(corrected.mse < 0.0 && corrected.rmse() == 0.0, "closer than the noise lets expect");
    }

    /// Pairs x = t + a, r = t + b with independent noise a, b: corrected errors are those of a alone.
    ///
    /// Over 64² · 3 values the mean of (a − b)² − v has a relative standard error of about √2 · 2/√12288 = 2.6 % of
    /// E[a²]; twice that each way keeps a wrong correction (by E[b²] = E[a²]) far off.
    #[test]
    fn the_correction_leaves_the_error_of_the_image_alone() {
        const N: u32 = 64;
        let rng = Rng::new(1);
        let noise = |replica, i: u32| {
            let counter = Counter { ladder: i, replica, step: 0, purpose: Purpose::Primary };
            let [r, g, b, _] = rng.words(counter, 0).map(|word| unit_f32(word) - 0.5);
            [4.0 + r, 4.0 + g, 4.0 + b]
        };
        let [image, truth] = [0, 1].map(|which| Image::new(N, N, (0..N * N).map(|i| noise(which, i)).collect()));
        let variance = 1.0 / 12.0; // of a number that is uniform in an interval of length 1
        let reference = Reference { image: truth, variance: Some(Image::constant(N, N, [variance as f32; 3])) };
        let errors = Errors::of(&image, &reference);
        assert!((errors.mse / variance - 1.0).abs() < 0.06, "{}", errors.mse);
        let plain = Errors::of(&image, &Reference { variance: None, ..reference.clone() });
        assert!((plain.mse / variance - 2.0).abs() < 0.06, "{}", plain.mse);
    }

    #[test]
    fn faults_of_a_reference_are_all_told_with_their_places() {
        let of = |image: &Image, layers: &[(String, Plane)]| {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("r.exr");
            exr_file::write(&path, image, layers, &[]).unwrap();
            let place = format!("{}: ", path.display());
            Reference::read(&path)
                .map_err(|faults| faults.iter().map(|fault| fault.replace(&place, "")).collect::<Vec<_>>())
        };
        let good = reference(3, 2, |i| i as f32);
        let layer = |image: &Image| vec![(VARIANCE.to_owned(), Plane::Rgb(image.clone()))];
        let variance = good.variance.clone().unwrap();
        assert_eq!(of(&good.image, &layer(&variance)), Ok(good.clone()));
        assert_eq!(of(&good.image, &[]).unwrap().variance, None);

        let (mut image, mut negative) = (good.image.clone(), variance);
        image.pixels[5][1] = f32::INFINITY;
        image.pixels[4][2] = f32::NAN;
        negative.pixels[2][0] = -0.5;
        let faults = of(&image, &layer(&negative)).unwrap_err();
        assert_eq!(
            faults,
            [
                "pixel (1, 1), channel B: NaN is not finite (the first of 2 such values)",
                "pixel (2, 0), channel variance.R: -0.5 is not finite or below 0"
            ]
        );
        let gray = of(&good.image, &[("variance".into(), Plane::Gray(vec![0.0; 6]))]).unwrap_err();
        assert!(gray[0].contains("variance.R, variance.G, variance.B"), "{gray:?}");
        let nowhere = Reference::read(Path::new("nowhere.exr")).unwrap_err();
        assert!(nowhere.len() == 1 && nowhere[0].contains("cannot read nowhere.exr"), "{nowhere:?}");
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
