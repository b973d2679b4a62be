//! The time of a run.

use std::time::{Duration, Instant};

/// Wall and processor time since a run began, without the pauses in which it is looked at.
pub struct Clock {
    begin: Instant,
    cpu_begin: Option<Duration>,
    /// Times of earlier processes.
    before: Duration,
    cpu_before: Option<Duration>,
    paused: Duration,
    cpu_paused: Duration,
}

impl Clock {
    /// Begins now.
    pub fn start() -> Clock {
        Clock {
            begin: Instant::now(),
            cpu_begin: cpu_time(),
            before: Duration::ZERO,
            cpu_before: Some(Duration::ZERO),
            paused: Duration::ZERO,
            cpu_paused: Duration::ZERO,
        }
    }

    /// Goes on from now where another process, after such wall and processor times, left off.
    pub fn going_on(elapsed: Duration, cpu: Option<Duration>) -> Clock {
        Clock { before: elapsed, cpu_before: cpu, ..Clock::start() }
    }

    /// Wall time.
    pub fn elapsed(&self) -> Duration {
        self.before + self.begin.elapsed().saturating_sub(self.paused)
    }

    /// Processor time of the whole process, all threads; `None` where the system does not tell.
    pub fn cpu(&self) -> Option<Duration> {
        Some(self.cpu_before? + cpu_time()?.saturating_sub(self.cpu_begin?).saturating_sub(self.cpu_paused))
    }

    /// Does something that counts as no time of the run.
    pub fn pause<T>(&mut self, something: impl FnOnce() -> T) -> T {
        let (begin, cpu_begin) = (Instant::now(), cpu_time());
        let done = something();
        self.paused += begin.elapsed();
        if let (Some(begin), Some(end)) = (cpu_begin, cpu_time()) {
            self.cpu_paused += end.saturating_sub(begin);
        }
        done
    }
}

/// User and system time of this process so far from Linux's `/proc/self/stat`, in steps of 10 ms; `None` elsewhere.
pub fn cpu_time() -> Option<Duration> {
    /// The kernel counts in this unit on every architecture that Linux and Embree share.
    const TICKS_PER_SECOND: f64 = 100.0;
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    // The second field is the program's name in parentheses and may itself hold spaces and parentheses; user and
    // system time are fields 14 and 15, that is, 12th and 13th behind it (proc_pid_stat(5)).
    let mut behind_name = stat[stat.rfind(')')? + 1..].split_whitespace().skip(11);
    let mut ticks = || behind_name.next()?.parse::<f64>().ok();
    Some(Duration::from_secs_f64((ticks()? + ticks()?) / TICKS_PER_SECOND))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pauses_do_not_count() {
        let mut clock = Clock::start();
        let before = clock.elapsed();
        let value = clock.pause(|| {
            let begin = Instant::now();
            while begin.elapsed() < Duration::from_millis(120) {} // works, so that processor time passes as well
            7
        });
        assert_eq!(value, 7);
        assert!(clock.elapsed() - before < Duration::from_millis(60), "{:?}", clock.elapsed());
        std::thread::sleep(Duration::from_millis(20));
        assert!(clock.elapsed() - before >= Duration::from_millis(20));
    }
}
