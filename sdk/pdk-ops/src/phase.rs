//! Scrambled phases.
//!
//! A phase is added to every coefficient of a channel's Fourier transform, and the real part of what comes back is the
//! result. Coefficients of a real image come in pairs, one the conjugate of the other, and taking the real part at the
//! end averages what was added to the two: with phases p and q, the first of a pair is multiplied by
//! `(e^(ip) + e^(-iq)) / 2 = cos((p + q) / 2) e^(i (p - q) / 2)` and the second by its conjugate. So half of the
//! coefficients is enough, two rows fit one complex transform, and nothing is computed that the real part drops.

use std::f32::consts::{FRAC_PI_2, PI};

use crate::fourier::{LANES, Lane, Plan, Sequences};
use crate::frame::{CHANNELS, Frame, FrameMut};
use crate::point::truncated;
use crate::simd::vectorised;
use pdk_seed::Random;

/// Random bytes for one coefficient in each lane: two numbers of 16 bits.
const DRAW: usize = 4 * LANES;

/// Rows that are transformed together: two in each lane.
const ROWS: usize = 2 * LANES;

/// What [`scramble_phase`] keeps between calls.
#[derive(Debug, Clone, Default)]
pub struct Workspace {
    across: Plan,
    down: Plan,
    /// Rows under way.
    rows: Sequences,
    /// The half spectrum of a channel: for each block of columns, the block's rows, and zeros up to a multiple of [`ROWS`].
    spectrum: Sequences,
    /// What the coefficients of a block of columns are multiplied with.
    filter: Sequences,
    /// The random bytes of a block of columns.
    draws: Vec<u8>,
    /// What stands for rows below the frame.
    black: Vec<[u8; CHANNELS]>,
    /// The results of rows under way, even and odd ones.
    bytes: [Vec<[u8; LANES]>; 2],
}

/// Adds to the phase of every coefficient of each channel's two-dimensional Fourier transform a random angle from
/// `0..strength * pi`, transforms back, and keeps the real part, clipped to 0..=255 and without its fraction. The
/// strength is clipped to 0..=1.
///
/// # Panics
/// If the sizes differ.
pub fn scramble_phase(
    src: Frame<'_>,
    mut dst: FrameMut<'_>,
    strength: f64,
    random: &mut Random,
    workspace: &mut Workspace,
) {
    assert!(src.same_size(&dst.as_ref()), "phase scrambling between frames of different size");
    let (width, height) = (src.width(), src.height());
    let columns = width / 2 + 1;
    let blocks = columns.div_ceil(LANES);
    let padded = height.next_multiple_of(ROWS);
    let range = strength.clamp(0.0, 1.0) as f32 * PI;
    let Workspace { across, down, rows, spectrum, filter, draws, black, bytes } = workspace;
    across.prepare(width);
    down.prepare(height);
    rows.resize(width);
    spectrum.resize(blocks * padded);
    filter.resize(height);
    draws.resize(DRAW * height, 0);
    black.resize(width, [0; CHANNELS]);
    bytes.iter_mut().for_each(|bytes| bytes.resize(width, [0; LANES]));

    for channel in 0..CHANNELS {
        let Sequences { re, im } = &mut *spectrum;
        for top in (0..height).step_by(ROWS) {
            let line = |y: usize| if y < height { src.row(y).as_chunks().0 } else { &black[..] };
            let lines = std::array::from_fn(|row| line(top + row));
            load_rows(lines, channel, &mut rows.re, &mut rows.im);
            across.transform(&mut rows.re, &mut rows.im);
            take_spectra_apart(&rows.re, &rows.im, re, im, top, padded);
        }
        for (block, (re, im)) in re.chunks_exact_mut(padded).zip(im.chunks_exact_mut(padded)).enumerate() {
            // What a row below the frame got from rounding does not belong to the picture.
            let ((re, below_re), (im, below_im)) = (re.split_at_mut(height), im.split_at_mut(height));
            below_re.fill(Lane::ZERO);
            below_im.fill(Lane::ZERO);
            random.fill(draws);
            make_filter(draws, range, &mut filter.re, &mut filter.im);
            for lane in 0..LANES {
                // Columns that are their own partners hold pairs of their own.
                if [0, width - width / 2].contains(&(block * LANES + lane)) && block * LANES + lane < columns
                {
                    pair_within_column(draws, range, lane, filter);
                }
            }
            down.transform(re, im);
            apply_filter(&filter.re, &filter.im, re, im);
            down.transform(im, re);
        }
        for top in (0..height).step_by(ROWS) {
            put_spectra_together(re, im, top, padded, &mut rows.re, &mut rows.im);
            across.transform(&mut rows.im, &mut rows.re);
            // Each of the two directions enlarges by its length, taking two rows apart by two.
            let scale = 1.0 / (2.0 * width as f32 * height as f32);
            for (results, bytes) in [&rows.re, &rows.im].into_iter().zip(&mut *bytes) {
                drop_fractions(Lane::numbers(results), scale, bytes.as_flattened_mut());
            }
            for (row, y) in (top..height).take(ROWS).enumerate() {
                for (pixel, bytes) in dst.row_mut(y).chunks_exact_mut(CHANNELS).zip(&bytes[row % 2]) {
                    pixel[channel] = bytes[row / 2];
                }
            }
        }
    }
}

vectorised! {
    /// One channel of rows: even ones as real parts, odd ones as imaginary parts.
    fn load_rows / load_rows_avx2 / load_rows_avx512 (
        lines: [&[[u8; CHANNELS]]; ROWS], channel: usize, re: &mut [Lane], im: &mut [Lane],
    ) {
        let width = re.len();
        let (lines, im) = (lines.map(|line| &line[..width]), &mut im[..width]);
        for x in 0..width {
            for lane in 0..LANES {
                re[x][lane] = f32::from(lines[2 * lane][x][channel]);
                im[x][lane] = f32::from(lines[2 * lane + 1][x][channel]);
            }
        }
    }
}

vectorised! {
    /// The results of rows. The small term keeps whole numbers whole where nothing was scrambled.
    fn drop_fractions / drop_fractions_avx2 / drop_fractions_avx512 (results: &[f32], scale: f32, bytes: &mut [u8]) {
        for (byte, result) in bytes.iter_mut().zip(results) {
            *byte = truncated(result * scale + 1.0 / 256.0);
        }
    }
}

/// Where a column of the spectrum has the rows from `top` on, and in which lane.
#[inline(always)]
fn place(column: usize, top: usize, padded: usize) -> (usize, usize) {
    (column / LANES * padded + top, column % LANES)
}

vectorised! {
    /// Takes the transforms of two rows each apart and puts their halves, twice as large, into the spectrum.
    fn take_spectra_apart / take_spectra_apart_avx2 / take_spectra_apart_avx512 (
        rows_re: &[Lane], rows_im: &[Lane], re: &mut [Lane], im: &mut [Lane], top: usize, padded: usize,
    ) {
        let width = rows_re.len();
        for column in 0..=width / 2 {
            let partner = (width - column) % width;
            let (r, i) = (&rows_re[column], &rows_im[column]);
            let (partner_r, partner_i) = (&rows_re[partner], &rows_im[partner]);
            let (mut first, mut second) = ([Lane::ZERO; 2], [Lane::ZERO; 2]);
            for pair in 0..LANES {
                first[0][pair] = r[pair] + partner_r[pair];
                first[1][pair] = i[pair] - partner_i[pair];
                second[0][pair] = i[pair] + partner_i[pair];
                second[1][pair] = partner_r[pair] - r[pair];
            }
            let (start, lane) = place(column, top, padded);
            let (re, im) = (&mut re[start..start + ROWS], &mut im[start..start + ROWS]);
            for pair in 0..LANES {
                (re[2 * pair][lane], im[2 * pair][lane]) = (first[0][pair], first[1][pair]);
                (re[2 * pair + 1][lane], im[2 * pair + 1][lane]) = (second[0][pair], second[1][pair]);
            }
        }
    }
}

vectorised! {
    /// The reverse of [`take_spectra_apart`], but for the size.
    fn put_spectra_together / put_spectra_together_avx2 / put_spectra_together_avx512 (
        re: &[Lane], im: &[Lane], top: usize, padded: usize, rows_re: &mut [Lane], rows_im: &mut [Lane],
    ) {
        let width = rows_re.len();
        for column in 0..=width / 2 {
            let (start, lane) = place(column, top, padded);
            let (re, im) = (&re[start..start + ROWS], &im[start..start + ROWS]);
            let (mut first, mut second) = ([Lane::ZERO; 2], [Lane::ZERO; 2]);
            for pair in 0..LANES {
                (first[0][pair], first[1][pair]) = (re[2 * pair][lane], im[2 * pair][lane]);
                (second[0][pair], second[1][pair]) = (re[2 * pair + 1][lane], im[2 * pair + 1][lane]);
            }
            let partner = (width - column) % width;
            for pair in 0..LANES {
                rows_re[partner][pair] = first[0][pair] + second[1][pair];
                rows_im[partner][pair] = second[0][pair] - first[1][pair];
            }
            for pair in 0..LANES {
                rows_re[column][pair] = first[0][pair] - second[1][pair];
                rows_im[column][pair] = first[1][pair] + second[0][pair];
            }
        }
    }
}

/// The sine of an angle in -pi/2..=pi/2, to within 1e-6.
#[inline(always)]
fn sine(x: f32) -> f32 {
    let y = x * x;
    let series = 1.0 / 362_880.0 - y * (1.0 / 39_916_800.0);
    let series = 1.0 / 120.0 - y * (1.0 / 5040.0 - y * series);
    x * (1.0 - y * (1.0 / 6.0 - y * series))
}

/// The cosine of an angle in -pi/2..=pi/2, to within 1e-6.
#[inline(always)]
fn cosine(x: f32) -> f32 {
    let y = x * x;
    let series = 1.0 / 40_320.0 - y * (1.0 / 3_628_800.0 - y * (1.0 / 479_001_600.0));
    let series = 1.0 / 24.0 - y * (1.0 / 720.0 - y * series);
    1.0 - y * (0.5 - y * series)
}

vectorised! {
    /// The factors of a block of columns, from two angles below `range` each.
    fn make_filter / make_filter_avx2 / make_filter_avx512 (
        draws: &[u8], range: f32, re: &mut [Lane], im: &mut [Lane],
    ) {
        let unit = range / 131_072.0;
        for ((draw, re), im) in draws.as_chunks::<DRAW>().0.iter().zip(re).zip(im) {
            let (words, _) = draw.as_chunks::<4>();
            for lane in 0..LANES {
                let both = u32::from_le_bytes(words[lane]) as i32;
                let (first, second) = (both & 0xffff, both >> 16 & 0xffff);
                let half_difference = (first - second) as f32 * unit;
                let half_sum = (first + second) as f32 * unit;
                let size = sine(FRAC_PI_2 - half_sum);
                (re[lane], im[lane]) = (size * cosine(half_difference), size * sine(half_difference));
            }
        }
    }
}

/// Makes the factors of a column whose coefficients pair with each other: a coefficient's partner has the conjugate of
/// its factor, and one that is its own partner has the real part of what its own angle gives.
fn pair_within_column(draws: &[u8], range: f32, lane: usize, filter: &mut Sequences) {
    let height = filter.re.len();
    for row in 0..=height / 2 {
        let partner = (height - row) % height;
        if partner == row {
            let start = row * DRAW + 4 * lane;
            let angle = f32::from(u16::from_le_bytes([draws[start], draws[start + 1]])) * (range / 65_536.0);
            (filter.re[row][lane], filter.im[row][lane]) = (sine(FRAC_PI_2 - angle), 0.0);
        } else {
            (filter.re[partner][lane], filter.im[partner][lane]) =
                (filter.re[row][lane], -filter.im[row][lane]);
        }
    }
}

vectorised! {
    fn apply_filter / apply_filter_avx2 / apply_filter_avx512 (
        filter_re: &[Lane], filter_im: &[Lane], re: &mut [Lane], im: &mut [Lane],
    ) {
        for ((re, im), (a, b)) in re.iter_mut().zip(im).zip(filter_re.iter().zip(filter_im)) {
            for lane in 0..LANES {
                (re[lane], im[lane]) =
                    (re[lane] * a[lane] - im[lane] * b[lane], re[lane] * b[lane] + im[lane] * a[lane]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::FrameBuf;
    use crate::testing::run;
    use pdk_seed::Key;

    /// What the effect is defined as, on the whole plane and in double precision, with the kernel's draws.
    fn plain(src: Frame<'_>, strength: f64, random: &mut Random) -> Vec<f64> {
        let (width, height) = (src.width(), src.height());
        let mut out = vec![0.0; width * height * 3];
        let angle = |k: usize, n: usize| 2.0 * std::f64::consts::PI * (k % n) as f64 / n as f64;
        for channel in 0..3 {
            let mut phases = vec![f64::NAN; width * height];
            for block in 0..(width / 2 + 1).div_ceil(LANES) {
                let mut draws = vec![0; DRAW * height];
                random.fill(&mut draws);
                for (i, draw) in draws.chunks(4).enumerate() {
                    let (row, column) = (i / LANES, block * LANES + i % LANES);
                    let phase = |low, high| {
                        strength * std::f64::consts::PI * f64::from(u16::from_le_bytes([low, high])) / 65536.0
                    };
                    let here = row * width + column;
                    let partner = (height - row) % height * width + (width - column) % width;
                    if column <= width / 2 && phases[here].is_nan() {
                        phases[partner] = phase(draw[2], draw[3]);
                        phases[here] = phase(draw[0], draw[1]);
                    }
                }
            }
            assert!(phases.iter().all(|p| !p.is_nan()));
            for (k, phase) in phases.iter().enumerate() {
                let (v, u) = (k / width, k % width);
                let (mut re, mut im) = (0.0, 0.0);
                for y in 0..height {
                    for x in 0..width {
                        let value = f64::from(src.pixel(x, y)[channel]);
                        let (sin, cos) = libm::sincos(-angle(u * x, width) - angle(v * y, height));
                        (re, im) = (re + value * cos, im + value * sin);
                    }
                }
                for y in 0..height {
                    for x in 0..width {
                        let (sin, cos) = libm::sincos(angle(u * x, width) + angle(v * y, height) + phase);
                        out[(y * width + x) * 3 + channel] += (re * cos - im * sin) / (width * height) as f64;
                    }
                }
            }
        }
        out
    }

    fn noise(width: usize, height: usize) -> FrameBuf {
        let mut pixels = vec![0; width * height * 3];
        Key([8; 32]).sequence().fill(&mut pixels);
        FrameBuf::from_vec(pixels, width, height).unwrap()
    }

    #[test]
    fn matches_the_definition_on_the_whole_plane() {
        let mut workspace = Workspace::default();
        for (width, height) in
            [(1, 1), (1, 6), (6, 1), (2, 2), (3, 5), (4, 7), (16, 12), (15, 16), (18, 17), (33, 19), (21, 33)]
        {
            let src = noise(width, height);
            for strength in [0.05, 0.55, 1.0] {
                let expected = plain(src.as_ref(), strength, &mut Key([5; 32]).frame(0));
                let result = run(width, height, |dst| {
                    let mut random = Key([5; 32]).frame(0);
                    scramble_phase(src.as_ref(), dst, strength, &mut random, &mut workspace);
                });
                for (actual, expected) in result.data().iter().zip(expected) {
                    let off = f64::from(*actual) + 0.5 - expected.clamp(0.0, 255.0);
                    assert!(off.abs() < 0.52, "{width}x{height} at {strength}: {actual}, not {expected}");
                }
            }
        }
    }

    #[test]
    fn without_strength_nothing_changes() {
        let mut workspace = Workspace::default();
        for (width, height) in [(1, 1), (7, 3), (64, 48), (161, 97), (320, 240)] {
            let src = noise(width, height);
            let mut dst = FrameBuf::new(width, height);
            scramble_phase(src.as_ref(), dst.as_mut(), 0.0, &mut Key([5; 32]).frame(0), &mut workspace);
            assert_eq!(dst, src, "{width}x{height}");
        }
    }

    #[test]
    fn sine_and_cosine_are_close() {
        for step in -1000..=1000 {
            let x = step as f32 * 0.001 * FRAC_PI_2;
            assert!((f64::from(sine(x)) - libm::sin(x.into())).abs() < 1e-6, "sine of {x}");
            assert!((f64::from(cosine(x)) - libm::cos(x.into())).abs() < 1e-6, "cosine of {x}");
        }
    }
}
