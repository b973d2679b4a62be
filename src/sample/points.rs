//! Points of many lanes, as a structure of arrays.

use serde::{Deserialize, Serialize};

use super::Block;

/// Added to the numbers of blocks of a point's second stream.
pub const LIGHT_STREAM: u16 = 1 << 15;

/// One point of the unit cube for each of a fixed number of lanes.
///
/// A point has two streams of blocks, one for the camera's subpath and one, from number [`LIGHT_STREAM`] on, for the
/// light's, so that either may be longer than before without the other. Blocks of the same number lie together over all
/// lanes. Rows are added when a lane first reaches that far and then stay, so a batch that is warm allocates nothing.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(into = "SavedPoints", try_from = "SavedPoints")]
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

/// Points as they are saved: the blocks that exist, lane by lane, of either stream.
#[derive(Serialize, Deserialize)]
struct SavedPoints(Vec<[Vec<Block>; 2]>);

impl From<Points> for SavedPoints {
    fn from(points: Points) -> SavedPoints {
        let of_lane = |lane: usize, stream: &Stream| {
            (0..usize::from(stream.used[lane])).map(|b| stream.blocks[b * points.lanes + lane]).collect()
        };
        SavedPoints((0..points.lanes).map(|lane| points.streams.each_ref().map(|s| of_lane(lane, s))).collect())
    }
}

impl TryFrom<SavedPoints> for Points {
    type Error = &'static str;

    fn try_from(SavedPoints(saved): SavedPoints) -> Result<Points, &'static str> {
        let mut points = Points::new(saved.len());
        for (lane, streams) in saved.iter().enumerate() {
            for (blocks, start) in streams.iter().zip([0, LIGHT_STREAM]) {
                if blocks.len() > usize::from(LIGHT_STREAM) {
                    return Err("a point has too many dimensions");
                }
                for (number, block) in (start..).zip(blocks) {
                    points.reserve(number);
                    points.set(number, lane, *block);
                }
            }
        }
        Ok(points)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn saved_points_are_those_that_were() {
        let mut points = Points::new(3);
        for (block, lane) in [(0, 0), (1, 0), (0, 2), (LIGHT_STREAM, 1), (LIGHT_STREAM + 1, 1)] {
            points.reserve(block);
            points.set(block, lane, [u32::from(block), lane as u32, u32::MAX, 7]);
        }
        points.clear(2); // what a lane forgot is not saved
        let bytes = postcard::to_stdvec(&points).unwrap();
        let back: Points = postcard::from_bytes(&bytes).unwrap();
        assert_eq!(back.lanes(), 3);
        for lane in 0..3 {
            assert_eq!(back.used(lane), points.used(lane), "lane {lane}");
            for block in [0, 1, LIGHT_STREAM, LIGHT_STREAM + 1] {
                if points.has(block, lane) {
                    assert_eq!(back.block(block, lane), points.block(block, lane));
                }
            }
        }
    }
}
