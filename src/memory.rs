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

/// `MemAvailable` of Linux, which counts what caches would give back.
fn of_meminfo(text: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
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
