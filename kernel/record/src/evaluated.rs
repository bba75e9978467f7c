//! What an evaluation of a dataset goes through, so that a record is not continued with something else.

use std::collections::BTreeMap;
use std::fmt::Display;

use pdk_model::component::ComponentSpec;
use pdk_model::json::{difference, replace};
use pdk_model::perturbation::AppliedPerturbation;
use pdk_sdk::error::Result;
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// A clause about a value that was another one.
pub(crate) fn differs(what: &str, was: &dyn Display, is: &dyn Display) -> String {
    format!("{what} was {was} and is {is}")
}

/// An evaluation of a dataset: what decides its results, besides the seed of the run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EvaluationRecord {
    /// The reader of its frames.
    pub dataset: ComponentSpec,
    /// The driver under test.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub driver: Option<ComponentSpec>,
    /// The predictor under test, in the place of a driver.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub predictor: Option<ComponentSpec>,
    /// The metric with its parameters, of a predictor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub task: Option<Value>,
    /// Each perturbation at each level.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub perturbations: Vec<AppliedPerturbation>,
    /// How many frames the whole run has of it.
    pub frames: usize,
    /// The files and folders that it names, each with the hash of its content.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub files: BTreeMap<String, String>,
}

impl EvaluationRecord {
    /// What has to be equal for two evaluations to be equal, wherever the files are.
    ///
    /// # Errors
    /// If it cannot be JSON.
    fn compared(&self) -> Result<Value> {
        // As it comes out of the file.
        let mut value: Value = serde_json::from_str(&serde_json::to_string(self)?)?;
        if let Some(fields) = value.as_object_mut() {
            fields.remove("files");
        }
        replace(&mut value, &|text| Some(format!("blake3:{}", self.files.get(text)?)));
        Ok(value)
    }

    /// How it differs from the recorded one of the same number, as a clause; none if it does not.
    ///
    /// # Errors
    /// If one of them cannot be JSON.
    pub(crate) fn difference(&self, number: usize, recorded: &Self) -> Result<Option<String>> {
        let (was, is) = (recorded.compared()?, self.compared()?);
        let found = difference(&format!("evaluations[{number}]"), &was, &is);
        Ok(found.map(|(name, was, is)| match [&was, &is].iter().all(|value| is_content(value)) {
            true => format!("what {name} names has other contents"),
            false => differs(&name, &was, &is),
        }))
    }
}

fn is_content(value: &Value) -> bool {
    value.as_str().is_some_and(|text| text.starts_with("blake3:"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn record(dataset: &str, content: &str, driver: &str, level: &str) -> EvaluationRecord {
        let mut reader = ComponentSpec::new("tub");
        reader.parameters.insert("path".to_owned(), dataset.into());
        EvaluationRecord {
            dataset: reader,
            driver: Some(ComponentSpec::new(driver)),
            predictor: None,
            task: None,
            perturbations: vec![AppliedPerturbation::parse(level).unwrap()],
            frames: 10,
            files: BTreeMap::from([(dataset.to_owned(), content.to_owned())]),
        }
    }

    #[test]
    fn an_evaluation_is_the_same_wherever_its_files_are() {
        let first = record("here/tub", "ab", "net", "fog@1");
        let text = serde_json::to_string(&first).unwrap();
        let read: EvaluationRecord = serde_json::from_str(&text).unwrap();
        assert_eq!(read, first);
        let difference = |other: &EvaluationRecord| other.difference(1, &first).unwrap();
        assert_eq!(difference(&record("/there/tub", "ab", "net", "fog@1")), None);
        assert_eq!(
            difference(&record("here/tub", "cd", "net", "fog@1")).unwrap(),
            "what `evaluations[1].dataset.parameters.path` names has other contents"
        );
        assert_eq!(
            difference(&record("here/tub", "ab", "other", "fog@1")).unwrap(),
            "`evaluations[1].driver.name` was \"net\" and is \"other\""
        );
        assert_eq!(
            difference(&record("here/tub", "ab", "net", "fog@2")).unwrap(),
            "`evaluations[1].perturbations[0].level` was 1.0 and is 2.0"
        );
        let task = json!({"kind": "depth"});
        let predictor = EvaluationRecord {
            driver: None,
            predictor: Some(ComponentSpec::new("net")),
            task: Some(task),
            ..first.clone()
        };
        assert!(difference(&predictor).unwrap().starts_with("`evaluations[1].driver` was {"));
    }
}
