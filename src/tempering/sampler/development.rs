//! From sums on the film to an image.

use super::{Learnt, Sampler};
use crate::{
    film::{Footprint, Heuristic, Image, Plane, Splats},
    tempering::{Combine, Histogram, PointLayer, RoundReport, Tally},
};

/// What there is to show at some moment.
pub struct Development {
    /// The picture.
    pub image: Image,
    /// Further layers.
    pub layers: Vec<(String, Plane)>,
    /// What the statistics say at this moment.
    pub learnt: Learnt,
    /// The round at work, as far as it has come.
    pub round: RoundReport,
}

impl<W: Default + Send> Sampler<W> {
    /// The picture so far, states included that have not been recorded yet; changes nothing.
    pub fn develop(&self) -> Development {
        let mut pending = Tally::new(self.state.round.ladder.rungs(), self.screen.layers.count);
        let (mut groups, mut sums) = (Vec::new(), Vec::new());
        let canvas = self.screen.canvas();
        for (number, portion) in self.portions.iter().enumerate() {
            let mut group = self.group(number);
            if let Some(block) = &portion.ladders {
                pending.histograms.fill(Histogram::default());
                block.pending(&canvas, &self.state.round, &mut pending);
                group.iter_mut().zip(&pending.histograms).for_each(|(sum, h)| sum.merge(h));
            }
            groups.push(group);
            sums.push(std::mem::take(&mut pending.tempered));
        }
        let learnt = self.learnt(&groups, &sums);
        let planes = Planes { sampler: self, pending: &pending.splats, learnt: &learnt };
        let combine = self.choices.combine;
        let image = match combine {
            Combine::Balance if self.screen.layers.hot.is_none() => planes.even(),
            Combine::Balance => planes.balance(),
            Combine::Uniform => planes.uniform(),
            Combine::Target => planes.target(),
            Combine::Max => Heuristic::Max.combine(&planes.uniform(), &planes.target()),
            Combine::Power => Heuristic::Power.combine(&planes.uniform(), &planes.target()),
            Combine::Median => Heuristic::Median.combine(&planes.uniform(), &planes.target()),
            Combine::MedianPrinted => Heuristic::MedianAsPrinted.combine(&planes.uniform(), &planes.target()),
        };
        Development { image, layers: planes.layers(), round: self.report(&learnt), learnt }
    }
}

/// Images from the layers of a film.
struct Planes<'a, W> {
    sampler: &'a Sampler<W>,
    pending: &'a Splats,
    learnt: &'a Learnt,
}

impl<W: Default + Send> Planes<'_, W> {
    fn sums(&self, layer: Option<usize>) -> Option<Vec<[f64; 4]>> {
        layer.map(|layer| self.sampler.screen.film.layer_with(layer, self.pending))
    }

    fn pixels(&self) -> f64 {
        let [width, height] = self.sampler.screen.size;
        f64::from(width) * f64::from(height)
    }

    fn image(&self, colour: impl Fn(usize) -> [f64; 3]) -> Image {
        let [width, height] = self.sampler.screen.size;
        Image::new(width, height, (0..self.pixels() as usize).map(|i| colour(i).map(|v| v as f32)).collect())
    }

    /// Ẑ_K by the magnitude that states are kept in.
    fn unit(&self) -> f64 {
        libm::exp(self.learnt.normalisers.target.ln_value - self.sampler.state.ln_unit)
    }

    /// What a sum of tempered states on the balanced film is multiplied by.
    fn tempered_scale(&self) -> f64 {
        if self.sampler.state.states_a_rung == 0 {
            0.0
        } else {
            self.pixels() * self.unit() / self.sampler.state.effort
        }
    }

    /// All rungs together: the mean over each pixel's uniform points, plus the tempered states.
    fn balance(&self) -> Image {
        let hot = self.hot();
        let tempered = self.sums(self.sampler.screen.layers.tempered);
        let scale = self.tempered_scale();
        self.image(|i| {
            let hot = hot.of(i);
            [0, 1, 2].map(|ch| hot[ch] + tempered.as_ref().map_or(0.0, |sums| sums[i][ch] * scale))
        })
    }

    /// The mean over each pixel's stratified points.
    fn even(&self) -> Image {
        let layer = self.sampler.screen.layers.even.expect("a layer of stratified points");
        let [stratified, _] = self.sampler.state.points;
        // runs go through the pixels in the same order
        let longest = if self.sampler.longest > 0 { self.sampler.longest } else { stratified };
        let points = self.points(layer, [longest, 0], stratified as f64);
        self.image(|i| points.of(i))
    }

    /// E_u.
    fn uniform(&self) -> Image {
        let layer = self.sampler.screen.layers.uniform.expect("a layer of uniform points");
        let [stratified, offered] = self.sampler.state.points;
        let points = self.points(layer, [stratified, offered], (stratified + offered) as f64);
        self.image(|i| points.of(i))
    }

    /// What uniform points add to the balanced image: those since chains started.
    fn hot(&self) -> PointImage {
        let layer = self.sampler.screen.layers.hot.expect("a layer of the balanced image");
        let [stratified, offered] = self.sampler.state.points;
        // a round's points share its evaluations among them as their effort, so all of them sum to all of these
        self.points(layer, [stratified - self.sampler.state.bootstrap, offered], self.sampler.state.effort)
    }

    /// Of a layer with so many stratified points in the order of pixels and so many offered ones, of weight `weight` all
    /// together.
    fn points(&self, layer: PointLayer, points: [u64; 2], weight: f64) -> PointImage {
        let own = self.sampler.screen.film.layer_with(layer.own, self.pending);
        let means = PixelMeans::new(&own, points, &self.sampler.screen.footprint);
        let scale = if weight > 0.0 { self.pixels() / weight } else { 0.0 };
        PointImage { own, means, elsewhere: self.sums(layer.elsewhere).map(|sums| (sums, scale)) }
    }

    /// E_e.
    fn target(&self) -> Image {
        let states = (self.sampler.state.states_a_rung as f64).max(1.0);
        let scale = self.pixels() * self.unit() / states;
        match self.sums(self.sampler.screen.layers.target) {
            Some(sums) => self.image(|i| [0, 1, 2].map(|ch| sums[i][ch] * scale)),
            None => self.image(|_| [0.0; 3]),
        }
    }

    /// Everything beside the picture: how many samples lie in each pixel, wherever they contribute, and on request E_u, E_e
    /// and every rung's part of the balanced image; the parts sum to it.
    fn layers(&self) -> Vec<(String, Plane)> {
        let on = &self.sampler.screen.layers;
        let tempered = self.sums(on.tempered);
        let of_points = on.hot.or(on.even).or(on.uniform).map(|layer| layer.own);
        let main = self.sums(of_points.or(on.target)).unwrap_or_default();
        let density =
            main.iter().enumerate().map(|(i, sums)| (sums[3] + tempered.as_ref().map_or(0.0, |t| t[i][3])) as f32);
        let mut layers = vec![("density".to_owned(), Plane::Gray(density.collect()))];
        if !self.sampler.choices.layers || on.hot.is_none() {
            return layers;
        }
        layers.push(("uniform".into(), Plane::Rgb(self.uniform())));
        if self.sampler.state.round.ladder.chains() == 0 {
            return layers;
        }
        layers.push(("target".into(), Plane::Rgb(self.target())));
        let hot = self.hot();
        layers.push(("rung1".into(), Plane::Rgb(self.image(|i| hot.of(i)))));
        let scale = self.tempered_scale();
        for k in 1..self.sampler.state.round.ladder.rungs() {
            let sums = self.sums(on.rungs.map(|first| first + k - 1)).unwrap_or_default();
            layers
                .push((format!("rung{}", k + 1), Plane::Rgb(self.image(|i| [0, 1, 2].map(|ch| sums[i][ch] * scale)))));
        }
        layers
    }
}

/// An image of uniform points: where they lie, the mean over the points of each pixel; elsewhere, the sum times the number
/// of pixels over the number (or weight) of all points.
///
/// What a pixel gets from elsewhere comes from points of all pixels, so the number of its own points says nothing about
/// it. While stratified points are amid a pass over the pixels it is unbiased if what points give elsewhere does not
/// depend on where they lie on the film, as with light subpaths; after whole passes it is so in any case.
struct PointImage {
    own: Vec<[f64; 4]>,
    means: PixelMeans,
    elsewhere: Option<(Vec<[f64; 4]>, f64)>,
}

impl PointImage {
    /// The colour of a pixel.
    fn of(&self, i: usize) -> [f64; 3] {
        let own = self.means.of(&self.own[i]);
        match &self.elsewhere {
            Some((sums, scale)) => [0, 1, 2].map(|ch| own[ch] + sums[i][ch] * scale),
            None => own,
        }
    }
}

/// Means over the uniform points of each pixel, of which the number is random.
///
/// Dividing by the number that a pixel got, rather than by the one it should have got, takes the noise of that number
/// out of the image (post-stratification; relMSE of `cornell-box` at 60 mpp and K = 3: 0.0094 to 0.0077), without
/// touching the points that are offered to chains, which must stay independent. A pixel without any counts as 0; the
/// others are scaled up for that, by the inverse of the probability of getting some, so that the estimate stays unbiased
/// at any number of points. With a filter wider than a pixel the divisor is the sum of filter weights: consistent, as in
/// Mitsuba. Where such a filter has negative lobes that sum may come out near 0 or below, and the mean as large as you
/// please, of either sign; so there the divisor is never less than half of what it is on average over the film. From some
/// ten points a pixel on that hardly ever happens, and the less, the more there are.
struct PixelMeans {
    scale: f64,
    least: f64,
}

impl PixelMeans {
    /// For what was gathered on that film: Σ of colours and of weights by pixel. `stratified` and `offered` are the numbers
    /// of points of either kind, of several runs the largest of the former; with a box filter a point is in one pixel.
    fn new(sums: &[[f64; 4]], [stratified, offered]: [u64; 2], footprint: &Footprint) -> PixelMeans {
        let pixels = sums.len() as f64;
        // (1 − s/P)⁺ (1 − 1/P)^o, the share of pixels that get none
        let none = (1.0 - stratified as f64 / pixels).max(0.0) * libm::exp(offered as f64 * libm::log1p(-1.0 / pixels));
        let some = if pixels > 1.0 { 1.0 - none } else { 1.0 };
        let average = sums.iter().map(|sum| sum[3]).sum::<f64>() / pixels;
        PixelMeans {
            scale: if footprint.is_box() && some > 0.0 { 1.0 / some } else { 1.0 },
            least: if footprint.has_negative_lobes() { 0.5 * average } else { 0.0 },
        }
    }

    fn of(&self, &[r, g, b, weight]: &[f64; 4]) -> [f64; 3] {
        let divisor = weight.max(self.least);
        if divisor > 0.0 { [r, g, b].map(|v| v * self.scale / divisor) } else { [0.0; 3] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Filter;

    #[test]
    fn a_pixel_whose_weights_cancel_stays_within_its_bounds() {
        // three pixels of ten samples of 1 each, whose weights sum to 10 on average
        let sums = [[19.5, 19.5, 19.5, 19.5], [10.4, 10.4, 10.4, 10.4], [0.1, 0.1, 0.1, 0.1]];
        let means = |filter| {
            let means = PixelMeans::new(&sums, [30, 0], &Footprint::new(filter, 3, 1));
            sums.map(|sum| means.of(&sum)[0])
        };
        assert_eq!(means(Filter::Gaussian { stddev: 0.5 }), [1.0; 3], "weights above 0 are trusted");
        assert_eq!(means(Filter::Lanczos { lobes: 3 }), [1.0, 1.0, 0.1 / 5.0]);
        let below = PixelMeans::new(&sums, [30, 0], &Footprint::new(Filter::Lanczos { lobes: 3 }, 3, 1));
        assert_eq!(below.of(&[2.0, 1.0, 0.0, -0.5]), [0.4, 0.2, 0.0]);
    }
}
