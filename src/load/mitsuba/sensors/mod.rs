//! `<sensor>`, one file a plugin, with the film and the sampler that each holds.

mod orthographic;
mod perspective;
mod thinlens;

use super::document::Element;
use super::parameters::ElementParameters;
use super::registry::Registry;
use super::{films, samplers};
use crate::load::faults::Faults;
use crate::scene::description::{CameraDescription, FilmDescription};
use crate::scene::parameters::Parameters;

const SENSORS: Registry<fn(&mut ElementParameters) -> CameraDescription> = Registry {
    tag: "sensor",
    plugins: &[("orthographic", orthographic::read), ("perspective", perspective::read), ("thinlens", thinlens::read)],
};

/// What a sensor says.
pub struct View {
    /// The camera.
    pub camera: CameraDescription,
    /// The picture.
    pub film: FilmDescription,
    /// What the person should know, one sentence each.
    pub warnings: Vec<String>,
}

/// Reads the element.
pub fn read(element: &Element, faults: &Faults) -> Option<View> {
    let read = SENSORS.find(element, faults)?;
    let mut p = ElementParameters::new(element, faults);
    let camera = read(&mut p);
    if let Some(sampler) = p.single("sampler") {
        samplers::check(sampler, faults);
    }
    let mut warnings = Vec::new();
    let film = p.single("film").and_then(|film| films::read(film, faults, &mut warnings)).unwrap_or(films::DEFAULT);
    p.finish();
    Some(View { camera, film, warnings })
}

/// `near_clip` and `far_clip`, which all sensors have.
fn clip(p: &mut ElementParameters) -> (f32, f32) {
    let near = p.float("near_clip").unwrap_or(1e-2);
    let far = p.float("far_clip").unwrap_or(1e4);
    if near <= 0.0 {
        p.fault("near_clip", format!("near_clip is {near}; it must be above 0"));
    }
    if near >= far {
        p.fault("near_clip", format!("near_clip is {near} and far_clip {far}; near_clip must be the smaller"));
    }
    (near, far)
}
