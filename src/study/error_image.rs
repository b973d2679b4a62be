//! Errors as pictures: numbers by pixel and the colours they are shown in.
//!
//! Both colour maps are straight in OKLab (Ottosson 2020), so that equal steps of a number look equally large, and have
//! a lightness that only rises or only falls with the size of the error, so that they read without colours too.

use std::f32::consts::{PI, TAU};

use super::metrics::FLOOR;
use crate::film::Image;

/// Signed relative error of every channel, (x − r)/√(r² + 0.01), whose mean square is relMSE.
///
/// # Panics
/// If sizes differ; so do the others.
pub fn relative(image: &Image, reference: &Image) -> Image {
    assert_eq!((image.width, image.height), (reference.width, reference.height), "images of different sizes");
    let pairs = image.pixels.iter().zip(&reference.pixels);
    let pixels = pairs.map(|(x, r)| [0, 1, 2].map(|c| relative_error(x[c], r[c]))).collect();
    Image::new(image.width, image.height, pixels)
}

fn relative_error(x: f32, r: f32) -> f32 {
    (x - r) / (r * r + FLOOR as f32).sqrt()
}

/// The signed relative error of luminance in colours, linear RGB: white where there is none, blue where the image is too
/// dark, red where it is too bright, full colours from an error of `range` on. Colours go with the square root of the
/// error, so that a hundredth of the range is visible and a quarter is not the whole.
pub fn signed_colours(image: &Image, reference: &Image, range: f32) -> Image {
    assert_eq!((image.width, image.height), (reference.width, reference.height), "images of different sizes");
    let errors = image.luminance().into_iter().zip(reference.luminance()).map(|(x, r)| relative_error(x, r));
    Image::new(image.width, image.height, errors.map(|error| signed_colour(error / range)).collect())
}

/// The colours of errors from minus the range to the range, a row of so many pixels, evenly by square root.
pub fn signed_strip(width: u32) -> Image {
    let root = |i: u32| 2.0 * i as f32 / (width.max(2) - 1) as f32 - 1.0;
    Image::new(width, 1, (0..width).map(|i| diverging(root(i))).collect())
}

fn signed_colour(error: f32) -> [f32; 3] {
    diverging(error.abs().sqrt().copysign(error))
}

/// Numbers from 0 to 1 in colours, linear RGB: black, violet, red, orange, pale yellow.
pub fn rising_colours(width: u32, height: u32, values: &[f32]) -> Image {
    Image::new(width, height, values.iter().map(|value| rising(*value)).collect())
}

/// White at 0, blue at −1 and below, red at 1 and above.
fn diverging(value: f32) -> [f32; 3] {
    const BLUE: f32 = 262.0 / 360.0;
    const RED: f32 = 27.0 / 360.0;
    let size = value.abs().min(1.0); // 1 for NaN
    oklch(1.0 - 0.55 * size, 0.2 * size, if value < 0.0 { BLUE } else { RED })
}

/// Black at 0, nearly white at 1; hues turn from violet over red to yellow.
fn rising(value: f32) -> [f32; 3] {
    let value = value.clamp(0.0, 1.0);
    oklch(0.98 * value, 0.2 * (PI * value).sin(), (290.0 + 175.0 * value) / 360.0)
}

/// Linear RGB of a lightness (0 to 1), chroma and hue (in turns) in OKLab, clamped to what a screen can show.
fn oklch(lightness: f32, chroma: f32, hue: f32) -> [f32; 3] {
    /// Roots of cone responses by lightness, green-red and blue-yellow.
    const ROOTS: [[f32; 3]; 3] =
        [[1.0, 0.396_337_78, 0.215_803_76], [1.0, -0.105_561_346, -0.063_854_17], [1.0, -0.089_484_18, -1.291_485_5]];
    /// Linear RGB by cone responses.
    const RGB: [[f32; 3]; 3] = [
        [4.076_741_7, -3.307_711_6, 0.230_969_94],
        [-1.268_438, 2.609_757_4, -0.341_319_38],
        [-0.004_196_086_3, -0.703_418_6, 1.707_614_7],
    ];
    let times = |matrix: [[f32; 3]; 3], v: [f32; 3]| matrix.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2]);
    let (sin, cos) = (TAU * hue).sin_cos();
    let cones = times(ROOTS, [lightness, chroma * cos, chroma * sin]).map(|root| root.powi(3));
    times(RGB, cones).map(|value| value.clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::png_file::srgb_byte;

    fn lightness(rgb: [f32; 3]) -> f32 {
        0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]
    }

    #[test]
    fn no_error_is_white_and_signs_have_colours() {
        let reference = Image::constant(4, 1, [0.4; 3]);
        let mut image = reference.clone();
        let (step, half) = (0.05 * 17f32.sqrt(), [1, 2]); // √(0.4² + 0.01) = √17/10, half of which makes an error of 0.5
        image.pixels[half[0]] = [0.4 + step; 3];
        image.pixels[half[1]] = [0.4 - step; 3];
        image.pixels[3] = [9.0; 3];
        let relative = relative(&image, &reference);
        assert!((relative.pixels[1][0] - 0.5).abs() < 1e-6 && (relative.pixels[2][2] + 0.5).abs() < 1e-6);
        let [none, bright, dark, beyond] = signed_colours(&image, &reference, 0.5).pixels[..] else { panic!() };
        assert_eq!(none.map(srgb_byte), [255; 3]);
        assert!(bright[0] > 4.0 * bright[1] && bright[0] > 4.0 * bright[2], "{bright:?} is red");
        assert!(dark[2] > 4.0 * dark[0] && dark[2] > 2.0 * dark[1], "{dark:?} is blue");
        assert!((0..3).all(|c| (beyond[c] - bright[c]).abs() < 1e-5), "colours are full at the range: {beyond:?}");
        let quarter = signed_colours(&image, &reference, 2.0).pixels[1];
        assert!((0..3).all(|c| (quarter[c] - diverging(0.5)[c]).abs() < 1e-5), "half of them at a quarter of it");
        let strip = signed_strip(201).pixels;
        assert_eq!([strip[0], strip[100], strip[200]], [diverging(-1.0), diverging(0.0), diverging(1.0)]);
        assert_eq!(signed_colour(f32::NAN), diverging(1.0), "what is no number is as wrong as can be");
    }

    #[test]
    fn lightness_tells_the_size_of_an_error() {
        let steps = || (0..=50).map(|i| i as f32 / 50.0);
        for (name, colours) in [
            ("rising", steps().map(rising).collect::<Vec<_>>()),
            ("too bright", steps().map(|t| diverging(1.0 - t)).collect()),
            ("too dark", steps().map(|t| diverging(t - 1.0)).collect()),
        ] {
            for pair in colours.windows(2) {
                assert!(lightness(pair[1]) > lightness(pair[0]), "{name}: {pair:?}");
            }
        }
        assert_eq!(rising(0.0).map(srgb_byte), [0; 3]);
        assert!(lightness(rising(1.0)) > 0.9);
    }
}
