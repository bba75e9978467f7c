//! A library that tells another SDK version and nothing else, as a plugin from another time would.

// SAFETY: the name is part of pdk's plugin interface, and nothing else in this library uses it.
#[unsafe(no_mangle)]
extern "C" fn pdk_plugin_sdk_version() -> *const std::ffi::c_char {
    c"0.0.1".as_ptr()
}
