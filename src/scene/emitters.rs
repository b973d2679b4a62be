//! The lights of a built scene: choosing one, sampling a direction to it, and the density of having done so.

use glam::Vec3;

use super::{
    Profile, Rgb, SceneDescription,
    description::{ShapeDescription, ShapeGeometry},
    lights::Light,
};
use crate::{
    math::{Frame, offset_origin, warp},
    scene::Mesh,
};

/// All lights and the probabilities of choosing them.
#[derive(Clone, Debug)]
pub struct Emitters {
    emitters: Vec<Emitter>,
    /// Probability of choosing each light: half uniform, half in proportion to power, so that a light of little
    /// power is not forgotten where it is the only one in sight.
    probability: Vec<f32>,
    /// Upper ends of the lights' shares of [0, 1].
    cumulative: Vec<f32>,
    /// Sum of the radiances at infinity.
    background: Rgb,
    /// Probability of choosing any light at infinity.
    background_probability: f32,
}

#[derive(Clone, Debug)]
struct Emitter {
    /// Radiance, or intensity for points.
    value: Rgb,
    form: Form,
}

#[derive(Clone, Debug)]
enum Form {
    /// Triangles chosen in proportion to area: upper ends of their shares, and 1/(total area).
    Mesh {
        mesh: std::sync::Arc<Mesh>,
        cumulative: Vec<f32>,
        inverse_area: f32,
    },
    Sphere {
        center: Vec3,
        radius: f32,
        flipped: bool,
    },
    Disk {
        center: Vec3,
        frame: Frame,
        radius: f32,
    },
    Constant,
    Point {
        position: Vec3,
    },
}

/// A direction towards a light.
#[derive(Clone, Copy, Debug)]
pub struct LightSample {
    /// Start of the shadow ray, just off the surface.
    pub origin: Vec3,
    /// Unit direction.
    pub wi: Vec3,
    /// Length of the shadow ray, a little short of the light.
    pub tfar: f32,
    /// Radiance over density, per channel.
    pub weight: Rgb,
    /// Density with respect to solid angle including the choice of the light; infinite for points, which no
    /// other technique can hit.
    pub pdf: f32,
}

/// Keeps shadow rays from meeting the light itself.
const SHORT_OF_LIGHT: f32 = 0.9999;

impl Emitters {
    /// The lights of that scene, and for each shape the index of the light that it is.
    pub(super) fn new(description: &SceneDescription, scene_radius: f32) -> (Emitters, Vec<Option<u32>>) {
        let mut emitters = Vec::new();
        let of_shape = description
            .shapes
            .iter()
            .map(|shape| {
                let radiance = shape.emission?;
                emitters.push(Emitter { value: radiance, form: Form::of_shape(shape) });
                Some(emitters.len() as u32 - 1)
            })
            .collect();
        emitters.extend(description.lights.iter().map(|light| match *light {
            Light::Constant { radiance } => Emitter { value: radiance, form: Form::Constant },
            Light::Point { position, intensity } => Emitter { value: intensity, form: Form::Point { position } },
        }));
        let powers: Vec<f64> = emitters.iter().map(|e| e.power(scene_radius)).collect();
        let total: f64 = powers.iter().sum();
        let uniform = 1.0 / emitters.len().max(1) as f64;
        let probability: Vec<f32> = powers
            .iter()
            .map(|p| if total > 0.0 { 0.5 * uniform + 0.5 * p / total } else { uniform })
            .map(|p| p as f32)
            .collect();
        let mut sum = 0.0f64;
        let mut cumulative: Vec<f32> = probability
            .iter()
            .map(|&p| {
                sum += f64::from(p);
                sum as f32
            })
            .collect();
        if let Some(last) = cumulative.last_mut() {
            *last = 1.0;
        }
        let infinite = |i: &usize| matches!(emitters[*i].form, Form::Constant);
        let all: Vec<usize> = (0..emitters.len()).filter(infinite).collect();
        let background = all.iter().map(|&i| emitters[i].value).sum();
        let background_probability = all.iter().map(|&i| probability[i]).sum();
        (Emitters { emitters, probability, cumulative, background, background_probability }, of_shape)
    }

    /// Number of lights.
    pub fn len(&self) -> usize {
        self.emitters.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.emitters.is_empty()
    }

    /// The largest channel of any radiance or intensity; a scale for the brightness of paths.
    pub fn brightest(&self) -> f32 {
        self.emitters.iter().map(|e| e.value.max_element()).fold(0.0, f32::max)
    }

    /// Radiance that a surface light sends from its front.
    #[inline(always)]
    pub fn radiance(&self, light: u32) -> Rgb {
        self.emitters[light as usize].value
    }

    /// Radiance from infinity.
    #[inline(always)]
    pub fn background(&self) -> Rgb {
        self.background
    }

    /// Density of sampling any direction to the lights at infinity, with respect to solid angle.
    #[inline(always)]
    pub fn background_pdf(&self) -> f32 {
        self.background_probability * (0.25 * warp::INV_PI)
    }

    /// Samples a direction from the surface point `p` with geometric normal `ng`: `u` for the place on the light,
    /// `choice` for the light. `None` where the chosen place does not shine to `p`.
    #[inline(always)]
    pub fn sample<P: Profile>(&self, p: Vec3, ng: Vec3, u: [f32; 2], choice: f32) -> Option<LightSample> {
        let light = if self.emitters.len() == 1 {
            0
        } else {
            self.cumulative.partition_point(|&end| end <= choice).min(self.emitters.len() - 1)
        };
        let emitter = &self.emitters[light];
        let probability = self.probability[light];
        match &emitter.form {
            Form::Mesh { mesh, cumulative, inverse_area } => {
                let (q, n) = sample_mesh(mesh, cumulative, u);
                emitter.towards(p, ng, q, n, probability * inverse_area)
            }
            _ if P::FLAT_MESHES => unreachable!("a profile with lights on flat meshes only"),
            &Form::Sphere { center, radius, flipped } => {
                emitter.towards_sphere(p, ng, center, radius, flipped, u, probability)
            }
            &Form::Disk { center, frame, radius } => {
                let d = warp::disk(u) * radius;
                let pdf = probability * warp::INV_PI / (radius * radius);
                emitter.towards(p, ng, center + frame.s * d.x + frame.t * d.y, frame.n, pdf)
            }
            Form::Constant => {
                let wi = warp::sphere(u);
                // every light at infinity can give any direction: all of them are evaluated together
                let pdf = self.background_pdf();
                let origin = offset_origin(p, if ng.dot(wi) >= 0.0 { ng } else { -ng });
                Some(LightSample { origin, wi, tfar: f32::MAX, weight: self.background / pdf, pdf })
            }
            &Form::Point { position } => {
                let origin = offset_origin(p, if ng.dot(position - p) >= 0.0 { ng } else { -ng });
                let to = position - origin;
                let d2 = to.length_squared();
                let distance = d2.sqrt();
                (distance > 0.0).then(|| LightSample {
                    origin,
                    wi: to / distance,
                    tfar: distance * SHORT_OF_LIGHT,
                    weight: emitter.value / (d2 * probability),
                    pdf: f32::INFINITY,
                })
            }
        }
    }

    /// Density with which [`sample`](Self::sample) gives the direction from `origin` to the point `q` with normal
    /// `n` on the front of a surface light, with respect to solid angle at `origin`.
    #[inline(always)]
    pub fn pdf<P: Profile>(&self, light: u32, origin: Vec3, q: Vec3, n: Vec3) -> f32 {
        let probability = self.probability[light as usize];
        let to = q - origin;
        let d2 = to.length_squared();
        let per_solid_angle = |per_area: f32| {
            let cos = to.dot(n).abs() / d2.sqrt();
            per_area * d2 / cos.max(f32::MIN_POSITIVE)
        };
        match &self.emitters[light as usize].form {
            Form::Mesh { inverse_area, .. } => probability * per_solid_angle(*inverse_area),
            _ if P::FLAT_MESHES => unreachable!("a profile with lights on flat meshes only"),
            &Form::Sphere { center, radius, .. } => match one_minus_cos_of_sphere(origin, center, radius) {
                Some(d) => probability / (std::f32::consts::TAU * d),
                None => probability * per_solid_angle(0.25 * warp::INV_PI / (radius * radius)),
            },
            &Form::Disk { radius, .. } => probability * per_solid_angle(warp::INV_PI / (radius * radius)),
            Form::Constant | Form::Point { .. } => 0.0,
        }
    }
}

impl Form {
    fn of_shape(shape: &ShapeDescription) -> Form {
        match &shape.geometry {
            ShapeGeometry::Mesh(mesh) => {
                let areas: Vec<f64> = (0..mesh.triangles.len() as u32).map(|t| mesh.area(t)).collect();
                let total: f64 = areas.iter().sum();
                let mut sum = 0.0;
                let mut cumulative: Vec<f32> = areas
                    .iter()
                    .map(|a| {
                        sum += a / total;
                        sum as f32
                    })
                    .collect();
                if let Some(last) = cumulative.last_mut() {
                    *last = 1.0;
                }
                Form::Mesh { mesh: mesh.clone(), cumulative, inverse_area: (1.0 / total) as f32 }
            }
            &ShapeGeometry::Sphere { center, radius, flipped } => Form::Sphere { center, radius, flipped },
            &ShapeGeometry::Disk { center, normal, radius } => Form::Disk { center, frame: Frame::new(normal), radius },
        }
    }
}

impl Emitter {
    /// Emitted power, up to a common factor; the luminance weights of the target.
    fn power(&self, scene_radius: f32) -> f64 {
        let pi = std::f64::consts::PI;
        let r2 = |r: f32| f64::from(r) * f64::from(r);
        let extent = match &self.form {
            Form::Mesh { inverse_area, .. } => pi / f64::from(*inverse_area),
            Form::Sphere { radius, .. } => 4.0 * pi * pi * r2(*radius),
            Form::Disk { radius, .. } => pi * pi * r2(*radius),
            Form::Constant => 4.0 * pi * pi * r2(scene_radius),
            Form::Point { .. } => 4.0 * pi,
        };
        extent * f64::from(crate::path::luminance(self.value))
    }

    /// A sample towards the point `q` with normal `n`, chosen with density `pdf_area`.
    #[inline(always)]
    fn towards(&self, p: Vec3, ng: Vec3, q: Vec3, n: Vec3, pdf_area: f32) -> Option<LightSample> {
        let origin = offset_origin(p, if ng.dot(q - p) >= 0.0 { ng } else { -ng });
        let to = q - origin;
        let d2 = to.length_squared();
        let distance = d2.sqrt();
        let wi = to / distance;
        let cos = -wi.dot(n);
        if cos <= 0.0 || d2 <= 0.0 {
            return None; // from behind
        }
        let pdf = pdf_area * d2 / cos;
        Some(LightSample { origin, wi, tfar: distance * SHORT_OF_LIGHT, weight: self.value / pdf, pdf })
    }

    /// A sample uniform over the solid angle of the sphere from outside, over its area from inside.
    #[expect(clippy::too_many_arguments, reason = "a surface point, a sphere and the numbers that choose on it")]
    fn towards_sphere(
        &self,
        p: Vec3,
        ng: Vec3,
        center: Vec3,
        radius: f32,
        flipped: bool,
        u: [f32; 2],
        probability: f32,
    ) -> Option<LightSample> {
        let origin = offset_origin(p, if ng.dot(center - p) >= 0.0 { ng } else { -ng });
        let Some(one_minus_cos) = one_minus_cos_of_sphere(origin, center, radius) else {
            let n = warp::sphere(u);
            let normal = if flipped { -n } else { n };
            let pdf = probability * 0.25 * warp::INV_PI / (radius * radius);
            return self.towards(p, ng, center + n * radius, normal, pdf);
        };
        if flipped {
            return None; // the outside does not shine
        }
        let to = center - origin;
        let wi = Frame::new(to.normalize()).to_world(warp::cone(u, one_minus_cos));
        // the cone may dip below the surface on the other side of the offset: such rays are absorbed by the surface
        let along = to.dot(wi);
        let half_chord = (radius * radius - (to - wi * along).length_squared()).max(0.0).sqrt();
        let pdf = probability / (std::f32::consts::TAU * one_minus_cos);
        let tfar = (along - half_chord) * SHORT_OF_LIGHT;
        Some(LightSample { origin, wi, tfar, weight: self.value / pdf, pdf })
    }
}

/// 1 − cos of the half angle under which a sphere is seen from outside; `None` from inside. With sin² small the
/// difference is taken as sin²/(1 + cos), which keeps its digits.
#[inline(always)]
fn one_minus_cos_of_sphere(origin: Vec3, center: Vec3, radius: f32) -> Option<f32> {
    let sin2 = radius * radius / (center - origin).length_squared();
    (sin2 < 1.0).then(|| sin2 / (1.0 + (1.0 - sin2).sqrt()))
}

/// A point uniform over a mesh and its normal; the first number also chooses the triangle, so that neighbouring
/// numbers stay on one triangle.
#[inline(always)]
fn sample_mesh(mesh: &Mesh, cumulative: &[f32], u: [f32; 2]) -> (Vec3, Vec3) {
    let triangle = cumulative.partition_point(|&end| end <= u[0]).min(cumulative.len() - 1);
    let start = if triangle == 0 { 0.0 } else { cumulative[triangle - 1] };
    let within = ((u[0] - start) / (cumulative[triangle] - start)).clamp(0.0, 1.0);
    let [b, c] = warp::triangle([within, u[1]]);
    let [p0, p1, p2] = mesh.corners(triangle as u32);
    let (e1, e2) = (p1 - p0, p2 - p0);
    (p0 + e1 * b + e2 * c, e1.cross(e2).normalize())
}
