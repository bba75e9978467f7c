//! What this processor has of the extensions that kernels are compiled for.

/// Whether it has AVX2.
#[inline(always)]
pub fn has_avx2() -> bool {
    std::arch::is_x86_feature_detected!("avx2")
}

/// Whether it has AVX-512 with BW, DQ, VL and permutations of bytes (VBMI). Processors that have these hardly lower their clock for wide
/// registers.
#[inline(always)]
pub fn has_avx512() -> bool {
    use std::arch::is_x86_feature_detected as has;
    has!("avx512vbmi") && has!("avx512bw") && has!("avx512dq") && has!("avx512vl")
}
