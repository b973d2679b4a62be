//! What a round of replica exchange came to: all that says whether the ladder works, and what was made of it.
//!
//! A report is one line of the run log. JSON has neither NaN nor infinities: such numbers are written as `null` and
//! read back as NaN, which everywhere here means "not known".

use serde::{Deserialize, Deserializer, Serialize};

/// Diagnostics of one round.
///
/// Counts and rates are those of the round alone unless they say "so far". K is the number of rungs; rungs and pairs
/// are in order from the uniform rung (β = 0) to the target (β = 1). Lists of rungs have K entries, lists of pairs
/// K − 1; both are empty where nothing was measured, as at the end of the bootstrap.
#[derive(Serialize, Deserialize, Clone, Debug, Default, PartialEq)]
pub struct RoundReport {
    /// Number of the round; 0 is the bootstrap, which draws uniform points only.
    pub round: u32,
    /// Sweeps of the run so far, the bootstrap's included; a sweep moves every replica of every ladder once.
    pub sweeps: u64,
    /// Evaluations of paths so far, uniform points included.
    pub mutations: u64,
    /// Independent ladders side by side.
    pub ladders: usize,
    /// Replicas on a ladder, K, the uniform one included.
    pub replicas: usize,
    /// Inverse temperatures β_k of the round, rising from 0 to 1.
    pub betas: Vec<f64>,
    /// ln Ẑ_k by rung, Ẑ_k the estimate of Z(β_k) = ∫ g^β_k from all samples so far; Ẑ_1 = 1. NaN for a rung that no
    /// lit state has reached.
    #[serde(deserialize_with = "or_nan")]
    pub ln_z: Vec<f64>,
    /// p_s = Z(0⁺), the share of the cube of primary samples where g > 0, from all uniform points so far; 0 to 1.
    #[serde(deserialize_with = "or_nan")]
    pub lit_share: f64,
    /// Communication barrier Λ = ∫₀¹ λ(β) dβ ≥ 0 given g > 0: the sum of rejection probabilities over the pairs of a
    /// ladder with very many rungs (Syed et al. 2021, section 4).
    #[serde(deserialize_with = "or_nan")]
    pub barrier: f64,
    /// [β, Λ(β)], Λ(β) = ∫₀^β λ the cumulative barrier, rising from 0 to Λ; β ascending.
    #[serde(deserialize_with = "or_nan")]
    pub barrier_curve: Vec<[f64; 2]>,
    /// [β, λ(β)], λ(β) = ½ E|ℓ − ℓ′| ≥ 0 for independent ℓ, ℓ′ = ln g at β: rejection per unit of β; β ascending.
    #[serde(deserialize_with = "or_nan")]
    pub local_barrier: Vec<[f64; 2]>,
    /// Mean rejection probability of the swaps of each pair, 0 to 1, as measured. The first pair's counts dark offers
    /// as well, which are always rejected.
    #[serde(deserialize_with = "or_nan")]
    pub rejection: Vec<f64>,
    /// The same, 1 − E min(1, e^{(β′ − β)(ℓ − ℓ′)}) for independent states, as computed beforehand from the density of
    /// states; 0 to 1. Far below the measured one where chains do not move freely between swaps.
    #[serde(deserialize_with = "or_nan")]
    pub predicted_rejection: Vec<f64>,
    /// Times that a replica went from the uniform rung to the target and back, over all ladders.
    pub round_trips: u64,
    /// Times that a state drawn on the uniform rung reached the target, over all ladders.
    pub restarts: u64,
    /// Round trips to be expected in as many sweeps where chains move freely between swaps:
    /// ladders · sweeps measured / (2 + 2 Σ r/(1 − r)), r the measured rejections (Syed et al. 2021, section 3.5).
    #[serde(deserialize_with = "or_nan")]
    pub round_trips_predicted: f64,
    /// Most mutations in a row that one chain rejected.
    pub longest_rejection_run: u64,
    /// Estimates of c = Z(1), the mean of g, from all samples so far.
    pub normalisers: NormaliserEstimates,
    /// The one of them that scales the image.
    pub used: Normaliser,
    /// Share of the round's evaluations that were uniform points, 0 to 1.
    #[serde(deserialize_with = "or_nan")]
    pub uniform_share: f64,
    /// Independent points offered to a ladder each sweep.
    pub offers: u64,
    /// ρ: what a state of a chain counts for beside a uniform point in the balance heuristic; 0 to 1, below 1 because
    /// states of a chain are correlated.
    #[serde(deserialize_with = "or_nan")]
    pub chain_ratio: f64,
    /// Split R̂ of block means of ln g on the target over the ladders (Gelman et al. 2013, section 11.4): 1 where
    /// ladders agree, above 1.01 where they have not forgotten their starts.
    #[serde(deserialize_with = "or_nan")]
    pub split_r_hat: f64,
    /// The same of the shares that blocks of the image, four by four, have of the states on the target; NaN in logs that do not
    /// tell.
    #[serde(default = "unknown", deserialize_with = "or_nan")]
    pub split_r_hat_image: f64,
    /// Halves of blocks of ladders that it compares; 0 in logs that do not tell.
    #[serde(default)]
    pub r_hat_halves: usize,
    /// Contributions so far that were not finite and were taken as zero.
    pub non_finite: u64,
    /// Rays traced so far, both kinds.
    pub rays: u64,
    /// Rung by rung.
    pub rungs: Vec<RungReport>,
    /// For a few replicas of the first ladder: the rung (from 0, the uniform one) at evenly spaced sweeps of the round.
    pub index_process: Vec<Vec<u16>>,
    /// Sweeps between two entries of a replica in `index_process`.
    pub index_stride: u64,
    /// What was chosen for the next round and why, one sentence each.
    pub choices: Vec<String>,
    /// Share of the final image that comes from rounds before the settings were frozen, 0 to 1; absent while they are
    /// not.
    pub image_share_before: Option<f64>,
}

/// Diagnostics of one rung in one round.
#[derive(Serialize, Deserialize, Clone, Debug, Default, PartialEq)]
pub struct RungReport {
    /// Inverse temperature β, 0 to 1.
    #[serde(deserialize_with = "or_nan")]
    pub beta: f64,
    /// Evaluations of paths on this rung, over all ladders.
    pub evaluations: u64,
    /// Mean acceptance probability of mutations, 0 to 1; NaN on the uniform rung, which has none.
    #[serde(deserialize_with = "or_nan")]
    pub acceptance: f64,
    /// The scales of small steps, smallest first; empty on the uniform rung.
    pub scales: Vec<ScaleReport>,
    /// Mean of ln g over lit states.
    #[serde(deserialize_with = "or_nan")]
    pub mean_ln_g: f64,
    /// Standard deviation of ln g over lit states.
    #[serde(deserialize_with = "or_nan")]
    pub sd_ln_g: f64,
    /// Share of states with g = 0, 0 to 1; above 0 on the uniform rung and while chains have not started.
    #[serde(deserialize_with = "or_nan")]
    pub dark_share: f64,
    /// τ of the image: variance between ladders of this rung's image on coarse blocks, over that of as many independent
    /// samples; 1 for independent samples. Absent where it was not measured.
    pub tau_image: Option<f64>,
    /// τ of lineages: Σt²/Σt over the sweeps t that states descended from one uniform draw spent here; at least 1,
    /// in sweeps. Absent where it was not measured.
    pub tau_lineage: Option<f64>,
    /// Effective number of samples for the image, at most `evaluations`.
    #[serde(deserialize_with = "or_nan")]
    pub effective: f64,
    /// Share of the image's luminance so far that samples of this rung carry, 0 to 1; the rungs' sum to 1.
    #[serde(deserialize_with = "or_nan")]
    pub image_share: f64,
}

/// Small steps of one size on one rung.
#[derive(Serialize, Deserialize, Clone, Debug, Default, PartialEq)]
pub struct ScaleReport {
    /// Centre of the distribution of step sizes, as a fraction of the unit interval, 0 to ½.
    #[serde(deserialize_with = "or_nan")]
    pub size: f64,
    /// Probability of choosing this scale for a mutation; a rung's sum to 1.
    #[serde(deserialize_with = "or_nan")]
    pub weight: f64,
    /// Mean acceptance probability, 0 to 1.
    #[serde(deserialize_with = "or_nan")]
    pub acceptance: f64,
    /// Mutations of this scale.
    pub proposed: u64,
}

/// c by each method.
#[derive(Serialize, Deserialize, Clone, Debug, Default, PartialEq)]
pub struct NormaliserEstimates {
    /// Mean of g over uniform points; unbiased.
    pub uniform: LnEstimate,
    /// Π_k E_k[g^{β_{k+1} − β_k}], forward and backward averaged (Xie et al. 2011).
    pub stepping_stones: LnEstimate,
    /// Multistate Bennett acceptance ratio (Shirts & Chodera 2008) on pooled histograms.
    pub mbar: LnEstimate,
}

impl NormaliserEstimates {
    /// The estimate of that method.
    pub fn of(&self, normaliser: Normaliser) -> &LnEstimate {
        match normaliser {
            Normaliser::Uniform => &self.uniform,
            Normaliser::SteppingStones => &self.stepping_stones,
            Normaliser::Mbar => &self.mbar,
        }
    }
}

/// A method to estimate c.
#[derive(Serialize, Deserialize, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Normaliser {
    /// The mean over uniform points.
    #[default]
    #[serde(rename = "uniform")]
    Uniform,
    /// Ratios of neighbours.
    #[serde(rename = "stepping stones")]
    SteppingStones,
    /// All samples of all rungs at once.
    #[serde(rename = "mbar")]
    Mbar,
}

impl Normaliser {
    /// All methods, simplest first.
    pub const ALL: [Normaliser; 3] = [Normaliser::Uniform, Normaliser::SteppingStones, Normaliser::Mbar];

    /// What it is called in logs and pictures.
    pub fn name(self) -> &'static str {
        match self {
            Normaliser::Uniform => "uniform",
            Normaliser::SteppingStones => "stepping stones",
            Normaliser::Mbar => "mbar",
        }
    }
}

/// An estimate of a positive number.
#[derive(Serialize, Deserialize, Clone, Copy, Debug, PartialEq)]
pub struct LnEstimate {
    /// Its natural logarithm; NaN as long as there is none.
    #[serde(deserialize_with = "or_nan")]
    pub ln_value: f64,
    /// Standard error over value, ≥ 0, from independent groups of ladders; NaN where there are fewer than two.
    #[serde(deserialize_with = "or_nan")]
    pub relative_error: f64,
}

impl Default for LnEstimate {
    /// Not known.
    fn default() -> LnEstimate {
        LnEstimate { ln_value: f64::NAN, relative_error: f64::NAN }
    }
}

impl LnEstimate {
    /// The number itself.
    pub fn value(&self) -> f64 {
        libm::exp(self.ln_value)
    }

    /// Its standard error.
    pub fn standard_error(&self) -> f64 {
        self.value() * self.relative_error
    }
}

/// What logs that do not tell a number say of it.
fn unknown() -> f64 {
    f64::NAN
}

/// Reads numbers, and `null` as NaN.
fn or_nan<'de, D: Deserializer<'de>, T: Nullable>(deserializer: D) -> Result<T, D::Error> {
    T::Json::deserialize(deserializer).map(T::from_json)
}

/// Something made of f64 that JSON holds with `null` for what is not finite.
trait Nullable {
    type Json: for<'de> Deserialize<'de>;
    fn from_json(json: Self::Json) -> Self;
}

impl Nullable for f64 {
    type Json = Option<f64>;
    fn from_json(json: Option<f64>) -> f64 {
        json.unwrap_or(f64::NAN)
    }
}

impl<T: Nullable> Nullable for Vec<T> {
    type Json = Vec<T::Json>;
    fn from_json(json: Vec<T::Json>) -> Vec<T> {
        json.into_iter().map(T::from_json).collect()
    }
}

impl Nullable for [f64; 2] {
    type Json = [Option<f64>; 2];
    fn from_json(json: [Option<f64>; 2]) -> [f64; 2] {
        json.map(f64::from_json)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_known_is_null_and_reads_back_as_nan() {
        let report = RoundReport {
            ln_z: vec![0.0, f64::NEG_INFINITY],
            barrier_curve: vec![[0.0, f64::NAN], [1.0, 2.5]],
            rungs: vec![RungReport { acceptance: f64::NAN, tau_image: Some(2.5), ..RungReport::default() }],
            used: Normaliser::SteppingStones,
            ..RoundReport::default()
        };
        let text = serde_json::to_string(&report).unwrap();
        for part in [r#""ln_z":[0.0,null]"#, "[0.0,null],[1.0,2.5]", r#""used":"stepping stones""#] {
            assert!(text.contains(part), "{part} is not in {text}");
        }
        let read: RoundReport = serde_json::from_str(&text).unwrap();
        assert!(read.ln_z[1].is_nan() && read.rungs[0].acceptance.is_nan() && read.normalisers.mbar.ln_value.is_nan());
        assert_eq!((read.rungs[0].tau_image, read.rungs[0].tau_lineage), (Some(2.5), None));
        // NaN equals nothing, so the second texts are compared
        assert_eq!(serde_json::to_string(&read).unwrap(), text);
    }

    #[test]
    fn every_digit_reads_back() {
        let report = RoundReport { barrier: 0.1 + 0.2, lit_share: f64::MIN_POSITIVE, ..RoundReport::default() };
        let read: RoundReport = serde_json::from_str(&serde_json::to_string(&report).unwrap()).unwrap();
        assert_eq!((read.barrier, read.lit_share), (report.barrier, report.lit_share));
    }

    #[test]
    fn a_missing_field_is_named() {
        let text = serde_json::to_string(&RoundReport::default()).unwrap().replace(r#""barrier":0.0,"#, "");
        let error = serde_json::from_str::<RoundReport>(&text).unwrap_err().to_string();
        assert!(error.contains("missing field `barrier`"), "{error}");
    }

    #[test]
    fn names_are_those_of_the_log() {
        for normaliser in Normaliser::ALL {
            assert_eq!(serde_json::to_value(normaliser).unwrap(), normaliser.name());
        }
    }
}
