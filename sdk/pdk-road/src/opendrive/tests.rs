use serde_json::{Value, json};

use super::*;
use crate::{LANE_WIDTH, Path, distance};

fn waypoints(road: &Value) -> Vec<[f64; 3]> {
    crate::read(road).unwrap().unwrap()
}

/// Follows the driven lane of a road that was written, and says how far it is off at most.
fn off(waypoints: &[[f64; 3]]) -> f64 {
    let map = Map::read(&write(waypoints, "test & <road>")).unwrap();
    let path = Path::through(&waypoints.iter().map(|&[x, _, z]| [x, z]).collect::<Vec<_>>(), 0.25);
    let (start, [dx, dz]) = (path.points()[0], path.direction(0));
    let lane = map.follow(start, libm::atan2(dx, dz), 1e6).unwrap();
    assert_eq!(lane.width, LANE_WIDTH);
    // It begins where it was asked for, and goes on behind the last waypoint.
    let [first, .., last] = lane.points.as_slice() else { panic!("no lane") };
    assert!(distance([first[0], first[2]], start) < 0.6, "{first:?}");
    let whole = Path::of(lane.points.iter().map(|p| [p[0], p[2]]).collect());
    assert!((whole.length() - path.length() - BEYOND).abs() < 1.0, "{}", whole.length());
    assert!(
        (first[1] - waypoints[0][1]).abs() < 1e-3
            && (last[1] - waypoints[waypoints.len() - 1][1]).abs() < 1e-9
    );
    for &[x, height, z] in waypoints {
        let nearest = lane
            .points
            .iter()
            .min_by(|a, b| distance([a[0], a[2]], [x, z]).total_cmp(&distance([b[0], b[2]], [x, z])));
        assert!((nearest.unwrap()[1] - height).abs() < 0.1, "{nearest:?} {height}");
    }
    lane.points.iter().map(|&[x, _, z]| path.locate([x, z], 0, usize::MAX).lateral.abs()).fold(0.0, f64::max)
}

#[test]
fn a_road_is_read_back_within_a_centimetre() {
    for road in [
        json!({"angles": [0, 0, 0]}),
        json!({"angles": [0, 35, -35, 35, -35, 0]}),
        json!({"angles": [0, 60, 60, 60, 0], "heights": [0, 2, 4, 2, 0]}),
        json!({"waypoints": [[100, 3, -50], [50, 3, -60], [0, 5, -60]]}),
    ] {
        let worst = off(&waypoints(&road));
        assert!(worst < 0.01, "{road}: {worst}");
    }
}

#[test]
fn a_straight_road_is_written_with_lines_alone() {
    let text = write(&waypoints(&json!({"angles": [0, 0, 0, 0]})), "straight");
    assert!(!text.contains("<arc") && text.matches("<geometry").count() <= 4, "{text}");
    assert!(text.contains("<laneOffset s=\"0\" a=\"2\""));
}

/// Two straight roads that meet in a junction, from which one leads straight on and one to the right.
const JUNCTION: &str = r#"<OpenDRIVE>
<road length="50" id="1" junction="-1">
  <link><successor elementType="junction" elementId="7"/></link>
  <planView><geometry s="0" x="0" y="0" hdg="0" length="50"><line/></geometry></planView>
  <lanes>
    <laneSection s="0"><right><lane id="-1" type="driving"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane></right></laneSection>
    <laneSection s="30"><right>
      <lane id="-1" type="driving"><link><successor id="-1"/></link><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane>
      <lane id="-2" type="sidewalk"><width sOffset="0" a="2" b="0" c="0" d="0"/></lane>
    </right></laneSection>
  </lanes>
</road>
<road length="20" id="2" junction="7">
  <link><predecessor elementType="road" elementId="1" contactPoint="end"/><successor elementType="road" elementId="4" contactPoint="end"/></link>
  <planView><geometry s="0" x="50" y="0" hdg="0" length="20"><line/></geometry></planView>
  <lanes><laneSection s="0"><right><lane id="-1" type="driving"><link><successor id="1"/></link><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane></right></laneSection></lanes>
</road>
<road length="15.7" id="3" junction="7">
  <link><predecessor elementType="road" elementId="1" contactPoint="end"/></link>
  <planView><geometry s="0" x="50" y="0" hdg="0" length="15.7"><arc curvature="-0.1"/></geometry></planView>
  <lanes><laneSection s="0"><right><lane id="-1" type="driving"><width sOffset="0" a="3" b="0" c="0" d="0"/></lane></right></laneSection></lanes>
</road>
<road length="40" id="4" junction="-1">
  <link><successor elementType="road" elementId="2" contactPoint="end"/></link>
  <planView><geometry s="0" x="110" y="0" hdg="3.141592653589793" length="40"><line/></geometry></planView>
  <lanes><laneSection s="0"><left><lane id="1" type="driving"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane></left></laneSection></lanes>
</road>
<junction id="7">
  <connection id="0" incomingRoad="1" connectingRoad="3" contactPoint="start"><laneLink from="-1" to="-1"/></connection>
  <connection id="1" incomingRoad="1" connectingRoad="2" contactPoint="start"><laneLink from="-1" to="-1"/></connection>
</junction>
</OpenDRIVE>"#;

#[test]
fn a_lane_goes_on_straight_through_a_junction_and_along_a_road_that_was_drawn_the_other_way_round() {
    let map = Map::read(JUNCTION).unwrap();
    // Towards +z, a little to the right of the reference line.
    let lane = map.follow([1.0, 5.0], 0.0, 1000.0).unwrap();
    let last = lane.points.last().unwrap();
    assert!(
        (last[2] - 110.0).abs() < 1e-6 && lane.points.iter().all(|p| (p[0] - 1.75).abs() < 1e-6),
        "{last:?}"
    );
    assert!((lane.points[0][2] - 5.0).abs() < 0.6);
    assert_eq!(lane.width, 3.5);
    assert_eq!(map.follow([1.0, 5.0], 0.0, 30.0).unwrap().points.len(), 31);
}

#[test]
fn a_lane_is_followed_until_it_tapers_off() {
    // 100 m, of which the lane has the same width for 50 m.
    let map = |width: f64, slope: f64| {
        let widths = format!(
            r#"<width sOffset="0" a="{width}" b="0" c="0" d="0"/><width sOffset="50" a="{width}" b="{slope}" c="0" d="0"/>"#
        );
        let text = format!(
            r#"<OpenDRIVE><road length="100" id="1" junction="-1">
            <planView><geometry s="0" x="0" y="0" hdg="0" length="100"><line/></geometry></planView>
            <lanes><laneSection s="0"><right><lane id="-1" type="driving">{widths}</lane></right></laneSection></lanes>
            </road></OpenDRIVE>"#
        );
        Map::read(&text).unwrap()
    };
    let lane = map(3.5, -0.11).follow([1.0, 5.0], 0.0, 1000.0).unwrap();
    let end = |lane: &Lane| lane.points[lane.points.len() - 1][2];
    assert!((end(&lane) - 63.0).abs() < 1e-6 && (lane.width - 2.07).abs() < 1e-6, "{lane:?}");
    let error = map(3.5, -0.11).follow([1.0, 60.0], 0.0, 1000.0).unwrap_err();
    assert!(error.contains("ends after 3.0 m"), "{error}");
    // One that is narrow where it begins is meant to be so.
    let lane = map(1.8, -0.01).follow([1.0, 5.0], 0.0, 1000.0).unwrap();
    assert!((end(&lane) - 100.0).abs() < 1e-6 && (lane.width - 1.3).abs() < 1e-6, "{lane:?}");
}

#[test]
fn a_road_that_cannot_be_followed_is_reported() {
    let map = Map::read(JUNCTION).unwrap();
    let error = map.follow([1.0, 5.0], 3.0, 100.0).unwrap_err();
    assert!(error.contains("no lane within 6 m of x 1.0, z 5.0 that leads towards 172 degrees"), "{error}");
    let error = map.follow([1.75, 109.0], 0.0, 100.0).unwrap_err();
    assert!(error.contains("ends after"), "{error}");
    for (text, expected) in [
        ("<a/>", "not OpenDRIVE"),
        ("nothing", "not XML"),
        ("<OpenDRIVE/>", "has no roads"),
        (
            "<OpenDRIVE><road id=\"9\" length=\"x\"/></OpenDRIVE>",
            "road `9` of the map: `length` of `road` is `x`",
        ),
        ("<OpenDRIVE><road id=\"9\" length=\"5\"/></OpenDRIVE>", "has no `planView`"),
    ] {
        let error = Map::read(text).unwrap_err();
        assert!(error.contains(expected), "{error}");
    }
}
