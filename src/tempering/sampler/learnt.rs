//! What the statistics of all rungs say.

use crate::tempering::{
    DensityOfStates, Estimate, Histogram, Ladder, Normalisers, Tail, stepping_stones, uniform_mean,
};

/// What is known at the end of a round.
pub struct Learnt {
    /// ln Z of every rung, and c.
    pub normalisers: Normalisers,
    /// c from uniform points alone.
    pub uniform: Estimate,
    /// c along the ladder, rung by rung.
    pub stepping_stones: Estimate,
    /// Mean luminance of the balanced image.
    pub luminance: Estimate,
    /// How g is spread over the cube.
    pub density: DensityOfStates,
    /// How bright the brightest of uniform points are, where there are enough to tell.
    pub tail: Option<Tail>,
    /// All samples are uniform points.
    pub is_uniform: bool,
}

impl Learnt {
    /// From the histograms of independent groups.
    pub(super) fn of(ladder: &Ladder, groups: &[Vec<Histogram>], luminance: Luminance) -> Learnt {
        let groups: Vec<&[Histogram]> = groups.iter().map(Vec::as_slice).collect();
        let normalisers = Normalisers::solve(ladder, &groups);
        let mut points = Histogram::default();
        groups.iter().for_each(|group| points.merge(&group[0]));
        Learnt {
            tail: Tail::of(&points),
            is_uniform: ladder.rungs() == 1,
            uniform: uniform_mean(&groups),
            stepping_stones: stepping_stones(ladder.betas(), &groups),
            density: DensityOfStates::new(ladder, &groups, &normalisers),
            luminance: luminance.estimate(&normalisers.target),
            normalisers,
        }
    }

    /// What keeps the numbers from being trusted, one sentence each.
    pub fn warnings(&self) -> Vec<String> {
        self.contradiction().into_iter().chain(self.heavy_tail()).collect()
    }

    /// Says when errors come from uniform points alone and these have no variance; chains follow what is bright, and
    /// samples of theirs are bounded.
    fn heavy_tail(&self) -> Option<String> {
        let Tail { index, .. } = self.tail.filter(|tail| tail.is_heavy && self.is_uniform)?;
        Some(format!(
            "few paths carry most of the light: brightness has a tail of index {index:.2}, and from 0.5 on there is no \
             variance; errors that are told, also that of the mean brightness, are too small; --method re may find more"
        ))
    }

    /// Says when the two estimates of c contradict each other: what the chains do not find, MBAR does not count.
    fn contradiction(&self) -> Option<String> {
        let (uniform, mbar) = (self.uniform, self.normalisers.target);
        if self.normalisers.disagreement.is_nan() || self.normalisers.disagreement <= ALARMING {
            return None;
        }
        Some(format!(
            "the uniform replica alone estimates ln c = {:.4} ± {:.4}, all replicas together {:.4} ± {:.4}: chains may not \
             find all of the light; render longer or compare with --method path",
            uniform.ln_value, uniform.relative_error, mbar.ln_value, mbar.relative_error
        ))
    }
}

/// Standard errors of their difference by which the uniform mean and MBAR may differ.
const ALARMING: f64 = 3.0;

/// Where the mean luminance of the image comes from.
pub(super) enum Luminance {
    /// Mean luminances that uniform points and tempered states add to the balanced image, the latter in units of
    /// e^`ln_unit`.
    Balanced { hot: Estimate, tempered: Estimate, ln_unit: f64 },
    /// The mean over stratified points.
    Mean(Estimate),
    /// c itself.
    Normaliser,
}

impl Luminance {
    /// The estimate, with c known to be `target`. Balanced: hot + Ẑ · tempered. The errors of the first and of Ẑ come from
    /// the same uniform points and are added, which is more than they can be; that of the states is independent of them
    /// as far as chains forget their starts.
    fn estimate(self, target: &Estimate) -> Estimate {
        let (hot, tempered, ln_unit) = match self {
            Luminance::Balanced { hot, tempered, ln_unit } => (hot, tempered, ln_unit),
            Luminance::Mean(mean) => return mean,
            Luminance::Normaliser => return *target,
        };
        if tempered.value == 0.0 {
            return hot;
        }
        let scale = libm::exp(target.ln_value - ln_unit);
        let states = tempered.value * scale;
        let value = hot.value + states;
        let shared = hot.standard_error + states * target.relative_error;
        Estimate::from_ln(libm::log(value), shared.hypot(tempered.standard_error * scale) / value)
    }
}
