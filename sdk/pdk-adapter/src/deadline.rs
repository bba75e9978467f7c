//! No wait without an end.

use std::fmt;
use std::time::{Duration, Instant};

use pdk_sdk::prelude::{Error, ErrorKind};

/// The end of a wait.
#[derive(Debug, Clone, Copy)]
pub struct Deadline {
    began: Instant,
    limit: Duration,
    /// The parameter that sets the limit.
    parameter: &'static str,
}

impl Deadline {
    /// A wait that begins now; `parameter` is that of the adapter which sets the limit.
    pub fn new(limit: Duration, parameter: &'static str) -> Self {
        Self { began: Instant::now(), limit, parameter }
    }

    /// The time that is left; none if it is over.
    pub fn left(&self) -> Option<Duration> {
        self.limit.checked_sub(self.began.elapsed()).filter(|left| !left.is_zero())
    }

    /// How long the wait has lasted.
    pub fn elapsed(&self) -> Duration {
        self.began.elapsed()
    }

    /// The error where the time is over: `who` has not done `what`, as in "the simulator at 127.0.0.1:9091 has not sent telemetry".
    pub fn late(&self, who: impl fmt::Display, what: impl fmt::Display) -> Error {
        let Self { limit, parameter, .. } = self;
        Error::of(
            ErrorKind::Late,
            format!(
                "{who} has not {what} within {} s; if it is only slow, raise `{parameter}`",
                limit.as_secs_f64()
            ),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wait_ends_and_says_what_it_was_for() {
        let deadline = Deadline::new(Duration::from_millis(20), "answer_seconds");
        assert!(deadline.left().is_some_and(|left| left <= Duration::from_millis(20)));
        std::thread::sleep(Duration::from_millis(25));
        assert_eq!(deadline.left(), None);
        let error = deadline.late("the simulator", "sent a picture");
        assert_eq!(error.kind(), ErrorKind::Late);
        assert_eq!(
            error.message(),
            "the simulator has not sent a picture within 0.02 s; if it is only slow, raise `answer_seconds`"
        );
    }
}
