//! Squares of two colours.

use glam::{Affine2, Vec2};

use super::Vary;
use crate::scene::{Rgb, parameters::Parameters};

/// A board of 2 × 2 squares over the unit square of surface coordinates, repeated.
///
/// Parameters: `color0` (default 0.4), of the square around (¼, ¼) and the one diagonal to it; `color1` (default 0.2);
/// `to_uv`: a transform of the surface coordinates.
#[derive(Clone, Debug)]
pub struct Checkerboard {
    colors: [Rgb; 2],
    to_uv: Affine2,
}

impl Vary for Checkerboard {
    #[inline]
    fn at(&self, uv: Vec2) -> Rgb {
        let uv = self.to_uv.transform_point2(uv);
        let beyond_half = (uv - uv.floor()).cmpgt(Vec2::splat(0.5));
        self.colors[usize::from(beyond_half.x != beyond_half.y)]
    }

    fn slope(&self, _uv: Vec2) -> Option<Vec2> {
        None
    }

    fn mean(&self) -> Rgb {
        0.5 * (self.colors[0] + self.colors[1])
    }

    fn range(&self) -> [f32; 2] {
        let [a, b] = self.colors;
        [a.min(b).min_element(), a.max(b).max_element()]
    }

    fn read(p: &mut dyn Parameters) -> Option<Checkerboard> {
        let mut color = |name: &str, default: f32| p.rgb(name).unwrap_or(Rgb::splat(default));
        let colors = [color("color0", 0.4), color("color1", 0.2)];
        Some(Checkerboard { colors, to_uv: p.to_uv() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn squares_alternate() {
        let board = Checkerboard { colors: [Rgb::ZERO, Rgb::ONE], to_uv: Affine2::from_scale(Vec2::splat(2.0)) };
        let row = |v: f32| [0.1, 0.3, 0.6, 0.9, -0.1].map(|u| board.at(Vec2::new(u, v)).x);
        assert_eq!(row(0.1), [0.0, 1.0, 0.0, 1.0, 1.0]);
        assert_eq!(row(0.3), [1.0, 0.0, 1.0, 0.0, 0.0]);
        assert_eq!(board.mean(), Rgb::splat(0.5));
    }
}
