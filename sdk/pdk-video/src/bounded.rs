//! Input that gives up. The reader of MP4 files believes counts and sizes, and goes round in circles in some files that are a few
//! bytes long.

use std::io::{Error, ErrorKind, Read, Result, Seek, SeekFrom};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Steps that an index of any file may take besides those for its bytes.
const BASE: u64 = 1 << 20;
/// The largest index is not larger than this in bytes, each of which may take a step.
const LARGEST: u64 = 1 << 26;

/// Reads from a file or from memory.
pub trait Input: Read + Seek {}
impl<T: Read + Seek> Input for T {}

/// Reads and seeks this many times.
pub struct Bounded {
    inner: Box<dyn Input>,
    left: Steps,
}

/// How many steps are left.
#[derive(Clone)]
pub struct Steps(Arc<AtomicU64>);

impl Bounded {
    /// Input for the index of a file of `size` bytes.
    pub fn new(inner: Box<dyn Input>, size: u64) -> (Self, Steps) {
        let left = Steps(Arc::new(AtomicU64::new(size.min(LARGEST) + BASE)));
        (Self { inner, left: left.clone() }, left)
    }
}

impl Steps {
    /// Whether there are none left.
    pub fn are_used_up(&self) -> bool {
        self.0.load(Ordering::Relaxed) == 0
    }

    /// From now on there is no limit.
    pub fn lift(&self) {
        self.0.store(u64::MAX, Ordering::Relaxed);
    }

    fn take(&self) -> Result<()> {
        let left = self.0.load(Ordering::Relaxed);
        if left == 0 {
            return Err(Error::new(ErrorKind::InvalidData, "the index leads in circles"));
        }
        self.0.store(left - 1, Ordering::Relaxed);
        Ok(())
    }
}

impl Read for Bounded {
    fn read(&mut self, into: &mut [u8]) -> Result<usize> {
        self.left.take()?;
        self.inner.read(into)
    }
}

impl Seek for Bounded {
    fn seek(&mut self, to: SeekFrom) -> Result<u64> {
        self.left.take()?;
        self.inner.seek(to)
    }
}
