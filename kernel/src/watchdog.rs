//! Ends the process when a component does not come back: code in a library cannot be interrupted from outside, so the
//! choice is between waiting for ever and stopping with a sentence that says who hangs. What is recorded stays.

use std::cell::Cell;
use std::ptr;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError, Weak};
use std::time::{Duration, Instant};

use crate::exit_guard;

/// The exit code of a process that was ended because a component did not come back.
pub const EXIT_CODE: i32 = 75;

/// How long a component may take for one call, unless the user says otherwise.
pub const DEFAULT_PATIENCE: Duration = Duration::from_secs(60);

/// How long one call of a component may take, and what the user can do where that is too short.
#[derive(Debug, Clone, Copy)]
pub struct Patience {
    /// The longest time.
    pub limit: Duration,
    /// What the user can do.
    pub remedy: &'static str,
}

impl Patience {
    /// That of a run.
    pub fn of_run(limit: Duration) -> Self {
        Self { limit, remedy: "the limit of a run is raised with --set patience=SECONDS" }
    }
}

/// Watches the calls that one thread makes.
pub struct Watch {
    slot: Arc<Slot>,
}

struct Slot {
    /// What may be called, as it is named to the user.
    labels: Vec<String>,
    patience: Duration,
    /// What the user can do.
    remedy: &'static str,
    /// Which label is being called.
    current: AtomicUsize,
    /// When the call began in nanoseconds since the clock's start; 0 while nothing is called.
    since: AtomicU64,
}

impl Watch {
    /// A watch over calls of a run with these labels. None may take longer than `patience`.
    pub fn new(labels: Vec<String>, patience: Duration) -> Self {
        Self::with_patience(labels, Patience::of_run(patience))
    }

    /// A watch over calls with these labels.
    pub fn with_patience(labels: Vec<String>, patience: Patience) -> Self {
        Self::with_remedy(labels, patience.limit, patience.remedy)
    }

    /// A watch over calls with these labels, that says what can be done where one takes longer than `patience`.
    pub fn with_remedy(labels: Vec<String>, patience: Duration, remedy: &'static str) -> Self {
        let (current, since) = (AtomicUsize::new(0), AtomicU64::new(0));
        let slot = Arc::new(Slot { labels, patience, remedy, current, since });
        let mut slots = slots().lock().unwrap_or_else(PoisonError::into_inner);
        slots.retain(|slot| slot.strong_count() > 0);
        slots.push(Arc::downgrade(&slot));
        Self { slot }
    }

    /// Makes a call under watch.
    pub fn call<T>(&self, label: usize, work: impl FnOnce() -> T) -> T {
        let _call = Call::begin(&self.slot, label);
        work()
    }
}

thread_local! {
    /// What this thread is calling; null while it calls nothing.
    static CALLED: Cell<*const Slot> = const { Cell::new(ptr::null()) };
}

/// A call in progress; it ends also where it unwinds.
struct Call<'a> {
    slot: &'a Slot,
    /// The call within which this one was made; null where it is the outermost.
    outer: *const Slot,
}

impl<'a> Call<'a> {
    fn begin(slot: &'a Slot, label: usize) -> Self {
        slot.current.store(label, Ordering::Relaxed);
        slot.since.store(now().max(1), Ordering::Release);
        Self { slot, outer: CALLED.replace(slot) }
    }
}

impl Drop for Call<'_> {
    fn drop(&mut self) {
        CALLED.set(self.outer);
        self.slot.since.store(0, Ordering::Release);
    }
}

/// The label of what this thread is calling; where it calls nothing, the labels of what the others are calling.
pub fn calls_in_progress() -> Vec<String> {
    let called = CALLED.get();
    if !called.is_null() {
        // SAFETY: it is set for the length of a call only, and the slot outlives the call.
        return vec![unsafe { &*called }.label().to_owned()];
    }
    // A thread that ends the process may hold the lock; then nobody is named.
    let Ok(slots) = slots().try_lock() else { return Vec::new() };
    let busy = slots.iter().filter_map(Weak::upgrade).filter(|slot| slot.since.load(Ordering::Acquire) != 0);
    busy.map(|slot| slot.label().to_owned()).collect()
}

/// Nanoseconds since the first use of the clock.
fn now() -> u64 {
    static START: OnceLock<Instant> = OnceLock::new();
    START.get_or_init(Instant::now).elapsed().as_nanos() as u64
}

/// The watches of all threads; the first use starts the thread that looks at them.
fn slots() -> &'static Mutex<Vec<Weak<Slot>>> {
    static SLOTS: OnceLock<Mutex<Vec<Weak<Slot>>>> = OnceLock::new();
    SLOTS.get_or_init(|| {
        // Without the thread a hanging component hangs the run, which the user can still interrupt.
        let _ = std::thread::Builder::new().name("watchdog".into()).spawn(|| {
            loop {
                std::thread::sleep(Duration::from_millis(100));
                let slots = self::slots().lock().unwrap_or_else(PoisonError::into_inner);
                slots.iter().filter_map(Weak::upgrade).for_each(|slot| slot.check());
            }
        });
        Mutex::new(Vec::new())
    })
}

impl Slot {
    fn label(&self) -> &str {
        self.labels.get(self.current.load(Ordering::Relaxed)).map_or("a component", String::as_str)
    }

    fn check(&self) {
        if let Some(sentence) = self.overdue() {
            eprintln!("pdk: error: {sentence}");
            exit_guard::end_now(EXIT_CODE);
        }
    }

    /// What there is to say where the call takes too long.
    fn overdue(&self) -> Option<String> {
        let since = self.since.load(Ordering::Acquire);
        if since == 0 || Duration::from_nanos(now().saturating_sub(since)) < self.patience {
            return None;
        }
        Some(format!(
            "{} has not come back for {} s, so pdk ends here; what was recorded is kept ({})",
            self.label(),
            self.patience.as_secs_f64(),
            self.remedy
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_call_that_takes_too_long_is_named_with_the_remedy() {
        let patient = Watch::new(vec!["driver `foo`".to_owned()], Duration::MAX);
        patient.call(0, || assert_eq!(patient.slot.overdue(), None));
        // Not known to the thread that would end the process.
        let slot = Slot {
            labels: vec!["driver `foo`".to_owned()],
            patience: Duration::ZERO,
            remedy: "leave it out",
            current: AtomicUsize::new(0),
            since: AtomicU64::new(0),
        };
        assert_eq!(slot.overdue(), None);
        let _call = Call::begin(&slot, 0);
        let sentence = slot.overdue().unwrap();
        assert!(sentence.starts_with("driver `foo` has not come back for 0 s"), "{sentence}");
        assert!(sentence.ends_with("(leave it out)"), "{sentence}");
    }

    #[test]
    fn calls_are_known_while_they_last() {
        let watches = ["outer", "inner"].map(|label| Watch::new(vec![label.to_owned()], DEFAULT_PATIENCE));
        watches[0].call(0, || {
            watches[1].call(0, || assert_eq!(calls_in_progress(), ["inner"]));
            assert_eq!(calls_in_progress(), ["outer"]);
            let unwound =
                std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| watches[1].call(0, || panic!())));
            assert!(unwound.is_err());
            assert_eq!(calls_in_progress(), ["outer"]);
            let seen_by_others = std::thread::scope(|scope| scope.spawn(calls_in_progress).join());
            assert!(seen_by_others.is_ok_and(|calls| calls.contains(&"outer".to_owned())));
        });
        assert!(CALLED.get().is_null());
    }
}
