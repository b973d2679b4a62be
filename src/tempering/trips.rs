//! Who travels the ladder: round trips, restarts, lineages, and the index process.

use serde::{Deserialize, Serialize};

/// Where a replica's state comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum Origin {
    /// It was there when the ladder started.
    Start,
    /// It was drawn on the uniform rung and has not been on the target yet.
    Uniform,
    /// It was drawn on the uniform rung and has been on the target.
    Target,
}

/// Sums over the lineages that ended on one rung's account: Σ t and Σ t² of their dwell times there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Dwell {
    /// Σ t, sweeps.
    pub sum: u64,
    /// Σ t².
    pub squares: u64,
}

/// Travels of all replicas of a block of ladders. A *lineage* is all that descends from one uniform point that a chain
/// took, until the next one takes its place.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Trips {
    chains: usize,
    origins: Vec<Origin>,
    /// Sweeps that each replica's lineage has spent on each rung: `[lane · chains + (rung − 1)]`.
    ages: Vec<u32>,
    /// By tempered rung.
    pub dwell: Vec<Dwell>,
    /// Lineages that went from the uniform rung to the target and were replaced by a uniform point again.
    pub round_trips: u64,
    /// Lineages that reached the target.
    pub restarts: u64,
}

impl Trips {
    /// For `lanes` replicas on ladders of `chains` tempered rungs.
    pub fn new(lanes: usize, chains: usize) -> Trips {
        Trips {
            chains,
            origins: vec![Origin::Start; lanes],
            ages: vec![0; lanes * chains],
            dwell: vec![Dwell::default(); chains],
            round_trips: 0,
            restarts: 0,
        }
    }

    /// Whether these are the travels of so many replicas on such ladders.
    pub fn fits(&self, lanes: usize, chains: usize) -> bool {
        let of = (self.chains, self.origins.len(), self.ages.len(), self.dwell.len());
        of == (chains, lanes, lanes * chains, chains)
    }

    /// The replica spends a sweep on rung `k`, counted from 1.
    #[inline(always)]
    pub fn stays(&mut self, lane: usize, k: usize) {
        self.ages[lane * self.chains + k - 1] += 1;
        if k == self.chains && self.origins[lane] == Origin::Uniform {
            self.origins[lane] = Origin::Target;
            self.restarts += 1;
        }
    }

    /// A uniform point takes the place of the replica's state: a lineage ends and another begins.
    pub fn renewed(&mut self, lane: usize) {
        if self.origins[lane] == Origin::Target {
            self.round_trips += 1;
        }
        self.origins[lane] = Origin::Uniform;
        let ages = &mut self.ages[lane * self.chains..][..self.chains];
        for (age, dwell) in ages.iter_mut().zip(&mut self.dwell) {
            let t = u64::from(std::mem::take(age));
            dwell.sum += t;
            dwell.squares += t * t;
        }
    }

    /// Forgets the counts, not the travellers.
    pub fn reset_counts(&mut self) {
        self.dwell.fill(Dwell::default());
        (self.round_trips, self.restarts) = (0, 0);
    }
}

/// The rungs of a few replicas over time, thinned as it grows.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct IndexProcess {
    /// Rungs of each replica, oldest first.
    pub rungs: Vec<Vec<u16>>,
    /// Sweeps from one entry to the next.
    pub stride: u64,
    sweeps: u64,
}

/// Replicas that are watched.
const WATCHED: usize = 4;
/// Entries of each, at most.
const MOST_ENTRIES: usize = 256;

impl IndexProcess {
    /// Notes the rungs of the first replicas after a sweep.
    pub fn note(&mut self, rungs: &[u16]) {
        self.stride = self.stride.max(1);
        if self.sweeps.is_multiple_of(self.stride) {
            self.rungs.resize(rungs.len().min(WATCHED), Vec::new());
            self.rungs.iter_mut().zip(rungs).for_each(|(list, rung)| list.push(*rung));
            if self.rungs.first().is_some_and(|list| list.len() > MOST_ENTRIES) {
                self.thin();
            }
        }
        self.sweeps += 1;
    }

    /// Drops every second entry.
    fn thin(&mut self) {
        for list in &mut self.rungs {
            let mut i = 0;
            list.retain(|_| {
                i += 1;
                i % 2 == 1
            });
        }
        self.stride *= 2;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_round_trip_goes_from_the_uniform_rung_to_the_target_and_back() {
        let mut trips = Trips::new(1, 2);
        trips.stays(0, 2); // what was there at the start has not come from anywhere
        trips.renewed(0);
        assert_eq!((trips.restarts, trips.round_trips), (0, 0));
        trips.stays(0, 1);
        trips.stays(0, 2);
        trips.stays(0, 2);
        trips.stays(0, 1);
        assert_eq!((trips.restarts, trips.round_trips), (1, 0));
        trips.renewed(0);
        assert_eq!((trips.restarts, trips.round_trips), (1, 1));
        assert_eq!(trips.dwell, [Dwell { sum: 2, squares: 4 }, Dwell { sum: 3, squares: 5 }]);
    }

    #[test]
    fn the_index_process_keeps_evenly_spaced_entries() {
        let mut process = IndexProcess::default();
        (0..1000u16).for_each(|sweep| process.note(&[sweep]));
        let [list] = &process.rungs[..] else { panic!("one replica") };
        assert!(list.len() > 100 && list.len() <= MOST_ENTRIES);
        assert!(list.iter().enumerate().all(|(i, r)| u64::from(*r) == i as u64 * process.stride));
    }
}
