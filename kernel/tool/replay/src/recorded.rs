//! The scenarios of a record, by their numbers and ids.

use std::collections::BTreeMap;

use pdk_loop::protocol::Skip;
use pdk_model::scenario::Mode;
use pdk_record::ledger::Line;
use pdk_record::trace::step::Step;
use pdk_sdk::error::{Error, Result};

/// A text of digits up to this length may be the number of a scenario; a longer one is an id.
const LONGEST_NUMBER: usize = 10;
/// This many digits of an id have to be there, so that a word that happens to be hexadecimal is not one.
const SHORTEST_ID: usize = 6;
/// Digits of a whole id.
const ID: usize = 32;
/// Characters of a name that fit into a line.
const LONGEST_NAME: usize = 60;

/// A scenario in a record.
#[derive(Debug, Clone, PartialEq)]
pub struct Recorded {
    /// Its number: its place in the ledger, from 0.
    pub number: u64,
    /// Its line in the ledger.
    pub line: Line,
}

impl Recorded {
    /// Its name, cut off if it does not fit into a line.
    pub fn short_name(&self) -> String {
        let name = &self.line.name;
        match name.char_indices().nth(LONGEST_NAME) {
            Some((end, _)) => format!("{}...", &name[..end]),
            None => name.clone(),
        }
    }

    /// Which frames its driver did not see, if it was driven in real time; `steps` are those of its trace, in which their
    /// numbers are missing. Those behind the last step are in the outcome only.
    pub fn skips(&self, steps: &[Step]) -> Option<Vec<Skip>> {
        if self.line.scenario.mode == Mode::Lockstep {
            return None;
        }
        let gap = |pair: &[Step]| {
            let behind = pair[0].sequence;
            Skip { behind, count: pair[1].sequence.saturating_sub(behind + 1) }
        };
        let mut skips: Vec<Skip> = steps.windows(2).map(gap).filter(|skip| skip.count > 0).collect();
        let before: u64 = skips.iter().map(|skip| skip.count).sum();
        let count = self.line.outcome.skipped_frames.saturating_sub(before);
        skips.extend(steps.last().filter(|_| count > 0).map(|last| Skip { behind: last.sequence, count }));
        Some(skips)
    }
}

/// The wanted ones of the scenarios in a ledger, in order, each once; all if none is named. A scenario is named by its number, by
/// its id, or by a beginning of its id that no other has. Digits that could be both are the number, if there is such a scenario. `place`
/// is what errors call the record.
///
/// # Errors
/// If a text does not name a scenario, or names several.
pub fn select(lines: Vec<Line>, wanted: &[String], place: &str) -> Result<Vec<Recorded>> {
    let mut scenarios: BTreeMap<u64, Line> = (0..).zip(lines).collect();
    if !wanted.is_empty() {
        let found = wanted.iter().map(|text| find(&scenarios, text, place)).collect::<Result<Vec<_>>>()?;
        scenarios.retain(|number, _| found.contains(number));
    }
    Ok(scenarios.into_iter().map(|(number, line)| Recorded { number, line }).collect())
}

fn find(scenarios: &BTreeMap<u64, Line>, text: &str, place: &str) -> Result<u64> {
    let last = scenarios.len().saturating_sub(1);
    let digits = !text.is_empty() && text.bytes().all(|c| c.is_ascii_digit());
    if digits && text.len() <= LONGEST_NUMBER {
        if let Some(number) = text.parse().ok().filter(|number| scenarios.contains_key(number)) {
            return Ok(number);
        }
        if text.len() < SHORTEST_ID {
            let count = scenarios.len();
            return Err(Error::new(format!(
                "{place} holds no scenario {text}; it has {count} of them, from 0 to {last}"
            )));
        }
    }
    if !(SHORTEST_ID..=ID).contains(&text.len()) || !text.bytes().all(|c| c.is_ascii_hexdigit()) {
        return Err(Error::new(format!(
            "`{text}` does not name a scenario; write its number, from 0 to {last}, its id, or the first {SHORTEST_ID} or more of the {ID} \
             hexadecimal digits of that, unless they are the number of another scenario"
        )));
    }
    let beginning = text.to_ascii_lowercase();
    let mut fitting = scenarios.iter().filter(|(_, line)| line.id.to_string().starts_with(&beginning));
    match (fitting.next(), fitting.next()) {
        (Some((number, _)), None) => Ok(*number),
        (None, _) if digits => Err(Error::new(format!(
            "{place} holds no scenario {text}, and none whose id begins with it; the numbers go from 0 to {last}, and the ids stand in its \
             scenarios.jsonl"
        ))),
        (None, _) => Err(Error::new(format!(
            "{place} holds no scenario whose id begins with {text}; the ids stand in its scenarios.jsonl"
        ))),
        (Some((first, _)), Some((second, _))) => Err(Error::new(format!(
            "{text} begins the ids of several scenarios in {place}, such as {first} and {second}; write more of its digits"
        ))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn line(id: &str) -> Line {
        let value = json!({
            "id": id, "name": "x", "images_every": 0, "success": false, "cause": "time_out", "time": 1.0,
            "frames": 5, "progress": 0.5, "mean_cross_track_error": 0.1, "max_cross_track_error": 0.2,
            "digest": "",
            "scenario": {"simulator": {"name": "lane"}, "driver": {"name": "x"}, "duration": 1.0, "seed": 0},
        });
        serde_json::from_value(value).unwrap()
    }

    const IDS: [&str; 4] = [
        "00000000000000000000000000000001",
        "123456789012aaaaaaaaaaaaaaaaaaaa",
        "abcdef12aaaaaaaaaaaaaaaaaaaaaaaa",
        "abcdef13aaaaaaaaaaaaaaaaaaaaaaaa",
    ];

    fn numbers(wanted: &[&str]) -> Result<Vec<u64>> {
        let wanted: Vec<String> = wanted.iter().map(|text| (*text).to_owned()).collect();
        let found = select(IDS.map(line).to_vec(), &wanted, "run")?;
        Ok(found.into_iter().map(|recorded| recorded.number).collect())
    }

    #[test]
    fn scenarios_are_named_by_numbers_and_ids() {
        assert_eq!(numbers(&[]).unwrap(), [0, 1, 2, 3]);
        assert_eq!(numbers(&["3", "1", "abcdef13"]).unwrap(), [1, 3]);
        assert_eq!(numbers(&["ABCDEF12", IDS[0]]).unwrap(), [0, 2]);
        // Eleven digits are no longer a number.
        assert_eq!(numbers(&["12345678901"]).unwrap(), [1]);
        assert_eq!(numbers(&["0000000002"]).unwrap(), [2]);
        let error = |text: &str| numbers(&[text]).unwrap_err().to_string();
        assert_eq!(error("4"), "run holds no scenario 4; it has 4 of them, from 0 to 3");
        assert_eq!(
            error("abcdef"),
            "abcdef begins the ids of several scenarios in run, such as 2 and 3; write more of its digits"
        );
        assert!(error("abcdef14").starts_with("run holds no scenario whose id begins with abcdef14; "));
        // Six digits or more may be either, and are the number if there is one.
        assert_eq!(numbers(&["123456"]).unwrap(), [1]);
        assert_eq!(numbers(&["000001"]).unwrap(), [1]);
        assert!(
            error("123457").starts_with("run holds no scenario 123457, and none whose id begins with it; ")
        );
        for text in ["", "abcde", "nominal", "-1", "1.5", &"a".repeat(33)] {
            assert!(
                error(text).starts_with(&format!("`{text}` does not name a scenario; write its number")),
                "{text}"
            );
        }
    }

    #[test]
    fn frames_that_were_skipped_are_those_that_the_trace_lacks() {
        let mut recorded = Recorded { number: 0, line: line(IDS[0]) };
        let step = |sequence: u64| Step { sequence, ..Step::default() };
        let steps = [0, 1, 4, 5, 7].map(step);
        assert_eq!(recorded.skips(&steps), None);
        recorded.line.scenario.mode = Mode::Realtime;
        let skips = |recorded: &Recorded, steps: &[Step]| {
            let skips = recorded.skips(steps).unwrap().into_iter();
            skips.map(|skip| (skip.behind, skip.count)).collect::<Vec<_>>()
        };
        recorded.line.outcome.skipped_frames = 3;
        assert_eq!(skips(&recorded, &steps), [(1, 2), (5, 1)]);
        recorded.line.outcome.skipped_frames = 7;
        assert_eq!(skips(&recorded, &steps), [(1, 2), (5, 1), (7, 4)]);
        // Nothing for the clock to say, even if nothing is known.
        assert_eq!(skips(&recorded, &[]), []);
    }

    #[test]
    fn long_names_are_cut_off() {
        let mut recorded = Recorded { number: 0, line: line(IDS[0]) };
        recorded.line.name = "foggy".to_owned();
        assert_eq!(recorded.short_name(), "foggy");
        recorded.line.name = "ä".repeat(70);
        assert_eq!(recorded.short_name(), format!("{}...", "ä".repeat(60)));
    }
}
