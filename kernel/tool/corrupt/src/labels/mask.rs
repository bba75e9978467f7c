//! Masks in PNG files: a value for each pixel, moved as the pixels of the picture are, without a mixture of values.

use pdk_image::samples;
use pdk_labels::Labels;
use pdk_sdk::error::{Error, Result};

/// The mask of a perturbed picture. What comes from outside of the picture has the value `outside` in all channels.
///
/// # Errors
/// If it is not a PNG file of the size of the picture, or a perturbation cannot say where its pixels come from.
pub fn moved(file: &[u8], size: [usize; 2], labels: &mut Labels<'_>, outside: u16) -> Result<Vec<u8>> {
    let mask = samples::read(file)?;
    let found = [mask.width, mask.height];
    if found != size {
        return Err(Error::new(format!(
            "the mask has {}x{} pixels, but its picture {}x{}; make them of one size",
            found[0], found[1], size[0], size[1]
        )));
    }
    if outside > mask.most() {
        return Err(Error::new(format!(
            "--outside is {outside}, but the mask holds values up to {}; choose one of these",
            mask.most()
        )));
    }
    let fill = vec![outside; mask.channels];
    let mut values = Vec::with_capacity(mask.values.len());
    for source in labels.sources()? {
        let value = source.and_then(|at| mask.values.get(at * mask.channels..(at + 1) * mask.channels));
        values.extend_from_slice(value.unwrap_or(&fill));
    }
    mask.write(&values)
}
