//! `<bsdf>`: the scattering functions of [`materials`], and those that are made of others: `twosided` around one or two,
//! `mask` and `blendbsdf`, `bumpmap` and `normalmap`.

use std::collections::HashMap;
use std::sync::Arc;

use super::document::{Element, Kind};
use super::ids::Ids;
use super::parameters::ElementParameters;
use super::textures::Textures;
use crate::load::faults::Faults;
use crate::scene::Rgb;
use crate::scene::appearance::{Appearance, Part};
use crate::scene::description::Sides;
use crate::scene::materials::{self, Diffuse, Material};
use crate::scene::parameters::{Parameters, Range};
use crate::scene::relief::{Relief, ReliefKind};
use crate::scene::textures::{Texture, Varying};

/// Reads each element once and lists the appearances that shapes use.
pub struct Library<'a> {
    ids: &'a Ids<'a>,
    textures: &'a Textures<'a>,
    faults: &'a Faults,
    /// Appearances in use, in the order of first use.
    pub appearances: Vec<Appearance>,
    read: HashMap<*const Element, Reading>,
    /// How many are being read, each inside of the one before or referred to by it.
    depth: usize,
    listed: HashMap<*const Element, Sides>,
    defaults: HashMap<Bare, Sides>,
}

/// How far reading an element has come.
enum Reading {
    /// It is being read: whatever refers to it now is part of it.
    Begun,
    /// It has been read; `None` where it is faulty.
    Done(Option<Bsdf>),
}

/// What a surface without a `bsdf` is, as in Mitsuba.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub enum Bare {
    /// A diffuse one of reflectance one half.
    Grey,
    /// A diffuse one of reflectance zero: what emits need not reflect.
    Black,
}

/// A surface.
#[derive(Clone, Debug)]
pub enum Bsdf {
    /// One with a front.
    One(Appearance),
    /// `twosided`; without a back both sides are like the front.
    Two {
        /// Of the front.
        front: Appearance,
        /// Of the back.
        back: Option<Appearance>,
    },
}

impl Bsdf {
    /// Changed on each of its sides.
    fn map(self, mut change: impl FnMut(Appearance) -> Option<Appearance>) -> Option<Bsdf> {
        Some(match self {
            Bsdf::One(one) => Bsdf::One(change(one)?),
            Bsdf::Two { front, back: None } => Bsdf::Two { front: change(front)?, back: None },
            Bsdf::Two { front, back: Some(back) } => Bsdf::Two { front: change(front)?, back: Some(change(back)?) },
        })
    }

    /// Front and back, where both are seen as fronts: what has a front only and transmits nothing is black from behind.
    fn both_sides(self) -> Result<[Appearance; 2], Appearance> {
        match self {
            Bsdf::One(one) if one.lobes().transmit() => Err(one),
            Bsdf::One(one) => Ok([one, diffuse(0.0).into()]),
            Bsdf::Two { front, back } => Ok([front.clone(), back.unwrap_or(front)]),
        }
    }
}

fn diffuse(reflectance: f32) -> Material {
    Material::Diffuse(Diffuse { reflectance: Rgb::splat(reflectance) })
}

/// Deepest nesting, by elements or by references. Keeps hostile files from exhausting the stack.
const MAX_NESTING: usize = 64;

/// Names of those that are made of others.
const COMPOSITES: [&str; 5] = ["blendbsdf", "bumpmap", "mask", "normalmap", "twosided"];

impl<'a> Library<'a> {
    /// An empty one.
    pub fn new(ids: &'a Ids<'a>, textures: &'a Textures<'a>, faults: &'a Faults) -> Self {
        Library {
            ids,
            textures,
            faults,
            appearances: Vec::new(),
            read: HashMap::new(),
            depth: 0,
            listed: HashMap::new(),
            defaults: HashMap::new(),
        }
    }

    /// The sides of a surface with this `bsdf`, or with the one that this `ref` names.
    pub fn sides(&mut self, element: &'a Element) -> Option<Sides> {
        let element = self.resolved(element)?;
        if let Some(sides) = self.listed.get(&std::ptr::from_ref(element)) {
            return Some(*sides);
        }
        let sides = match self.bsdf(element, element)? {
            Bsdf::One(one) => Sides::One(self.list(one)),
            Bsdf::Two { front, back } => {
                let front = self.list(front);
                Sides::Two { front, back: back.map_or(front, |back| self.list(back)) }
            }
        };
        self.listed.insert(element, sides);
        Some(sides)
    }

    /// The sides of a surface without a `bsdf`.
    pub fn bare_sides(&mut self, which: Bare) -> Sides {
        if let Some(sides) = self.defaults.get(&which) {
            return *sides;
        }
        let sides = Sides::One(self.list(diffuse(if which == Bare::Grey { 0.5 } else { 0.0 }).into()));
        self.defaults.insert(which, sides);
        sides
    }

    /// Appends an appearance.
    fn list(&mut self, appearance: Appearance) -> u32 {
        self.appearances.push(appearance);
        self.appearances.len() as u32 - 1
    }

    /// The element itself, or the `bsdf` that a `ref` names.
    fn resolved(&self, element: &'a Element) -> Option<&'a Element> {
        if element.kind() != Kind::Reference {
            return Some(element);
        }
        self.ids.referred(element, "bsdf", self.faults)
    }

    /// Reads an element, unless it has been read; its appearances are listed only when a shape uses them. `user` is the
    /// element itself or what refers to it.
    pub fn bsdf(&mut self, element: &'a Element, user: &Element) -> Option<Bsdf> {
        let key = std::ptr::from_ref(element);
        match self.read.get(&key) {
            Some(Reading::Done(bsdf)) => return bsdf.clone(),
            Some(Reading::Begun) => {
                self.faults.at(&user.span, format!("{} refers to itself, if by detours", element.described()));
                return None;
            }
            None => {}
        }
        if self.depth == MAX_NESTING {
            self.faults.at(&user.span, format!("bsdfs are inside one another deeper than {MAX_NESTING} levels"));
            return None;
        }
        self.read.insert(key, Reading::Begun);
        self.depth += 1;
        let bsdf = match element.value("type") {
            "blendbsdf" => self.blend(element),
            "bumpmap" => self.relief(element, true),
            "mask" => self.mask(element),
            "normalmap" => self.relief(element, false),
            "twosided" => self.twosided(element),
            _ => self.simple(element).map(Bsdf::One),
        };
        self.depth -= 1;
        self.read.insert(key, Reading::Done(bsdf.clone()));
        bsdf
    }

    /// A `bsdf` of the registry.
    fn simple(&self, element: &'a Element) -> Option<Appearance> {
        let kind = element.attribute("type")?;
        let varying = materials::varying(&kind.value);
        let mut p = ElementParameters::new(element, self.faults).with_textures(self.textures).with_varying(varying);
        let Some(material) = materials::read(&kind.value, &mut p) else {
            let mut known: Vec<_> = materials::KNOWN.iter().copied().chain(COMPOSITES).collect();
            known.sort_unstable();
            self.faults.unknown(&kind.span, "bsdf", &kind.value, &known);
            return None;
        };
        let textures = p.textured();
        p.finish();
        Some(Part { textures, ..Part::from(material) }.into())
    }

    /// The `bsdf`s directly inside, as many as accepted, read.
    fn inside(
        &mut self,
        element: &'a Element,
        p: &mut ElementParameters<'a>,
        accepted: std::ops::RangeInclusive<usize>,
    ) -> Option<Vec<(&'a Element, Bsdf)>> {
        let mut nested = p.nested(&["bsdf", "ref"]);
        nested.retain(|child| !self.textures.is_texture(child));
        if !accepted.contains(&nested.len()) {
            let (least, most) = (accepted.start(), accepted.end());
            let accepted = if least == most { format!("{least}") } else { format!("{least} or {most}") };
            let message = format!("{} holds {} bsdfs; accepted: {accepted}", element.described(), nested.len());
            self.faults.at(nested.get(*most).map_or(element.span_of("type"), |surplus| &surplus.span), message);
            nested.truncate(*most);
        }
        let is_enough = nested.len() >= *accepted.start();
        let read: Vec<_> = nested
            .into_iter()
            .map(|child| Some((child, self.resolved(child).and_then(|resolved| self.bsdf(resolved, child))?)))
            .collect();
        let read: Option<Vec<_>> = read.into_iter().collect();
        read.filter(|_| is_enough)
    }

    /// `twosided` around the front's `bsdf` and, where it differs, the back's; neither transmits.
    fn twosided(&mut self, element: &'a Element) -> Option<Bsdf> {
        let mut p = ElementParameters::new(element, self.faults);
        let inside = self.inside(element, &mut p, 1..=2);
        p.finish();
        let mut sides = Vec::new();
        for (child, bsdf) in inside? {
            let Bsdf::One(appearance) = bsdf else {
                self.faults.at(&child.span, "bsdf \"twosided\" cannot hold another one");
                return None;
            };
            if appearance.lobes().transmit() {
                let described = self.resolved(child).map_or_else(String::new, Element::described);
                let message = format!("bsdf \"twosided\" cannot hold {described}, which transmits light");
                self.faults.at(&child.span, message);
            }
            sides.push(appearance);
        }
        let mut sides = sides.into_iter();
        Some(Bsdf::Two { front: sides.next()?, back: sides.next() })
    }

    /// `mask`: as much of the `bsdf` inside as `opacity` says (default 0.5).
    fn mask(&mut self, element: &'a Element) -> Option<Bsdf> {
        let mut p = ElementParameters::new(element, self.faults).with_textures(self.textures);
        let opacity = self.share(&mut p, "opacity", Some(0.5));
        let inside = self.inside(element, &mut p, 1..=1);
        p.finish();
        let (opacity, (_, bsdf)) = (opacity?, inside?.pop()?);
        let masked = bsdf.map(|appearance| Some(appearance.masked(opacity.clone())));
        self.checked(element, masked)
    }

    /// `blendbsdf`: the first `bsdf` where `weight` is 0, the second where it is 1.
    fn blend(&mut self, element: &'a Element) -> Option<Bsdf> {
        let mut p = ElementParameters::new(element, self.faults).with_textures(self.textures);
        let weight = self.share(&mut p, "weight", None);
        let inside = self.inside(element, &mut p, 2..=2);
        p.finish();
        let (weight, mut inside) = (weight?, inside?.into_iter());
        let (first, second) = (inside.next()?.1, inside.next()?.1);
        let blended = match (first, second) {
            (Bsdf::One(first), Bsdf::One(second)) => Some(Bsdf::One(first.blend(second, weight))),
            (first, second) => match (first.both_sides(), second.both_sides()) {
                (Ok([front, back]), Ok([other_front, other_back])) => Some(Bsdf::Two {
                    front: front.blend(other_front, weight.clone()),
                    back: Some(back.blend(other_back, weight)),
                }),
                _ => {
                    let message = "bsdf \"blendbsdf\" cannot blend a \"twosided\" with one that transmits light";
                    self.faults.at(&element.span, message);
                    None
                }
            },
        };
        self.checked(element, blended)
    }

    /// `bumpmap` (heights, times `scale`) and `normalmap`: the `bsdf` inside with normals bent by a texture.
    fn relief(&mut self, element: &'a Element, heights: bool) -> Option<Bsdf> {
        let mut p = ElementParameters::new(element, self.faults).with_textures(self.textures);
        let kind = match heights {
            true => ReliefKind::Heights { scale: p.float("scale").unwrap_or(1.0) },
            false => ReliefKind::Normals,
        };
        let flip_invalid = p.boolean("flip_invalid_normals").unwrap_or(true);
        let shadowing = p.boolean("use_shadowing_function").unwrap_or(true);
        let texture = self.single_texture(element, &mut p);
        let inside = self.inside(element, &mut p, 1..=1);
        p.finish();
        let (texture, (_, bsdf)) = (texture?, inside?.pop()?);
        if heights && texture.slope(glam::Vec2::ZERO).is_none() {
            let message = "heights have no slope: a bumpmap needs a bitmap whose filter_type is bilinear";
            self.faults.at(element.span_of("type"), message);
            return None;
        }
        let relief = Relief { texture, kind, flip_invalid, shadowing };
        let bent = bsdf.map(|appearance| appearance.with_relief(&relief));
        if bent.is_none() {
            let message = format!("{} is around another one; only one of them can bend normals", element.described());
            self.faults.at(&element.span, message);
        }
        bent
    }

    /// The one texture inside, whatever its name.
    fn single_texture(&self, element: &'a Element, p: &mut ElementParameters<'a>) -> Option<Arc<Texture>> {
        let mut textures = p.nested(&["texture", "ref"]);
        textures.retain(|child| self.textures.is_texture(child));
        if textures.len() != 1 {
            let message = format!("{} holds {} textures; accepted: 1", element.described(), textures.len());
            self.faults.at(textures.get(1).map_or(element.span_of("type"), |surplus| &surplus.span), message);
        }
        textures.first().and_then(|texture| self.textures.get(texture))
    }

    /// A part of one, as a number or as a texture; without default it must be there.
    fn share(&self, p: &mut ElementParameters<'a>, name: &str, default: Option<f32>) -> Option<Varying> {
        if let Some(texture) = p.texture(name, Range::Fraction) {
            return texture.map(Varying::Textured);
        }
        let Some(value) = p.float(name).or(default) else {
            if !p.is_given(name) {
                p.fault("", format!("{} needs the parameter {name:?}", p.element.described()));
            }
            return None;
        };
        if !(0.0..=1.0).contains(&value) {
            p.fault(name, format!("{name} is {value}; it must lie between 0 and 1"));
            return None;
        }
        Some(Varying::Constant(Rgb::splat(value)))
    }

    /// A mixture of no more parts than a hit has room for.
    fn checked(&self, element: &Element, mixture: Option<Bsdf>) -> Option<Bsdf> {
        let bsdf = mixture?;
        let parts = match &bsdf {
            Bsdf::One(one) => one.parts().len(),
            Bsdf::Two { front, back } => front.parts().len().max(back.as_ref().map_or(0, |b| b.parts().len())),
        };
        if parts > Appearance::MOST_PARTS {
            let most = Appearance::MOST_PARTS;
            self.faults
                .at(&element.span, format!("{} mixes {parts} bsdfs; accepted: up to {most}", element.described()));
            return None;
        }
        Some(bsdf)
    }
}
