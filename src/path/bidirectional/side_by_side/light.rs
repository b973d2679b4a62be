//! Vertices of light subpaths.

use glam::Vec3;
use pulp::NullaryFnOnce;

use super::{
    super::{
        Arrays, How, LightVertex, Seen, add_splat, connections, is_last, keep_vertex, scatter_light_one, subpath,
        subpath::{Arrival, LightEdge, Particle},
        weights,
    },
    Arrivals, Departures,
};
use crate::{
    math::{offset_origin, widest},
    path::{
        Mapping,
        lanes::{Choices, Connections, Edges, Ends, N, Vectors},
        vertex::Decisions,
    },
    sample::Proposals,
    scene::{
        Camera, Eye, Profile, Sight,
        materials::{Evaluation, Scatter},
    },
};

/// Vertices of a group of light subpaths, as a structure of arrays; truths are 0 or 1.
#[derive(Default)]
pub struct Group {
    /// The edges that led there: what they carry and where they end.
    flux: Vectors,
    survival: [f32; N],
    ends: Ends,
    /// The arrival there.
    arrived: Vectors,
    arrivals: Arrivals,
    /// Place on the lens.
    lens: [[f32; N]; 2],
    choices: Choices,
    /// To the camera, and where that is on the film.
    connections: Connections,
    film: [[f32; N]; 2],
    /// Densities with which they are made from the camera: of the place per area, and of the direction back to the light.
    camera_density: [f32; N],
    back_pdf: [f32; N],
    weight: [f32; N],
    /// Next edges, and what they carry.
    next: Edges,
    next_flux: Vectors,
    next_survival: [f32; N],
    departures: Departures,
}

/// At every hit of a light subpath, its vertex number `j`: the lens to connect to, and the next edge, which replaces the one
/// that led here.
pub fn scatter_light<P: Profile>(mapping: &Mapping, j: u16, proposals: &Proposals, w: &mut Arrays) -> usize {
    let (scene, layout, techniques) = (mapping.scene(), mapping.layout(), mapping.kind().techniques());
    // the group and the lists are lent out while the other arrays are written to
    let mut group = w.light_group.take().unwrap_or_default();
    let (slots, lanes) = (std::mem::take(&mut w.hit_slots), std::mem::take(&mut w.hit_lanes));
    let weighs = techniques.weigh();
    let weighed = weighs.then(|| techniques.has(j, 2));
    let roulette = w.how != How::One && layout.roulette(j - 1);
    let goes_on = j + 1 < layout.max_depth();
    let mut kept = 0;
    for (slots, lanes) in slots.chunks(N).zip(lanes.chunks(N)) {
        let g = &mut *group;
        fetch_hits(mapping, w, j, slots, g);
        widest(Meet { g, weighs });
        for (k, &slot) in slots.iter().enumerate() {
            g.ends.fetch_side::<P>(k, scene, &w.hits, slot as usize);
        }
        fetch_choices(mapping, j, w, proposals, lanes, g);
        let last = |lane: &&u32| is_last(w, **lane, j);
        let looks = w.how != How::One || lanes.iter().filter(last).any(|lane| w.chosen[*lane as usize].camera == 1);
        let goes_on = goes_on && !lanes.iter().all(|lane| is_last(w, *lane, j));
        widest(Leave { g, camera: &scene.camera, looks, weighed, roulette, goes_on });
        for (k, (&slot, &lane)) in slots.iter().zip(lanes).enumerate() {
            if !g.ends.is_diffuse::<P>(k) {
                kept = scatter_light_one::<P>(mapping, j, proposals, w, [slot, lane], kept);
                continue;
            }
            let last = is_last(w, lane, j);
            if g.connections.any(k) && (w.how != How::One || last && w.chosen[lane as usize].camera == 1) {
                add_splat(mapping, j, w, lane, g.splat(k), g.survival[k]);
            }
            if techniques.inner && (w.how != How::One || last && w.chosen[lane as usize].camera > 1) {
                keep_vertex(j, proposals, w, lane, g.vertex(k));
            }
            if goes_on && !last && g.next.any(k) {
                w.go_on_from_light(kept, lane, &g.edge(k));
                kept += 1;
            }
        }
    }
    (w.light_group, w.hit_slots, w.hit_lanes) = (Some(group), slots, lanes);
    kept
}

/// Fetches what was hit, and from where.
#[inline(always)]
fn fetch_hits(mapping: &Mapping, w: &Arrays, j: u16, slots: &[u32], g: &mut Group) {
    let (scene, techniques) = (mapping.scene(), mapping.kind().techniques());
    let weighs = techniques.weigh();
    for (k, &slot) in slots.iter().enumerate() {
        let i = slot as usize;
        g.ends.fetch(k, scene, &w.rays, &w.hits, i);
        g.flux.set(k, w.particles[i].flux);
        g.survival[k] = w.particles[i].survival;
        if weighs {
            let (from, step) = match j {
                1 => (w.emissions[i].origin, subpath::first_step(techniques, &w.emissions[i])),
                _ => (w.rays.origin(i), w.steps[i]),
            };
            g.arrivals.from.set(k, from);
            g.arrivals.step.set(k, step);
        }
    }
}

/// Finds where subpaths arrive, which way that faces and what they bring there.
struct Meet<'g> {
    g: &'g mut Group,
    /// Whether there are other techniques.
    weighs: bool,
}

impl NullaryFnOnce for Meet<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Meet { g, weighs } = self;
        for j in 0..N {
            let cos = g.arrivals.meet(j, &mut g.ends);
            let particle = Particle { flux: g.flux.get(j), survival: g.survival[j] };
            g.arrived.set(j, particle.arrive(cos, subpath::STRAIGHT_OUT).flux);
        }
        if weighs {
            g.arrivals.follow();
        }
    }
}

/// Fetches the primary samples.
#[inline(always)]
fn fetch_choices(mapping: &Mapping, j: u16, w: &Arrays, proposals: &Proposals, lanes: &[u32], g: &mut Group) {
    let layout = mapping.layout();
    for (k, &lane) in lanes.iter().enumerate() {
        let block = proposals.block(layout.light_bounce(j - 1), lane as usize);
        g.choices.set(k, &Decisions::of_light(layout, j - 1, block, true));
        [g.lens[0][k], g.lens[1][k]] = w.lens[lane as usize];
    }
}

/// Connects vertices to the camera, and scatters there.
struct Leave<'g> {
    g: &'g mut Group,
    camera: &'g Camera,
    /// Whether any vertex is connected to the camera.
    looks: bool,
    /// Whether there are other techniques, and if so, whether next-event estimation of the vertex before is one of them.
    weighed: Option<bool>,
    roulette: bool,
    /// Whether any subpath has a further vertex.
    goes_on: bool,
}

impl NullaryFnOnce for Leave<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Leave { g, camera, looks, weighed, roulette, goes_on } = self;
        if looks {
            let camera = *camera; // what the loop writes to cannot be part of it
            match camera.eye() {
                Eye::Pinhole => look(&camera, Eye::Pinhole, g),
                eye => look(&camera, eye, g),
            }
            if let Some(compared) = weighed {
                weigh(compared, g);
            }
        }
        match (goes_on, roulette) {
            (false, _) => return,
            (true, false) => scatter::<false>(g),
            (true, true) => scatter::<true>(g),
        }
        if let Some(compared) = weighed {
            g.departures.follow(&g.arrivals.tail, compared);
        }
    }
}

/// What the camera sees of them, if nothing stands between.
#[inline(always)]
fn look(camera: &Camera, eye: Eye, g: &mut Group) {
    for j in 0..N {
        let (p, ng) = (g.ends.p.get(j), g.ends.ng.get(j));
        let (sight, visible) = camera.sight_anyhow(eye, p, [g.lens[0][j], g.lens[1][j]]);
        let (frame, wo) = g.ends.seen(j);
        let Sight { direction, density, .. } = sight;
        let Evaluation { value, pdf } = g.ends.material(j).evaluate(frame.to_local(direction), wo);
        let density = density * ng.dot(direction).abs();
        let origin = start_towards(p, ng, direction);
        let (seen, lit) = connections::seen_at(&sight, origin, g.arrived.get(j) * value * density);
        g.connections.set(j, seen.connection, visible & lit);
        [g.film[0][j], g.film[1][j]] = seen.film;
        (g.camera_density[j], g.back_pdf[j]) = (density, pdf);
    }
}

/// Weighs that by the other techniques.
#[inline(always)]
fn weigh(compared: bool, g: &mut Group) {
    for j in 0..N {
        let others = g.arrivals.tail.get(j).others(f64::from(g.camera_density[j]), f64::from(g.back_pdf[j]), compared);
        g.weight[j] = weights::weight(others);
    }
    for j in 0..N {
        g.connections.scale(j, g.weight[j]);
    }
}

/// Scattering and, where it is played, roulette.
#[inline(always)]
fn scatter<const ROULETTE: bool>(g: &mut Group) {
    for j in 0..N {
        let (frame, wo) = g.ends.seen(j);
        let material = g.ends.material(j);
        let (sample, above) = material.sample_anyhow(wo, g.choices.direction(j));
        let there = material.evaluate(sample.wi, wo);
        let (direction, back) = (frame.to_world(sample.wi), frame.to_world(wo));
        let (p, ng) = (g.ends.p.get(j), g.ends.ng.get(j));
        let (cos_before, cos) = (ng.dot(back).abs(), ng.dot(direction).abs());
        let arrival = Arrival { flux: g.arrived.get(j), tail: subpath::STRAIGHT_OUT, survival: g.survival[j] };
        let u = g.choices.survival::<ROULETTE>(j);
        let (particle, goes_on) = arrival.scattered(there.value / sample.pdf, [cos_before, cos], u);
        g.next.set(j, [start_towards(p, ng, direction), direction], above & goes_on);
        g.next_flux.set(j, particle.flux);
        g.next_survival[j] = particle.survival;
        g.departures.set(j, [sample.pdf, there.pdf], cos);
    }
}

/// Where a ray in that direction starts.
#[inline(always)]
fn start_towards(p: Vec3, ng: Vec3, direction: Vec3) -> Vec3 {
    offset_origin(p, if ng.dot(direction) >= 0.0 { ng } else { -ng })
}

impl Group {
    #[inline(always)]
    fn splat(&self, j: usize) -> Seen {
        Seen { film: [self.film[0][j], self.film[1][j]], connection: self.connections.get(j) }
    }

    fn vertex(&self, j: usize) -> LightVertex {
        let (frame, wo) = self.ends.seen(j);
        let arrival =
            Arrival { flux: self.arrived.get(j), tail: self.arrivals.tail.get(j), survival: self.survival[j] };
        LightVertex::flat([self.ends.p.get(j), self.ends.ng.get(j)], frame, wo, self.ends.appearance[j], arrival)
    }

    #[inline(always)]
    fn edge(&self, j: usize) -> LightEdge {
        let [origin, direction] = self.next.get(j);
        let particle = Particle { flux: self.next_flux.get(j), survival: self.next_survival[j] };
        LightEdge { origin, direction, particle, step: self.departures.step.get(j) }
    }
}
