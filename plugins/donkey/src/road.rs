//! The roads of the two builds.

use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::Value;

use crate::options::Build;

/// The road of a scenario.
#[derive(Debug, Clone, PartialEq)]
pub enum Road {
    /// The one that is there.
    Given,
    /// One through these points, `[x, height, z]` in metres from the start.
    Points(Vec<[f64; 3]>),
    /// One that the scene generates from these fields.
    Generated(Vec<(&'static str, String)>),
}

impl Road {
    /// Reads the road of a scenario.
    ///
    /// # Errors
    /// If it is none that the build can have.
    pub fn read(road: &Value, build: Build) -> Result<Self> {
        match (build, road) {
            (_, Value::Null) => Ok(Self::Given),
            (Build::RoadGenerating, road) => Ok(pdk_adapter::road(road)?.map_or(Self::Given, Self::Points)),
            (Build::Current, Value::Object(fields)) => {
                let known =
                    [("style", "road_style"), ("seed", "rand_seed"), ("turn_increment", "turn_increment")];
                if let Some(name) = fields.keys().find(|key| known.iter().all(|(name, _)| name != key)) {
                    return Err(mistake(format!(
                        "the road has `{name}`, but the current build of the simulator only knows roads such as {{style = 0, seed = 1, \
                         turn_increment = 2}}, in the scene generated_road; set build=road_generating for roads from points"
                    )));
                }
                let number = |name: &str, default: f64| match fields.get(name) {
                    None => Ok(default),
                    Some(value) => value.as_f64().ok_or_else(|| {
                        mistake(format!("`{name}` of the road is {value}, but has to be a number"))
                    }),
                };
                let mut sent = Vec::new();
                for (name, field) in known {
                    let default = if name == "turn_increment" { 1.0 } else { 0.0 };
                    sent.push((field, number(name, default)?.to_string()));
                }
                Ok(Self::Generated(sent))
            }
            (Build::Current, other) => Err(mistake(format!(
                "the road is {other}, but has to be null, or an object such as {{style = 0, seed = 1, turn_increment = 2}}"
            ))),
        }
    }
}

/// The points as the simulator takes them, with the first of them at `start`, in its own coordinates. They have all their digits
/// if that takes no more than `room` bytes, and else four decimals, tenths of millimetres.
pub fn print(points: &[[f64; 3]], start: [f64; 3], room: usize) -> String {
    let first = points.first().copied().unwrap_or_default();
    let place = |point: &[f64; 3]| std::array::from_fn(|axis| point[axis] - first[axis] + start[axis]);
    let places: Vec<[f64; 3]> = points.iter().map(place).collect();
    let whole = pdk_road::print(&places);
    if whole.len() <= room {
        return whole;
    }
    let rounded = |number: f64| {
        let text = format!("{number:.4}");
        let text = text.trim_end_matches('0').trim_end_matches('.');
        if text == "-0" { "0".to_owned() } else { text.to_owned() }
    };
    let shown = |[x, y, z]: &[f64; 3]| format!("{},{},{}", rounded(*x), rounded(*y), rounded(*z));
    places.iter().map(shown).collect::<Vec<_>>().join("@")
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
    fn points_begin_where_the_car_stands_and_stay_short() {
        let points = [[0.0, 0.0, 0.0], [0.00001, 0.0, 10.0], [1.23456, 0.5, 20.25]];
        assert_eq!(print(&points, [51.0, 0.5, 50.0], 1000), "51,0.5,50@51.00001,0.5,60@52.23456,1,70.25");
        assert_eq!(print(&points, [51.0, 0.6, 50.0], 10), "51,0.6,50@51,0.6,60@52.2346,1.1,70.25");
        assert_eq!(print(&[[0.0; 3], [-0.00001, 0.0, 1.0]], [0.0; 3], 0), "0,0,0@0,0,1");
        // A road of twice the published length still fits into one message, at any place.
        let road = pdk_road::Road::from_angles(&[5.0; 15], &[25.0; 15]).unwrap();
        let points: Vec<_> = road.waypoints.iter().map(|[x, z]| [*x, 0.0, *z]).collect();
        assert!(points.len() > 260 && print(&points, [-151.1234, 0.6123, -150.9876], 8000).len() < 8000);
    }

    #[test]
    fn each_build_has_its_roads() {
        let angles = json!({"angles": [0, 10, 0]});
        assert!(matches!(Road::read(&angles, Build::RoadGenerating), Ok(Road::Points(_))));
        assert!(Road::read(&angles, Build::Current).unwrap_err().message().contains("build=road_generating"));
        let generated = Road::read(&json!({"seed": 3, "style": 1}), Build::Current).unwrap();
        let fields = [("road_style", "1"), ("rand_seed", "3"), ("turn_increment", "1")];
        assert_eq!(generated, Road::Generated(fields.map(|(name, value)| (name, value.to_owned())).to_vec()));
        assert!(Road::read(&json!({"seed": 3}), Build::RoadGenerating).is_err());
        for build in [Build::Current, Build::RoadGenerating] {
            assert_eq!(Road::read(&Value::Null, build), Ok(Road::Given));
            assert!(Road::read(&json!(4), build).is_err());
        }
    }
}
