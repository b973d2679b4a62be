//! Tests that every member of the registry passes.

mod sampling;

use glam::Vec3;

use super::*;
use crate::rng::{Counter, Purpose, Rng, unit_f32};
use crate::scene::parameters::{NumberOrName, Parameters};

fn randoms(n: u64) -> impl Iterator<Item = [f32; 3]> {
    let rng = Rng::new(3);
    (0..n).map(move |step| {
        let w = rng.words(Counter { ladder: 0, replica: 0, step, purpose: Purpose::Primary }, 0);
        [unit_f32(w[0]), unit_f32(w[1]), unit_f32(w[2])]
    })
}

fn at(cosines: &[f32]) -> Vec<Vec3> {
    let towards = |cos: f32| {
        let sin = (1.0 - cos * cos).sqrt();
        [1.0, -1.0].map(|side| Vec3::new(0.6 * sin, 0.8 * sin, side * cos))
    };
    cosines.iter().copied().flat_map(towards).collect()
}

fn outgoing() -> Vec<Vec3> {
    at(&[1.0, 0.7, 0.2, 0.01])
}

/// How far value and density at `wi` may be off because directions are rounded to 24 bits: four times as much as they
/// change from one such direction to the next. Next to nothing but for the narrowest lobes.
fn rounding(material: &Material, wo: Vec3, wi: Vec3) -> (f32, f32) {
    let here = material.evaluate(wo, wi);
    let steps = [Vec3::X, Vec3::Y, Vec3::Z].into_iter().flat_map(|axis| [axis, -axis]);
    steps.fold((0.0, 0.0), |(value, pdf), step| {
        let next = material.evaluate(wo, wi + f32::EPSILON * step);
        (f32::max(value, 4.0 * (next.value - here.value).length()), f32::max(pdf, 4.0 * (next.pdf - here.pdf).abs()))
    })
}

#[test]
fn nothing_is_nan_or_negative_wherever_one_looks_from() {
    let corners = [0.0, 0.5, 1.0 - f32::EPSILON / 2.0];
    let corners = corners.map(|a| corners.map(|b| corners.map(|c| [a, b, c])));
    let points: Vec<[f32; 3]> = corners.into_iter().flatten().flatten().chain(randoms(500)).collect();
    let cosines = [1.0, 1.0 - 1e-6, 0.7, 0.2, 0.01, 1e-4, 1e-6, 1e-12, 1e-30, 0.0];
    for material in Material::examples() {
        for wo in at(&cosines) {
            for &[a, b, c] in &points {
                let given = crate::math::warp::sphere([a, b]);
                let sampled = material.sample(wo, [a, b], c);
                if let Some(s) = sampled {
                    assert!(s.weight.is_finite() && s.weight.min_element() >= 0.0, "{material:?} from {wo}: {s:?}");
                    assert!(s.wi.is_finite() && s.pdf > 0.0 && s.eta > 0.0, "{material:?} from {wo}: {s:?}");
                }
                for wi in [Some(given), sampled.map(|s| s.wi)].into_iter().flatten() {
                    let e = material.evaluate(wo, wi);
                    assert!(e.value.is_finite() && e.value.min_element() >= 0.0, "{material:?}: {wo} {wi}: {e:?}");
                    assert!(e.pdf.is_finite() && e.pdf >= 0.0, "{material:?}: {wo} {wi}: {e:?}");
                }
            }
        }
    }
}

#[test]
fn sampled_weights_are_value_over_density() {
    for material in Material::examples() {
        for wo in outgoing() {
            for [a, b, c] in randoms(200) {
                let Some(s) = material.sample(wo, [a, b], c) else { continue };
                assert!((s.wi.length() - 1.0).abs() < 1e-4, "{material:?}: wi = {} from {wo}", s.wi);
                if s.pdf.is_finite() {
                    let e = material.evaluate(wo, s.wi);
                    let (value, pdf) = rounding(&material, wo, s.wi);
                    assert!((e.pdf - s.pdf).abs() <= 1e-4 * s.pdf + pdf, "{material:?}: {wo} {s:?} {e:?}");
                    let error = (e.value - s.weight * s.pdf).length();
                    assert!(error <= 1e-4 * s.pdf + value, "{material:?}: {wo} {s:?} {e:?}");
                }
            }
        }
    }
}

/// Up to the digits that f32 keeps of narrow lobes and grazing directions: what is inverted is sampled again, and most of
/// it with the same numbers.
#[test]
fn what_is_sampled_is_inverted() {
    for material in Material::examples() {
        let (mut inverted, mut same, mut all) = (0, 0, 0);
        for wo in at(&[1.0, 0.7, 0.2]) {
            for [a, b, c] in randoms(300) {
                let Some(s) = material.sample(wo, [a, b], c) else { continue };
                all += 1;
                let Some(Inverse { shape, choice: [start, end] }) = material.invert(wo, s.wi) else { continue };
                inverted += 1;
                assert!(start <= c && c < end, "{material:?} from {wo}: {c} is not in {start} … {end}");
                assert_eq!(shape.is_none(), s.pdf == f32::INFINITY, "{material:?}");
                let again = material.sample(wo, shape.unwrap_or([0.3, 0.9]), 0.5 * (start + end));
                let off = again.map_or(f32::INFINITY, |again| (again.wi - s.wi).length());
                assert!(off < 2e-3, "{material:?} from {wo}: {:?} for {s:?} by {shape:?} for {:?}", again, [a, b]);
                let apart = |i: usize, u: f32| shape.map_or(0.0, |shape| (shape[i] - u).abs());
                let near = |d: f32| d.min(1.0 - d) < 1e-3;
                same += usize::from(near(apart(0, a)) && near(apart(1, b)));
            }
        }
        let one_lobe = matches!(
            material,
            Material::Diffuse(_)
                | Material::Conductor(_)
                | Material::Dielectric(_)
                | Material::ThinDielectric(_)
                | Material::RoughConductor(_)
        );
        assert!(
            if one_lobe { inverted == all && all > 500 } else { inverted == 0 },
            "{material:?}: {inverted} of {all}"
        );
        assert!(same as f64 >= 0.9 * f64::from(inverted), "{material:?}: {same} of {inverted} by the same numbers");
    }
}

/// Energy that leaves for that which comes, and its standard error.
fn albedo(material: &Material, wo: Vec3) -> (Rgb, f32) {
    let n = 20_000;
    let (mut sum, mut squares) = (Rgb::ZERO, Rgb::ZERO);
    for [a, b, c] in randoms(n) {
        // refracted radiance is scaled by 1/η²; energy is not
        let energy = material.sample(wo, [a, b], c).map_or(Rgb::ZERO, |s| s.weight * s.eta * s.eta);
        sum += energy;
        squares += energy * energy;
    }
    let mean = sum / n as f32;
    let variance = (squares / n as f32 - mean * mean).max_element().max(0.0);
    (mean, (variance / n as f32).sqrt())
}

/// To five standard errors, which are 0 for most.
#[test]
fn no_material_reflects_more_than_it_receives() {
    for material in Material::examples() {
        for wo in at(&[1.0, 0.7, 0.2, 0.01, 1e-4]) {
            let (albedo, error) = albedo(&material, wo);
            assert!(albedo.max_element() <= 1.0 + 1e-3 + 5.0 * error, "{material:?} from {wo}: {albedo} ± {error}");
        }
    }
}

/// A white furnace: what takes nothing away is not seen in front of a uniform background. Facets take the little that
/// they hide from each other, which is less the smoother they are and the steeper one looks.
#[test]
fn what_absorbs_nothing_is_as_bright_as_what_is_around_it() {
    let exact = [
        ("diffuse", vec![("reflectance", 1.0)]),
        ("conductor", vec![]),
        ("dielectric", vec![]),
        ("dielectric", vec![("int_ior", 1.0), ("ext_ior", 1.8)]),
        ("thindielectric", vec![]),
        ("plastic", vec![("diffuse_reflectance", 1.0)]),
        ("plastic", vec![("diffuse_reflectance", 1.0), ("nonlinear", 1.0), ("int_ior", 1.9)]),
    ];
    for (name, parameters) in exact {
        for wo in at(&[1.0, 0.7, 0.2, 0.01]) {
            let material = read(name, &mut Bag(parameters.clone())).expect("known");
            if wo.z < 0.0 && !material.lobes().transmit() {
                continue;
            }
            let (albedo, error) = albedo(&material, wo);
            assert!(
                (albedo - 1.0).abs().max_element() < 2e-4 + 5.0 * error,
                "{material:?} from {wo}: {albedo} ± {error}"
            );
        }
    }
    let rough = [("roughconductor", vec![]), ("roughdielectric", vec![]), ("roughdielectric", vec![("int_ior", 0.8)])];
    for (name, parameters) in rough {
        for (alpha, allowed) in [(1e-4, 1e-4), (0.01, 1e-3), (0.1, 0.01)] {
            let material = read(name, &mut Bag([vec![("alpha", alpha)], parameters.clone()].concat())).expect("known");
            for wo in at(&[1.0, 0.7, 0.4]) {
                if wo.z < 0.0 && !material.lobes().transmit() {
                    continue;
                }
                let (albedo, error) = albedo(&material, wo);
                let least = 1.0 - allowed - 5.0 * error;
                assert!(
                    albedo.min_element() > least && albedo.max_element() < 1.0 + 1e-4,
                    "{material:?} from {wo}: {albedo}"
                );
            }
        }
    }
}

/// Whatever is read with one value and then given another is what is read with the other.
#[test]
fn parameters_put_in_place_are_as_if_read() {
    let (wo, wi) = (Vec3::new(0.48, 0.36, 0.8), Vec3::new(-0.36, -0.48, 0.8));
    for name in KNOWN {
        for (i, parameter) in varying(name).iter().enumerate() {
            let both_ways = |value: f32| match parameter.name {
                "alpha_u" => vec![("alpha_u", value), ("alpha_v", 0.3)],
                "alpha_v" => vec![("alpha_u", 0.3), ("alpha_v", value)],
                _ => vec![(parameter.name, value)],
            };
            let of = |value| read(name, &mut Bag(both_ways(value))).expect("known");
            let (mut put, expected) = (of(0.3), of(0.7));
            put.put(i, Rgb::splat(0.7));
            for wi in [wi, -wi] {
                let (got, expected) = (put.evaluate(wo, wi), expected.evaluate(wo, wi));
                assert_eq!((got.value, got.pdf), (expected.value, expected.pdf), "{name}: {}", parameter.name);
            }
            for [a, b, c] in randoms(100) {
                let samples = [put, expected].map(|m| m.sample(wo, [a, b], c).map(|s| (s.wi, s.weight, s.pdf)));
                assert_eq!(samples[0], samples[1], "{name}: {}", parameter.name);
            }
        }
    }
}

/// Parameters that are numbers.
struct Bag(Vec<(&'static str, f32)>);

impl Parameters for Bag {
    fn float(&mut self, name: &str) -> Option<f32> {
        self.0.iter().find(|(n, _)| *n == name).map(|(_, value)| *value)
    }
    fn integer(&mut self, _name: &str) -> Option<i64> {
        None
    }
    fn boolean(&mut self, name: &str) -> Option<bool> {
        self.float(name).map(|value| value != 0.0)
    }
    fn string(&mut self, _name: &str) -> Option<String> {
        None
    }
    fn word(&mut self, _name: &str, _known: &[&str]) -> Option<usize> {
        None
    }
    fn rgb(&mut self, name: &str) -> Option<Rgb> {
        self.float(name).map(Rgb::splat)
    }
    fn number_or_name(&mut self, name: &str) -> Option<NumberOrName> {
        self.float(name).map(NumberOrName::Number)
    }
    fn point(&mut self, _name: &str) -> Option<Vec3> {
        None
    }
    fn vector(&mut self, _name: &str) -> Option<Vec3> {
        None
    }
    fn to_world(&mut self) -> glam::Affine3A {
        glam::Affine3A::IDENTITY
    }
    fn to_uv(&mut self) -> glam::Affine2 {
        glam::Affine2::IDENTITY
    }
    fn varies(&self, _name: &str) -> bool {
        false
    }
    fn image(&mut self, _name: &str) -> Option<std::sync::Arc<crate::scene::textures::Image>> {
        None
    }
    fn fault(&mut self, name: &str, message: String) {
        panic!("{name}: {message}");
    }
}

/// Ratio of indices of what goes through; 1 where nothing does, or straight on.
fn transmitted_eta(material: &Material, wo: Vec3) -> f32 {
    let samples = randoms(64).filter_map(|[a, b, c]| material.sample(wo, [a, b], c));
    samples.map(|sample| sample.eta).find(|eta| *eta != 1.0).unwrap_or(1.0)
}

#[test]
fn smooth_lobes_are_reciprocal() {
    for material in Material::examples() {
        let directions = outgoing();
        for &wo in &directions {
            let sampled = randoms(100).filter_map(|[a, b, c]| material.sample(wo, [a, b], c)).map(|s| s.wi);
            for wi in directions.iter().copied().chain(sampled) {
                let (a, b) = (material.evaluate(wo, wi).value, material.evaluate(wi, wo).value);
                let (a_rounded, b_rounded) = (rounding(&material, wo, wi).0, rounding(&material, wi, wo).0);
                // radiance over n² is what goes both ways alike
                let eta = if wo.z * wi.z < 0.0 { transmitted_eta(&material, wo) } else { 1.0 };
                let (a_scale, b_scale) = (eta * eta / wi.z.abs(), 1.0 / wo.z.abs());
                let (a, b) = (a * a_scale, b * b_scale);
                let allowed = 1e-4 * (1.0 + a.length()) + a_rounded * a_scale + b_rounded * b_scale;
                assert!((a - b).length() <= allowed, "{material:?}: {wo} {wi}: {a} {b}");
            }
        }
    }
}

#[test]
fn delta_lobes_obey_snell_and_leave_on_the_right_side() {
    for material in Material::examples().into_iter().filter(|m| !m.lobes().smooth) {
        for wo in outgoing() {
            for [a, b, c] in randoms(64) {
                let Some(s) = material.sample(wo, [a, b], c) else { continue };
                let transmitted = s.wi.z * wo.z < 0.0;
                assert_eq!(transmitted, s.eta != 1.0 || s.wi == -wo, "{material:?}");
                let (sin_o, sin_i) = (wo.truncate().length(), s.wi.truncate().length());
                assert!((sin_o - s.eta * sin_i).abs() < 1e-5, "{material:?}: {wo} to {}", s.wi);
            }
        }
    }
}
