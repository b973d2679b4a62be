//! Fresnel reflectances of smooth interfaces for unpolarised light.

use crate::scene::Rgb;

/// Reflectance of a conductor with complex index η + iκ (relative to the outside) at cos θ ≥ 0, per channel.
/// Source: the squared moduli of the Fresnel amplitudes; Born & Wolf, Principles of Optics, section 14.2.
pub fn conductor(cos_theta: f32, eta: Rgb, k: Rgb) -> Rgb {
    let cos2 = cos_theta * cos_theta;
    let sin2 = 1.0 - cos2;
    // a + ib is the square root of (η + iκ)² − sin²θ
    let t0 = eta * eta - k * k - sin2;
    let a2_plus_b2 = (t0 * t0 + 4.0 * eta * eta * k * k).map(f32::sqrt);
    let a = (0.5 * (a2_plus_b2 + t0)).max(Rgb::ZERO).map(f32::sqrt);
    let (t1, t2) = (a2_plus_b2 + cos2, 2.0 * cos_theta * a);
    let perpendicular = (t1 - t2) / (t1 + t2);
    let (t3, t4) = (cos2 * a2_plus_b2 + sin2 * sin2, t2 * sin2);
    let parallel = perpendicular * (t3 - t4) / (t3 + t4);
    0.5 * (perpendicular + parallel)
}

/// Reflectance of a dielectric interface and the cosine of the refracted direction (≥ 0; 0 under total internal
/// reflection, where the reflectance is 1), for cos θ ≥ 0 on the side of the incident ray and `eta` = n₂/n₁.
#[inline(always)]
pub fn dielectric(cos_theta: f32, eta: f32) -> (f32, f32) {
    let sin2_t = (1.0 - cos_theta * cos_theta) / (eta * eta);
    if sin2_t >= 1.0 {
        return (1.0, 0.0);
    }
    let cos_t = (1.0 - sin2_t).sqrt();
    let parallel = (eta * cos_theta - cos_t) / (eta * cos_theta + cos_t);
    let perpendicular = (cos_theta - eta * cos_t) / (cos_theta + eta * cos_t);
    (0.5 * (parallel * parallel + perpendicular * perpendicular), cos_t)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_conductor_without_absorption_is_a_dielectric() {
        for i in 1..=100 {
            let c = i as f32 / 100.0;
            let f = conductor(c, Rgb::splat(1.5), Rgb::ZERO).x;
            assert!((f - dielectric(c, 1.5).0).abs() < 1e-5, "cos θ = {c}");
        }
    }

    #[test]
    fn normal_incidence_has_the_textbook_values() {
        assert!((dielectric(1.0, 1.5).0 - 0.04).abs() < 1e-6);
        // ((η − 1)² + κ²)/((η + 1)² + κ²)
        let (eta, k) = (0.2f32, 3.9f32);
        let exact = ((eta - 1.0).powi(2) + k * k) / ((eta + 1.0).powi(2) + k * k);
        assert!((conductor(1.0, Rgb::splat(eta), Rgb::splat(k)).x - exact).abs() < 1e-5);
    }

    #[test]
    fn beyond_the_critical_angle_everything_is_reflected() {
        let critical = (1.0f32 - (1.0 / 1.5f32).powi(2)).sqrt();
        assert_eq!(dielectric(critical * 0.99, 1.0 / 1.5).0, 1.0);
        assert!(dielectric(critical * 1.01, 1.0 / 1.5).0 < 1.0);
    }
}
