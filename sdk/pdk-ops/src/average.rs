//! Averages over a fixed pattern of neighbours: a disc (a lens out of focus) or a few single pixels (motion).
//! The edges of the image mirror without repeating the edge pixel.

use crate::border::reflect;
use crate::frame::{CHANNELS, Frame, FrameMut};
use crate::simd::{round_inside_byte, vectorised};

/// The largest radius [`disc_blur`] takes, in pixels: sums over a row of a disc have to fit 16 bits.
pub const MAX_RADIUS: f64 = 128.0;
/// The largest number of neighbours [`pixel_average`] takes: 257 times 255 still fits 16 bits.
pub const MAX_NEIGHBOURS: usize = 257;

/// Discs of up to this many pixels are summed pixel by pixel, which takes less time there than sums from the left.
const FEW: usize = 21;

/// What the averages keep between calls.
#[derive(Debug, Clone, Default)]
pub struct Workspace {
    /// Half the width of the disc in each row, the middle one first.
    half_widths: Vec<usize>,
    /// For the rows that the disc covers: at each pixel the sum of everything left of it, modulo 65536.
    prefix: Vec<u16>,
    /// Sums of up to 257 pixels.
    partial: Vec<u16>,
    /// Sums of all pixels.
    sum: Vec<u32>,
    /// The places of a line.
    line: Vec<(isize, isize)>,
}

/// Half the width of each row of a disc: the largest `x` with `x^2 + y^2 <= radius^2` for `y = 0, 1, ...`
fn half_widths(radius: f64, into: &mut Vec<usize>) {
    into.clear();
    let square = radius * radius;
    let mut x = radius as usize;
    for y in 0..=radius as usize {
        while x > 0 && (x * x + y * y) as f64 > square {
            x -= 1;
        }
        into.push(x);
    }
}

/// Replaces each pixel by the mean of the disc around it: all pixels with `x^2 + y^2 <= radius^2`, at any real radius.
///
/// # Panics
/// If the sizes differ or `radius` is not within 0..=[`MAX_RADIUS`].
pub fn disc_blur(src: Frame<'_>, mut dst: FrameMut<'_>, radius: f64, workspace: &mut Workspace) {
    assert!(src.same_size(&dst.as_ref()), "disc_blur between frames of different size");
    assert!(
        (0.0..=MAX_RADIUS).contains(&radius),
        "disc_blur takes a radius of 0 to 128 pixels, not {radius}"
    );
    let Workspace { half_widths: halves, prefix, partial, sum, line } = workspace;
    half_widths(radius, halves);
    let (width, height, reach) = (src.width(), src.height(), halves.len() - 1);
    let area: usize = halves.iter().map(|h| 2 * h + 1).sum::<usize>() * 2 - (2 * halves[0] + 1);
    if area <= FEW {
        let reach = reach as isize;
        let mut places = std::mem::take(line);
        places.clear();
        for down in -reach..=reach {
            let half = halves[down.unsigned_abs()] as isize;
            places.extend((-half..=half).map(|right| (right, down)));
        }
        pixel_average(src, dst, &places, workspace);
        workspace.line = places;
        return;
    }
    let (values, rows) = (width * CHANNELS, 2 * reach + 1);
    let line = (width + 2 * reach + 1) * CHANNELS;
    prefix.resize(rows * line, 0);
    partial.resize(values, 0);
    sum.resize(values, 0);
    let scale = 1.0 / area as f32;

    // `prefix` is a ring: the row `v` rows below the top edge of the image is in slot `(v + reach) % rows`.
    let slot = |v: isize| (v + reach as isize) as usize % rows * line;
    for y in 0..height as isize {
        let first_new = if y == 0 { -(reach as isize) } else { y + reach as isize };
        for v in first_new..=y + reach as isize {
            let start = slot(v);
            fill_prefix(src.row(reflect(v, height)), &mut prefix[start..start + line], reach);
        }
        sum.fill(0);
        partial.fill(0);
        let mut pixels = 0;
        for (distance, &half) in halves.iter().enumerate() {
            let spans = [y - distance as isize, y + distance as isize].map(|v| {
                let row = &prefix[slot(v)..slot(v) + line];
                let (left, right) = ((reach - half) * CHANNELS, (reach + half + 1) * CHANNELS);
                (&row[left..left + values], &row[right..right + values])
            });
            let added = (2 * half + 1) * if distance == 0 { 1 } else { 2 };
            if pixels + added > MAX_NEIGHBOURS {
                flush(partial, sum);
                pixels = 0;
            }
            if distance == 0 {
                add_span(spans[0].0, spans[0].1, partial);
            } else if added <= MAX_NEIGHBOURS {
                add_spans(spans[0].0, spans[0].1, spans[1].0, spans[1].1, partial);
            } else {
                add_span(spans[0].0, spans[0].1, partial);
                flush(partial, sum);
                add_span(spans[1].0, spans[1].1, partial);
            }
            pixels += added;
        }
        flush(partial, sum);
        normalise_wide(sum, dst.row_mut(y as usize), scale);
    }
}

/// Sums a row, mirrored for `reach` pixels at both ends, from the left.
fn fill_prefix(row: &[u8], prefix: &mut [u16], reach: usize) {
    let width = row.len() / CHANNELS;
    let mut total = [0u16; CHANNELS];
    let (first, rest) = prefix.split_at_mut(CHANNELS);
    first.fill(0);
    let mut step = |to: &mut [u16], pixel: &[u8]| {
        for channel in 0..CHANNELS {
            total[channel] = total[channel].wrapping_add(u16::from(pixel[channel]));
            to[channel] = total[channel];
        }
    };
    let mirrored = |place: isize| {
        let start = reflect(place, width) * CHANNELS;
        &row[start..start + CHANNELS]
    };
    let (left, rest) = rest.split_at_mut(reach * CHANNELS);
    let (middle, right) = rest.split_at_mut(width * CHANNELS);
    for (i, to) in left.chunks_exact_mut(CHANNELS).enumerate() {
        step(to, mirrored(i as isize - reach as isize));
    }
    for (to, pixel) in middle.chunks_exact_mut(CHANNELS).zip(row.chunks_exact(CHANNELS)) {
        step(to, pixel);
    }
    for (i, to) in right.chunks_exact_mut(CHANNELS).enumerate() {
        step(to, mirrored((width + i) as isize));
    }
}

/// Replaces each pixel by the mean of the pixels at the given places `(right, down)` relative to it.
///
/// # Panics
/// If the sizes differ, or there are no neighbours or more than [`MAX_NEIGHBOURS`].
pub fn pixel_average(
    src: Frame<'_>,
    mut dst: FrameMut<'_>,
    neighbours: &[(isize, isize)],
    workspace: &mut Workspace,
) {
    assert!(src.same_size(&dst.as_ref()), "pixel_average between frames of different size");
    assert!((1..=MAX_NEIGHBOURS).contains(&neighbours.len()), "pixel_average takes 1 to 257 neighbours");
    let (width, height) = (src.width(), src.height());
    let partial = &mut workspace.partial;
    partial.resize(width * CHANNELS, 0);
    let scale = 1.0 / neighbours.len() as f32;
    for y in 0..height {
        partial.fill(0);
        for &(right, down) in neighbours {
            let row = src.row(reflect(y as isize + down, height));
            add_shifted(row, right, partial, width);
        }
        normalise(partial, dst.row_mut(y), scale);
    }
}

/// The longest line [`line_blur`] takes, in pixels to the right or down.
pub const MAX_LINE: f64 = (MAX_NEIGHBOURS - 1) as f64;

/// Replaces each pixel by the mean along the line that a point draws while it moves `right` and `down` by this many pixels,
/// with its middle on the pixel: one pixel in each column, or in each row where the line is steeper than a diagonal.
///
/// # Panics
/// If the sizes differ or `right` or `down` is not within -[`MAX_LINE`]..=[`MAX_LINE`].
pub fn line_blur(src: Frame<'_>, dst: FrameMut<'_>, right: f64, down: f64, workspace: &mut Workspace) {
    let longest = right.abs().max(down.abs());
    assert!(longest <= MAX_LINE, "line_blur takes lines of up to 256 pixels, not {right} and {down}");
    let steps = longest.round_ties_even();
    let mut line = std::mem::take(&mut workspace.line);
    line.clear();
    line.extend((0..=steps as usize).map(|step| {
        let share = if steps > 0.0 { step as f64 / steps - 0.5 } else { 0.0 };
        ((right * share).round_ties_even() as isize, (down * share).round_ties_even() as isize)
    }));
    pixel_average(src, dst, &line, workspace);
    workspace.line = line;
}

/// Adds to each pixel of `sum` the pixel of `row` that is `right` of it.
fn add_shifted(row: &[u8], right: isize, sum: &mut [u16], width: usize) {
    let shift = right.unsigned_abs().min(width);
    let inside = (width - shift) * CHANNELS;
    let outside = if right >= 0 {
        add_bytes(&row[shift * CHANNELS..], &mut sum[..inside]);
        width - shift..width
    } else {
        add_bytes(&row[..inside], &mut sum[shift * CHANNELS..]);
        0..shift
    };
    for x in outside {
        let from = reflect(x as isize + right, width) * CHANNELS;
        for channel in 0..CHANNELS {
            sum[x * CHANNELS + channel] += u16::from(row[from + channel]);
        }
    }
}

vectorised! {
    fn add_bytes / add_bytes_avx2 / add_bytes_avx512 (row: &[u8], sum: &mut [u16]) {
        for (sum, &value) in sum.iter_mut().zip(row) {
            *sum = sum.wrapping_add(u16::from(value));
        }
    }
}

vectorised! {
    fn add_span / add_span_avx2 / add_span_avx512 (left: &[u16], right: &[u16], sum: &mut [u16]) {
        for ((sum, &left), &right) in sum.iter_mut().zip(left).zip(right) {
            *sum = sum.wrapping_add(right.wrapping_sub(left));
        }
    }
}

vectorised! {
    fn add_spans / add_spans_avx2 / add_spans_avx512 (
        left: &[u16], right: &[u16], other_left: &[u16], other_right: &[u16], sum: &mut [u16],
    ) {
        let rights = right.iter().zip(other_right);
        for ((sum, (&right, &other_right)), (&left, &other_left)) in
            sum.iter_mut().zip(rights).zip(left.iter().zip(other_left))
        {
            let spans = right.wrapping_sub(left).wrapping_add(other_right.wrapping_sub(other_left));
            *sum = sum.wrapping_add(spans);
        }
    }
}

vectorised! {
    fn flush / flush_avx2 / flush_avx512 (partial: &mut [u16], sum: &mut [u32]) {
        for (sum, partial) in sum.iter_mut().zip(partial) {
            *sum += u32::from(*partial);
            *partial = 0;
        }
    }
}

vectorised! {
    fn normalise / normalise_avx2 / normalise_avx512 (sum: &[u16], dst: &mut [u8], scale: f32) {
        for (dst, &sum) in dst.iter_mut().zip(sum) {
            *dst = round_inside_byte(f32::from(sum) * scale);
        }
    }
}

vectorised! {
    // Sums stay far below 2^31; a signed conversion is one instruction, an unsigned one is many.
    fn normalise_wide / normalise_wide_avx2 / normalise_wide_avx512 (
        sum: &[u32], dst: &mut [u8], scale: f32,
    ) {
        for (dst, &sum) in dst.iter_mut().zip(sum) {
            *dst = round_inside_byte(sum as i32 as f32 * scale);
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::frame::FrameBuf;
    use crate::testing::{plain, run_on, samples};

    /// The mean over places relative to each pixel, rounded as the kernels round.
    fn plain_mean(src: Frame<'_>, places: &[(isize, isize)]) -> FrameBuf {
        plain(src, |x, y| {
            let mut sums = [0u32; 3];
            for &(right, down) in places {
                let row = reflect(y as isize + down, src.height());
                let pixel = src.pixel(reflect(x as isize + right, src.width()), row);
                (0..3).for_each(|c| sums[c] += u32::from(pixel[c]));
            }
            sums.map(|sum| (sum as f32 * (1.0 / places.len() as f32)).round_ties_even() as u8)
        })
    }

    fn disc(radius: f64) -> Vec<(isize, isize)> {
        let reach = radius as isize;
        let all = (-reach..=reach).flat_map(|y| (-reach..=reach).map(move |x| (x, y)));
        all.filter(|(x, y)| (x * x + y * y) as f64 <= radius * radius).collect()
    }

    #[test]
    fn discs_have_the_published_areas() {
        assert_eq!([2.0, 5.0, 6.0, 9.0, 12.0].map(|r| disc(r).len()), [13, 81, 113, 253, 441]);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn disc_blur_matches_the_plain_version(sample in samples(), radius in 0.0..24.0) {
            let expected = plain_mean(sample.frame(), &disc(radius));
            let mut workspace = Workspace::default();
            prop_assert_eq!(run_on(&sample, |src, dst| disc_blur(src, dst, radius, &mut workspace)), expected);
        }

        #[test]
        fn pixel_average_matches_the_plain_version(
            sample in samples(), places in prop::collection::vec((-90isize..90, -30isize..30), 1..40),
        ) {
            let expected = plain_mean(sample.frame(), &places);
            let mut workspace = Workspace::default();
            let result = run_on(&sample, |src, dst| pixel_average(src, dst, &places, &mut workspace));
            prop_assert_eq!(result, expected);
        }
    }

    #[test]
    fn a_line_has_the_stated_length() {
        let mut src = FrameBuf::new(21, 21);
        src.as_mut().set_pixel(10, 10, [252; 3]);
        for (right, down, expected) in [
            (0.0, 0.0, vec![(10, 10)]),
            (2.0, 0.0, vec![(9, 10), (10, 10), (11, 10)]),
            (0.0, -2.0, vec![(10, 9), (10, 10), (10, 11)]),
            (6.0, 2.0, vec![(7, 9), (8, 9), (9, 10), (10, 10), (11, 10), (12, 11), (13, 11)]),
        ] {
            let mut dst = FrameBuf::new(21, 21);
            line_blur(src.as_ref(), dst.as_mut(), right, down, &mut Workspace::default());
            let all = (0..21).flat_map(|x| (0..21).map(move |y| (x, y)));
            let lit: Vec<_> = all.filter(|&(x, y)| dst.as_ref().pixel(x, y)[0] > 0).collect();
            assert_eq!(lit, expected);
            let mean = dst.as_ref().pixel(10, 10)[0];
            assert_eq!(usize::from(mean) * expected.len(), 252);
        }
        let mut dst = FrameBuf::new(21, 21);
        line_blur(src.as_ref(), dst.as_mut(), MAX_LINE, -MAX_LINE, &mut Workspace::default());
    }

    #[test]
    fn the_largest_disc_and_the_most_neighbours_keep_a_white_frame_white() {
        let white = FrameBuf::from_vec(vec![255; 40 * 3 * 3], 40, 3).unwrap();
        let mut workspace = Workspace::default();
        let mut dst = FrameBuf::new(40, 3);
        disc_blur(white.as_ref(), dst.as_mut(), MAX_RADIUS, &mut workspace);
        assert_eq!(dst, white);
        pixel_average(white.as_ref(), dst.as_mut(), &[(5, -2); MAX_NEIGHBOURS], &mut workspace);
        assert_eq!(dst, white);
    }

    #[test]
    fn a_workspace_serves_frames_and_discs_of_any_size_in_turn() {
        let mut kept = Workspace::default();
        for (width, height, radius) in
            [(40, 30, 12.0), (7, 3, 2.0), (40, 30, 5.5), (90, 2, 9.0), (1, 1, 20.0)]
        {
            let bytes: Vec<u8> = (0..width * height * 3).map(|i| (i * 37 % 251) as u8).collect();
            let src = Frame::new(&bytes, width, height).unwrap();
            let (mut first, mut second) = (src.to_buf(), src.to_buf());
            disc_blur(src, first.as_mut(), radius, &mut kept);
            disc_blur(src, second.as_mut(), radius, &mut Workspace::default());
            assert_eq!(first, second);
        }
    }
}
