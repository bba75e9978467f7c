//! How an output becomes a number of a control: which of its numbers, bins, scale, offset and clip.

use pdk_sdk::error::Result;
use pdk_sdk::serde_json::Value;

use crate::given::Given;
use crate::reading::{known, numbers, whole};
use crate::suggest::hint;

/// How outputs become a number of a control.
#[derive(Debug, Clone, PartialEq)]
pub struct Rule {
    /// The output; empty for the one that is guessed.
    pub output: String,
    /// Which of its numbers.
    pub index: Option<usize>,
    /// The values of its bins; none if it is a number.
    pub bins: Option<Vec<f64>>,
    /// How bins become a value.
    pub decode: Decode,
    /// A factor.
    pub scale: f64,
    /// What is added after the factor.
    pub offset: f64,
    /// The least and the greatest value after that.
    pub clip: Option<[f64; 2]>,
}

/// How the numbers of bins become a value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Decode {
    /// The bin with the greatest number; the first of several.
    Argmax,
    /// The mean of the bins' values, weighed by their numbers.
    Mean,
    /// The same after a softmax.
    SoftmaxMean,
}

/// The names of [`Decode`].
const DECODES: [(&str, Decode); 3] =
    [("argmax", Decode::Argmax), ("mean", Decode::Mean), ("softmax_mean", Decode::SoftmaxMean)];

impl Rule {
    /// An output as it is.
    pub fn plain(output: &str) -> Self {
        Self {
            output: output.to_owned(),
            index: None,
            bins: None,
            decode: Decode::Argmax,
            scale: 1.0,
            offset: 0.0,
            clip: None,
        }
    }
}

/// The throttle: of an output, or constant.
#[derive(Debug, Clone, PartialEq)]
pub enum Throttle {
    /// Of an output.
    Output(Rule),
    /// Constant.
    Constant(f64),
}

/// Reads a field with a rule.
pub(crate) fn rule(given: &Given, name: &str) -> Result<Option<Rule>> {
    let Some((value, _)) = given.get(name) else { return Ok(None) };
    let table = match value {
        Value::String(output) => return Ok(Some(Rule::plain(output))),
        Value::Object(table) => table,
        _ => {
            return Err(given.wrong(
                name,
                format_args!("is {value}; write the name of an output, or {{ output = \"NAME\", ... }}"),
            ));
        }
    };
    known(given, name, table, &["output", "index", "bins", "decode", "scale", "offset", "clip"])?;
    let wrong = |key: &str, value: &Value, what: &str| {
        Err(given.wrong(name, format_args!("has {value} as `{key}`; {what}")))
    };
    let mut rule = Rule::plain("");
    for (key, value) in table {
        match key.as_str() {
            "output" => match value.as_str() {
                Some(output) => rule.output = output.to_owned(),
                None => return wrong(key, value, "write the name of an output"),
            },
            "index" => match whole(value) {
                Some(index) => rule.index = Some(index),
                None => return wrong(key, value, "write which of the output's numbers it is, from 0"),
            },
            "bins" => match bins(value) {
                Some(bins) => rule.bins = Some(bins),
                None => {
                    return wrong(
                        key,
                        value,
                        "write { from = -1, to = 1, count = 15 }, or a list with the value of each bin",
                    );
                }
            },
            "decode" => match DECODES.iter().find(|(name, _)| value.as_str() == Some(name)) {
                Some((_, decode)) => rule.decode = *decode,
                None => {
                    let names = DECODES.map(|(name, _)| name);
                    return wrong(key, value, &hint(value.as_str().unwrap_or_default(), names));
                }
            },
            "clip" => match value.as_array().and_then(|_| numbers(value)).as_deref() {
                Some([low, high]) if low <= high => rule.clip = Some([*low, *high]),
                _ => return wrong(key, value, "write [least, greatest]"),
            },
            _ => match (value.as_f64(), key.as_str()) {
                (Some(number), "scale") => rule.scale = number,
                (Some(number), _) => rule.offset = number,
                (None, _) => return wrong(key, value, "write a number"),
            },
        }
    }
    match (&rule.bins, rule.index, table.contains_key("decode")) {
        (Some(_), Some(_), _) => {
            Err(given.wrong(name, "has both `bins`, which take the whole output, and `index`; leave one out"))
        }
        (None, _, true) => {
            Err(given.wrong(name, "has `decode`, which is for bins; set `bins` too, or leave it out"))
        }
        _ => Ok(Some(rule)),
    }
}

/// The values of bins.
fn bins(value: &Value) -> Option<Vec<f64>> {
    let Some(table) = value.as_object() else {
        return value.as_array().and_then(|_| numbers(value)).filter(|bins| bins.len() > 1);
    };
    if table.keys().any(|key| !["from", "to", "count"].contains(&key.as_str())) {
        return None;
    }
    let number = |key: &str| table.get(key).and_then(Value::as_f64);
    let count = table.get("count").and_then(whole).filter(|count| (2..=100_000).contains(count))?;
    let (from, to) = (number("from")?, number("to")?);
    Some((0..count).map(|bin| from + bin as f64 * ((to - from) / (count - 1) as f64)).collect())
}
