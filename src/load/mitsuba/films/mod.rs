//! `<film>`, one file a plugin.

mod hdrfilm;

use super::document::Element;
use super::parameters::ElementParameters;
use super::registry::Registry;
use super::rfilters;
use crate::load::faults::Faults;
use crate::scene::description::FilmDescription;

/// Reads a film; the second argument collects what the person should know.
type Reader = fn(&mut ElementParameters, &mut Vec<String>) -> FilmDescription;

const FILMS: Registry<Reader> = Registry { tag: "film", plugins: &[("hdrfilm", hdrfilm::read)] };

/// What Mitsuba's sensors do without a film.
pub const DEFAULT: FilmDescription = FilmDescription::new(768, 576, rfilters::DEFAULT);

/// Reads the element, and adds to `warnings`.
pub fn read(element: &Element, faults: &Faults, warnings: &mut Vec<String>) -> Option<FilmDescription> {
    let read = FILMS.find(element, faults)?;
    let mut p = ElementParameters::new(element, faults);
    let film = read(&mut p, warnings);
    p.finish();
    Some(film)
}
