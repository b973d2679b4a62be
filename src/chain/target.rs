//! What chains need to know of the function they sample.

use std::sync::Arc;

use super::Importance;
use crate::{
    path::{Contributions, Mapping, Workspace},
    rng::{Counter, Rng},
    sample::{Block, Move, Points, Proposals},
};

/// A non-negative function on the unit cube, evaluated for a batch of points at a time.
///
/// Chains and ladders see nothing else of a scene: their statistics are tested on analytic targets.
pub trait Target: Sync {
    /// Memory that an evaluation reuses.
    type Workspace: Default + Send;

    /// Evaluates the proposals of all lanes that do not rest, drawing the blocks it needs.
    fn evaluate(&self, proposals: &mut Proposals, out: &mut Contributions, workspace: &mut Self::Workspace);

    /// Whether chains are to take [`change_technique`](Target::change_technique) for some of their steps.
    fn changes_techniques(&self) -> bool {
        false
    }

    /// Draws another way to say what the point of a lane says, whose blocks go to the same lane of `to`: a step that leaves
    /// the distribution g^β unchanged if accepted with min(1, (g′/g · e^−Δ)^β), Δ the returned expected change of ln g.
    /// `None`: the chain stays where it is. `random` gives uniform blocks, `rays` counts those traced.
    fn change_technique(
        &self,
        _current: (&Points, usize),
        _beta: f64,
        _random: &mut dyn FnMut() -> Block,
        _to: &mut Points,
        _rays: &mut u64,
    ) -> Option<f64> {
        None
    }

    /// Whether points may contribute elsewhere than at their own film positions.
    fn splats_elsewhere(&self) -> bool {
        false
    }

    /// Whether points choose among [outcomes](crate::path::Outcome) that can be had all at once.
    fn has_outcomes(&self) -> bool {
        false
    }

    /// Whether some of them are had by open points alone, so that there must be such points.
    fn needs_open_points(&self) -> bool {
        false
    }

    /// Lists all outcomes of the proposals of all lanes that do not rest in `out.outcomes`, with whatever the lanes choose
    /// left open. What outcomes contribute sums to what points contribute on average over their choices, and those of
    /// one lane are as many samples of what points are, each of weight `chance`, darkness making up for what these lack of 1
    /// on average.
    fn evaluate_open(&self, _: &mut Proposals, _: &mut Contributions, _: &mut Self::Workspace) {
        unreachable!("points of this target have one outcome");
    }
}

impl Target for Mapping<'_> {
    type Workspace = Workspace;

    fn splats_elsewhere(&self) -> bool {
        self.kind().splats_elsewhere()
    }

    fn has_outcomes(&self) -> bool {
        Mapping::has_outcomes(self)
    }

    fn needs_open_points(&self) -> bool {
        self.views_left_open()
    }

    fn evaluate_open(&self, proposals: &mut Proposals, out: &mut Contributions, workspace: &mut Self::Workspace) {
        Mapping::evaluate_open(self, proposals, out, workspace);
    }

    fn changes_techniques(&self) -> bool {
        self.technique_changes()
    }

    fn change_technique(
        &self,
        current: (&Points, usize),
        beta: f64,
        random: &mut dyn FnMut() -> Block,
        to: &mut Points,
        rays: &mut u64,
    ) -> Option<f64> {
        Mapping::change_technique(self, current, beta, random, to, rays)
    }

    fn evaluate(&self, proposals: &mut Proposals, out: &mut Contributions, workspace: &mut Self::Workspace) {
        Mapping::evaluate(self, proposals, out, workspace);
    }
}

/// Everything that one batch of proposals takes: moves, counters, proposed points and their contributions.
pub struct Evaluator<W> {
    rng: Rng,
    /// How each lane moves next.
    pub moves: Vec<Move>,
    /// Width and height in pixels of the film that stratified points are for; one pixel at first.
    pub film: [u32; 2],
    /// Which words each lane draws next.
    pub counters: Vec<Counter>,
    /// The blocks of lanes whose techniques change.
    pub(super) given: Points,
    /// The change of ln g that is expected of each lane's last change of technique.
    pub expected: Vec<f64>,
    /// Lanes that a change of technique was drawn for.
    pub drawn: Vec<usize>,
    /// The proposed points.
    pub points: Points,
    /// What they contribute.
    pub out: Contributions,
    /// What the scalar contributions are weighed by; they are luminances where absent.
    pub importance: Option<Arc<Importance>>,
    workspace: W,
}

impl<W: Default> Evaluator<W> {
    /// For as many lanes as there are counters; all lanes rest at first.
    pub fn new(rng: Rng, counters: Vec<Counter>) -> Evaluator<W> {
        Evaluator::with_workspace(rng, counters, W::default())
    }

    /// The same with a given workspace.
    pub fn with_workspace(rng: Rng, counters: Vec<Counter>, workspace: W) -> Evaluator<W> {
        let lanes = counters.len();
        Evaluator {
            rng,
            moves: vec![Move::Rest; lanes],
            film: [1, 1],
            importance: None,
            counters,
            given: Points::new(lanes),
            expected: vec![0.0; lanes],
            drawn: Vec::new(),
            points: Points::new(lanes),
            out: Contributions::new(lanes),
            workspace,
        }
    }

    /// What evaluations work in.
    pub fn workspace(&mut self) -> &mut W {
        &mut self.workspace
    }

    /// The source of random words.
    pub fn rng(&self) -> Rng {
        self.rng
    }

    /// Draws and evaluates a proposal in every lane that does not rest; small steps start at `current`.
    pub fn evaluate<T: Target<Workspace = W>>(&mut self, target: &T, current: &Points) {
        self.with_proposals(current, |proposals, out, workspace| target.evaluate(proposals, out, workspace));
        if let Some(importance) = &self.importance {
            for (lane, how) in self.moves.iter().enumerate() {
                if *how != Move::Rest {
                    let ln_g = importance.ln_weighed(self.out.whole(lane));
                    debug_assert!(ln_g < f64::INFINITY, "importance is finite, contributions are settled");
                    self.out.lanes[lane].ln_g = ln_g;
                }
            }
        }
    }

    /// The same, with what proposals choose left [open](Target::evaluate_open).
    pub fn evaluate_open<T: Target<Workspace = W>>(&mut self, target: &T, current: &Points) {
        self.with_proposals(current, |proposals, out, workspace| target.evaluate_open(proposals, out, workspace));
        let Some(importance) = &self.importance else { return };
        for (lane, how) in self.moves.iter().enumerate() {
            if *how != Move::Rest {
                for outcome in self.out.outcomes.of_mut(lane) {
                    outcome.ln_g += importance.ln_at(outcome.splat.film);
                }
            }
        }
    }

    fn with_proposals(&mut self, current: &Points, evaluate: impl FnOnce(&mut Proposals, &mut Contributions, &mut W)) {
        let mut proposals = Proposals {
            rng: self.rng,
            current,
            given: &self.given,
            points: &mut self.points,
            counters: &self.counters,
            moves: &self.moves,
            film: self.film,
        };
        evaluate(&mut proposals, &mut self.out, &mut self.workspace);
    }
}
