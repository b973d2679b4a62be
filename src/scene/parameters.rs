//! Named parameters of one scene element, whatever file format they come from.
//!
//! Materials and lights read themselves from here, so that adding one is a single new file. The implementor
//! remembers which names were asked for: those are what the element knows, and any other name in the file is a
//! fault that lists them.

use std::sync::Arc;

use glam::{Affine3A, Mat3, Mat3A};

use super::{Rgb, textures::Image};

/// A value that files give as a number or by name.
#[derive(Clone, Debug, PartialEq)]
pub enum NumberOrName {
    /// Given as a number.
    Number(f32),
    /// Given by name.
    Name(String),
}

/// A bag of named, typed values that knows where each came from.
///
/// A getter returns `None` when the name is absent *or* its value is faulty; faults are collected by the
/// implementor, all of them, and shown to the person with their place in the file. So reading code uses a
/// default and goes on.
pub trait Parameters {
    /// A single number.
    fn float(&mut self, name: &str) -> Option<f32>;
    /// A whole number.
    fn integer(&mut self, name: &str) -> Option<i64>;
    /// A truth value.
    fn boolean(&mut self, name: &str) -> Option<bool>;
    /// A string.
    fn string(&mut self, name: &str) -> Option<String>;
    /// A word, as its number among those known; another one is a fault that lists them.
    fn word(&mut self, name: &str, known: &[&str]) -> Option<usize>;
    /// A colour, given as one or as three numbers.
    fn rgb(&mut self, name: &str) -> Option<Rgb>;
    /// A number, or the name of one in a table.
    fn number_or_name(&mut self, name: &str) -> Option<NumberOrName>;
    /// A point in the element's own coordinates.
    fn point(&mut self, name: &str) -> Option<glam::Vec3>;
    /// A direction in the element's own coordinates, of any length.
    fn vector(&mut self, name: &str) -> Option<glam::Vec3>;
    /// The element's `to_world` transform, identity where absent.
    fn to_world(&mut self) -> Affine3A;
    /// The element's `to_uv` transform of surface coordinates, identity where absent: what it does to x and y.
    fn to_uv(&mut self) -> glam::Affine2;
    /// Whether a texture is in the place of a parameter that has been asked for.
    fn varies(&self, name: &str) -> bool;
    /// The picture in the file of that name.
    fn image(&mut self, name: &str) -> Option<Arc<Image>>;
    /// Reports a fault of the named parameter (of the element as a whole where the name is absent).
    fn fault(&mut self, name: &str, message: String);

    /// A reflectance or transmittance: every channel finite and within 0…1; anything else is a fault.
    fn reflectance(&mut self, name: &str, default: f32) -> Rgb {
        match self.rgb(name) {
            None => Rgb::splat(default),
            Some(v) if v.is_finite() && v.min_element() >= 0.0 && v.max_element() <= 1.0 => v,
            Some(v) => {
                self.fault(name, format!("{name} is {v}; every channel must lie between 0 and 1"));
                Rgb::splat(default)
            }
        }
    }

    /// A radiance or intensity: every channel finite and ≥ 0; anything else is a fault.
    fn radiance(&mut self, name: &str, default: f32) -> Rgb {
        match self.rgb(name) {
            None => Rgb::splat(default),
            Some(v) if v.is_finite() && v.min_element() >= 0.0 => v,
            Some(v) => {
                self.fault(name, format!("{name} is {v}; every channel must be finite and not negative"));
                Rgb::splat(default)
            }
        }
    }
}

/// A parameter in whose place a texture can be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VaryingParameter {
    /// Its name.
    pub name: &'static str,
    /// What values it takes.
    pub range: Range,
}

impl VaryingParameter {
    /// A colour with channels within 0…1.
    pub const fn reflectance(name: &'static str) -> VaryingParameter {
        VaryingParameter { name, range: Range::Reflectance }
    }

    /// A number within 0…1.
    pub const fn fraction(name: &'static str) -> VaryingParameter {
        VaryingParameter { name, range: Range::Fraction }
    }

    /// A number that is not negative.
    pub const fn roughness(name: &'static str) -> VaryingParameter {
        VaryingParameter { name, range: Range::Roughness }
    }
}

/// What values a parameter takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Range {
    /// Colours with channels within 0…1.
    Reflectance,
    /// Numbers within 0…1; of a texture, its luminance.
    Fraction,
    /// Numbers that are not negative; of a texture, its luminance.
    Roughness,
    /// Colours with channels that are not negative.
    Radiance,
}

impl Range {
    /// Whether values from `least` to `largest` are within; in words, what would be, where they are not.
    pub fn check(self, [least, largest]: [f32; 2]) -> Result<(), &'static str> {
        let (is_within, accepted) = match self {
            Range::Reflectance | Range::Fraction => (least >= 0.0 && largest <= 1.0, "0 to 1"),
            Range::Roughness | Range::Radiance => (least >= 0.0, "not negative"),
        };
        if is_within { Ok(()) } else { Err(accepted) }
    }
}

/// Largest entry of MᵀM/s² − 1 that still is a uniform scale s; covers matrices written with four digits.
const SCALE_TOLERANCE: f32 = 1e-3;

/// Axes (orthonormal; they may mirror) and scale of a transform that keeps angles, `None` of any other.
pub fn similarity(transform: &Affine3A) -> Option<(Mat3, f32)> {
    let matrix = transform.matrix3;
    let scale = matrix.determinant().abs().cbrt();
    let error = matrix.transpose() * matrix * (scale * scale).recip() + Mat3A::IDENTITY * -1.0;
    if !error.to_cols_array().iter().all(|entry| entry.abs() <= SCALE_TOLERANCE) {
        return None;
    }
    // straightened, since four digits leave axes askew
    let [x, y, z] = [matrix.x_axis, matrix.y_axis, matrix.z_axis].map(glam::Vec3::from);
    let z = z.normalize();
    let x = (x - z * z.dot(x)).normalize();
    let handed = z.cross(x);
    let y = if handed.dot(y) < 0.0 { -handed } else { handed };
    Some((Mat3::from_cols(x, y, z), scale))
}
