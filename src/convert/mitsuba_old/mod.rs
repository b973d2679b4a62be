//! Scene files of Mitsuba 0.5, 0.6 and 2 (XML, version 0.x to 2.x).
//!
//! Text becomes a tree with includes resolved ([`document`]); each family carries its plugins over by tables of what they
//! take ([`parameters`]), and lists what it knows no counterpart for.

mod bsdfs;
mod document;
mod emitters;
mod integrators;
mod lobes;
mod parameters;
mod sensors;
mod shapes;
mod textures;
mod transforms;
mod values;

use std::cell::Cell;
use std::collections::HashMap;
use std::path::Path;
use std::rc::Rc;

use super::Rgb;
use super::files::Files;
use super::notes::Notes;
use super::xml::Element;
use crate::load::faults::{did_you_mean, list};
use document::{Document, Node};

/// Where everything is that an element may need.
pub struct Context<'a> {
    document: &'a Document,
    ids: HashMap<&'a str, &'a Node>,
    files: &'a Files,
    notes: &'a Notes,
    /// How many textures are being made, each for the one before.
    depth: Cell<usize>,
}

/// Most textures inside one another; more refer to themselves. What is made of a texture doubles with each.
const MAX_NESTING: usize = 8;

/// Converts the file of that path, text and number.
pub(super) fn convert(
    path: &Path,
    (source, text): (usize, Rc<str>),
    defines: &[(String, String)],
    files: &Files,
    notes: &Notes,
) -> Option<Element> {
    let document = document::read(path, &text, source, defines, notes)?;
    let version = document.scene.attribute("version");
    match version.map(|version| version.value.split('.').next().unwrap_or_default().parse::<u32>()) {
        Some(Ok(0..=2)) => {}
        Some(Ok(3)) => notes.fault(document.scene.place_of("version"), "the scene is of version 3 already"),
        _ => notes.fault(document.scene.place_of("version"), "the scene's version must be one of 0.x to 2.x"),
    }
    let context = Context { ids: document.ids(), document: &document, files, notes, depth: Cell::new(0) };
    Some(context.scene())
}

impl<'a> Context<'a> {
    /// The new scene.
    fn scene(&self) -> Element {
        let mut scene = Element::new("scene").with("version", "3.0.0");
        for node in &self.document.scene.children {
            scene.children.extend(self.top(node));
        }
        scene
    }

    /// What an element directly inside the scene becomes.
    fn top(&self, node: &'a Node) -> Option<Element> {
        match &node.tag[..] {
            "integrator" => Some(integrators::convert(node, self)),
            "sensor" | "camera" => sensors::convert(node, self),
            "bsdf" => Some(bsdfs::convert(node, self)),
            "shape" => shapes::convert(node, self),
            "emitter" | "luminaire" => emitters::of_scene(node, self),
            // written where they are used
            "texture" => None,
            "medium" => {
                self.notes
                    .left_out(&node.place, format!("{}: neither renderer's path tracer has media", node.described()));
                None
            }
            _ => {
                self.notes
                    .left_out(&node.place, format!("{}: nothing of that kind can be converted", node.described()));
                None
            }
        }
    }

    /// The element itself, or the one that a `ref` names; one of the expected tag.
    fn referred(&self, node: &'a Node, tag: &str) -> Option<&'a Node> {
        if node.tag == tag {
            return Some(node);
        }
        if node.tag != "ref" {
            self.notes
                .fault(&node.place, format!("{} where a <{tag}> or a <ref> to one is expected", node.described()));
            return None;
        }
        match self.target(node)? {
            target if target.tag == tag => Some(target),
            target => {
                let message = format!("{:?} refers to a <{}>; expected a <{tag}>", node.value("id"), target.tag);
                self.notes.fault(node.place_of("id"), message);
                None
            }
        }
    }

    /// What is made of a texture inside of another, or of one that that refers to; nothing if too many are around it.
    fn nested<T>(&self, node: &Node, make: impl FnOnce() -> Option<T>) -> Option<T> {
        if self.depth.get() > MAX_NESTING {
            let message = format!("the texture is made of itself, or of more than {MAX_NESTING} inside one another");
            self.notes.fault(&node.place, message);
            return None;
        }
        self.depth.set(self.depth.get() + 1);
        let made = make();
        self.depth.set(self.depth.get() - 1);
        made
    }

    /// What a `ref` refers to.
    fn target(&self, reference: &Node) -> Option<&'a Node> {
        let id = self.document.resolved(reference.value("id"));
        let found = self.ids.get(id).copied();
        if found.is_none() {
            let known: Vec<&str> = self.ids.keys().copied().collect();
            let message = format!("nothing has the id {id:?}{}; {}", did_you_mean(id, &known), list(&known));
            self.notes.fault(reference.place_of("id"), message);
        }
        found
    }
}
