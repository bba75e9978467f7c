//! The names of runs on their topics.

use std::path::Path;

/// The name of a run on its topics: letters, digits, dashes and underscores, unique on this machine.
pub fn run_name(path: &Path) -> String {
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    let fits = |c: char| if c.is_ascii_alphanumeric() || c == '-' { c } else { '_' };
    let name: String = name.chars().map(fits).take(40).collect();
    format!("{name}-{}", std::process::id())
}
