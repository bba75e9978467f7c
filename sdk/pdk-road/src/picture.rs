//! Roads as a picture.

use std::fmt::Write as _;

use crate::Road;

/// One or several roads, seen from above, as an SVG: one metre is one unit, +z is up, and a dot is the start.
pub fn svg(roads: &[&Road], width: f64) -> String {
    let points = || roads.iter().flat_map(|road| &road.waypoints);
    let bound =
        |axis: usize| points().fold((0.0f64, 0.0f64), |(low, high), p| (low.min(p[axis]), high.max(p[axis])));
    let ((left, right), (bottom, top)) = (bound(0), bound(1));
    let margin = width + 5.0;
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"{:.1} {:.1} {:.1} {:.1}\">\n",
        left - margin,
        -top - margin,
        right - left + 2.0 * margin,
        top - bottom + 2.0 * margin
    );
    for road in roads {
        let line: Vec<String> = road.waypoints.iter().map(|[x, z]| format!("{x:.2},{:.2}", -z)).collect();
        let line = line.join(" ");
        for (colour, stroke) in [("#444", width), ("#fff", 0.4)] {
            let _ = writeln!(
                text,
                "<polyline points=\"{line}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"{stroke}\"/>"
            );
        }
    }
    text += "<circle r=\"2\" fill=\"#d33\"/>\n</svg>\n";
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_road_is_drawn_within_the_picture() {
        let road = Road::from_angles(&[0.0, 20.0, 0.0], &[25.0; 3]).unwrap();
        let picture = svg(&[&road, &road], 8.0);
        assert_eq!(picture.matches("<polyline").count(), 4);
        let line = picture.split("points=\"").nth(1).unwrap().split('"').next().unwrap();
        assert_eq!(line.split(' ').count(), road.waypoints.len());
        assert!(picture.starts_with("<svg") && picture.ends_with("</svg>\n"));
    }
}
