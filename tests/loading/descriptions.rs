//! Scene files become the descriptions they mean.
//!
//! What Mitsuba does was taken from Mitsuba 3.9.1 (PyPI), by tracing rays against small scenes.

use std::f32::consts::FRAC_1_SQRT_2;
use std::path::{Path, PathBuf};

use crate::files::{Folder, around, mesh, scene_beside, scene_with, shape};
use glam::{Affine3A, Mat3A, Vec2, Vec3, Vec3A};
use relt::film::Filter;
use relt::scene::description::{FovAxis, Projection, ShapeDescription, ShapeGeometry, Sides};
use relt::scene::lights::{Constant, Light, Point};
use relt::scene::materials::Material;
use relt::scene::{Mesh, SceneDescription};

fn assert_near(a: impl Into<Vec3>, b: impl Into<Vec3>, what: &str) {
    let (a, b) = (a.into(), b.into());
    assert!(a.distance(b) <= 1e-5 * b.length().max(1.0), "{what}: {a} instead of {b}");
}

fn assert_same_map(a: Affine3A, b: Affine3A, what: &str) {
    for (name, p) in [("origin", Vec3::ZERO), ("x", Vec3::X), ("y", Vec3::Y), ("z", Vec3::Z)] {
        assert_near(a.transform_point3(p), b.transform_point3(p), &format!("{what}: image of {name}"));
    }
}

// ---- scenes of the repository

/// A scene of the repository.
fn own_scene(name: &str) -> SceneDescription {
    load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name).join("scene.xml"))
}

fn load(path: &Path) -> SceneDescription {
    relt::load::scene(path, &[]).unwrap_or_else(|error| panic!("{error}"))
}

/// The field of view and what it spans.
fn field_of_view(scene: &SceneDescription) -> (f32, FovAxis) {
    match scene.camera.projection {
        Projection::Perspective { fov, fov_axis, principal_point: [0.0, 0.0], lens: None } => (fov, fov_axis),
        other => panic!("{other:?} is no plain pinhole camera"),
    }
}

/// Number of triangles of each shape.
fn triangle_counts(scene: &SceneDescription) -> Vec<(&str, usize)> {
    scene.shapes.iter().map(|s| (s.name.as_str(), mesh(s).triangles.len())).collect()
}

/// Shapes that emit, and what.
fn emissions(scene: &SceneDescription) -> Vec<(&str, Vec3)> {
    scene.shapes.iter().filter_map(|s| Some((s.name.as_str(), s.emission.as_ref()?.mean()))).collect()
}

/// The material of a shape's front.
fn front<'a>(scene: &'a SceneDescription, shape: &ShapeDescription) -> &'a Material {
    match shape.sides {
        Sides::One(m) | Sides::Two { front: m, .. } => scene.appearances[m as usize].plain().expect("a plain one"),
    }
}

fn named<'a>(scene: &'a SceneDescription, name: &str) -> &'a ShapeDescription {
    scene.shapes.iter().find(|s| s.name == name).unwrap_or_else(|| panic!("no shape {name}"))
}

/// What the three scenes have in common.
fn assert_own_conventions(scene: &SceneDescription) {
    assert_eq!((scene.integrator.max_depth, scene.integrator.rr_depth), (Some(16), 5));
    assert_eq!((scene.film.width, scene.film.height, scene.film.filter), (256, 256, Filter::Box));
    assert_eq!((scene.camera.near_clip, scene.camera.far_clip), (1e-3, 100.0));
    assert_eq!(field_of_view(scene).1, FovAxis::Smaller);
    assert!(scene.lights.is_empty() && scene.warnings.is_empty(), "{:?} {:?}", scene.lights, scene.warnings);
    for shape in &scene.shapes {
        assert!(mesh(shape).normals.is_empty(), "{} has face_normals", shape.name);
    }
}

#[test]
fn the_cornell_box_loads_with_the_numbers_of_its_file() {
    let scene = own_scene("cornell-box");
    assert_own_conventions(&scene);
    let expected = [
        ("floor", 2),
        ("ceiling", 2),
        ("back", 2),
        ("greenwall", 2),
        ("redwall", 2),
        ("smallbox", 12),
        ("largebox", 12),
        ("light", 2),
    ];
    assert_eq!(triangle_counts(&scene), expected);
    assert_eq!(emissions(&scene), [("light", Vec3::new(18.387, 13.9873, 6.75357))]);
    assert_eq!(field_of_view(&scene).0, 39.3077);
    // From (0, 0, 3.9) along −z with y up, x is to the left: that is a half turn about y.
    let expected = Affine3A::from_translation(Vec3::new(0.0, 0.0, 3.9)) * Affine3A::from_scale(Vec3::new(-1., 1., -1.));
    assert_same_map(scene.camera.to_world, expected, "camera");
    assert_eq!(scene.appearances.len(), 3, "each is listed once");
    assert!(scene.shapes.iter().all(|s| matches!(s.sides, Sides::Two { front, back } if front == back)));
    let Material::Diffuse(red) = front(&scene, named(&scene, "redwall")) else { panic!("red is diffuse") };
    assert_eq!(red.reflectance, Vec3::new(0.570068, 0.0430135, 0.0443706));
}

#[test]
fn the_caustic_loads_with_glass_that_has_one_side_and_a_mirror_that_has_two() {
    let scene = own_scene("caustic");
    assert_own_conventions(&scene);
    let counts = triangle_counts(&scene);
    assert_eq!(counts.iter().map(|(_, count)| count).sum::<usize>(), 2 * 20480 + 7 * 2);
    assert_eq!(emissions(&scene), [("lamp", Vec3::new(95.0, 88.0, 75.0))]);
    let glass = named(&scene, "glassball");
    assert!(matches!(glass.sides, Sides::One(_)));
    assert_eq!(front(&scene, glass).name(), "dielectric");
    let mirror = named(&scene, "mirrorball");
    assert!(matches!(mirror.sides, Sides::Two { .. }));
    assert_eq!(front(&scene, mirror).name(), "conductor");
    assert_eq!(scene.appearances.len(), 6, "the seventh of the file, mat_bars, is used by nothing");
    let forward = Vec3::new(0.0, -0.25, -2.45).normalize();
    assert_near(scene.camera.to_world.transform_vector3(Vec3::Z), forward, "viewing direction");
    assert_near(scene.camera.to_world.transform_vector3(Vec3::X), Vec3::NEG_X, "left");
}

#[test]
fn the_lattice_loads_with_its_twenty_bars() {
    let scene = own_scene("lattice");
    assert_own_conventions(&scene);
    let counts = triangle_counts(&scene);
    assert!(counts.contains(&("bars", 20 * 12)), "{counts:?}");
    assert_eq!(counts.iter().map(|(_, count)| count).sum::<usize>(), 306);
    assert_eq!(emissions(&scene), [("lamp", Vec3::new(80.0, 74.0, 62.0))]);
    assert_eq!(field_of_view(&scene).0, 75.0);
}

#[test]
#[ignore = "needs RELT_SCENES, a folder with scenes of others"]
fn a_scene_of_others_loads() {
    let folder = PathBuf::from(std::env::var("RELT_SCENES").expect("RELT_SCENES names a folder"));
    let scene = load(&folder.join("bitterli-cornell-box/scene.xml"));
    assert_eq!(triangle_counts(&scene).iter().map(|(_, count)| count).sum::<usize>(), 6 * 2 + 2 * 12);
    assert_eq!(emissions(&scene), [("Light", Vec3::new(17.0, 12.0, 4.0))]);
    assert_eq!(field_of_view(&scene).1, FovAxis::X);
    // The walls look away from the room, the lamp into it, as in Mitsuba.
    for (name, direction) in
        [("BackWall", Vec3::NEG_Z), ("RightWall", Vec3::X), ("LeftWall", Vec3::NEG_X), ("Light", Vec3::NEG_Y)]
    {
        assert_near(facing(named(&scene, name)), direction, name);
    }
}

// ---- defaults

#[test]
fn a_bare_sensor_is_that_of_mitsuba() {
    let scene = scene_with("");
    let camera = scene.camera;
    // Mitsuba prints x_fov = 38.1848 for it: 50 mm on film of 36 × 24 mm, whose diagonal that of 4:3 matches.
    let (fov, axis) = field_of_view(&scene);
    let half_diagonal = (fov / 2.0).to_radians().tan();
    assert_eq!(axis, FovAxis::Diagonal);
    assert!((2.0 * (0.8 * half_diagonal).atan().to_degrees() - 38.1848).abs() < 1e-4, "{fov}");
    assert_eq!((camera.near_clip, camera.far_clip), (1e-2, 1e4));
    assert_same_map(camera.to_world, Affine3A::IDENTITY, "camera");
    assert_eq!((scene.film.width, scene.film.height), (768, 576));
    assert_eq!(scene.film.filter, Filter::Gaussian { stddev: 0.5 });
    assert_eq!((scene.integrator.max_depth, scene.integrator.rr_depth), (None, 5));
}

#[test]
fn parameters_that_do_not_concern_relt_are_accepted() {
    scene_with("<bsdf type='diffuse' id='unused'/>");
    let text =
        "<scene version='3.0.0'><integrator type='path'><boolean name='hide_emitters' value='false'/></integrator>
        <sensor type='perspective'><integer name='fov' value='30'/>
        <sampler type='independent'><integer name='sample_count' value='16'/><integer name='seed' value='1'/></sampler>
        <film type='hdrfilm'><string name='file_format' value='openexr'/><string name='pixel_format' value='rgba'/>
        <string name='component_format' value='float16'/><boolean name='banner' value='false'/>
        <rfilter type='tent'/></film></sensor><emitter type='constant'/></scene>";
    let scene = Folder::new(&[]).load(text, &[]).unwrap();
    assert_eq!(scene.film.filter, Filter::Tent { radius: 1.0 });
    assert_eq!(field_of_view(&scene), (30.0, FovAxis::X));
}

#[test]
fn a_surface_without_bsdf_is_grey_and_black_where_it_emits() {
    let scene = scene_with("<shape type='rectangle'/><shape type='rectangle'><emitter type='area'/></shape>");
    let reflectances: Vec<_> = scene
        .shapes
        .iter()
        .map(|s| match front(&scene, s) {
            Material::Diffuse(diffuse) => diffuse.reflectance,
            other => panic!("{other:?}"),
        })
        .collect();
    assert_eq!(reflectances, [Vec3::splat(0.5), Vec3::ZERO]);
    assert!(scene.shapes.iter().all(|s| matches!(s.sides, Sides::One(_))));
    assert_eq!(scene.shapes[1].emission, Some(Vec3::ONE.into()));
}

#[test]
fn lights_that_are_no_surfaces_are_listed() {
    let scene = scene_with(
        "<emitter type='point'><rgb name='intensity' value='1 2 3'/><point name='position' x='1' y='2' z='3'/></emitter>
        <emitter type='point'><transform name='to_world'><translate y='4'/></transform></emitter>",
    );
    let position = |x, y, z| Vec3::new(x, y, z);
    assert_eq!(
        scene.lights[0],
        Light::Point(Point { position: position(1., 2., 3.), intensity: position(1., 2., 3.) })
    );
    assert_eq!(scene.lights[1], Light::Point(Point { position: position(0., 4., 0.), intensity: Vec3::ONE }));
    assert_eq!(scene.lights[2], Light::Constant(Constant { radiance: Vec3::ONE }));
}

// ---- substitution and references

#[test]
fn defaults_apply_unless_a_define_gives_the_value() {
    let text = "<scene version='3.0.0'><default name='res' value='64'/><default name='resx' value='$res'/>
        <sensor type='perspective'><film type='hdrfilm'><integer name='width' value='$resx'/>
        <integer name='height' value='${h}'/></film></sensor><emitter type='constant'/></scene>"
        .replace("${h}", "$h");
    let folder = Folder::new(&[]);
    let size = |defines: &[(&str, &str)]| {
        let film = folder.load(&text, defines).unwrap_or_else(|error| panic!("{error}")).film;
        (film.width, film.height)
    };
    assert_eq!(size(&[("h", "10")]), (64, 10));
    assert_eq!(size(&[("h", "10"), ("res", "32")]), (32, 10));
    assert_eq!(size(&[("h", "10"), ("resx", "16"), ("res", "32")]), (16, 10));
}

#[test]
fn names_are_replaced_within_longer_values() {
    let files: [(&str, &[u8]); 1] = [("triangle.obj", TRIANGLE_OBJ)];
    let text = "<default name='part' value='angle'/>
        <shape type='obj'><string name='filename' value='tri$part.obj'/></shape>";
    shape(&files, text);
}

#[test]
fn references_reach_forward_backward_and_into_shapes() {
    let scene = scene_with(
        "<shape type='rectangle'><ref id='later'/></shape>
        <bsdf type='diffuse' id='later'/>
        <shape type='rectangle'><bsdf type='conductor' id='inner'/></shape>
        <shape type='rectangle'><ref name='bsdf' id='inner'/></shape>
        <shape type='rectangle'><bsdf type='twosided'><ref id='later'/><ref id='inner'/></bsdf></shape>",
    );
    let names: Vec<_> = scene.shapes.iter().map(|s| front(&scene, s).name()).collect();
    assert_eq!(names, ["diffuse", "conductor", "conductor", "diffuse"]);
    assert_eq!(scene.shapes[1].sides, scene.shapes[2].sides, "the same material is listed once");
    let Sides::Two { front, back } = scene.shapes[3].sides else { panic!("two sides") };
    let sides = [front, back].map(|m| scene.appearances[m as usize].plain().unwrap().name());
    assert_eq!(sides, ["diffuse", "conductor"]);
}

#[test]
fn colours_are_one_number_or_three() {
    let radiance = |value: &str| {
        let text = format!("<shape type='rectangle'><emitter type='area'>{value}</emitter></shape>");
        shape(&[], &text).emission.unwrap().mean()
    };
    for (value, expected) in [
        ("<rgb name='radiance' value='1, 2, 3'/>", Vec3::new(1.0, 2.0, 3.0)),
        ("<rgb name='radiance' value=' 1 2.5e0\t3 '/>", Vec3::new(1.0, 2.5, 3.0)),
        ("<rgb name='radiance' value='0.25'/>", Vec3::splat(0.25)),
        ("<float name='radiance' value='4'/>", Vec3::splat(4.0)),
        ("<spectrum name='radiance' value='5'/>", Vec3::splat(5.0)),
    ] {
        assert_eq!(radiance(value), expected, "{value}");
    }
}

// ---- transforms

/// The camera transform of these steps.
fn transform(steps: &str) -> Affine3A {
    let text = format!(
        "<scene version='3.0.0'><emitter type='constant'/><sensor type='perspective'>
        <transform name='to_world'>{steps}</transform></sensor></scene>"
    );
    Folder::new(&[]).load(&text, &[]).unwrap_or_else(|error| panic!("{steps}\n{error}")).camera.to_world
}

/// Rows of the upper 3 × 4 part of a matrix.
fn rows(m: [f32; 12]) -> Affine3A {
    let row = |i: usize| Vec3A::new(m[i], m[i + 1], m[i + 2]);
    let matrix3 = Mat3A::from_cols(row(0), row(4), row(8)).transpose();
    Affine3A { matrix3, translation: Vec3A::new(m[3], m[7], m[11]) }
}

#[test]
fn transforms_are_those_computed_by_hand() {
    let (c, s) = (0.75_f32.sqrt(), 0.5);
    let cases = [
        ("", Affine3A::IDENTITY),
        ("<translate x='1' z='3'/>", rows([1., 0., 0., 1., 0., 1., 0., 0., 0., 0., 1., 3.])),
        ("<translate value='1, 2, 3'/>", rows([1., 0., 0., 1., 0., 1., 0., 2., 0., 0., 1., 3.])),
        ("<translate value='2'/>", rows([1., 0., 0., 2., 0., 1., 0., 2., 0., 0., 1., 2.])),
        ("<rotate x='1' angle='90'/>", rows([1., 0., 0., 0., 0., 0., -1., 0., 0., 1., 0., 0.])),
        ("<rotate value='0,1,0' angle='30'/>", rows([c, 0., s, 0., 0., 1., 0., 0., -s, 0., c, 0.])),
        ("<scale x='-1'/>", rows([-1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0.])),
        ("<matrix value='0 -1 0 1 0 0 0 0 1'/>", rows([0., -1., 0., 0., 1., 0., 0., 0., 0., 0., 1., 0.])),
        (
            "<matrix value='0 1 0 7, 0 0 1 8, 1 0 0 9, 0 0 0 1'/>",
            rows([0., 1., 0., 7., 0., 0., 1., 8., 1., 0., 0., 9.]),
        ),
        // In order: first to x = 1, then a quarter turn about z takes that to y = 1.
        ("<translate x='1'/><rotate z='1' angle='90'/>", rows([0., -1., 0., 0., 1., 0., 0., 1., 0., 0., 1., 0.])),
        ("<rotate z='1' angle='90'/><translate x='1'/>", rows([0., -1., 0., 1., 1., 0., 0., 0., 0., 0., 1., 0.])),
        // As Mitsuba prints it.
        (
            "<lookat origin='1,2,3' target='0,0,0' up='0,1,0'/>",
            rows([
                -0.948_683_3,
                -0.169_030_9,
                -0.267_261_24,
                1.,
                0.,
                0.845_154_3,
                -0.534_522_5,
                2.,
                0.316_227_76,
                -0.507_092_55,
                -0.801_783_7,
                3.,
            ]),
        ),
    ];
    for (steps, expected) in cases {
        assert_same_map(transform(steps), expected, steps);
    }
}

#[test]
fn lookat_without_up_is_a_frame_that_looks_at_the_target() {
    let map = transform("<lookat origin='1 2 3' target='0 0 0'/>");
    // As Mitsuba 3.9.1 prints it, to four digits.
    let y = Vec3::new(0.9604, -0.0793, -0.2673);
    assert!(map.transform_vector3(Vec3::Y).distance(y) < 1e-4, "{map}");
    assert_near(map.transform_vector3(Vec3::Z), -Vec3::new(1., 2., 3.).normalize(), "viewing direction");
}

#[test]
fn scales_and_shears_apply_to_vertices() {
    let text = "<shape type='rectangle'><transform name='to_world'><scale value='1, 2, 3'/>
        <matrix value='1 1 0 0 1 0 0 0 1'/><translate z='-1'/></transform></shape>";
    let shape = shape(&[], text);
    let expected = [(-3., -2.), (-1., -2.), (3., 2.), (1., 2.)].map(|(x, y)| Vec3::new(x, y, -1.0));
    assert_eq!(mesh(&shape).positions(), expected);
}

// ---- shapes

/// Where the front of the first triangle looks.
fn facing(shape: &ShapeDescription) -> Vec3 {
    let [a, b, c] = mesh(shape).corners(0);
    (b - a).cross(c - a).normalize()
}

/// A shape of a type, scaled, with further elements.
fn scaled(kind: &str, scale: &str, inner: &str) -> ShapeDescription {
    let text =
        format!("<shape type='{kind}'>{inner}<transform name='to_world'><scale value='{scale}'/></transform></shape>");
    let files: [(&str, &[u8]); 2] = [("flat.obj", TRIANGLE_OBJ), ("smooth.obj", SMOOTH_OBJ)];
    shape(&files, &text)
}

const FLIP: &str = "<boolean name='flip_normals' value='true'/>";
const FLAT: &str = "<string name='filename' value='flat.obj'/>";
const SMOOTH: &str = "<string name='filename' value='smooth.obj'/>";
const FACE_NORMALS: &str = "<boolean name='face_normals' value='true'/>";

const TRIANGLE_OBJ: &[u8] = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
const SMOOTH_OBJ: &[u8] = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0.6 0.8\nvt 0.25 0.75\nf 1/1/1 2/1/1 3/1/1\n";

#[test]
fn fronts_of_mirrored_shapes_are_where_mitsuba_has_them() {
    // z of the front, for: as it is, mirrored in x, mirrored in z. In Mitsuba the shading frame tells the front.
    for (kind, inner, expected) in [
        ("rectangle", "", [1.0, 1.0, -1.0]),
        ("rectangle", FLIP, [-1.0, -1.0, 1.0]),
        ("obj", FLAT, [1.0, -1.0, 1.0]),
        ("obj", &[FLAT, FLIP].concat(), [-1.0, 1.0, -1.0]),
        ("obj", SMOOTH, [1.0, 1.0, -1.0]),
        ("obj", &[SMOOTH, FLIP].concat(), [-1.0, -1.0, 1.0]),
        ("obj", &[SMOOTH, FACE_NORMALS].concat(), [1.0, -1.0, 1.0]),
    ] {
        for (scale, expected) in ["1", "-1, 1, 1", "1, 1, -1"].into_iter().zip(expected) {
            assert_near(facing(&scaled(kind, scale, inner)), Vec3::Z * expected, &format!("{kind} {inner} {scale}"));
        }
    }
}

#[test]
fn disks_keep_their_front_and_spheres_lose_it_when_mirrored_as_in_mitsuba() {
    for (scale, inner, expected_normal, expected_flipped) in [
        ("1", "", 1.0, false),
        ("1", FLIP, -1.0, true),
        ("-1, 1, 1", "", 1.0, true),
        ("-1, 1, 1", FLIP, -1.0, false),
        ("1, 1, -1", "", -1.0, true),
    ] {
        let ShapeGeometry::Disk { axes, .. } = scaled("disk", scale, inner).geometry else { panic!("a disk") };
        let normal = axes.z_axis;
        assert_near(normal, Vec3::Z * expected_normal, &format!("disk {scale} {inner}"));
        let ShapeGeometry::Sphere { flipped, .. } = scaled("sphere", scale, inner).geometry else { panic!("a sphere") };
        assert_eq!(flipped, expected_flipped, "sphere {scale} {inner}");
    }
}

#[test]
fn a_cube_faces_outwards_even_if_mirrored() {
    for (scale, inner, outwards) in
        [("1", "", 1.0), ("-1, 1, 1", "", 1.0), ("2", FLIP, -1.0), ("1, 1, -1", FACE_NORMALS, -1.0)]
    {
        let cube = scaled("cube", scale, inner);
        let mesh = mesh(&cube);
        assert_eq!((mesh.triangles.len(), mesh.positions().len(), mesh.uvs.len()), (12, 24, 24));
        for t in 0..12 {
            let [a, b, c] = mesh.corners(t);
            let normal = (b - a).cross(c - a).normalize();
            assert!(normal.dot((a + b + c) / 3.0) * outwards > 0.9, "{scale} {inner}: triangle {t}");
            assert_eq!(normal.abs().max_element(), 1.0);
        }
    }
    let area: f64 = (0..12).map(|t| mesh(&scaled("cube", "1, 2, 3", "")).area(t)).sum();
    assert_eq!(area, 2.0 * 4.0 * (2.0 + 3.0 + 6.0));
}

#[test]
fn spheres_and_disks_are_scaled_turned_and_moved() {
    let text = "<shape type='sphere'><point name='center' x='1' y='0' z='0'/><float name='radius' value='3'/>
        <transform name='to_world'><scale value='2'/><rotate z='1' angle='90'/><translate z='5'/></transform></shape>";
    let ShapeGeometry::Sphere { center, radius, flipped, .. } = shape(&[], text).geometry else { panic!("a sphere") };
    assert_near(center, Vec3::new(0.0, 2.0, 5.0), "centre");
    assert!((radius - 6.0).abs() < 1e-5 && !flipped);
    let text = "<shape type='disk'><transform name='to_world'><scale value='2'/><rotate x='1' angle='90'/>
        <translate x='1'/></transform></shape>";
    let ShapeGeometry::Disk { center, radius, axes } = shape(&[], text).geometry else { panic!("a disk") };
    let normal = axes.z_axis;
    assert_near(center, Vec3::X, "centre");
    assert_near(normal, Vec3::NEG_Y, "normal");
    assert!((radius - 2.0).abs() < 1e-5);
}

#[test]
fn cylinders_are_scaled_turned_and_moved_and_may_be_stretched_along_their_axis() {
    let cylinder = |text: &str| match shape(&[], text).geometry {
        ShapeGeometry::Cylinder { start, length, radius, axes, flipped } => {
            assert_near(axes.x_axis.cross(axes.y_axis), axes.z_axis, "axes");
            (start, start + length * axes.z_axis, radius, flipped)
        }
        other => panic!("a cylinder: {other:?}"),
    };
    let (start, end, radius, flipped) = cylinder("<shape type='cylinder'/>");
    assert_eq!((start, end, radius, flipped), (Vec3::ZERO, Vec3::Z, 1.0, false));
    let text = "<shape type='cylinder'><point name='p0' x='1' y='0' z='0'/><point name='p1' x='1' y='2' z='0'/>
        <float name='radius' value='3'/><boolean name='flip_normals' value='true'/><transform name='to_world'>
        <scale x='2' y='5' z='2'/><rotate z='1' angle='90'/><translate z='5'/></transform></shape>";
    let (start, end, radius, flipped) = cylinder(text);
    assert_near(start, Vec3::new(0.0, 2.0, 5.0), "start");
    assert_near(end, Vec3::new(-10.0, 2.0, 5.0), "end");
    assert!((radius - 6.0).abs() < 1e-5 && flipped);
    // in a mirror the front stays outside and surface coordinates are mirrored, as in Mitsuba
    let text = "<shape type='cylinder'><transform name='to_world'><scale x='-1'/></transform></shape>";
    let ShapeGeometry::Cylinder { axes, flipped, .. } = shape(&[], text).geometry else { panic!("a cylinder") };
    assert_eq!((axes.x_axis, axes.y_axis, axes.z_axis, flipped), (Vec3::NEG_X, Vec3::Y, Vec3::Z, false));
}

#[test]
fn shading_normals_stay_perpendicular_under_uneven_scales() {
    // The plane with normal (0, 0.6, 0.8), scaled by 1, 2, 3.
    let normals = &mesh(&scaled("obj", "1, 2, 3", SMOOTH)).normals.clone();
    assert_eq!(normals.len(), 3);
    assert_near(normals[0], Vec3::new(0.0, 0.6 / 2.0, 0.8 / 3.0).normalize(), "normal");
    let flipped = scaled("obj", "1", &[SMOOTH, FLIP].concat());
    assert_near(mesh(&flipped).normals[0], Vec3::new(0.0, -0.6, -0.8), "flipped normal");
    assert!(mesh(&scaled("obj", "1", &[SMOOTH, FACE_NORMALS].concat())).normals.is_empty());
}

#[test]
fn meshes_without_normals_get_smooth_ones_as_in_mitsuba() {
    let obj: &[u8] = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 1\nf 1 2 3\nf 2 4 3\n";
    let ply: &[u8] = b"ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
        element face 2\nproperty list uchar int vertex_index\nend_header\n0 0 0\n1 0 0\n0 1 0\n1 1 1\n3 0 1 2\n3 1 3 2\n";
    // as Mitsuba 3.9.1 has them: weighted by angles, 45° and 60° at the fold
    let fold = Vec3::new(-0.370_482_77, -0.370_482_77, 0.851_754_07);
    let expected = [Vec3::Z, fold, fold, Vec3::new(-1.0, -1.0, 1.0).normalize()];
    for (kind, content) in [("obj", obj), ("ply", ply)] {
        let file = format!("folded.{kind}");
        let read = |inner: &str| {
            let text = format!("<shape type='{kind}'><string name='filename' value='{file}'/>{inner}</shape>");
            mesh(&shape(&[(&file, content)], &text)).clone()
        };
        for (i, expected) in expected.into_iter().enumerate() {
            assert_near(read("").normals[i], expected, &format!("{kind}, normal {i}"));
            assert_near(read(FLIP).normals[i], -expected, &format!("{kind}, flipped normal {i}"));
        }
        // a mirror turns them, as it turns the corners
        let mirrored = read("<transform name='to_world'><scale x='-1'/></transform>");
        assert_near(mirrored.normals[1], Vec3::new(-fold.x, fold.y, fold.z) * -1.0, "mirrored");
        assert!(read(FACE_NORMALS).normals.is_empty());
    }
}

#[test]
fn texture_coordinates_of_obj_files_are_turned_upside_down_as_in_mitsuba() {
    let keep = "<boolean name='flip_tex_coords' value='false'/>";
    assert_eq!(mesh(&scaled("obj", "1", SMOOTH)).uvs, [Vec2::new(0.25, 0.25); 3]);
    assert_eq!(mesh(&scaled("obj", "1", &[SMOOTH, keep].concat())).uvs, [Vec2::new(0.25, 0.75); 3]);
    let rectangle = scaled("rectangle", "1", "");
    assert_eq!(mesh(&rectangle).uvs, [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y]);
}

#[test]
fn polygons_become_fans_and_corners_with_two_normals_become_two_vertices() {
    let obj = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv -1 0.5 0\nv 9 9 9\nvn 0 0 1\nvn 0 1 1\n\
        g one\nf 1//1 2//1 3//1 4//1 5//1\ng two\nusemtl none\nf 1//2 2//2 3//2\nf -6//-1 -4//-1 -3//-1\n";
    let files: [(&str, &[u8]); 1] = [("a.obj", obj)];
    let shape = shape(&files, "<shape type='obj'><string name='filename' value='a.obj'/></shape>");
    let mesh = mesh(&shape);
    assert_eq!(mesh.triangles.len(), 3 + 1 + 1);
    assert_eq!(mesh.positions().len(), 5 + 4, "the vertex that nothing uses is gone");
    assert_near(mesh.normals[mesh.triangles[3][0] as usize], Vec3::new(0.0, FRAC_1_SQRT_2, FRAC_1_SQRT_2), "normal");
}

/// A PLY file of a square with texture coordinates, in one of the three encodings.
fn square_ply(encoding: &str) -> Vec<u8> {
    let mut file = format!(
        "ply\nformat {encoding} 1.0\ncomment made here\nelement vertex 4\nproperty float x\nproperty float y\n\
        property double z\nproperty float nx\nproperty float ny\nproperty float nz\nproperty float u\nproperty float v\n\
        property uchar red\nelement face 1\nproperty list uchar int vertex_indices\nelement edge 1\nproperty int from\n\
        end_header\n"
    )
    .into_bytes();
    let is_big = encoding == "binary_big_endian";
    for (x, y) in [(0.0f32, 0.0f32), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
        if encoding == "ascii" {
            file.extend(format!("{x} {y} 2 0 0 1 {x} {y} 255\n").bytes());
            continue;
        }
        let float = |v: f32| if is_big { v.to_be_bytes() } else { v.to_le_bytes() };
        let double = if is_big { 2f64.to_be_bytes() } else { 2f64.to_le_bytes() };
        file.extend([x, y].map(float).concat());
        file.extend(double);
        file.extend([0.0, 0.0, 1.0, x, y].map(float).concat());
        file.push(255);
    }
    if encoding == "ascii" {
        file.extend(b"4 0 1 2 3\n7\n");
    } else {
        file.push(4);
        file.extend([0i32, 1, 2, 3, 7].map(|i| if is_big { i.to_be_bytes() } else { i.to_le_bytes() }).concat());
    }
    file
}

#[test]
fn ply_files_of_every_encoding_equal_the_obj_file() {
    let obj: &[u8] = b"v 0 0 2\nv 1 0 2\nv 1 1 2\nv 0 1 2\nvn 0 0 1\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n\
        f 1/1/1 2/2/1 3/3/1 4/4/1\n";
    let corners = |m: &Mesh| {
        let corner = |i: u32| (m.positions()[i as usize], m.normals[i as usize], m.uvs[i as usize]);
        m.triangles.iter().map(|t| t.map(corner)).collect::<Vec<_>>()
    };
    let same_uvs = "<boolean name='flip_tex_coords' value='false'/>";
    let text = format!("<shape type='obj'><string name='filename' value='a.obj'/>{same_uvs}</shape>");
    let expected = shape(&[("a.obj", obj)], &text);
    for encoding in ["ascii", "binary_little_endian", "binary_big_endian"] {
        let ply = square_ply(encoding);
        let text = "<shape type='ply'><string name='filename' value='a.ply'/></shape>";
        let shape = shape(&[("a.ply", &ply)], text);
        assert_eq!(corners(mesh(&shape)), corners(mesh(&expected)), "{encoding}");
    }
}

#[test]
fn triangles_without_area_are_dropped_with_one_warning_over_all_meshes() {
    let obj: &[u8] = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 2 0 0\nf 1 2 3\nf 1 2 4\nf 1 1 3\n";
    let text = "<shape type='obj'><string name='filename' value='a.obj'/></shape>".repeat(2);
    let scene = scene_beside(&[("a.obj", obj)], &text);
    assert_eq!(triangle_counts(&scene), [("obj 1", 1), ("obj 2", 1)]);
    assert_eq!(scene.warnings, ["triangles without area, left out: 4"]);
}

#[test]
fn normals_without_length_are_replaced_with_a_warning() {
    let obj: &[u8] = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 0\nvn 0 0 2\nf 1//1 2//2 3//2\n";
    let scene = scene_beside(&[("a.obj", obj)], "<shape type='obj'><string name='filename' value='a.obj'/></shape>");
    assert_eq!(mesh(&scene.shapes[0]).normals, [Vec3::Z; 3]);
    assert_eq!(scene.warnings.len(), 1, "{:?}", scene.warnings);
}

#[test]
fn the_whole_of_a_scene_with_many_shapes_keeps_the_order_of_the_file() {
    let text: String = (0..100).map(|i| format!("<shape type='cube' id='cube{i}'/>\n")).collect();
    let scene = Folder::new(&[]).load(&around(&text), &[]).unwrap();
    let names: Vec<_> = scene.shapes.iter().map(|s| s.name.clone()).collect();
    assert_eq!(names, (0..100).map(|i| format!("cube{i}")).collect::<Vec<_>>());
}
