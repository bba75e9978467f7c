//! The frames that maps are made of: an image, or those of a dataset.

use std::path::Path;

use pdk_core::calls::{self, Function};
use pdk_core::registry::Registry;
use pdk_sdk::describe::Kind;
use pdk_sdk::error::{Error, Result};
use pdk_sdk::prelude::{Dataset, FrameBuf};
use serde_json::Map;

/// An image, or frames of a dataset.
pub enum Frames {
    /// One image with its name.
    Image(String, Box<FrameBuf>),
    /// A dataset, what messages call it, and the frames that are taken.
    Dataset(Box<dyn Dataset>, String, Vec<usize>),
}

impl Frames {
    /// Reads the image, or opens the dataset with the first reader that knows it. Of a dataset `count` frames are taken, spread
    /// evenly over it.
    ///
    /// # Errors
    /// Where it is neither.
    pub fn open(registry: &Registry, path: &Path, count: Option<usize>) -> Result<Self> {
        if !path.is_dir() {
            let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            return Ok(Self::Image(name, Box::new(pdk_image::read(path)?)));
        }
        let mut reasons = Vec::new();
        for entry in registry.catalog().of_kind(Kind::Dataset) {
            let parameters = Map::from_iter([("path".to_owned(), path.to_string_lossy().into())]);
            match registry.dataset(&entry.description.name, &parameters) {
                Ok((dataset, _)) => {
                    let place = format!("dataset `{}`", path.display());
                    let length = calls::call(&place, Function::Len, || dataset.len());
                    if length == 0 {
                        return Err(Error::new(format!(
                            "{place} has no frames; name a folder that has some"
                        )));
                    }
                    let taken = count.unwrap_or(length).clamp(1, length);
                    let places = (0..taken).map(|at| at * length / taken).collect();
                    return Ok(Self::Dataset(dataset, place, places));
                }
                Err(error) => reasons.push(error.to_string()),
            }
        }
        Err(Error::new(match reasons.is_empty() {
            true => format!("cannot open the dataset {}: no dataset reader is installed", path.display()),
            false => format!("cannot open the dataset {}: {}", path.display(), reasons.join("; ")),
        }))
    }

    /// The number of frames.
    pub fn len(&self) -> usize {
        match self {
            Self::Image(..) => 1,
            Self::Dataset(_, _, places) => places.len(),
        }
    }

    /// A frame with its name, which is fit for a file's.
    ///
    /// # Errors
    /// Where it cannot be read.
    pub fn read(&mut self, index: usize) -> Result<(String, FrameBuf)> {
        match self {
            Self::Image(name, frame) => Ok((name.clone(), (**frame).clone())),
            Self::Dataset(dataset, place, places) => {
                let at = places[index];
                let name = calls::call(place, Function::Name, || dataset.name(at));
                let entry = calls::call_at(place, Function::Read, at as u64, || dataset.read(at))?;
                let stem = Path::new(&name).file_stem().unwrap_or_default().to_string_lossy().into_owned();
                Ok((stem, entry.frame))
            }
        }
    }
}
