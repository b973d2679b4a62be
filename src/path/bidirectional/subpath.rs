//! What happens at the vertices of both subpaths. The batch and the scalar mapping are both made of these, so that they
//! agree to the bit.

use glam::Vec3;

use super::{
    Techniques,
    weights::{Step, Tail},
};
use crate::{
    math::{Frame, offset_origin},
    path::vertex::{self, Carried, Decisions, Edge, MOST_SURVIVAL, Roulette},
    scene::{
        Mixture, Profile, Rgb, ScatteringRef, Scene, Surface,
        lights::{Emission, EmitterKind},
    },
};

/// A place where a path scatters.
#[derive(Clone, Copy, Debug)]
pub(super) struct Site<'a> {
    pub p: Vec3,
    /// Unit geometric normal.
    pub ng: Vec3,
    /// As in [`Surface`].
    pub lift: Vec3,
    pub frame: Frame,
    /// Local direction to where the subpath came from.
    pub wo: Vec3,
    pub scattering: ScatteringRef<'a>,
}

impl<'a> Site<'a> {
    #[inline(always)]
    pub fn of(surface: &'a Surface<'_>) -> Site<'a> {
        let &Surface { p, ng, lift, frame, wo, ref scattering, .. } = surface;
        Site { p, ng, lift, frame, wo, scattering: scattering.by_reference() }
    }

    /// |cos| between a world direction and the geometric normal.
    #[inline(always)]
    pub fn cos(&self, direction: Vec3) -> f32 {
        self.ng.dot(direction).abs()
    }

    /// Where a ray in about that world direction starts.
    #[inline(always)]
    pub fn start_towards(&self, direction: Vec3) -> Vec3 {
        offset_origin(self.p, if self.lift.dot(direction) >= 0.0 { self.lift } else { -self.lift })
    }
}

/// A vertex of a light subpath, kept until camera subpaths are connected to it.
#[derive(Clone, Copy, Debug)]
pub(super) struct LightVertex {
    p: Vec3,
    ng: Vec3,
    lift: Vec3,
    frame: Frame,
    wo: Vec3,
    appearance: u32,
    /// Place among the mixtures that are kept, or [`PLAIN`].
    mixture: u32,
    pub arrival: Arrival,
}

/// Marks vertices whose scattering functions are the same everywhere.
pub(super) const PLAIN: u32 = u32::MAX;

impl LightVertex {
    #[inline(always)]
    pub fn new(surface: &Surface, mixture: u32, arrival: &Arrival) -> LightVertex {
        let &Surface { p, ng, lift, frame, wo, appearance, .. } = surface;
        LightVertex { p, ng, lift, frame, wo, appearance, mixture, arrival: *arrival }
    }

    /// On a plain material of a flat mesh.
    #[inline(always)]
    pub fn flat([p, ng]: [Vec3; 2], frame: Frame, wo: Vec3, appearance: u32, arrival: Arrival) -> LightVertex {
        LightVertex { p, ng, lift: ng, frame, wo, appearance, mixture: PLAIN, arrival }
    }

    /// A place to be filled.
    pub const NOWHERE: LightVertex = LightVertex {
        p: Vec3::ZERO,
        ng: Vec3::Z,
        lift: Vec3::Z,
        frame: Frame { s: Vec3::X, t: Vec3::Y, n: Vec3::Z },
        wo: Vec3::Z,
        appearance: 0,
        mixture: PLAIN,
        arrival: Arrival { flux: Rgb::ZERO, tail: STRAIGHT_OUT, survival: 1.0 },
    };

    /// The place, with its scattering function from wherever it is.
    #[inline(always)]
    pub fn site<'a, P: Profile>(&self, scene: &'a Scene, mixtures: &'a [Mixture]) -> Site<'a> {
        let scattering = if P::VARYING && self.mixture != PLAIN {
            ScatteringRef::Mixed(&mixtures[self.mixture as usize])
        } else {
            ScatteringRef::Plain(scene.material(self.appearance))
        };
        let &LightVertex { p, ng, lift, frame, wo, .. } = self;
        Site { p, ng, lift, frame, wo, scattering }
    }
}

/// What a light subpath carries along an edge.
#[derive(Clone, Copy, Debug)]
pub(super) struct Particle {
    /// Emitted power over all densities so far, times all reflectances.
    pub flux: Rgb,
    /// Probability that roulette let it come so far.
    pub survival: f32,
}

/// A light subpath at its last vertex.
#[derive(Clone, Copy, Debug)]
pub(super) struct Arrival {
    /// Its flux over |cos| of the last edge by the geometric normal: f |cos| by the shading normal times this is what
    /// leaves.
    pub flux: Rgb,
    pub tail: Tail,
    /// Probability that roulette let it come so far.
    pub survival: f32,
}

/// Cosines that fluxes and densities are divided by are kept from 0.
pub(super) const LEAST_COSINE: f32 = 1e-9;

impl Particle {
    #[inline(always)]
    pub fn arrive(&self, cos: f32, tail: Tail) -> Arrival {
        Arrival { flux: self.flux / cos.max(LEAST_COSINE), tail, survival: self.survival }
    }

    /// At the start, `flux` being that of the emission.
    pub fn new(flux: Rgb) -> Particle {
        Particle { flux, survival: 1.0 }
    }

    /// Arrives at the first vertex after the light.
    #[inline(always)]
    pub fn arrive_from_light<P: Profile>(
        &self,
        scene: &Scene,
        techniques: Techniques,
        emission: &Emission,
        surface: &Surface,
    ) -> Arrival {
        let cos = surface.ng.dot(emission.direction).abs();
        let pdf_place = f64::from(emission.pdf_place);
        let mut step = first_step(techniques, emission);
        let d2 = (surface.p - emission.origin).length_squared();
        let direct = |pdf: f32| {
            let ratio = f64::from(pdf) / pdf_place;
            ratio * ratio
        };
        let tail = match emission.kind {
            EmitterKind::Surface => {
                if !scene.emitters.aims_by_area::<P>(emission.light) {
                    // from where next-event estimation would look: on a sphere or off it makes a difference
                    let from = Site::of(surface).start_towards(-emission.direction);
                    let pdf = scene.emitters.pdf::<P>(emission.light, from, emission.origin, emission.normals[0]);
                    step.shorter = direct(pdf * step.cos as f32 / d2);
                }
                step.arrive(d2, cos)
            }
            _ if P::FLAT_MESHES => unreachable!("a profile with lights on flat meshes only"),
            EmitterKind::Point => step.arrive(d2, cos),
            EmitterKind::SingleDirection => step.arrive_from_infinity(cos),
            EmitterKind::Surrounding => {
                let towards = -emission.direction;
                let pdf = scene.emitters.pdf::<P>(emission.light, surface.p, towards, towards);
                step.shorter = direct(pdf);
                step.arrive_from_infinity(cos)
            }
        };
        self.arrive(cos, tail)
    }

    /// Arrives at a later vertex from `origin`.
    #[inline(always)]
    pub fn arrive_after(&self, step: &Step, origin: Vec3, direction: Vec3, surface: &Surface) -> Arrival {
        let cos = surface.ng.dot(direction).abs();
        self.arrive(cos, step.arrive((surface.p - origin).length_squared(), cos))
    }
}

/// The first edge of a light subpath. From surfaces, next-event estimation chooses places as emission does, unless the
/// vertex where the edge ends says otherwise.
#[inline(always)]
pub(super) fn first_step(techniques: Techniques, emission: &Emission) -> Step {
    let pdf_place = f64::from(emission.pdf_place);
    let hit = if techniques.hit { 1.0 / (pdf_place * pdf_place) } else { 0.0 };
    let (cos, before) = match emission.kind {
        EmitterKind::Surface => (emission.normals[0].dot(emission.direction).abs(), hit),
        EmitterKind::Surrounding => (1.0, hit),
        EmitterKind::Point | EmitterKind::SingleDirection => (1.0, 0.0),
    };
    Step { density: f64::from(emission.pdf_rest), cos: f64::from(cos), before, shorter: 1.0 }
}

/// Where the ray of an emission starts.
#[inline(always)]
pub(super) fn start_of(emission: &Emission) -> Vec3 {
    offset_origin(emission.origin, emission.ng)
}

/// The next edge of a light subpath.
#[derive(Clone, Copy, Debug)]
pub(super) struct LightEdge {
    pub origin: Vec3,
    pub direction: Vec3,
    pub particle: Particle,
    pub step: Step,
}

/// Scattering of a light subpath at its vertex number `j`, counted from the one on the light, and roulette by the part of
/// the power that this vertex scatters. (By what is left of all power, as camera subpaths play it, `lattice` has 1.6 times
/// the squared error at equal processor time by light tracing and 1.3 times by all techniques: what has got through many
/// bounces is what counts there. `cornell-box` has 0.95 and 0.88 times. `relt render --method path --mapping light`, or
/// `bidirectional`, `--mpp 20`, one seed.)
///
/// Light goes from `wo` to the sampled direction, against the arguments of scattering functions: what counts is f(wi, wo).
/// For perfect refraction that is f(wo, wi) times the square of the ratio of indices. Shading normals do not conserve
/// energy that way round, which brings the cosines of both normals in (Veach 1997, section 5.3).
#[inline(always)]
pub(super) fn scatter_light<P: Profile>(
    site: &Site,
    arrival: &Arrival,
    decisions: &Decisions,
    techniques: Techniques,
    j: u16,
) -> Option<LightEdge> {
    let sample = site.scattering.sample::<P>(site.wo, decisions.direction, decisions.lobe)?;
    let direction = site.frame.to_world(sample.wi);
    let cos = site.cos(direction);
    let (weight, densities) = if !P::DIFFUSE && sample.pdf == f32::INFINITY {
        let shading = site.wo.z.abs() / sample.wi.z.abs().max(LEAST_COSINE);
        (sample.weight * (sample.eta * sample.eta * shading), None)
    } else {
        let there = site.scattering.evaluate::<P>(sample.wi, site.wo);
        (there.value / sample.pdf, Some([sample.pdf, there.pdf]))
    };
    let cos_before = site.cos(site.frame.to_world(site.wo));
    let (particle, goes_on) = arrival.scattered(weight, [cos_before, cos], decisions.roulette);
    if !goes_on {
        return None;
    }
    let step = arrival.tail.leave(densities, cos, techniques.has(j, 2));
    Some(LightEdge { origin: site.start_towards(direction), direction, particle, step })
}

impl Arrival {
    /// What goes on where that `weight` is scattered, and whether anything does; the cosines are those of the edges before
    /// and after by the geometric normal, and `u` is the number of roulette where it is played. Without a branch, for loops
    /// over lanes.
    #[inline(always)]
    pub fn scattered(&self, weight: Rgb, [cos_before, cos]: [f32; 2], u: Option<f32>) -> (Particle, bool) {
        let mut particle = Particle { flux: self.flux * weight * cos, survival: self.survival };
        let mut goes_on = true;
        if let Some(u) = u {
            // the part of what arrived that leaves: both fluxes, but for the cosine that one of them was divided by
            let survival = (weight.max_element() * cos / cos_before.max(LEAST_COSINE)).min(MOST_SURVIVAL);
            goes_on = u < survival;
            particle.flux /= survival;
            particle.survival *= survival;
        }
        goes_on &= particle.flux != Rgb::ZERO;
        (particle, goes_on)
    }
}

/// A camera subpath at its last vertex.
#[derive(Clone, Copy, Debug)]
pub(super) struct CameraEnd {
    pub carried: Carried,
    pub tail: Tail,
}

/// Arrives at the first vertex after the lens.
#[inline(always)]
pub(super) fn arrive_from_eye(scene: &Scene, surface: &Surface, direction: Vec3, lens: [f32; 2]) -> Tail {
    let cos = surface.ng.dot(direction).abs();
    seen_with(scene.camera.density(surface.p, lens), cos)
}

/// The same where the camera's rays have that density per area, with |cos| of the geometric normal.
#[inline(always)]
pub(super) fn seen_with(density: f32, cos: f32) -> Tail {
    Step { density: f64::from(density), cos: 0.0, before: 0.0, shorter: 1.0 }.arrive(1.0, cos)
}

/// The tail of a camera path that leaves the scene at once.
pub(super) const STRAIGHT_OUT: Tail = Tail { inverse_density: 0.0, shorter: 1.0, earlier: 0.0 };

/// Scattering of a camera subpath at its vertex number `j`, counted from the lens, and roulette.
#[inline(always)]
pub(super) fn scatter_camera<P: Profile>(
    surface: &Surface,
    end: &CameraEnd,
    decisions: &Decisions,
    techniques: Techniques,
    j: u16,
) -> Option<(Edge, Step)> {
    let edge = vertex::scatter::<P>(surface, &end.carried, decisions, Roulette::Path)?;
    let site = Site::of(surface);
    let pdf = edge.carried.pdf;
    let densities = if !P::DIFFUSE && pdf == f32::INFINITY {
        None
    } else {
        let wi = site.frame.to_local(edge.direction);
        Some([pdf, site.scattering.evaluate::<P>(wi, site.wo).pdf])
    };
    let step = end.tail.leave(densities, site.cos(edge.direction), techniques.has(2, j));
    Some((edge, step))
}
