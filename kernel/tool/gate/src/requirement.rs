//! What a suite requires of the new driver.

use serde::{Deserialize, Serialize};

/// A requirement with a name of its own, or one that follows from it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Requirement {
    /// What tables call it.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub name: String,
    /// What is required.
    #[serde(flatten)]
    pub kind: Kind,
}

/// What is required.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Kind {
    /// The new driver does not fail more often than the old one by more than what is tolerated: a test.
    NotWorse {
        /// Over all scenarios, or in each group of them.
        #[serde(default)]
        by: By,
        /// By how much its failure rate may be higher; what the suite says if it is left out.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        tolerated: Option<f64>,
    },
    /// The new driver fails in no scenario that the old one passes.
    NoNewFailure {
        /// In this many of the drawn scenarios, from the first; all if it is left out.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pairs: Option<usize>,
    },
    /// The new driver passes the fixed scenarios.
    Passes {
        /// Up to this many it may fail.
        #[serde(default)]
        allowed: usize,
    },
    /// A measure of the new driver is below or above a limit on enough roads or blocks, which are drawn for this.
    Measure {
        /// The measure: a field of outcomes, or of their `measures`; of recordings, a number of [`BlockOutcome`](crate::came::BlockOutcome).
        measure: String,
        /// The perturbation with its level; none for a clear view.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        at: Option<String>,
        /// It has to be less than this.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        below: Option<f64>,
        /// It has to be more than this.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        above: Option<f64>,
        /// On how many roads or blocks, of how many.
        on: [usize; 2],
    },
}

/// Which scenarios are tested together.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum By {
    /// All of them.
    #[default]
    Overall,
    /// Those of each perturbation.
    Perturbation,
    /// Those of each level.
    Level,
}

impl Requirement {
    /// One without a name.
    pub fn of(kind: Kind) -> Self {
        Self { name: String::new(), kind }
    }

    /// What is required, in a clause; `tolerated` is what the suite says, and `drawn` what is drawn for measures.
    pub fn described(&self, tolerated: f64, drawn: &str) -> String {
        let Kind::NotWorse { by, tolerated: own } = &self.kind else { return self.title(drawn) };
        let by = match by {
            By::Overall => "",
            By::Perturbation => ", each perturbation for itself",
            By::Level => ", each level for itself",
        };
        format!("{} by more than {}{by}", self.title(drawn), own.unwrap_or(tolerated))
    }

    /// What tables call it; `drawn` is what is drawn for measures.
    pub fn title(&self, drawn: &str) -> String {
        if !self.name.is_empty() {
            return self.name.clone();
        }
        match &self.kind {
            Kind::NotWorse { .. } => "not worse".to_owned(),
            Kind::NoNewFailure { .. } => "no failure that the old one does not have".to_owned(),
            Kind::Passes { allowed: 0 } => "passes all fixed scenarios".to_owned(),
            Kind::Passes { allowed } => format!("fails at most {allowed} fixed scenarios"),
            Kind::Measure { measure, at, below, above, on: [need, of] } => {
                let at = at.as_deref().map(|at| format!(" at {at}")).unwrap_or_default();
                let limits = [("below", *below), ("above", *above)];
                let limits: Vec<String> =
                    limits.iter().filter_map(|(word, limit)| Some(format!("{word} {}", (*limit)?))).collect();
                format!("{measure}{at} {} on {need} of {of} {drawn}", limits.join(" and "))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::fixture::{SMALL, suite};

    #[test]
    fn requirements_are_read_and_called_by_what_they_say() {
        let with = |text: &str| suite(&format!("{SMALL}\n[[require]]\n{text}"));
        for (text, title) in [
            ("kind = \"not_worse\"\nby = \"level\"", "not worse"),
            ("kind = \"no_new_failure\"\nname = \"nothing new\"", "nothing new"),
            (
                "kind = \"measure\"\nmeasure = \"max_cross_track_error\"\nat = \"fog@2\"\nbelow = 0.5\non = [9, 10]",
                "max_cross_track_error at fog@2 below 0.5 on 9 of 10 roads",
            ),
        ] {
            assert_eq!(with(text).unwrap().suite.required()[0].title("roads"), title);
        }
        for (text, said) in [
            ("kind = \"not_wrse\"", "unknown variant `not_wrse`"),
            ("kind = \"not_worse\"\nbelow = 1", "unknown field `below`"),
            ("kind = \"passes\"", "has no [[scenario]]"),
            (
                "kind = \"measure\"\nmeasure = \"x\"\nbelow = 1\non = [9, 10]",
                "names no measure of outcomes; they are time",
            ),
            ("kind = \"measure\"\nmeasure = \"time\"\non = [9, 10]", "has no limit"),
            ("kind = \"measure\"\nmeasure = \"time\"\nbelow = 1\non = [11, 10]", "has a wrong `on`"),
            ("kind = \"not_worse\"\ntolerated = 1.5", "has a `tolerated`"),
        ] {
            let error = with(text).unwrap_err().to_string();
            assert!(error.contains(said), "{error}");
        }
    }
}
