//! The road of a scenario: one of its own, or a lane of a map that CARLA has.

use pdk_road::{LANE_WIDTH, Path, Point, opendrive};
use pdk_sdk::prelude::{Error, Result};
use pdk_sdk::serde_json::{Map, Value};

/// Shortest and longest road in metres.
const LENGTHS: (f64, f64) = (10.0, pdk_adapter::track::LONGEST);
/// How far a lane of a map is followed by default, in metres.
const FOLLOWED: f64 = 200.0;

/// The road that a scenario wants.
#[derive(Debug, Clone, PartialEq)]
pub enum Ground {
    /// A road of its own through these waypoints: `[x, height, z]` in metres.
    Own(Vec<[f64; 3]>),
    /// A lane of a map.
    Map {
        /// The map; if none is named, the one that was found on the server.
        name: Option<String>,
        /// The number of the map's recommended place to start from, from 0.
        start: usize,
        /// How far the lane is followed in metres.
        length: f64,
    },
}

impl Ground {
    /// Reads the road of a scenario: `{"map": "Town01", "start": 3, "length": 200}`, or one of the forms that all simulators share. If
    /// there is none, one with random angles is drawn from the scenario's seed.
    ///
    /// # Errors
    /// If it is none of these, or cannot be driven on.
    pub fn read(road: &Value, seed: u64) -> Result<Self> {
        if let Value::Object(fields) = road
            && ["map", "start", "length"].iter().any(|name| fields.contains_key(*name))
        {
            return Self::of_map(fields);
        }
        let waypoints = match pdk_road::read(road).map_err(mistake)? {
            Some(waypoints) => waypoints,
            None => pdk_adapter::random_road(seed, "carla road")?,
        };
        check(&waypoints)?;
        Ok(Self::Own(waypoints))
    }

    fn of_map(fields: &Map<String, Value>) -> Result<Self> {
        if let Some(name) = fields.keys().find(|name| !["map", "start", "length"].contains(&name.as_str())) {
            return Err(mistake(format!(
                "the road has an unknown key `{name}`; a road on a map takes `map`, `start` and `length`"
            )));
        }
        let wrong = |name: &str, expected: &str| {
            mistake(format!("`{name}` of the road is {}, but has to be {expected}", fields[name]))
        };
        let name = match fields.get("map") {
            None => None,
            Some(Value::String(name)) if !name.is_empty() => Some(name.clone()),
            Some(_) => return Err(wrong("map", "the name of a map, such as \"Town01\"")),
        };
        let start = match fields.get("start") {
            None => 0,
            Some(value) => value
                .as_u64()
                .and_then(|number| usize::try_from(number).ok())
                .ok_or_else(|| wrong("start", "the number of a recommended place to start from, from 0"))?,
        };
        let length = match fields.get("length") {
            None => FOLLOWED,
            Some(value) => value
                .as_f64()
                .filter(|length| (LENGTHS.0..=LENGTHS.1).contains(length))
                .ok_or_else(|| wrong("length", &format!("from {} to {} m", LENGTHS.0, LENGTHS.1)))?,
        };
        Ok(Self::Map { name, start, length })
    }
}

/// A lane that can be driven on.
#[derive(Debug, Clone, PartialEq)]
pub struct Lane {
    /// Its centre line as `[x, height, z]` in metres.
    pub waypoints: Vec<[f64; 3]>,
    /// From its centre line to its edge in metres.
    pub half_width: f64,
    /// Whether a lane for the other direction lies to the left of it.
    pub has_opposite: bool,
}

impl Lane {
    /// The driven lane of a road of its own.
    pub fn own(waypoints: &[[f64; 3]]) -> Self {
        Self { waypoints: waypoints.to_vec(), half_width: LANE_WIDTH / 2.0, has_opposite: true }
    }

    /// The lane of a map, given as OpenDRIVE, that leads on from a place.
    ///
    /// # Errors
    /// If the map cannot be read, or has no lane there.
    pub fn of_map(document: &str, at: Point, heading: f64, length: f64) -> Result<Self> {
        let lane = opendrive::Map::read(document)
            .and_then(|map| map.follow(at, heading, length))
            .map_err(mistake)?;
        Ok(Self { waypoints: lane.points, half_width: lane.width / 2.0, has_opposite: false })
    }

    /// Heading of its beginning in radians.
    pub fn heading(&self) -> f64 {
        match self.waypoints.as_slice() {
            [a, b, ..] => libm::atan2(b[0] - a[0], b[2] - a[2]),
            _ => 0.0,
        }
    }
}

fn check(waypoints: &[[f64; 3]]) -> Result<()> {
    let points: Vec<Point> = waypoints.iter().map(|&[x, _, z]| [x, z]).collect();
    if points.len() < 2 {
        return Err(mistake(format!("the road has {} waypoints, but needs at least 2", points.len())));
    }
    if let Some(i) = points.windows(2).position(|pair| pdk_road::distance(pair[0], pair[1]) < 0.05) {
        return Err(mistake(format!(
            "waypoints {i} and {} of the road are less than 5 cm apart: remove one of them",
            i + 1
        )));
    }
    let length = Path::of(points).length();
    if !(LENGTHS.0..=LENGTHS.1).contains(&length) {
        return Err(mistake(format!(
            "the road is {length:.1} m long, but has to be {} to {} m long",
            LENGTHS.0, LENGTHS.1
        )));
    }
    Ok(())
}

/// What is wrong with one scenario's road is wrong with no other one.
fn mistake(sentence: String) -> Error {
    Error::new(sentence)
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_sdk::serde_json::json;

    #[test]
    fn a_road_is_one_of_its_own_or_a_lane_of_a_map() {
        let Ground::Own(waypoints) = Ground::read(&json!({"angles": [0, 10, -20]}), 0).unwrap() else {
            panic!("not its own")
        };
        assert_eq!(waypoints[0], [0.0; 3]);
        assert_eq!(Ground::read(&Value::Null, 5), Ground::read(&Value::Null, 5));
        assert_ne!(Ground::read(&Value::Null, 5), Ground::read(&Value::Null, 6));
        assert_eq!(
            Ground::read(&json!({"map": "Town04", "start": 3}), 0),
            Ok(Ground::Map { name: Some("Town04".to_owned()), start: 3, length: 200.0 })
        );
        assert_eq!(
            Ground::read(&json!({"length": 50}), 0),
            Ok(Ground::Map { name: None, start: 0, length: 50.0 })
        );
    }

    #[test]
    fn a_wrong_road_is_reported() {
        for (road, expected) in [
            (json!({"map": 3}), "`map` of the road is 3"),
            (json!({"map": "Town01", "angles": []}), "unknown key `angles`"),
            (json!({"start": -1}), "`start` of the road is -1"),
            (json!({"length": 1e9}), "`length` of the road is"),
            (json!({"angle": []}), "unknown key `angle`"),
            (json!({"waypoints": [[0, 0, 0]]}), "needs at least 2"),
            (json!({"waypoints": [[0, 0, 0], [0, 0, 0.01]]}), "less than 5 cm apart"),
            (json!({"waypoints": [[0, 0, 0], [0, 0, 5]]}), "the road is 5.0 m long"),
        ] {
            let error = Ground::read(&road, 0).unwrap_err();
            assert!(
                error.message().contains(expected) && error.kind() == pdk_sdk::prelude::ErrorKind::Failed,
                "{error}"
            );
        }
    }
}
