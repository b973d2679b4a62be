//! Whole pictures, from scene file to image, against what is known of them.
//!
//! [`mapping`] batch against scalar; [`choice`] which mapping is chosen; [`furnace`] scenes whose image is a formula; [`refraction`] light in glass; [`references`] scenes rendered by
//! another program to little noise; [`mitsuba`] small scenes with one feature each, the same; [`scattering`] materials
//! value by value, the same; [`techniques`] changes of technique; [`bits`] what must not change a bit; [`darkness`] scenes without light, with hardly any and
//! with too much; [`non_finite`] contributions that cannot be used; [`health`] what is said
//! of runs.
//!
//! Statistical tests compare means over independent runs (samples of one chain correlate, runs do not), state their
//! level, and leave the table and images of a failure under `target/test-evidence/NAME`.

mod bits;
mod choice;
mod darkness;
mod furnace;
mod health;
mod mapping;
mod mitsuba;
mod non_finite;
mod outcomes;
mod references;
mod refraction;
mod scattering;
mod support;
mod techniques;
