//! Light that enters glass and stays there.
//!
//! Radiance grows by the square of the ratio of refractive indices where light enters a denser medium. On the way out it
//! shrinks by as much, so pictures taken from outside hardly tell whether light subpaths know of that: here the camera is in
//! the glass itself.

use relt::film::Image;
use relt::path::MappingKind;
use relt::render::{MappingChoice, Method, Settings};

use crate::support::{runs, scene_of, settings, statistics::t_test};

/// Runs by each mapping.
const RUNS: u64 = 12;

/// The means of runs by light tracing agree with that by camera paths: t-test, level 10⁻⁵. A factor of 1.5² or its inverse
/// is hundreds of standard errors off, which the last assertion makes sure of.
#[test]
fn light_that_has_entered_glass_is_as_bright_from_either_end() {
    let scene = scene_of(
        "<integrator type='path'><integer name='max_depth' value='3'/></integrator>
         <sensor type='perspective'><float name='fov' value='60'/>
           <transform name='to_world'><lookat origin='0, 0.6, 0' target='0, 0, 0' up='0, 0, 1'/></transform>
           <film type='hdrfilm'><integer name='width' value='16'/><integer name='height' value='16'/>
             <rfilter type='box'/></film></sensor>
         <shape type='rectangle'><transform name='to_world'><rotate x='1' angle='-90'/><scale value='3'/></transform>
           <bsdf type='diffuse'/></shape>
         <shape type='rectangle'>
           <transform name='to_world'><rotate x='1' angle='-90'/><scale value='50'/><translate y='1'/></transform>
           <bsdf type='dielectric'><float name='int_ior' value='1.5'/><float name='ext_ior' value='1'/></bsdf></shape>
         <shape type='rectangle'>
           <transform name='to_world'><rotate x='1' angle='90'/><scale value='2'/><translate y='2'/></transform>
           <emitter type='area'><rgb name='radiance' value='5'/></emitter></shape>",
    );
    let means = |kind| -> Vec<f64> {
        let of = settings(Method::Path, 128.0, 21);
        let images = runs(&scene, &Settings { mapping: MappingChoice::Fixed(kind), ..of }, RUNS);
        images.iter().map(Image::mean).map(|rgb| rgb.iter().sum::<f64>() / 3.0).collect()
    };
    let camera = means(MappingKind::Unidirectional);
    let expected = camera.iter().sum::<f64>() / RUNS as f64;
    let variance = camera.iter().map(|m| (m - expected).powi(2)).sum::<f64>() / (RUNS * (RUNS - 1)) as f64;
    for kind in [MappingKind::Light, MappingKind::TwoWay, MappingKind::Bidirectional, MappingKind::Multiplexed] {
        let light = means(kind);
        let (t, p) = t_test(&light, expected, variance);
        assert!(p > 1e-5, "{}: t = {t}, p = {p}: {light:?} for {expected}", kind.name());
        assert!((t_test(&light, 1.5 * expected, variance).1) < 1e-9, "{}: too noisy to tell anything", kind.name());
    }
}
