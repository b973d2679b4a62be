//! Faulty scene files say what is wrong, where, and what would be right; all of it in one go.

use std::path::Path;

use relt::load::LoadError;

use crate::files::{Folder, around};

/// Files beside every scene of these tests.
const FILES: &[(&str, &[u8])] = &[
    ("good.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
    ("nan.obj", b"v 0 0 0\n\nv 1 nan 0\nv 0 1 0\nf 1 2 3\n"),
    ("infinite.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 1e39\nf 1 2 3\n"),
    ("range.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2 4\n"),
    ("zero.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n"),
    ("words.obj", b"v 0 0 0\nv 1 0 here\n"),
    ("empty.obj", b""),
    ("points.obj", b"v 0 0 0\nv 1 0 0\n"),
    ("line.obj", b"v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n"),
    ("edge.obj", b"v 0 0 0\nv 1 0 0\nf 1 2\n"),
    ("good.ply", PLY),
    ("good.serialized", include_bytes!("../mitsuba/meshes/balls.serialized")),
    ("no.serialized", b"no serialized mesh at all"),
    ("short.serialized", b"\x1c\x04\x04\x00\x78\x9c"),
    ("no.ply", b"no ply at all\n"),
    ("short.ply", b"ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nend_header\n1 2 3\n"),
    ("huge.ply", b"ply\nformat binary_little_endian 1.0\nelement vertex 99999999999\nproperty float x\nproperty float y\nproperty float z\nend_header\n1"),
    ("flat.ply", b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n"),
    (
        "nan.ply",
        b"ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
        element face 1\nproperty list uchar int vertex_index\nend_header\n\
        \0\0\0\0\0\0\0\0\0\0\0\0\0\0\x80\x3f\0\0\0\0\0\0\0\0\0\0\0\0\0\0\xc0\x7f\0\0\0\0\
        \x03\0\0\0\0\x01\0\0\0\x02\0\0\0",
    ),
    (
        "words.ply",
        b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\nfar\n",
    ),
    (
        "letters.ply",
        b"ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nend_header\n\
        0 0 0\n0 far 0\n",
    ),
    (
        "range.ply",
        b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
        element face 2\nproperty list uchar int vertex_index\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n3 0 1 3\n",
    ),
    (
        "negative.ply",
        b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
        element face 1\nproperty list uchar int vertex_index\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 -2\n",
    ),
];

/// A triangle.
const PLY: &[u8] = b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
    element face 1\nproperty list uchar int vertex_index\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";

/// The error that a text gives.
fn error(folder: &Folder, text: &str, defines: &[(&str, &str)]) -> LoadError {
    match folder.load(text, defines) {
        Ok(_) => panic!("no fault found in\n{text}"),
        Err(error) => error,
    }
}

/// The lines of the error without the path that each begins with.
fn faults(text: &str, defines: &[(&str, &str)]) -> Vec<String> {
    let folder = Folder::new(FILES);
    let error = error(&folder, text, defines);
    let path = format!("{}:", folder.path("scene.xml").display());
    let inside = format!("{}/", folder.path("").display().to_string().trim_end_matches('/'));
    error
        .to_string()
        .lines()
        .map(|line| line.strip_prefix(&path).unwrap_or_else(|| panic!("no path: {line}")).replace(&inside, ""))
        .collect()
}

/// A text, and what the faults in it begin with, in order and no others.
#[track_caller]
pub fn assert_faults(text: &str, defines: &[(&str, &str)], expected: &[&str]) {
    let found = faults(text, defines);
    let is_same = found.len() == expected.len() && found.iter().zip(expected).all(|(f, e)| f.starts_with(e));
    let text: String = text.chars().take(2000).collect();
    assert!(is_same, "{text}\nfound: {found:#?}\nexpected: {expected:#?}");
}

/// Checks elements, which stand on line 2, inside a scene that is otherwise right.
#[track_caller]
fn assert_each(cases: &[(&str, &str)]) {
    for (elements, expected) in cases {
        assert_faults(&around(elements), &[], &[expected]);
    }
}

#[test]
fn text_that_is_no_scene_is_a_fault() {
    for (text, expected) in [
        ("", "1:1: malformed XML: "),
        ("<scene version='3.0.0'>\n  <bsdf type='diffuse'>\n</scene>", "3:1: malformed XML: expected 'bsdf' tag"),
        ("<scene version='3.0.0'>\n<float name=a/></scene>", "2:13: malformed XML: "),
        ("<scene version='3.0.0'>", "1:1: malformed XML: "),
        ("<!DOCTYPE a [<!ENTITY b 'c'>]><scene version='3.0.0'/>", "1:1: malformed XML: "),
        ("<shape type='obj'/>", "1:1: the root element is <shape>; a scene file has <scene version=\"3.0.0\">"),
    ] {
        assert_faults(text, &[], &[expected]);
    }
}

#[test]
fn other_versions_are_faults() {
    let rest = "<sensor type='perspective'/><emitter type='constant'/>";
    let text = |version: &str| format!("<scene{version}>{rest}</scene>");
    assert_faults(
        &text(" version='0.6.0'"),
        &[],
        &["1:17: scene version \"0.6.0\" is not supported; supported: 3.x.y"],
    );
    assert_faults(&text(""), &[], &["1:1: <scene> needs the attribute version"]);
}

#[test]
fn what_is_unknown_is_a_fault_that_lists_what_is_known() {
    assert_each(&[
        (
            "  <bsdf type='glas'/>",
            "2:15: unknown bsdf \"glas\"; known: blendbsdf, bumpmap, conductor, dielectric, diffuse,",
        ),
        ("<bsdf type='difuse'/>", "2:13: unknown bsdf \"difuse\" (did you mean \"diffuse\"?); known: "),
        (
            "<shape type='sphere '/>",
            "2:14: unknown shape \"sphere \" (did you mean \"sphere\"?); known: cube, cylinder, disk, instance, obj,",
        ),
        ("<integrator type='bdpt'/>", "2:19: unknown integrator \"bdpt\"; known: path"),
        (
            "<emitter type='sun'/>",
            "2:16: unknown emitter \"sun\"; known: area, constant, directional, envmap, point, spot",
        ),
        (
            "<shape type='cube'><emitter type='aera'/></shape>",
            "2:35: unknown emitter \"aera\" (did you mean \"area\"?)",
        ),
        ("<medium type='homogeneous'/>", "2:1: unknown element \"medium\"; known: boolean, bsdf,"),
        ("<shpae type='cube'/>", "2:1: unknown element \"shpae\" (did you mean \"shape\"?); known: "),
        (
            "<shape typ='cube' type='cube'/>",
            "2:8: unknown attribute of <shape> \"typ\" (did you mean \"type\"?); known: id,",
        ),
        ("<shape/>", "2:1: <shape> needs the attribute type; known: id, name, type"),
        (
            "<shape type='sphere'>\n<float name='raduis' value='1'/></shape>",
            "3:14: unknown parameter \"raduis\" of shape \"sphere\" (did you mean \"radius\"?); known: center, flip_normals,",
        ),
        (
            "<bsdf type='diffuse'><float name='alpha' value='1'/></bsdf>",
            "2:35: unknown parameter \"alpha\" of bsdf \"diffuse\"; known: reflectance",
        ),
        ("<shape type='cube'><sensor type='perspective'/></shape>", "2:20: shape \"cube\" cannot hold a <sensor>"),
        ("<float name='a' value='1'/>", "2:14: unknown parameter \"a\" of <scene>; none is known here"),
        ("<ref id='a'/>", "2:1: <scene> cannot hold a <ref>"),
        ("<rotate x='1' angle='1'/>", "2:1: <rotate> belongs inside <transform>"),
        ("<shape type='cube'><default name='a' value='1'/></shape>", "2:20: <default> belongs directly inside <scene>"),
        (
            "<shape type='cube'><boolean name='flip_normals' value='true'><ref id='a'/></boolean></shape>",
            "2:62: <ref> does not belong inside <boolean>",
        ),
        ("hello", "2:1: text between elements means nothing"),
    ]);
}

#[test]
fn values_that_do_not_fit_are_faults() {
    let of_sphere = |parameter: &str| around(&format!("<shape type='sphere'>\n{parameter}</shape>"));
    for (parameter, expected) in [
        ("<string name='radius' value='1'/>", "3:1: \"radius\" is given as <string>; accepted: <float>, <integer>"),
        ("<float name='radius' value='one'/>", "3:29: \"one\" is not a number"),
        ("<float name='radius' value='nan'/>", "3:29: \"nan\" is not finite"),
        ("<float name='radius' value='-inf'/>", "3:29: \"-inf\" is not finite"),
        ("<float name='radius' value='1e39'/>", "3:29: \"1e39\" is not finite"),
        ("<float name='radius' value='0'/>", "3:29: radius is 0 (0 in the world); it must be above 0"),
        ("<float name='radius' value='-1'/>", "3:29: radius is -1"),
        ("<float name='radius'/>", "3:1: <float> needs the attribute value"),
        ("<boolean name='flip_normals' value='1'/>", "3:37: \"1\" is not a truth value; accepted: true, false"),
        ("<point name='center' x='1' z='2'/>", "3:1: <point> needs the attribute y"),
        ("<point name='center' value='1 2'/>", "3:29: \"1 2\" holds 2 numbers; expected 3"),
        ("<point name='center' value='1 2 3' x='1'/>", "3:1: <point> has both value and x, y, z"),
        ("<point name='center' x='1' y='2' z='x'/>", "3:37: \"x\" is not a number"),
        ("<ref name='radius' id='a'/>", "3:1: \"radius\" is given as <ref>; accepted: "),
    ] {
        assert_faults(&of_sphere(parameter), &[], &[expected]);
    }
    let twice = "<float name='radius' value='1'/><float name='radius' value='2'/>";
    assert_faults(&of_sphere(twice), &[], &["3:46: parameter \"radius\" is given twice"]);
}

#[test]
fn radiances_and_reflectances_out_of_range_are_faults() {
    assert_each(&[
        (
            "<shape type='cube'><emitter type='area'><rgb name='radiance' value='1, -2, 3'/></emitter></shape>",
            "2:69: radiance is [1, -2, 3]; every channel must be finite and not negative",
        ),
        ("<emitter type='point'><rgb name='intensity' value='nan 0 0'/></emitter>", "2:52: \"nan\" is not finite"),
        (
            "<bsdf type='diffuse'><rgb name='reflectance' value='1.1, 0, 0'/></bsdf>",
            "2:53: reflectance is [1.1, 0, 0]; every channel must lie between 0 and 1",
        ),
        (
            "<bsdf type='diffuse'><rgb name='reflectance' value='1, 0'/></bsdf>",
            "2:53: \"1, 0\" holds 2 numbers; expected 1 or 3",
        ),
        ("<bsdf type='diffuse'><rgb name='reflectance' value='#ff0000'/></bsdf>", "2:53: \"#ff0000\" is not a colour"),
    ]);
}

#[test]
fn names_without_value_and_values_without_use_are_faults() {
    let text = around("<default name='a' value='1'/><shape type='sphere'>\n<float name='radius' value='$b'/></shape>");
    assert_faults(&text, &[], &["3:29: $b has no value: no <default> before this, no -D b=…; known: a"]);
    let text = around("<default name='a' value='1'/><shape type='sphere'>\n<float name='radius' value='$a'/></shape>");
    let unused = " -D resolution=64 has no effect: the scene uses no $resolution; known: a";
    assert_faults(&text, &[("resolution", "64"), ("a", "2")], &[unused]);
    let later = "<shape type='sphere'>\n<float name='radius' value='$a'/></shape><default name='a' value='1'/>";
    assert_faults(&around(later), &[], &["3:29: $a has no value"]);
    let twice = "<default name='a' value='1'/><default name='a' value='2'/>";
    assert_faults(&around(twice), &[], &["2:45: the default of \"a\" is given twice"]);
}

#[test]
fn ids_that_lead_nowhere_or_to_two_places_are_faults() {
    assert_each(&[
        ("<bsdf type='diffuse' id='red'/><bsdf type='diffuse' id='red'/>", "2:57: the id \"red\" is given twice"),
        (
            "<bsdf type='diffuse' id='white'/><shape type='cube'>\n<ref id='wihte'/></shape>",
            "3:10: no <bsdf> has the id \"wihte\" (did you mean \"white\"?); known: white",
        ),
        ("<shape type='cube' id='a'><ref id='a'/></shape>", "2:36: \"a\" refers to a <shape>; expected a <bsdf>"),
        ("<shape type='cube'><bsdf type='twosided'><ref id='a'/></bsdf></shape>", "2:51: no <bsdf> has the id \"a\""),
    ]);
}

#[test]
fn two_sided_surfaces_need_one_or_two_sides_that_do_not_transmit() {
    assert_each(&[
        ("<bsdf type='twosided'/>", "2:13: bsdf \"twosided\" holds 0 bsdfs; accepted: 1 or 2"),
        (
            "<bsdf type='twosided'><bsdf type='diffuse'/><bsdf type='diffuse'/>\n<bsdf type='diffuse'/></bsdf>",
            "3:1: bsdf \"twosided\" holds 3 bsdfs; accepted: 1 or 2",
        ),
        (
            "<bsdf type='twosided'>\n<bsdf type='dielectric'/></bsdf>",
            "3:1: bsdf \"twosided\" cannot hold bsdf \"dielectric\", which transmits light",
        ),
        (
            "<bsdf type='dielectric' id='glass'/><bsdf type='twosided'>\n<ref id='glass'/></bsdf>",
            "3:1: bsdf \"twosided\" cannot hold bsdf \"dielectric\", which transmits light",
        ),
        (
            "<bsdf type='twosided' id='a'>\n<ref id='a'/></bsdf>",
            "3:1: bsdf \"twosided\" refers to itself, if by detours",
        ),
        (
            "<bsdf type='twosided'>\n<bsdf type='twosided'><bsdf type='diffuse'/></bsdf></bsdf>",
            "3:1: bsdf \"twosided\" cannot hold another one",
        ),
        (
            "<shape type='cube'><bsdf type='diffuse'/><bsdf type='diffuse'/></shape>",
            "2:42: the shape has more than one <bsdf>",
        ),
    ]);
}

#[test]
fn emitters_belong_where_they_can_emit() {
    assert_each(&[
        ("<emitter type='area'/>", "2:16: emitter \"area\" belongs inside a shape"),
        (
            "<shape type='cube'><emitter type='area'/><emitter type='area'/></shape>",
            "2:42: shape \"cube\" has more than one <emitter>",
        ),
        (
            "<shape type='cube'><emitter type='point'/></shape>",
            "2:35: emitter \"point\" belongs directly inside <scene>; a shape holds: area",
        ),
        // The second of them is that of the rest of the scene.
        ("<emitter type='constant'/>", "3:29: the scene has more than one emitter that surrounds it"),
    ]);
}

#[test]
fn lights_that_shine_nowhere_are_faults() {
    assert_each(&[
        (
            "<emitter type='spot'>\n<float name='cutoff_angle' value='200'/></emitter>",
            "3:35: cutoff_angle is 200; accepted are degrees above 0, up to 180",
        ),
        (
            "<emitter type='spot'><float name='cutoff_angle' value='10'/>\n<float name='beam_width' value='11'/></emitter>",
            "3:33: beam_width is 11; accepted are degrees above 0, up to 10",
        ),
        (
            "<emitter type='directional'>\n<vector name='direction' value='0, 0, 0'/></emitter>",
            "3:33: the light has no direction",
        ),
        (
            "<emitter type='directional'><transform name='to_world'><rotate x='1' angle='90'/></transform>\n\
             <vector name='direction' value='0, 1, 0'/></emitter>",
            "3:33: give either direction or to_world, not both",
        ),
    ]);
}

#[test]
fn facets_have_a_known_distribution_and_roughnesses_that_make_sense() {
    let of = |inner: &str, expected: &str| {
        let bsdf = format!("<bsdf type='roughconductor'>\n{inner}</bsdf>");
        assert_each(&[(&bsdf, expected)]);
    };
    of("<string name='distribution' value='phong'/>", "3:36: unknown distribution \"phong\"; known: beckmann, ggx");
    of("<float name='alpha' value='-0.1'/>", "3:28: alpha is -0.1; a roughness is finite and not negative");
    of("<float name='alpha_u' value='0.1'/>", "3:30: alpha_u and alpha_v are given together");
    of(
        "<float name='alpha' value='0.1'/><float name='alpha_u' value='0.1'/><float name='alpha_v' value='0.1'/>",
        "3:28: give either alpha or alpha_u and alpha_v, not both",
    );
    assert_each(&[(
        "<bsdf type='roughplastic'>\n<float name='alpha_u' value='0.1'/><float name='alpha_v' value='0.2'/></bsdf>",
        "3:65: alpha_u and alpha_v differ; a roughplastic has one roughness",
    )]);
}

#[test]
fn parameters_of_principled_materials_have_ranges() {
    let of = |inner: &str, expected: &str| {
        let bsdf = format!("<bsdf type='principled'>\n{inner}</bsdf>");
        assert_each(&[(&bsdf, expected)]);
    };
    of("<float name='sheen' value='1.5'/>", "3:28: sheen is 1.5; accepted are numbers from 0 to 1");
    of("<float name='eta' value='0'/>", "3:26: eta is 0; a ratio of refractive indices is finite and greater than 0");
    of(
        "<float name='eta' value='1.5'/><float name='specular' value='0.5'/>",
        "3:62: give either eta or specular, not both",
    );
    of(
        "<float name='main_specular_sampling_rate' value='0'/>",
        "3:50: main_specular_sampling_rate is 0; a rate of sampling is finite and greater than 0",
    );
    of(
        "<float name='clearcoat_sampling_rate' value='-1'/>",
        "3:46: clearcoat_sampling_rate is -1; a rate of sampling is finite and not negative",
    );
    of("<float name='diff_trans' value='1'/>", "3:14: unknown parameter \"diff_trans\" of bsdf \"principled\"");
}

#[test]
fn scenes_without_camera_or_light_are_faults() {
    let scene = |inner: &str| format!("<scene version='3.0.0'>\n{inner}</scene>");
    assert_faults(&scene("<emitter type='constant'/>"), &[], &["1:1: the scene has no <sensor>"]);
    assert_faults(&scene("<sensor type='perspective'/>"), &[], &["1:1: nothing in the scene emits light"]);
    assert_each(&[
        ("<sensor type='perspective'/>", "3:1: <scene> has more than one <sensor>"),
        ("<integrator type='path'/>\n<integrator type='path'/>", "3:1: <scene> has more than one <integrator>"),
    ]);
}

#[test]
fn limits_of_path_length_are_checked() {
    let of = |name: &str, value: &str| {
        around(&format!("<integrator type='path'>\n<integer name='{name}' value='{value}'/></integrator>"))
    };
    assert_faults(&of("max_depth", "-2"), &[], &["3:34: max_depth is -2; accepted: -1 (no limit) or 1 to 16000"]);
    assert_faults(&of("max_depth", "0"), &[], &["3:34: max_depth is 0; "]);
    assert_faults(&of("rr_depth", "0"), &[], &["3:33: rr_depth is 0; accepted: 1 and more"]);
    assert_faults(&of("max_depth", "1.5"), &[], &["3:34: \"1.5\" is not a whole number"]);
    let hide = around("<integrator type='path'><boolean name='hide_emitters' value='true'/></integrator>");
    assert_faults(&hide, &[], &["2:62: hide_emitters is not supported; accepted: false"]);
}

/// A scene whose sensor holds these elements, which begin on line 2.
fn with_sensor(inner: &str) -> String {
    format!("<scene version='3.0.0'><emitter type='constant'/><sensor type='perspective'>\n{inner}</sensor></scene>")
}

#[test]
fn cameras_that_see_nothing_are_faults() {
    for (inner, expected) in [
        ("<float name='fov' value='0'/>", "2:26: fov is 0 degrees; it must lie between 0 and 180"),
        ("<float name='fov' value='180'/>", "2:26: fov is 180 degrees"),
        ("<string name='fov_axis' value='z'/>", "2:32: unknown fov_axis \"z\"; known: diagonal, larger, smaller, x, y"),
        ("<string name='focal_length' value='0mm'/>", "2:36: focal_length is 0 mm"),
        ("<string name='focal_length' value='long'/>", "2:36: \"long\" is not a number"),
        ("<float name='fov' value='9'/><string name='focal_length' value='5mm'/>", "2:65: both fov and focal_length"),
        ("<float name='near_clip' value='0'/>", "2:32: near_clip is 0; it must be above 0"),
        ("<float name='near_clip' value='1e4'/>", "2:32: near_clip is 10000 and far_clip 10000; near_clip must be"),
        ("<transform name='to_world'><scale value='2'/></transform>", "2:1: the transform of a sensor must not scale"),
        ("<sampler type='sobol'/>", "2:16: unknown sampler \"sobol\"; known: independent"),
        ("<film type='ldrfilm'/>", "2:13: unknown film \"ldrfilm\""),
        ("<film type='hdrfilm'/><film type='hdrfilm'/>", "2:23: sensor \"perspective\" has more than one <film>"),
    ] {
        assert_faults(&with_sensor(inner), &[], &[expected]);
    }
}

#[test]
fn films_of_no_size_are_faults() {
    for (inner, expected) in [
        ("<integer name='width' value='0'/>", "3:30: width is 0 pixels; accepted: 1 to 65536"),
        ("<integer name='height' value='65537'/>", "3:31: height is 65537 pixels; accepted: 1 to 65536"),
        (
            "<integer name='height' value='99999999999999999999'/>",
            "3:31: \"99999999999999999999\" is not a whole number",
        ),
        ("<float name='width' value='10'/>", "3:1: \"width\" is given as <float>; accepted: <integer>"),
        ("<string name='file_format' value='png'/>", "3:35: unknown file_format \"png\"; known: exr, openexr"),
        (
            "<rfilter type='sinc'/>",
            "3:16: unknown rfilter \"sinc\"; known: box, catmullrom, gaussian, lanczos, mitchell, tent",
        ),
        ("<rfilter type='tent'><float name='radius' value='0'/></rfilter>", "3:50: radius is 0 pixels"),
        ("<rfilter type='gaussian'><float name='stddev' value='5'/></rfilter>", "3:54: stddev is 5 pixels"),
    ] {
        assert_faults(&with_sensor(&format!("<film type='hdrfilm'>\n{inner}</film>")), &[], &[expected]);
    }
}

#[test]
fn transforms_that_make_no_sense_are_faults() {
    let singular = "2:19: the transform is singular";
    for (steps, expected) in [
        ("<scale value='0'/>", singular),
        ("<scale value='1, 1, 0'/>", singular),
        ("<matrix value='1 2 3 2 4 6 1 1 1'/>", singular),
        ("<scale value='1e30'/><scale value='1e30'/>", singular),
        ("<matrix value='1 2 3'/>", "3:16: the matrix has 3 numbers; expected 9 or 16"),
        (
            "<matrix value='1 0 0 0  0 1 0 0  0 0 1 0  0 0 0 2'/>",
            "3:16: the last row of the matrix is [0.0, 0.0, 0.0, 2.0]",
        ),
        ("<matrix value='1 0 0 0 a 0 0 0 1'/>", "3:16: \"a\" is not a number"),
        ("<rotate x='1'/>", "3:1: <rotate> needs the attribute angle"),
        ("<rotate angle='90'/>", "3:1: the rotation axis has no length"),
        (
            "<rotate x='1' y='1' angle='9'/>",
            "3:1: the rotation axis must have length 1, as in 0.707107 0.707107 0.000000",
        ),
        ("<translate x='far'/>", "3:15: \"far\" is not a number"),
        ("<scale value='2' x='1'/>", "3:1: <scale> has both value and x, y, z"),
        ("<lookat origin='0 0 0' target='0 0 0' up='0 1 0'/>", "3:32: the target of <lookat> is its origin"),
        ("<lookat origin='0 0 0' target='0 2 0' up='0 1 0'/>", "3:43: up is parallel to the direction of <lookat>"),
        ("<lookat origin='0 0' target='0 2 0' up='1 0 0'/>", "3:17: \"0 0\" holds 2 numbers; expected 3"),
        ("<skew x='1'/>", "3:1: unknown element \"skew\""),
        ("<float name='a' value='1'/>", "3:1: <float> does not belong inside <transform>"),
    ] {
        let text = around(&format!("<shape type='cube'><transform name='to_world'>\n{steps}</transform></shape>"));
        let expected = expected.replacen("2:19", "2:20", 1);
        assert_faults(&text, &[], &[&expected]);
    }
    let uneven = "<transform name='to_world'>\n<scale x='2'/></transform></shape>";
    assert_faults(&around(&format!("<shape type='sphere'>{uneven}")), &[], &["2:22: a sphere must stay one"]);
    assert_faults(&around(&format!("<shape type='disk'>{uneven}")), &[], &["2:20: a disk must stay a circle"]);
    assert_faults(&around(&format!("<shape type='cylinder'>{uneven}")), &[], &["2:24: a cylinder must stay one"]);
    let sheared = "<transform name='to_world'>\n<matrix value='1 0 0.5 0 1 0 0 0 1'/></transform></shape>";
    assert_faults(&around(&format!("<shape type='cylinder'>{sheared}")), &[], &["2:24: a cylinder must stay one"]);
}

#[test]
fn singular_transforms_of_all_shapes_are_faults() {
    let mesh = |file: &str| format!("<string name='filename' value='{file}'/>");
    let group = "<ref id='group'/>".to_owned();
    for (kind, inner) in [
        ("cube", String::new()),
        ("cylinder", String::new()),
        ("disk", String::new()),
        ("instance", group),
        ("obj", mesh("good.obj")),
        ("ply", mesh("good.ply")),
        ("rectangle", String::new()),
        ("serialized", mesh("good.serialized")),
        ("sphere", String::new()),
    ] {
        for scale in ["x='0'", "value='0'", "value='1e-30'", "value='1e30'"] {
            let text = format!(
                "<shape type='{kind}'>{inner}\n<transform name='to_world'><scale {scale}/></transform></shape>"
            );
            let group = "<shape type='shapegroup' id='group'><shape type='cube'/></shape>";
            let found = faults(&around(&format!("{text}{group}")), &[]);
            let expected = "3:1: the transform is singular: it flattens space or makes values infinite";
            assert_eq!(found.iter().filter(|fault| *fault == expected).count(), 1, "{kind}, {scale}: {found:?}");
            assert_eq!(found.len(), 1, "{kind}, {scale}: {found:?}");
        }
    }
}

#[test]
fn cylinders_without_extent_are_faults() {
    assert_each(&[
        (
            "<shape type='cylinder'>\n<point name='p1' value='0, 0, 0'/></shape>",
            "3:25: p0 and p1 are the same point, or too far apart: the cylinder has no axis",
        ),
        (
            "<shape type='cylinder'>\n<float name='radius' value='0'/></shape>",
            "3:29: radius is 0 (0 in the world); it must be",
        ),
        ("<shape type='cylinder'>\n<float name='radius' value='-2'/></shape>", "3:29: radius is -2"),
    ]);
}

#[test]
fn meshes_that_cannot_be_used_are_faults() {
    for (file, expected) in [
        ("missing.obj", "cannot be read: "),
        ("nan.obj", "line 3: the vertex must be finite: \"v 1 nan 0\""),
        ("infinite.obj", "line 3: the vertex must be finite: \"v 0 1 1e39\""),
        ("range.obj", "line 5: vertex 4 of 3: \"f 1 2 4\""),
        ("zero.obj", "line 4: vertex 0: numbers begin at 1: \"f 0 1 2\""),
        ("words.obj", "line 2: \"here\" is not a number: \"v 1 0 here\""),
        ("empty.obj", "the mesh is empty: "),
        ("points.obj", "the mesh is empty: "),
        ("edge.obj", "line 3: the face has 2 corners; it must have 3 or more: \"f 1 2\""),
        ("line.obj", "none of its 1 triangles has an area"),
        ("no.ply", "it is no readable PLY: "),
        ("words.ply", "its vertices have no x, y and z"),
        ("letters.ply", "it is no readable PLY: vertex 2 of 2: line 9: \"far\" is no number of the type in the header"),
        ("no.serialized", "it is no serialized mesh: it begins with 0x6f6e, not 0x041c"),
        ("short.serialized", "it is no whole serialized mesh: "),
        ("short.ply", "it is no readable PLY: vertex 2 of 2: the file ends here"),
        ("huge.ply", "it is no readable PLY: vertex 1 of 99999999999: the file ends here"),
        ("flat.ply", "its vertices have no x, y and z"),
        ("nan.ply", "vertex 3 is (0, NaN, 0); it must be finite"),
        ("range.ply", "triangle 2 refers to vertex 4 of 3"),
        ("negative.ply", "face 1 has no list vertex_indices of whole numbers that are not negative"),
    ] {
        let (_, kind) = file.split_once('.').unwrap();
        let text = format!("<shape type='{kind}'>\n<string name='filename' value='{file}'/></shape>");
        assert_faults(&around(&text), &[], &[&format!("3:32: {file}: {expected}")]);
    }
    let index = |value: i32| {
        format!(
            "<shape type='serialized'><string name='filename' value='no.serialized'/>\n<integer name='shape_index' value='{value}'/></shape>"
        )
    };
    let negative = ["2:57: no.serialized: ", "3:36: shape_index is -1; the first mesh of a file is 0"];
    assert_faults(&around(&index(-1)), &[], &negative);
    let absent = "<shape type='obj'/>";
    assert_faults(&around(absent), &[], &["2:1: shape \"obj\" needs the parameter \"filename\""]);
    let far =
        "<shape type='obj'><transform name='to_world'><scale value='1e15'/><translate x='3e38'/><scale value='1e3'/>
        </transform>\n<string name='filename' value='good.obj'/></shape>";
    assert_faults(&around(far), &[], &["2:19: the transform is singular: it flattens space or makes values infinite"]);
}

#[test]
fn nesting_without_end_is_a_fault() {
    let deep = "<shape type='cube'>".repeat(100_000) + &"</shape>".repeat(100_000);
    let expected = ["2:20: shape \"cube\" cannot hold a <shape>", "2:609: elements are nested deeper than 32 levels"];
    assert_faults(&around(&deep), &[], &expected);
}

#[test]
fn all_faults_of_a_file_are_reported_together_in_its_order() {
    let text = "<scene version='3.0.0'>
<bsdf type='glas'/>
<shape type='obj'>
  <string name='filename' value='missing.obj'/>
  <ref id='nothing'/>
</shape>
<shape type='sphere'><float name='radius' value='$r'/><float name='size' value='2'/></shape>
<shape type='ply'><string name='filename' value='nan.ply'/><emitter type='area'><rgb name='radiance' value='-1'/></emitter></shape>
</scene>";
    let expected = [
        " -D x=1 has no effect",
        "1:1: the scene has no <sensor>",
        "2:13: unknown bsdf \"glas\"",
        "4:34: missing.obj: cannot be read",
        "5:12: no <bsdf> has the id \"nothing\"",
        "7:50: $r has no value",
        "7:68: unknown parameter \"size\" of shape \"sphere\"",
        "8:50: nan.ply: vertex 3",
        "8:109: radiance is [-1, -1, -1]",
    ];
    assert_faults(text, &[("x", "1")], &expected);
}

#[test]
fn files_that_are_missing_or_of_an_unknown_kind_are_told_so() {
    let message = |path: &Path| relt::load::scene(path, &[]).unwrap_err().to_string();
    let folder = Folder::new(&[("scene.pbrt", b""), ("binary.xml", b"<scene>\xff")]);
    let missing = folder.path("none.xml");
    assert!(message(&missing).starts_with(&format!("{}: cannot be read: ", missing.display())));
    let other = folder.path("scene.pbrt");
    let expected = format!("{}: is not a known scene format (extension .pbrt); known: .xml", other.display());
    assert_eq!(message(&other), expected);
    assert!(message(&folder.path("binary.xml")).ends_with("is not UTF-8 text: invalid at byte 7"));
    assert!(message(Path::new("scene")).ends_with("(no extension); known: .xml"));
}

#[test]
fn a_fault_is_shown_in_its_place() {
    let folder = Folder::new(&[]);
    let error = error(&folder, &around("<bsdf type='glas'/>\n<shape type='cub'/>"), &[]);
    assert_eq!(error.faults()[0].position, Some((2, 13)));
    let mut shown = String::new();
    let theme = miette::GraphicalTheme::unicode_nocolor();
    miette::GraphicalReportHandler::new_themed(theme).with_width(200).render_report(&mut shown, &error).unwrap();
    println!("{shown}");
    for part in ["scene.xml:2:13: unknown bsdf \"glas\"; known: ", "<bsdf type='glas'/>", "────", "scene.xml:2:13]"]
    {
        assert!(shown.contains(part), "{part} is missing in\n{shown}");
    }
}

#[test]
fn a_fault_without_a_place_is_shown_without_one() {
    let error = relt::load::scene(Path::new("none.xml"), &[]).unwrap_err();
    let mut shown = String::new();
    let theme = miette::GraphicalTheme::unicode_nocolor();
    miette::GraphicalReportHandler::new_themed(theme).render_report(&mut shown, &error).unwrap();
    assert!(shown.contains("none.xml: cannot be read") && !shown.contains("╭"), "{shown}");
}

#[test]
fn no_slip_of_the_finger_is_a_panic() {
    let text = around(
        "<default name='fov' value='30'/><bsdf type='twosided' id='ä'><bsdf type='diffuse'><rgb name='reflectance' \
        value='.1, .2, .3'/></bsdf></bsdf>\n<shape type='obj'><string name='filename' value='good.obj'/>\
        <ref id='ä'/></shape><shape type='sphere'><float name='radius' value='$fov'/><point name='center' x='1' y='2' \
        z='3'/><transform name='to_world'><lookat origin='0,0,0' target='1 2 3' up='0 1 0'/><rotate x='1' angle='9'/>\
        <scale value='2'/><matrix value='1 0 0 0 1 0 0 0 1'/></transform><emitter type='area'/></shape>",
    );
    let folder = Folder::new(FILES);
    folder.load(&text, &[]).unwrap_or_else(|error| panic!("{error}"));
    let mut faulty = 0;
    for (at, letter) in text.char_indices() {
        let (before, after) = (&text[..at], &text[at + letter.len_utf8()..]);
        for slip in ["", "9", "<", "'", " ", "$", "ß", "-"] {
            if let Err(error) = folder.load(&format!("{before}{slip}{after}"), &[]) {
                assert!(!error.to_string().is_empty());
                faulty += 1;
            }
        }
    }
    assert!(faulty > 1000, "{faulty} slips of {} were found", 8 * text.chars().count());
}

#[test]
fn no_slip_in_a_mesh_is_a_panic() {
    let obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 1\nvn 0 0 1\no a\nf 1/1/1 2/1/1 3/1/1\nf -1//-1 -2//-1 -3//-1\n";
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
        element face 1\nproperty list uchar int vertex_index\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    for (kind, content) in [("obj", obj), ("ply", ply)] {
        let folder = Folder::new(&[]);
        let text = around(&format!("<shape type='{kind}'><string name='filename' value='a.{kind}'/></shape>"));
        for at in 0..content.len() {
            for slip in ["", "9", "-", "x", "\n", "/", "\u{0}"] {
                let slipped = format!("{}{slip}{}", &content[..at], &content[at + 1..]);
                std::fs::write(folder.path(&format!("a.{kind}")), slipped).expect("a file in the folder");
                let _ = folder.load(&text, &[]);
            }
        }
    }
}
