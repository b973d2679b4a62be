//! Scattering functions, one file each.
//!
//! Directions are unit vectors leaving the surface, in the local frame whose z axis is the shading normal: `wo`
//! towards where the path comes from (the eye), `wi` towards where it goes on (the light).
//!
//! To add one: a new file and one line in the registry below. The tests at the end of this folder iterate the
//! registry, so a new member arrives tested.

mod conductor;
mod dielectric;
mod diffuse;
mod fresnel;
mod microfacets;
mod plastic;
mod roughconductor;
mod roughdielectric;
mod thindielectric;

#[cfg(test)]
mod tests;

use glam::Vec3;

pub use conductor::Conductor;
pub(crate) use conductor::PRESETS as CONDUCTORS;
pub use dielectric::Dielectric;
pub use diffuse::Diffuse;
pub use plastic::Plastic;
pub use roughconductor::RoughConductor;
pub use roughdielectric::RoughDielectric;
pub use thindielectric::ThinDielectric;

use super::{Rgb, parameters::Parameters};

/// One sampled direction.
#[derive(Clone, Copy, Debug)]
pub struct ScatterSample {
    /// The direction.
    pub wi: Vec3,
    /// f · |cos θᵢ| / density, per channel.
    pub weight: Rgb,
    /// Density with respect to solid angle; [`f32::INFINITY`] for a delta lobe, which no other technique can hit.
    pub pdf: f32,
    /// Ratio of refractive indices behind and before the surface along the path; 1 for reflection.
    pub eta: f32,
}

/// Value and density of one pair of directions; delta lobes contribute nothing.
#[derive(Clone, Copy, Debug)]
pub struct Evaluation {
    /// f · |cos θᵢ|, per channel.
    pub value: Rgb,
    /// Density of sampling `wi`, with respect to solid angle.
    pub pdf: f32,
}

impl Evaluation {
    /// No scattering.
    pub const ZERO: Evaluation = Evaluation { value: Rgb::ZERO, pdf: 0.0 };
}

/// What lobes a material has, for leaving out what a scene does not need.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lobes {
    /// A lobe with a finite density.
    pub smooth: bool,
    /// Another one, of what goes through.
    pub smooth_transmission: bool,
    /// Perfect reflection.
    pub delta_reflection: bool,
    /// Perfect refraction.
    pub delta_transmission: bool,
}

impl Lobes {
    /// None at all.
    pub const NONE: Lobes =
        Lobes { smooth: false, smooth_transmission: false, delta_reflection: false, delta_transmission: false };

    /// Whether choosing among the lobes takes a primary dimension of its own.
    pub fn need_choice(self) -> bool {
        let lobes = [self.smooth, self.smooth_transmission, self.delta_reflection, self.delta_transmission];
        lobes.into_iter().map(u8::from).sum::<u8>() > 1
    }

    /// The lobes there are, one short phrase each.
    pub fn in_words(self) -> Vec<&'static str> {
        let named = [
            (self.smooth, "smooth lobe"),
            (self.smooth_transmission, "smooth transmission"),
            (self.delta_reflection, "perfect reflection"),
            (self.delta_transmission, "perfect refraction"),
        ];
        named.into_iter().filter(|(there, _)| *there).map(|(_, name)| name).collect()
    }

    /// Whether light passes through.
    pub fn transmit(self) -> bool {
        self.smooth_transmission || self.delta_transmission
    }
}

/// A scattering function.
pub trait Scatter: Copy {
    /// Its lobes.
    fn lobes(&self) -> Lobes;
    /// Samples a direction from two primary samples for the lobe's shape and one for the choice of the lobe.
    fn sample(&self, wo: Vec3, u: [f32; 2], choice: f32) -> Option<ScatterSample>;
    /// Value and density of a given pair.
    fn evaluate(&self, wo: Vec3, wi: Vec3) -> Evaluation;
    /// Reads itself from a scene element.
    fn read(parameters: &mut dyn Parameters) -> Self;
    /// Instances that the tests go through.
    fn examples() -> Vec<Self>;
}

macro_rules! registry {
    ($($name:literal => $material:ident),+ $(,)?) => {
        /// A scattering function of any kind.
        #[derive(Clone, Copy, Debug)]
        pub enum Material {
            $(#[doc = concat!("`", $name, "`")] $material($material)),+
        }

        /// Names that [`read`] knows, as scene files use them.
        pub const KNOWN: &[&str] = &[$($name),+];

        /// Reads the material of that name; `None` where the name is not [`KNOWN`].
        pub fn read(name: &str, parameters: &mut dyn Parameters) -> Option<Material> {
            match name {
                $($name => Some(Material::$material($material::read(parameters))),)+
                _ => None,
            }
        }

        impl Material {
            /// The name of its kind.
            pub fn name(&self) -> &'static str {
                match self { $(Material::$material(_) => $name),+ }
            }

            /// Its lobes.
            pub fn lobes(&self) -> Lobes {
                match self { $(Material::$material(m) => m.lobes()),+ }
            }

            /// See [`Scatter::sample`].
            #[inline(always)]
            pub fn sample(&self, wo: Vec3, u: [f32; 2], choice: f32) -> Option<ScatterSample> {
                match self { $(Material::$material(m) => m.sample(wo, u, choice)),+ }
            }

            /// See [`Scatter::evaluate`].
            #[inline(always)]
            pub fn evaluate(&self, wo: Vec3, wi: Vec3) -> Evaluation {
                match self { $(Material::$material(m) => m.evaluate(wo, wi)),+ }
            }

            /// Instances of every kind, for tests.
            pub fn examples() -> Vec<Material> {
                let mut all = Vec::new();
                $(all.extend($material::examples().into_iter().map(Material::$material));)+
                all
            }
        }
    };
}

registry! {
    "conductor" => Conductor,
    "dielectric" => Dielectric,
    "diffuse" => Diffuse,
    "plastic" => Plastic,
    "roughconductor" => RoughConductor,
    "roughdielectric" => RoughDielectric,
    "thindielectric" => ThinDielectric,
}
