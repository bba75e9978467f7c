//! Hue, saturation and value in double precision, step by step as scikit-image computes them.
//!
//! Every operation is a single one of IEEE 754 in a fixed order, so every machine computes the same numbers.

use crate::frame::{CHANNELS, Frame, FrameMut, for_each_row};
use crate::planes::{BLOCK, BLOCK_BYTES, put_together, take_apart};
use crate::point::truncated_double;
use crate::simd::vectorised;

/// What is done to saturation and value, each from 0 to 1, which are clipped to that range afterwards.
#[derive(Debug, Clone, Copy)]
pub struct Change {
    /// What the saturation is multiplied by.
    pub saturation_factor: f64,
    /// What is added to the saturation then.
    pub saturation_added: f64,
    /// What is added to the value.
    pub value_added: f64,
}

impl Change {
    /// Nothing.
    pub const NONE: Self = Self { saturation_factor: 1.0, saturation_added: 0.0, value_added: 0.0 };
}

/// Changes saturation and value of every pixel; the hue stays. Fractions of grey levels are dropped, so a result that is whole but for
/// rounding counts as what rounding makes of it: the steps are those of scikit-image.
///
/// # Panics
/// If the sizes differ.
pub fn change_hsv(src: Frame<'_>, dst: FrameMut<'_>, change: Change) {
    let levels = std::array::from_fn(|value| value as f64 / 255.0);
    for_each_row(src, dst, |from, to| change_row(from, to, change, &levels));
}

vectorised! {
    fn change_row / change_row_avx2 / change_row_avx512 (
        from: &[u8], to: &mut [u8], change: Change, levels: &[f64; 256],
    ) {
        for (from, to) in from.chunks(BLOCK_BYTES).zip(to.chunks_mut(BLOCK_BYTES)) {
            let mut planes = take_apart(from);
            let mut colours = [[0.0; BLOCK]; CHANNELS];
            for (plane, colours) in planes.iter().zip(&mut colours) {
                colours.iter_mut().zip(plane).for_each(|(colour, &byte)| *colour = levels[usize::from(byte)]);
            }
            let [reds, greens, blues] = &mut colours;
            for ((r, g), b) in reds.iter_mut().zip(greens).zip(blues) {
                [*r, *g, *b] = changed([*r, *g, *b], change);
            }
            for (plane, colours) in planes.iter_mut().zip(&colours) {
                for (byte, &colour) in plane.iter_mut().zip(colours) {
                    *byte = truncated_double(colour * 255.0);
                }
            }
            put_together(&planes, to);
        }
    }
}

/// A changed colour, with channels of 0 to 1.
#[inline(always)]
fn changed([r, g, b]: [f64; 3], change: Change) -> [f64; 3] {
    let (most, least) = (r.max(g).max(b), r.min(g).min(b));
    let delta = most - least;
    let is_grey = delta == 0.0;
    // Grey divides 0 by 1.
    let [spread, brightest] = if is_grey { [1.0; 2] } else { [delta, most] };
    let (offset, difference) = if b == most {
        (4.0, r - g)
    } else if g == most {
        (2.0, b - r)
    } else {
        (0.0, g - b)
    };
    let quotient = difference / spread;
    // Nothing is added to what may be a negative zero.
    let sixth = if offset == 0.0 { quotient } else { offset + quotient };
    let hue = sixth / 6.0;
    let hue = if hue < 0.0 { hue + 1.0 } else { hue };
    let hue = if is_grey { 0.0 } else { hue };

    let saturation = (delta / brightest * change.saturation_factor + change.saturation_added).clamp(0.0, 1.0);
    let value = (most + change.value_added).clamp(0.0, 1.0);

    let sector = (hue * 6.0).floor();
    let place = hue * 6.0 - sector;
    let p = value * (1.0 - saturation);
    let q = value * (1.0 - place * saturation);
    let t = value * (1.0 - (1.0 - place) * saturation);
    // A hue of 1 is one of 0.
    let is = |number: f64| sector == number;
    let first = is(0.0) || is(6.0);
    let red = if first || is(5.0) {
        value
    } else if is(1.0) {
        q
    } else if is(4.0) {
        t
    } else {
        p
    };
    let green = if is(1.0) || is(2.0) {
        value
    } else if first {
        t
    } else if is(3.0) {
        q
    } else {
        p
    };
    let blue = if is(3.0) || is(4.0) {
        value
    } else if is(2.0) {
        t
    } else if is(5.0) {
        q
    } else {
        p
    };
    [red, green, blue]
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::testing::{plain, run_on, samples};

    /// Pixel by pixel, as the conversions are usually written.
    fn plain_change(pixel: [u8; 3], change: Change) -> [u8; 3] {
        let [r, g, b] = pixel.map(|value| f64::from(value) / 255.0);
        let (most, least) = (r.max(g).max(b), r.min(g).min(b));
        let delta = most - least;
        let (hue, saturation) = if delta == 0.0 {
            (0.0, 0.0)
        } else {
            let sixth = if b == most {
                4.0 + (r - g) / delta
            } else if g == most {
                2.0 + (b - r) / delta
            } else {
                (g - b) / delta
            };
            let hue = sixth / 6.0;
            (if hue < 0.0 { hue + 1.0 } else { hue }, delta / most)
        };
        let saturation = (saturation * change.saturation_factor + change.saturation_added).clamp(0.0, 1.0);
        let value = (most + change.value_added).clamp(0.0, 1.0);
        let sector = f64::floor(hue * 6.0);
        let place = hue * 6.0 - sector;
        let p = value * (1.0 - saturation);
        let q = value * (1.0 - place * saturation);
        let t = value * (1.0 - (1.0 - place) * saturation);
        let rgb = match sector as u32 % 6 {
            0 => [value, t, p],
            1 => [q, value, p],
            2 => [p, value, t],
            3 => [p, q, value],
            4 => [t, p, value],
            _ => [value, p, q],
        };
        rgb.map(|channel| (channel.clamp(0.0, 1.0) * 255.0) as u8)
    }

    /// The changes of the published suite, and others.
    fn changes() -> impl Strategy<Value = Change> {
        let saturation = prop_oneof![
            Just((1.0, 0.0)),
            Just((0.3, 0.0)),
            Just((2.0, 0.0)),
            Just((20.0, 0.2)),
            (0.0..100.0, -1.0..1.0)
        ];
        (saturation, prop_oneof![Just(0.0), Just(0.1), Just(0.5), -1.0..1.0]).prop_map(
            |((saturation_factor, saturation_added), value_added)| Change {
                saturation_factor,
                saturation_added,
                value_added,
            },
        )
    }

    proptest! {
        #[test]
        fn matches_the_plain_version(sample in samples(), change in changes()) {
            let src = sample.frame();
            let expected = plain(src, |x, y| plain_change(src.pixel(x, y), change));
            prop_assert_eq!(run_on(&sample, |src, dst| change_hsv(src, dst, change)), expected);
        }
    }

    #[test]
    fn what_is_not_a_number_becomes_black() {
        let src = crate::FrameBuf::from_vec(vec![9, 9, 9, 200, 10, 30], 2, 1).unwrap();
        for change in [
            Change { value_added: f64::NAN, ..Change::NONE },
            Change { saturation_factor: f64::INFINITY, saturation_added: f64::NAN, ..Change::NONE },
        ] {
            let mut dst = crate::FrameBuf::new(2, 1);
            change_hsv(src.as_ref(), dst.as_mut(), change);
            for (from, to) in src.data().chunks(3).zip(dst.data().chunks(3)) {
                assert_eq!(to, plain_change([from[0], from[1], from[2]], change), "{from:?} {change:?}");
            }
        }
    }

    #[test]
    fn colours_that_lie_on_borders_of_sectors_match_too() {
        for change in
            [Change { value_added: 0.3, ..Change::NONE }, Change { saturation_factor: 2.0, ..Change::NONE }]
        {
            for high in [1, 2, 85, 127, 128, 254, 255] {
                let pixels = [0, high / 2, high].into_iter().flat_map(|r| {
                    [0, high / 2, high]
                        .into_iter()
                        .flat_map(move |g| [0, high / 3, high / 2, high].map(|b| [r, g, b]))
                });
                let data: Vec<u8> = pixels.flatten().collect();
                let src = crate::FrameBuf::from_vec(data.clone(), data.len() / 3, 1).unwrap();
                let mut dst = crate::FrameBuf::new(data.len() / 3, 1);
                change_hsv(src.as_ref(), dst.as_mut(), change);
                for (from, to) in data.chunks(3).zip(dst.data().chunks(3)) {
                    assert_eq!(to, plain_change([from[0], from[1], from[2]], change), "{from:?}");
                }
            }
        }
    }
}
