//! What a round came to, in numbers.

use super::{Learnt, Sampler};
use crate::tempering::{
    Estimate, LnEstimate, Normaliser, NormaliserEstimates, RoundReport, RungCounts, RungReport, ScaleReport,
    agreement::Mixing, probes::TRIALS, steps, trips::Dwell,
};

/// β at which the local barrier is told.
const BARRIER_POINTS: usize = 33;

impl<W: Default + Send> Sampler<W> {
    /// The report of the round at work, as far as it has come.
    pub(super) fn report(&self, learnt: &Learnt) -> RoundReport {
        let ladder = &self.state.round.ladder;
        let betas = ladder.betas();
        let counts = self.counts_by_rung();
        let density = &learnt.density;
        let rejection: Vec<f64> = counts[1..].iter().map(|c| 1.0 - c.swaps.acceptance()).collect();
        let blocks = || self.portions.iter().filter_map(|portion| portion.ladders.as_ref());
        let ladders = self.ladders();
        let chains = ladders > 0;
        let waits: f64 = rejection.iter().map(|r| r / (1.0 - r)).sum();
        let trips = |f: fn(&crate::tempering::trips::Trips) -> u64| blocks().map(|block| f(block.trips())).sum::<u64>();
        let mixing = self.mixing();
        let index = blocks().find_map(|block| block.index());
        let grid = (0..BARRIER_POINTS).map(|i| i as f64 / (BARRIER_POINTS - 1) as f64);
        RoundReport {
            round: self.state.schedule.round,
            sweeps: self.state.sweeps,
            mutations: self.state.evaluations,
            ladders: ladders as usize,
            replicas: ladder.rungs(),
            betas: betas.to_vec(),
            ln_z: learnt.normalisers.ln_z.iter().map(|z| if z.is_finite() { *z } else { f64::NAN }).collect(),
            lit_share: density.lit_share(),
            barrier: density.barrier(),
            barrier_curve: density.barrier_curve().into_iter().map(|(beta, barrier)| [beta, barrier]).collect(),
            local_barrier: grid.map(|beta| [beta, density.local_barrier(beta)]).collect(),
            predicted_rejection: if chains { self.predicted_rejection(learnt) } else { Vec::new() },
            round_trips: trips(|t| t.round_trips),
            restarts: trips(|t| t.restarts),
            round_trips_predicted: if chains {
                // with one pair, which swaps in every sweep and not in every second, twice as many
                let one_pair = if rejection.len() == 1 { 2.0 } else { 1.0 };
                one_pair * self.ladder_steps(self.state.schedule.done) as f64 / (2.0 + 2.0 * waits)
            } else {
                f64::NAN
            },
            longest_rejection_run: counts.iter().map(|c| u64::from(c.longest_rejection)).max().unwrap_or(0),
            normalisers: NormaliserEstimates {
                uniform: told(&learnt.uniform),
                stepping_stones: told(&learnt.stepping_stones),
                mbar: told(&learnt.normalisers.target),
            },
            used: if self.state.states_a_rung > 0 { Normaliser::Mbar } else { Normaliser::Uniform },
            uniform_share: self.uniform_share(),
            offers: if chains { self.state.offers as u64 } else { 0 },
            chain_ratio: self.state.round.weights.ratio(),
            split_r_hat: mixing.r_hat_ln_g,
            split_r_hat_image: mixing.r_hat_film,
            r_hat_halves: mixing.halves,
            non_finite: self.state.faults.total(),
            rays: self.state.rays,
            rungs: if chains { self.rung_reports(learnt, &counts) } else { Vec::new() },
            index_process: index.map_or_else(Vec::new, |index| index.rungs.clone()),
            index_stride: index.map_or(0, |index| index.stride),
            rejection,
            choices: Vec::new(),
            image_share_before: None,
        }
    }

    /// Share of the round's evaluations that are uniform points.
    pub(super) fn uniform_share(&self) -> f64 {
        (self.portions.len() * self.points_a_block()) as f64 / self.a_sweep() as f64
    }

    /// Rejection of each pair for independent states; the first counts dark offers as well.
    fn predicted_rejection(&self, learnt: &Learnt) -> Vec<f64> {
        let density = &learnt.density;
        let pairs = self.state.round.ladder.betas().windows(2);
        let of_lit = |pair: &[f64]| density.rejection(pair[0], pair[1]);
        pairs
            .enumerate()
            .map(|(k, pair)| match k {
                0 => 1.0 - density.lit_share() * (1.0 - of_lit(pair)),
                _ => of_lit(pair),
            })
            .collect()
    }

    fn rung_reports(&self, learnt: &Learnt, counts: &[RungCounts]) -> Vec<RungReport> {
        let mut seen = vec![crate::tempering::Histogram::default(); self.state.round.ladder.rungs()];
        for number in 0..self.portions.len() {
            seen.iter_mut().zip(&self.group(number)).for_each(|(sum, h)| sum.merge(h));
        }
        // tempered luminance is in units of the weights, whose normalisers are only now known
        let scale = libm::exp(learnt.normalisers.target.ln_value - self.state.ln_unit);
        let luminance = |k: usize| counts[k].luminance.values().0 * if k == 0 { 1.0 } else { scale };
        let all: f64 = (0..counts.len()).map(luminance).sum();
        (0..counts.len())
            .map(|k| {
                let proposed: u64 = counts[k].steps.iter().map(|c| c.proposed).sum();
                let points = self.state.schedule.done * (self.portions.len() * self.points_a_block()) as u64;
                let dwell = self.dwell(k);
                let lineage = (dwell.sum > 0).then(|| dwell.squares as f64 / dwell.sum as f64);
                let accepted: f64 =
                    counts[k].steps.iter().filter(|c| c.proposed > 0).map(|c| c.acceptance() * c.proposed as f64).sum();
                let (mean_ln_g, sd_ln_g) = seen[k].mean_and_sd().unwrap_or((f64::NAN, f64::NAN));
                let evaluations = if k == 0 { points } else { proposed };
                RungReport {
                    beta: self.state.round.ladder.betas()[k],
                    evaluations,
                    acceptance: if k == 0 { f64::NAN } else { accepted / proposed as f64 },
                    scales: if k == 0 { Vec::new() } else { self.scale_reports(k, &counts[k]) },
                    mean_ln_g,
                    sd_ln_g,
                    dark_share: seen[k].dark() / seen[k].total(),
                    tau_image: (k > 0).then_some(self.state.image_correlation).flatten(),
                    tau_lineage: lineage,
                    effective: if k == 0 {
                        evaluations as f64
                    } else {
                        self.state.image_correlation.map_or(f64::NAN, |tau| evaluations as f64 / tau.max(1.0))
                    },
                    image_share: luminance(k) / all,
                }
            })
            .collect()
    }

    fn scale_reports(&self, k: usize, counts: &RungCounts) -> Vec<ScaleReport> {
        let weights = self.state.round.mixes[TRIALS / 2][k].weights();
        let report = |i: usize| ScaleReport {
            size: steps::size(i),
            weight: weights[i],
            acceptance: counts.steps[i].acceptance(),
            proposed: counts.steps[i].proposed,
        };
        (0..weights.len()).map(report).collect()
    }

    /// Dwell times of lineages that ended in the round on tempered rung `k`.
    fn dwell(&self, k: usize) -> Dwell {
        let mut sum = Dwell::default();
        for block in self.portions.iter().filter_map(|portion| portion.ladders.as_ref()) {
            if let Some(dwell) = k.checked_sub(1).and_then(|k| block.trips().dwell.get(k)) {
                sum.sum += dwell.sum;
                sum.squares += dwell.squares;
            }
        }
        sum
    }

    /// How far blocks of ladders agree on the target.
    fn mixing(&self) -> Mixing {
        let top = self.state.round.ladder.chains();
        let (mut means, mut whereabouts) = (Vec::new(), Vec::new());
        let mut within = crate::tempering::Histogram::default();
        let rungs = self.state.round.ladder.rungs();
        for block in self.portions.iter().filter_map(|portion| portion.ladders.as_ref()) {
            let mut counts = vec![RungCounts::default(); rungs];
            block.add_counts(&mut counts);
            means.extend(counts[top].halves.iter().filter_map(|half| half.mean()).map(|mean| [mean]));
            whereabouts.extend(counts[top].whereabouts);
            let mut histograms = vec![crate::tempering::Histogram::default(); rungs];
            block.add_histograms(&mut histograms);
            within.merge(&histograms[top]);
        }
        let sd = within.mean_and_sd().map_or(f64::NAN, |(_, sd)| sd);
        Mixing::of(&means, sd * sd, &whereabouts)
    }
}

/// An estimate as reports have it.
fn told(estimate: &Estimate) -> LnEstimate {
    let known = |v: f64| if v.is_finite() { v } else { f64::NAN };
    LnEstimate { ln_value: known(estimate.ln_value), relative_error: known(estimate.relative_error) }
}
