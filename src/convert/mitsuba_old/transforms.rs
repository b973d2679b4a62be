//! `<transform>` with its steps, first one applied first.

use glam::{DAffine3, DMat3, DVec3};

use super::document::Node;
use crate::convert::notes::Notes;
use crate::convert::values::{exactly, number, numbers};
use crate::convert::xml::{self, Element};

/// A transform as an element of the new file and as a map.
#[derive(Clone, Debug)]
pub struct Transform {
    /// The steps.
    pub steps: Vec<Element>,
    /// All of them together.
    pub map: DAffine3,
}

impl Transform {
    /// The element of that name.
    pub fn element(self, name: &str) -> Element {
        let mut element = Element::new("transform").with("name", name);
        element.children = self.steps;
        element
    }
}

/// Reads a `<transform>`; of an `<animation>`, its first.
pub fn read(node: &Node, notes: &Notes) -> Option<Transform> {
    if node.tag == "animation" {
        notes.left_out(
            &node.place,
            "motion of <animation>: its first transform is written, as neither renderer moves things",
        );
        return node.children.iter().find(|child| child.tag == "transform").and_then(|first| read(first, notes));
    }
    let mut whole = Some(Transform { steps: Vec::new(), map: DAffine3::IDENTITY });
    for child in &node.children {
        let read = step(child).map_err(|message| notes.fault(&child.place, message)).ok();
        whole = whole.zip(read).map(|(mut whole, (element, map))| {
            whole.steps.push(element);
            whole.map = map * whole.map;
            whole
        });
    }
    whole
}

/// One step as an element and as a map.
fn step(node: &Node) -> Result<(Element, DAffine3), String> {
    match &node.tag[..] {
        "translate" => {
            let by = xyz(node, 0.0)?;
            Ok((three("translate", by), DAffine3::from_translation(by)))
        }
        "scale" => {
            let by = xyz(node, 1.0)?;
            Ok((three("scale", by), DAffine3::from_scale(by)))
        }
        "rotate" => rotate(node),
        "look_at" | "lookat" => look_at(node),
        "matrix" => matrix(node),
        other => Err(format!("<{other}> is no step of a transform; known: lookAt, matrix, rotate, scale, translate")),
    }
}

fn three(tag: &'static str, value: DVec3) -> Element {
    Element::new(tag).with("value", xml::numbers(&value.to_array()))
}

/// `value` with one or three numbers, or `x`, `y`, `z`, each of which may be absent.
fn xyz(node: &Node, absent: f64) -> Result<DVec3, String> {
    if let Some(value) = node.attribute("value") {
        return match numbers(&value.value)?[..] {
            [single] => Ok(DVec3::splat(single)),
            [x, y, z] => Ok(DVec3::new(x, y, z)),
            ref given => Err(format!("{:?} holds {} numbers; expected 1 or 3", value.value, given.len())),
        };
    }
    let axis = |name: &str| node.attribute(name).map_or(Ok(absent), |given| number(&given.value));
    Ok(DVec3::new(axis("x")?, axis("y")?, axis("z")?))
}

/// Around an axis of any length, which is what the old format takes.
fn rotate(node: &Node) -> Result<(Element, DAffine3), String> {
    let axis = xyz(node, 0.0)?.try_normalize().ok_or("the rotation axis has no length; give x, y or z")?;
    let degrees = number(node.value("angle"))?;
    let element = three("rotate", axis).with("angle", xml::number(degrees));
    Ok((element, DAffine3::from_axis_angle(axis, degrees.to_radians())))
}

/// From `origin` to `target`, +z there, +x to the left.
fn look_at(node: &Node) -> Result<(Element, DAffine3), String> {
    let vector =
        |name: &str| exactly(node.value(name)).map(DVec3::from_array).map_err(|message| format!("{name}: {message}"));
    let (origin, target) = (vector("origin")?, vector("target")?);
    let forward = (target - origin).try_normalize().ok_or("the target of <lookAt> is its origin")?;
    let up = match node.attribute("up") {
        Some(_) => vector("up")?,
        None => forward.any_orthonormal_pair().0,
    };
    let left =
        up.cross(forward).try_normalize().ok_or("up is parallel to the direction of <lookAt>, or has no length")?;
    let list = |v: DVec3| xml::numbers(&v.to_array());
    let element = Element::new("lookat").with("origin", list(origin)).with("target", list(target)).with("up", list(up));
    let rotation = DMat3::from_cols(left, forward.cross(left), forward);
    Ok((element, DAffine3::from_mat3_translation(rotation, origin)))
}

/// Sixteen numbers, row by row.
fn matrix(node: &Node) -> Result<(Element, DAffine3), String> {
    let m: [f64; 16] = exactly(node.value("value"))?;
    if m[12..] != [0.0, 0.0, 0.0, 1.0] {
        return Err(format!("the last row of the matrix is {:?}; only 0 0 0 1 can be converted", &m[12..]));
    }
    let row = |i: usize| DVec3::new(m[i], m[i + 1], m[i + 2]);
    let map = DAffine3::from_mat3_translation(
        DMat3::from_cols(row(0), row(4), row(8)).transpose(),
        DVec3::new(m[3], m[7], m[11]),
    );
    Ok((xml::matrix(map), map))
}
