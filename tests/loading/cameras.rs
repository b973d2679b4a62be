//! Sensors, films and reconstruction filters: what they mean, and what is wrong with faulty ones.
//!
//! Defaults and meanings were taken from Mitsuba 3.9.1 (PyPI).

use relt::film::{Filter, PixelFormat, Window};
use relt::scene::SceneDescription;
use relt::scene::description::{FovAxis, Lens, Projection};

use crate::faults::assert_faults;
use crate::files::Folder;

/// A scene with a sensor of that type that holds these elements, which begin on line 2.
fn with_sensor(kind: &str, inner: &str) -> String {
    format!("<scene version='3.0.0'><emitter type='constant'/><sensor type='{kind}'>\n{inner}</sensor></scene>")
}

fn with_film(inner: &str) -> String {
    with_sensor("perspective", &format!("<film type='hdrfilm'>\n{inner}</film>"))
}

fn load(text: &str) -> SceneDescription {
    Folder::new(&[]).load(text, &[]).unwrap_or_else(|error| panic!("{text}\n{error}"))
}

// ---- sensors

#[test]
fn a_pinhole_has_a_principal_point_and_no_focus() {
    let camera = load(&with_sensor(
        "perspective",
        "<float name='fov' value='30'/><float name='principal_point_offset_x' value='0.25'/>
        <float name='principal_point_offset_y' value='-0.125'/><float name='focus_distance' value='3'/>",
    ))
    .camera;
    let expected =
        Projection::Perspective { fov: 30.0, fov_axis: FovAxis::X, principal_point: [0.25, -0.125], lens: None };
    assert_eq!(camera.projection, expected);
}

#[test]
fn a_thin_lens_is_sharp_at_the_far_clipping_plane_unless_it_says_where() {
    for (given, focus_distance) in [
        ("", 1e4),
        ("<float name='far_clip' value='50'/>", 50.0),
        ("<float name='far_clip' value='50'/><float name='focus_distance' value='3'/>", 3.0),
    ] {
        let camera = load(&with_sensor(
            "thinlens",
            &format!("<float name='aperture_radius' value='0.2'/><float name='fov' value='30'/>{given}"),
        ))
        .camera;
        let lens = Some(Lens { aperture_radius: 0.2, focus_distance });
        let expected = Projection::Perspective { fov: 30.0, fov_axis: FovAxis::X, principal_point: [0.0; 2], lens };
        assert_eq!(camera.projection, expected, "{given}");
    }
}

#[test]
fn parallel_rays_may_be_scaled() {
    let camera = load(&with_sensor(
        "orthographic",
        "<float name='near_clip' value='0.5'/><transform name='to_world'><scale x='2' y='2' z='1'/></transform>",
    ))
    .camera;
    assert_eq!((camera.projection, camera.near_clip, camera.far_clip), (Projection::Orthographic, 0.5, 1e4));
    assert_eq!(camera.to_world.matrix3.x_axis.x, 2.0);
}

#[test]
fn cameras_that_make_no_sense_are_faults() {
    let lens = |inner: &str| with_sensor("thinlens", &format!("<float name='fov' value='40'/>\n{inner}"));
    let radius = "<float name='aperture_radius' value='0.1'/>";
    for (text, expected) in [
        (with_sensor("fisheye", ""), "1:64: unknown sensor \"fisheye\"; known: orthographic, perspective, thinlens"),
        (lens(""), "1:64: sensor \"thinlens\" needs the parameter \"aperture_radius\""),
        (lens("<float name='aperture_radius' value='0'/>"), "3:38: aperture_radius is 0; it must be above 0 (a sensor"),
        (lens("<float name='aperture_radius' value='-1'/>"), "3:38: aperture_radius is -1; it must be above 0"),
        (lens("<float name='aperture_radius' value='wide'/>"), "3:38: \"wide\" is not a number"),
        (lens(&format!("{radius}<float name='focus_distance' value='0'/>")), "3:80: focus_distance is 0; it must be"),
        (lens(&format!("{radius}<float name='focus_distance' value='-2'/>")), "3:80: focus_distance is -2; it must"),
        (lens(&format!("{radius}<float name='focus_distance' value='inf'/>")), "3:80: \"inf\" is not finite"),
        (
            lens(&format!("{radius}<float name='principal_point_offset_x' value='0.1'/>")),
            "3:57: unknown parameter \"principal_point_offset_x\" of sensor \"thinlens\"; known: aperture_radius,",
        ),
        (
            lens(&format!("{radius}<transform name='to_world'><scale value='2'/></transform>")),
            "3:44: the transform of a sensor must not scale or shear",
        ),
        (
            with_sensor("perspective", "<float name='principal_point_offset_x' value='nan'/>"),
            "2:47: \"nan\" is not finite",
        ),
        (
            with_sensor("perspective", "<float name='principal_point_offset_y' value='-101'/>"),
            "2:47: principal_point_offset_y is -101 times the picture; accepted: -100 to 100",
        ),
        (
            with_sensor("orthographic", "<float name='fov' value='40'/>"),
            "2:14: unknown parameter \"fov\" of sensor \"orthographic\"; known: far_clip,",
        ),
        (
            with_sensor("orthographic", "<float name='near_clip' value='0'/>"),
            "2:32: near_clip is 0; it must be above 0",
        ),
        (
            with_sensor("orthographic", "<transform name='to_world'><scale z='0'/></transform>"),
            "2:1: the transform is singular",
        ),
    ] {
        assert_faults(&text, &[], &[expected]);
    }
}

// ---- films

#[test]
fn a_film_is_the_part_of_it_that_is_wanted() {
    let film = load(&with_film(
        "<integer name='width' value='40'/><integer name='height' value='30'/>
        <integer name='crop_offset_x' value='9'/><integer name='crop_width' value='24'/>
        <integer name='crop_height' value='16'/>",
    ))
    .film;
    assert_eq!((film.width, film.height), (24, 16));
    assert_eq!(film.window, Window { whole: [40, 30], offset: [9, 0] });
    let whole = load(&with_film("<integer name='width' value='40'/><integer name='height' value='30'/>")).film;
    assert_eq!((whole.width, whole.height, whole.window), (40, 30, Window::on_whole(40, 30)));
}

#[test]
fn parts_that_lie_beyond_the_film_or_are_empty_are_faults() {
    let of = |inner: &str| with_film(&format!("<integer name='width' value='40'/>\n{inner}"));
    for (inner, expected) in [
        (
            "<integer name='crop_width' value='0'/>",
            "4:35: crop_width is 0 pixels; accepted: 1 to 40, of 40 from pixel 0",
        ),
        ("<integer name='crop_width' value='-3'/>", "4:35: crop_width is -3 pixels; accepted: 1 to 40"),
        ("<integer name='crop_width' value='41'/>", "4:35: crop_width is 41 pixels; accepted: 1 to 40"),
        ("<integer name='crop_offset_x' value='-1'/>", "4:38: crop_offset_x is -1; accepted: 0 to 39"),
        ("<integer name='crop_offset_x' value='40'/>", "4:38: crop_offset_x is 40; accepted: 0 to 39"),
        (
            "<integer name='crop_offset_x' value='9'/>",
            "4:38: crop_offset_x is 9 without a crop_width; accepted: 1 to 31",
        ),
        (
            "<integer name='crop_offset_x' value='9'/><integer name='crop_width' value='32'/>",
            "4:76: crop_width is 32 pixels; accepted: 1 to 31, of 40 from pixel 9 on",
        ),
        (
            "<integer name='crop_offset_x' value='9'/><integer name='crop_width' value='all'/>",
            "4:76: \"all\" is not a whole number",
        ),
        ("<integer name='crop_height' value='577'/>", "4:36: crop_height is 577 pixels; accepted: 1 to 576"),
    ] {
        assert_faults(&of(inner), &[], &[expected]);
    }
}

#[test]
fn pixels_have_the_format_that_is_asked_for_or_it_is_said_that_they_have_not() {
    let alpha = "the film asks for an alpha channel, which relt does not write";
    for (name, format, warnings) in [
        ("rgb", PixelFormat::Rgb, &[][..]),
        ("rgba", PixelFormat::Rgb, &[alpha]),
        ("luminance", PixelFormat::Luminance, &[]),
        ("luminance_alpha", PixelFormat::Luminance, &[alpha]),
    ] {
        let scene = load(&with_film(&format!("<string name='pixel_format' value='{name}'/>")));
        assert_eq!(scene.film.format, format, "{name}");
        assert_eq!(scene.warnings, warnings, "{name}");
    }
    let xyz = with_film("<string name='pixel_format' value='xyz'/>");
    assert_faults(&xyz, &[], &["3:36: unknown pixel_format \"xyz\"; known: luminance, luminance_alpha, rgb, rgba"]);
}

#[test]
fn samples_beyond_the_border_are_refused_where_they_would_be_seen() {
    let film = |value: bool, filter: &str| {
        with_film(&format!("<rfilter type='{filter}'/>\n<boolean name='sample_border' value='{value}'/>"))
    };
    load(&film(true, "box"));
    load(&film(false, "lanczos"));
    assert_faults(&film(true, "tent"), &[], &["4:38: sample_border is supported with the box filter alone"]);
}

// ---- filters

#[test]
fn filters_have_the_shapes_that_mitsubas_have() {
    let third = 1.0 / 3.0;
    for (text, expected) in [
        ("<rfilter type='mitchell'/>", Filter::Mitchell { b: third, c: third }),
        (
            "<rfilter type='mitchell'><float name='B' value='0.25'/><float name='C' value='0.75'/></rfilter>",
            Filter::Mitchell { b: 0.25, c: 0.75 },
        ),
        ("<rfilter type='catmullrom'/>", Filter::Mitchell { b: 0.0, c: 0.5 }),
        ("<rfilter type='lanczos'/>", Filter::Lanczos { lobes: 3 }),
        ("<rfilter type='lanczos'><integer name='lobes' value='5'/></rfilter>", Filter::Lanczos { lobes: 5 }),
    ] {
        assert_eq!(load(&with_film(text)).film.filter, expected, "{text}");
    }
}

#[test]
fn filters_without_sense_are_faults() {
    for (text, expected) in [
        ("<rfilter type='mitchell'><float name='B' value='-0.1'/></rfilter>", "3:49: B is -0.1; accepted: 0 to 1"),
        ("<rfilter type='mitchell'><float name='C' value='1.5'/></rfilter>", "3:49: C is 1.5; accepted: 0 to 1"),
        (
            "<rfilter type='mitchell'><float name='A' value='0.5'/></rfilter>",
            "3:39: unknown parameter \"A\" of rfilter",
        ),
        (
            "<rfilter type='catmullrom'><float name='B' value='0'/></rfilter>",
            "3:41: unknown parameter \"B\" of rfilter",
        ),
        ("<rfilter type='lanczos'><integer name='lobes' value='0'/></rfilter>", "3:54: lobes is 0; accepted: 1 to 16"),
        (
            "<rfilter type='lanczos'><integer name='lobes' value='17'/></rfilter>",
            "3:54: lobes is 17; accepted: 1 to 16",
        ),
    ] {
        assert_faults(&with_film(text), &[], &[expected]);
    }
}
