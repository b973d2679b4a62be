//! A smooth conductor: a tinted mirror.

use glam::Vec3;

use super::{Evaluation, Inverse, Lobes, Scatter, ScatterSample, VaryingParameter, fresnel};
use crate::scene::{Rgb, parameters::Parameters};

/// Perfect reflection weighted by the conductor's Fresnel reflectance.
///
/// Parameters: either `material` (a name from `PRESETS`) or the complex refractive index `eta` + i `k`; with
/// neither, or with the material `none` alone, a mirror that reflects everything, as in Mitsuba.
/// `specular_reflectance` multiplies it, 0…1, default 1.
#[derive(Clone, Copy, Debug)]
pub struct Conductor {
    metal: Metal,
}

/// What light meets at a conductor, smooth or rough; parameters as of [`Conductor`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Metal {
    eta: Rgb,
    k: Rgb,
    pub specular_reflectance: Rgb,
    /// Without Fresnel factor.
    perfect: bool,
}

impl Metal {
    /// What of it varies.
    pub const VARYING: VaryingParameter = VaryingParameter::reflectance("specular_reflectance");

    /// By channel, at cos θ ≥ 0.
    #[inline(always)]
    pub fn reflectance(&self, cos_theta: f32) -> Rgb {
        if self.perfect {
            return self.specular_reflectance;
        }
        self.specular_reflectance * fresnel::conductor(cos_theta, self.eta, self.k)
    }

    pub fn read(p: &mut dyn Parameters) -> Metal {
        let specular_reflectance = p.reflectance("specular_reflectance", 1.0);
        let material = p.string("material").filter(|name| name != "none");
        let (eta, k) = (p.rgb("eta"), p.rgb("k"));
        if material.is_some() && (eta.is_some() || k.is_some()) {
            p.fault("material", "give either material or eta and k, not both".into());
        }
        for (name, value) in [("eta", eta), ("k", k)] {
            if value.is_some_and(|v| !v.is_finite() || v.min_element() < 0.0) {
                p.fault(name, format!("{name} must be finite and not negative"));
            }
        }
        if eta.is_some() != k.is_some() {
            p.fault(if eta.is_some() { "eta" } else { "k" }, "eta and k are given together".into());
        }
        let perfect = material.is_none() && eta.is_none() && k.is_none();
        let preset = material.map(|name| {
            preset(&name).unwrap_or_else(|| {
                let known: Vec<&str> = PRESETS.iter().map(|(name, ..)| *name).collect();
                p.fault("material", format!("unknown conductor \"{name}\"; known: none, {}", known.join(", ")));
                MIRROR
            })
        });
        let (eta, k) = preset.unwrap_or((eta.unwrap_or(MIRROR.0), k.unwrap_or(MIRROR.1)));
        Metal { eta, k, specular_reflectance, perfect }
    }
}

/// Gold, for examples.
pub(super) fn gold() -> Metal {
    let (eta, k) = preset("Au").expect("gold is in the table");
    Metal { eta, k, specular_reflectance: Rgb::ONE, perfect: false }
}

impl Scatter for Conductor {
    const VARYING: &'static [VaryingParameter] = &[Metal::VARYING];

    #[inline]
    fn put(&mut self, _specular_reflectance: usize, value: Rgb) {
        self.metal.specular_reflectance = value;
    }

    fn lobes(&self) -> Lobes {
        Lobes { delta_reflection: true, ..Lobes::NONE }
    }

    #[inline(always)]
    fn sample(&self, wo: Vec3, _u: [f32; 2], _choice: f32) -> Option<ScatterSample> {
        (wo.z > 0.0).then(|| ScatterSample {
            wi: Vec3::new(-wo.x, -wo.y, wo.z),
            weight: self.metal.reflectance(wo.z),
            pdf: f32::INFINITY,
            eta: 1.0,
        })
    }

    fn invert(&self, wo: Vec3, wi: Vec3) -> Option<Inverse> {
        (wo.z > 0.0 && wi.z > 0.0).then_some(Inverse::of_perfect([0.0, 1.0]))
    }

    #[inline(always)]
    fn evaluate(&self, _wo: Vec3, _wi: Vec3) -> Evaluation {
        Evaluation::ZERO
    }

    fn read(p: &mut dyn Parameters) -> Self {
        Conductor { metal: Metal::read(p) }
    }

    fn examples() -> Vec<Self> {
        let mirror = Metal { eta: Rgb::ZERO, k: Rgb::ONE, specular_reflectance: Rgb::splat(0.9), perfect: true };
        [gold(), mirror].map(|metal| Conductor { metal }).to_vec()
    }
}

/// η and κ of an interface that reflects everything.
const MIRROR: (Rgb, Rgb) = (Rgb::ZERO, Rgb::ONE);

fn preset(name: &str) -> Option<(Rgb, Rgb)> {
    PRESETS.iter().find(|(n, ..)| *n == name).map(|&(_, eta, k)| (Rgb::from(eta), Rgb::from(k)))
}

/// Complex refractive indices of conductors in linear RGB: name, η, κ.
///
/// Measured spectra integrated against the colour-matching functions, as Mitsuba 3.9 reports them in its RGB
/// variants (values that fall out of gamut are 0).
#[rustfmt::skip]
pub const PRESETS: &[(&str, [f32; 3], [f32; 3])] = &[
    ("a-C", [2.944046, 2.227136, 1.968162], [0.887465, 0.799299, 0.81529]),
    ("Ag", [0.155276, 0.116728, 0.138388], [4.828354, 3.122222, 2.146901]),
    ("Al", [1.657501, 0.880405, 0.521244], [9.223811, 6.269502, 4.837004]),
    ("AlAs", [3.605296, 3.232938, 2.216319], [0.000679, 0.0, 0.007513]),
    ("AlSb", [0.0, 4.139375, 4.669254], [0.0, 0.094009, 1.30057]),
    ("Au", [0.143036, 0.375307, 1.442045], [3.982997, 2.385556, 1.603359]),
    ("Be", [4.185012, 3.185029, 2.784061], [3.835466, 3.010122, 2.868994]),
    ("Cr", [4.369668, 2.916505, 1.654905], [5.206547, 4.231306, 3.754699]),
    ("CsI", [2.1449, 1.702319, 1.662427], [0.0, 0.0, 0.0]),
    ("Cu", [0.201005, 0.92375, 1.102215], [3.913262, 2.453045, 2.14209]),
    ("Cu2O", [3.551773, 2.94987, 2.751875], [0.114207, 0.193897, 0.606134]),
    ("CuO", [3.247541, 2.447805, 2.21022], [0.52109, 0.570031, 0.722179]),
    ("d-C", [2.70872, 2.318826, 2.228898], [0.0, 0.0, 0.0]),
    ("Hg", [2.398939, 1.440028, 0.90957], [6.327587, 4.371925, 3.421764]),
    ("HgTe", [4.77904, 3.231196, 2.659901], [1.631613, 1.58081, 1.729287]),
    ("Ir", [3.0863, 2.082191, 1.617915], [5.592153, 4.067088, 3.267312]),
    ("K", [0.064043, 0.04641, 0.038185], [2.1042, 1.34894, 0.913126]),
    ("Li", [0.265791, 0.195618, 0.220949], [3.540155, 2.311123, 1.668607]),
    ("MgO", [2.089584, 1.650723, 1.594879], [0.0, 0.0, 0.0]),
    ("Mo", [4.483974, 3.525131, 2.77631], [4.111437, 3.420827, 3.150607]),
    ("Na_palik", [0.060269, 0.056141, 0.061988], [3.179273, 2.11249, 1.579041]),
    ("Nb", [3.420074, 2.790093, 2.395629], [3.441395, 2.737666, 2.579746]),
    ("Ni_palik", [2.367305, 1.663373, 1.467078], [4.498812, 3.050153, 2.345439]),
    ("Rh", [2.585793, 1.860216, 1.554263], [6.78226, 4.702987, 3.976073]),
    ("Se", [4.058311, 2.842935, 2.820853], [0.75405, 0.638444, 0.521808]),
    ("SiC", [3.172342, 2.525972, 2.479371], [1e-06, 0.0, 1e-05]),
    ("SnTe", [4.52425, 1.981645, 1.281591], [0.0, 0.0, 0.0]),
    ("Ta", [2.062721, 2.392939, 2.627929], [2.40836, 1.741486, 1.947028]),
    ("Te", [7.390234, 4.482105, 2.637106], [3.256022, 3.527059, 3.292054]),
    ("ThF4", [1.830714, 1.442229, 1.387648], [0.0, 0.0, 0.0]),
    ("TiC", [3.700528, 2.837422, 2.582287], [3.265635, 2.351589, 2.172791]),
    ("TiN", [1.64845, 1.150516, 1.379823], [3.368328, 1.943498, 1.102068]),
    ("TiO2", [3.45661, 2.801736, 2.905175], [0.000105, 0.0, 0.000653]),
    ("VC", [3.657566, 2.752736, 2.532672], [3.068301, 2.198687, 1.963193]),
    ("V_palik", [4.277582, 3.512949, 2.761071], [3.491301, 2.889455, 3.111522]),
    ("VN", [2.865602, 2.119189, 1.940091], [3.032243, 2.056116, 1.616306]),
    ("W", [4.370817, 3.300246, 2.998407], [3.500641, 2.604874, 2.273233]),
];
