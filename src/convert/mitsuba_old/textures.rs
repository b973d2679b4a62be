//! `<texture>`, numbers and colours, to values over a surface.

use glam::{DAffine2, DVec2};

use super::Context;
use super::document::Node;
use super::parameters::Parameters;
use super::values::{self, COLOURS, Of};
use crate::convert::textures::{Picture, Pixels, Texture, Wrap, uv_map};

/// The value of an element; `None` where it cannot be converted, which is listed.
pub fn value(node: &Node, context: &Context) -> Option<Texture> {
    if COLOURS.contains(&&node.tag[..]) {
        return values::colour(node, Of::Surface, context.notes).map(Texture::Constant);
    }
    let node = context.referred(node, "texture")?;
    context.nested(node, || match node.plugin() {
        "bitmap" => bitmap(node, context),
        "checkerboard" => checkerboard(node, context),
        "scale" => scale(node, context),
        other => {
            let message = format!(
                "texture {other:?}: known are bitmap, checkerboard, scale; what it is for keeps its default instead"
            );
            context.notes.left_out(node.place_of("type"), message);
            None
        }
    })
}

/// The texture inside a `scale` with the factor, where that is one number; any other texture with factor 1.
pub fn with_factor(node: &Node, context: &Context) -> Option<(Texture, f64)> {
    let node = context.referred(node, "texture")?;
    if node.plugin() == "scale" {
        let p = Parameters::new(node, context);
        let (factor, inner) = (p.colour("scale", Of::Index), inner(&p));
        if let (Some([r, g, b]), Some(inner)) = (factor.or(Some([1.0; 3])), inner)
            && r == g
            && g == b
        {
            p.finish();
            return context.nested(node, || with_factor(inner, context)).map(|(texture, factor)| (texture, factor * r));
        }
    }
    value(node, context).map(|texture| (texture, 1.0))
}

/// The only texture inside another.
fn inner<'a>(p: &Parameters<'a>) -> Option<&'a Node> {
    let nested = p.nested(&["texture", "ref"]);
    if nested.len() != 1 {
        p.context
            .notes
            .fault(&p.node.place, format!("{} holds {} textures; expected 1", p.node.described(), nested.len()));
    }
    nested.first().copied()
}

/// Another texture times a number or a colour.
fn scale(node: &Node, context: &Context) -> Option<Texture> {
    let p = Parameters::new(node, context);
    let factor = p.colour("scale", Of::Index).unwrap_or([1.0; 3]);
    let inner = inner(&p).and_then(|inner| value(inner, context));
    p.finish();
    let inner = inner?;
    match inner.map(context.files, &|value| [0, 1, 2].map(|c| value[c] * factor[c])) {
        Ok(scaled) => Some(scaled),
        Err(message) => {
            context.notes.left_out(node.place_of("type"), format!("the scale of the texture inside: {message}"));
            Some(inner)
        }
    }
}

/// Two colours in squares.
fn checkerboard(node: &Node, context: &Context) -> Option<Texture> {
    let p = Parameters::new(node, context);
    let colour = |name: &str, default: f64| p.texture(name).unwrap_or(Texture::Constant([default; 3]));
    let values = Box::new([colour("color0", 0.4), colour("color1", 0.2)]);
    let to_uv = to_uv(&p);
    p.finish();
    Some(Texture::Checkerboard { values, to_uv })
}

/// A picture file.
fn bitmap(node: &Node, context: &Context) -> Option<Texture> {
    let p = Parameters::new(node, context);
    let path = p.file("filename");
    let gamma = p.float("gamma");
    let raw = p.boolean("raw").unwrap_or(gamma == Some(1.0));
    if let Some(gamma) = gamma.filter(|gamma| *gamma > 0.0 && *gamma != 1.0) {
        let message = format!("gamma {gamma} is taken as sRGB, the only curve that Mitsuba 3 has");
        context.notes.changed(p.place("gamma"), message);
    }
    let filter = p.string("filter_type");
    let wrap = wrap(&p);
    for quiet in ["max_anisotropy", "cache"] {
        p.child(quiet);
    }
    p.left_out("channel", "one channel of a picture as a texture is not supported");
    let picture = Picture {
        pixels: Pixels::File { path: path?, raw },
        to_uv: to_uv(&p),
        is_nearest: filter.as_deref() == Some("nearest"),
        wrap,
    };
    p.finish();
    Some(Texture::Picture(picture))
}

/// `wrap_mode`, or `wrap_mode_u` and `wrap_mode_v`.
fn wrap(p: &Parameters) -> Wrap {
    let both = p.string("wrap_mode");
    let [u, v] = ["wrap_mode_u", "wrap_mode_v"].map(|name| p.string(name).or(both.clone()));
    let u = u.unwrap_or("repeat".into());
    if v.is_some_and(|v| v != u) {
        let message = format!("the picture goes on as {u:?} in both directions, as Mitsuba 3 has one wrap_mode");
        p.context.notes.changed(p.place("wrap_mode_v"), message);
    }
    match &u[..] {
        "repeat" => Wrap::Repeat,
        "mirror" => Wrap::Mirror,
        "clamp" => Wrap::Clamp,
        other => {
            let message = format!("beyond its border the picture is clamped, as Mitsuba 3 has no wrap_mode {other:?}");
            let name = if both.is_some() { "wrap_mode" } else { "wrap_mode_u" };
            p.context.notes.changed(p.place(name), message);
            Wrap::Clamp
        }
    }
}

/// `uscale`, `vscale`, `uoffset`, `voffset`, or the `to_uv` of Mitsuba 2.
fn to_uv(p: &Parameters) -> DAffine2 {
    let both = p.float("uvscale").unwrap_or(1.0);
    let number = |name: &str, default: f64| p.float(name).unwrap_or(default);
    let scale = DVec2::new(number("uscale", both), number("vscale", both));
    let offset = DVec2::new(number("uoffset", 0.0), number("voffset", 0.0));
    let map = uv_map(scale, offset);
    match p.transform("to_uv") {
        None => map,
        Some(given) => {
            let m = given.map;
            let plane = glam::DMat2::from_cols(m.matrix3.x_axis.truncate(), m.matrix3.y_axis.truncate());
            DAffine2 { matrix2: plane, translation: m.translation.truncate() } * map
        }
    }
}
