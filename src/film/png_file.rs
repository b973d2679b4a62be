//! PNG previews: 8 bits, sRGB, exposure 1.

use std::io::{BufWriter, Write};
use std::path::Path;

use super::file::{FileError, plain, write_whole};
use super::image::Image;

/// Writes the image as it looks on a screen: linear 1 is full brightness, what is brighter is clipped.
pub fn write(path: &Path, image: &Image) -> Result<(), FileError> {
    write_whole(path, |file| encode_to(file, image))
}

/// The same file in memory.
///
/// # Panics
/// If the image has no pixels.
pub fn encode(image: &Image) -> Vec<u8> {
    let mut file = Vec::new();
    encode_to(&mut file, image).expect("memory takes what is written");
    file
}

fn encode_to(file: impl Write, image: &Image) -> Result<(), String> {
    let bytes: Vec<u8> = image.pixels.as_flattened().iter().map(|&value| srgb_byte(value)).collect();
    let mut encoder = png::Encoder::new(BufWriter::new(file), image.width, image.height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_source_srgb(png::SrgbRenderingIntent::RelativeColorimetric);
    let written = encoder.write_header().and_then(|mut writer| {
        writer.write_image_data(&bytes)?;
        writer.finish()
    });
    written.map_err(|error| match error {
        png::EncodingError::IoError(error) => plain(&error),
        other => other.to_string(),
    })
}

/// The byte of a linear value, IEC 61966-2-1: 12.92 v up to 0.0031308, 1.055 v^(1/2.4) − 0.055 above.
pub fn srgb_byte(linear: f32) -> u8 {
    let value = f64::from(linear).clamp(0.0, 1.0);
    let encoded = if value <= 0.003_130_8 { 12.92 * value } else { 1.055 * value.powf(1.0 / 2.4) - 0.055 };
    (encoded * 255.0).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_in_memory_is_the_file() {
        let image = Image::new(2, 1, vec![[0.0, 0.18, 0.5], [1.0, 7.0, -1.0]]);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("image.png");
        write(&path, &image).unwrap();
        assert_eq!(encode(&image), std::fs::read(path).unwrap());
    }

    #[test]
    fn spot_values_of_the_srgb_transfer() {
        // 0.21404 is the linear value of code 127.5 (middle gray on screens), 0.5 gives 187.5.
        let spots = [
            (-1.0, 0),
            (0.0, 0),
            (0.000_15, 0),
            (0.000_16, 1),
            (0.003_130_8, 10),
            (0.18, 118),
            (0.213, 127),
            (0.215, 128),
            (0.5, 188),
            (0.99, 254),
            (1.0, 255),
            (7.0, 255),
        ];
        for (linear, byte) in spots {
            assert_eq!(srgb_byte(linear), byte, "linear {linear}");
        }
    }
}
