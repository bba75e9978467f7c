//! What a driver decides.

use serde::{Deserialize, Serialize};

use crate::error::{Error, ErrorKind, Result};

/// What a driver decides.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Control {
    /// -1 (full left) to 1 (full right).
    pub steering: f64,
    /// -1 (full brake) to 1 (full throttle).
    pub throttle: f64,
}

impl Control {
    /// The names of its numbers, in the order of [`Control::numbers`].
    pub const NUMBERS: [&str; 2] = ["steering", "throttle"];

    /// Its numbers, in the order of [`Control::NUMBERS`].
    pub fn numbers(&self) -> [f64; 2] {
        let Self { steering, throttle } = *self;
        [steering, throttle]
    }

    /// The control of these numbers, in the order of [`Control::NUMBERS`].
    pub fn from_numbers([steering, throttle]: [f64; 2]) -> Self {
        Self { steering, throttle }
    }

    /// The control with both numbers limited to their range.
    ///
    /// # Errors
    /// Where one of them is not finite.
    pub fn checked(self) -> Result<Self> {
        if !self.numbers().iter().all(|number| number.is_finite()) {
            return Err(Error::of(
                ErrorKind::Nonsense,
                format!(
                    "it steers {} with throttle {}, which is not a control; look at its output layer",
                    self.steering, self.throttle
                ),
            ));
        }
        Ok(Self::from_numbers(self.numbers().map(|number| number.clamp(-1.0, 1.0))))
    }
}
