//! A run on several ranks: the first leads, the others do as they are told.
//!
//! All ranks have the same method in the same state and go through the same sweeps, each for blocks of its own. The first
//! one has the clock, the observers and the files; before every slice it says how many sweeps it is to have, so that all
//! stop at the same place whatever their speed. Who is slow is waited for at ends of slices and rounds: work is divided
//! beforehand and never by speed, on which nothing may depend.

use std::io::{self, Write};
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::engine::{Counts, Development, Engine, Phase, Stage};
use crate::{
    path::Workspace,
    ranks::Company,
    tempering::{RoundReport, Sampler},
};

/// What the first rank has all of them do next.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
enum Order {
    /// [`Engine::advance`].
    Advance { sweeps: u64, until: Option<u64> },
    /// [`Engine::gather`].
    Gather,
    /// It is over.
    End,
}

/// The method on the first rank.
pub struct Led {
    engine: Box<dyn Engine>,
    company: Arc<Company>,
}

impl Led {
    /// Shares the work of a method.
    pub fn new(mut engine: Box<dyn Engine>, company: Arc<Company>) -> Led {
        engine.share(&company);
        Led { engine, company }
    }

    fn order(&self, order: Order) {
        let _: Order = self.company.of_first(Some(&order));
    }
}

/// The others are let go, however the run ends.
impl Drop for Led {
    fn drop(&mut self) {
        if !std::thread::panicking() {
            self.order(Order::End);
        }
    }
}

/// Works for the first rank until it says that it is over.
pub fn follow(mut engine: Box<dyn Engine>, stage: &Stage, company: &Arc<Company>) {
    engine.share(company);
    loop {
        match company.of_first::<Order>(None) {
            Order::Advance { sweeps, until } => {
                engine.advance(stage, sweeps, until);
                engine.take_reports();
            }
            Order::Gather => engine.gather(),
            Order::End => return,
        }
    }
}

impl Engine for Led {
    fn sweeps_left(&self) -> Option<u64> {
        self.engine.sweeps_left()
    }

    fn mutations_wanted(&self) -> Option<u64> {
        self.engine.mutations_wanted()
    }

    fn advance(&mut self, stage: &Stage, sweeps: u64, until: Option<u64>) -> u64 {
        self.order(Order::Advance { sweeps, until });
        self.engine.advance(stage, sweeps, until)
    }

    fn phase(&self) -> Phase {
        self.engine.phase()
    }

    /// Rays, rates and faults are those of this rank's blocks since all were last brought together.
    fn counts(&self) -> Counts {
        self.engine.counts()
    }

    fn develop(&self) -> Development {
        self.engine.develop()
    }

    fn set_wanted(&mut self, mutations: Option<u64>) {
        self.engine.set_wanted(mutations);
    }

    fn save(&self, out: &mut dyn Write) -> io::Result<()> {
        self.engine.save(out)
    }

    fn share(&mut self, _: &Arc<Company>) {
        unreachable!("it is shared already");
    }

    fn gather(&mut self) {
        self.order(Order::Gather);
        self.engine.gather();
    }

    fn points(&self) -> Option<&Sampler<Workspace>> {
        self.engine.points()
    }

    fn take_reports(&mut self) -> Vec<RoundReport> {
        self.engine.take_reports()
    }
}
