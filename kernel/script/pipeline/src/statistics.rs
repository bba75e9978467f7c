//! The statistics that a pipeline can use, on plain lists: one entry a road.

use pdk_lua::ApiFunction;
use pdk_sdk::error::{Error, Result};
use pdk_statistics::CONFIDENCE;
use pdk_statistics::drives::{Drives, share_over_roads};
use pdk_statistics::groups;
use pdk_statistics::independent;
use pdk_statistics::level::{self, Bisection, Trial};
use pdk_statistics::mean;
use pdk_statistics::paired;
use serde_json::{Value, json};

use crate::bridge::function;
use crate::fields::Fields;

/// `pdk.failed_share`.
pub const FAILED_SHARE: ApiFunction = ApiFunction {
    name: "failed_share",
    signature: "(roads: { { boolean } }, confidence: number?) -> Estimate?",
    doc: "The share of drives that failed, from a list for each road of whether its drives failed, with its interval (of 95 % where \
          `confidence` is left out). Roads are the unit: several drives on a road count as one, by their mean. Nothing without \
          drives.",
    make: |lua| {
        function(lua, "pdk.failed_share", |_, [roads, confidence]| {
            let place = "pdk.failed_share";
            let roads: Vec<Drives> = list(place, &roads)?
                .iter()
                .map(|road| {
                    let mut drives = Drives::default();
                    for failed in list(place, road)? {
                        drives.add(truth(place, failed)?);
                    }
                    Ok(drives)
                })
                .collect::<Result<_>>()?;
            Ok(json!(share_over_roads(&roads, level_of_confidence(place, &confidence)?)))
        })
    },
};

/// `pdk.mean`.
pub const MEAN: ApiFunction = ApiFunction {
    name: "mean",
    signature: "(roads: { number }, confidence: number?) -> Estimate?",
    doc: "The mean of a quantity over roads, of which there is one value a road, with its interval, which is corrected for skewness. A \
          long tail that few roads do not show is missed: with ten roads, intervals of 95 % of a lognormal quantity (sigma 1) hold \
          the truth in 90 % of studies. Nothing without values.",
    make: |lua| {
        function(lua, "pdk.mean", |_, [roads, confidence]| {
            let place = "pdk.mean";
            let values =
                list(place, &roads)?.iter().map(|value| number(place, value)).collect::<Result<Vec<_>>>()?;
            Ok(json!(mean::over_roads(&values, UNLIMITED, level_of_confidence(place, &confidence)?)))
        })
    },
};

/// `pdk.mean_share`.
pub const MEAN_SHARE: ApiFunction = ApiFunction {
    name: "mean_share",
    signature: "(roads: { number | false }, confidence: number?) -> Estimate?",
    doc: "The mean over roads of a share, such as that of the levels at which a driver fails, from 0 to 1; `false` where a road was \
          not driven. Nothing if none was.",
    make: |lua| {
        function(lua, "pdk.mean_share", |_, [roads, confidence]| {
            let place = "pdk.mean_share";
            let values: Vec<f64> = shares(place, &roads)?.into_iter().flatten().collect();
            Ok(json!(mean::over_roads(&values, SHARE, level_of_confidence(place, &confidence)?)))
        })
    },
};

/// `pdk.compare`.
pub const COMPARE: ApiFunction = ApiFunction {
    name: "compare",
    signature: "(first: { number | false }, second: { number | false }, confidence: number?) -> Paired?",
    doc: "Compares two conditions that were driven on the same roads, such as two drivers: the share that failed on each road, \
          from 0 to 1, in the same order of roads; `false` where a road was not driven. Its p is for this comparison alone: use \
          `groups` for several. Nothing if no road has both.",
    make: |lua| {
        function(lua, "pdk.compare", |_, [first, second, confidence]| {
            let place = "pdk.compare";
            let (first, second) = (shares(place, &first)?, shares(place, &second)?);
            if first.len() != second.len() {
                return Err(Error::new(format!(
                    "{place}: the lists have {} and {} entries, but need one for each road; write false where one was not driven",
                    first.len(),
                    second.len()
                )));
            }
            let confidence = level_of_confidence(place, &confidence)?;
            Ok(json!(paired::compare(&first, &second, SHARE, confidence)))
        })
    },
};

/// `pdk.compare_independent`.
pub const COMPARE_INDEPENDENT: ApiFunction = ApiFunction {
    name: "compare_independent",
    signature: "(first: { number }, second: { number }) -> Independent?",
    doc: "Compares two samples that have nothing to do with each other, such as what searches by two strategies found. Nothing if \
          one of them is empty.",
    make: |lua| {
        function(lua, "pdk.compare_independent", |_, [first, second]| {
            let place = "pdk.compare_independent";
            let values = |sample| -> Result<Vec<f64>> {
                list(place, sample)?.iter().map(|value| number(place, value)).collect()
            };
            Ok(json!(independent::compare(&values(&first)?, &values(&second)?)))
        })
    },
};

/// `pdk.groups`.
pub const GROUPS: ApiFunction = ApiFunction {
    name: "groups",
    signature: "(entries: { { number | false } }, confidence: number?) -> { number }",
    doc: "The group of each entry of a ranking, from 1. The entries come in the order of the ranking, each as the share that failed \
          on each road (see `compare`). No two entries of a group can be told apart, and the first of each group differs \
          significantly from at least one of the group before; neighbours in different groups can still be close. All pairs are \
          tested together: where no entries differ, they are one group in at least 95 % of studies, or as `confidence` says, however \
          many there are. At 95 % fewer than six roads tell nothing apart.",
    make: |lua| {
        function(lua, "pdk.groups", |_, [entries, confidence]| {
            let place = "pdk.groups";
            let entries = list(place, &entries)?
                .iter()
                .map(|entry| shares(place, entry))
                .collect::<Result<Vec<_>>>()?;
            Ok(json!(groups::groups(&entries, level_of_confidence(place, &confidence)?)))
        })
    },
};

/// `pdk.failing_level`.
pub const FAILING_LEVEL: ApiFunction = ApiFunction {
    name: "failing_level",
    signature: "(roads: { { { Trial } } }, confidence: number?) -> FailingLevel?",
    doc: "The level at which the probability of failing reaches one half, from the drives on each road: a list for each repeat. Its \
          interval ends at levels that were driven. Nothing without drives.",
    make: |lua| {
        function(lua, "pdk.failing_level", |_, [roads, confidence]| {
            let place = "pdk.failing_level";
            let repeats = |road| -> Result<Vec<Vec<Trial>>> {
                list(place, road)?.iter().map(|repeat| trials(place, repeat)).collect()
            };
            let roads = list(place, &roads)?.iter().map(repeats).collect::<Result<Vec<_>>>()?;
            Ok(json!(level::failing_level(&roads, level_of_confidence(place, &confidence)?)))
        })
    },
};

/// `pdk.fails_at`.
pub const FAILS_AT: ApiFunction = ApiFunction {
    name: "fails_at",
    signature: "(trials: { Trial }, level: number) -> boolean?",
    doc: "Whether a driver fails at a level, by drives on one road under the same luck: by that at this level, or else by the nearest \
          level below that was failed or above that was survived. Nothing if no drive says it.",
    make: |lua| {
        function(lua, "pdk.fails_at", |_, [drives, level]| {
            let place = "pdk.fails_at";
            Ok(json!(level::fails_at(&trials(place, &drives)?, number(place, &level)?)))
        })
    },
};

/// `pdk.next_level`.
pub const NEXT_LEVEL: ApiFunction = ApiFunction {
    name: "next_level",
    signature: "(trials: { Trial }, search: Bisection?) -> number?",
    doc: "The level to drive next on a road with these drives so far, to find its failing level with few of them: the highest first, \
          then halfway between what was survived and what was failed. If each drive has luck of its own, as in a simulator with \
          its own clock, levels found like this are off by up to a quarter of a level. Nothing if enough is known.",
    make: |lua| {
        function(lua, "pdk.next_level", |_, [trials_so_far, search]| {
            let place = "pdk.next_level";
            let search = if search.is_null() { json!({}) } else { search };
            let mut fields = Fields::new(place, search, &["lowest", "highest", "resolution"])?;
            let bisection = Bisection {
                lowest: fields.number("lowest")?.unwrap_or(0.0),
                highest: fields.number("highest")?.unwrap_or(pdk_model::level::MAX_INTENSITY),
                resolution: fields.number("resolution")?.unwrap_or(0.25),
            };
            let Bisection { lowest, highest, resolution } = bisection;
            if !(lowest < highest && resolution > 0.0) {
                return Err(Error::new(format!(
                    "{place}: from {lowest} to {highest} in steps of {resolution} there is nothing to look for; `lowest` has to be \
                     below `highest`, and `resolution` above 0"
                )));
            }
            Ok(json!(bisection.next(&trials(place, &trials_so_far)?)))
        })
    },
};

const SHARE: (f64, f64) = (0.0, 1.0);
const UNLIMITED: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);

fn list<'a>(place: &str, value: &'a Value) -> Result<&'a Vec<Value>> {
    value.as_array().ok_or_else(|| Error::new(format!("{place}: {value} is not a list; write {{ ... }}")))
}

fn number(place: &str, value: &Value) -> Result<f64> {
    value.as_f64().ok_or_else(|| Error::new(format!("{place}: {value} is not a number")))
}

fn truth(place: &str, value: &Value) -> Result<bool> {
    value.as_bool().ok_or_else(|| {
        Error::new(format!("{place}: {value} is neither true, for a drive that failed, nor false"))
    })
}

/// The share that failed on each road; none if it was not driven.
fn shares(place: &str, value: &Value) -> Result<Vec<Option<f64>>> {
    let share = |value: &Value| match value {
        Value::Bool(false) => Ok(None),
        value => match number(place, value)? {
            share if (0.0..=1.0).contains(&share) => Ok(Some(share)),
            other => Err(Error::new(format!("{place}: {other} is not a share from 0 to 1"))),
        },
    };
    list(place, value)?.iter().map(share).collect()
}

fn trials(place: &str, value: &Value) -> Result<Vec<Trial>> {
    let trial = |value: &Value| {
        let mut fields = Fields::new(place, value.clone(), &["level", "failed"])?;
        let level = number(place, &fields.needed("level")?)?;
        Ok(Trial { level, failed: truth(place, &fields.needed("failed")?)? })
    };
    list(place, value)?.iter().map(trial).collect()
}

fn level_of_confidence(place: &str, value: &Value) -> Result<f64> {
    if value.is_null() {
        return Ok(CONFIDENCE);
    }
    let confidence = number(place, value)?;
    match confidence > 0.0 && confidence < 1.0 {
        true => Ok(confidence),
        false => Err(Error::new(format!(
            "{place}: the confidence is {confidence}, but has to be between 0 and 1, such as 0.95"
        ))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_of_a_script_are_read_and_mistakes_named() {
        assert_eq!(shares("x", &json!([0, false, 0.5])).unwrap(), [Some(0.0), None, Some(0.5)]);
        assert_eq!(
            trials("x", &json!([{"level": 1, "failed": true}])).unwrap(),
            [Trial { level: 1.0, failed: true }]
        );
        let said = [
            shares("x", &json!([1.5])).unwrap_err(),
            shares("x", &json!(["a"])).unwrap_err(),
            trials("x", &json!([{"level": 1}])).unwrap_err(),
            trials("x", &json!([{"level": 1, "failed": 0}])).unwrap_err(),
            level_of_confidence("x", &json!(95)).unwrap_err(),
            list("x", &json!(3)).unwrap_err(),
        ]
        .map(|error| error.to_string());
        for (said, part) in said.iter().zip([
            "x: 1.5 is not a share from 0 to 1",
            "x: \"a\" is not a number",
            "x: `failed` is missing",
            "x: 0 is neither true",
            "x: the confidence is 95, but has to be between 0 and 1",
            "x: 3 is not a list",
        ]) {
            assert!(said.starts_with(part), "{said}");
        }
    }
}
