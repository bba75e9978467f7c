//! What a user decides besides the conditions.

use std::path::{Path, PathBuf};

/// What becomes of labels.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum LabelsOption {
    /// They are moved along; what cannot say where it moves things is refused.
    #[default]
    Move,
    /// They are kept as they are.
    Keep,
    /// They are left out.
    Drop,
}

/// The format of the pictures that are written.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Format {
    /// That of the original, by its name.
    #[default]
    Same,
    /// PNG.
    Png,
    /// JPEG.
    Jpeg,
}

impl Format {
    /// As it is written on the command line.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Same => "same",
            Self::Png => "png",
            Self::Jpeg => "jpeg",
        }
    }

    /// The name of a picture in this format.
    pub(crate) fn renamed(self, name: &str) -> String {
        let ending = match self {
            Self::Same => return name.to_owned(),
            Self::Png => "png",
            Self::Jpeg => "jpg",
        };
        Path::new(name).with_extension(ending).display().to_string()
    }
}

/// What a user decides besides the conditions.
#[derive(Debug, Clone)]
pub struct Options {
    /// The folder to write to.
    pub out: PathBuf,
    /// The seed of the run.
    pub seed: u64,
    /// What becomes of labels.
    pub labels: LabelsOption,
    /// Labels of which less than this share is visible are left out.
    pub visible: f64,
    /// The value in masks of what comes from outside of the picture.
    pub outside: u16,
    /// Further folders in which PNG files are masks.
    pub masks: Vec<String>,
    /// The format of pictures.
    pub format: Format,
    /// The quality of JPEG files, 1 to 100.
    pub quality: u8,
    /// Whether a recording is written as pictures with a record beside each, whatever it was.
    pub plain: bool,
    /// How many units are done at a time.
    pub workers: usize,
}
