//! Ctrl-C, SIGTERM and SIGHUP: the first ends a run with the image of what is done, the second ends it at once. SIGUSR1
//! asks for a checkpoint. SIGXFSZ is nothing but a file that cannot grow.

use std::process;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use super::failure::Failure;

/// What shells expect of a program that Ctrl-C ended.
pub(super) const ENDED: i32 = 130;

/// The flag that the first signal raises.
pub(super) fn stop_flag() -> Result<Arc<AtomicBool>, Failure> {
    let stop = Arc::new(AtomicBool::new(false));
    let raised = stop.clone();
    ctrlc::set_handler(move || {
        if raised.swap(true, Relaxed) {
            process::exit(ENDED);
        }
    })
    .map_err(|error| Failure::running(format_args!("cannot listen to Ctrl-C: {error}")))?;
    Ok(stop)
}

/// The flag that SIGUSR1 raises, each time; nothing does on systems that have no such signal.
pub(super) fn checkpoint_flag() -> Result<Arc<AtomicBool>, Failure> {
    let flag = Arc::new(AtomicBool::new(false));
    #[cfg(unix)]
    signal_hook::flag::register(signal_hook::consts::SIGUSR1, flag.clone())
        .map_err(|error| Failure::running(format_args!("cannot listen to SIGUSR1: {error}")))?;
    Ok(flag)
}

/// Lets a file that reaches the limit of its size (`ulimit -f`) be an error of writing it, as a full disk is, instead of the
/// process's end, which SIGXFSZ is by default.
pub(super) fn survive_limits_of_files() {
    #[cfg(unix)]
    drop(signal_hook::flag::register(signal_hook::consts::SIGXFSZ, Arc::new(AtomicBool::new(false))));
}
