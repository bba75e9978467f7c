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
    /// If one of them is not finite.
    pub fn checked(self) -> Result<Self> {
        if !self.numbers().iter().all(|number| number.is_finite()) {
            return Err(Error::of(
                ErrorKind::Nonsense,
                format!(
                    "it steers {} with throttle {}, but both have to be finite numbers",
                    self.steering, self.throttle
                ),
            ));
        }
        Ok(Self::from_numbers(self.numbers().map(|number| number.clamp(-1.0, 1.0))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_those_that_are_named() {
        let control = Control { steering: -0.25, throttle: 0.5 };
        let written = serde_json::to_value(control).unwrap();
        for (name, number) in Control::NUMBERS.into_iter().zip(control.numbers()) {
            assert_eq!(written[name], number);
        }
        assert_eq!(written.as_object().unwrap().len(), Control::NUMBERS.len());
        assert_eq!(Control::from_numbers(control.numbers()), control);
    }

    #[test]
    fn what_is_wild_is_limited_and_what_is_not_finite_is_refused() {
        let wild = Control { steering: -1e9, throttle: 3.0 };
        assert_eq!(wild.checked(), Ok(Control { steering: -1.0, throttle: 1.0 }));
        let moderate = Control { steering: 0.3, throttle: -0.7 };
        assert_eq!(moderate.checked(), Ok(moderate));
        for numbers in [[f64::NAN, 0.0], [0.0, f64::INFINITY], [f64::NEG_INFINITY, 0.0]] {
            let error = Control::from_numbers(numbers).checked().unwrap_err();
            assert_eq!(error.kind(), ErrorKind::Nonsense);
        }
        assert_eq!(
            Control::from_numbers([f64::NAN, 0.5]).checked().unwrap_err().message(),
            "it steers NaN with throttle 0.5, but both have to be finite numbers"
        );
    }
}
