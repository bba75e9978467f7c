//! Edges of a grey image, and how far each pixel is from them.

use pdk_sdk::ops::float::Edge;

/// The distances to neighbours beside, across a corner, and a knight's move away (Borgefors, "Distance transformations in digital
/// images", 1986).
const BESIDE: f32 = 1.0;
const ACROSS: f32 = 1.4;
const KNIGHT: f32 = 2.1969;

/// For each pixel whether an edge goes through it (Canny, "A computational approach to edge detection", 1986): gradients by Sobel,
/// |dx| + |dy| above `high`, or above `low` beside such a pixel, where it is the largest across the edge.
pub fn edges(grey: &[u8], width: usize, height: usize, low: i32, high: i32) -> Vec<bool> {
    let at = |x: isize, y: isize| {
        i32::from(grey[Edge::Nearest.place(y, height) * width + Edge::Nearest.place(x, width)])
    };
    let mut gradients = vec![[0; 2]; width * height];
    for y in 0..height as isize {
        for x in 0..width as isize {
            let column = |x: isize| at(x, y - 1) + 2 * at(x, y) + at(x, y + 1);
            let row = |y: isize| at(x - 1, y) + 2 * at(x, y) + at(x + 1, y);
            gradients[y as usize * width + x as usize] =
                [column(x + 1) - column(x - 1), row(y + 1) - row(y - 1)];
        }
    }
    let strength = |x: isize, y: isize| {
        let inside = (0..width as isize).contains(&x) && (0..height as isize).contains(&y);
        let [dx, dy] = if inside { gradients[y as usize * width + x as usize] } else { [0, 0] };
        dx.abs() + dy.abs()
    };
    // 1 where an edge may go on, 2 where one begins.
    let mut marks = vec![0u8; width * height];
    let mut open = Vec::new();
    for y in 0..height as isize {
        for x in 0..width as isize {
            let here = strength(x, y);
            if here <= low {
                continue;
            }
            let place = y as usize * width + x as usize;
            let [dx, dy] = gradients[place];
            // tan 22.5 degrees, in parts of 2^15.
            let (across, along) = (i64::from(dx.abs()), i64::from(dy.abs()) << 15);
            let flat = across * 13573;
            let (before, after, strictly) = if along < flat {
                (strength(x - 1, y), strength(x + 1, y), false)
            } else if along > flat + (across << 16) {
                (strength(x, y - 1), strength(x, y + 1), false)
            } else {
                let turn = if (dx ^ dy) < 0 { -1 } else { 1 };
                (strength(x - turn, y - 1), strength(x + turn, y + 1), true)
            };
            if here > before && (here > after || here == after && !strictly) {
                marks[place] = if here > high { 2 } else { 1 };
                if here > high {
                    open.push((x, y));
                }
            }
        }
    }
    while let Some((x, y)) = open.pop() {
        for (right, down) in [(-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1)] {
            let (x, y) = (x + right, y + down);
            if (0..width as isize).contains(&x) && (0..height as isize).contains(&y) {
                let mark = &mut marks[y as usize * width + x as usize];
                if *mark == 1 {
                    *mark = 2;
                    open.push((x, y));
                }
            }
        }
    }
    marks.into_iter().map(|mark| mark == 2).collect()
}

/// How far each pixel is from the nearest one that is marked; `furthest` where none is nearer.
pub fn distances(marked: &[bool], width: usize, height: usize, furthest: f32) -> Vec<f32> {
    const BEFORE: [(isize, isize, f32); 8] = [
        (-1, -2, KNIGHT),
        (1, -2, KNIGHT),
        (-2, -1, KNIGHT),
        (-1, -1, ACROSS),
        (0, -1, BESIDE),
        (1, -1, ACROSS),
        (2, -1, KNIGHT),
        (-1, 0, BESIDE),
    ];
    let mut distances: Vec<f32> = marked.iter().map(|marked| if *marked { 0.0 } else { furthest }).collect();
    // Down from the upper left, and back up with everything the other way round.
    for sign in [1, -1] {
        let place = |index: usize| if sign > 0 { index } else { width * height - 1 - index };
        for index in (0..width * height).map(place) {
            let (x, y) = ((index % width) as isize, (index / width) as isize);
            let mut least = distances[index];
            for (right, down, distance) in BEFORE {
                let (x, y) = (x + sign * right, y + sign * down);
                if (0..width as isize).contains(&x) && (0..height as isize).contains(&y) {
                    least = least.min(distances[y as usize * width + x as usize] + distance);
                }
            }
            distances[index] = least;
        }
    }
    distances
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_edge_goes_around_a_bright_square() {
        let inside = |x: usize, y: usize| (5..15).contains(&x) && (5..15).contains(&y);
        let grey: Vec<u8> = (0..400).map(|at| if inside(at % 20, at / 20) { 200 } else { 0 }).collect();
        let edges = edges(&grey, 20, 20, 50, 150);
        assert!(edges[10 * 20 + 4] || edges[10 * 20 + 5]);
        assert!(!edges[10 * 20 + 10] && !edges[0]);
        assert!((25..60).contains(&edges.iter().filter(|edge| **edge).count()));
    }

    #[test]
    fn distances_are_those_to_the_nearest_mark() {
        let mut marked = vec![false; 21 * 21];
        marked[10 * 21 + 10] = true;
        let distances = distances(&marked, 21, 21, 20.0);
        for (x, y, wanted) in [(10, 10, 0.0), (13, 10, 3.0), (12, 12, 2.8), (11, 8, 2.1969), (9, 12, 2.1969)]
        {
            assert!((distances[y * 21 + x] - wanted).abs() < 1e-5, "{x} {y}");
        }
        assert!(super::distances(&[false; 4], 2, 2, 20.0).iter().all(|d| *d == 20.0));
    }
}
