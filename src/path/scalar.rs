//! The unidirectional mapping for one point at a time: the specification that the batch is tested against.

use super::{
    Causes, Contribution, Layout,
    vertex::{self, Carried, Connection, Decisions, Roulette},
    walk::{self, Found, Narration, Side},
};
use crate::{
    rng::unit_f32,
    sample::Proposals,
    scene::{FullProfile, NO_LIGHT, Rgb, Scene, Surface},
};

/// Nothing is left out: what is said of one point holds for every kernel, and time is of no concern.
type P = FullProfile;

/// Evaluates the proposal of one lane and tells how. The second value says whether the contribution had to be settled, and
/// why.
///
/// f = Σ over the vertices of the camera path of emission and next-event estimates, each weighted by the power
/// heuristic; unbiased for the measurement of the film position that block 0 names.
pub(super) fn walk(
    scene: &Scene,
    layout: &Layout,
    proposals: &mut Proposals,
    lane: usize,
    narration: &mut Narration,
) -> (Contribution, Causes) {
    let lanes = [lane as u32];
    let mut draw = |block: u16| {
        proposals.draw(block, &lanes);
        proposals.block(block, lane)
    };
    let [x, y, u, v] = draw(0).map(unit_f32);
    let mut ray = scene.camera.ray([x, y], [u, v]);
    narration.tell(|| walk::camera([x, y], [u, v], &ray));
    let mut carried = Carried::START;
    let mut radiance = Rgb::ZERO;

    for bounce in 0..layout.max_depth() {
        let at = (Side::Camera, bounce + 1);
        let Some(hit) = scene.tracer.closest_one(ray.origin, ray.direction, ray.tfar) else {
            let found = vertex::background::<P>(scene, ray.direction, &carried);
            radiance += found;
            narration.tell(|| tell_background(scene, &ray.direction, &carried, found, radiance, at.1));
            break;
        };
        let surface = scene.surface::<P>(hit, ray.origin, ray.direction);
        narration.tell(|| walk::vertex(scene, at, &surface, carried.throughput, f64::from(carried.pdf)));
        let found = vertex::emission::<P>(scene, &surface, ray.origin, &carried);
        radiance += found;
        if surface.light != NO_LIGHT {
            narration.tell(|| tell_emission(scene, &surface, ray.origin, &carried, found, radiance, at.1));
        }
        if bounce + 1 == layout.max_depth() {
            narration.tell(|| walk::ended(at, "paths are no longer"));
            break;
        }
        let first = draw(layout.bounce(bounce));
        let mut decisions = Decisions::new(layout, bounce, first, layout.choices(bounce).map(&mut draw));
        if let Some(c) = vertex::connection::<P>(scene, &surface, &carried, &decisions) {
            let seen = !scene.tracer.occluded_one(c.origin, c.direction, c.tfar);
            if seen {
                radiance += c.contribution;
            }
            narration.tell(|| tell_connection(scene, &surface, &carried, &decisions, (&c, seen), radiance, at.1));
        }
        let Some(edge) = vertex::scatter::<P>(&surface, &carried, &decisions, Roulette::Vertex) else {
            narration.tell(|| {
                decisions.survive();
                let survivor = vertex::scatter::<P>(&surface, &carried, &decisions, Roulette::Vertex);
                walk::ended(at, if survivor.is_some() { "lost at roulette" } else { "absorbed" })
            });
            break;
        };
        let (throughput, density) = (edge.carried.throughput, f64::from(edge.carried.pdf));
        narration.tell(|| walk::scattered(at, &surface, edge.direction, throughput, density));
        (ray.origin, ray.direction, ray.tfar) = (edge.origin, edge.direction, f32::MAX);
        carried = edge.carried;
    }
    Contribution::settle([x, y], radiance)
}

/// Light from beyond the scene, at the end of edge number `edges`.
fn tell_background(
    scene: &Scene,
    direction: &glam::Vec3,
    carried: &Carried,
    contribution: Rgb,
    sum: Rgb,
    edges: u16,
) -> walk::Event {
    let (radiance, pdf) = scene.emitters.surrounding::<P>(*direction).unwrap_or((Rgb::ZERO, 0.0));
    walk::found(Found {
        technique: [0, edges + 1],
        name: "out of the scene",
        factors: vec![("throughput", carried.throughput), ("radiance", radiance)],
        densities: vec![
            ("density of direction", f64::from(carried.pdf)),
            ("density by next-event estimation", f64::from(pdf)),
        ],
        contribution,
        seen: true,
        film: None,
        sum,
    })
}

/// Light of the surface that an edge hits, vertex number `j`.
fn tell_emission(
    scene: &Scene,
    surface: &Surface,
    origin: glam::Vec3,
    carried: &Carried,
    contribution: Rgb,
    sum: Rgb,
    j: u16,
) -> walk::Event {
    let direct = scene.emitters.pdf::<P>(surface.light, origin, surface.p, surface.ng);
    walk::found(Found {
        technique: [0, j + 1],
        name: "hit a light",
        factors: vec![
            ("throughput", carried.throughput),
            ("radiance", scene.emitters.radiance::<P>(surface.light, surface.uv)),
        ],
        densities: vec![
            ("density of direction", f64::from(carried.pdf)),
            ("density by next-event estimation", f64::from(direct)),
        ],
        contribution,
        seen: true,
        film: None,
        sum,
    })
}

/// Next-event estimation at vertex number `j`; also that of the bidirectional mappings.
pub(super) fn tell_connection(
    scene: &Scene,
    surface: &Surface,
    carried: &Carried,
    decisions: &Decisions,
    (connection, seen): (&Connection, bool),
    sum: Rgb,
    j: u16,
) -> walk::Event {
    let sample = scene.emitters.sample::<P>(surface.p, surface.lift, decisions.light_place, decisions.light);
    let (mut factors, mut densities) = (vec![("throughput", carried.throughput)], Vec::new());
    if let Some(light) = sample {
        let scattered = surface.scattering.evaluate::<P>(surface.wo, surface.frame.to_local(light.wi));
        factors.extend([("scattering", scattered.value), ("radiance over density", light.weight)]);
        densities.extend([
            ("density by next-event estimation", f64::from(light.pdf)),
            ("density by scattering", f64::from(scattered.pdf)),
        ]);
    }
    walk::found(Found {
        technique: [1, j + 1],
        name: "next-event estimation",
        factors,
        densities,
        contribution: connection.contribution,
        seen,
        film: None,
        sum,
    })
}
