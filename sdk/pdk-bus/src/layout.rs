//! The names of what belongs to a bus: `<base>/<run>/<slot>-<random>/` and `/dev/shm/pdk_<random>_*`.

use std::path::Path;

use crate::error::{Error, Result};

/// The run id that stands for the run that started last.
pub const LATEST: &str = "latest";
/// The longest run id: it has to fit into iceoryx2's paths of at most 255 bytes beside the rest.
pub(crate) const MAX_RUN_ID: usize = 64;

/// Where the shared memory of a process shows as files.
pub(crate) const SHARED_MEMORY: &str = "/dev/shm";
/// Held by the owner of the bus as long as it lives; tells who that is.
pub(crate) const LOCK_FILE: &str = "lock";
/// Held by a tap while it opens.
pub(crate) const TAPS_FILE: &str = "taps";
/// iceoryx2's configuration for this bus; it is there when the bus is complete.
pub(crate) const CONFIG_FILE: &str = "iceoryx2.toml";
/// The same before the bus is complete.
pub(crate) const UNFINISHED_CONFIG_FILE: &str = "iceoryx2.toml.new";
/// What the owner announces of its scenario.
pub(crate) const ANNOUNCEMENT_FILE: &str = "scenario";
/// The same while it is written.
pub(crate) const UNFINISHED_ANNOUNCEMENT_FILE: &str = "scenario.new";

/// # Errors
/// If `run` cannot be the name of a folder of a run.
pub(crate) fn check_run_id(run: &str) -> Result<()> {
    let allowed = |byte: u8| byte.is_ascii_alphanumeric() || b"-_.".contains(&byte);
    let fits = (1..=MAX_RUN_ID).contains(&run.len()) && run.bytes().all(allowed) && !run.starts_with('.');
    if !fits || run == LATEST {
        return Err(Error::new(format!(
            "`{run}` cannot be a run id: use 1 to {MAX_RUN_ID} ASCII letters, digits, `-`, `_` and `.`, no `.` \
             first, and not `{LATEST}`"
        )));
    }
    Ok(())
}

/// Hexadecimal digits of the random part: few, because it is in every path twice, and enough, because even of ten
/// thousand buses at the same time two would be alike only once in millions of times.
const RANDOM_DIGITS: usize = 12;

/// The name of a root within the folder of its run.
pub(crate) fn root_name(slot: u32, random: u64) -> String {
    format!("{slot}-{:0RANDOM_DIGITS$x}", random >> (64 - 4 * RANDOM_DIGITS))
}

/// Slot and random part of a root's name, if it is one.
pub(crate) fn parse_root(root: &Path) -> Option<(u32, &str)> {
    let (slot, random) = root.file_name()?.to_str()?.split_once('-')?;
    let is_random =
        random.len() == RANDOM_DIGITS && random.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f'));
    let slot = slot.parse().ok().filter(|_| is_random)?;
    Some((slot, random))
}

/// What the names of all files of the bus with this root begin with: no other bus of the machine has it.
pub(crate) fn prefix(root: &Path) -> Option<String> {
    parse_root(root).map(|(_, random)| format!("pdk_{random}_"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn run_ids_that_cannot_name_a_folder_are_refused() {
        for run in ["", LATEST, "a/b", "a b", "ü", ".", "..", ".hidden", &"x".repeat(MAX_RUN_ID + 1)] {
            let error = check_run_id(run).unwrap_err();
            assert!(error.message().contains("cannot be a run id"), "{error}");
        }
        check_run_id(&"x".repeat(MAX_RUN_ID)).unwrap();
        check_run_id("2026-11-20_a.1").unwrap();
    }

    #[test]
    fn roots_are_recognised_by_their_names() {
        let name = root_name(3, 0xbeef << 16);
        assert_eq!(parse_root(Path::new(&name)), Some((3, "00000000beef")));
        assert_eq!(prefix(&Path::new("/tmp/pdk/run").join(name)).unwrap(), "pdk_00000000beef_");
        for foreign in ["3", "3-", "3-beef", "x-00000000beef", "3-00000000BEEF", "-00000000beef"] {
            assert_eq!(parse_root(Path::new(foreign)), None, "{foreign}");
        }
        assert_eq!(prefix(Path::new("/")), None);
    }
}
