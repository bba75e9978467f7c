//! Who is still driving, over time.

use pdk_sdk::error::Result;

use crate::closed_loop::NO_PERTURBATION;
use crate::color::{LINES, NOMINAL, ORDERED, Rgb};
use crate::curve::{Axes, Chart, Curve, chart};
use crate::tally::common_level;
use crate::text;
use crate::view::{Drive, Scenario, Verdict};

/// Perturbations that have a curve of their own.
const CURVES: usize = 7;

/// Shares that are still driving, over time: by level, and for the worst perturbations. If levels were chosen by what failed, that
/// is the level at which all were driven. `end` is the last time on the axis, in seconds.
///
/// # Errors
/// If a picture cannot be drawn.
pub fn curves(drive: &Drive, order: &[String], chosen: &[f64], end: f64) -> Result<Vec<Chart>> {
    let common = match chosen.is_empty() {
        true => None,
        false => match common_level(&drive.scenarios) {
            None => return Ok(Vec::new()),
            common => common,
        },
    };
    if end <= 0.0 {
        return Ok(Vec::new());
    }
    let counted =
        || drive.scenarios.iter().filter(|s| common.is_none() || s.level.is_none() || s.level == common);
    let curve = |key: String, name: String, color: Rgb, in_group: &dyn Fn(&Scenario) -> bool| {
        let group: Vec<&Scenario> = counted().filter(|s| s.verdict != Verdict::Void && in_group(s)).collect();
        let points = survival(&group, end);
        let name = format!("{name} ({})", group.len());
        (!group.is_empty()).then_some(Curve { key, name, points, band: Vec::new(), color })
    };
    let nominal =
        || curve("–".to_owned(), NO_PERTURBATION.to_owned(), NOMINAL, &|s| s.perturbation.is_none());
    let axes = |label| Axes {
        x: "simulation time in s",
        x_range: (0.0, end),
        y: "still driving",
        top: 1.0,
        share: true,
        label,
    };

    let mut by_level: Vec<Curve> = nominal().into_iter().collect();
    let whole = drive.scenarios.iter().filter_map(|s| s.level).all(|level| level.fract() == 0.0);
    for (step, color) in ORDERED.iter().enumerate() {
        let name = match (whole, step + 1 == ORDERED.len()) {
            (true, _) | (_, true) => format!("level {step}"),
            (false, false) => format!("level {step} to below {}", step + 1),
        };
        by_level.extend(curve(step.to_string(), name, *color, &|s| {
            s.perturbation.is_some() && s.level.is_some_and(|level| level.floor() as usize == step)
        }));
    }
    by_level.extend(curve("~".to_owned(), "as given".to_owned(), LINES[3], &|s| {
        s.perturbation.is_some() && s.level.is_none()
    }));

    let mut worst: Vec<Curve> = nominal().into_iter().collect();
    let failing =
        |name: &&String| counted().any(|s| s.verdict.failed() && s.perturbation.as_ref() == Some(*name));
    for ((name, color), key) in order.iter().filter(failing).take(CURVES).zip(LINES).zip('A'..) {
        worst.extend(curve(key.to_string(), name.clone(), color, &|s| s.perturbation.as_ref() == Some(name)));
    }
    let of = match order.iter().filter(failing).count() > CURVES {
        true => "for the worst perturbations",
        false => "by perturbation with failures",
    };
    Ok(match common {
        Some(level) => {
            let label = format!("Share of scenarios still driving at level {}, {of}", text::short(level));
            vec![chart(&worst, &axes(&label))?]
        }
        None => vec![
            chart(&by_level, &axes("Share of scenarios still driving, by level"))?,
            chart(&worst, &axes(&format!("Share of scenarios still driving, {of}")))?,
        ],
    })
}

/// The share that has not failed, over time, as corners of a line of steps. Who reached the end of the road counts as still
/// driving.
pub fn survival(group: &[&Scenario], end: f64) -> Vec<(f64, f64)> {
    let mut times: Vec<f64> = group.iter().filter(|s| s.verdict.failed()).map(|s| s.time).collect();
    times.sort_by(f64::total_cmp);
    let mut points = vec![(0.0, 1.0)];
    let share = |failed: usize| 1.0 - failed as f64 / group.len().max(1) as f64;
    for (failed, time) in times.into_iter().enumerate() {
        points.extend([(time, share(failed)), (time, share(failed + 1))]);
    }
    let last = points[points.len() - 1].1;
    points.push((end, last));
    points
}
