//! The XML of Mitsuba 3 as a tree that is built from outside in and written once.

use std::fmt::Write;

use glam::{DAffine3, DVec3};

use super::Rgb;

/// An element.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Element {
    tag: &'static str,
    attributes: Vec<(&'static str, String)>,
    /// What is inside, in order.
    pub children: Vec<Element>,
}

impl Element {
    /// An element without attributes.
    pub fn new(tag: &'static str) -> Element {
        Element { tag, attributes: Vec::new(), children: Vec::new() }
    }

    /// A plugin, such as `<bsdf type="diffuse">`.
    pub fn plugin(tag: &'static str, name: &str) -> Element {
        Element::new(tag).with("type", name)
    }

    /// A `<ref>` to the element of that `id`.
    pub fn reference(id: &str) -> Element {
        Element::new("ref").with("id", id)
    }

    /// With a further attribute; an earlier value of it is replaced.
    pub fn with(mut self, attribute: &'static str, value: impl Into<String>) -> Element {
        self.attributes.retain(|(name, _)| *name != attribute);
        self.attributes.push((attribute, value.into()));
        self
    }

    /// With a further element inside.
    pub fn holding(mut self, child: Element) -> Element {
        self.children.push(child);
        self
    }

    /// An attribute's value.
    pub fn attribute(&self, name: &str) -> Option<&str> {
        self.attributes.iter().find(|(n, _)| *n == name).map(|(_, value)| &value[..])
    }

    /// With a number inside.
    pub fn float(self, name: &str, value: f64) -> Element {
        self.value("float", name, number(value))
    }

    /// With a whole number inside.
    pub fn integer(self, name: &str, value: i64) -> Element {
        self.value("integer", name, value.to_string())
    }

    /// With a truth value inside.
    pub fn boolean(self, name: &str, value: bool) -> Element {
        self.value("boolean", name, value.to_string())
    }

    /// With a string inside.
    pub fn string(self, name: &str, value: &str) -> Element {
        self.value("string", name, value.to_owned())
    }

    /// With a linear colour inside.
    pub fn rgb(self, name: &str, value: Rgb) -> Element {
        self.value("rgb", name, numbers(&value))
    }

    /// With a point inside.
    pub fn point(self, name: &str, value: DVec3) -> Element {
        self.value("point", name, numbers(&value.to_array()))
    }

    /// With a direction inside.
    pub fn vector(self, name: &str, value: DVec3) -> Element {
        self.value("vector", name, numbers(&value.to_array()))
    }

    /// With an affine map inside, as sixteen numbers row by row; none for the identity.
    pub fn transform(self, name: &str, map: DAffine3) -> Element {
        if map == DAffine3::IDENTITY {
            return self;
        }
        self.holding(Element::new("transform").with("name", name).holding(matrix(map)))
    }

    /// With a value of any tag inside.
    fn value(self, tag: &'static str, name: &str, value: String) -> Element {
        self.holding(Element::new(tag).with("name", name).with("value", value))
    }

    /// The text of a file that holds this as its root.
    pub fn document(&self, comment: &str) -> String {
        let mut text = String::from("<?xml version=\"1.0\" encoding=\"utf-8\"?>\n");
        // "--" would end the comment
        writeln!(text, "<!-- {} -->", comment.replace("--", "- -")).expect("text takes what is written");
        self.write(&mut text, 0);
        text
    }

    fn write(&self, text: &mut String, depth: usize) {
        let indent = "  ".repeat(depth);
        write!(text, "{indent}<{}", self.tag).expect("text takes what is written");
        for (name, value) in &self.attributes {
            write!(text, " {name}=\"{}\"", escaped(value)).expect("text takes what is written");
        }
        if self.children.is_empty() {
            text.push_str("/>\n");
            return;
        }
        text.push_str(">\n");
        self.children.iter().for_each(|child| child.write(text, depth + 1));
        writeln!(text, "{indent}</{}>", self.tag).expect("text takes what is written");
    }
}

/// A `<matrix>` of an affine map.
pub(super) fn matrix(map: DAffine3) -> Element {
    let [x, y, z] = map.matrix3.transpose().to_cols_array_2d();
    let t = map.translation;
    let rows = [x[0], x[1], x[2], t.x, y[0], y[1], y[2], t.y, z[0], z[1], z[2], t.z, 0.0, 0.0, 0.0, 1.0];
    Element::new("matrix").with("value", numbers(&rows))
}

/// The shortest text that reads back as the same number in single precision, which is what renderers keep.
pub(super) fn number(value: f64) -> String {
    let single = value as f32;
    format!("{}", if single == 0.0 { 0.0 } else { single })
}

/// Numbers with commas between them.
pub(super) fn numbers(values: &[f64]) -> String {
    values.iter().map(|value| number(*value)).collect::<Vec<_>>().join(", ")
}

/// A value between double quotes. What XML cannot hold at all is left out.
fn escaped(value: &str) -> String {
    let mut text = String::with_capacity(value.len());
    for c in value.chars() {
        match c {
            '&' => text.push_str("&amp;"),
            '<' => text.push_str("&lt;"),
            '>' => text.push_str("&gt;"),
            '"' => text.push_str("&quot;"),
            '\n' => text.push_str("&#10;"),
            '\t' => text.push_str("&#9;"),
            c if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') => {}
            c => text.push(c),
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_back() {
        let scene = Element::new("scene").with("version", "3.0.0").holding(
            Element::plugin("bsdf", "diffuse")
                .with("id", "a \"<&>\" b\u{1}")
                .rgb("reflectance", [0.1, 1e-7, 1.0 / 3.0]),
        );
        let text = scene.document("a -- b");
        let document = roxmltree::Document::parse(&text).unwrap();
        let bsdf = document.root_element().first_element_child().unwrap();
        assert_eq!(bsdf.attribute("id"), Some("a \"<&>\" b"));
        let numbers: Vec<f32> = bsdf
            .first_element_child()
            .and_then(|rgb| rgb.attribute("value"))
            .unwrap()
            .split(", ")
            .map(|n| n.parse().unwrap())
            .collect();
        assert_eq!(numbers, [0.1f32, 1e-7, 1.0 / 3.0]);
    }

    #[test]
    fn matrices_are_written_row_by_row() {
        let map =
            DAffine3::from_translation(DVec3::new(1.0, 2.0, 3.0)) * DAffine3::from_scale(DVec3::new(4.0, 5.0, 6.0));
        let element = matrix(map);
        assert_eq!(element.attribute("value"), Some("4, 0, 0, 1, 0, 5, 0, 2, 0, 0, 6, 3, 0, 0, 0, 1"));
    }
}
