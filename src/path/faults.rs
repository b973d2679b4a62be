//! Contributions that cannot be used: why, how many, and which evaluation the first of them came from.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::luminance;
use crate::{
    rng::Counter,
    sample::{Block, LIGHT_STREAM, Move, Points, Proposals},
    scene::Rgb,
};

/// Why a value is no contribution.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Cause {
    /// A channel is not a number: 0/0 or ∞ − ∞ on the way.
    NotANumber,
    /// A channel is below 0, which light never is.
    Negative,
    /// A channel is infinite: a division by 0, or a product beyond the range of 32-bit floats.
    Infinite,
    /// All channels of all parts are finite, but their luminance is not.
    Overflow,
}

impl Cause {
    /// All of them; a value that is several of these counts as the first.
    pub const ALL: [Cause; 4] = [Cause::NotANumber, Cause::Negative, Cause::Infinite, Cause::Overflow];

    /// Name in logs.
    pub fn name(self) -> &'static str {
        match self {
            Cause::NotANumber => "not_a_number",
            Cause::Negative => "negative",
            Cause::Infinite => "infinite",
            Cause::Overflow => "overflow",
        }
    }

    /// In words that follow a number.
    pub fn in_words(self) -> &'static str {
        match self {
            Cause::NotANumber => "not a number",
            Cause::Negative => "negative",
            Cause::Infinite => "infinite",
            Cause::Overflow => "of a luminance beyond 32-bit floats",
        }
    }

    /// Of a colour that is at fault.
    #[cold]
    pub(super) fn of(rgb: Rgb) -> Cause {
        match rgb {
            _ if rgb.is_nan() => Cause::NotANumber,
            _ if rgb.min_element() < 0.0 => Cause::Negative,
            _ if !rgb.is_finite() => Cause::Infinite,
            _ => {
                debug_assert!(!luminance(rgb).is_finite());
                Cause::Overflow
            }
        }
    }
}

/// How many values of one evaluation had to be settled, by cause. No more than a path has parts, so a word holds all.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Causes([u16; Cause::ALL.len()]);

impl Causes {
    /// None.
    pub const NONE: Causes = Causes([0; Cause::ALL.len()]);

    /// Whether there were any.
    #[inline(always)]
    pub fn is_none(self) -> bool {
        self.0 == [0; Cause::ALL.len()]
    }

    /// One more.
    #[cold]
    pub fn add(&mut self, cause: Cause) {
        self.0[cause as usize] = self.0[cause as usize].saturating_add(1);
    }

    /// How many of that cause.
    pub fn of(self, cause: Cause) -> u64 {
        u64::from(self.0[cause as usize])
    }

    /// How many.
    pub fn total(self) -> u64 {
        Cause::ALL.into_iter().map(|cause| self.of(cause)).sum()
    }

    /// The first of them.
    fn first(self) -> Option<Cause> {
        Cause::ALL.into_iter().find(|cause| self.of(*cause) > 0)
    }
}

impl From<Cause> for Causes {
    fn from(cause: Cause) -> Causes {
        let mut causes = Causes::NONE;
        causes.add(cause);
        causes
    }
}

/// How an evaluated point came about, in the order in which points are easier to come back to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Origin {
    /// A stratified point of a pixel that left open what it chooses: its counter says all.
    Open,
    /// A stratified point of a pixel: its counter says all.
    Stratified,
    /// A uniform point: its counter says all.
    Uniform,
    /// A small step of a chain: what it started from has a history.
    Step,
    /// A change of technique of a chain: the same.
    Change,
}

impl Origin {
    /// What a lane that moves like that evaluates; `None` where it rests.
    pub fn of(how: Move) -> Option<Origin> {
        match how {
            Move::Stratified => Some(Origin::Stratified),
            Move::Fresh => Some(Origin::Uniform),
            Move::Small(_) => Some(Origin::Step),
            Move::Given => Some(Origin::Change),
            Move::Rest => None,
        }
    }

    /// Whether the counter alone gives the point.
    pub fn is_addressed(self) -> bool {
        self <= Origin::Uniform
    }
}

/// One point of the cube by itself.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Point {
    /// The blocks of the camera's stream and of the light's.
    pub streams: [Vec<Block>; 2],
}

impl Point {
    /// That of a lane.
    pub fn of(points: &Points, lane: usize) -> Point {
        let [camera, light] = points.used(lane);
        let blocks = |first: u16, count: u16| (first..first + count).map(|block| points.block(block, lane)).collect();
        Point { streams: [blocks(0, camera), blocks(LIGHT_STREAM, light)] }
    }

    /// The same as points of one lane.
    pub fn to_points(&self) -> Points {
        let mut points = Points::new(1);
        for (first, blocks) in [0, LIGHT_STREAM].into_iter().zip(&self.streams) {
            for (block, words) in (first..).zip(blocks) {
                points.reserve(block);
                points.set(block, 0, *words);
            }
        }
        points
    }
}

/// An evaluation that can be repeated.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Evaluation {
    /// The words that were drawn for it.
    pub counter: Counter,
    /// What they were drawn for.
    pub origin: Origin,
    /// The point that came of them.
    pub point: Point,
}

impl Evaluation {
    /// The one in a lane; `None` where the lane rests.
    pub fn of(proposals: &Proposals, lane: usize) -> Option<Evaluation> {
        let origin = Origin::of(proposals.moves[lane])?;
        Some(Evaluation { counter: proposals.counters[lane], origin, point: Point::of(proposals.points, lane) })
    }

    /// Sorts evaluations by how easily they are repeated, and then by when they take place.
    fn rank(&self) -> impl Ord + use<> {
        let Counter { ladder, replica, step, purpose } = self.counter;
        (self.origin, step, ladder, replica, purpose as u8)
    }
}

/// An evaluation with a contribution that had to be settled.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Fault {
    /// What was wrong with it.
    pub cause: Cause,
    /// What repeats it.
    pub evaluation: Evaluation,
}

/// Contributions settled so far, mergeable in any order.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Faults {
    /// Numbers by [`Cause`].
    counts: [u64; Cause::ALL.len()],
    /// The one that is repeated most easily, and of such the earliest: the same in whatever order they were noted.
    first: Option<Box<Fault>>,
}

impl Faults {
    /// Counts those of one evaluation.
    pub fn count(&mut self, causes: Causes) {
        self.counts.iter_mut().zip(causes.0).for_each(|(sum, n)| *sum += u64::from(n));
    }

    /// Counts those of a lane's evaluation, and keeps what repeats it where it is the first.
    #[cold]
    pub fn note(&mut self, causes: Causes, proposals: &Proposals, lane: usize) {
        self.count(causes);
        if let (Some(cause), Some(evaluation)) = (causes.first(), Evaluation::of(proposals, lane)) {
            self.keep(&Fault { cause, evaluation });
        }
    }

    /// The same for an evaluation that left open what the point chooses.
    #[cold]
    pub fn note_open(&mut self, causes: Causes, proposals: &Proposals, lane: usize) {
        self.count(causes);
        if let (Some(cause), Some(evaluation)) = (causes.first(), Evaluation::of(proposals, lane)) {
            self.keep(&Fault { cause, evaluation: Evaluation { origin: Origin::Open, ..evaluation } });
        }
    }

    fn keep(&mut self, fault: &Fault) {
        if self.first.as_ref().is_none_or(|first| fault.evaluation.rank() < first.evaluation.rank()) {
            self.first = Some(Box::new(fault.clone()));
        }
    }

    /// Adds another part's.
    pub fn merge(&mut self, other: &Faults) {
        self.counts.iter_mut().zip(other.counts).for_each(|(sum, n)| *sum += n);
        other.first.iter().for_each(|fault| self.keep(fault));
    }

    /// How many of that cause.
    pub fn of(&self, cause: Cause) -> u64 {
        self.counts[cause as usize]
    }

    /// How many.
    pub fn total(&self) -> u64 {
        self.counts.iter().sum()
    }

    /// The one to look at.
    pub fn first(&self) -> Option<&Fault> {
        self.first.as_deref()
    }

    /// Numbers by the names of causes, of those that there are.
    pub fn by_cause(&self) -> BTreeMap<&'static str, u64> {
        let some = Cause::ALL.into_iter().filter(|cause| self.of(*cause) > 0);
        some.map(|cause| (cause.name(), self.of(cause))).collect()
    }

    /// `3 not a number, 2 infinite`; empty where there are none.
    pub fn in_words(&self) -> String {
        let some = Cause::ALL.into_iter().filter(|cause| self.of(*cause) > 0);
        some.map(|cause| format!("{} {}", self.of(cause), cause.in_words())).collect::<Vec<_>>().join(", ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Purpose;

    fn fault(origin: Origin, step: u64, ladder: u32) -> Fault {
        let counter = Counter { ladder, replica: 0, step, purpose: Purpose::Primary };
        Fault { cause: Cause::Infinite, evaluation: Evaluation { counter, origin, point: Point::default() } }
    }

    #[test]
    fn a_colour_has_the_gravest_of_its_causes() {
        let (nan, inf) = (f32::NAN, f32::INFINITY);
        for (rgb, cause) in [
            ([nan, inf, -1.0], Cause::NotANumber),
            ([inf, -1.0, 0.0], Cause::Negative),
            ([-inf, inf, 0.0], Cause::Negative),
            ([0.0, inf, 1.0], Cause::Infinite),
        ] {
            assert_eq!(Cause::of(Rgb::from_array(rgb)), cause, "{rgb:?}");
        }
    }

    /// The first is the same in whatever order parts are merged, and one that needs no history comes before all others.
    #[test]
    fn the_first_fault_depends_on_no_order() {
        let all = [(Origin::Step, 3, 7), (Origin::Uniform, 90, 1), (Origin::Uniform, 80, 2), (Origin::Uniform, 80, 1)];
        let parts = all.map(|(origin, step, ladder)| {
            let mut part = Faults::default();
            part.count(Cause::Infinite.into());
            part.keep(&fault(origin, step, ladder));
            part
        });
        for turn in 0..4 {
            for backwards in [false, true] {
                let mut sum = Faults::default();
                let mut order: Vec<usize> = (0..4).map(|i| (i + turn) % 4).collect();
                if backwards {
                    order.reverse();
                }
                order.into_iter().for_each(|i| sum.merge(&parts[i]));
                assert_eq!(sum.first(), Some(&fault(Origin::Uniform, 80, 1)));
                assert_eq!((sum.total(), sum.of(Cause::Infinite), sum.of(Cause::Negative)), (4, 4, 0));
                assert_eq!(sum.in_words(), "4 infinite");
            }
        }
    }

    #[test]
    fn a_point_survives_on_its_own() {
        let mut points = Points::new(3);
        for (block, words) in [(0, [1; 4]), (1, [2; 4]), (LIGHT_STREAM, [3; 4])] {
            points.reserve(block);
            points.set(block, 1, words);
        }
        let point = Point::of(&points, 1);
        assert_eq!(point.streams, [vec![[1; 4], [2; 4]], vec![[3; 4]]]);
        assert_eq!(Point::of(&point.to_points(), 0), point);
    }
}
