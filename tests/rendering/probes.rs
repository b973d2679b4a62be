//! Scattering functions against Mitsuba 3, value by value: what `tests/mitsuba/probes.py` stored.

use glam::Vec3;
use relt::scene::materials::Material;
use serde::Deserialize;

use crate::support::repository;

/// One material and pairs of directions: towards the eye, towards the light, value · cosine by channel, density.
#[derive(Deserialize)]
struct Probes {
    bsdf: String,
    rows: Vec<[f32; 10]>,
}

/// Relative error of values and densities. Both programs count in single precision, and facets of a slope of a
/// hundredth turn a direction's last digit into some 10⁻⁵ of their density.
const PRECISION: f32 = 1e-4;

fn material(bsdf: &str) -> Material {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("scene.xml");
    let scene = format!(
        "<scene version='3.0.0'><sensor type='perspective'/><emitter type='constant'/>\
         <shape type='sphere'>{bsdf}</shape></scene>"
    );
    std::fs::write(&path, scene).expect("a file in it");
    let description = relt::load::scene(&path, &[]).unwrap_or_else(|error| panic!("{error}"));
    *description.appearances[0].plain().expect("no textures")
}

#[test]
fn values_and_densities_are_mitsubas() {
    let text = std::fs::read_to_string(repository("tests/mitsuba/probes.json")).expect("stored values");
    let all: Vec<Probes> = serde_json::from_str(&text).expect("as probes.py writes them");
    let mut faults = Vec::new();
    let mut compared = 0;
    for Probes { bsdf, rows } in &all {
        let material = material(bsdf);
        for row in rows {
            let (wo, wi) = (Vec3::from_slice(&row[..3]), Vec3::from_slice(&row[3..6]));
            let expected = (Vec3::from_slice(&row[6..9]), row[9]);
            let got = material.evaluate(wo, wi);
            let values = (got.value - expected.0).abs().max_element() / expected.0.max_element().max(1e-6);
            let densities = (got.pdf - expected.1).abs() / expected.1.max(1e-6);
            // written so that NaN is a fault
            if !(values <= PRECISION && densities <= PRECISION) {
                faults.push(format!(
                    "{bsdf}\n  {wo} to {wi}: {} for {}, density {} for {}",
                    got.value, expected.0, got.pdf, expected.1
                ));
            }
            compared += usize::from(expected.1 > 0.0);
        }
    }
    assert!(compared > 200, "{compared} pairs of a density");
    assert!(faults.is_empty(), "{} faults:\n{}", faults.len(), faults.join("\n"));
}
