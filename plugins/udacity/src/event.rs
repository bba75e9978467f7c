//! What the simulator sends: Engine.IO packets with Socket.IO events in them.

use std::borrow::Cow;
use std::fmt;
use std::ops::Deref;

use pdk_sdk::serde_json;
use serde::de::{self, Deserialize, Deserializer, Visitor};

use crate::number;

/// A packet.
#[derive(Debug)]
pub enum Packet<'a> {
    /// It wants to hear `3` with this behind it.
    Ping(&'a str),
    /// It asks for the namespace, as clients of Socket.IO 5 do.
    Connect,
    /// It hangs up.
    Close,
    /// The state of the vehicle, with a picture.
    Telemetry(Telemetry<'a>),
    /// Telemetry without anything in it: a person drives with the keys.
    Manual,
    /// Another event or packet of the protocol, of no use here.
    Other,
}

/// The state of the vehicle. Fields that are not listed are of no use here.
#[derive(Debug, Default, serde::Deserialize)]
#[serde(default, expecting = "an object")]
pub struct Telemetry<'a> {
    /// The picture, in base64.
    #[serde(borrow)]
    pub image: Option<Text<'a>>,
    /// What was hit; "none" for nothing, or a count.
    #[serde(borrow)]
    pub hit: Option<Text<'a>>,
    /// The road that is there.
    #[serde(borrow)]
    pub track: Option<Text<'a>>,
    pub speed: Number,
    pub cte: Number,
    pub pos_x: Number,
    pub pos_y: Number,
    pub pos_z: Number,
}

/// A text, which is that of the message itself where nothing in it is escaped: a picture is not copied.
#[derive(Debug, Default, serde::Deserialize)]
#[serde(expecting = "a text")]
pub struct Text<'a>(#[serde(borrow)] Cow<'a, str>);

impl Deref for Text<'_> {
    type Target = str;

    fn deref(&self) -> &str {
        &self.0
    }
}

/// A number in a text; none if there is none.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
pub struct Number(pub Option<f64>);

/// An event: its name, and what it says.
#[derive(serde::Deserialize)]
#[serde(expecting = "a list with a name and an object")]
struct Event<'a>(#[serde(borrow)] Cow<'a, str>, #[serde(default, borrow)] Option<Telemetry<'a>>);

impl<'de> Deserialize<'de> for Number {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Any;
        impl Visitor<'_> for Any {
            type Value = Number;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number in a text")
            }
            fn visit_str<E: de::Error>(self, text: &str) -> Result<Number, E> {
                match number::read(text) {
                    Some(number) => Ok(Number(Some(number))),
                    None => Err(E::custom(format!("`{text}` is not a number"))),
                }
            }
            fn visit_f64<E: de::Error>(self, number: f64) -> Result<Number, E> {
                Ok(Number(Some(number)))
            }
            fn visit_i64<E: de::Error>(self, number: i64) -> Result<Number, E> {
                Ok(Number(Some(number as f64)))
            }
            fn visit_u64<E: de::Error>(self, number: u64) -> Result<Number, E> {
                Ok(Number(Some(number as f64)))
            }
            fn visit_unit<E: de::Error>(self) -> Result<Number, E> {
                Ok(Number(None))
            }
        }
        deserializer.deserialize_any(Any)
    }
}

/// Reads a packet.
///
/// # Errors
/// A clause that says why it is none.
pub fn read(text: &str) -> Result<Packet<'_>, String> {
    match text {
        "2" | "2probe" => Ok(Packet::Ping(&text[1..])),
        "1" => Ok(Packet::Close),
        // Pongs, an upgrade and nothing at all.
        "3" | "3probe" | "5" | "6" => Ok(Packet::Other),
        // A greeting.
        _ if text.starts_with("0{") => Ok(Packet::Other),
        _ if text.starts_with('4') => message(&text[1..]),
        _ => Err(format!("`{}`, which is not a packet of Engine.IO", begin(text))),
    }
}

fn message(text: &str) -> Result<Packet<'_>, String> {
    match text.as_bytes().first() {
        Some(b'1') => Ok(Packet::Close),
        Some(b'2') => {
            // It may ask for an acknowledgement by a number, which this protocol does not use.
            let event = text[1..].trim_start_matches(|c: char| c.is_ascii_digit());
            let Event(name, telemetry) = serde_json::from_str(event)
                .map_err(|error| format!("`{}`, which is not an event ({error})", begin(text)))?;
            Ok(match (name.as_ref(), telemetry) {
                ("telemetry", Some(telemetry)) if telemetry.image.is_some() => Packet::Telemetry(telemetry),
                ("telemetry", _) => Packet::Manual,
                _ => Packet::Other,
            })
        }
        Some(b'0') => Ok(Packet::Connect),
        Some(b'3' | b'4') => Ok(Packet::Other),
        _ => Err(format!("`4{}`, which is not a message of Socket.IO", begin(text))),
    }
}

fn begin(text: &str) -> String {
    text.chars().take(60).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn telemetry_is_read_with_all_values_as_texts() {
        let text = r#"42["telemetry",{"steering_angle":"0,0000","speed":"1.234,5000","hit":"none","cte":"-0,0213","track":"0,0,0@0,0,10","cte_pid":"x","pos_x":"1,5000","pos_y":"0,5000","pos_z":"-3,2500","image":"/9j/4AAQ"}]"#;
        let Ok(Packet::Telemetry(telemetry)) = read(text) else { panic!("no telemetry") };
        assert_eq!((telemetry.speed, telemetry.cte), (Number(Some(1234.5)), Number(Some(-0.0213))));
        assert_eq!((telemetry.pos_x, telemetry.pos_z), (Number(Some(1.5)), Number(Some(-3.25))));
        assert_eq!(telemetry.track.as_deref(), Some("0,0,0@0,0,10"));
        assert!(matches!(telemetry.image, Some(Text(Cow::Borrowed("/9j/4AAQ")))));
    }

    #[test]
    fn what_is_missing_or_null_is_none() {
        let text = r#"42["telemetry",{"speed":"1.0000","cte":null,"image":"AA"}]"#;
        let Ok(Packet::Telemetry(telemetry)) = read(text) else { panic!("no telemetry") };
        assert_eq!((telemetry.cte, telemetry.pos_x), (Number(None), Number(None)));
        assert!(telemetry.hit.is_none());
    }

    #[test]
    fn packets_are_recognised() {
        assert!(matches!(read("2"), Ok(Packet::Ping(""))));
        assert!(matches!(read("2probe"), Ok(Packet::Ping("probe"))));
        for close in ["1", "41"] {
            assert!(matches!(read(close), Ok(Packet::Close)));
        }
        for manual in [r#"42["telemetry",{}]"#, r#"42["telemetry"]"#] {
            assert!(matches!(read(manual), Ok(Packet::Manual)));
        }
        for connect in ["40", "40{}"] {
            assert!(matches!(read(connect), Ok(Packet::Connect)));
        }
        for other in ["3", "0{}", r#"42["hello",{}]"#, r#"4217["hello"]"#] {
            assert!(matches!(read(other), Ok(Packet::Other)), "{other}");
        }
        for (wrong, part) in [
            ("", "not a packet"),
            ("GET /", "not a packet"),
            ("220 mail.example.org", "not a packet"),
            ("500 error", "not a packet"),
            ("49", "not a message"),
            (r#"42["telemetry",{"speed":"fast","image":""}]"#, "`fast` is not a number"),
            ("42{}", "not an event"),
        ] {
            let error = read(wrong).unwrap_err();
            assert!(error.contains(part), "{error}");
        }
    }
}
