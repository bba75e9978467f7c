//! Keyed frames of a clip at one size, in a file. Frames are read one at a time, so a long clip takes no memory.
//!
//! The file is: a mark, the frames one after the other, the index as JSON, the index's hash, its length and the mark
//! again. A frame is a byte for each [`BLOCK`] of pixels, 0 if it is transparent, then red, green and blue of all others,
//! premultiplied, then their alpha; all of this compressed with LZ4, which is the fastest to read. A file that was cut off or changed is recognised by the hash, and by the checksums (XXH3) of the frames
//! in the index.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::Path;

use lz4_flex::block::{compress_into, decompress_into, get_maximum_output_size};
use pdk_sdk::ops::overlay;
use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::{self, Value, json};
use twox_hash::XxHash3_64;

const MARK: &[u8; 8] = b"pdkclip2";
/// Pixels that are left out together if all of them are transparent.
const BLOCK: usize = 64;
/// Hash, length and mark at the end.
const TAIL: usize = 32 + 8 + MARK.len();

/// What a store knows of its frames.
#[derive(Debug, Clone, PartialEq)]
pub struct Index {
    pub width: usize,
    pub height: usize,
    /// Frames per second, on average.
    pub rate: f64,
    /// How long each of the clip's own frames is shown, in nanoseconds; empty if they come at a fixed rate.
    pub durations: Vec<u64>,
    /// The clip's own frames; the frames that lead from its end to its beginning follow them.
    pub frames: usize,
    /// Where each frame lies.
    pub places: Vec<Stored>,
    /// The mean alpha of each frame, 0 to 255.
    pub coverage: Vec<f64>,
}

/// Where a compressed frame lies in the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Stored {
    pub offset: u64,
    pub length: u64,
    /// XXH3 of its bytes.
    pub checksum: u64,
}

/// One frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Layer {
    /// Red, green and blue of all pixels, premultiplied, then alpha of all pixels.
    data: Vec<u8>,
}

impl Layer {
    /// Red, green and blue of all pixels, then the alpha of all pixels.
    pub fn planes(&self) -> (&[u8], &[u8]) {
        self.data.split_at(self.data.len() / 4 * 3)
    }

    /// Becomes a mixture of two frames of the same size: `weight` 256ths of the second.
    pub fn mix(&mut self, first: &Self, second: &Self, weight: u16) {
        self.data.resize(first.data.len(), 0);
        overlay::mix(&first.data, &second.data, weight, &mut self.data);
    }
}

/// Writes a store.
pub struct Writer {
    file: File,
    index: Index,
    position: u64,
    data: Vec<u8>,
    compressed: Vec<u8>,
}

impl Writer {
    /// Begins a store in an empty file that can be read and written.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn new(mut file: File, width: usize, height: usize) -> Result<Self> {
        file.write_all(MARK)?;
        let index = Index {
            width,
            height,
            rate: 0.0,
            durations: Vec::new(),
            frames: 0,
            places: Vec::new(),
            coverage: Vec::new(),
        };
        let position = MARK.len() as u64;
        Ok(Self { file, index, position, data: Vec::new(), compressed: Vec::new() })
    }

    /// Adds a frame.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn push(&mut self, colours: &[u8], alphas: &[u8]) -> Result<()> {
        pack(colours, alphas, &mut self.data);
        self.compressed.resize(get_maximum_output_size(self.data.len()), 0);
        let length = compress_into(&self.data, &mut self.compressed).map_err(|error| error.to_string())?;
        let compressed = &self.compressed[..length];
        self.file.write_all(compressed)?;
        let stored = Stored {
            offset: self.position,
            length: length as u64,
            checksum: XxHash3_64::oneshot(compressed),
        };
        self.index.places.push(stored);
        self.position += stored.length;
        let sum: u64 = alphas.iter().map(|&alpha| u64::from(alpha)).sum();
        self.index.coverage.push(sum as f64 / alphas.len() as f64);
        Ok(())
    }

    /// Reads a frame that was added.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn read(&mut self, frame: usize, layer: &mut Layer) -> Result<()> {
        read_layer(&mut self.file, &self.index, frame, [&mut self.compressed, &mut self.data], layer)?;
        self.file.seek(SeekFrom::Start(self.position))?;
        Ok(())
    }

    /// Writes the index. Of all frames added, the first `frames` are the clip's own; `durations` as in the [`Index`].
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn finish(mut self, rate: f64, durations: Vec<u64>, frames: usize) -> Result<()> {
        (self.index.rate, self.index.durations, self.index.frames) = (rate, durations, frames);
        let index = serde_json::to_vec(&to_json(&self.index))?;
        self.file.write_all(&index)?;
        self.file.write_all(blake3::hash(&index).as_bytes())?;
        self.file.write_all(&(index.len() as u64).to_le_bytes())?;
        self.file.write_all(MARK)?;
        Ok(())
    }
}

/// Reads a store.
pub struct Store {
    file: File,
    index: Index,
    compressed: Vec<u8>,
    packed: Vec<u8>,
}

impl Store {
    /// Opens a store.
    ///
    /// # Errors
    /// If the file does not exist, or is not a whole store.
    pub fn open(path: &Path) -> Result<Self> {
        let mut file = File::open(path)?;
        let index = read_index(&mut file)?;
        let largest = index.places.iter().map(|stored| stored.length).max().unwrap_or_default();
        Ok(Self { file, index, compressed: Vec::with_capacity(largest as usize), packed: Vec::new() })
    }

    /// What is known of the frames.
    pub fn index(&self) -> &Index {
        &self.index
    }

    /// Reads a frame.
    ///
    /// # Errors
    /// If the file was changed since it was opened.
    pub fn read(&mut self, frame: usize, layer: &mut Layer) -> Result<()> {
        read_layer(&mut self.file, &self.index, frame, [&mut self.compressed, &mut self.packed], layer)
    }
}

fn read_layer(
    file: &mut File,
    index: &Index,
    frame: usize,
    [compressed, packed]: [&mut Vec<u8>; 2],
    layer: &mut Layer,
) -> Result<()> {
    let damaged = || Error::new("the cached clip is damaged");
    let stored = index.places.get(frame).ok_or_else(damaged)?;
    compressed.resize(stored.length as usize, 0);
    file.seek(SeekFrom::Start(stored.offset))?;
    file.read_exact(compressed)?;
    if XxHash3_64::oneshot(compressed) != stored.checksum {
        return Err(damaged());
    }
    let pixels = index.width * index.height;
    packed.resize(pixels.div_ceil(BLOCK) + 4 * pixels, 0);
    let written = decompress_into(compressed, packed).map_err(|_| damaged())?;
    layer.data.clear();
    layer.data.resize(4 * pixels, 0);
    let (colours, alphas) = layer.data.split_at_mut(3 * pixels);
    unpack(&packed[..written], colours, alphas).ok_or_else(damaged)
}

/// Leaves out what is transparent.
fn pack(colours: &[u8], alphas: &[u8], packed: &mut Vec<u8>) {
    packed.clear();
    packed.extend(alphas.chunks(BLOCK).map(|block| u8::from(block.iter().any(|&alpha| alpha != 0))));
    for (plane, size) in [(colours, 3 * BLOCK), (alphas, BLOCK)] {
        for (block, part) in plane.chunks(size).enumerate() {
            if packed[block] != 0 {
                packed.extend_from_slice(part);
            }
        }
    }
}

/// Puts what was packed into planes of zeros; nothing if it does not fit them.
fn unpack(packed: &[u8], colours: &mut [u8], alphas: &mut [u8]) -> Option<()> {
    let (shown, mut rest) = packed.split_at_checked(alphas.len().div_ceil(BLOCK))?;
    for (plane, size) in [(colours, 3 * BLOCK), (alphas, BLOCK)] {
        for (part, _) in plane.chunks_mut(size).zip(shown).filter(|(_, shown)| **shown != 0) {
            let (from, after) = rest.split_at_checked(part.len())?;
            part.copy_from_slice(from);
            rest = after;
        }
    }
    rest.is_empty().then_some(())
}

fn read_index(file: &mut File) -> Result<Index> {
    let damaged = || Error::new("the cached clip is damaged");
    let length = file.metadata()?.len();
    let tail_at = length.checked_sub(TAIL as u64).ok_or_else(damaged)?;
    let mut tail = [0; TAIL];
    file.seek(SeekFrom::Start(tail_at))?;
    file.read_exact(&mut tail)?;
    let (hash, rest) = tail.split_at(32);
    let (index_length, mark) = rest.split_at(8);
    let index_length = u64::from_le_bytes(index_length.try_into().map_err(|_| damaged())?);
    let index_at = tail_at.checked_sub(index_length).ok_or_else(damaged)?;
    if mark != MARK {
        return Err(damaged());
    }
    let mut bytes = vec![0; index_length as usize];
    file.seek(SeekFrom::Start(index_at))?;
    file.read_exact(&mut bytes)?;
    if blake3::hash(&bytes).as_bytes() != hash {
        return Err(damaged());
    }
    let index = from_json(&serde_json::from_slice(&bytes)?).ok_or_else(damaged)?;
    // Nothing lies outside of the file, so that nothing is reserved for what is not there.
    let inside = |at: &Stored| at.offset.checked_add(at.length).is_some_and(|end| end <= index_at);
    let fits = index.width.checked_mul(index.height).and_then(|pixels| pixels.checked_mul(5)).is_some();
    if fits && index.places.iter().all(inside) { Ok(index) } else { Err(damaged()) }
}

fn to_json(index: &Index) -> Value {
    json!({
        "width": index.width,
        "height": index.height,
        "rate": index.rate,
        "durations": index.durations,
        "frames": index.frames,
        "places": index.places.iter().map(|at| json!([at.offset, at.length, at.checksum])).collect::<Vec<_>>(),
        "coverage": index.coverage,
    })
}

fn from_json(value: &Value) -> Option<Index> {
    let size = |name: &str| Some(value[name].as_u64()? as usize);
    let place = |place: &Value| {
        let [offset, length, checksum] = [0, 1, 2].map(|at| place[at].as_u64());
        Some(Stored { offset: offset?, length: length?, checksum: checksum? })
    };
    let index = Index {
        width: size("width")?,
        height: size("height")?,
        rate: value["rate"].as_f64()?,
        durations: value["durations"].as_array()?.iter().map(Value::as_u64).collect::<Option<_>>()?,
        frames: size("frames")?,
        places: value["places"].as_array()?.iter().map(place).collect::<Option<_>>()?,
        coverage: value["coverage"].as_array()?.iter().map(Value::as_f64).collect::<Option<_>>()?,
    };
    let whole = index.frames > 0
        && index.frames <= index.places.len()
        && index.places.len() - index.frames < index.frames
        && index.coverage.len() == index.places.len()
        && (index.durations.is_empty() || index.durations.len() == index.frames);
    whole.then_some(index)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(path: &Path) -> Vec<Vec<u8>> {
        let file = File::options().read(true).write(true).create_new(true).open(path).unwrap();
        let mut writer = Writer::new(file, 8, 4).unwrap();
        let frames: Vec<Vec<u8>> = (0..3u8).map(|f| (0..128).map(|i| f.wrapping_mul(i)).collect()).collect();
        for (i, frame) in frames.iter().enumerate() {
            writer.push(&frame[..96], &frame[96..]).unwrap();
            let mut layer = Layer::default();
            writer.read(i, &mut layer).unwrap();
            assert_eq!(&layer.data, frame);
        }
        writer.finish(25.0, vec![30_000_000, 50_000_000], 2).unwrap();
        frames
    }

    #[test]
    fn frames_are_read_in_any_order_as_they_were_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        let frames = written(&path);
        let mut store = Store::open(&path).unwrap();
        let index = store.index().clone();
        assert_eq!((index.width, index.height, index.rate, index.frames), (8, 4, 25.0, 2));
        assert_eq!((index.coverage[0], &index.durations[..]), (0.0, &[30_000_000, 50_000_000][..]));
        let mut layer = Layer::default();
        for i in [2, 0, 1, 1] {
            store.read(i, &mut layer).unwrap();
            assert_eq!(layer.planes(), frames[i].split_at(96));
        }
        assert!(store.read(3, &mut layer).is_err());
    }

    #[test]
    fn an_index_that_points_out_of_the_file_is_recognised() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        written(&path);
        let whole = std::fs::read(&path).unwrap();
        let index = Store::open(&path).unwrap().index().clone();
        let with = |change: &dyn Fn(&mut Index)| {
            let (mut index, mut bytes) = (index.clone(), whole.clone());
            change(&mut index);
            let json = serde_json::to_vec(&to_json(&index)).unwrap();
            bytes.extend_from_slice(&json);
            bytes.extend_from_slice(blake3::hash(&json).as_bytes());
            bytes.extend_from_slice(&(json.len() as u64).to_le_bytes());
            bytes.extend_from_slice(MARK);
            let path = folder.path().join("b");
            std::fs::write(&path, bytes).unwrap();
            Store::open(&path).is_ok()
        };
        assert!(with(&|_| ()));
        assert!(!with(&|index| index.places[0].length = u64::MAX));
        assert!(!with(&|index| index.places[1].length = 1 << 45));
        assert!(!with(&|index| (index.width, index.height) = (1 << 40, 1 << 40)));
        // More that lead from the end to the beginning than there are frames.
        assert!(!with(&|index| (index.frames, index.durations) = (1, Vec::new())));
    }

    #[test]
    fn what_is_transparent_takes_no_room_and_comes_back() {
        for pixels in [1, 63, 64, 200, 1000] {
            let alphas: Vec<u8> = (0..pixels).map(|at| if at / 90 % 2 == 0 { 0 } else { 7 }).collect();
            let colours: Vec<u8> = alphas.iter().flat_map(|&alpha| [alpha, alpha / 2, 0]).collect();
            let mut packed = Vec::new();
            pack(&colours, &alphas, &mut packed);
            assert!(pixels < 200 || packed.len() < 4 * pixels);
            let (mut found, mut opaque) = (vec![0; 3 * pixels], vec![0; pixels]);
            unpack(&packed, &mut found, &mut opaque).unwrap();
            assert_eq!((found, opaque), (colours, alphas));
            // One that is too short or too long is of another size.
            for wrong in [&packed[..packed.len() - 1], &[&packed[..], &[1]].concat()] {
                assert!(unpack(wrong, &mut vec![0; 3 * pixels], &mut vec![0; pixels]).is_none());
            }
        }
    }

    #[test]
    fn a_file_that_was_cut_off_or_changed_anywhere_is_recognised() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        let frames = written(&path);
        let whole = std::fs::read(&path).unwrap();
        let intact = |bytes: &[u8]| {
            let path = folder.path().join("b");
            std::fs::write(&path, bytes).unwrap();
            let mut layer = Layer::default();
            let Ok(mut store) = Store::open(&path) else { return false };
            (0..3).all(|i| {
                let read = store.read(i, &mut layer).is_ok();
                assert!(!read || layer.data == frames[i]);
                read
            })
        };
        assert!(intact(&whole));
        for length in 0..whole.len() {
            assert!(!intact(&whole[..length]), "cut at {length}");
        }
        for at in MARK.len()..whole.len() {
            let mut changed = whole.clone();
            changed[at] ^= 0x10;
            assert!(!intact(&changed), "changed at {at}");
        }
    }
}
