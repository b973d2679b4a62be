//! `re` and `path`: replica exchange on the light paths of a scene, and its uniform rung alone.

use std::io::{self, Write};
use std::sync::Arc;

use super::{
    engine::{Counts, Development, Diagnostics, Engine, Phase, Sheet, Stage, film_warnings},
    settings::{Method, Settings},
};
use crate::{
    path::Workspace,
    ranks::Company,
    rng::Rng,
    saved::{Source, Unfit},
    tempering::{Choices, LadderChoice, Learning, RoundReport, Sampler, Setup},
};

/// The method at work.
pub struct ReplicaExchange {
    sampler: Sampler<Workspace>,
}

impl ReplicaExchange {
    /// Ready to start.
    pub fn new(sheet: &Sheet, rng: Rng, settings: &Settings, mutations: Option<u64>) -> ReplicaExchange {
        ReplicaExchange { sampler: Sampler::new(set_up(sheet, rng, settings, mutations)) }
    }

    /// As it was saved, with the settings and the number of mutations that it was planned for.
    pub fn restored(
        sheet: &Sheet,
        rng: Rng,
        settings: &Settings,
        planned: Option<u64>,
        from: &mut Source,
    ) -> Result<ReplicaExchange, Unfit> {
        Ok(ReplicaExchange { sampler: Sampler::restored(set_up(sheet, rng, settings, planned), from)? })
    }
}

fn set_up(sheet: &Sheet, rng: Rng, settings: &Settings, evaluations: Option<u64>) -> Setup {
    let choices = match settings.method {
        Method::ReplicaExchange => settings.ladder_choices(),
        _ => Choices { ladder: LadderChoice::Replicas(1), ..Choices::default() },
    };
    Setup {
        rng,
        choices,
        footprint: sheet.footprint(),
        size: sheet.size(),
        unit: sheet.brightest,
        elsewhere: sheet.elsewhere,
        outcomes: sheet.outcomes,
        evaluations,
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

    fn develop(&self) -> Development {
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
            agreement: None,
        }
    }

    fn points(&self) -> Option<&Sampler<Workspace>> {
        self.sampler.is_uniform_alone().then_some(&self.sampler)
    }

    fn share(&mut self, company: &Arc<Company>) {
        self.sampler.share(company.clone());
    }

    fn gather(&mut self) {
        self.sampler.gather();
    }

    fn set_wanted(&mut self, mutations: Option<u64>) {
        self.sampler.set_wanted(mutations);
    }

    fn save(&self, out: &mut dyn Write) -> io::Result<()> {
        self.sampler.save(out)
    }

    fn take_reports(&mut self) -> Vec<RoundReport> {
        self.sampler.take_reports()
    }
}
