//! `<sensor>` with its film, filter and sampler.

use super::Context;
use super::document::Node;
use super::parameters::Take::{Float, Integer, Quiet, String, Transform};
use super::parameters::{Parameters, Row, same};
use crate::convert::xml::Element;
use crate::load::faults::{did_you_mean, list};

const CAMERA: &[Row] = &[same("to_world", Transform), same("near_clip", Float), same("far_clip", Float)];
const OFFSET: &[Row] = &[same("principal_point_offset_x", Float), same("principal_point_offset_y", Float)];
const VIEW: &[Row] = &[same("fov", Float), same("fov_axis", String), same("focal_length", String)];
const LENS: &[Row] = &[same("aperture_radius", Float), same("focus_distance", Float)];

/// Sensors: the old name, the new one, and what each takes.
const SENSORS: &[(&str, &str, &[&[Row]])] = &[
    ("perspective", "perspective", &[CAMERA, VIEW, OFFSET]),
    ("perspective_rdist", "perspective", &[CAMERA, VIEW, OFFSET]),
    ("thinlens", "thinlens", &[CAMERA, VIEW, LENS]),
    ("orthographic", "orthographic", &[CAMERA]),
];

/// The new element.
pub fn convert(node: &Node, context: &Context) -> Option<Element> {
    let Some((_, name, rows)) = SENSORS.iter().find(|(old, ..)| *old == node.plugin()) else {
        let known: Vec<&str> = SENSORS.iter().map(|(old, ..)| *old).collect();
        let near = did_you_mean(node.plugin(), &known);
        let message = format!("sensor {:?}: not one that both renderers have{near}; {}", node.plugin(), list(&known));
        context.notes.left_out(node.place_of("type"), message);
        return None;
    };
    let p = Parameters::new(node, context);
    let mut element = rows.iter().fold(Element::plugin("sensor", name), |element, rows| p.carry(rows, element));
    p.left_out("kc", "distortion of the lens is not supported");
    motion(&p);
    if let [film] = p.nested(&["film"])[..] {
        element = element.holding(self::film(film, context));
    }
    if let [sampler] = p.nested(&["sampler"])[..] {
        element = element.holding(self::sampler(sampler, context));
    }
    p.finish();
    Some(element)
}

/// A shutter that is open for a while only matters where things move.
fn motion(p: &Parameters) {
    let (open, close) = (p.float("shutter_open").unwrap_or(0.0), p.float("shutter_close").unwrap_or(0.0));
    if open != close {
        p.context.notes.left_out(p.place("shutter_close"), "the time that the shutter is open: nothing moves");
    }
}

const FILM: &[Row] = &[
    same("width", Integer),
    same("height", Integer),
    same("crop_offset_x", Integer),
    same("crop_offset_y", Integer),
    same("crop_width", Integer),
    same("crop_height", Integer),
    same("file_format", Quiet),
    same("component_format", Quiet),
    same("banner", Quiet),
    same("attach_log", Quiet),
    same("label", Quiet),
    same("high_quality_edges", Quiet),
];

/// Whatever the film was, the picture is written with its linear values.
fn film(node: &Node, context: &Context) -> Element {
    let p = Parameters::new(node, context);
    let mut element = p.carry(FILM, Element::plugin("film", "hdrfilm"));
    match node.plugin() {
        "hdrfilm" => {}
        "ldrfilm" | "mfilm" | "tiledhdrfilm" => {
            let message = format!("film {:?} becomes \"hdrfilm\", whose picture has linear values", node.plugin());
            context.notes.changed(node.place_of("type"), message);
        }
        other => {
            let message = format!("film {other:?}: unknown; \"hdrfilm\" is written");
            context.notes.left_out(node.place_of("type"), message);
        }
    }
    for name in ["tonemap_method", "gamma", "exposure", "key", "burn"] {
        p.left_out(name, "the picture has linear values");
    }
    let pixels = p.string("pixel_format").unwrap_or("rgb".into()).to_lowercase();
    if !matches!(&pixels[..], "rgb" | "rgba") {
        context.notes.changed(p.place("pixel_format"), format!("pixel format {pixels:?} becomes \"rgb\""));
    }
    element = element.string("pixel_format", if pixels == "rgba" { "rgba" } else { "rgb" });
    if let [filter] = p.nested(&["rfilter"])[..] {
        element.children.extend(self::filter(filter, context));
    }
    p.finish();
    element
}

/// Filters with what each takes.
const FILTERS: &[(&str, &[Row])] = &[
    ("box", &[same("radius", Quiet)]),
    ("tent", &[same("radius", Float)]),
    ("gaussian", &[same("stddev", Float)]),
    ("mitchell", &[("b", "B", Float), ("c", "C", Float)]),
    ("catmullrom", &[]),
    ("lanczos", &[same("lobes", Integer)]),
];

fn filter(node: &Node, context: &Context) -> Option<Element> {
    let Some((name, rows)) = FILTERS.iter().find(|(name, _)| *name == node.plugin()) else {
        let known: Vec<&str> = FILTERS.iter().map(|(name, _)| *name).collect();
        let message = format!("rfilter {:?}: unknown; the film's default is written; {}", node.plugin(), list(&known));
        context.notes.left_out(node.place_of("type"), message);
        return None;
    };
    let p = Parameters::new(node, context);
    let element = p.carry(rows, Element::plugin("rfilter", name));
    p.finish();
    Some(element)
}

/// Whatever the sampler was, samples are independent; relt has its own.
fn sampler(node: &Node, context: &Context) -> Element {
    let p = Parameters::new(node, context);
    let rows =
        [same("sample_count", Integer), same("seed", Integer), same("dimension", Quiet), same("scramble", Quiet)];
    let element = p.carry(&rows, Element::plugin("sampler", "independent"));
    if node.plugin() != "independent" {
        let message = format!("sampler {:?} becomes \"independent\" with as many samples", node.plugin());
        context.notes.changed(node.place_of("type"), message);
    }
    p.finish();
    element
}
