//! Textures, mixtures and reliefs: what files make of them, and what is wrong with those that make nothing.

use crate::files::{Folder, around, scene_beside};
use glam::Vec3;
use relt::film::Image;
use relt::film::exr_file;
use relt::scene::SceneDescription;
use relt::scene::appearance::Appearance;
use relt::scene::description::Sides;
use relt::scene::textures::{Texture, Varying};

const COLOURS: &[u8] = include_bytes!("../mitsuba/textures/colours.png");
const HUGE: &[u8] = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 70000 +X 70000\n";
const CHECKERS: &str = "<texture type='checkerboard'/>";

/// Pictures of three colours, one not finite, one of a single row.
fn pictures() -> Folder {
    let folder = Folder::new(&[
        ("colours.png", COLOURS),
        ("short.png", &COLOURS[..100]),
        ("huge.hdr", HUGE),
        ("words.png", b"no picture"),
        ("empty.png", b""),
    ]);
    let write = |name: &str, pixels: Vec<[f32; 3]>| {
        let image = Image::new(2, pixels.len() as u32 / 2, pixels);
        exr_file::write(&folder.path(name), &image, &[], &[]).expect("a picture");
    };
    write("bright.exr", vec![[0.5, 0.5, 0.5], [0.1, 7.0, 0.2], [1.0; 3], [0.0; 3]]);
    write("dark.exr", vec![[0.5, 0.5, 0.5], [0.1, -2.0, 0.2], [1.0; 3], [0.0; 3]]);
    write("nan.exr", vec![[0.5, 0.5, 0.5], [0.1, 7.0, 0.2], [1.0; 3], [0.0, f32::NAN, 0.0]]);
    write("row.exr", vec![[0.5; 3]; 2]);
    folder
}

/// The faults that elements, which stand on line 2, give inside a scene that is otherwise right.
fn faults(folder: &Folder, elements: &str) -> Vec<String> {
    let Err(error) = folder.load(&around(elements), &[]) else { panic!("no fault found in\n{elements}") };
    let path = format!("{}:", folder.path("scene.xml").display());
    let inside = folder.path("").display().to_string();
    error.to_string().lines().map(|line| line.replace(&path, "").replace(&inside, "")).collect()
}

/// Elements and what the one fault in them begins with.
#[track_caller]
fn assert_each(cases: &[(&str, &str)]) {
    let folder = pictures();
    for (elements, expected) in cases {
        let found = faults(&folder, elements);
        assert!(
            found.len() == 1 && found[0].starts_with(expected),
            "{elements}\nfound: {found:#?}\nexpected: {expected}"
        );
    }
}

fn bitmap(file: &str) -> String {
    format!("<texture type='bitmap' name='reflectance'><string name='filename'\nvalue='{file}'/></texture>")
}

#[test]
fn pictures_that_cannot_be_read_are_faults() {
    let folder = pictures();
    for (file, expected) in [
        ("none.png", "3:8: none.png: cannot be read: "),
        ("words.png", "3:8: words.png: is no picture that relt reads; known: PNG, JPEG, HDR, OpenEXR"),
        ("empty.png", "3:8: empty.png: is no picture that relt reads; known: PNG, JPEG, HDR, OpenEXR"),
        ("short.png", "3:8: short.png: cannot be decoded: "),
        ("huge.hdr", "3:8: huge.hdr: cannot be decoded: "),
        ("nan.exr", "3:8: nan.exr: the texel at column 1, row 1 is (0, NaN, 0); it must be finite"),
    ] {
        let found = faults(&folder, &format!("<bsdf type='diffuse'>{}</bsdf>", bitmap(file)));
        assert!(found.len() == 1 && found[0].starts_with(expected), "found: {found:#?}\nexpected: {expected}");
    }
}

#[test]
fn values_that_parameters_do_not_take_are_faults() {
    let folder = pictures();
    for (file, expected) in [
        ("bright.exr", "2:22: values of the texture run from 0 to 7; reflectance must be 0 to 1"),
        ("dark.exr", "2:22: values of the texture run from -2 to 1; reflectance must be 0 to 1"),
    ] {
        assert_eq!(faults(&folder, &format!("<bsdf type='diffuse'>{}</bsdf>", bitmap(file))), [expected]);
    }
    let lamp = "<shape type='cube'><emitter type='area'><texture type='bitmap' name='radiance'>\
        <string name='filename' value='FILE'/></texture></emitter></shape>";
    assert!(folder.load(&around(&lamp.replace("FILE", "bright.exr")), &[]).is_ok());
    let expected = "2:41: values of the texture run from -2 to 1; radiance must be not negative";
    assert_eq!(faults(&folder, &lamp.replace("FILE", "dark.exr")), [expected]);
}

#[test]
fn textures_say_what_they_do_not_know() {
    assert_each(&[
        ("<texture type='marble' id='a'/>", "2:16: unknown texture \"marble\"; known: bitmap, checkerboard"),
        ("<texture type='bitmap' id='a'/>", "2:1: texture \"bitmap\" needs the parameter \"filename\""),
        (
            "<texture type='bitmap'><string name='filename' value='colours.png'/>\n<string name='wrap_mode' value='turn'/></texture>",
            "3:33: unknown wrap_mode \"turn\"; known: clamp, mirror, repeat",
        ),
        (
            "<texture type='bitmap'><string name='filename' value='colours.png'/>\n<string name='filter_type' value='sinc'/></texture>",
            "3:35: unknown filter_type \"sinc\"; known: bilinear, nearest",
        ),
        (
            "<bsdf type='dielectric'>\n<texture type='checkerboard' name='int_ior'/></bsdf>",
            "3:1: \"int_ior\" is given as <texture>; accepted: <float>",
        ),
        (
            "<bsdf type='diffuse'>\n<ref name='reflectance' id='none'/></bsdf>",
            "3:1: \"reflectance\" is given as <ref>; accepted: <rgb>, <spectrum>, <float>, <integer>, <texture>",
        ),
    ]);
}

#[test]
fn mixtures_are_made_of_what_can_be_mixed() {
    let nine = (0..8).fold("<bsdf type='diffuse'/>".to_string(), |inner, _| {
        format!("<bsdf type='blendbsdf'><float name='weight' value='0.5'/>{inner}<bsdf type='diffuse'/></bsdf>")
    });
    assert_each(&[
        ("<bsdf type='mask'/>", "2:13: bsdf \"mask\" holds 0 bsdfs; accepted: 1"),
        (
            "<bsdf type='mask'><bsdf type='diffuse'/>\n<float name='opacity' value='1.5'/></bsdf>",
            "3:30: opacity is 1.5; it must lie between 0 and 1",
        ),
        (
            "<bsdf type='blendbsdf'><bsdf type='diffuse'/><bsdf type='diffuse'/></bsdf>",
            "2:13: bsdf \"blendbsdf\" needs the parameter \"weight\"",
        ),
        (
            "<bsdf type='blendbsdf'><float name='weight' value='0.5'/><bsdf type='diffuse'/></bsdf>",
            "2:13: bsdf \"blendbsdf\" holds 1 bsdfs; accepted: 2",
        ),
        (
            "<bsdf type='twosided'>\n<bsdf type='mask'><bsdf type='diffuse'/></bsdf></bsdf>",
            "3:1: bsdf \"twosided\" cannot hold bsdf \"mask\", which transmits light",
        ),
        (
            "<bsdf type='blendbsdf'><float name='weight' value='0.5'/><bsdf type='dielectric'/>\
             <bsdf type='twosided'><bsdf type='diffuse'/></bsdf></bsdf>",
            "2:1: bsdf \"blendbsdf\" cannot blend a \"twosided\" with one that transmits light",
        ),
        (
            "<bsdf type='mask' id='a'>\n<ref id='b'/></bsdf><bsdf type='mask' id='b'>\n<ref id='a'/></bsdf>",
            "4:1: bsdf \"mask\" refers to itself, if by detours",
        ),
        (&nine, "2:1: bsdf \"blendbsdf\" mixes 9 bsdfs; accepted: up to 8"),
    ]);
}

#[test]
fn reliefs_need_one_texture_with_slopes() {
    let nested = "<texture type='bitmap'><string name='filename' value='colours.png'/></texture>";
    let bump = format!("<bsdf type='bumpmap'>{nested}<bsdf type='diffuse'/></bsdf>");
    assert_each(&[
        ("<bsdf type='bumpmap'><bsdf type='diffuse'/></bsdf>", "2:13: bsdf \"bumpmap\" holds 0 textures; accepted: 1"),
        (
            &format!("<bsdf type='bumpmap'>{CHECKERS}<bsdf type='diffuse'/></bsdf>"),
            "2:13: heights have no slope: a bumpmap needs a bitmap whose filter_type is bilinear",
        ),
        (
            &format!("<bsdf type='normalmap'>{CHECKERS}\n{CHECKERS}<bsdf type='diffuse'/></bsdf>"),
            "3:1: bsdf \"normalmap\" holds 2 textures; accepted: 1",
        ),
        (
            &format!("<bsdf type='normalmap'>{nested}{bump}</bsdf>"),
            "2:1: bsdf \"normalmap\" is around another one; only one of them can bend normals",
        ),
    ]);
}

#[test]
fn skies_need_a_picture_and_turn_only() {
    let folder = pictures();
    let sky = |inner: &str| {
        let text = around("").replace("<emitter type='constant'/>", "");
        text.replacen("\n\n", &format!("\n<emitter type='envmap'>{inner}</emitter>\n"), 1)
    };
    let found = |inner: &str| {
        let error = folder.load(&sky(inner), &[]).err().unwrap_or_else(|| panic!("no fault found in\n{inner}"));
        error.to_string().replace(&folder.path("").display().to_string(), "").replace("scene.xml:", "")
    };
    let file = |name: &str| format!("<string name='filename' value='{name}'/>");
    assert!(folder.load(&sky(&file("bright.exr")), &[]).is_ok());
    for (inner, expected) in [
        (String::new(), "2:1: emitter \"envmap\" needs the parameter \"filename\""),
        (file("row.exr"), "2:55: the picture has a single row"),
        (
            file("dark.exr"),
            "2:55: the radiance at column 1, row 0 is [0.1, -2, 0.2]; it must be finite and not negative",
        ),
        (
            file("bright.exr") + "<transform name='to_world'><scale x='2'/></transform>",
            "2:68: to_world of an envmap turns it",
        ),
        (
            file("bright.exr") + "<float name='scale' value='-1'/>",
            "2:95: scale is -1; it must be finite and not negative",
        ),
    ] {
        let found = found(&inner);
        assert!(found.starts_with(expected), "found: {found}\nexpected: {expected}");
    }
    let two = "<emitter type='envmap'><string name='filename' value='bright.exr'/></emitter>";
    assert_each(&[(two, "3:29: the scene has more than one emitter that surrounds it")]);
}

/// The appearance of the front and of the back of the first shape.
fn sides(scene: &SceneDescription) -> [&Appearance; 2] {
    match scene.shapes[0].sides {
        Sides::One(one) => [one; 2],
        Sides::Two { front, back } => [front, back],
    }
    .map(|side| &scene.appearances[side as usize])
}

fn of_bsdf(bsdf: &str) -> SceneDescription {
    scene_beside(&[("colours.png", COLOURS)], &format!("<shape type='cube'>{bsdf}</shape>"))
}

#[test]
fn textures_take_the_place_of_parameters() {
    let scene = of_bsdf(&format!("<bsdf type='diffuse'>{}</bsdf>", bitmap("colours.png")));
    let [front, _] = sides(&scene);
    let [part] = front.parts() else { panic!("{front:?}") };
    assert!(matches!(&part.textures[..], [(0, texture)] if matches!(**texture, Texture::Bitmap(_))));
    // the same by reference, and one texture for two users
    let texture = bitmap("colours.png").replace("name='reflectance'", "id='t'");
    let user = "<shape type='cube'><bsdf type='diffuse'><ref name='reflectance' id='t'/></bsdf></shape>";
    let scene = scene_beside(&[("colours.png", COLOURS)], &format!("{texture}{user}{user}"));
    let pointers = scene.appearances.iter().map(|a| std::sync::Arc::as_ptr(&a.parts()[0].textures[0].1));
    let pointers: Vec<_> = pointers.collect();
    assert!(pointers.len() == 2 && pointers[0] == pointers[1]);
}

#[test]
fn masks_may_be_around_two_sides() {
    let scene = of_bsdf(
        "<bsdf type='mask'><float name='opacity' value='0.25'/><bsdf type='twosided'>\
         <bsdf type='diffuse'/><bsdf type='conductor'/></bsdf></bsdf>",
    );
    let names = sides(&scene).map(|side| side.parts().iter().map(|part| part.material.name()).collect::<Vec<_>>());
    assert_eq!(names, [["null", "diffuse"], ["null", "conductor"]]);
    let share = &sides(&scene)[0].parts()[0].shares[0];
    assert!(share.value == Varying::Constant(Vec3::splat(0.25)) && share.is_rest);
}

#[test]
fn a_blend_of_two_sides_and_one_is_black_where_the_one_is() {
    let scene = of_bsdf(
        "<bsdf type='blendbsdf'><float name='weight' value='0.5'/><bsdf type='conductor'/>\
         <bsdf type='twosided'><bsdf type='plastic'/></bsdf></bsdf>",
    );
    let names = sides(&scene).map(|side| side.parts().iter().map(|part| part.material.name()).collect::<Vec<_>>());
    assert_eq!(names, [["conductor", "plastic"], ["diffuse", "plastic"]]);
}
