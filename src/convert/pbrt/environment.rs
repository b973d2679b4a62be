//! pbrt's environments, squares of equal solid angles, to pictures by longitude and latitude.

use std::f64::consts::PI;

use glam::{DMat3, DVec3};

use crate::film::Image;
use crate::film::image::relative_luminance;

/// Samples of the square that make a pixel, along each side of it.
const SUBSAMPLES: usize = 4;

/// From the coordinates of Mitsuba's environments, whose pole is +y, to those of pbrt's, whose pole is +z.
pub const FROM_MITSUBA: DMat3 = DMat3::from_cols_array(&[1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0]);

/// The picture that Mitsuba's `envmap` shows in the directions `to_square` · d as pbrt shows `square` in d.
///
/// Mitsuba has a pixel's centre in the middle of its longitudes, and the first and last rows at the poles.
pub fn by_longitude(square: &Image, to_square: DMat3) -> Image {
    let side = (square.width as usize).max(3); // rows at both poles and one between them
    let (width, height) = (2 * side, side);
    let mut pixels = Vec::with_capacity(width * height);
    for j in 0..height {
        for i in 0..width {
            let mut sum = [0.0; 3];
            for sub in 0..SUBSAMPLES * SUBSAMPLES {
                let [dx, dy] = [sub % SUBSAMPLES, sub / SUBSAMPLES].map(|k| (k as f64 + 0.5) / SUBSAMPLES as f64 - 0.5);
                let longitude = 2.0 * PI * (i as f64 + 0.5 + dx) / width as f64;
                let latitude = (PI * (j as f64 + dy) / (height - 1) as f64).clamp(0.0, PI);
                let value = lookup(square, square_of(to_square * direction(longitude, latitude)));
                sum.iter_mut().zip(value).for_each(|(sum, v)| *sum += v);
            }
            pixels.push(sum.map(|sum| (sum / (SUBSAMPLES * SUBSAMPLES) as f64) as f32));
        }
    }
    Image::new(width as u32, height as u32, pixels)
}

/// The direction of Mitsuba's environments at a longitude from −z towards +x and an angle from +y.
fn direction(longitude: f64, latitude: f64) -> DVec3 {
    let (sin, cos) = (libm::sin(latitude), libm::cos(latitude));
    DVec3::new(libm::sin(longitude) * sin, cos, -libm::cos(longitude) * sin)
}

/// The place in the unit square of a unit direction, +z in its middle.
///
/// Source: Clarberg 2008, "Fast equal-area mapping of the (hemi)sphere using SIMD".
fn square_of(d: DVec3) -> [f64; 2] {
    let [x, y, z] = d.abs().to_array();
    let r = (1.0 - z).max(0.0).sqrt();
    let phi = if x == 0.0 && y == 0.0 { 0.0 } else { libm::atan2(y, x) * 2.0 / PI };
    let v = phi * r;
    let u = r - v;
    let [u, v] = if d.z < 0.0 { [1.0 - v, 1.0 - u] } else { [u, v] };
    [(u.copysign(d.x) + 1.0) / 2.0, (v.copysign(d.y) + 1.0) / 2.0]
}

/// The value at a place of the square, linear between the centres of pixels. Beyond an edge is the half of the same edge
/// that mirrors it.
fn lookup(square: &Image, [u, v]: [f64; 2]) -> [f64; 3] {
    let n = i64::from(square.width);
    let (x, y) = (u * n as f64 - 0.5, v * n as f64 - 0.5);
    let (x0, y0) = (x.floor(), y.floor());
    let at = |x: i64, y: i64| {
        let (x, y) = if x < 0 || x >= n { (x.clamp(0, n - 1), n - 1 - y) } else { (x, y) };
        let (x, y) = if y < 0 || y >= n { (n - 1 - x, y.clamp(0, n - 1)) } else { (x, y) };
        square.pixels[(y * n + x) as usize].map(f64::from)
    };
    let (fx, fy, x0, y0) = (x - x0, y - y0, x0 as i64, y0 as i64);
    let corners = [at(x0, y0), at(x0 + 1, y0), at(x0, y0 + 1), at(x0 + 1, y0 + 1)];
    let weights = [(1.0 - fx) * (1.0 - fy), fx * (1.0 - fy), (1.0 - fx) * fy, fx * fy];
    [0, 1, 2].map(|c| corners.iter().zip(weights).map(|(corner, weight)| corner[c] * weight).sum())
}

/// What pbrt takes for the irradiance on a surface that faces +z, and scales to `illuminance`: one half of what a square
/// of radiances gives there, as it spreads 2π over all pixels of the sphere (as of 2024).
pub fn illuminance(square: &Image) -> f64 {
    let n = square.width as usize;
    let mut sum = 0.0;
    for (i, rgb) in square.pixels.iter().enumerate() {
        let [u, v] = [i % n, i / n].map(|k| 2.0 * (k as f64 + 0.5) / n as f64 - 1.0);
        let distance = 1.0 - (u.abs() + v.abs());
        let r = 1.0 - distance.abs();
        let cosine = (1.0 - r * r).copysign(distance).max(0.0);
        sum += cosine * relative_luminance(rgb.map(f64::from));
    }
    sum * 2.0 * PI / square.pixels.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_have_their_places_in_the_square() {
        for (d, place) in [
            (DVec3::Z, [0.5, 0.5]),
            (DVec3::X, [1.0, 0.5]),
            (DVec3::NEG_X, [0.0, 0.5]),
            (DVec3::Y, [0.5, 1.0]),
            (DVec3::NEG_Y, [0.5, 0.0]),
            (DVec3::NEG_Z, [1.0, 1.0]),
        ] {
            let [u, v] = square_of(d);
            assert!((u - place[0]).abs() < 1e-12 && (v - place[1]).abs() < 1e-12, "{d}: {u} {v}");
        }
    }

    #[test]
    fn equal_parts_of_the_square_are_equal_solid_angles() {
        // of directions by equal solid angles, as many fall into each of 4 × 4 cells
        const N: usize = 400;
        let mut cells = [0usize; 16];
        for i in 0..N * N {
            let z: f64 = 1.0 - 2.0 * ((i / N) as f64 + 0.5) / N as f64;
            let phi = 2.0 * PI * ((i % N) as f64 + 0.5) / N as f64;
            let r = (1.0 - z * z).sqrt();
            let [u, v] = square_of(DVec3::new(r * phi.cos(), r * phi.sin(), z));
            cells[(u * 4.0).min(3.0) as usize * 4 + (v * 4.0).min(3.0) as usize] += 1;
        }
        for count in cells {
            assert!((count as f64 / (N * N / 16) as f64 - 1.0).abs() < 0.02, "{cells:?}");
        }
    }

    #[test]
    fn a_bright_top_is_at_the_top() {
        let n = 16;
        let mut square = Image::constant(n, n, [0.0; 3]);
        // the middle of the square: around +z
        for (x, y) in [(7, 7), (8, 7), (7, 8), (8, 8)] {
            square.pixels[y * n as usize + x] = [1.0; 3];
        }
        let picture = by_longitude(&square, FROM_MITSUBA);
        assert!(picture.pixels[0][0] > 0.9, "{:?}", picture.pixels[0]);
        assert!(picture.pixels[picture.pixels.len() - 1][0] < 1e-6);
        assert!((illuminance(&Image::constant(128, 128, [1.0; 3])) / (PI / 2.0) - 1.0).abs() < 0.01);
    }
}
