//! What this process is calling right now, told to the process that supervises it.
//!
//! Code in a library cannot be interrupted, and may end the process in any way. So pdk runs components in a
//! process that another one supervises, and notes each call on a page of memory that both see. When the process crashes,
//! exits or does not come back, the supervisor finds there which component was called, which function and for which frame.
//!
//! Noting a call costs some nanoseconds. Without a supervisor, as in unit tests, nothing is noted.

use std::cell::Cell;
use std::fs::File;
use std::os::fd::{AsRawFd, FromRawFd, OwnedFd, RawFd};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicU8, AtomicU32, AtomicU64, Ordering, fence};
use std::time::Duration;

use rustix::mm::{MapFlags, ProtFlags, mmap};

use crate::float;

/// Threads that can note calls at the same time; what more threads call is not noted.
const THREADS: usize = 48;
/// The longest name of a component that is noted, in bytes; a longer one is cut off.
const LONGEST: usize = 112;
/// Stands for no frame.
const NO_FRAME: u64 = u64::MAX;

/// The environment variable with the number of the open file that holds the page.
pub(crate) const PAGE_VARIABLE: &str = "PDK_CALLS";

/// Declares the functions, with the names that the traits give them.
macro_rules! functions {
    ($($(#[$doc:meta])* $function:ident: $name:literal;)*) => {
        /// A function of a component, as it is named to the user.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        #[repr(u32)]
        pub enum Function {
            $($(#[$doc])* $function,)*
        }

        impl Function {
            const ALL: &[Self] = &[$(Self::$function),*];

            /// As the traits call it.
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$function => $name,)*
                }
            }
        }
    };
}

functions! {
    /// Loading the library, and asking what is in it.
    Load: "load";
    /// Making an instance.
    New: "new";
    /// Size and rate of the camera.
    Camera: "camera";
    /// The start of a scenario.
    Reset: "reset";
    /// The next frame of a simulator.
    Frame: "frame";
    /// A control for a simulator.
    Act: "act";
    /// The road that a simulator built.
    Waypoints: "waypoints";
    /// A frame for a perturbation.
    Apply: "apply";
    /// A frame for a driver.
    Drive: "drive";
    /// A frame for a predictor.
    Predict: "predict";
    /// What a driver or a dataset says of itself.
    Info: "info";
    /// The files that a component reads.
    InputFiles: "input_files";
    /// The number of frames in a dataset.
    Len: "len";
    /// The name of a frame in a dataset.
    Name: "name";
    /// A frame of a dataset.
    Read: "read";
    /// Where in its recording a frame of a dataset lies.
    Position: "position";
    /// The size of a saliency map.
    MapSize: "map_size";
    /// A frame for a saliency method.
    Map: "map";
    /// A frame for a mask.
    Weights: "weights";
    /// What the pixels of a simulator's frame show.
    Labels: "labels";
    /// What a simulator will be asked for besides frames.
    Annotate: "annotate";
    /// How far away the pixels of a simulator's frame are.
    Depth: "depth";
    /// The beginning of a search.
    Start: "start";
    /// Candidates of a search.
    Ask: "ask";
    /// Results for a search.
    Tell: "tell";
    /// The end of an instance.
    Drop: "drop";
    /// Where a perturbation moves points.
    MovePoints: "move_points";
    /// What a driver gets besides the frame.
    Observe: "observe";
    /// What becomes of a control.
    Actuate: "actuate";
    /// How something changes with the picture that a perturbation shows.
    PictureGradient: "picture_gradient";
    /// How a recording is written again.
    Form: "form";
    /// A file of a recording that is written again.
    Rewrite: "rewrite";
    /// How a driver's steering changes with a frame.
    Gradient: "steering_gradient";
    /// What a simulator has to be put back with.
    Save: "save";
    /// A simulator that is put back to a frame.
    Restore: "restore";
}

/// Both processes see this.
#[repr(C)]
struct Page {
    /// Set once the process has done its work, so that its end is not taken for a component's doing.
    done: AtomicU32,
    threads: [Thread; THREADS],
}

/// What one thread is calling.
#[repr(C)]
struct Thread {
    /// Nanoseconds of the monotonic clock when the call began; 0 while nothing is called.
    since: AtomicU64,
    frame: AtomicU64,
    function: AtomicU32,
    length: AtomicU32,
    name: [AtomicU8; LONGEST],
}

static PAGE: OnceLock<Option<&'static Page>> = OnceLock::new();
/// The places on the page that threads of this process have.
static TAKEN: [AtomicBool; THREADS] = [const { AtomicBool::new(false) }; THREADS];

thread_local! {
    /// The place of this thread on the page.
    static PLACE: Option<Place> = PAGE.get().copied().flatten().and_then(Place::take);
    /// The call that this thread is in.
    static CURRENT: Cell<Option<Noted>> = const { Cell::new(None) };
}

/// The place of a thread, which another one may have when it ends.
struct Place {
    thread: &'static Thread,
    taken: &'static AtomicBool,
}

impl Place {
    /// A place that no thread has; none if there are too many threads.
    fn take(page: &'static Page) -> Option<Self> {
        let free = |taken: &AtomicBool| !taken.swap(true, Ordering::Acquire);
        let (taken, thread) = TAKEN.iter().zip(&page.threads).find(|(taken, _)| free(taken))?;
        Some(Self { thread, taken })
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        // A thread that ends in the middle of a call ends the process with it, and the call says who did that.
        if self.thread.since.load(Ordering::Acquire) == 0 {
            self.taken.store(false, Ordering::Release);
        }
    }
}

#[derive(Clone, Copy)]
struct Noted {
    name: *const str,
    function: Function,
    frame: u64,
}

/// Makes a call of a component's function; `name` is the name in messages, such as "driver `dave2`".
pub fn call<T>(name: &str, function: Function, work: impl FnOnce() -> T) -> T {
    call_at(name, function, NO_FRAME, work)
}

/// As [`call`], for one frame.
pub fn call_at<T>(name: &str, function: Function, frame: u64, work: impl FnOnce() -> T) -> T {
    let _call = InCall::begin(Noted { name, function, frame });
    work()
}

/// A call in progress; it ends also where it unwinds. Then the call within which it was made goes on.
struct InCall {
    outer: Option<Noted>,
}

impl InCall {
    fn begin(noted: Noted) -> Self {
        let outer = CURRENT.replace(Some(noted));
        note(Some(noted));
        Self { outer }
    }
}

impl Drop for InCall {
    fn drop(&mut self) {
        float::restore();
        CURRENT.set(self.outer);
        note(self.outer);
    }
}

fn note(noted: Option<Noted>) {
    // A thread that ends has no place any more.
    let Ok(Some(place)) = PLACE.try_with(|place| place.as_ref().map(|place| place.thread)) else { return };
    let Some(Noted { name, function, frame }) = noted else {
        place.since.store(0, Ordering::Release);
        return;
    };
    // SAFETY: a call that is noted borrows its name until it ends, and an outer call outlives the inner one.
    let name = unsafe { &*name }.as_bytes();
    let length = name.len().min(LONGEST);
    place.since.store(0, Ordering::Relaxed);
    // A process that sees anything of what follows also sees that the call before is over.
    fence(Ordering::Release);
    for (to, from) in place.name.iter().zip(&name[..length]) {
        to.store(*from, Ordering::Relaxed);
    }
    place.length.store(length as u32, Ordering::Relaxed);
    place.function.store(function as u32, Ordering::Relaxed);
    place.frame.store(frame, Ordering::Relaxed);
    place.since.store(now(), Ordering::Release);
}

/// Nanoseconds of the monotonic clock, which is the same in all processes; never 0.
fn now() -> u64 {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::Monotonic);
    (now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64).max(1)
}

/// Finds the page that the supervisor of this process has opened for it, if there is one. Has to come first in `main`.
pub fn begin() {
    PAGE.get_or_init(|| {
        let file: RawFd = std::env::var(PAGE_VARIABLE).ok()?.parse().ok().filter(|file| *file > 2)?;
        // SAFETY: `main` calls this before there is another thread.
        unsafe { std::env::remove_var(PAGE_VARIABLE) };
        // SAFETY: the supervisor opened this file for this process, and nothing else here knows its number.
        let file = unsafe { OwnedFd::from_raw_fd(file) };
        map(&file).ok()
    });
}

/// Whether another process supervises this one.
pub fn supervised() -> bool {
    PAGE.get().copied().flatten().is_some()
}

/// Says that the process has done its work: what comes now is a regular end.
pub fn done() {
    if let Some(page) = PAGE.get().copied().flatten() {
        page.done.store(1, Ordering::Release);
    }
}

fn map(file: &OwnedFd) -> std::io::Result<&'static Page> {
    // SAFETY: a new mapping of a whole file that is as large as the page; all of it is atomics, for which any bytes will do.
    let memory = unsafe {
        mmap(
            std::ptr::null_mut(),
            size_of::<Page>(),
            ProtFlags::READ | ProtFlags::WRITE,
            MapFlags::SHARED,
            file,
            0,
        )
    }?;
    // SAFETY: it stays mapped as long as the process lives or, at the supervisor, until `Observed` is dropped.
    Ok(unsafe { &*memory.cast::<Page>() })
}

/// A call that another process was or is in.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Seen {
    /// The component's name in messages.
    pub name: String,
    /// The function.
    pub function: Function,
    /// The frame, if it is called for one.
    pub frame: Option<u64>,
    /// For how long.
    pub lasting: Duration,
}

impl std::fmt::Display for Seen {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} in `{}`", self.name, self.function.name())?;
        self.frame.map_or(Ok(()), |frame| write!(f, " at frame {frame}"))
    }
}

/// The supervisor's view of a page.
pub struct Observed {
    page: &'static Page,
    file: File,
}

impl Observed {
    /// Makes a page.
    ///
    /// # Errors
    /// If the system has no memory for it.
    pub fn new() -> std::io::Result<Self> {
        // Without close-on-exec: the process that is supervised gets it.
        let file = rustix::fs::memfd_create("pdk-calls", rustix::fs::MemfdFlags::empty())?;
        rustix::fs::ftruncate(&file, size_of::<Page>() as u64)?;
        let page = map(&file)?;
        Ok(Self { page, file: file.into() })
    }

    /// The number under which the process inherits the page.
    pub(crate) fn number(&self) -> RawFd {
        self.file.as_raw_fd()
    }

    /// Forgets what a process noted, for the next one.
    pub fn clear(&self) {
        self.page.done.store(0, Ordering::Release);
        self.page.threads.iter().for_each(|thread| thread.since.store(0, Ordering::Release));
    }

    /// Whether the process has done its work.
    pub fn is_done(&self) -> bool {
        self.page.done.load(Ordering::Acquire) != 0
    }

    /// The calls in progress, the longest first.
    pub fn calls(&self) -> Vec<Seen> {
        let mut calls: Vec<Seen> = self.page.threads.iter().filter_map(Thread::seen).collect();
        calls.sort_by_key(|call| std::cmp::Reverse(call.lasting));
        calls
    }
}

impl Drop for Observed {
    fn drop(&mut self) {
        // SAFETY: the page was mapped by `new`, nothing else refers to it, and it is not used after this.
        let _ =
            unsafe { rustix::mm::munmap(std::ptr::from_ref(self.page).cast_mut().cast(), size_of::<Page>()) };
    }
}

impl Thread {
    fn seen(&self) -> Option<Seen> {
        let since = self.since.load(Ordering::Acquire);
        if since == 0 {
            return None;
        }
        let length = (self.length.load(Ordering::Relaxed) as usize).min(LONGEST);
        let name: Vec<u8> = self.name[..length].iter().map(|byte| byte.load(Ordering::Relaxed)).collect();
        let function = self.function.load(Ordering::Relaxed);
        let frame = self.frame.load(Ordering::Relaxed);
        // The process may have gone on while this was read; the call is over then.
        fence(Ordering::Acquire);
        if self.since.load(Ordering::Relaxed) != since {
            return None;
        }
        Some(Seen {
            name: String::from_utf8_lossy(&name).into_owned(),
            function: *Function::ALL.iter().find(|known| **known as u32 == function)?,
            frame: (frame != NO_FRAME).then_some(frame),
            lasting: Duration::from_nanos(now().saturating_sub(since)),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn calls_are_seen_while_they_last() {
        let observed = Observed::new().unwrap();
        PAGE.set(Some(observed.page)).ok().unwrap();
        let names = || observed.calls().iter().map(ToString::to_string).collect::<Vec<_>>();
        assert!(names().is_empty());
        call("simulator `lane`", Function::Reset, || {
            call_at("driver `dave2`", Function::Drive, 17, || {
                assert_eq!(names(), ["driver `dave2` in `drive` at frame 17"]);
            });
            assert_eq!(names(), ["simulator `lane` in `reset`"]);
            let unwound = std::panic::catch_unwind(|| call("x", Function::New, || panic!()));
            assert!(unwound.is_err());
            assert_eq!(names(), ["simulator `lane` in `reset`"]);
            std::thread::scope(|scope| {
                scope.spawn(|| call(&"ä".repeat(80), Function::Load, || assert_eq!(names().len(), 2)));
            });
        });
        assert!(names().is_empty());
        for _ in 0..2 * THREADS {
            // A join, unlike the end of a scope, waits until the thread has given its place back.
            std::thread::scope(|scope| {
                let thread = scope.spawn(|| call("x", Function::New, || names().len()));
                assert_eq!(thread.join().unwrap(), 1, "threads that have ended leave their places to others");
            });
        }
        assert!(!observed.is_done());
        done();
        assert!(observed.is_done());
        observed.clear();
        assert!(!observed.is_done());
        // The page lives as long as the test's process, which may still note calls.
        std::mem::forget(observed);
    }
}
