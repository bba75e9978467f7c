//! The part of a drive in which the levels decide.

use std::ops::Range;

/// The shortest span of frames that holds this share of all influence, without its sign; none if there is no influence. `influence` begins with the
/// frame `first`.
pub fn shortest(influence: &[f64], first: usize, share: f64) -> Option<Range<usize>> {
    let all: f64 = influence.iter().map(|by| by.abs()).sum();
    if all <= 0.0 {
        return None;
    }
    let (mut start, mut held) = (0, 0.0);
    let mut best: Option<Range<usize>> = None;
    for (frame, by) in influence.iter().enumerate() {
        held += by.abs();
        while start < frame && held - influence[start].abs() >= share * all {
            held -= influence[start].abs();
            start += 1;
        }
        let length = frame + 1 - start;
        if held >= share * all && best.as_ref().is_none_or(|best| length < best.len()) {
            best = Some(start..frame + 1);
        }
    }
    best.map(|span| first + span.start..first + span.end)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shortest_span_is_found_wherever_it_lies() {
        assert_eq!(shortest(&[0.25, -3.0, 2.0, 0.25, 1.0], 10, 0.6), Some(11..13));
        assert_eq!(shortest(&[0.1, -3.0, 2.0, 0.1, 1.0], 0, 0.4), Some(1..2));
        assert_eq!(shortest(&[1.0, 1.0], 0, 1.0), Some(0..2));
        assert_eq!(shortest(&[0.0, 0.0], 0, 0.5), None);
        assert_eq!(shortest(&[], 0, 0.5), None);
    }
}
