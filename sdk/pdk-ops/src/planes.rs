//! Pixels in blocks, one channel after the other, as the compiler's vectors want them.

use crate::frame::CHANNELS;

/// The number of pixels in a block.
pub(crate) const BLOCK: usize = 64;

/// The number of bytes in a block.
const BYTES: usize = BLOCK * CHANNELS;

/// One channel of a block.
pub(crate) type Plane = [u8; BLOCK];

/// Takes a row apart into blocks of three planes, lets `change` work on them in place, and puts them together again.
/// `change` also gets the number of the block's first pixel. The last block of a row may hold pixels that do not count.
///
/// `change` is called in one place only, so that it becomes part of the caller and shares its instruction set.
#[inline(always)]
pub(crate) fn for_each_block(
    from: &[u8],
    to: &mut [u8],
    mut change: impl FnMut(usize, &mut [Plane; CHANNELS]),
) {
    let mut planes = [[0; BLOCK]; CHANNELS];
    let mut padded = [0; BYTES];
    for (index, (from, to)) in from.chunks(BYTES).zip(to.chunks_mut(BYTES)).enumerate() {
        match from.first_chunk::<BYTES>() {
            Some(whole) => take_apart(whole, &mut planes),
            None => {
                padded[..from.len()].copy_from_slice(from);
                take_apart(&padded, &mut planes);
            }
        }
        change(index * BLOCK, &mut planes);
        match to.first_chunk_mut::<BYTES>() {
            Some(whole) => put_together(&planes, whole),
            None => {
                put_together(&planes, &mut padded);
                to.copy_from_slice(&padded[..to.len()]);
            }
        }
    }
}

#[inline(always)]
fn take_apart(from: &[u8; BYTES], planes: &mut [Plane; CHANNELS]) {
    let [a, b, c] = planes;
    for (((pixel, a), b), c) in from.chunks_exact(CHANNELS).zip(a).zip(b).zip(c) {
        (*a, *b, *c) = (pixel[0], pixel[1], pixel[2]);
    }
}

#[inline(always)]
fn put_together(planes: &[Plane; CHANNELS], to: &mut [u8; BYTES]) {
    let [a, b, c] = planes;
    for (((pixel, a), b), c) in to.chunks_exact_mut(CHANNELS).zip(a).zip(b).zip(c) {
        (pixel[0], pixel[1], pixel[2]) = (*a, *b, *c);
    }
}
