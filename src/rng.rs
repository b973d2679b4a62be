//! Counter-based random numbers: every number is a pure function of who asks for what.
//!
//! Philox4x32-10 (Salmon, Moraes, Dror, Shaw 2011, "Parallel random numbers: as easy as 1, 2, 3") encrypts a
//! 128-bit counter under a 64-bit key. The key is the job's seed; the counter names the ladder, the replica, the
//! step and the block of four primary dimensions, so a number can be drawn anywhere, in any order and again: that
//! is what makes replay, lazy dimensions and the same image for any number of threads possible at once.

use serde::{Deserialize, Serialize};

/// What random numbers are for; part of the counter, so that streams never meet.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[repr(u8)]
pub enum Purpose {
    /// Primary samples and their mutations; one block of four dimensions a counter.
    Primary = 0,
    /// Decisions of one Metropolis step: which move, accept or reject.
    Step = 1,
    /// Swap decisions; the block is the pair's colder rung.
    Swap = 2,
    /// Independent samples before the chains start.
    Bootstrap = 3,
    /// Choice of the states that chains start from.
    Start = 4,
    /// Stratified points, beyond their low-discrepancy blocks.
    Stratified = 5,
    /// Scrambles of the low-discrepancy blocks.
    Scramble = 6,
    /// Turns that blocks take at the pixels.
    Turn = 7,
    /// Seeds of the passes that a reference is the mean of.
    Pass = 8,
    /// Points that mappings are tried with.
    Trial = 9,
    /// Changes of technique.
    Technique = 10,
    /// Seeds of the parts of a job.
    Part = 11,
    /// Looks at what is in plain view of an open point's pixel; the number of the look is the replica's.
    View = 12,
}

/// Identifies one call for four random words.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Counter {
    /// The ladder (for chains without ladder, the chain; for stratified points, the pixel).
    pub ladder: u32,
    /// The replica on its ladder, or the uniform draw.
    pub replica: u16,
    /// The step of that replica (for stratified points, the number in the pixel), < 2⁵⁶.
    pub step: u64,
    /// The stream.
    pub purpose: Purpose,
}

/// A seeded source of random words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rng {
    key: [u32; 2],
}

const MULTIPLIERS: [u32; 2] = [0xD251_1F53, 0xCD9E_8D57];
const WEYL: [u32; 2] = [0x9E37_79B9, 0xBB67_AE85];
const ROUNDS: usize = 10;

impl Rng {
    /// The source of the job with this seed.
    pub fn new(seed: u64) -> Rng {
        Rng { key: [seed as u32, (seed >> 32) as u32] }
    }

    /// Four independent uniform words for block `block` of the counter.
    #[inline(always)]
    pub fn words(&self, counter: Counter, block: u16) -> [u32; 4] {
        philox(counter.words(block).map(|word| [word]), self.key).map(|[word]| word)
    }

    /// A seed for another source, independent of all that this one gives: the first two words of the counter.
    pub fn seed(&self, counter: Counter) -> u64 {
        let [low, high, ..] = self.words(counter, 0);
        u64::from(high) << 32 | u64::from(low)
    }

    /// Four words for each of [`SIDE_BY_SIDE`] counters at once, which the compiler turns into vector instructions: word i of
    /// counter j is at `[i][j]`.
    #[inline(always)]
    pub fn words_side_by_side(&self, counters: [Counter; SIDE_BY_SIDE], block: u16) -> [[u32; SIDE_BY_SIDE]; 4] {
        // loops and no closures, which the compiler would call where the loop is made for wider instructions
        let mut words = [[0; SIDE_BY_SIDE]; 4];
        for (j, counter) in counters.into_iter().enumerate() {
            let [a, b, c, d] = counter.words(block);
            (words[0][j], words[1][j], words[2][j], words[3][j]) = (a, b, c, d);
        }
        philox(words, self.key)
    }
}

/// Counters that [`Rng::words_side_by_side`] takes.
pub const SIDE_BY_SIDE: usize = 8;

impl Counter {
    /// The 128 bits that are encrypted.
    #[inline(always)]
    fn words(self, block: u16) -> [u32; 4] {
        debug_assert!(self.step < 1 << 56);
        [
            self.ladder,
            (u32::from(self.replica) << 16) | u32::from(block),
            self.step as u32,
            ((self.step >> 32) as u32) | (u32::from(self.purpose as u8) << 24),
        ]
    }
}

/// Ten rounds of Philox4x32 on N counters side by side.
#[inline(always)]
#[expect(clippy::needless_range_loop, reason = "four arrays in step, in the form that vectorises")]
fn philox<const N: usize>(mut c: [[u32; N]; 4], mut key: [u32; 2]) -> [[u32; N]; 4] {
    for _ in 0..ROUNDS {
        for j in 0..N {
            let a = u64::from(c[0][j]) * u64::from(MULTIPLIERS[0]);
            let b = u64::from(c[2][j]) * u64::from(MULTIPLIERS[1]);
            c[0][j] = (b >> 32) as u32 ^ c[1][j] ^ key[0];
            c[1][j] = b as u32;
            c[2][j] = (a >> 32) as u32 ^ c[3][j] ^ key[1];
            c[3][j] = a as u32;
        }
        key = [key[0].wrapping_add(WEYL[0]), key[1].wrapping_add(WEYL[1])];
    }
    c
}

/// Uniform number in [0, 1) with 24 random bits, exact in f32; never 1.
#[inline(always)]
pub fn unit_f32(word: u32) -> f32 {
    (word >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// A word for which [`unit_f32`] is the nearest to `u`, a number in [0, 1]; the rest of the word is that of `rest`.
pub fn word_of_unit(u: f32, rest: u32) -> u32 {
    let steps = (f64::from(u) * 16_777_216.0 + 0.5) as u32; // negative numbers and NaN become 0
    (steps.min((1 << 24) - 1) << 8) | (rest & 0xff)
}

/// Uniform number in (0, 1) from 32 random bits; never 0, so that its logarithm is finite.
#[inline(always)]
pub fn open_unit_f64(word: u32) -> f64 {
    (f64::from(word) + 0.5) * (1.0 / 4_294_967_296.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn philox_gives_the_published_answers() {
        // Known answers distributed with Random123 (kat_vectors, philox4x32 10 rounds).
        let known = [
            ([0; 4], [0; 2], [0x6627_e8d5, 0xe169_c58d, 0xbc57_ac4c, 0x9b00_dbd8]),
            ([u32::MAX; 4], [u32::MAX; 2], [0x408f_276d, 0x41c8_3b0e, 0xa20b_c7c6, 0x6d54_51fd]),
            (
                [0x243f_6a88, 0x85a3_08d3, 0x1319_8a2e, 0x0370_7344],
                [0xa409_3822, 0x299f_31d0],
                [0xd16c_fe09, 0x94fd_cceb, 0x5001_e420, 0x2412_6ea1],
            ),
        ];
        for (counter, key, answer) in known {
            assert_eq!(philox(counter.map(|word| [word]), key).map(|[word]| word), answer);
        }
    }

    #[test]
    fn side_by_side_or_one_by_one_the_numbers_are_the_same() {
        let rng = Rng::new(0x1234_5678_9abc);
        let counters = std::array::from_fn(|j| Counter {
            ladder: 77 * j as u32,
            replica: j as u16,
            step: (j as u64) << 33,
            purpose: Purpose::Swap,
        });
        let together = rng.words_side_by_side(counters, 9);
        for (j, counter) in counters.into_iter().enumerate() {
            assert_eq!(together.map(|w| w[j]), rng.words(counter, 9));
        }
    }

    #[test]
    fn every_field_of_the_counter_changes_the_numbers() {
        let rng = Rng::new(7);
        let base = Counter { ladder: 1, replica: 2, step: 3, purpose: Purpose::Primary };
        let words = rng.words(base, 4);
        assert_ne!(words, rng.words(Counter { ladder: 2, ..base }, 4));
        assert_ne!(words, rng.words(Counter { replica: 3, ..base }, 4));
        assert_ne!(words, rng.words(Counter { step: 4, ..base }, 4));
        assert_ne!(words, rng.words(Counter { step: 3 | 1 << 40, ..base }, 4));
        assert_ne!(words, rng.words(Counter { purpose: Purpose::Step, ..base }, 4));
        assert_ne!(words, rng.words(base, 5));
        assert_ne!(words, Rng::new(8).words(base, 4));
    }

    #[test]
    fn words_of_units_are_read_as_those() {
        for word in [0, 255, 256, 0x1234_5678, u32::MAX - 256, u32::MAX] {
            assert_eq!(word_of_unit(unit_f32(word), word), word);
        }
        assert_eq!(word_of_unit(1.0, 0), 0xffff_ff00);
    }

    #[test]
    fn units_stay_within_their_intervals() {
        assert_eq!(unit_f32(0), 0.0);
        assert!(unit_f32(u32::MAX) < 1.0);
        assert!(open_unit_f64(0) > 0.0 && open_unit_f64(u32::MAX) < 1.0);
    }
}
