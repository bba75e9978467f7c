//! The road of a scenario as OpenDRIVE.

use std::fmt::Write;

use super::geometry::{Piece, Shape, arcs_along};
use super::turned;
use crate::{LANE_WIDTH, Path, Point};

/// The road begins this many metres before the first waypoint, so that the whole vehicle stands on it at the start.
pub const BEHIND: f64 = 15.0;
/// It goes on for this many metres after the last one, so that its end is not seen before it is reached.
pub const BEYOND: f64 = 40.0;
/// How far the road may be off the curve through the waypoints in metres.
const TOLERANCE: f64 = 0.005;
/// The curve is divided into pieces of this length in metres.
const STEP: f64 = 0.25;
/// Heights that differ by less than this are the same, in metres.
const FLAT: f64 = 1e-4;

/// The road through waypoints `[x, height, z]`, at least two that are apart from each other, as an OpenDRIVE document with this name: two
/// lanes of [`LANE_WIDTH`], of which the right one, number -1, has the waypoints in its middle. The reference line goes through the
/// waypoints, and the lanes are set off to the left of it.
pub fn write(waypoints: &[[f64; 3]], name: &str) -> String {
    let points: Vec<Point> = waypoints.iter().map(|&[x, _, z]| [x, z]).collect();
    let path = Path::through(&points, STEP);
    let pieces = plan(&path);
    let length = pieces.last().map_or(0.0, |piece| piece.s + piece.length);
    let mut text = format!(
        "<?xml version=\"1.0\" standalone=\"yes\"?>\n\
         <OpenDRIVE>\n\
         <header revMajor=\"1\" revMinor=\"4\" name=\"{}\" version=\"1.00\" north=\"0\" south=\"0\" east=\"0\" west=\"0\" vendor=\"pdk\">\n\
         <geoReference><![CDATA[+proj=tmerc +lat_0=0 +lon_0=0 +k=1 +x_0=0 +y_0=0 +datum=WGS84 +units=m +no_defs]]></geoReference>\n\
         </header>\n\
         <road name=\"{0}\" length=\"{length}\" id=\"0\" junction=\"-1\">\n\
         <link/>\n\
         <type s=\"0\" type=\"town\"><speed max=\"50\" unit=\"km/h\"/></type>\n\
         <planView>\n",
        escaped(name)
    );
    // Writing to a text cannot fail.
    for Piece { s, at: [x, y], heading, length, shape } in pieces {
        let shape = match shape {
            Shape::Arc(curvature) if curvature != 0.0 => format!("<arc curvature=\"{curvature}\"/>"),
            _ => "<line/>".to_owned(),
        };
        let _ = writeln!(
            text,
            "<geometry s=\"{s}\" x=\"{x}\" y=\"{y}\" hdg=\"{heading}\" length=\"{length}\">{shape}</geometry>"
        );
    }
    text.push_str("</planView>\n<elevationProfile>\n");
    heights(waypoints, &path, &mut text);
    text.push_str("</elevationProfile>\n<lanes>\n");
    let _ = writeln!(text, "<laneOffset s=\"0\" a=\"{}\" b=\"0\" c=\"0\" d=\"0\"/>", LANE_WIDTH / 2.0);
    text.push_str("<laneSection s=\"0\">\n");
    for (side, id) in [("left", 1), ("center", 0), ("right", -1)] {
        let (kind, width) = match id {
            0 => ("none", String::new()),
            _ => ("driving", format!("<width sOffset=\"0\" a=\"{LANE_WIDTH}\" b=\"0\" c=\"0\" d=\"0\"/>")),
        };
        let (mark, color, change) = match id {
            0 => ("broken", "yellow", "both"),
            _ => ("solid", "standard", "none"),
        };
        let _ = writeln!(
            text,
            "<{side}><lane id=\"{id}\" type=\"{kind}\" level=\"false\"><link/>{width}<roadMark sOffset=\"0\" type=\"{mark}\" \
             weight=\"standard\" color=\"{color}\" width=\"0.16\" laneChange=\"{change}\"/></lane></{side}>"
        );
    }
    text.push_str("</laneSection>\n</lanes>\n</road>\n</OpenDRIVE>\n");
    text
}

/// The reference line.
fn plan(path: &Path) -> Vec<Piece> {
    let points: Vec<_> = path.points().iter().map(|&point| turned(point)).collect();
    let between = |a: usize, b: usize| libm::atan2(points[b][1] - points[a][1], points[b][0] - points[a][0]);
    let last = points.len() - 1;
    let mut headings: Vec<f64> =
        (0..=last).map(|i| between(i.saturating_sub(1), (i + 1).min(last))).collect();
    // One course of headings, without jumps of a whole turn.
    for i in 1..headings.len() {
        let turn = 2.0 * std::f64::consts::PI;
        headings[i] -= turn * ((headings[i] - headings[i - 1]) / turn).round();
    }
    let straight = |at, heading, length| Piece { s: 0.0, at, heading, length, shape: Shape::Arc(0.0) };
    let (first, end) = (headings[0], headings[last]);
    let start = [points[0][0] - BEHIND * libm::cos(first), points[0][1] - BEHIND * libm::sin(first)];
    let mut pieces = vec![straight(start, first, BEHIND)];
    pieces.extend(arcs_along(&points, &headings, TOLERANCE));
    pieces.push(straight(points[last], end, BEYOND));
    for i in 1..pieces.len() {
        pieces[i].s = pieces[i - 1].s + pieces[i - 1].length;
    }
    pieces
}

/// The heights as cubics from waypoint to waypoint, with slopes that go over into each other; level before the first and behind the last.
fn heights(waypoints: &[[f64; 3]], path: &Path, text: &mut String) {
    let mut line = |s: f64, [a, b, c, d]: [f64; 4]| {
        let _ = writeln!(text, "<elevation s=\"{s}\" a=\"{a}\" b=\"{b}\" c=\"{c}\" d=\"{d}\"/>");
    };
    let height = |i: usize| waypoints[i][1];
    let last = waypoints.len() - 1;
    line(0.0, [height(0), 0.0, 0.0, 0.0]);
    if waypoints.iter().all(|point| (point[1] - height(0)).abs() < FLAT) {
        return;
    }
    let along = path.places(waypoints.iter().map(|&[x, _, z]| [x, z]));
    let slope = |i: usize| match i {
        0 => 0.0,
        i if i == last => 0.0,
        i => (height(i + 1) - height(i - 1)) / (along[i + 1] - along[i - 1]),
    };
    for i in 0..last {
        let step = along[i + 1] - along[i];
        let (from, to) = (slope(i), slope(i + 1));
        let rise = (height(i + 1) - height(i)) / step;
        let c = (3.0 * rise - 2.0 * from - to) / step;
        let d = (from + to - 2.0 * rise) / (step * step);
        line(BEHIND + along[i], [height(i), from, c, d]);
    }
    line(BEHIND + along[last], [height(last), 0.0, 0.0, 0.0]);
}

fn escaped(name: &str) -> String {
    name.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}
