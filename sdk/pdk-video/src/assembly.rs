//! Whether the codec was built with assembly.

// The declarations below are of this crate's native library.
use openh264_sys2 as _;

unsafe extern "C" {
    /// OpenH264's `cpu.h`: the instruction sets that it uses, as bits, and the number of processors if that is asked for.
    fn WelsCPUFeatureDetect(processors: *mut i32) -> u32;
}

/// Whether H.264 is encoded and decoded with assembly, which is a matter of speed alone. It was built in where nasm was installed,
/// when pdk was built.
pub fn has_assembly() -> bool {
    let mut processors = 0;
    // SAFETY: the function reads what the processor says of itself, and writes to the number that it is given, if at all. Without
    // assembly it knows no instruction set.
    unsafe { WelsCPUFeatureDetect(&raw mut processors) != 0 }
}
