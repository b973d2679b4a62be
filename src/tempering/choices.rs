//! What may be chosen about a ladder.

use serde::{Deserialize, Serialize};

use crate::chain::Measure;

/// The rungs of the ladders.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LadderChoice {
    /// Their number follows from the communication barrier, and chains are given up where path tracing is best.
    #[default]
    Auto,
    /// So many, the uniform one included, placed at equal rejection.
    Replicas(u32),
    /// These inverse temperatures, rising from 0 to 1.
    Betas(Vec<f64>),
}

impl LadderChoice {
    /// As on the command line: `auto`, `4` or `0,0.5,1`.
    pub fn in_words(&self) -> String {
        match self {
            LadderChoice::Auto => "auto".into(),
            LadderChoice::Replicas(k) => k.to_string(),
            LadderChoice::Betas(betas) => betas.iter().map(f64::to_string).collect::<Vec<_>>().join(","),
        }
    }
}

/// How the estimates of the rungs become one image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Combine {
    /// All samples of all rungs, weighed by the balance heuristic: unbiased given the normalisers.
    #[default]
    Balance,
    /// Only the rung β = 1, times the normalisation.
    Target,
    /// Only the rung β = 0.
    Uniform,
    /// The paper's: the larger of `Target` and `Uniform` in each pixel and channel; biased.
    Max,
    /// The paper's power heuristic of the two; biased.
    Power,
    /// The paper's median heuristic of the two, with the sign that suppresses outliers; biased.
    Median,
    /// The same with the sign as the paper prints it; biased.
    MedianPrinted,
}

impl Combine {
    /// All of them, the default first.
    pub const ALL: [Combine; 7] = [
        Combine::Balance,
        Combine::Target,
        Combine::Uniform,
        Combine::Max,
        Combine::Power,
        Combine::Median,
        Combine::MedianPrinted,
    ];

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Combine::Balance => "balance",
            Combine::Target => "target",
            Combine::Uniform => "uniform",
            Combine::Max => "max",
            Combine::Power => "power",
            Combine::Median => "median",
            Combine::MedianPrinted => "median-printed",
        }
    }
}

/// Evaluations a pixel from which on stratified points leave open what they choose.
///
/// Chains first have to see two passes of open points. At 25 evaluations a pixel that leaves `caustic` with a relMSE of 0.18 in
/// the place of 0.07, which points that choose reach at 60 a pixel for the same cost (`relt render
/// scenes/caustic/scene.xml --mapping multiplexed --mpp 25 --seed 1`, to 3, with this constant 0; `--mpp 60`).
const OPEN_FROM: u64 = 256;

/// Everything that may be chosen about replica exchange.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Choices {
    /// The rungs.
    pub ladder: LadderChoice,
    /// How they become an image.
    pub combine: Combine,
    /// Share of evaluations that are uniform points, 0 < share < 1; tuned where absent.
    pub uniform_share: Option<f64>,
    /// The error that weights, shares and chains are to make small.
    pub measure: Measure,
    /// Keep E_u, E_e and every rung's part of the image.
    pub layers: bool,
}

impl Choices {
    /// Whether there are no replicas but the uniform one.
    pub fn is_uniform_alone(&self) -> bool {
        match &self.ladder {
            LadderChoice::Auto => false,
            LadderChoice::Replicas(replicas) => *replicas == 1,
            LadderChoice::Betas(betas) => betas.len() == 1,
        }
    }

    /// Whether stratified points of a run of so many evaluations (without end where absent) leave open what they choose, on a
    /// target where points choose among [outcomes](crate::chain::Target::has_outcomes): where the balance heuristic joins
    /// them to chains, and the run is long.
    pub fn opens(&self, evaluations: Option<u64>, pixels: u64) -> bool {
        let balances = self.combine == Combine::Balance && !self.is_uniform_alone();
        balances && evaluations.is_none_or(|n| n >= OPEN_FROM * pixels)
    }
}
