//! What the targets share. Each target takes any bytes for what one of pdk's parsers reads, and ends in an abort where that
//! panics, takes too much memory or breaks a promise. `tests/fuzz/run` runs them.

#![cfg(feature = "engine")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};

/// What an input may make Rust code ask for, in bytes. Memory that is asked for and not written to costs nothing, and the reader of
/// traces asks for up to 4 GiB for a text before it finds that there is none; `tests/fuzz/run` limits what is written to.
const MOST: usize = 6 << 30;

/// The memory of the process, which counts what is taken.
#[derive(Debug)]
pub struct Counted;

static TAKEN: AtomicUsize = AtomicUsize::new(0);

#[global_allocator]
static MEMORY: Counted = Counted;

// SAFETY: all work is the system's; what is added only counts.
unsafe impl GlobalAlloc for Counted {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size());
        // SAFETY: as for the caller.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count(layout.size());
        // SAFETY: as for the caller.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        TAKEN.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: as for the caller.
        unsafe { System.dealloc(memory, layout) }
    }
}

fn count(size: usize) {
    if TAKEN.fetch_add(size, Ordering::Relaxed).saturating_add(size) > MOST {
        // Nothing here may take memory, and the engine keeps the input of a process that aborts.
        std::process::abort();
    }
}

/// A folder in memory for targets that read files, each process its own.
///
/// # Panics
/// If there is none.
#[must_use]
pub fn folder(target: &str) -> PathBuf {
    // `tests/fuzz/run` names one, which it removes.
    let parent = std::env::var_os("PDK_FUZZ_FOLDER").map_or_else(|| PathBuf::from("/dev/shm"), PathBuf::from);
    let folder = parent.join(format!("pdk-fuzz-{target}-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder in /dev/shm");
    folder
}

/// The parts of an input, which a byte that is in no text divides.
pub fn parts(data: &[u8]) -> impl Iterator<Item = &[u8]> {
    data.split(|byte| *byte == 0xff)
}
