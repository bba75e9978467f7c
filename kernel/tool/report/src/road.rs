//! Roads seen from above, with the lines that were driven on them.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use serde::Serialize;

use crate::color::{ORDERED, Rgb};
use crate::view::{Drive, Scenario};

/// A picture of a road, without its outermost tag.
#[derive(Debug, Clone, Serialize)]
pub struct Picture {
    /// The width of its coordinates.
    pub width: i32,
    /// Their height.
    pub height: i32,
    /// The tags within.
    pub body: String,
    /// What it shows, for those who do not see it.
    pub label: String,
    /// The number of the road, from 1.
    pub number: usize,
    /// How many scenarios were driven on it, and how many of them failed.
    pub caption: String,
}

/// Coordinates along the longer side.
const WIDTH: f64 = 1000.0;
/// Around the road.
const MARGIN: f64 = 34.0;
/// Failures that are nearer to each other share a mark.
const MARK: i32 = 12;
/// Names that a mark tells.
const NAMES: usize = 6;

/// Where the colours of the cross-track error change, in metres: steps of a round size up to the largest error.
pub fn classes(drives: &[Drive]) -> Vec<f64> {
    let errors = drives.iter().flat_map(|drive| &drive.scenarios).flat_map(|scenario| &scenario.path);
    let largest = errors.map(|place| place.error.abs()).fold(0.0, f64::max);
    let step = round_step(largest / ORDERED.len() as f64);
    (1..ORDERED.len()).map(|i| step * i as f64).collect()
}

/// The smallest of 1, 2, 2.5 and 5 times a power of ten that is not below a size.
pub fn round_step(size: f64) -> f64 {
    let mut power = 1e-6;
    loop {
        for factor in [1.0, 2.0, 2.5, 5.0] {
            if factor * power >= size || power > 1e9 {
                return factor * power;
            }
        }
        power *= 10.0;
    }
}

/// Metres to coordinates: turned so that the longer side lies across.
struct Frame {
    scale: f64,
    left: f64,
    top: f64,
    along_z: bool,
    height: i32,
}

impl Frame {
    /// The frame around these points of x and z.
    fn around(points: impl Iterator<Item = [f64; 2]>) -> Option<Self> {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for point in points.filter(|point| point.iter().all(|v| v.is_finite())) {
            for axis in 0..2 {
                low[axis] = low[axis].min(point[axis]);
                high[axis] = high[axis].max(point[axis]);
            }
        }
        let size = [high[0] - low[0], high[1] - low[1]];
        let longer = size[0].max(size[1]);
        // Without a point it has no size at all.
        if longer.is_nan() || longer <= 0.0 {
            return None;
        }
        let along_z = size[1] >= size[0];
        // Ahead lies to the right and right lies below, or ahead lies above.
        let (left, top, long, short) = match along_z {
            true => (low[1], low[0], size[1], size[0]),
            false => (low[0], -high[1], size[0], size[1]),
        };
        let scale = (WIDTH - 2.0 * MARGIN) / long;
        Some(Self { scale, left, top, along_z, height: (short * scale + 2.0 * MARGIN).ceil() as i32 })
    }

    fn place(&self, x: f64, z: f64) -> (i32, i32) {
        let (across, down) = if self.along_z { (z, x) } else { (x, -z) };
        let to = |value: f64, from: f64| ((value - from) * self.scale + MARGIN).round() as i32;
        (to(across, self.left), to(down, self.top))
    }
}

/// A picture for each road, the one with the most failures first.
pub fn pictures(drive: &Drive, classes: &[f64]) -> Vec<Picture> {
    let mut pictures: Vec<(usize, Picture)> = Vec::new();
    for (number, road) in drive.roads.iter().enumerate() {
        let scenarios: Vec<&Scenario> = drive.scenarios.iter().filter(|s| s.road == Some(number)).collect();
        let failed = scenarios.iter().filter(|s| s.verdict.failed()).count();
        pictures
            .extend(picture(number + 1, road, &scenarios, failed, classes).map(|picture| (failed, picture)));
    }
    pictures.sort_by_key(|(failed, picture)| (usize::MAX - failed, picture.number));
    pictures.into_iter().map(|(_, picture)| picture).collect()
}

fn picture(
    number: usize,
    road: &[[f64; 2]],
    scenarios: &[&Scenario],
    failed: usize,
    classes: &[f64],
) -> Option<Picture> {
    let driven = scenarios.iter().flat_map(|s| s.path.iter().map(|place| [place.x, place.z]));
    let frame = Frame::around(road.iter().copied().chain(driven))?;
    let mut body = String::new();
    let centre = path(road.iter().map(|[x, z]| frame.place(*x, *z)));
    let _ = writeln!(body, "<path class=\"band\" d=\"{centre}\"/>");
    for (class, lines) in lines(&frame, scenarios, classes).iter().enumerate() {
        if !lines.is_empty() {
            let (color, width) = (ORDERED[class], 4 + class);
            let _ = writeln!(
                body,
                "<path class=\"line\" d=\"{lines}\" stroke=\"{color}\" stroke-width=\"{width}\"/>"
            );
        }
    }
    if let Some([x, z]) = road.first() {
        let (x, y) = frame.place(*x, *z);
        let _ = writeln!(
            body,
            "<circle class=\"start\" cx=\"{x}\" cy=\"{y}\" r=\"9\"><title>start</title></circle>"
        );
    }
    body += &marks(&frame, scenarios);
    let scale_bar = [10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0];
    let metres = scale_bar.into_iter().rfind(|m| m * frame.scale <= WIDTH / 4.0).unwrap_or(scale_bar[0]);
    let (length, below) = ((metres * frame.scale).round() as i32, frame.height + 34);
    let _ = writeln!(
        body,
        "<path class=\"scale\" d=\"M{m} {below}h{length}\"/><text x=\"{}\" y=\"{}\" font-size=\"30\">{metres} m</text>",
        MARGIN as i32 + length + 12,
        below + 10,
        m = MARGIN as i32,
    );
    let count = scenarios.len();
    let caption = match failed {
        0 => format!("{count} driven, none failed"),
        failed => format!("{count} driven, {failed} failed"),
    };
    Some(Picture {
        width: WIDTH as i32,
        height: below + 20,
        body,
        label: format!("Road {number} from above: {caption}."),
        number,
        caption,
    })
}

/// A road from above with drives laid over each other, each in the colour of its driver, and a cross where it failed.
pub fn overlay(road: &[[f64; 2]], drives: &[(&Scenario, Rgb)], label: &str) -> Option<Picture> {
    let driven = drives.iter().flat_map(|(scenario, _)| scenario.path.iter().map(|place| [place.x, place.z]));
    let frame = Frame::around(road.iter().copied().chain(driven))?;
    let mut body =
        format!("<path class=\"band\" d=\"{}\"/>\n", path(road.iter().map(|[x, z]| frame.place(*x, *z))));
    for (scenario, color) in drives {
        let line = path(scenario.path.iter().map(|place| frame.place(place.x, place.z)));
        let _ = writeln!(body, "<path class=\"line\" d=\"{line}\" stroke=\"{color}\" stroke-width=\"5\"/>");
    }
    let failed: Vec<&Scenario> = drives.iter().map(|(scenario, _)| *scenario).collect();
    body += &marks(&frame, &failed);
    Some(Picture {
        width: WIDTH as i32,
        height: frame.height,
        body,
        label: format!("Road from above: {label}."),
        number: 0,
        caption: label.to_owned(),
    })
}

/// The driven lines, a path for each class of error. What many scenarios share is drawn once.
fn lines(frame: &Frame, scenarios: &[&Scenario], classes: &[f64]) -> Vec<String> {
    let mut paths = vec![String::new(); classes.len() + 1];
    let mut drawn = vec![BTreeSet::new(); paths.len()];
    for scenario in scenarios {
        let mut pen: Vec<Option<(i32, i32)>> = vec![None; paths.len()];
        for pair in scenario.path.windows(2) {
            let (from, to) = (frame.place(pair[0].x, pair[0].z), frame.place(pair[1].x, pair[1].z));
            let error = pair[0].error.abs().max(pair[1].error.abs());
            let class = classes.partition_point(|edge| *edge < error);
            if from == to || !drawn[class].insert((from, to)) {
                continue;
            }
            let path = &mut paths[class];
            // What is relative is shorter, and there are many.
            match pen[class] == Some(from) {
                true => path.push('l'),
                false => {
                    let _ = write!(path, "M{} {}l", from.0, from.1);
                }
            }
            let _ = write!(path, "{} {}", to.0 - from.0, to.1 - from.1);
            pen[class] = Some(to);
        }
    }
    paths
}

/// A cross where scenarios failed, which tells their names.
fn marks(frame: &Frame, scenarios: &[&Scenario]) -> String {
    let mut places: BTreeMap<(i32, i32), Vec<&Scenario>> = BTreeMap::new();
    for scenario in scenarios.iter().filter(|s| s.verdict.failed()) {
        if let Some(end) = scenario.path.last() {
            let (x, y) = frame.place(end.x, end.z);
            places.entry((x / MARK, y / MARK)).or_default().push(scenario);
        }
    }
    let mut text = String::new();
    for failed in places.values() {
        let Some(end) = failed.first().and_then(|s| s.path.last()) else { continue };
        let (x, y) = frame.place(end.x, end.z);
        let mut names: Vec<String> =
            failed.iter().take(NAMES).map(|s| format!("{}: {}", s.name, s.cause)).collect();
        if failed.len() > NAMES {
            names.push(format!("and {} more", failed.len() - NAMES));
        }
        let _ = writeln!(
            text,
            "<path class=\"mark\" tabindex=\"-1\" role=\"img\" aria-label=\"{names}\" d=\"M{} {}l22 22m0-22l-22 22\"><title>{names}</title></path>",
            x - 11,
            y - 11,
            names = minijinja::HtmlEscape(&names.join("; "))
        );
    }
    text
}

/// A line through points.
fn path(points: impl Iterator<Item = (i32, i32)>) -> String {
    let mut text = String::new();
    let mut pen = None;
    for (x, y) in points {
        let _ = match pen {
            None => write!(text, "M{x} {y}"),
            Some(before) if before == (x, y) => Ok(()),
            Some((from_x, from_y)) => write!(text, "l{} {}", x - from_x, y - from_y),
        };
        pen = Some((x, y));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::{Place, Verdict};

    fn scenario(error: f64, verdict: Verdict) -> Scenario {
        let place = |z: f64, error: f64| Place { x: error, z, error };
        Scenario {
            name: "<fog>".into(),
            cause: "lane departure".into(),
            road: Some(0),
            verdict,
            path: vec![place(0.0, 0.0), place(50.0, error), place(100.0, error)],
            ..Scenario::default()
        }
    }

    fn drive(scenarios: Vec<Scenario>) -> Drive {
        Drive { roads: vec![vec![[0.0, 0.0], [0.0, 100.0]]], scenarios, ..Drive::default() }
    }

    #[test]
    fn steps_are_round() {
        for (size, expected) in [(0.404, 0.5), (0.21, 0.25), (1.0, 1.0), (37.0, 50.0)] {
            assert!((round_step(size) - expected).abs() < 1e-9 * expected, "{size}: {}", round_step(size));
        }
        assert!(round_step(0.0) > 0.0 && round_step(f64::INFINITY).is_finite());
    }

    #[test]
    fn errors_have_their_colours_and_failures_their_marks() {
        let drive = drive(vec![scenario(0.1, Verdict::Passed), scenario(2.0, Verdict::Unsafe)]);
        let classes = classes(std::slice::from_ref(&drive));
        assert_eq!(classes.len(), ORDERED.len() - 1);
        let pictures = pictures(&drive, &classes);
        let [picture] = pictures.as_slice() else { panic!("{} pictures", pictures.len()) };
        let color = |class: usize| picture.body.contains(&ORDERED[class].to_string());
        assert!(color(0) && color(3) && !color(2), "{}", picture.body);
        assert_eq!(picture.body.matches("class=\"mark\"").count(), 1);
        assert!(picture.body.contains("&lt;fog&gt;: lane departure") && !picture.body.contains("<fog>"));
        assert_eq!(picture.caption, "2 driven, 1 failed");
    }

    #[test]
    fn what_is_driven_twice_is_drawn_once() {
        let once = pictures(&drive(vec![scenario(1.0, Verdict::Passed)]), &[0.5]);
        let twice = pictures(&drive(vec![scenario(1.0, Verdict::Passed); 2]), &[0.5]);
        assert_eq!(once[0].body, twice[0].body);
    }

    #[test]
    fn a_right_turn_stays_a_right_turn() {
        // Ahead, then to the right: on the screen clockwise in both positions.
        for road in [[[0.0, 0.0], [0.0, 90.0], [40.0, 100.0]], [[0.0, 0.0], [0.0, 30.0], [100.0, 40.0]]] {
            let frame = Frame::around(road.into_iter()).unwrap();
            let [a, b, c] = road.map(|[x, z]| frame.place(x, z));
            let turn = (b.0 - a.0) * (c.1 - b.1) - (b.1 - a.1) * (c.0 - b.0);
            assert!(turn > 0, "{a:?} {b:?} {c:?}");
        }
    }

    #[test]
    fn without_a_place_there_is_no_picture() {
        let drive = Drive { roads: vec![vec![[1.0, 1.0]]], ..Drive::default() };
        assert!(pictures(&drive, &[1.0]).is_empty());
    }
}
