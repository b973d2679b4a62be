//! Vertices of light subpaths.

use glam::Vec3;
use pulp::NullaryFnOnce;

use super::{
    super::{
        Arrays, LightVertex, ONE, Seen, add_splat, connections, is_last, keep_vertex, scatter_light_one, subpath,
        subpath::{Arrival, LightEdge, Particle},
        weights,
    },
    Steps, Tails,
};
use crate::{
    math::{offset_origin, widest},
    path::{
        Mapping,
        lanes::{Connections, Ends, N, Vectors},
        vertex::Decisions,
    },
    sample::Proposals,
    scene::{
        Camera, Eye, Profile, Sight,
        materials::{Evaluation, Scatter},
    },
};

/// Vertices of a group of light subpaths, as a structure of arrays; truths are 0 or 1.
pub struct Group {
    /// The edges that led there: where densities take them to start, what they carry, and where they end.
    from: Vectors,
    flux: Vectors,
    survival: [f32; N],
    step: Steps,
    ends: Ends,
    /// The arrival there, and what its tail follows from: square of the distance, |cos|.
    arrived: Vectors,
    distance2: [f32; N],
    cos: [f32; N],
    tail: Tails,
    /// Place on the lens, and primary samples: direction and roulette.
    lens: [[f32; N]; 2],
    chosen_direction: [[f32; N]; 2],
    chosen_survival: [f32; N],
    /// To the camera, and where that is on the film.
    connections: Connections,
    film: [[f32; N]; 2],
    /// Densities with which they are made from the camera: of the place per area, and of the direction back to the light.
    camera_density: [f32; N],
    back_pdf: [f32; N],
    weight: [f32; N],
    /// Next edges, and whether there are any.
    goes_on: [u32; N],
    next_origin: Vectors,
    next_direction: Vectors,
    next_flux: Vectors,
    next_survival: [f32; N],
    /// Densities of their directions, forwards and back, |cos|, and what follows.
    next_pdf: [[f32; N]; 2],
    next_cos: [f32; N],
    next_step: Steps,
}

impl Default for Group {
    fn default() -> Group {
        Group {
            ends: Ends::NONE,
            from: Vectors::ZERO,
            flux: Vectors::ZERO,
            survival: [1.0; N],
            step: Steps::NOWHERE,
            arrived: Vectors::ZERO,
            distance2: [0.0; N],
            cos: [0.0; N],
            tail: Tails::NONE,
            lens: [[0.0; N]; 2],
            chosen_direction: [[0.0; N]; 2],
            chosen_survival: [0.0; N],
            connections: Connections::NONE,
            film: [[0.0; N]; 2],
            camera_density: [0.0; N],
            back_pdf: [0.0; N],
            weight: [0.0; N],
            goes_on: [0; N],
            next_origin: Vectors::ZERO,
            next_direction: Vectors::ZERO,
            next_flux: Vectors::ZERO,
            next_survival: [1.0; N],
            next_pdf: [[0.0; N]; 2],
            next_cos: [0.0; N],
            next_step: Steps::NOWHERE,
        }
    }
}

/// At every hit of a light subpath, its vertex number `j`: the lens to connect to, and the next edge, which replaces the one
/// that led here.
pub fn scatter_light<P: Profile, const HOW: u8>(
    mapping: &Mapping,
    j: u16,
    proposals: &Proposals,
    w: &mut Arrays,
) -> usize {
    let (scene, layout, techniques) = (mapping.scene(), mapping.layout(), mapping.kind().techniques());
    // the group and the lists are lent out while the other arrays are written to
    let mut group = w.light_group.take().unwrap_or_default();
    let (slots, lanes) = (std::mem::take(&mut w.hit_slots), std::mem::take(&mut w.hit_lanes));
    let weighs = techniques.weigh();
    let weighed = weighs.then(|| techniques.has(j, 2));
    let roulette = HOW != ONE && layout.roulette(j - 1);
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
        let last = |lane: &&u32| is_last::<HOW>(w, **lane, j);
        let looks = HOW != ONE || lanes.iter().filter(last).any(|lane| w.chosen[*lane as usize].camera == 1);
        let goes_on = goes_on && !lanes.iter().all(|lane| is_last::<HOW>(w, *lane, j));
        widest(Leave { g, camera: &scene.camera, looks, weighed, roulette, goes_on });
        for (k, (&slot, &lane)) in slots.iter().zip(lanes).enumerate() {
            if !g.ends.is_diffuse::<P>(k) {
                kept = scatter_light_one::<P, HOW>(mapping, j, proposals, w, [slot, lane], kept);
                continue;
            }
            let last = is_last::<HOW>(w, lane, j);
            if g.connections.any[k] == 1 && (HOW != ONE || last && w.chosen[lane as usize].camera == 1) {
                add_splat::<HOW>(mapping, j, w, lane, g.splat(k), g.survival[k]);
            }
            if techniques.inner && (HOW != ONE || last && w.chosen[lane as usize].camera > 1) {
                keep_vertex::<HOW>(j, proposals, w, lane, g.vertex(k));
            }
            if goes_on && !last && g.goes_on[k] == 1 {
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
            g.from.set(k, from);
            g.step.set(k, step);
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
            let cos = g.ends.meet(j).abs();
            let particle = Particle { flux: g.flux.get(j), survival: g.survival[j] };
            g.arrived.set(j, particle.arrive(cos, subpath::STRAIGHT_OUT).flux);
            g.distance2[j] = (g.ends.p.get(j) - g.from.get(j)).length_squared();
            g.cos[j] = cos;
        }
        if weighs {
            for j in 0..N {
                g.tail.set(j, g.step.get(j).arrive(g.distance2[j], g.cos[j]));
            }
        }
    }
}

/// Fetches the primary samples.
#[inline(always)]
fn fetch_choices(mapping: &Mapping, j: u16, w: &Arrays, proposals: &Proposals, lanes: &[u32], g: &mut Group) {
    let layout = mapping.layout();
    for (k, &lane) in lanes.iter().enumerate() {
        let block = proposals.block(layout.light_bounce(j - 1), lane as usize);
        let decisions = Decisions::of_light(layout, j - 1, block, true);
        [g.chosen_direction[0][k], g.chosen_direction[1][k]] = decisions.direction;
        g.chosen_survival[k] = decisions.roulette.unwrap_or(0.0);
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
            step(compared, g);
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
        let others = g.tail.get(j).others(f64::from(g.camera_density[j]), f64::from(g.back_pdf[j]), compared);
        g.weight[j] = weights::weight(others);
    }
    for j in 0..N {
        g.connections.contribution.set(j, g.connections.contribution.get(j) * g.weight[j]);
    }
}

/// Scattering and, where it is played, roulette.
#[inline(always)]
fn scatter<const ROULETTE: bool>(g: &mut Group) {
    for j in 0..N {
        let (frame, wo) = g.ends.seen(j);
        let material = g.ends.material(j);
        let (sample, above) = material.sample_anyhow(wo, [g.chosen_direction[0][j], g.chosen_direction[1][j]]);
        let there = material.evaluate(sample.wi, wo);
        let (direction, back) = (frame.to_world(sample.wi), frame.to_world(wo));
        let (p, ng) = (g.ends.p.get(j), g.ends.ng.get(j));
        let (cos_before, cos) = (ng.dot(back).abs(), ng.dot(direction).abs());
        let arrival = Arrival { flux: g.arrived.get(j), tail: subpath::STRAIGHT_OUT, survival: g.survival[j] };
        let u = ROULETTE.then_some(g.chosen_survival[j]);
        let (particle, goes_on) = arrival.scattered(there.value / sample.pdf, [cos_before, cos], u);
        g.goes_on[j] = u32::from(above & goes_on);
        g.next_origin.set(j, start_towards(p, ng, direction));
        g.next_direction.set(j, direction);
        g.next_flux.set(j, particle.flux);
        g.next_survival[j] = particle.survival;
        [g.next_pdf[0][j], g.next_pdf[1][j]] = [sample.pdf, there.pdf];
        g.next_cos[j] = cos;
    }
}

/// What weights will need of the next edges.
#[inline(always)]
fn step(compared: bool, g: &mut Group) {
    for j in 0..N {
        let densities = Some([g.next_pdf[0][j], g.next_pdf[1][j]]);
        let step = g.tail.get(j).leave(densities, g.next_cos[j], compared);
        g.next_step.set(j, step);
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
        let arrival = Arrival { flux: self.arrived.get(j), tail: self.tail.get(j), survival: self.survival[j] };
        LightVertex::flat([self.ends.p.get(j), self.ends.ng.get(j)], frame, wo, self.ends.appearance[j], arrival)
    }

    #[inline(always)]
    fn edge(&self, j: usize) -> LightEdge {
        LightEdge {
            origin: self.next_origin.get(j),
            direction: self.next_direction.get(j),
            particle: Particle { flux: self.next_flux.get(j), survival: self.next_survival[j] },
            step: self.next_step.get(j),
        }
    }
}
