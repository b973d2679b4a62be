//! `path`: independent samples and nothing else, the same number in every pixel.

use rayon::prelude::*;

use super::{
    engine::{Counts, Development, Engine, Stage, film_warnings},
    plan::Plan,
};
use crate::{
    chain::Evaluator,
    film::{Accumulator, Plane, Splats},
    path::unidirectional::Workspace,
    rng::{Counter, Purpose},
    sample::{Move, Points, StepLaw},
    tempering::Estimate,
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
    /// Not used by fresh points; the interface of proposals wants one.
    nowhere: Points,
    splats: Splats,
    sweeps: u64,
    sum_g: f64,
}

impl PathTracer {
    /// Ready to start.
    pub fn new(stage: &Stage, mutations: Option<u64>) -> PathTracer {
        let plan = Plan::new(mutations, 1);
        let block = |number: usize| {
            let counter = |lane: usize| Counter {
                ladder: (number * plan.lanes() + lane) as u32,
                replica: 0,
                step: 0,
                purpose: Purpose::Primary,
            };
            let mut evaluator = Evaluator::new(stage.rng, StepLaw::KELEMEN, (0..plan.lanes()).map(counter).collect());
            evaluator.moves.fill(Move::FreshAfterFirst);
            evaluator.points.reserve(0);
            Block { number, evaluator, nowhere: Points::new(0), splats: Splats::new(1), sweeps: 0, sum_g: 0.0 }
        };
        PathTracer {
            plan,
            order: PixelOrder::new(stage.pixels()),
            film: stage.accumulator(1),
            blocks: (0..plan.blocks).map(block).collect(),
        }
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
            normalisation: Some(Estimate::from_sums(&groups)),
            warnings: film_warnings(&self.film),
        }
    }
}

impl Block {
    fn sweep(&mut self, stage: &Stage, plan: &Plan, order: &PixelOrder) {
        let first = (self.sweeps * plan.blocks as u64 + self.number as u64) * plan.lanes() as u64;
        for lane in 0..plan.lanes() {
            self.evaluator.counters[lane].step = self.sweeps;
            let words = stage.rng.words(self.evaluator.counters[lane], 0);
            let pixel = order.pixel(first + lane as u64);
            self.evaluator.points.set(0, lane, within_pixel(pixel, stage.size(), words));
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

/// The order in which pixels get their samples: every pixel as often as any other, short runs of neighbours (whose rays
/// are coherent) scattered over the film, so that an unfinished pass covers it evenly.
struct PixelOrder {
    pixels: u64,
    runs: u64,
    /// Runs from one to the next in order; has no divisor in common with their number.
    stride: u64,
}

/// Neighbouring pixels in a run; a packet of rays.
const RUN: u64 = 16;

impl PixelOrder {
    fn new(pixels: u64) -> PixelOrder {
        let runs = pixels.div_ceil(RUN);
        // the golden section spreads any number of first runs evenly
        let golden = ((runs as f64 * 0.618_033_988_75) as u64).max(1);
        let common = |mut a: u64, mut b: u64| {
            while b > 0 {
                (a, b) = (b, a % b);
            }
            a
        };
        let stride = (golden..).find(|s| common(*s, runs) == 1).expect("one number in `runs` is coprime to it");
        PixelOrder { pixels, runs, stride }
    }

    /// The pixel of the n-th sample. Where runs do not fill the film evenly, a few pixels come twice in a pass.
    fn pixel(&self, n: u64) -> u64 {
        let run = u128::from(n / RUN) * u128::from(self.stride) % u128::from(self.runs);
        (run as u64 * RUN + n % RUN) % self.pixels
    }
}

/// The first block of a point whose film position lies within a pixel, uniform if `words` are.
fn within_pixel(pixel: u64, [width, height]: [u32; 2], words: [u32; 4]) -> [u32; 4] {
    let coordinate =
        |index: u64, extent: u32, word: u32| (((index << 32) | u64::from(word)) / u64::from(extent)) as u32;
    [
        coordinate(pixel % u64::from(width), width, words[0]),
        coordinate(pixel / u64::from(width), height, words[1]),
        words[2],
        words[3],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pixel_gets_its_samples_and_an_unfinished_pass_is_even() {
        for pixels in [1, 7, 16, 100, 65536, 1920 * 1080] {
            let order = PixelOrder::new(pixels);
            let mut counts = vec![0; pixels as usize];
            let pass = order.runs * RUN;
            (0..pass).for_each(|n| counts[order.pixel(n) as usize] += 1);
            let often = 1 + pass / pixels;
            assert!(counts.iter().all(|c| (1..=often).contains(c)), "{pixels}");
        }
        let order = PixelOrder::new(65536);
        let mut quarters = [0; 4];
        (0..65536 / 10).for_each(|n| quarters[(order.pixel(n) / 16384) as usize] += 1);
        assert!(quarters.iter().all(|q| (1500..1800).contains(q)), "{quarters:?}");
    }

    #[test]
    fn film_positions_lie_within_their_pixel() {
        let size = [640, 3];
        for pixel in [0, 1, 639, 640, 1919] {
            for word in [0, 1 << 31, u32::MAX] {
                let [x, y, ..] = within_pixel(pixel, size, [word; 4]);
                let position = |v: u32, extent: u32| (u64::from(v) * u64::from(extent)) >> 32;
                // rounding down may leave the very first of 2³² positions in the pixel before
                let close = |a: u64, b: u64| a == b || (word == 0 && a + 1 == b);
                assert!(close(position(x, size[0]), pixel % 640) && close(position(y, size[1]), pixel / 640));
            }
        }
    }
}
