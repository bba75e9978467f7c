//! The sentences on top of the page about recordings: what breaks each driver, whether one is better than another, and what was done.

use crate::offline::{by_severity, compare};
use crate::text::{self, count, number, was};
use crate::view::Evaluation;

/// With fewer frames a constant is hard to beat.
const FEWEST: usize = 30;

/// The sentences on top of the page about these evaluations: what breaks each, whether one is better than another, and what was done.
pub fn verdict(evaluations: &[Evaluation]) -> Vec<String> {
    let of_each: Vec<[Vec<String>; 2]> =
        evaluations.iter().map(|evaluation| sentences(evaluation, evaluations.len() > 1)).collect();
    let pairs = compare::pairs(evaluations);
    let compared = pairs.into_iter().filter_map(|(base, other)| compare::sentence(base, other));
    let broken = of_each.iter().flat_map(|[broken, _]| broken.iter().cloned());
    broken.chain(compared).chain(of_each.iter().flat_map(|[_, done]| done.iter().cloned())).collect()
}

/// What breaks a driver, and what was done with it; of several evaluations the sentences name the driver.
fn sentences(evaluation: &Evaluation, is_one_of_several: bool) -> [Vec<String>; 2] {
    let bad = match evaluation.bad_frames.len() {
        0 => String::new(),
        bad => format!(" ({} left out)", was(bad, "frame")),
    };
    let perturbations = by_severity(evaluation).len();
    let off = match evaluation.original_error.is_nan() {
        true => "no steering was recorded to compare with".to_owned(),
        false => {
            format!(
                "without perturbation the steering is off by {} on average",
                number(evaluation.original_error)
            )
        }
    };
    let with = match is_one_of_several && !evaluation.driver.is_empty() {
        true => format!("With {}, ", evaluation.driver),
        false => String::new(),
    };
    let first = format!(
        "{with}{} evaluated under {}{bad}; {off}.",
        was(evaluation.frames, "frame"),
        count(perturbations, "perturbation"),
    );
    let the = if with.is_empty() { "The" } else { "the" };
    let worst = evaluation.cells.iter().max_by(|a, b| a.harm().total_cmp(&b.harm()));
    let second = worst.map(|worst| {
        let times = worst.error / evaluation.original_error;
        let times = match times.is_finite() && times >= 1.0 {
            true => format!(", {times:.1} times as much as without"),
            false => String::new(),
        };
        let interval = if worst.error.is_nan() { worst.drift_interval } else { worst.error_interval };
        let interval = interval.filter(|(low, high)| low.is_finite() && high.is_finite());
        let sure = interval
            .map_or_else(String::new, |(low, high)| format!(" (95 %: {} to {})", number(low), number(high)));
        format!(
            "{with}{the} worst perturbation is {}: at level {} the steering {} {}{sure}{times}.",
            worst.perturbation,
            text::short(worst.level),
            if worst.error.is_nan() { "drifts by" } else { "is off by" },
            number(worst.harm())
        )
    });
    let worse = evaluation.frames >= FEWEST && evaluation.original_error > evaluation.constant_error;
    let worthless = worse.then(|| {
        format!(
            "{with}{the} driver is worse than a constant on the frames as they are ({} against {} on average), so what perturbations do to it \
             says nothing.",
            number(evaluation.original_error),
            number(evaluation.constant_error)
        )
    });
    [worthless.into_iter().chain(second).collect(), vec![first]]
}
