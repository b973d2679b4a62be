//! `<sensor>`, one file a plugin, with the film and the sampler that each holds.

mod perspective;

use super::document::Element;
use super::parameters::ElementParameters;
use super::registry::Registry;
use super::{films, samplers};
use crate::load::faults::Faults;
use crate::scene::description::{CameraDescription, FilmDescription};

const SENSORS: Registry<fn(&mut ElementParameters) -> CameraDescription> =
    Registry { tag: "sensor", plugins: &[("perspective", perspective::read)] };

/// Reads the element.
pub fn read(element: &Element, faults: &Faults) -> Option<(CameraDescription, FilmDescription)> {
    let read = SENSORS.find(element, faults)?;
    let mut p = ElementParameters::new(element, faults);
    let camera = read(&mut p);
    if let Some(sampler) = p.single("sampler") {
        samplers::check(sampler, faults);
    }
    let film = p.single("film").and_then(|film| films::read(film, faults)).unwrap_or(films::DEFAULT);
    p.finish();
    Some((camera, film))
}
