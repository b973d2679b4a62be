//! Points of many lanes, as a structure of arrays.

use super::Block;

/// Added to the numbers of blocks of a point's second stream.
pub const LIGHT_STREAM: u16 = 1 << 15;

/// One point of the unit cube for each of a fixed number of lanes.
///
/// A point has two streams of blocks, one for the camera's subpath and one, from number [`LIGHT_STREAM`] on, for the
/// light's, so that either may be longer than before without the other. Blocks of the same number lie together over all
/// lanes. Rows are added when a lane first reaches that far and then stay, so a batch that is warm allocates nothing.
#[derive(Clone, Debug)]
pub struct Points {
    lanes: usize,
    streams: [Stream; 2],
}

#[derive(Clone, Debug)]
struct Stream {
    /// `blocks[b * lanes + lane]`.
    blocks: Vec<Block>,
    /// How many leading blocks of each lane exist.
    used: Vec<u16>,
}

/// Stream of a block, and its number there.
#[inline(always)]
fn place(block: u16) -> (usize, u16) {
    (usize::from(block >= LIGHT_STREAM), block & (LIGHT_STREAM - 1))
}

impl Points {
    /// Points of `lanes` lanes, none with any block yet.
    pub fn new(lanes: usize) -> Points {
        Points { lanes, streams: [(); 2].map(|()| Stream { blocks: Vec::new(), used: vec![0; lanes] }) }
    }

    /// Number of lanes.
    pub fn lanes(&self) -> usize {
        self.lanes
    }

    /// How many leading blocks of each stream lane `lane` has.
    pub fn used(&self, lane: usize) -> [u16; 2] {
        [0, 1].map(|stream: usize| self.streams[stream].used[lane])
    }

    /// Whether lane `lane` has block `block`.
    #[inline(always)]
    pub fn has(&self, block: u16, lane: usize) -> bool {
        let (stream, number) = place(block);
        number < self.streams[stream].used[lane]
    }

    /// Block `block` of a lane; it must exist.
    #[inline(always)]
    pub fn block(&self, block: u16, lane: usize) -> Block {
        debug_assert!(self.has(block, lane));
        let (stream, number) = place(block);
        self.streams[stream].blocks[usize::from(number) * self.lanes + lane]
    }

    /// Makes room for block `block` of every lane.
    #[inline]
    pub fn reserve(&mut self, block: u16) {
        let (stream, number) = place(block);
        let rows = (usize::from(number) + 1) * self.lanes;
        let blocks = &mut self.streams[stream].blocks;
        if blocks.len() < rows {
            blocks.resize(rows, [0; 4]);
        }
    }

    /// Sets block `block` of a lane, which becomes the last of its stream; room must have been made.
    #[inline(always)]
    pub fn set(&mut self, block: u16, lane: usize, words: Block) {
        let (stream, number) = place(block);
        let stream = &mut self.streams[stream];
        stream.blocks[usize::from(number) * self.lanes + lane] = words;
        stream.used[lane] = number + 1;
    }

    /// Forgets all blocks of a lane.
    #[inline(always)]
    pub fn clear(&mut self, lane: usize) {
        self.streams.iter_mut().for_each(|stream| stream.used[lane] = 0);
    }

    /// Copies lane `from` of `other` into lane `to`.
    #[inline]
    pub fn copy(&mut self, to: usize, other: &Points, from: usize) {
        for (stream, theirs) in self.streams.iter_mut().zip(&other.streams) {
            let used = usize::from(theirs.used[from]);
            if stream.blocks.len() < used * self.lanes {
                stream.blocks.resize(used * self.lanes, [0; 4]);
            }
            for b in 0..used {
                stream.blocks[b * self.lanes + to] = theirs.blocks[b * other.lanes + from];
            }
            stream.used[to] = used as u16;
        }
    }
}
