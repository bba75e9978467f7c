//! Looks at how large the chunks of a trace are to be once they are decompressed: the reader takes that much memory before it
//! looks at them.

use std::io::{BufReader, Read, Seek, SeekFrom};

/// Bytes before the first record.
const MAGIC: u64 = 8;
/// The code of a chunk among the records of MCAP.
const CHUNK: u8 = 6;

/// The size of the largest chunk of a trace, decompressed, as far as its records can be followed; damage is for the reader to find.
pub fn largest<R: Read + Seek>(file: R) -> std::io::Result<u64> {
    let mut file = BufReader::new(file);
    let mut largest = 0;
    let mut at = MAGIC;
    loop {
        file.seek(SeekFrom::Start(at))?;
        let mut head = [0; 9];
        if file.read_exact(&mut head).is_err() {
            return Ok(largest);
        }
        let [code, length @ ..] = head;
        if code == CHUNK {
            // The times of its first and last message, and its size.
            let mut start = [0; 24];
            if file.read_exact(&mut start).is_err() {
                return Ok(largest);
            }
            let [.., a, b, c, d, e, f, g, h] = start;
            largest = largest.max(u64::from_le_bytes([a, b, c, d, e, f, g, h]));
        }
        let Some(next) = at.checked_add(9).and_then(|at| at.checked_add(u64::from_le_bytes(length))) else {
            return Ok(largest);
        };
        at = next;
    }
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;

    #[test]
    fn the_largest_chunk_counts_and_nonsense_ends_the_search() {
        let record = |code: u8, data: &[u8]| [&[code][..], &(data.len() as u64).to_le_bytes(), data].concat();
        let chunk = |size: u64| record(CHUNK, &[&[0; 16], &size.to_le_bytes()[..], &[7; 5]].concat());
        let size = |parts: &[Vec<u8>]| largest(Cursor::new([&[0; 8][..], &parts.concat()].concat())).unwrap();
        assert_eq!(size(&[]), 0);
        assert_eq!(size(&[record(1, b"head"), chunk(5), chunk(1 << 60), chunk(9)]), 1 << 60);
        assert_eq!(size(&[chunk(5), vec![1, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff], chunk(9)]), 5);
        assert_eq!(size(&[chunk(5), chunk(9)[..20].to_vec()]), 5);
    }
}
