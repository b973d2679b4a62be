//! A picture of all that is infinitely far away.

use std::f32::consts::{PI, TAU};
use std::fmt;
use std::sync::Arc;

use glam::{Mat3, Vec3};

use super::{Ball, Emission, Emit, EmitterKind, LightSample, from_infinity, origin_towards};
use crate::math::{Cumulative, sin_cos_turn};
use crate::path::luminance;
use crate::scene::{
    Rgb,
    parameters::{Parameters, similarity},
};

/// Radiance from infinitely far away by a picture of latitudes and longitudes.
///
/// Parameters: `filename`; `scale` (default 1) multiplies it; `to_world`, whose y axis is the picture's top. In the
/// picture's own axes the direction (sin θ sin φ, cos θ, −sin θ cos φ) is found at column φ/2π of its width (centres of
/// texels at halves, going round) and at row θ/π, the first row being the pole at θ = 0 and the last the one at θ = π;
/// between texels radiance is bilinear, as in Mitsuba.
///
/// Sampled cell by cell, the cells lying between four texels, in proportion to the mean luminance of those times the
/// cell's solid angle; within a cell uniformly over solid angle.
#[derive(Clone, Debug)]
pub struct Envmap(Arc<Map>);

impl PartialEq for Envmap {
    fn eq(&self, other: &Envmap) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

/// The picture with what sampling it needs.
struct Map {
    /// Columns and rows of cells: as many columns as texels, one row less.
    columns: usize,
    rows: usize,
    /// Texels, (rows + 1) × columns, scaled.
    texels: Vec<Rgb>,
    /// The choice among rows of cells, and that among the cells of each.
    of_rows: Cumulative,
    of_cells: Vec<Cumulative>,
    /// cos θ at the upper border of each row of cells and at the lower one of the last.
    cosines: Vec<f32>,
    /// The picture's axes in the world, orthonormal.
    axes: Mat3,
    mean: Rgb,
    largest: f32,
}

/// Size and checksum stand for the picture.
impl fmt::Debug for Map {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let mut hasher = crc32fast::Hasher::new();
        self.texels.iter().flat_map(|t| t.to_array()).for_each(|c| hasher.update(&c.to_le_bytes()));
        let checksum = hasher.finalize();
        write!(f, "{} × {}, {checksum:08x}, axes {:?}", self.columns, self.rows + 1, self.axes)
    }
}

impl Envmap {
    pub(super) fn read(p: &mut dyn Parameters) -> Option<Envmap> {
        let image = p.image("filename");
        let mut scale = p.float("scale").unwrap_or(1.0);
        if !(scale >= 0.0 && scale.is_finite()) {
            p.fault("scale", format!("scale is {scale}; it must be finite and not negative"));
            scale = 1.0;
        }
        p.boolean("mis_compensation"); // changes how Mitsuba samples, not what is there
        let Some((axes, _)) = similarity(&p.to_world()) else {
            p.fault("to_world", "to_world of an envmap turns it: it must not shear or scale directions unlike".into());
            return None;
        };
        let image = image?;
        let texels: Vec<Rgb> = image.linear().map(|texel| texel * scale).collect();
        if let Some(i) = texels.iter().position(|t| !t.is_finite() || t.min_element() < 0.0) {
            let (x, y) = (i % image.width as usize, i / image.width as usize);
            let message =
                format!("the radiance at column {x}, row {y} is {}; it must be finite and not negative", texels[i]);
            p.fault("filename", message);
            return None;
        }
        if image.height < 2 {
            p.fault("filename", "the picture has a single row; one for each pole is the least".into());
            return None;
        }
        Some(Envmap(Arc::new(Map::new(texels, image.width as usize, axes))))
    }

    /// Radiance from the direction `d`, and the density of sampling it.
    #[inline]
    pub(super) fn surrounding(&self, d: Vec3) -> (Rgb, f32) {
        let ([column, row], t) = self.0.cell(d);
        (self.0.within(row, column, t), self.0.density(row, column))
    }
}

impl Map {
    fn new(texels: Vec<Rgb>, columns: usize, axes: Mat3) -> Map {
        let rows = texels.len() / columns - 1;
        let cosines: Vec<f32> =
            (0..=rows).map(|row| libm::cos(std::f64::consts::PI * row as f64 / rows as f64) as f32).collect();
        let mut row_weights = Vec::with_capacity(rows);
        let mut of_cells = Vec::with_capacity(rows);
        let mut mean = glam::DVec3::ZERO;
        for row in 0..rows {
            let size = f64::from(cosines[row] - cosines[row + 1]) / (2.0 * columns as f64); // of the whole sphere
            let middle = |column| {
                let corners = corners(&texels, columns, row, column);
                corners.iter().map(|c| c.as_dvec3()).sum::<glam::DVec3>() / 4.0
            };
            let weights: Vec<_> = (0..columns).map(|column| f64::from(luminance(middle(column).as_vec3()))).collect();
            mean += (0..columns).map(middle).sum::<glam::DVec3>() * size;
            row_weights.push(weights.iter().sum::<f64>() * size);
            of_cells.push(Cumulative::new(weights.into_iter()));
        }
        let of_rows = Cumulative::new(row_weights.into_iter());
        let largest = texels.iter().map(|t| t.max_element()).fold(0.0, f32::max);
        Map { columns, rows, texels, of_rows, of_cells, cosines, axes, mean: mean.as_vec3(), largest }
    }

    /// The cell in the direction `d`, and how far in it that is: from the left, from above.
    #[inline]
    fn cell(&self, d: Vec3) -> ([usize; 2], [f32; 2]) {
        let local = (self.axes.transpose() * d).normalize();
        let turn = libm::atan2f(local.x, -local.z) / TAU;
        let across = turn * self.columns as f32 - 0.5;
        let column = across.floor();
        let down = libm::acosf(local.y.clamp(-1.0, 1.0)) / PI * self.rows as f32;
        let row = (down as usize).min(self.rows - 1);
        let index = (column as i64).rem_euclid(self.columns as i64) as usize;
        ([index, row], [across - column, (down - row as f32).clamp(0.0, 1.0)])
    }

    /// Radiance in a cell.
    #[inline]
    fn within(&self, row: usize, column: usize, t: [f32; 2]) -> Rgb {
        let [a, b, c, d] = corners(&self.texels, self.columns, row, column);
        a.lerp(b, t[0]).lerp(c.lerp(d, t[0]), t[1])
    }

    /// Draws a direction; with it the radiance from there and the density, with respect to solid angle.
    #[inline]
    fn draw(&self, u: [f32; 2]) -> (Vec3, Rgb, f32) {
        let (row, down) = self.of_rows.choose(u[1]);
        let (column, across) = self.of_cells[row].choose(u[0]);
        let (high, low) = (self.cosines[row], self.cosines[row + 1]);
        let cos = high + (low - high) * down;
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        let (s, c) = sin_cos_turn((column as f32 + 0.5 + across) / self.columns as f32);
        let wi = (self.axes * Vec3::new(sin * s, cos, -sin * c)).normalize();
        let theta = libm::acosf(cos.clamp(-1.0, 1.0)) / PI * self.rows as f32 - row as f32;
        (wi, self.within(row, column, [across, theta.clamp(0.0, 1.0)]), self.density(row, column))
    }

    /// Density of sampling any direction in a cell, with respect to solid angle.
    #[inline]
    fn density(&self, row: usize, column: usize) -> f32 {
        let solid_angle = TAU / self.columns as f32 * (self.cosines[row] - self.cosines[row + 1]);
        self.of_rows.share(row) * self.of_cells[row].share(column) / solid_angle
    }
}

/// The texels at the corners of a cell: left and right above, left and right below.
#[inline]
fn corners(texels: &[Rgb], columns: usize, row: usize, column: usize) -> [Rgb; 4] {
    let right = if column + 1 == columns { 0 } else { column + 1 };
    let (above, below) = (row * columns, (row + 1) * columns);
    [texels[above + column], texels[above + right], texels[below + column], texels[below + right]]
}

impl Emit for Envmap {
    fn kind(&self) -> EmitterKind {
        EmitterKind::Surrounding
    }

    /// What enters the sphere around the scene: the mean radiance · π · 4πr².
    fn power(&self, scene_radius: f32) -> Rgb {
        self.0.mean * (4.0 * PI * PI * scene_radius * scene_radius)
    }

    fn largest(&self) -> f32 {
        self.0.largest
    }

    #[inline]
    fn sample(&self, p: Vec3, ng: Vec3, u: [f32; 2]) -> Option<LightSample> {
        let (wi, radiance, pdf) = self.0.draw(u);
        let origin = origin_towards(p, ng, wi);
        (pdf > 0.0).then(|| LightSample::from_infinity(origin, wi, radiance / pdf, pdf))
    }

    #[inline]
    fn pdf(&self, _origin: Vec3, q: Vec3, _n: Vec3) -> f32 {
        let ([column, row], _) = self.0.cell(q);
        self.0.density(row, column)
    }

    #[inline]
    fn emit(&self, place: [f32; 2], direction: [f32; 2], scene: Ball) -> Option<Emission> {
        let (wi, radiance, pdf) = self.0.draw(place);
        (pdf > 0.0).then(|| from_infinity(scene, -wi, radiance, pdf, self.kind(), direction))
    }

    #[inline]
    fn emission_pdf(&self, _normals: [Vec3; 2], direction: Vec3, scene: Ball) -> [f32; 2] {
        let ([column, row], _) = self.0.cell(-direction);
        [self.0.density(row, column), scene.pdf()]
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::rng::{Counter, Purpose, Rng, unit_f32};

    /// Dark but for one bright texel at column 2 of 8 and row 1 of 5, on a turned sky.
    pub fn sky() -> Envmap {
        let mut texels = vec![Rgb::splat(0.1); 40];
        texels[10] = Rgb::new(50.0, 20.0, 5.0);
        Envmap(Arc::new(Map::new(texels, 8, Mat3::from_rotation_x(0.7))))
    }

    #[test]
    fn texels_are_where_mitsuba_puts_them() {
        let map = Envmap(Arc::new(Map::new((0..40).map(|i| Rgb::splat(i as f32)).collect(), 8, Mat3::IDENTITY)));
        // centres of columns at halves, rows from pole to pole
        let at = |column: f32, row: f32| {
            let (phi, theta) = (TAU * (column + 0.5) / 8.0, PI * row / 4.0);
            let d = Vec3::new(theta.sin() * phi.sin(), theta.cos(), -theta.sin() * phi.cos());
            radiance_from(&map, d).x
        };
        for (column, row, value) in [(2.0, 1.0, 10.0), (0.0, 3.0, 24.0), (7.0, 2.0, 23.0), (3.0, 1.5, 15.0)] {
            assert!((at(column, row) - value).abs() < 1e-3, "({column}, {row}) is {}", at(column, row));
        }
    }

    /// For directions drawn with it, the means of L/pdf and of 1/pdf are ∫ L and 4π. 2¹⁶ samples, bound 1 %.
    #[test]
    fn directions_are_sampled_with_the_density_they_state() {
        let map = sky();
        let (rng, n) = (Rng::new(3), 1u64 << 16);
        let (mut radiance, mut solid_angle) = (glam::DVec3::ZERO, 0.0);
        for step in 0..n {
            let counter = Counter { ladder: 0, replica: 0, step, purpose: Purpose::Primary };
            let [a, b, ..] = rng.words(counter, 0).map(unit_f32);
            let sample = map.sample(Vec3::ZERO, Vec3::Y, [a, b]).unwrap();
            let pdf = map.pdf(Vec3::ZERO, sample.wi, sample.wi);
            assert!((pdf / sample.pdf - 1.0).abs() < 1e-3 || on_a_border(&map, sample.wi), "{pdf} for {}", sample.pdf);
            let expected = radiance_from(&map, sample.wi);
            let error = (sample.weight * sample.pdf - expected).abs().max_element();
            assert!(error < 2e-3 * (1.0 + expected.max_element()), "{expected} in {}", sample.wi);
            radiance += sample.weight.as_dvec3();
            solid_angle += 1.0 / f64::from(sample.pdf);
        }
        assert!((solid_angle / n as f64 / (4.0 * std::f64::consts::PI) - 1.0).abs() < 0.01, "{solid_angle}");
        let exact = integral(&map);
        let got = radiance / n as f64;
        assert!(((got - exact) / exact).abs().max_element() < 0.01, "{got} for {exact}");
    }

    fn radiance_from(map: &Envmap, d: Vec3) -> Rgb {
        map.surrounding(d).0
    }

    /// Whether rounding may put a direction into the neighbouring cell.
    fn on_a_border(map: &Envmap, d: Vec3) -> bool {
        let (_, t) = map.0.cell(d);
        t.iter().any(|t| !(1e-3..=1.0 - 1e-3).contains(t))
    }

    /// ∫ L over all directions by midpoints.
    fn integral(map: &Envmap) -> glam::DVec3 {
        let (rows, columns) = (800, 1600);
        let mut sum = glam::DVec3::ZERO;
        for row in 0..rows {
            let theta = PI * (row as f32 + 0.5) / rows as f32;
            for column in 0..columns {
                let phi = TAU * (column as f32 + 0.5) / columns as f32;
                let local = Vec3::new(theta.sin() * phi.sin(), theta.cos(), -theta.sin() * phi.cos());
                sum += radiance_from(map, map.0.axes * local).as_dvec3() * f64::from(theta.sin());
            }
        }
        sum * (2.0 * std::f64::consts::PI * std::f64::consts::PI / f64::from(rows * columns))
    }

    #[test]
    fn its_power_is_that_of_its_mean() {
        let map = sky();
        let exact = integral(&map).as_vec3() * PI; // of a sphere of radius 1: ∫ L · π r²
        // cells weigh the corners' mean, which is not quite the mean within the cell
        assert!((map.power(1.0) / exact - Rgb::ONE).abs().max_element() < 0.1, "{} for {exact}", map.power(1.0));
    }

    #[test]
    fn a_black_sky_is_sampled_without_faults() {
        let map = Envmap(Arc::new(Map::new(vec![Rgb::ZERO; 8], 4, Mat3::IDENTITY)));
        let sample = map.sample(Vec3::ZERO, Vec3::Y, [0.3, 0.6]).unwrap();
        assert_eq!(sample.weight, Rgb::ZERO);
        assert!(sample.pdf.is_finite() && sample.pdf > 0.0);
    }
}
