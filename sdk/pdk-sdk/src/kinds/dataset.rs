//! Dataset readers: components that read recorded frames with their ground truth.

use std::cell::RefCell;
use std::ffi::c_void;
use std::panic::{AssertUnwindSafe, catch_unwind};

use pdk_abi::{DatasetFunctionsRef, Perturber, Sink, Status, Text, empty, load, store};
use pdk_ops::FrameBuf;

use crate::abi::convert::{self, Crosses};
use crate::abi::host::call::{Object, call, collect, needed};
use crate::abi::plugin::call::{finish, functions, put};
use crate::config::Config;
use crate::describe::Description;
use crate::error::{Error, ErrorKind, Result};
use crate::form::{Form, Perturb, Rewrite};
use crate::testing::sample::{Make, ensure};

/// Reads the frames of a recording, in any order.
///
/// What a reader does not recognise as its format it rejects with [`ErrorKind::Unsuitable`](crate::error::ErrorKind::Unsuitable), so
/// that pdk asks the next one.
pub trait Dataset: Send {
    /// The number of frames.
    fn len(&self) -> usize;

    /// Whether there are none.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The name of a frame, as it is reported; also where the frame itself cannot be read.
    fn name(&self, index: usize) -> String;

    /// Reads a frame.
    ///
    /// # Errors
    /// If this frame cannot be read; the run counts it, names it and goes on with the next.
    fn read(&mut self, index: usize) -> Result<Entry>;

    /// Where in its recording a frame lies, as far as that is known without its picture. A driver that remembers earlier frames begins
    /// anew where numbers or times jump.
    fn position(&self, index: usize) -> Position {
        Position { part: 0, number: index as u64, time: f64::NAN }
    }

    /// What was decided when the recording was opened and is not among the parameters, such as the columns that were guessed: names and
    /// values, which pdk prints and records.
    fn info(&self) -> Vec<(String, String)> {
        Vec::new()
    }

    /// How the recording is written again in its own form; none if only its frames can be had, so that a copy is pictures with a record
    /// beside each.
    ///
    /// # Errors
    /// If that cannot be found out.
    fn form(&self) -> Result<Option<Form>> {
        Ok(None)
    }

    /// Writes a file of the recording again, as [`form`](Self::form) lists it: with the pictures that `perturb` makes of the recorded ones, steering
    /// of mirrored frames with the other sign, and everything else as it is. The same call gives the same bytes.
    ///
    /// # Errors
    /// If a frame cannot be read or perturbed, or the file cannot be written.
    fn rewrite(&mut self, _: &Rewrite, _: &mut Perturb<'_>) -> Result<()> {
        Err(Error::new("recordings of this form are not written"))
    }
}

/// Where in its recording a frame lies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Position {
    /// The part of the recording that the frame belongs to, such as a drive of its own: frames of two parts do not follow each other.
    pub part: u64,
    /// Its number in that part, as it was recorded: frames that are missing leave a gap.
    pub number: u64,
    /// Seconds since the first frame; not a number if it is not known.
    pub time: f64,
}

/// A recorded frame.
///
/// What was not recorded is not a number: `Entry { frame, steering, ..Entry::default() }` has no throttle and no speed.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    /// The image.
    pub frame: FrameBuf,
    /// The recorded steering, -1 to 1; NaN if none was recorded.
    pub steering: f64,
    /// The recorded throttle, -1 to 1; NaN if none was recorded.
    pub throttle: f64,
    /// Seconds since the first frame.
    pub time: f64,
    /// The recorded speed in metres per second; NaN if none was recorded.
    pub speed: f64,
}

impl Default for Entry {
    fn default() -> Self {
        let frame = FrameBuf::default();
        Self { frame, steering: f64::NAN, throttle: f64::NAN, time: 0.0, speed: f64::NAN }
    }
}

impl Entry {
    /// Whether it can be used: what was recorded is finite, and it has a time.
    pub fn is_plausible(&self) -> bool {
        self.time.is_finite() && ![self.steering, self.throttle, self.speed].iter().any(|n| n.is_infinite())
    }
}

impl Crosses for Position {
    type Raw = pdk_abi::Position;

    fn raw(self) -> Self::Raw {
        let Self { part, number, time } = self;
        pdk_abi::Position { part, number, time, ..empty() }
    }

    fn from_raw(raw: Self::Raw) -> Self {
        Self { part: raw.part, number: raw.number, time: raw.time }
    }
}

functions! { Dataset as DatasetFunctions:
    fn length(component, _, into: *mut u64) {
        into.write(component.len() as u64);
        Ok(())
    }
    fn name(component, _, index: u64, name: *const Sink) {
        put(name, &component.name(index as usize));
        Ok(())
    }
    fn read(component, _, index: u64, into: *mut pdk_abi::Entry, pixels: *const Sink) {
        let entry = component.read(index as usize)?;
        let (width, height) = (entry.frame.width(), entry.frame.height());
        load(pixels, empty()).put(entry.frame.data());
        let crate::dataset::Entry { steering, throttle, time, speed, .. } = entry;
        store(pdk_abi::Entry { width, height, steering, throttle, time, speed, ..empty() }, into);
        Ok(())
    }
    fn position(component, _, index: u64, into: *mut pdk_abi::Position) {
        store(component.position(index as usize).raw(), into);
        Ok(())
    }
    fn info(component, _, info: *const Sink) {
        put(info, &serde_json::to_string(&component.info())?);
        Ok(())
    }
    fn form(component, _, form: *const Sink) {
        put(form, &serde_json::to_string(&component.form()?)?);
        Ok(())
    }
    fn rewrite(component, _, wanted: Text, perturber: *const Perturber) {
        let wanted: Rewrite = serde_json::from_str(convert::text(wanted)?)?;
        let perturber = load(perturber, empty());
        let apply = perturber.apply.ok_or_else(|| Error::of(ErrorKind::Nonsense, "nothing perturbs its frames"))?;
        component.rewrite(&wanted, &mut |index, source, mut target| {
            let (source, target) = (convert::frame(source), convert::frame_mut(&mut target));
            call(|error| apply(perturber.context, index as u64, &source, &target, error))
        })
    }
}

/// An instance in a plugin.
pub(crate) struct Host {
    /// Behind a cell, because an instance is used by one at a time.
    object: RefCell<Object<DatasetFunctionsRef>>,
    len: usize,
    info: Vec<(String, String)>,
}

impl Host {
    pub(crate) fn new(object: Object<DatasetFunctionsRef>) -> Result<Self> {
        let mut length = 0;
        // SAFETY: everything lives through the call.
        call(|error| unsafe { object.functions.length()(object.pointer, &mut length, error) })?;
        let len = usize::try_from(length)
            .map_err(|_| Error::of(ErrorKind::Nonsense, format!("it says that it has {length} frames")))?;
        let info = match object.functions.info() {
            None => Vec::new(),
            Some(info) => {
                // SAFETY: both sinks live through the call.
                let info = collect(|text, error| unsafe { info(object.pointer, text, error) })?;
                serde_json::from_str(&info)?
            }
        };
        Ok(Self { object: RefCell::new(object), len, info })
    }
}

impl Dataset for Host {
    fn len(&self) -> usize {
        self.len
    }

    fn name(&self, index: usize) -> String {
        let object = self.object.borrow_mut();
        // SAFETY: both sinks live through the call.
        let name = collect(|text, error| unsafe {
            object.functions.name()(object.pointer, index as u64, text, error)
        });
        name.unwrap_or_else(|_| format!("frame {index}"))
    }

    fn read(&mut self, index: usize) -> Result<Entry> {
        let Object { pointer, functions, .. } = *self.object.get_mut();
        // An older plugin says nothing of the speed.
        let mut entry = pdk_abi::Entry { speed: f64::NAN, ..empty() };
        let mut pixels = Vec::new();
        let sink = convert::sink(&mut pixels);
        // SAFETY: everything lives through the call.
        call(|error| unsafe { functions.read()(pointer, index as u64, &mut entry, &sink, error) })?;
        let pdk_abi::Entry { width, height, steering, throttle, time, speed, .. } = entry;
        Ok(Entry {
            frame: FrameBuf::from_vec(pixels, width, height).map_err(Error::new)?,
            steering,
            throttle,
            time,
            speed,
        })
    }

    fn info(&self) -> Vec<(String, String)> {
        self.info.clone()
    }

    fn form(&self) -> Result<Option<Form>> {
        let object = self.object.borrow_mut();
        let Some(form) = object.functions.form() else { return Ok(None) };
        // SAFETY: both sinks live through the call.
        let form = collect(|text, error| unsafe { form(object.pointer, text, error) })?;
        Ok(serde_json::from_str(&form)?)
    }

    fn rewrite(&mut self, wanted: &Rewrite, perturb: &mut Perturb<'_>) -> Result<()> {
        let Object { pointer, functions, .. } = *self.object.get_mut();
        let rewrite = needed(functions.rewrite(), "rewrite")?;
        let wanted = serde_json::to_string(wanted)?;
        let mut perturb = perturb;
        let perturber = Perturber { context: (&raw mut perturb).cast(), apply: Some(apply), ..empty() };
        let wanted = Text::new(wanted.as_bytes());
        // SAFETY: everything lives through the call.
        call(|error| unsafe { rewrite(pointer, wanted, &perturber, error) })
    }

    fn position(&self, index: usize) -> Position {
        let unknown = Position { part: 0, number: index as u64, time: f64::NAN };
        let object = self.object.borrow_mut();
        let Some(function) = object.functions.position() else { return unknown };
        let mut position = unknown.raw();
        // SAFETY: everything lives through the call.
        let told = call(|error| unsafe { function(object.pointer, index as u64, &mut position, error) });
        told.map_or(unknown, |()| Position::from_raw(position))
    }
}

/// Perturbs a frame for the plugin, which writes it to the copy. A panic must not cross the boundary.
unsafe extern "C" fn apply(
    context: *mut c_void,
    index: u64,
    source: *const pdk_abi::Frame,
    target: *const pdk_abi::FrameMut,
    error: *const Sink,
) -> Status {
    let work = || {
        // SAFETY: `context` is what `rewrite` above passed on, and the plugin lends both frames for this call, the second not to be used by
        // anything else.
        let (perturb, source, target) = unsafe {
            (&mut *context.cast::<&mut Perturb<'_>>(), convert::source(source)?, convert::target(target)?)
        };
        perturb(index as usize, source, target)
    };
    let panicked = |_| Err(Error::of(ErrorKind::Panic, "pdk panicked while it perturbed a frame"));
    // SAFETY: the sink is that of this call.
    unsafe { finish(catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(panicked), error) }
}

/// Checks that a dataset's frames can be read in any order.
///
/// # Errors
/// The first check that fails.
pub fn check(_: &Description, config: &Config, make: Make<'_, dyn Dataset>) -> Result<()> {
    let mut dataset = make(config)?;
    ensure(!dataset.is_empty(), || "it has no frames".to_owned())?;
    let last = dataset.len() - 1;
    // A panic in `name` shows in the next call.
    ensure(!dataset.name(last).is_empty(), || "its last frame has an empty name".to_owned())?;
    let before = dataset.read(last)?;
    dataset.read(0)?;
    ensure(before.is_plausible(), || {
        "its last frame has a steering, throttle, speed or time that is not finite".to_owned()
    })?;
    let again = dataset.read(last)?;
    // By their bits, because what was not recorded is not a number, which is unequal to itself.
    let bits = |entry: &Entry| [entry.steering, entry.throttle, entry.speed, entry.time].map(f64::to_bits);
    ensure(before.frame == again.frame && bits(&before) == bits(&again), || {
        "the same frame is read differently the second time".to_owned()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_not_recorded_is_plausible_and_infinity_is_not() {
        assert!(Entry::default().is_plausible());
        for entry in [
            Entry { steering: f64::INFINITY, ..Entry::default() },
            Entry { time: f64::NAN, ..Entry::default() },
            Entry { speed: f64::NEG_INFINITY, ..Entry::default() },
        ] {
            assert!(!entry.is_plausible(), "{entry:?}");
        }
    }

    #[test]
    fn positions_cross_as_they_are() {
        let position = Position { part: 2, number: 7, time: 0.25 };
        assert_eq!(Position::from_raw(position.raw()), position);
    }
}
