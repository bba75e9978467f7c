//! The floating-point mode of a thread: rounding, and whether very small numbers become zero. Code in a library can change it,
//! and results would then differ without a word; so it is put back after every call of a component.

use std::sync::atomic::{AtomicBool, Ordering};

/// Whether a mode was put back since anybody asked.
static CHANGED: AtomicBool = AtomicBool::new(false);

/// Puts the mode back to what every program starts with, and notes if it was another.
pub fn restore() {
    if mode::restore() {
        CHANGED.store(true, Ordering::Relaxed);
    }
}

/// Whether a mode was put back since the last time that this was asked.
pub fn was_changed() -> bool {
    CHANGED.swap(false, Ordering::Relaxed)
}

#[cfg(target_arch = "x86_64")]
mod mode {
    use std::arch::asm;

    /// Round to nearest, all exceptions masked, nothing flushed to zero.
    const USUAL: u32 = 0x1f80;
    /// Flags that any calculation may raise.
    const FLAGS: u32 = 0x3f;

    pub fn restore() -> bool {
        let mut found: u32 = 0;
        // SAFETY: stores the control register in a variable.
        unsafe { asm!("stmxcsr [{}]", in(reg) &raw mut found, options(nostack)) };
        let changed = found & !FLAGS != USUAL;
        if changed {
            let usual = USUAL;
            // SAFETY: loads the value that the system gives every thread at its start.
            unsafe { asm!("ldmxcsr [{}]", in(reg) &raw const usual, options(nostack)) };
        }
        changed
    }
}

#[cfg(target_arch = "aarch64")]
mod mode {
    use std::arch::asm;

    pub fn restore() -> bool {
        let found: u64;
        // SAFETY: reads the control register.
        unsafe { asm!("mrs {}, fpcr", out(reg) found, options(nomem, nostack)) };
        if found != 0 {
            // SAFETY: zero is what the system gives every thread at its start.
            unsafe { asm!("msr fpcr, {}", in(reg) 0u64, options(nomem, nostack)) };
        }
        found != 0
    }
}

#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
mod mode {
    pub fn restore() -> bool {
        false
    }
}

#[cfg(all(test, target_arch = "x86_64"))]
mod tests {
    use super::*;
    use std::arch::asm;

    #[test]
    fn another_rounding_is_noticed_and_put_back() {
        restore();
        was_changed();
        let upwards: u32 = 0x5f80;
        // SAFETY: a valid mode of this thread, which is put back right after.
        unsafe { asm!("ldmxcsr [{}]", in(reg) &raw const upwards, options(nostack)) };
        restore();
        assert!(was_changed());
        restore();
        assert!(!was_changed());
    }
}
