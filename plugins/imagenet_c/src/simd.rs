//! Code that is compiled several times: for every processor, and for those with AVX2 or AVX-512, chosen at run time.
//!
//! The bodies are plain Rust. All versions do the same single operations in the same order, so the bytes are the same.

pub(crate) use pdk_sdk::ops::vectorised;

/// Whether the versions for AVX2 are to be used.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
pub fn has_avx2() -> bool {
    allowed() >= 1
}

/// Whether the versions for AVX-512 are to be used.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
pub fn has_avx512() -> bool {
    allowed() >= 2
}

/// What may be used: 0 for the instructions of every processor, 1 for AVX2, 2 for AVX-512.
#[cfg(all(not(test), target_arch = "x86_64"))]
#[inline(always)]
const fn allowed() -> u8 {
    2
}

#[cfg(all(test, target_arch = "x86_64"))]
fn allowed() -> u8 {
    ALLOWED.get()
}

#[cfg(test)]
thread_local! {
    /// What a test allows on this thread.
    static ALLOWED: std::cell::Cell<u8> = const { std::cell::Cell::new(2) };
}

/// Does a test's work once with each set of instructions, of those that the processor has.
#[cfg(test)]
pub fn with_each(mut work: impl FnMut(u8)) {
    for allowed in [0, 1, 2] {
        ALLOWED.set(allowed);
        work(allowed);
    }
}
