//! Edges of a grey image, and how far each pixel is from them.

use pdk_sdk::ops::float::Edge;

/// The distances to neighbours beside, across a corner, and a knight's move away (Borgefors, "Distance transformations in digital
/// images", 1986).
const BESIDE: f32 = 1.0;
const ACROSS: f32 = 1.4;
const KNIGHT: f32 = 2.1969;

/// Values with `border` more on each side, so that neighbours need no look at where the image ends. `beyond` says what lies there.
pub fn bordered<T: Copy>(
    values: &[T],
    width: usize,
    height: usize,
    border: usize,
    beyond: impl Fn(isize, isize) -> T,
) -> Vec<T> {
    let (across, down) = (width as isize, height as isize);
    let reach = border as isize;
    let mut wide = Vec::with_capacity((width + 2 * border) * (height + 2 * border));
    for y in -reach..down + reach {
        if (0..down).contains(&y) {
            wide.extend((-reach..0).map(|x| beyond(x, y)));
            wide.extend_from_slice(&values[y as usize * width..][..width]);
            wide.extend((across..across + reach).map(|x| beyond(x, y)));
        } else {
            wide.extend((-reach..across + reach).map(|x| beyond(x, y)));
        }
    }
    wide
}

/// For each pixel whether an edge goes through it (Canny, "A computational approach to edge detection", 1986): gradients by Sobel,
/// |dx| + |dy| above `high`, or above `low` beside such a pixel, where it is the largest across the edge.
pub fn edges(grey: &[u8], width: usize, height: usize, low: i32, high: i32) -> Vec<bool> {
    let nearest =
        |x: isize, y: isize| grey[Edge::Nearest.place(y, height) * width + Edge::Nearest.place(x, width)];
    let wide = bordered(grey, width, height, 1, nearest);
    let line = width + 2;
    let mut gradients = Vec::with_capacity(width * height);
    for y in 0..height {
        let [above, here, below] = [0, 1, 2].map(|down| &wide[(y + down) * line..][..line]);
        for x in 0..width {
            let at = |row: &[u8], right: usize| i32::from(row[x + right]);
            let column = |right: usize| at(above, right) + 2 * at(here, right) + at(below, right);
            let row = |row: &[u8]| at(row, 0) + 2 * at(row, 1) + at(row, 2);
            gradients.push([column(2) - column(0), row(below) - row(above)]);
        }
    }
    let strengths: Vec<i32> = gradients.iter().map(|[dx, dy]| dx.abs() + dy.abs()).collect();
    // Outside there are none.
    let strengths = bordered(&strengths, width, height, 1, |_, _| 0);
    // 1 where an edge may go on, 2 where one begins.
    let mut marks = vec![0u8; line * (height + 2)];
    let mut open = Vec::new();
    for y in 0..height {
        for x in 0..width {
            let place = (y + 1) * line + x + 1;
            let here = strengths[place];
            if here <= low {
                continue;
            }
            let [dx, dy] = gradients[y * width + x];
            // tan 22.5 degrees, in parts of 2^15.
            let (across, along) = (i64::from(dx.abs()), i64::from(dy.abs()) << 15);
            let flat = across * 13573;
            let (step, strictly) = if along < flat {
                (1, false)
            } else if along > flat + (across << 16) {
                (line, false)
            } else if (dx ^ dy) < 0 {
                (line - 1, true)
            } else {
                (line + 1, true)
            };
            let (before, after) = (strengths[place - step], strengths[place + step]);
            if here > before && (here > after || here == after && !strictly) {
                marks[place] = if here > high { 2 } else { 1 };
                if here > high {
                    open.push(place);
                }
            }
        }
    }
    while let Some(place) = open.pop() {
        for step in [1, line - 1, line, line + 1] {
            for next in [place - step, place + step] {
                if marks[next] == 1 {
                    marks[next] = 2;
                    open.push(next);
                }
            }
        }
    }
    let rows = marks.chunks_exact(line).skip(1).take(height);
    rows.flat_map(|row| row[1..=width].iter().map(|mark| *mark == 2)).collect()
}

/// How far each pixel is from the nearest one that is marked; `furthest` if none is nearer.
pub fn distances(marked: &[bool], width: usize, height: usize, furthest: f32) -> Vec<f32> {
    const BORDER: usize = 2;
    let line = width + 2 * BORDER;
    let near: Vec<f32> = marked.iter().map(|marked| if *marked { 0.0 } else { furthest }).collect();
    let mut wide = bordered(&near, width, height, BORDER, |_, _| furthest);
    // How far back neighbours are that have been looked at before.
    let before = [
        (2 * line + 1, KNIGHT),
        (2 * line - 1, KNIGHT),
        (line + 2, KNIGHT),
        (line + 1, ACROSS),
        (line, BESIDE),
        (line - 1, ACROSS),
        (line - 2, KNIGHT),
        (1, BESIDE),
    ];
    let places = || (0..height).flat_map(move |y| (0..width).map(move |x| (y + BORDER) * line + x + BORDER));
    for place in places() {
        let least = |least: f32, (back, distance): (usize, f32)| least.min(wide[place - back] + distance);
        wide[place] = before.into_iter().fold(wide[place], least);
    }
    // And back up, with everything the other way round.
    for place in places().rev() {
        let least = |least: f32, (back, distance): (usize, f32)| least.min(wide[place + back] + distance);
        wide[place] = before.into_iter().fold(wide[place], least);
    }
    let rows = wide.chunks_exact(line).skip(BORDER).take(height);
    rows.flat_map(|row| row[BORDER..BORDER + width].iter().copied()).collect()
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
