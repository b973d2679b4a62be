//! Scenes of other renderers become scenes of Mitsuba 3 that mean the same: element by element, by what relt loads, by
//! pictures, and by what is said about what cannot be converted.

mod command;
mod listings;
mod mitsuba;
mod mutations;
mod pbrt;
mod pictures;
mod support;
