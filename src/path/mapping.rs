//! The mappings and the choice among them.

use std::{
    mem,
    sync::{Mutex, OnceLock, PoisonError},
};

use serde::{Deserialize, Serialize};

use super::{
    Causes, Contribution, Contributions, Elsewhere, Evaluation, Event, Layout, Narration, Origin, RecordedRays, Widths,
    bidirectional,
    bidirectional::{Lengths, Techniques},
    scalar,
    tracing::Tracing,
    unidirectional,
};
use crate::{
    rng::{Counter, Rng},
    sample::{Block, Move, Points, Proposals},
    scene::{DiffuseProfile, Features, FlatProfile, FullProfile, Kernel, PlainProfile, Profile, Scene},
};

/// How points of the cube become light paths.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MappingKind {
    /// Camera paths with next-event estimation.
    #[default]
    Unidirectional,
    /// Light tracing: light subpaths of which every vertex is connected to the camera. What the camera sees in perfect
    /// mirrors, through smooth glass or of a sky is missing.
    Light,
    /// Camera paths with next-event estimation, and light tracing.
    TwoWay,
    /// Subpaths from both ends, and every vertex of one connected to every vertex of the other.
    Bidirectional,
    /// One of the bidirectional techniques, which primary dimensions choose, and one connection a point.
    Multiplexed,
}

impl MappingKind {
    /// All of them, simplest first.
    pub const ALL: [MappingKind; 5] = [
        MappingKind::Unidirectional,
        MappingKind::Light,
        MappingKind::TwoWay,
        MappingKind::Bidirectional,
        MappingKind::Multiplexed,
    ];

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            MappingKind::Unidirectional => "unidirectional",
            MappingKind::Light => "light",
            MappingKind::TwoWay => "two-way",
            MappingKind::Bidirectional => "bidirectional",
            MappingKind::Multiplexed => "multiplexed",
        }
    }

    /// The techniques that the mapping combines.
    pub fn techniques(self) -> Techniques {
        match self {
            MappingKind::Unidirectional => Techniques::CAMERA,
            MappingKind::Light => Techniques::LIGHT,
            MappingKind::TwoWay => Techniques::TWO_WAY,
            MappingKind::Bidirectional | MappingKind::Multiplexed => Techniques::ALL,
        }
    }

    /// What images of that scene by the mapping lack, one phrase each: paths that none of its techniques makes.
    pub fn misses(self, features: &Features) -> Vec<&'static str> {
        if self.techniques().hit {
            return Vec::new();
        }
        let missed = [
            (features.delta_lobes, "whatever is seen in perfect mirrors, through smooth glass or through masks"),
            (features.infinite_lights > 0, "the sky itself"),
        ];
        missed.into_iter().filter(|(missed, _)| *missed).map(|(_, what)| what).collect()
    }

    /// Whether points contribute to the film elsewhere than their first dimensions say.
    pub fn splats_elsewhere(self) -> bool {
        self.techniques().light
    }
}

type Evaluate = fn(&Mapping, &mut Proposals, &mut Contributions, &mut Workspace);

/// The mapping of one scene.
pub struct Mapping<'s> {
    scene: &'s Scene,
    kind: MappingKind,
    layout: Layout,
    widths: Widths,
    /// How points of the multiplexed mapping choose.
    lengths: Lengths,
    technique_changes: bool,
    views_left_open: bool,
    evaluate: Evaluate,
    evaluate_open: Option<Evaluate>,
    /// An evaluation to look out for, where somebody asked for one.
    watch: Option<Watch>,
    /// The rays of all batches, where somebody asked for them.
    record: Option<Mutex<RecordedRays>>,
}

/// Looks out for the evaluation that draws the words of a counter.
struct Watch {
    counter: Counter,
    seen: OnceLock<Evaluation>,
}

impl Watch {
    /// Keeps the evaluation, if it is among these.
    #[cold]
    fn look(&self, proposals: &Proposals) {
        let lane = (0..proposals.lanes())
            .find(|lane| proposals.counters[*lane] == self.counter && proposals.moves[*lane] != Move::Rest);
        if let Some(evaluation) = lane.and_then(|lane| Evaluation::of(proposals, lane)) {
            self.seen.get_or_init(|| evaluation);
        }
    }
}

/// Arrays that evaluating a batch fills; reused, so that nothing is allocated once they have grown.
#[derive(Default)]
pub struct Workspace {
    pub(super) tracing: Tracing,
    pub(super) unidirectional: unidirectional::Arrays,
    pub(super) bidirectional: bidirectional::Arrays,
}

impl Workspace {
    /// A workspace that keeps a copy of every ray.
    pub fn recording() -> Workspace {
        Workspace { tracing: Tracing::recording(), ..Workspace::default() }
    }

    /// A workspace that never asks Embree, but takes the answers recorded in evaluations of some points for those of the
    /// same points in the same batches, as often as those are gone through.
    pub fn replaying(recorded: RecordedRays) -> Workspace {
        Workspace { tracing: Tracing::replaying(recorded), ..Workspace::default() }
    }

    /// The rays kept since the last call.
    pub fn take_recorded(&mut self) -> RecordedRays {
        self.tracing.take_recorded()
    }
}

impl<'s> Mapping<'s> {
    /// The mapping of that scene, by the smallest kernel that does all it needs.
    pub fn new(scene: &'s Scene, kind: MappingKind, widths: Widths) -> Mapping<'s> {
        Mapping::with_kernel(scene, kind, widths, scene.features.kernel())
    }

    /// The mapping by a given kernel, which must do all that the scene needs.
    pub fn with_kernel(scene: &'s Scene, kind: MappingKind, widths: Widths, kernel: Kernel) -> Mapping<'s> {
        assert!(kernel >= scene.features.kernel(), "the scene needs more than {kernel:?}");
        let (evaluate, open): (Evaluate, Evaluate) = match kernel {
            Kernel::Diffuse => kernels::<DiffuseProfile>(kind),
            Kernel::Flat => kernels::<FlatProfile>(kind),
            Kernel::Plain => kernels::<PlainProfile>(kind),
            Kernel::Full => kernels::<FullProfile>(kind),
        };
        let layout = Layout::new(&scene.features, kind == MappingKind::Multiplexed);
        Mapping {
            scene,
            kind,
            lengths: Lengths::new(layout.max_depth()),
            layout,
            widths,
            technique_changes: false,
            views_left_open: false,
            evaluate,
            evaluate_open: (kind == MappingKind::Multiplexed).then_some(open),
            watch: None,
            record: None,
        }
    }

    /// The scene.
    pub fn scene(&self) -> &'s Scene {
        self.scene
    }

    /// Which of the mappings it is.
    pub fn kind(&self) -> MappingKind {
        self.kind
    }

    /// What the primary dimensions decide.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// How points of the multiplexed mapping choose.
    pub fn lengths(&self) -> &Lengths {
        &self.lengths
    }

    /// Packet widths.
    pub fn widths(&self) -> Widths {
        self.widths
    }

    /// Another technique for the path of a lane's point: see [`bidirectional`] for the law, at inverse
    /// temperature `beta`. The blocks of which it decides go to the same lane of `to`. The expected change of ln g; `None`
    /// where the technique is to stay.
    pub fn change_technique(
        &self,
        current: (&Points, usize),
        beta: f64,
        random: &mut dyn FnMut() -> Block,
        to: &mut Points,
        rays: &mut u64,
    ) -> Option<f64> {
        assert!(self.kind == MappingKind::Multiplexed, "points of other mappings have no technique");
        bidirectional::change_technique(self, current, beta, random, to, rays)
    }

    /// Lets chains change techniques, where points have any.
    pub fn with_technique_changes(mut self, allowed: bool) -> Self {
        self.technique_changes = allowed && self.kind == MappingKind::Multiplexed;
        self
    }

    /// Whether chains are to change techniques.
    pub fn technique_changes(&self) -> bool {
        self.technique_changes
    }

    /// Leaves light that is seen directly, or by way of perfect mirrors and smooth glass only, to points that leave
    /// [open](Self::evaluate_open) what they choose, which look for it apart; points that choose it are dark. Where there are no perfect
    /// lobes, chains keep it.
    pub fn with_views_left_open(mut self, left: bool) -> Self {
        self.views_left_open = left && self.has_outcomes() && self.scene.features.delta_lobes;
        self
    }

    /// Whether light that is seen by way of perfect lobes only is left to open points.
    pub fn views_left_open(&self) -> bool {
        self.views_left_open
    }

    /// Whether points choose among outcomes that can be had all at once.
    pub fn has_outcomes(&self) -> bool {
        self.evaluate_open.is_some()
    }

    /// Lists all outcomes of the proposals of all lanes that do not rest, whatever they choose: all techniques for the two
    /// subpaths of each, at the cost of the bidirectional mapping.
    pub fn evaluate_open(&self, proposals: &mut Proposals, out: &mut Contributions, workspace: &mut Workspace) {
        let evaluate = self.evaluate_open.expect("points of other mappings have one outcome");
        self.evaluate_by(evaluate, proposals, out, workspace);
    }

    /// Evaluates the proposals of all lanes that do not rest.
    pub fn evaluate(&self, proposals: &mut Proposals, out: &mut Contributions, workspace: &mut Workspace) {
        self.evaluate_by(self.evaluate, proposals, out, workspace);
    }

    fn evaluate_by(
        &self,
        evaluate: Evaluate,
        proposals: &mut Proposals,
        out: &mut Contributions,
        workspace: &mut Workspace,
    ) {
        match &self.record {
            None => evaluate(self, proposals, out, workspace),
            Some(record) => {
                let tracing = mem::replace(&mut workspace.tracing, Tracing::recording());
                evaluate(self, proposals, out, workspace);
                let rays = mem::replace(&mut workspace.tracing, tracing).take_recorded();
                record.lock().unwrap_or_else(PoisonError::into_inner).append(rays);
            }
        }
        if let Some(watch) = &self.watch {
            watch.look(proposals);
        }
    }

    /// Keeps a copy of the rays of every batch, whoever evaluates it.
    pub fn recording(mut self) -> Self {
        self.record = Some(Mutex::default());
        self
    }

    /// The rays kept since the last call, batch by batch.
    pub fn take_recorded(&self) -> RecordedRays {
        self.record.as_ref().map_or_else(RecordedRays::default, |record| {
            mem::take(&mut record.lock().unwrap_or_else(PoisonError::into_inner))
        })
    }

    /// Looks out for the evaluation that draws the words of that counter.
    pub fn watching(mut self, counter: Counter) -> Self {
        self.watch = Some(Watch { counter, seen: OnceLock::new() });
        self
    }

    /// The evaluation that was looked out for, once it has been.
    pub fn watched(&self) -> Option<&Evaluation> {
        self.watch.as_ref().and_then(|watch| watch.seen.get())
    }

    /// Evaluates the proposal of one lane and tells how, the same to the bit as in a batch; of a point that leaves `open` what
    /// it chooses, the sum of all outcomes.
    pub fn walk(
        &self,
        proposals: &mut Proposals,
        (lane, open): (usize, bool),
        narration: &mut Narration,
    ) -> (Contribution, Elsewhere, Causes) {
        if self.kind == MappingKind::Unidirectional {
            let (contribution, causes) = scalar::walk(self.scene, &self.layout, proposals, lane, narration);
            return (contribution, Elsewhere::new(1), causes);
        }
        bidirectional::scalar::walk(self, proposals, (lane, open), narration)
    }

    /// Goes through an evaluation once more: what it contributes, there and elsewhere, why that had to be settled, and all
    /// that happens on the way.
    pub fn retrace(&self, evaluation: &Evaluation) -> Retraced {
        let given = evaluation.point.to_points();
        let (counters, moves) = ([evaluation.counter], [Move::Given]);
        let mut points = Points::new(1);
        let mut proposals = Proposals {
            rng: Rng::new(0), // all blocks are given
            current: &given,
            given: &given,
            points: &mut points,
            counters: &counters,
            moves: &moves,
            film: [1, 1],
        };
        proposals.begin(&mut Vec::new());
        let mut narration = Narration::kept();
        let (contribution, elsewhere, causes) =
            self.walk(&mut proposals, (0, evaluation.origin == Origin::Open), &mut narration);
        Retraced { contribution, elsewhere, causes, events: narration.events() }
    }
}

/// An evaluation, told.
pub struct Retraced {
    /// What the point contributes.
    pub contribution: Contribution,
    /// What it gives to the film elsewhere; of one lane.
    pub elsewhere: Elsewhere,
    /// Why how many of its values had to be settled.
    pub causes: Causes,
    /// What happens on the way, in order.
    pub events: Vec<Event>,
}

/// The batch, and the batch of open points.
fn kernels<P: Profile>(kind: MappingKind) -> (Evaluate, Evaluate) {
    (evaluate::<P>(kind), bidirectional::open::<P>)
}

fn evaluate<P: Profile>(kind: MappingKind) -> Evaluate {
    match kind {
        MappingKind::Unidirectional => unidirectional::evaluate::<P>,
        MappingKind::Multiplexed => bidirectional::multiplexed::<P>,
        _ => bidirectional::evaluate::<P>,
    }
}
