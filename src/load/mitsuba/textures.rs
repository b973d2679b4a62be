//! `<texture>`: values that vary over surfaces, and the pictures they are made of.

use std::cell::RefCell;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::Folder;
use super::document::{Element, Kind};
use super::ids::Ids;
use super::parameters::ElementParameters;
use crate::load::faults::Faults;
use crate::load::images::Images;
use crate::scene::textures::{self, Image, Texture};

/// Reads each texture once.
pub struct Textures<'a> {
    ids: &'a Ids<'a>,
    faults: &'a Faults,
    /// Where pictures are.
    pub folder: &'a Folder,
    images: Images,
    read: RefCell<HashMap<*const Element, Option<Arc<Texture>>>>,
}

impl<'a> Textures<'a> {
    /// Of a scene file in that folder; reads the pictures that it names, in parallel.
    pub fn new(scene: &'a Element, ids: &'a Ids<'a>, folder: &'a Folder, faults: &'a Faults) -> Self {
        let mut paths = Vec::new();
        gather(scene, folder, &mut paths);
        paths.sort();
        paths.dedup();
        Textures { ids, faults, folder, images: Images::read(paths), read: RefCell::default() }
    }

    /// The texture of a `texture` element, or of the one that a `ref` names.
    pub fn get(&self, element: &'a Element) -> Option<Arc<Texture>> {
        let element = match element.kind() {
            Kind::Reference => self.ids.referred(element, "texture", self.faults)?,
            _ => element,
        };
        let key = std::ptr::from_ref(element);
        if let Some(texture) = self.read.borrow().get(&key) {
            return texture.clone();
        }
        let texture = self.texture(element).map(Arc::new);
        self.read.borrow_mut().insert(key, texture.clone());
        texture
    }

    /// Reads an element.
    fn texture(&self, element: &'a Element) -> Option<Texture> {
        let kind = element.attribute("type")?;
        let mut p = ElementParameters::new(element, self.faults).with_textures(self);
        let Some(texture) = textures::read(&kind.value, &mut p) else {
            self.faults.unknown(&kind.span, "texture", &kind.value, textures::KNOWN);
            return None;
        };
        p.finish();
        texture
    }

    /// The picture in a file, or in a sentence why there is none.
    pub fn image(&self, path: &Path) -> Result<Arc<Image>, String> {
        self.images.get(path)
    }

    /// Whether an element is a texture or refers to one.
    pub fn is_texture(&self, element: &Element) -> bool {
        match element.kind() {
            Kind::Reference => self.ids.tag_of(element.value("id")) == Some("texture"),
            _ => element.tag == "texture",
        }
    }
}

/// The picture files that an element and all in it name.
fn gather(element: &Element, folder: &Folder, paths: &mut Vec<PathBuf>) {
    let is_picture = matches!((element.tag, element.value("type")), ("texture", "bitmap") | ("emitter", "envmap"));
    let names = element.children.iter().filter(|child| is_picture && child.tag == "string");
    let names = names.filter(|child| child.value("name") == "filename").filter_map(|child| child.attribute("value"));
    paths.extend(names.filter_map(|name| folder.file(name).ok())); // those that are not read are faults later
    for child in &element.children {
        gather(child, folder, paths);
    }
}
