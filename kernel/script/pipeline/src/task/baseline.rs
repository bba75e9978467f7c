//! Baselines of corruption errors.

use std::collections::BTreeMap;

use pdk_metrics::alexnet;
use pdk_metrics::classification::{Errors, corruption_error, mean, relative_corruption_error};
use pdk_sdk::error::{Error, Result};
use serde::Serialize;
use serde_json::Value;

use crate::fields::Fields;

/// All levels of a perturbation.
const ALL_LEVELS: [f64; 5] = [0.0, 1.0, 2.0, 3.0, 4.0];

/// The errors of another network, by which those of the network under test are divided.
#[derive(Debug, Clone, PartialEq)]
pub struct Baseline {
    name: String,
    clean: Option<f64>,
    /// The mean error over the levels, by the perturbation's label.
    errors: BTreeMap<String, f64>,
    /// The levels over which these are means, if they are known.
    levels: Option<&'static [f64]>,
}

/// The errors of a network under a perturbation.
#[derive(Debug, Clone)]
pub struct UnderPerturbation {
    /// The perturbation with its parameters.
    pub label: String,
    /// The level and the error at it.
    pub errors: Vec<(f64, f64)>,
}

/// Corruption errors.
#[derive(Debug, Clone, Serialize)]
pub struct CorruptionErrors {
    /// The name of the baseline.
    pub baseline: String,
    /// How many perturbations have a corruption error, over which the means below are.
    pub over: usize,
    /// How many the baseline has.
    pub of: usize,
    /// The mean corruption error; none if no perturbation has one.
    pub mce: Option<f64>,
    /// The mean relative corruption error.
    pub relative_mce: Option<f64>,
    /// One for each perturbation.
    pub rows: Vec<CorruptionRow>,
}

/// The corruption errors of a perturbation.
#[derive(Debug, Clone, Serialize)]
pub struct CorruptionRow {
    /// The perturbation with its parameters.
    pub label: String,
    /// The mean top-1 error over its levels.
    pub error: f64,
    /// The same of the baseline; none if it has none, or has it over other levels.
    pub baseline_error: Option<f64>,
    /// The corruption error.
    pub ce: Option<f64>,
    /// The relative corruption error.
    pub relative_ce: Option<f64>,
}

impl Baseline {
    /// Reads what a pipeline wrote: `"alexnet"`, or a table with `name`, `errors` and maybe `clean`.
    ///
    /// # Errors
    /// If it is neither.
    pub fn read(value: &Value) -> Result<Self> {
        if value == "alexnet" {
            return Ok(Self {
                name: "AlexNet on ImageNet-C (Hendrycks and Dietterich, 2019)".to_owned(),
                clean: Some(alexnet::CLEAN),
                errors: alexnet::ERRORS.iter().map(|(label, error)| ((*label).to_owned(), *error)).collect(),
                levels: Some(&ALL_LEVELS),
            });
        }
        let wrong = || {
            Error::new(format!(
                "task: `baseline` is {value}, but has to be \"alexnet\" or a table {{ name = ..., clean = ..., errors = {{ \
                 PERTURBATION = ERROR, ... }} }} with the mean error over the levels of each perturbation"
            ))
        };
        if !value.is_object() {
            return Err(wrong());
        }
        let mut fields = Fields::new("task: baseline", value.clone(), &["name", "clean", "errors"])?;
        let errors = value["errors"].as_object().ok_or_else(wrong)?;
        let number = |(label, error): (&String, &Value)| {
            error.as_f64().map(|error| (label.clone(), error)).ok_or_else(wrong)
        };
        Ok(Self {
            name: value["name"].as_str().ok_or_else(wrong)?.to_owned(),
            clean: fields.number("clean")?,
            errors: errors.iter().map(number).collect::<Result<_>>()?,
            levels: None,
        })
    }

    /// The corruption errors of a network with this error on the pictures as they are, and these errors under perturbations.
    pub fn compare(&self, clean: f64, under: &[UnderPerturbation]) -> CorruptionErrors {
        let row = |UnderPerturbation { label, errors }: &UnderPerturbation| {
            let mut levels: Vec<f64> = errors.iter().map(|(level, _)| *level).collect();
            levels.sort_by(f64::total_cmp);
            let error = errors.iter().map(|(_, error)| error).sum::<f64>() / errors.len() as f64;
            // Means over other levels cannot be divided by each other.
            let is_over_these = self.levels.is_none_or(|over| levels == over);
            let baseline_error = self.errors.get(label).copied().filter(|_| is_over_these);
            let both = baseline_error.map(|baseline| ([error], [baseline]));
            let both = both.as_ref().map(|(network, baseline)| Errors { network, baseline });
            CorruptionRow {
                label: label.clone(),
                error,
                baseline_error,
                ce: both.as_ref().and_then(corruption_error),
                relative_ce: both
                    .as_ref()
                    .zip(self.clean)
                    .and_then(|(both, baseline)| relative_corruption_error(both, clean, baseline)),
            }
        };
        let rows: Vec<CorruptionRow> = under.iter().map(row).collect();
        let over =
            |of: fn(&CorruptionRow) -> Option<f64>| mean(&rows.iter().filter_map(of).collect::<Vec<_>>());
        CorruptionErrors {
            baseline: self.name.clone(),
            over: rows.iter().filter(|row| row.ce.is_some()).count(),
            of: self.errors.len(),
            mce: over(|row| row.ce),
            relative_mce: over(|row| row.relative_ce),
            rows,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn errors_are_divided_by_those_of_the_baseline() {
        let baseline =
            Baseline::read(&json!({"name": "small", "clean": 0.2, "errors": {"fog": 0.5, "rain": 0.4}}))
                .unwrap();
        let under = |label: &str, errors: &[(f64, f64)]| UnderPerturbation {
            label: label.to_owned(),
            errors: errors.to_vec(),
        };
        let of = [
            under("fog", &[(2.0, 0.2), (4.0, 0.3)]),
            under("rain", &[(4.0, 0.3)]),
            under("snow", &[(4.0, 0.9)]),
        ];
        let found = baseline.compare(0.1, &of);
        assert_eq!((found.over, found.of), (2, 2));
        assert!((found.mce.unwrap() - (0.5 + 0.75) / 2.0).abs() < 1e-12);
        assert!((found.relative_mce.unwrap() - (0.15 / 0.3 + 0.2 / 0.2) / 2.0).abs() < 1e-12);
        assert_eq!(found.rows[2].ce, None);
        let published = Baseline::read(&json!("alexnet")).unwrap();
        let (fog, error) = alexnet::ERRORS[9];
        let levels = |count: u32| (0..count).map(|level| (f64::from(level), error)).collect::<Vec<_>>();
        let found = published.compare(0.435, &[under(fog, &levels(5))]);
        assert_eq!((found.over, found.of), (1, 15));
        assert!(
            (found.mce.unwrap() - 1.0).abs() < 1e-12 && (found.relative_mce.unwrap() - 1.0).abs() < 1e-12
        );
        // The published errors are means over five levels.
        let few = published.compare(0.435, &[under(fog, &levels(4))]);
        assert_eq!((few.over, few.mce, few.rows[0].ce, few.rows[0].baseline_error), (0, None, None, None));
        let error = |more: Value| {
            let mut baseline = json!({"name": "small", "errors": {"fog": 0.5}});
            baseline.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
            Baseline::read(&baseline).unwrap_err().to_string()
        };
        assert!(error(json!({"clean": "0.4"})).contains("`clean` is \"0.4\", but has to be a number"));
        assert!(error(json!({"claen": 0.4})).contains("did you mean `clean`?"));
        assert!(Baseline::read(&json!("vgg")).unwrap_err().message().contains("`baseline` is \"vgg\""));
    }
}
