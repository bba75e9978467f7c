//! What every call to a plugin has in common.

use std::ffi::c_void;

use pdk_abi::abi_stable::StableAbi;
use pdk_abi::abi_stable::reexports::True;
use pdk_abi::{Sink, Status, Text, status};

use crate::SDK_VERSION;
use crate::abi::convert;
use crate::error::{Error, ErrorKind, Result};

/// A function of a root module that makes instances with these functions.
pub(super) type Make<F> = unsafe extern "C" fn(usize, Text, *mut pdk_abi::Instance<F>, *const Sink) -> Status;

/// Calls a function that makes instances.
pub(super) fn make_instance<F: StableAbi<IsNonZeroType = True>>(
    make: Make<F>,
    index: usize,
    parameters: &str,
) -> Result<(*mut c_void, F)> {
    let mut made = pdk_abi::Instance { object: std::ptr::null_mut(), functions: None };
    let parameters = Text::new(parameters.as_bytes());
    // SAFETY: everything lives through the call.
    call(|error| unsafe { make(index, parameters, &mut made, error) })?;
    let functions = made
        .functions
        .ok_or_else(|| Error::of(ErrorKind::Nonsense, "its plugin made an instance without functions"))?;
    Ok((made.object, functions))
}

/// Makes a call; if it fails, the plugin leaves its sentence in the sink.
#[inline]
pub(crate) fn call(work: impl FnOnce(*const Sink) -> Status) -> Result<()> {
    // Takes memory only if there is an error.
    let mut sentence = Vec::new();
    let sink = convert::sink(&mut sentence);
    match work(&sink) {
        Status { code: status::DONE } => Ok(()),
        status => Err(Error::of(convert::kind_of(status), String::from_utf8_lossy(&sentence))),
    }
}

/// Makes a call that answers with a text.
pub(crate) fn collect(work: impl FnOnce(*const Sink, *const Sink) -> Status) -> Result<String> {
    let mut answer = Vec::new();
    let sink = convert::sink(&mut answer);
    call(|error| work(&sink, error))?;
    String::from_utf8(answer)
        .map_err(|_| Error::of(ErrorKind::Nonsense, "it answered with a text that is not UTF-8"))
}

/// A function that was added after the first version, if there is no way without it.
pub(crate) fn needed<F>(function: Option<F>, name: &str) -> Result<F> {
    function.ok_or_else(|| {
        let sentence =
            format!("its plugin has no function `{name}`; build it again with pdk-sdk {SDK_VERSION}");
        Error::of(ErrorKind::Nonsense, sentence)
    })
}

/// An instance in a plugin, which ends with this.
pub(crate) struct Object<F> {
    pub(crate) pointer: *mut c_void,
    pub(crate) functions: F,
    drop: unsafe extern "C" fn(*mut c_void),
}

impl<F> Object<F> {
    pub(super) fn new(pointer: *mut c_void, functions: F, drop: unsafe extern "C" fn(*mut c_void)) -> Self {
        Self { pointer, functions, drop }
    }
}

// SAFETY: the interface has instances used by one thread at a time, not always by the same one.
unsafe impl<F> Send for Object<F> {}

impl<F> Drop for Object<F> {
    fn drop(&mut self) {
        // SAFETY: the plugin made it, and it is not used after this.
        unsafe { (self.drop)(self.pointer) };
    }
}
