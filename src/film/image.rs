//! Images in memory.

use serde::{Deserialize, Serialize};

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

/// What a pixel holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum PixelFormat {
    /// Red, green and blue.
    #[default]
    Rgb,
    /// The relative luminance Y alone.
    Luminance,
}

/// Where an image lies in a larger one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Window {
    /// Width and height in pixels of the whole.
    pub whole: [u32; 2],
    /// Columns of the whole to the left of the image, and rows above it.
    pub offset: [u32; 2],
}

impl Window {
    /// Of an image that is the whole.
    pub const fn on_whole(width: u32, height: u32) -> Window {
        Window { whole: [width, height], offset: [0; 2] }
    }
}

/// Relative luminance Y of linear RGB with Rec. 709 primaries and white D65 (ITU-R BT.709), in the six digits that
/// Mitsuba has. Not [`LUMINANCE`], which is what chains follow.
pub(crate) const RELATIVE_LUMINANCE: [f32; 3] = [0.212_671, 0.715_16, 0.072_169];

/// Y of linear RGB.
pub(crate) fn relative_luminance(rgb: [f64; 3]) -> f64 {
    rgb.into_iter().zip(RELATIVE_LUMINANCE).map(|(value, weight)| value * f64::from(weight)).sum()
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

    /// The image as it looks without colours: every channel is the pixel's relative luminance Y.
    pub fn without_colour(&self) -> Image {
        let y = |rgb: &[f32; 3]| rgb.iter().zip(RELATIVE_LUMINANCE).map(|(value, weight)| value * weight).sum();
        Image { pixels: self.pixels.iter().map(|rgb| [y(rgb); 3]).collect(), ..*self }
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
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_has_luminance_one() {
        let white = Image::constant(1, 1, [1.0; 3]);
        assert!((white.luminance()[0] - 1.0).abs() < 1e-6);
        assert!((white.without_colour().pixels[0][0] - 1.0).abs() < 1e-6);
    }
}
