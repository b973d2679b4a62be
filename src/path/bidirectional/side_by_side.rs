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
use crate::path::lanes::{Ends, N, Vectors};

pub(super) mod camera;
pub(super) mod light;

/// [`Step`]s in step.
#[derive(Default)]
struct Steps {
    density: [f64; N],
    cos: [f64; N],
    before: [f64; N],
    shorter: [f64; N],
}

impl Steps {
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
#[derive(Default)]
struct Tails {
    inverse_density: [f64; N],
    shorter: [f64; N],
    earlier: [f64; N],
}

impl Tails {
    #[inline(always)]
    fn get(&self, j: usize) -> Tail {
        Tail { inverse_density: self.inverse_density[j], shorter: self.shorter[j], earlier: self.earlier[j] }
    }

    #[inline(always)]
    fn set(&mut self, j: usize, tail: Tail) {
        Tail { inverse_density: self.inverse_density[j], shorter: self.shorter[j], earlier: self.earlier[j] } = tail;
    }
}

/// What tails of subpaths follow from where edges end: where densities take the edges to start, square of the length, |cos|.
#[derive(Default)]
struct Arrivals {
    from: Vectors,
    step: Steps,
    distance2: [f32; N],
    cos: [f32; N],
    tail: Tails,
}

impl Arrivals {
    /// Arrives at that end, and finds where it is; |cos| between the edge and the normal there.
    #[inline(always)]
    fn meet(&mut self, j: usize, ends: &mut Ends) -> f32 {
        self.cos[j] = ends.meet(j).abs();
        self.distance2[j] = (ends.p.get(j) - self.from.get(j)).length_squared();
        self.cos[j]
    }

    /// The tails; after all have arrived.
    #[inline(always)]
    fn follow(&mut self) {
        for j in 0..N {
            self.tail.set(j, self.step.get(j).arrive(self.distance2[j], self.cos[j]));
        }
    }
}

/// What steps of subpaths follow from where edges start: densities of their directions, forwards and back, and |cos|.
#[derive(Default)]
struct Departures {
    pdf: [[f32; N]; 2],
    cos: [f32; N],
    step: Steps,
}

impl Departures {
    #[inline(always)]
    fn set(&mut self, j: usize, pdf: [f32; 2], cos: f32) {
        [self.pdf[0][j], self.pdf[1][j]] = pdf;
        self.cos[j] = cos;
    }

    /// The steps from those tails; after all have been set. `compared` as for [`Tail::leave`].
    #[inline(always)]
    fn follow(&mut self, tail: &Tails, compared: bool) {
        for j in 0..N {
            let densities = Some([self.pdf[0][j], self.pdf[1][j]]);
            self.step.set(j, tail.get(j).leave(densities, self.cos[j], compared));
        }
    }
}
