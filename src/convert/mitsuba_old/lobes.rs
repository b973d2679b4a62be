//! Reflection lobes that Mitsuba 3 does not have, by the nearest ones that it has.

use super::parameters::Parameters;
use crate::convert::diffuse_transmitter;
use crate::convert::sums::{Shares, shares};
use crate::convert::textures::{Texture, Use};
use crate::convert::xml::Element;

/// A diffuse lobe and one of cosⁿ around the mirror direction.
///
/// The nearest microfacets are Beckmann's of α = 1/√(2n + 1): near the mirror direction, cosⁿ of its angle is
/// exp(−n(2θ)²/2) in the angle θ of the half vector, and Beckmann's distribution exp(−θ²/α²).
pub fn phong(p: &Parameters) -> Element {
    let exponent = p.texture("exponent").unwrap_or(Texture::Constant([30.0; 3]));
    let alpha = exponent.map(p.context.files, &|n| n.map(|n| 1.0 / (2.0 * n.max(0.0) + 1.0).sqrt())).unwrap_or_else(
        |message| {
            p.context
                .notes
                .left_out(p.place("exponent"), format!("the texture of the exponent, 30 is taken instead: {message}"));
            Texture::Constant([1.0 / 61f64.sqrt(); 3])
        },
    );
    let message = "phong becomes a blend of diffuse and of roughconductor (Beckmann microfacets without Fresnel factor, \
                   alpha = 1/sqrt(2 exponent + 1)), which is darker at grazing angles";
    p.context.notes.changed(p.node.place_of("type"), message);
    let lobe = mirror_facets().holding(alpha.element("alpha", Use::Number, p.context.files));
    with_diffuse(p, lobe)
}

/// A diffuse lobe and an elliptic Gaussian one.
pub fn ward(p: &Parameters) -> Element {
    let variant = p.string("variant").unwrap_or("balanced".into());
    let message = format!(
        "ward ({variant}) becomes a blend of diffuse and of roughconductor (Beckmann microfacets without Fresnel factor, \
         the same alpha_u and alpha_v), which differs at grazing angles"
    );
    p.context.notes.changed(p.node.place_of("type"), message);
    let mut lobe = mirror_facets();
    for name in ["alpha_u", "alpha_v"] {
        let alpha = p.texture(name).unwrap_or(Texture::Constant([0.1; 3]));
        lobe = lobe.holding(alpha.element(name, Use::Number, p.context.files));
    }
    with_diffuse(p, lobe)
}

/// A diffuse transmitter: what light meets is scattered evenly on the other side.
pub fn difftrans(p: &Parameters) -> Element {
    let transmittance = p.texture("transmittance").unwrap_or(Texture::Constant([0.5; 3]));
    diffuse_transmitter(transmittance.element("base_color", Use::Colour, p.context.files))
}

/// Microfacets that reflect everything; their colour and roughness come from what is around.
fn mirror_facets() -> Element {
    Element::plugin("bsdf", "roughconductor").string("material", "none").string("distribution", "beckmann")
}

/// The sum of a diffuse lobe and another.
fn with_diffuse(p: &Parameters, lobe: Element) -> Element {
    let files = p.context.files;
    let specular = p.texture("specular_reflectance").unwrap_or(Texture::Constant([0.2; 3]));
    let diffuse = p.texture("diffuse_reflectance").unwrap_or(Texture::Constant([0.5; 3]));
    p.child("specular_sampling_weight");
    let place = p.node.place_of("type");
    let shares = shares(&diffuse, &specular, files).unwrap_or_else(|message| {
        p.context.notes.changed(place, format!("the two lobes are blended half and half and so darkened: {message}"));
        Shares { weight: 0.5, first: diffuse, second: specular, sum: 1.0 }
    });
    if shares.sum > 1.0 {
        let message = format!("reflectances of sum {:.3} are scaled to 0.99, as old Mitsubas do", shares.sum);
        p.context.notes.changed(place, message);
    }
    let base = Element::plugin("bsdf", "diffuse").holding(shares.first.element("reflectance", Use::Colour, files));
    let lobe = lobe.holding(shares.second.element("specular_reflectance", Use::Colour, files));
    match shares.weight {
        0.0 => base,
        1.0 => lobe,
        weight => Element::plugin("bsdf", "blendbsdf").float("weight", weight).holding(base).holding(lobe),
    }
}
