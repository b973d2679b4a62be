//! What a run is: the options that its numbers depend on, shared by the subcommands that begin one or repeat a part of it.

use std::time::Duration;

use clap::Args;

use super::values;
use crate::path::MappingKind;
use crate::render::settings::DEFAULT_MUTATIONS_PER_PIXEL;
use crate::render::{Combine, LadderChoice, MappingChoice, Measure, Method, MltSettings, Normalisation, Settings};

/// Method, budget, seed and threads.
#[derive(Args)]
pub(super) struct RunOptions {
    /// path: independent samples; mlt: Metropolis light transport; re: replica exchange [default: re]
    #[arg(long, value_parser = values::method(), help_heading = "Method")]
    pub method: Option<Method>,

    /// Replicas on a ladder for --method re, 1 to 1024, the uniform one included, placed at equal rejection of swaps;
    /// auto: as many as pay, none but the uniform one where path tracing is best [default: auto]
    #[arg(long, value_name = "K", value_parser = values::replicas, allow_hyphen_values = true, help_heading = "Method")]
    pub replicas: Option<LadderChoice>,

    /// From random numbers to light paths; unidirectional: camera paths; light: light subpaths seen by the camera;
    /// two-way: both; bidirectional: both, and every vertex of one joined to every vertex of the other; multiplexed: one of
    /// those ways for each mutation; auto: a short trial on the scene decides [default: auto]
    #[arg(long, value_name = "HOW", value_parser = values::mapping(), help_heading = "Method")]
    pub mapping: Option<MappingChoice>,

    /// Lets chains on --mapping multiplexed change the technique of a path and keep the path [default: off]
    #[arg(long, value_name = "WHETHER", value_parser = values::switch(), help_heading = "Method")]
    pub technique_changes: Option<bool>,

    /// Inverse temperatures for --method re in place of --replicas, rising from 0 to 1, such as 0,0.3,1
    #[arg(long, value_name = "0,…,1", value_delimiter = ',', allow_negative_numbers = true, help_heading = "Method")]
    pub betas: Option<Vec<f64>>,

    /// Share of evaluations of --method re that are uniform points, between 0 and 1 [default: tuned to the scene]
    #[arg(long, value_name = "F", allow_negative_numbers = true, help_heading = "Method")]
    pub uniform_share: Option<f64>,

    /// How --method re makes one image of its replicas; balance: all samples of all, weighed; target: the coldest's;
    /// uniform: the uniform one's; max, power, median, median-printed: the paper's heuristics of the latter two, biased
    /// [default: balance]
    #[arg(long, value_parser = values::combine(), help_heading = "Method")]
    pub combine: Option<Combine>,

    /// The error that --method re makes small: relative to the luminance of a pixel, or absolute [default: relative]
    #[arg(long, value_parser = values::measure(), help_heading = "Method")]
    pub error: Option<Measure>,

    /// Probability of a large step for --method mlt, between 0 and 1 [default: 0.3]
    #[arg(long, value_name = "P", allow_negative_numbers = true, help_heading = "Method")]
    pub large_steps: Option<f64>,

    /// Samples that --method mlt takes the mean luminance from; two-pass: those before the chains start; pooled: those
    /// and all large steps [default: two-pass]
    #[arg(long, value_parser = values::normalisation(), help_heading = "Method")]
    pub normalisation: Option<Normalisation>,

    /// Lets --method mlt use large steps in the image also as independent samples, by Kelemen's weights
    #[arg(long, help_heading = "Method")]
    pub kelemen_weights: bool,

    /// Mutations per pixel, above 0; the same seed and number give the same image, bit by bit
    /// [default: 64 unless --time is given; with both, whichever ends first]
    #[arg(long, value_name = "N", allow_negative_numbers = true, help_heading = "Budget")]
    pub mpp: Option<f64>,

    /// Wall time to render for, such as 60s or 5m
    #[arg(long, value_parser = values::duration, allow_hyphen_values = true, help_heading = "Budget")]
    pub time: Option<Duration>,

    /// Seed of all random numbers [default: 0]
    #[arg(long, value_name = "N", allow_negative_numbers = true, help_heading = "Budget")]
    pub seed: Option<u64>,

    /// Worker threads, from 1 [default: as many as the machine runs at once, or SLURM or HyperQueue has given this process];
    /// the image does not depend on it
    #[arg(long, value_name = "N", allow_negative_numbers = true, help_heading = "Machine")]
    pub threads: Option<usize>,
}

impl RunOptions {
    /// The run that is asked for; files and what else concerns the machine are left at their defaults. What is not given is
    /// as `before` had it, or as it usually is.
    pub fn settings(&self, before: Option<&Settings>) -> Settings {
        let (mutations_per_pixel, time) = match (self.mpp, self.time, before) {
            (None, None, Some(before)) => (before.mutations_per_pixel, before.time),
            (None, None, None) => (Some(DEFAULT_MUTATIONS_PER_PIXEL), None),
            given => (given.0, given.1),
        };
        let base = before.cloned().unwrap_or_default();
        Settings {
            method: self.method.unwrap_or(base.method),
            mapping: self.mapping.unwrap_or(base.mapping),
            seed: self.seed.unwrap_or(base.seed),
            threads: self.threads,
            mutations_per_pixel,
            time,
            ladder: match (&self.betas, &self.replicas) {
                (Some(betas), _) => LadderChoice::Betas(betas.clone()),
                (None, Some(replicas)) => replicas.clone(),
                (None, None) => base.ladder,
            },
            combine: self.combine.unwrap_or(base.combine),
            uniform_share: self.uniform_share.or(base.uniform_share),
            measure: self.error.unwrap_or(base.measure),
            technique_changes: self.technique_changes.unwrap_or(base.technique_changes),
            mlt: MltSettings {
                large_steps: self.large_steps.unwrap_or(base.mlt.large_steps),
                normalisation: self.normalisation.unwrap_or(base.mlt.normalisation),
                kelemen_weights: self.kelemen_weights || base.mlt.kelemen_weights,
            },
            ..Settings::default()
        }
    }

    /// What is wrong with the options beside one another and the settings they came to; `of_a_ladder` are further
    /// options that only a ladder makes sense of, and whether they are given.
    pub fn contradictions(&self, settings: &Settings, of_a_ladder: &[(&str, bool)]) -> Vec<String> {
        let mut faults = Vec::new();
        if self.betas.is_some() && self.replicas.is_some() {
            faults.push("--betas and --replicas: give one of them; the number of replicas is that of the betas".into());
        }
        let own = [
            ("--replicas", self.replicas.is_some()),
            ("--betas", self.betas.is_some()),
            ("--combine", self.combine.is_some()),
            ("--uniform-share", self.uniform_share.is_some()),
            ("--error", self.error.is_some()),
        ];
        if settings.method != Method::ReplicaExchange {
            let method = settings.method.name();
            let given = own.iter().chain(of_a_ladder).filter(|(_, given)| *given);
            faults.extend(given.map(|(name, _)| format!("{name}: --method {method} has no ladder; only re has")));
        }
        let multiplexed = settings.mapping == MappingChoice::Fixed(MappingKind::Multiplexed);
        if self.technique_changes == Some(true) && !(multiplexed && settings.method != Method::Path) {
            faults.push(
                "--technique-changes on: only chains of --method mlt or re on --mapping multiplexed have a technique to change"
                    .into(),
            );
        }
        let of_large_steps = [
            ("--large-steps", self.large_steps.is_some()),
            ("--normalisation", self.normalisation.is_some()),
            ("--kelemen-weights", self.kelemen_weights),
        ];
        if settings.method != Method::Mlt {
            let method = settings.method.name();
            let given = of_large_steps.iter().filter(|(_, given)| *given);
            faults.extend(given.map(|(name, _)| format!("{name}: --method {method} has no large steps; only mlt has")));
        }
        faults
    }
}
