//! `re` and `path`: replica exchange on the light paths of a scene, and its uniform rung alone.

use super::{
    engine::{Counts, Development, Diagnostics, Engine, Phase, Stage, film_warnings},
    settings::{Method, Settings},
};
use crate::{
    chain::Target,
    film::Footprint,
    path::Workspace,
    tempering::{Choices, LadderChoice, Learning, RoundReport, Sampler, Setup},
};

/// The method at work.
pub struct ReplicaExchange {
    sampler: Sampler<Workspace>,
}

impl ReplicaExchange {
    /// Ready to start.
    pub fn new(stage: &Stage, settings: &Settings, mutations: Option<u64>) -> ReplicaExchange {
        let film = &stage.mapping.scene().film;
        let choices = match settings.method {
            Method::ReplicaExchange => settings.ladder_choices(),
            _ => Choices { ladder: LadderChoice::Replicas(1), ..Choices::default() },
        };
        let setup = Setup {
            rng: stage.rng,
            choices,
            footprint: Footprint::new(film.filter, film.width, film.height),
            size: stage.size(),
            unit: f64::from(stage.mapping.scene().emitters.brightest()),
            elsewhere: stage.mapping.splats_elsewhere(),
            outcomes: stage.mapping.has_outcomes(),
            evaluations: mutations,
        };
        ReplicaExchange { sampler: Sampler::new(setup) }
    }
}

impl Engine for ReplicaExchange {
    fn sweeps_left(&self) -> Option<u64> {
        self.sampler.sweeps_left()
    }

    fn mutations_wanted(&self) -> Option<u64> {
        self.sampler.evaluations_wanted()
    }

    fn advance(&mut self, stage: &Stage, sweeps: u64, until: Option<u64>) -> u64 {
        self.sampler.advance(&stage.mapping, sweeps, until)
    }

    fn phase(&self) -> Phase {
        match self.sampler.learning() {
            Learning::Bootstrap => Phase::Bootstrap,
            Learning::Rounds => Phase::Adaptation,
            Learning::Over => Phase::Steady,
        }
    }

    fn counts(&self) -> Counts {
        let (acceptance, swap) = self.sampler.acceptances();
        Counts {
            mutations: self.sampler.evaluations(),
            rays: self.sampler.rays(),
            faults: self.sampler.faults().clone(),
            acceptance,
            swap,
            technique_changes: self.sampler.technique_changes(),
        }
    }

    fn develop(&self, _: &Stage) -> Development {
        let developed = self.sampler.develop();
        let mut warnings = developed.learnt.warnings();
        warnings.extend(film_warnings(self.sampler.film()));
        Development {
            image: developed.image,
            layers: developed.layers,
            normalisation: Some(developed.learnt.luminance),
            diagnostics: Diagnostics {
                round: Some(developed.round),
                contradiction: !developed.learnt.warnings().is_empty(),
                ..Diagnostics::default()
            },
            warnings,
        }
    }

    fn take_reports(&mut self) -> Vec<RoundReport> {
        self.sampler.take_reports()
    }
}
