//! What the statistics of all rungs say.

use crate::tempering::{DensityOfStates, Estimate, Histogram, Ladder, Normalisers, stepping_stones, uniform_mean};

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
}

impl Learnt {
    /// From the histograms of independent groups.
    pub(super) fn of(ladder: &Ladder, groups: &[Vec<Histogram>], luminance: Luminance) -> Learnt {
        let groups: Vec<&[Histogram]> = groups.iter().map(Vec::as_slice).collect();
        let normalisers = Normalisers::solve(ladder, &groups);
        Learnt {
            uniform: uniform_mean(&groups),
            stepping_stones: stepping_stones(ladder.betas(), &groups),
            density: DensityOfStates::new(ladder, &groups, &normalisers),
            luminance: luminance.estimate(&normalisers.target),
            normalisers,
        }
    }

    /// Says when the two estimates of c contradict each other: what the chains do not find, MBAR does not count.
    pub fn warnings(&self) -> Vec<String> {
        let (uniform, mbar) = (self.uniform, self.normalisers.target);
        if self.normalisers.disagreement.is_nan() || self.normalisers.disagreement <= ALARMING {
            return Vec::new();
        }
        vec![format!(
            "the uniform replica alone estimates ln c = {:.4} ± {:.4}, all replicas together {:.4} ± {:.4}: chains may not \
             find all of the light; render longer or compare with --method path",
            uniform.ln_value, uniform.relative_error, mbar.ln_value, mbar.relative_error
        )]
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
