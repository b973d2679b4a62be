//! A spot light.

use std::f32::consts::TAU;

use glam::Vec3;

use super::{Ball, Emission, Emit, EmitterKind, LightSample, Point, from_point};
use crate::{
    math::{Frame, warp},
    scene::{Rgb, parameters::Parameters},
};

/// A point that shines into a cone: full intensity within half of `beam_width`, falling linearly with the angle to
/// nothing at half of `cutoff_angle`, both angles from the axis.
///
/// Parameters: `to_world` puts the point at its origin and the axis along its z; `intensity`, W/sr on the axis, default
/// 1; `cutoff_angle`, degrees from the axis, default 20; `beam_width`, degrees from the axis, default ¾ of that.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spot {
    point: Point,
    axis: Vec3,
    cos_beam: f32,
    cos_cutoff: f32,
    /// Radians.
    cutoff: f32,
    /// 1/(cutoff − beam width), per radian.
    steepness: f32,
}

impl Spot {
    pub(super) fn read(p: &mut dyn Parameters) -> Spot {
        let to_world = p.to_world();
        let intensity = p.radiance("intensity", 1.0);
        let mut angle = |name: &str, default: f32, most: f32| match p.float(name) {
            None => default,
            Some(value) if value > 0.0 && value <= most => value,
            Some(value) => {
                p.fault(name, format!("{name} is {value}; accepted are degrees above 0, up to {most}"));
                default
            }
        };
        let cutoff = angle("cutoff_angle", 20.0, 180.0);
        let beam = angle("beam_width", 0.75 * cutoff, cutoff);
        let axis = to_world.transform_vector3(Vec3::Z).try_normalize().unwrap_or_else(|| {
            p.fault("to_world", "to_world leaves the light no direction".into());
            Vec3::Z
        });
        Spot::new(Point { position: to_world.transform_point3(Vec3::ZERO), intensity }, axis, beam, cutoff)
    }

    /// Of a unit axis, and angles from it in degrees.
    pub fn new(point: Point, axis: Vec3, beam: f32, cutoff: f32) -> Spot {
        let (beam, cutoff) = (beam.to_radians(), cutoff.to_radians());
        let cos = |angle: f32| libm::cosf(angle);
        Spot { point, axis, cos_beam: cos(beam), cos_cutoff: cos(cutoff), cutoff, steepness: 1.0 / (cutoff - beam) }
    }

    /// Where it is, and its intensity on the axis.
    pub fn point(&self) -> &Point {
        &self.point
    }

    /// The same, to be changed.
    pub fn point_mut(&mut self) -> &mut Point {
        &mut self.point
    }

    /// 1 − cos of the cutoff, as 2 sin² of its half, which keeps the digits of narrow cones. (Not kept: checksums of
    /// scenes are over all fields, and those of old files must not change.)
    #[inline(always)]
    fn one_minus_cos(&self) -> f32 {
        let sin_half = libm::sinf(0.5 * self.cutoff);
        2.0 * sin_half * sin_half
    }

    /// Intensity in a direction at that cosine from the axis, by that on it.
    #[inline(always)]
    fn falloff(&self, cos: f32) -> f32 {
        if cos <= self.cos_cutoff {
            return 0.0;
        }
        if cos >= self.cos_beam { 1.0 } else { (self.cutoff - libm::acosf(cos)) * self.steepness }
    }
}

impl Emit for Spot {
    fn kind(&self) -> EmitterKind {
        EmitterKind::Point
    }

    /// As if the intensity fell at once, in the middle between the two cones: it only guides the choice among lights.
    fn power(&self, _scene_radius: f32) -> Rgb {
        self.point.intensity * (TAU * (1.0 - 0.5 * (self.cos_beam + self.cos_cutoff)))
    }

    fn largest(&self) -> f32 {
        self.point.intensity.max_element()
    }

    #[inline(always)]
    fn sample(&self, p: Vec3, ng: Vec3, u: [f32; 2]) -> Option<LightSample> {
        let sample = self.point.sample(p, ng, u)?;
        let falloff = self.falloff(-sample.wi.dot(self.axis));
        (falloff > 0.0).then(|| LightSample { weight: sample.weight * falloff, ..sample })
    }

    #[inline(always)]
    fn pdf(&self, _origin: Vec3, _q: Vec3, _n: Vec3) -> f32 {
        0.0
    }

    #[inline(always)]
    fn emit(&self, _place: [f32; 2], direction: [f32; 2], scene: Ball) -> Option<Emission> {
        let direction = Frame::new(self.axis).to_world(warp::cone(direction, self.one_minus_cos()));
        let falloff = self.falloff(direction.dot(self.axis));
        let [_, pdf] = self.emission_pdf([Vec3::ZERO; 2], direction, scene);
        (falloff > 0.0).then(|| from_point(self.point.position, direction, self.point.intensity * falloff, pdf))
    }

    /// Directions are uniform over the cone of the cutoff.
    #[inline(always)]
    fn emission_pdf(&self, _normals: [Vec3; 2], direction: Vec3, _scene: Ball) -> [f32; 2] {
        [1.0, if direction.dot(self.axis) > self.cos_cutoff { 1.0 / (TAU * self.one_minus_cos()) } else { 0.0 }]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intensity_falls_linearly_between_the_cones() {
        let spot = Spot::new(Point { position: Vec3::ZERO, intensity: Rgb::ONE }, Vec3::Z, 10.0, 30.0);
        for (angle, expected) in
            [(0.0f32, 1.0), (9.9, 1.0), (15.0, 0.75), (20.0, 0.5), (29.0, 0.05), (30.1, 0.0), (170.0, 0.0)]
        {
            let got = spot.falloff(angle.to_radians().cos());
            assert!((got - expected).abs() < 1e-3, "{got} at {angle}°, not {expected}");
        }
        // beam and cutoff alike: a cone with a sharp edge, no NaN
        let sharp = Spot::new(spot.point, Vec3::Z, 30.0, 30.0);
        assert_eq!([29.0f32, 31.0].map(|angle| sharp.falloff(angle.to_radians().cos())), [1.0, 0.0]);
    }

    #[test]
    fn nothing_shines_backwards() {
        let spot = Spot::new(Point { position: Vec3::Z, intensity: Rgb::splat(8.0) }, -Vec3::Z, 10.0, 30.0);
        let below = spot.sample(Vec3::new(0.0, 0.0, -1.0), Vec3::Z, [0.0; 2]).unwrap();
        assert!((below.weight - Rgb::splat(2.0)).length() < 1e-3 && below.pdf == f32::INFINITY, "{below:?}");
        assert!(spot.sample(Vec3::new(0.0, 0.0, 3.0), -Vec3::Z, [0.0; 2]).is_none());
    }
}
