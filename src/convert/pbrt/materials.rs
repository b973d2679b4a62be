//! `Material`: surfaces, with their bumps and their opacity.
//!
//! pbrt's surfaces reflect on both sides, unless they transmit; Mitsuba's have a back only as `twosided`.

use glam::DAffine2;

use super::Converter;
use super::parameters::Parameters;
use super::spectra::{self, Metal};
use super::world::{MaterialReference, TextureKind};
use crate::convert::sums::{Shares, shares};
use crate::convert::textures::{Picture, Pixels, Texture, Use, Wrap};
use crate::convert::xml::Element;
use crate::convert::{diffuse_sheet, diffuse_transmitter};
use crate::load::faults::{did_you_mean, list};

/// A surface, and whether light goes through it.
struct Surface {
    element: Element,
    transmits: bool,
}

/// Turns a material into a surface.
type Make = fn(&Converter, &Parameters, DAffine2, usize) -> Surface;

const MATERIALS: &[(&str, Make)] = &[
    ("diffuse", diffuse),
    ("conductor", conductor),
    ("dielectric", dielectric),
    ("thindielectric", thindielectric),
    ("coateddiffuse", coateddiffuse),
    ("coatedconductor", coatedconductor),
    ("diffusetransmission", diffusetransmission),
    ("interface", interface),
    ("none", interface),
    ("", interface),
    ("mix", mix),
];

/// Most mixtures inside one another; more refer to themselves. What is written of a mixture doubles with each.
const MAX_NESTING: usize = 8;

impl Converter<'_> {
    /// The element of a material on surfaces whose texture coordinates `map` leads to pbrt's.
    pub fn material(&self, reference: &MaterialReference, map: DAffine2) -> Element {
        let surface = self.surface(reference, map, 0);
        if surface.transmits { surface.element } else { two_sided(surface.element) }
    }

    /// Whether any of the material's parameters is a texture, directly or by way of a mixture.
    pub fn is_textured(&self, reference: &MaterialReference) -> bool {
        let Some(material) = self.definition(reference) else { return false };
        let is_texture = |p: &std::rc::Rc<super::parameters::Parameter>| p.kind == "texture" || p.name == "normalmap";
        material.list.iter().chain(&material.shared).any(is_texture) || material.kind == "mix"
    }

    fn definition(&self, reference: &MaterialReference) -> Option<&Parameters> {
        match reference {
            MaterialReference::Default => None,
            MaterialReference::Index(index) => Some(&self.world.materials[*index]),
            MaterialReference::Named(name, place) => match self.world.named_materials.get(name) {
                Some(index) => Some(&self.world.materials[*index]),
                None => {
                    let known: Vec<&str> = self.world.named_materials.keys().map(String::as_str).collect();
                    let message = format!("no material {name:?}{}; {}", did_you_mean(name, &known), list(&known));
                    self.notes.fault(place, message);
                    None
                }
            },
        }
    }

    fn surface(&self, reference: &MaterialReference, map: DAffine2, depth: usize) -> Surface {
        let Some(material) = self.definition(reference) else { return reflecting(Element::plugin("bsdf", "diffuse")) };
        let Some((_, make)) = MATERIALS.iter().find(|(known, _)| *known == material.kind) else {
            let known: Vec<&str> =
                MATERIALS.iter().map(|(known, _)| *known).filter(|known| !known.is_empty()).collect();
            let message = format!(
                "material {:?}{}: a grey diffuse surface is written; {}",
                material.kind,
                did_you_mean(&material.kind, &known),
                list(&known)
            );
            self.notes.left_out(&material.place, message);
            return reflecting(Element::plugin("bsdf", "diffuse"));
        };
        let Surface { element, transmits } = make(self, material, map, depth);
        let element = self.bumps(material, map, element);
        material.finish(self.notes);
        Surface { element, transmits }
    }

    /// `displacement` and `normalmap` around a surface.
    fn bumps(&self, material: &Parameters, map: DAffine2, surface: Element) -> Element {
        let mut surface = surface;
        if let Some(heights) = self.placed(material, "displacement", TextureKind::Float, map)
            && heights.constant().is_none()
        {
            let (heights, was_nearest) = heights.smooth();
            if was_nearest {
                let message = "the picture of heights is linear between its pixels: squares have no slope";
                self.notes.changed(material.place_of("displacement"), message);
            }
            surface = Element::plugin("bsdf", "bumpmap")
                .holding(heights.element("heights", Use::Number, self.files))
                .holding(surface);
        }
        if let Some(path) = material.file("normalmap", self.notes) {
            let picture = Picture {
                pixels: Pixels::File { path, raw: true },
                to_uv: super::textures::upside_down() * map,
                is_nearest: false,
                wrap: Wrap::Repeat,
            };
            surface = Element::plugin("bsdf", "normalmap")
                .holding(Texture::Picture(picture).element("normalmap", Use::Number, self.files))
                .holding(surface);
        }
        surface
    }

    /// A texture on surfaces whose coordinates `map` leads to pbrt's.
    fn placed(&self, material: &Parameters, name: &str, kind: TextureKind, map: DAffine2) -> Option<Texture> {
        self.texture(material, name, kind).map(|texture| texture.placed(map))
    }

    /// A colour with a default.
    fn colour(&self, material: &Parameters, name: &str, default: f64, map: DAffine2) -> Texture {
        self.placed(material, name, TextureKind::Spectrum, map).unwrap_or(Texture::Constant([default; 3]))
    }

    /// Roughness α along u and v: what is given, or its square root after `remaproughness`.
    fn roughness(&self, material: &Parameters, names: [&str; 3], default: f64, map: DAffine2) -> [Texture; 2] {
        let [both, u, v] = names.map(|name| self.placed(material, name, TextureKind::Float, map));
        let both = both.unwrap_or(Texture::Constant([default; 3]));
        let is_remapped = material.boolean("remaproughness").unwrap_or(true);
        [u, v].map(|one| {
            let given = one.unwrap_or(both.clone());
            if !is_remapped {
                return given;
            }
            given.map(self.files, &|value| value.map(|v| v.max(0.0).sqrt())).unwrap_or_else(|message| {
                let message = format!("remaproughness of a texture, whose numbers are taken as they are: {message}");
                self.notes.left_out(&material.place, message);
                given.clone()
            })
        })
    }
}

/// pbrt takes a roughness below this for smooth.
const SMOOTH: f64 = 1e-3;

/// A plugin of the smooth or the rough kind, the latter with its roughness.
fn microfacets(converter: &Converter, [u, v]: [Texture; 2], smooth: &str, rough: &str) -> Element {
    let greatest = |texture: &Texture| texture.constant().map_or(1.0, |[value, ..]| value);
    if greatest(&u).max(greatest(&v)) < SMOOTH {
        return Element::plugin("bsdf", smooth);
    }
    let element = Element::plugin("bsdf", rough).string("distribution", "ggx");
    if u == v {
        return element.holding(u.element("alpha", Use::Number, converter.files));
    }
    element.holding(u.element("alpha_u", Use::Number, converter.files)).holding(v.element(
        "alpha_v",
        Use::Number,
        converter.files,
    ))
}

const ROUGHNESS: [&str; 3] = ["roughness", "uroughness", "vroughness"];

fn reflecting(element: Element) -> Surface {
    Surface { element, transmits: false }
}

fn transmitting(element: Element) -> Surface {
    Surface { element, transmits: true }
}

fn two_sided(element: Element) -> Element {
    Element::plugin("bsdf", "twosided").holding(element)
}

fn diffuse(c: &Converter, p: &Parameters, map: DAffine2, _: usize) -> Surface {
    let reflectance = c.colour(p, "reflectance", 0.5, map);
    reflecting(Element::plugin("bsdf", "diffuse").holding(reflectance.element("reflectance", Use::Colour, c.files)))
}

fn conductor(c: &Converter, p: &Parameters, map: DAffine2, _: usize) -> Surface {
    let element = microfacets(c, c.roughness(p, ROUGHNESS, 0.0, map), "conductor", "roughconductor");
    reflecting(of_metal(c, p, map, ["reflectance", "eta", "k"], element))
}

/// A metal by `reflectance` at normal incidence, or by index.
fn of_metal(
    c: &Converter,
    p: &Parameters,
    map: DAffine2,
    [reflectance, eta, k]: [&str; 3],
    element: Element,
) -> Element {
    match c.placed(p, reflectance, TextureKind::Spectrum, map) {
        Some(Texture::Constant(rgb)) => {
            // η = 1, and κ such that ((η − 1)² + κ²)/((η + 1)² + κ²) is the reflectance
            let k = rgb.map(|r| {
                let r = r.clamp(0.0, 0.9999);
                2.0 * r.sqrt() / (1.0 - r).sqrt()
            });
            element.rgb("eta", [1.0; 3]).rgb("k", k)
        }
        Some(texture) => {
            let message =
                "a textured reflectance of a conductor tints a perfect mirror: no Fresnel effect at grazing angles";
            c.notes.changed(p.place_of(reflectance), message);
            element.string("material", "none").holding(texture.element("specular_reflectance", Use::Colour, c.files))
        }
        None => match spectra::metal(p, [eta, k], c.notes) {
            Metal::Named(name) => element.string("material", name),
            Metal::Index { eta, k } => element.rgb("eta", eta).rgb("k", k),
        },
    }
}

fn dielectric(c: &Converter, p: &Parameters, map: DAffine2, _: usize) -> Surface {
    let element = microfacets(c, c.roughness(p, ROUGHNESS, 0.0, map), "dielectric", "roughdielectric");
    p.left_out("tint", "colours of glass are not supported", c.notes);
    transmitting(element.float("int_ior", spectra::index(p, "eta", 1.5, c.notes)).float("ext_ior", 1.0))
}

fn thindielectric(c: &Converter, p: &Parameters, _: DAffine2, _: usize) -> Surface {
    let element = Element::plugin("bsdf", "thindielectric");
    transmitting(element.float("int_ior", spectra::index(p, "eta", 1.5, c.notes)).float("ext_ior", 1.0))
}

/// A diffuse base under a dielectric coat: `plastic` counts what goes back and forth between them, as pbrt's walks do.
fn coateddiffuse(c: &Converter, p: &Parameters, map: DAffine2, _: usize) -> Surface {
    let [u, v] = c.roughness(p, ROUGHNESS, 0.0, map).map(|alpha| match alpha.constant() {
        Some([alpha, ..]) => alpha,
        None => {
            c.notes.left_out(
                &p.place,
                "the texture of a coat's roughness, which Mitsuba takes as one number; 0.1 is written",
            );
            0.1
        }
    });
    if u != v {
        c.notes.changed(&p.place, "a coat's roughness is the same in all directions: the mean of both is written");
    }
    let alpha = (u + v) / 2.0;
    let element = match alpha < SMOOTH {
        true => Element::plugin("bsdf", "plastic"),
        false => {
            let message = "a rough coat on a diffuse base becomes roughplastic, which approximates what goes back and forth between them";
            c.notes.changed(&p.place, message);
            Element::plugin("bsdf", "roughplastic").string("distribution", "ggx").float("alpha", alpha)
        }
    };
    for name in ["g", "albedo"] {
        p.left_out(name, "what scatters inside of a coat is not supported", c.notes);
    }
    p.quiet(&["thickness", "maxdepth", "nsamples"]);
    let reflectance = c.colour(p, "reflectance", 0.5, map);
    reflecting(
        element
            .float("int_ior", spectra::index(p, "eta", 1.5, c.notes))
            .float("ext_ior", 1.0)
            .boolean("nonlinear", true)
            .holding(reflectance.element("diffuse_reflectance", Use::Colour, c.files)),
    )
}

fn coatedconductor(c: &Converter, p: &Parameters, map: DAffine2, _: usize) -> Surface {
    c.notes.left_out(&p.place, "the coat of a coatedconductor: the conductor alone is written");
    let names = ["conductor.roughness", "conductor.uroughness", "conductor.vroughness"];
    let element = microfacets(c, c.roughness(p, names, 0.0, map), "conductor", "roughconductor");
    p.quiet(&["interface.roughness", "interface.uroughness", "interface.vroughness", "interface.eta"]);
    p.quiet(&["thickness", "g", "albedo", "maxdepth", "nsamples"]);
    reflecting(of_metal(c, p, map, ["reflectance", "conductor.eta", "conductor.k"], element))
}

/// A diffuse lobe on either side.
fn diffusetransmission(c: &Converter, p: &Parameters, map: DAffine2, _: usize) -> Surface {
    let scale = p.float("scale").unwrap_or(1.0);
    let [reflectance, transmittance] = ["reflectance", "transmittance"].map(|name| {
        let texture = c.colour(p, name, 0.25, map);
        texture.map(c.files, &|value| value.map(|v| v * scale)).unwrap_or(texture)
    });
    let shares = shares(&reflectance, &transmittance, c.files).unwrap_or_else(|message| {
        c.notes.changed(&p.place, format!("the two lobes are blended half and half and so darkened: {message}"));
        Shares { weight: 0.5, first: reflectance, second: transmittance, sum: 1.0 }
    });
    if shares.sum > 1.0 {
        let message = format!("reflectance and transmittance of sum {:.3} are scaled to 0.99", shares.sum);
        c.notes.changed(&p.place, message);
    }
    if shares.weight < 1.0 {
        let message = "what a diffusetransmission reflects differs from an even scattering at grazing angles";
        c.notes.changed(&p.place, message);
    }
    let front = diffuse_sheet(shares.first.element("base_color", Use::Colour, c.files));
    let through = diffuse_transmitter(shares.second.element("base_color", Use::Colour, c.files));
    transmitting(match shares.weight {
        0.0 => front,
        1.0 => through,
        weight => Element::plugin("bsdf", "blendbsdf").float("weight", weight).holding(front).holding(through),
    })
}

fn interface(_: &Converter, _: &Parameters, _: DAffine2, _: usize) -> Surface {
    transmitting(Element::plugin("bsdf", "null"))
}

fn mix(c: &Converter, p: &Parameters, map: DAffine2, depth: usize) -> Surface {
    let amount = c.placed(p, "amount", TextureKind::Float, map).unwrap_or(Texture::Constant([0.5; 3]));
    let names = p.strings("materials").unwrap_or_default();
    let [first, second] = names else {
        let message = format!("a mixture of {} materials; expected two names in \"string materials\"", names.len());
        c.notes.fault(p.place_of("materials"), message);
        return reflecting(Element::plugin("bsdf", "diffuse"));
    };
    if depth > MAX_NESTING {
        let message = format!("the material is a mixture of itself, or of more than {MAX_NESTING} inside one another");
        c.notes.fault(&p.place, message);
        return reflecting(Element::plugin("bsdf", "diffuse"));
    }
    let place = p.place_of("materials");
    let references = [first, second].map(|name| MaterialReference::Named(name.clone(), place.clone()));
    let parts = references.each_ref().map(|reference| c.surface(reference, map, depth + 1));
    let transmits = parts.iter().any(|part| part.transmits);
    let blend = Element::plugin("bsdf", "blendbsdf").holding(amount.element("weight", Use::Number, c.files));
    let element = parts.into_iter().zip(&references).fold(blend, |blend, (part, reference)| {
        blend.holding(if transmits && !part.transmits {
            beside_glass(c, p, part, reference, map)
        } else {
            part.element
        })
    });
    Surface { element, transmits }
}

/// A surface that only reflects, in a mixture with one that transmits: it cannot be `twosided` there.
fn beside_glass(
    c: &Converter,
    mixture: &Parameters,
    surface: Surface,
    reference: &MaterialReference,
    map: DAffine2,
) -> Element {
    match c.definition(reference).filter(|material| material.kind == "diffuse") {
        Some(material) => {
            let message =
                "what is diffuse beside something that transmits differs from an even scattering at grazing angles";
            c.notes.changed(&mixture.place, message);
            let reflectance = c.colour(material, "reflectance", 0.5, map);
            c.bumps(material, map, diffuse_sheet(reflectance.element("base_color", Use::Colour, c.files)))
        }
        None => {
            let message = "what reflects beside something that transmits does so on its front only";
            c.notes.left_out(&mixture.place, message);
            surface.element
        }
    }
}

/// Keeps what is seen of a surface where its opacity is high.
pub(super) fn masked(opacity: &Texture, surface: Element, converter: &Converter) -> Element {
    Element::plugin("bsdf", "mask").holding(opacity.element("opacity", Use::Number, converter.files)).holding(surface)
}
