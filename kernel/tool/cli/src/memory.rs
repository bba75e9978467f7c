//! Memory that the system does not give. What allocates cannot go on without it, so the standard library aborts; here that is a sentence
//! and an exit code. What asks for memory and can do without it still gets to know that there is none.

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicBool, Ordering};

use pdk_sdk::error::{Place, Result};

struct Watched;

#[global_allocator]
static ALLOCATOR: Watched = Watched;

/// Whether memory was asked for without success.
static REFUSED: AtomicBool = AtomicBool::new(false);
/// Whether this process is another one's to end, which says how it ended.
static SUPERVISED: AtomicBool = AtomicBool::new(false);

fn noted(memory: *mut u8) -> *mut u8 {
    if memory.is_null() {
        REFUSED.store(true, Ordering::SeqCst);
    }
    memory
}

// SAFETY: everything is done by the system's allocator.
unsafe impl GlobalAlloc for Watched {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: what the caller promises is passed on.
        noted(unsafe { System.alloc(layout) })
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as above.
        noted(unsafe { System.alloc_zeroed(layout) })
    }

    unsafe fn realloc(&self, memory: *mut u8, layout: Layout, bytes: usize) -> *mut u8 {
        // SAFETY: as above.
        noted(unsafe { System.realloc(memory, layout, bytes) })
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { System.dealloc(memory, layout) }
    }
}

/// From here on, an abort for lack of memory is reported. In a process that another one supervises it stays an abort, which that one reports.
///
/// # Errors
/// If the system does not allow it.
pub fn watch(supervised: bool) -> Result<()> {
    SUPERVISED.store(supervised, Ordering::SeqCst);
    // SAFETY: the action is zeroed, which is a valid one, and then gets a handler that only does what handlers may do.
    let set = unsafe {
        let mut action: libc::sigaction = std::mem::zeroed();
        action.sa_sigaction = aborted as *const () as libc::sighandler_t;
        libc::sigaction(libc::SIGABRT, &raw const action, std::ptr::null_mut())
    };
    match set {
        0 => Ok(()),
        _ => Err(std::io::Error::last_os_error()).place("cannot watch for a lack of memory"),
    }
}

/// Says why the process ends. An abort for another reason than a lack of memory continues when this returns.
extern "C" fn aborted(_: libc::c_int) {
    if !REFUSED.load(Ordering::SeqCst) {
        return;
    }
    let supervised = SUPERVISED.load(Ordering::SeqCst);
    let said: &[u8] = match supervised {
        true => b"pdk: the system gives this process no more memory; raise its limit (`ulimit -v`), or use fewer workers\n",
        false => b"pdk: error: the system gives this process no more memory; raise its limit (`ulimit -v`), or use fewer workers\n",
    };
    // SAFETY: writes constant bytes, which is allowed in a signal handler.
    let _ = unsafe { libc::write(2, said.as_ptr().cast(), said.len()) };
    if !supervised {
        // SAFETY: ends the process at once, which is allowed in a signal handler.
        unsafe { libc::_exit(1) };
    }
}
