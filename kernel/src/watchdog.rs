//! Ends the process when a component does not come back: code in a library cannot be interrupted from outside, so the
//! choice is between waiting for ever and stopping with a sentence that says who hangs. What is recorded stays.

use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError, Weak};
use std::time::{Duration, Instant};

/// The exit code of a process that was ended because a component did not come back.
pub const EXIT_CODE: i32 = 75;

/// How long a component may take for one call, unless the user says otherwise.
pub const DEFAULT_PATIENCE: Duration = Duration::from_secs(60);

/// Watches the calls that one thread makes.
pub struct Watch {
    slot: Arc<Slot>,
}

struct Slot {
    /// What may be called, as it is named to the user.
    labels: Vec<String>,
    patience: Duration,
    /// Which label is being called.
    current: AtomicUsize,
    /// When the call began in nanoseconds since the clock's start; 0 while nothing is called.
    since: AtomicU64,
}

impl Watch {
    /// A watch over calls with these labels. None may take longer than `patience`.
    pub fn new(labels: Vec<String>, patience: Duration) -> Self {
        let slot = Arc::new(Slot { labels, patience, current: AtomicUsize::new(0), since: AtomicU64::new(0) });
        let mut slots = slots().lock().unwrap_or_else(PoisonError::into_inner);
        slots.retain(|slot| slot.strong_count() > 0);
        slots.push(Arc::downgrade(&slot));
        Self { slot }
    }

    /// Makes a call under watch.
    pub fn call<T>(&self, label: usize, work: impl FnOnce() -> T) -> T {
        self.slot.current.store(label, Ordering::Relaxed);
        self.slot.since.store(now().max(1), Ordering::Release);
        let result = work();
        self.slot.since.store(0, Ordering::Release);
        result
    }
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
    fn check(&self) {
        let since = self.since.load(Ordering::Acquire);
        if since == 0 || Duration::from_nanos(now().saturating_sub(since)) < self.patience {
            return;
        }
        let label = self.labels.get(self.current.load(Ordering::Relaxed)).map_or("a component", String::as_str);
        eprintln!(
            "pdk: error: {label} has not come back for {} s, so the run ends here; what was recorded is kept \
             (raise the limit with --set patience=SECONDS)",
            self.patience.as_secs_f64()
        );
        std::process::exit(EXIT_CODE);
    }
}
