//! Values of the SDK as they cross the boundary, and back.

use pdk_abi::{
    Prefix, Sink, State as RawState, Status, Text, annotation, empty, load, map_flag, state_flag, status,
};
use pdk_ops::{Frame, FrameMut};
use pdk_seed::Key;
use serde::{Deserialize, Serialize};

use crate::dataset::Position;
use crate::driver::{Control, DriveContext};
use crate::error::{Error, ErrorKind, Result};
use crate::predictor::Output;
use crate::saliency::MapContext;
use crate::simulator::{Annotations, Camera, State};

/// What a call returns for each kind of error.
const STATUSES: [(ErrorKind, u64); ErrorKind::ALL.len()] = [
    (ErrorKind::Failed, status::FAILED),
    (ErrorKind::Late, status::LATE),
    (ErrorKind::Lost, status::LOST),
    (ErrorKind::Nonsense, status::NONSENSE),
    (ErrorKind::Configuration, status::CONFIGURATION),
    (ErrorKind::Panic, status::PANIC),
];

/// What a call returns that failed with this kind of error.
pub(super) fn status_of(kind: ErrorKind) -> Status {
    let found = STATUSES.iter().find(|(known, _)| *known == kind);
    Status { code: found.map_or(status::FAILED, |(_, code)| *code) }
}

/// The kind of error of a call that returned this: one that is not known here says no more than that it failed.
pub(super) fn kind_of(status: Status) -> ErrorKind {
    STATUSES.iter().find(|(_, code)| *code == status.code).map_or(ErrorKind::Failed, |(kind, _)| *kind)
}

/// A text of the other side.
///
/// # Safety
/// Its bytes have to be readable and unchanged for `'a`.
pub(super) unsafe fn text<'a>(text: Text) -> Result<&'a str> {
    // SAFETY: the caller's promise.
    std::str::from_utf8(unsafe { text.bytes() })
        .map_err(|_| Error::of(ErrorKind::Nonsense, "a text is not UTF-8"))
}

/// A sink that adds to a vector, which nothing else may use while the sink is in use.
pub(super) fn sink(bytes: &mut Vec<u8>) -> Sink {
    unsafe extern "C" fn append(context: *mut std::ffi::c_void, bytes: Text) {
        // SAFETY: `context` is the vector below, and the bytes live through the call.
        unsafe { (*context.cast::<Vec<u8>>()).extend_from_slice(bytes.bytes()) };
    }
    Sink { context: std::ptr::from_mut(bytes).cast(), write: Some(append), ..empty() }
}

/// A slice of the other side, empty if the pointer is null.
///
/// # Safety
/// A pointer that is not null has to be readable for `length` elements for `'a`.
pub(super) unsafe fn slice<'a, V>(data: *const V, length: usize) -> &'a [V] {
    // SAFETY: the caller's promise.
    if data.is_null() { &[] } else { unsafe { std::slice::from_raw_parts(data, length) } }
}

/// A frame for the other side to read.
pub(super) fn frame(frame: Frame<'_>) -> pdk_abi::Frame {
    let data = frame.data();
    pdk_abi::Frame {
        data: data.as_ptr(),
        length: data.len(),
        width: frame.width(),
        height: frame.height(),
        stride: frame.stride(),
        ..empty()
    }
}

/// A frame for the other side to write.
pub(super) fn frame_mut(frame: &mut FrameMut<'_>) -> pdk_abi::FrameMut {
    let (width, height, stride) = (frame.width(), frame.height(), frame.stride());
    let data = frame.data_mut();
    pdk_abi::FrameMut { data: data.as_mut_ptr(), length: data.len(), width, height, stride, ..empty() }
}

/// A frame of the other side.
///
/// # Safety
/// The memory has to be readable and unchanged for `'a`.
pub(super) unsafe fn source<'a>(from: *const pdk_abi::Frame) -> Result<Frame<'a>> {
    // SAFETY: the caller's promise.
    let raw = unsafe { load(from, empty()) };
    // SAFETY: as above.
    let data = unsafe { slice(raw.data, raw.length) };
    Frame::with_stride(data, raw.width, raw.height, raw.stride).map_err(Error::new)
}

/// A frame of the other side to write.
///
/// # Safety
/// The memory has to be writable and not otherwise used for `'a`.
pub(super) unsafe fn target<'a>(from: *const pdk_abi::FrameMut) -> Result<FrameMut<'a>> {
    // SAFETY: the caller's promise.
    let raw = unsafe { load(from, empty()) };
    // SAFETY: as above.
    let data = unsafe { slice_mut(raw.data, raw.length) };
    FrameMut::with_stride(data, raw.width, raw.height, raw.stride).map_err(Error::new)
}

/// A writable slice of the other side, empty if the pointer is null.
///
/// # Safety
/// A pointer that is not null has to be writable for `length` elements for `'a`, and not otherwise used.
pub(super) unsafe fn slice_mut<'a, V>(data: *mut V, length: usize) -> &'a mut [V] {
    // SAFETY: the caller's promise.
    if data.is_null() { &mut [] } else { unsafe { std::slice::from_raw_parts_mut(data, length) } }
}

/// What a simulator is asked for, as it crosses.
pub(super) fn annotations(annotations: Annotations) -> u64 {
    [(annotations.labels, annotation::LABELS), (annotations.depth, annotation::DEPTH)]
        .into_iter()
        .filter_map(|(wanted, number)| wanted.then_some(number))
        .sum()
}

/// What a simulator is asked for; what is not known here is left out.
pub(super) fn read_annotations(numbers: u64) -> Annotations {
    Annotations { labels: numbers & annotation::LABELS != 0, depth: numbers & annotation::DEPTH != 0 }
}

/// What a saliency method knows, as it crosses.
pub(super) fn map_context(cx: &MapContext<'_>) -> pdk_abi::MapContext {
    pdk_abi::MapContext {
        frame_index: cx.frame_index,
        time: cx.time,
        key: cx.key.0,
        speed: cx.speed.unwrap_or(f64::NAN),
        flags: if cx.recorded { map_flag::RECORDED } else { 0 },
        ..empty()
    }
}

/// What a saliency method knows where the other side says nothing.
pub(super) fn unsaid_map_context() -> pdk_abi::MapContext {
    pdk_abi::MapContext { speed: f64::NAN, ..empty() }
}

/// What a saliency method knows.
pub(super) fn read_map_context<'a>(raw: &pdk_abi::MapContext, key: &'a Key) -> MapContext<'a> {
    MapContext {
        speed: Some(raw.speed).filter(|speed| !speed.is_nan()),
        recorded: raw.flags & map_flag::RECORDED != 0,
        ..MapContext::new(raw.frame_index, raw.time, key)
    }
}

/// How the values of an output are to be read.
#[derive(Serialize, Deserialize)]
pub(super) struct Shape {
    name: String,
    shape: Vec<usize>,
}

/// How the values of these outputs are to be read.
pub(super) fn shapes(outputs: &[Output]) -> Vec<Shape> {
    outputs
        .iter()
        .map(|Output { name, shape, .. }| Shape { name: name.clone(), shape: shape.clone() })
        .collect()
}

/// Numbers as the machine has them.
pub(super) fn bytes(values: &[f32]) -> &[u8] {
    // SAFETY: the same memory; any bytes are bytes.
    unsafe { std::slice::from_raw_parts(values.as_ptr().cast(), size_of_val(values)) }
}

/// Outputs from their shapes and the bytes of all their values; none if these do not belong together.
pub(super) fn read_outputs(shapes: Vec<Shape>, bytes: &[u8]) -> Option<Vec<Output>> {
    let mut values =
        bytes.chunks_exact(size_of::<f32>()).map(|value| value.try_into().map(f32::from_ne_bytes));
    let mut outputs = Vec::with_capacity(shapes.len());
    for Shape { name, shape } in shapes {
        let count = shape.iter().try_fold(1_usize, |count, side| count.checked_mul(*side))?;
        let values: Vec<f32> = values.by_ref().take(count).collect::<std::result::Result<_, _>>().ok()?;
        if values.len() != count {
            return None;
        }
        outputs.push(Output { name, shape, values });
    }
    (values.next().is_none() && bytes.len().is_multiple_of(size_of::<f32>())).then_some(outputs)
}

/// A value that both sides know in a form of their own.
pub(super) trait Crosses: Sized {
    /// As it crosses.
    type Raw: Prefix;

    /// As it crosses.
    fn raw(self) -> Self::Raw;

    /// What crossed.
    fn from_raw(raw: Self::Raw) -> Self;

    /// What the other side wrote; what it does not know is as it is without it.
    ///
    /// # Safety
    /// `from` points to a structure of this kind, which is as large as it says.
    unsafe fn read(from: *const Self::Raw) -> Self
    where
        Self: Default,
    {
        // SAFETY: the caller's promise.
        Self::from_raw(unsafe { load(from, Self::default().raw()) })
    }
}

impl Crosses for State {
    type Raw = RawState;

    fn raw(self) -> RawState {
        let Self { time, position, heading, speed, cross_track_error, progress, vehicle_ahead, .. } = self;
        let flag = |set: bool, flag: u64| if set { flag } else { 0 };
        RawState {
            time,
            position,
            heading,
            speed,
            cross_track_error,
            progress,
            vehicle_ahead,
            flags: flag(self.lane_departure, state_flag::LANE_DEPARTURE)
                | flag(self.collision, state_flag::COLLISION)
                | flag(self.finished, state_flag::FINISHED),
            ..empty()
        }
    }

    fn from_raw(raw: RawState) -> Self {
        let RawState { time, position, heading, speed, cross_track_error, progress, vehicle_ahead, .. } = raw;
        Self {
            time,
            position,
            heading,
            speed,
            cross_track_error,
            progress,
            vehicle_ahead,
            lane_departure: raw.flags & state_flag::LANE_DEPARTURE != 0,
            collision: raw.flags & state_flag::COLLISION != 0,
            finished: raw.flags & state_flag::FINISHED != 0,
        }
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

impl Crosses for Camera {
    type Raw = pdk_abi::Camera;

    fn raw(self) -> Self::Raw {
        let Self { width, height, rate } = self;
        pdk_abi::Camera { width, height, rate, ..empty() }
    }

    fn from_raw(raw: Self::Raw) -> Self {
        Self { width: raw.width, height: raw.height, rate: raw.rate }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_of_error_crosses_and_an_unknown_one_says_failed() {
        for kind in ErrorKind::ALL {
            assert_eq!(kind_of(status_of(kind)), kind);
            assert_ne!(status_of(kind).code, status::DONE);
        }
        assert_eq!(kind_of(Status { code: 77 }), ErrorKind::Failed);
    }

    #[test]
    fn values_cross_as_they_are() {
        for flag in 0..3 {
            let flags = std::array::from_fn(|other| other == flag);
            let state = State::from_parts(std::array::from_fn(|i| i as f64 + 0.5), flags);
            assert_eq!(State::from_raw(state.raw()), state);
        }
        let control = Control { steering: 0.25, throttle: -0.5 };
        assert_eq!(Control::from_raw(control.raw()), control);
        let cx = DriveContext { frame_index: 3, time: 0.5, speed: 8.0 };
        assert_eq!(DriveContext::from_raw(cx.raw()), cx);
        let position = Position { part: 2, number: 7, time: 0.25 };
        assert_eq!(Position::from_raw(position.raw()), position);
        let camera = Camera { width: 32, height: 24, rate: 20.0 };
        assert_eq!(Camera::from_raw(camera.raw()), camera);
    }

    #[test]
    fn outputs_cross_as_they_are_and_others_are_refused() {
        let output = |name: &str, shape: &[usize], values: &[f32]| Output {
            name: name.into(),
            shape: shape.into(),
            values: values.into(),
        };
        let outputs = vec![
            output("a", &[1, 2], &[0.5, f32::INFINITY]),
            output("b", &[], &[-1.0]),
            output("c", &[0], &[]),
        ];
        let values: Vec<u8> = outputs.iter().flat_map(|output| bytes(&output.values)).copied().collect();
        assert_eq!(read_outputs(shapes(&outputs), &values).unwrap(), outputs);
        for wrong in [&values[..8], &values[..11], &[values.clone(), vec![0; 4]].concat()] {
            assert!(read_outputs(shapes(&outputs), wrong).is_none());
        }
        assert!(read_outputs(shapes(&[output("a", &[usize::MAX, 2], &[])]), &values).is_none());
    }

    #[test]
    fn what_a_saliency_method_knows_crosses_as_it_is() {
        let key = Key([3; 32]);
        let known = MapContext { speed: Some(0.0), recorded: true, ..MapContext::new(4, 0.5, &key) };
        for cx in [known, MapContext::new(5, 1.0, &key)] {
            let raw = map_context(&cx);
            let read = read_map_context(&raw, &key);
            assert_eq!(
                (read.frame_index, read.time, read.speed, read.recorded),
                (cx.frame_index, cx.time, cx.speed, cx.recorded)
            );
        }
        assert_eq!(read_map_context(&unsaid_map_context(), &key).speed, None);
    }

    #[test]
    fn what_the_other_side_does_not_know_is_as_without_it() {
        // A state that ends before the road ahead.
        let mut short = State { speed: 3.0, vehicle_ahead: 4.0, collision: true, ..State::default() }.raw();
        short.size = std::mem::offset_of!(RawState, vehicle_ahead);
        // SAFETY: it is larger than it says.
        let state = unsafe { State::read(&short) };
        assert_eq!(state, State { speed: 3.0, ..State::default() });
    }
}
