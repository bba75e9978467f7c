//! The archive. The same tree gives the same bytes.

use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use flate2::Compression;
use flate2::write::GzEncoder;
use pdk_model::error::{Place, Result};
use tar::{Builder, HeaderMode};
use walkdir::WalkDir;

use crate::project::Project;

/// Packs the tree, and returns the archive. Every system can unpack gzip.
///
/// # Errors
/// If a file cannot be read or written.
pub fn pack(project: &Project, tree: &Path) -> Result<PathBuf> {
    let title = project.title()?;
    let path = project.out().join(format!("{title}.tar.gz"));
    let file = File::create(&path).place(path.display())?;
    let mut archive = Builder::new(GzEncoder::new(BufWriter::new(file), Compression::best()));
    // Neither owners nor times.
    archive.mode(HeaderMode::Deterministic);
    for entry in WalkDir::new(tree).sort_by_file_name() {
        let entry = entry.place(tree.display())?;
        let place = Path::new(&title).join(entry.path().strip_prefix(tree).place(tree.display())?);
        archive.append_path_with_name(entry.path(), place).place(entry.path().display())?;
    }
    let file = archive.into_inner().and_then(GzEncoder::finish).place(path.display())?;
    file.into_inner().place(path.display())?;
    Ok(path)
}
