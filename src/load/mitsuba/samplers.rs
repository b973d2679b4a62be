//! `<sampler>`: relt has its own; what a scene says is checked and not used.

use super::document::Element;
use super::parameters::ElementParameters;
use super::registry::Registry;
use crate::load::faults::Faults;
use crate::scene::parameters::Parameters;

const SAMPLERS: Registry<fn(&mut ElementParameters)> =
    Registry { tag: "sampler", plugins: &[("independent", independent)] };

/// Checks the element.
pub fn check(element: &Element, faults: &Faults) {
    let Some(check) = SAMPLERS.find(element, faults) else { return };
    let mut p = ElementParameters::new(element, faults);
    check(&mut p);
    p.finish();
}

/// `sample_count` and `seed`.
fn independent(p: &mut ElementParameters) {
    p.integer("sample_count");
    p.integer("seed");
}
