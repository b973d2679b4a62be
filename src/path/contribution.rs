//! What a point contributes to the image, and the scalar that chains follow.

use serde::{Deserialize, Serialize};

use super::faults::{Cause, Causes, Faults};
use crate::scene::Rgb;

/// Luminance with the paper's weights (Rec. 601): 0.299 R + 0.587 G + 0.114 B. Non-negative colours have
/// f/g ≤ 1/0.114 < 8.8 in every channel.
#[inline(always)]
pub fn luminance(rgb: Rgb) -> f32 {
    0.299 * rgb.x + 0.587 * rgb.y + 0.114 * rgb.z
}

/// The same of sums, which may be beyond f32 where their terms are not.
pub fn luminance_of_sums([r, g, b]: [f64; 3]) -> f64 {
    0.299 * r + 0.587 * g + 0.114 * b
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
    /// Probability of the choice that made the point what it is, where points choose among [`Outcome`]s; else 1.
    pub chance: f32,
}

impl Contribution {
    /// No contribution: where chains are before their first state.
    pub const NONE: Contribution =
        Contribution { film: [0.0; 2], rgb: Rgb::ZERO, luminance: 0.0, ln_g: f64::NEG_INFINITY, chance: 1.0 };

    /// The contribution of radiance `rgb` at a film position and nothing elsewhere, and whether it had to be settled; see
    /// [`settle_whole`](Self::settle_whole).
    #[inline(always)]
    pub fn settle(film: [f32; 2], rgb: Rgb) -> (Contribution, Causes) {
        let mut causes = Causes::NONE;
        let rgb = settled(rgb, &mut causes);
        (Contribution::of(film, rgb, luminance(rgb)), causes)
    }

    /// The contribution of radiance `rgb` at a film position and of what a lane gives elsewhere, and why how many of those
    /// had to be settled: a value that is not finite or negative contributes nothing. This is the one place where
    /// that is decided; a NaN that got as far as an acceptance probability would be accepted for ever.
    pub fn settle_whole(film: [f32; 2], rgb: Rgb, elsewhere: &mut Elsewhere, lane: usize) -> (Contribution, Causes) {
        let mut causes = Causes::NONE;
        let rgb = settled(rgb, &mut causes);
        let mut total = luminance(rgb);
        for splat in elsewhere.of_mut(lane) {
            splat.rgb = settled(splat.rgb, &mut causes);
            total += luminance(splat.rgb);
        }
        if total == f32::INFINITY {
            elsewhere.clear(lane);
            causes.add(Cause::Overflow);
            return (Contribution { film, ..Contribution::NONE }, causes);
        }
        (Contribution::of(film, rgb, total), causes)
    }

    fn of(film: [f32; 2], rgb: Rgb, luminance: f32) -> Contribution {
        let ln_g = if luminance > 0.0 { libm::log(f64::from(luminance)) } else { f64::NEG_INFINITY };
        Contribution { film, rgb, luminance, ln_g, chance: 1.0 }
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

/// A colour that can be trusted in the place of `rgb`; `causes` is told where that was at fault. A luminance that
/// underflows is darkness, not a fault.
#[inline(always)]
fn settled(rgb: Rgb, causes: &mut Causes) -> Rgb {
    let g = luminance(rgb);
    if g > 0.0 && g < f32::INFINITY && rgb.min_element() >= 0.0 {
        return rgb;
    }
    if rgb != Rgb::ZERO && !(g == 0.0 && rgb.is_finite() && rgb.min_element() >= 0.0) {
        causes.add(Cause::of(rgb));
    }
    Rgb::ZERO
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
/// subpaths that the camera sees.
pub type Elsewhere = Lists<FilmSplat>;

/// One of the things that a point may turn out to be, where points choose.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Outcome {
    /// What it adds to a place of the film if all outcomes are had at once. A point that chooses it adds that over
    /// `chance`.
    pub splat: FilmSplat,
    /// Whether the place is the one that the point's first dimensions name.
    pub own: bool,
    /// Probability of the choice, over that of roulette having let the path be made, which points that choose do not
    /// play; 0 for what no point can choose.
    pub chance: f32,
    /// ln g of a point that chooses it; −∞ where it contributes nothing or cannot be chosen.
    pub ln_g: f64,
}

impl Outcome {
    /// Settles the outcome as a [`Contribution`] is, and finds ln g for chains that follow the luminance.
    pub fn settle(&mut self, causes: &mut Causes) {
        let rgb = settled(self.splat.rgb, causes);
        self.splat.rgb = rgb;
        self.ln_g = if rgb == Rgb::ZERO || self.chance == 0.0 {
            f64::NEG_INFINITY
        } else {
            libm::log(self.splat.luminance()) - libm::log(f64::from(self.chance))
        };
    }
}

/// Lists by lane; lanes of mappings that have no such thing cost nothing.
///
/// Memory is as large as the longest list asks for and then stays, so a batch that is warm allocates nothing.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(
    from = "Vec<Vec<T>>",
    into = "Vec<Vec<T>>",
    bound(serialize = "T: Copy + Default + Serialize", deserialize = "T: Copy + Default + Deserialize<'de>")
)]
pub struct Lists<T> {
    /// Items that a lane has room for.
    room: usize,
    /// Number of items by lane.
    counts: Vec<u16>,
    /// `items[lane * room ..]`.
    items: Vec<T>,
}

impl<T: Copy + Default> Lists<T> {
    /// Whether it is for so many lanes.
    pub fn fits(&self, lanes: usize) -> bool {
        self.counts.len() == lanes
    }

    /// Nothing, for `lanes` lanes.
    pub fn new(lanes: usize) -> Lists<T> {
        Lists { room: 0, counts: vec![0; lanes], items: Vec::new() }
    }

    /// The items of a lane.
    #[inline(always)]
    pub fn of(&self, lane: usize) -> &[T] {
        let start = lane * self.room;
        &self.items[start..start + usize::from(self.counts[lane])]
    }

    /// The items of a lane, to be changed.
    pub fn of_mut(&mut self, lane: usize) -> &mut [T] {
        let start = lane * self.room;
        &mut self.items[start..start + usize::from(self.counts[lane])]
    }

    /// Forgets the items of a lane.
    #[inline(always)]
    pub fn clear(&mut self, lane: usize) {
        self.counts[lane] = 0;
    }

    /// Adds an item to a lane.
    #[inline]
    pub fn push(&mut self, lane: usize, item: T) {
        let count = usize::from(self.counts[lane]);
        self.reserve(count + 1);
        self.items[lane * self.room + count] = item;
        self.counts[lane] += 1;
    }

    /// Copies what lane `from` of `other` has to lane `to`.
    #[inline(always)]
    pub fn copy(&mut self, to: usize, other: &Lists<T>, from: usize) {
        let items = other.of(from);
        if items.is_empty() {
            self.counts[to] = 0;
            return;
        }
        self.reserve(items.len());
        let start = to * self.room;
        self.items[start..start + items.len()].copy_from_slice(items);
        self.counts[to] = items.len() as u16;
    }

    /// Makes room for `count` items a lane.
    fn reserve(&mut self, count: usize) {
        if count <= self.room {
            return;
        }
        let room = count.next_power_of_two().max(4);
        let mut items = vec![T::default(); room * self.counts.len()];
        for lane in 0..self.counts.len() {
            let own = self.of(lane);
            items[lane * room..lane * room + own.len()].copy_from_slice(own);
        }
        (self.room, self.items) = (room, items);
    }
}

/// Lists are saved lane by lane, without the room around them.
impl<T: Copy + Default> From<Lists<T>> for Vec<Vec<T>> {
    fn from(lists: Lists<T>) -> Vec<Vec<T>> {
        (0..lists.counts.len()).map(|lane| lists.of(lane).to_vec()).collect()
    }
}

impl<T: Copy + Default> From<Vec<Vec<T>>> for Lists<T> {
    fn from(saved: Vec<Vec<T>>) -> Lists<T> {
        let mut lists = Lists::new(saved.len());
        for (lane, items) in saved.into_iter().enumerate() {
            items.into_iter().take(usize::from(u16::MAX)).for_each(|item| lists.push(lane, item));
        }
        lists
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
    /// All outcomes of the points that were [evaluated openly](crate::chain::Target::evaluate_open).
    pub outcomes: Lists<Outcome>,
    /// Rays traced since the counter was last taken.
    pub rays: u64,
    /// Contributions settled since they were last taken.
    pub faults: Faults,
}

impl Contributions {
    /// For `lanes` lanes.
    pub fn new(lanes: usize) -> Contributions {
        Contributions {
            lanes: vec![Contribution::NONE; lanes],
            elsewhere: Elsewhere::new(lanes),
            outcomes: Lists::new(lanes),
            rays: 0,
            faults: Faults::default(),
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
            let (c, causes) = Contribution::settle([0.5; 2], Rgb::new(1.0, bad, 1.0));
            assert!(c.is_dark() && causes.total() == 1, "{bad}");
        }
        let (c, causes) = Contribution::settle([0.5; 2], Rgb::ZERO);
        assert!(c.is_dark() && causes.is_none());
    }

    #[test]
    fn ln_g_is_the_logarithm_of_luminance() {
        let (c, causes) = Contribution::settle([0.1, 0.2], Rgb::new(1.0, 2.0, 3.0));
        assert!(causes.is_none() && (c.ln_g - f64::from(0.299 + 2.0 * 0.587 + 3.0 * 0.114f32).ln()).abs() < 1e-6);
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
        let (c, causes) = Contribution::settle_whole([0.1; 2], Rgb::splat(1.0), &mut elsewhere, 0);
        assert_eq!((c.luminance, causes), (6.0, Cause::NotANumber.into()));
        assert_eq!(elsewhere.of(0).iter().map(|s| s.rgb.x).collect::<Vec<_>>(), [2.0, 0.0, 3.0]);
        elsewhere.push(0, FilmSplat { film: [0.5; 2], rgb: Rgb::splat(f32::MAX) });
        elsewhere.push(0, FilmSplat { film: [0.5; 2], rgb: Rgb::splat(f32::MAX) });
        let (c, causes) = Contribution::settle_whole([0.1; 2], Rgb::splat(1.0), &mut elsewhere, 0);
        assert!(
            c.is_dark() && causes == Cause::Overflow.into() && elsewhere.of(0).is_empty(),
            "a sum beyond the range of f32"
        );
    }
}
