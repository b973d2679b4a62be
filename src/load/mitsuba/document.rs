//! XML text to a tree of elements with positions, defaults applied and attributes checked.

use std::collections::BTreeSet;

use crate::load::faults::{Faults, Span, list};
use crate::load::names::{Names, Replaced};

/// An element, its `$names` replaced and its attributes known to be those that its tag has.
#[derive(Debug)]
pub struct Element {
    /// What it is: `bsdf`, `float`, …
    pub tag: &'static str,
    /// Where its start tag begins.
    pub span: Span,
    attributes: Vec<Attribute>,
    /// What it contains, without `default`s.
    pub children: Vec<Element>,
}

/// An attribute with its `$names` replaced.
#[derive(Debug)]
pub struct Attribute {
    name: &'static str,
    /// Its value.
    pub value: String,
    /// Whether it stands in the file as it is, but for what `-D` says.
    pub is_plain: bool,
    /// Where the value stands, without quotes.
    pub span: Span,
}

impl Element {
    /// The attribute of that name.
    pub fn attribute(&self, name: &str) -> Option<&Attribute> {
        self.attributes.iter().find(|a| a.name == name)
    }

    /// The value of an attribute, empty where it is absent (which is a fault already if it is required).
    pub fn value(&self, name: &str) -> &str {
        self.attribute(name).map_or("", |a| &a.value)
    }

    /// Where an attribute's value stands, or the element where it is absent.
    pub fn span_of(&self, name: &str) -> &Span {
        self.attribute(name).map_or(&self.span, |a| &a.span)
    }

    /// What kind of element it is.
    pub fn kind(&self) -> Kind {
        TAGS.iter().find(|t| t.name == self.tag).expect("only known tags become elements").kind
    }

    /// For messages: `bsdf "diffuse"`, or `<float>` where there is no type.
    pub fn described(&self) -> String {
        match self.attribute("type") {
            Some(plugin) => format!("{} {:?}", self.tag, plugin.value),
            None => format!("<{}>", self.tag),
        }
    }
}

/// What elements are for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// The root.
    Scene,
    /// A plugin with parameters.
    Object,
    /// A stand-in for an object defined elsewhere.
    Reference,
    /// A named value, a leaf.
    Value,
    /// A named sequence of steps.
    Transform,
    /// A part of a transform, a leaf.
    Step,
    /// The value of a `$name` where none is given from outside, a leaf.
    Default,
}

/// A tag and its attributes.
struct Tag {
    name: &'static str,
    kind: Kind,
    required: &'static [&'static str],
    optional: &'static [&'static str],
}

/// Rows of the table below.
const fn tag(
    name: &'static str,
    kind: Kind,
    required: &'static [&'static str],
    optional: &'static [&'static str],
) -> Tag {
    Tag { name, kind, required, optional }
}

/// Every tag that a scene may hold.
const TAGS: &[Tag] = &[
    tag("scene", Kind::Scene, &["version"], &[]),
    tag("bsdf", Kind::Object, &["type"], &["id", "name"]),
    tag("emitter", Kind::Object, &["type"], &["id", "name"]),
    tag("film", Kind::Object, &["type"], &["id", "name"]),
    tag("integrator", Kind::Object, &["type"], &["id", "name"]),
    tag("rfilter", Kind::Object, &["type"], &["id", "name"]),
    tag("sampler", Kind::Object, &["type"], &["id", "name"]),
    tag("sensor", Kind::Object, &["type"], &["id", "name"]),
    tag("shape", Kind::Object, &["type"], &["id", "name"]),
    tag("texture", Kind::Object, &["type"], &["id", "name"]),
    tag("ref", Kind::Reference, &["id"], &["name"]),
    tag("boolean", Kind::Value, &["name", "value"], &[]),
    tag("float", Kind::Value, &["name", "value"], &[]),
    tag("integer", Kind::Value, &["name", "value"], &[]),
    tag("string", Kind::Value, &["name", "value"], &[]),
    tag("rgb", Kind::Value, &["name", "value"], &[]),
    tag("spectrum", Kind::Value, &["name", "value"], &[]),
    tag("point", Kind::Value, &["name"], &["value", "x", "y", "z"]),
    tag("vector", Kind::Value, &["name"], &["value", "x", "y", "z"]),
    tag("transform", Kind::Transform, &["name"], &[]),
    tag("translate", Kind::Step, &[], &["value", "x", "y", "z"]),
    tag("scale", Kind::Step, &[], &["value", "x", "y", "z"]),
    tag("rotate", Kind::Step, &["angle"], &["value", "x", "y", "z"]),
    tag("lookat", Kind::Step, &["origin", "target"], &["up"]),
    tag("matrix", Kind::Step, &["value"], &[]),
    tag("default", Kind::Default, &["name", "value"], &[]),
];

/// Deepest nesting of elements; scenes need six. Keeps hostile files from exhausting the stack.
const MAX_NESTING: usize = 32;

/// Reads the text; `defines` go before the defaults in it. `None` where nothing sensible can be made of it.
pub fn read(text: &str, defines: &[(String, String)], faults: &Faults) -> Option<Element> {
    let document = match roxmltree::Document::parse(text) {
        Ok(document) => document,
        Err(error) => {
            report_malformed(text, &error, faults);
            return None;
        }
    };
    let root = document.root_element();
    if root.tag_name().name() != "scene" {
        let message = format!("the root element is <{}>; a scene file has <scene version=\"3.0.0\">", name_of(root));
        faults.at(&tag_span(root), message);
        return None;
    }
    let mut builder = Builder { names: Names::new(defines), defaults: BTreeSet::new(), faults };
    let scene = builder.element(root, 0)?;
    check_version(&scene, faults);
    builder.names.unused().into_iter().for_each(|message| faults.general(message));
    Some(scene)
}

/// Text that is no XML.
fn report_malformed(text: &str, error: &roxmltree::Error, faults: &Faults) {
    let place = error.pos();
    let line_start: usize = text.split_inclusive('\n').take(place.row as usize - 1).map(str::len).sum();
    let column = text[line_start..].char_indices().nth(place.col as usize - 1).map_or(0, |(byte, _)| byte);
    let start = (line_start + column).min(text.len());
    let message = error.to_string();
    let message = message.strip_suffix(&format!(" at {place}")).unwrap_or(&message);
    faults.at(&(start..start), format!("malformed XML: {message}"));
}

/// Other versions name parameters differently.
fn check_version(scene: &Element, faults: &Faults) {
    if let Some(version) = scene.attribute("version")
        && version.value.split('.').next() != Some("3")
    {
        faults.at(&version.span, format!("scene version {:?} is not supported; supported: 3.x.y", version.value));
    }
}

/// Makes elements of nodes.
struct Builder<'a> {
    names: Names<'a>,
    /// Names that have a `<default>`.
    defaults: BTreeSet<String>,
    faults: &'a Faults,
}

impl Builder<'_> {
    /// The element of a node and of all below it.
    fn element(&mut self, node: roxmltree::Node, depth: usize) -> Option<Element> {
        let span = tag_span(node);
        if depth > MAX_NESTING {
            self.faults.at(&span, format!("elements are nested deeper than {MAX_NESTING} levels"));
            return None;
        }
        let Some(tag) = TAGS.iter().find(|t| t.name == node.tag_name().name()) else {
            let known: Vec<_> = TAGS.iter().map(|t| t.name).filter(|n| *n != "scene").collect();
            self.faults.unknown(&span, "element", name_of(node), &known);
            return None;
        };
        let attributes = self.attributes(node, tag, &span);
        let children = self.children(node, tag, depth);
        Some(Element { tag: tag.name, span, attributes, children })
    }

    /// Attributes with `$names` replaced; those that the tag does not have are faults, as are missing ones.
    fn attributes(&mut self, node: roxmltree::Node, tag: &Tag, span: &Span) -> Vec<Attribute> {
        let known: Vec<_> = tag.required.iter().chain(tag.optional).copied().collect();
        let mut attributes = Vec::new();
        for given in node.attributes() {
            let Some(name) = known.iter().find(|k| **k == given.name()) else {
                self.faults.unknown(
                    &given.range_qname(),
                    &format!("attribute of <{}>", tag.name),
                    given.name(),
                    &known,
                );
                continue;
            };
            let span = given.range_value();
            let stands_there = node.document().input_text()[span.clone()] == *given.value();
            let fault = |message| self.faults.without_value(&span, message);
            let Replaced { text: value, by_default } = self.names.replaced(given.value(), fault);
            attributes.push(Attribute { name, value, is_plain: stands_there && !by_default, span });
        }
        for name in tag.required.iter().filter(|name| !node.has_attribute(**name)) {
            self.faults.at(span, format!("<{}> needs the attribute {name}; {}", tag.name, list(&known)));
        }
        attributes
    }

    /// Elements inside, in order; a `default` acts on those after it and vanishes.
    fn children(&mut self, node: roxmltree::Node, tag: &Tag, depth: usize) -> Vec<Element> {
        let mut children = Vec::new();
        for child in node.children() {
            if child.is_text() {
                self.expect_blank(child);
            }
            if !child.is_element() {
                continue;
            }
            let Some(element) = self.element(child, depth + 1) else { continue };
            match (tag.kind, element.kind()) {
                (Kind::Scene, Kind::Default) => self.default(&element),
                (_, Kind::Default) => self.faults.at(&element.span, "<default> belongs directly inside <scene>"),
                (Kind::Transform, Kind::Step) => children.push(element),
                (_, Kind::Step) => {
                    self.faults.at(&element.span, format!("<{}> belongs inside <transform>", element.tag))
                }
                (Kind::Scene | Kind::Object, _) => children.push(element),
                (..) => {
                    let message = format!("<{}> does not belong inside <{}>", element.tag, tag.name);
                    self.faults.at(&element.span, message);
                }
            }
        }
        children
    }

    /// A `<default>`, one for each name.
    fn default(&mut self, element: &Element) {
        let name = element.value("name");
        if !self.defaults.insert(name.into()) {
            self.faults.at(element.span_of("name"), format!("the default of {name:?} is given twice"));
        }
        self.names.default(name, element.value("value"));
    }

    /// Text between elements means nothing, so it is a slip.
    fn expect_blank(&self, node: roxmltree::Node) {
        let text = node.text().unwrap_or_default();
        if !text.trim().is_empty() {
            let start = node.range().start + (text.len() - text.trim_start().len());
            self.faults.at(&(start..start + 1), "text between elements means nothing in a scene");
        }
    }
}

/// From the `<` of the start tag to the end of its name.
fn tag_span(node: roxmltree::Node) -> Span {
    let start = node.range().start;
    start..start + 1 + name_of(node).len()
}

/// The tag's name, cut to what a message can hold.
fn name_of<'a>(node: roxmltree::Node<'a, 'a>) -> &'a str {
    let name = node.tag_name().name();
    &name[..name.char_indices().nth(40).map_or(name.len(), |(end, _)| end)]
}
