//! `<rfilter>`: reconstruction filters.

use super::document::Element;
use super::parameters::ElementParameters;
use super::registry::Registry;
use crate::film::Filter;
use crate::load::faults::Faults;
use crate::scene::parameters::Parameters;

const FILTERS: Registry<fn(&mut ElementParameters) -> Filter> =
    Registry { tag: "rfilter", plugins: &[("box", |_| Filter::Box), ("gaussian", gaussian), ("tent", tent)] };

/// What Mitsuba's films do without a filter.
pub const DEFAULT: Filter = Filter::Gaussian { stddev: 0.5 };

/// Widest filter in pixels: each sample touches the square of it.
const MAX_RADIUS: f32 = 16.0;

/// Reads the element.
pub fn read(element: &Element, faults: &Faults) -> Option<Filter> {
    let read = FILTERS.find(element, faults)?;
    let mut p = ElementParameters::new(element, faults);
    let filter = read(&mut p);
    p.finish();
    Some(filter)
}

/// `stddev` in pixels.
fn gaussian(p: &mut ElementParameters) -> Filter {
    Filter::Gaussian { stddev: length(p, "stddev", 0.5, MAX_RADIUS / 4.0) }
}

/// `radius` in pixels.
fn tent(p: &mut ElementParameters) -> Filter {
    Filter::Tent { radius: length(p, "radius", 1.0, MAX_RADIUS) }
}

/// A length within (0, most].
fn length(p: &mut ElementParameters, name: &str, default: f32, most: f32) -> f32 {
    let given = p.float(name).unwrap_or(default);
    if given > 0.0 && given <= most {
        return given;
    }
    p.fault(name, format!("{name} is {given} pixels; it must be above 0 and at most {most}"));
    default
}
