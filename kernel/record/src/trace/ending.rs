//! Which frames show how a scenario ended: the last one, and some before it.

/// How long before the last frame the others are, in seconds; the longest first.
pub const BEFORE: [f64; 2] = [2.0, 1.0];

/// The positions of the last of some times, which are in order, and of those at least [`BEFORE`] it, as far as there are.
pub fn before_the_last(times: &[f64]) -> Vec<usize> {
    let Some(last) = times.last() else { return Vec::new() };
    // Half a millisecond allows for times that are sums of rounded frame times.
    let at = |before: &f64| times.iter().rposition(|time| *time <= last - before + 0.0005);
    let mut positions: Vec<usize> = BEFORE.iter().filter_map(at).chain([times.len() - 1]).collect();
    positions.dedup();
    positions
}
