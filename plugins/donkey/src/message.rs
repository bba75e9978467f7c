//! What the simulator sends: one JSON object a line.

use std::borrow::Cow;
use std::fmt;

use pdk_sdk::prelude::*;
use pdk_sdk::serde_json;
use serde::de::{self, Deserialize, Deserializer, Visitor};

/// A message, as far as it is of use. Fields that are not listed may come twice, as `sector` does.
#[derive(Debug, Default, serde::Deserialize)]
#[serde(default, expecting = "an object")]
pub struct Message<'a> {
    /// What it is; empty in one that only keeps the connection alive.
    #[serde(borrow)]
    pub msg_type: Cow<'a, str>,
    /// The scenes that can be loaded.
    pub scene_names: Vec<String>,
    /// The version of the protocol.
    pub version: Option<String>,
    /// The picture, in base64.
    #[serde(borrow, deserialize_with = "text")]
    pub image: Option<Cow<'a, str>>,
    /// What was hit since the last message; "none" for nothing.
    #[serde(borrow, deserialize_with = "text")]
    pub hit: Option<Cow<'a, str>>,
    pub speed: Option<Number>,
    pub time: Option<Number>,
    pub cte: Option<Number>,
    pub pos_x: Option<Number>,
    pub pos_y: Option<Number>,
    pub pos_z: Option<Number>,
    pub yaw: Option<Number>,
    /// Whether the end of the road was reached or the lane was left; only the road-generating build says so.
    pub done: Option<bool>,
    #[serde(rename = "maxSector")]
    pub max_sector: Option<Number>,
    #[serde(rename = "activeNode")]
    pub active_node: Option<Number>,
    #[serde(rename = "totalNodes")]
    pub total_nodes: Option<Number>,
}

/// A text that is borrowed from the line, where nothing in it is escaped.
fn text<'de, D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Option<Cow<'de, str>>, D::Error> {
    #[derive(serde::Deserialize)]
    #[serde(expecting = "a text")]
    struct Text<'a>(#[serde(borrow)] Cow<'a, str>);
    Ok(Option::<Text<'de>>::deserialize(deserializer)?.map(|Text(text)| text))
}

/// A number; those that JSON does not have come as texts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Number(pub f64);

impl<'de> Deserialize<'de> for Number {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        struct Any;
        impl Visitor<'_> for Any {
            type Value = Number;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number")
            }
            fn visit_f64<E: de::Error>(self, number: f64) -> std::result::Result<Number, E> {
                Ok(Number(number))
            }
            fn visit_i64<E: de::Error>(self, number: i64) -> std::result::Result<Number, E> {
                Ok(Number(number as f64))
            }
            fn visit_u64<E: de::Error>(self, number: u64) -> std::result::Result<Number, E> {
                Ok(Number(number as f64))
            }
            fn visit_str<E: de::Error>(self, text: &str) -> std::result::Result<Number, E> {
                match text {
                    "INFINITY" => Ok(Number(f64::INFINITY)),
                    "NEGINFINITY" => Ok(Number(f64::NEG_INFINITY)),
                    text => text.replace(',', ".").parse().map(Number).map_err(|_| E::custom("not a number")),
                }
            }
        }
        deserializer.deserialize_any(Any)
    }
}

/// Reads a line. If the simulator's computer writes decimal commas, they are made points, in `repaired`.
///
/// # Errors
/// If it is not a message.
pub fn read<'a>(line: &'a [u8], repaired: &'a mut Vec<u8>, peer: &str) -> Result<Message<'a>> {
    match serde_json::from_slice(line) {
        Ok(message) => Ok(message),
        Err(first) => {
            with_points(line, repaired);
            serde_json::from_slice(repaired).map_err(|_| {
                let begin: String = String::from_utf8_lossy(&line[..line.len().min(60)]).into_owned();
                Error::of(
                    ErrorKind::Nonsense,
                    format!("{peer} sends what is not a message of its protocol ({first}): `{begin}`; is another program at this port?"),
                )
            })
        }
    }
}

/// Makes points of decimal commas. Behind the colon of a field no number can be followed by a comma and a digit, since the next field
/// begins with a quotation mark.
fn with_points(line: &[u8], into: &mut Vec<u8>) {
    into.clear();
    into.reserve(line.len());
    let (mut in_text, mut escaped, mut in_number) = (false, false, false);
    for (i, &byte) in line.iter().enumerate() {
        let mut written = byte;
        if in_text {
            in_text = escaped || byte != b'"';
            escaped = !escaped && byte == b'\\';
        } else {
            match byte {
                b'"' => (in_text, in_number) = (true, false),
                b':' => in_number = true,
                b',' => {
                    if in_number && line.get(i + 1).is_some_and(u8::is_ascii_digit) {
                        written = b'.';
                    }
                    in_number = false;
                }
                b'0'..=b'9' | b'-' | b'+' | b'e' | b'E' | b'.' => {}
                _ => in_number = false,
            }
        }
        into.push(written);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with<R>(line: &str, look: impl FnOnce(Message<'_>) -> R) -> R {
        look(read(line.as_bytes(), &mut Vec::new(), "the simulator").unwrap())
    }

    #[test]
    fn telemetry_is_read_whatever_comes_twice() {
        let line = r#"{"msg_type":"telemetry","steering_angle":0,"speed":1.5,"image":"AAAA","hit":"none","pos_x":51,"sector":0,"sector":3,"done":false,"cte":1E-05,"maxSector":139}"#;
        with(line, |message| {
            assert_eq!(
                (message.msg_type.as_ref(), message.speed, message.pos_x),
                ("telemetry", Some(Number(1.5)), Some(Number(51.0)))
            );
            assert_eq!(
                (message.cte, message.done, message.max_sector),
                (Some(Number(1e-5)), Some(false), Some(Number(139.0)))
            );
            assert!(message.active_node.is_none() && message.yaw.is_none());
            assert!(matches!(message.image, Some(Cow::Borrowed("AAAA"))));
        });
        with("{}", |message| assert_eq!(message.msg_type, ""));
    }

    #[test]
    fn decimal_commas_are_points() {
        let line = r#"{"msg_type":"telemetry","speed":-1,5,"cte":0,05,"time":1E-05,"hit":"a:1,5 \"b\":2,5","lidar":[1,2,3],"pos_x":3,"pos_y":12,25}"#;
        with(line, |message| {
            let numbers = [message.speed, message.cte, message.time, message.pos_x, message.pos_y];
            assert_eq!(numbers, [-1.5, 0.05, 1e-5, 3.0, 12.25].map(|number| Some(Number(number))));
            assert_eq!(message.hit.unwrap(), r#"a:1,5 "b":2,5"#);
        });
    }

    #[test]
    fn what_json_has_no_numbers_for_comes_as_text() {
        let line = r#"{"msg_type":"telemetry","speed":"NaN","cte":"NEGINFINITY","time":"0,5"}"#;
        with(line, |message| {
            assert!(message.speed.unwrap().0.is_nan() && message.cte.unwrap().0 == f64::NEG_INFINITY);
            assert_eq!(message.time, Some(Number(0.5)));
        });
    }

    #[test]
    fn garbage_is_quoted() {
        for line in ["HTTP/1.1 400 Bad Request", "{\"msg_type\":", "[1,2]", "\u{fffd}"] {
            let error = read(line.as_bytes(), &mut Vec::new(), "the simulator").unwrap_err();
            assert_eq!(error.kind(), ErrorKind::Nonsense);
            assert!(error.message().contains(&line[..3]), "{error}");
        }
    }
}
