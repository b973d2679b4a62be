//! Lights that are not surfaces, one file each. (Surfaces that emit are shapes with an emission.)
//!
//! To add one: a new file and a line in [`read`] and [`KNOWN`].

use super::{Rgb, parameters::Parameters};
use glam::Vec3;

/// A light that is not a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Light {
    /// The same radiance from every direction, infinitely far away.
    Constant {
        /// Radiance, W/(m² sr) per channel.
        radiance: Rgb,
    },
    /// A point that shines equally in all directions.
    Point {
        /// Where it is, in world space.
        position: Vec3,
        /// Radiant intensity, W/sr per channel.
        intensity: Rgb,
    },
}

/// Names that [`read`] knows, as scene files use them. (`area` is a property of shapes.)
pub const KNOWN: &[&str] = &["constant", "point"];

/// Reads the light of that name; `None` where the name is not [`KNOWN`].
pub fn read(name: &str, p: &mut dyn Parameters) -> Option<Light> {
    match name {
        "constant" => Some(Light::Constant { radiance: p.radiance("radiance", 1.0) }),
        "point" => {
            let position = p.point("position");
            let origin = p.to_world().transform_point3(Vec3::ZERO);
            Some(Light::Point { position: position.unwrap_or(origin), intensity: p.radiance("intensity", 1.0) })
        }
        _ => None,
    }
}
