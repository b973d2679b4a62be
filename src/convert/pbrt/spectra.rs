//! Colours, refractive indices and metals as pbrt gives them.

use super::parameters::{Parameter, Parameters, Values};
use crate::convert::Rgb;
use crate::convert::notes::Notes;
use crate::convert::spectra::{Spectrum, blackbody_hue};
use crate::load;

/// What a colour is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Of {
    /// A surface, under white light.
    Surface,
    /// A light. As pbrt does, light that is not given as RGB is brought to luminance 1; its scale says the rest.
    Light,
    /// A refractive index.
    Index,
}

/// Types that a colour may be of.
pub const COLOURS: &[&str] = &["rgb", "spectrum", "blackbody", "float"];

/// A colour parameter.
pub fn colour(parameters: &Parameters, name: &str, of: Of, notes: &Notes) -> Option<Rgb> {
    let parameter = parameters.get(name, COLOURS)?;
    value(parameter, of, notes).map_err(|message| notes.fault(&parameter.place, format!("{name}: {message}"))).ok()
}

/// The value of a colour parameter.
pub fn value(parameter: &Parameter, of: Of, notes: &Notes) -> Result<Rgb, String> {
    match (&parameter.kind[..], &parameter.values) {
        ("rgb", Values::Numbers(numbers)) => match numbers[..] {
            [r, g, b, ..] => Ok([r, g, b]),
            _ => Err("a colour has three numbers".into()),
        },
        ("float", Values::Numbers(numbers)) => match numbers[..] {
            [grey, ..] => Ok([grey; 3]),
            [] => Err("it has no number".into()),
        },
        ("blackbody", Values::Numbers(numbers)) => match numbers[..] {
            [kelvin, ..] if kelvin > 0.0 => Ok(blackbody_hue(kelvin)),
            _ => Err("a temperature in kelvin must be above 0".into()),
        },
        ("spectrum", Values::Numbers(numbers)) => {
            let samples = numbers.as_chunks().0.iter().map(|[wavelength, value]| (*wavelength, *value)).collect();
            Spectrum::new(samples).map(|spectrum| colour_of(&spectrum, of))
        }
        ("spectrum", Values::Strings(names)) => named(names.first().map_or("", String::as_str), of, notes),
        _ => Err("its value is no colour".into()),
    }
}

fn colour_of(spectrum: &Spectrum, of: Of) -> Rgb {
    match of {
        Of::Surface => spectrum.reflectance(),
        Of::Light => spectrum.hue(),
        Of::Index => spectrum.emission(),
    }
}

/// A spectrum by name or in a file.
fn named(name: &str, of: Of, notes: &Notes) -> Result<Rgb, String> {
    if let Some((_, index)) = GLASSES.iter().find(|(known, _)| *known == name) {
        return Ok([*index; 3]);
    }
    if name.starts_with("stdillum-D65") || name == "illum-acesD60" {
        return Ok([1.0; 3]);
    }
    let path = notes.file(&notes.home(), name, true)?;
    match load::text_of(&path) {
        Ok(text) => Spectrum::of_file(&text).map(|s| colour_of(&s, of)).map_err(|m| format!("{}: {m}", path.display())),
        Err(error) => Err(format!("the spectrum {name:?} is not known by name, and {} {error}", path.display())),
    }
}

/// Refractive indices at 587.6 nm (data sheets of Schott). pbrt's F glasses are dense flints, SF by their makers' names.
const GLASSES: &[(&str, f64)] = &[
    ("glass-BK7", 1.5168),
    ("glass-BAF10", 1.6700),
    ("glass-FK51A", 1.4866),
    ("glass-LASF9", 1.8503),
    ("glass-F5", 1.6727),
    ("glass-F10", 1.7283),
    ("glass-F11", 1.7847),
];

/// A refractive index, which is one number; of a spectrum, the mean. `default` where it is absent.
pub fn index(parameters: &Parameters, name: &str, default: f64, notes: &Notes) -> f64 {
    let Some(parameter) = parameters.get(name, &["float", "spectrum"]) else { return default };
    if parameter.kind == "spectrum" {
        let message = format!("{name}: one refractive index for all colours, so light is not dispersed");
        notes.changed(&parameter.place, message);
    }
    match value(parameter, Of::Index, notes) {
        Ok([r, g, b]) => (r + g + b) / 3.0,
        Err(message) => {
            notes.fault(&parameter.place, format!("{name}: {message}"));
            default
        }
    }
}

/// What a conductor is of.
#[derive(Clone, Debug, PartialEq)]
pub enum Metal {
    /// A material that Mitsuba 3 knows by this name.
    Named(&'static str),
    /// Complex refractive index.
    Index {
        /// Real part.
        eta: Rgb,
        /// Imaginary part.
        k: Rgb,
    },
}

/// Metals that pbrt and Mitsuba 3 both know.
const METALS: &[&str] = &["Ag", "Al", "Au", "Cu", "MgO", "TiO2"];

/// `eta` and `k`, copper's where they are absent; with other names for coated conductors.
pub fn metal(parameters: &Parameters, [eta, k]: [&str; 2], notes: &Notes) -> Metal {
    let given = [eta, k].map(|name| parameters.get(name, &["spectrum", "rgb", "float"]));
    let name = |parameter: Option<&Parameter>, end: &str| match parameter {
        None => Some("Cu".to_owned()),
        Some(parameter) => Some(parameter.string()?.strip_prefix("metal-")?.strip_suffix(end)?.to_owned()),
    };
    if let (Some(of_eta), Some(of_k)) = (name(given[0], "-eta"), name(given[1], "-k"))
        && of_eta == of_k
        && let Some(known) = METALS.iter().find(|known| **known == of_eta)
    {
        return Metal::Named(known);
    }
    let name = given[0].and_then(Parameter::string).unwrap_or_default();
    if name.starts_with("metal-") {
        let message = format!("{name}: Mitsuba 3 does not know this metal; copper is written");
        notes.left_out(parameters.place_of(eta), message);
        return Metal::Named("Cu");
    }
    let part = |parameter: Option<&Parameter>, default: Rgb| {
        let Some(parameter) = parameter else { return default };
        value(parameter, Of::Index, notes).unwrap_or_else(|message| {
            notes.fault(&parameter.place, message);
            default
        })
    };
    let (_, copper_eta, copper_k) =
        crate::scene::materials::CONDUCTORS.iter().find(|(name, ..)| *name == "Cu").expect("copper is in the table");
    Metal::Index {
        eta: part(given[0], crate::convert::numbers_of(*copper_eta)),
        k: part(given[1], crate::convert::numbers_of(*copper_k)),
    }
}
