//! Spectra to the linear RGB that renders compute with.

use super::Rgb;
use super::cie::{D65, FIRST, STEP, XYZ};

/// XYZ to linear RGB with Rec. 709 primaries and a D65 white (IEC 61966-2-1).
const RGB_OF_XYZ: [[f64; 3]; 3] =
    [[3.240_479, -1.537_150, -0.498_535], [-0.969_256, 1.875_991, 0.041_556], [0.055_648, -0.204_043, 1.057_311]];

/// A spectrum: wavelengths in nanometres, rising, and values; linear between them and 0 beyond them.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Spectrum(Vec<(f64, f64)>);

impl Spectrum {
    /// Of wavelengths and values in any order.
    pub fn new(mut samples: Vec<(f64, f64)>) -> Result<Spectrum, String> {
        samples.sort_by(|a, b| a.0.total_cmp(&b.0));
        if samples.len() < 2 {
            return Err("a spectrum needs two wavelengths or more".into());
        }
        if let Some(pair) = samples.windows(2).find(|pair| pair[0].0 == pair[1].0) {
            return Err(format!("the wavelength {} nm is given twice", pair[0].0));
        }
        Ok(Spectrum(samples))
    }

    /// Of a file with a wavelength and a value on each line; `#` begins a comment.
    pub fn of_file(text: &str) -> Result<Spectrum, String> {
        let mut samples = Vec::new();
        for (i, line) in text.lines().enumerate() {
            let line = line.split('#').next().unwrap_or_default();
            let numbers: Result<Vec<f64>, _> = line.split_whitespace().map(str::parse).collect();
            match numbers.as_deref() {
                Ok([]) => {}
                Ok([wavelength, value]) if wavelength.is_finite() && value.is_finite() => {
                    samples.push((*wavelength, *value))
                }
                _ => return Err(format!("line {} is no wavelength and value", i + 1)),
            }
        }
        Spectrum::new(samples)
    }

    /// Its value at a wavelength.
    pub fn at(&self, wavelength: f64) -> f64 {
        let after = self.0.partition_point(|(w, _)| *w < wavelength);
        match (after.checked_sub(1).and_then(|i| self.0.get(i)), self.0.get(after)) {
            (_, Some((w, value))) if *w == wavelength => *value,
            (Some((w0, v0)), Some((w1, v1))) => v0 + (v1 - v0) * (wavelength - w0) / (w1 - w0),
            _ => 0.0,
        }
    }

    /// The colour of a surface that reflects it, under D65: 1 everywhere is white.
    pub fn reflectance(&self) -> Rgb {
        let white: f64 = XYZ.iter().zip(D65).map(|(xyz, d65)| xyz[1] * d65).sum();
        rgb_of_xyz(integral(|i, wavelength| D65[i] * self.at(wavelength)).map(|v| v / white)).map(|v| v.clamp(0.0, 1.0))
    }

    /// The colour of light of this spectrum: 1 everywhere has luminance 1. Negative parts, of colours beyond those that
    /// RGB can show, are 0.
    pub fn emission(&self) -> Rgb {
        emission(|wavelength| self.at(wavelength))
    }

    /// [`Spectrum::emission`] of luminance 1.
    pub fn hue(&self) -> Rgb {
        of_luminance_one(|wavelength| self.at(wavelength))
    }
}

/// The colour of a black body's radiance in W/(m² sr nm) at a temperature in kelvin (Planck's law).
pub(super) fn blackbody(kelvin: f64) -> Rgb {
    emission(|wavelength| planck(wavelength, kelvin))
}

/// [`blackbody`] of luminance 1.
pub(super) fn blackbody_hue(kelvin: f64) -> Rgb {
    of_luminance_one(|wavelength| planck(wavelength, kelvin))
}

/// Spectral radiance 2hc²/λ⁵/(exp(hc/λkT) − 1) in W/(m² sr nm); the wavelength in nanometres.
fn planck(wavelength: f64, kelvin: f64) -> f64 {
    const C: f64 = 299_792_458.0;
    const H: f64 = 6.626_069_57e-34;
    const K: f64 = 1.380_648_8e-23;
    let metres = wavelength * 1e-9;
    let fifth = metres * metres * metres * metres * metres;
    1e-9 * 2.0 * H * C * C / (fifth * (libm::exp(H * C / (metres * K * kelvin)) - 1.0))
}

fn emission(spectrum: impl Fn(f64) -> f64) -> Rgb {
    let whole: f64 = XYZ.iter().map(|xyz| xyz[1]).sum();
    rgb_of_xyz(integral(|_, wavelength| spectrum(wavelength)).map(|v| v / whole)).map(|v| v.max(0.0))
}

fn of_luminance_one(spectrum: impl Fn(f64) -> f64) -> Rgb {
    let xyz = integral(|_, wavelength| spectrum(wavelength));
    if xyz[1] > 0.0 { rgb_of_xyz(xyz.map(|v| v / xyz[1])).map(|v| v.max(0.0)) } else { [0.0; 3] }
}

/// Sums of a spectrum, by number of row and wavelength, times the colour-matching functions.
fn integral(spectrum: impl Fn(usize, f64) -> f64) -> [f64; 3] {
    let mut sums = [0.0; 3];
    for (i, xyz) in XYZ.iter().enumerate() {
        let value = spectrum(i, FIRST + STEP * i as f64);
        sums.iter_mut().zip(xyz).for_each(|(sum, weight)| *sum += weight * value);
    }
    sums
}

/// XYZ to linear RGB, which may be negative.
pub(super) fn rgb_of_xyz(xyz: [f64; 3]) -> Rgb {
    RGB_OF_XYZ.map(|row| row.iter().zip(xyz).map(|(m, v)| m * v).sum())
}

/// The linear value of an sRGB one (IEC 61966-2-1).
pub(super) fn linear_of_srgb(value: f64) -> f64 {
    if value <= 0.04045 { value / 12.92 } else { libm::pow((value + 0.055) / 1.055, 2.4) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flat(value: f64) -> Spectrum {
        Spectrum::new(vec![(300.0, value), (900.0, value)]).unwrap()
    }

    #[test]
    fn a_surface_that_reflects_everything_is_white() {
        for channel in flat(1.0).reflectance() {
            assert!((channel - 1.0).abs() < 2e-3, "{channel}");
        }
        for channel in flat(0.25).reflectance() {
            assert!((channel - 0.25).abs() < 1e-3, "{channel}");
        }
    }

    #[test]
    fn equal_energy_is_of_luminance_one_and_reddish() {
        let [r, g, b] = flat(1.0).emission();
        assert!((0.2126 * r + 0.7152 * g + 0.0722 * b - 1.0).abs() < 2e-3);
        assert!(r > g && g > b, "{r} {g} {b}");
    }

    #[test]
    fn spectra_are_linear_between_samples_and_nothing_beyond() {
        let spectrum = Spectrum::new(vec![(600.0, 3.0), (500.0, 1.0)]).unwrap();
        for (wavelength, value) in [(499.0, 0.0), (500.0, 1.0), (550.0, 2.0), (600.0, 3.0), (600.1, 0.0)] {
            assert_eq!(spectrum.at(wavelength), value, "{wavelength}");
        }
        assert!(Spectrum::new(vec![(500.0, 1.0), (500.0, 2.0)]).unwrap_err().contains("500"));
    }

    #[test]
    fn files_of_spectra_hold_two_numbers_a_line() {
        let text = "# metal\n400 1.5 # first\n\n700 2.5\n";
        assert_eq!(Spectrum::of_file(text).unwrap(), Spectrum(vec![(400.0, 1.5), (700.0, 2.5)]));
        assert!(Spectrum::of_file("400 1\n500\n").unwrap_err().contains("line 2"));
    }

    #[test]
    fn planck_is_right_at_the_peak_of_the_sun() {
        // Wien: 5778 K peaks at 2.8978e6/5778 = 501.5 nm; there B = 26.37 kW/(m² sr nm)
        assert!((planck(501.5, 5778.0) / 26_370.0 - 1.0).abs() < 2e-3, "{}", planck(501.5, 5778.0));
        let [r, g, b] = blackbody_hue(6504.0);
        assert!((r - 1.0).abs() < 0.05 && (g - 1.0).abs() < 0.05 && (b - 1.0).abs() < 0.05, "{r} {g} {b}");
    }

    #[test]
    fn the_srgb_transfer_ends_at_one() {
        assert_eq!(linear_of_srgb(0.0), 0.0);
        assert_eq!(linear_of_srgb(1.0), 1.0);
        assert!((linear_of_srgb(0.5) - 0.214_041).abs() < 1e-6);
    }
}
