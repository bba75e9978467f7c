//! How the edges of chosen pixels are treated: gaps are closed, small spots left out, and what remains is blended over some pixels.

/// What is done, in pixels; 0 for what is not.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Treatment {
    /// Gaps of up to twice this width are closed.
    pub close: usize,
    /// Spots of fewer pixels are left out.
    pub smallest: usize,
    /// Edges are blended over this many pixels.
    pub soft: usize,
}

/// Treats edges frame after frame. Keeps its memory, so that only the first frame of a size allocates.
#[derive(Default)]
pub struct Edges {
    /// Whether a pixel is chosen.
    chosen: Vec<bool>,
    /// For each column how far back a pixel is that spreads.
    since: Vec<usize>,
    /// Whether a pixel belongs to a spot that has been found.
    seen: Vec<bool>,
    /// The pixels of a spot.
    spot: Vec<usize>,
    /// Weights in the middle of a step.
    weights: Vec<u8>,
    /// Sums of the weights up to each place of a line.
    sums: Vec<u64>,
}

/// The lines of a frame in one direction.
#[derive(Clone, Copy)]
struct Lines {
    count: usize,
    length: usize,
    /// From one line to the next, and from one pixel of a line to the next.
    apart: usize,
    step: usize,
}

impl Lines {
    fn of(width: usize, height: usize) -> [Self; 2] {
        let rows = Self { count: height, length: width, apart: width, step: 1 };
        [rows, Self { count: width, length: height, apart: 1, step: width }]
    }

    fn at(self, line: usize, place: usize) -> usize {
        line * self.apart + place * self.step
    }
}

impl Edges {
    /// Closes gaps, leaves out small spots, and softens the edges, in this order, in a frame of `size`, width and height.
    pub fn treat(&mut self, weights: &mut [u8], size: (usize, usize), treatment: Treatment) {
        let (width, height) = size;
        let lines = Lines::of(width, height);
        if treatment.close > 0 || treatment.smallest > 0 {
            self.chosen.clear();
            self.chosen.extend(weights.iter().map(|weight| *weight > 127));
            if treatment.close > 0 {
                // What lies beyond the frame is neither chosen nor left out.
                for value in [true, false] {
                    spread(&mut self.chosen, width, treatment.close, value, &mut self.since);
                }
            }
            if treatment.smallest > 0 {
                self.leave_out_small(width, height, treatment.smallest);
            }
            for (weight, chosen) in weights.iter_mut().zip(&self.chosen) {
                *weight = u8::from(*chosen) * 255;
            }
        }
        if treatment.soft > 0 {
            let soft = treatment.soft;
            self.weights.clear();
            self.weights.resize(weights.len(), 0);
            average(weights, &mut self.weights, &mut self.sums, lines[0], soft);
            average(&self.weights, weights, &mut self.sums, lines[1], soft);
        }
    }

    /// Leaves out spots, joined by their sides, of fewer pixels.
    fn leave_out_small(&mut self, width: usize, height: usize, smallest: usize) {
        let Self { chosen, seen, spot, .. } = self;
        seen.clear();
        seen.resize(chosen.len(), false);
        for start in 0..chosen.len() {
            if !chosen[start] || std::mem::replace(&mut seen[start], true) {
                continue;
            }
            spot.clear();
            spot.push(start);
            let mut next = 0;
            while let Some(&at) = spot.get(next) {
                next += 1;
                let (x, y) = (at % width, at / width);
                let sides = [
                    (x > 0).then(|| at - 1),
                    (x + 1 < width).then(|| at + 1),
                    (y > 0).then(|| at - width),
                    (y + 1 < height).then(|| at + width),
                ];
                for side in sides.into_iter().flatten() {
                    if chosen[side] && !std::mem::replace(&mut seen[side], true) {
                        spot.push(side);
                    }
                }
            }
            if spot.len() < smallest {
                spot.iter().for_each(|&at| chosen[at] = false);
            }
        }
    }
}

/// Spreads `value` in a frame of rows of this width to all pixels within a square of `reach` pixels around those that have it. Keeps `since`, so
/// that only the first frame of a size allocates.
pub fn spread(pixels: &mut [bool], width: usize, reach: usize, value: bool, since: &mut Vec<usize>) {
    // To one side and then to the other: what the first has reached carries the second no further than its origin.
    for row in pixels.chunks_exact_mut(width) {
        spread_on(row.chunks_exact_mut(1), reach, value, &mut [0]);
        spread_on(row.chunks_exact_mut(1).rev(), reach, value, &mut [0]);
    }
    since.resize(width, 0);
    spread_on(pixels.chunks_exact_mut(width), reach, value, since);
    spread_on(pixels.chunks_exact_mut(width).rev(), reach, value, since);
}

/// Spreads `value` from each line to those behind it.
fn spread_on<'a>(
    lines: impl Iterator<Item = &'a mut [bool]>,
    reach: usize,
    value: bool,
    since: &mut [usize],
) {
    since.fill(usize::MAX);
    for line in lines {
        for (pixel, since) in line.iter_mut().zip(&mut *since) {
            *since = if *pixel == value { 0 } else { since.saturating_add(1) };
            if *since <= reach {
                *pixel = value;
            }
        }
    }
}

/// The mean over `2 soft + 1` pixels of each line, whose ends are the frame's.
fn average(from: &[u8], to: &mut [u8], sums: &mut Vec<u64>, lines: Lines, soft: usize) {
    sums.clear();
    sums.resize(lines.length + 1, 0);
    for line in 0..lines.count {
        for place in 0..lines.length {
            sums[place + 1] = sums[place] + u64::from(from[lines.at(line, place)]);
        }
        for place in 0..lines.length {
            let (first, end) = (place.saturating_sub(soft), (place + soft + 1).min(lines.length));
            let count = (end - first) as u64;
            to[lines.at(line, place)] = ((sums[end] - sums[first] + count / 2) / count) as u8;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn treated(mut weights: Vec<u8>, width: usize, treatment: Treatment) -> Vec<u8> {
        let size = (width, weights.len() / width);
        let original = weights.clone();
        let mut edges = Edges::default();
        edges.treat(&mut weights, size, treatment);
        // What is left of a frame has no part in the next one.
        let mut again = original;
        edges.treat(&mut again, size, treatment);
        assert_eq!(again, weights);
        weights
    }

    fn treat(rows: &[&str], treatment: Treatment) -> Vec<String> {
        let width = rows[0].len();
        let chosen =
            rows.iter().flat_map(|row| row.bytes().map(|byte| if byte == b'#' { 255 } else { 0 })).collect();
        let rows = treated(chosen, width, treatment);
        rows.chunks(width).map(|row| row.iter().map(|&w| if w > 127 { '#' } else { '.' }).collect()).collect()
    }

    #[test]
    fn marks_spread_to_a_square() {
        let mut marks = vec![false; 9 * 6];
        marks[2 * 9 + 3] = true;
        marks[5 * 9 + 8] = true;
        let mut since = Vec::new();
        spread(&mut marks, 9, 2, true, &mut since);
        let near = |at: usize, x: usize, y: usize| (at % 9).abs_diff(x) < 3 && (at / 9).abs_diff(y) < 3;
        let expected: Vec<bool> = (0..54).map(|at| near(at, 3, 2) || near(at, 8, 5)).collect();
        assert_eq!(marks, expected);
        // The rest spreads back as far, but not from beyond the frame.
        spread(&mut marks, 9, 2, false, &mut since);
        assert!(marks[2 * 9 + 3] && marks[5 * 9 + 8] && !marks[2 * 9 + 1], "{marks:?}");
    }

    #[test]
    fn gaps_are_closed_and_small_spots_are_left_out() {
        let rows = ["##.##...", "##.##...", "##.##...", "........", ".......#"];
        let closed = treat(&rows, Treatment { close: 1, ..Treatment::default() });
        assert_eq!(closed[..3], ["#####...", "#####...", "#####..."]);
        assert_eq!(closed[4].chars().last(), Some('#'));
        let cleaned = treat(&rows, Treatment { smallest: 4, ..Treatment::default() });
        assert_eq!(cleaned, ["##.##...", "##.##...", "##.##...", "........", "........"]);
        assert_eq!(treat(&rows, Treatment { smallest: 6, ..Treatment::default() }), cleaned);
        assert!(
            treat(&rows, Treatment { smallest: 7, ..Treatment::default() })
                .iter()
                .all(|row| !row.contains('#'))
        );
    }

    #[test]
    fn soft_edges_are_blended() {
        let chosen = (0..20).map(|x| if x >= 10 { 255 } else { 0 }).collect();
        let weights = treated(chosen, 20, Treatment { soft: 2, ..Treatment::default() });
        assert_eq!(weights[6..14], [0, 0, 51, 102, 153, 204, 255, 255]);
    }
}
