//! Quarter turns: what the matrices of a file say about how its pictures are held up, and pictures turned so.

use crate::convert::Yuv420;

/// 1 in the fixed-point numbers of a matrix.
const ONE: i32 = 1 << 16;

/// How many quarter turns to the right a matrix makes, given by its first two rows; none if it does something else, such as mirroring. By how much it moves the picture does not matter, since a video has one.
pub fn quarter_turns([a, b, u, c, d, v]: [i32; 6]) -> Option<u8> {
    if (u, v) != (0, 0) {
        return None;
    }
    match [a, b, c, d].map(|number| (number / ONE, number % ONE)) {
        [(1, 0), (0, 0), (0, 0), (1, 0)] => Some(0),
        [(0, 0), (1, 0), (-1, 0), (0, 0)] => Some(1),
        [(-1, 0), (0, 0), (0, 0), (-1, 0)] => Some(2),
        [(0, 0), (-1, 0), (1, 0), (0, 0)] => Some(3),
        _ => None,
    }
}

/// Turns a picture to the right by this many quarters; `turned` is memory. Each plane is turned by itself, so that chroma comes to lie
/// half a pixel beside where it was, as in other programs.
pub fn turn(picture: &mut Yuv420, quarters: u8, turned: &mut Yuv420) {
    let (width, height) = (picture.width, picture.height);
    match quarters % 4 {
        0 => return,
        2 => turned.reset(width, height),
        _ => turned.reset(height, width),
    }
    let sizes =
        [(width, height), (width.div_ceil(2), height.div_ceil(2)), (width.div_ceil(2), height.div_ceil(2))];
    for ((from, to), size) in picture.planes().into_iter().zip(turned.planes_mut()).zip(sizes) {
        turn_plane(from, size, quarters % 4, to);
    }
    turned.coding = picture.coding;
    std::mem::swap(picture, turned);
}

fn turn_plane(from: &[u8], (width, height): (usize, usize), quarters: u8, to: &mut [u8]) {
    match quarters {
        1 => {
            for (x, row) in to.chunks_exact_mut(height).enumerate() {
                for (out, from) in row.iter_mut().rev().zip(from.chunks_exact(width)) {
                    *out = from[x];
                }
            }
        }
        2 => {
            for (out, &value) in to.iter_mut().rev().zip(from) {
                *out = value;
            }
        }
        _ => {
            for (x, row) in to.chunks_exact_mut(height).rev().enumerate() {
                for (out, from) in row.iter_mut().zip(from.chunks_exact(width)) {
                    *out = from[x];
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn matrices_that_turn_by_quarters_are_known_and_others_are_not() {
        assert_eq!(quarter_turns([ONE, 0, 0, 0, ONE, 0]), Some(0));
        assert_eq!(quarter_turns([0, ONE, 0, -ONE, 0, 0]), Some(1));
        assert_eq!(quarter_turns([-ONE, 0, 0, 0, -ONE, 0]), Some(2));
        assert_eq!(quarter_turns([0, -ONE, 0, ONE, 0, 0]), Some(3));
        for other in [
            [-ONE, 0, 0, 0, ONE, 0],
            [ONE, 0, 0, 0, -ONE, 0],
            [0; 6],
            [ONE / 2, 0, 0, 0, ONE / 2, 0],
            [ONE + 1, 0, 0, 0, ONE, 0],
            [ONE, 0, 1, 0, ONE, 0],
        ] {
            assert_eq!(quarter_turns(other), None, "{other:?}");
        }
    }

    #[test]
    fn a_picture_is_turned_to_the_right() {
        let mut picture = Yuv420::default();
        picture.reset(3, 2);
        picture.data.copy_from_slice(&[1, 2, 3, 4, 5, 6, 10, 11, 20, 21]);
        let mut memory = Yuv420::default();
        for (quarters, width, height, data) in [
            (0, 3, 2, [1, 2, 3, 4, 5, 6, 10, 11, 20, 21]),
            (1, 2, 3, [4, 1, 5, 2, 6, 3, 10, 11, 20, 21]),
            (2, 3, 2, [6, 5, 4, 3, 2, 1, 11, 10, 21, 20]),
            (3, 2, 3, [3, 6, 2, 5, 1, 4, 11, 10, 21, 20]),
        ] {
            let mut turned = picture.clone();
            turn(&mut turned, quarters, &mut memory);
            assert_eq!(
                (turned.width, turned.height, &turned.data[..]),
                (width, height, &data[..]),
                "{quarters}"
            );
        }
    }
}
