//! What stays as it is for as long as the version is the same, because it is passed by value.

use abi_stable::StableAbi;

/// Bytes of the side that passes them, for the time of the call: text is UTF-8.
#[repr(C)]
#[derive(Clone, Copy, StableAbi)]
pub struct Text {
    /// The first byte.
    pub data: *const u8,
    /// The number of bytes.
    pub length: usize,
}

/// How a call went. If it failed, the sentence is in the sink for errors.
#[repr(C)]
#[derive(Clone, Copy, StableAbi)]
pub struct Status {
    /// One of the numbers of [`status`]; another one says no more than that it failed.
    pub code: u64,
}

impl Text {
    /// The bytes of a slice, which has to live as long as they are used.
    pub fn new(bytes: &[u8]) -> Self {
        Self { data: bytes.as_ptr(), length: bytes.len() }
    }

    /// The bytes; none if the pointer is null.
    ///
    /// # Safety
    /// They have to be readable and unchanged for `'a`.
    pub unsafe fn bytes<'a>(self) -> &'a [u8] {
        match self.data.is_null() {
            true => &[],
            // SAFETY: the caller's promise.
            false => unsafe { core::slice::from_raw_parts(self.data, self.length) },
        }
    }
}

/// How a call can go.
pub mod status {
    crate::declare::numbers! {
        /// It worked.
        pub const DONE = 0;
        /// It did not work, for a reason that only the sentence tells.
        pub const FAILED = 1;
        /// It did not answer in time.
        pub const LATE = 2;
        /// The connection or the process behind it is gone.
        pub const LOST = 3;
        /// It answered with something that cannot be.
        pub const NONSENSE = 4;
        /// The user has to change something before it can work.
        pub const CONFIGURATION = 5;
        /// It panicked: the instance is of no more use.
        pub const PANIC = 6;
        /// The file or folder is not of the kind that the component reads.
        pub const UNSUITABLE = 7;
    }
}

/// Which way a perturbation moves points.
pub mod way {
    crate::declare::numbers! {
        /// From the source frame to the perturbed one.
        pub const TO_PERTURBED = 0;
        /// From the perturbed frame to the source.
        pub const TO_SOURCE = 1;
    }
}

/// What a simulator can be asked for besides frames; a simulator leaves out what it does not know.
pub mod annotation {
    crate::declare::numbers! {
        /// What each pixel shows.
        pub const LABELS = 1;
        /// How far away it is.
        pub const DEPTH = 2;
    }
}
