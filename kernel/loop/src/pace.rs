//! The pace of a drive in real time: when frames are due, and how many went by.

use std::time::{Duration, Instant};

use crate::protocol::Skip;

/// The clock of a drive.
pub struct Pace<'a> {
    /// When frame 0 was due.
    began: Instant,
    /// How long a frame lasts.
    period: Duration,
    /// Which frames are skipped, if that is not for the clock to say.
    skips: Option<&'a [Skip]>,
}

impl<'a> Pace<'a> {
    /// The pace of a drive that begins now.
    pub fn start(rate: f64, skips: Option<&'a [Skip]>) -> Self {
        Self { began: Instant::now(), period: Duration::from_secs_f64(1.0 / rate), skips }
    }

    /// Whether it goes by the clock.
    pub fn is_by_clock(&self) -> bool {
        self.skips.is_none()
    }

    /// When a frame is due.
    pub fn due(&self, sequence: u64) -> Instant {
        self.began + self.period.mul_f64(sequence as f64)
    }

    /// How many frames are skipped behind this one: those that went by since it was due, besides the next.
    pub fn skipped(&self, sequence: u64) -> u64 {
        if let Some(skips) = self.skips {
            return skips.iter().find(|skip| skip.behind == sequence).map_or(0, |skip| skip.count);
        }
        let late = Instant::now().saturating_duration_since(self.due(sequence));
        (late.as_secs_f64() / self.period.as_secs_f64()) as u64
    }
}
