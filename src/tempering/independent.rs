//! The uniform rung beside the ladders: stratified points that are offered to nobody.
//!
//! Points that are offered to chains must be independent of everything; those that only serve the image may come in
//! the even order of a path tracer (ALGORITHM section 11). Where nothing but such points is drawn, relt is a path
//! tracer.

use super::{Canvas, Round, Tally};
use crate::{
    chain::{Evaluator, Start, Target},
    rng::{Counter, Purpose, Rng},
    sample::{Move, PixelOrder, Points},
};

/// Points that are evaluated together, at most.
const LANES: usize = 256;

/// One block's share of the stratified points.
pub struct Independent<W> {
    block: usize,
    blocks: usize,
    order: PixelOrder,
    evaluator: Evaluator<W>,
    /// Stratified points do not move from anywhere; the interface of proposals wants a place.
    nowhere: Points,
    /// Points of all blocks so far.
    drawn: u64,
    sweeps: u64,
}

impl<W: Default> Independent<W> {
    /// Block number `block` of `blocks`, for a film of that size.
    pub fn new(rng: Rng, (block, blocks): (usize, usize), size: [u32; 2]) -> Independent<W> {
        let mut evaluator = Evaluator::new(rng, vec![NOBODY; LANES]);
        evaluator.film = size;
        Independent {
            block,
            blocks,
            order: PixelOrder::new(size),
            evaluator,
            nowhere: Points::new(0),
            drawn: 0,
            sweeps: 0,
        }
    }

    /// Evaluates and records the block's next `points` points; all blocks are asked for as many.
    ///
    /// The blocks take turns at random over the pixels, so that no block sees always the same of them: what blocks find
    /// then differs as that of independent groups does, or a little more.
    pub fn sweep<T: Target<Workspace = W>>(
        &mut self,
        target: &T,
        points: usize,
        canvas: &Canvas,
        round: &Round,
        tally: &mut Tally,
        mut keep: impl FnMut(Start),
    ) {
        let turn = Counter { step: self.sweeps, purpose: Purpose::Turn, ..NOBODY };
        let turn = self.evaluator.rng().words(turn, 0)[0] as usize;
        let chunk = (self.block + turn) % self.blocks;
        let mut counters = self.order.points_from(self.drawn + (chunk * points) as u64);
        let mut left = points;
        while left > 0 {
            let lanes = left.min(LANES);
            self.evaluator.moves[..lanes].fill(Move::Stratified);
            self.evaluator.moves[lanes..].fill(Move::Rest);
            self.evaluator.counters[..lanes].iter_mut().zip(&mut counters).for_each(|(c, next)| *c = next);
            self.evaluator.evaluate(target, &self.nowhere);
            for (point, counter) in self.evaluator.out.lanes[..lanes].iter().zip(&self.evaluator.counters) {
                tally.uniform_point(canvas, round, point);
                keep(Start { counter: *counter, ln_g: point.ln_g });
            }
            left -= lanes;
        }
        self.drawn += (self.blocks * points) as u64;
        self.sweeps += 1;
    }

    /// Rays traced and contributions settled since this was last asked for.
    pub fn take_rays_and_faults(&mut self) -> [u64; 2] {
        let out = &mut self.evaluator.out;
        [std::mem::take(&mut out.rays), std::mem::take(&mut out.non_finite)]
    }
}

/// The counter of a lane that has none yet.
const NOBODY: Counter = Counter { ladder: 0, replica: 0, step: 0, purpose: Purpose::Stratified };
