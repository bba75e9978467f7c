//! Where the frames of a file lie, and why they cannot be read here.

use pdk_sdk::prelude::*;

use crate::boxes::Misbuilt;

/// Where a frame lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sample {
    /// Its first byte.
    pub at: u64,
    /// Its bytes.
    pub length: u32,
    /// Whether decoding can begin with it.
    pub alone: bool,
}

/// Why there is no index to be used.
pub enum Left {
    /// The file is broken.
    Broken(Error),
    /// It is left to others.
    Other(String),
}

impl From<Misbuilt> for Left {
    fn from(_: Misbuilt) -> Self {
        Self::Other(
            "MP4 or QuickTime of a kind that the built-in reader does not know (a box of its index is not built as expected)"
                .to_owned(),
        )
    }
}

impl From<Error> for Left {
    fn from(error: Error) -> Self {
        Self::Broken(error)
    }
}

/// Makes sure that the frames lie in the file.
pub fn within(samples: &[Sample], size: u64) -> Result<()> {
    let outside = samples.iter().position(|sample| sample.at.saturating_add(u64::from(sample.length)) > size);
    match outside {
        Some(place) => Err(Error::new(format!(
            "it is cut off: frame {} of {} is missing; copy it again",
            place + 1,
            samples.len()
        ))),
        None => Ok(()),
    }
}
