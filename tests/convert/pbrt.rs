//! pbrt's directives to elements of Mitsuba 3.

use glam::Vec3;
use relt::scene::description::ShapeGeometry;

use crate::support::{Folder, shown};

/// What a world needs besides what a test is about; on one line, so as to leave line numbers alone.
const BEGIN: &str =
    "Camera \"perspective\" Film \"rgb\" \"integer xresolution\" 8 \"integer yresolution\" 8 WorldBegin";

/// Each world, and what elements of that tag are after conversion, in the notation of [`shown`].
#[track_caller]
fn assert_each(tag: &str, cases: &[(&str, &str)]) {
    let folder = Folder::new();
    for (world, expected) in cases {
        match folder.convert_text("pbrt/case.pbrt", &format!("{BEGIN}\n{world}\n")) {
            Ok((_, output)) => assert_eq!(shown(&output, tag), *expected, "{world}"),
            Err(error) => panic!("{world}\n{error}"),
        }
    }
}

/// A sphere of a material.
fn of(material: &str) -> String {
    format!("Material {material}\nShape \"sphere\"")
}

#[test]
fn materials_that_reflect_do_so_on_both_sides() {
    assert_each(
        "bsdf",
        &[
            (&of("\"diffuse\" \"rgb reflectance\" [ 0.1 0.2 0.3 ]"), "twosided(diffuse(reflectance=0.1,0.2,0.3))"),
            (&of("\"diffuse\""), "twosided(diffuse(reflectance=0.5,0.5,0.5))"),
            (&of("\"conductor\""), "twosided(conductor(material=Cu))"),
            (
                &of(
                    "\"conductor\" \"spectrum eta\" \"metal-Ag-eta\" \"spectrum k\" \"metal-Ag-k\" \"float roughness\" 0.25",
                ),
                "twosided(roughconductor(distribution=ggx alpha=0.5 material=Ag))",
            ),
            (
                // κ = 2√r/√(1 − r)
                &of(
                    "\"conductor\" \"rgb reflectance\" [ 0.5 0.8 0 ] \"float roughness\" 0.1 \"bool remaproughness\" false",
                ),
                "twosided(roughconductor(distribution=ggx alpha=0.1 eta=1,1,1 k=2,4,0))",
            ),
            (
                &of("\"coateddiffuse\" \"float eta\" 1.4"),
                "twosided(plastic(int_ior=1.4 ext_ior=1 nonlinear=true diffuse_reflectance=0.5,0.5,0.5))",
            ),
            (
                &of("\"coateddiffuse\" \"float roughness\" 0.04"),
                "twosided(roughplastic(distribution=ggx alpha=0.2 int_ior=1.5 ext_ior=1 nonlinear=true diffuse_reflectance=0.5,0.5,0.5))",
            ),
        ],
    );
}

#[test]
fn materials_that_transmit_have_their_own_back() {
    assert_each(
        "bsdf",
        &[
            (&of("\"dielectric\""), "dielectric(int_ior=1.5 ext_ior=1)"),
            (
                &of(
                    "\"dielectric\" \"spectrum eta\" \"glass-F11\" \"float uroughness\" 0.01 \"float vroughness\" 0.04",
                ),
                "roughdielectric(distribution=ggx alpha_u=0.1 alpha_v=0.2 int_ior=1.7847 ext_ior=1)",
            ),
            (&of("\"thindielectric\" \"float eta\" 1.3"), "thindielectric(int_ior=1.3 ext_ior=1)"),
            (
                // shares of 0.3 and 0.6 in a sum of 0.9
                &of(
                    "\"diffusetransmission\" \"rgb reflectance\" [ 0.3 0.2 0.1 ] \"rgb transmittance\" [ 0.2 0.6 0.4 ]",
                ),
                "blendbsdf(weight=0.6666667 principledthin(base_color=0.9,0.6,0.3 diff_trans=0 roughness=0.5) \
                 principledthin(base_color=0.3,0.9,0.6 diff_trans=2))",
            ),
            (
                "MakeNamedMaterial \"d\" \"string type\" \"diffuse\" MakeNamedMaterial \"n\" \"string type\" \"interface\" \
                 Material \"mix\" \"string materials\" [ \"n\" \"d\" ] \"float amount\" 0.75 Shape \"sphere\"",
                "blendbsdf(weight=0.75 null principledthin(base_color=0.5,0.5,0.5 diff_trans=0 roughness=0.5))",
            ),
            (&of("\"interface\""), "null"),
            (&of("\"\""), "null"),
        ],
    );
}

#[test]
fn materials_have_names_and_mixtures() {
    let named = "MakeNamedMaterial \"a\" \"string type\" \"diffuse\" MakeNamedMaterial \"b\" \"string type\" \"conductor\" \
                 MakeNamedMaterial \"m\" \"string type\" \"mix\" \"string materials\" [ \"a\" \"b\" ] \"float amount\" 0.25";
    assert_each(
        "bsdf",
        &[
            (
                &format!("{named} NamedMaterial \"m\" Shape \"sphere\""),
                "twosided(blendbsdf(weight=0.25 diffuse(reflectance=0.5,0.5,0.5) conductor(material=Cu)))",
            ),
            (
                "NamedMaterial \"late\" Shape \"sphere\" MakeNamedMaterial \"late\" \"string type\" \"thindielectric\"",
                "thindielectric(int_ior=1.5 ext_ior=1)",
            ),
        ],
    );
    assert_each(
        "shape",
        &[(
            &format!(
                "{named} NamedMaterial \"a\" Shape \"sphere\" NamedMaterial \"a\" Shape \"sphere\" \"float radius\" 2"
            ),
            "sphere(→a) sphere(to_world(matrix:2,0,0,0,0,2,0,0,0,0,2,0,0,0,0,1) →a)",
        )],
    );
}

#[test]
fn attributes_are_scoped_and_shared() {
    assert_each(
        "shape",
        &[(
            "Attribute \"shape\" \"float radius\" 2 AttributeBegin Translate 1 0 0 Shape \"sphere\" AttributeEnd Shape \"sphere\" \"float radius\" 3",
            "sphere(to_world(matrix:2,0,0,1,0,2,0,0,0,0,2,0,0,0,0,1) →material) sphere(to_world(matrix:3,0,0,0,0,3,0,0,0,0,3,0,0,0,0,1) →material)",
        )],
    );
}

#[test]
fn transforms_act_from_the_last_to_the_first() {
    let at = |transforms: &str| format!("{transforms} LightSource \"point\" \"point3 from\" [ 1 0 0 ]");
    assert_each(
        "emitter",
        &[
            (&at("Translate 0 2 0 Scale 3 3 3"), "point(position=3,2,0 intensity=1,1,1)"),
            (&at("Scale 3 3 3 Translate 0 2 0"), "point(position=3,6,0 intensity=1,1,1)"),
            (
                &at("Translate 0 2 0 CoordinateSystem \"a\" Identity Scale 2 2 2 CoordSysTransform \"a\""),
                "point(position=1,2,0 intensity=1,1,1)",
            ),
            (&at("TransformBegin Translate 5 5 5 TransformEnd Scale 2 2 2"), "point(position=2,0,0 intensity=1,1,1)"),
            (
                &at("Translate 1 1 1 Transform [ 1 0 0 0 0 1 0 0 0 0 1 0 7 8 9 1 ]"),
                "point(position=8,8,9 intensity=1,1,1)",
            ),
            (&at("ConcatTransform [ 0 1 0 0 -1 0 0 0 0 0 1 0 0 0 0 1 ]"), "point(position=0,1,0 intensity=1,1,1)"),
            (&at("LookAt 0 0 5 0 0 0 0 1 0"), "point(position=-1,0,5 intensity=1,1,1)"),
        ],
    );
}

#[test]
fn a_camera_looks_at_the_same_side_of_the_world_in_both() {
    // Bitterli's "Cornell box" exists in both formats, by its author: these are its transforms, the second for Mitsuba.
    let text = "Transform [ 1 -0 -0 -0 -0 1 -0 -0 -0 -0 -1 -0 -0 -1 6.8 1 ] Camera \"perspective\" \"float fov\" 19.5
        Film \"rgb\" \"integer xresolution\" 8 \"integer yresolution\" 8 WorldBegin LightSource \"infinite\"";
    let folder = Folder::new();
    let (_, output) = folder.convert_text("pbrt/case.pbrt", text).unwrap();
    let sensor = shown(&output, "sensor");
    assert!(
        sensor.starts_with("perspective(to_world(matrix:-1,0,0,0,0,1,0,1,0,0,-1,6.8,0,0,0,1) fov=19.5 fov_axis=x"),
        "{sensor}"
    );
}

#[test]
fn the_angle_of_view_is_that_of_the_shorter_side() {
    let folder = Folder::new();
    for (width, height, options, expected) in [
        (8, 8, "\"float fov\" 90", "fov=90 fov_axis=x"),
        // tan(θ/2) = 2
        (16, 8, "\"float fov\" 90", "fov=126.869896 fov_axis=x"),
        (8, 16, "\"float fov\" 90", "fov=90 fov_axis=x"),
        (
            16,
            8,
            "\"float fov\" 90 \"float screenwindow\" [ 0 2 -0.5 0.5 ]",
            "fov=90 fov_axis=x far_clip=1000000 principal_point_offset_x=0.5 ",
        ),
        (
            8,
            8,
            "\"float fov\" 90 \"float screenwindow\" [ -1 1 0 2 ]",
            "fov=90 fov_axis=x far_clip=1000000 principal_point_offset_y=-0.5 ",
        ),
        (8, 8, "\"float lensradius\" 0.1 \"float focaldistance\" 3", "fov=90 fov_axis=x"),
    ] {
        let text = format!(
            "Camera \"perspective\" {options} Film \"rgb\" \"integer xresolution\" {width} \"integer yresolution\" {height} WorldBegin"
        );
        let (_, output) = folder.convert_text("pbrt/case.pbrt", &text).unwrap();
        let sensor = shown(&output, "sensor");
        assert!(sensor.contains(expected), "{options}: {sensor}");
        assert_eq!(
            sensor.contains("thinlens(aperture_radius=0.1 focus_distance=3 "),
            options.contains("lensradius"),
            "{sensor}"
        );
    }
}

#[test]
fn films_and_filters_are_carried_over() {
    let folder = Folder::new();
    for (options, expected) in [
        ("PixelFilter \"triangle\" \"float xradius\" 1.5 \"float yradius\" 1.5", "tent(radius=1.5)"),
        ("PixelFilter \"mitchell\"", "mitchell(B=0.33333334 C=0.33333334)"),
        ("PixelFilter \"sinc\"", "lanczos(lobes=3)"),
        ("PixelFilter \"box\"", "box)"),
        ("", "gaussian(stddev=0.5)"),
        (
            "Film \"rgb\" \"integer xresolution\" 10 \"integer yresolution\" 10 \"float cropwindow\" [ 0.1 0.5 0 1 ]",
            "crop_offset_x=1 crop_offset_y=0 crop_width=4 crop_height=10",
        ),
        (
            "Film \"rgb\" \"integer pixelbounds\" [ 2 4 3 8 ]",
            "crop_offset_x=2 crop_offset_y=3 crop_width=2 crop_height=5",
        ),
    ] {
        let (_, output) =
            folder.convert_text("pbrt/case.pbrt", &format!("Camera \"orthographic\" {options} WorldBegin")).unwrap();
        let sensor = shown(&output, "sensor");
        assert!(sensor.starts_with("orthographic(") && sensor.contains(expected), "{options}: {sensor}");
    }
}

#[test]
fn paths_have_one_edge_more_than_what_scatters() {
    let folder = Folder::new();
    for (options, expected) in
        [("Integrator \"path\" \"integer maxdepth\" 0", "path(max_depth=1)"), ("", "path(max_depth=6)")]
    {
        let (_, output) = folder.convert_text("pbrt/case.pbrt", &format!("{options} {BEGIN}")).unwrap();
        assert_eq!(shown(&output, "integrator"), expected);
    }
}

#[test]
fn lights_have_the_brightness_that_pbrt_gives_them() {
    assert_each(
        "emitter",
        &[
            ("LightSource \"point\" \"rgb I\" [ 1 2 3 ] \"float scale\" 2", "point(position=0,0,0 intensity=2,4,6)"),
            // 4π of intensity 1
            ("LightSource \"point\" \"float power\" 12.566371", "point(position=0,0,0 intensity=1,1,1)"),
            (
                "LightSource \"distant\" \"point3 from\" [ 0 2 0 ] \"float illuminance\" 5",
                "directional(direction=0,-0.8944272,0.4472136 irradiance=5,5,5)",
            ),
            ("LightSource \"infinite\" \"rgb L\" [ 1 2 3 ]", "constant(radiance=1,2,3)"),
            // π of radiance 1
            ("LightSource \"infinite\" \"float illuminance\" 6.2831855", "constant(radiance=2,2,2)"),
            (
                "LightSource \"spot\" \"point3 to\" [ 0 0 2 ] \"float coneangle\" 20",
                "spot(to_world(matrix:0,-1,0,0,1,0,0,0,0,0,1,0,0,0,0,1) intensity=1,1,1 cutoff_angle=20 beam_width=15)",
            ),
        ],
    );
    let square = "Shape \"bilinearmesh\" \"point3 P\" [ 0 0 0  2 0 0  0 2 0  2 2 0 ]";
    assert_each(
        "shape",
        &[
            (
                &format!("AreaLightSource \"diffuse\" \"rgb L\" [ 3 2 1 ] \"float scale\" 2 {square}"),
                "ply(filename=out-files/bilinearmesh.ply face_normals=true →material area(radiance=6,4,2))",
            ),
            (
                // each triangle, of area 2, emits 2π
                &format!("AreaLightSource \"diffuse\" \"float power\" 6.2831855 {square}"),
                "ply(filename=out-files/bilinearmesh.ply face_normals=true →material area(radiance=1,1,1))",
            ),
            (
                "AreaLightSource \"diffuse\" \"bool twosided\" true Shape \"sphere\"",
                "sphere(→material area(radiance=1,1,1)) \
             sphere(to_world(matrix:0.9999,0,0,0,0,0.9999,0,0,0,0,0.9999,0,0,0,0,1) flip_normals=true →material area(radiance=1,1,1))",
            ),
        ],
    );
}

#[test]
fn a_film_s_gain_goes_into_its_lights() {
    let folder = Folder::new();
    let text = "Camera \"perspective\" \"float shutterclose\" 0.5 Film \"rgb\" \"float iso\" 400 WorldBegin LightSource \"infinite\"";
    let (report, output) = folder.convert_text("pbrt/case.pbrt", text).unwrap();
    assert_eq!(shown(&output, "emitter"), "constant(radiance=2,2,2)");
    assert!(report.notes.iter().any(|note| note.message.contains("gain of 2")), "{:?}", report.notes);
}

#[test]
fn light_by_its_spectrum_has_the_luminance_of_its_scale() {
    let folder = Folder::new();
    for (light, expected) in [
        // of xy = (0.3135, 0.3237) and (0.4369, 0.4041), where Planck's locus is at these temperatures
        ("\"blackbody L\" 6500", [10.43, 9.84, 10.35]),
        ("\"blackbody L\" 3000", [17.70, 8.44, 2.72]),
        // equal energy, XYZ = (1, 1, 1), is redder than daylight
        ("\"spectrum L\" [ 300 9 900 9 ]", [12.05, 9.48, 9.09]),
    ] {
        let text = format!("{BEGIN} LightSource \"infinite\" {light} \"float scale\" 10");
        let (_, output) = folder.convert_text("pbrt/case.pbrt", &text).unwrap();
        let shown = shown(&output, "emitter");
        let rgb = shown.trim_matches(|c: char| !c.is_ascii_digit()).split(',');
        let rgb: [f64; 3] = rgb.map(|n| n.parse().unwrap()).collect::<Vec<_>>().try_into().unwrap();
        for (value, expected) in rgb.into_iter().zip(expected) {
            assert!((value - expected).abs() < 0.1, "{light}: {shown}");
        }
    }
}

#[test]
fn objects_are_groups_and_instances() {
    assert_each(
        "shape",
        &[(
            "ObjectBegin \"o\" Translate 1 0 0 Shape \"sphere\" ObjectEnd Scale 2 2 2 ObjectInstance \"o\"",
            "shapegroup(sphere(to_world(matrix:1,0,0,1,0,1,0,0,0,0,1,0,0,0,0,1) →material)) \
         instance(to_world(matrix:2,0,0,0,0,2,0,0,0,0,2,0,0,0,0,1) →o)",
        )],
    );
}

#[test]
fn textures_lie_on_shapes_as_they_do_in_pbrt() {
    let picture = "Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"picture.png\"";
    let on = |texture: &str, shape: &str| {
        format!("{texture} Material \"diffuse\" \"texture reflectance\" \"t\" Shape {shape}")
    };
    let square = "\"bilinearmesh\" \"point3 P\" [ 0 0 0 1 0 0 0 1 0 1 1 0 ]";
    assert_each(
        "bsdf",
        &[
            (
                // pbrt's v of pictures runs upwards
                &on(picture, square),
                "twosided(diffuse(reflectance=bitmap(filename=picture.png to_uv(matrix:1,0,0,0,0,-1,0,1,0,0,1,0,0,0,0,1))))",
            ),
            (
                // and that of spheres the other way than Mitsuba's: they cancel
                &on(picture, "\"sphere\""),
                "twosided(diffuse(reflectance=bitmap(filename=picture.png)))",
            ),
            (
                &on(
                    &format!("{picture} \"float uscale\" 2 \"float udelta\" 0.5 \"string encoding\" \"linear\""),
                    square,
                ),
                "twosided(diffuse(reflectance=bitmap(filename=picture.png to_uv(matrix:2,0,0,0.5,0,-1,0,1,0,0,1,0,0,0,0,1) raw=true)))",
            ),
            (
                &on("Texture \"t\" \"spectrum\" \"checkerboard\" \"float uscale\" 4 \"float vscale\" 6", square),
                "twosided(diffuse(reflectance=checkerboard(color0=1,1,1 color1=0,0,0 to_uv(matrix:2,0,0,0,0,3,0,0,0,0,1,0,0,0,0,1))))",
            ),
            (
                &on(
                    "Texture \"c\" \"spectrum\" \"checkerboard\" Texture \"t\" \"spectrum\" \"mix\" \"texture tex1\" \"c\" \"rgb tex2\" [ 1 0 0 ] \"float amount\" 0.25",
                    square,
                ),
                "twosided(diffuse(reflectance=checkerboard(color0=1,0.75,0.75 color1=0.25,0,0 to_uv(matrix:0.5,0,0,0,0,0.5,0,0,0,0,1,0,0,0,0,1))))",
            ),
            (
                &on(
                    "Texture \"c\" \"spectrum\" \"constant\" \"rgb value\" [ 0.5 0.25 1 ] Texture \"t\" \"spectrum\" \"scale\" \"texture tex\" \"c\" \"float scale\" 0.5",
                    square,
                ),
                "twosided(diffuse(reflectance=0.25,0.125,0.5))",
            ),
            (
                &format!("Texture \"a\" \"float\" \"checkerboard\" Shape {square} \"texture alpha\" \"a\""),
                "mask(opacity=checkerboard(color0=1,1,1 color1=0,0,0 to_uv(matrix:0.5,0,0,0,0,0.5,0,0,0,0,1,0,0,0,0,1)) twosided(diffuse))",
            ),
        ],
    );
}

#[test]
fn the_front_of_a_mesh_is_where_pbrt_has_it() {
    // A triangle whose corners run counter-clockwise around +z, with and without normals.
    let flat = "\"point3 P\" [ 0 0 0 1 0 0 0 1 0 ]";
    let smooth = format!("{flat} \"normal3 N\" [ 0 0 1 0 0 1 0 0 1 ]");
    let against = format!("{flat} \"normal3 N\" [ 0 0 -1 0 0 -1 0 0 -1 ]");
    let folder = Folder::new();
    for (mesh, turn, front) in [
        (flat, "", 1.0),
        (flat, "ReverseOrientation", -1.0),
        (flat, "Scale -1 1 1", 1.0), // a mirror that leaves +z alone does not turn the front
        (flat, "Scale 1 1 -1", -1.0),
        (flat, "ReverseOrientation Scale -1 1 1", -1.0),
        (&smooth, "", 1.0),
        (&smooth, "Scale -1 1 1", 1.0),
        (&smooth, "ReverseOrientation", -1.0),
        (&against, "", -1.0),
        (&against, "Scale 1 1 -1", 1.0),
    ] {
        let text = format!("{BEGIN} LightSource \"infinite\" {turn} Shape \"trianglemesh\" {mesh}");
        let (_, output) = folder.convert_text("pbrt/case.pbrt", &text).unwrap();
        let description = relt::load::scene(&output, &[]).unwrap();
        let ShapeGeometry::Mesh(mesh) = &description.shapes[0].geometry else { panic!("no mesh") };
        let [a, b, c] = mesh.triangles[0].map(|i| mesh.positions()[i as usize]);
        assert_eq!((b - a).cross(c - a).normalize(), Vec3::Z * front, "{text}");
    }
}

#[test]
fn a_mesh_without_texture_coordinates_gets_pbrt_s() {
    let folder = Folder::new();
    let text = format!(
        "{BEGIN} LightSource \"infinite\" Texture \"t\" \"spectrum\" \"checkerboard\" Material \"diffuse\" \"texture reflectance\" \"t\"
         Shape \"trianglemesh\" \"point3 P\" [ 0 0 0 1 0 0 1 1 0 0 1 0 ] \"integer indices\" [ 0 1 2 0 2 3 ]"
    );
    let (_, output) = folder.convert_text("pbrt/case.pbrt", &text).unwrap();
    let description = relt::load::scene(&output, &[]).unwrap();
    let ShapeGeometry::Mesh(mesh) = &description.shapes[0].geometry else { panic!("no mesh") };
    let uvs: Vec<[f32; 2]> = mesh.uvs.iter().map(|uv| uv.to_array()).collect();
    assert_eq!(uvs, [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]].repeat(2));
}

#[test]
fn a_ply_file_is_referred_to_where_it_can_be() {
    assert_each(
        "shape",
        &[
            ("Shape \"plymesh\" \"string filename\" \"ball.ply\"", "ply(filename=ball.ply →material)"),
            (
                "Scale 2 2 2 Shape \"plymesh\" \"string filename\" \"ball.ply\"",
                "ply(filename=ball.ply to_world(matrix:2,0,0,0,0,2,0,0,0,0,2,0,0,0,0,1) →material)",
            ),
            // its normals would point against its corners
            (
                "Scale -1 1 1 Shape \"plymesh\" \"string filename\" \"ball.ply\"",
                "ply(filename=out-files/ball.ply →material)",
            ),
        ],
    );
}

#[test]
fn a_mesh_is_smooth_only_where_it_has_normals() {
    let mesh = "Shape \"trianglemesh\" \"point3 P\" [ 0 0 0 1 0 0 0 1 0 ]";
    assert_each(
        "shape",
        &[
            (mesh, "ply(filename=out-files/trianglemesh.ply face_normals=true →material)"),
            (
                &format!("{mesh} \"normal3 N\" [ 0 0 1 0 0 1 0 0 1 ]"),
                "ply(filename=out-files/trianglemesh.ply →material)",
            ),
        ],
    );
}

#[test]
fn files_are_seen_from_the_folder_of_the_scene() {
    let folder = Folder::new();
    std::fs::create_dir(folder.path("pbrt/parts")).unwrap();
    std::fs::write(folder.path("pbrt/parts/ball.pbrt"), "Shape \"plymesh\" \"string filename\" \"ball.ply\"").unwrap();
    let (_, output) = folder.convert_text("pbrt/case.pbrt", &format!("{BEGIN} Include \"parts/ball.pbrt\"")).unwrap();
    assert_eq!(shown(&output, "shape"), "ply(filename=ball.ply →material)");
}

#[test]
fn quadrics_are_exact_where_they_are_whole() {
    assert_each(
        "shape",
        &[
            (
                "Shape \"disk\" \"float height\" 2 \"float radius\" 3",
                "disk(to_world(matrix:3,0,0,0,0,3,0,0,0,0,3,2,0,0,0,1) →material)",
            ),
            (
                "Scale -1 1 1 Shape \"sphere\"",
                "sphere(to_world(matrix:-1,0,0,0,0,-1,0,0,0,0,1,0,0,0,0,1) flip_normals=true →material)",
            ),
            ("ReverseOrientation Shape \"sphere\"", "sphere(flip_normals=true →material)"),
            ("Scale 2 2 2 Shape \"cylinder\" \"float radius\" 0.5", "cylinder(p0=0,0,-2 p1=0,0,2 radius=1 →material)"),
            ("Shape \"sphere\" \"float zmax\" 0.5", "ply(filename=out-files/sphere.ply →material)"),
            ("Scale 1 2 1 Shape \"disk\"", "ply(filename=out-files/disk.ply →material)"),
        ],
    );
}
