//! Which frames are driven one after the other.

/// How long sequences are divided.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Pieces {
    /// Longer sequences are driven in pieces of this many frames, so that several workers and several parts of a run share them, and a
    /// run that is killed loses little.
    length: usize,
    /// This many frames before a piece are seen as well, so that what is remembered of them is there.
    warm_up: usize,
}

/// The pieces for drivers.
pub const DRIVER: Pieces = Pieces { length: 1000, warm_up: 100 };
/// The pieces for predictors, whose outputs may be large and which rarely remember anything.
pub const PREDICTOR: Pieces = Pieces { length: 100, warm_up: 10 };

/// Frames that are driven one after the other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Segment {
    /// The first frame of the sequence that it belongs to.
    pub sequence: usize,
    /// The first frame that the driver sees.
    pub from: usize,
    /// The first frame that counts.
    pub start: usize,
    /// The frame behind the last.
    pub end: usize,
}

impl Segment {
    /// The number of its frames that count.
    pub fn len(&self) -> usize {
        self.end - self.start
    }
}

/// The segments of this many frames, of which these begin a sequence, as does the first.
pub fn segments(sequences: &[usize], frames: usize, pieces: Pieces) -> Vec<Segment> {
    let Pieces { length, warm_up } = pieces;
    let mut starts: Vec<usize> = sequences.iter().copied().filter(|start| *start < frames).collect();
    if starts.first() != Some(&0) {
        starts.insert(0, 0);
    }
    let ends = starts.iter().skip(1).copied().chain([frames]);
    let of_sequence = |(sequence, end): (usize, usize)| {
        (sequence..end).step_by(length).map(move |start| Segment {
            sequence,
            from: start.saturating_sub(warm_up).max(sequence),
            start,
            end: (start + length).min(end),
        })
    };
    starts.iter().copied().zip(ends).flat_map(of_sequence).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_frame_counts_once_and_a_long_sequence_has_a_warm_up() {
        for (sequences, frames) in [(vec![0, 40, 41], 2345), (vec![], 5), (vec![0, 7, 9], 8)] {
            let all = segments(&sequences, frames, DRIVER);
            let counted: Vec<usize> = all.iter().flat_map(|segment| segment.start..segment.end).collect();
            assert!(counted.iter().copied().eq(0..frames));
            for segment in &all {
                let is_first = segment.start == segment.sequence;
                assert_eq!(segment.start - segment.from, if is_first { 0 } else { DRIVER.warm_up });
                assert!(segment.len() <= DRIVER.length && segment.from >= segment.sequence);
            }
        }
        let starts: Vec<usize> =
            segments(&[0, 40, 41], 2345, DRIVER).iter().map(|segment| segment.start).collect();
        assert_eq!(starts, [0, 40, 41, 1041, 2041]);
    }
}
