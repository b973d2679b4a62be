//! What a pbrt file describes, before any of it is converted.

use std::collections::HashMap;

use glam::DAffine3;

use super::parameters::Parameters;
use crate::convert::notes::Place;

/// A scene as the directives leave it.
#[derive(Debug, Default)]
pub struct World {
    /// `Camera`, and the map from the world to it.
    pub camera: Option<(Parameters, DAffine3)>,
    /// `Film`.
    pub film: Option<Parameters>,
    /// `PixelFilter`.
    pub filter: Option<Parameters>,
    /// `Sampler`.
    pub sampler: Option<Parameters>,
    /// `Integrator`.
    pub integrator: Option<Parameters>,
    /// Every `Material`, named or not.
    pub materials: Vec<Parameters>,
    /// Named ones among them.
    pub named_materials: HashMap<String, usize>,
    /// Textures of numbers and of colours, by name.
    pub textures: HashMap<(String, TextureKind), Parameters>,
    /// Every `AreaLightSource`.
    pub area_lights: Vec<Parameters>,
    /// `LightSource`, each with the map from its own coordinates to the world.
    pub lights: Vec<(Parameters, DAffine3)>,
    /// Shapes in the world.
    pub shapes: Vec<Shape>,
    /// What is between `ObjectBegin` and `ObjectEnd`, by name, in the order of the file.
    pub objects: Vec<(String, Vec<Shape>)>,
    /// `ObjectInstance`.
    pub instances: Vec<Instance>,
    /// Where the file begins, for faults of it as a whole.
    pub start: Option<Place>,
}

/// What a texture is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum TextureKind {
    /// Numbers.
    Float,
    /// Colours.
    Spectrum,
}

/// A shape in its surroundings.
#[derive(Clone, Debug)]
pub struct Shape {
    /// `Shape`.
    pub parameters: Parameters,
    /// Its own coordinates to those around it.
    pub to_world: DAffine3,
    /// After `ReverseOrientation`.
    pub is_reversed: bool,
    /// What it is made of.
    pub material: MaterialReference,
    /// Index into [`World::area_lights`].
    pub area_light: Option<usize>,
}

/// A copy of an object.
#[derive(Clone, Debug)]
pub struct Instance {
    /// The object's name.
    pub name: String,
    /// Where it stands in the file.
    pub place: Place,
    /// The object's coordinates to the world.
    pub to_world: DAffine3,
}

/// A material by number or by name.
#[derive(Clone, Debug, PartialEq)]
pub enum MaterialReference {
    /// Where nothing was said: diffuse, one half.
    Default,
    /// Index into [`World::materials`].
    Index(usize),
    /// By a name that may be given later.
    Named(String, Place),
}
