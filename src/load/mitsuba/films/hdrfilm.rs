//! `hdrfilm`: a picture of `width` × `height` pixels with an `rfilter`.
//!
//! Checked and otherwise ignored, because relt writes 32 bit OpenEXR in any case: `file_format` (openexr, exr),
//! `pixel_format` (rgb, rgba), `component_format` (float16, float32), `banner`, `sample_border`,
//! `high_quality_edges`, `compensate`.

use super::super::parameters::ElementParameters;
use super::super::rfilters;
use super::DEFAULT;
use crate::scene::description::FilmDescription;
use crate::scene::parameters::Parameters;

/// Largest width and height.
const MAX_SIZE: u32 = 65536;

/// Reads the film.
pub fn read(p: &mut ElementParameters) -> FilmDescription {
    p.choice("file_format", &[("openexr", ()), ("exr", ())], ());
    p.choice("pixel_format", &[("rgb", ()), ("rgba", ())], ());
    p.choice("component_format", &[("float16", ()), ("float32", ())], ());
    for harmless in ["banner", "sample_border", "high_quality_edges", "compensate"] {
        p.boolean(harmless);
    }
    let filter = p.single("rfilter").and_then(|element| rfilters::read(element, p.faults));
    FilmDescription {
        width: size(p, "width", DEFAULT.width),
        height: size(p, "height", DEFAULT.height),
        filter: filter.unwrap_or(rfilters::DEFAULT),
    }
}

/// A number of pixels.
fn size(p: &mut ElementParameters, name: &str, default: u32) -> u32 {
    match p.integer(name) {
        None => default,
        Some(given) if (1..=MAX_SIZE.into()).contains(&given) => given as u32,
        Some(given) => {
            p.fault(name, format!("{name} is {given} pixels; accepted: 1 to {MAX_SIZE}"));
            default
        }
    }
}
