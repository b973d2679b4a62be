//! From states and their weights to splats.

use crate::{
    film::{Footprint, Splat, Splats},
    path::{FilmSplat, Outcome, Whole},
    scene::Rgb,
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
    /// Adds `value` · f to the layer's image, at the contribution's own film position and elsewhere, and `weight` to its
    /// density at its own. So the density of a layer says how many samples there were, each once, where their first
    /// dimensions lie.
    ///
    /// For layers that are divided by the number of all samples; see [`splat_apart`](Self::splat_apart) for others.
    #[inline(always)]
    pub fn splat(&mut self, layer: usize, whole: Whole, value: f64, weight: f64) {
        self.splat_apart([layer, layer], whole, value, weight);
    }

    /// [`splat`](Self::splat) with what goes elsewhere in a layer of its own, the second one, so that the pixels of the
    /// first may be divided by the samples that they got.
    #[inline(always)]
    pub fn splat_apart(&mut self, [layer, elsewhere]: [usize; 2], whole: Whole, value: f64, weight: f64) {
        self.add(layer, whole.main.splat(), value, weight);
        if !whole.elsewhere.is_empty() {
            self.add_all(elsewhere, whole.elsewhere, value);
        }
    }

    /// Adds `weight` to the density at `film`, where an open point lies, and `value` · f of all its outcomes: of those that
    /// are there to the first layer, of others to the second.
    pub fn splat_outcomes(
        &mut self,
        [layer, elsewhere]: [usize; 2],
        film: [f32; 2],
        outcomes: &[Outcome],
        value: impl Fn(usize) -> f64,
        weight: f64,
    ) {
        self.add(layer, FilmSplat { film, rgb: Rgb::ZERO }, 0.0, weight);
        for (i, outcome) in outcomes.iter().enumerate() {
            self.add(if outcome.own { layer } else { elsewhere }, outcome.splat, value(i), 0.0);
        }
    }

    /// Adds `value` · f of every splat to a layer's image; apart, so that what has none stays small.
    #[inline(never)]
    fn add_all(&mut self, layer: usize, splats: &[FilmSplat], value: f64) {
        splats.iter().for_each(|splat| self.add(layer, *splat, value, 0.0));
    }

    /// Adds `value` · f to a layer's image and `weight` to its density.
    #[inline(always)]
    fn add(&mut self, layer: usize, splat: FilmSplat, value: f64, weight: f64) {
        let rgb = splat.rgb * value as f32;
        let weight = weight as f32;
        let [x, y] = [splat.film[0] * self.size[0], splat.film[1] * self.size[1]];
        let splats = &mut *self.splats;
        self.footprint.spread(x, y, &mut |pixel, share| {
            splats.push(layer, Splat { pixel, rgb: (rgb * share).to_array(), weight: weight * share });
        });
    }
}
