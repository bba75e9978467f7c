//! The frames that maps are made of: an image, those of a folder, of a run's record, or of a dataset.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use pdk_components::registry::Registry;
use pdk_model::component::ComponentSpec;
use pdk_pipeline::readers;
use pdk_sdk::error::{Error, Place, Result};
use pdk_sdk::prelude::Dataset;
use pdk_supervise::calls::{self, Function};

use super::recorded::Recorded;
use super::shown::Shown;

/// How the names of images end, and those of the files that make a dataset of a folder.
pub const IMAGES: [&str; 5] = ["jpg", "jpeg", "png", "bmp", "webp"];
const RECORDS: [&str; 3] = ["json", "csv", "catalog"];

/// Images, or frames of a record or a dataset.
pub enum Frames {
    /// Image files, with the names of their frames.
    Images(Vec<(String, PathBuf)>),
    /// The frames of a record, and which of them are taken.
    Record(Box<Recorded>, Vec<usize>),
    /// A dataset, what messages call it, and the frames that are taken, with their names.
    Dataset(Box<dyn Dataset>, String, Vec<(String, usize)>),
}

impl Frames {
    /// Takes the image, or the frames of a run's record, or the images of a folder that is not a dataset, or opens the dataset with the first
    /// reader that knows it. Of a folder `count` frames are taken, spread evenly over it.
    ///
    /// # Errors
    /// If it is none of these.
    pub fn open(registry: &Registry, path: &Path, count: Option<usize>) -> Result<Self> {
        if !path.is_dir() {
            return Ok(Self::Images(named(vec![path.to_owned()])));
        }
        if Recorded::is_one(path) {
            let record = Recorded::open(path)?;
            let taken = spread(record.len(), count);
            return Ok(Self::Record(Box::new(record), taken));
        }
        let images = images(path)?;
        if !images.is_empty() {
            let taken = spread(images.len(), count).into_iter().map(|at| images[at].clone());
            return Ok(Self::Images(named(taken.collect())));
        }
        let text = path.to_string_lossy();
        let make = |reader: &ComponentSpec| Ok(registry.dataset(&reader.name, &reader.parameters)?.0);
        let (_, dataset) = readers::open(registry.catalog(), &text, make)?;
        let place = format!("dataset `{}`", path.display());
        let length = calls::call(&place, Function::Len, || dataset.len());
        if length == 0 {
            return Err(Error::new(format!("{place} has no frames; name a folder that has some")));
        }
        let places = spread(length, count);
        let name = |at: &usize| calls::call(&place, Function::Name, || dataset.name(*at));
        let names = told_apart(&places.iter().map(name).collect::<Vec<String>>());
        Ok(Self::Dataset(dataset, place, names.into_iter().zip(places).collect()))
    }

    /// The number of frames.
    pub fn len(&self) -> usize {
        match self {
            Self::Images(images) => images.len(),
            Self::Record(_, places) => places.len(),
            Self::Dataset(_, _, frames) => frames.len(),
        }
    }

    /// A frame.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn read(&mut self, index: usize) -> Result<Shown> {
        match self {
            Self::Images(images) => {
                let (name, path) = &images[index];
                Ok(Shown::image(name.clone(), pdk_image::read(path)?))
            }
            Self::Record(record, places) => record.read(places[index]),
            Self::Dataset(dataset, place, frames) => {
                let (name, at) = frames[index].clone();
                let entry = calls::call_at(place, Function::Read, at as u64, || dataset.read(at))?;
                // What was not recorded is not a number.
                let speed = entry.speed.is_finite().then_some(entry.speed);
                Ok(Shown { speed, ..Shown::image(name, entry.frame) })
            }
        }
    }
}

/// The images in a folder, in the order of their names; none if there are also records, which make it a dataset.
fn images(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut images = Vec::new();
    let place = || format!("cannot list the folder {}", folder.display());
    for entry in std::fs::read_dir(folder).place(place())? {
        let path = entry.place(place())?.path();
        let ending = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        if RECORDS.contains(&ending.as_str()) {
            return Ok(Vec::new());
        }
        if IMAGES.contains(&ending.as_str()) && path.is_file() {
            images.push(path);
        }
    }
    images.sort();
    Ok(images)
}

/// Images with the names of their frames.
fn named(paths: Vec<PathBuf>) -> Vec<(String, PathBuf)> {
    let files = paths.iter().map(|path| path.file_name().unwrap_or_default().to_string_lossy().into_owned());
    told_apart(&files.collect::<Vec<_>>()).into_iter().zip(paths).collect()
}

/// What maps of these files are called, none like another one: the files' names without their endings if that tells them apart, or else with the folders
/// that they lie in, or else with their endings as well.
fn told_apart(files: &[String]) -> Vec<String> {
    let joined = |path: &Path| path.to_string_lossy().replace('/', "-");
    let forms: [&dyn Fn(&String) -> String; 3] = [
        &|file| Path::new(file).file_stem().unwrap_or_default().to_string_lossy().into_owned(),
        &|file| joined(&Path::new(file).with_extension("")),
        &|file| joined(Path::new(file)),
    ];
    let all = forms.map(|form| files.iter().map(form).collect::<Vec<_>>());
    let mut counts = [(); 3].map(|()| HashMap::<&str, usize>::new());
    for (names, counts) in all.iter().zip(&mut counts) {
        names.iter().for_each(|name| *counts.entry(name).or_default() += 1);
    }
    let name = |file: usize| {
        let unique = (0..2).find(|form| counts[*form][all[*form][file].as_str()] == 1);
        all[unique.unwrap_or(2)][file].clone()
    };
    (0..files.len()).map(name).collect()
}

/// This many places of `length`, spread evenly.
fn spread(length: usize, count: Option<usize>) -> Vec<usize> {
    let taken = count.unwrap_or(length).clamp(1, length);
    (0..taken).map(|at| at * length / taken).collect()
}

#[cfg(test)]
mod tests {
    use pdk_sdk::prelude::{Entry, FrameBuf};

    use super::*;

    /// A recording of one frame, with this speed.
    struct Recording(f64);

    impl Dataset for Recording {
        fn len(&self) -> usize {
            1
        }

        fn name(&self, _index: usize) -> String {
            "0.png".to_owned()
        }

        fn read(&mut self, _index: usize) -> Result<Entry> {
            Ok(Entry { frame: FrameBuf::new(4, 3), speed: self.0, ..Entry::default() })
        }
    }

    #[test]
    fn a_frame_of_a_dataset_has_the_speed_that_was_recorded() {
        let speed = |recorded| {
            let frames = vec![("0".to_owned(), 0)];
            let mut frames = Frames::Dataset(Box::new(Recording(recorded)), "dataset".to_owned(), frames);
            frames.read(0).unwrap().speed
        };
        assert_eq!((speed(7.9), speed(f64::NAN)), (Some(7.9), None));
    }

    #[test]
    fn a_folder_of_images_is_one_only_without_records() {
        let dir = tempfile::tempdir().unwrap();
        for name in ["b.png", "a.JPG", "a.png", "notes.txt"] {
            std::fs::write(dir.path().join(name), b"").unwrap();
        }
        let found = named(images(dir.path()).unwrap());
        let names: Vec<_> = found.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(names, ["a.JPG", "a.png", "b"]);
        std::fs::write(dir.path().join("record_1.json"), b"{}").unwrap();
        assert!(images(dir.path()).unwrap().is_empty());
        let files = ["stop/0.jpg", "limit/0.jpg", "limit/1.jpg", "limit/1.png", "2.png"].map(str::to_owned);
        assert_eq!(told_apart(&files), ["stop-0", "limit-0", "limit-1.jpg", "limit-1.png", "2"]);
        assert_eq!(spread(10, Some(3)), [0, 3, 6]);
        assert_eq!((spread(2, Some(9)), spread(2, None)), (vec![0, 1], vec![0, 1]));
    }
}
