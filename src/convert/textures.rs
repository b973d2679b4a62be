//! Colours and numbers that vary over a surface, and arithmetic with them.
//!
//! Mitsuba 3 has no textures that scale or mix others. A scaled or mixed picture becomes a new picture; a scaled
//! checkerboard is one of scaled colours; constants stay constants.

use std::path::PathBuf;
use std::rc::Rc;

use glam::{DAffine2, DAffine3, DMat3, DVec2, DVec3};

use super::Rgb;
use super::files::Files;
use super::pictures::bilinear;
use super::xml::Element;
use crate::film::Image;

/// A value by place on a surface.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Texture {
    /// The same everywhere.
    Constant(Rgb),
    /// A picture.
    Picture(Picture),
    /// The first value where both texture coordinates are within the same half of [0, 1), else the second.
    Checkerboard {
        /// The two values.
        values: Box<[Texture; 2]>,
        /// Surface to texture coordinates.
        to_uv: DAffine2,
    },
}

/// A picture on a surface; (0, 0) is the corner of its first pixel, in the top row.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Picture {
    /// Where its pixels are.
    pub pixels: Pixels,
    /// Surface to texture coordinates.
    pub to_uv: DAffine2,
    /// Pixels as squares rather than values between their centres.
    pub is_nearest: bool,
    /// What is beyond [0, 1].
    pub wrap: Wrap,
}

/// Where the pixels of a picture are.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Pixels {
    /// In a file; with `raw`, its numbers are meant as they are.
    File {
        /// The file.
        path: PathBuf,
        /// Not colours in sRGB.
        raw: bool,
    },
    /// Here; linear.
    Own {
        /// The pixels.
        image: Rc<Image>,
        /// What the file that they go to should be called.
        stem: String,
    },
}

/// How a picture goes on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Wrap {
    /// From its other end.
    Repeat,
    /// As its mirror image.
    Mirror,
    /// As its border.
    Clamp,
}

/// What a texture's value is taken for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Use {
    /// A colour.
    Colour,
    /// A number, such as a roughness: the mean of the channels.
    Number,
}

impl Texture {
    /// The value where it is the same everywhere.
    pub fn constant(&self) -> Option<Rgb> {
        match self {
            Texture::Constant(value) => Some(*value),
            _ => None,
        }
    }

    /// The texture on a surface whose own coordinates `map` leads to those that the texture is meant for.
    pub fn placed(&self, map: DAffine2) -> Texture {
        let mut placed = self.clone();
        match &mut placed {
            Texture::Constant(_) => {}
            Texture::Picture(picture) => picture.to_uv *= map,
            Texture::Checkerboard { values, to_uv } => {
                *to_uv *= map;
                values.iter_mut().for_each(|value| *value = value.placed(map));
            }
        }
        placed
    }

    /// The same with pictures linear between the centres of their pixels, which is what has slopes; and whether that
    /// changes anything.
    pub fn smooth(self) -> (Texture, bool) {
        match self {
            Texture::Picture(picture) if picture.is_nearest => {
                (Texture::Picture(Picture { is_nearest: false, ..picture }), true)
            }
            other => (other, false),
        }
    }

    /// Applies a function to every value.
    pub fn map(&self, files: &Files, f: &dyn Fn(Rgb) -> Rgb) -> Result<Texture, String> {
        Ok(match self {
            Texture::Constant(value) => Texture::Constant(f(*value)),
            Texture::Picture(picture) => {
                let image = picture.image(files)?;
                let pixel = |rgb: &[f32; 3]| f(rgb.map(f64::from)).map(|value| value as f32);
                let pixels = image.pixels.iter().map(pixel).collect();
                Texture::Picture(picture.with(Image::new(image.width, image.height, pixels)))
            }
            Texture::Checkerboard { values, to_uv } => {
                let [first, second] = &**values;
                Texture::Checkerboard { values: Box::new([first.map(files, f)?, second.map(files, f)?]), to_uv: *to_uv }
            }
        })
    }

    /// Applies a function to the values of two textures.
    pub fn combine(&self, other: &Texture, files: &Files, f: &dyn Fn(Rgb, Rgb) -> Rgb) -> Result<Texture, String> {
        match (self, other) {
            (Texture::Constant(a), b) => b.map(files, &|b| f(*a, b)),
            (a, Texture::Constant(b)) => a.map(files, &|a| f(a, *b)),
            (Texture::Checkerboard { values, to_uv }, other) => {
                let [a, b] = &**values;
                let values = Box::new([a.combine(other, files, f)?, b.combine(other, files, f)?]);
                Ok(Texture::Checkerboard { values, to_uv: *to_uv })
            }
            (_, Texture::Checkerboard { .. }) => other.combine(self, files, &|b, a| f(a, b)),
            (Texture::Picture(a), Texture::Picture(b)) => a.combined(b, files, f).map(Texture::Picture),
        }
    }

    /// The greatest value of any channel anywhere.
    pub fn greatest(&self, files: &Files) -> Result<f64, String> {
        Ok(match self {
            Texture::Constant(value) => value.iter().copied().fold(f64::MIN, f64::max),
            Texture::Picture(picture) => {
                f64::from(picture.image(files)?.pixels.as_flattened().iter().copied().fold(f32::MIN, f32::max))
            }
            Texture::Checkerboard { values, .. } => values[0].greatest(files)?.max(values[1].greatest(files)?),
        })
    }

    /// The element of that name.
    pub fn element(&self, name: &str, as_: Use, files: &Files) -> Element {
        match self {
            Texture::Constant(value) if as_ == Use::Colour => named("rgb", name, &value[..]),
            Texture::Constant([r, g, b]) => named("float", name, &[(r + g + b) / 3.0]),
            Texture::Picture(picture) => picture.element(name, files),
            Texture::Checkerboard { values, to_uv } => {
                let [first, second] = &**values;
                Element::plugin("texture", "checkerboard")
                    .with("name", name)
                    .holding(first.element("color0", Use::Colour, files))
                    .holding(second.element("color1", Use::Colour, files))
                    .transform("to_uv", in_space(*to_uv))
            }
        }
    }
}

impl Picture {
    /// Its pixels, linear.
    fn image(&self, files: &Files) -> Result<Rc<Image>, String> {
        match &self.pixels {
            Pixels::File { path, raw } => files.read_picture(path, *raw),
            Pixels::Own { image, .. } => Ok(image.clone()),
        }
    }

    /// The same with other pixels.
    fn with(&self, image: Image) -> Picture {
        let stem = match &self.pixels {
            Pixels::File { path, .. } => path.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
            Pixels::Own { stem, .. } => stem.clone(),
        };
        Picture { pixels: Pixels::Own { image: Rc::new(image), stem }, ..self.clone() }
    }

    /// A picture of two that lie on a surface in the same way, in the resolution of the finer.
    fn combined(&self, other: &Picture, files: &Files, f: &dyn Fn(Rgb, Rgb) -> Rgb) -> Result<Picture, String> {
        if self.to_uv != other.to_uv || self.wrap != other.wrap {
            return Err("two pictures that lie on the surface in different ways cannot become one".into());
        }
        let (a, b) = (self.image(files)?, other.image(files)?);
        let (width, height) = (a.width.max(b.width), a.height.max(b.height));
        let is_same = (a.width, a.height) == (b.width, b.height);
        let mut pixels = Vec::with_capacity(width as usize * height as usize);
        for i in 0..width as usize * height as usize {
            let (x, y) = ((i % width as usize) as f64 + 0.5, (i / width as usize) as f64 + 0.5);
            let at = |image: &Image| match is_same {
                true => image.pixels[i].map(f64::from),
                false => bilinear(image, x / f64::from(width), y / f64::from(height)),
            };
            pixels.push(f(at(&a), at(&b)).map(|value| value as f32));
        }
        Ok(self.with(Image::new(width, height, pixels)))
    }

    fn element(&self, name: &str, files: &Files) -> Element {
        let (reference, raw) = match &self.pixels {
            Pixels::File { path, raw } => (files.reference(path), *raw),
            Pixels::Own { image, stem } => (files.picture(stem, image), false),
        };
        let mut element = Element::plugin("texture", "bitmap")
            .with("name", name)
            .string("filename", &reference)
            .transform("to_uv", in_space(self.to_uv));
        if raw {
            element = element.boolean("raw", true);
        }
        if self.is_nearest {
            element = element.string("filter_type", "nearest");
        }
        match self.wrap {
            Wrap::Repeat => element,
            Wrap::Mirror => element.string("wrap_mode", "mirror"),
            Wrap::Clamp => element.string("wrap_mode", "clamp"),
        }
    }
}

/// A value element.
fn named(tag: &'static str, name: &str, values: &[f64]) -> Element {
    Element::new(tag).with("name", name).with("value", super::xml::numbers(values))
}

/// A map of the plane as one of space, which is how the file format has it.
fn in_space(map: DAffine2) -> DAffine3 {
    let [x, y, t] = [map.matrix2.x_axis, map.matrix2.y_axis, map.translation];
    let matrix = DMat3::from_cols(x.extend(0.0), y.extend(0.0), DVec3::Z);
    DAffine3::from_mat3_translation(matrix, t.extend(0.0))
}

/// (u, v) to (`scale` · (u, v) + `offset`).
pub(super) fn uv_map(scale: DVec2, offset: DVec2) -> DAffine2 {
    DAffine2 { matrix2: glam::DMat2::from_diagonal(scale), translation: offset }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn picture(pixels: Vec<[f32; 3]>, width: u32) -> Texture {
        let image = Rc::new(Image::new(width, pixels.len() as u32 / width, pixels));
        let pixels = Pixels::Own { image, stem: "p".into() };
        Texture::Picture(Picture { pixels, to_uv: DAffine2::IDENTITY, is_nearest: false, wrap: Wrap::Repeat })
    }

    fn pixels(texture: &Texture) -> Vec<f32> {
        match texture {
            Texture::Picture(Picture { pixels: Pixels::Own { image, .. }, .. }) => {
                image.pixels.iter().map(|rgb| rgb[0]).collect()
            }
            other => panic!("{other:?} is no picture of its own"),
        }
    }

    const MULTIPLY: &dyn Fn(Rgb, Rgb) -> Rgb = &|a, b| [a[0] * b[0], a[1] * b[1], a[2] * b[2]];

    #[test]
    fn pictures_are_computed_with_pixel_by_pixel() {
        let files = Files::new(Path::new("out.xml"));
        let grey = |values: &[f32]| picture(values.iter().map(|v| [*v; 3]).collect(), values.len() as u32);
        let product = grey(&[0.5, 1.0]).combine(&grey(&[0.5, 0.25]), &files, MULTIPLY).unwrap();
        assert_eq!(pixels(&product), [0.25, 0.25]);
        let finer = grey(&[1.0, 1.0, 1.0, 1.0]).combine(&grey(&[0.0, 1.0]), &files, MULTIPLY).unwrap();
        assert_eq!(pixels(&finer), [0.0, 0.25, 0.75, 1.0]);
        let moved = grey(&[1.0]).placed(uv_map(DVec2::ONE, DVec2::X));
        assert!(moved.combine(&grey(&[1.0]), &files, MULTIPLY).unwrap_err().contains("different ways"));
    }

    #[test]
    fn checkerboards_are_computed_with_square_by_square() {
        let files = Files::new(Path::new("out.xml"));
        let [a, b] = [0.5, 0.25].map(|v| Texture::Constant([v; 3]));
        let board = Texture::Checkerboard { values: Box::new([a, b]), to_uv: DAffine2::IDENTITY };
        let subtract = |a: Rgb, b: Rgb| [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
        let two = Texture::Constant([2.0; 3]);
        for (result, expected) in [
            (two.combine(&board, &files, &subtract), [1.5, 1.75]),
            (board.combine(&two, &files, &subtract), [-1.5, -1.75]),
            (picture(vec![[2.0; 3]], 1).combine(&board, &files, &subtract), [1.5, 1.75]),
        ] {
            let Texture::Checkerboard { values, .. } = result.unwrap() else { panic!("the board is gone") };
            assert_eq!(values.each_ref().map(|value| value.greatest(&files).unwrap()), expected);
        }
    }

    #[test]
    fn a_placed_texture_sees_mapped_coordinates() {
        let placed = picture(vec![[1.0; 3]], 1)
            .placed(uv_map(DVec2::splat(2.0), DVec2::ZERO))
            .placed(uv_map(DVec2::ONE, DVec2::X));
        let Texture::Picture(picture) = placed else { panic!("no picture") };
        assert_eq!(picture.to_uv.transform_point2(DVec2::ZERO), DVec2::new(2.0, 0.0));
    }
}
