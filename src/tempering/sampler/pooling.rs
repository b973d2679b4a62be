//! Uniform points of several runs as those of one.

use super::{Sampler, Setup};

impl<W: Default + Send> Sampler<W> {
    /// Whether there are uniform points only, and will be: then sums of several runs of the same job may be added.
    pub fn is_uniform_alone(&self) -> bool {
        self.choices.is_uniform_alone()
    }

    /// A sampler of the same job that has done nothing.
    pub fn empty(&self) -> Sampler<W> {
        Sampler::new(Setup {
            rng: self.rng,
            choices: self.choices.clone(),
            footprint: self.screen.footprint.clone(),
            size: self.screen.size,
            unit: self.screen.unit,
            elsewhere: self.screen.elsewhere,
            outcomes: self.state.round.open,
            evaluations: self.planned,
        })
    }

    /// Adds all that another sampler of uniform points has seen: what comes of it is the image of all points together, and
    /// no more points may be drawn.
    ///
    /// # Panics
    /// If there are chains, or jobs differ in their films.
    pub fn pool(&mut self, other: &Sampler<W>) {
        assert!(self.is_uniform_alone() && other.is_uniform_alone(), "chains cannot be pooled");
        self.screen.film.merge(&other.screen.film);
        self.screen.groups.merge(&other.screen.groups);
        self.longest = self.longest.max(other.state.points[0]);
        self.state.points[0] += other.state.points[0];
        self.state.sweeps += other.state.sweeps;
        self.state.evaluations += other.state.evaluations;
        self.state.rays += other.state.rays;
        self.state.faults.merge(&other.state.faults);
    }
}
