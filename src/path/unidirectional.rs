//! The unidirectional mapping in batches: camera paths with next-event estimation, all lanes a bounce at a time.
//!
//! The rays that are still alive stay compacted at the front of the arrays, so packets stay full. Shadow rays are
//! traced once a bounce.

use super::{
    Contribution, Contributions, Mapping, Workspace,
    tracing::Kind,
    vertex::{self, Carried, Connection, Decisions, Edge, Roulette},
};
use crate::{
    embree::{Hits, MISS, Rays},
    math::widest,
    rng::unit_f32,
    sample::Proposals,
    scene::{Profile, Rgb, Scene},
};

mod side_by_side;

/// Arrays that evaluating a batch fills; reused, so that nothing is allocated once they have grown.
#[derive(Default)]
pub(super) struct Arrays {
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
    /// Vertices that are shaded side by side; there from the first time on that there are any, but while they are lent out.
    group: Option<Box<side_by_side::Group>>,
}

impl Arrays {
    /// Forgets the shadow rays of the bounce before.
    #[inline(always)]
    fn begin_bounce(&mut self) {
        self.shadow_lanes.clear();
        self.shadow_rays.clear();
        self.shadow_contributions.clear();
    }

    /// A light to look at in a lane, once all shadow rays of this bounce are there.
    #[inline(always)]
    fn connect(&mut self, lane: u32, connection: &Connection) {
        self.shadow_lanes.push(lane);
        self.shadow_rays.push(connection.origin, connection.direction, connection.tfar);
        self.shadow_contributions.push(connection.contribution);
    }

    /// The edge with which the `place`-th path that goes on does so.
    #[inline(always)]
    fn go_on(&mut self, place: usize, lane: u32, edge: &Edge) {
        self.lanes[place] = lane;
        self.carried[place] = edge.carried;
        self.rays.set(place, edge.origin, edge.direction, f32::MAX);
    }

    /// No more than so many paths have gone on.
    #[inline(always)]
    fn end_bounce(&mut self, kept: usize) {
        self.lanes.truncate(kept);
        self.carried.truncate(kept);
        self.rays.truncate(kept);
    }
}

/// One batch, from primary samples to contributions.
pub(super) fn evaluate<P: Profile>(
    mapping: &Mapping,
    proposals: &mut Proposals,
    out: &mut Contributions,
    workspace: &mut Workspace,
) {
    let Workspace { tracing, unidirectional: w, .. } = workspace;
    let (scene, widths) = (mapping.scene(), mapping.widths());
    start_at_camera(mapping, proposals, w);
    let last = mapping.layout().max_depth() - 1;
    for bounce in 0..=last {
        if w.lanes.is_empty() {
            break;
        }
        let kind = if bounce == 0 { Kind::Camera } else { Kind::Bounce };
        tracing.closest(scene, widths, kind, &w.rays, &mut w.hits, out);
        if bounce == last {
            collect_emission::<P>(scene, w);
            break;
        }
        keep_hits::<P>(scene, w);
        proposals.draw(mapping.layout().bounce(bounce), &w.hit_lanes);
        if let Some(block) = mapping.layout().choices(bounce) {
            proposals.draw(block, &w.hit_lanes);
        }
        if P::FLAT_MESHES && !P::VARYING {
            widest(side_by_side::Shade::<P>::new(mapping, bounce, proposals, w));
        } else {
            shade::<P>(mapping, bounce, proposals, w);
        }
        tracing.occluded(scene, widths, &w.shadow_rays, &mut w.occluded, out);
        connect(w);
    }
    settle(proposals, w, out);
}

/// Draws film positions and places on the lens, and starts a path in every lane that does not rest.
fn start_at_camera(mapping: &Mapping, proposals: &mut Proposals, w: &mut Arrays) {
    proposals.begin(&mut w.lanes);
    proposals.draw(0, &w.lanes);
    w.rays.clear();
    w.carried.clear();
    w.radiance.clear();
    w.radiance.resize(proposals.lanes(), Rgb::ZERO);
    w.film.resize(proposals.lanes(), [0.0; 2]);
    for &lane in &w.lanes {
        let [x, y, u, v] = proposals.block(0, lane as usize).map(unit_f32);
        let ray = mapping.scene().camera.ray([x, y], [u, v]);
        w.film[lane as usize] = [x, y];
        w.rays.push(ray.origin, ray.direction, ray.tfar);
        w.carried.push(Carried::START);
    }
}

/// Adds the background to the paths that left the scene and lists the others.
fn keep_hits<P: Profile>(scene: &Scene, w: &mut Arrays) {
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
fn shade<P: Profile>(mapping: &Mapping, bounce: u16, proposals: &Proposals, w: &mut Arrays) {
    w.begin_bounce();
    let mut kept = 0;
    let (slots, lanes) = (std::mem::take(&mut w.hit_slots), std::mem::take(&mut w.hit_lanes)); // lent out
    for (&slot, &lane) in slots.iter().zip(&lanes) {
        kept = shade_one::<P>(mapping, bounce, proposals, w, [slot, lane], kept);
    }
    w.end_bounce(kept);
    (w.hit_slots, w.hit_lanes) = (slots, lanes);
}

/// At one hit; returns how many paths have gone on then, `kept` before.
#[inline(always)]
fn shade_one<P: Profile>(
    mapping: &Mapping,
    bounce: u16,
    proposals: &Proposals,
    w: &mut Arrays,
    [slot, lane]: [u32; 2],
    kept: usize,
) -> usize {
    let (scene, layout) = (mapping.scene(), mapping.layout());
    let i = slot as usize;
    let carried = w.carried[i];
    let (origin, direction) = (w.rays.origin(i), w.rays.direction(i));
    let hit = w.hits.get(i).expect("misses are gone");
    let surface = scene.surface::<P>(hit, origin, direction);
    w.radiance[lane as usize] += vertex::emission::<P>(scene, &surface, origin, &carried);

    let choices = layout.choices(bounce).map(|block| proposals.block(block, lane as usize));
    let decisions = Decisions::new(layout, bounce, proposals.block(layout.bounce(bounce), lane as usize), choices);
    if let Some(c) = vertex::connection::<P>(scene, &surface, &carried, &decisions) {
        w.connect(lane, &c);
    }
    let Some(edge) = vertex::scatter::<P>(&surface, &carried, &decisions, Roulette::Vertex) else { return kept };
    w.go_on(kept, lane, &edge);
    kept + 1
}

/// Adds the lights that are seen.
fn connect(w: &mut Arrays) {
    for ((&lane, &contribution), &occluded) in w.shadow_lanes.iter().zip(&w.shadow_contributions).zip(&w.occluded) {
        if !occluded {
            w.radiance[lane as usize] += contribution;
        }
    }
}

/// Emission and background at the end of the longest paths, where nothing follows.
fn collect_emission<P: Profile>(scene: &Scene, w: &mut Arrays) {
    for i in 0..w.lanes.len() {
        let (origin, direction, carried) = (w.rays.origin(i), w.rays.direction(i), &w.carried[i]);
        w.radiance[w.lanes[i] as usize] += match w.hits.get(i) {
            Some(hit) => vertex::emission::<P>(scene, &scene.surface::<P>(hit, origin, direction), origin, carried),
            None => vertex::background::<P>(scene, direction, carried),
        };
    }
}

/// Turns radiances into contributions and settles those that are not finite.
fn settle(proposals: &Proposals, w: &Arrays, out: &mut Contributions) {
    for (lane, m) in proposals.moves.iter().enumerate() {
        if *m != crate::sample::Move::Rest {
            let (contribution, causes) = Contribution::settle(w.film[lane], w.radiance[lane]);
            out.lanes[lane] = contribution;
            if !causes.is_none() {
                out.faults.note(causes, proposals, lane);
            }
        }
    }
}
