//! `<shape>`: the same plugins under the same names, but for those that Mitsuba 3 has no more.

use super::Context;
use super::bsdfs;
use super::document::Node;
use super::emitters;
use super::parameters::Take::{Boolean, File, Float, Integer, Point, Quiet, Transform};
use super::parameters::{Parameters, Row, same};
use crate::convert::xml::Element;
use crate::load::faults::{did_you_mean, list};

const PLACE: Row = same("to_world", Transform);
const FLIP: Row = same("flip_normals", Boolean);
const FACES: Row = same("face_normals", Boolean);
const FILE: Row = same("filename", File);

/// Shapes with what each takes.
const SHAPES: &[(&str, &[Row])] = &[
    ("cube", &[PLACE, FLIP]),
    ("sphere", &[PLACE, FLIP, same("center", Point), same("radius", Float)]),
    ("cylinder", &[PLACE, FLIP, same("p0", Point), same("p1", Point), same("radius", Float)]),
    ("rectangle", &[PLACE, FLIP]),
    ("disk", &[PLACE, FLIP]),
    ("obj", &[FILE, PLACE, FLIP, FACES, same("flip_tex_coords", Boolean), same("collapse", Quiet)]),
    ("ply", &[FILE, PLACE, FLIP, FACES, same("flip_tex_coords", Boolean)]),
    ("serialized", &[FILE, PLACE, FLIP, FACES, same("shape_index", Integer)]),
    ("shapegroup", &[]),
    ("instance", &[PLACE]),
];

/// Elements inside a shape that neither renderer's path tracer has a use for.
const MATTER: &[(&str, &str)] = &[
    ("subsurface", "subsurface scattering is not supported"),
    ("medium", "media are not supported"),
    ("sensor", "a sensor on a shape is not supported"),
];

/// The new element.
pub fn convert(node: &Node, context: &Context) -> Option<Element> {
    let Some((name, rows)) = SHAPES.iter().find(|(name, _)| *name == node.plugin()) else {
        let known: Vec<&str> = SHAPES.iter().map(|(name, _)| *name).collect();
        let near = did_you_mean(node.plugin(), &known);
        let message = format!("shape {:?}: not one that both renderers have{near}; {}", node.plugin(), list(&known));
        context.notes.left_out(node.place_of("type"), message);
        return None;
    };
    let p = Parameters::new(node, context);
    let mut element = Element::plugin("shape", name);
    if let Some(id) = node.attribute("id") {
        element = element.with("id", &id.value[..]);
    }
    element = p.carry(rows, element);
    p.left_out("max_smooth_angle", "normals stay those of the file");
    p.left_out("shape_index_name", "a shape is chosen by shape_index");
    p.left_out("srgb", "colours of vertices are not supported");
    for (tag, why) in MATTER {
        for inside in p.nested(&[tag]) {
            context.notes.left_out(&inside.place, format!("{} in {}: {why}", inside.described(), node.described()));
        }
    }
    element.children.extend(match *name {
        "shapegroup" => p.nested(&["shape"]).into_iter().filter_map(|shape| convert(shape, context)).collect(),
        "instance" => vec![group(&p)?],
        _ => surface(&p),
    });
    p.finish();
    Some(element)
}

/// The material and the emitter.
fn surface(p: &Parameters) -> Vec<Element> {
    let context = p.context;
    let mut inside = Vec::new();
    for surface in p.nested(&["bsdf", "ref"]) {
        let is_medium = surface.tag == "ref" && context.target(surface).is_some_and(|target| target.tag != "bsdf");
        if is_medium {
            let message = format!("{} in {}: media are not supported", surface.described(), p.node.described());
            context.notes.left_out(&surface.place, message);
        } else if inside.is_empty() {
            inside.push(bsdfs::inside(surface, context));
        } else {
            let message = format!("a further bsdf of {}: a shape has one, the first", p.node.described());
            context.notes.left_out(&surface.place, message);
        }
    }
    let emitters = p.nested(&["emitter", "luminaire"]);
    inside.extend(emitters.into_iter().filter_map(|emitter| emitters::of_shape(emitter, context)));
    inside
}

/// What an instance shows.
fn group(p: &Parameters) -> Option<Element> {
    let nested = p.nested(&["ref", "shape"]);
    match nested[..] {
        [node] if node.tag == "shape" => convert(node, p.context),
        [node] => {
            p.context.referred(node, "shape")?;
            Some(Element::reference(p.context.document.resolved(node.value("id"))))
        }
        _ => {
            let message = format!("an instance refers to {} shapegroups; expected 1", nested.len());
            p.context.notes.fault(&p.node.place, message);
            None
        }
    }
}
