//! Code that is compiled several times: for every processor, and for those with AVX2 or AVX-512, chosen at run time.
//!
//! The bodies are plain Rust. All versions do the same single operations in the same order, so the bytes are the same.

pub(crate) use pdk_sdk::ops::vectorised;

/// Whether the versions for AVX2 are to be used.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
pub fn has_avx2() -> bool {
    allowed() >= Instructions::Avx2
}

/// Whether the versions for AVX-512 are to be used.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
pub fn has_avx512() -> bool {
    allowed() >= Instructions::Avx512
}

/// What may be used, if the processor has it.
#[cfg(any(test, target_arch = "x86_64"))]
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
pub enum Instructions {
    #[cfg(test)]
    Portable,
    Avx2,
    Avx512,
}

#[cfg(all(not(test), target_arch = "x86_64"))]
#[inline(always)]
fn allowed() -> Instructions {
    Instructions::Avx512
}

#[cfg(all(test, target_arch = "x86_64"))]
fn allowed() -> Instructions {
    ALLOWED.get()
}

#[cfg(test)]
thread_local! {
    /// What a test allows on this thread.
    static ALLOWED: std::cell::Cell<Instructions> = const { std::cell::Cell::new(Instructions::Avx512) };
}

/// Does a test's work once with each set of instructions; one that the processor lacks is replaced by one that it has.
#[cfg(test)]
pub fn with_each(mut work: impl FnMut(Instructions)) {
    for allowed in [Instructions::Portable, Instructions::Avx2, Instructions::Avx512] {
        ALLOWED.set(allowed);
        work(allowed);
    }
}
