//! What a point contributes to the image, and the scalar that chains follow.

use serde::{Deserialize, Serialize};

use crate::scene::Rgb;

/// Luminance with the paper's weights (Rec. 601): 0.299 R + 0.587 G + 0.114 B. Non-negative colours have
/// f/g ≤ 1/0.114 < 8.8 in every channel.
#[inline(always)]
pub fn luminance(rgb: Rgb) -> f32 {
    0.299 * rgb.x + 0.587 * rgb.y + 0.114 * rgb.z
}

/// The contribution of one point of the cube, but for what it gives to the film elsewhere ([`Elsewhere`]).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Contribution {
    /// Position on the film, as fractions of its width and height.
    pub film: [f32; 2],
    /// f there: radiance over the density of the mapping, per channel; finite and not negative.
    pub rgb: Rgb,
    /// Luminance of all that the point contributes, elsewhere too; finite and not negative.
    pub luminance: f32,
    /// ln g, the natural logarithm of the scalar contribution that chains follow: the luminance of f, weighed by an
    /// [`Importance`](crate::chain::Importance) where there is one; −∞ where that is 0; never NaN or +∞.
    pub ln_g: f64,
}

impl Contribution {
    /// No contribution: where chains are before their first state.
    pub const NONE: Contribution =
        Contribution { film: [0.0; 2], rgb: Rgb::ZERO, luminance: 0.0, ln_g: f64::NEG_INFINITY };

    /// The contribution of radiance `rgb` at a film position and nothing elsewhere, and whether it had to be settled; see
    /// [`settle_whole`](Self::settle_whole).
    #[inline(always)]
    pub fn settle(film: [f32; 2], rgb: Rgb) -> (Contribution, bool) {
        let (rgb, fault) = settled(rgb);
        (Contribution::of(film, rgb, luminance(rgb)), fault)
    }

    /// The contribution of radiance `rgb` at a film position and of what a lane gives elsewhere, and the number of those
    /// that had to be settled: a value that is not finite or negative contributes nothing. This is the one place where
    /// that is decided; a NaN that got as far as an acceptance probability would be accepted for ever.
    pub fn settle_whole(film: [f32; 2], rgb: Rgb, elsewhere: &mut Elsewhere, lane: usize) -> (Contribution, u64) {
        let (rgb, fault) = settled(rgb);
        let mut total = luminance(rgb);
        let mut faults = u64::from(fault);
        for splat in elsewhere.of_mut(lane) {
            let (rgb, fault) = settled(splat.rgb);
            splat.rgb = rgb;
            faults += u64::from(fault);
            total += luminance(rgb);
        }
        if total == f32::INFINITY {
            elsewhere.clear(lane);
            return (Contribution { film, ..Contribution::NONE }, faults + 1);
        }
        (Contribution::of(film, rgb, total), faults)
    }

    fn of(film: [f32; 2], rgb: Rgb, luminance: f32) -> Contribution {
        let ln_g = if luminance > 0.0 { libm::log(f64::from(luminance)) } else { f64::NEG_INFINITY };
        Contribution { film, rgb, luminance, ln_g }
    }

    /// The luminance of all that the point contributes.
    pub fn luminance(&self) -> f64 {
        f64::from(self.luminance)
    }

    /// What the point adds at its own film position.
    #[inline(always)]
    pub fn splat(&self) -> FilmSplat {
        FilmSplat { film: self.film, rgb: self.rgb }
    }

    /// Whether nothing is contributed.
    #[inline(always)]
    pub fn is_dark(&self) -> bool {
        self.ln_g == f64::NEG_INFINITY
    }
}

/// A colour that can be trusted in the place of `rgb`, and whether that was at fault. A luminance that underflows is
/// darkness, not a fault.
#[inline(always)]
fn settled(rgb: Rgb) -> (Rgb, bool) {
    let g = luminance(rgb);
    if g > 0.0 && g < f32::INFINITY && rgb.min_element() >= 0.0 {
        return (rgb, false);
    }
    let fault = rgb != Rgb::ZERO && !(g == 0.0 && rgb.is_finite() && rgb.min_element() >= 0.0);
    (Rgb::ZERO, fault)
}

/// What a point adds to one place of the film.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FilmSplat {
    /// Position on the film, as fractions of its width and height.
    pub film: [f32; 2],
    /// f there.
    pub rgb: Rgb,
}

impl FilmSplat {
    /// Luminance of f there.
    #[inline(always)]
    pub fn luminance(&self) -> f64 {
        f64::from(luminance(self.rgb))
    }
}

/// What the points of a batch give to the film elsewhere than at the position that their first dimensions name: light
/// subpaths that the camera sees. Lists by lane; lanes of mappings that have no such thing cost nothing.
///
/// Memory is as large as the longest list asks for and then stays, so a batch that is warm allocates nothing.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Elsewhere {
    /// Splats that a lane has room for.
    room: usize,
    /// Number of splats by lane.
    counts: Vec<u16>,
    /// `splats[lane * room ..]`.
    splats: Vec<FilmSplat>,
}

impl Elsewhere {
    /// Whether it is for so many lanes and its lists lie where they should.
    pub fn fits(&self, lanes: usize) -> bool {
        let within = self.counts.iter().all(|count| usize::from(*count) <= self.room);
        self.counts.len() == lanes && within && self.room.checked_mul(lanes) == Some(self.splats.len())
    }

    /// Nothing, for `lanes` lanes.
    pub fn new(lanes: usize) -> Elsewhere {
        Elsewhere { room: 0, counts: vec![0; lanes], splats: Vec::new() }
    }

    /// The splats of a lane.
    #[inline(always)]
    pub fn of(&self, lane: usize) -> &[FilmSplat] {
        let start = lane * self.room;
        &self.splats[start..start + usize::from(self.counts[lane])]
    }

    fn of_mut(&mut self, lane: usize) -> &mut [FilmSplat] {
        let start = lane * self.room;
        &mut self.splats[start..start + usize::from(self.counts[lane])]
    }

    /// Forgets the splats of a lane.
    #[inline(always)]
    pub fn clear(&mut self, lane: usize) {
        self.counts[lane] = 0;
    }

    /// Adds a splat to a lane.
    #[inline]
    pub fn push(&mut self, lane: usize, splat: FilmSplat) {
        let count = usize::from(self.counts[lane]);
        self.reserve(count + 1);
        self.splats[lane * self.room + count] = splat;
        self.counts[lane] += 1;
    }

    /// Copies what lane `from` of `other` has to lane `to`.
    #[inline(always)]
    pub fn copy(&mut self, to: usize, other: &Elsewhere, from: usize) {
        let splats = other.of(from);
        if splats.is_empty() {
            self.counts[to] = 0;
            return;
        }
        self.reserve(splats.len());
        let start = to * self.room;
        self.splats[start..start + splats.len()].copy_from_slice(splats);
        self.counts[to] = splats.len() as u16;
    }

    /// Makes room for `count` splats a lane.
    fn reserve(&mut self, count: usize) {
        if count <= self.room {
            return;
        }
        let room = count.next_power_of_two().max(4);
        let mut splats = vec![FilmSplat::default(); room * self.counts.len()];
        for lane in 0..self.counts.len() {
            let own = self.of(lane);
            splats[lane * room..lane * room + own.len()].copy_from_slice(own);
        }
        (self.room, self.splats) = (room, splats);
    }
}

/// All that a point contributes.
#[derive(Clone, Copy, Debug)]
pub struct Whole<'a> {
    /// Where its first dimensions say, with the sums.
    pub main: &'a Contribution,
    /// Elsewhere.
    pub elsewhere: &'a [FilmSplat],
}

impl<'a> Whole<'a> {
    /// What it adds to each place of the film, its own position first.
    #[inline(always)]
    pub fn parts(self) -> impl Iterator<Item = FilmSplat> + use<'a> {
        std::iter::once(self.main.splat()).chain(self.elsewhere.iter().copied())
    }
}

/// Contributions of a batch, one a lane, and counts of what evaluating them took.
#[derive(Clone, Debug, Default)]
pub struct Contributions {
    /// One a lane; lanes that rested keep what they had.
    pub lanes: Vec<Contribution>,
    /// The rest of them.
    pub elsewhere: Elsewhere,
    /// Rays traced since the counter was last taken.
    pub rays: u64,
    /// Contributions settled because they were not finite since the counter was last taken.
    pub non_finite: u64,
}

impl Contributions {
    /// For `lanes` lanes.
    pub fn new(lanes: usize) -> Contributions {
        Contributions {
            lanes: vec![Contribution::NONE; lanes],
            elsewhere: Elsewhere::new(lanes),
            rays: 0,
            non_finite: 0,
        }
    }

    /// All that the point of a lane contributes.
    #[inline(always)]
    pub fn whole(&self, lane: usize) -> Whole<'_> {
        Whole { main: &self.lanes[lane], elsewhere: self.elsewhere.of(lane) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_finite_contributes_nothing_and_is_counted() {
        for bad in [f32::NAN, f32::INFINITY, -1.0] {
            let (c, fault) = Contribution::settle([0.5; 2], Rgb::new(1.0, bad, 1.0));
            assert!(c.is_dark() && fault, "{bad}");
        }
        let (c, fault) = Contribution::settle([0.5; 2], Rgb::ZERO);
        assert!(c.is_dark() && !fault);
    }

    #[test]
    fn ln_g_is_the_logarithm_of_luminance() {
        let (c, fault) = Contribution::settle([0.1, 0.2], Rgb::new(1.0, 2.0, 3.0));
        assert!(!fault && (c.ln_g - f64::from(0.299 + 2.0 * 0.587 + 3.0 * 0.114f32).ln()).abs() < 1e-6);
    }

    #[test]
    fn lists_of_lanes_keep_apart_while_they_grow() {
        let splat = |i: usize| FilmSplat { film: [i as f32; 2], rgb: Rgb::splat(i as f32) };
        let (mut a, mut b) = (Elsewhere::new(3), Elsewhere::new(2));
        for i in 0..20 {
            a.push(i % 2, splat(i));
        }
        assert_eq!(a.of(1), (0..10).map(|i| splat(2 * i + 1)).collect::<Vec<_>>());
        b.push(1, splat(7));
        b.copy(0, &a, 0);
        assert_eq!((b.of(0), b.of(1)), (a.of(0), &[splat(7)][..]));
        b.copy(0, &a, 2);
        assert!(b.of(0).is_empty());
    }

    #[test]
    fn the_whole_is_settled_part_by_part() {
        let mut elsewhere = Elsewhere::new(1);
        for value in [2.0, f32::NAN, 3.0] {
            elsewhere.push(0, FilmSplat { film: [0.5; 2], rgb: Rgb::splat(value) });
        }
        let (c, faults) = Contribution::settle_whole([0.1; 2], Rgb::splat(1.0), &mut elsewhere, 0);
        assert_eq!((c.luminance, faults), (6.0, 1));
        assert_eq!(elsewhere.of(0).iter().map(|s| s.rgb.x).collect::<Vec<_>>(), [2.0, 0.0, 3.0]);
        elsewhere.push(0, FilmSplat { film: [0.5; 2], rgb: Rgb::splat(f32::MAX) });
        elsewhere.push(0, FilmSplat { film: [0.5; 2], rgb: Rgb::splat(f32::MAX) });
        let (c, faults) = Contribution::settle_whole([0.1; 2], Rgb::splat(1.0), &mut elsewhere, 0);
        assert!(c.is_dark() && faults == 1 && elsewhere.of(0).is_empty(), "a sum beyond the range of f32");
    }
}
