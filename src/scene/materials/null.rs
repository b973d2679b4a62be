//! Nothing at all.

use glam::Vec3;

use super::{Evaluation, Lobes, Scatter, ScatterSample};
use crate::scene::{Rgb, parameters::Parameters};

/// Light passes straight through, as if the surface were not there. Alone it marks a border; mixed with others it makes
/// surfaces that are there in parts.
///
/// Only paths that follow it get through: to connections with lights the surface is in the way, as in Mitsuba's `path`.
#[derive(Clone, Copy, Debug)]
pub struct Null;

impl Scatter for Null {
    fn lobes(&self) -> Lobes {
        Lobes { straight: true, ..Lobes::NONE }
    }

    #[inline(always)]
    fn sample(&self, wo: Vec3, _u: [f32; 2], _choice: f32) -> Option<ScatterSample> {
        Some(ScatterSample { wi: -wo, weight: Rgb::ONE, pdf: f32::INFINITY, eta: 1.0 })
    }

    #[inline(always)]
    fn evaluate(&self, _wo: Vec3, _wi: Vec3) -> Evaluation {
        Evaluation::ZERO
    }

    fn read(_parameters: &mut dyn Parameters) -> Self {
        Null
    }

    fn examples() -> Vec<Self> {
        vec![Null]
    }
}
