//! The mappings and the choice among them.

use serde::{Deserialize, Serialize};

use super::{
    Contributions, Layout, RecordedRays, Widths, bidirectional,
    bidirectional::{Lengths, Techniques},
    tracing::Tracing,
    unidirectional,
};
use crate::{
    sample::{Block, Points, Proposals},
    scene::{DiffuseProfile, Features, FullProfile, Kernel, PlainProfile, Profile, Scene},
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
    evaluate: Evaluate,
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
        let evaluate = match kernel {
            Kernel::Diffuse => evaluate::<DiffuseProfile>(kind),
            Kernel::Plain => evaluate::<PlainProfile>(kind),
            Kernel::Full => evaluate::<FullProfile>(kind),
        };
        let layout = Layout::new(&scene.features, kind == MappingKind::Multiplexed);
        Mapping {
            scene,
            kind,
            lengths: Lengths::new(layout.max_depth()),
            layout,
            widths,
            technique_changes: false,
            evaluate,
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

    /// Evaluates the proposals of all lanes that do not rest.
    pub fn evaluate(&self, proposals: &mut Proposals, out: &mut Contributions, workspace: &mut Workspace) {
        (self.evaluate)(self, proposals, out, workspace);
    }
}

fn evaluate<P: Profile>(kind: MappingKind) -> Evaluate {
    match kind {
        MappingKind::Unidirectional => unidirectional::evaluate::<P>,
        MappingKind::Multiplexed => bidirectional::multiplexed::<P>,
        _ => bidirectional::evaluate::<P>,
    }
}
