//! What one side of a surface looks like: scattering functions, alone or mixed, whose parameters may vary from place to
//! place and whose normals may be bent.
//!
//! A scene says all that once, as an [`Appearance`]; a hit makes a [`Scattering`] of it, in which everything is a number.

use std::sync::Arc;

use arrayvec::ArrayVec;
use glam::Vec3;

use super::{
    Profile,
    materials::{Evaluation, Inverse, Lobes, Material, Null, Scatter, ScatterSample},
    parametrisation::Place,
    relief::{Relief, ReliefKind, Tilt},
    textures::{Texture, Varying, scalar},
};
use crate::math::Frame;

/// One side of a surface: a mixture f = Σ wᵢ fᵢ with Σ wᵢ = 1 of at least one part.
#[derive(Clone, Debug)]
pub struct Appearance {
    parts: Vec<Part>,
}

/// One scattering function of a mixture.
#[derive(Clone, Debug)]
pub struct Part {
    /// The scattering function; parameters that vary have any value.
    pub material: Material,
    /// Textures in the place of parameters, by their numbers in [`materials::varying`](super::materials::varying).
    pub textures: Vec<(usize, Arc<Texture>)>,
    /// Its weight is the product of these, 1 where there is none.
    pub shares: Vec<Share>,
    /// How its normals are bent.
    pub relief: Option<Relief>,
}

/// A factor w or 1 − w of weights, w within [0, 1].
#[derive(Clone, Debug)]
pub struct Share {
    /// w, or a colour of that relative luminance.
    pub value: Varying,
    /// 1 − w is meant.
    pub is_rest: bool,
}

impl Share {
    fn at(&self, place: &Place) -> f32 {
        let value = scalar(self.value.at(|| place.uv)).clamp(0.0, 1.0);
        if self.is_rest { 1.0 - value } else { value }
    }

    /// The value that it has everywhere, if it has one.
    fn everywhere(&self) -> Option<f32> {
        let Varying::Constant(value) = self.value else { return None };
        Some(if self.is_rest { 1.0 - scalar(value) } else { scalar(value) })
    }
}

impl From<Material> for Part {
    fn from(material: Material) -> Part {
        Part { material, textures: Vec::new(), shares: Vec::new(), relief: None }
    }
}

impl From<Material> for Appearance {
    fn from(material: Material) -> Appearance {
        Appearance { parts: vec![material.into()] }
    }
}

impl From<Part> for Appearance {
    fn from(part: Part) -> Appearance {
        Appearance { parts: vec![part] }
    }
}

impl Appearance {
    /// Most parts of a mixture.
    pub const MOST_PARTS: usize = 8;

    /// The first where `weight` is 0 and the second where it is 1.
    pub fn blend(self, other: Appearance, weight: Varying) -> Appearance {
        let shared = |appearance: Appearance, is_rest: bool| {
            let share = Share { value: weight.clone(), is_rest };
            appearance.parts.into_iter().filter_map(move |mut part| {
                match share.everywhere() {
                    Some(0.0) => return None,
                    Some(1.0) => {}
                    _ => part.shares.push(share.clone()),
                }
                Some(part)
            })
        };
        let parts = shared(self, true).chain(shared(other, false)).collect();
        Appearance { parts }
    }

    /// As much of it as `opacity` says, with nothing in between.
    pub fn masked(self, opacity: Varying) -> Appearance {
        Appearance::from(Material::Null(Null)).blend(self, opacity)
    }

    /// Multiplies heights of reliefs, for surfaces that become as much larger.
    pub fn scale_heights(&mut self, factor: f32) {
        for relief in self.parts.iter_mut().filter_map(|part| part.relief.as_mut()) {
            if let ReliefKind::Heights { scale } = &mut relief.kind {
                *scale *= factor;
            }
        }
    }

    /// With bent normals; `None` where a part has some already.
    pub fn with_relief(mut self, relief: &Relief) -> Option<Appearance> {
        if self.parts.iter().any(|part| part.relief.is_some()) {
            return None;
        }
        // light that passes straight through does not care
        for part in self.parts.iter_mut().filter(|part| !matches!(part.material, Material::Null(_))) {
            part.relief = Some(relief.clone());
        }
        Some(self)
    }

    /// What it is mixed of.
    pub fn parts(&self) -> &[Part] {
        &self.parts
    }

    /// The scattering function, where it is a single one that is the same everywhere.
    pub fn plain(&self) -> Option<&Material> {
        match &self.parts[..] {
            [Part { material, textures, shares, relief: None }] if textures.is_empty() && shares.is_empty() => {
                Some(material)
            }
            _ => None,
        }
    }

    /// All textures in use.
    pub fn textures(&self) -> impl Iterator<Item = &Arc<Texture>> {
        self.parts.iter().flat_map(|part| {
            let of_parameters = part.textures.iter().map(|(_, texture)| texture);
            let of_shares = part.shares.iter().filter_map(|share| match &share.value {
                Varying::Textured(texture) => Some(texture),
                Varying::Constant(_) => None,
            });
            of_parameters.chain(of_shares).chain(part.relief.as_ref().map(Relief::texture))
        })
    }

    /// Whether the direction of tangents matters.
    pub fn needs_tangents(&self) -> bool {
        self.parts.iter().any(|part| part.relief.is_some() || part.material.needs_tangents())
    }

    /// The lobes of all parts.
    pub fn lobes(&self) -> Lobes {
        self.parts.iter().map(|part| part.material.lobes()).fold(Lobes::NONE, Lobes::or)
    }

    /// Whether scattering takes a primary dimension for choosing among lobes or parts.
    pub fn needs_choice(&self) -> bool {
        self.parts.len() > 1 || self.parts.iter().any(|part| part.material.lobes().need_choice())
    }

    /// The scattering function at a place of a surface with that shading frame and geometric normal; see [`Relief::at`].
    pub(super) fn at(&self, place: &Place, frame: &Frame, ng: Vec3) -> Mixture {
        let components = self.parts.iter().map(|part| {
            let mut material = part.material;
            for (parameter, texture) in &part.textures {
                material.put(*parameter, texture.at(place.uv));
            }
            Component {
                share: part.shares.iter().map(|share| share.at(place)).product(),
                material,
                tilt: part.relief.as_ref().map(|relief| relief.at(place, frame, ng)),
            }
        });
        Mixture(components.filter(|component| component.share > 0.0).collect())
    }
}

/// The scattering function at one point.
#[derive(Clone, Debug)]
#[expect(
    clippy::large_enum_variant,
    reason = "it lives on the stack for one vertex; a box would allocate at every hit"
)]
pub enum Scattering<'s> {
    /// One that is the same everywhere.
    Plain(&'s Material),
    /// Any.
    Mixed(Mixture),
}

/// f = Σ wᵢ fᵢ at one point; directions are in the shading frame there.
#[derive(Clone, Debug)]
pub struct Mixture(ArrayVec<Component, { Appearance::MOST_PARTS }>);

#[derive(Clone, Debug)]
struct Component {
    share: f32,
    material: Material,
    tilt: Option<Tilt>,
}

impl Component {
    fn sample(&self, wo: Vec3, u: [f32; 2], choice: f32) -> Option<ScatterSample> {
        match &self.tilt {
            None => self.material.sample(wo, u, choice),
            Some(tilt) => tilt.sample(&self.material, wo, u, choice),
        }
    }

    fn evaluate(&self, wo: Vec3, wi: Vec3) -> Evaluation {
        match &self.tilt {
            None => self.material.evaluate(wo, wi),
            Some(tilt) => tilt.evaluate(&self.material, wo, wi),
        }
    }
}

impl Mixture {
    /// Chooses a component in proportion to its weight and samples it; value and density are those of the whole mixture,
    /// so that what one component seldom samples and another often does is no surprise.
    fn sample(&self, wo: Vec3, u: [f32; 2], choice: f32) -> Option<ScatterSample> {
        let (chosen, choice) = self.choose(choice)?;
        let sample = self.0[chosen].sample(wo, u, choice)?;
        if self.0.len() == 1 || sample.pdf == f32::INFINITY {
            return Some(sample); // its weight over the probability of choosing it is 1
        }
        let Evaluation { value, pdf } = self.evaluate(wo, sample.wi);
        (pdf > 0.0).then(|| ScatterSample { weight: value / pdf, pdf, ..sample })
    }

    /// The component at `choice` ∈ [0, 1), and where within its share that is.
    fn choose(&self, choice: f32) -> Option<(usize, f32)> {
        let last = self.0.len().checked_sub(1)?;
        let mut start = 0.0;
        for (i, component) in self.0.iter().enumerate() {
            let end = start + component.share;
            if choice < end || i == last {
                return Some((i, ((choice - start) / component.share).clamp(0.0, ALMOST_ONE)));
            }
            start = end;
        }
        None
    }

    /// Of a single component whose normals are not bent.
    fn invert(&self, wo: Vec3, wi: Vec3) -> Option<Inverse> {
        match &self.0[..] {
            [Component { material, tilt: None, .. }] => material.invert(wo, wi),
            _ => None,
        }
    }

    fn evaluate(&self, wo: Vec3, wi: Vec3) -> Evaluation {
        self.0.iter().fold(Evaluation::ZERO, |sum, component| {
            let Evaluation { value, pdf } = component.evaluate(wo, wi);
            Evaluation { value: sum.value + component.share * value, pdf: sum.pdf + component.share * pdf }
        })
    }
}

/// The largest number below 1.
const ALMOST_ONE: f32 = 1.0 - f32::EPSILON / 2.0;

impl Scattering<'_> {
    /// The same without owning it.
    #[inline(always)]
    pub fn by_reference(&self) -> ScatteringRef<'_> {
        match self {
            Scattering::Plain(material) => ScatteringRef::Plain(material),
            Scattering::Mixed(mixture) => ScatteringRef::Mixed(mixture),
        }
    }

    /// Whether some lobe has a finite density.
    #[inline(always)]
    pub fn is_smooth<P: Profile>(&self) -> bool {
        self.by_reference().is_smooth::<P>()
    }

    /// See [`Scatter::sample`].
    #[inline(always)]
    pub fn sample<P: Profile>(&self, wo: Vec3, u: [f32; 2], choice: f32) -> Option<ScatterSample> {
        self.by_reference().sample::<P>(wo, u, choice)
    }

    /// See [`Scatter::evaluate`].
    #[inline(always)]
    pub fn evaluate<P: Profile>(&self, wo: Vec3, wi: Vec3) -> Evaluation {
        self.by_reference().evaluate::<P>(wo, wi)
    }
}

/// A scattering function that somebody else keeps.
#[derive(Clone, Copy, Debug)]
pub enum ScatteringRef<'a> {
    /// One that is the same everywhere.
    Plain(&'a Material),
    /// Any.
    Mixed(&'a Mixture),
}

impl ScatteringRef<'_> {
    /// See [`Scatter::invert`].
    pub fn invert(&self, wo: Vec3, wi: Vec3) -> Option<Inverse> {
        match self {
            ScatteringRef::Plain(material) => material.invert(wo, wi),
            ScatteringRef::Mixed(mixture) => mixture.invert(wo, wi),
        }
    }

    /// Whether some lobe has a finite density.
    #[inline(always)]
    pub fn is_smooth<P: Profile>(&self) -> bool {
        match self {
            _ if P::DIFFUSE => true,
            ScatteringRef::Plain(material) => material.lobes().smooth,
            _ if !P::VARYING => unreachable!("a profile without textures and mixtures"),
            ScatteringRef::Mixed(mixture) => mixture.0.iter().any(|component| component.material.lobes().smooth),
        }
    }

    /// See [`Scatter::sample`].
    #[inline(always)]
    pub fn sample<P: Profile>(&self, wo: Vec3, u: [f32; 2], choice: f32) -> Option<ScatterSample> {
        match self {
            ScatteringRef::Plain(Material::Diffuse(diffuse)) => diffuse.sample(wo, u, choice),
            _ if P::DIFFUSE => unreachable!("a profile with diffuse materials only"),
            ScatteringRef::Plain(material) => material.sample(wo, u, choice),
            _ if !P::VARYING => unreachable!("a profile without textures and mixtures"),
            ScatteringRef::Mixed(mixture) => mixture.sample(wo, u, choice),
        }
    }

    /// See [`Scatter::evaluate`].
    #[inline(always)]
    pub fn evaluate<P: Profile>(&self, wo: Vec3, wi: Vec3) -> Evaluation {
        match self {
            ScatteringRef::Plain(Material::Diffuse(diffuse)) => diffuse.evaluate(wo, wi),
            _ if P::DIFFUSE => unreachable!("a profile with diffuse materials only"),
            ScatteringRef::Plain(material) => material.evaluate(wo, wi),
            _ if !P::VARYING => unreachable!("a profile without textures and mixtures"),
            ScatteringRef::Mixed(mixture) => mixture.evaluate(wo, wi),
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec2;

    use super::*;
    use crate::scene::{
        FullProfile, Rgb,
        materials::{Conductor, Diffuse, Lobes},
        textures::Bitmap,
    };

    const FRAME: Frame = Frame { s: Vec3::X, t: Vec3::Y, n: Vec3::Z };

    fn place(u: f32, v: f32) -> Place {
        Place { uv: Vec2::new(u, v), du: Vec3::X, dv: Vec3::Y }
    }

    fn diffuse(reflectance: f32) -> Appearance {
        Material::Diffuse(Diffuse { reflectance: Rgb::splat(reflectance) }).into()
    }

    fn mirror() -> Appearance {
        let mirror = Conductor::examples().pop().expect("a mirror of reflectance 0.9");
        Material::Conductor(mirror).into()
    }

    fn number(value: f32) -> Varying {
        Varying::Constant(Rgb::splat(value))
    }

    /// Left half 0, right half 1, nearly.
    fn halves() -> Varying {
        let texels = (0..64).map(|i| [f32::from(u8::from(i >= 32)); 3]).collect();
        Varying::Textured(Arc::new(Texture::Bitmap(Bitmap::of_texels(64, 1, texels))))
    }

    fn at(appearance: &Appearance, u: f32) -> Mixture {
        appearance.at(&place(u, 0.5), &FRAME, Vec3::Z)
    }

    /// Mean weight of samples over a grid: what is reflected of light from everywhere, and the part that goes straight on.
    fn means(mixture: &Mixture, wo: Vec3) -> [f32; 2] {
        let n = 24;
        let scattering = Scattering::Mixed(mixture.clone());
        let (mut all, mut straight) = (0.0, 0.0);
        for i in 0..n * n * n {
            let [u, v, choice] = [i % n, i / n % n, i / n / n].map(|k| (k as f32 + 0.5) / n as f32);
            let Some(sample) = scattering.sample::<FullProfile>(wo, [u, v], choice) else { continue };
            all += sample.weight.x;
            straight += if sample.wi == -wo { sample.weight.x } else { 0.0 };
        }
        [all, straight].map(|sum| sum / (n * n * n) as f32)
    }

    #[test]
    fn mixtures_reflect_what_their_parts_do() {
        let wo = Vec3::new(0.6, 0.0, 0.8);
        let blend = diffuse(0.5).blend(mirror(), number(0.25));
        let [all, _] = means(&at(&blend, 0.0), wo);
        assert!((all - (0.75 * 0.5 + 0.25 * 0.9)).abs() < 2e-3, "{all}");
        let nested = blend.masked(number(0.25)).blend(diffuse(1.0), number(0.5));
        assert_eq!(nested.parts().len(), 4);
        let [all, straight] = means(&at(&nested, 0.0), wo);
        assert!((straight - 0.5 * 0.75).abs() < 0.03, "{straight}");
        assert!((all - (0.5 * (0.75 + 0.25 * 0.6) + 0.5)).abs() < 4e-3, "{all}");
    }

    #[test]
    fn values_and_densities_are_weighted_sums() {
        let (wo, wi) = (Vec3::new(0.6, 0.0, 0.8), Vec3::new(0.0, 0.6, 0.8));
        let blend = diffuse(0.5).blend(diffuse(0.9), number(0.25));
        let value = at(&blend, 0.0).evaluate(wo, wi);
        let cos = 0.8 * std::f32::consts::FRAC_1_PI;
        assert!((value.value.x - 0.6 * cos).abs() < 1e-6 && (value.pdf - cos).abs() < 1e-6, "{value:?}");
        let masked = diffuse(0.5).masked(number(0.25));
        let value = at(&masked, 0.0).evaluate(wo, wi);
        assert!((value.value.x - 0.125 * cos).abs() < 1e-6 && (value.pdf - 0.25 * cos).abs() < 1e-6, "{value:?}");
    }

    #[test]
    fn weights_follow_their_texture() {
        let blend = diffuse(0.2).blend(diffuse(0.8), halves());
        let albedo = |u: f32| means(&at(&blend, u), Vec3::Z)[0];
        assert!((albedo(0.25) - 0.2).abs() < 1e-3 && (albedo(0.75) - 0.8).abs() < 1e-3);
        assert_eq!(at(&blend, 0.25).0.len(), 1, "parts without weight are left out");
    }

    #[test]
    fn parameters_follow_their_texture() {
        let Varying::Textured(texture) = halves() else { unreachable!() };
        let material = Material::Diffuse(Diffuse { reflectance: Rgb::splat(0.5) });
        let textured = Appearance::from(Part { textures: vec![(0, texture)], ..Part::from(material) });
        assert!(textured.plain().is_none());
        assert_eq!([0.25, 0.75].map(|u| means(&at(&textured, u), Vec3::Z)[0]), [0.0, 1.0]);
    }

    #[test]
    fn weights_of_nothing_and_of_all_leave_one_part() {
        for (weight, reflectance) in [(0.0, 0.2), (1.0, 0.8)] {
            let blend = diffuse(0.2).blend(diffuse(0.8), number(weight));
            let Some(Material::Diffuse(only)) = blend.plain() else { panic!("{blend:?}") };
            assert_eq!(only.reflectance.x, reflectance);
        }
        assert!(diffuse(0.2).masked(number(1.0)).plain().is_some());
        let nothing = diffuse(0.2).masked(number(0.0));
        assert_eq!(nothing.lobes(), Lobes { straight: true, ..Lobes::NONE });
    }
}
