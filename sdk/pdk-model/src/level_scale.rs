//! Scales of levels that were measured. A level of such a scale means the same for every perturbation, and lies somewhere among the
//! published levels of each, or beyond them.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::error::{Error, Result};
use crate::level::{Level, MAX_INTENSITY};

/// The published levels that a scale may reach: the parameters go on in straight lines below level 0 and above level 4.
pub const PUBLISHED_LEVELS: (f64, f64) = (-4.0, 12.0);

/// The scale that the level of a perturbation is on, if it is not the published one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum LevelScale {
    /// By its name, as users write it.
    Named(String),
    /// With what was measured for the perturbation, as records have it.
    Measured(MeasuredScale),
}

/// Where the levels of a scale lie for one perturbation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeasuredScale {
    /// The scale's name.
    pub name: String,
    /// The version of the perturbation that was measured.
    pub version: u32,
    /// `[level, published level]` by level, between which it is linear. The first and the last are how far the perturbation reaches; empty if
    /// it reaches no level.
    pub points: Vec<[f64; 2]>,
}

impl LevelScale {
    /// Reads a scale from a script or the command line.
    ///
    /// # Errors
    /// If it is neither a name nor what was measured.
    pub fn from_json(value: &Value) -> Result<Self> {
        if value.is_object() {
            let measured: MeasuredScale = serde_json::from_value(value.clone())
                .map_err(|error| Error::new(format!("the `level_scale` {value}: {error}")))?;
            measured.check_points()?;
            return Ok(Self::Measured(measured));
        }
        serde_json::from_value(value.clone()).map_err(|_| {
            Error::new(format!("the `level_scale` {value} is not the name of a scale; `pdk show NAME` lists those of a perturbation"))
        })
    }

    /// Its name.
    pub fn name(&self) -> &str {
        match self {
            Self::Named(name) => name,
            Self::Measured(measured) => &measured.name,
        }
    }
}

impl MeasuredScale {
    /// Makes sure that its points can be measurements.
    ///
    /// # Errors
    /// If they are out of order or out of range.
    fn check_points(&self) -> Result<()> {
        if self.are_points() {
            return Ok(());
        }
        let (low, high) = PUBLISHED_LEVELS;
        Err(Error::new(format!(
            "the points of scale `{}` have to be [level, published level] in rising order, the first from 0 to {MAX_INTENSITY}, the second from \
             {low} to {high}; measure it again",
            self.name
        )))
    }

    /// Whether its points are in order and in range.
    pub fn are_points(&self) -> bool {
        let (low, high) = PUBLISHED_LEVELS;
        let in_range = |[level, published]: &[f64; 2]| {
            (0.0..=MAX_INTENSITY).contains(level) && (low..=high).contains(published)
        };
        let rising = |a: &[f64; 2], b: &[f64; 2]| a[0] < b[0] && a[1] <= b[1];
        self.points.iter().all(in_range) && self.points.is_sorted_by(rising)
    }

    /// The lowest and the highest level that the perturbation reaches; none if it reaches none.
    pub fn reach(&self) -> Option<(f64, f64)> {
        Some((self.points.first()?[0], self.points.last()?[0]))
    }

    /// The published level that does what a level of this scale stands for. It may lie outside 0 to 4.
    pub fn published(&self, level: f64) -> Option<f64> {
        let next = self.points.partition_point(|point| point[0] < level);
        let after = self.points.get(next).or(self.points.last())?;
        let before = next.checked_sub(1).and_then(|before| self.points.get(before)).unwrap_or(after);
        let width = after[0] - before[0];
        if width == 0.0 || level == after[0] {
            return Some(after[1]);
        }
        Some(before[1] + (after[1] - before[1]) * ((level - before[0]) / width))
    }

    /// The same, if the perturbation reaches the level.
    pub fn reached(&self, level: f64) -> Option<f64> {
        let (low, high) = self.reach()?;
        self.published(level).filter(|_| (low..=high).contains(&level))
    }

    /// Makes sure that the perturbation reaches a level, or all levels of a course.
    ///
    /// # Errors
    /// If it does not.
    pub fn check(&self, level: &Level) -> Result<()> {
        let values = level.values();
        let Some(beyond) = values.iter().find(|value| self.reached(**value).is_none()) else { return Ok(()) };
        let reached = match self.reach() {
            Some((low, high)) => format!("its parameters reach levels {low} to {high} of it"),
            None => "its parameters reach no level of it".to_owned(),
        };
        Err(Error::new(format!("level {beyond} of scale `{}` cannot be had: {reached}", self.name)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn measured(points: &[[f64; 2]]) -> MeasuredScale {
        MeasuredScale { name: "own".to_owned(), version: 1, points: points.to_vec() }
    }

    #[test]
    fn levels_lie_between_what_was_measured() {
        let scale = measured(&[[0.5, -1.0], [1.0, 2.0], [3.0, 7.0]]);
        let published = |level| scale.published(level).unwrap();
        assert_eq!([0.5, 0.75, 1.0, 2.0, 3.0].map(published), [-1.0, 0.5, 2.0, 4.5, 7.0]);
        // Outside nothing is made up.
        assert_eq!([0.0, 4.0].map(published), [-1.0, 7.0]);
        assert_eq!(
            [0.0, 0.5, 3.0, 4.0].map(|level| scale.reached(level)),
            [None, Some(-1.0), Some(7.0), None]
        );
        assert_eq!(measured(&[]).published(1.0), None);
        assert_eq!(measured(&[[2.0, 3.0]]).published(2.0), Some(3.0));
    }

    #[test]
    fn a_level_that_is_not_reached_is_refused() {
        let scale = measured(&[[0.5, 0.0], [3.25, 8.0]]);
        assert!(scale.check(&Level::Constant(0.5)).is_ok());
        let refused = scale.check(&Level::Constant(4.0)).unwrap_err().to_string();
        assert_eq!(
            refused,
            "level 4 of scale `own` cannot be had: its parameters reach levels 0.5 to 3.25 of it"
        );
        let course = Level::Points { points: vec![[0.0, 1.0], [1.0, 3.5]] };
        assert!(scale.check(&course).unwrap_err().to_string().starts_with("level 3.5 of scale"));
        assert!(
            measured(&[]).check(&Level::Constant(2.0)).unwrap_err().to_string().contains("reach no level")
        );
    }

    #[test]
    fn what_cannot_be_a_scale_is_refused() {
        assert_eq!(LevelScale::from_json(&json!("own")).unwrap().name(), "own");
        let table = |points: Value| json!({"name": "own", "version": 1, "points": points});
        assert!(LevelScale::from_json(&table(json!([[0, 0], [4, 12]]))).is_ok());
        for wrong in
            [json!([[1, 0], [1, 2]]), json!([[0, 3], [1, 2]]), json!([[0, 0], [5, 2]]), json!([[0, -5]])]
        {
            let error = LevelScale::from_json(&table(wrong.clone())).unwrap_err().to_string();
            assert!(error.starts_with("the points of scale `own` have to be"), "{wrong}: {error}");
        }
        for wrong in [json!(3), json!(null), json!([1])] {
            let error = LevelScale::from_json(&wrong).unwrap_err().to_string();
            assert!(error.contains("is not the name of a scale"), "{wrong}: {error}");
        }
        let error = LevelScale::from_json(&json!({"name": "own"})).unwrap_err().to_string();
        assert!(error.ends_with("missing field `version`"), "{error}");
    }
}
