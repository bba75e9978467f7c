//! Looks at a library before the system maps it: from a file that was cut off, the system reads memory that is not
//! there, and the process dies of it.

use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

use pdk_sdk::error::Result;
use pdk_sdk::file;

const MAGIC: [u8; 4] = *b"\x7fELF";
const CLASS_64: u8 = 2;
const LITTLE_ENDIAN: u8 = 1;
/// The type of a program header whose part of the file is mapped.
const PT_LOAD: u32 = 1;

/// How many bytes the file has to have and how many it has, where it has too few. Only 64-bit little-endian ELF files
/// are looked at; everything else is left to the system.
///
/// # Errors
/// Where the file cannot be read.
pub fn missing_part(path: &Path) -> Result<Option<(u64, u64)>> {
    let (mut file, len) = file::open(path)?;
    let mut header = [0; 64];
    if len < header.len() as u64 {
        return Ok(None);
    }
    file.read_exact(&mut header)?;
    if header[..4] != MAGIC || header[4] != CLASS_64 || header[5] != LITTLE_ENDIAN {
        return Ok(None);
    }
    let (table, size, count) = (u64_at(&header, 0x20), u16_at(&header, 0x36), u16_at(&header, 0x38));
    let table_end = table.saturating_add(u64::from(size) * u64::from(count));
    if usize::from(size) < 56 || table_end > len {
        return Ok((table_end > len).then_some((table_end, len)));
    }
    let mut programs = vec![0; usize::from(size) * usize::from(count)];
    file.seek(SeekFrom::Start(table))?;
    file.read_exact(&mut programs)?;
    let mapped = programs.chunks_exact(usize::from(size)).filter(|program| u32_at(program, 0) == PT_LOAD);
    let needed =
        mapped.map(|program| u64_at(program, 8).saturating_add(u64_at(program, 32))).max().unwrap_or(0);
    Ok((needed > len).then_some((needed, len)))
}

fn u64_at(bytes: &[u8], at: usize) -> u64 {
    u64::from(u32_at(bytes, at)) | u64::from(u32_at(bytes, at + 4)) << 32
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from(u16_at(bytes, at)) | u32::from(u16_at(bytes, at + 2)) << 16
}

fn u16_at(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes([bytes[at], bytes[at + 1]])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn this_executable_is_complete_and_its_first_half_is_not() {
        let whole = std::env::current_exe().unwrap();
        assert_eq!(missing_part(&whole).unwrap(), None);
        let bytes = std::fs::read(&whole).unwrap();
        if bytes[..6] != [0x7f, b'E', b'L', b'F', CLASS_64, LITTLE_ENDIAN] {
            return;
        }
        let cut = std::env::temp_dir().join(format!("pdk-elf-{}", std::process::id()));
        for len in [64, 5_000] {
            std::fs::write(&cut, &bytes[..len]).unwrap();
            let (needed, has) = missing_part(&cut).unwrap().unwrap();
            assert!(needed > has && has == len as u64);
        }
        std::fs::write(&cut, "no library").unwrap();
        assert_eq!(missing_part(&cut).unwrap(), None);
        std::fs::remove_file(&cut).unwrap();
    }
}
