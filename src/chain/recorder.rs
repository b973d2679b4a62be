//! From states and their weights to splats.

use crate::{
    film::{Footprint, Splat, Splats},
    path::Contribution,
};

/// Writes the contributions of states into the splats of a block.
pub struct Recorder<'a> {
    /// Which pixels a film position goes to.
    pub footprint: &'a Footprint,
    /// Width and height of the film in pixels.
    pub size: [f32; 2],
    /// Where the splats go.
    pub splats: &'a mut Splats,
}

impl Recorder<'_> {
    /// Adds `value` · f to the layer's image and `weight` to its density, at the contribution's film position.
    #[inline(always)]
    pub fn splat(&mut self, layer: usize, contribution: &Contribution, value: f64, weight: f64) {
        let rgb = contribution.rgb * value as f32;
        let weight = weight as f32;
        let [x, y] = [contribution.film[0] * self.size[0], contribution.film[1] * self.size[1]];
        let splats = &mut *self.splats;
        self.footprint.spread(x, y, &mut |pixel, share| {
            splats.push(layer, Splat { pixel, rgb: (rgb * share).to_array(), weight: weight * share });
        });
    }
}
