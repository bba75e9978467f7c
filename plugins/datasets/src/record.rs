//! What a record says about its frame.

use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::{Map, Value};

/// What was recorded with one frame; numbers that were not recorded are not numbers.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Record {
    /// -1 (full left) to 1 (full right).
    pub steering: f64,
    /// -1 (full brake) to 1 (full throttle).
    pub throttle: f64,
    /// In m/s.
    pub speed: f64,
    /// Milliseconds since any fixed moment, where the record has a time.
    pub milliseconds: Option<f64>,
    /// Its number in the recording, where the record has one.
    pub number: Option<u64>,
    /// The drive that it belongs to, where the record names one.
    pub session: Option<String>,
}

impl Record {
    /// Reads the keys that DonkeyCar writes: `user/angle`, `user/throttle`, `enc/speed`, the time as `_timestamp_ms` (tub v2) or
    /// `milliseconds` (tub v1), and `_index` and `_session_id`. `null` stands for a steering or throttle that was not recorded.
    ///
    /// # Errors
    /// If the steering or the throttle is missing, is not a number, or is outside -1 to 1, or if the speed is not a number.
    pub fn from_json(json: &Map<String, Value>) -> Result<Self> {
        Ok(Self {
            steering: control(json, "user/angle")?,
            throttle: control(json, "user/throttle")?,
            speed: speed(json, "enc/speed")?,
            milliseconds: ["_timestamp_ms", "milliseconds"]
                .iter()
                .find_map(|key| json.get(*key).and_then(Value::as_f64)),
            number: json.get("_index").and_then(Value::as_u64),
            session: json.get("_session_id").and_then(Value::as_str).map(str::to_owned),
        })
    }
}

fn control(json: &Map<String, Value>, key: &str) -> Result<f64> {
    match json.get(key) {
        None => Err(Error::new(format!("the record has no `{key}`"))),
        Some(Value::Null) => Ok(f64::NAN),
        Some(value) => match value.as_f64() {
            Some(number) if (-1.0..=1.0).contains(&number) => Ok(number),
            _ => Err(Error::new(format!("`{key}` is {value}, but has to be a number from -1 to 1"))),
        },
    }
}

fn speed(json: &Map<String, Value>, key: &str) -> Result<f64> {
    match json.get(key) {
        None | Some(Value::Null) => Ok(f64::NAN),
        Some(value) => value
            .as_f64()
            .ok_or_else(|| Error::new(format!("`{key}` is {value}, but has to be a number, in m/s"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_sdk::serde_json::json;

    fn parse(json: Value) -> Result<Record> {
        Record::from_json(json.as_object().unwrap())
    }

    #[test]
    fn the_keys_of_both_tub_versions_are_read() {
        let v2 = json!({"user/angle": 0.5, "user/throttle": -1, "_timestamp_ms": 1602421393803u64, "_index": 7,
            "_session_id": "20-10-11_0"});
        let v2 = parse(v2).unwrap();
        assert_eq!((v2.number, v2.session.as_deref()), (Some(7), Some("20-10-11_0")));
        assert_eq!((v2.steering, v2.throttle, v2.milliseconds), (0.5, -1.0, Some(1602421393803.0)));
        let v1 = parse(json!({"user/angle": 0, "user/throttle": 0.1, "enc/speed": 2.5, "milliseconds": 40}))
            .unwrap();
        assert_eq!((v1.speed, v1.milliseconds), (2.5, Some(40.0)));
        assert_eq!(parse(json!({"user/angle": 0, "user/throttle": 0})).unwrap().milliseconds, None);
    }

    #[test]
    fn what_was_not_recorded_is_not_a_number() {
        let record = parse(json!({"user/angle": null, "user/throttle": null})).unwrap();
        assert!(record.steering.is_nan() && record.throttle.is_nan() && record.speed.is_nan());
    }

    #[test]
    fn missing_and_senseless_values_are_named() {
        let error = |json| parse(json).unwrap_err().to_string();
        assert_eq!(error(json!({"user/throttle": 0})), "the record has no `user/angle`");
        assert_eq!(error(json!({"user/angle": 0})), "the record has no `user/throttle`");
        assert_eq!(
            error(json!({"user/angle": 25.0, "user/throttle": 0})),
            "`user/angle` is 25.0, but has to be a number from -1 to 1"
        );
        let speed = json!({"user/angle": 0, "user/throttle": 0, "enc/speed": "fast"});
        assert_eq!(error(speed), "`enc/speed` is \"fast\", but has to be a number, in m/s");
        assert!(error(json!({"user/angle": "0.1", "user/throttle": 0})).contains("\"0.1\""));
    }
}
