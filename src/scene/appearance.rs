//! What one side of a surface looks like: scattering functions, alone or mixed, whose parameters may vary from place to
//! place and whose normals may be bent.
//!
//! A scene says all that once, as an [`Appearance`]; a hit makes a [`Scattering`] of it, in which everything is a number.

use std::sync::Arc;

use arrayvec::ArrayVec;
use glam::Vec3;

use super::{
    Profile,
    materials::{Evaluation, Lobes, Material, Null, Scatter, ScatterSample},
    parametrisation::Place,
    relief::{Relief, Tilt},
    textures::{Texture, scalar},
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
    /// Textures in the place of parameters, by their numbers in [`Material::varying`].
    pub textures: Vec<(usize, Arc<Texture>)>,
    /// Its weight is the product of these, 1 where there is none.
    pub shares: Vec<Share>,
    /// How its normals are bent.
    pub relief: Option<Relief>,
}

/// A factor w or 1 − w of weights, w within [0, 1].
#[derive(Clone, Debug)]
pub struct Share {
    /// w.
    pub value: ShareValue,
    /// 1 − w is meant.
    pub is_rest: bool,
}

/// A number that is the same everywhere or the luminance of a texture.
#[derive(Clone, Debug)]
pub enum ShareValue {
    /// The same everywhere.
    Constant(f32),
    /// The luminance of a texture.
    Textured(Arc<Texture>),
}

impl Share {
    fn at(&self, place: &Place) -> f32 {
        let value = match &self.value {
            ShareValue::Constant(value) => *value,
            ShareValue::Textured(texture) => scalar(texture.at(place.uv)).clamp(0.0, 1.0),
        };
        if self.is_rest { 1.0 - value } else { value }
    }

    /// Whether it is 0 everywhere.
    fn is_nothing(&self) -> bool {
        match self.value {
            ShareValue::Constant(value) => value == f32::from(u8::from(self.is_rest)),
            ShareValue::Textured(_) => false,
        }
    }

    /// Whether it is 1 everywhere.
    fn is_all(&self) -> bool {
        match self.value {
            ShareValue::Constant(value) => value == f32::from(u8::from(!self.is_rest)),
            ShareValue::Textured(_) => false,
        }
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
    pub fn blend(self, other: Appearance, weight: ShareValue) -> Appearance {
        let shared = |appearance: Appearance, is_rest: bool| {
            let share = Share { value: weight.clone(), is_rest };
            appearance.parts.into_iter().filter_map(move |mut part| {
                if share.is_nothing() {
                    return None;
                }
                if !share.is_all() {
                    part.shares.push(share.clone());
                }
                Some(part)
            })
        };
        let parts = shared(self, true).chain(shared(other, false)).collect();
        Appearance { parts }
    }

    /// As much of it as `opacity` says, with nothing in between.
    pub fn masked(self, opacity: ShareValue) -> Appearance {
        Appearance::from(Material::Null(Null)).blend(self, opacity)
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
                ShareValue::Textured(texture) => Some(texture),
                ShareValue::Constant(_) => None,
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

    /// The scattering function at a place of a surface with that shading frame and geometric normal, seen from `wo`; see
    /// [`Relief::at`].
    pub(super) fn at(&self, place: &Place, frame: &Frame, ng: Vec3, wo: Vec3) -> Mixture {
        let components = self.parts.iter().map(|part| {
            let mut material = part.material;
            for (parameter, texture) in &part.textures {
                material.put(*parameter, texture.at(place.uv));
            }
            Component {
                share: part.shares.iter().map(|share| share.at(place)).product(),
                material,
                tilt: part.relief.as_ref().map(|relief| relief.at(place, frame, ng, wo)),
            }
        });
        Mixture(components.filter(|component| component.share > 0.0).collect())
    }
}

/// The scattering function at one point.
#[derive(Clone, Debug)]
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
    /// Whether some lobe has a finite density.
    #[inline(always)]
    pub fn is_smooth<P: Profile>(&self) -> bool {
        match self {
            _ if P::DIFFUSE => true,
            Scattering::Plain(material) => material.lobes().smooth,
            _ if !P::VARYING => unreachable!("a profile without textures and mixtures"),
            Scattering::Mixed(mixture) => mixture.0.iter().any(|component| component.material.lobes().smooth),
        }
    }

    /// See [`Scatter::sample`].
    #[inline(always)]
    pub fn sample<P: Profile>(&self, wo: Vec3, u: [f32; 2], choice: f32) -> Option<ScatterSample> {
        match self {
            Scattering::Plain(Material::Diffuse(diffuse)) => diffuse.sample(wo, u, choice),
            _ if P::DIFFUSE => unreachable!("a profile with diffuse materials only"),
            Scattering::Plain(material) => material.sample(wo, u, choice),
            _ if !P::VARYING => unreachable!("a profile without textures and mixtures"),
            Scattering::Mixed(mixture) => mixture.sample(wo, u, choice),
        }
    }

    /// See [`Scatter::evaluate`].
    #[inline(always)]
    pub fn evaluate<P: Profile>(&self, wo: Vec3, wi: Vec3) -> Evaluation {
        match self {
            Scattering::Plain(Material::Diffuse(diffuse)) => diffuse.evaluate(wo, wi),
            _ if P::DIFFUSE => unreachable!("a profile with diffuse materials only"),
            Scattering::Plain(material) => material.evaluate(wo, wi),
            _ if !P::VARYING => unreachable!("a profile without textures and mixtures"),
            Scattering::Mixed(mixture) => mixture.evaluate(wo, wi),
        }
    }
}
