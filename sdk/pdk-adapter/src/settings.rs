//! The parameters that every adapter has.

use std::time::Duration;

use pdk_sdk::prelude::{Config, Description, Error, ErrorKind, Parameter, Result};
use pdk_sdk::serde_json::{Value, json};

use crate::deadline::Deadline;

/// How long a simulator may take to start, in seconds: less than pdk grants one call of a component.
const START_SECONDS: f64 = 45.0;
/// How long it may take to answer, in seconds.
const ANSWER_SECONDS: f64 = 10.0;

/// Where a simulator is, how it is started and how long it may take.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// What users call the simulator, such as "the Donkey simulator".
    pub title: &'static str,
    /// The host that the simulator runs on, or the address that an adapter listens at.
    pub host: String,
    /// The port of slot 0.
    pub port: u16,
    /// How much higher the port of each further slot is.
    pub port_step: u16,
    /// The program that starts the simulator, and its arguments; empty if it is running already.
    pub launch: Vec<String>,
    /// How long it may take to start.
    pub start: Duration,
    /// How long it may take for anything else.
    pub answer: Duration,
}

impl Settings {
    /// Adds the parameters to the description of an adapter. The simulator of slot 0 is at `port`, the next one `port_step` above.
    pub fn describe(description: Description, port: u16, port_step: u16) -> Description {
        description
            .parameter(
                Parameter::text("host", "host of the simulator, or the address to listen at for one that connects to pdk; this machine where \
                     it is not set"),
            )
            .parameter(
                Parameter::integer("port", port.into(), "port of the simulator of the first worker").range(1.0, 65_535.0),
            )
            .parameter(
                Parameter::integer(
                    "port_step",
                    port_step.into(),
                    "how much higher the port of each further worker's simulator is",
                )
                .range(1.0, 1000.0),
            )
            .parameter(Parameter::json(
                "launch",
                Value::Null,
                "program that starts the simulator, and its arguments, as a list of texts in which {port} and {slot} are filled in; \
                 null where the simulator is running already",
            )
            .starts_program())
            .parameter(
                Parameter::number(
                    "start_seconds",
                    START_SECONDS,
                    "how long the simulator may take until it is ready; if that is 60 s or more, raise pdk's own `patience` too",
                )
                    .range(0.1, 3600.0)
                    .unit("s"),
            )
            .parameter(
                Parameter::number("answer_seconds", ANSWER_SECONDS, "how long the simulator may take for an answer")
                    .range(0.1, 3600.0)
                    .unit("s"),
            )
            .parameter(gpus())
            // A check does not wait as long for a simulator that is not there.
            .example(json!({ "start_seconds": 5 }))
    }

    /// Reads the parameters.
    ///
    /// # Errors
    /// If `launch` is not a list of texts.
    pub fn read(title: &'static str, config: &Config) -> Result<Self> {
        let whole = |name| u16::try_from(config.integer(name)).unwrap_or(u16::MAX);
        let host = match config.text("host") {
            "" => "127.0.0.1",
            host => host,
        };
        Ok(Self {
            title,
            host: host.to_owned(),
            port: whole("port"),
            port_step: whole("port_step"),
            launch: words("launch", config.value("launch"))?,
            start: Duration::from_secs_f64(config.number("start_seconds")),
            answer: Duration::from_secs_f64(config.number("answer_seconds")),
        })
    }

    /// The port of a slot's simulator.
    ///
    /// # Errors
    /// If there is no such port.
    pub fn port_of(&self, slot: u32) -> Result<u16> {
        let port = u64::from(self.port) + u64::from(slot) * u64::from(self.port_step);
        u16::try_from(port).map_err(|_| {
            mistake(format!(
                "worker {slot} would need port {port}, and there are none above 65535; lower `port` or `port_step`, or the number of \
                 workers"
            ))
        })
    }

    /// The end of a wait for the start of the simulator.
    pub fn starting(&self) -> Deadline {
        Deadline::new(self.start, "start_seconds")
    }

    /// The end of a wait for an answer.
    pub fn answering(&self) -> Deadline {
        Deadline::new(self.answer, "answer_seconds")
    }
}

/// The parameter that says how much of a GPU a program needs that pdk starts. A pool that places workers goes by it; nothing else does.
pub fn gpus() -> Parameter {
    Parameter::number(
        "gpus",
        0.0,
        "how much of a GPU the program needs, for pools that place workers by that",
    )
    .range(0.0, 64.0)
}

/// A program with its arguments, from the value of a parameter: a list of texts, or null for none.
///
/// # Errors
/// If it is something else.
pub fn words(parameter: &str, value: &Value) -> Result<Vec<String>> {
    list(value).ok_or_else(|| {
        mistake(format!(
            "`{parameter}` is {value}, but has to be a program with its arguments, as in [\"./program\", \"--option\", \"value\"]"
        ))
    })
}

/// Texts from the value of a parameter: a list of them, one alone, or null for none.
///
/// # Errors
/// If it is something else.
pub fn texts(parameter: &str, value: &Value) -> Result<Vec<String>> {
    list(value).ok_or_else(|| mistake(format!("`{parameter}` is {value}, but has to be a list of texts")))
}

/// A list of texts, one alone, or null or nothing for none.
fn list(value: &Value) -> Option<Vec<String>> {
    match value {
        Value::Null => Some(Vec::new()),
        Value::String(text) if text.is_empty() => Some(Vec::new()),
        Value::String(text) => Some(vec![text.clone()]),
        Value::Array(texts) => texts.iter().map(|text| Some(text.as_str()?.to_owned())).collect(),
        _ => None,
    }
}

/// Something that only the user can correct.
fn mistake(sentence: String) -> Error {
    Error::of(ErrorKind::Configuration, sentence)
}

#[cfg(test)]
mod tests {

    use super::*;

    fn read(given: Value) -> Result<Settings> {
        let description = Settings::describe(Description::simulator("x", "X"), 9091, 2);
        let Value::Object(given) = given else { panic!("not an object") };
        Settings::read("the simulator", &Config::check(&description, &given)?)
    }

    #[test]
    fn every_slot_has_a_port_of_its_own() {
        let settings = read(json!({})).unwrap();
        assert_eq!(
            (settings.host.as_str(), settings.port_of(0), settings.port_of(3)),
            ("127.0.0.1", Ok(9091), Ok(9097))
        );
        let error = read(json!({"port": 65_535})).unwrap().port_of(1).unwrap_err();
        assert!(error.message().contains("would need port 65537"), "{error}");
    }

    #[test]
    fn what_is_launched_is_a_list_of_words() {
        let launch = |value| read(json!({"launch": value})).map(|settings| settings.launch);
        assert_eq!(launch(Value::Null), Ok(Vec::new()));
        assert_eq!(launch(json!("./run it")), Ok(vec!["./run it".to_owned()]));
        assert_eq!(launch(json!(["a", "{port}"])), Ok(vec!["a".to_owned(), "{port}".to_owned()]));
        for wrong in [json!(3), json!(["a", 1]), json!({"a": 1})] {
            assert!(launch(wrong).unwrap_err().message().starts_with("`launch` is "));
        }
    }
}
