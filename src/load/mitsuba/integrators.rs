//! `<integrator>`: of Mitsuba's, only the limits on path length concern relt.

use super::document::Element;
use super::parameters::ElementParameters;
use super::registry::Registry;
use crate::load::faults::Faults;
use crate::scene::description::Integrator;
use crate::scene::parameters::Parameters;

const INTEGRATORS: Registry<fn(&mut ElementParameters) -> Integrator> =
    Registry { tag: "integrator", plugins: &[("path", path)] };

/// What Mitsuba does without an integrator.
pub const DEFAULT: Integrator = Integrator { max_depth: None, rr_depth: 5 };

/// Reads the element.
pub fn read(element: &Element, faults: &Faults) -> Option<Integrator> {
    let read = INTEGRATORS.find(element, faults)?;
    let mut p = ElementParameters::new(element, faults);
    let integrator = read(&mut p);
    p.finish();
    Some(integrator)
}

/// `max_depth` (−1: no limit), `rr_depth`; `hide_emitters` only where it is false.
fn path(p: &mut ElementParameters) -> Integrator {
    let max_depth = match p.integer("max_depth") {
        None | Some(-1) => None,
        Some(depth) if (1..=Integrator::LONGEST.into()).contains(&depth) => Some(depth as u32),
        Some(depth) => {
            let longest = Integrator::LONGEST;
            p.fault("max_depth", format!("max_depth is {depth}; accepted: -1 (no limit) or 1 to {longest}"));
            None
        }
    };
    let rr_depth = match p.integer("rr_depth") {
        None => DEFAULT.rr_depth,
        Some(depth) if (1..=u32::MAX.into()).contains(&depth) => depth as u32,
        Some(depth) => {
            p.fault("rr_depth", format!("rr_depth is {depth}; accepted: 1 and more"));
            DEFAULT.rr_depth
        }
    };
    if p.boolean("hide_emitters") == Some(true) {
        p.fault("hide_emitters", "hide_emitters is not supported; accepted: false".into());
    }
    Integrator { max_depth, rr_depth }
}
