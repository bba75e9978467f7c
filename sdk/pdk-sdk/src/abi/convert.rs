//! Values of the SDK as they cross the boundary, and back.

use pdk_abi::{Prefix, Sink, Status, Text, empty, load, status};
use pdk_ops::{Frame, FrameMut};

use crate::error::{Error, ErrorKind, Result};

/// What a call returns for each kind of error.
const STATUSES: [(ErrorKind, u64); ErrorKind::ALL.len()] = [
    (ErrorKind::Failed, status::FAILED),
    (ErrorKind::Late, status::LATE),
    (ErrorKind::Lost, status::LOST),
    (ErrorKind::Nonsense, status::NONSENSE),
    (ErrorKind::Configuration, status::CONFIGURATION),
    (ErrorKind::Panic, status::PANIC),
    (ErrorKind::Unsuitable, status::UNSUITABLE),
];

/// What a call returns that failed with this kind of error.
pub(crate) fn status_of(kind: ErrorKind) -> Status {
    let found = STATUSES.iter().find(|(known, _)| *known == kind);
    Status { code: found.map_or(status::FAILED, |(_, code)| *code) }
}

/// The kind of error of a call that returned this: one that is not known here says no more than that it failed.
pub(crate) fn kind_of(status: Status) -> ErrorKind {
    STATUSES.iter().find(|(_, code)| *code == status.code).map_or(ErrorKind::Failed, |(kind, _)| *kind)
}

/// A text of the other side.
///
/// # Safety
/// Its bytes have to be readable and unchanged for `'a`.
pub(crate) unsafe fn text<'a>(text: Text) -> Result<&'a str> {
    // SAFETY: the caller's promise.
    std::str::from_utf8(unsafe { text.bytes() })
        .map_err(|_| Error::of(ErrorKind::Nonsense, "a text is not UTF-8"))
}

/// A sink that adds to a vector, which nothing else may use while the sink is in use.
pub(crate) fn sink(bytes: &mut Vec<u8>) -> Sink {
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
pub(crate) unsafe fn slice<'a, V>(data: *const V, length: usize) -> &'a [V] {
    // SAFETY: the caller's promise.
    if data.is_null() { &[] } else { unsafe { std::slice::from_raw_parts(data, length) } }
}

/// A frame for the other side to read.
pub(crate) fn frame(frame: Frame<'_>) -> pdk_abi::Frame {
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
pub(crate) fn frame_mut(frame: &mut FrameMut<'_>) -> pdk_abi::FrameMut {
    let (width, height, stride) = (frame.width(), frame.height(), frame.stride());
    let data = frame.data_mut();
    pdk_abi::FrameMut { data: data.as_mut_ptr(), length: data.len(), width, height, stride, ..empty() }
}

/// A frame of the other side.
///
/// # Safety
/// The memory has to be readable and unchanged for `'a`.
pub(crate) unsafe fn source<'a>(from: *const pdk_abi::Frame) -> Result<Frame<'a>> {
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
pub(crate) unsafe fn target<'a>(from: *const pdk_abi::FrameMut) -> Result<FrameMut<'a>> {
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
pub(crate) unsafe fn slice_mut<'a, V>(data: *mut V, length: usize) -> &'a mut [V] {
    // SAFETY: the caller's promise.
    if data.is_null() { &mut [] } else { unsafe { std::slice::from_raw_parts_mut(data, length) } }
}

/// A value that both sides know in a form of their own.
pub(crate) trait Crosses: Sized {
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
}
