//! One function a directive, and the table of them.

use glam::{DAffine3, DMat3, DMat4, DVec3};

use super::parameters::Parameters;
use super::state::{Saved, State};
use super::world::{Instance, MaterialReference, TextureKind};
use crate::convert::notes::{Notes, Place};

/// What a directive is followed by, and what it does.
pub enum Action {
    /// Another file's name.
    Include,
    /// Nothing.
    Plain(fn(&mut State, &Place, &Notes)),
    /// Numbers.
    Numbers(usize, fn(&mut State, &[f64], &Place, &Notes)),
    /// A name.
    Name(fn(&mut State, String, Place, &Notes)),
    /// A word without quotes.
    Word(fn(&mut State, &str, &Place, &Notes)),
    /// One name or two.
    Names(fn(&mut State, &Place, &Notes)),
    /// A name and parameters.
    List(fn(&mut State, Parameters, &Notes)),
    /// A name, a type, a class and parameters.
    Texture,
    /// Parameters.
    Option,
}

use Action::{List, Name, Names, Numbers, Plain, Word};

/// Every directive.
pub const DIRECTIVES: &[(&str, Action)] = &[
    ("Include", Action::Include),
    ("Import", Action::Include),
    ("Option", Action::Option),
    ("Texture", Action::Texture),
    ("Identity", Plain(|state, _, _| state.set(DAffine3::IDENTITY))),
    ("Translate", Numbers(3, |state, v, _, _| state.apply(DAffine3::from_translation(DVec3::from_slice(v))))),
    ("Scale", Numbers(3, scale)),
    ("Rotate", Numbers(4, rotate)),
    ("LookAt", Numbers(9, look_at)),
    (
        "Transform",
        Numbers(16, |state, v, place, notes| {
            if let Some(map) = affine(v, place, notes) {
                state.set(map);
            }
        }),
    ),
    (
        "ConcatTransform",
        Numbers(16, |state, v, place, notes| {
            if let Some(map) = affine(v, place, notes) {
                state.apply(map);
            }
        }),
    ),
    (
        "CoordinateSystem",
        Name(|state, name, _, _| {
            state.systems.insert(name, state.now.transform);
        }),
    ),
    ("CoordSysTransform", Name(coord_sys_transform)),
    ("ActiveTransform", Word(active_transform)),
    ("TransformTimes", Numbers(2, |_, _, _, _| {})),
    ("ReverseOrientation", Plain(|state, _, _| state.now.is_reversed = !state.now.is_reversed)),
    ("ColorSpace", Name(color_space)),
    ("AttributeBegin", Plain(|state, place, notes| save(state, Saved::Attribute, place, notes))),
    ("AttributeEnd", Plain(|state, place, notes| end(state, Saved::Attribute, place, notes))),
    ("TransformBegin", Plain(|state, place, notes| save(state, Saved::Transform, place, notes))),
    ("TransformEnd", Plain(|state, place, notes| end(state, Saved::Transform, place, notes))),
    ("ObjectBegin", Name(object_begin)),
    ("ObjectEnd", Plain(|state, place, notes| end(state, Saved::Object, place, notes))),
    ("ObjectInstance", Name(object_instance)),
    ("WorldBegin", Plain(world_begin)),
    ("Attribute", List(attribute)),
    ("Camera", List(camera)),
    ("Film", List(|state, list, _| state.world.film = Some(list))),
    ("PixelFilter", List(|state, list, _| state.world.filter = Some(list))),
    ("Sampler", List(|state, list, _| state.world.sampler = Some(list))),
    ("Integrator", List(|state, list, _| state.world.integrator = Some(list))),
    ("Accelerator", List(|_, _, _| {})),
    ("Material", List(material)),
    ("MakeNamedMaterial", List(make_named_material)),
    ("NamedMaterial", Name(|state, name, place, _| state.now.material = MaterialReference::Named(name, place))),
    (
        "MakeNamedMedium",
        List(|_, list, notes| {
            notes.left_out(&list.place, format!("medium {:?}: neither renderer's path tracer has media", list.kind));
        }),
    ),
    (
        "MediumInterface",
        Names(|_, place, notes| {
            notes.left_out(place, "MediumInterface: neither renderer's path tracer has media");
        }),
    ),
    (
        "Shape",
        List(|state, list, _| {
            let list = state.with_attributes("shape", list);
            state.add_shape(list);
        }),
    ),
    (
        "LightSource",
        List(|state, list, _| {
            let list = state.with_attributes("light", list);
            state.world.lights.push((list, state.now.transform));
        }),
    ),
    (
        "AreaLightSource",
        List(|state, list, _| {
            let list = state.with_attributes("light", list);
            state.world.area_lights.push(list);
            state.now.area_light = Some(state.world.area_lights.len() - 1);
        }),
    ),
];

fn scale(state: &mut State, v: &[f64], place: &Place, notes: &Notes) {
    if v.contains(&0.0) {
        return notes.fault(place, "Scale: a factor of 0 flattens space");
    }
    state.apply(DAffine3::from_scale(DVec3::from_slice(v)));
}

/// By degrees around an axis of any length.
fn rotate(state: &mut State, v: &[f64], place: &Place, notes: &Notes) {
    match DVec3::from_slice(&v[1..]).try_normalize() {
        Some(axis) => state.apply(DAffine3::from_axis_angle(axis, v[0].to_radians())),
        None => notes.fault(place, "Rotate: the axis has no length"),
    }
}

/// From the world to a camera at the first point that looks at the second, the third up. Its x is to the right.
fn look_at(state: &mut State, v: &[f64], place: &Place, notes: &Notes) {
    let [eye, target, up] = [0, 3, 6].map(|i| DVec3::from_slice(&v[i..i + 3]));
    let Some(forward) = (target - eye).try_normalize() else {
        return notes.fault(place, "LookAt: the point looked at is where the eye is");
    };
    let Some(right) = up.normalize_or_zero().cross(forward).try_normalize() else {
        return notes.fault(place, "LookAt: up is the direction of view, or has no length");
    };
    let to_world = DMat3::from_cols(right, forward.cross(right), forward);
    state.apply(DAffine3::from_mat3_translation(to_world, eye).inverse());
}

/// Sixteen numbers, column by column.
fn affine(v: &[f64], place: &Place, notes: &Notes) -> Option<DAffine3> {
    let matrix = DMat4::from_cols_slice(v);
    if matrix.row(3).to_array() != [0.0, 0.0, 0.0, 1.0] {
        notes.fault(place, format!("the transform's last row is {}; only 0 0 0 1 can be converted", matrix.row(3)));
        return None;
    }
    let map = DAffine3::from_mat4(matrix);
    let columns = map.matrix3;
    let volume = columns.x_axis.length() * columns.y_axis.length() * columns.z_axis.length();
    if columns.determinant().abs() <= 1e-9 * volume {
        notes.fault(place, "the transform is singular: it flattens space");
        return None;
    }
    Some(map)
}

fn coord_sys_transform(state: &mut State, name: String, place: Place, notes: &Notes) {
    match state.systems.get(&name) {
        Some(map) => state.set(*map),
        None => {
            let known: Vec<&str> = state.systems.keys().map(String::as_str).collect();
            notes.fault(&place, format!("no coordinate system {name:?}; {}", crate::load::faults::list(&known)));
        }
    }
}

/// Which end of a motion transforms act on from here on.
fn active_transform(state: &mut State, which: &str, place: &Place, notes: &Notes) {
    match which {
        "All" | "StartTime" => state.now.is_end_of_motion = false,
        "EndTime" => {
            state.now.is_end_of_motion = true;
            notes.left_out(place, "motion: everything stays where it is at its start");
        }
        other => notes.fault(place, format!("ActiveTransform {other:?}; known: All, EndTime, StartTime")),
    }
}

fn color_space(_: &mut State, name: String, place: Place, notes: &Notes) {
    if name != "srgb" {
        notes.left_out(&place, format!("ColorSpace {name:?}: colours are taken as sRGB's"));
    }
}

/// Most states that are saved at once, and most parameters that `Attribute` adds at once: each of those holds these.
const MOST_SAVED: usize = 1024;
const MOST_ATTRIBUTES: usize = 256;

/// Saves the state up to the directive's end.
fn save(state: &mut State, what: Saved, place: &Place, notes: &Notes) {
    if state.saved.len() == MOST_SAVED {
        return notes.fault(place, format!("{what:?}Begin inside of {MOST_SAVED} others, which is the most accepted"));
    }
    state.saved.push((what, state.now.clone()));
}

/// Goes back to what was saved.
fn end(state: &mut State, what: Saved, place: &Place, notes: &Notes) {
    match state.saved.last() {
        Some((saved, _)) if *saved == what => {}
        Some((other, _)) => return notes.fault(place, format!("{what:?}End where {other:?}End is due")),
        None => return notes.fault(place, format!("{what:?}End without {what:?}Begin")),
    }
    let (_, graphics) = state.saved.pop().expect("there is one, as just seen");
    match what {
        Saved::Transform => {
            state.now.transform = graphics.transform;
            state.now.is_end_of_motion = graphics.is_end_of_motion;
        }
        Saved::Attribute => state.now = graphics,
        Saved::Object => {
            state.now = graphics;
            state.object = None;
        }
    }
}

fn object_begin(state: &mut State, name: String, place: Place, notes: &Notes) {
    if state.object.is_some() {
        return notes.fault(&place, "ObjectBegin inside of another");
    }
    if !state.objects.insert(name.clone()) {
        return notes.fault(&place, format!("the object {name:?} is given twice"));
    }
    save(state, Saved::Object, &place, notes);
    state.world.objects.push((name, Vec::new()));
    state.object = Some(state.world.objects.len() - 1);
}

fn object_instance(state: &mut State, name: String, place: Place, notes: &Notes) {
    if state.object.is_some() {
        return notes.fault(&place, "ObjectInstance inside of an object");
    }
    state.world.instances.push(Instance { name, place, to_world: state.now.transform });
}

fn world_begin(state: &mut State, place: &Place, notes: &Notes) {
    if std::mem::replace(&mut state.is_in_world, true) {
        notes.fault(place, "WorldBegin is given twice");
    }
    state.now.transform = DAffine3::IDENTITY;
    state.now.is_end_of_motion = false;
    state.systems.insert("world".into(), DAffine3::IDENTITY);
}

/// Parameters for all directives of a kind that follow.
fn attribute(state: &mut State, list: Parameters, notes: &Notes) {
    let known = ["shape", "light", "material", "medium", "texture"];
    if !known.contains(&&list.kind[..]) {
        return notes
            .fault(&list.place, format!("Attribute of {:?}; {}", list.kind, crate::load::faults::list(&known)));
    }
    if state.now.attributes.len() + list.list.len() > MOST_ATTRIBUTES {
        let message =
            format!("Attribute: with these it adds more than {MOST_ATTRIBUTES} parameters, which is the most accepted");
        return notes.fault(&list.place, message);
    }
    state.now.attributes.extend(list.list.into_iter().map(|parameter| (list.kind.clone(), parameter)));
}

fn camera(state: &mut State, list: Parameters, _: &Notes) {
    state.systems.insert("camera".into(), state.now.transform.inverse());
    state.world.camera = Some((list, state.now.transform));
}

fn material(state: &mut State, list: Parameters, _: &Notes) {
    let list = state.with_attributes("material", list);
    state.world.materials.push(list);
    state.now.material = MaterialReference::Index(state.world.materials.len() - 1);
}

/// The list's kind is the material's name, and its parameter `type` the kind.
fn make_named_material(state: &mut State, list: Parameters, notes: &Notes) {
    let mut list = state.with_attributes("material", list);
    let name = list.kind.clone();
    match list.string("type").map(str::to_owned) {
        Some(kind) => list.kind = kind,
        None => return notes.fault(&list.place, format!("the material {name:?} needs a \"string type\"")),
    }
    state.world.materials.push(list);
    let index = state.world.materials.len() - 1;
    if state.world.named_materials.insert(name.clone(), index).is_some() {
        notes.fault(&state.world.materials[index].place, format!("the material {name:?} is given twice"));
    }
}

/// A texture by name.
pub fn texture(
    state: &mut State,
    name: String,
    (of, of_place): (&str, Place),
    list: Parameters,
) -> Result<(), (Place, String)> {
    let kind = match of {
        "float" => TextureKind::Float,
        "spectrum" => TextureKind::Spectrum,
        other => return Err((of_place, format!("a texture of {other:?}; known: float, spectrum"))),
    };
    let list = state.with_attributes("texture", list);
    let place = list.place.clone();
    match state.world.textures.insert((name.clone(), kind), list) {
        None => Ok(()),
        Some(_) => Err((place, format!("the texture {name:?} is given twice"))),
    }
}
