//! Starts of light subpaths: a place, and a direction in which light leaves it.
//!
//! Every light draws two pairs of numbers: `place` with the density [`Emission::pdf_place`], `direction` with
//! [`Emission::pdf_rest`]. For lights at infinity the place is a direction, and the rest a point of the disk through
//! which all their parallel rays pass that can meet the scene.
//! Source: Veach 1997, sections 8.3.2 and 10.3; Pharr, Jakob & Humphreys 2016, section 16.1.2.

use glam::Vec3;

use crate::{
    math::{Frame, warp},
    scene::Rgb,
};

/// A sphere around the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    /// Its centre.
    pub center: Vec3,
    /// Its radius, > 0.
    pub radius: f32,
}

impl Ball {
    /// A thousandth larger, so that what touches the sphere lies inside for all that rounding does, and rays that start
    /// on it start before all surfaces.
    pub fn enlarged(self) -> Ball {
        /// Thousands of steps of `f32` in a coordinate as large as the radius.
        const BY: f32 = 1.001;
        /// For scenes far from the origin, whose coordinates are coarser than their size suggests.
        const STEPS: f32 = 8.0 * f32::EPSILON;
        Ball { radius: self.radius * BY + self.center.abs().max_element() * STEPS, ..self }
    }

    /// The start of a ray in that direction, drawn from the disk that touches the ball on the side it comes from, and its
    /// density per area of that disk, 1/(πR²).
    #[inline(always)]
    fn start(&self, direction: Vec3, u: [f32; 2]) -> (Vec3, f32) {
        let Frame { s, t, .. } = Frame::new(direction);
        let d = warp::disk(u);
        let origin = self.center + (s * d.x + t * d.y - direction) * self.radius;
        (origin, self.pdf())
    }

    /// Density per area of a disk of its radius: 1/(πR²).
    #[inline(always)]
    pub(super) fn pdf(&self) -> f32 {
        warp::INV_PI / (self.radius * self.radius)
    }
}

/// Where lights are, and with it what can find them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EmitterKind {
    /// On a surface: rays hit it.
    Surface,
    /// In a point, which no ray hits.
    Point,
    /// At infinity in a single direction, which no ray takes by chance.
    SingleDirection,
    /// At infinity all around: rays that leave the scene meet it.
    Surrounding,
}

/// The start of a light subpath.
#[derive(Clone, Copy, Debug)]
pub struct Emission {
    /// Where the ray starts: on the light's surface (not yet offset), at the point light, or for lights at infinity (and
    /// single directions) on a disk just outside the scene's bounding sphere.
    pub origin: Vec3,
    /// Geometric normal there on the shining side, with the length that
    /// [`offset_origin`](crate::math::offset_origin) needs, 1; zero for lights without surface.
    pub ng: Vec3,
    /// Geometric and shading unit normal there, as in [`LightSample`](super::LightSample); zero for lights without
    /// surface.
    pub normals: [Vec3; 2],
    /// Unit direction in which light leaves.
    pub direction: Vec3,
    /// Radiance · |cos| / (`pdf_place` · `pdf_rest`), per channel: a power, W up to the unit of the scene. For points
    /// intensity stands for radiance · |cos|, for single directions irradiance.
    pub weight: Rgb,
    /// Density of the place: per area on surfaces; per solid angle of the direction for lights all around; 1 for points
    /// and single directions. Times the probability of choosing the light.
    pub pdf_place: f32,
    /// Density of the rest: of the direction per solid angle for surfaces and points; per area of the disk, 1/(πR²), for
    /// lights at infinity and single directions.
    pub pdf_rest: f32,
    /// What kind of light it is.
    pub kind: EmitterKind,
    /// Index of the light, as [`Emitters`](crate::scene::Emitters) count them; 0 from a light itself.
    pub light: u32,
}

/// The geometric normal on the side that shines: that of the shading normal.
#[inline(always)]
fn shining_side([geometric, shading]: [Vec3; 2]) -> Vec3 {
    geometric * geometric.dot(shading).signum()
}

/// From the place `q` of a surface that emits `radiance`, chosen with density `pdf_area`: a direction around the
/// geometric normal of the shining side in proportion to its cosine; `None` where that is behind the shading normal.
#[inline(always)]
pub(super) fn from_surface(
    q: Vec3,
    normals: [Vec3; 2],
    radiance: Rgb,
    pdf_area: f32,
    direction: [f32; 2],
) -> Option<Emission> {
    let ng = shining_side(normals);
    let direction = Frame::new(ng).to_world(warp::cosine_hemisphere(direction));
    let [pdf_place, pdf_rest] = surface_pdf(pdf_area, normals, direction);
    (pdf_rest > 0.0).then(|| Emission {
        origin: q,
        ng,
        normals,
        direction,
        weight: radiance / (pdf_place * warp::INV_PI), // cos/pdf_rest is π
        pdf_place,
        pdf_rest,
        kind: EmitterKind::Surface,
        light: 0,
    })
}

/// The densities of [`from_surface`]: that of the place, and that of the direction, which is 0 behind either normal.
#[inline(always)]
pub(super) fn surface_pdf(pdf_area: f32, normals: [Vec3; 2], direction: Vec3) -> [f32; 2] {
    let in_front = direction.dot(normals[1]) > 0.0;
    [pdf_area, if in_front { warp::cosine_hemisphere_pdf(direction.dot(shining_side(normals))) } else { 0.0 }]
}

/// From a point whose intensity in that direction, drawn with density `pdf` per solid angle, is `intensity`.
#[inline(always)]
pub(super) fn from_point(position: Vec3, direction: Vec3, intensity: Rgb, pdf: f32) -> Emission {
    Emission {
        origin: position,
        ng: Vec3::ZERO,
        normals: [Vec3::ZERO; 2],
        direction,
        weight: intensity / pdf,
        pdf_place: 1.0,
        pdf_rest: pdf,
        kind: EmitterKind::Point,
        light: 0,
    }
}

/// From infinity in a direction drawn with density `pdf`: of radiance per solid angle, or 1 for the irradiance of a
/// single direction.
#[inline(always)]
pub(super) fn from_infinity(
    scene: Ball,
    direction: Vec3,
    radiance: Rgb,
    pdf: f32,
    kind: EmitterKind,
    on_disk: [f32; 2],
) -> Emission {
    let (origin, pdf_rest) = scene.start(direction, on_disk);
    Emission {
        origin,
        ng: Vec3::ZERO,
        normals: [Vec3::ZERO; 2],
        direction,
        weight: radiance / (pdf * pdf_rest),
        pdf_place: pdf,
        pdf_rest,
        kind,
        light: 0,
    }
}
