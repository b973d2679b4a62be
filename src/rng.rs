//! Counter-based random numbers: every number is a pure function of who asks for what.
//!
//! Philox4x32-10 (Salmon, Moraes, Dror, Shaw 2011, "Parallel random numbers: as easy as 1, 2, 3") encrypts a
//! 128-bit counter under a 64-bit key. The key is the job's seed; the counter names the ladder, the replica, the
//! step and the block of four primary dimensions, so a number can be drawn anywhere, in any order and again: that
//! is what makes replay, lazy dimensions and the same image for any number of threads possible at once.

/// What random numbers are for; part of the counter, so that streams never meet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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
}

/// Identifies one call for four random words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Counter {
    /// The ladder (for chains without ladder, the chain).
    pub ladder: u32,
    /// The replica on its ladder, or the uniform draw.
    pub replica: u16,
    /// The step of that replica, < 2⁵⁶.
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
    pub fn words(&self, c: Counter, block: u16) -> [u32; 4] {
        debug_assert!(c.step < 1 << 56);
        philox(
            [
                c.ladder,
                (u32::from(c.replica) << 16) | u32::from(block),
                c.step as u32,
                ((c.step >> 32) as u32) | (u32::from(c.purpose as u8) << 24),
            ],
            self.key,
        )
    }
}

/// Ten rounds of Philox4x32.
#[inline(always)]
fn philox(mut c: [u32; 4], mut key: [u32; 2]) -> [u32; 4] {
    for _ in 0..ROUNDS {
        let a = u64::from(c[0]) * u64::from(MULTIPLIERS[0]);
        let b = u64::from(c[2]) * u64::from(MULTIPLIERS[1]);
        c = [(b >> 32) as u32 ^ c[1] ^ key[0], b as u32, (a >> 32) as u32 ^ c[3] ^ key[1], a as u32];
        key = [key[0].wrapping_add(WEYL[0]), key[1].wrapping_add(WEYL[1])];
    }
    c
}

/// Uniform number in [0, 1) with 24 random bits, exact in f32; never 1.
#[inline(always)]
pub fn unit_f32(word: u32) -> f32 {
    (word >> 8) as f32 * (1.0 / 16_777_216.0)
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
        assert_eq!(philox([0; 4], [0; 2]), [0x6627_e8d5, 0xe169_c58d, 0xbc57_ac4c, 0x9b00_dbd8]);
        assert_eq!(philox([u32::MAX; 4], [u32::MAX; 2]), [0x408f_276d, 0x41c8_3b0e, 0xa20b_c7c6, 0x6d54_51fd]);
        assert_eq!(
            philox([0x243f_6a88, 0x85a3_08d3, 0x1319_8a2e, 0x0370_7344], [0xa409_3822, 0x299f_31d0]),
            [0xd16c_fe09, 0x94fd_cceb, 0x5001_e420, 0x2412_6ea1]
        );
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
    fn units_stay_within_their_intervals() {
        assert_eq!(unit_f32(0), 0.0);
        assert!(unit_f32(u32::MAX) < 1.0);
        assert!(open_unit_f64(0) > 0.0 && open_unit_f64(u32::MAX) < 1.0);
    }
}
