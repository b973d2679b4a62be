//! The bidirectional mappings for one point at a time: the specification that the batch is tested against.

use super::{
    Chosen, connections,
    subpath::{self, Arrival, CameraEnd, LightVertex, PLAIN, Particle, Site},
};
use crate::{
    path::{
        Contribution, Elsewhere, FilmSplat, Mapping, MappingKind,
        vertex::{Carried, Connection, Decisions},
    },
    rng::unit_f32,
    sample::{Block, Proposals},
    scene::{Mixture, Profile, Rgb, Scattering, Scene},
};

/// Evaluates the proposal of one lane: the contribution, what it gives to the film elsewhere, and how many values had to
/// be settled.
///
/// f = Σ over the techniques (s, t) of the mapping of flux · scattering · geometry · scattering · throughput, each weighed
/// by the power heuristic; for the multiplexed mapping one of them over the probability of its choice. Unbiased for the
/// measurement of the film position that block 0 names once splats elsewhere are counted as well.
pub fn evaluate<P: Profile>(
    mapping: &Mapping,
    proposals: &mut Proposals,
    lane: usize,
) -> (Contribution, Elsewhere, u64) {
    let lanes = [lane as u32];
    let mut draw = |block: u16| {
        proposals.draw(block, &lanes);
        proposals.block(block, lane)
    };
    let [x, y, u, v] = draw(0).map(unit_f32);
    let choices = mapping.layout().light_choices().map_or([0; 4], &mut draw);
    let chosen = (mapping.kind() == MappingKind::Multiplexed).then(|| mapping.lengths().choose(choices));
    let mut point = Point {
        mapping,
        film: [x, y],
        lens: [u, v],
        chosen,
        radiance: Rgb::ZERO,
        elsewhere: Elsewhere::new(1),
        vertices: Vec::new(),
        mixtures: Vec::new(),
    };
    if chosen.is_none_or(|chosen| chosen.light > 1) {
        point.follow_light::<P>(unit_f32(choices[0]), &mut draw);
    }
    if mapping.kind().techniques().follow_camera() && chosen.is_none_or(|chosen| chosen.camera > 1) {
        point.follow_camera::<P>(&mut draw);
    }
    let Point { film, radiance, mut elsewhere, .. } = point;
    let (mut contribution, faults) = Contribution::settle_whole(film, radiance, &mut elsewhere, 0);
    if let Some(chosen) = chosen {
        contribution.chance = 1.0 / chosen.scale;
    }
    (contribution, elsewhere, faults)
}

struct Point<'a> {
    mapping: &'a Mapping<'a>,
    film: [f32; 2],
    lens: [f32; 2],
    chosen: Option<Chosen>,
    radiance: Rgb,
    elsewhere: Elsewhere,
    vertices: Vec<LightVertex>,
    mixtures: Vec<Mixture>,
}

impl Point<'_> {
    fn scene(&self) -> &Scene {
        self.mapping.scene()
    }

    /// What a technique's contribution is multiplied by; `None` where it is not wanted.
    fn scale(&self, s: u16, t: u16) -> Option<f32> {
        match self.chosen {
            None => Some(1.0),
            Some(chosen) => chosen.is(s, t).then_some(chosen.scale),
        }
    }

    fn is_seen(&self, connection: &Connection) -> bool {
        !self.scene().tracer.occluded_one(connection.origin, connection.direction, connection.tfar)
    }

    fn splat(&mut self, seen: &connections::Seen, scale: f32) {
        if self.is_seen(&seen.connection) {
            let rgb = seen.connection.contribution * scale;
            self.elsewhere.push(0, FilmSplat { film: seen.film, rgb });
        }
    }

    fn follow_light<P: Profile>(&mut self, choice: f32, draw: &mut impl FnMut(u16) -> Block) {
        let (layout, techniques) = (self.mapping.layout(), self.mapping.kind().techniques());
        let [a, b, c, d] = draw(layout.emission()).map(unit_f32);
        let Some(emission) = self.scene().emitters.emit::<P>([a, b], [c, d], choice) else { return };
        if let Some(seen) = connections::lamp_to_camera(self.scene(), techniques, &emission, self.lens) {
            self.splat(&seen, 1.0);
        }
        if emission.weight == Rgb::ZERO {
            return;
        }
        let mut particle = Particle::new(emission.weight);
        let (mut origin, mut direction, mut step) = (subpath::start_of(&emission), emission.direction, None);
        for j in 1..layout.max_depth() {
            let scene = self.mapping.scene();
            let Some(hit) = scene.tracer.closest_one(origin, direction, f32::MAX) else { return };
            let surface = scene.surface::<P>(hit, origin, direction);
            let arrival: Arrival = match &step {
                None => particle.arrive_from_light::<P>(scene, techniques, &emission, &surface),
                Some(step) => particle.arrive_after(step, origin, direction, &surface),
            };
            let site = Site::of(&surface);
            let block = draw(layout.light_bounce(j - 1));
            if let Some(scale) = self.scale(j + 1, 1)
                && let Some(seen) = connections::to_camera::<P>(scene, techniques, &arrival, &site, self.lens, j)
            {
                self.splat(&seen, scale);
            }
            let mixture = match &surface.scattering {
                Scattering::Plain(_) => PLAIN,
                Scattering::Mixed(mixture) => {
                    self.mixtures.push(mixture.clone());
                    self.mixtures.len() as u32 - 1
                }
            };
            self.vertices.push(LightVertex::new(&surface, mixture, &arrival));
            let decisions = Decisions::of_light(layout, j - 1, block, self.chosen.is_none());
            if j + 1 == layout.max_depth() || self.chosen.is_some_and(|chosen| chosen.light == j + 1) {
                return;
            }
            let Some(edge) = subpath::scatter_light::<P>(&site, &arrival, &decisions, techniques, j) else { return };
            (origin, direction, particle, step) = (edge.origin, edge.direction, edge.particle, Some(edge.step));
        }
    }

    fn follow_camera<P: Profile>(&mut self, draw: &mut impl FnMut(u16) -> Block) {
        let (layout, techniques) = (self.mapping.layout(), self.mapping.kind().techniques());
        let scene = self.mapping.scene();
        let mut ray = scene.camera.ray(self.film, self.lens);
        let (mut carried, mut step) = (Carried::START, None::<super::weights::Step>);
        for j in 1..=layout.max_depth() {
            let Some(hit) = scene.tracer.closest_one(ray.origin, ray.direction, ray.tfar) else {
                let tail = step.as_ref().map_or(subpath::STRAIGHT_OUT, |step| step.arrive_at_infinity());
                if let Some(scale) = self.scale(0, j + 1) {
                    let end = CameraEnd { carried, tail };
                    self.radiance += connections::background::<P>(scene, techniques, ray.direction, &end, j) * scale;
                }
                return;
            };
            let surface = scene.surface::<P>(hit, ray.origin, ray.direction);
            let tail = match &step {
                None => subpath::arrive_from_eye(scene, &surface, ray.direction, self.lens),
                Some(step) => {
                    step.arrive((surface.p - ray.origin).length_squared(), surface.ng.dot(ray.direction).abs())
                }
            };
            let end = CameraEnd { carried, tail };
            if let Some(scale) = self.scale(0, j + 1) {
                let edge = (ray.origin, ray.direction);
                self.radiance += connections::hit::<P>(scene, techniques, &surface, edge, &end, j) * scale;
            }
            if j == layout.max_depth() {
                return;
            }
            let first = draw(layout.bounce(j - 1));
            let mut decisions = Decisions::new(layout, j - 1, first, layout.choices(j - 1).map(&mut *draw));
            let site = Site::of(&surface);
            let mut connections: Vec<(Connection, f32)> = Vec::new();
            if let Some(scale) = self.scale(1, j + 1) {
                let light = connections::next_event::<P>(scene, techniques, &site, &end, &decisions, j);
                connections.extend(light.map(|c| (c, scale)));
            }
            if techniques.inner && site.scattering.is_smooth::<P>() {
                for (i, vertex) in (1..layout.max_depth() - j).zip(&self.vertices) {
                    let Some(scale) = self.scale(i + 1, j + 1) else { continue };
                    let light = vertex.site::<P>(scene, &self.mixtures);
                    let join = connections::join::<P>(techniques, (&vertex.arrival, &light, i), (&end, &site, j));
                    connections.extend(join.map(|c| (c, scale)));
                }
            }
            for (connection, scale) in connections {
                if self.is_seen(&connection) {
                    self.radiance += connection.contribution * scale;
                }
            }
            if self.chosen.is_some() {
                decisions.survive();
            }
            if self.chosen.is_some_and(|chosen| chosen.camera == j + 1) {
                return;
            }
            let Some((edge, next)) = subpath::scatter_camera::<P>(&surface, &end, &decisions, techniques, j) else {
                return;
            };
            (ray.origin, ray.direction, ray.tfar) = (edge.origin, edge.direction, f32::MAX);
            (carried, step) = (edge.carried, Some(next));
        }
    }
}
