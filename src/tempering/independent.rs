//! The uniform rung beside the ladders: stratified points that are offered to nobody.
//!
//! Points that are offered to chains must be independent of everything; those that only serve the image may come in
//! the even order of a path tracer (ALGORITHM section 11). Where nothing but such points is drawn, relt is a path
//! tracer.

use std::sync::Arc;

use super::{Canvas, Round, Tally};
use crate::{
    chain::{Evaluator, Importance, Start, Target},
    path::Faults,
    ranks::Group,
    rng::{Counter, Purpose, Rng},
    sample::{Move, PixelOrder, Points},
    saved::{Unfit, expect},
};

/// Points that are evaluated together, at most.
const LANES: usize = 256;
/// Parts of a pass that count for different groups.
const QUARTERS: u64 = 4;

/// What stratified points are drawn for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Use {
    /// For the image and, as long as there are none, to start chains from.
    Image,
    /// For the image, with what they choose left open.
    OpenImage,
    /// To start chains from, and no more.
    Starts,
}

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
    pixels: u64,
    /// Group that the tally's points are for.
    group: usize,
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
            pixels: u64::from(size[0]) * u64::from(size[1]),
            group: 0,
        }
    }

    /// Evaluates and records the block's next `points` points, those of them that are this rank's among a `group` that
    /// shares the block; all blocks are asked for as many. `keep` is told of each that chose.
    pub fn sweep<T: Target<Workspace = W>>(
        &mut self,
        target: &T,
        (points, purpose, group): (usize, Use, Option<&Group>),
        canvas: &Canvas,
        round: &Round,
        tally: &mut Tally,
        mut keep: impl FnMut(Start),
    ) {
        let mut next = self.drawn + (self.block * points) as u64;
        let mut counters = self.order.points_from(next);
        let mut left = points;
        while left > 0 {
            let lanes = left.min(LANES);
            let counted_for = self.group(next);
            if counted_for != self.group {
                canvas.groups.take(self.group, tally);
                self.group = counted_for;
            }
            left -= lanes;
            next += lanes as u64;
            let own = group.map_or(0..0, |group| group.own(lanes));
            let batch = counters.by_ref().take(lanes).enumerate();
            let mine = batch.filter(|(i, _)| own.contains(i)).map(|(_, counter)| counter);
            self.evaluator.counters.iter_mut().zip(mine).for_each(|(c, next)| *c = next);
            let lanes = own.len();
            if lanes == 0 {
                continue;
            }
            self.evaluator.moves[..lanes].fill(Move::Stratified);
            self.evaluator.moves[lanes..].fill(Move::Rest);
            if purpose == Use::OpenImage {
                self.evaluator.evaluate_open(target, &self.nowhere);
            } else {
                self.evaluator.evaluate(target, &self.nowhere);
            }
            for (lane, counter) in self.evaluator.counters[..lanes].iter().enumerate() {
                let point = self.evaluator.out.whole(lane);
                match purpose {
                    Use::Image => tally.uniform_point(canvas, round, point, true),
                    Use::Starts => tally.only_seen(point),
                    Use::OpenImage => {
                        tally.open_point(canvas, round, point.main.film, self.evaluator.out.outcomes.of(lane));
                        continue;
                    }
                }
                keep(Start { counter: *counter, ln_g: point.main.ln_g });
            }
        }
        self.drawn += (self.blocks * points) as u64;
    }

    /// The group that a point counts for, `next` its number in the order of pixels: quarters of passes take turns.
    ///
    /// What is found in a quarter of a pass, which is spread evenly over the film, hardly depends on which quarter it is,
    /// so groups differ by the noise within pixels, as the image does. Groups made of blocks would differ by the pixels
    /// that they happened to visit: on `cornell-box` at 64 points a pixel the mean was told with an error of 1.25 % in the
    /// place of 0.23 %.
    fn group(&self, next: u64) -> usize {
        let (pass, place) = (next / self.pixels, next % self.pixels);
        let quarter = place * QUARTERS / self.pixels;
        let turn = Counter { step: pass, purpose: Purpose::Turn, ..NOBODY };
        let turn = u64::from(self.evaluator.rng().words(turn, 0)[0]);
        ((QUARTERS * pass + (quarter + turn) % QUARTERS) % self.blocks as u64) as usize
    }

    /// Hands over what was seen and not yet given to its group.
    pub fn settle(&mut self, canvas: &Canvas, tally: &mut Tally) {
        canvas.groups.take(self.group, tally);
    }

    /// Points of all blocks so far, and the group that the next count for: all that there is to save between sweeps.
    pub fn saved(&self) -> (u64, usize) {
        (self.drawn, self.group)
    }

    /// Goes on from there.
    pub fn restore(&mut self, (drawn, group): (u64, usize)) -> Result<(), Unfit> {
        expect(group < self.blocks, "groups of points")?;
        (self.drawn, self.group) = (drawn, group);
        Ok(())
    }

    /// From now on scalar contributions are weighed by this importance.
    pub fn set_importance(&mut self, importance: &Arc<Importance>) {
        self.evaluator.importance = Some(importance.clone());
    }

    /// Rays traced and contributions settled since this was last asked for.
    pub fn take_rays_and_faults(&mut self) -> (u64, Faults) {
        let out = &mut self.evaluator.out;
        (std::mem::take(&mut out.rays), std::mem::take(&mut out.faults))
    }
}

/// The counter of a lane that has none yet.
const NOBODY: Counter = Counter { ladder: 0, replica: 0, step: 0, purpose: Purpose::Stratified };
