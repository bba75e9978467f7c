//! Pixels in blocks, one channel after the other, as the compiler's vectors want them.

use crate::frame::CHANNELS;

/// The number of pixels in a block.
pub(crate) const BLOCK: usize = 64;

/// One channel of a block.
pub(crate) type Plane = [u8; BLOCK];

/// Takes a row apart into blocks of three planes, lets `change` work on them in place, and puts them together again.
/// `change` also gets the number of the block's first pixel. The last block of a row may hold pixels that do not count.
#[inline(always)]
pub(crate) fn for_each_block(
    from: &[u8],
    to: &mut [u8],
    mut change: impl FnMut(usize, &mut [Plane; CHANNELS]),
) {
    const BYTES: usize = BLOCK * CHANNELS;
    let whole = from.len() / BYTES * BYTES;
    let (from, rest_from) = from.split_at(whole);
    let (to, rest_to) = to.split_at_mut(whole);
    for (index, (from, to)) in from.chunks_exact(BYTES).zip(to.chunks_exact_mut(BYTES)).enumerate() {
        change_block(from, to, index * BLOCK, &mut change);
    }
    if !rest_from.is_empty() {
        let (mut padded, mut changed) = ([0; BYTES], [0; BYTES]);
        padded[..rest_from.len()].copy_from_slice(rest_from);
        change_block(&padded, &mut changed, whole / CHANNELS, &mut change);
        rest_to.copy_from_slice(&changed[..rest_from.len()]);
    }
}

#[inline(always)]
fn change_block(
    from: &[u8],
    to: &mut [u8],
    first: usize,
    change: &mut impl FnMut(usize, &mut [Plane; CHANNELS]),
) {
    let mut planes = [[0u8; BLOCK]; CHANNELS];
    let [a, b, c] = &mut planes;
    for (((pixel, a), b), c) in from.chunks_exact(CHANNELS).zip(a).zip(b).zip(c) {
        (*a, *b, *c) = (pixel[0], pixel[1], pixel[2]);
    }
    change(first, &mut planes);
    let [a, b, c] = &planes;
    for (((pixel, a), b), c) in to.chunks_exact_mut(CHANNELS).zip(a).zip(b).zip(c) {
        (pixel[0], pixel[1], pixel[2]) = (*a, *b, *c);
    }
}
