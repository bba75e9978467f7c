//! What every function of an instance has in common, and the macro that declares those of a kind.

use std::ffi::c_void;

use pdk_abi::{Sink, Status, status};

use super::guard::Guarded;
use crate::abi::convert;
use crate::error::Result;

/// An instance of a kind, for the host.
pub(super) fn instance<K: ?Sized>(component: Box<K>, names: Vec<String>) -> *mut c_void {
    Box::into_raw(Box::new(Guarded::new(component, names))).cast()
}

/// Ends an instance.
pub(crate) unsafe extern "C" fn end<K: ?Sized>(object: *mut c_void) {
    // SAFETY: the host has it from here, and does not use it after this.
    drop(unsafe { Box::from_raw(object.cast::<Guarded<K>>()) });
}

/// Calls the component in an instance.
///
/// # Safety
/// The instance was made here for this kind, no other call of it is in progress, and the sink is that of this call.
pub(crate) unsafe fn call<K: ?Sized>(
    object: *mut c_void,
    error: *const Sink,
    work: impl FnOnce(&mut K, &[String]) -> Result<()>,
) -> Status {
    // SAFETY: the caller's promise.
    unsafe { finish((*object.cast::<Guarded<K>>()).call(work), error) }
}

/// Passes a text on.
///
/// # Safety
/// The sink is that of a call in progress.
pub(crate) unsafe fn put(into: *const Sink, text: &str) {
    // SAFETY: the caller's promise.
    unsafe { pdk_abi::load(into, pdk_abi::empty()).put(text.as_bytes()) };
}

/// Ends a call, with its sentence if it failed.
///
/// # Safety
/// The sink is that of a call in progress.
pub(crate) unsafe fn finish(result: Result<()>, sink: *const Sink) -> Status {
    match result {
        Ok(()) => Status { code: status::DONE },
        Err(error) => {
            // SAFETY: the caller's promise.
            unsafe { put(sink, error.message()) };
            convert::status_of(error.kind())
        }
    }
}

/// Declares the functions of an instance of a kind, and their table. What they do with the host's pointers is within the promises that `call`
/// asks for: these live through the call, and the instance was made here and is lent to one call at a time.
///
/// They know a component as a value of its kind's trait, so that they are compiled once and not for every component of every plugin.
macro_rules! functions {
    ($bound:ident as $table:ident:
     $(fn $function:ident($component:ident, $names:pat $(, $argument:ident: $type:ty)*) $work:block)*) => {
        /// The functions of an instance, as the host calls them.
        pub(crate) mod functions {
            use super::*;
            $(
                unsafe extern "C" fn $function(
                    object: *mut std::ffi::c_void,
                    $($argument: $type,)*
                    error: *const pdk_abi::Sink,
                ) -> pdk_abi::Status {
                    // SAFETY: the host lends the instance, the memory behind all pointers and the sink for this call, what is to be
                    // not written to by anything else.
                    unsafe { $crate::abi::plugin::call::call::<dyn $bound>(object, error, |$component, $names| $work) }
                }
            )*

            /// Their table.
            pub(crate) const fn table() -> &'static pdk_abi::abi_stable::prefix_type::WithMetadata<pdk_abi::$table> {
                const {
                    &pdk_abi::abi_stable::prefix_type::WithMetadata::new(pdk_abi::$table {
                        drop: $crate::abi::plugin::call::end::<dyn $bound>,
                        $($function,)*
                    })
                }
            }
        }
    };
}
pub(crate) use functions;
