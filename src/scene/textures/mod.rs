//! Values that vary over a surface, one file a kind.
//!
//! A texture gives a colour at every pair of surface coordinates (u, v). Materials never see it: at a hit its value takes
//! the place of one of their parameters (see [`Appearance`](super::Appearance)).
//!
//! To add one: a new file and one line in the registry below.

mod bitmap;
mod checkerboard;
mod image;

use std::sync::Arc;

use glam::Vec2;

pub use bitmap::Bitmap;
pub use checkerboard::Checkerboard;
pub use image::{Image, Texels};

use super::{Rgb, parameters::Parameters};
use crate::film::image::RELATIVE_LUMINANCE;

/// A kind of texture.
trait Vary: Sized {
    /// Its value at the surface coordinates `uv`.
    fn at(&self, uv: Vec2) -> Rgb;
    /// ∂/∂u and ∂/∂v of the luminance there, or `None` where a kind has no slope worth the name.
    fn slope(&self, uv: Vec2) -> Option<Vec2>;
    /// Mean over what it is made of.
    fn mean(&self) -> Rgb;
    /// Least and largest value of any channel.
    fn range(&self) -> [f32; 2];
    /// Reads itself from a scene element; `None` after a fault without which there is nothing to show.
    fn read(parameters: &mut dyn Parameters) -> Option<Self>;
}

macro_rules! registry {
    ($($name:literal => $kind:ident),+ $(,)?) => {
        /// A texture of any kind.
        #[derive(Clone, Debug)]
        pub enum Texture {
            $(#[doc = concat!("`", $name, "`")] $kind($kind)),+
        }

        /// Names that [`read`] knows, as scene files use them.
        pub const KNOWN: &[&str] = &[$($name),+];

        /// Reads the texture of that name: `None` where the name is not [`KNOWN`], `Some(None)` after a fault.
        pub fn read(name: &str, parameters: &mut dyn Parameters) -> Option<Option<Texture>> {
            match name {
                $($name => Some($kind::read(parameters).map(Texture::$kind)),)+
                _ => None,
            }
        }

        impl Texture {
            /// Its value at the surface coordinates `uv`.
            #[inline]
            pub fn at(&self, uv: Vec2) -> Rgb {
                match self { $(Texture::$kind(t) => t.at(uv)),+ }
            }

            /// ∂/∂u and ∂/∂v of the luminance at `uv`; `None` where the kind is flat between steps.
            #[inline]
            pub fn slope(&self, uv: Vec2) -> Option<Vec2> {
                match self { $(Texture::$kind(t) => t.slope(uv)),+ }
            }

            /// Mean over what it is made of, for choices that need no exact one.
            pub fn mean(&self) -> Rgb {
                match self { $(Texture::$kind(t) => t.mean()),+ }
            }

            /// Least and largest value of any channel.
            pub fn range(&self) -> [f32; 2] {
                match self { $(Texture::$kind(t) => t.range()),+ }
            }
        }
    };
}

registry! {
    "bitmap" => Bitmap,
    "checkerboard" => Checkerboard,
}

/// The number that a colour stands for where a texture takes the place of one: its relative luminance.
#[inline]
pub fn scalar(value: Rgb) -> f32 {
    if value.x == value.y && value.y == value.z {
        return value.x; // the weights sum to one but for rounding
    }
    value.dot(Rgb::from(RELATIVE_LUMINANCE))
}

/// A colour that is the same everywhere or varies.
#[derive(Clone, Debug)]
pub enum Varying {
    /// The same everywhere.
    Constant(Rgb),
    /// By the texture's value.
    Textured(Arc<Texture>),
}

impl PartialEq for Varying {
    fn eq(&self, other: &Varying) -> bool {
        match (self, other) {
            (Varying::Constant(a), Varying::Constant(b)) => a == b,
            (Varying::Textured(a), Varying::Textured(b)) => Arc::ptr_eq(a, b),
            _ => false,
        }
    }
}

impl From<Rgb> for Varying {
    fn from(value: Rgb) -> Varying {
        Varying::Constant(value)
    }
}

impl Varying {
    /// The value at surface coordinates that are asked for only where they matter.
    #[inline(always)]
    pub fn at(&self, uv: impl FnOnce() -> Vec2) -> Rgb {
        match self {
            Varying::Constant(value) => *value,
            Varying::Textured(texture) => texture.at(uv()),
        }
    }

    /// Its mean.
    pub fn mean(&self) -> Rgb {
        match self {
            Varying::Constant(value) => *value,
            Varying::Textured(texture) => texture.mean(),
        }
    }

    /// The largest value of any channel.
    pub fn largest(&self) -> f32 {
        match self {
            Varying::Constant(value) => value.max_element(),
            Varying::Textured(texture) => texture.range()[1],
        }
    }

    /// Whether surface coordinates matter.
    pub fn is_textured(&self) -> bool {
        matches!(self, Varying::Textured(_))
    }
}
