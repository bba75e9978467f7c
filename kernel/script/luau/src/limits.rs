//! How much memory and time a script may use.

use std::time::Duration;

use pdk_sdk::error::{Error, Result};

/// The environment variable that sets the time limit, in seconds.
pub const TIME_VARIABLE: &str = "PDK_SCRIPT_SECONDS";
/// The environment variable that sets the memory limit, in MiB.
pub const MEMORY_VARIABLE: &str = "PDK_SCRIPT_MEGABYTES";

/// What a script may use.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// Memory of the whole virtual machine, images included; see [`Limits::for_frame`].
    pub memory_bytes: usize,
    /// Time of one call.
    pub time: Duration,
    /// Whether the time begins anew after each host function that waits or works ([`without_clock`](crate::without_clock)), so
    /// that a script may run for as long as it likes and is ended only if it is stuck.
    pub renewed: bool,
}

impl Default for Limits {
    /// 256 MiB and one second.
    fn default() -> Self {
        Self { memory_bytes: 256 << 20, time: Duration::from_secs(1), renewed: false }
    }
}

/// How long a pipeline may compute without calling a host function that waits or works.
const PIPELINE_TIME: Duration = Duration::from_secs(60);
/// Images as large as the frame that a perturbation may have besides [`Limits::memory_bytes`].
const IMAGES: usize = 4;
/// Frames with more pixels than this get more time.
const USUAL_PIXELS: usize = 1 << 20;

impl Limits {
    /// The limits of a perturbation for a frame of this size: four images as large as the frame, and those of its history, do not count
    /// against the memory, and a frame with more than a megapixel has as many times the time.
    pub fn for_frame(self, width: usize, height: usize, history: usize) -> Self {
        let pixels = width.saturating_mul(height);
        let factor = (pixels as f64 / USUAL_PIXELS as f64).max(1.0);
        let seconds = self.time.as_secs_f64() * factor;
        Self {
            memory_bytes: self.memory_bytes.saturating_add(pixels.saturating_mul(3 * (IMAGES + history))),
            time: if factor > 1.0 {
                Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX)
            } else {
                self.time
            },
            ..self
        }
    }

    /// Those of a perturbation: 256 MiB and one second a frame, or what the environment variables [`TIME_VARIABLE`] and
    /// [`MEMORY_VARIABLE`] say.
    ///
    /// # Errors
    /// If a variable is set to something other than a positive number.
    pub fn of_perturbation() -> Result<Self> {
        Self::default().or_environment()
    }

    /// Those of a pipeline: 256 MiB, and 60 seconds of its own computing between two host functions that wait or work, or what
    /// the environment variables [`TIME_VARIABLE`] and [`MEMORY_VARIABLE`] say.
    ///
    /// # Errors
    /// If a variable is set to something other than a positive number.
    pub fn of_pipeline() -> Result<Self> {
        Self { time: PIPELINE_TIME, renewed: true, ..Self::default() }.or_environment()
    }

    fn or_environment(mut self) -> Result<Self> {
        if let Some(seconds) = positive_variable(TIME_VARIABLE)? {
            self.time = Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX);
        }
        if let Some(megabytes) = positive_variable(MEMORY_VARIABLE)? {
            self.memory_bytes = (megabytes * f64::from(1 << 20)) as usize;
        }
        Ok(self)
    }
}

fn positive_variable(name: &str) -> Result<Option<f64>> {
    let Some(text) = std::env::var_os(name) else { return Ok(None) };
    match text.to_str().and_then(|text| text.trim().parse::<f64>().ok()) {
        Some(number) if number > 0.0 => Ok(Some(number)),
        _ => Err(Error::new(format!(
            "the environment variable {name} is {text:?}, but has to be a positive number"
        ))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_come_from_the_environment_when_they_make_sense() {
        assert_eq!(Limits::default().time, Duration::from_secs(1));
        assert_eq!(positive_variable("PDK_TEST_NOT_SET").unwrap(), None);
        if std::env::var_os(TIME_VARIABLE).is_none() {
            let pipeline = Limits::of_pipeline().unwrap();
            assert_eq!((pipeline.time, pipeline.renewed), (Duration::from_secs(60), true));
            assert!(!Limits::of_perturbation().unwrap().renewed);
        }
    }
}
