//! Proposed points, drawn block by block as paths reach them.

use pulp::NullaryFnOnce;

use super::{
    Block, LIGHT_STREAM, Points, StepLaw,
    sobol::{self, LOW_DISCREPANCY_BLOCKS},
    strata::within_pixel,
};
use crate::{
    math::widest,
    rng::{Counter, Rng, SIDE_BY_SIDE},
};

/// How a lane's proposal comes about.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Move {
    /// A uniform point of the cube.
    Fresh,
    /// The point of a pixel that the lane's counter names: `ladder` the pixel, `step` the number of the point in it.
    /// Its film position lies in the pixel and its first blocks are low-discrepancy over the points of the pixel.
    Stratified,
    /// A small step of this law from the lane's current point.
    Small(StepLaw),
    /// The given blocks, and uniform ones where none are given.
    Given,
    /// The lane rests; nothing is drawn or evaluated.
    Rest,
}

/// The proposals of one step of a batch.
///
/// A target asks for block after block with [`draw`](Self::draw), for the lanes that still need it, and reads the
/// words with [`block`](Self::block). Blocks of a
/// stream must be drawn in rising order.
pub struct Proposals<'a> {
    /// The source of random words.
    pub rng: Rng,
    /// Where small steps start; at least as many lanes as `moves`.
    pub current: &'a Points,
    /// The blocks of lanes that move by [`Move::Given`]; at least as many lanes as `moves` if there are any such.
    pub given: &'a Points,
    /// The proposed points.
    pub points: &'a mut Points,
    /// Which words each lane draws.
    pub counters: &'a [Counter],
    /// How each lane moves.
    pub moves: &'a [Move],
    /// Width and height in pixels of the film that stratified points are for; beyond 1 × 1 pixels, the first two
    /// dimensions are their film position.
    pub film: [u32; 2],
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
            if *m != Move::Rest {
                self.points.clear(lane);
                live.push(lane as u32);
            }
        }
    }

    /// Draws block `block` for each of `lanes`.
    pub fn draw(&mut self, block: u16, lanes: &[u32]) {
        widest(Draw { proposals: self, block, lanes });
    }

    #[inline(always)]
    fn draw_all(&mut self, block: u16, lanes: &[u32]) {
        self.points.reserve(block);
        let (together, rest) = lanes.as_chunks::<SIDE_BY_SIDE>();
        for lanes in together {
            let mut counters = [self.counters[lanes[0] as usize]; SIDE_BY_SIDE];
            for (counter, lane) in counters.iter_mut().zip(lanes) {
                *counter = self.counters[*lane as usize];
            }
            let words = match lanes.iter().filter(|lane| self.low_discrepancy(block, **lane)).count() {
                0 => self.rng.words_side_by_side(counters, block),
                SIDE_BY_SIDE => {
                    let (sequences, number) = self.sequences(counters, block);
                    sobol::words_side_by_side(self.rng, sequences, number)
                }
                _ => {
                    lanes.iter().for_each(|lane| self.draw_one(block, *lane));
                    continue;
                }
            };
            for (j, &lane) in lanes.iter().enumerate() {
                self.set(block, lane as usize, [words[0][j], words[1][j], words[2][j], words[3][j]]);
            }
        }
        for &lane in rest {
            self.draw_one(block, lane);
        }
    }

    /// Draws a block for one lane.
    #[inline(always)]
    fn draw_one(&mut self, block: u16, lane: u32) {
        let counter = self.counters[lane as usize];
        let words = if self.low_discrepancy(block, lane) {
            let ([sequence], number) = self.sequences([counter], block);
            sobol::words(self.rng, sequence, number)
        } else {
            self.rng.words(counter, block)
        };
        self.set(block, lane as usize, words);
    }

    /// Whether a block of a lane comes from the low-discrepancy sequence.
    #[inline(always)]
    fn low_discrepancy(&self, block: u16, lane: u32) -> bool {
        block & (LIGHT_STREAM - 1) < LOW_DISCREPANCY_BLOCKS && self.moves[lane as usize] == Move::Stratified
    }

    /// The sequences that a block of stratified points is drawn from, with the points' numbers there, and the block's number
    /// among all low-discrepancy ones. Each pixel has a sequence of its own for the camera's subpath; light subpaths have
    /// nothing to do with pixels and follow one over the whole film.
    #[inline(always)]
    fn sequences<const N: usize>(&self, counters: [Counter; N], block: u16) -> ([Counter; N], u16) {
        if block < LIGHT_STREAM {
            return (counters, block);
        }
        let pixels = u64::from(self.film[0]) * u64::from(self.film[1]);
        let of_film = |c: Counter| Counter { ladder: 0, step: c.step * pixels + u64::from(c.ladder), ..c };
        (counters.map(of_film), block - LIGHT_STREAM + LOW_DISCREPANCY_BLOCKS)
    }

    /// Makes the lane's block from four words that are uniform.
    #[inline(always)]
    fn set(&mut self, block: u16, lane: usize, words: Block) {
        let proposed = match self.moves[lane] {
            Move::Small(law) if self.current.has(block, lane) => law.step(self.current.block(block, lane), words),
            Move::Given if self.given.has(block, lane) => self.given.block(block, lane),
            Move::Stratified if block == 0 => within_pixel(self.counters[lane].ladder, self.film, words),
            _ => words,
        };
        self.points.set(block, lane, proposed);
    }

    /// A first block in the place of a lane's own: of another point in the same pixel where the lane's is
    /// [stratified](Move::Stratified), of any point otherwise; uniform there if `words` are.
    #[inline(always)]
    pub fn beside(&self, lane: usize, words: Block) -> Block {
        match self.moves[lane] {
            Move::Stratified => within_pixel(self.counters[lane].ladder, self.film, words),
            _ => words,
        }
    }

    /// Block `block` of a lane, drawn before.
    #[inline(always)]
    pub fn block(&self, block: u16, lane: usize) -> Block {
        self.points.block(block, lane)
    }
}

/// The work of [`Proposals::draw`].
struct Draw<'d, 'p> {
    proposals: &'d mut Proposals<'p>,
    block: u16,
    lanes: &'d [u32],
}

impl NullaryFnOnce for Draw<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        self.proposals.draw_all(self.block, self.lanes);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample::PixelOrder;

    const FILM: [u32; 2] = [5, 7];

    /// Draws six blocks of the lanes that `moves` names; all lanes have counters of stratified points.
    fn draw(moves: &[Move]) -> Points {
        let counters: Vec<Counter> = PixelOrder::new(FILM).points_from(1000).take(moves.len()).collect();
        let (current, mut points, mut live) = (Points::new(moves.len()), Points::new(moves.len()), Vec::new());
        let mut proposals = Proposals {
            rng: Rng::new(1),
            current: &current,
            given: &current,
            points: &mut points,
            counters: &counters,
            moves,
            film: FILM,
        };
        proposals.begin(&mut live);
        (0..6).for_each(|block| proposals.draw(block, &live));
        points
    }

    #[test]
    fn a_stratified_point_is_the_same_in_any_company() {
        let expected = draw(&[Move::Stratified; 40]);
        for other in [Move::Rest, Move::Fresh] {
            for every in 2..20 {
                let moves: Vec<Move> = (0..40).map(|l| if l % every == 0 { other } else { Move::Stratified }).collect();
                let points = draw(&moves);
                for lane in (0..40).filter(|lane| moves[*lane] == Move::Stratified) {
                    for block in 0..6 {
                        assert_eq!(points.block(block, lane), expected.block(block, lane), "{lane}, {block}");
                    }
                }
            }
        }
    }

    #[test]
    fn stratified_points_lie_in_their_pixels_and_end_in_plain_words() {
        let points = draw(&[Move::Stratified; 40]);
        for (lane, counter) in PixelOrder::new(FILM).points_from(1000).take(40).enumerate() {
            let [x, y, ..] = points.block(0, lane);
            let [x, y] = [(x, FILM[0]), (y, FILM[1])].map(|(word, n)| ((u64::from(word) * u64::from(n)) >> 32) as u32);
            assert_eq!(y * FILM[0] + x, counter.ladder);
            for block in LOW_DISCREPANCY_BLOCKS..6 {
                assert_eq!(points.block(block, lane), Rng::new(1).words(counter, block));
            }
        }
    }
}
