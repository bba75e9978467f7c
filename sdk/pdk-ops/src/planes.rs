//! Pixels in blocks, one channel after the other, as the compiler's vectors want them.

use crate::frame::CHANNELS;

/// The number of pixels in a block.
pub(crate) const BLOCK: usize = 64;

/// The number of bytes in a block.
pub(crate) const BLOCK_BYTES: usize = BLOCK * CHANNELS;

/// A block's channels.
pub(crate) type Planes = [[u8; BLOCK]; CHANNELS];

/// Takes at most a block of pixels apart. What a shorter one lacks is filled with black.
#[inline(always)]
pub(crate) fn take_apart(from: &[u8]) -> Planes {
    let mut planes = [[0; BLOCK]; CHANNELS];
    match from.first_chunk() {
        Some(whole) => take_whole(whole, &mut planes),
        None => {
            let mut padded = [0; BLOCK_BYTES];
            padded[..from.len()].copy_from_slice(from);
            take_whole(&padded, &mut planes);
        }
    }
    planes
}

/// Puts at most a block of pixels together.
#[inline(always)]
pub(crate) fn put_together(planes: &Planes, to: &mut [u8]) {
    match to.first_chunk_mut() {
        Some(whole) => put_whole(planes, whole),
        None => {
            let mut padded = [0; BLOCK_BYTES];
            put_whole(planes, &mut padded);
            to.copy_from_slice(&padded[..to.len()]);
        }
    }
}

#[inline(always)]
fn take_whole(from: &[u8; BLOCK_BYTES], planes: &mut Planes) {
    let [a, b, c] = planes;
    for (((pixel, a), b), c) in from.chunks_exact(CHANNELS).zip(a).zip(b).zip(c) {
        (*a, *b, *c) = (pixel[0], pixel[1], pixel[2]);
    }
}

#[inline(always)]
fn put_whole(planes: &Planes, to: &mut [u8; BLOCK_BYTES]) {
    let [a, b, c] = planes;
    for (((pixel, a), b), c) in to.chunks_exact_mut(CHANNELS).zip(a).zip(b).zip(c) {
        (pixel[0], pixel[1], pixel[2]) = (*a, *b, *c);
    }
}
