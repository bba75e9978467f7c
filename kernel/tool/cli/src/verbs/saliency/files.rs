//! Maps as files: numbers for NumPy, and pictures.

use std::path::{Path, PathBuf};

use pdk_chain::view;
use pdk_sdk::error::{Place, Result};
use pdk_sdk::prelude::Frame;

/// The file of this ending beside others of the same stem, which may have points of its own.
pub fn beside(stem: &Path, ending: &str) -> PathBuf {
    let mut name = stem.as_os_str().to_owned();
    name.push(format!(".{ending}"));
    name.into()
}

/// Writes 32-bit floats as NumPy reads them (format 1.0), row by row.
///
/// # Errors
/// If the file cannot be written.
pub fn write_npy(path: &Path, values: &[f32], width: usize) -> Result<()> {
    let height = values.len() / width.max(1);
    let mut header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({height}, {width}), }}");
    // Magic, version, length and header end at a multiple of 64.
    let length = (10 + header.len() + 1).next_multiple_of(64) - 10;
    header.push_str(&" ".repeat(length - header.len() - 1));
    header.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((length as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
    pdk_sdk::file::write(path, &bytes).place(format_args!("cannot write {}", path.display()))
}

/// Writes the frame with the map laid over.
///
/// # Errors
/// If the file cannot be written.
pub fn write_picture(path: &Path, frame: Frame<'_>, values: &[f32]) -> Result<()> {
    pdk_image::write(path, view::heat(frame, values).as_ref())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_written_as_numpy_reads_them() {
        let dir = tempfile::tempdir().unwrap();
        let path = beside(&dir.path().join("a.b"), "npy");
        assert!(path.ends_with("a.b.npy"));
        write_npy(&path, &[0.0, 0.5, 1.0, 0.25, 0.75, 0.125], 3).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let length = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
        assert_eq!((10 + length) % 64, 0);
        let header = std::str::from_utf8(&bytes[10..10 + length]).unwrap();
        assert!(
            header.starts_with("{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }")
                && header.ends_with('\n')
        );
        let values: Vec<_> =
            bytes[10 + length..].chunks(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
        assert_eq!(values, [0.0, 0.5, 1.0, 0.25, 0.75, 0.125]);
    }
}
