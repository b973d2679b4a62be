//! How principled materials are written down, and which of their parameters vary over a surface.

use super::{Principled, Rates};
use crate::scene::materials::VaryingParameter;
use crate::scene::{Rgb, parameters::Parameters, textures::scalar};

/// As numbered by [`Principled::put_at`].
pub(super) const VARYING: &[VaryingParameter] = &[
    VaryingParameter::reflectance("base_color"),
    VaryingParameter::fraction("roughness"),
    VaryingParameter::fraction("anisotropic"),
    VaryingParameter::fraction("metallic"),
    VaryingParameter::fraction("spec_trans"),
    VaryingParameter::fraction("spec_tint"),
    VaryingParameter::fraction("sheen"),
    VaryingParameter::fraction("sheen_tint"),
    VaryingParameter::fraction("flatness"),
    VaryingParameter::fraction("clearcoat"),
    VaryingParameter::fraction("clearcoat_gloss"),
];

impl Principled {
    /// Gives a parameter another value, by its number in [`VARYING`].
    #[inline]
    pub(super) fn put_at(&mut self, i: usize, value: Rgb) {
        let number = match i {
            0 => {
                self.base_color = value;
                return;
            }
            1 => &mut self.roughness,
            2 => &mut self.anisotropic,
            3 => &mut self.metallic,
            4 => &mut self.spec_trans,
            5 => &mut self.spec_tint,
            6 => &mut self.sheen,
            7 => &mut self.sheen_tint,
            8 => &mut self.flatness,
            9 => &mut self.clearcoat,
            10 => &mut self.clearcoat_gloss,
            _ => unreachable!("parameter {i} of a principled material"),
        };
        *number = scalar(value);
    }

    /// Reads the parameters.
    pub(super) fn read_from(p: &mut dyn Parameters) -> Principled {
        let base_color = p.reflectance("base_color", 0.5);
        let mut part = |name: &str, default: f32| part(p, name, default);
        let (roughness, anisotropic) = (part("roughness", 0.5), part("anisotropic", 0.0));
        let (metallic, spec_trans) = (part("metallic", 0.0), part("spec_trans", 0.0));
        let (spec_tint, flatness) = (part("spec_tint", 0.0), part("flatness", 0.0));
        let (sheen, sheen_tint) = (part("sheen", 0.0), part("sheen_tint", 0.0));
        let (clearcoat, clearcoat_gloss) = (part("clearcoat", 0.0), part("clearcoat_gloss", 0.0));
        let eta = relative_index(p, spec_trans > 0.0);
        Principled {
            base_color,
            roughness,
            anisotropic,
            metallic,
            spec_trans,
            eta,
            spec_tint,
            sheen,
            sheen_tint,
            flatness,
            clearcoat,
            clearcoat_gloss,
            rates: Rates::read(p),
        }
    }
}

/// A number from 0 to 1; of one that varies something between, so that the lobe it weighs is there.
fn part(p: &mut dyn Parameters, name: &str, default: f32) -> f32 {
    match p.float(name) {
        Some(v) if !(0.0..=1.0).contains(&v) => {
            p.fault(name, format!("{name} is {v}; accepted are numbers from 0 to 1"));
            default
        }
        None if p.varies(name) => 0.5,
        value => value.unwrap_or(default),
    }
}

/// Index inside over index outside, from `eta` or `specular`.
fn relative_index(p: &mut dyn Parameters, transmits: bool) -> f32 {
    match (p.float("eta"), p.float("specular").map(|_| part(p, "specular", 0.5))) {
        (Some(_), Some(_)) => {
            p.fault("specular", "give either eta or specular, not both".into());
            1.5
        }
        (Some(eta), None) if !eta.is_finite() || eta <= 0.0 => {
            p.fault("eta", format!("eta is {eta}; a ratio of refractive indices is finite and greater than 0"));
            1.5
        }
        (Some(1.0), None) if transmits => 1.001,
        (Some(eta), None) => eta,
        (None, Some(0.0)) if transmits => index_of(1e-3),
        (None, specular) => index_of(specular.unwrap_or(0.5)),
    }
}

/// The index whose normal reflectance is 0.08 `specular`.
fn index_of(specular: f32) -> f32 {
    2.0 / (1.0 - (0.08 * specular).sqrt()) - 1.0
}

impl Rates {
    fn read(p: &mut dyn Parameters) -> Rates {
        let mut rate = |name: &str, least: f32, accepted: &str| match p.float(name) {
            Some(v) if !v.is_finite() || v < least => {
                p.fault(name, format!("{name} is {v}; a rate of sampling is finite and {accepted}"));
                1.0
            }
            rate => rate.unwrap_or(1.0),
        };
        Rates {
            base: rate("diffuse_reflectance_sampling_rate", 0.0, "not negative"),
            // what the facets do is done by no other lobe, so they are never without samples
            facets: rate("main_specular_sampling_rate", f32::MIN_POSITIVE, "greater than 0"),
            coat: rate("clearcoat_sampling_rate", 0.0, "not negative"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Scatter;
    use super::*;

    /// Every number goes to the parameter of its name: a grey of its own for each, which the debug form then shows.
    #[test]
    fn what_varies_is_put_where_its_name_says() {
        let mut material = Principled::examples()[0];
        let value = |i: usize| (i as f32 + 1.0) / 16.0;
        for i in 0..VARYING.len() {
            material.put(i, Rgb::splat(value(i)));
        }
        let text = format!("{material:?}");
        for (i, parameter) in VARYING.iter().enumerate().skip(1) {
            assert!(text.contains(&format!(" {}: {:?},", parameter.name, value(i))), "{} in {text}", parameter.name);
        }
        assert_eq!(material.base_color, Rgb::splat(value(0)));
    }

    #[test]
    fn an_index_of_one_and_a_half_is_a_specular_of_one_half() {
        assert!((index_of(0.5) - 1.5).abs() < 1e-6);
        assert_eq!(index_of(0.0), 1.0);
    }
}
