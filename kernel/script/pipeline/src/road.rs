//! `pdk.road`: a road from angles, at random, or towards a number of turns and a mean curvature.

use pdk_road::{Informed, MapBox, Road};
use pdk_sdk::error::{Error, Result};
use serde_json::{Value, json};

use crate::fields::Fields;
use crate::records::ROAD_REQUEST;

/// Largest angle in degrees of a random road, as in the published study, and of an informed one.
const RANDOM_LIMIT: u64 = 35;
const INFORMED_LIMIT: u64 = 60;
/// Most draws of one call.
const MOST_ATTEMPTS: u64 = 100_000;

/// Makes a road; `seed` is that of the run, for roads that name none.
///
/// # Errors
/// As [`build`].
pub fn make(request: Value, seed: u64) -> Result<Value> {
    let (road, lengths) = build(request, seed)?;
    Ok(described(&road, &lengths))
}

/// Builds the road that a request asks for, with the lengths of its segments; `seed` is for requests that name none.
///
/// # Errors
/// If a field is wrong, or no valid road comes of it; the error says where the last one is not valid.
pub fn build(request: Value, seed: u64) -> Result<(Road, Vec<f64>)> {
    let wrong = |sentence: String| Error::new(format!("pdk.road: {sentence}"));
    let known: Vec<&str> = ROAD_REQUEST.names().collect();
    let mut fields = Fields::new("pdk.road", request, &known)?;
    let angles = fields.list("angles")?.map(|list| numbers("angles", &list)).transpose()?;
    let segment = fields.any("segment");
    let seed_given = fields.seed("seed")?;
    let limit = fields.whole("limit")?;
    let turns = fields.whole("turns")?;
    let target = fields.number("mean_curvature")?;
    let attempts = fields.whole("attempts")?;
    let width = fields.number("width")?.unwrap_or(pdk_road::WIDTH);
    let smallest_radius = fields.number("smallest_radius")?.unwrap_or(pdk_road::SMALLEST_RADIUS);
    if !(0.0..=1000.0).contains(&smallest_radius) {
        return Err(wrong(format!("`smallest_radius` is {smallest_radius}, but has to be from 0 to 1000 m")));
    }
    if !(0.1..=100.0).contains(&width) {
        return Err(wrong(format!("`width` is {width}, but has to be from 0.1 to 100 m")));
    }
    let count = angles.as_ref().map_or(pdk_road::NODES, Vec::len);
    let lengths = match &segment {
        Value::Null => vec![pdk_road::SEGMENT; count],
        Value::Array(list) if angles.is_some() => numbers("segment", list)?,
        other => match other.as_f64() {
            Some(length) => vec![length; count],
            None => return Err(wrong(format!("`segment` is {other}, but has to be a length in metres"))),
        },
    };
    let map = MapBox::for_segments(&lengths);
    let of = |angles: &[f64]| -> std::result::Result<Road, String> {
        let road = Road::from_angles(angles, &lengths)?;
        pdk_road::check(&road, width, &map)?;
        pdk_road::check_bends(&road, smallest_radius).map(|()| road)
    };
    if let Some(angles) = angles {
        if seed_given.is_some()
            || limit.is_some()
            || turns.is_some()
            || target.is_some()
            || attempts.is_some()
        {
            return Err(wrong(
                "`angles` say all; leave `seed`, `limit`, `turns`, `mean_curvature` and `attempts` out"
                    .into(),
            ));
        }
        let road = of(&angles).map_err(wrong)?;
        return Ok((road, lengths));
    }
    let attempts = attempts.unwrap_or(1);
    if !(1..=MOST_ATTEMPTS).contains(&attempts) {
        return Err(wrong(format!("`attempts` is {attempts}, but has to be from 1 to {MOST_ATTEMPTS}")));
    }
    let informed = match (turns, target) {
        (Some(turns), Some(mean_curvature)) => {
            if turns > pdk_road::NODES as u64 || !(0.0..=1.0).contains(&mean_curvature) {
                return Err(wrong(format!(
                    "`turns` is {turns} and `mean_curvature` {mean_curvature}, but they have to be from 0 to {} and from 0 \
                     to 1",
                    pdk_road::NODES
                )));
            }
            Some((turns as usize, mean_curvature))
        }
        (None, None) => None,
        _ => return Err(wrong("`turns` and `mean_curvature` belong together; give both or none".into())),
    };
    let limit = limit.unwrap_or(if informed.is_some() { INFORMED_LIMIT } else { RANDOM_LIMIT });
    let least = if informed.is_some() { pdk_road::STRAIGHTEST_TURN as u64 } else { 0 };
    if !(least..=90).contains(&limit) {
        return Err(wrong(format!("`limit` is {limit}, but has to be from {least} to 90 degrees")));
    }
    let limit = limit as i32;
    let seed = seed_given.unwrap_or(seed);
    let mut random = pdk_sdk::seed::key(seed, "road", 0).sequence();
    let mut refused = String::new();
    for _ in 0..attempts {
        let angles = match informed {
            Some((turns, mean_curvature)) => {
                pdk_road::informed_angles(&mut random, &lengths, Informed { turns, mean_curvature, limit })
            }
            None => pdk_road::random_angles(&mut random, count, limit),
        };
        match of(&angles) {
            Ok(road) => return Ok((road, lengths)),
            Err(reason) => refused = reason,
        }
    }
    Err(wrong(format!(
        "no valid road in {attempts} attempts from seed {seed}; the last: {refused}; allow more `attempts` or another seed"
    )))
}

/// What `pdk.road` says of a road whose segments have these lengths.
pub fn described(road: &Road, lengths: &[f64]) -> Value {
    let segment = match lengths {
        [first, rest @ ..] if rest.iter().all(|length| length == first) => json!(first),
        lengths => json!(lengths),
    };
    let waypoints: Vec<[f64; 3]> = road.waypoints.iter().map(|&[x, z]| [x, 0.0, z]).collect();
    json!({
        "waypoints": pdk_road::print(&waypoints),
        "road": { "angles": road.angles, "segment": segment },
        "angles": road.angles,
        "turns": road.turns(),
        "mean_curvature": road.mean_curvature(),
        "length": road.length(),
    })
}

fn numbers(field: &str, list: &[Value]) -> Result<Vec<f64>> {
    list.iter()
        .map(|value| {
            value
                .as_f64()
                .ok_or_else(|| Error::new(format!("pdk.road: `{field}` has {value}, which is not a number")))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(request: Value) -> String {
        make(request, 0).unwrap_err().to_string()
    }

    #[test]
    fn the_three_generators_make_roads() {
        let given = make(json!({"angles": [0, 30, 0, -30, 0, 0, 0, 0]}), 0).unwrap();
        assert_eq!(
            (&given["turns"], given["waypoints"].as_str().unwrap().split('@').count()),
            (&json!(2), 134)
        );
        assert_eq!(given["road"]["segment"], json!(25.0));
        let again =
            make(json!({"angles": given["road"]["angles"], "segment": given["road"]["segment"]}), 0).unwrap();
        assert_eq!(again, given);
        assert!((175.0..185.0).contains(&given["length"].as_f64().unwrap()));
        let random = |seed| make(json!({"attempts": 100}), seed).unwrap();
        assert_eq!(random(4), random(4));
        assert_eq!(random(4), make(json!({"attempts": 100, "seed": 4}), 9).unwrap());
        assert_ne!(random(4), random(5));
        let informed = make(json!({"turns": 3, "mean_curvature": 0.02, "attempts": 100}), 1).unwrap();
        assert_eq!(informed["turns"], 3);
    }

    #[test]
    fn attempts_draw_until_a_road_is_valid() {
        let failing = (0..200).find(|seed| make(json!({"limit": 80}), *seed).is_err()).unwrap();
        assert!(make(json!({"limit": 80, "attempts": 1000}), failing).is_ok());
    }

    #[test]
    fn mistakes_are_reported() {
        assert!(error(json!({"angle": []})).contains("did you mean `angles`?"));
        assert!(error(json!({"angles": [0, 0], "seed": 1})).contains("`angles` say all"));
        assert!(error(json!({"turns": 3})).contains("belong together"));
        assert!(error(json!({"turns": 9, "mean_curvature": 0.02})).contains("from 0 to 8"));
        assert!(error(json!({"limit": 91})).contains("from 0 to 90 degrees"));
        assert!(error(json!({"angles": [0, "a"]})).contains("which is not a number"));
        assert!(error(json!({"angles": [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]})).contains("leaves the map"));
        assert!(error(json!({"attempts": 0})).contains("from 1 to 100000"));
    }
}
