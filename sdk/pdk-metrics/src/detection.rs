//! Detection: the average precision of COCO (T.-Y. Lin et al., "Microsoft COCO: Common Objects in Context", 2014), as the program
//! `pycocotools` computes it: of each class at each threshold, from the precision at 101 recalls, and the mean over all of them.
//!
//! Boxes are `[x, y, width, height]` in pixels, as in COCO's files.

/// The thresholds of intersection over union: 0.5 to 0.95 in steps of 0.05, with the rounding of the original program, which counts if
/// an overlap is exactly at a threshold.
pub const THRESHOLDS: [f64; 10] = {
    let step = (0.95 - 0.5) / 9.0;
    let mut thresholds = [0.5; 10];
    let mut place = 1;
    while place < 9 {
        thresholds[place] = place as f64 * step + 0.5;
        place += 1;
    }
    thresholds[9] = 0.95;
    thresholds
};
/// Of each class in a picture at most this many detections count, those with the highest scores.
pub const MOST_DETECTIONS: usize = 100;
/// The recalls at which the precision is taken: 0 to 1 in steps of 0.01.
const RECALLS: usize = 101;

/// What was found in a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Detection {
    /// `[x, y, width, height]`.
    pub bounds: [f64; 4],
    /// The class.
    pub class: usize,
    /// How sure the network is.
    pub score: f64,
}

/// What a picture shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Labelled {
    /// `[x, y, width, height]`.
    pub bounds: [f64; 4],
    /// The class.
    pub class: usize,
    /// Whether it is a crowd of objects: a detection in it counts neither as right nor as wrong.
    pub crowd: bool,
    /// Its area in pixels, by which it belongs to a range of sizes: that of its outline, if that is known.
    pub area: f64,
}

/// Objects of these areas count, in pixels: at least the first and at most the second.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Areas(pub f64, pub f64);

impl Areas {
    /// All.
    pub const ALL: Self = Self(0.0, 1e10);
    /// Up to 32 x 32 pixels.
    pub const SMALL: Self = Self(0.0, 1024.0);
    /// From 32 x 32 to 96 x 96 pixels.
    pub const MEDIUM: Self = Self(1024.0, 9216.0);
    /// From 96 x 96 pixels.
    pub const LARGE: Self = Self(9216.0, 1e10);

    fn leaves_out(self, area: f64) -> bool {
        area < self.0 || area > self.1
    }
}

/// A picture: what was found in it, and what it shows.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Picture {
    /// What was found.
    pub detections: Vec<Detection>,
    /// What it shows.
    pub labelled: Vec<Labelled>,
}

/// The average precisions.
#[derive(Debug, Clone, PartialEq)]
pub struct AveragePrecision {
    /// The mean over classes and thresholds: COCO's AP. None if no class has an object that counts.
    pub mean: Option<f64>,
    /// The mean over classes at each threshold.
    pub by_threshold: Vec<Option<f64>>,
    /// The mean over thresholds of each class; none if it has no object that counts.
    pub by_class: Vec<Option<f64>>,
}

/// The average precisions over pictures with this many classes.
pub fn average_precision(pictures: &[Picture], classes: usize, areas: Areas) -> AveragePrecision {
    // By class, then by threshold.
    let found: Vec<Option<[f64; THRESHOLDS.len()]>> =
        (0..classes).map(|class| of_class(pictures, class, areas)).collect();
    let mean = |values: &mut dyn Iterator<Item = f64>| {
        let values: Vec<f64> = values.collect();
        (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
    };
    AveragePrecision {
        mean: mean(&mut found.iter().flatten().flatten().copied()),
        by_threshold: (0..THRESHOLDS.len())
            .map(|place| mean(&mut found.iter().flatten().map(|of_class| of_class[place])))
            .collect(),
        by_class: found.iter().map(|of_class| mean(&mut of_class.iter().flatten().copied())).collect(),
    }
}

/// A detection, as it counts at one threshold.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Counts {
    Right,
    Wrong,
    Not,
}

fn of_class(pictures: &[Picture], class: usize, areas: Areas) -> Option<[f64; THRESHOLDS.len()]> {
    let mut objects = 0;
    // The score of each detection with how it counts at each threshold.
    let mut all: Vec<(f64, [Counts; THRESHOLDS.len()])> = Vec::new();
    for picture in pictures {
        let mut labelled: Vec<(Labelled, bool)> = picture
            .labelled
            .iter()
            .filter(|labelled| labelled.class == class)
            .map(|labelled| (*labelled, labelled.crowd || areas.leaves_out(labelled.area)))
            .collect();
        // Those that count come first; the order is kept otherwise.
        labelled.sort_by_key(|(_, ignored)| *ignored);
        objects += labelled.iter().filter(|(_, ignored)| !ignored).count();
        let mut detections: Vec<Detection> =
            picture.detections.iter().copied().filter(|found| found.class == class).collect();
        detections.sort_by(|a, b| b.score.total_cmp(&a.score));
        detections.truncate(MOST_DETECTIONS);
        let by_threshold = THRESHOLDS.map(|threshold| matched(&detections, &labelled, threshold, areas));
        for (place, detection) in detections.iter().enumerate() {
            all.push((detection.score, std::array::from_fn(|threshold| by_threshold[threshold][place])));
        }
    }
    if objects == 0 {
        return None;
    }
    // Of equal scores, the picture that comes first.
    all.sort_by(|a, b| b.0.total_cmp(&a.0));
    Some(std::array::from_fn(|threshold| precision(all.iter().map(|(_, counts)| counts[threshold]), objects)))
}

/// How each detection of a picture counts: each takes the free object that it covers best.
fn matched(
    detections: &[Detection],
    labelled: &[(Labelled, bool)],
    threshold: f64,
    areas: Areas,
) -> Vec<Counts> {
    let mut taken = vec![false; labelled.len()];
    let mut one = |detection: &Detection| {
        let mut best = threshold.min(1.0 - 1e-10);
        let mut found: Option<usize> = None;
        for (place, (object, ignored)) in labelled.iter().enumerate() {
            if taken[place] && !object.crowd {
                continue;
            }
            // One that counts is not given up for one that does not.
            if found.is_some_and(|found| !labelled[found].1) && *ignored {
                break;
            }
            let overlap = over_union(&detection.bounds, &object.bounds, object.crowd);
            if overlap >= best {
                (best, found) = (overlap, Some(place));
            }
        }
        match found {
            Some(place) => {
                taken[place] = true;
                if labelled[place].1 { Counts::Not } else { Counts::Right }
            }
            None if areas.leaves_out(detection.bounds[2] * detection.bounds[3]) => Counts::Not,
            None => Counts::Wrong,
        }
    };
    detections.iter().map(&mut one).collect()
}

/// The intersection of two boxes over their union; with a crowd, over the detection alone.
pub fn over_union(detection: &[f64; 4], object: &[f64; 4], crowd: bool) -> f64 {
    let along = |axis: usize| {
        let end = (detection[axis] + detection[axis + 2]).min(object[axis] + object[axis + 2]);
        (end - detection[axis].max(object[axis])).max(0.0)
    };
    let both = along(0) * along(1);
    let (own, other) = (detection[2] * detection[3], object[2] * object[3]);
    let union = if crowd { own } else { own + other - both };
    if union > 0.0 { both / union } else { 0.0 }
}

/// The mean of the precision at 101 recalls, of detections in the order of their scores.
fn precision(counts: impl Iterator<Item = Counts>, objects: usize) -> f64 {
    let (mut right, mut wrong) = (0_usize, 0_usize);
    let mut curve: Vec<(f64, f64)> = Vec::new();
    for counts in counts {
        match counts {
            Counts::Right => right += 1,
            Counts::Wrong => wrong += 1,
            Counts::Not => {}
        }
        let precision = right as f64 / (right as f64 + wrong as f64 + f64::EPSILON);
        curve.push((right as f64 / objects as f64, precision));
    }
    // At each recall the highest precision at it or behind it.
    let mut highest = 0.0_f64;
    for (_, precision) in curve.iter_mut().rev() {
        highest = highest.max(*precision);
        *precision = highest;
    }
    let at = |step: usize| {
        // Not divided by 100, which rounds 0.35 and others differently: a recall may be exactly there.
        let recall = step as f64 * 0.01;
        let place = curve.partition_point(|(reached, _)| *reached < recall);
        curve.get(place).map_or(0.0, |(_, precision)| *precision)
    };
    (0..RECALLS).map(at).sum::<f64>() / RECALLS as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn detection(bounds: [f64; 4], score: f64) -> Detection {
        Detection { bounds, class: 0, score }
    }

    fn labelled(bounds: [f64; 4]) -> Labelled {
        Labelled { bounds, class: 0, crowd: false, area: bounds[2] * bounds[3] }
    }

    const ONE: [f64; 4] = [0.0, 0.0, 10.0, 10.0];
    const TWO: [f64; 4] = [50.0, 50.0, 10.0, 10.0];

    #[test]
    fn what_is_found_exactly_has_a_precision_of_one() {
        let picture = Picture {
            detections: vec![detection(TWO, 0.6), detection(ONE, 0.9)],
            labelled: vec![labelled(ONE), labelled(TWO)],
        };
        let found = average_precision(&[picture], 2, Areas::ALL);
        assert!((found.mean.unwrap() - 1.0).abs() < 1e-9);
        assert_eq!(found.by_class[1], None);
    }

    #[test]
    fn half_of_the_objects_at_most_make_half_of_the_recalls() {
        let picture =
            Picture { detections: vec![detection(ONE, 0.9)], labelled: vec![labelled(ONE), labelled(TWO)] };
        // 51 of 101 recalls are reached.
        let found = average_precision(&[picture], 1, Areas::ALL).mean.unwrap();
        assert!((found - 51.0 / 101.0).abs() < 1e-9, "{found}");
    }

    #[test]
    fn a_recall_that_is_exactly_reached_is_rounded_as_in_the_original_program() {
        // 7 of 20 objects are found: the program takes 0.35000000000000003 for the 36th recall, which 7 / 20 does not reach.
        let place = |number: usize| [100.0 * number as f64, 0.0, 10.0, 10.0];
        let picture = Picture {
            detections: (0..7).map(|number| detection(place(number), 0.9)).collect(),
            labelled: (0..20).map(|number| labelled(place(number))).collect(),
        };
        let found = average_precision(&[picture], 1, Areas::ALL).mean.unwrap();
        assert!((found - 35.0 / 101.0).abs() < 1e-9, "{found}");
    }

    #[test]
    fn an_object_is_found_once_and_at_the_thresholds_that_its_overlap_reaches() {
        // Its intersection over union is 0.8, and the second one finds nothing new.
        let near = [0.0, 0.0, 10.0, 8.0];
        let picture = Picture {
            detections: vec![detection(near, 0.9), detection(ONE, 0.5)],
            labelled: vec![labelled(ONE)],
        };
        let found = average_precision(&[picture], 1, Areas::ALL);
        assert!((found.by_threshold[5].unwrap() - 1.0).abs() < 1e-9);
        assert!((found.by_threshold[9].unwrap() - 0.5).abs() < 1e-9);
        assert!((over_union(&near, &ONE, false) - 0.8).abs() < 1e-12);
    }

    #[test]
    fn a_crowd_and_an_object_of_another_size_count_neither_way() {
        let crowd = Labelled { crowd: true, ..labelled(TWO) };
        let picture = Picture {
            detections: vec![
                detection(ONE, 0.9),
                detection(TWO, 0.95),
                detection([52.0, 52.0, 4.0, 4.0], 0.97),
            ],
            labelled: vec![labelled(ONE), crowd],
        };
        let mean = |areas| average_precision(std::slice::from_ref(&picture), 1, areas).mean;
        assert!((mean(Areas::ALL).unwrap() - 1.0).abs() < 1e-9);
        assert_eq!(mean(Areas::LARGE), None);
    }
}
