//! Pictures as files hold them.

use std::fmt;

use crate::scene::Rgb;

/// A picture; rows from the top, from the left in each.
pub struct Image {
    /// Width in texels, ≥ 1.
    pub width: u32,
    /// Height in texels, ≥ 1.
    pub height: u32,
    /// Red, green and blue of every texel.
    pub texels: Texels,
}

/// Red, green and blue of all texels of a picture, as precise as its file.
pub enum Texels {
    /// 8 bits a channel, encoded as sRGB unless they are no colours.
    Bytes(Vec<[u8; 3]>),
    /// 16 bits a channel, encoded as sRGB unless they are no colours.
    Words(Vec<[u16; 3]>),
    /// Linear and finite.
    Floats(Vec<[f32; 3]>),
}

impl Image {
    /// Linear colours of all texels, row by row.
    pub fn linear(&self) -> Box<dyn Iterator<Item = Rgb> + '_> {
        let decode = |c: f64| linear_of_srgb(c) as f32;
        match &self.texels {
            Texels::Bytes(texels) => {
                let decoded: [f32; 256] = std::array::from_fn(|byte| decode(byte as f64 / 255.0));
                Box::new(texels.iter().map(move |t| Rgb::from(t.map(|byte| decoded[usize::from(byte)]))))
            }
            Texels::Words(texels) => {
                Box::new(texels.iter().map(move |t| Rgb::from(t.map(|word| decode(f64::from(word) / 65535.0)))))
            }
            Texels::Floats(texels) => Box::new(texels.iter().map(|t| Rgb::from(*t))),
        }
    }
}

/// Size and checksum stand for the picture.
impl fmt::Debug for Image {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let mut hasher = crc32fast::Hasher::new();
        match &self.texels {
            Texels::Bytes(texels) => texels.iter().for_each(|t| hasher.update(t)),
            Texels::Words(texels) => texels.iter().flatten().for_each(|c| hasher.update(&c.to_le_bytes())),
            Texels::Floats(texels) => texels.iter().flatten().for_each(|c| hasher.update(&c.to_le_bytes())),
        }
        let (width, height) = (self.width, self.height);
        write!(f, "Image({width} × {height}, {:08x})", hasher.finalize())
    }
}

/// Linear value of a colour channel c ∈ [0, 1] that is encoded as sRGB. Source: IEC 61966-2-1.
pub(super) fn linear_of_srgb(c: f64) -> f64 {
    if c <= 0.04045 { c / 12.92 } else { libm::pow((c + 0.055) / 1.055, 2.4) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_is_decoded_as_the_standard_says() {
        assert_eq!(linear_of_srgb(0.0), 0.0);
        assert_eq!(linear_of_srgb(1.0), 1.0);
        // middle grey 119/255 of sRGB is 18.4 % in linear light
        assert!((linear_of_srgb(119.0 / 255.0) - 0.184_475).abs() < 1e-6);
        // both branches meet
        assert!((linear_of_srgb(0.040_449_99) - linear_of_srgb(0.040_450_01)).abs() < 1e-7);
    }
}
