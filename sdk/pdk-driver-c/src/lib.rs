//! Drives for pdk from C and C++: what `include/pdk_driver.h` declares.
//!
//! It is the other side of the driver `process`: frames come on the topic `pdk/perturbed` of a bus that its plugin has made, and answers go to
//! `pdk/answer`.

use std::cell::RefCell;
use std::ffi::{CStr, CString, OsStr, c_char, c_int};
use std::fs::File;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};
use std::time::Duration;

use iceoryx2::config::Config;
use iceoryx2::node::{Node, NodeBuilder};
use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::{
    FilePath, LogLevel, SemanticString, ServiceName, SignalHandlingMode, ZeroCopySend,
    set_log_level_from_env_or,
};
use iceoryx2::sample::Sample;
use iceoryx2::service::ipc_threadsafe::Service;
use pdk_bus::FrameHeader;

/// How long to wait for a frame before looking whether pdk is still there.
const LOOK: Duration = Duration::from_millis(100);

/// The numbers of a control.
#[repr(C)]
#[derive(Debug, Clone, Copy, ZeroCopySend)]
#[type_name("PdkControl")]
struct Answer {
    steering: f64,
    throttle: f64,
}

/// The numbers of a state, of which the speed counts here, and its flags.
#[repr(C)]
#[derive(Debug, Clone, Copy, ZeroCopySend)]
#[type_name("PdkState")]
struct State {
    numbers: [f64; 9],
    flags: u32,
    reserved: u32,
}

/// The place of the speed among the numbers of a state.
const SPEED: usize = 5;

/// The exchange with pdk.
#[allow(non_camel_case_types)]
pub struct pdk_driver {
    folder: PathBuf,
    frames: Subscriber<Service, [u8], FrameHeader>,
    states: Subscriber<Service, State, FrameHeader>,
    answers: Publisher<Service, Answer, FrameHeader>,
    sent: Listener<Service>,
    answered: Notifier<Service>,
    /// The frame that is looked at.
    held: Option<Sample<Service, [u8], FrameHeader>>,
    /// Which frame was answered last, and how.
    last: Option<((u64, u64), Answer)>,
    _node: Node<Service>,
}

/// A frame, and what is known besides.
#[allow(non_camel_case_types)]
#[repr(C)]
pub struct pdk_frame {
    /// The first pixel.
    pub pixels: *const u8,
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Number of the scenario in this process, from 1.
    pub scenario: u64,
    /// Number of the frame within its scenario, from 0.
    pub frame_index: u64,
    /// Simulation time in seconds since the start of the scenario.
    pub time: f64,
    /// The vehicle's speed in metres a second.
    pub speed: f64,
}

thread_local! {
    static ERROR: RefCell<CString> = RefCell::default();
}

type Result<T> = std::result::Result<T, String>;

impl pdk_driver {
    fn open(folder: &Path) -> Result<Self> {
        let failed = |error: &dyn std::fmt::Display| {
            format!("the exchange in {} cannot be opened: {error}", folder.display())
        };
        // What fails is returned.
        set_log_level_from_env_or(LogLevel::Fatal);
        let file = folder.join("iceoryx2.toml");
        let path = FilePath::new(file.as_os_str().as_bytes()).map_err(|error| failed(&error))?;
        let config = Config::from_file(&path).map_err(|error| failed(&error))?;
        let node = NodeBuilder::new()
            .config(&config)
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<Service>()
            .map_err(|error| failed(&error))?;
        let named = |name: &str| ServiceName::new(name).map_err(|error| failed(&error));
        macro_rules! topic {
            ($name:literal, $payload:ty) => {
                node.service_builder(&named($name)?)
                    .publish_subscribe::<$payload>()
                    .user_header::<FrameHeader>()
                    .open()
                    .map_err(|error| failed(&error))?
            };
        }
        let event =
            |name: &str| node.service_builder(&named(name)?).event().open().map_err(|error| failed(&error));
        let frames =
            topic!("pdk/perturbed", [u8]).subscriber_builder().create().map_err(|error| failed(&error))?;
        let states =
            topic!("pdk/state", State).subscriber_builder().create().map_err(|error| failed(&error))?;
        let answers =
            topic!("pdk/answer", Answer).publisher_builder().create().map_err(|error| failed(&error))?;
        let sent = event("pdk/frame-event")?.listener_builder().create().map_err(|error| failed(&error))?;
        let answered =
            event("pdk/answer-event")?.notifier_builder().create().map_err(|error| failed(&error))?;
        Ok(Self {
            folder: folder.to_owned(),
            frames,
            states,
            answers,
            sent,
            answered,
            held: None,
            last: None,
            _node: node,
        })
    }

    /// The next frame that has not been answered; none if pdk is done.
    fn next(&mut self) -> Result<Option<pdk_frame>> {
        self.held = None;
        loop {
            let Some(sample) = self.frames.receive().map_err(|error| error.to_string())? else {
                if self.is_over() {
                    return Ok(None);
                }
                self.sent.timed_wait(|_| {}, LOOK).map_err(|error| error.to_string())?;
                continue;
            };
            let header = *sample.user_header();
            let stamp = (header.scenario, header.sequence);
            // Until it has been answered once, pdk sends the first frame again and again.
            if let Some((last, answer)) = self.last
                && last == stamp
            {
                self.send(header, answer)?;
                continue;
            }
            let mut speed = f64::NAN;
            while let Some(state) = self.states.receive().map_err(|error| error.to_string())? {
                let of = state.user_header();
                if (of.scenario, of.sequence) == stamp {
                    speed = state.payload().numbers[SPEED];
                }
            }
            let sample = self.held.insert(sample);
            return Ok(Some(pdk_frame {
                pixels: sample.payload().as_ptr(),
                width: header.width,
                height: header.height,
                scenario: header.scenario,
                frame_index: header.sequence,
                time: header.time,
                speed,
            }));
        }
    }

    fn answer(&mut self, answer: Answer) -> Result<()> {
        let Some(sample) = self.held.take() else {
            return Err("there is no frame to answer: call pdk_driver_next first".to_owned());
        };
        let header = *sample.user_header();
        self.last = Some(((header.scenario, header.sequence), answer));
        self.send(header, answer)
    }

    fn send(&self, header: FrameHeader, answer: Answer) -> Result<()> {
        let mut sample = self.answers.loan_uninit().map_err(|error| error.to_string())?;
        *sample.user_header_mut() = header;
        sample.write_payload(answer).send().map_err(|error| error.to_string())?;
        self.answered.notify().map_err(|error| error.to_string())?;
        Ok(())
    }

    /// Whether pdk is done with it: the owner holds a lock for as long as it lives.
    fn is_over(&self) -> bool {
        File::open(self.folder.join("lock")).is_ok_and(|lock| lock.try_lock_shared().is_ok())
            || !self.folder.exists()
    }
}

/// Keeps the sentence of an error for [`pdk_driver_error`].
fn said<T>(result: Result<T>) -> Option<T> {
    result.map_err(|error| ERROR.set(CString::new(error).unwrap_or_default())).ok()
}

/// Opens the exchange in a folder; null for the one that pdk has named.
///
/// # Safety
/// `folder` is null, or a text that ends in zero.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pdk_driver_open(folder: *const c_char) -> *mut pdk_driver {
    let named = match folder.is_null() {
        true => std::env::var_os("PDK_EXCHANGE").map(PathBuf::from),
        // SAFETY: the caller's promise.
        false => Some(PathBuf::from(OsStr::from_bytes(unsafe { CStr::from_ptr(folder) }.to_bytes()))),
    };
    let folder =
        named.ok_or_else(|| "pdk has not started this program: name the folder of the exchange".to_owned());
    let opened = said(folder.and_then(|folder| pdk_driver::open(&folder)));
    opened.map_or(std::ptr::null_mut(), |driver| Box::into_raw(Box::new(driver)))
}

/// Waits for the next frame: 1 if there is one, 0 if pdk is done, -1 if something fails.
///
/// # Safety
/// Both are those of this library, and not used by another thread at the same time.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pdk_driver_next(driver: *mut pdk_driver, frame: *mut pdk_frame) -> c_int {
    // SAFETY: the caller's promise.
    match said(unsafe { &mut *driver }.next()) {
        Some(Some(next)) => {
            // SAFETY: the caller's promise.
            unsafe { frame.write(next) };
            1
        }
        Some(None) => 0,
        None => -1,
    }
}

/// Answers the frame: 1, or -1 where something fails.
///
/// # Safety
/// As for [`pdk_driver_next`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pdk_driver_answer(driver: *mut pdk_driver, steering: f64, throttle: f64) -> c_int {
    // SAFETY: the caller's promise.
    said(unsafe { &mut *driver }.answer(Answer { steering, throttle })).map_or(-1, |()| 1)
}

/// What failed last in this thread.
#[unsafe(no_mangle)]
pub extern "C" fn pdk_driver_error() -> *const c_char {
    ERROR.with_borrow(|error| error.as_ptr())
}

/// Closes the exchange.
///
/// # Safety
/// It is null, or one of this library that is not used after this.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pdk_driver_close(driver: *mut pdk_driver) {
    if !driver.is_null() {
        // SAFETY: the caller's promise.
        drop(unsafe { Box::from_raw(driver) });
    }
}
