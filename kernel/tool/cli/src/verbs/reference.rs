//! `pdk reference`: writes the reference pages with a picture of each perturbation.

use std::path::{Path, PathBuf};

use indicatif::ProgressBar;
use pdk_components::registry::Registry;
use pdk_preview::preview::{self, Options};
use pdk_preview::{picture, reference};
use pdk_sdk::error::{Error, Place, Result};

use super::Global;

/// Arguments of `pdk reference`
#[derive(clap::Args)]
pub struct Arguments {
    /// The folder to write to
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// The image that the pictures are made from; without it only the pages are written
    #[arg(long, value_name = "FILE")]
    image: Option<PathBuf>,
    /// Write nothing, and fail where a page is not what would be written
    #[arg(long)]
    check: bool,
}

/// Width of the frame that is perturbed, and of one picture, in pixels.
const WIDTH: u32 = 320;
const PICTURE_WIDTH: u32 = 180;

/// Writes or checks the pages of all perturbations that need no file of the user's.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let registry = global.registry()?;
    for page in reference::pages(&preview::usable(registry.catalog(), true)) {
        let path = arguments.folder.join(&page.file);
        if !arguments.check {
            write(&path, page.text.as_bytes())?;
        } else if std::fs::read_to_string(&path).unwrap_or_default() != page.text {
            return Err(Error::new(format!(
                "{} is not up to date; write it anew with `pdk reference {}`",
                path.display(),
                arguments.folder.display()
            )));
        }
    }
    match &arguments.image {
        Some(image) if !arguments.check => pictures(&registry, image, &arguments.folder),
        _ => Ok(()),
    }
}

fn pictures(registry: &Registry, image: &Path, folder: &Path) -> Result<()> {
    let source = picture::to_frame(picture::scaled(&pdk_image::read(image)?, WIDTH))?;
    let options = Options { seed: 0, frame_width: WIDTH, picture_width: PICTURE_WIDTH, maps: None };
    let shown = preview::chosen(registry.catalog(), &[], true)?;
    let blocks = preview::rows(registry, &shown, &source, &options, &ProgressBar::no_length());
    for (shown, block) in shown.iter().zip(blocks) {
        let mut jpeg = Vec::new();
        let path = folder.join(format!("pictures/{}.jpg", shown.description.name));
        image::codecs::jpeg::JpegEncoder::new_with_quality(&mut jpeg, 82)
            .encode_image(&block?.row)
            .place(format_args!("cannot encode {}", path.display()))?;
        write(&path, &jpeg)?;
    }
    Ok(())
}

fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    let place = format!("cannot write {}", path.display());
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).place(&place)?;
    }
    pdk_sdk::file::write(path, bytes).place(&place)
}
