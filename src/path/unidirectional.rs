//! The unidirectional mapping in batches: camera paths with next-event estimation, all lanes a bounce at a time.
//!
//! The rays that are still alive stay compacted at the front of the arrays, so packets stay full. Shadow rays are
//! traced once a bounce.

use super::{
    Contribution, Contributions, Layout,
    vertex::{self, Carried, Decisions},
};
use crate::{
    embree::{Hits, MISS, Rays, Width},
    rng::unit_f32,
    sample::Proposals,
    scene::{DiffuseProfile, FullProfile, Kernel, PlainProfile, Profile, Rgb, Scene},
};

/// Packet widths by kind of ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Widths {
    /// Of camera rays.
    pub camera: Width,
    /// Of rays after a bounce.
    pub bounce: Width,
    /// Of shadow rays.
    pub shadow: Width,
}

/// The mapping of one scene.
pub struct Mapping<'s> {
    scene: &'s Scene,
    layout: Layout,
    widths: Widths,
    kernel: fn(&Mapping, &mut Proposals, &mut Contributions, &mut Workspace),
}

/// Arrays that evaluating a batch fills; reused, so that nothing is allocated once they have grown.
#[derive(Default)]
pub struct Workspace {
    /// Lanes whose paths are alive, in step with `rays` and `carried`.
    lanes: Vec<u32>,
    rays: Rays,
    carried: Vec<Carried>,
    hits: Hits,
    /// Rays that hit something: their indices and lanes.
    hit_slots: Vec<u32>,
    hit_lanes: Vec<u32>,
    /// Radiance and film position of every lane.
    radiance: Vec<Rgb>,
    film: Vec<[f32; 2]>,
    shadow_lanes: Vec<u32>,
    shadow_rays: Rays,
    shadow_contributions: Vec<Rgb>,
    occluded: Vec<bool>,
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
    /// Rays after a bounce.
    pub bounce: Vec<Rays>,
    /// Shadow rays.
    pub shadow: Vec<Rays>,
    /// Hits of camera rays and of those after a bounce, in the order in which they were traced.
    pub hits: Vec<Hits>,
    /// Whether something was in the way of shadow rays, in that order.
    pub occluded: Vec<Vec<bool>>,
}

/// Recorded answers, given again in the order in which they were recorded, round and round.
struct Replay {
    recorded: RecordedRays,
    next_hits: usize,
    next_occluded: usize,
}

impl Workspace {
    /// A workspace that keeps a copy of every ray.
    pub fn recording() -> Workspace {
        Workspace { recording: Some(RecordedRays::default()), ..Workspace::default() }
    }

    /// A workspace that never asks Embree, but takes the answers recorded in evaluations of some points for those of the
    /// same points in the same batches, as often as those are gone through.
    pub fn replaying(recorded: RecordedRays) -> Workspace {
        Workspace { replay: Some(Replay { recorded, next_hits: 0, next_occluded: 0 }), ..Workspace::default() }
    }

    /// The rays kept since the last call.
    pub fn take_recorded(&mut self) -> RecordedRays {
        self.recording.as_mut().map(std::mem::take).unwrap_or_default()
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

impl<'s> Mapping<'s> {
    /// The mapping of that scene, by the smallest kernel that does all it needs.
    pub fn new(scene: &'s Scene, widths: Widths) -> Mapping<'s> {
        Mapping::with_kernel(scene, widths, scene.features.kernel())
    }

    /// The mapping by a given kernel, which must do all that the scene needs.
    pub fn with_kernel(scene: &'s Scene, widths: Widths, kernel: Kernel) -> Mapping<'s> {
        assert!(kernel >= scene.features.kernel(), "the scene needs more than {kernel:?}");
        let kernel = match kernel {
            Kernel::Diffuse => evaluate::<DiffuseProfile>,
            Kernel::Plain => evaluate::<PlainProfile>,
            Kernel::Full => evaluate::<FullProfile>,
        };
        Mapping { scene, layout: Layout::new(&scene.features), widths, kernel }
    }

    /// The scene.
    pub fn scene(&self) -> &'s Scene {
        self.scene
    }

    /// What the primary dimensions decide.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Evaluates the proposals of all lanes that do not rest.
    pub fn evaluate(&self, proposals: &mut Proposals, out: &mut Contributions, workspace: &mut Workspace) {
        (self.kernel)(self, proposals, out, workspace);
    }
}

/// One batch, from primary samples to contributions.
fn evaluate<P: Profile>(
    mapping: &Mapping,
    proposals: &mut Proposals,
    out: &mut Contributions,
    workspace: &mut Workspace,
) {
    start_at_camera(mapping, proposals, workspace);
    let last = mapping.layout.max_depth() - 1;
    for bounce in 0..=last {
        if workspace.lanes.is_empty() {
            break;
        }
        trace(mapping, bounce, workspace, out);
        if bounce == last {
            collect_emission::<P>(mapping.scene, workspace);
            break;
        }
        keep_hits::<P>(mapping.scene, workspace);
        proposals.draw(mapping.layout.bounce(bounce), &workspace.hit_lanes);
        if let Some(block) = mapping.layout.choices(bounce) {
            proposals.draw(block, &workspace.hit_lanes);
        }
        shade::<P>(mapping, bounce, proposals, workspace);
        connect(mapping, workspace, out);
    }
    settle(proposals, workspace, out);
}

/// Draws film positions and places on the lens, and starts a path in every lane that does not rest.
fn start_at_camera(mapping: &Mapping, proposals: &mut Proposals, w: &mut Workspace) {
    proposals.begin(&mut w.lanes);
    proposals.draw(0, &w.lanes);
    w.rays.clear();
    w.carried.clear();
    w.radiance.clear();
    w.radiance.resize(proposals.lanes(), Rgb::ZERO);
    w.film.resize(proposals.lanes(), [0.0; 2]);
    for &lane in &w.lanes {
        let [x, y, u, v] = proposals.block(0, lane as usize).map(unit_f32);
        let ray = mapping.scene.camera.ray([x, y], [u, v]);
        w.film[lane as usize] = [x, y];
        w.rays.push(ray.origin, ray.direction, ray.tfar);
        w.carried.push(Carried::START);
    }
}

/// Finds the closest hits of all live rays.
fn trace(mapping: &Mapping, bounce: u16, w: &mut Workspace, out: &mut Contributions) {
    let width = if bounce == 0 { mapping.widths.camera } else { mapping.widths.bounce };
    match &mut w.replay {
        None => mapping.scene.tracer.closest(width, &w.rays, &mut w.hits),
        Some(replay) => replay.closest(&w.rays, &mut w.hits),
    }
    out.rays += w.rays.len() as u64;
    if let Some(recording) = &mut w.recording {
        (if bounce == 0 { &mut recording.camera } else { &mut recording.bounce }).push(w.rays.clone());
        recording.hits.push(w.hits.clone());
    }
}

/// Adds the background to the paths that left the scene and lists the others.
fn keep_hits<P: Profile>(scene: &Scene, w: &mut Workspace) {
    w.hit_slots.clear();
    w.hit_lanes.clear();
    for i in 0..w.lanes.len() {
        let lane = w.lanes[i];
        if w.hits.geometry[i] == MISS {
            w.radiance[lane as usize] += vertex::background::<P>(scene, w.rays.direction(i), &w.carried[i]);
        } else {
            w.hit_slots.push(i as u32);
            w.hit_lanes.push(lane);
        }
    }
}

/// At every hit: emission, a light to connect to, and the next edge. The edges of the paths that go on replace the
/// ones that led here.
fn shade<P: Profile>(mapping: &Mapping, bounce: u16, proposals: &Proposals, w: &mut Workspace) {
    let (scene, layout) = (mapping.scene, &mapping.layout);
    let (first, choices) = (layout.bounce(bounce), layout.choices(bounce));
    w.shadow_lanes.clear();
    w.shadow_rays.clear();
    w.shadow_contributions.clear();
    let mut kept = 0;
    for (&slot, &lane) in w.hit_slots.iter().zip(&w.hit_lanes) {
        let i = slot as usize;
        let carried = w.carried[i];
        let (origin, direction) = (w.rays.origin(i), w.rays.direction(i));
        let hit = w.hits.get(i).expect("misses are gone");
        let surface = scene.surface::<P>(hit, origin, direction);
        w.radiance[lane as usize] += vertex::emission::<P>(scene, &surface, origin, &carried);

        let choices = choices.map(|block| proposals.block(block, lane as usize));
        let decisions = Decisions::new(layout, bounce, proposals.block(first, lane as usize), choices);
        if let Some(c) = vertex::connection::<P>(scene, &surface, &carried, &decisions) {
            w.shadow_lanes.push(lane);
            w.shadow_rays.push(c.origin, c.direction, c.tfar);
            w.shadow_contributions.push(c.contribution);
        }
        if let Some(edge) = vertex::scatter::<P>(&surface, &carried, &decisions) {
            w.lanes[kept] = lane;
            w.carried[kept] = edge.carried;
            w.rays.set(kept, edge.origin, edge.direction, f32::MAX);
            kept += 1;
        }
    }
    w.lanes.truncate(kept);
    w.carried.truncate(kept);
    w.rays.truncate(kept);
}

/// Traces the shadow rays and adds the lights that are seen.
fn connect(mapping: &Mapping, w: &mut Workspace, out: &mut Contributions) {
    match &mut w.replay {
        None => mapping.scene.tracer.occluded(mapping.widths.shadow, &w.shadow_rays, &mut w.occluded),
        Some(replay) => replay.occluded(&w.shadow_rays, &mut w.occluded),
    }
    out.rays += w.shadow_rays.len() as u64;
    if let Some(recording) = &mut w.recording {
        recording.shadow.push(w.shadow_rays.clone());
        recording.occluded.push(w.occluded.clone());
    }
    for ((&lane, &contribution), &occluded) in w.shadow_lanes.iter().zip(&w.shadow_contributions).zip(&w.occluded) {
        if !occluded {
            w.radiance[lane as usize] += contribution;
        }
    }
}

/// Emission and background at the end of the longest paths, where nothing follows.
fn collect_emission<P: Profile>(scene: &Scene, w: &mut Workspace) {
    for i in 0..w.lanes.len() {
        let (origin, direction, carried) = (w.rays.origin(i), w.rays.direction(i), &w.carried[i]);
        w.radiance[w.lanes[i] as usize] += match w.hits.get(i) {
            Some(hit) => vertex::emission::<P>(scene, &scene.surface::<P>(hit, origin, direction), origin, carried),
            None => vertex::background::<P>(scene, direction, carried),
        };
    }
}

/// Turns radiances into contributions and settles those that are not finite.
fn settle(proposals: &Proposals, w: &Workspace, out: &mut Contributions) {
    for (lane, m) in proposals.moves.iter().enumerate() {
        if *m != crate::sample::Move::Rest {
            let (contribution, fault) = Contribution::settle(w.film[lane], w.radiance[lane]);
            out.lanes[lane] = contribution;
            out.non_finite += u64::from(fault);
        }
    }
}
