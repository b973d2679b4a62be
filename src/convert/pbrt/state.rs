//! What directives act on: the current transform, material and so on, and the stack of them.

use std::collections::{HashMap, HashSet};
use std::rc::Rc;

use glam::DAffine3;

use super::parameters::{Parameter, Parameters};
use super::world::{MaterialReference, Shape, World};
use crate::convert::notes::{Notes, Place};

/// The state while a file is read.
#[derive(Debug)]
pub struct State {
    /// What the file has described so far.
    pub world: World,
    /// What the next directive sees.
    pub now: Graphics,
    /// Saved by `AttributeBegin`, `TransformBegin` and `ObjectBegin`.
    pub saved: Vec<(Saved, Graphics)>,
    /// Names of objects.
    pub objects: HashSet<String>,
    /// `CoordinateSystem`.
    pub systems: HashMap<String, DAffine3>,
    /// Index into [`World::objects`] between `ObjectBegin` and `ObjectEnd`.
    pub object: Option<usize>,
    /// After `WorldBegin`.
    pub is_in_world: bool,
}

/// What saved a state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Saved {
    /// `AttributeBegin`.
    Attribute,
    /// `TransformBegin`, which only saves the transform.
    Transform,
    /// `ObjectBegin`.
    Object,
}

/// What the next directive sees.
#[derive(Clone, Debug)]
pub struct Graphics {
    /// The current transform.
    pub transform: DAffine3,
    /// `ActiveTransform EndTime`: transforms act on the end of a motion only.
    pub is_end_of_motion: bool,
    /// `ReverseOrientation`.
    pub is_reversed: bool,
    /// `Material` or `NamedMaterial`.
    pub material: MaterialReference,
    /// `AreaLightSource`, an index into [`World::area_lights`].
    pub area_light: Option<usize>,
    /// `Attribute`: for which directive, and what.
    pub attributes: Vec<(String, Rc<Parameter>)>,
}

impl State {
    /// At the beginning of a file.
    pub fn new(start: Place) -> State {
        let now = Graphics {
            transform: DAffine3::IDENTITY,
            is_end_of_motion: false,
            is_reversed: false,
            material: MaterialReference::Default,
            area_light: None,
            attributes: Vec::new(),
        };
        let world = World { start: Some(start), ..World::default() };
        State {
            world,
            now,
            saved: Vec::new(),
            objects: HashSet::new(),
            systems: HashMap::new(),
            object: None,
            is_in_world: false,
        }
    }

    /// The world, at the end of the file.
    pub fn finish(self, notes: &Notes) -> World {
        let start = self.world.start.clone().expect("it is set where the state is made");
        if !self.is_in_world {
            notes.fault(&start, "the scene has no WorldBegin");
        }
        if let Some((what, _)) = self.saved.last() {
            notes.fault(&start, format!("a {what:?}Begin of the scene has no {what:?}End"));
        }
        self.world
    }

    /// Applies a map before the current transform, as all directives do.
    pub fn apply(&mut self, map: DAffine3) {
        self.set(self.now.transform * map);
    }

    /// Replaces the current transform.
    pub fn set(&mut self, transform: DAffine3) {
        if !self.now.is_end_of_motion {
            self.now.transform = transform;
        }
    }

    /// A list with what `Attribute` adds to it.
    pub fn with_attributes(&self, target: &str, mut parameters: Parameters) -> Parameters {
        let of_target = self.now.attributes.iter().rev().filter(|(name, _)| name == target);
        parameters.shared.extend(of_target.map(|(_, parameter)| parameter.clone()));
        parameters
    }

    /// Adds a shape where it belongs.
    pub fn add_shape(&mut self, parameters: Parameters) {
        let shape = Shape {
            parameters,
            to_world: self.now.transform,
            is_reversed: self.now.is_reversed,
            material: self.now.material.clone(),
            area_light: self.now.area_light,
        };
        match self.object {
            Some(object) => self.world.objects[object].1.push(shape),
            None => self.world.shapes.push(shape),
        }
    }
}
