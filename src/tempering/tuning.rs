//! Which weights serve the image best, and how evaluations are shared out: by measured error and cost.
//!
//! Let a round have drawn N_u uniform points and N_t states of chains, and let the image be made with what a state
//! counts for, ρ, in the balance heuristic. Its error is U/N_u + T/N_t, with U the variance of what one uniform point
//! adds and T that of one state times the correlation of the chain, both summed over pixels in the measure of the
//! error. With c_u and c_t the costs of an evaluation of each kind, the error at unit cost is
//!
//! E(f) = (U/f + T/(1 − f)) (f c_u + (1 − f) c_t),
//!
//! f the share of uniform points; its least value (√(U c_u) + √(T c_t))² lies where f/(1 − f) = √(U c_t / (T c_u))
//! (Neyman's allocation). U and T are measured for each of several ρ at once, from the difference of the two halves of
//! the [`Probes`](super::Probes); ρ = 0 is path tracing, E = U c_u. Costs are counted in rays, not in seconds, so that
//! the same job makes the same choices everywhere.

use super::probes::RATIOS;

/// What a round has measured.
pub struct Measured<'a> {
    /// By ratio and probe: the two halves' Σ over uniform points, Σ over states and number of uniform points.
    pub probes: Vec<Vec<[[f64; 3]; 2]>>,
    /// Number of pixels of the film.
    pub pixels: f64,
    /// Uniform points of the round, and chain states.
    pub points: f64,
    /// See `points`.
    pub states: f64,
    /// What a half's Σ over states is multiplied by to be an image: pixels · Ẑ_K/unit over its samples a rung.
    pub tempered_scale: [f64; 2],
    /// (standard error/value)² of Ẑ_K.
    pub normaliser_variance: f64,
    /// c, the mean of the image.
    pub mean: f64,
    /// Cost of an evaluation on the uniform rung and on the others.
    pub cost: [f64; 2],
    /// The shares that may be chosen.
    pub shares: &'a std::ops::RangeInclusive<f64>,
}

/// What serves best.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Choice {
    /// ρ; 0 for path tracing.
    pub ratio: f64,
    /// Share of evaluations that are uniform points.
    pub share: f64,
    /// Error at unit cost over that of path tracing.
    pub relative_error: f64,
}

/// Pixels count by 1/(I² + (c/2)²), I their luminance: close to the relative error where it is bright, to the absolute
/// one where it is darker than half the mean.
const FLOOR: f64 = 0.5;

impl Measured<'_> {
    /// The best choice; path tracing where nothing was seen or nothing is better.
    pub fn choose(&self) -> Choice {
        let path = self.variances(0)[0] * self.cost[0];
        let mut best = Choice { ratio: 0.0, share: 1.0, relative_error: 1.0 };
        let path_allowed = *self.shares.end() >= 1.0;
        if path == 0.0 {
            return Choice { ratio: RATIOS[RATIOS.len() - 2], share: self.shares.end().min(0.5), relative_error: 1.0 };
        }
        if !path_allowed {
            best.relative_error = f64::INFINITY;
        }
        for (i, ratio) in RATIOS.into_iter().enumerate().skip(1) {
            let [u, t] = self.variances(i);
            let [cost_u, cost_t] = self.cost;
            let odds = ((u * cost_t) / (t * cost_u)).sqrt();
            // all the variance on one side, as for a constant, gives no odds
            let share = if odds.is_finite() { odds / (1.0 + odds) } else { *self.shares.end() };
            let share = share.clamp(*self.shares.start(), self.shares.end().min(MOST_WITH_CHAINS));
            let error = (u / share + t / (1.0 - share)) * (share * cost_u + (1.0 - share) * cost_t) / path;
            if error < best.relative_error {
                best = Choice { ratio, share, relative_error: error };
            }
        }
        best
    }

    /// U and T with the ratio number `i`.
    fn variances(&self, i: usize) -> [f64; 2] {
        let [mut u, mut t] = [0.0; 2];
        let mut both = 0.0;
        for halves in &self.probes[i] {
            let [hot, tempered] = [0, 1].map(|part: usize| {
                [0, 1].map(|half: usize| match part {
                    0 => halves[half][0] / halves[half][2],
                    _ => halves[half][1] * self.tempered_scale[half],
                })
            });
            let counts = halves.map(|half| half[2]);
            if counts.contains(&0.0) {
                continue;
            }
            both += 1.0;
            let mean = |[a, b]: [f64; 2]| 0.5 * (a + b);
            let luminance = (hot[0] * counts[0] + hot[1] * counts[1]) / (counts[0] + counts[1]) + mean(tempered);
            let importance = 1.0 / (luminance * luminance + (FLOOR * self.mean).powi(2));
            // per point: a half of n points has n times less variance
            u += importance * (hot[0] - hot[1]).powi(2) / (1.0 / counts[0] + 1.0 / counts[1]);
            let spread = (tempered[0] - tempered[1]).powi(2) / 4.0;
            t += importance * (spread + self.normaliser_variance * mean(tempered).powi(2)) * self.states;
        }
        if both == 0.0 {
            return [0.0; 2];
        }
        [u * self.pixels / both, t / both]
    }
}

/// Chains that are to have any say get this share at least.
const MOST_WITH_CHAINS: f64 = 31.0 / 32.0;
