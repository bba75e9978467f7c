//! Recordings that are written again in the form that they have, with other pictures in them.

use std::path::PathBuf;

use pdk_ops::{Frame, FrameMut};
use serde::{Deserialize, Serialize};

use crate::error::Result;

/// Which files of a recording are written again, and what cannot be.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Form {
    /// The folder of the recording.
    pub folder: PathBuf,
    /// The files that hold its frames and what was recorded with them.
    pub files: Vec<FormFile>,
    /// Whether all other files of the folder belong to it, so that they are carried over as they are.
    pub whole: bool,
    /// Why steering cannot be written with the other sign; none if it can be.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unturned: Option<String>,
    /// Why the labels cannot be left out; none if they can be.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub undropped: Option<String>,
    /// What a user should know, a sentence each without its full stop.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
}

/// A file of a recording.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FormFile {
    /// Its path in the folder, with `/` between folders.
    pub name: String,
    /// How many frames it holds; none in a file of labels, which is written again only if steering changes its sign.
    pub frames: usize,
    /// How its pictures are stored in the copy, such as "JPEG of quality 95"; for the manifest.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub stored: String,
}

/// A file that is to be written again.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Rewrite {
    /// Its path in the folder of the recording.
    pub file: String,
    /// Where to write it.
    pub into: PathBuf,
    /// The quality of pictures in JPEG, 1 to 100.
    pub quality: u8,
    /// Whether each frame of the recording is mirrored, so that its steering changes its sign; empty if none is.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub mirrored: Vec<bool>,
}

impl Rewrite {
    /// Whether a frame is mirrored.
    pub fn mirrors(&self, frame: usize) -> bool {
        self.mirrored.get(frame).copied().unwrap_or_default()
    }
}

/// Writes to the second frame what the frame of this number, which is the first one, is to be in the copy.
pub type Perturb<'a> = dyn FnMut(usize, Frame<'_>, FrameMut<'_>) -> Result<()> + 'a;
