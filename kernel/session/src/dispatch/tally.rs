//! What everything took, and what went wrong beside it.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use pdk_loop::protocol::Driven;

use crate::submission::Performance;

/// What the handle sees of the thread's work.
#[derive(Default)]
pub struct Shared {
    /// Frames that were driven or evaluated.
    pub frames: AtomicU64,
    /// What all scenarios took.
    pub performance: Mutex<Performance>,
    /// Components that took their process along outside of any job's outcome, a sentence each, and how often.
    pub troubles: Mutex<BTreeMap<String, u64>>,
}

/// The sums of the session.
pub struct Tally {
    shared: Arc<Shared>,
    /// Since when at least one slot has been at work.
    busy_since: Option<Instant>,
}

impl Tally {
    /// Sums that the handle sees.
    pub fn new(shared: Arc<Shared>) -> Self {
        Self { shared, busy_since: None }
    }

    /// Counts frames that were driven or evaluated.
    pub fn count(&self, frames: u64) {
        self.shared.frames.fetch_add(frames, Ordering::Relaxed);
    }

    /// Adds what a scenario took.
    pub fn add(&self, driven: &Driven) {
        let mut performance = self.shared.performance.lock().unwrap_or_else(PoisonError::into_inner);
        performance.times.add(&driven.times);
        if driven.rate > 0.0 {
            performance.simulated_seconds += driven.outcome.frames as f64 / driven.rate;
        }
        for warning in &driven.warnings {
            *performance.warnings.entry(warning.clone()).or_default() += 1;
        }
    }

    /// Adds up the time in which there is work, while this many slots have some.
    pub fn measure(&mut self, busy: usize) {
        let mut performance = self.shared.performance.lock().unwrap_or_else(PoisonError::into_inner);
        performance.slots = performance.slots.max(busy);
        let now = Instant::now();
        if let Some(since) = self.busy_since {
            performance.wall_seconds += now.duration_since(since).as_secs_f64();
        }
        self.busy_since = (busy > 0).then_some(now);
    }

    /// Counts a component that took its process along outside of any outcome.
    pub fn note(&self, trouble: String) {
        *self.shared.troubles.lock().unwrap_or_else(PoisonError::into_inner).entry(trouble).or_default() += 1;
    }
}
