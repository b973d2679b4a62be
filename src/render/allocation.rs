//! What an engine that runs jobs has given this process of the machine.

use std::env::var;
use std::thread::available_parallelism;

/// Threads for a run that nothing else is said for, from 1: as many as this process may run at once, by its affinity and
/// its group's quota of processor time, or fewer where an engine has given it fewer and does not enforce that.
pub fn threads() -> usize {
    let may = available_parallelism().map_or(1, usize::from);
    given(&|name| var(name).ok()).map_or(may, |given| given.min(may))
}

/// Cores that an engine says it has given: `SLURM_CPUS_PER_TASK` is their number, where one was asked for, and `HQ_CPUS`
/// lists them (`0,2,3`). What is no such thing says nothing. A task of HyperQueue may itself run on nodes that are SLURM's:
/// what is smaller holds.
fn given(variable: &dyn Fn(&str) -> Option<String>) -> Option<usize> {
    let slurm = variable("SLURM_CPUS_PER_TASK").and_then(|text| text.trim().parse().ok());
    let hyperqueue = variable("HQ_CPUS").and_then(|text| {
        let cores: Vec<u32> = text.split(',').map(|core| core.trim().parse().ok()).collect::<Option<_>>()?;
        Some(cores.len())
    });
    [slurm, hyperqueue].into_iter().flatten().filter(|cores| *cores > 0).min()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn engines_say_how_many_cores_there_are() {
        for (slurm, hyperqueue, expected) in [
            (None, None, None),
            (Some("4"), None, Some(4)),
            (None, Some("3"), Some(1)),
            (None, Some("0,1,6"), Some(3)),
            (Some("16"), Some("0,1,6"), Some(3)),
            (Some("0"), Some(""), None),
            (Some("many"), Some("0-3"), None),
        ] {
            let variable = |name: &str| match name {
                "SLURM_CPUS_PER_TASK" => slurm.map(str::to_owned),
                "HQ_CPUS" => hyperqueue.map(str::to_owned),
                other => panic!("{other} is none of them"),
            };
            assert_eq!(given(&variable), expected, "{slurm:?}, {hyperqueue:?}");
        }
        assert!(threads() >= 1);
    }
}
