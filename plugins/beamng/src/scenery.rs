//! The road of a scenario as BeamNG draws it: decals on the ground of a level, and a vehicle.

use pdk_road::{LANE_WIDTH, Path, Point};
use pdk_sdk::serde_json::{Value, json};

/// Distance between the nodes of a road in metres.
const STEP: f64 = 5.0;
/// The road begins and ends this many metres before and behind its waypoints.
const BEYOND: f64 = 15.0;
/// Width of the lines in metres.
const LINE: f64 = 0.15;

/// The numbers of the group and the vehicle among the objects of a prefab; the roads have those from 0 on.
const GROUP: u32 = 100;
const VEHICLE: u32 = 101;

/// What a road is drawn with.
#[derive(Debug, Clone, PartialEq)]
pub struct Materials {
    /// The asphalt.
    pub road: String,
    /// The lines at the edges.
    pub edge: String,
    /// The line in the middle.
    pub middle: String,
}

/// A scenario's group of objects, as the lines of a prefab file: the driven lane goes through the waypoints, `[x, height, z]` in metres, and
/// the lane for the other direction lies to its left. Heights count from `ground`.
pub fn prefab(
    name: &str,
    waypoints: &[[f64; 3]],
    ground: f64,
    materials: &Materials,
    vehicle: &Value,
) -> String {
    let points: Vec<Point> = waypoints.iter().map(|&[x, _, z]| [x, z]).collect();
    let path = Path::through(&points, 0.25);
    let group = format!("{name}_group");
    let mut vehicle = vehicle.clone();
    vehicle["__parent"] = group.as_str().into();
    let mut lines = vec![vehicle];
    let half = LANE_WIDTH / 2.0;
    let roads = [
        ("road", -half, 2.0 * LANE_WIDTH, &materials.road),
        ("left", -half - LANE_WIDTH + LINE, LINE, &materials.edge),
        ("right", half - LINE, LINE, &materials.edge),
        ("middle", -half, LINE, &materials.middle),
    ];
    for (priority, (part, lateral, width, material)) in roads.into_iter().enumerate() {
        let nodes = nodes(&path, waypoints, lateral, width, ground);
        lines.push(json!({
            "name": format!("{name}_{part}"), "class": "DecalRoad", "persistentId": persistent_id(priority as u32),
            "__parent": group, "position": nodes[0][..3], "distanceFade": [1000, 1000],
            "drivability": if part == "road" { 1 } else { -1 }, "improvedSpline": true, "looped": false, "material": material,
            "oneWay": false, "flipDirection": false, "smoothness": 0.5, "detail": 0.1, "overObjects": true, "breakAngle": 1,
            "renderPriority": priority, "textureLength": 5, "zBias": 0, "nodes": nodes,
        }));
    }
    lines.push(json!({
        "name": group, "class": "SimGroup", "persistentId": persistent_id(GROUP), "groupPosition": "0.000000 0.000000 0.000000",
        "noAutoReload": true,
    }));
    lines.iter().map(|line| format!("{line}\n")).collect()
}

/// Nodes `[x, y, z, width]` in BeamNG's axes beside a path.
fn nodes(path: &Path, waypoints: &[[f64; 3]], lateral: f64, width: f64, ground: f64) -> Vec<[f64; 4]> {
    let heights: Vec<f64> = waypoints.iter().map(|point| point[1]).collect();
    let places = path.places(waypoints.iter().map(|&[x, _, z]| [x, z]));
    let height = |along: f64| {
        let after = places.partition_point(|place| *place <= along).clamp(1, places.len() - 1);
        let (a, b) = (places[after - 1], places[after]);
        let share = ((along - a) / (b - a).max(1e-9)).clamp(0.0, 1.0);
        heights[after - 1] + (heights[after] - heights[after - 1]) * share
    };
    let length = path.length();
    let count = ((length + 2.0 * BEYOND) / STEP).ceil();
    (0..=count as u32)
        .map(|i| {
            let along = f64::from(i) / count * (length + 2.0 * BEYOND) - BEYOND;
            let [x, z] = path.beside(along, lateral);
            [x, z, ground + height(along), width]
        })
        .collect()
}

/// The identifier that an object of a prefab keeps over reloads of the level, a UUID of version 4. There is one scenario at a time, so the same
/// objects always have the same ones.
fn persistent_id(object: u32) -> String {
    format!("7064b000-0000-4000-8000-{object:012x}")
}

/// The vehicle of a prefab, at our position and heading.
pub fn vehicle(name: &str, model: &str, [x, height, z]: [f64; 3]) -> Value {
    json!({
        "name": name, "class": "BeamNGVehicle", "persistentId": persistent_id(VEHICLE), "position": [x, z, height],
        "dataBlock": "default_vehicle", "jBeam": model, "rotationMatrix": [1, 0, 0, 0, 1, 0, 0, 0, 1], "autoEnterVehicle": "false", "spawnAutoplace": "true",
    })
}

/// The turn about the vertical axis, as a quaternion x, y, z, w, by which a vehicle faces in the direction of a heading (radians, clockwise
/// from +z). A vehicle that is not turned faces towards -y, which is our -z.
pub fn facing(heading: f64) -> [f64; 4] {
    let half = (heading - std::f64::consts::PI) / 2.0;
    [0.0, 0.0, libm::sin(half), libm::cos(half)]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn materials() -> Materials {
        Materials { road: "asphalt".to_owned(), edge: "white".to_owned(), middle: "yellow".to_owned() }
    }

    #[test]
    fn a_road_is_drawn_to_the_left_of_the_driven_lane() {
        let car = vehicle("ego", "etk800", [0.0, 100.5, 0.0]);
        let text =
            prefab("pdk", &[[0.0, 0.0, 0.0], [0.0, 2.0, 50.0], [0.0, 2.0, 100.0]], 100.0, &materials(), &car);
        let lines: Vec<Value> =
            text.lines().map(|line| pdk_sdk::serde_json::from_str(line).unwrap()).collect();
        assert_eq!(lines.len(), 6);
        assert_eq!((&lines[0]["class"], &lines[5]["class"]), (&json!("BeamNGVehicle"), &json!("SimGroup")));
        let mut ids: Vec<_> = lines.iter().map(|line| line["persistentId"].as_str().unwrap()).collect();
        ids.sort_unstable();
        ids.dedup();
        assert_eq!(ids.len(), 6);
        assert_eq!(
            (&lines[5]["groupPosition"], &lines[5]["noAutoReload"]),
            (&json!("0.000000 0.000000 0.000000"), &json!(true))
        );
        let nodes = lines[1]["nodes"].as_array().unwrap();
        for node in nodes {
            assert_eq!((&node[0], &node[3]), (&json!(-2.0), &json!(8.0)));
        }
        // It begins before the first waypoint and ends behind the last one.
        assert_eq!((&nodes[0][1], &nodes[nodes.len() - 1][1]), (&json!(-15.0), &json!(115.0)));
        assert_eq!((&nodes[0][2], &nodes[nodes.len() - 1][2]), (&json!(100.0), &json!(102.0)));
        assert_eq!(lines[3]["nodes"][0][0], json!(1.85));
        assert_eq!(lines[0]["position"], json!([0.0, 0.0, 100.5]));
    }

    #[test]
    fn a_vehicle_that_faces_back_is_not_turned() {
        assert_eq!(facing(std::f64::consts::PI), [0.0, 0.0, 0.0, 1.0]);
        assert!((facing(0.0)[2] + 1.0).abs() < 1e-12);
    }
}
