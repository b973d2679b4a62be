//! The techniques: what each adds, weighed against the others.

use glam::Vec3;

use super::{
    Techniques,
    subpath::{Arrival, CameraEnd, LEAST_COSINE, Site},
    weights::weight,
};
use crate::{
    path::vertex::{Connection, Decisions},
    scene::{
        NO_LIGHT, Profile, Rgb, Scene, Sight, Surface,
        lights::{Emission, EmitterKind, LightSample, SHORT_OF_LIGHT},
        materials::Evaluation,
    },
};

/// s = 0: light from the surface where a camera subpath ends, its vertex number `j`.
#[inline(always)]
pub(super) fn hit<P: Profile>(
    scene: &Scene,
    techniques: Techniques,
    surface: &Surface,
    (origin, direction): (Vec3, Vec3),
    end: &CameraEnd,
    j: u16,
) -> Rgb {
    if surface.light == NO_LIGHT || !techniques.hit {
        return Rgb::ZERO;
    }
    let radiance = end.carried.throughput * scene.emitters.radiance::<P>(surface.light, surface.uv);
    if j == 1 {
        return radiance;
    }
    let (light, tail) = (surface.light, &end.tail);
    let to = surface.p - origin;
    let per_area = surface.ng.dot(direction).abs() / to.length_squared();
    let direct = scene.emitters.pdf::<P>(light, origin, surface.p, surface.ng) * per_area;
    let mut others = tail.others(f64::from(direct), 0.0, techniques.has(1, j));
    if tail.earlier > 0.0 {
        let [place, rest] = scene.emitters.emission_pdf::<P>(light, [surface.ng, surface.frame.n], -direction);
        others += tail.others(f64::from(place), f64::from(rest), false);
    }
    radiance * weight(others)
}

/// s = 0: light from infinity where a camera subpath leaves the scene by its edge number `j`.
#[inline(always)]
pub(super) fn background<P: Profile>(
    scene: &Scene,
    techniques: Techniques,
    direction: Vec3,
    end: &CameraEnd,
    j: u16,
) -> Rgb {
    if !techniques.hit {
        return Rgb::ZERO;
    }
    let Some((radiance, pdf)) = scene.emitters.surrounding::<P>(direction) else { return Rgb::ZERO };
    let radiance = end.carried.throughput * radiance;
    if j == 1 {
        return radiance;
    }
    let mut others = end.tail.others(f64::from(pdf), 0.0, techniques.has(1, j));
    if end.tail.earlier > 0.0
        && let Some(light) = scene.emitters.surrounding_light()
    {
        let [place, rest] = scene.emitters.emission_pdf::<P>(light, [-direction; 2], -direction);
        others += end.tail.others(f64::from(place), f64::from(rest), false);
    }
    radiance * weight(others)
}

/// s = 1: a place on a light, seen from vertex number `j` of a camera subpath.
#[inline(always)]
pub(super) fn next_event<P: Profile>(
    scene: &Scene,
    techniques: Techniques,
    site: &Site,
    end: &CameraEnd,
    decisions: &Decisions,
    j: u16,
) -> Option<Connection> {
    if !techniques.next_event || !site.scattering.is_smooth::<P>() {
        return None;
    }
    let light = scene.emitters.sample::<P>(site.p, site.lift, decisions.light_place, decisions.light)?;
    let wi = site.frame.to_local(light.wi);
    let Evaluation { value, pdf } = site.scattering.evaluate::<P>(site.wo, wi);
    let (mut connection, lit) = looked_at(&light, end.carried.throughput * value);
    if !lit {
        return None;
    }
    let ratio = if techniques.hit { f64::from(pdf / light.pdf) } else { 0.0 };
    let mut others = ratio * ratio;
    if techniques.light {
        let kind = if P::FLAT_MESHES { EmitterKind::Surface } else { scene.emitters.kind(light.light) };
        let [place, rest] = scene.emitters.emission_pdf::<P>(light.light, light.normals, -light.wi);
        let distance = light.tfar / SHORT_OF_LIGHT;
        let d2 = distance * distance;
        let cos = site.cos(light.wi);
        // by how much likelier light subpaths start there than next-event estimation looks there
        let (place, density) = match kind {
            EmitterKind::Surface if scene.emitters.aims_by_area::<P>(light.light) => (1.0, rest * cos / d2),
            EmitterKind::Surface => {
                // at the rim of a sphere the cosine is 0, as is `rest`
                let cos_light = light.normals[0].dot(light.wi).abs().max(LEAST_COSINE);
                (place * d2 / (light.pdf * cos_light), rest * cos / d2)
            }
            EmitterKind::Point => (1.0, rest * cos / d2),
            EmitterKind::SingleDirection => (1.0, rest * cos),
            EmitterKind::Surrounding => (place / light.pdf, rest * cos),
        };
        let back = if end.tail.earlier > 0.0 { site.scattering.evaluate::<P>(wi, site.wo).pdf } else { 0.0 };
        let place = f64::from(place);
        others += place * place * end.tail.others(f64::from(density), f64::from(back), techniques.has(2, j));
    }
    connection.contribution *= weight(others);
    Some(connection)
}

/// The connection to a place on a light, unless it is black, where that part of its light is scattered. Without a branch, for
/// loops over lanes.
#[inline(always)]
pub(super) fn looked_at(light: &LightSample, scattered: Rgb) -> (Connection, bool) {
    let contribution = scattered * light.weight;
    let connection = Connection { origin: light.origin, direction: light.wi, tfar: light.tfar, contribution };
    (connection, contribution != Rgb::ZERO)
}

/// A splat that is waiting for its shadow ray.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    pub film: [f32; 2],
    pub connection: Connection,
}

/// t = 1: vertex number `j` ≥ 1 of a light subpath, seen through a place on the lens.
#[inline(always)]
pub(super) fn to_camera<P: Profile>(
    scene: &Scene,
    techniques: Techniques,
    arrival: &Arrival,
    site: &Site,
    lens: [f32; 2],
    j: u16,
) -> Option<Seen> {
    if !techniques.light || !site.scattering.is_smooth::<P>() {
        return None;
    }
    let sight = scene.camera.sight(site.p, lens)?;
    let evaluation = site.scattering.evaluate::<P>(site.frame.to_local(sight.direction), site.wo);
    let density = sight.density * site.cos(sight.direction);
    let origin = site.start_towards(sight.direction);
    let (mut seen, lit) = seen_at(&sight, origin, arrival.flux * evaluation.value * density);
    if !lit {
        return None;
    }
    if techniques.weigh() {
        let others = arrival.tail.others(f64::from(density), f64::from(evaluation.pdf), techniques.has(j, 2));
        seen.connection.contribution *= weight(others);
    }
    Some(seen)
}

/// What is seen of a vertex of a light subpath from where rays towards the camera start, unless it is black. Without a branch,
/// for loops over lanes.
#[inline(always)]
pub(super) fn seen_at(sight: &Sight, origin: Vec3, contribution: Rgb) -> (Seen, bool) {
    let (direction, tfar) = (sight.direction, sight.distance * SHORT_OF_LIGHT);
    let connection = Connection { origin, direction, tfar, contribution };
    (Seen { film: sight.film, connection }, contribution != Rgb::ZERO)
}

/// s = t = 1: a place on a lamp, seen through a place on the lens.
pub(super) fn lamp_to_camera(
    scene: &Scene,
    techniques: Techniques,
    emission: &Emission,
    lens: [f32; 2],
) -> Option<Seen> {
    if !techniques.lamp || emission.kind != EmitterKind::Surface {
        return None;
    }
    let sight = scene.camera.sight(emission.origin, lens)?;
    let [geometric, shading] = emission.normals;
    let cos = geometric.dot(sight.direction).abs();
    if shading.dot(sight.direction) <= 0.0 {
        return None;
    }
    let contribution = emission.of_place * (cos * sight.density);
    let facing = geometric * geometric.dot(sight.direction).signum();
    let origin = crate::math::offset_origin(emission.origin, facing);
    (contribution != Rgb::ZERO).then_some(Seen {
        film: sight.film,
        connection: Connection {
            origin,
            direction: sight.direction,
            tfar: sight.distance * SHORT_OF_LIGHT,
            contribution,
        },
    })
}

/// s ≥ 2, t ≥ 2: vertex number `i` ≥ 1 of a light subpath, seen from vertex number `j` ≥ 1 of a camera subpath.
#[inline(always)]
pub(super) fn join<P: Profile>(
    techniques: Techniques,
    (light, light_site, i): (&Arrival, &Site, u16),
    (end, site, j): (&CameraEnd, &Site, u16),
) -> Option<Connection> {
    let about = light_site.p - site.p;
    let origin = site.start_towards(about);
    let to = light_site.p - origin;
    let d2 = to.length_squared();
    if d2 <= 0.0 {
        return None;
    }
    let distance = d2.sqrt();
    let direction = to / distance;
    let wi = site.frame.to_local(direction);
    let here = site.scattering.evaluate::<P>(site.wo, wi);
    if here.value == Rgb::ZERO {
        return None;
    }
    let we = light_site.frame.to_local(-direction);
    let there = light_site.scattering.evaluate::<P>(we, light_site.wo);
    let (cos, cos_light) = (site.cos(direction), light_site.cos(direction));
    let contribution = end.carried.throughput * here.value * light.flux * there.value * (cos_light / d2);
    if contribution == Rgb::ZERO {
        return None;
    }
    let forwards = light_site.scattering.evaluate::<P>(light_site.wo, we).pdf;
    let back = site.scattering.evaluate::<P>(wi, site.wo).pdf;
    let others = light.tail.others(f64::from(here.pdf * cos_light / d2), f64::from(there.pdf), techniques.has(i, 2))
        + end.tail.others(f64::from(forwards * cos / d2), f64::from(back), techniques.has(2, j));
    Some(Connection { origin, direction, tfar: distance * SHORT_OF_LIGHT, contribution: contribution * weight(others) })
}
