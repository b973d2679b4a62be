//! A target whose normalisers and states are known exactly, for the tests of this folder.

use super::Histogram;
use crate::rng::{Counter, Purpose, Rng, open_unit_f64};

/// g(x) = e^{offset + s x} on [0, 1]: Z(β) = e^{β offset} (e^{βs} − 1)/(βs).
pub struct Exponential {
    /// Range of ln g; may be negative.
    pub s: f64,
    /// ln g at x = 0.
    pub offset: f64,
}

impl Exponential {
    /// ln Z(β).
    pub fn ln_z(&self, beta: f64) -> f64 {
        let t = beta * self.s;
        beta * self.offset
            + if t == 0.0 {
                0.0
            } else if t > 500.0 {
                t - t.ln()
            } else {
                (t.exp_m1() / t).ln()
            }
    }

    /// `n` exact draws from g^β by inversion, in runs of `repeats` equal ones on average (geometric, as a chain that
    /// rejects would have them), with stream `stream` of random numbers.
    pub fn draws(&self, beta: f64, n: u64, repeats: u64, stream: u32) -> Histogram {
        let mut h = Histogram::default();
        let mut ln_g = None;
        for step in 0..n {
            let c = Counter { ladder: stream, replica: 0, step, purpose: Purpose::Primary };
            let words = Rng::new(5).words(c, 0);
            let fresh = (f64::from(words[2]) / 2f64.powi(32)) * (repeats as f64) < 1.0;
            let old = ln_g.filter(|_| !fresh);
            let now = old.unwrap_or_else(|| {
                let u = open_unit_f64(words[0]);
                let t = beta * self.s;
                let x = if t == 0.0 {
                    u
                } else if t > 500.0 {
                    (1.0 + u.ln() / t).max(0.0)
                } else {
                    (u * t.exp_m1()).ln_1p() / t
                };
                self.offset + self.s * x
            });
            h.add(now, 1.0);
            ln_g = Some(now);
        }
        h
    }

    /// Histograms of `groups` independent groups with `n` states a rung; those of tempered rungs come in runs of
    /// `repeats`.
    pub fn groups(&self, betas: &[f64], groups: u32, n: u64, repeats: u64, run: u32) -> Vec<Vec<Histogram>> {
        let rung = |group: u32, (k, beta): (usize, &f64)| {
            let stream = (run * 1000 + group) * betas.len() as u32 + k as u32;
            self.draws(*beta, n, if k == 0 { 1 } else { repeats }, stream)
        };
        (0..groups).map(|group| betas.iter().enumerate().map(|b| rung(group, b)).collect()).collect()
    }
}

/// Groups as the estimators take them.
pub fn slices(groups: &[Vec<Histogram>]) -> Vec<&[Histogram]> {
    groups.iter().map(Vec::as_slice).collect()
}
