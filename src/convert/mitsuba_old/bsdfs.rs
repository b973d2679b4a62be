//! `<bsdf>`: what each of the old plugins is in Mitsuba 3.

use super::Context;
use super::document::Node;
use super::lobes;
use super::parameters::Take::{Boolean, Colour, Float, Index, Number, Quiet};
use super::parameters::{Index as IndexValue, Parameters, Row, same};
use super::textures;
use super::values::Of;
use crate::convert::numbers_of;
use crate::convert::textures::Use;
use crate::convert::xml::Element;
use crate::load::faults::did_you_mean;
use crate::scene::materials::CONDUCTORS;

/// A plugin that is carried over parameter by parameter.
struct Plugin {
    old: &'static str,
    new: &'static str,
    rows: &'static [Row],
    /// What rows cannot say.
    more: fn(&Parameters, Element) -> Element,
}

const COLOURED_REFLECTION: Row = same("specular_reflectance", Colour);
const TRANSMISSION: Row = same("specular_transmittance", Colour);
const INSIDE: Row = same("int_ior", Index);
const OUTSIDE: Row = same("ext_ior", Index);
const DIFFUSE: Row = same("diffuse_reflectance", Colour);
const VISIBLE: Row = same("sample_visible", Quiet);
const WEIGHT: Row = same("specular_sampling_weight", Quiet);
const ROUGHNESS: [Row; 3] = [same("alpha", Number), same("alpha_u", Number), same("alpha_v", Number)];

const fn plugin(old: &'static str, new: &'static str, rows: &'static [Row]) -> Plugin {
    Plugin { old, new, rows, more: |_, element| element }
}

const PLUGINS: &[Plugin] = &[
    plugin("diffuse", "diffuse", &[same("reflectance", Colour), ("diffuse_reflectance", "reflectance", Colour)]),
    Plugin {
        more: roughdiffuse,
        ..plugin(
            "roughdiffuse",
            "diffuse",
            &[same("reflectance", Colour), ("diffuse_reflectance", "reflectance", Colour)],
        )
    },
    plugin("dielectric", "dielectric", &[INSIDE, OUTSIDE, COLOURED_REFLECTION, TRANSMISSION]),
    plugin("thindielectric", "thindielectric", &[INSIDE, OUTSIDE, COLOURED_REFLECTION, TRANSMISSION]),
    Plugin {
        more: distribution,
        ..plugin(
            "roughdielectric",
            "roughdielectric",
            &[INSIDE, OUTSIDE, COLOURED_REFLECTION, TRANSMISSION, VISIBLE, ROUGHNESS[0], ROUGHNESS[1], ROUGHNESS[2]],
        )
    },
    Plugin { more: metal, ..plugin("conductor", "conductor", &[COLOURED_REFLECTION]) },
    Plugin {
        more: |p, element| metal(p, distribution(p, element)),
        ..plugin(
            "roughconductor",
            "roughconductor",
            &[COLOURED_REFLECTION, VISIBLE, ROUGHNESS[0], ROUGHNESS[1], ROUGHNESS[2]],
        )
    },
    plugin("plastic", "plastic", &[INSIDE, OUTSIDE, COLOURED_REFLECTION, DIFFUSE, WEIGHT, same("nonlinear", Boolean)]),
    Plugin {
        more: distribution,
        ..plugin(
            "roughplastic",
            "roughplastic",
            &[
                INSIDE,
                OUTSIDE,
                COLOURED_REFLECTION,
                DIFFUSE,
                WEIGHT,
                VISIBLE,
                same("nonlinear", Boolean),
                same("alpha", Float),
            ],
        )
    },
    plugin("null", "null", &[]),
    plugin(
        "principled",
        "principled",
        &[
            same("base_color", Colour),
            same("roughness", Number),
            same("anisotropic", Number),
            same("metallic", Number),
            same("spec_trans", Number),
            same("eta", Float),
            same("specular", Float),
            same("spec_tint", Number),
            same("sheen", Number),
            same("sheen_tint", Number),
            same("flatness", Number),
            same("clearcoat", Number),
            same("clearcoat_gloss", Number),
            same("diffuse_reflectance_sampling_rate", Quiet),
            same("main_specular_sampling_rate", Quiet),
            same("clearcoat_sampling_rate", Quiet),
        ],
    ),
];

/// Makes the new element of an old one.
type Wrapper = fn(&Parameters) -> Element;

/// Plugins around others, or made of several.
const WRAPPERS: &[(&str, Wrapper)] = &[
    ("twosided", twosided),
    ("mask", mask),
    ("blendbsdf", blend),
    ("mixturebsdf", mixture),
    ("mixture", mixture),
    ("bumpmap", bumpmap),
    ("bump", bumpmap),
    ("normalmap", normalmap),
    ("coating", coating),
    ("roughcoating", coating),
    ("phong", lobes::phong),
    ("ward", lobes::ward),
    ("difftrans", lobes::difftrans),
];

/// The new element; where there is none like the old one, a grey diffuse one, which is listed.
pub fn convert(node: &Node, context: &Context) -> Element {
    let p = Parameters::new(node, context);
    let element = if let Some(plugin) = PLUGINS.iter().find(|plugin| plugin.old == node.plugin()) {
        (plugin.more)(&p, p.carry(plugin.rows, Element::plugin("bsdf", plugin.new)))
    } else if let Some((_, wrapper)) = WRAPPERS.iter().find(|(old, _)| *old == node.plugin()) {
        wrapper(&p)
    } else {
        let known: Vec<&str> =
            PLUGINS.iter().map(|plugin| plugin.old).chain(WRAPPERS.iter().map(|(old, _)| *old)).collect();
        let near = did_you_mean(node.plugin(), &known);
        let message =
            format!("bsdf {:?}: Mitsuba 3 has none like it{near}; a grey diffuse surface is written", node.plugin());
        context.notes.left_out(node.place_of("type"), message);
        return grey().with_id_of(node);
    };
    p.finish();
    element.with_id_of(node)
}

/// The element of a `<bsdf>`, or a `<ref>` to what a `<ref>` refers to.
pub fn inside(node: &Node, context: &Context) -> Element {
    if node.tag != "ref" {
        return convert(node, context);
    }
    match context.referred(node, "bsdf") {
        Some(_) => Element::reference(context.document.resolved(node.value("id"))),
        None => grey(),
    }
}

fn grey() -> Element {
    Element::plugin("bsdf", "diffuse")
}

impl Element {
    /// With the id of what it is made of.
    fn with_id_of(self, node: &Node) -> Element {
        match node.attribute("id") {
            Some(id) => self.with("id", &id.value[..]),
            None => self,
        }
    }
}

/// Surfaces of Oren and Nayar.
fn roughdiffuse(p: &Parameters, element: Element) -> Element {
    p.left_out("alpha", "the surface becomes a smooth diffuse one, as Mitsuba 3 has no rough ones");
    p.child("use_fast_approx");
    element
}

/// `distribution`, of which Mitsuba 3 has two.
fn distribution(p: &Parameters, element: Element) -> Element {
    match p.string("distribution").as_deref() {
        None => element,
        Some(kept @ ("beckmann" | "ggx")) => element.string("distribution", kept),
        Some(other) => {
            let message = format!("distribution {other:?} becomes \"beckmann\" of the same roughness, its nearest");
            p.context.notes.changed(p.place("distribution"), message);
            element.string("distribution", "beckmann")
        }
    }
}

/// `material`, or `eta` and `k`; copper where nothing is said.
fn metal(p: &Parameters, element: Element) -> Element {
    let outside = p.index("ext_eta");
    let (eta, k) = (p.colour("eta", Of::Index), p.colour("k", Of::Index));
    let material = p.string("material");
    let outside = match outside {
        None => 1.0,
        Some(IndexValue::Number(value)) => value,
        Some(IndexValue::Name(name)) if name == "air" || name == "vacuum" => 1.0,
        Some(IndexValue::Name(name)) => {
            let message = format!("ext_eta {name:?}: give it as a number; air is written");
            p.context.notes.left_out(p.place("ext_eta"), message);
            1.0
        }
    };
    let name = material.as_deref().unwrap_or("Cu");
    if eta.is_none() && k.is_none() {
        if name == "none" {
            return element.string("material", "none");
        }
        let Some((known, eta, k)) = conductor(name) else {
            let known: Vec<&str> = CONDUCTORS.iter().map(|(name, ..)| *name).collect();
            let message = format!("material {name:?}: unknown; copper is written; known: {}", known.join(", "));
            p.context.notes.left_out(p.place("material"), message);
            return element.string("material", "Cu");
        };
        if outside == 1.0 {
            return element.string("material", known);
        }
        return element.rgb("eta", divided(numbers_of(eta), outside)).rgb("k", divided(numbers_of(k), outside));
    }
    let (_, copper_eta, copper_k) = conductor("Cu").expect("copper is in the table");
    let (eta, k) = (eta.unwrap_or(numbers_of(copper_eta)), k.unwrap_or(numbers_of(copper_k)));
    element.rgb("eta", divided(eta, outside)).rgb("k", divided(k, outside))
}

fn divided(rgb: [f64; 3], by: f64) -> [f64; 3] {
    rgb.map(|value| value / by)
}

/// A metal by its old name, which may have a source behind it, as in `Al_palik`.
fn conductor(name: &str) -> Option<(&'static str, [f32; 3], [f32; 3])> {
    let base = name.split(['_', '-']).next().unwrap_or(name);
    let names = [name.to_owned(), base.to_owned(), format!("{base}_palik")];
    names.iter().find_map(|name| CONDUCTORS.iter().find(|(known, ..)| known == name).copied())
}

/// The surfaces inside, `count` of them at most.
fn surfaces(p: &Parameters, count: std::ops::RangeInclusive<usize>) -> Vec<Element> {
    let nested = p.nested(&["bsdf", "ref"]);
    if !count.contains(&nested.len()) {
        let expected = if count.start() == count.end() {
            format!("{}", count.start())
        } else {
            format!("{} to {}", count.start(), count.end())
        };
        let message = format!("{} holds {} bsdfs; expected {expected}", p.node.described(), nested.len());
        p.context.notes.fault(&p.node.place, message);
    }
    let mut surfaces: Vec<_> = nested.into_iter().map(|surface| inside(surface, p.context)).collect();
    // something to go on with, to find what else is wrong
    surfaces.resize_with(surfaces.len().max(*count.start()), grey);
    surfaces
}

fn holding(element: Element, inside: Vec<Element>) -> Element {
    inside.into_iter().fold(element, Element::holding)
}

fn twosided(p: &Parameters) -> Element {
    holding(Element::plugin("bsdf", "twosided"), surfaces(p, 1..=2))
}

fn mask(p: &Parameters) -> Element {
    let opacity = p.texture("opacity");
    if let Some([r, g, b]) = opacity.as_ref().and_then(|opacity| opacity.constant())
        && (r != g || g != b)
    {
        p.context
            .notes
            .changed(p.place("opacity"), "a coloured opacity becomes its mean, as Mitsuba 3 takes one number");
    }
    let element = Element::plugin("bsdf", "mask");
    let element = match opacity {
        Some(opacity) => element.holding(opacity.element("opacity", Use::Number, p.context.files)),
        None => element,
    };
    holding(element, surfaces(p, 1..=1))
}

fn blend(p: &Parameters) -> Element {
    let weight = p.carry(&[same("weight", Number)], Element::plugin("bsdf", "blendbsdf"));
    holding(weight, surfaces(p, 2..=2))
}

/// Any number of surfaces with weights of sum 1 or less, as blends of two: each of one and of all after it.
fn mixture(p: &Parameters) -> Element {
    let surfaces = surfaces(p, 1..=256);
    let text = p.string("weights").unwrap_or_default();
    let mut weights = match crate::convert::values::numbers(&text) {
        Ok(weights) if weights.len() == surfaces.len() && weights.iter().all(|w| *w >= 0.0) => weights,
        Ok(weights) => {
            let message =
                format!("{} weights for {} bsdfs; expected as many, not negative", weights.len(), surfaces.len());
            p.context.notes.fault(p.place("weights"), message);
            return grey();
        }
        Err(message) => {
            p.context.notes.fault(p.place("weights"), message);
            return grey();
        }
    };
    let sum: f64 = weights.iter().sum();
    if sum > 1.0 {
        weights.iter_mut().for_each(|weight| *weight /= sum);
        p.context.notes.changed(p.place("weights"), format!("the weights, of sum {sum}, are scaled to 1"));
    }
    let mut parts: Vec<(f64, Element)> = weights.into_iter().zip(surfaces).collect();
    if sum < 1.0 - 1e-6 {
        // what is missing to 1 absorbs
        parts.push((1.0 - sum, Element::plugin("bsdf", "diffuse").rgb("reflectance", [0.0; 3])));
    }
    let (mut total, mut whole) = parts.pop().expect("there is one surface or more");
    for (weight, surface) in parts.into_iter().rev() {
        let share = if total + weight > 0.0 { total / (total + weight) } else { 0.0 };
        whole = Element::plugin("bsdf", "blendbsdf").float("weight", share).holding(surface).holding(whole);
        total += weight;
    }
    whole
}

/// The texture and the surface inside.
fn texture_and_surface<'a>(p: &Parameters<'a>) -> (Option<&'a Node>, Element) {
    let is_texture = |node: &&Node| {
        node.tag == "texture"
            || (node.tag == "ref" && p.context.target(node).is_some_and(|target| target.tag == "texture"))
    };
    let (textures, surfaces): (Vec<&Node>, Vec<&Node>) =
        p.nested(&["texture", "bsdf", "ref"]).into_iter().partition(is_texture);
    if textures.len() != 1 || surfaces.len() != 1 {
        let message = format!(
            "{} holds {} textures and {} bsdfs; expected one of each",
            p.node.described(),
            textures.len(),
            surfaces.len()
        );
        p.context.notes.fault(&p.node.place, message);
    }
    (textures.first().copied(), surfaces.first().map_or_else(grey, |surface| inside(surface, p.context)))
}

/// Heights, whose texture may be scaled.
fn bumpmap(p: &Parameters) -> Element {
    let factor = p.float("scale").unwrap_or(1.0);
    let (texture, surface) = texture_and_surface(p);
    match texture.and_then(|texture| textures::with_factor(texture, p.context)) {
        Some((texture, inner)) => {
            let (heights, was_nearest) = texture.smooth();
            if was_nearest {
                let message = "the picture of heights is linear between its pixels: squares have no slope";
                p.context.notes.changed(p.node.place_of("type"), message);
            }
            Element::plugin("bsdf", "bumpmap")
                .holding(heights.element("heights", Use::Number, p.context.files))
                .float("scale", factor * inner)
                .holding(surface)
        }
        None => surface,
    }
}

fn normalmap(p: &Parameters) -> Element {
    let (texture, surface) = texture_and_surface(p);
    match texture.and_then(|texture| textures::value(texture, p.context)) {
        Some(texture) => Element::plugin("bsdf", "normalmap")
            .holding(texture.element("normalmap", Use::Number, p.context.files))
            .holding(surface),
        None => surface,
    }
}

/// A coat that Mitsuba 3 does not have.
fn coating(p: &Parameters) -> Element {
    let message = format!("the coat of {}: Mitsuba 3 has none; what is under it is written", p.node.described());
    p.context.notes.left_out(p.node.place_of("type"), message);
    for name in [
        "int_ior",
        "ext_ior",
        "thickness",
        "sigma_a",
        "specular_reflectance",
        "alpha",
        "distribution",
        "sample_visible",
    ] {
        p.child(name);
    }
    surfaces(p, 1..=1).remove(0)
}
