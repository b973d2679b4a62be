//! Parameter lists: `"type name" [ values ]`.

use std::cell::{Cell, RefCell};
use std::collections::BTreeSet;
use std::path::PathBuf;
use std::rc::Rc;

use glam::{DVec2, DVec3};

use crate::convert::notes::{Notes, Place};
use crate::load::faults::{did_you_mean, list};

/// Types of parameters and how many numbers make one value; 0 for what are no numbers.
pub const TYPES: &[(&str, usize)] = &[
    ("integer", 1),
    ("float", 1),
    ("point2", 2),
    ("vector2", 2),
    ("point3", 3),
    ("point", 3),
    ("vector3", 3),
    ("vector", 3),
    ("normal3", 3),
    ("normal", 3),
    ("rgb", 3),
    ("blackbody", 1),
    ("spectrum", 0),
    ("bool", 0),
    ("string", 0),
    ("texture", 0),
];

/// What stands in the brackets.
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// Numbers.
    Numbers(Vec<f64>),
    /// Strings.
    Strings(Vec<String>),
    /// `true` and `false`.
    Booleans(Vec<bool>),
}

/// A parameter.
#[derive(Debug)]
pub struct Parameter {
    /// One of [`TYPES`].
    pub kind: String,
    /// Its name.
    pub name: String,
    /// Its values.
    pub values: Values,
    /// Where its name stands.
    pub place: Place,
    is_used: Cell<bool>,
}

impl Parameter {
    /// One that nothing has asked for.
    pub fn new(kind: String, name: String, values: Values, place: Place) -> Parameter {
        Parameter { kind, name, values, place, is_used: Cell::new(false) }
    }

    /// Its numbers; none where it has others.
    pub fn numbers(&self) -> &[f64] {
        match &self.values {
            Values::Numbers(numbers) => numbers,
            _ => &[],
        }
    }

    /// Its first string.
    pub fn string(&self) -> Option<&str> {
        match &self.values {
            Values::Strings(strings) => strings.first().map(String::as_str),
            _ => None,
        }
    }
}

/// A directive's name and parameters, and those that `Attribute` adds to it.
#[derive(Clone, Debug)]
pub struct Parameters {
    /// What the directive makes, such as `sphere`.
    pub kind: String,
    /// Where that stands.
    pub place: Place,
    /// The directive, for messages.
    pub directive: &'static str,
    /// Its parameters, earlier ones first in effect.
    pub list: Vec<Rc<Parameter>>,
    /// Those that every directive of the kind has been given; unused, they are no slip.
    pub shared: Vec<Rc<Parameter>>,
    asked: RefCell<BTreeSet<String>>,
}

impl Parameters {
    /// A list.
    pub fn new(directive: &'static str, kind: String, place: Place, list: Vec<Rc<Parameter>>) -> Parameters {
        Parameters { kind, place, directive, list, shared: Vec::new(), asked: RefCell::default() }
    }

    /// For messages: `Shape "sphere"`.
    pub fn described(&self) -> String {
        format!("{} {:?}", self.directive, self.kind)
    }

    /// The parameter of that name, of one of these types.
    pub fn get(&self, name: &str, kinds: &[&str]) -> Option<&Parameter> {
        self.asked.borrow_mut().insert(name.to_owned());
        let is_it = |parameter: &&Rc<Parameter>| parameter.name == name && kinds.contains(&&parameter.kind[..]);
        let found = self.list.iter().chain(&self.shared).find(is_it)?;
        found.is_used.set(true);
        Some(found)
    }

    /// Where a parameter stands, or the directive's kind where it is absent.
    pub fn place_of(&self, name: &str) -> &Place {
        self.list.iter().find(|parameter| parameter.name == name).map_or(&self.place, |parameter| &parameter.place)
    }

    /// A number.
    pub fn float(&self, name: &str) -> Option<f64> {
        self.get(name, &["float"])?.numbers().first().copied()
    }

    /// Numbers.
    pub fn floats(&self, name: &str) -> Option<&[f64]> {
        self.get(name, &["float"]).map(Parameter::numbers)
    }

    /// A whole number.
    pub fn integer(&self, name: &str) -> Option<i64> {
        self.get(name, &["integer"])?.numbers().first().map(|value| *value as i64)
    }

    /// Whole numbers.
    pub fn integers(&self, name: &str) -> Option<Vec<i64>> {
        Some(self.get(name, &["integer"])?.numbers().iter().map(|value| *value as i64).collect())
    }

    /// A truth value; older files quote it.
    pub fn boolean(&self, name: &str) -> Option<bool> {
        match &self.get(name, &["bool"])?.values {
            Values::Booleans(values) => values.first().copied(),
            Values::Strings(values) => values.first().map(|value| value == "true"),
            Values::Numbers(_) => None,
        }
    }

    /// A string.
    pub fn string(&self, name: &str) -> Option<&str> {
        self.get(name, &["string"])?.string()
    }

    /// Strings.
    pub fn strings(&self, name: &str) -> Option<&[String]> {
        match &self.get(name, &["string"])?.values {
            Values::Strings(strings) => Some(strings),
            _ => None,
        }
    }

    /// A point, a direction or a normal.
    pub fn point(&self, name: &str) -> Option<DVec3> {
        self.points(name)?.first().copied()
    }

    /// Points, directions or normals.
    pub fn points(&self, name: &str) -> Option<Vec<DVec3>> {
        let kinds = ["point3", "point", "vector3", "vector", "normal3", "normal"];
        let numbers = self.get(name, &kinds)?.numbers();
        Some(numbers.as_chunks().0.iter().map(|xyz| DVec3::from_array(*xyz)).collect())
    }

    /// Points of the plane.
    pub fn points_2(&self, name: &str) -> Option<Vec<DVec2>> {
        let numbers = self.get(name, &["point2", "vector2"])?.numbers();
        Some(numbers.as_chunks().0.iter().map(|xy| DVec2::from_array(*xy)).collect())
    }

    /// A file, seen from the folder of the scene, whichever file names it; it must be there.
    pub fn file(&self, name: &str, notes: &Notes) -> Option<PathBuf> {
        let parameter = self.get(name, &["string"])?;
        let given = parameter.string().filter(|given| !given.is_empty())?;
        let path = notes.file(&notes.home(), given, true);
        let path = path.map_err(|message| notes.fault(&parameter.place, message)).ok()?;
        if !path.is_file() {
            notes.fault(&parameter.place, format!("there is no file {}", path.display()));
            return None;
        }
        Some(path)
    }

    /// A parameter that is not converted, if it is there, and why.
    pub fn left_out(&self, name: &str, why: &str, notes: &Notes) {
        let kinds: Vec<&str> = TYPES.iter().map(|(kind, _)| *kind).collect();
        if let Some(parameter) = self.get(name, &kinds) {
            notes.left_out(&parameter.place, format!("{name} of {}: {why}", self.described()));
        }
    }

    /// Parameters that say nothing about the picture.
    pub fn quiet(&self, names: &[&str]) {
        let kinds: Vec<&str> = TYPES.iter().map(|(kind, _)| *kind).collect();
        for name in names {
            self.get(name, &kinds);
        }
    }

    /// Lists what nothing asked for.
    pub fn finish(&self, notes: &Notes) {
        let asked = self.asked.borrow();
        let known: Vec<&str> = asked.iter().map(String::as_str).collect();
        for parameter in self.list.iter().filter(|parameter| !parameter.is_used.get()) {
            let Parameter { kind, name, .. } = &**parameter;
            let message = if asked.contains(name) {
                format!("{kind} {name} of {}: it is not taken as {kind}, or is given twice", self.described())
            } else {
                let near = did_you_mean(name, &known);
                format!("{kind} {name} of {}: no such parameter is known{near}; {}", self.described(), list(&known))
            };
            notes.left_out(&parameter.place, message);
        }
    }
}
