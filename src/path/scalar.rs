//! The unidirectional mapping for one point at a time: the specification that the batch is tested against.

use super::{
    Contribution, Layout,
    vertex::{self, Carried, Decisions, Roulette},
};
use crate::{
    rng::unit_f32,
    sample::Proposals,
    scene::{Profile, Rgb, Scene},
};

/// Evaluates the proposal of one lane. The second value says whether the contribution had to be settled.
///
/// f = Σ over the vertices of the camera path of emission and next-event estimates, each weighted by the power
/// heuristic; unbiased for the measurement of the film position that block 0 names.
pub fn evaluate<P: Profile>(
    scene: &Scene,
    layout: &Layout,
    proposals: &mut Proposals,
    lane: usize,
) -> (Contribution, bool) {
    let lanes = [lane as u32];
    let mut draw = |block: u16| {
        proposals.draw(block, &lanes);
        proposals.block(block, lane)
    };
    let [x, y, u, v] = draw(0).map(unit_f32);
    let mut ray = scene.camera.ray([x, y], [u, v]);
    let mut carried = Carried::START;
    let mut radiance = Rgb::ZERO;

    for bounce in 0..layout.max_depth() {
        let Some(hit) = scene.tracer.closest_one(ray.origin, ray.direction, ray.tfar) else {
            radiance += vertex::background::<P>(scene, ray.direction, &carried);
            break;
        };
        let surface = scene.surface::<P>(hit, ray.origin, ray.direction);
        radiance += vertex::emission::<P>(scene, &surface, ray.origin, &carried);
        if bounce + 1 == layout.max_depth() {
            break;
        }
        let first = draw(layout.bounce(bounce));
        let decisions = Decisions::new(layout, bounce, first, layout.choices(bounce).map(&mut draw));
        if let Some(c) = vertex::connection::<P>(scene, &surface, &carried, &decisions)
            && !scene.tracer.occluded_one(c.origin, c.direction, c.tfar)
        {
            radiance += c.contribution;
        }
        let Some(edge) = vertex::scatter::<P>(&surface, &carried, &decisions, Roulette::Vertex) else { break };
        (ray.origin, ray.direction, ray.tfar) = (edge.origin, edge.direction, f32::MAX);
        carried = edge.carried;
    }
    Contribution::settle([x, y], radiance)
}
