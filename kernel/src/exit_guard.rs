//! Notices when something other than pdk ends the process.
//!
//! A component may call `exit`, most likely with 0 and without a word. The run would then look as if it had come to its
//! end. So the process is guarded while pdk works: an exit that is not pdk's own gets a sentence and a code of its own.

use std::sync::Once;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::watchdog;

/// The exit code of a process that a component ended.
pub const EXIT_CODE: i32 = 70;

static ARMED: AtomicBool = AtomicBool::new(false);

/// The process is guarded while this lives.
#[must_use]
pub struct ExitGuard(());

impl ExitGuard {
    /// Starts guarding.
    pub fn new() -> Self {
        static REGISTERED: Once = Once::new();
        REGISTERED.call_once(|| {
            // SAFETY: the function is there as long as the process. Where the system has no room for it, the process
            // is not guarded and works as before.
            unsafe { libc::atexit(at_exit) };
        });
        ARMED.store(true, Ordering::SeqCst);
        Self(())
    }
}

impl Default for ExitGuard {
    fn default() -> Self {
        Self::new()
    }
}

impl Drop for ExitGuard {
    fn drop(&mut self) {
        disarm();
    }
}

/// Stops guarding, for a process that another one watches: that one sees for itself how this one ends.
pub fn disarm() {
    ARMED.store(false, Ordering::SeqCst);
}

/// Ends the process at once, whatever other threads do: nothing that components registered for its end is run.
pub fn end_now(code: i32) -> ! {
    // SAFETY: it only ends the process.
    unsafe { libc::_exit(code) }
}

/// Runs on the thread that called `exit`.
extern "C" fn at_exit() {
    if !ARMED.load(Ordering::SeqCst) {
        return;
    }
    let culprit = match watchdog::calls_in_progress() {
        calls if calls.is_empty() => "a component".to_owned(),
        calls => calls.join(" or "),
    };
    eprintln!(
        "pdk: error: {culprit} ended the process, so pdk ends here; what was recorded is kept (a component has to \
         return an error instead of calling exit)"
    );
    end_now(EXIT_CODE);
}
