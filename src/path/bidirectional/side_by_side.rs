//! What happens at the vertices of several subpaths at a time, in scenes of flat meshes: as for
//! [camera paths](crate::path::unidirectional), loops that fetch what lies anywhere in memory take turns with loops that
//! compute, which have no branches and become vector instructions.
//!
//! What weighs techniques is f64 and has loops of its own: the compiler makes no vectors of loops that have both kinds.
//!
//! They call what [`subpath`](super::subpath) and [`connections`](super::connections) are made of, so every lane gets the
//! bits that it would have got alone; lanes without a subpath compute something that nobody looks at, and so do those on
//! materials that are not diffuse, which then go through the vertex alone.

use super::weights::{Step, Tail};
use crate::path::lanes::N;

pub(super) mod camera;
pub(super) mod light;

/// [`Step`]s in step.
struct Steps {
    density: [f64; N],
    cos: [f64; N],
    before: [f64; N],
    shorter: [f64; N],
}

impl Steps {
    const NOWHERE: Steps = Steps { density: [1.0; N], cos: [1.0; N], before: [0.0; N], shorter: [0.0; N] };

    #[inline(always)]
    fn get(&self, j: usize) -> Step {
        Step { density: self.density[j], cos: self.cos[j], before: self.before[j], shorter: self.shorter[j] }
    }

    #[inline(always)]
    fn set(&mut self, j: usize, step: Step) {
        Step { density: self.density[j], cos: self.cos[j], before: self.before[j], shorter: self.shorter[j] } = step;
    }
}

/// [`Tail`]s in step.
struct Tails {
    inverse_density: [f64; N],
    shorter: [f64; N],
    earlier: [f64; N],
}

impl Tails {
    const NONE: Tails = Tails { inverse_density: [0.0; N], shorter: [0.0; N], earlier: [0.0; N] };

    #[inline(always)]
    fn get(&self, j: usize) -> Tail {
        Tail { inverse_density: self.inverse_density[j], shorter: self.shorter[j], earlier: self.earlier[j] }
    }

    #[inline(always)]
    fn set(&mut self, j: usize, tail: Tail) {
        Tail { inverse_density: self.inverse_density[j], shorter: self.shorter[j], earlier: self.earlier[j] } = tail;
    }
}
