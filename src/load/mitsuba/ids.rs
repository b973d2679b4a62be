//! Elements by `id`.

use std::collections::HashMap;

use super::document::Element;
use crate::load::faults::{Faults, list};

/// All elements with an `id`, wherever they are.
pub struct Ids<'a>(HashMap<&'a str, &'a Element>);

impl<'a> Ids<'a> {
    /// Of a scene and all below it; an `id` given twice is a fault.
    pub fn new(scene: &'a Element, faults: &Faults) -> Self {
        let mut ids = Ids(HashMap::new());
        ids.gather(scene, faults);
        ids
    }

    fn gather(&mut self, element: &'a Element, faults: &Faults) {
        if element.tag != "ref"
            && let Some(id) = element.attribute("id")
            && self.0.insert(&id.value, element).is_some()
        {
            faults.at(&id.span, format!("the id {:?} is given twice", id.value));
        }
        for child in &element.children {
            self.gather(child, faults);
        }
    }

    /// The tag of the element with that `id`.
    pub fn tag_of(&self, id: &str) -> Option<&'static str> {
        self.0.get(id).map(|element| element.tag)
    }

    /// The element of the expected tag that a `ref` names.
    pub fn referred(&self, reference: &Element, tag: &str, faults: &Faults) -> Option<&'a Element> {
        let id = reference.attribute("id")?;
        if self.0.get(id.value.as_str()).is_none_or(|element| element.tag != tag) && faults.is_full() {
            return None; // names that are known need not be listed once more
        }
        let known = || {
            let known: Vec<_> = self.0.iter().filter(|(_, e)| e.tag == tag).map(|(id, _)| *id).collect();
            (super::did_you_mean(&id.value, &known), list(&known))
        };
        match self.0.get(id.value.as_str()) {
            Some(element) if element.tag == tag => Some(element),
            Some(other) => {
                faults.at(
                    &id.span,
                    format!("{:?} refers to a <{}>; expected a <{tag}>; {}", id.value, other.tag, known().1),
                );
                None
            }
            None => {
                let (near, known) = known();
                faults.at(&id.span, format!("no <{tag}> has the id {:?}{near}; {known}", id.value));
                None
            }
        }
    }
}
