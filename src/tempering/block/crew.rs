//! Blocks in one batch.

use arrayvec::ArrayVec;

use super::{
    super::{Canvas, Round, steps},
    Batch, Block, Seated, Work,
};
use crate::chain::{Target, Walkers};

/// Blocks in a crew, at most.
pub const MOST_BLOCKS: usize = 64;

/// Blocks that go through sweeps together, their lanes in one batch: what comes out is what each would have come to
/// by itself, but packets of rays are fuller.
///
/// Chains sit in the crew's batch as long as there is one, and go back to their blocks when it ends.
pub struct Crew<'b, W: Default + Send> {
    blocks: Vec<&'b mut Block<W>>,
    batches: Vec<Batch<W>>,
}

impl<'b, W: Default + Send> Crew<'b, W> {
    /// One block or several, at most `MOST_BLOCKS`, if all [can join](Block::can_join).
    pub fn new(blocks: Vec<&'b mut Block<W>>) -> Crew<'b, W> {
        let mut crew = Crew { blocks, batches: Vec::new() };
        crew.batches = match &mut crew.blocks[..] {
            [block] => std::mem::take(&mut block.batches),
            blocks => vec![join(blocks)],
        };
        crew
    }

    /// Goes through `sweeps` sweeps.
    pub fn advance<T: Target<Workspace = W>>(&mut self, target: &T, sweeps: u64, canvas: &Canvas, round: &Round) {
        let work = Work { target, canvas, round, bank: &steps::bank() };
        let Crew { blocks, batches } = self;
        for _ in 0..sweeps {
            match &mut blocks[..] {
                [block] => block.explore(batches, &work),
                blocks => {
                    let mut seated: ArrayVec<Seated, MOST_BLOCKS> =
                        blocks.iter_mut().map(|block| block.seated()).collect();
                    batches[0].explore(&mut seated, &work);
                }
            }
            blocks.iter_mut().for_each(|block| block.exchange(batches, canvas, round));
        }
    }
}

impl<W: Default + Send> Drop for Crew<'_, W> {
    fn drop(&mut self) {
        let Crew { blocks, batches } = self;
        if let [block] = &mut blocks[..] {
            block.batches = std::mem::take(batches);
            return;
        }
        let [Batch { walkers, evaluator, .. }] = &mut batches[..] else { return };
        for block in blocks.iter_mut() {
            let part = &mut block.parts[0];
            let [first, _] = std::mem::replace(&mut part.seat, [0, part.replicas]);
            block.batches[0].walkers = walkers.some(first..first + part.replicas);
        }
        let out = &mut blocks[0].batches[0].evaluator.out;
        out.rays += evaluator.out.rays;
        out.faults.merge(&evaluator.out.faults);
    }
}

/// Seats the lanes of blocks in one batch: all their replicas first, as chains are found by the numbers of their lanes.
fn join<W: Default + Send>(blocks: &mut [&mut Block<W>]) -> Batch<W> {
    debug_assert!(blocks.iter().all(|block| block.can_join()));
    let mut next = [0, blocks.iter().map(|block| block.parts[0].replicas).sum()];
    let mut counters = [Vec::new(), Vec::new()];
    for block in blocks.iter_mut() {
        let part = &mut block.parts[0];
        part.seat = next;
        let of_part = &block.batches[0].evaluator.counters;
        for (i, own) in [&of_part[..part.replicas], &of_part[part.replicas..]].into_iter().enumerate() {
            counters[i].extend_from_slice(own);
            next[i] += own.len();
        }
    }
    let walkers = Walkers::joined(blocks.iter().map(|block| &block.batches[0].walkers));
    Batch { walkers, ..blocks[0].batch(counters.concat()) }
}
