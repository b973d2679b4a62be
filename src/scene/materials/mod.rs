//! Scattering functions, one file each.
//!
//! To add one: a new file and one line in the registry below.

use super::parameters::Parameters;

/// A scattering function.
#[derive(Clone, Copy, Debug)]
pub enum Material {
    /// Placeholder until the materials land.
    Diffuse,
}

/// Names that [`read`] knows, as scene files use them.
pub const KNOWN: &[&str] = &["conductor", "dielectric", "diffuse"];

/// Reads the material of that name; `None` where the name is not [`KNOWN`].
pub fn read(name: &str, p: &mut dyn Parameters) -> Option<Material> {
    match name {
        "diffuse" => {
            p.reflectance("reflectance", 0.5);
            Some(Material::Diffuse)
        }
        "conductor" | "dielectric" => Some(Material::Diffuse),
        _ => None,
    }
}
