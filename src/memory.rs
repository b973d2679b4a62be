//! Memory that is to be had, told before any of it is asked for.

use std::fmt::Display;
use std::fs;

/// Bytes that this process may still ask for: what the system says is available, or what is left of the limit that a
/// container has. `None` where it is not told.
pub fn available() -> Option<u64> {
    let system = fs::read_to_string("/proc/meminfo").ok().and_then(|text| of_meminfo(&text));
    let number = |file: &str| fs::read_to_string(format!("/sys/fs/cgroup/{file}")).ok()?.trim().parse::<u64>().ok();
    // of what a group uses, the cache of files can be had back
    let container = number("memory.max").zip(number("memory.current")).map(|(most, now)| {
        let stat = fs::read_to_string("/sys/fs/cgroup/memory.stat").unwrap_or_default();
        let cache = stat.lines().find_map(|line| line.strip_prefix("file ")?.parse::<u64>().ok()).unwrap_or(0);
        (most + cache).saturating_sub(now)
    });
    match (system, container) {
        (Some(a), Some(b)) => Some(a.min(b)),
        (a, b) => a.or(b),
    }
}

/// Address space that this process may still ask for under the limit that it has (`ulimit -v`). `None` where it has none, or
/// where it is not told.
pub fn space_left() -> Option<u64> {
    let of = |file: &str| fs::read_to_string(format!("/proc/self/{file}")).ok();
    of_limits(&of("limits")?, &of("status")?)
}

/// What the limit of Linux leaves.
fn of_limits(limits: &str, status: &str) -> Option<u64> {
    let limit = limits.lines().find_map(|line| line.strip_prefix("Max address space"))?;
    let limit: u64 = limit.split_whitespace().next()?.parse().ok()?; // not a number: `unlimited`
    Some(limit.saturating_sub(kibibytes(status, "VmSize:")?))
}

/// `MemAvailable` of Linux, which counts what caches would give back.
fn of_meminfo(text: &str) -> Option<u64> {
    kibibytes(text, "MemAvailable:")
}

/// Bytes of a line such as `VmSize:   5 kB`.
fn kibibytes(text: &str, key: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(key))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    kibibytes.checked_mul(1024)
}

/// Nothing if so many bytes are to be had, or an unknown number is; `what` is what would take them.
pub fn check(bytes: u64, what: impl Display) -> Result<(), String> {
    match available() {
        Some(most) if bytes > most => {
            Err(format!("{what} take {}, and {} are to be had", gigabytes(bytes), gigabytes(most)))
        }
        _ => Ok(()),
    }
}

/// `1.5 GB`.
pub fn gigabytes(bytes: u64) -> String {
    format!("{:.1} GB", bytes as f64 / 1e9)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_system_says_is_read() {
        let text = "MemTotal:       24000000 kB\nMemFree: 1 kB\nMemAvailable:   22000000 kB\n";
        assert_eq!(of_meminfo(text), Some(22_000_000 * 1024));
        assert_eq!(of_meminfo("MemTotal: 5 kB\n"), None);
        assert_eq!(of_meminfo("MemAvailable: lots kB\n"), None);
        let limits = "Max cpu time unlimited unlimited seconds\nMax address space     5000000     unlimited    bytes\n";
        assert_eq!(of_limits(limits, "VmPeak: 9 kB\nVmSize:     1000 kB\n"), Some(5_000_000 - 1_024_000));
        assert_eq!(of_limits(limits, "VmSize: 9000 kB\n"), Some(0));
        assert_eq!(of_limits("Max address space  unlimited  unlimited  bytes\n", "VmSize: 1 kB\n"), None);
    }

    #[test]
    fn more_than_a_machine_has_is_refused_in_numbers() {
        assert_eq!(check(0, "nothing"), Ok(()));
        if let Some(most) = available() {
            let fault = check(u64::MAX, "all pixels").unwrap_err();
            assert!(fault.starts_with("all pixels take 18446744073.7 GB, and "), "{fault}");
            assert!(check(most.saturating_mul(2).max(1 << 40), "twice of it").is_err());
        }
    }
}
