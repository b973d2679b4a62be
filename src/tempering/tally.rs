//! What one thread records while it works: statistics, splats, probes. Sums are of integers or kept in lists, so
//! nothing depends on how work was cut up.

use std::sync::{Mutex, MutexGuard, PoisonError};

use serde::{Deserialize, Serialize};

use super::{
    Choices, Combine, Histogram, Ladder, ProbeMap, Probes, StepMix, Weights,
    probes::TRIALS,
    steps::{SCALES, StepCount},
};
use crate::{
    chain::{Recorder, TechniqueChanges, Whereabouts},
    film::{Accumulator, Footprint, Splats},
    path::{Outcome, Whole},
    saved::{Unfit, expect},
};

/// A layer of uniform points, of which every pixel is divided by the number of points that it got, with what points gave
/// to other places than their own: that is divided by the number of all points and so needs a layer for itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PointLayer {
    /// f of points where they lie on the film, and their number.
    pub own: usize,
    /// f elsewhere; absent where points have no such thing.
    pub elsewhere: Option<usize>,
}

impl PointLayer {
    /// Records a point.
    #[inline(always)]
    fn splat(self, recorder: &mut Recorder, point: Whole, value: f64, weight: f64) {
        debug_assert!(self.elsewhere.is_some() || point.elsewhere.is_empty(), "the set-up promised nothing elsewhere");
        recorder.splat_apart([self.own, self.elsewhere.unwrap_or(self.own)], point, value, weight);
    }
}

/// Layers of the film, those that the settings need. Others cost nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Layers {
    /// f of uniform points: the uniform rung's own image E_u.
    pub uniform: Option<PointLayer>,
    /// f of stratified points: the image of a path tracer, as long as it may be the best. Also where chains are wanted
    /// follows from it.
    pub even: Option<PointLayer>,
    /// What uniform points add to the balanced image.
    pub hot: Option<PointLayer>,
    /// What tempered states add to the balanced image, in the unit of [`Weights`].
    pub tempered: Option<usize>,
    /// f/g of states on the target: the target's own image E_e, in the unit of [`Weights`].
    pub target: Option<usize>,
    /// The first of K − 1 layers with the parts of `tempered` by rung.
    pub rungs: Option<usize>,
    /// Number of layers.
    pub count: usize,
}

impl Layers {
    /// The layers that those choices need, with room for the parts of `most_rungs` and, if wanted, for what points give
    /// `elsewhere`.
    pub fn of(choices: &Choices, most_rungs: usize, elsewhere: bool) -> Layers {
        let mut count = 0;
        let mut layer = |wanted: bool, layers: usize| {
            wanted.then(|| {
                count += layers;
                count - layers
            })
        };
        let mut points = |wanted: bool| layer(wanted, 1).map(|own| PointLayer { own, elsewhere: layer(elsewhere, 1) });
        let pair = !matches!(choices.combine, Combine::Balance | Combine::Target | Combine::Uniform);
        let balance = choices.combine == Combine::Balance || choices.layers;
        let chains = most_rungs > 1;
        let [uniform, even, hot] = [
            choices.layers || pair || choices.combine == Combine::Uniform || !chains && !balance,
            balance,
            balance && chains,
        ]
        .map(&mut points);
        let layers = Layers {
            uniform,
            even,
            hot,
            tempered: layer(balance && chains, 1),
            target: layer((choices.layers || pair || choices.combine == Combine::Target) && chains, 1),
            rungs: layer(choices.layers && chains, most_rungs.saturating_sub(1)),
            count: 0,
        };
        Layers { count, ..layers }
    }
}

/// The film that blocks record to, and its probes.
pub struct Canvas<'a> {
    /// Which pixels a film position goes to.
    pub footprint: &'a Footprint,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// The film.
    pub film: &'a Accumulator,
    /// Typical magnitude of the brightest f.
    pub unit: f64,
    /// What its layers hold.
    pub layers: Layers,
    /// Probes, while there is something to learn.
    pub probes: Option<(&'a ProbeMap, &'a Probes)>,
    /// Where stratified points are counted.
    pub groups: &'a PointGroups,
}

/// ln g of stratified points in groups that may be taken as independent. Histograms are exact, so it does not matter who
/// adds to them when.
pub struct PointGroups(Vec<Mutex<Seen>>);

/// Stratified points of one group.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Seen {
    histogram: Histogram,
    hot: Sum,
    even: Sum,
}

/// Σ of luminances that went to the balanced image, in units of 2⁻⁶⁰ of the film's, and Σ of weights that went with
/// them, in units of 2⁻²⁰: integers, which do not depend on the order of addition.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Sum {
    luminance: i128,
    weight: u128,
}

/// 2⁶⁰.
const LUMINANCE_STEPS: f64 = (1u64 << 60) as f64;
/// 2²⁰.
const WEIGHT_STEPS: f64 = (1u64 << 20) as f64;

impl Sum {
    #[inline(always)]
    fn add(&mut self, luminance: f64, weight: f64) {
        self.luminance = self.luminance.saturating_add((luminance * LUMINANCE_STEPS) as i128);
        self.weight += (weight * WEIGHT_STEPS + 0.5) as u128;
    }

    /// Adds another sum.
    pub fn merge(&mut self, other: Sum) {
        self.luminance = self.luminance.saturating_add(other.luminance);
        self.weight += other.weight;
    }

    /// Luminance, in the film's unit, and weight.
    pub fn values(self) -> (f64, f64) {
        (self.luminance as f64 / LUMINANCE_STEPS, self.weight as f64 / WEIGHT_STEPS)
    }
}

impl PointGroups {
    /// So many groups, all empty.
    pub fn new(groups: usize) -> PointGroups {
        PointGroups((0..groups).map(|_| Mutex::default()).collect())
    }

    /// Adds to a group what a tally has seen of the uniform rung, which forgets it.
    pub fn take(&self, group: usize, tally: &mut Tally) {
        let mut seen = self.locked(group);
        seen.histogram.take(&mut tally.histograms[0]);
        seen.hot.merge(std::mem::take(&mut tally.hot));
        seen.even.merge(std::mem::take(&mut tally.even));
    }

    /// Adds a group's points to `sum`.
    pub fn add_to(&self, group: usize, sum: &mut Histogram) {
        sum.merge(&self.locked(group).histogram);
    }

    /// What a group's points added to the balanced image, and their whole luminance.
    pub fn hot_and_even(&self, group: usize) -> [Sum; 2] {
        let seen = self.locked(group);
        [seen.hot, seen.even]
    }

    /// Adds what as many other groups saw, each to the one of its number.
    pub fn merge(&self, other: &PointGroups) {
        for (group, seen) in other.saved().into_iter().enumerate() {
            let mut own = self.locked(group);
            own.histogram.merge(&seen.histogram);
            own.hot.merge(seen.hot);
            own.even.merge(seen.even);
        }
    }

    /// Forgets ln g, which is about to mean something else.
    pub fn forget_histograms(&self) {
        (0..self.0.len()).for_each(|group| self.locked(group).histogram = Histogram::default());
    }

    /// What all groups saw, to be saved.
    pub fn saved(&self) -> Vec<Seen> {
        (0..self.0.len()).map(|group| self.locked(group).clone()).collect()
    }

    /// Groups that saw that already.
    pub fn restored(seen: Vec<Seen>) -> PointGroups {
        PointGroups(seen.into_iter().map(Mutex::new).collect())
    }

    /// The group, even if another thread panicked with it in hand.
    fn locked(&self, group: usize) -> MutexGuard<'_, Seen> {
        self.0[group].lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Canvas<'_> {
    /// The probe at a film position.
    #[inline(always)]
    fn probe(&self, film: [f32; 2]) -> Option<u32> {
        let (map, _) = self.probes?;
        let [x, y] = [0, 1].map(|i| {
            let extent = self.size[i];
            ((film[i] * extent as f32) as u32).min(extent - 1)
        });
        map.of_pixel(y * self.size[0] + x)
    }
}

/// What all blocks do in one round; fixed within it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Round {
    /// The rungs.
    pub ladder: Ladder,
    /// How samples enter the image.
    pub weights: Weights,
    /// How chains move, by trial and rung; the first rung is unused.
    pub mixes: [Vec<StepMix>; TRIALS],
    /// Weight on the film of a uniform point and of a state, by which rounds count in proportion to their length
    /// whatever their share of uniform points is.
    pub effort: [f64; 2],
    /// All uniform points are offered ones.
    pub only_offers: bool,
    /// Stratified points leave open what they choose; the image has nothing of offered ones, which cannot.
    pub open: bool,
    /// Sweep of the ladders at which the second half of the round begins.
    pub half: u64,
}

/// Counts of one tempered rung.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RungCounts {
    /// Small steps by scale.
    pub steps: [StepCount; SCALES],
    /// Changes of technique.
    pub changes: TechniqueChanges,
    /// Swaps with the next hotter rung.
    pub swaps: StepCount,
    /// ln g of states in the two halves of the round.
    pub halves: [LnMean; 2],
    /// Where states on the target were in the two halves of the round.
    pub whereabouts: [Whereabouts; 2],
    /// Luminance that went to the balanced image, in the unit of the weights, and its weight.
    pub luminance: Sum,
    /// Most steps in a row that a chain refused.
    pub longest_rejection: u32,
}

impl RungCounts {
    /// Adds another part's counts.
    pub fn add(&mut self, other: &RungCounts) {
        self.steps.iter_mut().zip(other.steps).for_each(|(a, b)| *a += b);
        self.changes.merge(&other.changes);
        self.swaps += other.swaps;
        self.halves.iter_mut().zip(other.halves).for_each(|(a, b)| a.merge(b));
        self.whereabouts.iter_mut().zip(&other.whereabouts).for_each(|(a, b)| a.merge(b));
        self.luminance.merge(other.luminance);
        self.longest_rejection = self.longest_rejection.max(other.longest_rejection);
    }
}

/// Σ of ln g over states in steps of 2⁻³⁰ nat, which do not depend on the order of addition, and the number of states.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct LnMean {
    sum: i128,
    states: u64,
}

/// 2³⁰.
const NAT_STEPS: f64 = (1u64 << 30) as f64;

impl LnMean {
    /// Adds a lit state.
    #[inline(always)]
    pub fn add(&mut self, ln_g: f64) {
        self.sum += i128::from((ln_g * NAT_STEPS) as i64);
        self.states += 1;
    }

    fn merge(&mut self, other: LnMean) {
        self.sum += other.sum;
        self.states += other.states;
    }

    /// Mean of ln g; nothing without states.
    pub fn mean(self) -> Option<f64> {
        (self.states > 0).then(|| self.sum as f64 / NAT_STEPS / self.states as f64)
    }
}

/// A [`Tally`] as it is saved: between sweeps, when all its splats are on the film.
#[derive(Serialize, Deserialize)]
pub struct SavedTally {
    histograms: Vec<Histogram>,
    counts: Vec<RungCounts>,
    hot: Sum,
    even: Sum,
    tempered: Sum,
}

/// What was seen since it was last emptied.
#[derive(Clone, Debug)]
pub struct Tally {
    /// ln g by rung: of uniform points first, then of states with their expected weights.
    pub histograms: Vec<Histogram>,
    /// Counts by rung; of the uniform rung only the luminance.
    pub counts: Vec<RungCounts>,
    /// Splats not yet on the film.
    pub splats: Splats,
    probes: Splats,
    /// What uniform points added to the balanced image, since ever or since it was taken.
    pub hot: Sum,
    /// The whole luminance of stratified points.
    even: Sum,
    /// The same as `hot` of tempered states, since ever.
    pub tempered: Sum,
    /// The half of the round at work.
    pub half: usize,
    /// S of the outcomes of one open point.
    mixtures: Vec<f64>,
}

impl SavedTally {
    /// Adds what another one saw.
    pub fn merge(&mut self, other: &SavedTally) {
        self.histograms.iter_mut().zip(&other.histograms).for_each(|(sum, h)| sum.merge(h));
        self.counts.iter_mut().zip(&other.counts).for_each(|(sum, counts)| sum.add(counts));
        self.hot.merge(other.hot);
        self.even.merge(other.even);
        self.tempered.merge(other.tempered);
    }
}

impl Tally {
    /// For a ladder of `rungs` and a film of `layers`.
    pub fn new(rungs: usize, layers: usize) -> Tally {
        Tally {
            histograms: vec![Histogram::default(); rungs],
            counts: vec![RungCounts::default(); rungs],
            splats: Splats::new(layers),
            probes: Probes::splats(),
            hot: Sum::default(),
            even: Sum::default(),
            tempered: Sum::default(),
            half: 0,
            mixtures: Vec::new(),
        }
    }

    /// All that there is to save once splats are deposited.
    pub fn saved(&self) -> SavedTally {
        debug_assert!(self.splats.is_empty() && self.probes.is_empty(), "splats are deposited before state is saved");
        let Tally { histograms, counts, hot, even, tempered, .. } = self;
        SavedTally {
            histograms: histograms.clone(),
            counts: counts.clone(),
            hot: *hot,
            even: *even,
            tempered: *tempered,
        }
    }

    /// Takes what was saved, of a ladder of as many rungs.
    pub fn restore(&mut self, saved: SavedTally) -> Result<(), Unfit> {
        let SavedTally { histograms, counts, hot, even, tempered } = saved;
        expect([histograms.len(), counts.len()] == [self.histograms.len(); 2], "rungs")?;
        (self.histograms, self.counts) = (histograms, counts);
        (self.hot, self.even, self.tempered) = (hot, even, tempered);
        Ok(())
    }

    /// Forgets all that is saved.
    pub fn forget(&mut self) {
        self.histograms.fill(Histogram::default());
        self.reset_counts();
        [self.hot, self.even, self.tempered] = [Sum::default(); 3];
    }

    /// Records a uniform point; the film counts dark ones too. Probes are for `stratified` ones, the usual kind, where there
    /// are any: offered ones are noisier.
    #[inline(always)]
    pub fn uniform_point(&mut self, canvas: &Canvas, round: &Round, point: Whole, stratified: bool) {
        let luminance = point.main.luminance();
        self.histograms[0].add(point.main.ln_g, 1.0);
        let mixture = if point.main.is_dark() { 0.0 } else { round.weights.mixture(point.main.ln_g) };
        let size = canvas.size.map(|n| n as f32);
        let mut recorder = Recorder { footprint: canvas.footprint, size, splats: &mut self.splats };
        if let Some(layer) = canvas.layers.uniform {
            layer.splat(&mut recorder, point, 1.0, 1.0);
        }
        if let Some(layer) = canvas.layers.even.filter(|_| stratified) {
            layer.splat(&mut recorder, point, 1.0, 1.0);
        }
        if stratified {
            self.even.add(luminance / canvas.unit, 1.0);
        }
        if let Some(layer) = canvas.layers.hot {
            let [effort, _] = round.effort;
            let share = effort * round.weights.uniform(mixture);
            layer.splat(&mut recorder, point, share, effort);
            let shown = share * luminance / canvas.unit;
            self.counts[0].luminance.add(shown, effort);
            self.hot.add(shown, effort);
        }
        if stratified || round.only_offers {
            for (part, points) in point.parts().zip(std::iter::once(1.0).chain(std::iter::repeat(0.0))) {
                let Some(probe) = canvas.probe(part.film) else { continue };
                let g = part.luminance();
                let value = |ratio| g * round.weights.uniform_with(ratio, mixture);
                Probes::uniform(&mut self.probes, probe, value, round.weights.uniform_with(1.0, mixture), points);
            }
        }
    }

    /// Records a uniform point that serves chains only, not the image.
    pub fn only_seen(&mut self, point: Whole) {
        self.histograms[0].add(point.main.ln_g, 1.0);
    }

    /// Records a stratified point at `film` that leaves its choice open, with all outcomes.
    ///
    /// Every outcome is weighed as a chain's state is that chooses it, so that the shares of both sum to one technique by
    /// technique.
    pub fn open_point(&mut self, canvas: &Canvas, round: &Round, film: [f32; 2], outcomes: &[Outcome]) {
        let mut lit = 0.0;
        for outcome in outcomes.iter().filter(|outcome| outcome.ln_g > f64::NEG_INFINITY) {
            let chance = f64::from(outcome.chance);
            self.histograms[0].add(outcome.ln_g, chance);
            lit += chance;
        }
        self.histograms[0].add_dark(1.0 - lit);
        self.mixtures.clear();
        self.mixtures.extend(outcomes.iter().map(|outcome| match outcome.ln_g {
            f64::NEG_INFINITY => 0.0,
            ln_g => round.weights.mixture(ln_g),
        }));
        let mixtures = &self.mixtures;
        let luminance: f64 = outcomes.iter().map(|outcome| outcome.splat.luminance()).sum();
        self.even.add(luminance / canvas.unit, 1.0);
        let size = canvas.size.map(|n| n as f32);
        let mut recorder = Recorder { footprint: canvas.footprint, size, splats: &mut self.splats };
        let pair = |layer: PointLayer| [layer.own, layer.elsewhere.unwrap_or(layer.own)];
        for layer in canvas.layers.uniform.into_iter().chain(canvas.layers.even) {
            recorder.splat_outcomes(pair(layer), film, outcomes, |_| 1.0, 1.0);
        }
        if let Some(layer) = canvas.layers.hot {
            let [effort, _] = round.effort;
            let share = |i: usize| effort * round.weights.uniform(mixtures[i]);
            recorder.splat_outcomes(pair(layer), film, outcomes, share, effort);
            let sum: f64 = outcomes.iter().enumerate().map(|(i, outcome)| share(i) * outcome.splat.luminance()).sum();
            self.counts[0].luminance.add(sum / canvas.unit, effort);
            self.hot.add(sum / canvas.unit, effort);
        }
        if let Some(probe) = canvas.probe(film) {
            Probes::uniform(&mut self.probes, probe, |_| 0.0, 0.0, 1.0);
        }
        for (outcome, mixture) in outcomes.iter().zip(mixtures) {
            let Some(probe) = canvas.probe(outcome.splat.film) else { continue };
            let g = outcome.splat.luminance();
            let value = |ratio| g * round.weights.uniform_with(ratio, *mixture);
            Probes::uniform(&mut self.probes, probe, value, round.weights.uniform_with(1.0, *mixture), 0.0);
        }
    }

    /// Records a state on tempered rung `k`, counted from 1, with its expected weight.
    #[inline(always)]
    pub fn state(&mut self, canvas: &Canvas, round: &Round, k: usize, state: Whole, weight: f64) {
        let ln_g = state.main.ln_g;
        self.histograms[k].add(ln_g, weight);
        let size = canvas.size.map(|n| n as f32);
        let mut recorder = Recorder { footprint: canvas.footprint, size, splats: &mut self.splats };
        let on_target = k + 1 == round.ladder.rungs();
        if on_target {
            self.counts[k].whereabouts[self.half].add(state, weight);
        }
        if let Some(layer) = canvas.layers.target.filter(|_| on_target) {
            recorder.splat(layer, state, round.weights.target(ln_g) * weight, weight);
        }
        let Some(layer) = canvas.layers.tempered else { return };
        let mixture = round.weights.mixture(ln_g);
        let [_, effort] = round.effort;
        let value = effort * weight * round.weights.tempered(mixture);
        recorder.splat(layer, state, value, effort * weight);
        if let Some(first) = canvas.layers.rungs {
            recorder.splat(first + k - 1, state, value, effort * weight);
        }
        let shown = value * state.main.luminance() / canvas.unit;
        self.counts[k].luminance.add(shown, effort * weight);
        self.tempered.add(shown, effort * weight);
        for part in state.parts() {
            let Some(probe) = canvas.probe(part.film) else { continue };
            let g = part.luminance();
            let value = |ratio| g * round.weights.tempered_with(ratio, mixture);
            // where points leave their choice open, an outcome adds what it does times its chance, 1/chance times as often
            let open = if round.open { f64::from(state.main.chance).sqrt() } else { 1.0 };
            let uniform = |ratio| open * g * round.weights.uniform_with(ratio, mixture);
            let even = round.weights.tempered_with(1.0, mixture);
            Probes::tempered(&mut self.probes, probe, weight, value, uniform, even);
        }
    }

    /// Puts what was splatted onto the film, and into that half and trial of the probes.
    pub fn deposit(&mut self, canvas: &Canvas, half: usize, trial: Option<usize>) {
        canvas.film.deposit(&mut self.splats);
        match canvas.probes {
            Some((_, probes)) => probes.deposit(half, trial, &mut self.probes),
            None => self.probes.clear(),
        }
    }

    /// Empties the counts of a round.
    pub fn reset_counts(&mut self) {
        self.counts.fill(RungCounts::default());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        film::Filter,
        path::{Contribution, Elsewhere, FilmSplat},
        scene::Rgb,
        tempering::probes::EVEN,
    };

    /// A film of two pixels, probed both, and a point that gives 1 to the first, where it lies, and 1 + 2 to the second:
    /// g = 4, so that with ζ = ρ = 1 it counts 1/5 in the balanced image.
    #[test]
    fn parts_of_a_point_go_where_they_belong_and_count_as_one_point() {
        let (map, footprint, groups) = (ProbeMap::new([2, 1]), Footprint::new(Filter::Box, 2, 1), PointGroups::new(1));
        let layers = Layers::of(&Choices::default(), 2, true);
        let (film, probes) = (Accumulator::new(2, 1, layers.count, 1.0), Probes::new(&map, 1.0));
        let canvas = Canvas {
            footprint: &footprint,
            size: [2, 1],
            film: &film,
            unit: 1.0,
            layers,
            probes: Some((&map, &probes)),
            groups: &groups,
        };
        let ladder = Ladder::even(2);
        let round = Round {
            weights: Weights::new(&ladder, &[0.0; 2], 1.0, 0.0),
            ladder,
            mixes: std::array::from_fn(|_| Vec::new()),
            effort: [2.0, 0.5],
            only_offers: false,
            open: false,
            half: u64::MAX,
        };
        let mut elsewhere = Elsewhere::new(1);
        for value in [1.0, 2.0] {
            elsewhere.push(0, FilmSplat { film: [0.75, 0.5], rgb: Rgb::splat(value) });
        }
        let (main, _) = Contribution::settle_whole([0.25, 0.5], Rgb::splat(1.0), &mut elsewhere, 0);
        let whole = Whole { main: &main, elsewhere: elsewhere.of(0) };
        let mut tally = Tally::new(2, layers.count);
        tally.uniform_point(&canvas, &round, whole, true);
        tally.state(&canvas, &round, 1, whole, 0.5);
        tally.deposit(&canvas, 0, None);

        // value and weight of both pixels
        let near = |got: [[f64; 2]; 2], expected: [[f64; 2]; 2], what: &str| {
            let close = got.as_flattened().iter().zip(expected.as_flattened()).all(|(a, b)| (a - b).abs() < 1e-6);
            assert!(close, "{what}: {got:?} in the place of {expected:?}");
        };
        let layer = |layer: usize| [0, 1].map(|i| [film.layer(layer)[i][0], film.layer(layer)[i][3]]);
        let (even, hot) = (layers.even.unwrap(), layers.hot.unwrap());
        near(layer(even.own), [[1.0, 1.0], [0.0, 0.0]], "stratified points");
        near(layer(even.elsewhere.unwrap()), [[0.0, 0.0], [3.0, 0.0]], "what they give elsewhere");
        near(layer(hot.own), [[0.4, 2.0], [0.0, 0.0]], "balanced points");
        near(layer(hot.elsewhere.unwrap()), [[0.0, 0.0], [1.2, 0.0]], "what they give elsewhere");
        near(layer(layers.tempered.unwrap()), [[0.05, 0.25], [0.15, 0.0]], "states");
        // a quarter and three quarters of the state's luminance, which is on the target, by cells of four columns
        let shares = tally.counts[1].whereabouts[0].means().expect("a state on the target");
        near([[shares[9], shares[11]], [0.0; 2]], [[0.25, 0.75], [0.0; 2]], "where states are");
        let probed = |ratio, of: [usize; 2]| [0, 1].map(|probe| of.map(|i| probes.sums(ratio).0[probe][0][i]));
        near(probed(0, [0, 2]), [[1.0, 1.0], [3.0, 0.0]], "points and their number in probes");
        near(probed(EVEN, [1, 3]), [[0.1, 0.02], [0.3, 0.5 * (0.04 + 0.16)]], "states and their squares in probes");
        assert!(
            (tally.counts[0].luminance.values().0 - 1.6).abs() < 1e-6
                && (tally.counts[1].luminance.values().0 - 0.2).abs() < 1e-6
        );
    }

    #[test]
    fn layers_for_what_goes_elsewhere_are_there_only_if_wanted() {
        for layers in [false, true] {
            for combine in Combine::ALL {
                let choices = Choices { combine, layers, ..Choices::default() };
                let [without, with] = [false, true].map(|elsewhere| Layers::of(&choices, 3, elsewhere));
                let points = |layers: Layers| [layers.uniform, layers.even, layers.hot].into_iter().flatten();
                assert_eq!(with.count - without.count, points(with).count());
                assert!(points(without).all(|layer| layer.elsewhere.is_none()));
                assert!(points(with).all(|layer| layer.elsewhere.is_some()));
            }
        }
    }
}
