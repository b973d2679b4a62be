//! A sphere that emits.

use std::f32::consts::{PI, TAU};

use glam::{Mat3, Vec3};

use super::{
    Ball, Emission, EmissionInverse, Emit, EmitterKind, LightSample, SHORT_OF_LIGHT, from_surface, invert_surface,
    origin_towards, per_solid_angle, surface_pdf, towards,
};
use crate::{
    math::{Frame, warp},
    scene::{Rgb, parametrisation::sphere_uv, textures::Varying},
};

/// A sphere that emits from its outside (from its inside, if flipped): uniform over the solid angle under which it is
/// seen from outside, uniform over its area from inside and where light subpaths start.
/// Source: Shirley, Wang & Zimmerman 1996, section 3.2.
#[derive(Clone, Debug, PartialEq)]
pub struct Sphere {
    /// Centre.
    pub center: Vec3,
    /// Radius, > 0.
    pub radius: f32,
    /// Its own axes, which surface coordinates refer to.
    pub axes: Mat3,
    /// The front is the inside.
    pub flipped: bool,
    /// Radiance, W/(m² sr) per channel.
    pub radiance: Varying,
}

impl Sphere {
    fn pdf_area(&self) -> f32 {
        0.25 * warp::INV_PI / (self.radius * self.radius)
    }

    /// A place, uniform over the area, with the geometric and the shading normal of the front there and the radiance.
    #[inline(always)]
    fn place(&self, u: [f32; 2]) -> (Vec3, [Vec3; 2], Rgb) {
        let n = warp::sphere(u);
        let front = if self.flipped { -n } else { n };
        (self.center + n * self.radius, [front; 2], self.radiance.at(|| sphere_uv(&self.axes, n)))
    }

    /// 1 − cos of the half angle under which it is seen from outside; `None` from inside. With sin² small the
    /// difference is taken as sin²/(1 + cos), which keeps its digits.
    #[inline(always)]
    fn one_minus_cos(&self, origin: Vec3) -> Option<f32> {
        let sin2 = self.radius * self.radius / (self.center - origin).length_squared();
        (sin2 < 1.0).then(|| sin2 / (1.0 + (1.0 - sin2).sqrt()))
    }

    /// Where a direction of the cone under which the sphere is seen meets it first: the unit normal of the outside there.
    /// `local` is the direction as seen along `frame`, whose z points to the centre, `distance` away.
    ///
    /// With θ the angle from the axis, e the direction away from it, s = sin θ · distance/radius and c² = 1 − s², the
    /// normal is (s cos θ − c sin θ) e − (s sin θ + c cos θ) z. Taken from the place minus the centre, which are large
    /// beside a small sphere, normals of one of a millionth of the distance were off by a tenth: light subpaths counted
    /// for nothing where these looked away, and walls were 0.8 % too bright.
    #[inline(always)]
    fn outside(&self, frame: &Frame, local: Vec3, distance: f32) -> Vec3 {
        let sin = (local.x * local.x + local.y * local.y).sqrt();
        let s = (sin * (distance / self.radius)).min(1.0);
        let c = (1.0 - s * s).max(0.0).sqrt();
        let across = if sin > 0.0 { (s * local.z - c * sin) / sin } else { 0.0 };
        frame.to_world(Vec3::new(local.x * across, local.y * across, -(s * sin + c * local.z))).normalize_or(-frame.n)
    }

    /// The inverse of [`place`](Self::place).
    fn invert_place(&self, q: Vec3) -> Option<[f32; 2]> {
        Some(warp::from_sphere((q - self.center).normalize_or_zero()))
    }
}

impl Emit for Sphere {
    fn kind(&self) -> EmitterKind {
        EmitterKind::Surface
    }

    fn power(&self, _scene_radius: f32) -> Rgb {
        self.radiance.mean() * (4.0 * PI * PI * self.radius * self.radius)
    }

    #[inline(always)]
    fn surface(&self) -> Option<&Varying> {
        Some(&self.radiance)
    }

    #[inline(always)]
    fn sample(&self, p: Vec3, ng: Vec3, u: [f32; 2]) -> Option<LightSample> {
        let towards_center = origin_towards(p, ng, self.center - p);
        let Some(one_minus_cos) = self.one_minus_cos(towards_center) else {
            let (q, normals, radiance) = self.place(u);
            return towards(p, ng, q, normals, radiance, self.pdf_area());
        };
        if self.flipped {
            return None; // the outside does not shine
        }
        let axis = self.center - towards_center;
        let length = axis.length();
        let (frame, local) = (Frame::new(axis / length), warp::cone(u, one_minus_cos));
        let wi = frame.to_world(local);
        // where the surface cuts the sphere the cone reaches to both of its sides: the ray starts on that of `wi`
        let origin = origin_towards(p, ng, wi);
        let to = self.center - origin;
        let along = to.dot(wi);
        let half_chord = (self.radius * self.radius - (to - wi * along).length_squared()).max(0.0).sqrt();
        let pdf = 1.0 / (TAU * one_minus_cos);
        let distance = along - half_chord;
        let outside = self.outside(&frame, local, length);
        let radiance = self.radiance.at(|| sphere_uv(&self.axes, outside));
        Some(LightSample {
            origin,
            wi,
            tfar: distance * SHORT_OF_LIGHT,
            weight: radiance / pdf,
            pdf,
            normals: [outside; 2],
            light: 0,
        })
    }

    #[inline(always)]
    fn pdf(&self, origin: Vec3, q: Vec3, n: Vec3) -> f32 {
        match self.one_minus_cos(origin) {
            Some(one_minus_cos) => 1.0 / (TAU * one_minus_cos),
            None => per_solid_angle(self.pdf_area(), origin, q, n),
        }
    }

    #[inline(always)]
    fn emit(&self, place: [f32; 2], direction: [f32; 2], _scene: Ball) -> Option<Emission> {
        let (q, normals, radiance) = self.place(place);
        Some(from_surface(q, normals, radiance, self.pdf_area(), direction))
    }

    #[inline(always)]
    fn emission_pdf(&self, normals: [Vec3; 2], direction: Vec3, _scene: Ball) -> [f32; 2] {
        surface_pdf(self.pdf_area(), normals, direction)
    }

    fn invert_emission(&self, q: Vec3, _triangle: u32, normals: [Vec3; 2], direction: Vec3) -> Option<EmissionInverse> {
        invert_surface(self.invert_place(q)?, normals, direction)
    }

    fn invert_sample(&self, p: Vec3, ng: Vec3, q: Vec3, _triangle: u32) -> Option<Option<[f32; 2]>> {
        let towards_center = origin_towards(p, ng, self.center - p);
        let Some(one_minus_cos) = self.one_minus_cos(towards_center) else {
            return self.invert_place(q).map(Some);
        };
        let wi = (q - origin_towards(p, ng, q - p)).normalize();
        let local = Frame::new((self.center - towards_center).normalize()).to_local(wi);
        Some(Some(warp::from_cone(local, one_minus_cos)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normals_of_small_and_large_spheres_keep_their_digits() {
        let p = Vec3::new(0.3, -0.2, 0.6);
        for radius in [1e-6, 1e-3, 0.5, 0.999] {
            let center = p + Vec3::new(0.6, 0.0, -0.8);
            let radiance = Varying::Constant(Rgb::ONE);
            let sphere = Sphere { center, radius, axes: Mat3::IDENTITY, flipped: false, radiance };
            let axis = center - p;
            let (frame, distance) = (Frame::new(axis / axis.length()), axis.length());
            let one_minus_cos = sphere.one_minus_cos(p).expect("it is seen from outside");
            for i in 0..100 {
                let u = [i as f32 / 100.0, (i * 37 % 100) as f32 / 100.0];
                let local = warp::cone(u, one_minus_cos);
                // where the ray meets the sphere, in f64 and along the frame
                let d = local.as_dvec3().normalize();
                let (r, to) = (f64::from(radius), glam::DVec3::Z * f64::from(distance));
                let along = d.dot(to);
                let half_chord = (r * r - (to.z * d.truncate().length()).powi(2)).max(0.0).sqrt();
                let expected = (d * (along - half_chord) - to) / r;
                let normal = frame.to_local(sphere.outside(&frame, local, distance)).as_dvec3();
                // near the rim the cosine is the root of a small difference
                assert!((normal - expected).length() < 2e-3, "radius {radius}, {u:?}: {normal} for {expected}");
            }
        }
    }
}
