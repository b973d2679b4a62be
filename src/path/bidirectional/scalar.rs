//! The bidirectional mappings for one point at a time: the specification that the batch is tested against.

use super::{
    Chosen, connections,
    subpath::{self, Arrival, CameraEnd, LightVertex, PLAIN, Particle, Site},
    weights::Step,
};
use crate::{
    path::{
        Causes, Contribution, Elsewhere, FilmSplat, Mapping, MappingKind,
        scalar::tell_connection,
        vertex::{Carried, Connection, Decisions},
        walk::{self, Found, Narration, Side},
    },
    rng::unit_f32,
    sample::{Block, Proposals},
    scene::{FullProfile, Mixture, NO_LIGHT, Rgb, Scattering, Scene, Surface},
};

/// Nothing is left out: what is said of one point holds for every kernel, and time is of no concern.
type P = FullProfile;

/// Evaluates the proposal of one lane and tells how: the contribution, what it gives to the film elsewhere, and why how many
/// values had to be settled.
///
/// f = Σ over the techniques (s, t) of the mapping of flux · scattering · geometry · scattering · throughput, each weighed
/// by the power heuristic; for the multiplexed mapping one of them over the probability of its choice, where the point does
/// not leave it `open`. Unbiased for the measurement of the film position that block 0 names once splats elsewhere are
/// counted as well.
pub(in crate::path) fn walk(
    mapping: &Mapping,
    proposals: &mut Proposals,
    (lane, open): (usize, bool),
    narration: &mut Narration,
) -> (Contribution, Elsewhere, Causes) {
    let lanes = [lane as u32];
    let mut draw = |block: u16| {
        proposals.draw(block, &lanes);
        proposals.block(block, lane)
    };
    let [x, y, u, v] = draw(0).map(unit_f32);
    let choices = mapping.layout().light_choices().map_or([0; 4], &mut draw);
    let chosen = (mapping.kind() == MappingKind::Multiplexed && !open).then(|| mapping.lengths().choose(choices));
    let mut point = Point {
        mapping,
        film: [x, y],
        lens: [u, v],
        chosen,
        radiance: Rgb::ZERO,
        elsewhere: Elsewhere::new(1),
        vertices: Vec::new(),
        mixtures: Vec::new(),
        splatted: Rgb::ZERO,
        narration,
    };
    if chosen.is_none_or(|chosen| chosen.light > 1) {
        point.follow_light(unit_f32(choices[0]), &mut draw);
    }
    if mapping.kind().techniques().follow_camera() && chosen.is_none_or(|chosen| chosen.camera > 1) {
        point.follow_camera(&mut draw);
    }
    let Point { film, radiance, mut elsewhere, .. } = point;
    let (mut contribution, causes) = Contribution::settle_whole(film, radiance, &mut elsewhere, 0);
    if let Some(chosen) = chosen {
        contribution.chance = 1.0 / chosen.scale;
    }
    (contribution, elsewhere, causes)
}

/// The weighed contribution of a technique by the number of its light vertices and its scale, and what it is told as.
struct Joined {
    connection: Connection,
    scale: f32,
    light_vertices: u16,
}

struct Point<'a, 'n> {
    mapping: &'a Mapping<'a>,
    film: [f32; 2],
    lens: [f32; 2],
    chosen: Option<Chosen>,
    radiance: Rgb,
    elsewhere: Elsewhere,
    vertices: Vec<LightVertex>,
    mixtures: Vec<Mixture>,
    /// The sum of what went to the film elsewhere.
    splatted: Rgb,
    narration: &'n mut Narration,
}

impl Point<'_, '_> {
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

    /// The same of what the end of a camera subpath finds by itself at its vertex number `j`, where nothing but perfect lobes
    /// may lie between it and the lens.
    fn scale_of_view(&self, j: u16, specular: bool) -> Option<f32> {
        let left_open = self.chosen.is_some() && specular && self.mapping.views_left_open();
        self.scale(0, j + 1).filter(|_| !left_open)
    }

    fn is_seen(&self, connection: &Connection) -> bool {
        !self.scene().tracer.occluded_one(connection.origin, connection.direction, connection.tfar)
    }

    /// Adds what the camera sees of the light vertex number `j` − 1, whose flux is `flux`.
    fn splat(&mut self, splat: &connections::Seen, scale: f32, (j, flux): (u16, Rgb)) {
        let seen = self.is_seen(&splat.connection);
        let rgb = splat.connection.contribution * scale;
        if seen {
            self.elsewhere.push(0, FilmSplat { film: splat.film, rgb });
            self.splatted += rgb;
        }
        let sum = self.splatted;
        self.narration.tell(|| {
            walk::found(Found {
                technique: [j, 1],
                name: "seen by the camera",
                factors: vec![("flux", flux)],
                densities: Vec::new(),
                contribution: rgb,
                seen,
                film: Some(splat.film),
                sum,
            })
        });
    }

    /// Tells what a subpath's end found at its vertex number `j`, or beyond it.
    fn tell_hit(&mut self, name: &str, factors: &[(&'static str, Rgb)], density: f64, contribution: Rgb, j: u16) {
        let sum = self.radiance;
        self.narration.tell(|| {
            walk::found(Found {
                technique: [0, j + 1],
                name,
                factors: factors.to_vec(),
                densities: vec![("density of direction", density)],
                contribution,
                seen: true,
                film: None,
                sum,
            })
        });
    }

    fn follow_light(&mut self, choice: f32, draw: &mut impl FnMut(u16) -> Block) {
        let (layout, techniques) = (self.mapping.layout(), self.mapping.kind().techniques());
        let [a, b, c, d] = draw(layout.emission()).map(unit_f32);
        let Some(emission) = self.scene().emitters.emit::<P>([a, b], [c, d], choice) else { return };
        self.narration.tell(|| walk::light(&emission));
        if let Some(seen) = connections::lamp_to_camera(self.scene(), techniques, &emission, self.lens) {
            self.splat(&seen, 1.0, (1, emission.of_place));
        }
        if emission.weight == Rgb::ZERO {
            return;
        }
        let mut particle = Particle::new(emission.weight);
        let (mut origin, mut direction, mut step) = (subpath::start_of(&emission), emission.direction, None);
        for j in 1..layout.max_depth() {
            let scene = self.mapping.scene();
            let at = (Side::Light, j);
            let Some(hit) = scene.tracer.closest_one(origin, direction, f32::MAX) else {
                self.narration.tell(|| walk::ended(at, "left the scene"));
                return;
            };
            let surface = scene.surface::<P>(hit, origin, direction);
            let arrival: Arrival = match &step {
                None => particle.arrive_from_light::<P>(scene, techniques, &emission, &surface),
                Some(step) => particle.arrive_after(step, origin, direction, &surface),
            };
            let density = step.as_ref().map_or(f64::from(emission.pdf_rest), density_of);
            self.narration.tell(|| walk::vertex(scene, at, &surface, arrival.flux, density));
            let site = Site::of(&surface);
            let block = draw(layout.light_bounce(j - 1));
            if let Some(scale) = self.scale(j + 1, 1)
                && let Some(seen) = connections::to_camera::<P>(scene, techniques, &arrival, &site, self.lens, j)
            {
                self.splat(&seen, scale, (j + 1, arrival.flux));
            }
            let mixture = match &surface.scattering {
                Scattering::Plain(_) => PLAIN,
                Scattering::Mixed(mixture) => {
                    self.mixtures.push(mixture.clone());
                    self.mixtures.len() as u32 - 1
                }
            };
            self.vertices.push(LightVertex::new(&surface, mixture, &arrival));
            let mut decisions = Decisions::of_light(layout, j - 1, block, self.chosen.is_none());
            if j + 1 == layout.max_depth() || self.chosen.is_some_and(|chosen| chosen.light == j + 1) {
                self.narration.tell(|| walk::ended(at, "the subpath is as long as it is to be"));
                return;
            }
            let Some(edge) = subpath::scatter_light::<P>(&site, &arrival, &decisions, techniques, j) else {
                self.narration.tell(|| {
                    decisions.survive();
                    let survivor = subpath::scatter_light::<P>(&site, &arrival, &decisions, techniques, j);
                    walk::ended(at, if survivor.is_some() { "lost at roulette" } else { "absorbed" })
                });
                return;
            };
            let (flux, density) = (edge.particle.flux, density_of(&edge.step));
            self.narration.tell(|| walk::scattered(at, &surface, edge.direction, flux, density));
            (origin, direction, particle, step) = (edge.origin, edge.direction, edge.particle, Some(edge.step));
        }
    }

    fn follow_camera(&mut self, draw: &mut impl FnMut(u16) -> Block) {
        let (layout, techniques) = (self.mapping.layout(), self.mapping.kind().techniques());
        let scene = self.mapping.scene();
        let mut ray = scene.camera.ray(self.film, self.lens);
        let (film, lens) = (self.film, self.lens);
        self.narration.tell(|| walk::camera(film, lens, &ray));
        let (mut carried, mut step, mut specular) = (Carried::START, None::<Step>, true);
        for j in 1..=layout.max_depth() {
            let at = (Side::Camera, j);
            let Some(hit) = scene.tracer.closest_one(ray.origin, ray.direction, ray.tfar) else {
                let tail = step.as_ref().map_or(subpath::STRAIGHT_OUT, |step| step.arrive_at_infinity());
                if let Some(scale) = self.scale_of_view(j, specular) {
                    let end = CameraEnd { carried, tail };
                    let found = connections::background::<P>(scene, techniques, ray.direction, &end, j) * scale;
                    self.radiance += found;
                    let factors = [("throughput", carried.throughput)];
                    self.tell_hit("out of the scene", &factors, f64::from(carried.pdf), found, j);
                }
                self.narration.tell(|| walk::ended(at, "left the scene"));
                return;
            };
            let surface = scene.surface::<P>(hit, ray.origin, ray.direction);
            let tail = match &step {
                None => subpath::arrive_from_eye(scene, &surface, ray.direction, self.lens),
                Some(step) => {
                    step.arrive((surface.p - ray.origin).length_squared(), surface.ng.dot(ray.direction).abs())
                }
            };
            self.narration.tell(|| walk::vertex(scene, at, &surface, carried.throughput, f64::from(carried.pdf)));
            let end = CameraEnd { carried, tail };
            if let Some(scale) = self.scale_of_view(j, specular) {
                let edge = (ray.origin, ray.direction);
                let found = connections::hit::<P>(scene, techniques, &surface, edge, &end, j) * scale;
                self.radiance += found;
                if surface.light != NO_LIGHT {
                    let radiance = scene.emitters.radiance::<P>(surface.light, surface.uv);
                    let factors = [("throughput", carried.throughput), ("radiance", radiance)];
                    self.tell_hit("hit a light", &factors, f64::from(carried.pdf), found, j);
                }
            }
            if j == layout.max_depth() {
                self.narration.tell(|| walk::ended(at, "paths are no longer"));
                return;
            }
            let first = draw(layout.bounce(j - 1));
            let mut decisions = Decisions::new(layout, j - 1, first, layout.choices(j - 1).map(&mut *draw));
            let site = Site::of(&surface);
            let mut connections: Vec<Joined> = Vec::new();
            let joined = |scale: f32, s: u16| move |connection| Joined { connection, scale, light_vertices: s };
            if let Some(scale) = self.scale(1, j + 1) {
                let light = connections::next_event::<P>(scene, techniques, &site, &end, &decisions, j);
                connections.extend(light.map(joined(scale, 1)));
            }
            if techniques.inner && site.scattering.is_smooth::<P>() {
                for (i, vertex) in (1..layout.max_depth() - j).zip(&self.vertices) {
                    let Some(scale) = self.scale(i + 1, j + 1) else { continue };
                    let light = vertex.site::<P>(scene, &self.mixtures);
                    let join = connections::join::<P>(techniques, (&vertex.arrival, &light, i), (&end, &site, j));
                    connections.extend(join.map(joined(scale, i + 1)));
                }
            }
            for joined in connections {
                self.connect(joined, &surface, &carried, &decisions, j);
            }
            if self.chosen.is_some() {
                decisions.survive();
            }
            if self.chosen.is_some_and(|chosen| chosen.camera == j + 1) {
                self.narration.tell(|| walk::ended(at, "the subpath is as long as it is to be"));
                return;
            }
            let Some((edge, next)) = subpath::scatter_camera::<P>(&surface, &end, &decisions, techniques, j) else {
                self.narration.tell(|| {
                    decisions.survive();
                    let survivor = subpath::scatter_camera::<P>(&surface, &end, &decisions, techniques, j);
                    walk::ended(at, if survivor.is_some() { "lost at roulette" } else { "absorbed" })
                });
                return;
            };
            let (throughput, density) = (edge.carried.throughput, f64::from(edge.carried.pdf));
            self.narration.tell(|| walk::scattered(at, &surface, edge.direction, throughput, density));
            (ray.origin, ray.direction, ray.tfar) = (edge.origin, edge.direction, f32::MAX);
            specular &= edge.carried.pdf == f32::INFINITY;
            (carried, step) = (edge.carried, Some(next));
        }
    }

    /// Adds a connection to vertex number `j` of the camera's subpath.
    fn connect(
        &mut self,
        Joined { connection, scale, light_vertices }: Joined,
        surface: &Surface,
        carried: &Carried,
        decisions: &Decisions,
        j: u16,
    ) {
        let seen = self.is_seen(&connection);
        let contribution = connection.contribution * scale;
        if seen {
            self.radiance += contribution;
        }
        let (scene, sum, vertices) = (self.mapping.scene(), self.radiance, &self.vertices);
        self.narration.tell(|| {
            if light_vertices == 1 {
                let scaled = Connection { contribution, ..connection };
                return tell_connection(scene, surface, carried, decisions, (&scaled, seen), sum, j);
            }
            let flux = vertices[usize::from(light_vertices) - 2].arrival.flux;
            walk::found(Found {
                technique: [light_vertices, j + 1],
                name: "joined",
                factors: vec![("throughput", carried.throughput), ("flux", flux)],
                densities: Vec::new(),
                contribution,
                seen,
                film: None,
                sum,
            })
        });
    }
}

/// The density of a step's direction per solid angle, infinite for a perfect lobe.
fn density_of(step: &Step) -> f64 {
    if step.shorter == 0.0 { f64::INFINITY } else { step.density }
}
