//! How large a picture may be. Small files can claim any size, and a picture takes memory by its pixels.

use pdk_sdk::prelude::*;

/// The variable that sets how many megapixels a picture may have.
const VARIABLE: &str = "PDK_MEGAPIXELS";
/// Megapixels, of 2^20 pixels each, by default: a picture of 8192 x 8192. Decoding takes up to 20 bytes a pixel.
const MEGAPIXELS: usize = 64;
/// The longest side of a picture in pixels.
pub const LONGEST: u32 = 16_384;
/// Bytes that the file of a picture may have: some of them are read whole before their size is known.
pub const LARGEST_FILE: u64 = 512 << 20;

/// The pixels that a picture may have: 64 megapixels of 2^20, or as many as `PDK_MEGAPIXELS` says.
///
/// # Errors
/// If the variable is not a whole number from 1 to 256.
pub fn most_pixels() -> Result<usize> {
    match std::env::var(VARIABLE) {
        Err(_) => Ok(MEGAPIXELS << 20),
        // Neither side is longer than 2^14.
        Ok(text) => text.parse().ok().filter(|megapixels| (1..=256).contains(megapixels)).map_or_else(
            || Err(Error::new(format!("{VARIABLE} is `{text}`, but has to be a whole number from 1 to 256"))),
            |megapixels: usize| Ok(megapixels << 20),
        ),
    }
}

/// Looks at the size of a picture before memory is taken for it.
///
/// # Errors
/// If it is too large, with what can be done.
pub fn check_size(width: u32, height: u32) -> Result<()> {
    let most = most_pixels()?;
    match width.max(height) <= LONGEST && width as usize * height as usize <= most {
        true => Ok(()),
        false => Err(Error::new(format!(
            "it is {width} x {height}, and pictures may have {} megapixels and sides of {LONGEST}; scale it down, or raise \
             the limit with {VARIABLE}",
            most >> 20
        ))),
    }
}
