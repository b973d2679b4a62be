//! Attribute text to numbers and colours.

use super::document::Node;
use crate::convert::Rgb;
use crate::convert::notes::Notes;
use crate::convert::spectra::{self, Spectrum, linear_of_srgb};
use crate::convert::values::{exactly, number, numbers};
use crate::load;

/// Tags of colours.
pub const COLOURS: &[&str] = &["rgb", "srgb", "spectrum", "blackbody", "xyz", "float", "integer", "color"];

/// What a colour is for: a spectrum that reflects is seen under white light, one that is emitted is seen itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Of {
    /// A surface.
    Surface,
    /// A light.
    Light,
    /// A refractive index: neither.
    Index,
}

/// The colour of an element, linear.
pub fn colour(node: &Node, of: Of, notes: &Notes) -> Option<Rgb> {
    let read = match &node.tag[..] {
        "float" | "integer" => number(node.value("value")).map(|grey| [grey; 3]),
        "rgb" | "color" => triple(node.value("value")),
        "srgb" => triple(node.value("value")).map(|rgb| rgb.map(linear_of_srgb)),
        "xyz" => exactly(node.value("value")).map(spectra::rgb_of_xyz),
        "blackbody" => blackbody(node),
        "spectrum" => spectrum(node, of, notes),
        other => Err(format!("<{other}> is no colour; known: {}", COLOURS.join(", "))),
    };
    read.map_err(|message| notes.fault(node.place_of("value"), message)).ok()
}

/// Three numbers, one for all of them, or bytes as in `#ff8000`.
fn triple(text: &str) -> Result<Rgb, String> {
    if let Some(digits) = text.trim().strip_prefix('#') {
        let byte = |i: usize| digits.get(2 * i..2 * i + 2).and_then(|pair| u8::from_str_radix(pair, 16).ok());
        return match [0, 1, 2].map(byte) {
            [Some(r), Some(g), Some(b)] if digits.len() == 6 => Ok([r, g, b].map(|byte| f64::from(byte) / 255.0)),
            _ => Err(format!("{text:?} is no colour; expected six hexadecimal digits after #")),
        };
    }
    match numbers(text)?[..] {
        [grey] => Ok([grey; 3]),
        [r, g, b] => Ok([r, g, b]),
        ref given => Err(format!("{text:?} holds {} numbers; expected 1 or 3", given.len())),
    }
}

/// `temperature` in kelvin, with or without a `K`, and `scale`.
fn blackbody(node: &Node) -> Result<Rgb, String> {
    let kelvin = number(node.value("temperature").trim().trim_end_matches(['k', 'K']))?;
    if kelvin <= 0.0 {
        return Err(format!("the temperature is {kelvin} K; it must be above 0"));
    }
    let scale = match node.attribute("scale") {
        Some(scale) => number(&scale.value)?,
        None => 1.0,
    };
    Ok(spectra::blackbody(kelvin).map(|value| value * scale))
}

/// One or three numbers, wavelengths with values as in `400:0.1, 700:0.9`, or a file of such.
fn spectrum(node: &Node, of: Of, notes: &Notes) -> Result<Rgb, String> {
    let text = node.value("value");
    let spectrum = if let Some(filename) = node.attribute("filename") {
        let path = notes.file(&notes.folder(&filename.place), &filename.value, filename.is_plain)?;
        let text = load::text_of(&path).map_err(|error| format!("{}: {error}", path.display()))?;
        Spectrum::of_file(&text).map_err(|message| format!("{}: {message}", path.display()))?
    } else if text.contains(':') {
        let pair = |pair: &str| {
            let (wavelength, value) = pair.split_once(':').ok_or(format!("{pair:?} is no wavelength:value"))?;
            Ok((number(wavelength)?, number(value)?))
        };
        let pairs = text.split([',', ' ', '\t', '\n', '\r']).filter(|part| !part.is_empty()).map(pair);
        Spectrum::new(pairs.collect::<Result<_, String>>()?)?
    } else {
        return triple(text);
    };
    Ok(match of {
        Of::Surface => spectrum.reflectance(),
        Of::Light | Of::Index => spectrum.emission(),
    })
}
