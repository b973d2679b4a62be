//! A picture as a texture.

use std::sync::Arc;

use glam::{Affine2, IVec2, Vec2};

use super::image::linear_of_srgb;
use super::{Image, Texels, Vary, scalar};
use crate::scene::{Rgb, parameters::Parameters};

/// A picture laid over the unit square of surface coordinates: u runs along its rows, v from its first row to its last.
///
/// Parameters: `filename`; `raw` (default false): values are no colours and are taken as they are, rather than decoded
/// from sRGB where the file has 8 or 16 bits a channel; `filter_type`: `bilinear` (default) between the centres of
/// texels or `nearest`; `wrap_mode` outside of the square: `repeat` (default), `mirror` or `clamp`; `to_uv`: a transform
/// of the surface coordinates.
#[derive(Clone, Debug)]
pub struct Bitmap {
    image: Arc<Image>,
    /// Linear value of every byte.
    decoded: Arc<[f32; 256]>,
    to_uv: Affine2,
    filter: Filter,
    wrap: Wrap,
    /// Of all texels: every user of the texture asks.
    mean: Rgb,
    range: [f32; 2],
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Filter {
    Bilinear,
    Nearest,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Wrap {
    Repeat,
    Mirror,
    Clamp,
}

impl Bitmap {
    /// The colour of a texel, wherever it lies.
    #[inline]
    fn texel(&self, x: i32, y: i32) -> Rgb {
        let (width, height) = (self.image.width, self.image.height);
        let index = self.wrap.apply(y, height) * width as usize + self.wrap.apply(x, width);
        match &self.image.texels {
            Texels::Bytes(texels) => Rgb::from(texels[index].map(|byte| self.decoded[usize::from(byte)])),
            Texels::Floats(texels) => Rgb::from(texels[index]),
            Texels::Words(_) => unreachable!("decoded when the texture was made"),
        }
    }

    /// Surface coordinates in texels.
    #[inline]
    fn place(&self, uv: Vec2) -> Vec2 {
        self.to_uv.transform_point2(uv) * self.size()
    }

    fn size(&self) -> Vec2 {
        Vec2::new(self.image.width as f32, self.image.height as f32)
    }

    /// The four texels around a place, row by row, and how far between their centres it lies.
    #[inline]
    fn around(&self, place: Vec2) -> ([Rgb; 4], Vec2) {
        let from_centre = place - 0.5;
        let corner = from_centre.floor();
        let IVec2 { x, y } = corner.as_ivec2();
        let (right, below) = (x.saturating_add(1), y.saturating_add(1));
        let texels = [self.texel(x, y), self.texel(right, y), self.texel(x, below), self.texel(right, below)];
        (texels, from_centre - corner)
    }

    /// With mean and range of its texels.
    fn measured(mut self) -> Bitmap {
        let (width, height) = (self.image.width as i32, self.image.height as i32);
        let texels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let mut sum = glam::DVec3::ZERO;
        let [mut low, mut high] = [f32::INFINITY, f32::NEG_INFINITY];
        for (x, y) in texels {
            let texel = self.texel(x, y);
            sum += texel.as_dvec3();
            [low, high] = [low.min(texel.min_element()), high.max(texel.max_element())];
        }
        self.mean = (sum / (f64::from(width) * f64::from(height))).as_vec3();
        self.range = [low, high];
        self
    }
}

impl Wrap {
    /// The texel of a row (or column) of `n` that stands for number `i`.
    #[inline]
    fn apply(self, i: i32, n: u32) -> usize {
        let n = n as i32;
        let index = match self {
            Wrap::Repeat => i.rem_euclid(n),
            Wrap::Clamp => i.clamp(0, n - 1),
            Wrap::Mirror => {
                let within = i64::from(i).rem_euclid(2 * i64::from(n)) as i32;
                within.min(2 * n - 1 - within)
            }
        };
        index as usize
    }
}

impl Vary for Bitmap {
    #[inline]
    fn at(&self, uv: Vec2) -> Rgb {
        let place = self.place(uv);
        match self.filter {
            Filter::Nearest => {
                let texel = place.floor().as_ivec2();
                self.texel(texel.x, texel.y)
            }
            Filter::Bilinear => {
                let ([a, b, c, d], t) = self.around(place);
                a.lerp(b, t.x).lerp(c.lerp(d, t.x), t.y)
            }
        }
    }

    #[inline]
    fn slope(&self, uv: Vec2) -> Option<Vec2> {
        if self.filter == Filter::Nearest {
            return None;
        }
        let (texels, t) = self.around(self.place(uv));
        let [a, b, c, d] = texels.map(scalar);
        let by_texel = Vec2::new((b - a) + t.y * ((d - c) - (b - a)), (c - a) + t.x * ((d - b) - (c - a)));
        Some(self.to_uv.matrix2.transpose() * (by_texel * self.size()))
    }

    fn mean(&self) -> Rgb {
        self.mean
    }

    fn range(&self) -> [f32; 2] {
        self.range
    }

    fn read(p: &mut dyn Parameters) -> Option<Bitmap> {
        let image = p.image("filename");
        let raw = p.boolean("raw").unwrap_or(false);
        let filter = match p.word("filter_type", &["bilinear", "nearest"]) {
            None | Some(0) => Filter::Bilinear,
            Some(_) => Filter::Nearest,
        };
        let wrap =
            [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp][p.word("wrap_mode", &["repeat", "mirror", "clamp"]).unwrap_or(0)];
        let to_uv = p.to_uv();
        let decode = |c: f64| if raw { c as f32 } else { linear_of_srgb(c) as f32 };
        let decoded = Arc::new(std::array::from_fn(|byte| decode(byte as f64 / 255.0)));
        let image = unpacked(image?, decode);
        Some(Bitmap { image, decoded, to_uv, filter, wrap, mean: Rgb::ZERO, range: [0.0; 2] }.measured())
    }
}

/// The picture without 16-bit words, which no table decodes.
fn unpacked(image: Arc<Image>, decode: impl Fn(f64) -> f32) -> Arc<Image> {
    let Texels::Words(words) = &image.texels else { return image };
    let texels = words.iter().map(|t| t.map(|word| decode(f64::from(word) / 65535.0))).collect();
    Arc::new(Image { width: image.width, height: image.height, texels: Texels::Floats(texels) })
}

#[cfg(test)]
impl Bitmap {
    /// A linear picture with texels between which it is bilinear, repeated.
    pub fn of_texels(width: u32, height: u32, texels: Vec<[f32; 3]>) -> Bitmap {
        let image = Arc::new(Image { width, height, texels: Texels::Floats(texels) });
        let (to_uv, filter, wrap) = (Affine2::IDENTITY, Filter::Bilinear, Wrap::Repeat);
        Bitmap { image, decoded: Arc::new([0.0; 256]), to_uv, filter, wrap, mean: Rgb::ZERO, range: [0.0; 2] }
            .measured()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values and slopes by Mitsuba 3.9.1.
    #[test]
    fn values_are_those_of_mitsuba() {
        let texels = [0.0, 1.0, 3.0, 2.0, 4.0, 7.0].map(|v| [v; 3]).to_vec();
        let places = [(1.0 / 6.0, 0.25), (0.5, 0.25), (0.5, 0.75), (0.02, 0.3), (1.1, -0.2), (0.4, 0.6)];
        for (wrap, expected) in [
            (Wrap::Repeat, [0.0, 1.0, 4.0, 1.608, 2.76, 2.59]),
            (Wrap::Mirror, [0.0, 1.0, 4.0, 0.2, 3.0, 2.59]),
            (Wrap::Clamp, [0.0, 1.0, 4.0, 0.2, 3.0, 2.59]),
        ] {
            let map = Bitmap { wrap, ..Bitmap::of_texels(3, 2, texels.clone()) };
            for ((u, v), expected) in places.into_iter().zip(expected) {
                let value = map.at(Vec2::new(u, v)).x;
                assert!((value - expected).abs() < 1e-4, "{wrap:?} at ({u}, {v}): {value} for {expected}");
            }
        }
        let to_uv = Affine2::from_scale_angle_translation(Vec2::new(0.5, 2.0), 0.0, Vec2::new(0.1, 0.2));
        let map = Bitmap { to_uv, ..Bitmap::of_texels(3, 2, texels) };
        let expected = [
            ((1.0 / 6.0, 0.25), 1.895, [2.85, 8.2]),
            ((0.5, 0.25), 2.845, [2.85, 10.2]),
            ((0.7, 0.6), 1.705, [1.95, 11.4]),
        ];
        for ((u, v), value, slope) in expected {
            let uv = Vec2::new(u, v);
            assert!((map.at(uv).x - value).abs() < 1e-4);
            assert!((map.slope(uv).unwrap() - Vec2::from(slope)).length() < 1e-4, "at {uv}");
        }
    }

    /// Two by two texels, linear: 0, 1 above, 2, 4 below.
    fn four(filter: Filter, wrap: Wrap, to_uv: Affine2) -> Bitmap {
        let texels = Texels::Floats([0.0, 1.0, 2.0, 4.0].map(|v| [v; 3]).to_vec());
        let decoded = Arc::new([0.0; 256]);
        let image = Arc::new(Image { width: 2, height: 2, texels });
        Bitmap { image, decoded, to_uv, filter, wrap, mean: Rgb::ZERO, range: [0.0; 2] }.measured()
    }

    #[test]
    fn centres_of_texels_have_their_values_and_places_between_them_mixtures() {
        for (filter, middle) in [(Filter::Bilinear, 1.75), (Filter::Nearest, 4.0)] {
            let map = four(filter, Wrap::Repeat, Affine2::IDENTITY);
            for (u, v, value) in [(0.25, 0.25, 0.0), (0.75, 0.25, 1.0), (0.25, 0.75, 2.0), (0.75, 0.75, 4.0)] {
                assert_eq!(map.at(Vec2::new(u, v)).x, value);
            }
            assert_eq!(map.at(Vec2::splat(0.5)).x, middle);
        }
    }

    #[test]
    fn beyond_the_square_it_goes_on_as_it_is_told() {
        let row = |wrap: Wrap| [-3, -2, -1, 0, 1, 2, 3, 4].map(|i| wrap.apply(i, 3));
        assert_eq!(row(Wrap::Repeat), [0, 1, 2, 0, 1, 2, 0, 1]);
        assert_eq!(row(Wrap::Mirror), [2, 1, 0, 0, 1, 2, 2, 1]);
        assert_eq!(row(Wrap::Clamp), [0, 0, 0, 0, 1, 2, 2, 2]);
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            for i in [i32::MIN, i32::MAX] {
                assert!(wrap.apply(i, 65536) < 65536);
            }
        }
    }

    #[test]
    fn slopes_are_those_of_the_values() {
        let to_uv = Affine2::from_scale_angle_translation(Vec2::new(0.7, 1.9), 0.4, Vec2::new(0.1, -0.3));
        let map = four(Filter::Bilinear, Wrap::Mirror, to_uv);
        for (u, v) in [(0.4, 0.45), (0.3, 0.6), (0.1, 0.2)] {
            let slope = map.slope(Vec2::new(u, v)).unwrap();
            let h = 1e-3;
            let difference = |du: f32, dv: f32| {
                let at = |sign: f32| f64::from(scalar(map.at(Vec2::new(u + sign * du, v + sign * dv))));
                (at(1.0) - at(-1.0)) / (2.0 * f64::from(h))
            };
            let expected = [difference(h, 0.0), difference(0.0, h)];
            assert!((f64::from(slope.x) - expected[0]).abs() < 2e-3, "{slope} for {expected:?}");
            assert!((f64::from(slope.y) - expected[1]).abs() < 2e-3, "{slope} for {expected:?}");
        }
    }

    #[test]
    fn its_mean_and_range_are_those_of_its_texels() {
        let map = four(Filter::Bilinear, Wrap::Repeat, Affine2::IDENTITY);
        assert_eq!(map.mean(), Rgb::splat(1.75));
        assert_eq!(map.range(), [0.0, 4.0]);
    }
}
