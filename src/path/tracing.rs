//! Rays on their way to Embree: traced, and where somebody asked for it, recorded or answered from a record.

use super::Contributions;
use crate::{
    embree::{Hits, Rays, Width},
    scene::Scene,
};

/// Packet widths by kind of ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Widths {
    /// Of camera rays.
    pub camera: Width,
    /// Of rays after a bounce, and of those that leave lights.
    pub bounce: Width,
    /// Of shadow rays.
    pub shadow: Width,
}

/// Rays whose closest hits are wanted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// From the camera: neighbours are alike.
    Camera,
    /// All others.
    Bounce,
}

/// Traces the rays of a workspace.
#[derive(Default)]
pub(super) struct Tracing {
    /// Rays of every kind as they are traced, where somebody asked for them.
    recording: Option<RecordedRays>,
    /// Answers that take the place of tracing, where somebody gave them.
    replay: Option<Replay>,
}

/// The rays of some evaluations, batch by batch, for measuring Embree alone, and what came of them, for measuring all
/// but Embree.
#[derive(Default)]
pub struct RecordedRays {
    /// Camera rays.
    pub camera: Vec<Rays>,
    /// Rays after a bounce, and those that leave lights.
    pub bounce: Vec<Rays>,
    /// Shadow rays.
    pub shadow: Vec<Rays>,
    /// Hits of camera rays and of those after a bounce, in the order in which they were traced.
    pub hits: Vec<Hits>,
    /// Whether something was in the way of shadow rays, in that order.
    pub occluded: Vec<Vec<bool>>,
}

impl RecordedRays {
    /// Number of rays.
    pub fn len(&self) -> usize {
        [&self.camera, &self.bounce, &self.shadow].into_iter().flatten().map(Rays::len).sum()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Adds those of further evaluations.
    pub(super) fn append(&mut self, mut more: RecordedRays) {
        self.camera.append(&mut more.camera);
        self.bounce.append(&mut more.bounce);
        self.shadow.append(&mut more.shadow);
        self.hits.append(&mut more.hits);
        self.occluded.append(&mut more.occluded);
    }

    /// Traces all of them once more and does nothing else.
    pub fn trace(&self, scene: &Scene, widths: Widths, hits: &mut Hits, occluded: &mut Vec<bool>) {
        self.camera.iter().for_each(|rays| scene.tracer.closest(widths.camera, rays, hits));
        self.bounce.iter().for_each(|rays| scene.tracer.closest(widths.bounce, rays, hits));
        self.shadow.iter().for_each(|rays| scene.tracer.occluded(widths.shadow, rays, occluded));
    }
}

/// Recorded answers, given again in the order in which they were recorded, round and round.
struct Replay {
    recorded: RecordedRays,
    next_hits: usize,
    next_occluded: usize,
}

impl Tracing {
    /// Keeps a copy of every ray.
    pub fn recording() -> Tracing {
        Tracing { recording: Some(RecordedRays::default()), replay: None }
    }

    /// Never asks Embree.
    pub fn replaying(recorded: RecordedRays) -> Tracing {
        Tracing { recording: None, replay: Some(Replay { recorded, next_hits: 0, next_occluded: 0 }) }
    }

    /// The rays kept since the last call.
    pub fn take_recorded(&mut self) -> RecordedRays {
        self.recording.as_mut().map(std::mem::take).unwrap_or_default()
    }

    /// Finds the closest hits.
    pub fn closest(
        &mut self,
        scene: &Scene,
        widths: Widths,
        kind: Kind,
        rays: &Rays,
        hits: &mut Hits,
        out: &mut Contributions,
    ) {
        let width = if kind == Kind::Camera { widths.camera } else { widths.bounce };
        match &mut self.replay {
            None => scene.tracer.closest(width, rays, hits),
            Some(replay) => replay.closest(rays, hits),
        }
        out.rays += rays.len() as u64;
        if let Some(recording) = &mut self.recording {
            (if kind == Kind::Camera { &mut recording.camera } else { &mut recording.bounce }).push(rays.clone());
            recording.hits.push(hits.clone());
        }
    }

    /// Finds out which shadow rays meet something.
    pub fn occluded(
        &mut self,
        scene: &Scene,
        widths: Widths,
        rays: &Rays,
        occluded: &mut Vec<bool>,
        out: &mut Contributions,
    ) {
        match &mut self.replay {
            None => scene.tracer.occluded(widths.shadow, rays, occluded),
            Some(replay) => replay.occluded(rays, occluded),
        }
        out.rays += rays.len() as u64;
        if let Some(recording) = &mut self.recording {
            recording.shadow.push(rays.clone());
            recording.occluded.push(occluded.clone());
        }
    }
}

impl Replay {
    fn closest(&mut self, rays: &Rays, hits: &mut Hits) {
        let answers = &self.recorded.hits[self.next_hits];
        debug_assert_eq!(rays.len(), answers.t.len(), "other points than those recorded");
        hits.geometry.clone_from(&answers.geometry);
        hits.primitive.clone_from(&answers.primitive);
        hits.u.clone_from(&answers.u);
        hits.v.clone_from(&answers.v);
        hits.t.clone_from(&answers.t);
        hits.instance.clone_from(&answers.instance);
        self.next_hits = (self.next_hits + 1) % self.recorded.hits.len();
    }

    fn occluded(&mut self, rays: &Rays, occluded: &mut Vec<bool>) {
        let answers = &self.recorded.occluded[self.next_occluded];
        debug_assert_eq!(rays.len(), answers.len(), "other points than those recorded");
        occluded.clone_from(answers);
        self.next_occluded = (self.next_occluded + 1) % self.recorded.occluded.len();
    }
}
