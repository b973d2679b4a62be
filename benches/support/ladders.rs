//! Blocks of ladders alone, without the sampler that feeds them.

use rayon::prelude::*;
use relt::{
    chain::{Evaluator, Start, Target, resample},
    film::{Accumulator, Footprint},
    rng::{Counter, Purpose, Rng},
    sample::{Move, Points},
    tempering::{Block, Canvas, Choices, Combine, Ladder, Layers, PointGroups, Round, StepMix, Weights},
};

/// Chains of a block, on ladders of any length.
pub const CHAINS: usize = 192;
/// Lanes that are evaluated together.
const LANES_A_PART: usize = 512;
/// Sweeps before anything is measured.
const FORGET: u64 = 16;
/// Centre of the sizes of steps, in scales.
const STEPS: f64 = 2.0;
/// Uniform points that chains start from.
const SAMPLES: u64 = 1 << 12;

/// Ladders of so many rungs in a block.
pub fn ladders_a_block(rungs: usize) -> usize {
    (CHAINS / (rungs - 1)).max(1)
}

/// What ladders record to.
pub struct Film {
    pub footprint: Footprint,
    pub size: [u32; 2],
    pub brightest: f64,
}

/// Blocks of ladders that have gone through some sweeps.
pub struct Ladders<W> {
    film: Film,
    sums: Accumulator,
    layers: Layers,
    groups: PointGroups,
    round: Round,
    blocks: Vec<Block<W>>,
}

impl<W: Default + Send> Ladders<W> {
    /// So many blocks, whose ladders are offered so many points a sweep.
    pub fn new<T: Target<Workspace = W>>(
        target: &T,
        film: Film,
        (ladder, ln_z): (Ladder, &[f64]),
        samples: &[Start],
        (blocks, offers): (usize, usize),
    ) -> Ladders<W> {
        let rungs = ladder.rungs();
        let choices = Choices { combine: Combine::Balance, ..Choices::default() };
        let layers = Layers::of(&choices, rungs, target.splats_elsewhere());
        let ladders = ladders_a_block(rungs);
        let starts: Vec<Vec<Start>> =
            ladder.betas()[1..].iter().map(|&beta| resample(samples, beta, ladders, Rng::new(0), 0)).collect();
        let starts: Vec<&[Start]> = starts.iter().map(Vec::as_slice).collect();
        let round = Round {
            weights: Weights::new(&ladder, ln_z, 1.0, 0.0),
            mixes: std::array::from_fn(|_| vec![StepMix::about(STEPS); rungs]),
            effort: [1.0; 2],
            only_offers: true,
            open: false,
            half: u64::MAX,
            ladder,
        };
        let size = film.size;
        let block =
            |number| Block::new(Rng::new(0), (number, ladders), rungs, offers, LANES_A_PART, layers.count, size);
        let mut all = Ladders {
            sums: Accumulator::new(film.size[0], film.size[1], layers.count, film.brightest),
            film,
            layers,
            groups: PointGroups::new(blocks),
            blocks: (0..blocks).map(block).collect(),
            round,
        };
        all.blocks.iter_mut().for_each(|block| block.start(target, &starts));
        all.work(|block, canvas, round| block.advance(target, FORGET, canvas, round));
        all
    }

    /// Evaluations of a sweep of all blocks.
    pub fn lanes(&self) -> usize {
        self.blocks.iter().map(Block::lanes).sum()
    }

    /// Does something with every block in parallel, and empties their splats.
    pub fn work(&mut self, work: impl Fn(&mut Block<W>, &Canvas, &Round) + Sync) {
        let Ladders { film, sums, layers, groups, round, blocks } = self;
        let Film { footprint, size, brightest } = film;
        let canvas =
            Canvas { footprint, size: *size, film: sums, unit: *brightest, layers: *layers, probes: None, groups };
        blocks.par_iter_mut().for_each(|block| {
            work(block, &canvas, round);
            block.deposit(&canvas);
        });
    }
}

/// Uniform points of a target.
pub fn samples<T: Target>(target: &T) -> Vec<Start> {
    const LANES: u64 = 256;
    let counter = |step| Counter { ladder: 0, replica: 0, step, purpose: Purpose::Bootstrap };
    let batch = |batch: u64| {
        let counters: Vec<Counter> = (batch * LANES..(batch + 1) * LANES).map(counter).collect();
        let mut evaluator = Evaluator::<T::Workspace>::new(Rng::new(0), counters);
        evaluator.moves.fill(Move::Fresh);
        evaluator.evaluate(target, &Points::new(0));
        let start =
            |(counter, state): (&Counter, &relt::path::Contribution)| Start { counter: *counter, ln_g: state.ln_g };
        evaluator.counters.iter().zip(&evaluator.out.lanes).map(start).collect::<Vec<_>>()
    };
    (0..SAMPLES / LANES).flat_map(batch).collect()
}
