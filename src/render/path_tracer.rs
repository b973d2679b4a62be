//! `path`: stratified points and nothing else, the same number in every pixel.

use rayon::prelude::*;

use super::{
    engine::{Counts, Development, Engine, Stage, film_warnings},
    plan::Plan,
};
use crate::{
    chain::Evaluator,
    film::{Accumulator, Plane, Splats},
    path::unidirectional::Workspace,
    sample::{Move, PixelOrder, Points, StepLaw},
    tempering::uniform_mean,
};

/// The method at work.
pub struct PathTracer {
    plan: Plan,
    order: PixelOrder,
    film: Accumulator,
    blocks: Vec<Block>,
}

struct Block {
    number: usize,
    evaluator: Evaluator<Workspace>,
    /// Not used by stratified points; the interface of proposals wants one.
    nowhere: Points,
    splats: Splats,
    sweeps: u64,
    sum_g: f64,
}

impl PathTracer {
    /// Ready to start.
    pub fn new(stage: &Stage, mutations: Option<u64>) -> PathTracer {
        let plan = Plan::new(mutations, 1);
        let order = PixelOrder::new(stage.size());
        let block = |number: usize| {
            let counters = order.points_from(0).take(plan.lanes()).collect();
            let mut evaluator = Evaluator::new(stage.rng, StepLaw::KELEMEN, counters);
            evaluator.moves.fill(Move::Stratified);
            evaluator.film = stage.size();
            Block { number, evaluator, nowhere: Points::new(0), splats: Splats::new(1), sweeps: 0, sum_g: 0.0 }
        };
        PathTracer { plan, order, film: stage.accumulator(1), blocks: (0..plan.blocks).map(block).collect() }
    }
}

impl Engine for PathTracer {
    fn sweeps_wanted(&self) -> Option<u64> {
        self.plan.sweeps
    }

    fn mutations_wanted(&self) -> Option<u64> {
        self.plan.sweeps.map(|s| s * self.plan.a_sweep())
    }

    fn advance(&mut self, stage: &Stage, sweeps: u64) {
        let (plan, order, film) = (self.plan, &self.order, &self.film);
        self.blocks.par_iter_mut().for_each(|block| {
            for _ in 0..sweeps {
                block.sweep(stage, &plan, order);
            }
            film.deposit(&mut block.splats);
        });
    }

    fn counts(&self) -> Counts {
        let mut counts = Counts::default();
        for block in &self.blocks {
            counts.mutations += block.sweeps * self.plan.lanes() as u64;
            counts.rays += block.evaluator.out.rays;
            counts.non_finite += block.evaluator.out.non_finite;
        }
        counts
    }

    /// Every pixel is the weighted mean of the samples that reached it.
    fn develop(&self, stage: &Stage) -> Development {
        let sums = self.film.layer(0);
        let image = stage.image(|i| {
            let [r, g, b, weight] = sums[i];
            if weight > 0.0 { [r / weight, g / weight, b / weight] } else { [0.0; 3] }
        });
        let groups: Vec<(f64, f64)> =
            self.blocks.iter().map(|b| (b.sum_g, (b.sweeps * self.plan.lanes() as u64) as f64)).collect();
        let density = Plane::Gray(sums.iter().map(|s| s[3] as f32).collect());
        Development {
            image,
            layers: vec![("density".into(), density)],
            normalisation: Some(uniform_mean(&groups)),
            warnings: film_warnings(&self.film),
        }
    }
}

impl Block {
    fn sweep(&mut self, stage: &Stage, plan: &Plan, order: &PixelOrder) {
        let first = (self.sweeps * plan.blocks as u64 + self.number as u64) * plan.lanes() as u64;
        for (counter, next) in self.evaluator.counters.iter_mut().zip(order.points_from(first)) {
            *counter = next;
        }
        self.evaluator.evaluate(&stage.mapping, &self.nowhere);
        let mut recorder = stage.recorder(&mut self.splats);
        for contribution in &self.evaluator.out.lanes {
            self.sum_g += contribution.g();
            recorder.splat(0, contribution, 1.0, 1.0);
        }
        self.sweeps += 1;
    }
}
