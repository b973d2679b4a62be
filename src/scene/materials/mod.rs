//! Scattering functions, one file each.
//!
//! Directions are unit vectors leaving the surface, in the local frame whose z axis is the shading normal: `wo`
//! towards where the path comes from (the eye), `wi` towards where it goes on (the light).
//!
//! To add one: a new file and one line in the registry below. The tests at the end of this folder iterate the
//! registry, so a new member arrives tested.

mod burley;
mod coat;
mod conductor;
mod dielectric;
mod diffuse;
mod fresnel;
mod microfacets;
mod null;
mod plastic;
mod principled;
mod principledthin;
mod roughconductor;
mod roughdielectric;
mod roughplastic;
mod thindielectric;

#[cfg(test)]
mod tests;

use glam::Vec3;

pub use conductor::Conductor;
pub(crate) use conductor::PRESETS as CONDUCTORS;
pub use dielectric::Dielectric;
pub use diffuse::Diffuse;
pub use null::Null;
pub use plastic::Plastic;
pub use principled::Principled;
pub use principledthin::PrincipledThin;
pub use roughconductor::RoughConductor;
pub use roughdielectric::RoughDielectric;
pub use roughplastic::RoughPlastic;
pub use thindielectric::ThinDielectric;

use super::{
    Rgb,
    parameters::{Parameters, VaryingParameter},
};

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

/// The primary samples for which [`Scatter::sample`] gives a certain direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inverse {
    /// Those of the lobe's shape; `None` where any will do, as for perfect lobes.
    pub shape: Option<[f32; 2]>,
    /// Those of the choice: from the first to before the second.
    pub choice: [f32; 2],
}

impl Inverse {
    /// Of the only lobe there is.
    fn of_one_lobe(shape: [f32; 2]) -> Inverse {
        Inverse { shape: Some(shape), choice: [0.0, 1.0] }
    }

    /// Of a perfect lobe.
    fn of_perfect(choice: [f32; 2]) -> Inverse {
        Inverse { shape: None, choice }
    }
}

/// What lobes a material has, for leaving out what a scene does not need.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lobes {
    /// A lobe with a finite density.
    pub smooth: bool,
    /// Another one, of what goes through.
    pub smooth_transmission: bool,
    /// Another one, of what is under a coat.
    pub smooth_base: bool,
    /// Perfect reflection.
    pub delta_reflection: bool,
    /// Perfect refraction.
    pub delta_transmission: bool,
    /// Some light passes as if nothing were there.
    pub straight: bool,
}

impl Lobes {
    /// None at all.
    pub const NONE: Lobes = Lobes {
        smooth: false,
        smooth_transmission: false,
        smooth_base: false,
        delta_reflection: false,
        delta_transmission: false,
        straight: false,
    };

    /// Whether choosing among the lobes takes a primary dimension of its own.
    pub fn need_choice(self) -> bool {
        self.in_words().len() > 1
    }

    /// Those of either.
    pub fn or(self, other: Lobes) -> Lobes {
        Lobes {
            smooth: self.smooth || other.smooth,
            smooth_transmission: self.smooth_transmission || other.smooth_transmission,
            smooth_base: self.smooth_base || other.smooth_base,
            delta_reflection: self.delta_reflection || other.delta_reflection,
            delta_transmission: self.delta_transmission || other.delta_transmission,
            straight: self.straight || other.straight,
        }
    }

    /// Whether some of them are perfect, so that no other technique can hit them.
    pub fn has_delta(self) -> bool {
        self.delta_reflection || self.delta_transmission || self.straight
    }

    /// The lobes there are, one short phrase each.
    pub fn in_words(self) -> Vec<&'static str> {
        let named = [
            (self.smooth, "smooth lobe"),
            (self.smooth_transmission, "smooth transmission"),
            (self.smooth_base, "smooth base"),
            (self.delta_reflection, "perfect reflection"),
            (self.delta_transmission, "perfect refraction"),
            (self.straight, "straight passage"),
        ];
        named.into_iter().filter(|(there, _)| *there).map(|(_, name)| name).collect()
    }

    /// Whether light passes through.
    pub fn transmit(self) -> bool {
        self.smooth_transmission || self.delta_transmission || self.straight
    }
}

/// A scattering function.
pub trait Scatter: Copy {
    /// The parameters that may vary over a surface.
    const VARYING: &'static [VaryingParameter] = &[];
    /// Gives parameter number `i` of [`VARYING`](Scatter::VARYING) another value. Called at hits, so it must be quick.
    fn put(&mut self, i: usize, _value: Rgb) {
        unreachable!("parameter {i} of {}", std::any::type_name::<Self>());
    }
    /// Whether directions round the normal are not all alike, so that the frame's x axis must lie along ∂p/∂u.
    fn needs_tangents(&self) -> bool {
        false
    }
    /// Its lobes.
    fn lobes(&self) -> Lobes;
    /// Samples a direction from two primary samples for the lobe's shape and one for the choice of the lobe.
    fn sample(&self, wo: Vec3, u: [f32; 2], choice: f32) -> Option<ScatterSample>;
    /// The inverse of [`sample`](Scatter::sample); `None` where `wi` is not sampled, or not by one set of numbers that is
    /// known. Perfect lobes take `wi` for the direction on its side of the surface that they give.
    fn invert(&self, _wo: Vec3, _wi: Vec3) -> Option<Inverse> {
        None
    }
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

        /// The parameters in whose place textures can be, of the material of that name.
        pub fn varying(name: &str) -> &'static [VaryingParameter] {
            match name {
                $($name => $material::VARYING,)+
                _ => &[],
            }
        }

        impl Material {
            /// Gives the parameter of that number in [`varying`] another value.
            #[inline]
            pub fn put(&mut self, parameter: usize, value: Rgb) {
                match self { $(Material::$material(m) => m.put(parameter, value)),+ }
            }

            /// The name of its kind.
            pub fn name(&self) -> &'static str {
                match self { $(Material::$material(_) => $name),+ }
            }

            /// Its lobes.
            pub fn lobes(&self) -> Lobes {
                match self { $(Material::$material(m) => m.lobes()),+ }
            }

            /// See [`Scatter::needs_tangents`].
            pub fn needs_tangents(&self) -> bool {
                match self { $(Material::$material(m) => m.needs_tangents()),+ }
            }

            /// See [`Scatter::sample`].
            #[inline(always)]
            pub fn sample(&self, wo: Vec3, u: [f32; 2], choice: f32) -> Option<ScatterSample> {
                match self { $(Material::$material(m) => m.sample(wo, u, choice)),+ }
            }

            /// See [`Scatter::invert`].
            pub fn invert(&self, wo: Vec3, wi: Vec3) -> Option<Inverse> {
                match self { $(Material::$material(m) => m.invert(wo, wi)),+ }
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
    "null" => Null,
    "plastic" => Plastic,
    "principled" => Principled,
    "principledthin" => PrincipledThin,
    "roughconductor" => RoughConductor,
    "roughdielectric" => RoughDielectric,
    "roughplastic" => RoughPlastic,
    "thindielectric" => ThinDielectric,
}
