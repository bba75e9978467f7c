//! How far back a derivative holds: drives that begin at some frame of the recorded one, with levels a little lower and higher from there.

use pdk_chain::chain::Chain;
use pdk_sdk::error::Result;

use crate::course::on_courses;
use crate::rehearsal::{Driven, Place, Rehearsal};
use crate::sweep::Sensitivity;
use crate::variant::Variant;

/// How long the shortest window is, in seconds; each one is twice as long as the one before.
const SHORTEST: f64 = 0.5;
/// How far prediction and drive may be apart, as a share of the larger of both.
pub const TOLERANCE: f64 = 0.2;
/// What is less than this many metres for one level is nothing.
pub const NOTHING: f64 = 1e-3;

/// The levels of one perturbation changed from a frame on, up to the frame of the largest error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Window {
    /// The first frame.
    pub from: usize,
    /// How the error changes by the derivative, in metres for one level.
    pub predicted: f64,
    /// How it changes by drives with the levels a little lower and higher.
    pub driven: f64,
}

impl Window {
    /// Whether prediction and drives agree.
    pub fn agrees(&self) -> bool {
        let Self { predicted, driven, .. } = *self;
        let largest = predicted.abs().max(driven.abs());
        largest < NOTHING || (predicted - driven).abs() <= TOLERANCE * largest
    }
}

/// The windows of a perturbation, the shortest first. The last one is the whole drive up to the largest error.
///
/// # Errors
/// If a component fails.
pub fn windows(
    rehearsal: &mut Rehearsal<'_>,
    driven: &Driven,
    sensitivity: &Sensitivity,
    perturbation: usize,
    frame_done: &mut dyn FnMut(),
) -> Result<Vec<Window>> {
    let (rate, worst) = (rehearsal.camera().rate, sensitivity.worst);
    let (courses, influence) = (&sensitivity.courses, &sensitivity.influence[perturbation]);
    let applied = on_courses(&rehearsal.scenario().perturbations, courses);
    let mut variant = Variant::new(rehearsal, &applied, perturbation, &courses[perturbation])?;
    let mut windows: Vec<Window> = Vec::new();
    let mut length = (SHORTEST * rate).round().max(1.0) as usize;
    while windows.last().is_none_or(|last| last.from > 0) && worst > 0 {
        let from = worst.saturating_sub(length);
        let mut error = |chain| from_frame(rehearsal, &driven.places[from], chain, sensitivity, frame_done);
        let [lower, higher] = &mut variant.chains;
        let by_drives = -error(lower)? + error(higher)?;
        let apart = |frame: usize| variant.distance(frame);
        let by_derivative: f64 = (from..worst).map(|frame| influence[frame] * apart(frame)).sum();
        let levels = (from..worst).map(apart).sum::<f64>() / (worst - from) as f64;
        windows.push(Window { from, predicted: by_derivative / levels, driven: by_drives / levels });
        length *= 2;
    }
    Ok(windows)
}

/// How many frames before the largest error the derivative holds: those of the longest window that agrees, as all shorter ones do.
pub fn reach(windows: &[Window], worst: usize) -> usize {
    windows.iter().take_while(|window| window.agrees()).last().map_or(0, |window| worst - window.from)
}

/// The cross-track error at the frame of the largest one, towards its side, of a drive that begins at a frame and goes through this chain. It is driven on also if
/// it left its lane before.
fn from_frame(
    rehearsal: &mut Rehearsal<'_>,
    start: &Place,
    chain: &mut Chain,
    sensitivity: &Sensitivity,
    frame_done: &mut dyn FnMut(),
) -> Result<f64> {
    rehearsal.restore(start.frame, &start.saved)?;
    let mut place = start.clone();
    for _ in start.frame..sensitivity.worst as u64 {
        rehearsal.render(&place)?;
        let decision = rehearsal.decide_alone(chain, &place)?;
        place = rehearsal.act(&place, decision.applied)?;
        frame_done();
    }
    Ok(sensitivity.side * place.state.cross_track_error)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_derivative_holds_as_far_back_as_all_shorter_windows_agree() {
        let window = |from, predicted, driven| Window { from, predicted, driven };
        let windows =
            [window(90, 0.1, 0.11), window(80, 0.2, 0.19), window(60, 0.2, 0.1), window(20, 0.2, 0.2)];
        assert_eq!(reach(&windows, 100), 20);
        assert_eq!(reach(&windows[2..], 100), 0);
        assert_eq!(reach(&[], 100), 0);
        // Nothing agrees with nothing, and a change of the sign with nothing else.
        assert!(window(0, 1e-5, -2e-4).agrees() && !window(0, 0.1, -0.1).agrees());
    }
}
