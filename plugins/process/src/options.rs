//! The parameters that a driver and a simulator in another process have in common.

use std::time::Duration;

use pdk_adapter::settings;
use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::{Value, json};

use crate::modules;

/// Which program it is, and how long it may take.
pub struct Options {
    /// The program and its arguments; empty for one that runs already.
    pub command: Vec<String>,
    /// The name by which one that runs already finds pdk.
    pub exchange: String,
    /// How long it may take for the first answer.
    pub start: Duration,
    /// How long it may take for any other answer.
    pub answer: Duration,
    /// Further files and folders that it reads.
    pub files: Vec<String>,
}

impl Options {
    /// Adds the parameters to a description; `what` is the default name of the exchange.
    pub fn describe(description: Description, what: &str) -> Description {
        description
            .external()
            // A check is not to wait for a program that is not there.
            .example(json!({ "start_seconds": 1 }))
            .parameter(Parameter::json(
                "command",
                Value::Null,
                "the program and its arguments, as a list of texts; null for one that runs already",
            )
            .starts_program())
            .parameter(Parameter {
                default: what.into(),
                ..Parameter::text("exchange", "the name by which one that runs already finds pdk")
            })
            .parameter(
                Parameter::number(
                    "start_seconds",
                    45.0,
                    "how long it may take for the first answer; if that is 60 s or more, raise pdk's own `patience` too",
                )
                    .range(0.01, 3600.0)
                    .unit("s"),
            )
            .parameter(
                Parameter::number("answer_seconds", 5.0, "how long it may take for any other answer")
                    .range(0.001, 3600.0)
                    .unit("s"),
            )
            .parameter(Parameter::json(
                "files",
                Value::Null,
                "further files and folders that the program reads, as a list of texts, such as its weights: the record holds their hashes, as \
                 it does for the files in the command and the modules beside them",
            ))
            .parameter(settings::gpus())
    }

    /// Reads the parameters.
    ///
    /// # Errors
    /// If `exchange` is not a name, or `command` or `files` is not a list of texts.
    pub fn read(config: &Config) -> Result<Self> {
        let exchange = config.text("exchange").to_owned();
        let fits = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        if exchange.is_empty() || exchange.len() > 40 || !exchange.chars().all(fits) {
            return Err(Error::of(
                ErrorKind::Configuration,
                format!(
                    "`exchange` is `{exchange}`, but has to be 1 to 40 letters, digits, dashes and underscores"
                ),
            ));
        }
        let seconds = |name| Duration::from_secs_f64(config.number(name));
        Ok(Self {
            command: settings::words("command", config.value("command"))?,
            exchange,
            start: seconds("start_seconds"),
            answer: seconds("answer_seconds"),
            files: settings::texts("files", config.value("files"))?,
        })
    }

    /// The files that the program reads besides those that the parameters name.
    ///
    /// # Errors
    /// As for [`Self::read`], and if a folder cannot be listed.
    pub fn input_files(config: &Config) -> Result<Vec<InputFiles>> {
        let Self { command, files, .. } = Self::read(config)?;
        modules::input_files(&command, &files)
    }
}
