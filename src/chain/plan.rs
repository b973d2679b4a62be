//! How a job is cut into blocks, by the job alone and never by the machine.

/// Blocks of lanes and the length of the run.
///
/// A block is what one thread works on at a time, a lane one chain or one stream of independent samples. Blocks are
/// many more than threads, so that threads stay busy, and the same for any number of threads, so that the image is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Plan {
    /// Number of blocks.
    pub blocks: usize,
    /// Groups of lanes in a block: ladders, where there are any.
    pub groups: usize,
    /// Lanes in a group.
    pub lanes_per_group: usize,
    /// Sweeps to go through, where mutations are limited. A sweep evaluates every lane of every block once.
    pub sweeps: Option<u64>,
}

/// Blocks of a large job: enough for 16 threads to have four each left when the first finishes.
const BLOCKS: usize = 64;
/// Lanes of a block: packets stay full when most paths have ended, and all a block needs stays in a core's cache.
const LANES: usize = 256;
/// Groups from which standard errors are taken are the blocks: never fewer.
pub const FEWEST_BLOCKS: usize = 8;
/// A chain with fewer steps than this is mostly start-up: short jobs get fewer chains instead.
const SHORTEST_CHAIN: u64 = 512;

/// Lanes of the ladders of a block, unless one ladder has more.
///
/// Few, because what chains start from is not enough for many: the bootstrap has some hundred samples that matter, and
/// chains forget them only after thousands of sweeps. relMSE times mutations on `lattice` after 12 to 22 M mutations with
/// 8, 16, 32, 64, 256 lanes in each of 64 blocks: 2.0, 2.0, 2.7, 3.0, 4.1 M. Packets of rays want more: they are filled by
/// several blocks together.
const LANES_OF_LADDERS: usize = 16;
/// Sweeps that a ladder should go through; at 128 mutations per pixel, relMSE of `lattice` is 0.64, 0.28, 0.25 with 512,
/// 2048 and 8192 (`relt render --replicas 3 --mpp 128`, median of seeds 1 to 3, this constant changed).
const SHORTEST_ON_LADDER: u64 = 8192;

impl Plan {
    /// The plan for `mutations` evaluations, or an open end, in groups of `lanes_per_group`.
    pub fn new(mutations: Option<u64>, lanes_per_group: usize) -> Plan {
        let groups_at_most = (LANES / lanes_per_group).max(1);
        let Some(mutations) = mutations else {
            return Plan { blocks: BLOCKS, groups: groups_at_most, lanes_per_group, sweeps: None };
        };
        // fewer lanes first in number a block, then in blocks, so that every lane gets its steps
        let all_groups = (mutations / (SHORTEST_CHAIN * lanes_per_group as u64)) as usize;
        // an even number, of which halves are compared
        let blocks = (all_groups / groups_at_most).clamp(FEWEST_BLOCKS, BLOCKS) & !1;
        let groups = (all_groups / blocks).clamp(1, groups_at_most);
        let a_sweep = (blocks * groups * lanes_per_group) as u64;
        Plan { blocks, groups, lanes_per_group, sweeps: Some(mutations.div_ceil(a_sweep).max(1)) }
    }

    /// Ladders of `lanes_per_group` for each of the blocks, where `mutations` are left.
    pub fn groups_a_block(&self, mutations: Option<u64>, lanes_per_group: usize) -> usize {
        let at_most = (LANES_OF_LADDERS / lanes_per_group).max(1);
        mutations.map_or(at_most, |mutations| {
            let all = mutations / (SHORTEST_ON_LADDER * lanes_per_group as u64);
            (all as usize / self.blocks).clamp(1, at_most)
        })
    }

    /// Lanes of one block.
    pub fn lanes(&self) -> usize {
        self.groups * self.lanes_per_group
    }

    /// Evaluations of one sweep.
    pub fn a_sweep(&self) -> u64 {
        (self.blocks * self.lanes()) as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_budget_is_met_and_hardly_exceeded() {
        for mutations in [1u64, 100, 4096, 1 << 17, 1 << 20, 1 << 24, 1 << 40] {
            for lanes_per_group in [1, 2, 5, 33, 1024] {
                let plan = Plan::new(Some(mutations), lanes_per_group);
                let done = plan.sweeps.unwrap() * plan.a_sweep();
                assert!(done >= mutations && done < mutations + plan.a_sweep(), "{plan:?} for {mutations}");
                assert!((FEWEST_BLOCKS..=BLOCKS).contains(&plan.blocks));
            }
        }
    }

    #[test]
    fn short_jobs_have_few_long_chains_rather_than_many_short_ones() {
        let plan = Plan::new(Some(1 << 20), 1);
        assert!(plan.sweeps.unwrap() >= SHORTEST_CHAIN, "{plan:?}");
        assert_eq!(Plan::new(None, 2), Plan { blocks: 64, groups: 128, lanes_per_group: 2, sweeps: None });
    }
}
