//! Groups of shapes, and the places that instances give them.

use glam::{Affine3A, Vec3};
use relt::scene::Features;

use crate::files::{Folder, around, scene_with};

const GROUP: &str = "<shape type='shapegroup' id='pair'><shape type='sphere'/><shape type='cube' id='block'/></shape>";

#[test]
fn groups_are_read_once_and_placed_as_often_as_instances_say() {
    let scene = scene_with(&format!(
        "<shape type='instance'><ref id='pair'/></shape>
        <shape type='rectangle'/>
        {GROUP}
        <shape type='instance'><ref name='group' id='pair'/>
        <transform name='to_world'><scale x='-2'/><translate y='3'/></transform></shape>"
    ));
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    let names: Vec<_> = scene.shapes.iter().map(|shape| shape.name.as_str()).collect();
    assert_eq!(names, ["rectangle 2"], "shapes of groups are not in the world");
    assert_eq!(scene.groups.len(), 1);
    assert_eq!(scene.groups[0].name, "pair");
    let names: Vec<_> = scene.groups[0].shapes.iter().map(|shape| shape.name.as_str()).collect();
    assert_eq!(names, ["sphere 1", "block"]);
    let places: Vec<_> = scene.instances.iter().map(|instance| (instance.group, instance.to_world)).collect();
    let second = Affine3A::from_translation(3.0 * Vec3::Y) * Affine3A::from_scale(Vec3::new(-2.0, 1.0, 1.0));
    assert_eq!(places, [(0, Affine3A::IDENTITY), (0, second)]);
    let features = Features::of(&scene);
    assert_eq!((features.instances, features.shapes.spheres, features.shapes.flat_meshes), (2, 1, 2));
    assert_eq!(features.triangles, 12 + 2, "those of a group once");
    assert!(features.beyond_diffuse().contains(&"instances".to_owned()), "{:?}", features.beyond_diffuse());
}

#[test]
fn materials_are_shared_between_groups_and_the_world() {
    let scene = scene_with(
        "<bsdf type='conductor' id='gold'/>
        <shape type='shapegroup' id='g'><shape type='sphere'><ref id='gold'/></shape></shape>
        <shape type='sphere'><ref id='gold'/></shape><shape type='instance'><ref id='g'/></shape>",
    );
    assert_eq!(scene.appearances.len(), 1);
    assert_eq!(scene.shapes[0].sides, scene.groups[0].shapes[0].sides);
}

#[test]
fn a_group_without_a_place_is_left_out_with_a_warning() {
    let missing =
        "<shape type='shapegroup' id='a'><shape type='obj'><string name='filename' value='none.obj'/></shape></shape>";
    let scene = scene_with(missing);
    assert!(scene.groups.is_empty() && scene.shapes.is_empty());
    assert_eq!(scene.warnings, ["the shapegroup \"a\" is placed by no instance and left out"]);
}

#[test]
fn groups_and_instances_that_make_no_sense_are_faults() {
    let folder = Folder::new(&[]);
    for (elements, expected) in [
        ("<shape type='instance'/>", "2:1: the instance places nothing: it needs a <ref> to a shape \"shapegroup\""),
        (
            "<shape type='instance'>\n<ref id='b'/></shape><shape type='sphere' id='b'/>",
            "3:10: an instance places a shape \"shapegroup\"; \"b\" is shape \"sphere\"",
        ),
        (
            "<shape type='instance'><ref id='pair'/>\n<shape type='cube'/></shape>",
            "3:1: shape \"instance\" cannot hold a <shape>",
        ),
        (
            "<shape type='instance'>\n<ref id='pear'/></shape>",
            "3:10: no <shape> has the id \"pear\" (did you mean \"pair\"?)",
        ),
        (
            "<bsdf type='diffuse' id='b'/><shape type='instance'>\n<ref id='b'/></shape>",
            "3:10: \"b\" refers to a <bsdf>; expected a <shape>",
        ),
        (
            "<shape type='instance'><ref id='pair'/>\n<ref id='pair'/></shape>",
            "3:1: the instance places more than one group",
        ),
        (
            "<shape type='instance'><ref id='pair'/>\n<emitter type='area'/></shape>",
            "3:1: shape \"instance\" cannot hold a <emitter>",
        ),
        (
            "<shape type='instance'><ref id='pair'/>\n<float name='scale' value='2'/></shape>",
            "3:14: unknown parameter \"scale\" of shape \"instance\"; known: to_world",
        ),
        (
            "<shape type='instance'><ref id='pair'/>\n<transform name='to_world'><scale z='0'/></transform></shape>",
            "3:1: the transform is singular",
        ),
        ("<shape type='shapegroup'/>", "2:14: the shapegroup holds no shape"),
        (
            "<shape type='shapegroup'>\n<shape type='sphere'>\n<emitter type='area'/></shape></shape>",
            "4:1: a shape in a shapegroup cannot emit",
        ),
        (
            "<shape type='shapegroup'>\n<shape type='instance'><ref id='pair'/></shape></shape>",
            "3:14: a shapegroup cannot hold a shape \"instance\"",
        ),
        (
            "<shape type='shapegroup'>\n<shape type='shapegroup'><shape type='cube'/></shape></shape>",
            "3:14: a shapegroup cannot hold a shape \"shapegroup\"",
        ),
        (
            "<shape type='shapegroup'><shape type='cube'/>\n<bsdf type='diffuse'/></shape>",
            "3:1: shape \"shapegroup\" cannot hold a <bsdf>",
        ),
        (
            "<shape type='instance'><ref id='c'/></shape><shape type='shapegroup' id='c'>\n<shape type='sfere'/></shape>",
            "3:14: unknown shape \"sfere\" (did you mean \"sphere\"?)",
        ),
    ] {
        // the group of these tests, in use, behind what is tested
        let text = around(&format!("{elements}{GROUP}<shape type='instance'><ref id='pair'/></shape>"));
        let error = folder.load(&text, &[]).expect_err(elements).to_string();
        let lines: Vec<_> = error.lines().map(|line| line.split_once("scene.xml:").unwrap().1).collect();
        assert!(lines.len() == 1 && lines[0].starts_with(expected), "{elements}\n{lines:#?}\nexpected: {expected}");
    }
}
