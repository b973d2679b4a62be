//! Proposed points, drawn block by block as paths reach them.

use super::{Block, Points, StepLaw};
use crate::rng::{Counter, Rng, SIDE_BY_SIDE};

/// How a lane's proposal comes about.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Move {
    /// A uniform point of the cube.
    Fresh,
    /// A uniform point, but its first block is already set (stratified film positions).
    FreshAfterFirst,
    /// A small step of this law from the lane's current point.
    Small(StepLaw),
    /// The lane rests; nothing is drawn or evaluated.
    Rest,
}

/// The proposals of one step of a batch.
///
/// A target asks for block after block with [`draw`](Self::draw), for the lanes that still need it, and reads the
/// words with [`block`](Self::block). Blocks must be drawn in rising order.
pub struct Proposals<'a> {
    /// The source of random words.
    pub rng: Rng,
    /// Where small steps start; at least as many lanes as `moves`.
    pub current: &'a Points,
    /// The proposed points.
    pub points: &'a mut Points,
    /// Which words each lane draws.
    pub counters: &'a [Counter],
    /// How each lane moves.
    pub moves: &'a [Move],
}

impl Proposals<'_> {
    /// Number of lanes.
    pub fn lanes(&self) -> usize {
        self.moves.len()
    }

    /// Starts new proposals in all lanes and lists those that do not rest.
    pub fn begin(&mut self, live: &mut Vec<u32>) {
        live.clear();
        for (lane, m) in self.moves.iter().enumerate() {
            if *m == Move::Rest {
                continue;
            }
            if *m != Move::FreshAfterFirst {
                self.points.clear(lane);
            }
            live.push(lane as u32);
        }
    }

    /// Draws block `block` for each of `lanes`.
    #[inline]
    pub fn draw(&mut self, block: u16, lanes: &[u32]) {
        self.points.reserve(block);
        let (together, rest) = lanes.as_chunks::<SIDE_BY_SIDE>();
        for lanes in together {
            let words = self.rng.words_side_by_side(lanes.map(|lane| self.counters[lane as usize]), block);
            for (j, &lane) in lanes.iter().enumerate() {
                self.set(block, lane as usize, words.map(|w| w[j]));
            }
        }
        for &lane in rest {
            self.set(block, lane as usize, self.rng.words(self.counters[lane as usize], block));
        }
    }

    /// Makes the lane's block from four random words.
    #[inline(always)]
    fn set(&mut self, block: u16, lane: usize, words: [u32; 4]) {
        let proposed = match self.moves[lane] {
            Move::Small(law) if block < self.current.used(lane) => law.step(self.current.block(block, lane), words),
            Move::FreshAfterFirst if block == 0 => return,
            _ => words,
        };
        self.points.set(block, lane, proposed);
    }

    /// Block `block` of a lane, drawn before.
    #[inline(always)]
    pub fn block(&self, block: u16, lane: usize) -> Block {
        self.points.block(block, lane)
    }
}
