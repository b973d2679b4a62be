//! Parameters of a plugin: read by name, or carried over by tables of what each plugin takes.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::path::PathBuf;

use glam::DVec3;

use super::document::Node;
use super::textures;
use super::transforms::{self, Transform};
use super::values::{self, Of};
use super::{Context, Rgb};
use crate::convert::notes::Place;
use crate::convert::textures::{Texture, Use};
use crate::convert::values::{exactly, number};
use crate::convert::xml::Element;
use crate::load::faults::{did_you_mean, list};

/// Tags of values with a name.
const VALUES: &[&str] = &["float", "integer", "boolean", "string", "point", "vector", "transform", "animation"];

/// How a parameter is carried over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Take {
    /// A number.
    Float,
    /// A whole number.
    Integer,
    /// A truth value.
    Boolean,
    /// A string.
    String,
    /// A point.
    Point,
    /// A direction.
    Vector,
    /// A colour of light.
    Light,
    /// A colour or a texture.
    Colour,
    /// A number or a texture.
    Number,
    /// An index of refraction, as a number or by a material's name.
    Index,
    /// A transform.
    Transform,
    /// A file's name.
    File,
    /// Says nothing about the picture, such as how to sample something: read and not written.
    Quiet,
}

/// A parameter: its name in the spelling of Mitsuba 3 ([`super::document::snake_case`]), what it is called there, and
/// how it is carried over.
pub type Row = (&'static str, &'static str, Take);

/// A parameter that keeps its name.
pub const fn same(name: &'static str, take: Take) -> Row {
    (name, name, take)
}

/// The parameters of an element. What is not asked for is listed as left out by [`Parameters::finish`].
pub struct Parameters<'a> {
    /// The element.
    pub node: &'a Node,
    /// Where all is.
    pub context: &'a Context<'a>,
    asked: RefCell<BTreeSet<String>>,
    taken: RefCell<BTreeSet<*const Node>>,
}

impl<'a> Parameters<'a> {
    /// Those of an element.
    pub fn new(node: &'a Node, context: &'a Context<'a>) -> Self {
        Parameters { node, context, asked: RefCell::default(), taken: RefCell::default() }
    }

    /// Writes those of the table that are there.
    pub fn carry(&self, rows: &[Row], mut element: Element) -> Element {
        for (name, new, take) in rows {
            if self.node.children.iter().any(|child| child.name() == *name) {
                element = self.carry_one(name, new, *take, element);
            } else {
                self.asked.borrow_mut().insert((*name).to_owned());
            }
        }
        element
    }

    fn carry_one(&self, name: &str, new: &str, take: Take, element: Element) -> Element {
        let written = match take {
            Take::Float => self.float(name).map(|value| element.clone().float(new, value)),
            Take::Integer => self.integer(name).map(|value| element.clone().integer(new, value)),
            Take::Boolean => self.boolean(name).map(|value| element.clone().boolean(new, value)),
            Take::String => self.string(name).map(|value| element.clone().string(new, &value)),
            Take::Point => self.point(name).map(|value| element.clone().point(new, value)),
            Take::Vector => self.point(name).map(|value| element.clone().vector(new, value)),
            Take::Light => self.colour(name, Of::Light).map(|value| element.clone().rgb(new, value)),
            Take::Colour | Take::Number => {
                let as_ = if take == Take::Colour { Use::Colour } else { Use::Number };
                self.texture(name).map(|value| element.clone().holding(value.element(new, as_, self.context.files)))
            }
            Take::Index => match self.index(name) {
                Some(Index::Number(value)) => Some(element.clone().float(new, value)),
                Some(Index::Name(value)) => Some(element.clone().string(new, &value)),
                None => None,
            },
            Take::Transform => self.transform(name).map(|value| element.clone().holding(value.element(new))),
            Take::File => self.file(name).map(|path| element.clone().string(new, &self.context.files.reference(&path))),
            Take::Quiet => {
                self.child(name);
                None
            }
        };
        written.unwrap_or(element)
    }

    /// The child of that name.
    pub fn child(&self, name: &str) -> Option<&'a Node> {
        self.asked.borrow_mut().insert(name.to_owned());
        let child = self.node.children.iter().find(|child| child.name() == name)?;
        self.taken.borrow_mut().insert(child);
        Some(child)
    }

    /// The elements of these tags that have not been asked for by name, in order.
    pub fn nested(&self, tags: &[&str]) -> Vec<&'a Node> {
        let is_new = |child: &&Node| {
            tags.contains(&&child.tag[..]) && !self.taken.borrow().contains(&std::ptr::from_ref(*child))
        };
        let nested: Vec<&Node> = self.node.children.iter().filter(is_new).collect();
        self.taken.borrow_mut().extend(nested.iter().map(|child| std::ptr::from_ref(*child)));
        nested
    }

    /// A number.
    pub fn float(&self, name: &str) -> Option<f64> {
        self.parsed(name, number)
    }

    /// A whole number.
    pub fn integer(&self, name: &str) -> Option<i64> {
        self.parsed(name, |text| text.trim().parse().map_err(|_| format!("{text:?} is not a whole number")))
    }

    /// A truth value.
    pub fn boolean(&self, name: &str) -> Option<bool> {
        self.parsed(name, |text| match &text.trim().to_lowercase()[..] {
            "true" => Ok(true),
            "false" => Ok(false),
            _ => Err(format!("{text:?} is not a truth value; accepted: true, false")),
        })
    }

    /// A string.
    pub fn string(&self, name: &str) -> Option<String> {
        self.parsed(name, |text| Ok(text.to_owned()))
    }

    /// A point or a direction: `x`, `y`, `z`, or `value`.
    pub fn point(&self, name: &str) -> Option<DVec3> {
        let child = self.child(name)?;
        let read = match child.attribute("value") {
            Some(value) => exactly(&value.value).map(DVec3::from_array),
            None => ["x", "y", "z"]
                .map(|axis| child.attribute(axis).map_or(Ok(0.0), |given| number(&given.value)))
                .into_iter()
                .collect::<Result<Vec<_>, _>>()
                .map(|xyz| DVec3::from_slice(&xyz)),
        };
        self.sound(child.place_of("value"), read)
    }

    /// A colour.
    pub fn colour(&self, name: &str, of: Of) -> Option<Rgb> {
        values::colour(self.child(name)?, of, self.context.notes)
    }

    /// A colour, a number or a texture.
    pub fn texture(&self, name: &str) -> Option<Texture> {
        textures::value(self.child(name)?, self.context)
    }

    /// An index of refraction.
    pub fn index(&self, name: &str) -> Option<Index> {
        let child = self.child(name)?;
        if child.tag == "string" {
            return Some(Index::Name(child.value("value").to_owned()));
        }
        self.float(name).map(Index::Number)
    }

    /// A transform.
    pub fn transform(&self, name: &str) -> Option<Transform> {
        transforms::read(self.child(name)?, self.context.notes)
    }

    /// A file, beside the one that names it or else beside the scene.
    pub fn file(&self, name: &str) -> Option<PathBuf> {
        let child = self.child(name)?;
        let (notes, name) = (self.context.notes, child.attribute("value")?);
        let find = |folder: PathBuf| {
            let found = notes.file(&folder, &name.value, name.is_plain);
            found.map_err(|message| notes.fault(&name.place, message)).ok()
        };
        let mut path = find(notes.folder(&child.place))?;
        if !path.is_file() {
            path = find(notes.home())?;
        }
        if !path.is_file() {
            self.context.notes.fault(child.place_of("value"), format!("there is no file {}", path.display()));
        }
        Some(path)
    }

    /// Where a parameter's value stands, or the element where it is absent.
    pub fn place(&self, name: &str) -> &'a Place {
        let child = self.node.children.iter().find(|child| child.name() == name);
        child.map_or(self.node.place_of("type"), |child| child.place_of("value"))
    }

    /// A parameter that is not converted, if it is there, and why.
    pub fn left_out(&self, name: &str, why: &str) {
        if let Some(child) = self.child(name) {
            let message = format!("{} of {}: {why}", child.value("name"), self.node.described());
            self.context.notes.left_out(&child.place, message);
        }
    }

    /// Lists what nothing asked for.
    pub fn finish(&self) {
        let asked = self.asked.borrow();
        let known: Vec<&str> = asked.iter().map(String::as_str).collect();
        for child in &self.node.children {
            if self.taken.borrow().contains(&std::ptr::from_ref(child)) {
                continue;
            }
            let name = child.name();
            let is_value = VALUES.contains(&&child.tag[..]) || values::COLOURS.contains(&&child.tag[..]);
            let message = if is_value {
                let near = did_you_mean(&name, &known);
                format!(
                    "{} of {}: no such parameter is known{near}; {}",
                    child.value("name"),
                    self.node.described(),
                    list(&known)
                )
            } else {
                format!(
                    "{} in {}: nothing of that kind can be converted there",
                    child.described(),
                    self.node.described()
                )
            };
            self.context.notes.left_out(&child.place, message);
        }
    }

    fn parsed<T>(&self, name: &str, parse: impl Fn(&str) -> Result<T, String>) -> Option<T> {
        let child = self.child(name)?;
        self.sound(child.place_of("value"), parse(child.value("value")))
    }

    fn sound<T>(&self, place: &Place, read: Result<T, String>) -> Option<T> {
        read.map_err(|message| self.context.notes.fault(place, message)).ok()
    }
}

/// An index of refraction.
#[derive(Clone, Debug, PartialEq)]
pub enum Index {
    /// As a number.
    Number(f64),
    /// By a material's name.
    Name(String),
}
