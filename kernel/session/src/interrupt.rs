//! What the user types at the terminal, or the system sends, to end a run: Ctrl-C and the signal TERM.

use std::sync::atomic::{AtomicBool, AtomicI32, AtomicU32, Ordering};

use pdk_sdk::error::{Error, ErrorKind, Place, Result};

static SIGNALS: AtomicU32 = AtomicU32::new(0);
static LAST: AtomicI32 = AtomicI32::new(0);
static WATCHED: AtomicBool = AtomicBool::new(false);

/// How far a run has been told to end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Wish {
    /// Not at all.
    None,
    /// Once what is in flight is done.
    Finish,
    /// At once.
    Drop,
}

/// From here on, the signals do not end this process but are noted.
///
/// # Errors
/// If the system does not allow it.
pub fn watch() -> Result<()> {
    if WATCHED.swap(true, Ordering::SeqCst) {
        return Ok(());
    }
    for signal in [libc::SIGINT, libc::SIGTERM] {
        // SAFETY: the function only writes to atomics and to standard error.
        let set = unsafe { signal_hook::low_level::register(signal, move || note(signal)) };
        set.place("cannot watch for Ctrl-C")?;
    }
    Ok(())
}

/// Wishes for an end at once, as the signal TERM does: the program that started the run is gone.
pub fn abandon() {
    SIGNALS.fetch_add(2, Ordering::SeqCst);
}

fn note(signal: i32) {
    LAST.store(signal, Ordering::SeqCst);
    let before = SIGNALS.fetch_add(if signal == libc::SIGTERM { 2 } else { 1 }, Ordering::SeqCst);
    if signal == libc::SIGINT && before == 0 {
        let said = b"pdk: finishing what is in flight; Ctrl-C again drops it\n";
        // SAFETY: writes constant bytes, which is allowed in a signal handler. If no one reads, nothing is lost.
        let _ = unsafe { libc::write(2, said.as_ptr().cast(), said.len()) };
    }
}

/// What has been wished so far: the first Ctrl-C lets what is in flight finish, the second does not, and neither does TERM.
pub fn wish() -> Wish {
    match SIGNALS.load(Ordering::SeqCst) {
        0 => Wish::None,
        1 => Wish::Finish,
        _ => Wish::Drop,
    }
}

/// The exit code that says which signal ended the run; none if none did.
pub fn exit_code() -> Option<u8> {
    match LAST.load(Ordering::SeqCst) {
        0 => None,
        signal => Some(128 + signal as u8),
    }
}

/// What an interrupted run says.
pub fn error() -> Error {
    Error::of(
        ErrorKind::Lost,
        "the run was interrupted; what was recorded is kept, and the same command with --out and the folder of the record goes on from \
         there",
    )
}
