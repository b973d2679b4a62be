//! `shapegroup`: shapes that are there only where an `instance` places them; `instance`: one such place, a `ref` to a group
//! and `to_world`.
//!
//! As in Mitsuba, shapes of a group do not emit, and a group holds no instances.

use std::collections::HashMap;

use glam::Affine3A;

use super::super::document::Element;
use super::super::ids::Ids;
use super::super::parameters::ElementParameters;
use crate::load::faults::Faults;
use crate::scene::description::InstanceDescription;
use crate::scene::parameters::Parameters;

/// The `type` of a group.
pub const GROUP: &str = "shapegroup";
/// The `type` of a place of one.
pub const INSTANCE: &str = "instance";

/// Groups that instances place, and the places.
pub struct Layout<'a> {
    /// The groups' elements.
    pub groups: Vec<&'a Element>,
    /// Places, with indices into `groups`.
    pub instances: Vec<InstanceDescription>,
    /// One sentence for each group without a place.
    pub warnings: Vec<String>,
}

/// Reads all instances among a scene's shapes.
pub fn layout<'a>(elements: &[&'a Element], ids: &Ids<'a>, faults: &'a Faults) -> Layout<'a> {
    let mut layout = Layout { groups: Vec::new(), instances: Vec::new(), warnings: Vec::new() };
    let mut known: HashMap<usize, usize> = HashMap::new(); // indices of groups, by where they stand
    for element in elements.iter().filter(|element| element.value("type") == INSTANCE) {
        let Some((group, to_world)) = instance(element, ids, faults) else { continue };
        let index = *known.entry(group.span.start).or_insert_with(|| {
            layout.groups.push(group);
            layout.groups.len() - 1
        });
        layout.instances.push(InstanceDescription { group: index, to_world });
    }
    for element in elements.iter().filter(|element| element.value("type") == GROUP) {
        if !known.contains_key(&element.span.start) {
            let name = element.attribute("id").map_or("without an id".to_owned(), |id| format!("{:?}", id.value));
            layout.warnings.push(format!("the shapegroup {name} is placed by no instance and left out"));
            members(element, faults); // it may have faults as well
        }
    }
    layout
}

/// The group that an instance places, and where.
fn instance<'a>(element: &'a Element, ids: &Ids<'a>, faults: &'a Faults) -> Option<(&'a Element, Affine3A)> {
    let mut p = ElementParameters::new(element, faults);
    let to_world = p.to_world();
    let references = p.nested(&["ref"]);
    p.finish();
    if let Some(surplus) = references.get(1) {
        faults.at(&surplus.span, "the instance places more than one group");
    }
    let Some(reference) = references.first() else {
        faults.at(&element.span, format!("the instance places nothing: it needs a <ref> to a shape {GROUP:?}"));
        return None;
    };
    let group = ids.referred(reference, "shape", faults)?;
    if group.value("type") != GROUP {
        let message =
            format!("an instance places a shape {GROUP:?}; {:?} is {}", reference.value("id"), group.described());
        faults.at(reference.span_of("id"), message);
        return None;
    }
    Some((group, to_world))
}

/// The shapes of a group, those that may be in one.
pub fn members<'a>(group: &'a Element, faults: &'a Faults) -> Vec<&'a Element> {
    let mut p = ElementParameters::new(group, faults);
    let mut members = p.nested(&["shape"]);
    p.finish();
    if members.is_empty() {
        faults.at(group.span_of("type"), "the shapegroup holds no shape");
    }
    members.retain(|member| {
        let kind = member.value("type");
        let may_be = kind != GROUP && kind != INSTANCE;
        if !may_be {
            faults.at(member.span_of("type"), format!("a shapegroup cannot hold a shape {kind:?}"));
        }
        for emitter in member.children.iter().filter(|child| child.tag == "emitter") {
            faults.at(&emitter.span, "a shape in a shapegroup cannot emit");
        }
        may_be
    });
    members
}
