//! XML text to a tree of nodes with places: includes and `$names` resolved, names in one spelling.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use crate::convert::notes::{Notes, Place};
use crate::load::names::{Names, Replaced};

/// An element.
#[derive(Debug)]
pub struct Node {
    /// What it is: `bsdf`, `float`, …
    pub tag: String,
    /// Where its start tag is.
    pub place: Place,
    attributes: Vec<Attribute>,
    /// What is inside, without `default`, `include` and `alias`.
    pub children: Vec<Node>,
}

/// An attribute.
#[derive(Debug)]
pub struct Attribute {
    name: String,
    /// Its value, `$names` replaced.
    pub value: String,
    /// Whether it stands in the file as it is, but for what `-D` says.
    pub is_plain: bool,
    /// Where the value stands.
    pub place: Place,
}

impl Node {
    /// The attribute of that name.
    pub fn attribute(&self, name: &str) -> Option<&Attribute> {
        self.attributes.iter().find(|a| a.name == name)
    }

    /// The value of an attribute, empty where it is absent.
    pub fn value(&self, name: &str) -> &str {
        self.attribute(name).map_or("", |a| &a.value)
    }

    /// Where an attribute's value stands, or the element where it is absent.
    pub fn place_of(&self, name: &str) -> &Place {
        self.attribute(name).map_or(&self.place, |a| &a.place)
    }

    /// The plugin's type, or nothing.
    pub fn plugin(&self) -> &str {
        self.value("type")
    }

    /// The parameter's name in the spelling of Mitsuba 2 and 3.
    pub fn name(&self) -> String {
        snake_case(self.value("name"))
    }

    /// For messages: `bsdf "diffuse"`, or `<float>` where there is no type.
    pub fn described(&self) -> String {
        match self.attribute("type") {
            Some(plugin) => format!("{} {:?}", self.tag, plugin.value),
            None => format!("<{}>", self.tag),
        }
    }
}

/// A scene file with all that it includes.
#[derive(Debug)]
pub struct Document {
    /// `<scene>`.
    pub scene: Node,
    /// Other names of ids.
    aliases: HashMap<String, String>,
}

impl Document {
    /// The id that a name stands for.
    pub fn resolved<'a>(&'a self, id: &'a str) -> &'a str {
        let mut id = id;
        // an alias of an alias; a ring of them ends as well
        for _ in 0..MAX_ALIASES {
            match self.aliases.get(id) {
                Some(of) => id = of,
                None => break,
            }
        }
        id
    }

    /// All nodes with an id, by it.
    pub fn ids(&self) -> HashMap<&str, &Node> {
        let mut ids = HashMap::new();
        gather(&self.scene, &mut ids);
        ids
    }
}

fn gather<'a>(node: &'a Node, ids: &mut HashMap<&'a str, &'a Node>) {
    if node.tag != "ref"
        && let Some(id) = node.attribute("id")
    {
        ids.insert(&id.value, node);
    }
    node.children.iter().for_each(|child| gather(child, ids));
}

/// Deepest nesting of elements, and of files that include others. Keeps hostile files from exhausting the stack.
const MAX_NESTING: usize = 64;
const MAX_INCLUDES: usize = 16;
/// Most aliases of one another that are followed.
const MAX_ALIASES: usize = 64;

/// Reads a scene file; `defines` go before the defaults in it.
pub fn read(path: &Path, text: &str, source: usize, defines: &[(String, String)], notes: &Notes) -> Option<Document> {
    let mut reader =
        Reader { notes, names: Names::new(defines), aliases: HashMap::new(), files: vec![path.to_owned()] };
    let scene = reader.file(text, source, 0)?;
    reader.names.unused().into_iter().for_each(|message| notes.fault(&scene.place, message));
    Some(Document { scene, aliases: reader.aliases })
}

struct Reader<'a> {
    notes: &'a Notes,
    names: Names<'a>,
    aliases: HashMap<String, String>,
    /// The file that is being read and those that include it.
    files: Vec<PathBuf>,
}

impl Reader<'_> {
    /// The root of a file that is so deep inside of others.
    fn file(&mut self, text: &str, source: usize, depth: usize) -> Option<Node> {
        // entities could name other files or grow without bounds; roxmltree refuses the latter and knows no former
        let document = match roxmltree::Document::parse(text) {
            Ok(document) => document,
            Err(error) => {
                let byte = byte_of(text, error.pos());
                self.notes.fault(&Place::new(source, byte..byte), format!("malformed XML: {error}"));
                return None;
            }
        };
        let root = document.root_element();
        if root.tag_name().name() != "scene" {
            let message = format!("the root element is <{}>; a scene file has <scene>", root.tag_name().name());
            self.notes.fault(&Place::new(source, root.range().start..root.range().start + 1), message);
            return None;
        }
        self.node(root, source, depth)
    }

    fn node(&mut self, node: roxmltree::Node, source: usize, depth: usize) -> Option<Node> {
        let start = node.range().start;
        let tag = snake_case(node.tag_name().name());
        let place = Place::new(source, start..start + 1 + node.tag_name().name().len());
        if depth > MAX_NESTING {
            self.notes.fault(&place, format!("elements are nested deeper than {MAX_NESTING} levels"));
            return None;
        }
        let (mut attributes, text) = (Vec::new(), node.document().input_text());
        for given in node.attributes() {
            let place = Place::new(source, given.range_value());
            let stands_there = text[given.range_value()] == *given.value();
            let fault = |message| self.notes.fault(&place, message);
            let Replaced { text: value, by_default } = self.names.replaced(given.value(), fault);
            let is_plain = stands_there && !by_default;
            attributes.push(Attribute { name: given.name().to_owned(), value, is_plain, place });
        }
        let mut read = Node { tag, place, attributes, children: Vec::new() };
        for child in node.children().filter(|child| child.is_element()) {
            let Some(child) = self.node(child, source, depth + 1) else { continue };
            match &child.tag[..] {
                "default" => {
                    self.names.default(child.value("name"), child.value("value"));
                }
                "alias" => {
                    self.aliases.insert(child.value("as").to_owned(), child.value("id").to_owned());
                }
                "include" => read.children.extend(self.included(&child, depth)),
                _ => read.children.push(child),
            }
        }
        Some(read)
    }

    /// What the root of another file holds.
    fn included(&mut self, include: &Node, depth: usize) -> Vec<Node> {
        let place = include.place_of("filename").clone();
        let Some(name) = include.attribute("filename") else {
            self.notes.fault(&include.place, "<include> needs the attribute filename");
            return Vec::new();
        };
        let path = match self.notes.file(&self.notes.folder(&place), &name.value, name.is_plain) {
            Ok(path) => path,
            Err(message) => {
                self.notes.fault(&place, message);
                return Vec::new();
            }
        };
        if self.files.contains(&path) || self.files.len() > MAX_INCLUDES {
            self.notes.fault(&place, format!("{} includes itself, by way of others or directly", path.display()));
            return Vec::new();
        }
        let (source, text) = match self.notes.read(&path) {
            Ok(read) => read,
            Err(message) => {
                self.notes.fault(&place, message);
                return Vec::new();
            }
        };
        self.files.push(path);
        let root = self.file(&text, source, depth);
        self.files.pop();
        root.map_or(Vec::new(), |root| root.children)
    }
}

/// The byte of a line and column from 1.
fn byte_of(text: &str, place: roxmltree::TextPos) -> usize {
    let line_start: usize = text.split_inclusive('\n').take(place.row.saturating_sub(1) as usize).map(str::len).sum();
    let column = text[line_start..].char_indices().nth(place.col.saturating_sub(1) as usize);
    column.map_or(text.len(), |(byte, _)| line_start + byte)
}

/// `intIOR` as `int_ior`, `toWorld` as `to_world`; what is in that spelling already stays.
pub fn snake_case(name: &str) -> String {
    let mut snake = String::with_capacity(name.len() + 4);
    let mut was_lower = false;
    for c in name.chars() {
        if c.is_ascii_uppercase() && was_lower {
            snake.push('_');
        }
        was_lower = c.is_ascii_lowercase() || c.is_ascii_digit();
        snake.push(c.to_ascii_lowercase());
    }
    snake
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_spelt_as_in_mitsuba_3() {
        for (old, new) in [
            ("intIOR", "int_ior"),
            ("toWorld", "to_world"),
            ("lookAt", "look_at"),
            ("alphaU", "alpha_u"),
            ("color0", "color0"),
            ("rrDepth", "rr_depth"),
            ("max_depth", "max_depth"),
        ] {
            assert_eq!(snake_case(old), new);
        }
    }
}
