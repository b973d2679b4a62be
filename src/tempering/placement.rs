//! Where to place rungs, and how many.

use super::{DensityOfStates, Ladder};

impl DensityOfStates {
    /// A ladder of `rungs` inverse temperatures with equal predicted rejections between neighbours; the first pair's,
    /// with β = 0, is that of lit points (otherwise darkness would drive β₂ to 0).
    ///
    /// First Λ(β) is cut into equal parts (Syed et al. 2021), which is right for many rungs. Then the rungs
    /// move until the pairs' *lengths* √(−ln(1 − r²)) are equal, and with them r: along a ladder of Gaussian ln g that
    /// length is within 12 % of additive however far rungs are apart (r is erf of half the distance), and it is r where
    /// r is small. Equal steps where there is no barrier or nothing is known.
    ///
    /// # Panics
    /// If `rungs` is 0 or more than [`Ladder::LONGEST`].
    pub fn place(&self, rungs: usize) -> Ladder {
        /// Spread of lengths, relative to their mean, that is good enough.
        const EVEN: f64 = 1e-3;
        /// Least barrier that says anything; half the width of a bin.
        const NOTICEABLE: f64 = 1.0 / 128.0;
        const CORRECTIONS: usize = 40;
        let curve = self.barrier_curve();
        let barrier = curve[curve.len() - 1].1;
        if rungs <= 2 || barrier < NOTICEABLE {
            return Ladder::even(rungs);
        }
        let at = |places: &[f64]| Ladder::new(apart(places.iter().map(|p| interpolate(&curve, *p)).collect()));
        // a rung's place is its Λ(β)
        let mut places: Vec<f64> = (0..rungs).map(|k| barrier * k as f64 / (rungs - 1) as f64).collect();
        let mut best = (f64::INFINITY, at(&places));
        for _ in 0..CORRECTIONS {
            let ladder = at(&places);
            let lengths: Vec<f64> = self.acceptances(ladder.betas()).into_iter().map(length).collect();
            let mut travelled = vec![(0.0, 0.0)];
            for (length, place) in lengths.iter().zip(&places[1..]) {
                travelled.push((travelled[travelled.len() - 1].0 + length, *place));
            }
            let total = travelled[rungs - 1].0;
            let mean = total / (rungs - 1) as f64;
            let spread = lengths.iter().map(|l| (l / mean - 1.0).abs()).fold(0.0, f64::max);
            if spread < best.0 {
                best = (spread, ladder);
            }
            if best.0 < EVEN {
                break;
            }
            let inverse: Vec<(f64, f64)> = travelled.iter().map(|(t, p)| (*p, *t)).collect();
            places = (0..rungs).map(|k| interpolate(&inverse, total * k as f64 / (rungs - 1) as f64)).collect();
        }
        best.1
    }
}

/// A first guess at the number of rungs for a communication barrier Λ ≥ 0: ⌈2Λ⌉ + 1, of which neighbours reject about
/// half of their swaps, from 2 to 8. More rungs than that have not paid on test targets: the pilot decides whether fewer
/// do.
pub fn rungs(barrier: f64) -> usize {
    (2.0 * barrier).ceil().clamp(1.0, 7.0) as usize + 1
}

/// √(−ln(1 − r²)) of a pair that accepts 1 − r.
fn length(acceptance: f64) -> f64 {
    // 1 − r² = A (2 − A); the least positive number bounds the length
    (-libm::log((acceptance * (2.0 - acceptance)).max(f64::MIN_POSITIVE))).max(0.0).sqrt()
}

/// x where the rising broken line through (x, y) reaches `y`; the first such x where it is level.
fn interpolate(line: &[(f64, f64)], y: f64) -> f64 {
    let i = line.partition_point(|point| point.1 < y).clamp(1, line.len() - 1);
    let [(x0, y0), (x1, y1)] = [line[i - 1], line[i]];
    if y1 > y0 { x0 + (x1 - x0) * ((y - y0) / (y1 - y0)).clamp(0.0, 1.0) } else { x0 }
}

/// The same inverse temperatures from 0 to 1, at least [`Ladder::CLOSEST`] apart.
fn apart(mut betas: Vec<f64>) -> Vec<f64> {
    let last = betas.len() - 1;
    (betas[0], betas[last]) = (0.0, 1.0);
    for k in 1..=last {
        betas[k] = betas[k].max(k as f64 * 2.0 * Ladder::CLOSEST).max(betas[k - 1] + 2.0 * Ladder::CLOSEST);
    }
    betas[last] = 1.0;
    for k in (1..last).rev() {
        betas[k] = betas[k].min(betas[k + 1] - 2.0 * Ladder::CLOSEST);
    }
    betas
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Even masses from `low` to `high`.
    fn flat(low: f64, high: f64) -> DensityOfStates {
        let n = 4000;
        DensityOfStates::from_masses(
            (0..n).map(|i| (low + (high - low) * f64::from(i) / f64::from(n), -f64::from(n).ln())),
        )
    }

    fn rejections(d: &DensityOfStates, ladder: &Ladder) -> Vec<f64> {
        d.acceptances(ladder.betas()).into_iter().map(|a| 1.0 - a).collect()
    }

    #[test]
    fn neighbours_reject_equally() {
        for (low, high) in [(0.0, 3.0), (-20.0, 0.0), (-40.0, 90.0), (-700.0, 700.0)] {
            let d = flat(low, high);
            for rungs in [3, 4, 8, 33, 200] {
                let ladder = d.place(rungs);
                assert_eq!(ladder.rungs(), rungs);
                let r = rejections(&d, &ladder);
                let (least, most) = r.iter().fold((1.0f64, 0.0f64), |(a, b), r| (a.min(*r), b.max(*r)));
                assert!(most - least < 2e-3 * most + 1e-4, "{low} to {high}, {rungs} rungs: {least} to {most}");
            }
        }
    }

    #[test]
    fn rungs_of_gaussians_are_geometric() {
        // −ln g ~ Gamma(a) κ/(1 + βκ): rejection depends on the ratio of 1 + βκ alone
        let (a, kappa) = (4.0, 50.0);
        let n = 100_000;
        let farthest = 60.0 * kappa;
        let d = DensityOfStates::from_masses((0..n).map(|i| {
            let l = -farthest * (1.0 - (f64::from(i) + 0.5) / f64::from(n));
            (l, (a - 1.0) * (-l).ln() + l / kappa)
        }));
        let ladder = d.place(6);
        for (k, beta) in ladder.betas().iter().enumerate() {
            let exact = ((1.0 + kappa).powf(k as f64 / 5.0) - 1.0) / kappa;
            assert!((beta - exact).abs() <= 3e-3 * exact, "rung {k}: {beta} for {exact}");
        }
    }

    #[test]
    fn ladders_do_not_collapse() {
        let constant = DensityOfStates::from_masses([(2.0, 0.0)]);
        let islands = DensityOfStates::from_masses([(-700.0, 0.0), (700.0, -350.0)]);
        let needle = DensityOfStates::from_masses([(-700.0, 0.0), (-1.0, -600.0), (0.0, -601.0)]);
        let hot = DensityOfStates::from_masses([(-16_000.0, 0.0), (16_000.0, -1e-3)]);
        let nothing = DensityOfStates::from_masses([]);
        assert_eq!(constant.place(5), Ladder::even(5));
        assert_eq!(nothing.place(5), Ladder::even(5));
        for d in [constant, islands, needle, hot, nothing] {
            for rungs in [1, 2, 3, 8, 256, 1024] {
                let ladder = d.place(rungs);
                assert_eq!(ladder.rungs(), rungs);
                assert!(ladder.betas().windows(2).all(|p| p[1] - p[0] >= Ladder::CLOSEST), "{:?}", ladder.betas());
            }
        }
    }

    #[test]
    fn the_number_of_rungs_follows_the_barrier() {
        assert_eq!([0.0, 0.3, 0.6, 1.2, 3.4, 3.6, 50.0].map(rungs), [2, 2, 3, 4, 8, 8, 8]);
    }
}
