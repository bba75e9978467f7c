//! Measured latencies, from a file.

use std::path::Path;

use pdk_sdk::error::Place;
use pdk_sdk::file;
use pdk_sdk::prelude::*;

/// The most bytes of a file.
const LARGEST: u64 = 4 << 20;
/// The longest latency in milliseconds.
const LONGEST: f64 = 60_000.0;

/// Reads latencies in milliseconds, one a line, and gives them in seconds. Lines that are empty or begin with `#` are left out.
///
/// # Errors
/// If the file cannot be read, or a line is not a latency.
pub fn read(path: &Path) -> Result<Vec<f64>> {
    let text = file::read_text(path, LARGEST).place(path.display())?;
    let lines = text.lines().enumerate().map(|(number, line)| (number + 1, line.trim()));
    let latencies: Vec<f64> = lines
        .filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
        .map(|(number, line)| match line.parse::<f64>() {
            Ok(latency) if (0.0..=LONGEST).contains(&latency) => Ok(latency / 1000.0),
            _ => Err(Error::of(
                ErrorKind::Configuration,
                format!(
                    "line {number} of {} is `{line}`; write one latency in milliseconds a line, from 0 to {LONGEST}",
                    path.display()
                ),
            )),
        })
        .collect::<Result<_>>()?;
    match latencies.is_empty() {
        false => Ok(latencies),
        true => Err(Error::of(
            ErrorKind::Configuration,
            format!("{} has no latencies; write one in milliseconds a line", path.display()),
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(name: &str, text: impl AsRef<[u8]>) -> Result<Vec<f64>> {
        let path = std::env::temp_dir().join(format!("pdk-profile-{name}-{}", std::process::id()));
        std::fs::write(&path, text).unwrap();
        let read = read(&path);
        std::fs::remove_file(path).unwrap();
        read
    }

    #[test]
    fn a_profile_has_one_latency_a_line() {
        assert_eq!(of("good", "# at night\n50\n\n 12.5 \r\n0").unwrap(), [0.05, 0.0125, 0.0]);
        for (name, text, expected) in [
            ("word", "50\nfast", "line 2 of "),
            ("negative", "-1", "line 1 of "),
            ("nan", "NaN", "line 1 of "),
            ("empty", "# nothing", "has no latencies"),
        ] {
            let error = of(name, text).unwrap_err().to_string();
            assert!(error.contains(expected), "{error}");
        }
        let error = of("binary", b"50\n\xff").unwrap_err().to_string();
        assert!(error.contains("it is not text"), "{error}");
    }
}
