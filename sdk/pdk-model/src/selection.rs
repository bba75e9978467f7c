//! Which pixels a perturbation changes: those that a saliency map marks, or as many at random.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::component::ComponentSpec;
use crate::error::{Error, Result};
use crate::pace::Pace;

/// Pixels that are chosen by a saliency map.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Selection {
    /// The share of the frame that matters most, in percent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub top: Option<f64>,
    /// The share of the frame that matters least, in percent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bottom: Option<f64>,
    /// A share of the frame at random, in percent, exactly as many pixels as `top` would take.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub random: Option<f64>,
    /// All pixels whose value, from 0 to 1, is above this one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub above: Option<f64>,
    /// What a simulator's own labels say that a pixel shows, such as `road`: one or several of its names.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub label: Vec<String>,
    /// What is at most this many metres away, as the simulator says.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nearer: Option<f64>,
    /// What is at least this many metres away, as the simulator says.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub farther: Option<f64>,
    /// A mask, which says itself how much of each pixel is perturbed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mask: Option<ComponentSpec>,
    /// The saliency method that makes the map, for `top`, `bottom` and `above`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub by: Option<ComponentSpec>,
    /// As [`Pace::every`].
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub every: u64,
    /// As [`Pace::change`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub change: Option<f64>,
    /// As [`Pace::follow`].
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub follow: bool,
    /// Gaps and notches up to twice this many pixels across are closed.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub close: u32,
    /// Spots of fewer pixels are left out.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub smallest: u32,
    /// The edges are blended over this many pixels.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub soft: u32,
}

pub(crate) fn one() -> u64 {
    1
}

pub(crate) fn is_one(value: &u64) -> bool {
    *value == 1
}

fn is_zero(value: &u32) -> bool {
    *value == 0
}

/// Which pixels are chosen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Choice {
    /// A share of the frame in percent, of what matters most.
    Top(f64),
    /// A share of the frame in percent, of what matters least.
    Bottom(f64),
    /// A share of the frame in percent, at random.
    Random(f64),
    /// What matters more than this value.
    Above(f64),
    /// What a simulator's labels say.
    Labelled,
    /// What a mask says.
    Masked,
    /// What is between these distances in metres.
    Between(f64, f64),
}

/// The largest number of pixels for `close` and `soft`.
const LARGEST: u32 = 1000;

impl Selection {
    /// Reads a selection from a script or the command line; `by` is a text as for a component on the command line, or a table.
    ///
    /// # Errors
    /// If it is none, or contradicts itself.
    pub fn from_json(value: &Value) -> Result<Self> {
        let wrong = |why: &str| Error::new(format!("`where` is {value}, but {why}"));
        let mut table = value.as_object().ok_or_else(|| wrong(FORM))?.clone();
        if let Some(by) = table.get_mut("by") {
            *by = serde_json::to_value(component("saliency method", "by", by)?)?;
        }
        if let Some(mask) = table.get_mut("mask") {
            *mask = serde_json::to_value(component("mask", "mask", mask)?)?;
        }
        if let Some(label) = table.get_mut("label").filter(|label| label.is_string()) {
            *label = Value::Array(vec![label.take()]);
        }
        let selection: Self = serde_json::from_value(Value::Object(table)).map_err(|_| wrong(FORM))?;
        let choices = [selection.top, selection.bottom, selection.random, selection.above];
        let shares = [selection.top, selection.bottom, selection.random].into_iter().flatten();
        let distances: Vec<_> = selection.farther.into_iter().chain(selection.nearer).collect();
        let by_content = [!selection.label.is_empty(), selection.mask.is_some(), !distances.is_empty()];
        let by_content = by_content.into_iter().filter(|given| *given).count();
        let by_map = [selection.top, selection.bottom, selection.above].iter().flatten().count() == 1;
        let mistake = if choices.iter().flatten().count() + by_content != 1 {
            "it has to have one of top, bottom, random, above, label, mask and a distance (nearer, farther or both)"
        } else if shares.into_iter().any(|share| !(0.0..=100.0).contains(&share)) {
            "its share has to be from 0 to 100 percent"
        } else if selection.above.is_some_and(|above| !(0.0..=1.0).contains(&above)) {
            "what it is above has to be from 0 to 1"
        } else if distances.iter().any(|distance| !(0.0..=1e6).contains(distance)) {
            "its distances have to be from 0 to 1,000,000 metres"
        } else if !distances.is_sorted() {
            "nothing is both farther and nearer than these"
        } else if by_map != selection.by.is_some() {
            if selection.by.is_some() {
                return Err(wrong("`by` goes with top, bottom and above alone"));
            }
            "it has to say by which saliency method, such as by=\"hirescam,model=FILE.onnx\""
        } else if let Some(mistake) = selection.pace().mistake() {
            mistake
        } else if selection.close > LARGEST || selection.soft > LARGEST {
            "close and soft are at most 1000 pixels"
        } else {
            return Ok(selection);
        };
        Err(wrong(mistake))
    }

    /// How long a map is used.
    pub fn pace(&self) -> Pace {
        Pace { every: self.every, change: self.change, follow: self.follow }
    }

    /// Which pixels are chosen.
    pub fn choice(&self) -> Choice {
        match (self.top, self.bottom, self.random, self.above) {
            (Some(share), ..) => Choice::Top(share),
            (_, Some(share), ..) => Choice::Bottom(share),
            (_, _, Some(share), _) => Choice::Random(share),
            (.., Some(above)) => Choice::Above(above),
            _ if self.mask.is_some() => Choice::Masked,
            _ if self.nearer.is_some() || self.farther.is_some() => {
                Choice::Between(self.farther.unwrap_or(0.0), self.nearer.unwrap_or(f64::INFINITY))
            }
            _ => Choice::Labelled,
        }
    }
}

/// Reads a component that a modifier names under a key: a text as on the command line, or a table.
///
/// # Errors
/// If it is none.
pub(crate) fn component(kind: &str, key: &str, value: &Value) -> Result<ComponentSpec> {
    match value {
        Value::String(text) => ComponentSpec::parse(kind, text),
        table => ComponentSpec::from_json(key, table),
    }
}

/// How a selection is written.
const FORM: &str = "has to be { top = 20, by = \"METHOD,model=FILE.onnx\" }, with bottom or above in place of top; { random = 20 }, { label = \"road\" }, \
                    { farther = 20, nearer = 60 } or { mask = \"MASK\" }; and every or change, follow, close, smallest and soft if wanted";

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_selection_is_read_and_written_back_the_same() {
        let read = |value: Value| Selection::from_json(&value).unwrap();
        let selection =
            read(json!({"top": 20, "by": "hirescam,model=a.onnx,sign=positive", "every": 5, "soft": 3}));
        assert_eq!(selection.choice(), Choice::Top(20.0));
        assert_eq!(selection.by.as_ref().unwrap().parameters["model"], "a.onnx");
        let written = serde_json::to_value(&selection).unwrap();
        assert_eq!(read(written.clone()), selection);
        assert!(written.get("smallest").is_none() && written["every"] == 5);
        assert_eq!(
            read(json!({"above": 0.5, "by": {"name": "rise", "model": "a.onnx"}})).choice(),
            Choice::Above(0.5)
        );
        assert_eq!(read(json!({"random": 50})).choice(), Choice::Random(50.0));
        let road = read(json!({"label": "road", "soft": 2}));
        assert_eq!((road.choice(), &road.label), (Choice::Labelled, &vec!["road".to_owned()]));
        assert_eq!(read(json!({"label": ["road", "sky"]})).label.len(), 2);
        let masked = read(json!({"mask": "segmentation,model=a.onnx,classes=7"}));
        assert_eq!(masked.choice(), Choice::Masked);
        let between = read(json!({"farther": 5, "nearer": 30.5}));
        assert_eq!(between.choice(), Choice::Between(5.0, 30.5));
        assert_eq!(read(json!({"farther": 5})).choice(), Choice::Between(5.0, f64::INFINITY));
        assert_eq!(read(json!({"nearer": 0})).choice(), Choice::Between(0.0, 0.0));
        for selection in [road, masked, between] {
            assert_eq!(read(serde_json::to_value(&selection).unwrap()), selection);
        }
    }

    #[test]
    fn mistakes_are_named() {
        let error = |value: Value| Selection::from_json(&value).unwrap_err().to_string();
        assert!(error(json!(3)).contains("has to be { top = 20"));
        assert!(error(json!({"left": 3})).contains("has to be { top = 20"));
        assert!(
            error(json!({"top": 3, "bottom": 3, "by": "rise"}))
                .contains("one of top, bottom, random, above, label, mask")
        );
        assert!(error(json!({"top": 101, "by": "rise"})).contains("0 to 100 percent"));
        assert!(error(json!({"above": 2, "by": "rise"})).contains("from 0 to 1"));
        assert!(error(json!({"top": 10})).contains("by which saliency method"));
        assert!(error(json!({"label": []})).contains("one of top"));
        assert!(error(json!({"label": "road", "by": "rise"})).contains("`by` goes with"));
        assert!(error(json!({"nearer": 5, "label": "road"})).contains("one of top"));
        assert!(error(json!({"nearer": 5, "farther": 6})).contains("both farther and nearer"));
        assert!(error(json!({"nearer": -5})).contains("0 to 1,000,000 metres"));
        assert!(error(json!({"random": 10, "every": 0})).contains("every 0 frames"));
        assert!(
            error(json!({"random": 10, "every": 2, "change": 3})).contains("`every`, or until a `change`")
        );
        assert!(error(json!({"random": 10, "follow": true})).contains("nothing to follow"));
        assert!(error(json!({"random": 10, "change": 300})).contains("from 0 to 255"));
        assert!(error(json!({"random": 10, "soft": 2000})).contains("at most 1000"));
    }
}
