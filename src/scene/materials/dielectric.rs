//! A smooth interface between two dielectrics.

use glam::Vec3;

use super::{Evaluation, Inverse, Lobes, Scatter, ScatterSample, VaryingParameter, fresnel};
use crate::scene::{
    Rgb,
    parameters::{NumberOrName, Parameters},
};

/// Perfect reflection and refraction, chosen with the Fresnel reflectance; refracted radiance is scaled by
/// (n₁/n₂)², as radiance is when a beam narrows.
///
/// Parameters: `int_ior` and `ext_ior`, the refractive index behind and before the surface, a number > 0 or a
/// name from `INDICES` (defaults `bk7` and `air`); `specular_reflectance`, `specular_transmittance`, 0…1,
/// default 1.
#[derive(Clone, Copy, Debug)]
pub struct Dielectric {
    interface: Interface,
}

/// What light meets between two dielectrics, smooth or rough; parameters as of [`Dielectric`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Interface {
    /// Index inside over index outside.
    pub eta: f32,
    pub specular_reflectance: Rgb,
    pub specular_transmittance: Rgb,
}

impl Interface {
    /// One that absorbs nothing.
    pub fn clear(eta: f32) -> Interface {
        Interface { eta, specular_reflectance: Rgb::ONE, specular_transmittance: Rgb::ONE }
    }

    pub fn read(p: &mut dyn Parameters) -> Interface {
        Interface {
            eta: relative_index(p, "bk7"),
            specular_reflectance: p.reflectance("specular_reflectance", 1.0),
            specular_transmittance: p.reflectance("specular_transmittance", 1.0),
        }
    }

    /// As numbered by [`put`](Interface::put).
    pub const VARYING: &'static [VaryingParameter] = &[
        VaryingParameter::reflectance("specular_reflectance"),
        VaryingParameter::reflectance("specular_transmittance"),
    ];

    /// Gives a parameter another value.
    #[inline]
    pub fn put(&mut self, i: usize, value: Rgb) {
        *(if i == 0 { &mut self.specular_reflectance } else { &mut self.specular_transmittance }) = value;
    }
}

/// Of an interface that reflects where the choice is below `reflectance`, and else lets through.
pub(super) fn perfect_inverse(reflectance: f32, wo: Vec3, wi: Vec3) -> Option<Inverse> {
    let choice = if wo.z * wi.z > 0.0 { [0.0, reflectance] } else { [reflectance, 1.0] };
    (choice[1] > choice[0]).then_some(Inverse::of_perfect(choice))
}

impl Scatter for Dielectric {
    const VARYING: &'static [VaryingParameter] = Interface::VARYING;

    #[inline]
    fn put(&mut self, i: usize, value: Rgb) {
        self.interface.put(i, value);
    }

    fn lobes(&self) -> Lobes {
        Lobes { delta_reflection: true, delta_transmission: true, ..Lobes::NONE }
    }

    #[inline(always)]
    fn sample(&self, wo: Vec3, _u: [f32; 2], choice: f32) -> Option<ScatterSample> {
        let Interface { eta, specular_reflectance, specular_transmittance } = self.interface;
        let eta = if wo.z >= 0.0 { eta } else { 1.0 / eta };
        let (reflectance, cos_t) = fresnel::dielectric(wo.z.abs(), eta);
        if choice < reflectance {
            let wi = Vec3::new(-wo.x, -wo.y, wo.z);
            return Some(ScatterSample { wi, weight: specular_reflectance, pdf: f32::INFINITY, eta: 1.0 });
        }
        let wi = Vec3::new(-wo.x / eta, -wo.y / eta, -cos_t.copysign(wo.z));
        let weight = specular_transmittance / (eta * eta);
        Some(ScatterSample { wi, weight, pdf: f32::INFINITY, eta })
    }

    fn invert(&self, wo: Vec3, wi: Vec3) -> Option<Inverse> {
        let eta = if wo.z >= 0.0 { self.interface.eta } else { 1.0 / self.interface.eta };
        let (reflectance, _) = fresnel::dielectric(wo.z.abs(), eta);
        perfect_inverse(reflectance, wo, wi)
    }

    #[inline(always)]
    fn evaluate(&self, _wo: Vec3, _wi: Vec3) -> Evaluation {
        Evaluation::ZERO
    }

    fn read(p: &mut dyn Parameters) -> Self {
        Dielectric { interface: Interface::read(p) }
    }

    fn examples() -> Vec<Self> {
        [1.5, 1.0 / 1.33, 1.0001].map(|eta| Dielectric { interface: Interface::clear(eta) }).to_vec()
    }
}

/// Index inside over index outside, from `int_ior` (that of the medium `inside` where absent) and `ext_ior` (air).
pub(super) fn relative_index(p: &mut dyn Parameters, inside: &str) -> f32 {
    let mut index = |name: &str, default: &str| -> f32 {
        let known = |n: &str| INDICES.iter().find(|(known, _)| *known == n).map(|(_, index)| *index);
        let value = match p.number_or_name(name) {
            None => return known(default).expect("defaults are in the table"),
            Some(NumberOrName::Number(v)) => v,
            Some(NumberOrName::Name(n)) => match known(&n) {
                Some(v) => v,
                None => {
                    let names: Vec<&str> = INDICES.iter().map(|(n, _)| *n).collect();
                    p.fault(name, format!("unknown medium \"{n}\"; known: {}", names.join(", ")));
                    1.0
                }
            },
        };
        if !value.is_finite() || value <= 0.0 {
            p.fault(name, format!("{name} is {value}; a refractive index is finite and greater than 0"));
            return 1.0;
        }
        value
    };
    index("int_ior", inside) / index("ext_ior", "air")
}

/// Refractive indices at 589 nm by the names that Mitsuba's files use.
pub const INDICES: &[(&str, f32)] = &[
    ("vacuum", 1.0),
    ("helium", 1.00004),
    ("hydrogen", 1.00013),
    ("air", 1.000277),
    ("carbon dioxide", 1.00045),
    ("water ice", 1.31),
    ("water", 1.333),
    ("acetone", 1.36),
    ("ethanol", 1.361),
    ("fused quartz", 1.458),
    ("carbon tetrachloride", 1.461),
    ("pyrex", 1.47),
    ("glycerol", 1.4729),
    ("acrylic glass", 1.49),
    ("polypropylene", 1.49),
    ("benzene", 1.501),
    ("bk7", 1.5046),
    ("silicone oil", 1.52045),
    ("sodium chloride", 1.544),
    ("amber", 1.55),
    ("pet", 1.575),
    ("bromine", 1.661),
    ("diamond", 2.419),
];
