//! Drivers: the models under test.

use pdk_abi::{DriverFunctionsRef, Sink, empty, store};
pub use pdk_model::control::Control;
use pdk_ops::Frame;

use crate::abi::convert::{self, Crosses};
use crate::abi::host::call::{Object, call, collect, needed};
use crate::abi::plugin::call::{functions, put};
use crate::config::Config;
use crate::describe::Description;
use crate::error::{Error, ErrorKind, Result};
use crate::testing::sample::{Make, ensure, sample_frame};

/// The name under which [`Driver::info`] gives the conventions that a driver assumes because nothing says otherwise, such as the range
/// of pixel values. A run reports them once at its start.
pub const ASSUMED: &str = "assumed";

/// Looks at a frame and steers.
pub trait Driver: Send {
    /// Forgets everything about earlier frames. Called before each scenario.
    ///
    /// # Errors
    /// If the driver cannot start over.
    fn reset(&mut self) -> Result<()> {
        Ok(())
    }

    /// Decides what to do.
    ///
    /// # Errors
    /// If the driver cannot use the frame, for instance because of its size.
    fn drive(&mut self, frame: Frame<'_>, cx: &DriveContext) -> Result<Control>;

    /// How the steering changes with each byte of a frame before which nothing was seen: writes as many numbers as the frame has bytes, row by
    /// row, and returns the steering. What the driver knows of earlier frames stays as it is.
    ///
    /// Drivers that run a network have it; others do without.
    ///
    /// # Errors
    /// If the driver cannot say, or cannot use the frame.
    fn gradient(&mut self, frame: Frame<'_>, cx: &DriveContext, into: &mut [f32]) -> Result<f64> {
        let _ = (frame, cx, into);
        Err(Error::new(
            "it does not say how its steering changes with a frame; name a driver that runs a network",
        ))
    }

    /// What was decided when the instance was made and is not among its parameters, such as the library that runs a
    /// network: names and values for the record.
    fn info(&self) -> Vec<(String, String)> {
        Vec::new()
    }
}

/// An observation: what a driver gets besides the frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DriveContext {
    /// The number of the frame in its sequence, from 0.
    pub frame_index: u64,
    /// Simulation time in seconds since the start of the sequence.
    pub time: f64,
    /// The vehicle's speed in metres per second; not a number where it is not known, as in a dataset.
    pub speed: f64,
}

impl DriveContext {
    /// The names of its numbers, in the order of [`DriveContext::numbers`].
    pub const NUMBERS: [&str; 2] = ["time", "speed"];

    /// Its numbers besides that of the frame, in the order of [`DriveContext::NUMBERS`].
    pub fn numbers(&self) -> [f64; 2] {
        [self.time, self.speed]
    }

    /// The same, if a driver can be given it.
    ///
    /// # Errors
    /// If the time is not finite, or the speed is infinite.
    pub fn checked(self) -> Result<Self> {
        if self.time.is_finite() && !self.speed.is_infinite() {
            return Ok(self);
        }
        let Self { time, speed, .. } = self;
        Err(Error::of(
            ErrorKind::Nonsense,
            format!(
                "it gives the driver the time {time} s and the speed {speed} m/s, but the time has to be finite, and the speed finite or \
                 not a number"
            ),
        ))
    }
}

impl Default for DriveContext {
    /// The first frame, at an unknown speed.
    fn default() -> Self {
        Self { frame_index: 0, time: 0.0, speed: f64::NAN }
    }
}

impl Crosses for Control {
    type Raw = pdk_abi::Control;

    fn raw(self) -> Self::Raw {
        pdk_abi::Control { steering: self.steering, throttle: self.throttle, ..empty() }
    }

    fn from_raw(raw: Self::Raw) -> Self {
        Self { steering: raw.steering, throttle: raw.throttle }
    }
}

impl Crosses for DriveContext {
    type Raw = pdk_abi::DriveContext;

    fn raw(self) -> Self::Raw {
        let Self { frame_index, time, speed } = self;
        pdk_abi::DriveContext { frame_index, time, speed, ..empty() }
    }

    fn from_raw(raw: Self::Raw) -> Self {
        Self { frame_index: raw.frame_index, time: raw.time, speed: raw.speed }
    }
}

functions! { Driver as DriverFunctions:
    fn reset(component, _) {
        component.reset()
    }
    fn drive(
        component,
        _,
        frame: *const pdk_abi::Frame,
        context: *const pdk_abi::DriveContext,
        into: *mut pdk_abi::Control
    ) {
        store(component.drive(convert::source(frame)?, &DriveContext::read(context))?.raw(), into);
        Ok(())
    }
    fn info(component, _, info: *const Sink) {
        put(info, &serde_json::to_string(&component.info())?);
        Ok(())
    }
    fn gradient(
        component,
        _,
        frame: *const pdk_abi::Frame,
        context: *const pdk_abi::DriveContext,
        into: *mut f32,
        length: usize,
        steering: *mut f64
    ) {
        let (frame, into) = (convert::source(frame)?, convert::slice_mut(into, length));
        let cx = DriveContext::read(context);
        steering.write(component.gradient(frame, &cx, bytes_of(frame, into)?)?);
        Ok(())
    }
}

/// The numbers for the bytes of a frame, if they are as many.
fn bytes_of<'a>(frame: Frame<'_>, into: &'a mut [f32]) -> Result<&'a mut [f32]> {
    match into.len() == frame.width() * frame.height() * 3 {
        true => Ok(into),
        false => Err(Error::of(
            ErrorKind::Nonsense,
            format!(
                "{} numbers are not a gradient for a frame of {}x{} pixels; give it three for each pixel",
                into.len(),
                frame.width(),
                frame.height()
            ),
        )),
    }
}

/// An instance in a plugin.
pub(crate) struct Host {
    object: Object<DriverFunctionsRef>,
    info: Vec<(String, String)>,
}

impl Host {
    pub(crate) fn new(object: Object<DriverFunctionsRef>) -> Result<Self> {
        let Object { pointer, functions, .. } = object;
        // SAFETY: both sinks live through the call.
        let info = collect(|text, error| unsafe { functions.info()(pointer, text, error) })?;
        Ok(Self { object, info: serde_json::from_str(&info)? })
    }
}

impl Driver for Host {
    fn reset(&mut self) -> Result<()> {
        let Object { pointer, functions, .. } = self.object;
        // SAFETY: the sink lives through the call.
        call(|error| unsafe { functions.reset()(pointer, error) })
    }

    fn drive(&mut self, frame: Frame<'_>, cx: &DriveContext) -> Result<Control> {
        let Object { pointer, functions, .. } = self.object;
        let (frame, context) = (convert::frame(frame), cx.raw());
        let mut control = Control::default().raw();
        // SAFETY: everything lives through the call.
        call(|error| unsafe { functions.drive()(pointer, &frame, &context, &mut control, error) })?;
        Ok(Control::from_raw(control))
    }

    fn gradient(&mut self, frame: Frame<'_>, cx: &DriveContext, into: &mut [f32]) -> Result<f64> {
        let Object { pointer, functions, .. } = self.object;
        let gradient = needed(functions.gradient(), "gradient")?;
        let (frame, context, mut steering) = (convert::frame(frame), cx.raw(), f64::NAN);
        let (data, length) = (into.as_mut_ptr(), into.len());
        // SAFETY: everything lives through the call.
        call(|error| unsafe { gradient(pointer, &frame, &context, data, length, &mut steering, error) })?;
        Ok(steering)
    }

    fn info(&self) -> Vec<(String, String)> {
        self.info.clone()
    }
}

/// Checks that a driver gives finite controls, and the same ones after a reset.
///
/// # Errors
/// The first check that fails.
pub fn check(_: &Description, config: &Config, make: Make<'_, dyn Driver>) -> Result<()> {
    let mut driver = make(config)?;
    let frame = sample_frame(160, 120);
    let mut runs = [Vec::new(), Vec::new()];
    for run in &mut runs {
        driver.reset()?;
        for frame_index in 0..3 {
            let cx = DriveContext { frame_index, time: frame_index as f64 / 30.0, speed: 8.0 };
            let control = driver.drive(frame.as_ref(), &cx)?;
            control.checked()?;
            run.push(control);
        }
    }
    ensure(runs[0] == runs[1], || "after a reset it decides differently on the same frames".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn controls_and_contexts_cross_as_they_are() {
        let control = Control { steering: 0.25, throttle: -0.5 };
        assert_eq!(Control::from_raw(control.raw()), control);
        let cx = DriveContext { frame_index: 3, time: 0.5, speed: 8.0 };
        assert_eq!(DriveContext::from_raw(cx.raw()), cx);
    }
}
