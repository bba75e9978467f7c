//! Ends calls that use up their time, or that the user wants to stop.
//!
//! Luau asks an interrupt function at every loop and call, if one is set. Asking costs as much as a tight loop's
//! body, so none is set until a deadline has passed: a single thread looks at the deadlines of all virtual machines
//! every few milliseconds and sets the function of the one that is late. It stays set until the call ends, so
//! a script that catches the error meets it again at its next loop or call. The same thread asks whether to stop.
//!
//! A script's time is the processor time of its thread, so that a busy machine does not end one that computes little.

use std::cell::Cell;
use std::ffi::{c_int, c_void};
use std::ptr;
use std::sync::atomic::{AtomicBool, AtomicI32, AtomicPtr, AtomicU32, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::thread::{self, Thread};
use std::time::Duration;

use mlua::{Lua, ffi};
use pdk_sdk::error::{Error, Result};

use crate::failure;

/// How often deadlines are looked at.
const PERIOD: Duration = Duration::from_millis(5);
/// How many looks in a row have to find nothing before the thread goes to sleep.
const IDLE_LOOKS: u32 = 200;
/// The deadline of a machine that runs nothing.
const NEVER: u64 = u64::MAX;

type Interrupt = unsafe extern "C-unwind" fn(*mut ffi::lua_State, c_int);

thread_local! {
    /// The alarm of the innermost call that this thread is in.
    static CURRENT: Cell<*const Alarm> = const { Cell::new(ptr::null()) };
}

/// Says whether a script has to stop, and with which error. Called every few milliseconds while one runs.
pub type Stop = fn() -> Option<Error>;

/// The deadline of one virtual machine.
pub(crate) struct Alarm {
    /// The clock of the thread that the machine runs in: its processor time.
    clock: AtomicI32,
    /// Nanoseconds on that clock.
    deadline: AtomicU64,
    /// Nanoseconds that are left after [`without_clock`]; [`NEVER`] for what was left before.
    renewal: AtomicU64,
    /// Asked whether to stop.
    stop: OnceLock<Stop>,
    /// What it answered in the present call.
    stopped: Mutex<Option<Error>>,
    /// Whether it did, and the script has to be interrupted.
    is_stopped: AtomicBool,
    /// Whether a script was interrupted since the last call began.
    rang: AtomicBool,
    /// Where Luau looks for its interrupt function. Valid while the alarm is registered.
    slot: *mut c_void,
}

// SAFETY: `slot` is only ever used as an atomic pointer, see `Alarm::set`.
unsafe impl Send for Alarm {}
// SAFETY: as above.
unsafe impl Sync for Alarm {}

impl Alarm {
    fn set(&self, interrupt: Option<Interrupt>) {
        // SAFETY: the slot lives as long as the virtual machine, which outlives the registration of the alarm (see
        // `Registration`), and both callers hold one of the two.
        unsafe { store(self.slot, interrupt) }
    }

    fn is_late(&self) -> bool {
        self.is_stopped.load(Ordering::Acquire) || own_time() >= self.deadline.load(Ordering::Relaxed)
    }

    /// Asks whether to stop.
    fn ask(&self) {
        if let Some(error) = self.stop.get().and_then(|stop| stop()) {
            *self.stopped() = Some(error);
            self.is_stopped.store(true, Ordering::Release);
        }
    }

    fn stopped(&self) -> MutexGuard<'_, Option<Error>> {
        self.stopped.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Sets the function of a virtual machine. The watchdog and the machine's own thread may both do so at any time, so
/// every write to the slot goes through here.
///
/// # Safety
/// `slot` has to be that of a virtual machine that lives.
unsafe fn store(slot: *mut c_void, interrupt: Option<Interrupt>) {
    let function = interrupt.map_or(ptr::null_mut(), |f| f as *mut c_void);
    // SAFETY: `slot` is the address of an aligned, nullable function pointer, which Luau documents as "safe to set
    // from an arbitrary thread".
    unsafe { AtomicPtr::from_ptr(slot.cast::<*mut c_void>()) }.store(function, Ordering::Release);
}

/// Where the virtual machine of `state` looks for its interrupt function.
///
/// # Safety
/// `state` has to be of a virtual machine that lives.
unsafe fn slot_of(state: *mut ffi::lua_State) -> *mut c_void {
    // SAFETY: `lua_callbacks` returns a pointer into the global state, valid for the machine's lifetime; only the
    // address of a field is taken.
    unsafe { (&raw mut (*ffi::lua_callbacks(state)).interrupt).cast() }
}

/// Registers an alarm for as long as it lives. Has to be dropped before the virtual machine.
pub(crate) struct Registration {
    alarm: Arc<Alarm>,
    /// The process whose watchdog knows the alarm.
    process: AtomicU32,
}

impl Registration {
    /// Registers the alarm of a virtual machine, which has to outlive the registration.
    pub(crate) fn new(lua: &Lua) -> Result<Self> {
        let watchdog = watchdog()?;
        let mut slot: *mut c_void = ptr::null_mut();
        // SAFETY: `state` is of `lua`, which lives, and the stack is left as it is.
        unsafe { lua.exec_raw::<()>((), |state| slot = slot_of(state)) }
            .map_err(|error| Error::new(format!("the script's virtual machine cannot be set up: {error}")))?;
        let alarm = Arc::new(Alarm {
            clock: AtomicI32::new(libc::CLOCK_THREAD_CPUTIME_ID),
            deadline: AtomicU64::new(NEVER),
            renewal: AtomicU64::new(NEVER),
            stop: OnceLock::new(),
            stopped: Mutex::default(),
            is_stopped: AtomicBool::new(false),
            rang: AtomicBool::new(false),
            slot,
        });
        watchdog.alarms().push(Arc::clone(&alarm));
        Ok(Self { alarm, process: AtomicU32::new(watchdog.process) })
    }

    /// Tells the watchdog of this process of the alarm, where the virtual machine comes from before a fork.
    fn follow(&self) {
        if let Ok(watchdog) = watchdog()
            && self.process.swap(watchdog.process, Ordering::Relaxed) != watchdog.process
        {
            watchdog.alarms().push(Arc::clone(&self.alarm));
        }
    }

    /// Asks `stop` from now on, while a call runs. What was given first stays.
    pub(crate) fn stop_when(&self, stop: Stop) {
        self.alarm.stop.get_or_init(|| stop);
    }

    /// Starts the clock of a call; dropping the result stops it. A budget that is renewed begins anew after each
    /// [`without_clock`].
    pub(crate) fn start(&self, budget: Duration, renewed: bool) -> Running<'_> {
        self.follow();
        let outer = CURRENT.replace(Arc::as_ptr(&self.alarm));
        let before = self.alarm.deadline.load(Ordering::Relaxed);
        if before == NEVER {
            self.alarm.rang.store(false, Ordering::Relaxed);
            self.alarm.is_stopped.store(false, Ordering::Relaxed);
            self.alarm.clock.store(own_clock(), Ordering::SeqCst);
            let renewal = if renewed { nanoseconds(budget) } else { NEVER };
            self.alarm.renewal.store(renewal, Ordering::Relaxed);
        }
        arm(&self.alarm, own_time().saturating_add(nanoseconds(budget)).min(before));
        Running { alarm: &self.alarm, outer, before }
    }
}

impl Drop for Registration {
    fn drop(&mut self) {
        if let Ok(watchdog) = watchdog() {
            watchdog.alarms().retain(|alarm| !Arc::ptr_eq(alarm, &self.alarm));
        }
    }
}

/// A call with a running clock.
pub(crate) struct Running<'a> {
    alarm: &'a Alarm,
    outer: *const Alarm,
    /// The deadline of an outer call into the same machine.
    before: u64,
}

impl Running<'_> {
    /// Whether the script was interrupted.
    pub(crate) fn rang(&self) -> bool {
        self.alarm.rang.load(Ordering::Relaxed)
    }

    /// The error of who wanted the script to stop, where that interrupted it.
    pub(crate) fn stopped(&self) -> Option<Error> {
        self.alarm.is_stopped.load(Ordering::Acquire).then(|| self.alarm.stopped().take()).flatten()
    }
}

impl Drop for Running<'_> {
    fn drop(&mut self) {
        CURRENT.set(self.outer);
        self.alarm.deadline.store(self.before, Ordering::SeqCst);
        // The watchdog may set it once more right after this; the interrupt function then finds that nothing is
        // late and takes itself out.
        self.alarm.set(None);
    }
}

/// Whether the script that this thread is in has been interrupted: then it has to end, whatever called it.
pub fn is_interrupted() -> bool {
    // SAFETY: the alarm belongs to a call that this thread is still in, and the call keeps it alive.
    unsafe { CURRENT.get().as_ref() }.is_some_and(|alarm| alarm.rang.load(Ordering::Relaxed))
}

/// Runs `work`, the time of which does not count against the script that called it. Host functions that wait or
/// compute for long, such as one that drives a scenario, do so inside this. Afterwards a pipeline has its whole time again, and
/// any other script what it had left.
pub fn without_clock<R>(work: impl FnOnce() -> R) -> R {
    struct Resume {
        alarm: *const Alarm,
        left: u64,
    }
    impl Drop for Resume {
        fn drop(&mut self) {
            // SAFETY: the alarm belongs to a call that this thread is still in, and the call keeps it alive.
            if let Some(alarm) = unsafe { self.alarm.as_ref() } {
                arm(alarm, own_time().saturating_add(self.left));
            }
        }
    }
    let alarm = CURRENT.get();
    // SAFETY: as above.
    let _resume = unsafe { alarm.as_ref() }.map(|current| {
        let left = current.deadline.swap(NEVER, Ordering::SeqCst).saturating_sub(own_time());
        let left = match current.renewal.load(Ordering::Relaxed) {
            NEVER => left,
            renewal => renewal,
        };
        Resume { alarm, left }
    });
    work()
}

fn arm(alarm: &Alarm, deadline: u64) {
    alarm.deadline.store(deadline, Ordering::SeqCst);
    if let Ok(watchdog) = watchdog() {
        watchdog.wake();
    }
}

/// What Luau calls at every loop and call once the deadline has passed.
unsafe extern "C-unwind" fn interrupt(state: *mut ffi::lua_State, gc: c_int) {
    if gc >= 0 {
        return; // The collector must not be left by an error.
    }
    // SAFETY: a script runs, so this thread is in the call that owns the alarm.
    let late = unsafe { CURRENT.get().as_ref() }.filter(|alarm| alarm.is_late());
    // SAFETY: `state` is the running state that Luau passed; no value with a destructor is alive when `lua_error`
    // unwinds.
    unsafe {
        match late {
            Some(alarm) => {
                if !alarm.rang.swap(true, Ordering::Relaxed) {
                    failure::record_location(state);
                }
                ffi::lua_rawcheckstack(state, 1);
                ffi::lua_pushliteral(state, c"out of time");
                ffi::lua_error(state);
            }
            None => store(slot_of(state), None),
        }
    }
}

/// Does what Luau does at every loop and call: asks the interrupt function, if one is set.
///
/// # Safety
/// `state` is a running Lua state. Raises an error where the script has to end, so no value with a destructor is alive.
pub(crate) unsafe fn ask_interrupt(state: *mut ffi::lua_State) {
    // SAFETY: every access to the slot is atomic, see `store`. It holds nothing or an `Interrupt`.
    unsafe {
        let function = AtomicPtr::from_ptr(slot_of(state).cast::<*mut c_void>()).load(Ordering::Acquire);
        if !function.is_null() {
            let function: Interrupt = std::mem::transmute(function);
            function(state, -1);
        }
    }
}

struct Watchdog {
    alarms: Mutex<Vec<Arc<Alarm>>>,
    /// Set before anybody else sees the watchdog.
    thread: OnceLock<Thread>,
    /// Whether the thread waits to be woken.
    asleep: AtomicBool,
    /// The process that the thread is in.
    process: u32,
}

impl Watchdog {
    fn alarms(&self) -> MutexGuard<'_, Vec<Arc<Alarm>>> {
        self.alarms.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Interrupts what is late. Says whether anything runs.
    fn look(&self) -> bool {
        let mut running = false;
        for alarm in self.alarms().iter() {
            let deadline = alarm.deadline.load(Ordering::SeqCst);
            if deadline == NEVER {
                continue;
            }
            running = true;
            alarm.ask();
            // A clock that cannot be read is of a thread that has just ended, and its call with it.
            let is_over = time_on(alarm.clock.load(Ordering::SeqCst)).is_some_and(|now| deadline <= now);
            if is_over || alarm.is_stopped.load(Ordering::Relaxed) {
                alarm.set(Some(interrupt));
            }
        }
        running
    }

    /// What its thread does.
    fn watch(&self) {
        let mut idle = 0;
        loop {
            idle = if self.look() { 0 } else { idle + 1 };
            if idle < IDLE_LOOKS {
                thread::sleep(PERIOD);
                continue;
            }
            // Say so first and look again: a call that starts in between either sees the flag or is seen.
            self.asleep.store(true, Ordering::SeqCst);
            if !self.look() {
                thread::park();
            }
            self.asleep.store(false, Ordering::SeqCst);
            idle = 0;
        }
    }

    fn wake(&self) {
        if self.asleep.load(Ordering::SeqCst)
            && let Some(thread) = self.thread.get()
        {
            thread.unpark();
        }
    }
}

/// The watchdog of the process; it lives until the process ends.
static WATCHDOG: AtomicPtr<Watchdog> = AtomicPtr::new(ptr::null_mut());

/// The one watchdog of this process, started when it is first needed. A process that was forked off another one has none of its
/// threads, so it gets a watchdog of its own, and takes no lock of the other one's, which may be held for ever.
fn watchdog() -> Result<&'static Watchdog> {
    let process = std::process::id();
    let found = WATCHDOG.load(Ordering::Acquire);
    // SAFETY: what is stored there is never freed.
    if let Some(watchdog) = unsafe { found.as_ref() }
        && watchdog.process == process
    {
        return Ok(watchdog);
    }
    let made: &'static Watchdog = Box::leak(Box::new(Watchdog {
        alarms: Mutex::default(),
        thread: OnceLock::new(),
        asleep: AtomicBool::new(false),
        process,
    }));
    let spawned = thread::Builder::new().name("pdk-lua-watchdog".into()).spawn(|| made.watch());
    let handle = spawned.map_err(|error| {
        Error::new(format!("the thread that limits the time of scripts cannot be started: {error}"))
    })?;
    made.thread.get_or_init(|| handle.thread().clone());
    let made = ptr::from_ref(made).cast_mut();
    match WATCHDOG.compare_exchange(found, made, Ordering::AcqRel, Ordering::Acquire) {
        // SAFETY: as above.
        Ok(_) => Ok(unsafe { &*made }),
        // SAFETY: as above. Another thread was faster; the one that was started here sleeps.
        Err(first) => Ok(unsafe { &*first }),
    }
}

fn nanoseconds(duration: Duration) -> u64 {
    // A budget beyond the clock's range is none; one less keeps it apart from `NEVER`.
    u64::try_from(duration.as_nanos()).unwrap_or(NEVER - 1).min(NEVER - 1)
}

/// The clock of this thread's processor time, which other threads of the process can read as well.
fn own_clock() -> libc::clockid_t {
    let mut clock = libc::CLOCK_THREAD_CPUTIME_ID;
    // SAFETY: the thread is the present one, and `clock` can be written to. On failure it stays as it is, and the watchdog then measures its
    // own time, which is almost none: the script would not be ended by its time, but by the limit of the call that it runs in.
    unsafe { libc::pthread_getcpuclockid(libc::pthread_self(), &raw mut clock) };
    clock
}

/// The processor time of this thread in nanoseconds.
pub(crate) fn own_time() -> u64 {
    time_on(libc::CLOCK_THREAD_CPUTIME_ID).unwrap_or_default()
}

/// Nanoseconds on a clock; none if there is no such clock any more.
fn time_on(clock: libc::clockid_t) -> Option<u64> {
    let mut time = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: `time` can be written to; the system checks the clock.
    let read = unsafe { libc::clock_gettime(clock, &raw mut time) } == 0;
    let (seconds, rest) = (u64::try_from(time.tv_sec).ok()?, u64::try_from(time.tv_nsec).ok()?);
    read.then(|| seconds.saturating_mul(1_000_000_000).saturating_add(rest))
}
