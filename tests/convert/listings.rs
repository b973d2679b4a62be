//! What is said: every loss and every change with its place, and faults of the input.

use relt::convert::{ConvertError, Kind, Report};

use crate::support::Folder;

/// The notes of a report, `file:line:column: kind: message`.
fn notes(report: &Report) -> Vec<String> {
    let name = |path: &std::path::Path| path.file_name().unwrap().to_string_lossy().into_owned();
    let shown = report.notes.iter().map(|note| {
        let text = note.to_string();
        text.replacen(&note.path.display().to_string(), &name(&note.path), 1)
    });
    shown.collect()
}

/// Notes that begin like this, in this order, and no others.
#[track_caller]
fn assert_notes(report: &Report, expected: &[&str]) {
    let found = notes(report);
    let is_same = found.len() == expected.len() && found.iter().zip(expected).all(|(f, e)| f.starts_with(e));
    assert!(is_same, "found: {found:#?}\nexpected: {expected:#?}");
}

#[test]
fn all_that_an_old_mitsuba_scene_loses_is_listed() {
    let (report, _) = Folder::new().convert("mitsuba/everything.xml").unwrap();
    assert_notes(
        &report,
        &[
            "everything.xml:6:21: changed: integrator \"bdpt\" becomes \"path\"",
            "everything.xml:15:17: changed: film \"ldrfilm\" becomes \"hdrfilm\"",
            "everything.xml:20:7: left out: gamma of film \"ldrfilm\"",
            "everything.xml:23:20: changed: sampler \"ldsampler\" becomes \"independent\"",
            "everything.xml:52:17: changed: phong becomes a blend of diffuse and of roughconductor",
            "everything.xml:59:17: changed: reflectances of sum 1.156 are scaled to 0.99",
            "everything.xml:59:17: changed: ward (ward-duer) becomes a blend",
            "everything.xml:67:78: changed: distribution \"phong\" becomes \"beckmann\"",
            "everything.xml:95:17: changed: the picture of heights is linear between its pixels",
            "everything.xml:100:108: left out: alpha of bsdf \"roughdiffuse\"",
            "everything.xml:107:17: left out: the coat of bsdf \"coating\"",
            "everything.xml:114:16: left out: shape \"heightfield\"",
            "everything.xml:126:18: left out: emitter \"sunsky\"",
            "everything.xml:127:3: left out: medium \"homogeneous\"",
        ],
    );
}

#[test]
fn all_that_a_pbrt_scene_loses_is_listed() {
    let (report, _) = Folder::new().convert("pbrt/everything.pbrt").unwrap();
    assert_notes(
        &report,
        &[
            "everything.pbrt:2:9: left out: Option seed",
            "everything.pbrt:3:13: left out: ColorSpace \"rec2020\"",
            "everything.pbrt:7:4: left out: the window's distance from the axis",
            "everything.pbrt:8:7: changed: the film's gain of 2",
            "everything.pbrt:10:10: changed: sampler \"zsobol\" becomes \"independent\"",
            "everything.pbrt:11:13: changed: integrator \"bdpt\" becomes \"path\"",
            "everything.pbrt:11:41: left out: regularize of Integrator \"bdpt\"",
            "everything.pbrt:21:30: left out: texture \"marble\"",
            "everything.pbrt:26:20: changed: a rough coat on a diffuse base becomes roughplastic",
            "everything.pbrt:59:13: changed: what a diffusetransmission reflects differs",
            "everything.pbrt:61:10: changed: a sphere that is partial, stretched or textured in its own way becomes a mesh",
            "everything.pbrt:64:26: changed: eta: one refractive index for all colours",
            "everything.pbrt:67:10: changed: a sphere that is partial, stretched or textured in its own way becomes a mesh",
            "everything.pbrt:73:10: changed: a cylinder that is partial, stretched or textured in its own way becomes a mesh",
            "everything.pbrt:81:13: left out: the coat of a coatedconductor",
            "everything.pbrt:90:10: left out: subdivision",
            "everything.pbrt:99:10: left out: shape \"curve\"",
            "lights.pbrt:7:14: changed: between its two cones the spot falls off linearly",
            "lights.pbrt:9:14: left out: light source \"goniometric\"",
        ],
    );
}

#[test]
fn parameters_that_nothing_knows_are_listed() {
    let folder = Folder::new();
    let text = "<scene version='0.6.0'>\n<shape type='sphere'><float name='raduis' value='2'/></shape>\n</scene>";
    let (report, _) = folder.convert_text("mitsuba/case.xml", text).unwrap();
    assert_notes(
        &report,
        &["case.xml:2:22: left out: raduis of shape \"sphere\": no such parameter is known (did you mean \"radius\"?)"],
    );
    let text = "Camera \"perspective\" WorldBegin\nShape \"sphere\" \"float raduis\" 2 \"integer radius\" 3";
    let (report, _) = folder.convert_text("pbrt/case.pbrt", text).unwrap();
    assert_notes(
        &report,
        &[
            "case.pbrt:2:17: left out: float raduis of Shape \"sphere\": no such parameter is known (did you mean \"radius\"?)",
            "case.pbrt:2:34: left out: integer radius of Shape \"sphere\": it is not taken as integer",
        ],
    );
}

/// The faults of a scene, without the path.
fn faults(name: &str, text: &str) -> Vec<String> {
    let folder = Folder::new();
    match folder.convert_text(name, text) {
        Err(ConvertError::Input(errors)) => {
            assert!(!folder.path("mitsuba/out.xml").exists() && !folder.path("pbrt/out.xml").exists());
            let lines: Vec<String> =
                errors.iter().flat_map(|e| e.to_string().lines().map(str::to_owned).collect::<Vec<_>>()).collect();
            let folder = folder.path("");
            lines.iter().map(|line| line.replace(&*folder.to_string_lossy(), "")).collect()
        }
        other => panic!("no fault in {text}\n{other:?}"),
    }
}

#[track_caller]
fn assert_fault(name: &str, text: &str, expected: &str) {
    let found = faults(name, text);
    assert!(
        found.iter().any(|fault| fault.starts_with(&format!("{name}:{expected}"))),
        "{text}\nfound: {found:#?}\nexpected: {expected}"
    );
}

#[test]
fn faulty_old_mitsuba_scenes_say_where_and_why() {
    let name = "mitsuba/case.xml";
    for (text, expected) in [
        ("", "1:1: malformed XML"),
        ("<scene version='0.6.0'>\n<bsdf>\n</scene>", "3:1: malformed XML"),
        ("<thing/>", "1:1: the root element is <thing>"),
        ("<scene version='3.0.0'/>", "1:17: the scene is of version 3 already"),
        ("<scene/>", "1:1: the scene's version must be"),
    ] {
        assert_fault(name, text, expected);
    }
    for (element, expected) in [
        ("<shape type='sphere'><float name='radius' value='much'/></shape>", "2:50: \"much\" is not a number"),
        ("<shape type='cube'><ref id='nothing'/></shape>", "2:29: nothing has the id \"nothing\""),
        ("<shape type='ply'><string name='filename' value='no.ply'/></shape>", "2:50: there is no file"),
        ("<shape type='cube'><transform name='toWorld'><turn/></transform></shape>", "2:46: <turn> is no step"),
        (
            "<shape type='cube'><transform name='toWorld'><rotate angle='3'/></transform></shape>",
            "2:46: the rotation axis has no length",
        ),
        ("<bsdf type='twosided'/>", "2:1: bsdf \"twosided\" holds 0 bsdfs; expected 1 to 2"),
        (
            "<bsdf type='mixturebsdf'><string name='weights' value='1'/><bsdf type='diffuse'/><bsdf type='diffuse'/></bsdf>",
            "2:56: 1 weights for 2 bsdfs",
        ),
        ("<bsdf type='diffuse'><rgb name='reflectance' value='1 2'/></bsdf>", "2:53: \"1 2\" holds 2 numbers"),
        ("<bsdf type='diffuse'><rgb name='reflectance' value='$x'/></bsdf>", "2:53: $x has no value"),
        ("<include filename='case.xml'/>", "2:20: "),
        ("<include filename='no.xml'/>", "2:20: "),
    ] {
        assert_fault(name, &format!("<scene version='0.6.0'>\n{element}\n</scene>"), expected);
    }
}

#[test]
fn faulty_pbrt_scenes_say_where_and_why() {
    let name = "pbrt/case.pbrt";
    for (text, expected) in [
        ("", "1:1: the scene has no WorldBegin"),
        ("WorldBegin", "1:1: the scene has no Camera"),
        ("Camera \"perspective\" WorldBegin\nAttributeBegin", "1:1: a AttributeBegin of the scene has no AttributeEnd"),
    ] {
        assert_fault(name, text, expected);
    }
    for (world, expected) in [
        ("Shpae \"sphere\"", "2:1: unknown directive \"Shpae\" (did you mean \"Shape\"?)"),
        ("Shape \"sphere\" \"float radius\" [ x ]", "2:33: Shape: \"x\" is not a number"),
        ("Shape \"sphere\" \"float radius\" [ 1", "2:17: Shape: the parameter has no value, or its bracket no end"),
        ("Shape \"sphere\" \"flaot radius\" 1", "2:17: Shape: unknown type \"flaot\" (did you mean \"float\"?)"),
        ("Shape \"sphere\" \"radius\" 1", "2:17: Shape: \"radius\" is no parameter"),
        ("Shape \"sphere\" \"point3 P\" [ 1 2 ]", "2:17: Shape: P: 2 numbers; expected 3 for each point3"),
        ("Shape \"sphere", "2:7: the string has no end"),
        ("Translate 1 2", "2:1: Translate: 2 numbers after it; expected 3"),
        ("Scale 0 1 1", "2:1: Scale: a factor of 0"),
        ("Rotate 30 0 0 0", "2:1: Rotate: the axis has no length"),
        ("LookAt 0 0 0 0 0 0 0 1 0", "2:1: LookAt"),
        ("Transform [ 1 0 0 0 0 1 0 0 0 0 0 0 0 0 0 1 ]", "2:1: the transform is singular"),
        ("AttributeEnd", "2:1: AttributeEnd without AttributeBegin"),
        ("AttributeBegin TransformEnd AttributeEnd", "2:16: TransformEnd where AttributeEnd is due"),
        ("NamedMaterial \"a\" Shape \"sphere\"", "2:16: no material \"a\""),
        ("ObjectInstance \"a\"", "2:17: no object \"a\""),
        ("Material \"diffuse\" \"texture reflectance\" \"a\" Shape \"sphere\"", "2:21: no spectrum texture \"a\""),
        (
            "Shape \"trianglemesh\" \"point3 P\" [ 0 0 0 1 0 0 0 1 0 ] \"integer indices\" [ 0 1 3 ]",
            "2:56: the index 3 of 3 points",
        ),
        ("Shape \"plymesh\" \"string filename\" \"no.ply\"", "2:18: there is no file"),
        ("Shape \"sphere\" \"float radius\" -1", "2:17: a radius of -1"),
        ("Include \"no.pbrt\"", "2:10: Include: "),
        ("Include \"case.pbrt\"", "2:10: Include: "),
        (
            "Texture \"a\" \"spectrum\" \"scale\" \"texture tex\" \"a\" Material \"diffuse\" \"texture reflectance\" \"a\" Shape \"sphere\"",
            "2:33: the texture \"a\" is made of itself",
        ),
        (
            "MakeNamedMaterial \"a\" \"string type\" \"mix\" \"string materials\" [ \"a\" \"a\" ] NamedMaterial \"a\" Shape \"sphere\"",
            "2:20: the material is a mixture of itself",
        ),
    ] {
        assert_fault(name, &format!("Camera \"perspective\" WorldBegin\n{world}"), expected);
    }
}

#[test]
fn what_is_left_out_and_what_is_changed_are_told_apart() {
    let folder = Folder::new();
    let (report, _) = folder.convert("mitsuba/everything.xml").unwrap();
    let count = |kind| report.notes.iter().filter(|note| note.kind == kind).count();
    assert_eq!((count(Kind::LeftOut), count(Kind::Changed)), (6, 8));
}
