//! Looks at the index of an MP4 file before it is believed: the reader of such files takes it at its word.

use std::io::{Read, Seek, SeekFrom};

use mp4::Mp4Track;
use pdk_sdk::prelude::*;

const UNKNOWN: &str = "MP4 or QuickTime of a kind that the built-in reader does not know";

/// Looks at the sizes of all boxes before anything is read from them, because the reader would go round in circles in one
/// of size 0. Returns what the file is where the reader would not understand it.
pub fn check_boxes(input: &mut (impl Read + Seek), size: u64) -> Result<Option<String>> {
    let mut index = false;
    // Where the boxes to look at begin and end, and whether that is the whole file.
    let mut spans = vec![(0, size, true)];
    while let Some((mut at, end, file)) = spans.pop() {
        while at < end {
            let Some((name, header, length)) = box_at(input, at, end)? else {
                return match file {
                    true => Err(Error::new(CUT_OFF)),
                    false => Ok(Some(format!("{UNKNOWN} (a box has an impossible size)"))),
                };
            };
            // The last box of a file may go on to its end without saying how long it is.
            let length = if file && length == 0 { end - at } else { length };
            if at + length > end && file {
                return Err(Error::new(CUT_OFF));
            }
            if length < header || at + length > end {
                return Ok(Some(format!("{UNKNOWN} (a box has an impossible size)")));
            }
            index |= &name == b"moov";
            // Boxes that consist of boxes, some behind a version.
            match &name {
                b"moov" | b"trak" | b"mdia" | b"minf" | b"stbl" | b"dinf" | b"mvex" | b"moof" | b"traf"
                | b"udta" => {
                    spans.push((at + header, at + length, false));
                }
                b"meta" => spans.push((at + header + 4, at + length, false)),
                _ => {}
            }
            at += length;
        }
    }
    input.seek(SeekFrom::Start(0))?;
    if index { Ok(None) } else { Err(Error::new(CUT_OFF)) }
}

/// Said of a file of which a part is missing.
pub const CUT_OFF: &str = "it is cut off: its frames or their index are missing in part; copy it again";

/// The name, the length of the header and the length of the box at a place; none if there is no room for a header.
fn box_at(input: &mut (impl Read + Seek), at: u64, end: u64) -> Result<Option<([u8; 4], u64, u64)>> {
    if end - at < 8 {
        return Ok(None);
    }
    let mut head = [0; 8];
    input.seek(SeekFrom::Start(at))?;
    input.read_exact(&mut head)?;
    let [a, b, c, d, name @ ..] = head;
    let length = u64::from(u32::from_be_bytes([a, b, c, d]));
    if length != 1 {
        return Ok(Some((name, 8, length)));
    }
    if end - at < 16 {
        return Ok(None);
    }
    let mut long = [0; 8];
    input.read_exact(&mut long)?;
    Ok(Some((name, 16, u64::from_be_bytes(long).min(u64::MAX / 2))))
}

/// Looks at what the index says of the frames before memory is taken for them: they have to find room in a file of `size`
/// bytes, and to lie and to be shown somewhere.
pub fn check_samples(track: &Mp4Track, size: u64) -> Result<()> {
    let tables = &track.trak.mdia.minf.stbl;
    let (sizes, chunks, times) = (&tables.stsz, &tables.stsc, &tables.stts);
    let count = sizes.sample_count;
    let largest = sizes.sample_sizes.iter().copied().max().unwrap_or(sizes.sample_size);
    let together = u64::from(count) * u64::from(sizes.sample_size);
    if together > size || u64::from(largest) > size {
        return Err(Error::new(format!(
            "it is damaged: its index claims {count} frames, of up to {largest} bytes each, in a file of {size} bytes; copy \
             it again"
        )));
    }
    let placed = chunks.entries.iter().all(|entry| entry.samples_per_chunk > 0 && entry.first_chunk > 0);
    let shown: u64 = times.entries.iter().map(|entry| u64::from(entry.sample_count)).sum();
    if !placed || shown < u64::from(count) {
        return Err(Error::new(format!(
            "it is damaged: its index does not say of all {count} frames where they lie and when they are shown; copy it \
             again"
        )));
    }
    Ok(())
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
    fn an_index_that_leads_in_circles_is_left() {
        let folder = tempfile::tempdir().unwrap();
        let (path, whole) = clip(folder.path());
        // The list of places of the data: very many, of which the first takes no bytes.
        let mut circle = whole.clone();
        circle[place(&whole, b"dref", 0)].copy_from_slice(&u32::MAX.to_be_bytes());
        circle[place(&whole, b"dref", 4)].copy_from_slice(&0u32.to_be_bytes());
        circle[place(&whole, b"dref", 8)].copy_from_slice(b"abcd");
        std::fs::write(&path, &circle).unwrap();
        assert_eq!(refusal(&path), "it is damaged: its index leads in circles; copy it again");
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
