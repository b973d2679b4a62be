//! The named parameters and nested objects of one element.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::Arc;

use glam::{Affine2, Affine3A, Mat2, Vec3};

use super::Folder;
use super::document::{Element, Kind};
use super::textures::Textures;
use super::{transforms, values};
use crate::load::faults::{Faults, did_you_mean, list};
use crate::scene::Rgb;
use crate::scene::parameters::{NumberOrName, Parameters, Range, VaryingParameter};
use crate::scene::textures::{Image, Texture};

/// Reads an element; [`finish`](Self::finish) then reports all in it that nothing asked for.
pub struct ElementParameters<'a> {
    /// The element.
    pub element: &'a Element,
    /// Where faults go.
    pub faults: &'a Faults,
    /// Names asked for.
    asked: BTreeSet<String>,
    /// Tags of nested objects asked for.
    nested: BTreeSet<&'static str>,
    /// Where textures and pictures come from, of elements that may have any.
    textures: Option<&'a Textures<'a>>,
    /// Parameters in whose place textures can be, and those that are.
    varying: &'static [VaryingParameter],
    textured: Vec<(usize, Arc<Texture>)>,
}

impl<'a> ElementParameters<'a> {
    /// Of an element.
    pub fn new(element: &'a Element, faults: &'a Faults) -> Self {
        ElementParameters {
            element,
            faults,
            asked: BTreeSet::new(),
            nested: BTreeSet::new(),
            textures: None,
            varying: &[],
            textured: Vec::new(),
        }
    }

    /// With textures and pictures.
    pub fn with_textures(self, textures: &'a Textures<'a>) -> Self {
        ElementParameters { textures: Some(textures), ..self }
    }

    /// With textures in the place of some parameters; [`textured`](Self::textured) then tells which.
    pub fn with_varying(self, varying: &'static [VaryingParameter]) -> Self {
        ElementParameters { varying, ..self }
    }

    /// The textures met in the place of parameters, by their numbers among those that vary.
    pub fn textured(&mut self) -> Vec<(usize, Arc<Texture>)> {
        std::mem::take(&mut self.textured)
    }

    /// The texture in the place of a parameter; `None` where the parameter is something else or absent, `Some(None)`
    /// where the texture is faulty.
    pub fn texture(&mut self, name: &str, range: Range) -> Option<Option<Arc<Texture>>> {
        let (textures, child) = (self.textures?, self.child(name)?);
        if !textures.is_texture(child) {
            return None;
        }
        self.asked.insert(name.into());
        let texture = textures.get(child);
        Some(texture.filter(|texture| {
            let values = texture.range();
            let checked = range.check(values);
            if let Err(accepted) = checked {
                let [least, largest] = values;
                let message = format!("values of the texture run from {least} to {largest}; {name} must be {accepted}");
                self.faults.at(&child.span, message);
            }
            checked.is_ok()
        }))
    }

    /// The nested objects of some tags (`ref` for references), in order, but for those in the place of parameters
    /// that have been asked for.
    pub fn nested(&mut self, tags: &'static [&'static str]) -> Vec<&'a Element> {
        self.nested.extend(tags);
        self.element
            .children
            .iter()
            .filter(|child| tags.contains(&child.tag) && !self.asked.contains(child.value("name")))
            .collect()
    }

    /// The nested object of a tag; a second one is a fault.
    pub fn single(&mut self, tag: &'static str) -> Option<&'a Element> {
        self.nested.insert(tag);
        let mut found = self.element.children.iter().filter(|child| child.tag == tag);
        let first = found.next();
        for surplus in found {
            let message = format!("{} has more than one <{tag}>", self.element.described());
            self.faults.at(&surplus.span, message);
        }
        first
    }

    /// The string of that name, which must be one of those known, or the default.
    pub fn choice<T: Copy>(&mut self, name: &str, known: &[(&str, T)], default: T) -> T {
        let words: Vec<_> = known.iter().map(|(word, _)| *word).collect();
        self.word(name, &words).map_or(default, |i| known[i].1)
    }

    /// Whether there is a parameter of that name, faulty or not.
    pub fn is_given(&self, name: &str) -> bool {
        self.child(name).is_some()
    }

    /// The string of that name, without which the element means nothing.
    pub fn required_string(&mut self, name: &str) -> Option<String> {
        let is_absent = !self.element.children.iter().any(|c| c.kind() != Kind::Reference && c.value("name") == name);
        let value = self.string(name);
        if is_absent {
            self.faults.at(&self.element.span, format!("{} needs the parameter {name:?}", self.element.described()));
        }
        value
    }

    /// The file that the string of that name, without which the element means nothing, names.
    pub fn file(&mut self, name: &str, folder: &Folder) -> Option<PathBuf> {
        self.required_string(name)?;
        let named = self.child(name)?.attribute("value")?;
        folder.file(named).map_err(|message| self.faults.at(&named.span, message)).ok()
    }

    /// Reports parameters and objects that nothing asked for, and those given twice.
    pub fn finish(self) {
        let mut seen = BTreeSet::new();
        for child in &self.element.children {
            let name = child.value("name");
            match child.kind() {
                Kind::Value | Kind::Transform => {
                    if !self.asked.contains(name) {
                        self.report_unknown(child);
                    } else if !seen.insert(name) {
                        self.faults.at(child.span_of("name"), format!("parameter {name:?} is given twice"));
                    }
                }
                // A named object where a value was asked for has been reported as such.
                _ if self.asked.contains(name) => {}
                _ if !self.nested.contains(child.tag) => {
                    let message = format!("{} cannot hold a <{}>", self.element.described(), child.tag);
                    self.faults.at(&child.span, message);
                }
                _ => {}
            }
        }
    }

    /// A parameter of a name that nothing asked for.
    fn report_unknown(&self, child: &Element) {
        let name = child.value("name");
        let known: Vec<_> = self.asked.iter().map(String::as_str).collect();
        let near = did_you_mean(name, &known);
        let message = format!("unknown parameter {name:?} of {}{near}; {}", self.element.described(), list(&known));
        self.faults.at(child.span_of("name"), message);
    }

    /// The child of that name if it has one of the accepted tags; another tag is a fault.
    fn value(&mut self, name: &str, accepted: &[&str]) -> Option<&'a Element> {
        self.asked.insert(name.into());
        let child = self.child(name)?;
        if accepted.contains(&child.tag) {
            return Some(child);
        }
        let slot = self.varying.iter().position(|parameter| parameter.name == name);
        if let Some(slot) = slot
            && let Some(texture) = self.texture(name, self.varying[slot].range)
        {
            if self.textured.iter().all(|(known, _)| *known != slot) {
                self.textured.extend(texture.map(|texture| (slot, texture)));
            }
            return None;
        }
        let texture = slot.map(|_| "<texture>".to_string());
        let accepted: Vec<_> = accepted.iter().map(|tag| format!("<{tag}>")).chain(texture).collect();
        let message = format!("{name:?} is given as <{}>; accepted: {}", child.tag, accepted.join(", "));
        self.faults.at(&child.span, message);
        None
    }

    /// The child of that name, whatever it is.
    fn child(&self, name: &str) -> Option<&'a Element> {
        self.element.children.iter().find(|c| c.attribute("name").is_some_and(|a| a.value == name))
    }

    /// The value of the child of that name, read from its `value` attribute.
    fn parsed<T>(&mut self, name: &str, tags: &[&str], parse: impl Fn(&str) -> Result<T, String>) -> Option<T> {
        let child = self.value(name, tags)?;
        let attribute = child.attribute("value")?;
        parse(&attribute.value).map_err(|message| self.faults.at(&attribute.span, message)).ok()
    }
}

impl Parameters for ElementParameters<'_> {
    fn float(&mut self, name: &str) -> Option<f32> {
        self.parsed(name, &["float", "integer"], values::float)
    }

    fn integer(&mut self, name: &str) -> Option<i64> {
        self.parsed(name, &["integer"], values::integer)
    }

    fn boolean(&mut self, name: &str) -> Option<bool> {
        self.parsed(name, &["boolean"], values::boolean)
    }

    fn string(&mut self, name: &str) -> Option<String> {
        self.parsed(name, &["string"], |text| Ok(text.to_string()))
    }

    fn word(&mut self, name: &str, known: &[&str]) -> Option<usize> {
        let element = self.value(name, &["string"])?;
        let given = element.value("value");
        let found = known.iter().position(|word| *word == given);
        if found.is_none() {
            self.faults.unknown(element.span_of("value"), name, given, known);
        }
        found
    }

    fn rgb(&mut self, name: &str) -> Option<Rgb> {
        self.parsed(name, &["rgb", "spectrum", "float", "integer"], values::rgb)
    }

    fn number_or_name(&mut self, name: &str) -> Option<NumberOrName> {
        if self.value(name, &["float", "integer", "string"])?.tag == "string" {
            return self.string(name).map(NumberOrName::Name);
        }
        self.float(name).map(NumberOrName::Number)
    }

    fn point(&mut self, name: &str) -> Option<Vec3> {
        let child = self.value(name, &["point"])?;
        values::xyz(child, None, self.faults).map(|point| point.as_vec3())
    }

    fn vector(&mut self, name: &str) -> Option<Vec3> {
        let child = self.value(name, &["vector"])?;
        values::xyz(child, None, self.faults).map(|vector| vector.as_vec3())
    }

    fn to_world(&mut self) -> Affine3A {
        let read = self.value("to_world", &["transform"]).and_then(|child| transforms::read(child, self.faults));
        read.unwrap_or(Affine3A::IDENTITY)
    }

    fn to_uv(&mut self) -> Affine2 {
        let read = self.value("to_uv", &["transform"]).and_then(|child| transforms::read(child, self.faults));
        let Some(Affine3A { matrix3, translation }) = read else { return Affine2::IDENTITY };
        Affine2 {
            matrix2: Mat2::from_cols(matrix3.x_axis.truncate(), matrix3.y_axis.truncate()),
            translation: translation.truncate(),
        }
    }

    fn varies(&self, name: &str) -> bool {
        self.textured.iter().any(|(slot, _)| self.varying[*slot].name == name)
    }

    fn image(&mut self, name: &str) -> Option<Arc<Image>> {
        let textures = self.textures.expect("elements that name pictures are read with them");
        let file = self.file(name, textures.folder)?;
        textures.image(&file).map_err(|message| Parameters::fault(self, name, message)).ok()
    }

    fn fault(&mut self, name: &str, message: String) {
        let span = match self.child(name) {
            Some(child) => child.span_of("value"),
            None => self.element.span_of("type"),
        };
        self.faults.at(span, message);
    }
}
