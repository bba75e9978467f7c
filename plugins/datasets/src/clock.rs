//! Which time a frame has.

use pdk_sdk::prelude::*;

use crate::record::Record;

/// Gives every frame its time in seconds since the first.
#[derive(Debug, Clone, Copy)]
pub enum Clock {
    /// The recorded times, counted from this one in milliseconds.
    Recorded { start: f64 },
    /// This many frames a second, one after the other.
    Rate(f64),
}

impl Clock {
    /// The parameters that choose the clock.
    pub fn parameters() -> [Parameter; 2] {
        [
            Parameter::choice(
                "clock",
                &["recorded", "rate"],
                "where the time of a frame comes from: its record, or its place at a fixed rate",
            ),
            Parameter::number(
                "rate",
                20.0,
                "frames per second with `clock=rate`, and if the records have no time",
            )
            .range(0.001, 100_000.0)
            .unit("1/s"),
        ]
    }

    /// The clock that the configuration asks for. `first` is the first record that could be read; whether it has a
    /// time decides for the whole recording.
    pub fn new(config: &Config, first: Option<&Record>) -> Self {
        match first.and_then(|record| record.milliseconds) {
            Some(start) if config.text("clock") == "recorded" => Clock::Recorded { start },
            _ => Clock::Rate(config.number("rate")),
        }
    }

    /// Seconds since the first frame.
    ///
    /// # Errors
    /// If the recording has times and this record has none.
    pub fn time(&self, index: usize, record: &Record) -> Result<f64> {
        match (self, record.milliseconds) {
            (Clock::Rate(rate), _) => Ok(index as f64 / rate),
            (Clock::Recorded { start }, Some(now)) => Ok((now - start) / 1000.0),
            (Clock::Recorded { .. }, None) => Err(Error::new(
                "the record has no time although others have one; set `clock=rate` to do without times",
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_sdk::serde_json::{Map, json};

    fn clock(clock: &str, first: Option<f64>) -> Clock {
        let description =
            Clock::parameters().into_iter().fold(Description::dataset("d", ""), Description::parameter);
        let given: Map<_, _> = json!({"clock": clock, "rate": 10.0}).as_object().unwrap().clone();
        Clock::new(&Config::check(&description, &given).unwrap(), Some(&record(first)))
    }

    fn record(milliseconds: Option<f64>) -> Record {
        Record { milliseconds, ..Record::default() }
    }

    #[test]
    fn recorded_times_count_from_the_first() {
        let clock = clock("recorded", Some(5000.0));
        assert_eq!(clock.time(7, &record(Some(5250.0))).unwrap(), 0.25);
        assert!(clock.time(7, &record(None)).unwrap_err().message().contains("clock=rate"));
    }

    #[test]
    fn the_rate_is_used_if_there_are_no_times_or_if_it_is_requested() {
        assert_eq!(clock("recorded", None).time(7, &record(None)).unwrap(), 0.7);
        assert_eq!(clock("rate", Some(5000.0)).time(7, &record(Some(9000.0))).unwrap(), 0.7);
    }
}
