//! `<rfilter>`: reconstruction filters.

use super::document::Element;
use super::parameters::ElementParameters;
use super::registry::Registry;
use crate::film::Filter;
use crate::load::faults::Faults;
use crate::scene::parameters::Parameters;

const FILTERS: Registry<fn(&mut ElementParameters) -> Filter> = Registry {
    tag: "rfilter",
    plugins: &[
        ("box", |_| Filter::Box),
        ("catmullrom", |_| Filter::Mitchell { b: 0.0, c: 0.5 }),
        ("gaussian", gaussian),
        ("lanczos", lanczos),
        ("mitchell", mitchell),
        ("tent", tent),
    ],
};

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

/// `B` and `C`, as the paper calls them.
fn mitchell(p: &mut ElementParameters) -> Filter {
    Filter::Mitchell { b: share(p, "B"), c: share(p, "C") }
}

/// `lobes`, the radius in pixels.
fn lanczos(p: &mut ElementParameters) -> Filter {
    const DEFAULT: u32 = 3;
    let lobes = match p.integer("lobes") {
        None => DEFAULT,
        Some(given) if (1..=MAX_RADIUS as i64).contains(&given) => given as u32,
        Some(given) => {
            p.fault("lobes", format!("lobes is {given}; accepted: 1 to {MAX_RADIUS}"));
            DEFAULT
        }
    };
    Filter::Lanczos { lobes }
}

/// A parameter of the cubics, of which the paper considers those within [0, 1]; others ring or blur without bounds.
fn share(p: &mut ElementParameters, name: &str) -> f32 {
    const DEFAULT: f32 = 1.0 / 3.0;
    let given = p.float(name).unwrap_or(DEFAULT);
    if (0.0..=1.0).contains(&given) {
        return given;
    }
    p.fault(name, format!("{name} is {given}; accepted: 0 to 1"));
    DEFAULT
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
