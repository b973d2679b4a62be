//! Points of many lanes, as a structure of arrays.

use super::Block;

/// One point of the unit cube for each of a fixed number of lanes.
///
/// Blocks of the same number lie together over all lanes. Rows are added when a lane first reaches that far and
/// then stay, so a batch that is warm allocates nothing.
#[derive(Clone, Debug)]
pub struct Points {
    lanes: usize,
    /// `blocks[b * lanes + lane]`.
    blocks: Vec<Block>,
    /// How many leading blocks of each lane exist.
    used: Vec<u16>,
}

impl Points {
    /// Points of `lanes` lanes, none with any block yet.
    pub fn new(lanes: usize) -> Points {
        Points { lanes, blocks: Vec::new(), used: vec![0; lanes] }
    }

    /// Number of lanes.
    pub fn lanes(&self) -> usize {
        self.lanes
    }

    /// Number of blocks that lane `lane` has.
    #[inline(always)]
    pub fn used(&self, lane: usize) -> u16 {
        self.used[lane]
    }

    /// Block `block` of a lane; it must exist.
    #[inline(always)]
    pub fn block(&self, block: u16, lane: usize) -> Block {
        debug_assert!(block < self.used[lane]);
        self.blocks[usize::from(block) * self.lanes + lane]
    }

    /// Makes room for block `block` of every lane.
    #[inline]
    pub fn reserve(&mut self, block: u16) {
        let rows = (usize::from(block) + 1) * self.lanes;
        if self.blocks.len() < rows {
            self.blocks.resize(rows, [0; 4]);
        }
    }

    /// Sets block `block` of a lane, which becomes its last; room must have been made.
    #[inline(always)]
    pub fn set(&mut self, block: u16, lane: usize, words: Block) {
        self.blocks[usize::from(block) * self.lanes + lane] = words;
        self.used[lane] = block + 1;
    }

    /// Forgets all blocks of a lane.
    #[inline(always)]
    pub fn clear(&mut self, lane: usize) {
        self.used[lane] = 0;
    }

    /// Copies lane `from` of `other` into lane `to`.
    #[inline]
    pub fn copy(&mut self, to: usize, other: &Points, from: usize) {
        let used = other.used[from];
        if used > 0 {
            self.reserve(used - 1);
        }
        for b in 0..usize::from(used) {
            self.blocks[b * self.lanes + to] = other.blocks[b * other.lanes + from];
        }
        self.used[to] = used;
    }
}
