//! Gaussian smoothing of 16-bit numbers, for kernels of any width and results finer than a grey level.
//!
//! Weights are whole numbers that sum to 2^15 and sums have 32 bits, so nothing is lost but by one rounding between the
//! vertical and the horizontal pass, and a constant stays constant.

use crate::border::reflect;
use crate::simd::vectorised;
#[cfg(target_arch = "x86_64")]
use crate::simd::{Instructions, instructions};

/// The weights of a kernel sum to two to this power.
pub(crate) const WEIGHT_BITS: u32 = 15;
/// The vertical pass is done in strips of this many values, which stay in the processor's first cache.
const STRIP: usize = 64;
/// Sums are computed in groups of this many values.
const GROUP: usize = 32;

/// A symmetric kernel.
#[derive(Debug, Clone, Default)]
pub(crate) struct Kernel {
    /// The distances 0 and 1, 2 and 3, ... with a weight for each side; the centre has half its weight on either side.
    /// The last distance may have no weight.
    pairs: Vec<[i16; 2]>,
}

impl Kernel {
    /// Makes it a Gaussian of `size` values (the next odd number counts) and the given standard deviation. Weights are
    /// rounded from the end to the centre, each handing its rounding error on, and the centre takes what is left.
    pub(crate) fn set_gaussian(&mut self, size: usize, sigma: f64) {
        let radius = size / 2;
        let density = |x: usize| libm::exp(-((x * x) as f64) / (2.0 * sigma * sigma));
        let total = 1.0 + 2.0 * (1..=radius).map(density).sum::<f64>();
        let whole = 1 << WEIGHT_BITS;
        self.pairs.clear();
        self.pairs.resize(radius / 2 + 1, [0; 2]);
        let (mut error, mut used) = (0.0, 0);
        for x in (1..=radius).rev() {
            let wanted = f64::from(whole) * density(x) / total + error;
            let weight = wanted.round_ties_even();
            error = wanted - weight;
            self.pairs[x / 2][x % 2] = weight as i16;
            used += 2 * weight as i32;
        }
        self.pairs[0][0] = ((whole - used) / 2) as i16;
    }

    /// The largest distance.
    fn reach(&self) -> usize {
        (2 * self.pairs.len()).saturating_sub(1)
    }
}

/// What [`smooth`] keeps between calls.
#[derive(Debug, Clone, Default)]
pub(crate) struct Workspace {
    /// A strip of columns, mirrored at the top and the bottom.
    strip: Vec<i16>,
    /// The result of the vertical pass, each row mirrored at both ends.
    rows: Vec<i16>,
    sums: Vec<i32>,
}

/// The size of an image of 16-bit numbers: `channels` numbers for each pixel.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Size {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) channels: usize,
}

/// Smooths in both directions, mirrored at the edges without repeating them.
///
/// `read` fills a slice with the numbers of a row from a place on; every number has to be at least -2^14 and below 2^14,
/// also after it has been shifted to the left by `finer`, the number of bits that the vertical pass adds: twice such a
/// number fits into 16 bits. `write` gets each
/// row's result, which is larger than what was read by 2^`finer` times 2^15.
pub(crate) fn smooth(
    size: Size,
    kernel: &Kernel,
    finer: u32,
    read: impl Fn(usize, usize, &mut [i16]),
    mut write: impl FnMut(usize, &[i32]),
    workspace: &mut Workspace,
) {
    let Size { width, height, channels } = size;
    let Workspace { strip, rows, sums } = workspace;
    let (values, reach) = (width * channels, kernel.reach());
    let border = reach * channels;
    // The last group may reach beyond the row, into the border and what follows it.
    let line = values + 2 * border + GROUP;
    rows.resize(line * height, 0);
    strip.resize((height + 2 * reach) * STRIP, 0);
    sums.resize(values.next_multiple_of(GROUP).max(STRIP), 0);
    for start in (0..values).step_by(STRIP) {
        let count = STRIP.min(values - start);
        for (v, to) in strip.chunks_exact_mut(STRIP).enumerate() {
            read(reflect(v as isize - reach as isize, height), start, &mut to[..count]);
        }
        for y in 0..height {
            weighted_sums(strip, (y + reach) * STRIP, STRIP, kernel, &mut sums[..STRIP]);
            let to = y * line + border + start;
            shift_down(&sums[..count], &mut rows[to..to + count], WEIGHT_BITS - finer);
        }
    }
    for (y, row) in rows.chunks_exact_mut(line).enumerate() {
        for distance in 1..=reach {
            let left = reflect(-(distance as isize), width);
            let right = reflect((width + distance - 1) as isize, width);
            for (to, from) in [(reach - distance, left), (reach + width + distance - 1, right)] {
                let from = (reach + from) * channels;
                row.copy_within(from..from + channels, to * channels);
            }
        }
        let groups = values.next_multiple_of(GROUP);
        weighted_sums(row, border, channels, kernel, &mut sums[..groups]);
        write(y, &sums[..values]);
    }
}

vectorised! {
    // Rounds half up.
    fn shift_down / shift_down_avx2 / shift_down_avx512 (sums: &[i32], into: &mut [i16], bits: u32) {
        let half = (1 << bits) >> 1;
        for (into, &sum) in into.iter_mut().zip(sums) {
            *into = ((sum + half) >> bits) as i16;
        }
    }
}

/// For each place `i` of `sums`, the kernel's sum of the numbers `step` apart around `line[at + i]`. The number of sums
/// is a multiple of [`GROUP`].
fn weighted_sums(line: &[i16], at: usize, step: usize, kernel: &Kernel, sums: &mut [i32]) {
    let reach = kernel.reach() * step;
    assert!(sums.len().is_multiple_of(GROUP) && at >= reach && at + reach + sums.len() <= line.len());
    #[cfg(target_arch = "x86_64")]
    if instructions() >= Instructions::Avx2 {
        // SAFETY: the processor has AVX2, and the line was just found to be long enough.
        return unsafe { weighted_sums_avx2(line, at, step, kernel, sums) };
    }
    weighted_sums_portable(line, at, step, kernel, sums);
}

fn weighted_sums_portable(line: &[i16], at: usize, step: usize, kernel: &Kernel, sums: &mut [i32]) {
    sums.fill(0);
    for (distance, &weight) in kernel.pairs.iter().flatten().enumerate() {
        let (left, right) = (&line[at - distance * step..], &line[at + distance * step..]);
        for ((sum, &a), &b) in sums.iter_mut().zip(left).zip(right) {
            *sum += i32::from(a + b) * i32::from(weight);
        }
    }
}

/// # Safety
/// `line` has at least `reach * step` numbers before `at`, and as many after the `sums.len()` numbers from `at` on.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
unsafe fn weighted_sums_avx2(line: &[i16], at: usize, step: usize, kernel: &Kernel, sums: &mut [i32]) {
    use std::arch::x86_64::*;
    for (group, sums) in sums.chunks_exact_mut(GROUP).enumerate() {
        // SAFETY: the group lies within the line.
        let middle = unsafe { line.as_ptr().add(at + group * GROUP) };
        let mut total = [_mm256_setzero_si256(); 4];
        for (pair, &[first, second]) in kernel.pairs.iter().enumerate() {
            let weights = _mm256_set1_epi32(i32::from(first as u16) | i32::from(second) << 16);
            let near = 2 * pair * step;
            let far = near + step;
            for half in 0..2 {
                // SAFETY: both distances are within the kernel's reach.
                let both = |distance: usize| unsafe {
                    let centre = middle.add(half * 16);
                    _mm256_add_epi16(
                        _mm256_loadu_si256(centre.sub(distance).cast()),
                        _mm256_loadu_si256(centre.add(distance).cast()),
                    )
                };
                let (near, far) = (both(near), both(far));
                let lower = _mm256_madd_epi16(_mm256_unpacklo_epi16(near, far), weights);
                let upper = _mm256_madd_epi16(_mm256_unpackhi_epi16(near, far), weights);
                total[2 * half] = _mm256_add_epi32(total[2 * half], lower);
                total[2 * half + 1] = _mm256_add_epi32(total[2 * half + 1], upper);
            }
        }
        for (total, sums) in total.chunks_exact(2).zip(sums.chunks_exact_mut(16)) {
            // Unpacking put numbers 0 to 3 and 8 to 11 into the first, the others into the second.
            let first = _mm256_permute2x128_si256::<0x20>(total[0], total[1]);
            let second = _mm256_permute2x128_si256::<0x31>(total[0], total[1]);
            // SAFETY: there are 16 sums.
            unsafe {
                _mm256_storeu_si256(sums.as_mut_ptr().cast(), first);
                _mm256_storeu_si256(sums.as_mut_ptr().add(8).cast(), second);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::simd::with_each;

    #[test]
    fn weights_follow_the_gaussian_and_sum_to_the_whole() {
        let mut kernel = Kernel::default();
        for (size, sigma) in [(1, 1.0), (3, 0.8), (5, 0.4), (13, 1.5), (35, 5.6), (113, 17.3), (301, 45.5)] {
            kernel.set_gaussian(size, sigma);
            let weights: Vec<i32> = kernel.pairs.iter().flatten().map(|&w| i32::from(w)).collect();
            assert_eq!(2 * weights.iter().sum::<i32>(), 1 << 15, "{size}");
            let density = |x: usize| libm::exp(-((x * x) as f64) / (2.0 * sigma * sigma));
            let total: f64 = 2.0 * (1..=size / 2).map(density).sum::<f64>() + 1.0;
            for (x, weight) in weights.into_iter().take(size / 2 + 1).enumerate() {
                let sides = if x == 0 { 2.0 } else { 1.0 };
                let wanted = 32768.0 * density(x) / total / sides;
                assert!((f64::from(weight) - wanted).abs() <= 1.0, "{size} {x} {weight} {wanted}");
            }
        }
    }

    proptest! {
        #[test]
        fn matches_the_plain_version(
            width in 1usize..60, height in 1usize..12, channels in 1usize..4, size in 1usize..40,
            finer in 0u32..3, key: [u8; 32],
        ) {
            let values = width * channels;
            let mut random = pdk_seed::Key(key).sequence();
            let limit = (1 << 14) >> finer;
            let numbers: Vec<i16> = (0..values * height).map(|_| random.between(-limit, limit - 1) as i16).collect();
            let mut kernel = Kernel::default();
            kernel.set_gaussian(size, size as f64 / 5.0);
            let radius = size as isize / 2;
            let weight = |distance: isize| {
                let x = distance.unsigned_abs();
                i64::from(kernel.pairs[x / 2][x % 2]) * if x == 0 { 2 } else { 1 }
            };
            let mut down = vec![0i64; values * height];
            for y in 0..height {
                for i in 0..values {
                    let at = |d: isize| i64::from(numbers[reflect(y as isize + d, height) * values + i]);
                    let sum: i64 = (-radius..=radius).map(|d| at(d) * weight(d)).sum();
                    let bits = 15 - finer;
                    down[y * values + i] = (sum + (1 << bits) / 2) >> bits;
                }
            }
            let mut expected = vec![0; values * height];
            for y in 0..height {
                for i in 0..values {
                    let (x, c) = ((i / channels) as isize, i % channels);
                    let at = |d: isize| down[y * values + reflect(x + d, width) * channels + c];
                    expected[y * values + i] = (-radius..=radius).map(|d| at(d) * weight(d)).sum::<i64>() as i32;
                }
            }
            let mut workspace = Workspace::default();
            with_each(|instructions| {
                let mut actual = vec![0; values * height];
                smooth(
                    Size { width, height, channels },
                    &kernel,
                    finer,
                    |y, start, to| to.copy_from_slice(&numbers[y * values + start..][..to.len()]),
                    |y, sums| actual[y * values..][..values].copy_from_slice(sums),
                    &mut workspace,
                );
                assert_eq!(actual, expected, "{instructions:?}");
            });
        }
    }
}
