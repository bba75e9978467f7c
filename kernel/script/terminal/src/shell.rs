//! Commands about a record, as people paste them into a shell.

use std::fmt::Display;
use std::path::Path;

/// A word as a shell takes it.
pub fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "._-/=:,@+".contains(c);
    match !word.is_empty() && word.chars().all(plain) {
        true => word.to_owned(),
        false => format!("'{}'", word.replace('\'', r"'\''")),
    }
}

/// The command that replays a scenario, which is named by its number or its id.
pub fn replay(folder: &Path, scenario: impl Display) -> String {
    format!("pdk replay {} --scenario {scenario}", quoted(&folder.to_string_lossy()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_come_through_a_shell() {
        assert_eq!(quoted("runs/quickstart-1"), "runs/quickstart-1");
        assert_eq!(quoted("my run"), "'my run'");
        assert_eq!(quoted("it's"), r"'it'\''s'");
        assert_eq!(quoted(""), "''");
        assert_eq!(replay(Path::new("a b"), 3), "pdk replay 'a b' --scenario 3");
    }
}
