//! A library for the tests that was built for another version of the plugin interface: the version is all that it has.

// SAFETY: the name is part of pdk's plugin interface, and nothing else in this library uses it.
#[unsafe(no_mangle)]
#[allow(non_upper_case_globals)]
static pdk_plugin: u64 = 2;
