//! Images in memory and how far they are from one another.

/// The paper's luminance of linear RGB; also what the scalar contribution g is made with.
pub const LUMINANCE: [f32; 3] = [0.299, 0.587, 0.114];

/// Linear RGB (Rec. 709 primaries), row by row, top row first.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Image {
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width` · `height` colours.
    pub pixels: Vec<[f32; 3]>,
}

/// A named layer's content: colours or one number a pixel.
#[derive(Clone, Debug, PartialEq)]
pub enum Plane {
    /// A colour a pixel.
    Rgb(Image),
    /// A number a pixel, in the order of [`Image::pixels`].
    Gray(Vec<f32>),
}

impl Image {
    /// An image of the given pixels.
    ///
    /// # Panics
    /// If their number is not `width` · `height`.
    pub fn new(width: u32, height: u32, pixels: Vec<[f32; 3]>) -> Image {
        assert_eq!(pixels.len(), width as usize * height as usize, "pixels of a {width} × {height} image");
        Image { width, height, pixels }
    }

    /// The same colour everywhere.
    pub fn constant(width: u32, height: u32, rgb: [f32; 3]) -> Image {
        Image { width, height, pixels: vec![rgb; width as usize * height as usize] }
    }

    /// Luminance of every pixel, weights [`LUMINANCE`].
    pub fn luminance(&self) -> Vec<f32> {
        self.pixels.iter().map(|rgb| rgb.iter().zip(LUMINANCE).map(|(value, weight)| value * weight).sum()).collect()
    }

    /// Mean of each channel.
    pub fn mean(&self) -> [f64; 3] {
        let mut sums = [0.0; 3];
        for rgb in &self.pixels {
            for (sum, value) in sums.iter_mut().zip(rgb) {
                *sum += f64::from(*value);
            }
        }
        sums.map(|sum| sum / self.pixels.len() as f64)
    }

    /// relMSE: mean over pixels and channels of (x − r)² / (r² + 0.01), where 0.01 keeps dark pixels from
    /// deciding alone.
    pub fn rel_mse(&self, reference: &Image) -> f64 {
        const FLOOR: f64 = 0.01;
        self.mean_over(reference, |x, r| (x - r).powi(2) / (r * r + FLOOR))
    }

    /// Root of the mean over pixels and channels of (x − r)².
    pub fn rmse(&self, reference: &Image) -> f64 {
        self.mean_over(reference, |x, r| (x - r).powi(2)).sqrt()
    }

    /// Σ x / Σ r over all pixels and channels: what remains different when all noise is averaged away.
    pub fn mean_ratio(&self, reference: &Image) -> f64 {
        self.mean_over(reference, |x, _| x) / self.mean_over(reference, |_, r| r)
    }

    fn mean_over(&self, reference: &Image, error: impl Fn(f64, f64) -> f64) -> f64 {
        assert_eq!((self.width, self.height), (reference.width, reference.height), "images of different sizes");
        let (ours, theirs) = (self.pixels.as_flattened(), reference.pixels.as_flattened());
        let sum: f64 = ours.iter().zip(theirs).map(|(&x, &r)| error(f64::from(x), f64::from(r))).sum();
        sum / ours.len() as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_what_their_formulas_say() {
        let reference = Image::new(2, 1, vec![[1.0, 0.5, 0.0], [2.0, 0.0, 0.1]]);
        let mut image = reference.clone();
        assert_eq!((image.rel_mse(&reference), image.rmse(&reference), image.mean_ratio(&reference)), (0.0, 0.0, 1.0));
        image.pixels[0][2] = 0.3;
        assert!((image.rel_mse(&reference) - 0.09 / 0.01 / 6.0).abs() < 1e-6);
        assert!((image.rmse(&reference) - (0.09f64 / 6.0).sqrt()).abs() < 1e-7);
        assert!((image.mean_ratio(&reference) - 3.9 / 3.6).abs() < 1e-7);
    }

    #[test]
    fn white_has_luminance_one() {
        assert!((Image::constant(1, 1, [1.0; 3]).luminance()[0] - 1.0).abs() < 1e-6);
    }
}
