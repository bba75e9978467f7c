//! A saliency map that a perturbation is given, so that it can do more where the driver looks.

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::component::ComponentSpec;
use crate::error::{Error, Result};
use crate::pace::Pace;
use crate::selection::{component, is_one, one};

/// The maps that a perturbation is given.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Attention {
    /// The saliency method that makes them.
    pub by: ComponentSpec,
    /// As [`Pace::every`].
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub every: u64,
    /// As [`Pace::change`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub change: Option<f64>,
    /// As [`Pace::follow`].
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub follow: bool,
}

impl Attention {
    /// Reads it from a script or the command line: a saliency method as a text, or a table with `by` and how long a map is used.
    ///
    /// # Errors
    /// If it is neither, or contradicts itself.
    pub fn from_json(value: &Value) -> Result<Self> {
        let wrong = |why: &str| Error::new(format!("`attention` is {value}, but {why}"));
        let mut table = match value {
            Value::String(_) => json!({ "by": value }),
            table => table.clone(),
        };
        if let Some(by) = table.get_mut("by") {
            *by = serde_json::to_value(component("saliency method", "by", by)?)?;
        }
        let attention: Self = serde_json::from_value(table).map_err(|_| wrong(FORM))?;
        match attention.pace().mistake() {
            Some(mistake) => Err(wrong(mistake)),
            None => Ok(attention),
        }
    }

    /// How long a map is used.
    pub fn pace(&self) -> Pace {
        Pace { every: self.every, change: self.change, follow: self.follow }
    }
}

/// How it is written.
const FORM: &str = "has to be \"METHOD,model=FILE.onnx\", or { by = \"METHOD,model=FILE.onnx\" } with every or change, and \
                    follow if wanted";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_read_and_written_back_the_same() {
        let read = |value: Value| Attention::from_json(&value).unwrap();
        let plain = read(json!("hirescam,model=a.onnx"));
        assert_eq!((plain.by.name.as_str(), plain.every), ("hirescam", 1));
        let slow = read(json!({"by": {"name": "rise", "model": "a.onnx"}, "every": 5, "follow": true}));
        assert_eq!(slow.pace(), Pace { every: 5, change: None, follow: true });
        for attention in [plain, slow] {
            assert_eq!(read(serde_json::to_value(&attention).unwrap()), attention);
        }
        let error = |value: Value| Attention::from_json(&value).unwrap_err().to_string();
        assert!(error(json!(3)).contains("has to be \"METHOD"));
        assert!(error(json!({"every": 2})).contains("has to be \"METHOD"));
        assert!(error(json!({"by": "rise", "every": 0})).contains("every 0 frames"));
        assert!(error(json!({"by": "rise", "top": 20})).contains("has to be \"METHOD"));
    }
}
