//! Normals bent by textures, as if a surface had a relief that its geometry lacks.

use std::sync::Arc;

use glam::Vec3;

use super::{
    materials::{Evaluation, Material, ScatterSample},
    parametrisation::Place,
    textures::Texture,
};
use crate::math::Frame;

/// What bends normals.
#[derive(Clone, Debug)]
pub struct Relief {
    /// Heights or normals.
    pub texture: Arc<Texture>,
    /// What the texture holds.
    pub kind: ReliefKind,
    /// Normals that are bent away from the eye are bent the other way instead.
    pub flip_invalid: bool,
    /// Light is attenuated where bent normals would see light that the surface does not.
    pub shadowing: bool,
}

/// What the texture of a relief holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ReliefKind {
    /// Heights along the normal in units of the scene over this factor.
    Heights {
        /// Multiplies heights.
        scale: f32,
    },
    /// Normals (x, y, z) in the shading frame, as (c + 1)/2.
    Normals,
}

/// A shading frame bent at one point.
#[derive(Clone, Debug)]
pub(super) struct Tilt {
    /// The bent frame in coordinates of the one that it was bent from.
    frame: Frame,
    /// The one that takes its place where it is turned away from the eye, if any.
    turned: Option<Frame>,
    /// How fast light is attenuated towards grazing directions, as the square of a roughness.
    shadow: f32,
}

impl Relief {
    /// The texture.
    pub fn texture(&self) -> &Arc<Texture> {
        &self.texture
    }

    /// At a place of a surface with that shading frame and geometric normal.
    pub(super) fn at(&self, place: &Place, frame: &Frame, ng: Vec3) -> Tilt {
        let (du, dv) = (frame.to_local(place.du), frame.to_local(place.dv));
        let n = match self.kind {
            ReliefKind::Heights { scale } => {
                let slope = scale * self.texture.slope(place.uv).unwrap_or_default();
                let n = du.with_z(slope.x).cross(dv.with_z(slope.y)).normalize_or(Vec3::Z);
                if frame.to_local(ng).dot(n) < 0.0 { -n } else { n }
            }
            ReliefKind::Normals => (2.0 * self.texture.at(place.uv) - Vec3::ONE).normalize_or(Vec3::Z),
        };
        let about = |n: Vec3| match (du - n * n.dot(du)).try_normalize() {
            Some(s) => Frame { s, t: n.cross(s), n },
            None => Frame::new(n),
        };
        let cos2 = (n.z * n.z).clamp(f32::MIN_POSITIVE, 1.0);
        let shadow = if self.shadowing { (SHADOW * (1.0 - cos2) / cos2).min(1.0) } else { 0.0 };
        let turned = self.flip_invalid.then(|| about(Vec3::new(-n.x, -n.y, n.z)));
        Tilt { frame: about(n), turned, shadow }
    }
}

/// Squared roughness of a surface by the squared tangent of its normals.
/// Source: Estevez, Lecocq & Stein 2019, "A microfacet-based shadowing function to solve the bump terminator problem".
const SHADOW: f32 = 0.125;

impl Tilt {
    /// The frame as seen from `wo` (whose z is that of the side where both sides are seen as fronts).
    fn seen_from(&self, wo: Vec3) -> &Frame {
        match &self.turned {
            Some(turned) if self.frame.n.dot(wo) * wo.z < 0.0 => turned,
            _ => &self.frame,
        }
    }

    /// The part of light from `w` that reaches bent normals: G₁ of GGX with the roughness that they stand for.
    fn lit(&self, w: Vec3) -> f32 {
        let cos2 = (w.z * w.z).clamp(1e-12, 1.0);
        2.0 / (1.0 + (1.0 + self.shadow * (1.0 - cos2) / cos2).sqrt())
    }

    /// Samples a material whose normal is bent; directions are in the frame as it was.
    pub fn sample(&self, material: &Material, wo: Vec3, u: [f32; 2], choice: f32) -> Option<ScatterSample> {
        let frame = self.seen_from(wo);
        let sample = material.sample(frame.to_local(wo), u, choice)?;
        let wi = frame.to_world(sample.wi);
        // on the same side of the surface as of the bent one
        (wi.z * sample.wi.z > 0.0).then(|| ScatterSample { wi, weight: sample.weight * self.lit(wi), ..sample })
    }

    /// Value and density; directions are in the frame as it was.
    pub fn evaluate(&self, material: &Material, wo: Vec3, wi: Vec3) -> Evaluation {
        let frame = self.seen_from(wo);
        let bent = frame.to_local(wi);
        if bent.z * wi.z <= 0.0 {
            return Evaluation::ZERO;
        }
        let Evaluation { value, pdf } = material.evaluate(frame.to_local(wo), bent);
        Evaluation { value: value * self.lit(wi), pdf }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec2;

    use super::*;
    use crate::scene::{
        Rgb,
        materials::Diffuse,
        textures::{Bitmap, Texture},
    };

    const FRAME: Frame = Frame { s: Vec3::X, t: Vec3::Y, n: Vec3::Z };

    /// A rectangle of 4 × 2.
    const PLACE: Place =
        Place { uv: Vec2::new(0.599_102_56, 0.443_301_26), du: Vec3::new(4.0, 0.0, 0.0), dv: Vec3::new(0.0, 2.0, 0.0) };

    fn relief(kind: ReliefKind, flip_invalid: bool, shadowing: bool, map: Bitmap) -> Relief {
        Relief { texture: Arc::new(Texture::Bitmap(map)), kind, flip_invalid, shadowing }
    }

    fn normals(normal: [f32; 3], flip_invalid: bool) -> Relief {
        relief(ReliefKind::Normals, flip_invalid, false, Bitmap::of_texels(1, 1, vec![normal]))
    }

    /// Values and densities of a diffuse material of reflectance 0.8 against Mitsuba 3.9.1's.
    fn check(relief: &Relief, place: &Place, frame: &Frame, ng: Vec3, wo: Vec3, expected: &[([f32; 3], f32)]) {
        let diffuse = Material::Diffuse(Diffuse { reflectance: Rgb::splat(0.8) });
        let tilt = relief.at(place, frame, ng);
        for &(wi, value) in expected {
            let got = tilt.evaluate(&diffuse, wo, Vec3::from(wi).normalize()).value.x;
            assert!((got - value).abs() < 2e-5, "{:?} from {wo} to {wi:?}: {got} for {value}", relief.kind);
        }
    }

    const DIRECTIONS: [[f32; 3]; 5] =
        [[0.0, 0.0, 1.0], [0.5, 0.2, 0.6], [-0.8, 0.1, 0.3], [0.3, -0.9, 0.1], [0.1, 0.1, -1.0]];

    #[test]
    fn heights_bend_normals_as_mitsubas_do() {
        let heights = [
            0.261_612_15,
            0.298_491_15,
            0.814_225_73,
            0.091_915_94,
            0.600_100_5,
            0.728_560_5,
            0.187_901_08,
            0.055_146_627,
            0.274_969_37,
            0.657_433_03,
            0.562_265_63,
            0.150_062_26,
            0.432_630_78,
            0.669_297_3,
            0.422_784_7,
            0.633_184_4,
        ];
        let map = || Bitmap::of_texels(4, 4, heights.map(|h| [h; 3]).to_vec());
        for (shadowing, expected) in
            [(true, [0.100_207, 0.092_417, 0.0, 0.053_103, 0.0]), (false, [0.100_207, 0.103_729, 0.0, 0.236_291, 0.0])]
        {
            let relief = relief(ReliefKind::Heights { scale: 3.0 }, true, shadowing, map());
            let expected: Vec<_> = DIRECTIONS.into_iter().zip(expected).collect();
            for wo in [Vec3::Z, Vec3::new(0.9559, -0.2734, 0.1072)] {
                check(&relief, &PLACE, &FRAME, Vec3::Z, wo, &expected);
            }
        }
    }

    /// A shading normal far from the geometric one, and heights that fall along u.
    #[test]
    fn bent_normals_stay_on_the_side_of_the_geometry() {
        let n = Vec3::new(0.9, 0.0, 0.3).normalize();
        let s = (Vec3::X - n * n.x).normalize();
        let frame = Frame { s, t: n.cross(s), n };
        let place = Place { uv: Vec2::splat(0.3), du: Vec3::X, dv: Vec3::Y };
        let heights = (0..64).map(|i| [-((i % 8) as f32); 3]).collect();
        let relief = relief(ReliefKind::Heights { scale: -1.0 }, true, false, Bitmap::of_texels(8, 8, heights));
        let wo = frame.to_local(Vec3::Z);
        check(
            &relief,
            &place,
            &frame,
            Vec3::Z,
            wo,
            &[([0.0, 0.0, 1.0], 0.010_057_985), ([-0.8, 0.1, 0.3], 0.240_140_6), ([0.5, 0.2, 0.6], 0.0)],
        );
    }

    #[test]
    fn normals_that_look_away_are_turned_round() {
        let left = Vec3::new(-0.745_3, 0.660_8, 0.088_7);
        let expected = [([0.0, 0.0, 1.0], 0.052_994), ([-0.8, 0.1, 0.3], 0.250_114), ([0.5, 0.2, 0.6], 0.0)];
        check(&normals([0.97, 0.5, 0.6], true), &PLACE, &FRAME, Vec3::Z, left, &expected);
        check(&normals([0.97, 0.5, 0.6], false), &PLACE, &FRAME, Vec3::Z, left, &expected.map(|(wi, _)| (wi, 0.0)));
        let below = normals([0.9, 0.55, 0.3], true);
        check(&below, &PLACE, &FRAME, Vec3::Z, left, &[([-0.8, 0.1, 0.3], 0.167_746), ([0.0, 0.0, 1.0], 0.0)]);
        let right = Vec3::new(0.955_9, -0.273_4, 0.107_2);
        check(&below, &PLACE, &FRAME, Vec3::Z, right, &[([0.5, 0.2, 0.6], 0.063_17), ([0.9, 0.1, 0.1], 0.214_293)]);
    }

    #[test]
    fn flat_heights_bend_nothing() {
        let relief = relief(ReliefKind::Heights { scale: 5.0 }, true, true, Bitmap::of_texels(2, 2, vec![[0.4; 3]; 4]));
        let tilt = relief.at(&PLACE, &FRAME, Vec3::Z);
        assert_eq!(tilt.frame, FRAME);
        assert_eq!(tilt.lit(Vec3::new(0.9, 0.0, 0.1).normalize()), 1.0);
    }
}
