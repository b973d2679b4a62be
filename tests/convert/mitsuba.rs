//! Elements of old Mitsubas to those of Mitsuba 3.

use crate::support::{Folder, shown};

/// What is around an element to make it a scene.
fn scene(elements: &str) -> String {
    format!("<scene version='0.6.0'>\n{elements}\n</scene>")
}

/// Each element, and what elements of its tag are after conversion, in the notation of [`shown`].
#[track_caller]
fn assert_each(tag: &str, cases: &[(&str, &str)]) {
    let folder = Folder::new();
    for (elements, expected) in cases {
        match folder.convert_text("mitsuba/case.xml", &scene(elements)) {
            Ok((_, output)) => assert_eq!(shown(&output, tag), *expected, "{elements}"),
            Err(error) => panic!("{elements}\n{error}"),
        }
    }
}

#[test]
fn parameters_get_their_new_names() {
    assert_each(
        "bsdf",
        &[
            (
                "<bsdf type='diffuse'><rgb name='reflectance' value='0.1 0.2 0.3'/></bsdf>",
                "diffuse(reflectance=0.1,0.2,0.3)",
            ),
            (
                "<bsdf type='diffuse'><spectrum name='diffuseReflectance' value='0.2'/></bsdf>",
                "diffuse(reflectance=0.2,0.2,0.2)",
            ),
            (
                "<bsdf type='dielectric'><float name='intIOR' value='1.6'/><string name='extIOR' value='water'/></bsdf>",
                "dielectric(int_ior=1.6 ext_ior=water)",
            ),
            (
                "<bsdf type='roughdielectric'><float name='alphaU' value='0.1'/><float name='alphaV' value='0.2'/>\
             <string name='distribution' value='as'/><boolean name='sampleVisible' value='true'/></bsdf>",
                "roughdielectric(alpha_u=0.1 alpha_v=0.2 distribution=beckmann)",
            ),
            (
                "<bsdf type='plastic'><boolean name='nonlinear' value='true'/><rgb name='diffuseReflectance' value='0.5'/></bsdf>",
                "plastic(diffuse_reflectance=0.5,0.5,0.5 nonlinear=true)",
            ),
            ("<bsdf type='roughplastic'><float name='alpha' value='0.2'/></bsdf>", "roughplastic(alpha=0.2)"),
            ("<bsdf type='thindielectric'/>", "thindielectric"),
            ("<bsdf type='null'/>", "null"),
        ],
    );
}

#[test]
fn what_is_named_as_in_mitsuba_2_is_read_as_well() {
    assert_each(
        "bsdf",
        &[(
            "<bsdf type='roughconductor'><string name='material' value='none'/><float name='alpha_u' value='0.1'/></bsdf>",
            "roughconductor(alpha_u=0.1 material=none)",
        )],
    );
}

#[test]
fn colours_become_linear_rgb() {
    let reflectance = |colour: &str| format!("<bsdf type='diffuse'>{colour}</bsdf>");
    let cases = [
        ("<srgb name='reflectance' value='#ff8000'/>", "1,0.2158605,0"),
        ("<srgb name='reflectance' value='0.5, 0, 1'/>", "0.21404114,0,1"),
        ("<rgb name='reflectance' value='#ff0080'/>", "1,0,0.5019608"),
        ("<xyz name='reflectance' value='0.95047 1 1.08883'/>", "1.0000"),
    ];
    let folder = Folder::new();
    for (colour, expected) in cases {
        let (_, output) = folder.convert_text("mitsuba/case.xml", &scene(&reflectance(colour))).unwrap();
        let shown = shown(&output, "bsdf");
        assert!(shown.starts_with(&format!("diffuse(reflectance={expected}")), "{colour}: {shown}");
    }
}

#[test]
fn spectra_are_the_colours_that_mitsuba_3_makes_of_them() {
    // By mitsuba 3.9.1, scalar_rgb, of the same spectrum in a scene of version 3; it samples more coarsely.
    let reflected = [0.8351, 0.4057, 0.1126];
    let folder = Folder::new();
    let spectrum = "400:0.1, 500:0.2, 600:0.7, 700:0.8";
    let text = scene(&format!("<bsdf type='diffuse'><spectrum name='reflectance' value='{spectrum}'/></bsdf>"));
    let (_, output) = folder.convert_text("mitsuba/case.xml", &text).unwrap();
    let numbers: Vec<f64> = shown(&output, "bsdf")
        .trim_matches(|c: char| !c.is_ascii_digit())
        .split(',')
        .map(|number| number.parse().unwrap())
        .collect();
    for (number, expected) in numbers.iter().zip(reflected) {
        assert!((number - expected).abs() < 3e-3, "{numbers:?}, expected {reflected:?}");
    }
}

#[test]
fn conductors_are_of_copper_unless_something_else_is_said() {
    assert_each(
        "bsdf",
        &[
            ("<bsdf type='conductor'/>", "conductor(material=Cu)"),
            (
                "<bsdf type='conductor'><string name='material' value='Ni_palik'/></bsdf>",
                "conductor(material=Ni_palik)",
            ),
            ("<bsdf type='conductor'><string name='material' value='Al_palik'/></bsdf>", "conductor(material=Al)"),
            (
                "<bsdf type='conductor'><rgb name='eta' value='1 2 3'/><rgb name='k' value='4 5 6'/><float name='extEta' value='2'/></bsdf>",
                "conductor(eta=0.5,1,1.5 k=2,2.5,3)",
            ),
        ],
    );
}

#[test]
fn lobes_that_are_no_more_become_the_nearest_microfacets() {
    assert_each(
        "bsdf",
        &[
            (
                // 1/√(2 · 40 + 1) = 1/9; shares of 0.5 and 0.25: 1/3 to the lobe, each reflecting 0.75
                "<bsdf type='phong'><float name='exponent' value='40'/><rgb name='diffuseReflectance' value='0.5'/><rgb name='specularReflectance' value='0.25'/></bsdf>",
                "blendbsdf(weight=0.33333334 diffuse(reflectance=0.75,0.75,0.75) \
             roughconductor(material=none distribution=beckmann alpha=0.11111111 specular_reflectance=0.75,0.75,0.75))",
            ),
            (
                "<bsdf type='ward'><float name='alphaU' value='0.2'/><rgb name='diffuseReflectance' value='0'/><rgb name='specularReflectance' value='0.4'/></bsdf>",
                "roughconductor(material=none distribution=beckmann alpha_u=0.2 alpha_v=0.1 specular_reflectance=0.4,0.4,0.4)",
            ),
        ],
    );
}

#[test]
fn surfaces_hold_others() {
    let grey = "<bsdf type='diffuse'/>";
    assert_each(
        "bsdf",
        &[
            (
                &format!("<bsdf type='twosided'>{grey}<bsdf type='conductor'/></bsdf>"),
                "twosided(diffuse conductor(material=Cu))",
            ),
            (&format!("<bsdf type='mask'><rgb name='opacity' value='0.3'/>{grey}</bsdf>"), "mask(opacity=0.3 diffuse)"),
            (
                &format!(
                    "<bsdf type='blendbsdf'><float name='weight' value='0.3'/>{grey}<bsdf type='plastic'/></bsdf>"
                ),
                "blendbsdf(weight=0.3 diffuse plastic)",
            ),
            (
                &format!(
                    "<bsdf type='mixturebsdf'><string name='weights' value='0.25, 0.75'/>{grey}<bsdf type='plastic'/></bsdf>"
                ),
                "blendbsdf(weight=0.75 diffuse plastic)",
            ),
            (
                // the half that is missing to 1 absorbs
                &format!(
                    "<bsdf type='mixturebsdf'><string name='weights' value='0.25 0.25'/>{grey}<bsdf type='plastic'/></bsdf>"
                ),
                "blendbsdf(weight=0.75 diffuse blendbsdf(weight=0.6666667 plastic diffuse(reflectance=0,0,0)))",
            ),
            (&format!("<bsdf type='coating'>{grey}</bsdf>"), "diffuse"),
        ],
    );
}

#[test]
fn references_and_aliases_lead_to_what_they_name() {
    assert_each(
        "shape",
        &[(
            "<bsdf type='diffuse' id='a'/><alias id='a' as='b'/><alias id='b' as='c'/><shape type='cube'><ref id='c'/></shape>",
            "cube(→a)",
        )],
    );
}

#[test]
fn textures_are_placed_by_one_transform() {
    let textured = |texture: &str| format!("<bsdf type='diffuse'>{texture}</bsdf>");
    let picture = "<string name='filename' value='picture.png'/>";
    assert_each(
        "bsdf",
        &[
            (
                &textured(&format!(
                    "<texture type='bitmap' name='reflectance'>{picture}<float name='uscale' value='2'/><float name='voffset' value='0.5'/>\
                 <string name='filterType' value='nearest'/><string name='wrapMode' value='mirror'/><float name='gamma' value='1'/></texture>"
                )),
                "diffuse(reflectance=bitmap(filename=picture.png to_uv(matrix:2,0,0,0,0,1,0,0.5,0,0,1,0,0,0,0,1) raw=true filter_type=nearest wrap_mode=mirror))",
            ),
            (
                &textured(
                    "<texture type='checkerboard' name='reflectance'><float name='uvscale' value='4'/></texture>",
                ),
                "diffuse(reflectance=checkerboard(color0=0.4,0.4,0.4 color1=0.2,0.2,0.2 to_uv(matrix:4,0,0,0,0,4,0,0,0,0,1,0,0,0,0,1)))",
            ),
            (
                &textured(
                    "<texture type='scale' name='reflectance'><float name='scale' value='0.5'/><texture type='checkerboard'/></texture>",
                ),
                "diffuse(reflectance=checkerboard(color0=0.2,0.2,0.2 color1=0.1,0.1,0.1))",
            ),
            (
                &textured(&format!(
                    "<texture type='scale' name='reflectance'><float name='scale' value='0.5'/><texture type='bitmap'>{picture}</texture></texture>"
                )),
                "diffuse(reflectance=bitmap(filename=out-files/picture.exr))",
            ),
            (
                &format!(
                    "<bsdf type='bump'><texture type='scale'><float name='scale' value='3'/><texture type='bitmap'>{picture}</texture></texture><bsdf type='diffuse'/></bsdf>"
                ),
                "bumpmap(heights=bitmap(filename=picture.png) scale=3 diffuse)",
            ),
        ],
    );
}

#[test]
fn a_scaled_picture_has_scaled_pixels() {
    let folder = Folder::new();
    let text = scene(
        "<bsdf type='diffuse'><texture type='scale' name='reflectance'><rgb name='scale' value='0.5 0.25 0'/>\
         <texture type='bitmap'><string name='filename' value='sky.exr'/></texture></texture></bsdf>",
    );
    folder.convert_text("mitsuba/case.xml", &text).unwrap();
    let made = relt::film::exr_file::read_file(&folder.path("mitsuba/out-files/sky.exr")).unwrap().image;
    assert_eq!(made.pixels[0], [0.15, 0.075, 0.0]);
    assert_eq!(made.pixels[19], [4.5, 1.75, 0.0]);
}

#[test]
fn shapes_keep_their_names() {
    assert_each(
        "shape",
        &[
            (
                "<shape type='sphere'><point name='center' x='1' y='2'/><float name='radius' value='3'/><boolean name='flipNormals' value='true'/></shape>",
                "sphere(flip_normals=true center=1,2,0 radius=3)",
            ),
            (
                "<shape type='cylinder'><point name='p0' x='0' y='0' z='0'/><point name='p1' x='0' y='1' z='0'/></shape>",
                "cylinder(p0=0,0,0 p1=0,1,0)",
            ),
            (
                "<shape type='obj'><string name='filename' value='ball.obj'/><boolean name='faceNormals' value='true'/><boolean name='flipTexCoords' value='false'/></shape>",
                "obj(filename=ball.obj face_normals=true flip_tex_coords=false)",
            ),
            (
                "<shape type='serialized'><string name='filename' value='ball.ply'/><integer name='shapeIndex' value='3'/></shape>",
                "serialized(filename=ball.ply shape_index=3)",
            ),
            (
                "<shape type='shapegroup' id='g'><shape type='cube'/></shape><shape type='instance'><ref id='g'/></shape>",
                "shapegroup(cube) instance(→g)",
            ),
            (
                "<shape type='rectangle'><emitter type='area'><rgb name='radiance' value='1 2 3'/><float name='samplingWeight' value='2'/></emitter></shape>",
                "rectangle(area(radiance=1,2,3))",
            ),
        ],
    );
}

#[test]
fn transforms_keep_their_steps() {
    let placed = |steps: &str| format!("<shape type='cube'><transform name='toWorld'>{steps}</transform></shape>");
    assert_each(
        "shape",
        &[
            (&placed("<translate x='1'/><scale value='2'/>"), "cube(to_world(translate:1,0,0 scale:2,2,2))"),
            (&placed("<rotate x='3' y='4' angle='30'/>"), "cube(to_world(rotate:0.6,0.8,0;30))"),
            (&placed("<lookAt origin='1 2 3' target='0 0 0' up='0 1 0'/>"), "cube(to_world(lookat:1,2,3;0,0,0;0,1,0))"),
            (
                &placed("<matrix value='1 0 0 4 0 1 0 5 0 0 1 6 0 0 0 1'/>"),
                "cube(to_world(matrix:1,0,0,4,0,1,0,5,0,0,1,6,0,0,0,1))",
            ),
        ],
    );
}

#[test]
fn emitters_keep_their_names() {
    assert_each(
        "emitter",
        &[
            (
                "<emitter type='point'><transform name='toWorld'><translate x='1' y='2' z='3'/></transform></emitter>",
                "point(position=1,2,3)",
            ),
            (
                "<emitter type='spot'><float name='cutoffAngle' value='30'/><spectrum name='intensity' value='2'/></emitter>",
                "spot(intensity=2,2,2 cutoff_angle=30)",
            ),
            (
                "<emitter type='directional'><vector name='direction' x='0' y='-1' z='0'/></emitter>",
                "directional(direction=0,-1,0)",
            ),
            (
                "<emitter type='envmap'><string name='filename' value='sky.exr'/><float name='scale' value='2'/></emitter>",
                "envmap(filename=sky.exr scale=2)",
            ),
            ("<emitter type='constant'/>", "constant"),
        ],
    );
}

#[test]
fn integrators_become_path_with_the_same_limits() {
    assert_each(
        "integrator",
        &[
            ("<integrator type='path'><integer name='maxDepth' value='8'/></integrator>", "path(max_depth=8)"),
            (
                "<integrator type='mlt'><integer name='maxDepth' value='8'/><integer name='rrDepth' value='9'/></integrator>",
                "path(max_depth=8 rr_depth=9)",
            ),
            ("<integrator type='direct'/>", "path(max_depth=2)"),
            ("<integrator type='adaptive'><integrator type='bdpt'/></integrator>", "path"),
        ],
    );
}

#[test]
fn sensors_films_and_filters_are_carried_over() {
    assert_each(
        "sensor",
        &[
            (
                "<sensor type='thinlens'><float name='apertureRadius' value='0.1'/><float name='focusDistance' value='2'/>\
             <film type='ldrfilm'><integer name='width' value='8'/><integer name='cropOffsetX' value='1'/><rfilter type='lanczos'><integer name='lobes' value='2'/></rfilter></film>\
             <sampler type='halton'><integer name='sampleCount' value='9'/></sampler></sensor>",
                "thinlens(aperture_radius=0.1 focus_distance=2 hdrfilm(width=8 crop_offset_x=1 pixel_format=rgb lanczos(lobes=2)) independent(sample_count=9))",
            ),
            (
                "<sensor type='perspective'><string name='focalLength' value='35mm'/><float name='nearClip' value='0.5'/></sensor>",
                "perspective(near_clip=0.5 focal_length=35mm)",
            ),
            (
                "<sensor type='orthographic'><transform name='toWorld'><scale x='2' y='2'/></transform></sensor>",
                "orthographic(to_world(scale:2,2,1))",
            ),
        ],
    );
}

#[test]
fn defaults_are_replaced_by_what_is_given_from_outside() {
    let folder = Folder::new();
    let text = scene(
        "<default name='n' value='4'/><integrator type='path'><integer name='maxDepth' value='$n'/></integrator>",
    );
    std::fs::write(folder.path("mitsuba/case.xml"), text).unwrap();
    for (defines, expected) in
        [(vec![], "path(max_depth=4)"), (vec![("n".to_owned(), "7".to_owned())], "path(max_depth=7)")]
    {
        let output = folder.path("mitsuba/out.xml");
        let job = relt::convert::Job {
            input: folder.path("mitsuba/case.xml"),
            output: output.clone(),
            defines,
            reach: Default::default(),
            strict: true,
        };
        relt::convert::convert(&job).unwrap();
        assert_eq!(shown(&output, "integrator"), expected);
    }
}
