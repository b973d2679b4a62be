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
    /// How g is spread over the cube.
    pub density: DensityOfStates,
}

impl Learnt {
    pub(super) fn of(ladder: &Ladder, groups: &[Vec<Histogram>]) -> Learnt {
        let groups: Vec<&[Histogram]> = groups.iter().map(Vec::as_slice).collect();
        let normalisers = Normalisers::solve(ladder, &groups);
        Learnt {
            uniform: uniform_mean(&groups),
            stepping_stones: stepping_stones(ladder.betas(), &groups),
            density: DensityOfStates::new(ladder, &groups, &normalisers),
            normalisers,
        }
    }

    /// Says when the two estimates of c contradict each other: what the chains do not find, MBAR does not count.
    pub fn warnings(&self) -> Vec<String> {
        let (uniform, mbar) = (self.uniform, self.normalisers.target);
        if !uniform.contradicts(&mbar) {
            return Vec::new();
        }
        vec![format!(
            "the uniform replica alone estimates a mean luminance of {:.4} ± {:.4}, all replicas together {:.4} ± {:.4}: \
             chains may not find all of the light; render longer or compare with --method path",
            uniform.value, uniform.standard_error, mbar.value, mbar.standard_error
        )]
    }
}
