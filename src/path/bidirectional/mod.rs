//! Mappings that start paths at both ends, in batches: all lanes a bounce at a time, light subpaths first.
//!
//! Primary samples are those of the unidirectional mapping, so that the camera's subpath and its next-event estimation
//! are the same, and a second stream for the light's subpath. Vertices of light subpaths are connected to the lens as
//! they come and, where vertices of both subpaths are joined, kept until the camera's come. The rays that are alive stay
//! compacted at the front of the arrays, so packets stay full; shadow rays are traced once a bounce.
//!
//! Source: Veach & Guibas 1995, "Optimally combining sampling techniques for Monte Carlo rendering" (bidirectional path
//! tracing); Hachisuka et al. 2014, "Multiplexed Metropolis light transport".

mod connections;
mod inversion;
mod lengths;
pub(super) mod scalar;
mod side_by_side;
mod subpath;
mod techniques;
mod views;
mod weights;

pub(super) use inversion::change_technique;
pub use lengths::{Chosen, Lengths};
pub use techniques::Techniques;

use connections::Seen;
use subpath::{Arrival, CameraEnd, LightEdge, LightVertex, PLAIN, Particle, Site};
use weights::Step;

use super::{
    Causes, Contribution, Contributions, FilmSplat, Mapping, Outcome, Workspace,
    tracing::{Kind, Tracing},
    vertex::{Carried, Connection, Decisions, Edge},
};
use crate::{
    embree::{Hits, MISS, Rays},
    rng::unit_f32,
    sample::{Move, Proposals},
    scene::{Mixture, NO_LIGHT, Profile, Rgb, Scattering, Surface, lights::Emission},
};

/// What becomes of the techniques.
#[derive(Clone, Copy, Default, PartialEq, Eq)]
enum How {
    /// All are summed up.
    #[default]
    Sum,
    /// Points choose one of them.
    One,
    /// All are listed, each with the probability that a point chooses it.
    Open,
}

/// Arrays that evaluating a batch fills; reused, so that nothing is allocated once they have grown.
#[derive(Default)]
pub(super) struct Arrays {
    /// What becomes of the batch's techniques.
    how: How,
    /// Lanes that do not rest.
    live: Vec<u32>,
    /// By lane: position on the film, place on the lens, radiance there.
    film: Vec<[f32; 2]>,
    lens: Vec<[f32; 2]>,
    radiance: Vec<Rgb>,
    /// Technique of each lane, where points choose one.
    chosen: Vec<Chosen>,
    /// Lanes whose subpaths are alive, in step with `rays`, `steps`, and `particles` or `carried`.
    lanes: Vec<u32>,
    rays: Rays,
    steps: Vec<Step>,
    particles: Vec<Particle>,
    carried: Vec<Carried>,
    /// Whether camera subpaths have met nothing but perfect lobes, in step with `carried`.
    specular: Vec<bool>,
    /// Starts of light subpaths, in step with `lanes` along their first edges.
    emissions: Vec<Emission>,
    hits: Hits,
    /// Rays that hit something: their indices and lanes.
    hit_slots: Vec<u32>,
    hit_lanes: Vec<u32>,
    /// Vertices of light subpaths by number and lane, and how many each lane has.
    vertices: Vec<LightVertex>,
    kept: Vec<u16>,
    /// Scattering functions of those that are not plain.
    mixtures: Vec<Mixture>,
    waiting: Waiting,
    /// Vertices of either kind of subpath side by side; there from the first time on that there are any, but while they are
    /// lent out.
    light_group: Option<Box<side_by_side::light::Group>>,
    camera_group: Option<Box<side_by_side::camera::Group>>,
}

impl Arrays {
    /// Goes through all hits, by slot and lane, one by one; how many subpaths go on.
    #[inline(always)]
    fn at_each_hit(&mut self, mut scatter: impl FnMut(&mut Arrays, [u32; 2], usize) -> usize) -> usize {
        let mut kept = 0;
        // the lists are lent out while the other arrays are written to
        let (slots, lanes) = (std::mem::take(&mut self.hit_slots), std::mem::take(&mut self.hit_lanes));
        for (&slot, &lane) in slots.iter().zip(&lanes) {
            kept = scatter(self, [slot, lane], kept);
        }
        (self.hit_slots, self.hit_lanes) = (slots, lanes);
        kept
    }

    /// The edge with which the `place`-th light subpath that goes on does so.
    #[inline(always)]
    fn go_on_from_light(&mut self, place: usize, lane: u32, edge: &LightEdge) {
        self.lanes[place] = lane;
        self.particles[place] = edge.particle;
        self.steps[place] = edge.step;
        self.rays.set(place, edge.origin, edge.direction, f32::MAX);
    }

    /// The edge with which the `place`-th camera subpath that goes on does so, `slot` being where its last one is.
    #[inline(always)]
    fn go_on_from_camera(&mut self, place: usize, [slot, lane]: [u32; 2], edge: &Edge, step: Step) {
        self.lanes[place] = lane;
        self.carried[place] = edge.carried;
        self.specular[place] = self.specular[slot as usize] && edge.carried.pdf == f32::INFINITY;
        self.steps[place] = step;
        self.rays.set(place, edge.origin, edge.direction, f32::MAX);
    }
}

/// Contributions that wait for their shadow rays.
#[derive(Default)]
struct Waiting {
    rays: Rays,
    lanes: Vec<u32>,
    contributions: Vec<Rgb>,
    /// Positions of splats on the film; none for connections to camera subpaths.
    films: Vec<[f32; 2]>,
    /// Chances of outcomes, where these are told apart.
    chances: Vec<f32>,
    occluded: Vec<bool>,
}

impl Waiting {
    fn clear(&mut self) {
        self.rays.clear();
        self.lanes.clear();
        self.contributions.clear();
        self.films.clear();
        self.chances.clear();
    }

    fn add(&mut self, lane: u32, connection: &Connection) {
        self.rays.push(connection.origin, connection.direction, connection.tfar);
        self.lanes.push(lane);
        self.contributions.push(connection.contribution);
    }

    fn add_splat(&mut self, lane: u32, seen: &Seen) {
        self.add(lane, &seen.connection);
        self.films.push(seen.film);
    }

    fn trace(&mut self, mapping: &Mapping, tracing: &mut Tracing, out: &mut Contributions) {
        tracing.occluded(mapping.scene(), mapping.widths(), &self.rays, &mut self.occluded, out);
    }

    /// The contributions that nothing is in the way of, by their places in the lists.
    fn seen(&self) -> impl Iterator<Item = usize> {
        self.occluded.iter().enumerate().filter(|(_, occluded)| !**occluded).map(|(i, _)| i)
    }
}

/// All techniques of a batch.
pub(super) fn evaluate<P: Profile>(
    mapping: &Mapping,
    proposals: &mut Proposals,
    out: &mut Contributions,
    workspace: &mut Workspace,
) {
    trace_both::<P>(How::Sum, mapping, proposals, out, workspace);
}

/// One technique for each point of a batch.
pub(super) fn multiplexed<P: Profile>(
    mapping: &Mapping,
    proposals: &mut Proposals,
    out: &mut Contributions,
    workspace: &mut Workspace,
) {
    trace_both::<P>(How::One, mapping, proposals, out, workspace);
}

/// All techniques of a batch of points that could choose one, each by itself.
pub(super) fn open<P: Profile>(
    mapping: &Mapping,
    proposals: &mut Proposals,
    out: &mut Contributions,
    workspace: &mut Workspace,
) {
    trace_both::<P>(How::Open, mapping, proposals, out, workspace);
}

fn trace_both<P: Profile>(
    how: How,
    mapping: &Mapping,
    proposals: &mut Proposals,
    out: &mut Contributions,
    workspace: &mut Workspace,
) {
    let Workspace { tracing, bidirectional: w, .. } = workspace;
    w.how = how;
    begin(mapping, proposals, out, w);
    follow_light::<P>(mapping, proposals, out, tracing, w);
    if mapping.kind().techniques().follow_camera() {
        follow_camera::<P>(mapping, proposals, out, tracing, w);
    }
    if w.how == How::Open && mapping.views_left_open() {
        views::look::<P>(mapping, proposals, tracing, w, out);
    }
    if w.how == How::Open { settle_outcomes(proposals, out) } else { settle(proposals, w, out) }
}

/// Draws what is chosen for both subpaths, and forgets all lanes' past.
fn begin(mapping: &Mapping, proposals: &mut Proposals, out: &mut Contributions, w: &mut Arrays) {
    proposals.begin(&mut w.live);
    proposals.draw(0, &w.live);
    if let Some(block) = mapping.layout().light_choices() {
        proposals.draw(block, &w.live);
    }
    let lanes = proposals.lanes();
    w.radiance.clear();
    w.radiance.resize(lanes, Rgb::ZERO);
    w.film.resize(lanes, [0.0; 2]);
    w.lens.resize(lanes, [0.0; 2]);
    w.kept.clear();
    w.kept.resize(lanes, 0);
    w.mixtures.clear();
    if w.how == How::One {
        w.chosen.resize(lanes, Chosen::NONE);
    }
    for &lane in &w.live {
        let at = lane as usize;
        let [x, y, u, v] = proposals.block(0, at).map(unit_f32);
        (w.film[at], w.lens[at]) = ([x, y], [u, v]);
        out.elsewhere.clear(at);
        if w.how == How::Open {
            out.outcomes.clear(at);
            out.lanes[at] = Contribution { film: [x, y], ..Contribution::NONE };
        }
        if w.how == How::One
            && let Some(block) = mapping.layout().light_choices()
        {
            w.chosen[at] = mapping.lengths().choose(proposals.block(block, at));
        }
    }
}

/// Light subpaths: connects their vertices to the lens and keeps those that will be joined.
fn follow_light<P: Profile>(
    mapping: &Mapping,
    proposals: &mut Proposals,
    out: &mut Contributions,
    tracing: &mut Tracing,
    w: &mut Arrays,
) {
    let (scene, layout) = (mapping.scene(), mapping.layout());
    start_at_light::<P>(mapping, proposals, out, tracing, w);
    // a path through vertex number j has an edge more, to the lens
    for j in 1..layout.max_depth() {
        if w.lanes.is_empty() {
            break;
        }
        tracing.closest(scene, mapping.widths(), Kind::Bounce, &w.rays, &mut w.hits, out);
        keep_hits(w);
        proposals.draw(layout.light_bounce(j - 1), &w.hit_lanes);
        w.waiting.clear();
        scatter_light::<P>(mapping, j, proposals, w);
        splat(mapping, tracing, w, out);
    }
}

/// Starts a light subpath in every lane that has one, and connects the place where it starts to the lens.
fn start_at_light<P: Profile>(
    mapping: &Mapping,
    proposals: &mut Proposals,
    out: &mut Contributions,
    tracing: &mut Tracing,
    w: &mut Arrays,
) {
    let (scene, layout, techniques) = (mapping.scene(), mapping.layout(), mapping.kind().techniques());
    begin_subpaths(w, |chosen| chosen.light > 1);
    proposals.draw(layout.emission(), &w.lanes);
    w.particles.clear();
    w.emissions.clear();
    w.waiting.clear();
    let mut kept = 0;
    for i in 0..w.lanes.len() {
        let lane = w.lanes[i];
        let Some(emission) = emit::<P>(mapping, proposals, lane as usize) else { continue };
        if let Some(seen) = connections::lamp_to_camera(scene, techniques, &emission, w.lens[lane as usize]) {
            w.waiting.add_splat(lane, &seen);
        }
        if emission.weight == Rgb::ZERO {
            continue;
        }
        w.lanes[kept] = lane;
        kept += 1;
        w.rays.push(subpath::start_of(&emission), emission.direction, f32::MAX);
        w.particles.push(Particle::new(emission.weight));
        w.emissions.push(emission);
    }
    w.lanes.truncate(kept);
    if techniques.lamp {
        splat(mapping, tracing, w, out);
    }
}

/// Lists the lanes that have a subpath of one kind, all of them where points do not choose, and forgets old rays.
fn begin_subpaths(w: &mut Arrays, has: impl Fn(&Chosen) -> bool) {
    w.lanes.clear();
    w.lanes.extend(w.live.iter().filter(|lane| w.how != How::One || has(&w.chosen[**lane as usize])));
    w.rays.clear();
    w.steps.resize(w.live.len(), Step::NOWHERE);
}

/// The start of a lane's light subpath.
fn emit<P: Profile>(mapping: &Mapping, proposals: &Proposals, lane: usize) -> Option<Emission> {
    let layout = mapping.layout();
    let [a, b, c, d] = proposals.block(layout.emission(), lane).map(unit_f32);
    let choice = layout.light_choices().map_or(0, |block| proposals.block(block, lane)[0]);
    mapping.scene().emitters.emit::<P>([a, b], [c, d], unit_f32(choice))
}

/// Lists the rays that hit something.
fn keep_hits(w: &mut Arrays) {
    w.hit_slots.clear();
    w.hit_lanes.clear();
    for (i, lane) in w.lanes.iter().enumerate() {
        if w.hits.geometry[i] != MISS {
            w.hit_slots.push(i as u32);
            w.hit_lanes.push(*lane);
        }
    }
}

/// At every hit of a light subpath: the lens to connect to, and the next edge, which replaces the one that led here.
fn scatter_light<P: Profile>(mapping: &Mapping, j: u16, proposals: &Proposals, w: &mut Arrays) {
    let row = if w.how == How::One { 0 } else { usize::from(j - 1) * proposals.lanes() };
    if mapping.kind().techniques().inner && w.vertices.len() < row + proposals.lanes() {
        w.vertices.resize(row + proposals.lanes(), LightVertex::NOWHERE);
    }
    let kept = if P::FLAT_MESHES && !P::VARYING {
        side_by_side::light::scatter_light::<P>(mapping, j, proposals, w)
    } else {
        w.at_each_hit(|w, hit, kept| scatter_light_one::<P>(mapping, j, proposals, w, hit, kept))
    };
    w.lanes.truncate(kept);
    w.particles.truncate(kept);
    w.rays.truncate(kept);
}

/// At one hit; returns how many subpaths have gone on then, `kept` before.
#[inline(always)]
fn scatter_light_one<P: Profile>(
    mapping: &Mapping,
    j: u16,
    proposals: &Proposals,
    w: &mut Arrays,
    [slot, lane]: [u32; 2],
    kept: usize,
) -> usize {
    let (scene, layout, techniques) = (mapping.scene(), mapping.layout(), mapping.kind().techniques());
    let (i, at) = (slot as usize, lane as usize);
    let (origin, direction) = (w.rays.origin(i), w.rays.direction(i));
    let hit = w.hits.get(i).expect("misses are gone");
    let surface = scene.surface::<P>(hit, origin, direction);
    let particle = w.particles[i];
    let arrival: Arrival = if j == 1 {
        particle.arrive_from_light::<P>(scene, techniques, &w.emissions[i], &surface)
    } else {
        particle.arrive_after(&w.steps[i], origin, direction, &surface)
    };
    let site = Site::of(&surface);
    let last = is_last(w, lane, j);
    if w.how != How::One || last && w.chosen[at].camera == 1 {
        let seen = connections::to_camera::<P>(scene, techniques, &arrival, &site, w.lens[at], j);
        if let Some(seen) = seen {
            add_splat(mapping, j, w, lane, seen, arrival.survival);
        }
    }
    if techniques.inner && (w.how != How::One || last && w.chosen[at].camera > 1) {
        let mixture = match &surface.scattering {
            Scattering::Plain(_) => PLAIN,
            Scattering::Mixed(mixture) => {
                w.mixtures.push(mixture.clone());
                w.mixtures.len() as u32 - 1
            }
        };
        keep_vertex(j, proposals, w, lane, LightVertex::new(&surface, mixture, &arrival));
    }
    if last || j + 1 == layout.max_depth() {
        return kept;
    }
    let block = proposals.block(layout.light_bounce(j - 1), at);
    let decisions = Decisions::of_light(layout, j - 1, block, w.how != How::One);
    let Some(edge) = subpath::scatter_light::<P>(&site, &arrival, &decisions, techniques, j) else { return kept };
    w.go_on_from_light(kept, lane, &edge);
    kept + 1
}

/// Whether a light subpath is as long as its point chose when it has come to its vertex number `j`.
#[inline(always)]
fn is_last(w: &Arrays, lane: u32, j: u16) -> bool {
    w.how == How::One && w.chosen[lane as usize].light == j + 1
}

/// Keeps what is seen of a lane's vertex number `j` for its shadow ray; roulette has let the subpath come so far with
/// the probability `survival`.
#[inline(always)]
fn add_splat(mapping: &Mapping, j: u16, w: &mut Arrays, lane: u32, mut seen: Seen, survival: f32) {
    if w.how == How::One {
        seen.connection.contribution *= w.chosen[lane as usize].scale;
    }
    w.waiting.add_splat(lane, &seen);
    if w.how == How::Open {
        w.waiting.chances.push(mapping.lengths().chance(j + 1, 1) / survival);
    }
}

/// Keeps a lane's vertex number `j`, to be joined with camera subpaths.
#[inline(always)]
fn keep_vertex(j: u16, proposals: &Proposals, w: &mut Arrays, lane: u32, vertex: LightVertex) {
    let row = if w.how == How::One { 0 } else { usize::from(j - 1) * proposals.lanes() };
    w.vertices[row + lane as usize] = vertex;
    w.kept[lane as usize] = if w.how == How::One { 1 } else { j };
}

/// Traces the shadow rays of splats and puts those that are seen onto the lists of their lanes.
fn splat(mapping: &Mapping, tracing: &mut Tracing, w: &mut Arrays, out: &mut Contributions) {
    let waiting = &mut w.waiting;
    waiting.trace(mapping, tracing, out);
    for i in waiting.seen() {
        let splat = FilmSplat { film: waiting.films[i], rgb: waiting.contributions[i] };
        let lane = waiting.lanes[i] as usize;
        if w.how == How::Open {
            out.outcomes.push(lane, Outcome { splat, own: false, chance: waiting.chances[i], ..Outcome::default() });
        } else {
            out.elsewhere.push(lane, splat);
        }
    }
}

/// Camera subpaths: emission, next-event estimation and the vertices of light subpaths at each of their vertices.
fn follow_camera<P: Profile>(
    mapping: &Mapping,
    proposals: &mut Proposals,
    out: &mut Contributions,
    tracing: &mut Tracing,
    w: &mut Arrays,
) {
    let (scene, layout) = (mapping.scene(), mapping.layout());
    start_at_camera(mapping, w);
    for j in 1..=layout.max_depth() {
        if w.lanes.is_empty() {
            break;
        }
        let kind = if j == 1 { Kind::Camera } else { Kind::Bounce };
        tracing.closest(scene, mapping.widths(), kind, &w.rays, &mut w.hits, out);
        collect_background::<P>(mapping, j, w, out);
        keep_hits(w);
        if j < layout.max_depth() {
            proposals.draw(layout.bounce(j - 1), &w.hit_lanes);
            if let Some(block) = layout.choices(j - 1) {
                proposals.draw(block, &w.hit_lanes);
            }
        }
        w.waiting.clear();
        scatter_camera::<P>(mapping, j, proposals, w, out);
        w.waiting.trace(mapping, tracing, out);
        for i in w.waiting.seen() {
            let (at, rgb) = (w.waiting.lanes[i] as usize, w.waiting.contributions[i]);
            if w.how == How::Open {
                out.outcomes.push(at, outcome(w.film[at], rgb, w.waiting.chances[i]));
            } else {
                w.radiance[at] += rgb;
            }
        }
    }
}

/// Starts a camera subpath in every lane that has one.
fn start_at_camera(mapping: &Mapping, w: &mut Arrays) {
    begin_subpaths(w, |chosen| chosen.camera > 1);
    w.carried.clear();
    w.specular.clear();
    w.specular.resize(w.lanes.len(), true);
    for &lane in &w.lanes {
        let ray = mapping.scene().camera.ray(w.film[lane as usize], w.lens[lane as usize]);
        w.rays.push(ray.origin, ray.direction, ray.tfar);
        w.carried.push(Carried::START);
    }
}

/// Adds the background to the paths that left the scene by their edge number `j`.
fn collect_background<P: Profile>(mapping: &Mapping, j: u16, w: &mut Arrays, out: &mut Contributions) {
    if P::FLAT_MESHES || mapping.scene().emitters.surrounding_light().is_none() {
        return;
    }
    for i in 0..w.lanes.len() {
        let at = w.lanes[i] as usize;
        if w.hits.geometry[i] != MISS || w.how == How::One && !w.chosen[at].is(0, j + 1) {
            continue;
        }
        if w.how != How::Sum && mapping.views_left_open() && w.specular[i] {
            continue;
        }
        let tail = if j == 1 { subpath::STRAIGHT_OUT } else { w.steps[i].arrive_at_infinity() };
        let end = CameraEnd { carried: w.carried[i], tail };
        let techniques = mapping.kind().techniques();
        let radiance = connections::background::<P>(mapping.scene(), techniques, w.rays.direction(i), &end, j);
        if w.how == How::Open {
            if radiance != Rgb::ZERO {
                let chance = mapping.lengths().chance(0, j + 1) / end.carried.survival;
                out.outcomes.push(at, outcome(w.film[at], radiance, chance));
            }
        } else {
            w.radiance[at] += if w.how == How::One { radiance * w.chosen[at].scale } else { radiance };
        }
    }
}

/// At every hit of a camera subpath, its vertex number `j`: emission, connections, and the next edge, which replaces the
/// one that led here.
fn scatter_camera<P: Profile>(
    mapping: &Mapping,
    j: u16,
    proposals: &Proposals,
    w: &mut Arrays,
    out: &mut Contributions,
) {
    let kept = if P::FLAT_MESHES && !P::VARYING {
        side_by_side::camera::scatter_camera::<P>(mapping, j, proposals, w, out)
    } else {
        w.at_each_hit(|w, hit, kept| scatter_camera_one::<P>(mapping, j, proposals, w, out, hit, kept))
    };
    w.lanes.truncate(kept);
    w.carried.truncate(kept);
    w.specular.truncate(kept);
    w.rays.truncate(kept);
}

/// At one hit; returns how many subpaths have gone on then, `kept` before.
#[inline(always)]
fn scatter_camera_one<P: Profile>(
    mapping: &Mapping,
    j: u16,
    proposals: &Proposals,
    w: &mut Arrays,
    out: &mut Contributions,
    [slot, lane]: [u32; 2],
    kept: usize,
) -> usize {
    let (scene, layout, techniques) = (mapping.scene(), mapping.layout(), mapping.kind().techniques());
    let bounce = j - 1;
    let (i, at) = (slot as usize, lane as usize);
    let (origin, direction) = (w.rays.origin(i), w.rays.direction(i));
    let hit = w.hits.get(i).expect("misses are gone");
    let surface = scene.surface::<P>(hit, origin, direction);
    let tail = if j == 1 {
        subpath::arrive_from_eye(scene, &surface, direction, w.lens[at])
    } else {
        w.steps[i].arrive((surface.p - origin).length_squared(), surface.ng.dot(direction).abs())
    };
    let end = CameraEnd { carried: w.carried[i], tail };
    if surface.light != NO_LIGHT {
        collect_hit::<P>(mapping, j, w, out, [slot, lane], &surface, &end);
    }
    if j == layout.max_depth() {
        return kept;
    }
    let choices = layout.choices(bounce).map(|block| proposals.block(block, at));
    let mut decisions = Decisions::new(layout, bounce, proposals.block(layout.bounce(bounce), at), choices);
    let site = Site::of(&surface);
    if w.how != How::One || w.chosen[at].is(1, j + 1) {
        let connection = connections::next_event::<P>(scene, techniques, &site, &end, &decisions, j);
        if let Some(connection) = connection {
            add_connection(mapping, w, lane, connection, [1, j + 1], end.carried.survival);
        }
    }
    if site.scattering.is_smooth::<P>() {
        join::<P>(mapping, j, proposals, w, lane, &end, &site);
    }
    if w.how == How::One {
        if w.chosen[at].camera == j + 1 {
            return kept;
        }
        decisions.survive();
    }
    let Some((edge, step)) = subpath::scatter_camera::<P>(&surface, &end, &decisions, techniques, j) else {
        return kept;
    };
    w.go_on_from_camera(kept, [slot, lane], &edge, step);
    kept + 1
}

/// Adds what a light sends to a camera subpath that hit it with its edge number `j`.
fn collect_hit<P: Profile>(
    mapping: &Mapping,
    j: u16,
    w: &mut Arrays,
    out: &mut Contributions,
    [slot, lane]: [u32; 2],
    surface: &Surface,
    end: &CameraEnd,
) {
    let (i, at) = (slot as usize, lane as usize);
    let left_open = w.how != How::Sum && mapping.views_left_open() && w.specular[i];
    if left_open || w.how == How::One && !w.chosen[at].is(0, j + 1) {
        return;
    }
    let edge = (w.rays.origin(i), w.rays.direction(i));
    let radiance = connections::hit::<P>(mapping.scene(), mapping.kind().techniques(), surface, edge, end, j);
    if w.how == How::Open {
        if radiance != Rgb::ZERO {
            let chance = mapping.lengths().chance(0, j + 1) / end.carried.survival;
            out.outcomes.push(at, outcome(w.film[at], radiance, chance));
        }
    } else {
        w.radiance[at] += if w.how == How::One { radiance * w.chosen[at].scale } else { radiance };
    }
}

/// Keeps a connection by the technique (s, t) for its shadow ray; roulette has let both subpaths come so far with the
/// probability `survival`.
#[inline(always)]
fn add_connection(
    mapping: &Mapping,
    w: &mut Arrays,
    lane: u32,
    mut connection: Connection,
    [s, t]: [u16; 2],
    survival: f32,
) {
    if w.how == How::One {
        connection.contribution *= w.chosen[lane as usize].scale;
    }
    w.waiting.add(lane, &connection);
    if w.how == How::Open {
        w.waiting.chances.push(mapping.lengths().chance(s, t) / survival);
    }
}

/// Connects vertex number `j` of a camera subpath, which scatters smoothly, to all vertices that are kept of the light's.
#[inline(always)]
fn join<P: Profile>(
    mapping: &Mapping,
    j: u16,
    proposals: &Proposals,
    w: &mut Arrays,
    lane: u32,
    end: &CameraEnd,
    site: &Site,
) {
    let (scene, layout, techniques) = (mapping.scene(), mapping.layout(), mapping.kind().techniques());
    let at = lane as usize;
    if !techniques.inner || w.kept[at] == 0 || w.how == How::One && w.chosen[at].camera != j + 1 {
        return;
    }
    // as many edges as both subpaths have, and the one between
    let longest = if w.how == How::One { 1 } else { w.kept[at].min(layout.max_depth() - j - 1) };
    for i in 1..=longest {
        let vertex = &w.vertices[usize::from(i - 1) * proposals.lanes() + at];
        let light = vertex.site::<P>(scene, &w.mixtures);
        let number = if w.how == How::One { w.chosen[at].light - 1 } else { i };
        let survival = vertex.arrival.survival * end.carried.survival;
        let ends = ((&vertex.arrival, &light, number), (end, site, j));
        if let Some(connection) = connections::join::<P>(techniques, ends.0, ends.1) {
            add_connection(mapping, w, lane, connection, [i + 1, j + 1], survival);
        }
    }
}

/// Turns radiances and splats into contributions and settles those that are not finite.
fn settle(proposals: &Proposals, w: &Arrays, out: &mut Contributions) {
    for (lane, m) in proposals.moves.iter().enumerate() {
        if *m != Move::Rest {
            let (contribution, causes) =
                Contribution::settle_whole(w.film[lane], w.radiance[lane], &mut out.elsewhere, lane);
            out.lanes[lane] = contribution;
            if w.how == How::One && w.chosen[lane].scale > 0.0 {
                out.lanes[lane].chance = 1.0 / w.chosen[lane].scale;
            }
            if !causes.is_none() {
                out.faults.note(causes, proposals, lane);
            }
        }
    }
}

/// An outcome at the position that the point's first dimensions name.
fn outcome(film: [f32; 2], rgb: Rgb, chance: f32) -> Outcome {
    Outcome { splat: FilmSplat { film, rgb }, own: true, chance, ..Outcome::default() }
}

/// Settles outcomes that are not finite; the points themselves are dark.
fn settle_outcomes(proposals: &Proposals, out: &mut Contributions) {
    for (lane, m) in proposals.moves.iter().enumerate() {
        if *m != Move::Rest {
            let mut causes = Causes::NONE;
            out.outcomes.of_mut(lane).iter_mut().for_each(|outcome| outcome.settle(&mut causes));
            if !causes.is_none() {
                out.faults.note_open(causes, proposals, lane);
            }
        }
    }
}
