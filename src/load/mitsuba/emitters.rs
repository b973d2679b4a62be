//! `<emitter>`: `area` belongs to a shape, all others stand on their own and are those of [`lights`].

use super::document::Element;
use super::parameters::ElementParameters;
use super::textures::Textures;
use crate::load::faults::Faults;
use crate::scene::lights::{self, Light};
use crate::scene::parameters::{Parameters, Range};
use crate::scene::textures::Varying;

/// The emitter inside a shape.
pub fn of_shape<'a>(element: &'a Element, textures: &'a Textures<'a>, faults: &'a Faults) -> Option<Varying> {
    let kind = element.value("type");
    if kind != "area" {
        let is_known = lights::KNOWN.contains(&kind);
        let message = format!("emitter {kind:?} belongs directly inside <scene>; a shape holds: area");
        if is_known {
            faults.at(element.span_of("type"), message);
        } else {
            report_unknown(element, faults);
        }
        return None;
    }
    let mut p = ElementParameters::new(element, faults).with_textures(textures);
    let radiance = match p.texture("radiance", Range::Radiance) {
        Some(texture) => texture.map(Varying::Textured),
        None => Some(Varying::Constant(p.radiance("radiance", 1.0))),
    };
    p.finish();
    radiance
}

/// An emitter directly inside the scene.
pub fn of_scene<'a>(element: &'a Element, textures: &'a Textures<'a>, faults: &'a Faults) -> Option<Light> {
    let kind = element.value("type");
    let mut p = ElementParameters::new(element, faults).with_textures(textures);
    let light = lights::read(kind, &mut p);
    if light.is_some() {
        p.finish();
    } else if kind == "area" {
        faults.at(element.span_of("type"), "emitter \"area\" belongs inside a shape, which is what emits");
    } else {
        report_unknown(element, faults);
    }
    light.flatten()
}

/// A type that is neither `area` nor a light.
fn report_unknown(element: &Element, faults: &Faults) {
    if let Some(kind) = element.attribute("type") {
        let known: Vec<_> = lights::KNOWN.iter().copied().chain(["area"]).collect();
        faults.unknown(&kind.span, "emitter", &kind.value, &known);
    }
}
