//! Why a scenario failed: the smallest part of the drive that is proven to matter.
//!
//! A part is a span of frames and a box in them. It is *sufficient* if the drive fails for the same cause when only this part is perturbed, and
//! *necessary* if the drive passes when everything up to the failure but this part is. Drives repeat bit for bit, so each attempt is a fact. Sides are moved inwards by halves, and
//! at the end every side is tried one step further in, so that what is reported cannot be made smaller by one step of any one side. It is not claimed to be the
//! smallest of all parts: other parts may matter as well. The idea of making a cause smaller while it stays one is that of delta debugging (Zeller and Hildebrandt,
//! Simplifying and isolating failure-inducing input, IEEE Transactions on Software Engineering 28, 2002).

use std::collections::HashMap;

use indicatif::ProgressBar;
use pdk_model::during::{During, Span};
use pdk_model::outcome::{Cause, Outcome};
use pdk_model::perturbation::AppliedPerturbation;
use pdk_model::scenario::{Scenario, ScenarioId};
use pdk_record::ledger::Line;
use pdk_sdk::describe::Kind;
use pdk_sdk::error::{Error, Result};
use pdk_session::session::Session;

use crate::drives;
use crate::smallest::{Block, GRID, OF_TIME, SIDES, smallest};

/// A part of a drive, and the drive that proves that it matters.
#[derive(Debug, Clone)]
pub struct Proof {
    /// The part.
    pub part: Block,
    /// The scenario.
    pub scenario: Scenario,
    /// Its outcome.
    pub outcome: Outcome,
}

/// Why a scenario failed.
#[derive(Debug, Clone)]
pub struct Why {
    /// Perturbations without which it still fails, as they are named, in the order in which they were left out.
    pub not_needed: Vec<String>,
    /// Perturbed alone, this part makes the drive fail.
    pub sufficient: Proof,
    /// If everything up to the failure but this part is perturbed, the drive passes.
    pub necessary: Proof,
    /// Whether all of the necessary part lies in the sufficient one.
    pub within: bool,
    /// Seconds from one frame to the next.
    pub interval: f64,
    /// How many drives it took.
    pub probes: usize,
}

/// Finds out why a recorded scenario failed.
///
/// # Errors
/// If it did not fail, does not any more, fails without perturbations too, was driven in real time, has parts of its own or does not repeat itself, or if the session
/// cannot go on.
pub fn why(session: &mut Session, line: &Line, progress: &ProgressBar) -> Result<Why> {
    let Line { id, scenario, outcome, .. } = line;
    drives::check_failed(line, "explain")?;
    drives::check_lockstep(line, "a cause cannot be proven")?;
    if let Some(own) = scenario.perturbations.iter().find(|applied| applied.during.is_some()) {
        return Err(Error::new(format!(
            "{} of scenario {id} is limited by `during` already; ask about the scenario without that",
            own.short_name()
        )));
    }
    let mut search = Search { session, cause: outcome.cause, known: HashMap::new(), probes: 0, progress };
    let again = search.drive(std::slice::from_ref(scenario))?.remove(0);
    drives::check_same_cause(line, &again)?;
    let raw = Scenario { perturbations: Vec::new(), ..scenario.clone() };
    let raw = search.drive(&[raw])?.remove(0);
    check_passed(line, &raw)?;
    let (scenario, not_needed) = search.needed(scenario)?;
    // What is left may fail later than all together.
    let failed = search.drive(std::slice::from_ref(&scenario))?.remove(0);
    let frames = u32::try_from(failed.frames).unwrap_or(u32::MAX);
    // The first frame is at 0 s.
    let interval = failed.time / f64::from(frames.saturating_sub(1).max(1));
    // Faults of devices have no box.
    let of_frames = |applied: &AppliedPerturbation| {
        let entry = search.session.catalog().get(Kind::Perturbation, &applied.name);
        entry.is_ok_and(|entry| entry.description.acts_on.is_frame())
    };
    let sides = if scenario.perturbations.iter().all(of_frames) { SIDES } else { OF_TIME };
    let limited = |part: &Block, except: bool| {
        let span = span(part, interval);
        let during = match except {
            false => During { span, except: None },
            // What comes after the failure is not its cause.
            true => During { span: self::span(&Block::whole(frames), interval), except: Some(span) },
        };
        let mut scenario = scenario.clone();
        scenario.perturbations.iter_mut().for_each(|applied| applied.during = Some(during));
        scenario
    };
    let mut fails = |parts: &[Block]| {
        search.sufficient(&parts.iter().map(|part| limited(part, false)).collect::<Vec<_>>())
    };
    let part = smallest(Block::whole(frames), sides, &mut fails)?;
    let mut passes =
        |parts: &[Block]| search.necessary(&parts.iter().map(|part| limited(part, true)).collect::<Vec<_>>());
    // What suffices is often necessary as well; if it is not, there is more than one cause.
    let is_needed = passes(std::slice::from_ref(&part))?.first() == Some(&true);
    let from = if is_needed { part.clone() } else { Block::whole(frames) };
    let other = smallest(from, sides, &mut passes)?;
    let within = part.contains(&other);
    let mut proof = |part: Block, except| {
        let scenario = limited(&part, except);
        let outcome = search.drive(std::slice::from_ref(&scenario))?.remove(0);
        Ok::<_, Error>(Proof { part, scenario, outcome })
    };
    let (sufficient, necessary) = (proof(part, false)?, proof(other, true)?);
    if sufficient.outcome.cause != outcome.cause || !necessary.outcome.success {
        return Err(Error::new(format!(
            "drives of scenario {id} contradict each other, so a cause cannot be proven: its driver or its simulator does not repeat itself; \
             `pdk replay` says where"
        )));
    }
    Ok(Why { not_needed, sufficient, necessary, within, interval, probes: search.probes })
}

/// Checks that the drive without perturbations reaches its end.
fn check_passed(line: &Line, raw: &Outcome) -> Result<()> {
    let Line { id, outcome, .. } = line;
    if raw.success {
        return Ok(());
    }
    let ends =
        format!("without perturbations scenario {id} ends with {} at {:.2} s", raw.cause.text(), raw.time);
    let remedy = match raw.cause {
        cause if cause == outcome.cause => {
            return Err(Error::new(format!("{ends}, so they are not the cause")));
        }
        Cause::TimeOut => "drive it again with a longer `duration`",
        _ => "name a scenario that passes without perturbations",
    };
    Err(Error::new(format!("{ends}, so there is no drive that passes to prove a cause by; {remedy}")))
}

/// A part in seconds and shares of the frame.
fn span(part: &Block, interval: f64) -> Span {
    // Between two frames, so that rounding cannot move a frame to the other side.
    let between = |frame: u32| (1e6 * (f64::from(frame) - 0.5) * interval).round() / 1e6;
    let from = if part.frames.start == 0 { 0.0 } else { between(part.frames.start) };
    Span { from, to: Some(between(part.frames.end)), area: part.area() }
}

struct Search<'a> {
    session: &'a mut Session,
    cause: Cause,
    known: HashMap<ScenarioId, Outcome>,
    probes: usize,
    progress: &'a ProgressBar,
}

impl Search<'_> {
    /// Drives scenarios that were not driven yet, and returns the outcomes of all in the same order.
    fn drive(&mut self, scenarios: &[Scenario]) -> Result<Vec<Outcome>> {
        let new: Vec<Scenario> =
            scenarios.iter().filter(|scenario| !self.known.contains_key(&scenario.id())).cloned().collect();
        let ids: Vec<ScenarioId> = new.iter().map(Scenario::id).collect();
        self.probes += new.len();
        self.progress.set_message(format!("{} drives", self.probes));
        for (id, outcome) in ids.into_iter().zip(drives::outcomes(self.session, new, self.progress)?) {
            if outcome.cause == Cause::Error {
                let error = outcome.error.unwrap_or_default();
                return Err(Error::new(format!("a component failed in one of the drives: {error}")));
            }
            self.known.insert(id, outcome);
        }
        Ok(scenarios.iter().filter_map(|scenario| self.known.get(&scenario.id()).cloned()).collect())
    }

    /// For each scenario, whether it fails as the recorded one did.
    fn sufficient(&mut self, scenarios: &[Scenario]) -> Result<Vec<bool>> {
        let cause = self.cause;
        Ok(self.drive(scenarios)?.iter().map(|outcome| outcome.cause == cause).collect())
    }

    /// For each scenario, whether it passes.
    fn necessary(&mut self, scenarios: &[Scenario]) -> Result<Vec<bool>> {
        Ok(self.drive(scenarios)?.iter().map(|outcome| outcome.success).collect())
    }

    /// The scenario without the perturbations that are not needed, and what these are called.
    fn needed(&mut self, scenario: &Scenario) -> Result<(Scenario, Vec<String>)> {
        let (mut scenario, mut not_needed) = (scenario.clone(), Vec::new());
        while scenario.perturbations.len() > 1 {
            let without = |place: usize| {
                let mut smaller = scenario.clone();
                smaller.perturbations.remove(place);
                smaller
            };
            let smaller: Vec<Scenario> = (0..scenario.perturbations.len()).map(without).collect();
            let Some(place) = self.sufficient(&smaller)?.iter().position(|fails| *fails) else { break };
            not_needed.push(scenario.perturbations[place].short_name());
            scenario = smaller.into_iter().nth(place).unwrap_or(scenario);
        }
        Ok((scenario, not_needed))
    }
}

/// A part in words: its frames, times and box.
pub fn words(part: &Block, interval: f64) -> String {
    let (first, last) = (part.frames.start, part.frames.end - 1);
    let seconds = |frame: u32| f64::from(frame) * interval;
    let when = match first == last {
        true => format!("frame {first} ({:.2} s)", seconds(first)),
        false => format!("frames {first} to {last} ({:.2} to {:.2} s)", seconds(first), seconds(last)),
    };
    let percent = |part: u32| (100.0 * f64::from(part) / f64::from(GRID)).round();
    match part.area() {
        None => when,
        Some(_) => format!(
            "{when}, in the box from {} to {} % of the width and from {} to {} % of the height",
            percent(part.columns.start),
            percent(part.columns.end),
            percent(part.rows.start),
            percent(part.rows.end)
        ),
    }
}
