//! `<emitter>`: inside a shape, and on its own.

use super::Context;
use super::document::Node;
use super::parameters::Take::{Colour, File, Float, Light, Quiet, Transform, Vector};
use super::parameters::{Parameters, Row, same};
use crate::convert::xml::Element;
use crate::load::faults::{did_you_mean, list};

const WEIGHT: Row = same("sampling_weight", Quiet);

/// Emitters that stand on their own, with what each takes.
const EMITTERS: &[(&str, &[Row])] = &[
    ("point", &[same("intensity", Light), WEIGHT]),
    (
        "spot",
        &[
            same("intensity", Light),
            same("cutoff_angle", Float),
            same("beam_width", Float),
            same("to_world", Transform),
            WEIGHT,
        ],
    ),
    ("directional", &[same("irradiance", Light), same("direction", Vector), same("to_world", Transform), WEIGHT]),
    ("constant", &[same("radiance", Light), WEIGHT]),
    (
        "envmap",
        &[same("filename", File), same("scale", Float), same("to_world", Transform), same("cache", Quiet), WEIGHT],
    ),
];

/// An emitter directly inside the scene.
pub fn of_scene(node: &Node, context: &Context) -> Option<Element> {
    let Some((name, rows)) = EMITTERS.iter().find(|(name, _)| *name == node.plugin()) else {
        let known: Vec<&str> = EMITTERS.iter().map(|(name, _)| *name).collect();
        let near = did_you_mean(node.plugin(), &known);
        let message = format!("emitter {:?}: not one that both renderers have{near}; {}", node.plugin(), list(&known));
        context.notes.left_out(node.place_of("type"), message);
        return None;
    };
    let p = Parameters::new(node, context);
    let mut element = p.carry(rows, Element::plugin("emitter", name));
    if *name == "point" {
        let origin = p.transform("to_world").map(|to_world| to_world.map.translation);
        if let Some(position) = p.point("position").or(origin) {
            element = element.point("position", position);
        }
    }
    p.left_out("texture", "a spot's texture is not supported");
    p.left_out("gamma", "an environment of another gamma than its file's is not supported");
    p.finish();
    Some(element)
}

/// The emitter inside a shape.
pub fn of_shape(node: &Node, context: &Context) -> Option<Element> {
    if node.plugin() != "area" {
        let message = format!("emitter {:?} in a shape: only area can be converted there", node.plugin());
        context.notes.left_out(node.place_of("type"), message);
        return None;
    }
    let p = Parameters::new(node, context);
    let mut element = Element::plugin("emitter", "area");
    // a texture's values are those of a surface, so it is no light's colour unless it is one
    let is_texture = node.children.iter().any(|child| matches!(&child.tag[..], "texture" | "ref"));
    let take = if is_texture { Colour } else { Light };
    element = p.carry(&[same("radiance", take), WEIGHT], element);
    p.finish();
    Some(element)
}
