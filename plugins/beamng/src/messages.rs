//! Requests and answers: MessagePack maps, each behind its length.

use pdk_adapter::{Connection, Deadline};
use pdk_sdk::prelude::{Error, ErrorKind, Result};
use rmpv::Value;

/// The longest message in bytes: a picture of 4096x4096 pixels, and more than any level's list of objects.
pub const LONGEST: usize = 80 << 20;

/// A connection to the game engine or to a vehicle.
#[derive(Debug)]
pub struct Messages {
    connection: Connection,
    /// The number of the next request.
    next: u64,
}

/// The value of a key of a map; nil if there is none.
pub fn field<'a>(map: &'a Value, key: &str) -> &'a Value {
    let entries = map.as_map().map_or(&[][..], Vec::as_slice);
    entries.iter().find(|(name, _)| name.as_str() == Some(key)).map_or(&Value::Nil, |(_, value)| value)
}

/// Three finite numbers; none if the value is something else.
pub fn three(value: &Value) -> Option<[f64; 3]> {
    let number = |i: usize| match value {
        // Lua has one kind of table: a list may come as a map that counts from 1, or has the names of the axes.
        Value::Array(elements) => elements.get(i)?.as_f64(),
        Value::Map(entries) => {
            let named = |name: &Value| {
                name.as_u64() == Some(i as u64 + 1) || name.as_str() == Some(["x", "y", "z"][i])
            };
            entries.iter().find(|(name, _)| named(name))?.1.as_f64()
        }
        _ => None,
    };
    let numbers = [number(0)?, number(1)?, number(2)?];
    numbers.iter().all(|number| number.is_finite()).then_some(numbers)
}

/// A request: what it is, and what belongs to it.
pub fn request(number: u64, what: &str, fields: Vec<(&str, Value)>) -> Vec<u8> {
    let mut all = vec![("type".into(), what.into())];
    all.extend(fields.into_iter().map(|(name, value)| (name.into(), value)));
    all.push(("_id".into(), number.into()));
    let mut bytes = vec![0; 4];
    if let Err(error) = rmpv::encode::write_value(&mut bytes, &Value::Map(all)) {
        unreachable!("memory takes every byte: {error}");
    }
    let length = (bytes.len() - 4) as u32;
    bytes[..4].copy_from_slice(&length.to_be_bytes());
    bytes
}

impl Messages {
    /// Takes a connection and says hello. Both sides have to have the same version of the protocol.
    ///
    /// # Errors
    /// If the other end is not BeamNG.tech, or has another version.
    pub fn open(connection: Connection, version: &str, deadline: &Deadline) -> Result<Self> {
        let mut messages = Self { connection, next: 0 };
        let answer = messages.call("Hello", vec![("protocolVersion", version.into())], "Hello", deadline)?;
        match field(&answer, "protocolVersion").as_str() {
            Some(theirs) if theirs == version => Ok(messages),
            Some(theirs) => Err(Error::of(
                ErrorKind::Configuration,
                format!(
                    "{} speaks version {theirs} of its protocol, but {version} was asked for; set `protocol` to {theirs}, or start another \
                     release of BeamNG.tech",
                    messages.connection.peer()
                ),
            )),
            None => Err(messages.strange("Hello", &answer)),
        }
    }

    /// As the other end is named to users.
    pub fn peer(&self) -> &str {
        self.connection.peer()
    }

    /// Whether the connection still stands.
    pub fn is_open(&mut self) -> bool {
        self.connection.has_bytes(1).is_ok()
    }

    /// Sends a request and waits for its answer, which says that it is an `expected`.
    ///
    /// # Errors
    /// If the other end is gone, does not answer in time, refuses, or answers something else.
    pub fn call(
        &mut self,
        what: &str,
        fields: Vec<(&str, Value)>,
        expected: &str,
        deadline: &Deadline,
    ) -> Result<Value> {
        let answer = self.ask(what, fields, deadline)?;
        match field(&answer, "type").as_str() {
            Some(kind) if kind == expected => Ok(answer),
            _ => Err(self.strange(what, &answer)),
        }
    }

    /// Sends a request and waits for its answer, whatever that calls itself.
    ///
    /// # Errors
    /// If the other end is gone, does not answer in time, or refuses.
    pub fn ask(&mut self, what: &str, fields: Vec<(&str, Value)>, deadline: &Deadline) -> Result<Value> {
        let number = self.next;
        self.next += 1;
        self.connection.send(&request(number, what, fields), deadline)?;
        let waiting = format!("answered `{what}`");
        loop {
            let length = self.connection.bytes(4, deadline, &waiting)?;
            let length = length.iter().fold(0usize, |length, byte| length << 8 | usize::from(*byte));
            let bytes = self.connection.bytes(length, deadline, &waiting)?;
            let answer = rmpv::decode::read_value(&mut &bytes[..]).ok().filter(Value::is_map);
            let Some(answer) = answer else {
                return Err(self.nonsense(format!("answers `{what}` with what is not a MessagePack map")));
            };
            // Answers that are no longer waited for are dropped.
            if field(&answer, "_id").as_u64() != Some(number) {
                continue;
            }
            for problem in ["bngError", "bngValueError"] {
                let said = field(&answer, problem);
                if !said.is_nil() {
                    let said = said.as_str().map_or_else(|| said.to_string(), str::to_owned);
                    return Err(Error::new(format!("{} refused `{what}`: {said}", self.peer())));
                }
            }
            return Ok(answer);
        }
    }

    /// An answer that is not what it should be.
    pub fn strange(&self, what: &str, answer: &Value) -> Error {
        let said: String = answer.to_string().chars().take(200).collect();
        self.nonsense(format!("answers `{what}` with {said}"))
    }

    fn nonsense(&self, what: String) -> Error {
        Error::of(ErrorKind::Nonsense, format!("{} {what}; is another program at this port?", self.peer()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_request_is_a_map_behind_its_length() {
        let bytes = request(7, "Step", vec![("count", 3.into()), ("ack", true.into())]);
        assert_eq!(bytes[..4], (bytes.len() as u32 - 4).to_be_bytes());
        let map = rmpv::decode::read_value(&mut &bytes[4..]).unwrap();
        assert_eq!((field(&map, "type").as_str(), field(&map, "_id").as_u64()), (Some("Step"), Some(7)));
        assert_eq!((field(&map, "count").as_u64(), field(&map, "ack").as_bool()), (Some(3), Some(true)));
        assert!(field(&map, "no").is_nil());
    }

    #[test]
    fn a_vector_is_a_list_or_what_lua_makes_of_one() {
        let numbers = || [1.5, 2.0, 3.0].map(Value::F64);
        let counted = (1u64..).map(Value::from).zip(numbers()).collect();
        let named = ["x", "y", "z"].map(Value::from).into_iter().zip(numbers()).collect();
        for value in [Value::Array(numbers().to_vec()), Value::Map(counted), Value::Map(named)] {
            assert_eq!(three(&value), Some([1.5, 2.0, 3.0]));
        }
        assert_eq!(three(&Value::Array(vec![1.into(), Value::F64(f64::NAN), 3.into()])), None);
        assert_eq!(three(&Value::Nil), None);
    }
}
