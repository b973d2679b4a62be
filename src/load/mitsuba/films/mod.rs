//! `<film>`, one file a plugin.

mod hdrfilm;

use super::document::Element;
use super::parameters::ElementParameters;
use super::registry::Registry;
use super::rfilters;
use crate::load::faults::Faults;
use crate::scene::description::FilmDescription;

const FILMS: Registry<fn(&mut ElementParameters) -> FilmDescription> =
    Registry { tag: "film", plugins: &[("hdrfilm", hdrfilm::read)] };

/// What Mitsuba's sensors do without a film.
pub const DEFAULT: FilmDescription = FilmDescription { width: 768, height: 576, filter: rfilters::DEFAULT };

/// Reads the element.
pub fn read(element: &Element, faults: &Faults) -> Option<FilmDescription> {
    let read = FILMS.find(element, faults)?;
    let mut p = ElementParameters::new(element, faults);
    let film = read(&mut p);
    p.finish();
    Some(film)
}
