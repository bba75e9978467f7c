//! Perspective maps of the whole image: the image as a flat picture, seen from anywhere.

use crate::frame::{Frame, FrameMut};
use crate::sample::{Border, Padded, SUBPIXELS};
use crate::simd::vectorised;

/// Places further away than this, in 1/32 pixel, count as this far: beyond the border of any image.
const FAR: f64 = (1u32 << 30) as f64;

/// A projective map of the plane: `x' = (m[0] x + m[1] y + m[2]) / w` and `y' = (m[3] x + m[4] y + m[5]) / w` with
/// `w = m[6] x + m[7] y + m[8]`, in pixels, `x` to the right and `y` down from the centre of the first pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Perspective(pub [f64; 9]);

impl Perspective {
    /// The map that takes the corners of an image of this size to four places: upper left, upper right, lower right,
    /// lower left. None if they are not the corners of a convex quadrilateral in this order.
    ///
    /// Heckbert, "Fundamentals of texture mapping and image warping" (1989): the map from a square to a quadrilateral.
    pub fn of_corners(width: f64, height: f64, corners: [[f64; 2]; 4]) -> Option<Self> {
        let [[x0, y0], [x1, y1], [x2, y2], [x3, y3]] = corners;
        // In this order each corner turns to the right; a turn to the left would make it hollow or a bow tie.
        for start in 0..4 {
            let [a, b, c] = [0, 1, 2].map(|step| corners[(start + step) % 4]);
            let turn = (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0]);
            if turn.is_nan() || turn <= 0.0 {
                return None;
            }
        }
        let (dx1, dx2, sx) = (x1 - x2, x3 - x2, x0 - x1 + x2 - x3);
        let (dy1, dy2, sy) = (y1 - y2, y3 - y2, y0 - y1 + y2 - y3);
        let determinant = dx1 * dy2 - dx2 * dy1;
        let g = (sx * dy2 - dx2 * sy) / determinant;
        let h = (dx1 * sy - sx * dy1) / determinant;
        let square =
            [x1 - x0 + g * x1, x3 - x0 + h * x3, x0, y1 - y0 + g * y1, y3 - y0 + h * y3, y0, g, h, 1.0];
        // The corners of the image, half a pixel outside of the centres of its outermost pixels, are those of a square.
        let [a, b, c, d, e, f, g, h, i] = square;
        let across = |a: f64, b: f64, c: f64| {
            let (a, b) = (a / width, b / height);
            [a, b, c + 0.5 * (a + b)]
        };
        let ([a, b, c], [d, e, f], [g, h, i]) = (across(a, b, c), across(d, e, f), across(g, h, i));
        // Places are given from the corner of the image too.
        let map = [a - 0.5 * g, b - 0.5 * h, c - 0.5 * i, d - 0.5 * g, e - 0.5 * h, f - 0.5 * i, g, h, i];
        map.iter().all(|number| number.is_finite()).then_some(Self(map))
    }

    /// The map back, up to a factor that is the same for all numbers, if there is one.
    pub fn inverse(&self) -> Option<Self> {
        let [a, b, c, d, e, f, g, h, i] = self.0;
        let minors = [
            e * i - f * h,
            c * h - b * i,
            b * f - c * e,
            f * g - d * i,
            a * i - c * g,
            c * d - a * f,
            d * h - e * g,
            b * g - a * h,
            a * e - b * d,
        ];
        let determinant = a * minors[0] + b * minors[3] + c * minors[6];
        let back = minors.map(|minor| minor / determinant);
        back.iter().all(|number| number.is_finite()).then_some(Self(back))
    }
}

/// What [`warp_perspective`] keeps between calls.
#[derive(Debug, Clone, Default)]
pub struct Workspace {
    padded: Padded,
    /// The places of a row, in 1/32 pixel.
    xs: Vec<i32>,
    ys: Vec<i32>,
}

/// Moves every pixel of `src` as `map` says, with linear interpolation; what the image does not cover, and what lies
/// behind the eye, is black, and edges fade to black over one pixel. Places are rounded to 1/32 pixel. A map that cannot
/// be inverted gives a black frame.
///
/// # Panics
/// If the sizes differ.
pub fn warp_perspective(src: Frame<'_>, mut dst: FrameMut<'_>, map: &Perspective, workspace: &mut Workspace) {
    assert!(src.same_size(&dst.as_ref()), "warp_perspective between frames of different size");
    let Some(Perspective([a, b, c, d, e, f, g, h, i])) = map.inverse() else {
        return dst.rows_mut().for_each(|row| row.fill(0));
    };
    let Workspace { padded, xs, ys } = workspace;
    padded.fill(src, 1, Border::Black);
    xs.resize(src.width(), 0);
    ys.resize(src.width(), 0);
    for y in 0..src.height() {
        let down = y as f64;
        // What a row adds to numerators and denominator.
        places([a, d, g], [b * down + c, e * down + f, h * down + i], xs, ys);
        padded.sample(xs, ys, dst.row_mut(y));
    }
}

/// A quotient in 1/32 pixel, rounded half to even; far away where the denominator is not positive.
#[inline(always)]
fn place(numerator: f64, denominator: f64) -> i32 {
    /// Adding this to a number of magnitude below 2^51 leaves it, rounded, in the lower bits.
    const WHOLE: f64 = 6_755_399_441_055_744.0;
    let quotient = numerator * f64::from(SUBPIXELS) / denominator;
    // Unlike `clamp`, this makes a number of what is none.
    #[allow(clippy::manual_clamp)]
    let near = quotient.max(-FAR).min(FAR);
    let near = if denominator > 0.0 { near } else { -FAR };
    (near + WHOLE).to_bits() as i32
}

vectorised! {
    fn places / places_avx2 (
        factors: [f64; 3], row: [f64; 3], xs: &mut [i32], ys: &mut [i32],
    ) {
        let mut column = 0.0;
        for (x, y) in xs.iter_mut().zip(ys) {
            let denominator = factors[2] * column + row[2];
            *x = place(factors[0] * column + row[0], denominator);
            *y = place(factors[1] * column + row[1], denominator);
            column += 1.0;
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::frame::FrameBuf;
    use crate::testing::{plain, run_on, samples};
    use crate::warp::{self, Affine, warp_affine};

    fn apply(Perspective(m): &Perspective, x: f64, y: f64) -> [f64; 2] {
        let w = m[6] * x + m[7] * y + m[8];
        [(m[0] * x + m[1] * y + m[2]) / w, (m[3] * x + m[4] * y + m[5]) / w]
    }

    /// Interpolates pixel by pixel, testing each of the four neighbours.
    fn plain_warp(src: Frame<'_>, map: &Perspective) -> FrameBuf {
        let back = map.inverse().unwrap().0;
        plain(src, |x, y| {
            let (x, y) = (x as f64, y as f64);
            let w = back[6] * x + (back[7] * y + back[8]);
            if w.is_nan() || w <= 0.0 {
                return [0; 3];
            }
            let place = |row: &[f64]| {
                let quotient = (row[0] * x + (row[1] * y + row[2])) * 32.0 / w;
                quotient.clamp(-1e9, 1e9).round_ties_even() as i64
            };
            let (x, y) = (place(&back[..3]), place(&back[3..6]));
            let at = |x: i64, y: i64, channel: usize| {
                let inside = (0..src.width() as i64).contains(&x) && (0..src.height() as i64).contains(&y);
                if inside { i64::from(src.pixel(x as usize, y as usize)[channel]) } else { 0 }
            };
            let (left, top) = (x.div_euclid(32), y.div_euclid(32));
            let (right, down) = (x.rem_euclid(32), y.rem_euclid(32));
            [0, 1, 2].map(|channel| {
                let sum = at(left, top, channel) * (32 - right) * (32 - down)
                    + at(left + 1, top, channel) * right * (32 - down)
                    + at(left, top + 1, channel) * (32 - right) * down
                    + at(left + 1, top + 1, channel) * right * down;
                ((sum + 512) >> 10) as u8
            })
        })
    }

    /// Maps that bend the unit square, with the eye in front of it or not.
    fn maps() -> impl Strategy<Value = Perspective> {
        prop::array::uniform8(-1.0..1.0f64).prop_map(|n| {
            let [a, b, c, d, e, f, g, h] = n;
            Perspective([
                1.0 + a / 2.0,
                b / 2.0,
                30.0 * c,
                d / 2.0,
                1.0 + e / 2.0,
                9.0 * f,
                g / 40.0,
                h / 20.0,
                1.0,
            ])
        })
    }

    proptest! {
        #[test]
        fn matches_the_plain_version(sample in samples(), map in maps()) {
            prop_assume!(map.inverse().is_some());
            let mut workspace = Workspace::default();
            let result = run_on(&sample, |src, dst| warp_perspective(src, dst, &map, &mut workspace));
            prop_assert_eq!(result, plain_warp(sample.frame(), &map));
        }

        #[test]
        fn corners_go_where_they_are_told_to(bent in prop::array::uniform8(-4.0..4.0f64)) {
            let (width, height) = (37.0, 23.0);
            let from = [[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]];
            let to: [[f64; 2]; 4] = std::array::from_fn(|i| [from[i][0] + bent[2 * i], from[i][1] + bent[2 * i + 1]]);
            let map = Perspective::of_corners(width, height, to).unwrap();
            for (from, to) in from.into_iter().zip(to) {
                let [x, y] = apply(&map, from[0] - 0.5, from[1] - 0.5);
                prop_assert!((x + 0.5 - to[0]).abs() < 1e-9 && (y + 0.5 - to[1]).abs() < 1e-9, "{x} {y} {to:?}");
                let back = map.inverse().unwrap();
                let [x, y] = apply(&back, to[0] - 0.5, to[1] - 0.5);
                prop_assert!((x + 0.5 - from[0]).abs() < 1e-9 && (y + 0.5 - from[1]).abs() < 1e-9);
            }
        }

        #[test]
        fn a_map_without_perspective_is_affine(sample in samples(), right in -9i32..9, down in -9i32..9) {
            let (right, down) = (f64::from(right) / 32.0, f64::from(down) / 32.0);
            let mut expected = sample.frame().to_buf();
            let map = Affine::translation(right, down);
            warp_affine(sample.frame(), expected.as_mut(), &map, &mut warp::Workspace::default());
            let map = Perspective([1.0, 0.0, right, 0.0, 1.0, down, 0.0, 0.0, 1.0]);
            let mut workspace = Workspace::default();
            let found = run_on(&sample, |src, dst| warp_perspective(src, dst, &map, &mut workspace));
            prop_assert_eq!(found, expected);
        }
    }

    #[test]
    fn corners_that_are_not_a_quadrilateral_are_rejected() {
        for corners in [
            [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]],
            [[0.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, 0.0]],
            [[0.0, 0.0], [1.0, 0.0], [0.2, 0.2], [0.0, 1.0]],
            [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [0.0, 1.0]],
            [[f64::NAN, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]],
            [[0.0; 2]; 4],
        ] {
            assert_eq!(Perspective::of_corners(4.0, 3.0, corners), None, "{corners:?}");
        }
    }

    #[test]
    fn maps_without_inverse_give_black() {
        let src = FrameBuf::from_vec(vec![200; 40 * 6 * 3], 40, 6).unwrap();
        for map in [Perspective([0.0; 9]), Perspective([f64::NAN; 9]), Perspective([1.0; 9])] {
            let mut dst = src.clone();
            warp_perspective(src.as_ref(), dst.as_mut(), &map, &mut Workspace::default());
            assert!(dst.data().iter().all(|&v| v == 0), "{map:?}");
        }
    }
}
