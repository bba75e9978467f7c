//! A drive in a bag, written again: messages with its pictures and, of mirrored frames, with its steering are others.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use pdk_sdk::prelude::*;
use pdk_video::Encoder;

use crate::bag::Place;
use crate::bag_copy;
use crate::message::Picture;
use crate::topics::Drive;

impl Drive {
    /// How a bag of these files in a folder is written again.
    pub fn form(&self, folder: &Path, files: &[PathBuf], whole: bool) -> Form {
        let frames = |number: usize| self.frames.iter().filter(|frame| frame.place.file == number).count();
        let file = |(number, name): (usize, &PathBuf)| {
            let (name, frames) = (name.to_string_lossy().into_owned(), frames(number));
            let stored = if frames > 0 { self.kind.stored_as() } else { String::new() };
            FormFile { name, frames, stored }
        };
        let mut notes: Vec<String> = Vec::new();
        if !self.others.is_empty() {
            notes.push(format!(
                "pictures of other topics are carried over as they are ({}); `image` of the reader chooses the topic",
                self.others.join(", ")
            ));
        }
        match self.before_keys() {
            0 => {}
            count => notes.push(format!(
                "the first {count} pictures need earlier ones that were not recorded, and are carried over as they are"
            )),
        }
        Form {
            folder: folder.to_owned(),
            files: files.iter().enumerate().map(file).collect(),
            whole,
            unturned: None,
            undropped: Some("they are messages in the files of its pictures".to_owned()),
            notes,
        }
    }

    /// How many frames come before the first with which decoding can begin.
    fn before_keys(&self) -> usize {
        self.frames.iter().position(|frame| frame.begins).unwrap_or(self.frames.len())
    }

    /// Writes a file of the bag again; `number` is its number.
    ///
    /// # Errors
    /// If a picture cannot be read, perturbed or written.
    pub fn rewrite(&mut self, number: usize, wanted: &Rewrite, perturb: &mut Perturb<'_>) -> Result<()> {
        let from = self.bag.file(number)?.to_owned();
        let places = self.frames.iter().enumerate().filter(|(_, frame)| frame.place.file == number);
        let places: BTreeMap<Place, usize> = places.map(|(index, frame)| (frame.place, index)).collect();
        let undecodable = self.before_keys();
        let mut encoder = None;
        let mut perturbed = FrameBuf::default();
        bag_copy::rewrite(number, &from, &wanted.into, &mut |message| {
            let Some(&index) = places.get(&message.place) else {
                return match &self.steering {
                    Some((topic, kind))
                        if topic == message.topic && wanted.mirrors(self.nearest(message.time)) =>
                    {
                        kind.with_other_sign(message.data).map(Some)
                    }
                    _ => Ok(None),
                };
            };
            if index < undecodable {
                return Ok(None);
            }
            let mut work = || {
                let picture = match self.kind {
                    Picture::FoxgloveVideo(stored) => self.video(stored, index)?,
                    kind => kind.decode(message.data)?,
                };
                perturbed.resize(picture.width(), picture.height());
                perturb(index, picture.as_ref(), perturbed.as_mut())?;
                match self.kind {
                    Picture::FoxgloveVideo(_) => {
                        let encoder = match &mut encoder {
                            Some(encoder) => encoder,
                            none => {
                                none.insert(Encoder::new(picture.width(), picture.height(), self.rate(), 0)?)
                            }
                        };
                        if encoder.size() != [picture.width(), picture.height()] {
                            return Err(Error::new("its video changes its size; cut the recording there"));
                        }
                        let units = encoder.encode(perturbed.as_ref(), self.frames[index].begins)?;
                        self.kind.with_data(message.data, &units.to_stream())
                    }
                    kind => kind.with_picture(message.data, perturbed.as_ref(), wanted.quality),
                }
            };
            work().map(Some).map_err(|error| error.at(format_args!("frame {index}")))
        })
    }

    /// The frame that was recorded nearest to a time in nanoseconds.
    fn nearest(&self, time: u64) -> usize {
        let behind = self.frames.partition_point(|frame| frame.logged < time);
        let around = behind.saturating_sub(1)..(behind + 1).min(self.frames.len());
        around.min_by_key(|index| self.frames[*index].logged.abs_diff(time)).unwrap_or_default()
    }

    /// Frames a second, on average.
    fn rate(&self) -> f64 {
        let seconds = self.frames.last().map_or(0.0, |last| last.time);
        match self.frames.len().saturating_sub(1) as f64 / seconds {
            rate if rate.is_finite() && rate > 0.0 => rate.clamp(1.0, 1000.0),
            _ => 30.0,
        }
    }
}
