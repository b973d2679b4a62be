//! `<bsdf>`: the scattering functions of [`materials`], and `twosided` around one or two of them.

use std::collections::HashMap;

use super::document::{Element, Kind};
use super::ids::Ids;
use super::parameters::ElementParameters;
use crate::load::faults::Faults;
use crate::scene::Rgb;
use crate::scene::description::Sides;
use crate::scene::materials::{self, Diffuse, Material};

/// Reads each element once and lists the materials that shapes use.
pub struct Library<'a> {
    ids: &'a Ids<'a>,
    faults: &'a Faults,
    /// Materials in use, in the order of first use.
    pub materials: Vec<Material>,
    read: HashMap<*const Element, Option<Bsdf>>,
    listed: HashMap<*const Element, Sides>,
    defaults: HashMap<Bare, Sides>,
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
    One(Material),
    /// `twosided`; without a back both sides are like the front.
    Two {
        /// Of the front.
        front: Material,
        /// Of the back.
        back: Option<Material>,
    },
}

impl<'a> Library<'a> {
    /// An empty one.
    pub fn new(ids: &'a Ids<'a>, faults: &'a Faults) -> Self {
        Library {
            ids,
            faults,
            materials: Vec::new(),
            read: HashMap::new(),
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
        let sides = match self.bsdf(element)? {
            Bsdf::One(material) => Sides::One(self.list(material)),
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
        let reflectance = if which == Bare::Grey { 0.5 } else { 0.0 };
        let material = Material::Diffuse(Diffuse { reflectance: Rgb::splat(reflectance) });
        let sides = Sides::One(self.list(material));
        self.defaults.insert(which, sides);
        sides
    }

    /// Appends a material.
    fn list(&mut self, material: Material) -> u32 {
        self.materials.push(material);
        self.materials.len() as u32 - 1
    }

    /// The element itself, or the `bsdf` that a `ref` names.
    fn resolved(&self, element: &'a Element) -> Option<&'a Element> {
        if element.kind() != Kind::Reference {
            return Some(element);
        }
        self.ids.referred(element, "bsdf", self.faults)
    }

    /// Reads an element, unless it has been read; its materials are listed only when a shape uses them.
    pub fn bsdf(&mut self, element: &'a Element) -> Option<Bsdf> {
        let key = std::ptr::from_ref(element);
        if !self.read.contains_key(&key) {
            let bsdf = if element.value("type") == "twosided" {
                self.twosided(element)
            } else {
                self.one_sided(element).map(Bsdf::One)
            };
            self.read.insert(key, bsdf);
        }
        self.read[&key].clone()
    }

    /// A `bsdf` of the registry.
    fn one_sided(&self, element: &'a Element) -> Option<Material> {
        let kind = element.attribute("type")?;
        let mut p = ElementParameters::new(element, self.faults);
        let Some(material) = materials::read(&kind.value, &mut p) else {
            let known: Vec<_> = materials::KNOWN.iter().copied().chain(["twosided"]).collect();
            self.faults.unknown(&kind.span, "bsdf", &kind.value, &known);
            return None;
        };
        p.finish();
        Some(material)
    }

    /// `twosided` around the front's `bsdf` and, where it differs, the back's.
    fn twosided(&mut self, element: &'a Element) -> Option<Bsdf> {
        let mut p = ElementParameters::new(element, self.faults);
        let nested = p.nested(&["bsdf", "ref"]);
        p.finish();
        if nested.is_empty() || nested.len() > 2 {
            let message = format!("bsdf \"twosided\" holds {} bsdfs; accepted: 1 or 2", nested.len());
            self.faults.at(nested.get(2).map_or(element.span_of("type"), |third| &third.span), message);
        }
        let mut materials = nested.into_iter().map(|side| self.side(side)).collect::<Vec<_>>().into_iter();
        let front = materials.next()??;
        match materials.next() {
            None => Some(Bsdf::Two { front, back: None }),
            Some(back) => Some(Bsdf::Two { front, back: Some(back?) }),
        }
    }

    /// What one side of a `twosided` is; neither transmits.
    fn side(&mut self, side: &'a Element) -> Option<Material> {
        let element = self.resolved(side)?;
        if element.value("type") == "twosided" {
            self.faults.at(&side.span, "bsdf \"twosided\" cannot hold another one");
            return None;
        }
        let Some(Bsdf::One(material)) = self.bsdf(element) else { return None };
        if material.lobes().transmit() {
            let message = format!("bsdf \"twosided\" cannot hold {}, which transmits light", element.described());
            self.faults.at(&side.span, message);
        }
        Some(material)
    }
}
