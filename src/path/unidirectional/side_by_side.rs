//! What happens at the vertices of several paths at a time, in scenes of flat meshes.
//!
//! A group of paths goes through a few loops over its lanes. Some only fetch what lies anywhere in memory: corners,
//! materials, triangles of lights. Between them lie those that compute, without branches and on arrays, which the
//! compiler turns into vector instructions. They call what [`vertex`] is made of, so every lane gets the bits that
//! it would have got alone; lanes without a path compute something that nobody looks at, and so do those on materials
//! that are not diffuse, which then go through the vertex alone.

use std::marker::PhantomData;

use glam::Vec2;
use pulp::NullaryFnOnce;

use super::{Arrays, Connection, Edge, shade_one, vertex};
use crate::{
    path::{
        Mapping,
        lanes::{Aims, Choices, Connections, Edges, Ends, N, Vectors},
        vertex::{Carried, Decisions, Roulette},
    },
    sample::Proposals,
    scene::{NO_LIGHT, Profile, Scene, materials::Scatter},
};

/// Vertices of a group of paths, as a structure of arrays; truths are 0 or 1.
#[derive(Default)]
pub(super) struct Group {
    /// The edges that led there.
    ends: Ends,
    throughput: Vectors,
    survival: [f32; N],
    choices: Choices,
    aims: Aims,
    /// To lights.
    connections: Connections,
    /// Next edges, and what they carry.
    next: Edges,
    next_throughput: Vectors,
    next_pdf: [f32; N],
    next_survival: [f32; N],
}

/// The work of a bounce: at every hit emission, a light to connect to, and the next edge, as `shade` does them.
pub(super) struct Shade<'a, P> {
    mapping: &'a Mapping<'a>,
    bounce: u16,
    proposals: &'a Proposals<'a>,
    w: &'a mut Arrays,
    profile: PhantomData<P>,
}

impl<'a, P: Profile> Shade<'a, P> {
    pub fn new(mapping: &'a Mapping<'a>, bounce: u16, proposals: &'a Proposals<'a>, w: &'a mut Arrays) -> Shade<'a, P> {
        Shade { mapping, bounce, proposals, w, profile: PhantomData }
    }
}

impl<P: Profile> NullaryFnOnce for Shade<'_, P> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Shade { mapping, bounce, proposals, w, .. } = self;
        let (scene, lit) = (mapping.scene(), mapping.scene().features.lights() > 0);
        let roulette = mapping.layout().roulette(bounce);
        // the group and the lists are lent out while the other arrays are written to
        let mut group = w.group.take().unwrap_or_default();
        let (slots, lanes) = (std::mem::take(&mut w.hit_slots), std::mem::take(&mut w.hit_lanes));
        w.begin_bounce();
        let mut kept = 0;
        for (slots, lanes) in slots.chunks(N).zip(lanes.chunks(N)) {
            let g = &mut *group;
            fetch_hits(scene, w, slots, g);
            for j in 0..N {
                g.ends.meet(j);
            }
            fetch_sides::<P>(scene, w, slots, lanes, g);
            fetch_choices(mapping, bounce, proposals, lanes, g);
            if lit {
                look_at_lights(g);
            }
            if roulette {
                scatter::<true>(g)
            } else {
                scatter::<false>(g)
            }
            for (j, (&slot, &lane)) in slots.iter().zip(lanes).enumerate() {
                if !g.ends.is_diffuse::<P>(j) {
                    kept = shade_one::<P>(mapping, bounce, proposals, w, [slot, lane], kept);
                    continue;
                }
                if lit && g.connections.any(j) {
                    w.connect(lane, &g.connections.get(j));
                }
                if g.next.any(j) {
                    w.go_on(kept, lane, &g.edge(j));
                    kept += 1;
                }
            }
        }
        w.end_bounce(kept);
        (w.group, w.hit_slots, w.hit_lanes) = (Some(group), slots, lanes);
    }
}

/// Fetches what was hit.
#[inline(always)]
fn fetch_hits(scene: &Scene, w: &Arrays, slots: &[u32], g: &mut Group) {
    for (j, &slot) in slots.iter().enumerate() {
        let i = slot as usize;
        g.ends.fetch(j, scene, &w.rays, &w.hits, i);
        g.throughput.set(j, w.carried[i].throughput);
        g.survival[j] = w.carried[i].survival;
    }
}

/// Fetches the materials, and adds what the surfaces emit.
#[inline(always)]
fn fetch_sides<P: Profile>(scene: &Scene, w: &mut Arrays, slots: &[u32], lanes: &[u32], g: &mut Group) {
    for (j, (&slot, &lane)) in slots.iter().zip(lanes).enumerate() {
        let i = slot as usize;
        let side = g.ends.fetch_side::<P>(j, scene, &w.hits, i);
        if side.light != NO_LIGHT && g.ends.is_diffuse::<P>(j) {
            let place = ([g.ends.p.get(j), g.ends.ng.get(j)], Vec2::ZERO);
            w.radiance[lane as usize] +=
                vertex::emitted::<P>(scene, side.light, place, w.rays.origin(i), &w.carried[i]);
        }
    }
}

/// Fetches the primary samples and the triangles of lights that they choose.
#[inline(always)]
fn fetch_choices(mapping: &Mapping, bounce: u16, proposals: &Proposals, lanes: &[u32], g: &mut Group) {
    let (scene, layout) = (mapping.scene(), mapping.layout());
    let (first, choices) = (layout.bounce(bounce), layout.choices(bounce));
    for (j, &lane) in lanes.iter().enumerate() {
        let choices = choices.map(|block| proposals.block(block, lane as usize));
        let decisions = Decisions::new(layout, bounce, proposals.block(first, lane as usize), choices);
        g.choices.set(j, &decisions);
        g.aims.fetch(j, scene, decisions.light_place, decisions.light);
    }
}

/// Next-event estimation: the lights' contributions if nothing stands between.
#[inline(always)]
fn look_at_lights(g: &mut Group) {
    for j in 0..N {
        let (light, shines) = g.aims.sample_anyhow(j, g.ends.p.get(j), g.ends.ng.get(j));
        let connection = shines.then_some(light).and_then(|light| {
            let (frame, wo) = g.ends.seen(j);
            let evaluation = g.ends.material(j).evaluate(wo, frame.to_local(light.wi));
            vertex::connected(&light, evaluation, &g.carried(j))
        });
        g.connections.set(j, connection.unwrap_or(Connection::NONE), connection.is_some());
    }
}

/// Scattering and, where it is played, roulette.
#[inline(always)]
fn scatter<const ROULETTE: bool>(g: &mut Group) {
    for j in 0..N {
        let (frame, wo) = g.ends.seen(j);
        let (sample, above) = g.ends.material(j).sample_anyhow(wo, g.choices.direction(j));
        let u = g.choices.survival::<ROULETTE>(j);
        let from = (g.ends.p.get(j), g.ends.ng.get(j), &frame);
        let (edge, goes_on) = vertex::scattered(from, sample, &g.carried(j), u, Roulette::Vertex);
        let Edge { origin, direction, carried } = edge;
        g.next.set(j, [origin, direction], above & goes_on);
        g.next_throughput.set(j, carried.throughput);
        g.next_pdf[j] = carried.pdf;
        g.next_survival[j] = carried.survival;
    }
}

impl Group {
    /// What a path carried along the edge that led to its vertex, but for the density, which only emission needs.
    #[inline(always)]
    fn carried(&self, j: usize) -> Carried {
        Carried { throughput: self.throughput.get(j), survival: self.survival[j], ..Carried::START }
    }

    /// Diffuse surfaces refract nothing, so the product of ratios of refractive indices stays 1.
    #[inline(always)]
    fn edge(&self, j: usize) -> Edge {
        let carried = Carried {
            throughput: self.next_throughput.get(j),
            pdf: self.next_pdf[j],
            survival: self.next_survival[j],
            ..Carried::START
        };
        let [origin, direction] = self.next.get(j);
        Edge { origin, direction, carried }
    }
}
