//! Where on the film chains have been.

use serde::{Deserialize, Serialize};

use crate::path::Whole;

/// Cells of the film, a grid of as many columns as rows.
pub const CELLS: usize = GRID * GRID;

/// Columns of the grid: few enough that every cell gets states of every chain that moves.
const GRID: usize = 4;

/// 2¹⁶.
const STEPS: f64 = 65536.0;

/// Which share of its luminance the states of some chains put into each cell of the film, as sums over states: integers in
/// steps of 2⁻¹⁶, which do not depend on the order of addition.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Whereabouts {
    /// Σ of expected weights times shares.
    cells: [u64; CELLS],
    /// Σ of expected weights times Σ over cells of squares of shares.
    squares: u64,
    /// Σ of expected weights.
    states: u64,
}

impl Whereabouts {
    /// Adds a lit state with its expected weight.
    #[inline(always)]
    pub fn add(&mut self, state: Whole, weight: f64) {
        let weight = (weight * STEPS) as u64;
        self.states += weight;
        if state.elsewhere.is_empty() {
            self.cells[cell(state.main.film)] += weight;
            self.squares += weight;
        } else {
            self.add_parts(state, weight);
        }
    }

    /// A state that lies in several places; apart, so that what has one stays small.
    #[inline(never)]
    fn add_parts(&mut self, state: Whole, weight: u64) {
        let mut shares = [0.0; CELLS];
        for part in state.parts() {
            shares[cell(part.film)] += part.luminance() / state.main.luminance();
        }
        for (sum, share) in self.cells.iter_mut().zip(shares) {
            *sum += (weight as f64 * share) as u64;
        }
        self.squares += (weight as f64 * shares.iter().map(|share| share * share).sum::<f64>()) as u64;
    }

    /// Adds the states of others, which may come from a file and be of any size.
    pub fn merge(&mut self, other: &Whereabouts) {
        self.cells.iter_mut().zip(other.cells).for_each(|(sum, cell)| *sum = sum.saturating_add(cell));
        self.squares = self.squares.saturating_add(other.squares);
        self.states = self.states.saturating_add(other.states);
    }

    /// Mean share of each cell; nothing without states.
    pub fn means(&self) -> Option<[f64; CELLS]> {
        (self.states > 0).then(|| self.cells.map(|cell| cell as f64 / self.states as f64))
    }

    /// Variance of a state's shares, summed over cells; 0 without states.
    pub fn variance(&self) -> f64 {
        let squares: f64 = self.means().map_or(f64::NAN, |means| means.iter().map(|mean| mean * mean).sum());
        (self.squares as f64 / self.states as f64 - squares).max(0.0)
    }
}

/// The cell of a film position, both coordinates from 0 to 1.
#[inline(always)]
fn cell([x, y]: [f32; 2]) -> usize {
    let [column, row] = [x, y].map(|at| ((at * GRID as f32) as usize).min(GRID - 1));
    row * GRID + column
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        path::{Contribution, Elsewhere, FilmSplat},
        scene::Rgb,
    };

    /// A state in the first cell, one in the last, and one that is a quarter in the first and three quarters in the second.
    #[test]
    fn states_count_where_their_light_falls() {
        let mut elsewhere = Elsewhere::new(3);
        elsewhere.push(2, FilmSplat { film: [0.3, 0.0], rgb: Rgb::splat(3.0) });
        let mut sums = Whereabouts::default();
        for (lane, film) in [[0.1, 0.2], [1.0, 1.0], [0.0, 0.0]].into_iter().enumerate() {
            let (main, _) = Contribution::settle_whole(film, Rgb::splat(1.0), &mut elsewhere, lane);
            let mut one = Whereabouts::default();
            one.add(Whole { main: &main, elsewhere: elsewhere.of(lane) }, 0.5);
            sums.merge(&one);
        }
        let means = sums.means().unwrap();
        let expected = [(0, 1.25 / 3.0), (1, 0.25), (15, 1.0 / 3.0)];
        expected.iter().for_each(|(cell, mean)| assert!((means[*cell] - mean).abs() < 1e-4, "{means:?}"));
        assert!((means.iter().sum::<f64>() - 1.0).abs() < 1e-4);
        let variance = (2.0 + 0.25 * 0.25 + 0.75 * 0.75) / 3.0 - expected.iter().map(|(_, m)| m * m).sum::<f64>();
        assert!((sums.variance() - variance).abs() < 1e-4, "{} for {variance}", sums.variance());
        let full = Whereabouts { cells: [u64::MAX; CELLS], squares: u64::MAX, states: u64::MAX };
        sums.merge(&full);
        assert_eq!(sums, full);
        assert!(Whereabouts::default().variance() == 0.0 && Whereabouts::default().means().is_none());
    }
}
