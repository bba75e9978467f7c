//! A library for the tests with the object that plugins exported before abi_stable had the door.

// SAFETY: nothing else in this library has the name.
#[unsafe(no_mangle)]
#[allow(non_upper_case_globals)]
static pdk_plugin: u64 = 1;
