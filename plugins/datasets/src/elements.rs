//! The numbers of a recording of LeRobot: features, most of which are lists whose elements have names.

use std::fmt;

use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::Value;

/// A number of a feature.
#[derive(Debug, Clone, PartialEq)]
pub struct Element {
    /// The feature, which is a column.
    pub feature: String,
    /// Its place in the feature.
    pub number: usize,
    /// Its name there; the feature's if it has none.
    name: String,
}

impl fmt::Display for Element {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.name == self.feature {
            true => write!(f, "{}:{}", self.feature, self.number),
            false => write!(f, "{}:{}", self.feature, self.name),
        }
    }
}

/// The numbers of all features, those of actions first: what was done, and not what was measured.
pub fn elements(features: &Value) -> Vec<Element> {
    let mut all = Vec::new();
    for (feature, what) in features.as_object().into_iter().flatten() {
        let is_number =
            what["dtype"].as_str().is_some_and(|kind| kind.starts_with("float") || kind.starts_with("int"));
        if !is_number {
            continue;
        }
        let names = names(&what["names"]);
        let count = what["shape"][0].as_u64().unwrap_or(1).min(1 << 12) as usize;
        for number in 0..count {
            let name = names.get(number).cloned().unwrap_or_else(|| feature.clone());
            all.push(Element { feature: feature.clone(), number, name });
        }
    }
    all.sort_by_key(|element| !element.feature.starts_with("action"));
    all
}

/// The names of a feature's elements: a list, or a list under the name of what they are, such as `motors`.
fn names(value: &Value) -> Vec<String> {
    let list = value.as_array().or_else(|| value.as_object()?.values().find_map(Value::as_array));
    list.into_iter().flatten().filter_map(Value::as_str).map(str::to_owned).collect()
}

/// The number that was named, or the first one whose name has one of these words.
///
/// # Errors
/// If there is none of the name that was given.
pub fn choose(known: &[Element], given: &str, what: &str, words: &[&str]) -> Result<Option<Element>> {
    if given == "none" {
        return Ok(None);
    }
    if given.is_empty() {
        let has_word = |element: &&Element| {
            let name = element.name.to_lowercase();
            words.iter().any(|word| name.contains(word))
        };
        return Ok(known.iter().find(has_word).cloned());
    }
    let is_meant = |element: &&Element| match given.split_once(':') {
        None => element.feature == given,
        Some((feature, which)) => {
            element.feature == feature && (element.name == which || which.parse() == Ok(element.number))
        }
    };
    match known.iter().find(is_meant) {
        Some(element) => Ok(Some(element.clone())),
        None => {
            let known: Vec<String> = known.iter().map(Element::to_string).collect();
            Err(Error::new(format!(
                "there is no `{given}` for `{what}`; the recording has {}",
                known.join(", ")
            )))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_sdk::serde_json::json;

    #[test]
    fn numbers_are_found_by_name_place_or_word() {
        let features = json!({
            "observation.state": {"dtype": "float32", "shape": [2], "names": {"axes": ["speed", "steering"]}},
            "cam": {"dtype": "video", "shape": [3, 4, 4], "names": ["steering"]},
            "action": {"dtype": "float32", "shape": [2], "names": ["gas_pedal", "Steering_Angle"]},
            "extra": {"dtype": "float64", "shape": [1], "names": null},
        });
        let known = elements(&features);
        let choose = |given: &str, word: &str| {
            choose(&known, given, "x", &[word])
                .map(|found| found.map_or("none".to_owned(), |found| found.to_string()))
        };
        assert_eq!(choose("", "steer").unwrap(), "action:Steering_Angle");
        assert_eq!(choose("", "speed").unwrap(), "observation.state:speed");
        assert_eq!(choose("", "brake").unwrap(), "none");
        assert_eq!(choose("none", "steer").unwrap(), "none");
        assert_eq!(choose("observation.state:1", "").unwrap(), "observation.state:steering");
        assert_eq!(choose("extra", "").unwrap(), "extra:0");
        assert!(choose("action:2", "").unwrap_err().message().contains("action:gas_pedal"));
    }
}
