//! A mean over roads.

use crate::estimate::{Estimate, student_limit};
use crate::share::largest_unseen;

/// The mean of a quantity, of which there is one value a road; `range` is what it can be, infinite if it has no end. None if there
/// are not roads.
///
/// A single road says nothing about others: of a quantity without ends, the interval is the value then.
pub fn over_roads(values: &[f64], range: (f64, f64), confidence: f64) -> Option<Estimate> {
    (!values.is_empty()).then(|| interval(values, range, confidence))
}

/// The interval of the mean of values within a range, of which there is one a road.
///
/// If all roads have the same value, they do not say how much others may differ. Then the interval leaves room for as many roads with
/// any other value as could have been missed: with 10 roads up to 28 % of all. In any case as many roads at either end of the range
/// stay possible, so that a mean near an end is not surer than one at it.
pub(crate) fn interval(values: &[f64], range: (f64, f64), confidence: f64) -> Estimate {
    let roads = values.len() as f64;
    let value = values.iter().sum::<f64>() / roads;
    // Means of shares are not exact.
    let alike = |other: &f64| (other - values[0]).abs() <= 1e-9 * values[0].abs().max(1.0);
    let missed = largest_unseen(values.len() as u64, confidence);
    let (low, high) = match values.iter().all(alike) {
        true => {
            let toward = |end: f64| if end.is_finite() { value + (end - value) * missed } else { value };
            (toward(range.0), toward(range.1))
        }
        false => {
            let (low, high) = around(values, value, confidence);
            (low.clamp(range.0, value), high.clamp(value, range.1))
        }
    };
    let width = range.1 - range.0;
    match width.is_finite() {
        true => Estimate {
            value,
            low: low.min(range.1 - width * missed),
            high: high.max(range.0 + width * missed),
        },
        false => Estimate { value, low, high },
    }
}

/// The ends of the interval of a mean of values that differ.
///
/// Student's interval, corrected for skewness: P. Hall, "On the Removal of Skewness by Transformation" (1992). The mean of skewed values
/// divided by its standard error is skewed, too; a cubic of it that depends on the skewness of the values is nearly symmetric. So the
/// ends are where that cubic reaches Student's limits. Of symmetric values it is Student's interval.
fn around(values: &[f64], mean: f64, confidence: f64) -> (f64, f64) {
    let roads = values.len() as f64;
    let average = |of: fn(f64) -> f64| values.iter().map(|value| of(value - mean)).sum::<f64>() / roads;
    let (variance, third) = (average(|away| away * away), average(|away| away * away * away));
    let error = (variance / (roads - 1.0)).sqrt();
    let skew = third / (variance * (variance * roads).sqrt());
    let limit = student_limit(values.len(), confidence);
    // Below this the quotient is rounding; the terms that are left out are smaller still.
    if skew.abs() < 1e-6 {
        return (mean - limit * error, mean + limit * error);
    }
    // The inverse of t + skew t^2 / 3 + skew^2 t^3 / 27 + skew / 6.
    let errors = |reached: f64| 3.0 / skew * (libm::cbrt(1.0 + skew * (reached - skew / 6.0)) - 1.0);
    (mean - error * errors(limit), mean - error * errors(-limit))
}

#[cfg(test)]
mod tests {
    use super::*;

    const METRES: (f64, f64) = (0.0, f64::INFINITY);
    const ANY: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);
    const SHARE: (f64, f64) = (0.0, 1.0);

    #[test]
    fn a_mean_lies_in_its_interval_and_in_its_range() {
        let found = over_roads(&[0.1, 0.3, 0.2, 0.9, 0.1, 0.2], METRES, 0.95).unwrap();
        assert!((found.value - 0.3).abs() < 1e-15 && found.low < 0.3 && found.high > 0.3);
        // Two roads say next to nothing: 12.7 standard errors.
        let two = over_roads(&[1.1, 1.2], METRES, 0.95).unwrap();
        assert!(
            (two.low - (1.15 - 12.7062 * 0.05)).abs() < 1e-4 && (two.high - 1.7853).abs() < 1e-4,
            "{two:?}"
        );
        assert_eq!(over_roads(&[0.1, 0.2], METRES, 0.95).unwrap().low, 0.0);
        let alike = over_roads(&[0.4; 10], METRES, 0.95).unwrap();
        assert!(alike.value == alike.high && (alike.low - 0.4 * (1.0 - 0.2775)).abs() < 1e-4, "{alike:?}");
        assert!(over_roads(&[], METRES, 0.95).is_none());
        // Of skewed values with little confidence the interval would lie beside the mean.
        let beside = over_roads(&[0.0, 0.0, 0.0, 0.0, 0.0, 9.0], ANY, 0.05).unwrap();
        assert!(beside.low <= beside.value && beside.high >= beside.value, "{beside:?}");
    }

    #[test]
    fn an_interval_reaches_further_to_the_side_of_the_long_tail() {
        // By hand: the mean and the second and third central moments are 1.
        let values = [0.0, 0.0, 1.0, 1.0, 1.0, 3.0];
        let found = over_roads(&values, ANY, 0.95).unwrap();
        let (skew, error): (f64, f64) = ((1.0_f64 / 6.0).sqrt(), (1.0_f64 / 5.0).sqrt());
        let back = |end: f64| {
            let t = (1.0 - end) / error;
            t + skew * t * t / 3.0 + skew * skew * t * t * t / 27.0 + skew / 6.0
        };
        assert!(
            (back(found.low) - 2.570_582).abs() < 1e-4 && (back(found.high) + 2.570_582).abs() < 1e-4,
            "{found:?}"
        );
        assert!(found.high - 1.0 > 2.0 * (1.0 - found.low), "{found:?}");
        let mirrored = over_roads(&values.map(|value| -value), ANY, 0.95).unwrap();
        assert!((mirrored.low + found.high).abs() < 1e-9 && (mirrored.high + found.low).abs() < 1e-9);
        let symmetric = over_roads(&[-2.0, -1.0, 0.0, 0.0, 1.0, 2.0], ANY, 0.95).unwrap();
        assert!((symmetric.high - 2.570_582 * (10.0_f64 / 30.0).sqrt()).abs() < 1e-6, "{symmetric:?}");
    }

    #[test]
    fn what_differs_by_rounding_is_alike() {
        let rounded: Vec<f64> = (0..10).map(|road| if road % 2 == 0 { 0.6 - 0.4 } else { 0.2 }).collect();
        let Estimate { low, high, .. } = interval(&rounded, SHARE, 0.95);
        assert!((low - 0.2 * (1.0 - 0.2775)).abs() < 1e-4 && (high - (0.2 + 0.8 * 0.2775)).abs() < 1e-4);
    }

    #[test]
    fn the_same_numbers_give_the_same_interval() {
        // Fixed, so that another machine that differs is noticed.
        let Estimate { value, low, high } = interval(&[0.0, 0.2, 0.2, 0.4, 0.4, 1.0], ANY, 0.95);
        assert!((value - 2.2 / 6.0).abs() < 1e-15);
        assert!(
            (low - 0.096_174_227_954_117_18).abs() < 1e-15 && (high - 1.852_722_117_857_883_2).abs() < 1e-15,
            "{low} {high}"
        );
    }

    #[test]
    fn one_failure_is_not_more_certain_than_none() {
        let none = interval(&[0.0; 8], SHARE, 0.95);
        let one = interval(&[0.05, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], SHARE, 0.95);
        assert!(none.high > 0.3 && one.high == none.high, "{none:?} {one:?}");
        let all_but_one = interval(&[0.95, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0], SHARE, 0.95);
        assert!((all_but_one.low - (1.0 - none.high)).abs() < 1e-12, "{all_but_one:?}");
    }
}
