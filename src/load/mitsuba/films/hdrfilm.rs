//! `hdrfilm`: a picture of `width` × `height` pixels with an `rfilter`, or a part of it: `crop_width` × `crop_height`
//! pixels from column `crop_offset_x` and row `crop_offset_y` on. `pixel_format` is rgb, rgba, luminance or
//! luminance_alpha; relt has no alpha and says so.
//!
//! Checked and otherwise ignored, because relt writes 32 bit OpenEXR in any case and its sums are exact: `file_format`
//! (openexr, exr), `component_format` (float16, float32), `banner`, `compensate`. `sample_border`,
//! by which samples beyond the picture reach into it, is refused where the filter is wider than a pixel.

use super::super::parameters::ElementParameters;
use super::super::rfilters;
use super::DEFAULT;
use crate::film::{Filter, PixelFormat, Window};
use crate::scene::description::FilmDescription;
use crate::scene::parameters::Parameters;

/// Largest width and height.
const MAX_SIZE: u32 = 65536;

/// Names of formats, what they are here, and whether they have an alpha channel.
const FORMATS: &[(&str, (PixelFormat, bool))] = &[
    ("rgb", (PixelFormat::Rgb, false)),
    ("rgba", (PixelFormat::Rgb, true)),
    ("luminance", (PixelFormat::Luminance, false)),
    ("luminance_alpha", (PixelFormat::Luminance, true)),
];

/// Reads the film.
pub fn read(p: &mut ElementParameters, warnings: &mut Vec<String>) -> FilmDescription {
    p.choice("file_format", &[("openexr", ()), ("exr", ())], ());
    p.choice("component_format", &[("float16", ()), ("float32", ())], ());
    for harmless in ["banner", "compensate"] {
        p.boolean(harmless);
    }
    let (format, has_alpha) = p.choice("pixel_format", FORMATS, DEFAULT_FORMAT);
    if has_alpha {
        warnings.push("the film asks for an alpha channel, which relt does not write".to_owned());
    }
    let filter = p.single("rfilter").and_then(|element| rfilters::read(element, p.faults)).unwrap_or(rfilters::DEFAULT);
    if p.boolean("sample_border") == Some(true) && filter != Filter::Box {
        let message = "sample_border is supported with the box filter alone, where it changes nothing; accepted: false";
        p.fault("sample_border", message.into());
    }
    let whole = [size(p, "width", DEFAULT.width), size(p, "height", DEFAULT.height)];
    let (x, width) = part(p, "crop_offset_x", "crop_width", whole[0]);
    let (y, height) = part(p, "crop_offset_y", "crop_height", whole[1]);
    FilmDescription { width, height, window: Window { whole, offset: [x, y] }, filter, format }
}

/// Without a `pixel_format`.
const DEFAULT_FORMAT: (PixelFormat, bool) = (PixelFormat::Rgb, false);

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

/// Where the part that is wanted begins along one axis of the whole, and its length; all of it where it is not given.
///
/// As in Mitsuba, an offset alone is a fault: a part without a size is as large as the whole, and does not fit.
fn part(p: &mut ElementParameters, offset_name: &str, size_name: &str, whole: u32) -> (u32, u32) {
    let offset = p.integer(offset_name).unwrap_or(0);
    let size = p.integer(size_name);
    let room = i64::from(whole) - offset;
    if !(0..whole.into()).contains(&offset) {
        p.fault(offset_name, format!("{offset_name} is {offset}; accepted: 0 to {}", whole - 1));
        return (0, whole);
    }
    match size {
        Some(size) if (1..=room).contains(&size) => return (offset as u32, size as u32),
        Some(size) => {
            let message =
                format!("{size_name} is {size} pixels; accepted: 1 to {room}, of {whole} from pixel {offset} on");
            p.fault(size_name, message);
        }
        None if offset == 0 || p.is_given(size_name) => {} // all of it, or what is given is no number
        None => p.fault(offset_name, format!("{offset_name} is {offset} without a {size_name}; accepted: 1 to {room}")),
    }
    (0, whole)
}
