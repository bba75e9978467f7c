//! What to do when topics cannot be made. iceoryx2 says which step failed and not why, so the limits of this process are looked at.

use rustix::process::{Resource, getrlimit};

use crate::layout::SHARED_MEMORY;

/// Setting up a topic needs fewer files than this at the same time.
const FILES_OF_A_TOPIC: u64 = 12;

/// The remedy for the limit that was reached, as far as it shows.
pub(crate) fn remedy() -> String {
    let most = getrlimit(Resource::Nofile).current.unwrap_or(u64::MAX);
    // It takes a file to count them.
    let open = std::fs::read_dir("/proc/self/fd").map_or(most, |files| files.count() as u64);
    if open.saturating_add(FILES_OF_A_TOPIC) > most {
        return format!(
            "this process may have {most} files open, and has {open}; raise that limit, as with `ulimit -n 1024`"
        );
    }
    let memory = match getrlimit(Resource::As).current {
        Some(bytes) => format!(
            ", and that {} MiB of memory are enough for this process, its limit of `ulimit -v`",
            bytes >> 20
        ),
        None => String::new(),
    };
    format!("check that {SHARED_MEMORY} is writable and not full{memory}")
}
