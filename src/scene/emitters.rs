//! All lights of a built scene and the choice among them.

use glam::{Vec2, Vec3};

use super::{
    Profile, Rgb, SceneDescription,
    lights::{Ball, Emission, EmitterKind, Face, Light, LightSample, MeshLight},
};
use crate::math::Cumulative;

/// All lights and the probabilities of choosing them.
#[derive(Clone, Debug)]
pub struct Emitters {
    lights: Vec<Light>,
    /// Probability of choosing each light: half uniform, half in proportion to power, so that a light of little
    /// power is not forgotten where it is the only one in sight.
    probability: Vec<f32>,
    /// The choice, by those; `None` without lights.
    choice: Option<Cumulative>,
    /// The light at infinity, if any; a scene has one at most.
    surrounding: Option<u32>,
    /// All of the scene lies inside.
    ball: Ball,
}

/// A triangle of a light that was chosen to be looked at.
pub(crate) struct Target<'e> {
    pub mesh: &'e MeshLight,
    pub face: &'e Face,
    /// That of choosing the light: exactly 1 where there is but one.
    pub probability: f32,
}

impl Emitters {
    /// The lights of that scene, which lies within the ball, and for each shape the index of the light that it is.
    pub(super) fn new(description: &SceneDescription, bounds: Ball) -> (Emitters, Vec<Option<u32>>) {
        let mut lights: Vec<Light> = Vec::new();
        let of_shape = description
            .shapes
            .iter()
            .map(|shape| {
                lights.push(Light::of_shape(shape)?);
                Some(lights.len() as u32 - 1)
            })
            .collect();
        lights.extend(description.lights.iter().cloned());
        let surrounding = lights.iter().position(Light::is_surrounding).map(|i| i as u32);
        let power = |light: &Light| f64::from(crate::path::luminance(light.power(bounds.radius)));
        let total: f64 = lights.iter().map(power).sum();
        let uniform = 1.0 / lights.len().max(1) as f64;
        let share = |light: &Light| match total > 0.0 && total.is_finite() {
            true => 0.5 * uniform + 0.5 * power(light) / total,
            false => uniform,
        };
        let probability: Vec<f32> = lights.iter().map(|light| share(light) as f32).collect();
        let choice = (!lights.is_empty()).then(|| Cumulative::new(probability.iter().map(|&p| f64::from(p))));
        (Emitters { lights, probability, choice, surrounding, ball: bounds.enlarged() }, of_shape)
    }

    /// The largest channel of any radiance or intensity; a scale for the brightness of paths.
    pub fn brightest(&self) -> f32 {
        self.lights.iter().map(Light::largest).fold(0.0, f32::max)
    }

    /// Radiance that a surface light sends from the place of its front with those surface coordinates.
    #[inline(always)]
    pub fn radiance<P: Profile>(&self, light: u32, uv: Vec2) -> Rgb {
        self.lights[light as usize].radiance::<P>(uv)
    }

    /// The light at infinity in the direction `d`: its radiance and the density of sampling that direction, with respect
    /// to solid angle.
    #[inline(always)]
    pub fn surrounding<P: Profile>(&self, d: Vec3) -> Option<(Rgb, f32)> {
        if P::FLAT_MESHES {
            return None;
        }
        let light = self.surrounding? as usize;
        let (radiance, pdf) = self.lights[light].surrounding(d);
        Some((radiance, self.probability[light] * pdf))
    }

    /// Samples a direction from the surface point `p` with geometric normal `ng`: `u` for the place on the light,
    /// `choice` for the light; the density includes the choice. `None` where the chosen place does not shine to `p`.
    #[inline(always)]
    pub fn sample<P: Profile>(&self, p: Vec3, ng: Vec3, u: [f32; 2], choice: f32) -> Option<LightSample> {
        if self.lights.len() == 1 {
            return self.lights[0].sample::<P>(p, ng, u);
        }
        let light = self.choice.as_ref()?.index(choice);
        let probability = self.probability[light];
        let sample = self.lights[light].sample::<P>(p, ng, u)?;
        Some(LightSample {
            weight: sample.weight / probability,
            pdf: sample.pdf * probability,
            light: light as u32,
            ..sample
        })
    }

    /// What [`sample`](Self::sample) looks at in a scene lit by flat meshes, for the first number of `u` and for `choice`;
    /// `None` without lights.
    #[inline(always)]
    pub(crate) fn target(&self, u: f32, choice: f32) -> Option<Target<'_>> {
        let light = if self.lights.len() == 1 { 0 } else { self.choice.as_ref()?.index(choice) };
        let Light::MeshLight(mesh) = &self.lights[light] else {
            unreachable!("a profile with lights on flat meshes only")
        };
        Some(Target { mesh, face: mesh.face(u), probability: self.probability[light] })
    }

    /// Density with which [`sample`](Self::sample) gives the direction from `origin` to the point `q` with normal
    /// `n` on the front of a surface light, with respect to solid angle at `origin`.
    #[inline(always)]
    pub fn pdf<P: Profile>(&self, light: u32, origin: Vec3, q: Vec3, n: Vec3) -> f32 {
        self.probability[light as usize] * self.lights[light as usize].pdf::<P>(origin, q, n)
    }

    /// Starts a light subpath: `place` for the place on the light, `direction` for that in which light leaves (see
    /// [`Emission`]), `choice` for the light; the densities include the choice. `None` where nothing leaves the chosen
    /// light so.
    #[inline(always)]
    pub fn emit<P: Profile>(&self, place: [f32; 2], direction: [f32; 2], choice: f32) -> Option<Emission> {
        if self.lights.len() == 1 {
            return self.lights[0].emit::<P>(place, direction, self.ball);
        }
        let light = self.choice.as_ref()?.index(choice);
        let probability = self.probability[light];
        let emission = self.lights[light].emit::<P>(place, direction, self.ball)?;
        Some(Emission {
            weight: emission.weight / probability,
            of_place: emission.of_place / probability,
            pdf_place: emission.pdf_place * probability,
            light: light as u32,
            ..emission
        })
    }

    /// Densities [`Emission::pdf_place`], the choice of the light included, and [`Emission::pdf_rest`] with which
    /// [`emit`](Self::emit) starts a subpath on that light at a place with those geometric and shading normals (of no
    /// account for lights without surface) in the unit vector `direction`, in which light leaves.
    #[inline(always)]
    pub fn emission_pdf<P: Profile>(&self, light: u32, normals: [Vec3; 2], direction: Vec3) -> [f32; 2] {
        let [place, rest] = self.lights[light as usize].emission_pdf::<P>(normals, direction, self.ball);
        [self.probability[light as usize] * place, rest]
    }

    /// Whether next-event estimation chooses places on that light as emission does, by area: true of meshes.
    #[inline(always)]
    pub fn aims_by_area<P: Profile>(&self, light: u32) -> bool {
        P::FLAT_MESHES || matches!(self.lights[light as usize], Light::MeshLight(_))
    }

    /// The light of that index.
    pub fn light(&self, light: u32) -> &Light {
        &self.lights[light as usize]
    }

    /// The numbers that choose a light: from the first to before the second.
    pub fn choice_of(&self, light: u32) -> [f32; 2] {
        match &self.choice {
            Some(choice) if self.lights.len() > 1 => choice.range(light as usize),
            _ => [0.0, 1.0],
        }
    }

    /// Where that light is, and with it what can find it.
    #[inline]
    pub fn kind(&self, light: u32) -> EmitterKind {
        self.lights[light as usize].kind()
    }

    /// Index of the light that surrounds the scene, if any.
    #[inline]
    pub fn surrounding_light(&self) -> Option<u32> {
        self.surrounding
    }
}

#[cfg(test)]
pub(super) mod tests {
    use glam::Mat3;

    use super::*;
    use crate::{
        math::Frame,
        rng::{Counter, Purpose, Rng, unit_f32},
        scene::{
            FullProfile, Mesh,
            lights::{Constant, Cylinder, Disk, MeshLight, Sphere},
            textures::Varying,
        },
    };

    /// Lights that surfaces or directions can hit, one of each kind, around the origin's upper hemisphere.
    pub fn lights() -> Vec<Light> {
        let corners = vec![Vec3::new(-1.0, -1.0, 2.0), Vec3::new(1.0, -1.0, 2.0), Vec3::new(0.0, 1.0, 3.0)];
        let white = Varying::Constant(Rgb::ONE);
        let sphere = |center: Vec3, radius: f32, flipped: bool| {
            Light::Sphere(Sphere { center, radius, axes: Mat3::IDENTITY, flipped, radiance: Rgb::ONE.into() })
        };
        let axes = |n: Vec3| {
            let Frame { s, t, n } = Frame::new(n);
            Mat3::from_cols(s, t, n)
        };
        let disk_axes = axes(Vec3::new(0.6, 0.0, -0.8));
        let cylinder = |start: Vec3, end: Vec3, radius: f32, flipped: bool| {
            let (axis, length) = (end - start).normalize_and_length();
            Light::Cylinder(Cylinder { start, length, radius, axes: axes(axis), flipped, radiance: Rgb::ONE.into() })
        };
        vec![
            Light::Constant(Constant { radiance: Rgb::ONE }),
            cylinder(Vec3::new(0.0, -0.6, -0.8), Vec3::new(0.0, 0.6, 0.8), 0.5, true),
            cylinder(Vec3::new(-1.0, 1.0, 2.0), Vec3::new(2.0, 0.0, 1.0), 0.6, false),
            Light::Disk(Disk::new(Vec3::new(0.3, 0.0, 2.0), 0.7, disk_axes, white.clone())),
            Light::MeshLight(MeshLight::new(Mesh::new(corners, vec![[0, 2, 1]]).into(), white)),
            sphere(Vec3::new(0.0, 1.0, 2.0), 0.8, false),
            sphere(Vec3::ZERO, 3.0, true),
        ]
    }

    /// The density integrates to one: for directions drawn with it, the mean of 1/pdf is the light's solid angle,
    /// which is known, and weight · pdf is the radiance. 2¹⁶ samples, bound 2 %.
    #[test]
    fn samples_have_the_density_they_state() {
        // solid angle of a triangle: Van Oosterom & Strackee 1983
        let triangle = {
            let [a, b, c] = [[-1.0f64, -1.0, 2.0], [1.0, -1.0, 2.0], [0.0, 1.0, 3.0]].map(glam::DVec3::from);
            let (la, lb, lc) = (a.length(), b.length(), c.length());
            let denominator = la * lb * lc + a.dot(b) * lc + a.dot(c) * lb + b.dot(c) * la;
            2.0 * (a.dot(b.cross(c)).abs()).atan2(denominator)
        };
        let sphere = std::f64::consts::TAU * (1.0 - (1.0f64 - 0.64 / 5.0).sqrt());
        let full = 4.0 * std::f64::consts::PI;
        // seen from the middle of a tube of half length 1 and radius ½: all but its two ends
        let tube = full / 1.25f64.sqrt();
        let exact = [Some(full), Some(tube), None, None, Some(triangle), Some(sphere), Some(full)];
        let rng = Rng::new(2);
        for (light, solid_angle) in lights().iter().zip(exact) {
            let n = 1 << 16;
            let mut sum = 0.0;
            for step in 0..n {
                let counter = Counter { ladder: 0, replica: 0, step, purpose: Purpose::Primary };
                let [a, b, ..] = rng.words(counter, 0).map(unit_f32);
                let Some(s) = light.sample::<FullProfile>(Vec3::ZERO, Vec3::Z, [a, b]) else { continue };
                sum += 1.0 / f64::from(s.pdf);
                assert!((s.weight * s.pdf - Rgb::ONE).length() < 1e-4, "{light:?}");
                assert!((s.wi.length() - 1.0).abs() < 1e-4);
            }
            if let Some(exact) = solid_angle {
                let got = sum / n as f64;
                assert!((got / exact - 1.0).abs() < 0.02, "{light:?}: solid angle {got} for {exact}");
            }
        }
    }

    #[test]
    fn the_choice_favours_power_but_forgets_nobody() {
        let lights = lights();
        let description = |lights: Vec<Light>| {
            let (emitters, _) = Emitters::new(
                &crate::scene::description::tests::with_lights(lights),
                Ball { center: Vec3::ZERO, radius: 1.0 },
            );
            emitters
        };
        let emitters = description(lights[..1].to_vec());
        assert_eq!(emitters.probability, [1.0]);
        let two = |a: f32, b: f32| {
            let point =
                |i: f32| Light::Point(crate::scene::lights::Point { position: Vec3::ZERO, intensity: Rgb::splat(i) });
            description(vec![point(a), point(b)]).probability
        };
        assert_eq!(two(1.0, 3.0), [0.375, 0.625]);
        assert_eq!(two(0.0, 1.0), [0.25, 0.75]);
        assert_eq!(two(0.0, 0.0), [0.5, 0.5]);
    }
}
