//! Vertices of camera subpaths.

use pulp::NullaryFnOnce;

use super::{
    super::{
        Arrays, CameraEnd, How, Site, add_connection, collect_hit, connections, join, scatter_camera_one, subpath,
        weights,
    },
    Arrivals, Departures,
};
use crate::{
    math::widest,
    path::{
        Contributions, Mapping,
        lanes::{Aims, Choices, Connections, Edges, Ends, N, Vectors},
        vertex::{self, Carried, Decisions, Edge, Roulette},
    },
    sample::Proposals,
    scene::{
        Camera, Eye, NO_LIGHT, Profile, ScatteringRef, Scene,
        lights::{SHORT_OF_LIGHT, surface_direction_pdf},
        materials::{Evaluation, Scatter},
    },
};

/// Vertices of a group of camera subpaths, as a structure of arrays; truths are 0 or 1.
#[derive(Default)]
pub struct Group {
    /// The edges that led there: what they carry and where they end.
    throughput: Vectors,
    pdf: [f32; N],
    eta: [f32; N],
    survival: [f32; N],
    ends: Ends,
    arrivals: Arrivals,
    /// What the tails of first vertices follow from instead: place on the lens and density of the camera's rays there.
    lens: [[f32; N]; 2],
    seen: [f32; N],
    /// Whether the surface is a light.
    shines: [u32; N],
    choices: Choices,
    aims: Aims,
    /// To lights.
    connections: Connections,
    /// How dense scattering makes them over how dense they are; and the density of the vertex from the light's side, per area,
    /// and that of the direction back to the one before.
    ratio: [f32; N],
    light_density: [f32; N],
    back_pdf: [f32; N],
    weight: [f32; N],
    /// Next edges, and what they carry, but for the density of the direction.
    next: Edges,
    next_throughput: Vectors,
    next_eta: [f32; N],
    next_survival: [f32; N],
    departures: Departures,
}

/// At every hit of a camera subpath, its vertex number `j`: emission, connections, and the next edge, which replaces the one
/// that led here. Returns how many subpaths go on.
pub fn scatter_camera<P: Profile>(
    mapping: &Mapping,
    j: u16,
    proposals: &Proposals,
    w: &mut Arrays,
    out: &mut Contributions,
) -> usize {
    let (scene, layout, techniques) = (mapping.scene(), mapping.layout(), mapping.kind().techniques());
    // the group and the lists are lent out while the other arrays are written to
    let mut group = w.camera_group.take().unwrap_or_default();
    let (slots, lanes) = (std::mem::take(&mut w.hit_slots), std::mem::take(&mut w.hit_lanes));
    let goes_on = j < layout.max_depth();
    let lit = scene.features.lights() > 0;
    let roulette = w.how != How::One && layout.roulette(j - 1);
    let compared = techniques.has(2, j);
    debug_assert!(techniques.hit && techniques.next_event && techniques.light, "weights that leave one of them out");
    let mut kept = 0;
    for (slots, lanes) in slots.chunks(N).zip(lanes.chunks(N)) {
        let g = &mut *group;
        fetch_hits(scene, w, j, [slots, lanes], g);
        widest(Meet { g, camera: &scene.camera, first: j == 1 });
        for (k, &slot) in slots.iter().enumerate() {
            let side = g.ends.fetch_side::<P>(k, scene, &w.hits, slot as usize);
            g.shines[k] = u32::from(side.light != NO_LIGHT);
        }
        if goes_on {
            let looks = fetch_choices(mapping, j, w, proposals, lanes, lit, g);
            let scatters = w.how != How::One || lanes.iter().any(|lane| w.chosen[*lane as usize].camera != j + 1);
            widest(Leave { g, looks, scatters, roulette, compared });
        }
        for (k, (&slot, &lane)) in slots.iter().zip(lanes).enumerate() {
            if !g.ends.is_diffuse::<P>(k) {
                kept = scatter_camera_one::<P>(mapping, j, proposals, w, out, [slot, lane], kept);
                continue;
            }
            if g.shines[k] == 1 {
                let (i, tail) = (slot as usize, g.arrivals.tail.get(k));
                let hit = w.hits.get(i).expect("misses are gone");
                let surface = scene.surface::<P>(hit, w.rays.origin(i), w.rays.direction(i));
                let end = CameraEnd { carried: w.carried[i], tail };
                collect_hit::<P>(mapping, j, w, out, [slot, lane], &surface, &end);
            }
            if !goes_on {
                continue;
            }
            let chosen = (w.how == How::One).then(|| w.chosen[lane as usize]);
            if lit && g.connections.any(k) && chosen.is_none_or(|chosen| chosen.is(1, j + 1)) {
                add_connection(mapping, w, lane, g.connections.get(k), [1, j + 1], g.survival[k]);
            }
            if techniques.inner {
                let end = CameraEnd { carried: g.carried(k), tail: g.arrivals.tail.get(k) };
                join::<P>(mapping, j, proposals, w, lane, &end, &g.site(k, scene));
            }
            if g.next.any(k) && chosen.is_none_or(|chosen| chosen.camera != j + 1) {
                w.go_on_from_camera(kept, [slot, lane], &g.edge(k), g.departures.step.get(k));
                kept += 1;
            }
        }
    }
    (w.camera_group, w.hit_slots, w.hit_lanes) = (Some(group), slots, lanes);
    kept
}

/// Fetches what was hit, and from where.
#[inline(always)]
fn fetch_hits(scene: &Scene, w: &Arrays, j: u16, [slots, lanes]: [&[u32]; 2], g: &mut Group) {
    for (k, (&slot, &lane)) in slots.iter().zip(lanes).enumerate() {
        let i = slot as usize;
        g.ends.fetch(k, scene, &w.rays, &w.hits, i);
        g.arrivals.from.set(k, w.rays.origin(i));
        let carried = &w.carried[i];
        g.throughput.set(k, carried.throughput);
        (g.pdf[k], g.eta[k], g.survival[k]) = (carried.pdf, carried.eta, carried.survival);
        if j == 1 {
            [g.lens[0][k], g.lens[1][k]] = w.lens[lane as usize];
        } else {
            g.arrivals.step.set(k, w.steps[i]);
        }
    }
}

/// Finds where subpaths arrive, which way that faces and how likely that was.
struct Meet<'g> {
    g: &'g mut Group,
    camera: &'g Camera,
    first: bool,
}

impl NullaryFnOnce for Meet<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Meet { g, camera, first } = self;
        for j in 0..N {
            g.arrivals.meet(j, &mut g.ends);
        }
        if !first {
            g.arrivals.follow();
            return;
        }
        let camera = *camera; // what the loop writes to cannot be part of it
        match camera.eye() {
            Eye::Pinhole => see(&camera, Eye::Pinhole, g),
            eye => see(&camera, eye, g),
        }
        for j in 0..N {
            g.arrivals.tail.set(j, subpath::seen_with(g.seen[j], g.arrivals.cos[j]));
        }
    }
}

/// How dense the camera's rays are there.
#[inline(always)]
fn see(camera: &Camera, eye: Eye, g: &mut Group) {
    for j in 0..N {
        g.seen[j] = camera.density_from(eye, g.ends.p.get(j), [g.lens[0][j], g.lens[1][j]]);
    }
}

/// Fetches the primary samples and the triangles of lights that they choose; whether any lane looks at one.
#[inline(always)]
fn fetch_choices(
    mapping: &Mapping,
    j: u16,
    w: &Arrays,
    proposals: &Proposals,
    lanes: &[u32],
    lit: bool,
    g: &mut Group,
) -> bool {
    let (scene, layout, bounce) = (mapping.scene(), mapping.layout(), j - 1);
    let (first, choices) = (layout.bounce(bounce), layout.choices(bounce));
    let mut looks = false;
    for (k, &lane) in lanes.iter().enumerate() {
        let at = lane as usize;
        let choices = choices.map(|block| proposals.block(block, at));
        let decisions = Decisions::new(layout, bounce, proposals.block(first, at), choices);
        g.choices.set(k, &decisions);
        if lit && (w.how != How::One || w.chosen[at].is(1, j + 1)) {
            g.aims.fetch(k, scene, decisions.light_place, decisions.light);
            looks = true;
        }
    }
    looks
}

/// Connects vertices to lights, and scatters there.
struct Leave<'g> {
    g: &'g mut Group,
    /// Whether any look at a light.
    looks: bool,
    /// Whether any go on.
    scatters: bool,
    roulette: bool,
    /// Whether ending a light subpath at the next vertex is one of the techniques.
    compared: bool,
}

impl NullaryFnOnce for Leave<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Leave { g, looks, scatters, roulette, compared } = self;
        if looks {
            look_at_lights(g);
            weigh(compared, g);
        }
        if !scatters {
            return;
        }
        if roulette {
            scatter::<true>(g);
        } else {
            scatter::<false>(g);
        }
        g.departures.follow(&g.arrivals.tail, compared);
    }
}

/// Next-event estimation: the lights' contributions if nothing stands between.
#[inline(always)]
fn look_at_lights(g: &mut Group) {
    for j in 0..N {
        let (p, ng) = (g.ends.p.get(j), g.ends.ng.get(j));
        let (frame, wo) = g.ends.seen(j);
        let material = g.ends.material(j);
        let (light, shines) = g.aims.sample_anyhow(j, p, ng);
        let wi = frame.to_local(light.wi);
        let Evaluation { value, pdf } = material.evaluate(wo, wi);
        let (connection, lit) = connections::looked_at(&light, g.throughput.get(j) * value);
        g.connections.set(j, connection, shines & lit);
        let distance = connection.tfar / SHORT_OF_LIGHT;
        let rest = surface_direction_pdf(light.normals, -light.wi);
        g.ratio[j] = pdf / light.pdf;
        g.light_density[j] = rest * ng.dot(light.wi).abs() / (distance * distance);
        g.back_pdf[j] = material.evaluate(wi, wo).pdf;
    }
}

/// Weighs those by the other techniques.
#[inline(always)]
fn weigh(compared: bool, g: &mut Group) {
    for j in 0..N {
        let (tail, ratio) = (g.arrivals.tail.get(j), f64::from(g.ratio[j]));
        let back = if tail.earlier > 0.0 { f64::from(g.back_pdf[j]) } else { 0.0 };
        let others = ratio * ratio + tail.others(f64::from(g.light_density[j]), back, compared);
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
        let (p, ng) = (g.ends.p.get(j), g.ends.ng.get(j));
        let material = g.ends.material(j);
        let (sample, above) = material.sample_anyhow(wo, g.choices.direction(j));
        let u = g.choices.survival::<ROULETTE>(j);
        let (edge, goes_on) = vertex::scattered((p, ng, &frame), sample, &g.carried(j), u, Roulette::Path);
        let Edge { origin, direction, carried } = edge;
        g.next.set(j, [origin, direction], above & goes_on);
        g.next_throughput.set(j, carried.throughput);
        (g.next_eta[j], g.next_survival[j]) = (carried.eta, carried.survival);
        let back = material.evaluate(frame.to_local(direction), wo).pdf;
        g.departures.set(j, [carried.pdf, back], ng.dot(direction).abs());
    }
}

impl Group {
    #[inline(always)]
    fn carried(&self, j: usize) -> Carried {
        Carried { throughput: self.throughput.get(j), pdf: self.pdf[j], eta: self.eta[j], survival: self.survival[j] }
    }

    #[inline(always)]
    fn site<'s>(&self, j: usize, scene: &'s Scene) -> Site<'s> {
        let ((p, ng), (frame, wo)) = ((self.ends.p.get(j), self.ends.ng.get(j)), self.ends.seen(j));
        Site { p, ng, lift: ng, frame, wo, scattering: ScatteringRef::Plain(scene.material(self.ends.appearance[j])) }
    }

    #[inline(always)]
    fn edge(&self, j: usize) -> Edge {
        let carried = Carried {
            throughput: self.next_throughput.get(j),
            pdf: self.departures.pdf[0][j],
            eta: self.next_eta[j],
            survival: self.next_survival[j],
        };
        let [origin, direction] = self.next.get(j);
        Edge { origin, direction, carried }
    }
}
