//! Stratified points: the same number in every pixel of a film.

use super::Block;
use crate::rng::{Counter, Purpose};

/// The order in which pixels get their points: every pixel once a pass, short runs of neighbours (whose rays are
/// coherent) scattered over the film, so that an unfinished pass covers it evenly.
#[derive(Clone, Copy, Debug)]
pub struct PixelOrder {
    pixels: u64,
    runs: u64,
    /// Runs from one to the next in order; has no divisor in common with their number.
    stride: u64,
}

/// Neighbouring pixels in a run; a packet of rays.
const RUN: u64 = 16;

impl PixelOrder {
    /// The order on a film of that width and height.
    ///
    /// # Panics
    /// If there are more than 2³² pixels, or none.
    pub fn new([width, height]: [u32; 2]) -> PixelOrder {
        let pixels = u64::from(width) * u64::from(height);
        assert!((1..=1 << 32).contains(&pixels), "{width} × {height} pixels cannot be ordered");
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

    /// The stratified points from the `first`-th on, each as the counter that a lane moving by
    /// [`Move::Stratified`](super::Move::Stratified) needs.
    pub fn points_from(&self, first: u64) -> StratifiedPoints {
        let place = first % self.pixels;
        StratifiedPoints { order: *self, number: first / self.pixels, place, run_start: self.run_start(place / RUN) }
    }

    /// First pixel of the k-th run of a pass. The last run, which may be short, comes last.
    fn run_start(&self, k: u64) -> u64 {
        ((k + 1) * self.stride - 1) % self.runs * RUN
    }
}

/// Stratified points in the order of their pixels, without end.
#[derive(Clone, Debug)]
pub struct StratifiedPoints {
    order: PixelOrder,
    /// Of the pass, and of the next point in its pixel.
    number: u64,
    /// Of the next pixel in the pass.
    place: u64,
    /// First pixel of the run that the next pixel is in.
    run_start: u64,
}

impl Iterator for StratifiedPoints {
    type Item = Counter;

    #[inline(always)]
    fn next(&mut self) -> Option<Counter> {
        let pixel = self.run_start + self.place % RUN;
        let counter = Counter { ladder: pixel as u32, replica: 0, step: self.number, purpose: Purpose::Stratified };
        self.place += 1;
        if self.place == self.order.pixels {
            (self.place, self.number) = (0, self.number + 1);
        }
        if self.place.is_multiple_of(RUN) {
            self.run_start = self.order.run_start(self.place / RUN);
        }
        Some(counter)
    }
}

/// The first block of a point whose film position lies within a pixel, uniform if `words` are.
#[inline(always)]
pub(super) fn within_pixel(pixel: u32, [width, height]: [u32; 2], words: Block) -> Block {
    let coordinate =
        |index: u32, extent: u32, word: u32| (((u64::from(index) << 32) | u64::from(word)) / u64::from(extent)) as u32;
    [coordinate(pixel % width, width, words[0]), coordinate(pixel / width, height, words[1]), words[2], words[3]]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pass_visits_every_pixel_once() {
        for size in [[1, 1], [7, 1], [4, 4], [17, 1], [10, 10], [256, 256], [1920, 1080]] {
            let pixels = (size[0] * size[1]) as usize;
            let mut points = PixelOrder::new(size).points_from(0);
            for pass in 0..3 {
                let mut seen = vec![false; pixels];
                for point in points.by_ref().take(pixels) {
                    assert_eq!(point.step, pass, "{size:?}");
                    assert!(!std::mem::replace(&mut seen[point.ladder as usize], true), "{size:?}: {point:?} again");
                }
            }
        }
    }

    #[test]
    fn an_unfinished_pass_is_even() {
        let mut quarters = [0; 4];
        let first_tenth = PixelOrder::new([256, 256]).points_from(0).take(65536 / 10);
        first_tenth.for_each(|point| quarters[point.ladder as usize / 16384] += 1);
        assert!(quarters.iter().all(|q| (1500..1800).contains(q)), "{quarters:?}");
    }

    #[test]
    fn points_are_the_same_wherever_one_starts_to_count() {
        for size in [[1, 1], [13, 3], [16, 9]] {
            let order = PixelOrder::new(size);
            let all: Vec<Counter> = order.points_from(0).take(1000).collect();
            for first in 0..500 {
                let there = order.points_from(first as u64).take(500);
                assert!(there.eq(all[first..first + 500].iter().copied()), "{size:?} from {first}");
            }
        }
    }

    #[test]
    fn film_positions_lie_within_their_pixel() {
        let size = [640, 3];
        for pixel in [0, 1, 639, 640, 1919] {
            for word in [0, 1 << 31, u32::MAX] {
                let [x, y, ..] = within_pixel(pixel, size, [word; 4]);
                let position = |v: u32, extent: u32| ((u64::from(v) * u64::from(extent)) >> 32) as u32;
                // rounding down may leave the very first of 2³² positions in the pixel before
                let close = |a: u32, b: u32| a == b || (word == 0 && a + 1 == b);
                assert!(close(position(x, size[0]), pixel % 640) && close(position(y, size[1]), pixel / 640));
            }
        }
    }

    #[test]
    fn a_film_of_one_pixel_is_the_whole_square() {
        let words = [0x1234_5678, u32::MAX, 3, 4];
        assert_eq!(within_pixel(0, [1, 1], words), words);
    }
}
