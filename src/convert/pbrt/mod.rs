//! A part of pbrt-v4's scene format.
//!
//! Text becomes tokens ([`tokenizer`]), tokens directives with parameters ([`reader`], [`parameters`]), directives act on
//! a state and leave a description of the scene ([`directives`], [`state`], [`world`]); then each family is converted by
//! a file of its own.

mod camera;
mod directives;
mod environment;
mod lights;
mod materials;
mod parameters;
mod quadrics;
mod reader;
mod shapes;
mod spectra;
mod state;
mod textures;
mod tokenizer;
mod world;

use std::cell::RefCell;
use std::collections::{HashMap, HashSet};
use std::path::Path;
use std::rc::Rc;

use super::files::Files;
use super::notes::Notes;
use super::textures::Texture;
use super::xml::Element;
use crate::load::faults::{did_you_mean, list};
use world::{TextureKind, World};

/// Converts the file of that path, text and number.
pub(super) fn convert(
    path: &Path,
    source: (usize, Rc<str>),
    defines: &[(String, String)],
    files: &Files,
    notes: &Notes,
) -> Option<Element> {
    let world = reader::read(path, source, notes);
    if let (Some((name, value)), Some(start)) = (defines.first(), &world.start) {
        notes.fault(start, format!("-D {name}={value} has no effect: pbrt's files have no parameters"));
    }
    let gain = camera::gain(world.film.as_ref(), world.camera.as_ref().map(|(camera, _)| camera), notes);
    Converter {
        world: &world,
        files,
        notes,
        gain,
        textures: RefCell::default(),
        materials: RefCell::default(),
        used: RefCell::default(),
        bsdfs: RefCell::default(),
        ids: RefCell::default(),
    }
    .scene()
}

/// Makes elements of a world.
pub struct Converter<'a> {
    world: &'a World,
    files: &'a Files,
    notes: &'a Notes,
    /// By how much the film multiplies all light.
    gain: f64,
    /// Textures made, by name.
    textures: RefCell<HashMap<(String, TextureKind), Option<Texture>>>,
    /// Ids of materials written, by all that makes them what they are.
    materials: RefCell<HashMap<String, String>>,
    /// Indices of those that shapes have.
    used: RefCell<HashSet<usize>>,
    /// Materials written.
    bsdfs: RefCell<Vec<Element>>,
    /// Ids that are taken, and how many were asked for by the same name before.
    ids: RefCell<HashMap<String, usize>>,
}

impl Converter<'_> {
    fn scene(&self) -> Option<Element> {
        let mut scene = Element::new("scene").with("version", "3.0.0").holding(self.integrator());
        scene.children.extend(self.sensor());
        let groups = self.groups();
        let by_name = groups.iter().map(|(name, group)| (*name, group.as_ref())).collect();
        let shapes: Vec<Element> = self.world.shapes.iter().flat_map(|shape| self.shape(shape, false)).collect();
        let instances: Vec<Element> = self.world.instances.iter().filter_map(|i| self.instance(i, &by_name)).collect();
        let lights = self.world.lights.iter().filter_map(|(light, to_world)| self.light(light, *to_world));
        let lights: Vec<Element> = lights.collect();
        // what was never used has faults as well
        for (index, material) in self.world.materials.iter().enumerate() {
            if !self.used.borrow().contains(&index) {
                let names: Vec<&str> = material.list.iter().map(|parameter| &parameter.name[..]).collect();
                material.quiet(&names);
            }
        }
        scene.children.append(&mut self.bsdfs.borrow_mut());
        scene.children.extend(groups.into_iter().filter_map(|(_, group)| group));
        scene.children.extend(shapes.into_iter().chain(instances).chain(lights));
        Some(scene)
    }

    /// Every object as a group of shapes; none where nothing of it could be converted.
    fn groups(&self) -> Vec<(&str, Option<Element>)> {
        let group = |(name, shapes): &(String, Vec<world::Shape>)| {
            let inside: Vec<Element> = shapes.iter().flat_map(|shape| self.shape(shape, true)).collect();
            if inside.is_empty() {
                return None;
            }
            let mut group = Element::plugin("shape", "shapegroup").with("id", self.unique(name));
            group.children = inside;
            Some(group)
        };
        self.world.objects.iter().map(|object| (&object.0[..], group(object))).collect()
    }

    fn instance(&self, instance: &world::Instance, groups: &HashMap<&str, Option<&Element>>) -> Option<Element> {
        let Some(group) = groups.get(&instance.name[..]) else {
            let known: Vec<&str> = groups.keys().copied().collect();
            let message =
                format!("no object {:?}{}; {}", instance.name, did_you_mean(&instance.name, &known), list(&known));
            self.notes.fault(&instance.place, message);
            return None;
        };
        let id = group.as_ref()?.attribute("id").expect("groups have ids");
        let element = Element::plugin("shape", "instance").transform("to_world", instance.to_world);
        Some(element.holding(Element::reference(id)))
    }

    /// An id that is not taken, made of a name.
    fn unique(&self, name: &str) -> String {
        let mut ids = self.ids.borrow_mut();
        let base = if name.is_empty() { "unnamed" } else { name };
        let first = ids.get(base).copied().unwrap_or(0) + 1;
        let (number, id) = (first..)
            .map(|i| (i, if i == 1 { base.to_owned() } else { format!("{base}-{i}") }))
            .find(|(_, id)| !ids.contains_key(id))
            .expect("numbers do not end");
        ids.insert(id.clone(), 1);
        ids.insert(base.to_owned(), number);
        id
    }
}
