//! Tests that every member of the registry passes.

use glam::Vec3;

use super::*;
use crate::rng::{Counter, Purpose, Rng, unit_f32};

fn randoms(n: u64) -> impl Iterator<Item = [f32; 3]> {
    let rng = Rng::new(3);
    (0..n).map(move |step| {
        let w = rng.words(Counter { ladder: 0, replica: 0, step, purpose: Purpose::Primary }, 0);
        [unit_f32(w[0]), unit_f32(w[1]), unit_f32(w[2])]
    })
}

fn outgoing() -> Vec<Vec3> {
    let mut all = Vec::new();
    for cos in [1.0f32, 0.7, 0.2, 0.01] {
        for sign in [1.0, -1.0] {
            all.push(Vec3::new((1.0 - cos * cos).sqrt() * 0.6, (1.0 - cos * cos).sqrt() * 0.8, sign * cos));
        }
    }
    all
}

/// χ² of sampled directions against the stated density, integrated over 16 × 32 cells of (cos θ, φ) on the whole
/// sphere; cells with fewer than five expected samples are pooled. Level 10⁻⁶ for each material and direction.
#[test]
fn smooth_lobes_are_sampled_with_the_density_they_state() {
    const N: u64 = 200_000;
    let (rows, columns, sub) = (16, 32, 32);
    let cell = |w: Vec3| {
        let i = (((w.z + 1.0) * 0.5 * rows as f32) as usize).min(rows - 1);
        let phi = (w.y.atan2(w.x) / std::f32::consts::TAU).rem_euclid(1.0);
        i * columns + ((phi * columns as f32) as usize).min(columns - 1)
    };
    let mut checked = 0;
    for material in Material::examples().into_iter().filter(|m| m.lobes().smooth) {
        for wo in outgoing() {
            let mut counts = vec![0.0f64; rows * columns];
            for [a, b, c] in randoms(N) {
                if let Some(s) = material.sample(wo, [a, b], c).filter(|s| s.pdf.is_finite()) {
                    counts[cell(s.wi)] += 1.0;
                }
            }
            let mut expected = vec![0.0f64; rows * columns];
            for (i, k) in (0..rows).flat_map(|i| (0..sub).map(move |k| (i, k))) {
                // evenly in θ within a row, which resolves what is narrow about the poles
                let theta = |edge: usize| (2.0 * edge as f32 / rows as f32 - 1.0).acos();
                let (step, first) = ((theta(i) - theta(i + 1)) / sub as f32, theta(i + 1));
                let (sin, cos) = (first + (k as f32 + 0.5) * step).sin_cos();
                for j in 0..columns * sub {
                    let phi = std::f32::consts::TAU * (j as f32 + 0.5) / (columns * sub) as f32;
                    let wi = Vec3::new(sin * phi.cos(), sin * phi.sin(), cos);
                    let area = f64::from(sin * step) * std::f64::consts::TAU / (columns * sub) as f64;
                    let place = i * columns + j / sub;
                    expected[place] += N as f64 * area * f64::from(material.evaluate(wo, wi).pdf);
                }
            }
            if expected.iter().sum::<f64>() == 0.0 {
                assert_eq!(counts.iter().sum::<f64>(), 0.0, "{material:?} from {wo}");
                continue;
            }
            let (mut chi2, mut cells, mut rest) = (0.0, 0, (0.0, 0.0));
            for (&c, &e) in counts.iter().zip(&expected) {
                if e < 5.0 {
                    rest = (rest.0 + c, rest.1 + e);
                } else {
                    chi2 += (c - e).powi(2) / e;
                    cells += 1;
                }
            }
            if rest.1 >= 5.0 {
                chi2 += (rest.0 - rest.1).powi(2) / rest.1;
                cells += 1;
            }
            let p = 1.0
                - statrs::distribution::ContinuousCDF::cdf(
                    &statrs::distribution::ChiSquared::new(f64::from(cells - 1)).unwrap(),
                    chi2,
                );
            assert!(p > 1e-6, "{material:?} from {wo}: χ² = {chi2} over {cells} cells, p = {p}");
            checked += 1;
        }
    }
    assert!(checked > 0);
}

#[test]
fn sampled_weights_are_value_over_density() {
    for material in Material::examples() {
        for wo in outgoing() {
            for [a, b, c] in randoms(200) {
                let Some(s) = material.sample(wo, [a, b], c) else { continue };
                assert!((s.wi.length() - 1.0).abs() < 1e-4, "{material:?}: wi = {} from {wo}", s.wi);
                assert!(s.weight.is_finite() && s.weight.min_element() >= 0.0);
                if s.pdf.is_finite() {
                    let e = material.evaluate(wo, s.wi);
                    assert!((e.pdf - s.pdf).abs() <= 1e-4 * s.pdf, "{material:?}");
                    assert!((e.value - s.weight * s.pdf).length() <= 1e-4 * s.pdf, "{material:?}");
                }
            }
        }
    }
}

#[test]
fn no_material_reflects_more_than_it_receives() {
    for material in Material::examples() {
        for wo in outgoing() {
            let mut sum = Rgb::ZERO;
            let n = 20_000;
            for [a, b, c] in randoms(n) {
                // refracted radiance is scaled by 1/η²; energy is not
                sum += material.sample(wo, [a, b], c).map_or(Rgb::ZERO, |s| s.weight * s.eta * s.eta);
            }
            let albedo = sum / n as f32;
            assert!(albedo.max_element() <= 1.0 + 1e-3, "{material:?} from {wo}: {albedo}");
        }
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
            for &wi in &directions {
                let (a, b) = (material.evaluate(wo, wi).value, material.evaluate(wi, wo).value);
                // radiance over n² is what goes both ways alike
                let eta = if wo.z * wi.z < 0.0 { transmitted_eta(&material, wo) } else { 1.0 };
                let (a, b) = (a * eta * eta / wi.z.abs(), b / wo.z.abs());
                assert!((a - b).length() <= 1e-4 * (1.0 + a.length()), "{material:?}: {wo} {wi}");
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
