//! The boxes of an MP4 file: which there are and where. Their sizes are not believed before they have been compared with the room that
//! there is.

use std::io::{Read, Seek, SeekFrom};

use mp4_atom::Atom;
use pdk_sdk::prelude::*;

/// Said of a file of which a part is missing.
pub const CUT_OFF: &str = "it is cut off: its frames or their index are missing in part; copy it again";

/// More boxes than this beside each other are not believed. A file in fragments has two for each.
const MOST: usize = 1 << 20;
/// Bytes of an index: that of millions of frames.
const LARGEST: u64 = 1 << 27;

/// A box of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Outermost {
    /// What it is.
    pub name: [u8; 4],
    /// Where it begins.
    pub at: u64,
    /// The length of its header.
    header: u64,
    /// Its length with the header.
    length: u64,
}

/// The boxes of a file of `size` bytes, which follow each other without gaps.
///
/// # Errors
/// If they do not fill the file.
pub fn outermost(input: &mut (impl Read + Seek), size: u64) -> Result<Vec<Outermost>> {
    let (mut boxes, mut at) = (Vec::new(), 0);
    while at < size {
        if size - at < 8 {
            return Err(Error::new(CUT_OFF));
        }
        let mut head = [0; 16];
        let long = (size - at).min(16) as usize;
        input.seek(SeekFrom::Start(at))?;
        input.read_exact(&mut head[..long])?;
        let [a, b, c, d, name @ ..] = head;
        let name = [name[0], name[1], name[2], name[3]];
        let (header, length) = match u32::from_be_bytes([a, b, c, d]) {
            // The last box of a file may go on to its end without saying how long it is.
            0 => (8, size - at),
            1 if long == 16 => (16, u64::from_be_bytes([8, 9, 10, 11, 12, 13, 14, 15].map(|i| head[i]))),
            length => (8, u64::from(length)),
        };
        if length < header || length > size - at {
            return Err(Error::new(CUT_OFF));
        }
        boxes.push(Outermost { name, at, header, length });
        if boxes.len() > MOST {
            return Err(Error::new("it is damaged: it consists of a million boxes; copy it again"));
        }
        at += length;
    }
    Ok(boxes)
}

impl Outermost {
    /// What the box holds.
    ///
    /// # Errors
    /// If it is too large for an index, or cannot be read.
    pub fn read(&self, input: &mut (impl Read + Seek)) -> Result<Vec<u8>> {
        let length = self.length - self.header;
        if length > LARGEST {
            return Err(Error::new(format!(
                "its index has more than {} MiB; cut the video into parts",
                LARGEST >> 20
            )));
        }
        let mut bytes = vec![0; length as usize];
        input.seek(SeekFrom::Start(self.at + self.header))?;
        input.read_exact(&mut bytes)?;
        Ok(bytes)
    }
}

/// What a box holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Content<'a>(pub &'a [u8]);

/// A box is not built as it has to be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Misbuilt;

impl<'a> Content<'a> {
    /// The boxes in it, by name.
    pub fn boxes(self) -> Result<Vec<([u8; 4], Content<'a>)>, Misbuilt> {
        let (mut boxes, mut rest) = (Vec::new(), self.0);
        // QuickTime ends some lists with a zero in place of a box.
        while rest.iter().any(|byte| *byte != 0) {
            let (head, behind) = rest.split_first_chunk::<8>().ok_or(Misbuilt)?;
            let [a, b, c, d, name @ ..] = *head;
            let (header, length) = match u32::from_be_bytes([a, b, c, d]) {
                1 => (16, u64::from_be_bytes(*behind.first_chunk().ok_or(Misbuilt)?)),
                length => (8, u64::from(length)),
            };
            let length = usize::try_from(length).map_err(|_| Misbuilt)?;
            let content = rest.get(header..length).ok_or(Misbuilt)?;
            boxes.push((name, Content(content)));
            rest = &rest[length..];
        }
        Ok(boxes)
    }

    /// The first box of a name in it; none if there is none.
    pub fn find(self, name: &[u8; 4]) -> Result<Option<Content<'a>>, Misbuilt> {
        Ok(self.boxes()?.into_iter().find(|(found, _)| found == name).map(|(_, content)| content))
    }

    /// The box to which a path of names leads; none if there is none.
    pub fn reach(self, path: &[&[u8; 4]]) -> Result<Option<Content<'a>>, Misbuilt> {
        let mut here = self;
        for name in path {
            match here.find(name)? {
                Some(found) => here = found,
                None => return Ok(None),
            }
        }
        Ok(Some(here))
    }

    /// What it says, as a box of this sort.
    pub fn as_a<T: Atom>(self) -> Result<T, Misbuilt> {
        T::decode_body(&mut { self.0 }).map_err(|_| Misbuilt)
    }
}
