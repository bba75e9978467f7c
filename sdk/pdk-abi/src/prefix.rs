//! Structures that may grow: each side reads and writes what both know.

/// A structure that begins with its size and may grow at its end.
///
/// # Safety
/// The type is `repr(C)` without padding and begins with its size in bytes, a `usize`. Zeros are a value of each other field, and
/// so are all bytes that the other side may write.
pub unsafe trait Prefix: Copy {}

/// A structure of this size in which everything else is zero: no function, no pointer, no number.
pub const fn empty<T: Prefix>() -> T {
    // SAFETY: zeros are a value of each field.
    let value = unsafe { core::mem::zeroed() };
    sized(value)
}

/// What the other side has written: as much as both sides know, and from `unsaid` what it does not know.
///
/// # Safety
/// `from` points to a structure of this kind, which is as large as it says, and which is not written to meanwhile.
#[inline]
pub unsafe fn load<T: Prefix>(from: *const T, unsaid: T) -> T {
    // SAFETY: every structure begins with its size.
    let size = unsafe { from.cast::<usize>().read() };
    if size >= size_of::<T>() {
        // SAFETY: it is at least as large as the type.
        return sized(unsafe { from.read() });
    }
    let mut value = unsaid;
    // SAFETY: both have this many bytes, and what was zero before is written over with values of the same fields.
    unsafe { core::ptr::copy_nonoverlapping(from.cast::<u8>(), (&raw mut value).cast::<u8>(), size) };
    sized(value)
}

/// Fills in a structure of the other side, as much as both sides know. Its size stays.
///
/// # Safety
/// `into` points to a structure of this kind, which is as large as it says, and which nothing else uses meanwhile.
#[inline]
pub unsafe fn store<T: Prefix>(value: T, into: *mut T) {
    // SAFETY: every structure begins with its size.
    let size = unsafe { into.cast::<usize>().read() };
    if size == size_of::<T>() {
        // SAFETY: both have the same size.
        return unsafe { into.write(sized(value)) };
    }
    let head = size_of::<usize>();
    let known = size.min(size_of::<T>()).saturating_sub(head);
    // SAFETY: both have this many bytes behind the size.
    unsafe {
        let from = (&raw const value).cast::<u8>().add(head);
        core::ptr::copy_nonoverlapping(from, into.cast::<u8>().add(head), known);
    }
}

/// The same structure with the size that it has here.
const fn sized<T: Prefix>(mut value: T) -> T {
    // SAFETY: every structure begins with its size.
    unsafe { (&raw mut value).cast::<usize>().write(size_of::<T>()) };
    value
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A structure before and after it has grown.
    #[repr(C)]
    #[derive(Debug, Clone, Copy, PartialEq)]
    struct Before {
        size: usize,
        number: f64,
    }

    #[repr(C)]
    #[derive(Debug, Clone, Copy, PartialEq)]
    struct After {
        size: usize,
        number: f64,
        more: f64,
    }

    // SAFETY: `repr(C)`, size first, no padding, all bytes are values.
    unsafe impl Prefix for Before {}
    // SAFETY: as above.
    unsafe impl Prefix for After {}

    #[test]
    fn each_side_reads_what_both_know() {
        let before = Before { size: 16, number: 1.5 };
        let after = After { size: 24, number: 2.5, more: 3.5 };
        let unsaid = After { size: 0, number: 0.0, more: 9.0 };
        // SAFETY: all of them are as large as they say.
        unsafe {
            assert_eq!(load((&raw const before).cast(), unsaid), After { size: 24, number: 1.5, more: 9.0 });
            assert_eq!(load((&raw const after).cast(), empty::<Before>()), Before { size: 16, number: 2.5 });
            assert_eq!(load(&after, unsaid), after);
        }
    }

    #[test]
    fn each_side_writes_what_both_know_and_leaves_the_size() {
        let mut before = Before { size: 16, number: 0.0 };
        let mut after = After { size: 24, number: 0.0, more: 9.0 };
        // SAFETY: all of them are as large as they say.
        unsafe {
            store(After { size: 24, number: 2.5, more: 3.5 }, (&raw mut before).cast());
            store(Before { size: 16, number: 1.5 }, (&raw mut after).cast());
        }
        assert_eq!(before, Before { size: 16, number: 2.5 });
        assert_eq!(after, After { size: 24, number: 1.5, more: 9.0 });
    }

    #[test]
    fn what_is_empty_has_its_size_and_nothing_else() {
        assert_eq!(empty::<After>(), After { size: 24, number: 0.0, more: 0.0 });
    }
}
