//! Which technique a point of the multiplexed mapping stands for.

use super::Techniques;
use crate::{rng::unit_f32, sample::Block};

/// The technique that a point has chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chosen {
    /// Vertices of the light subpath, s.
    pub light: u16,
    /// Vertices of the camera subpath, t, the place on the lens included.
    pub camera: u16,
    /// One over the probability of the choice.
    pub scale: f32,
}

impl Chosen {
    /// Nothing at all.
    pub const NONE: Chosen = Chosen { light: 0, camera: 0, scale: 0.0 };

    /// Whether it is that technique.
    #[inline(always)]
    pub fn is(&self, light: u16, camera: u16) -> bool {
        (self.light, self.camera) == (light, camera)
    }
}

/// How often paths of each number of edges are chosen.
///
/// Longer ones are rarer by a constant factor; the technique is uniform among those that make paths of that length, so that a
/// small step in either of two dimensions keeps the other.
#[derive(Clone, Debug, PartialEq)]
pub struct Lengths {
    /// Σ of probabilities up to each length, from 1 edge on; the last is 1.
    cumulative: Vec<f32>,
}

/// Edges of the longest paths that are told apart; of those that a scene without limit could have, the longer ones are
/// left out.
const LONGEST: u16 = 128;
/// How much rarer paths of one more edge are.
const DECAY: f64 = 0.75;

impl Lengths {
    /// For paths of up to `max_depth` edges.
    ///
    /// In proportion to what paths of each length were found to contribute to the picture, relative to its luminance, the
    /// squared error of `mlt` on `lattice` fell to 0.6 to 0.8 after 4 seconds (two seeds) and little changed on `cornell-box`
    /// and `caustic`, but on the former the brightness of `re` was off by up to 5 % (six seeds) in the place of 2 % (five).
    pub fn new(max_depth: u16) -> Lengths {
        let longest = usize::from(max_depth.min(LONGEST));
        let shares = (0..longest).map(|i| DECAY.powi(i as i32));
        let all: f64 = shares.clone().sum();
        let mut sum = 0.0;
        let mut cumulative: Vec<f32> = shares
            .map(|share| {
                sum += share / all;
                sum as f32
            })
            .collect();
        *cumulative.last_mut().expect("paths have an edge at least") = 1.0;
        Lengths { cumulative }
    }

    /// Probability of a number of edges, from 1 on.
    pub fn probability(&self, edges: usize) -> f32 {
        self.cumulative[edges - 1] - if edges > 1 { self.cumulative[edges - 2] } else { 0.0 }
    }

    /// How many techniques make paths of that many edges.
    fn techniques(edges: usize) -> u32 {
        // s = 0 … n, but for lamps that are seen directly
        if edges == 1 { 1 } else { edges as u32 + 1 }
    }

    /// Probability of choosing a technique; 0 for paths longer than any that are chosen.
    #[inline(always)]
    pub fn chance(&self, light: u16, camera: u16) -> f32 {
        let edges = usize::from(light + camera) - 1;
        if edges > self.cumulative.len() { 0.0 } else { self.probability(edges) / Self::techniques(edges) as f32 }
    }

    /// A word that chooses technique `light` for paths of `edges` edges, uniform among all that do if `random` is uniform
    /// among all words.
    pub fn technique_word(&self, edges: usize, light: usize, random: u32) -> u32 {
        let techniques = u64::from(Self::techniques(edges));
        let start = |s: usize| ((s as u64) << 32).div_ceil(techniques);
        let (first, end) = (start(light), start(light + 1));
        (first + ((u64::from(random) * (end - first)) >> 32)) as u32
    }

    /// The technique for a block of words, of which the second decides on the length and the third on the technique.
    #[inline]
    pub fn choose(&self, [_, length, technique, _]: Block) -> Chosen {
        let u = unit_f32(length);
        let edges = self.cumulative.partition_point(|c| *c <= u).min(self.cumulative.len() - 1) + 1;
        let techniques = Self::techniques(edges);
        let light = ((u64::from(technique) * u64::from(techniques)) >> 32) as u16;
        let camera = edges as u16 + 1 - light;
        debug_assert!(Techniques::ALL.has(light, camera));
        Chosen { light, camera, scale: techniques as f32 / self.probability(edges) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_of_a_technique_choose_it() {
        let lengths = Lengths::new(16);
        for length in [0, 1 << 31, u32::MAX] {
            let edges =
                usize::from(lengths.choose([0, length, 0, 0]).light + lengths.choose([0, length, 0, 0]).camera) - 1;
            for light in 0..Lengths::techniques(edges) as usize {
                for random in [0, 1, 1 << 31, u32::MAX] {
                    let word = lengths.technique_word(edges, light, random);
                    let chosen = lengths.choose([0, length, word, 0]);
                    assert_eq!(usize::from(chosen.light), light, "{edges} edges, {random}");
                }
            }
        }
    }
}
