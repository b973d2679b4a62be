//! Pictures whose pixels a conversion has to compute with.

use std::path::Path;

use super::spectra::linear_of_srgb;
use crate::film::Image;
use crate::load::images;
use crate::scene::textures::Texels;

/// Reads a picture as linear colours, without opacity; with `raw`, the numbers of the file as they are, bytes as parts
/// of 255.
pub(super) fn read(path: &Path, raw: bool) -> Result<Image, String> {
    let picture = images::read(path)?;
    let decode = |value: f64| (if raw { value } else { linear_of_srgb(value) }) as f32;
    let pixels = match picture.texels {
        Texels::Floats(pixels) => pixels,
        Texels::Bytes(bytes) => {
            let decoded: [f32; 256] = std::array::from_fn(|byte| decode(byte as f64 / 255.0));
            bytes.iter().map(|rgb| rgb.map(|byte| decoded[usize::from(byte)])).collect()
        }
        Texels::Words(words) => words.iter().map(|rgb| rgb.map(|word| decode(f64::from(word) / 65535.0))).collect(),
    };
    Ok(Image::new(picture.width, picture.height, pixels))
}

/// The value at a place in the unit square, (0, 0) at the corner of the first pixel, linear between the centres of
/// pixels and constant beyond the outermost of them.
pub(super) fn bilinear(image: &Image, u: f64, v: f64) -> [f64; 3] {
    let axis = |t: f64, size: u32| {
        let x = (t * f64::from(size) - 0.5).clamp(0.0, f64::from(size - 1));
        let low = x as u32;
        (low, (low + 1).min(size - 1), x - f64::from(low))
    };
    let (x0, x1, fx) = axis(u, image.width);
    let (y0, y1, fy) = axis(v, image.height);
    let at = |x: u32, y: u32| image.pixels[y as usize * image.width as usize + x as usize].map(f64::from);
    let mix = |a: [f64; 3], b: [f64; 3], f: f64| [0, 1, 2].map(|c| a[c] + (b[c] - a[c]) * f);
    mix(mix(at(x0, y0), at(x1, y0), fx), mix(at(x0, y1), at(x1, y1), fx), fy)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::png_file;

    #[test]
    fn what_a_preview_shows_is_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("p.png");
        let image = Image::new(2, 1, vec![[0.0, 0.18, 1.0], [0.5, 0.02, 0.8]]);
        png_file::write(&path, &image).unwrap();
        let read = super::read(&path, false).unwrap();
        for (a, b) in image.pixels.as_flattened().iter().zip(read.pixels.as_flattened()) {
            assert!((a - b).abs() < 0.005, "{a} {b}"); // half a step of 255 near white
        }
        let raw = super::read(&path, true).unwrap();
        assert!((raw.pixels[0][1] - 118.0 / 255.0).abs() < 1e-6); // the byte of linear 0.18
    }

    #[test]
    fn values_between_pixels_are_linear_and_end_at_the_border() {
        let image = Image::new(2, 1, vec![[0.0; 3], [1.0; 3]]);
        for (u, value) in [(0.0, 0.0), (0.25, 0.0), (0.5, 0.5), (0.75, 1.0), (1.0, 1.0)] {
            assert_eq!(bilinear(&image, u, 0.5), [value; 3]);
        }
    }
}
