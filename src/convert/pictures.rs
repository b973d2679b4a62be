//! Pictures whose pixels a conversion has to compute with.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use super::spectra::linear_of_srgb;
use crate::film::{Image, exr_file};

/// Most pixels of a picture that is computed with; keeps hostile headers from exhausting the memory.
const MOST_PIXELS: u64 = 1 << 28;

/// Reads PNG or OpenEXR as linear colours, without opacity; with `raw`, the numbers of the file as they are, bytes as
/// parts of 255.
pub(super) fn read(path: &Path, raw: bool) -> Result<Image, String> {
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    match &extension[..] {
        "png" => read_png(path, raw).map_err(|message| format!("{}: {message}", path.display())),
        "exr" => exr_file::read_file(path).map(|contents| contents.image).map_err(|error| error.to_string()),
        _ => Err(format!("{}: computing with pixels needs PNG or OpenEXR", path.display())),
    }
}

fn read_png(path: &Path, raw: bool) -> Result<Image, String> {
    let file = File::open(path).map_err(|error| format!("cannot be read: {error}"))?;
    let mut decoder = png::Decoder::new(BufReader::new(file));
    decoder.set_transformations(png::Transformations::EXPAND);
    let mut reader = decoder.read_info().map_err(|error| error.to_string())?;
    let (width, height) = (reader.info().width, reader.info().height);
    if u64::from(width) * u64::from(height) > MOST_PIXELS {
        return Err(format!("{width} × {height} pixels are too many"));
    }
    let size = reader.output_buffer_size().ok_or("its size is beyond what a machine can hold")?;
    let mut bytes = vec![0; size];
    let info = reader.next_frame(&mut bytes).map_err(|error| error.to_string())?;
    bytes.truncate(info.buffer_size());
    let values: Vec<f64> = match info.bit_depth {
        png::BitDepth::Sixteen => {
            bytes.as_chunks().0.iter().map(|pair| f64::from(u16::from_be_bytes(*pair)) / 65535.0).collect()
        }
        _ => bytes.iter().map(|byte| f64::from(*byte) / 255.0).collect(),
    };
    let channels = info.color_type.samples();
    let decode = |value: f64| (if raw { value } else { linear_of_srgb(value) }) as f32;
    let pixel = |values: &[f64]| match values {
        [r, g, b, ..] => [*r, *g, *b].map(decode),
        [grey, ..] => [decode(*grey); 3],
        [] => unreachable!("every colour type has a channel"),
    };
    Ok(Image::new(width, height, values.chunks_exact(channels).map(pixel).collect()))
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
