//! The index of an MP4 file: where its frames lie and when they are shown. It is compared with the file before it is believed.

use std::io::{Read, Seek};

use mp4_atom::{Avcc, Co64, Ctts, Elst, Mdhd, Mvhd, Stco, Stsc, Stss, Stsz, StszSamples, Stts, Tkhd};
use pdk_sdk::prelude::*;

use crate::boxes::{CUT_OFF, Content, Misbuilt, outermost};
use crate::fragments;
use crate::sample::{Left, Sample, within};
use crate::timing::{Moment, Timing, few_enough};
use crate::turn::quarter_turns;

/// Profiles that the decoder knows: Baseline, Main, Extended and High. The others have more bits or more chroma.
const PROFILES: [u8; 4] = [66, 77, 88, 100];
/// Bytes of a picture's description before the boxes in it.
const VISUAL: usize = 78;

/// What became of reading an index.
pub enum Indexed {
    /// The frames can be decoded here.
    Own(Box<Index>),
    /// It is a video that the built-in reader leaves to others; the sentence part says what it is.
    Other(String),
}

/// The index of a video with H.264.
pub struct Index {
    /// Where each frame lies, in the order of decoding.
    pub samples: Vec<Sample>,
    /// When each frame is shown.
    pub timing: Timing,
    /// Parameter sets of the stream.
    pub parameters: Vec<Vec<u8>>,
    /// Bytes before each unit that hold its length.
    pub length_size: usize,
    /// How many quarters the pictures are turned to the right.
    pub quarters: u8,
    /// Whether the file has sound.
    pub has_sound: bool,
}

/// Reads the index of a file of `size` bytes.
///
/// # Errors
/// If it is not an MP4 file, is cut off or damaged, or has no video.
pub fn index(input: &mut (impl Read + Seek), size: u64) -> Result<Indexed> {
    match read(input, size) {
        Ok(index) => Ok(Indexed::Own(Box::new(index))),
        Err(Left::Other(what)) => Ok(Indexed::Other(what)),
        Err(Left::Broken(error)) => Err(error),
    }
}

fn read(input: &mut (impl Read + Seek), size: u64) -> Result<Index, Left> {
    let boxes = outermost(input, size)?;
    let movie = boxes.iter().find(|found| &found.name == b"moov").ok_or_else(|| Error::new(CUT_OFF))?;
    let movie = movie.read(input)?;
    let movie = Content(&movie);
    let (mut video, mut has_sound) = (None, false);
    for (name, track) in movie.boxes()? {
        if &name != b"trak" {
            continue;
        }
        match track.reach(&[b"mdia", b"hdlr"])?.and_then(|handler| handler.0.get(8..12)) {
            Some(b"vide") if video.is_none() => video = Some(track),
            Some(b"soun") => has_sound = true,
            _ => {}
        }
    }
    let track = video.ok_or_else(|| Error::new("it has no video track"))?;
    let tables = needed(track.reach(&[b"mdia", b"minf", b"stbl"])?)?;
    let sets = h264(needed(tables.find(b"stsd")?)?)?;
    let header: Tkhd = needed(track.find(b"tkhd")?)?.as_a()?;
    let whole: Mvhd = needed(movie.find(b"mvhd")?)?.as_a()?;
    let scale = needed(track.reach(&[b"mdia", b"mdhd"])?)?.as_a::<Mdhd>()?.timescale.max(1);

    let (samples, moments) = match movie.find(b"mvex")? {
        Some(defaults) => fragments::read(input, &boxes, defaults, header.track_id, size)?,
        None => listed(tables, size)?,
    };
    if samples.is_empty() {
        return Err(Error::new("it has no frames").into());
    }
    let edits = match track.reach(&[b"edts", b"elst"])? {
        Some(list) => list.as_a::<Elst>()?.entries,
        None => Vec::new(),
    };
    let timing = Timing::new(moments, scale, &edits, whole.timescale)?;
    if timing.time(timing.count()) <= 0.0 {
        return Err(Error::new("its frames are shown for no time at all").into());
    }
    let turns = [&header.matrix, &whole.matrix].map(|m| quarter_turns([m.a, m.b, m.u, m.c, m.d, m.v]));
    let [Some(own), Some(all)] = turns else {
        return Err(Left::Other(
            "an MP4 file whose pictures are to be mirrored, scaled or turned by other than quarter turns"
                .to_owned(),
        ));
    };
    let parameters = sets.sequence_parameter_sets.into_iter().chain(sets.picture_parameter_sets).collect();
    Ok(Index {
        samples,
        timing,
        parameters,
        length_size: usize::from(sets.length_size),
        quarters: own + all,
        has_sound,
    })
}

/// A box without which there is no index.
fn needed<T>(found: Option<T>) -> Result<T, Misbuilt> {
    found.ok_or(Misbuilt)
}

/// How the frames are encoded, if that is H.264 that the decoder knows.
fn h264(description: Content<'_>) -> Result<Avcc, Left> {
    let (count, entries) =
        description.0.get(4..).and_then(|content| content.split_first_chunk::<4>()).ok_or(Misbuilt)?;
    let entries = Content(entries).boxes()?;
    let ([(name, entry)], 1) = (&entries[..], u32::from_be_bytes(*count)) else {
        return Err(Left::Other("an MP4 file whose frames are encoded in several ways".to_owned()));
    };
    if !matches!(name, b"avc1" | b"avc3") {
        return Err(Left::Other(match name {
            b"hvc1" | b"hev1" => "H.265".to_owned(),
            b"vp09" => "VP9".to_owned(),
            b"av01" => "AV1".to_owned(),
            _ => "another codec than H.264".to_owned(),
        }));
    }
    let boxes = Content(entry.0.get(VISUAL..).ok_or(Misbuilt)?);
    let sets: Avcc = needed(boxes.find(b"avcC")?)?.as_a()?;
    let profile = sets.avc_profile_indication;
    match PROFILES.contains(&profile) {
        true => Ok(sets),
        false => Err(Left::Other(format!(
            "H.264 in profile {profile} with more than 8 bits or more than 4:2:0 chroma"
        ))),
    }
}

/// The frames of a file that is not in fragments, from its tables.
fn listed(tables: Content<'_>, size: u64) -> Result<(Vec<Sample>, Vec<Moment>), Left> {
    let sizes = needed(tables.find(b"stsz")?)?.as_a::<Stsz>()?.samples;
    let (count, largest, together) = match &sizes {
        StszSamples::Identical { count, size } => (*count, *size, u64::from(*count) * u64::from(*size)),
        StszSamples::Different { sizes } => (
            u32::try_from(sizes.len()).map_err(|_| Misbuilt)?,
            sizes.iter().copied().max().unwrap_or_default(),
            0,
        ),
    };
    if together > size || u64::from(largest) > size {
        return Err(Error::new(format!(
            "it is damaged: its index claims {count} frames, of up to {largest} bytes each, in a file of {size} bytes; copy \
             it again"
        ))
        .into());
    }
    few_enough(count)?;
    let chunks: Stsc = needed(tables.find(b"stsc")?)?.as_a()?;
    let times: Stts = needed(tables.find(b"stts")?)?.as_a()?;
    let placed = chunks.entries.iter().all(|entry| entry.samples_per_chunk > 0 && entry.first_chunk > 0);
    let shown: u64 = times.entries.iter().map(|entry| u64::from(entry.sample_count)).sum();
    let places: Vec<u64> = match (tables.find(b"stco")?, tables.find(b"co64")?) {
        (Some(places), _) => places.as_a::<Stco>()?.entries.into_iter().map(u64::from).collect(),
        (None, places) => needed(places)?.as_a::<Co64>()?.entries,
    };
    let damaged = || {
        Error::new(format!(
            "it is damaged: its index does not say of all {count} frames where they lie and when they are shown; copy it \
             again"
        ))
    };
    if !placed || shown < u64::from(count) {
        return Err(damaged().into());
    }
    let alone = match tables.find(b"stss")? {
        Some(alone) => Some(alone.as_a::<Stss>()?.entries),
        None => None,
    };

    let mut samples = Vec::with_capacity(count as usize);
    let mut entries = chunks.entries.iter().peekable();
    let mut per_chunk = 0;
    for (chunk, place) in (1u32..).zip(places) {
        while let Some(entry) = entries.next_if(|entry| entry.first_chunk <= chunk) {
            per_chunk = entry.samples_per_chunk;
        }
        let mut at = place;
        for _ in 0..per_chunk {
            if samples.len() == count as usize {
                break;
            }
            let length = match &sizes {
                StszSamples::Identical { size, .. } => *size,
                StszSamples::Different { sizes } => sizes[samples.len()],
            };
            samples.push(Sample { at, length, alone: alone.is_none() });
            at = at.saturating_add(u64::from(length));
        }
    }
    if samples.len() < count as usize {
        return Err(damaged().into());
    }
    for number in alone.into_iter().flatten() {
        if let Some(sample) = (number as usize).checked_sub(1).and_then(|place| samples.get_mut(place)) {
            sample.alone = true;
        }
    }
    within(&samples, size)?;

    let offsets = match tables.find(b"ctts")? {
        Some(offsets) => offsets.as_a::<Ctts>()?.entries,
        None => Vec::new(),
    };
    let offsets = offsets
        .iter()
        .flat_map(|entry| std::iter::repeat_n(entry.sample_offset, entry.sample_count as usize));
    let durations = times
        .entries
        .iter()
        .flat_map(|entry| std::iter::repeat_n(entry.sample_delta, entry.sample_count as usize));
    let mut decoded = 0;
    let moments =
        durations.zip(offsets.chain(std::iter::repeat(0))).take(count as usize).map(|(duration, offset)| {
            let begins = decoded + offset;
            decoded += i64::from(duration);
            Moment { begins, duration }
        });
    let moments = moments.collect();
    Ok((samples, moments))
}

#[cfg(test)]
mod tests {
    use std::path::{Path, PathBuf};

    use pdk_sdk::prelude::*;

    use crate::{Reader, Writer};

    fn clip(folder: &Path) -> (PathBuf, Vec<u8>) {
        let path = folder.join("clip.mp4");
        let mut writer = Writer::create(&path, 64, 48, 25.0).unwrap();
        for _ in 0..3 {
            writer.push(FrameBuf::new(64, 48).as_ref()).unwrap();
        }
        writer.finish().unwrap();
        let bytes = std::fs::read(&path).unwrap();
        (path, bytes)
    }

    /// Where a number of a table lies: `skip` bytes behind the table's name, version and flags.
    fn place(bytes: &[u8], table: &[u8; 4], skip: usize) -> std::ops::Range<usize> {
        let at = bytes.windows(4).rposition(|window| window == table).unwrap() + 8 + skip;
        at..at + 4
    }

    fn refusal(path: &Path) -> String {
        match Reader::open_file(path) {
            Err(error) => error.to_string(),
            Ok(_) => panic!("{} was opened", path.display()),
        }
    }

    #[test]
    fn more_frames_than_a_file_has_bytes_are_not_believed() {
        let folder = tempfile::tempdir().unwrap();
        let (path, whole) = clip(folder.path());
        // All of one size, so that the file need not list them; and their number.
        let mut many = whole.clone();
        many[place(&whole, b"stsz", 0)].copy_from_slice(&1u32.to_be_bytes());
        many[place(&whole, b"stsz", 4)].copy_from_slice(&u32::MAX.to_be_bytes());
        std::fs::write(&path, &many).unwrap();
        let expected = format!(
            "it is damaged: its index claims 4294967295 frames, of up to 1 bytes each, in a file of {} bytes; copy it again",
            whole.len()
        );
        assert_eq!(refusal(&path), expected);
        // One frame that is larger than the file.
        let mut large = whole.clone();
        large[place(&whole, b"stsz", 12)].copy_from_slice(&u32::MAX.to_be_bytes());
        std::fs::write(&path, &large).unwrap();
        assert!(refusal(&path).contains("3 frames, of up to 4294967295 bytes each"), "{}", refusal(&path));
    }

    #[test]
    fn what_is_not_needed_of_an_index_is_not_read() {
        let folder = tempfile::tempdir().unwrap();
        let (path, whole) = clip(folder.path());
        // The list of places of the data: very many, of which the first takes no bytes.
        let mut circle = whole.clone();
        circle[place(&whole, b"dref", 0)].copy_from_slice(&u32::MAX.to_be_bytes());
        circle[place(&whole, b"dref", 4)].copy_from_slice(&0u32.to_be_bytes());
        std::fs::write(&path, &circle).unwrap();
        assert_eq!(Reader::open_file(&path).unwrap().count(), 3);
    }

    #[test]
    fn a_table_with_more_entries_than_bytes_is_left() {
        let folder = tempfile::tempdir().unwrap();
        let (path, whole) = clip(folder.path());
        for table in [b"stsz", b"stts", b"stsc", b"stco", b"stss"] {
            let mut many = whole.clone();
            let skip = if table == b"stsz" { 4 } else { 0 };
            many[place(&whole, table, skip)].copy_from_slice(&u32::MAX.to_be_bytes());
            std::fs::write(&path, &many).unwrap();
            let said = refusal(&path);
            assert!(said.contains("a box of its index is not built as expected"), "{table:?}: {said}");
        }
    }

    #[test]
    fn frames_that_lie_nowhere_or_are_never_shown_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let (path, whole) = clip(folder.path());
        for (table, skip, value) in [(b"stsc", 4, 0u32), (b"stsc", 8, 0), (b"stts", 4, 1)] {
            let mut damaged = whole.clone();
            damaged[place(&whole, table, skip)].copy_from_slice(&value.to_be_bytes());
            std::fs::write(&path, &damaged).unwrap();
            let said = refusal(&path);
            assert!(
                said.contains("its index does not say of all 3 frames where they lie"),
                "{table:?}: {said}"
            );
        }
    }

    #[test]
    fn the_file_that_once_asked_for_17_gigabytes_is_refused() {
        let data = std::env::var_os("PDK_TEST_DATA")
            .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared"), PathBuf::from);
        let path = data.join("attacks/samples_2e32.mp4");
        if !path.is_file() {
            eprintln!("skipped: no {}; PDK_TEST_DATA can name the folder", path.display());
            return;
        }
        assert!(refusal(&path).starts_with("it is damaged: its index claims 42949"), "{}", refusal(&path));
    }
}
