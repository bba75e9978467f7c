//! Interpolation between the four pixels around any place of an image, at places given in 1/32 pixel.
//!
//! The image is copied with a border around it first. Places are limited to the copy, so that no pixel needs a test of
//! its own: how wide the border is and what it holds decides what lies beyond the edge. All sums are exact.

use crate::frame::{CHANNELS, Frame};
#[cfg(target_arch = "x86_64")]
use crate::simd::{Instructions, instructions};

/// Places are whole numbers of this fraction of a pixel.
pub const SUBPIXELS: i32 = 32;
const SUBPIXEL_BITS: u32 = SUBPIXELS.trailing_zeros();
/// A pixel pair is read as one word of eight bytes, two more than it has.
const SLACK: usize = 2;

/// What lies beyond the edge.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Border {
    /// Black.
    Black,
    /// The image, mirrored with the edge pixel repeated: `b a | a b c | c b`.
    Mirror,
}

/// A copy of an image with a border around it.
#[derive(Debug, Clone, Default)]
pub struct Padded {
    data: Vec<u8>,
    width: usize,
    height: usize,
    stride: usize,
    margin: usize,
}

impl Padded {
    /// Copies `src` with a border of `margin` pixels at the left and the top, and one more at the right and the bottom.
    ///
    /// # Panics
    /// If the copy would have 2 GiB or more.
    pub fn fill(&mut self, src: Frame<'_>, margin: usize, border: Border) {
        let (width, height) = (src.width(), src.height());
        self.width = width + 2 * margin + 1;
        self.height = height + 2 * margin + 1;
        self.stride = self.width * CHANNELS;
        self.margin = margin;
        let len = self.stride * self.height + SLACK;
        assert!(len <= i32::MAX as usize, "sampling takes frames of less than 2 GiB");
        self.data.resize(len, 0);
        let (left, right) = (margin * CHANNELS, (margin + width) * CHANNELS);
        for (v, line) in self.data.chunks_exact_mut(self.stride).enumerate() {
            let down = v as isize - margin as isize;
            let row = match border {
                Border::Mirror => src.row(mirror(down, height)),
                Border::Black if down < 0 || down >= height as isize => {
                    line.fill(0);
                    continue;
                }
                Border::Black => src.row(down as usize),
            };
            line[left..right].copy_from_slice(row);
            match border {
                Border::Black => {
                    line[..left].fill(0);
                    line[right..].fill(0);
                }
                Border::Mirror => {
                    for u in (0..margin).chain(margin + width..self.width) {
                        let from = mirror(u as isize - margin as isize, width) * CHANNELS;
                        line[u * CHANNELS..(u + 1) * CHANNELS].copy_from_slice(&row[from..from + CHANNELS]);
                    }
                }
            }
        }
    }

    /// The largest place in each direction, counted from the corner of the border; the one after it is the last pixel.
    fn limits(&self) -> (i32, i32) {
        ((self.width as i32 - 2) * SUBPIXELS, (self.height as i32 - 2) * SUBPIXELS)
    }

    /// Interpolates at one place after the other, `xs` to the right and `ys` down from the centre of the image's first
    /// pixel, in 1/32 px. Places further out than the border count as its edge.
    ///
    /// # Panics
    /// If the lengths differ.
    pub fn sample(&self, xs: &[i32], ys: &[i32], out: &mut [u8]) {
        assert!(xs.len() == ys.len() && out.len() == xs.len() * CHANNELS, "one pixel for each place");
        assert!(self.width > 1, "sampling needs an image");
        #[cfg(target_arch = "x86_64")]
        let done = match instructions() >= Instructions::Avx2 {
            // SAFETY: the processor has AVX2.
            true => unsafe { self.sample_avx2(xs, ys, out) },
            false => 0,
        };
        #[cfg(not(target_arch = "x86_64"))]
        let done = 0;
        self.sample_portable(&xs[done..], &ys[done..], &mut out[done * CHANNELS..]);
    }

    fn sample_portable(&self, xs: &[i32], ys: &[i32], out: &mut [u8]) {
        let (last_x, last_y) = self.limits();
        let start = self.margin as i32 * SUBPIXELS;
        for ((&x, &y), out) in xs.iter().zip(ys).zip(out.chunks_exact_mut(CHANNELS)) {
            let (x, y) = (x.saturating_add(start).clamp(0, last_x), y.saturating_add(start).clamp(0, last_y));
            let (right, down) = ((x % SUBPIXELS) as u32, (y % SUBPIXELS) as u32);
            let place =
                (y >> SUBPIXEL_BITS) as usize * self.stride + (x >> SUBPIXEL_BITS) as usize * CHANNELS;
            let upper = &self.data[place..][..2 * CHANNELS];
            let lower = &self.data[place + self.stride..][..2 * CHANNELS];
            for (c, out) in out.iter_mut().enumerate() {
                let across = |row: &[u8]| {
                    u32::from(row[c]) * (SUBPIXELS as u32 - right) + u32::from(row[c + CHANNELS]) * right
                };
                let sum = across(upper) * (SUBPIXELS as u32 - down) + across(lower) * down;
                *out = ((sum + (1 << (2 * SUBPIXEL_BITS - 1))) >> (2 * SUBPIXEL_BITS)) as u8;
            }
        }
    }

    /// Does eight places at a time and returns how many it did; the last few are left.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn sample_avx2(&self, xs: &[i32], ys: &[i32], out: &mut [u8]) -> usize {
        use std::arch::x86_64::*;
        // Eight pixels are written as two overlapping stores, which reach four bytes further.
        const BYTES: usize = 8 * CHANNELS;
        const WRITTEN: usize = BYTES + 4;
        let (last_x, last_y) = self.limits();
        let (last_x, last_y) = (_mm256_set1_epi32(last_x), _mm256_set1_epi32(last_y));
        let start = _mm256_set1_epi32(self.margin as i32 * SUBPIXELS);
        // Far places are drawn near before anything is added to them.
        let far = _mm256_set1_epi32(1 << 30);
        let (zero, mask, whole) =
            (_mm256_setzero_si256(), _mm256_set1_epi32(SUBPIXELS - 1), _mm256_set1_epi32(SUBPIXELS));
        let stride = _mm256_set1_epi32(self.stride as i32);
        let half = _mm256_set1_epi32(1 << (2 * SUBPIXEL_BITS - 1));
        // From r g b r g b to r r g g b b, for two pairs of pixels in each lane.
        let in_pairs = _mm256_broadcastsi128_si256(_mm_setr_epi8(
            0, 3, 1, 4, 2, 5, -1, -1, 8, 11, 9, 12, 10, 13, -1, -1,
        ));
        // From r g b 0 to r g b.
        let in_threes = _mm256_broadcastsi128_si256(_mm_setr_epi8(
            0, 1, 2, 4, 5, 6, 8, 9, 10, 12, 13, 14, -1, -1, -1, -1,
        ));
        let data = self.data.as_ptr();
        let mut done = 0;
        while xs.len() - done >= 8 {
            // SAFETY: both slices have eight more elements.
            let (x, y) = unsafe {
                (
                    _mm256_loadu_si256(xs.as_ptr().add(done).cast()),
                    _mm256_loadu_si256(ys.as_ptr().add(done).cast()),
                )
            };
            let x = _mm256_add_epi32(_mm256_min_epi32(x, far), start);
            let y = _mm256_add_epi32(_mm256_min_epi32(y, far), start);
            let x = _mm256_min_epi32(_mm256_max_epi32(x, zero), last_x);
            let y = _mm256_min_epi32(_mm256_max_epi32(y, zero), last_y);
            let (right, down) = (_mm256_and_si256(x, mask), _mm256_and_si256(y, mask));
            let columns = _mm256_srli_epi32::<{ SUBPIXEL_BITS as i32 }>(x);
            let rows = _mm256_srli_epi32::<{ SUBPIXEL_BITS as i32 }>(y);
            let bytes = _mm256_add_epi32(_mm256_add_epi32(columns, columns), columns);
            let places = _mm256_add_epi32(_mm256_mullo_epi32(rows, stride), bytes);
            let mut place = [0u32; 8];
            // SAFETY: the array has 32 bytes.
            unsafe { _mm256_storeu_si256(place.as_mut_ptr().cast(), places) };

            // The weights across, as bytes left and right, twice; those down, as words upper and lower.
            let across = _mm256_or_si256(_mm256_sub_epi32(whole, right), _mm256_slli_epi32::<8>(right));
            let across = _mm256_or_si256(across, _mm256_slli_epi32::<16>(across));
            let along = _mm256_or_si256(_mm256_sub_epi32(whole, down), _mm256_slli_epi32::<16>(down));

            let four = |first: usize, pairs: __m256i, even: __m256i, odd: __m256i| {
                let line = |skip: usize| {
                    // SAFETY: a place is at most (height - 2) rows and (width - 2) pixels into the data, the row below
                    // it has two pixels from there, and SLACK bytes follow the last row.
                    let word = |i: usize| unsafe {
                        data.add(place[first + i] as usize + skip).cast::<i64>().read_unaligned()
                    };
                    let words = _mm256_setr_epi64x(word(0), word(1), word(2), word(3));
                    let across = _mm256_permutevar8x32_epi32(across, pairs);
                    _mm256_maddubs_epi16(_mm256_shuffle_epi8(words, in_pairs), across)
                };
                let (upper, lower) = (line(0), line(self.stride));
                let finish = |both: __m256i, which: __m256i| {
                    let sum = _mm256_madd_epi16(both, _mm256_permutevar8x32_epi32(along, which));
                    _mm256_srli_epi32::<{ 2 * SUBPIXEL_BITS as i32 }>(_mm256_add_epi32(sum, half))
                };
                _mm256_packs_epi32(
                    finish(_mm256_unpacklo_epi16(upper, lower), even),
                    finish(_mm256_unpackhi_epi16(upper, lower), odd),
                )
            };
            let first = four(
                0,
                _mm256_setr_epi32(0, 0, 1, 1, 2, 2, 3, 3),
                _mm256_setr_epi32(0, 0, 0, 0, 2, 2, 2, 2),
                _mm256_setr_epi32(1, 1, 1, 1, 3, 3, 3, 3),
            );
            let second = four(
                4,
                _mm256_setr_epi32(4, 4, 5, 5, 6, 6, 7, 7),
                _mm256_setr_epi32(4, 4, 4, 4, 6, 6, 6, 6),
                _mm256_setr_epi32(5, 5, 5, 5, 7, 7, 7, 7),
            );
            // Pixels 0 1 4 5 and 2 3 6 7 in the two lanes, put in order.
            let pixels = _mm256_permutevar8x32_epi32(
                _mm256_packus_epi16(first, second),
                _mm256_setr_epi32(0, 1, 4, 5, 2, 3, 6, 7),
            );
            let pixels = _mm256_shuffle_epi8(pixels, in_threes);
            let mut last = [0; WRITTEN];
            let out = &mut out[done * CHANNELS..];
            let ends = out.len() < WRITTEN;
            let into = if ends { &mut last[..] } else { &mut *out }.as_mut_ptr();
            // SAFETY: there are WRITTEN bytes, the first 16 and the last 16 of which these write.
            unsafe {
                _mm_storeu_si128(into.cast(), _mm256_castsi256_si128(pixels));
                _mm_storeu_si128(into.add(12).cast(), _mm256_extracti128_si256::<1>(pixels));
            }
            if ends {
                out[..BYTES].copy_from_slice(&last[..BYTES]);
            }
            done += 8;
        }
        done
    }
}

/// The index that stands for `index` in a row of `len` that is mirrored with the last element repeated.
fn mirror(index: isize, len: usize) -> usize {
    let place = index.rem_euclid(2 * len as isize) as usize;
    place.min(2 * len - 1 - place)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::testing::{run, samples};

    #[test]
    fn mirrors_with_the_edge_repeated() {
        assert_eq!(
            (-5..8).map(|i| mirror(i, 3)).collect::<Vec<_>>(),
            [1, 2, 2, 1, 0, 0, 1, 2, 2, 1, 0, 0, 1]
        );
        assert!((-3..4).all(|i| mirror(i, 1) == 0));
    }

    /// Interpolates at one place without a copy.
    fn plain(src: Frame<'_>, x: i32, y: i32, border: Border) -> [u8; 3] {
        let at = |x: i32, y: i32, c: usize| match border {
            Border::Mirror => {
                i32::from(src.pixel(mirror(x as isize, src.width()), mirror(y as isize, src.height()))[c])
            }
            Border::Black if x < 0 || y < 0 || x >= src.width() as i32 || y >= src.height() as i32 => 0,
            Border::Black => i32::from(src.pixel(x as usize, y as usize)[c]),
        };
        let (left, top) = (x.div_euclid(32), y.div_euclid(32));
        let (right, down) = (x.rem_euclid(32), y.rem_euclid(32));
        [0, 1, 2].map(|c| {
            let upper = at(left, top, c) * (32 - right) + at(left + 1, top, c) * right;
            let lower = at(left, top + 1, c) * (32 - right) + at(left + 1, top + 1, c) * right;
            ((upper * (32 - down) + lower * down + 512) >> 10) as u8
        })
    }

    proptest! {
        #[test]
        fn black_borders_match_the_plain_version(
            sample in samples(), places in prop::collection::vec((-3000..3000i32, -1000..1000i32), 1..60),
        ) {
            let src = sample.frame();
            let (xs, ys): (Vec<i32>, Vec<i32>) = places.iter().copied().unzip();
            let mut padded = Padded::default();
            padded.fill(src, 1, Border::Black);
            let result = run(places.len(), 1, |mut dst| padded.sample(&xs, &ys, dst.row_mut(0)));
            for (i, &(x, y)) in places.iter().enumerate() {
                prop_assert_eq!(result.as_ref().pixel(i, 0), plain(src, x, y, Border::Black), "{} {}", x, y);
            }
        }

        #[test]
        fn mirrored_borders_match_the_plain_version(
            sample in samples(), margin in 0..80usize, places in prop::collection::vec((0.0..1.0, 0.0..1.0), 1..60),
        ) {
            let src = sample.frame();
            // Anywhere from one end of the border to the other.
            let along = |share: f64, len: usize| {
                (share * ((len + 2 * margin) * 32) as f64) as i32 - margin as i32 * 32
            };
            let xs: Vec<i32> = places.iter().map(|p| along(p.0, src.width() - 1)).collect();
            let ys: Vec<i32> = places.iter().map(|p| along(p.1, src.height() - 1)).collect();
            let mut padded = Padded::default();
            padded.fill(src, margin, Border::Mirror);
            let result = run(places.len(), 1, |mut dst| padded.sample(&xs, &ys, dst.row_mut(0)));
            for i in 0..places.len() {
                let expected = plain(src, xs[i], ys[i], Border::Mirror);
                prop_assert_eq!(result.as_ref().pixel(i, 0), expected, "{} {}", xs[i], ys[i]);
            }
        }
    }

    #[test]
    fn the_most_distant_places_are_black() {
        let src = crate::FrameBuf::from_vec(vec![255; 5 * 4 * 3], 5, 4).unwrap();
        let mut padded = Padded::default();
        padded.fill(src.as_ref(), 1, Border::Black);
        for place in [i32::MIN, -100, -32, 5 * 32, 1000, i32::MAX] {
            let result = run(20, 1, |mut dst| padded.sample(&[place; 20], &[0; 20], dst.row_mut(0)));
            assert!(result.data().iter().all(|&v| v == 0), "{place}");
        }
    }
}
