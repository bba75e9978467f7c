//! A picture laid over a frame.

use crate::frame::{Frame, FrameMut};
use crate::point::truncated;
use crate::simd::vectorised;

/// `(1 - opacity * cover / 255) * src + opacity * colour`, clipped to 0..=255, its fraction dropped. The colours are not
/// multiplied by the cover here: a caller who wants that has done it already. The opacity is clipped to 0..=1.
///
/// # Panics
/// If the sizes differ.
pub fn lay_over(src: Frame<'_>, colour: Frame<'_>, cover: Frame<'_>, opacity: f64, mut dst: FrameMut<'_>) {
    let same = |other: &Frame<'_>| src.same_size(other);
    assert!(
        same(&colour) && same(&cover) && same(&dst.as_ref()),
        "lay_over between frames of different size"
    );
    let opacity = opacity.clamp(0.0, 1.0) as f32;
    for y in 0..src.height() {
        lay_over_row(src.row(y), colour.row(y), cover.row(y), dst.row_mut(y), opacity);
    }
}

/// Added before the fraction is dropped, so that rounding errors do not lower whole numbers.
const MARGIN: f32 = 1.0 / 1024.0;

vectorised! {
    fn lay_over_row / lay_over_row_avx2 / lay_over_row_avx512 (
        src: &[u8], colour: &[u8], cover: &[u8], dst: &mut [u8], opacity: f32,
    ) {
        for ((dst, &src), (&colour, &cover)) in dst.iter_mut().zip(src).zip(colour.iter().zip(cover)) {
            let rest = 1.0 - f32::from(cover) * (opacity * (1.0 / 255.0));
            *dst = truncated(f32::from(src) * rest + f32::from(colour) * opacity + MARGIN);
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::frame::FrameBuf;
    use crate::testing::{pairs, plain, run_on};

    proptest! {
        #[test]
        fn matches_the_plain_version((first, second) in pairs(), opacity in -0.1..1.1f64) {
            let (src, colour) = (first.frame(), second.frame());
            let cover = plain(src, |x, y| src.pixel(src.width() - 1 - x, y).map(|v| v.wrapping_mul(7)));
            let result = run_on(&first, |src, dst| lay_over(src, colour, cover.as_ref(), opacity, dst));
            let opacity = opacity.clamp(0.0, 1.0);
            for y in 0..src.height() {
                for x in 0..src.width() {
                    for c in 0..3 {
                        let of = |frame: Frame<'_>| f64::from(frame.pixel(x, y)[c]);
                        let share = opacity * of(cover.as_ref()) / 255.0;
                        let exact = ((1.0 - share) * of(src) + opacity * of(colour)).min(255.0);
                        let actual = of(result.as_ref());
                        prop_assert!(actual <= exact + 0.002 && actual > exact - 1.001, "{} {}", actual, exact);
                    }
                }
            }
        }
    }

    #[test]
    fn equal_colours_stay() {
        let opaque = FrameBuf::from_vec(vec![255; 256 * 3], 256, 1).unwrap();
        let src = FrameBuf::from_vec((0..=255).flat_map(|v| [v; 3]).collect(), 256, 1).unwrap();
        for step in 0..=20 {
            let mut dst = FrameBuf::new(256, 1);
            lay_over(src.as_ref(), src.as_ref(), opaque.as_ref(), f64::from(step) / 20.0, dst.as_mut());
            assert_eq!(dst, src);
        }
    }
}
