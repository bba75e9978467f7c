//! Drives of recorded scenarios and of variants of them that leave an outcome and no trace: what looking for the reasons of a failure consists of.

use indicatif::ProgressBar;
use pdk_loop::protocol::Drive;
use pdk_model::outcome::{Cause, Outcome};
use pdk_model::scenario::{Mode, Scenario};
use pdk_record::ledger::Line;
use pdk_sdk::error::{Error, Result};
use pdk_session::session::{Reply, Session};

/// Checks that a recorded scenario is a failure of the driver; `task` is what would be done with it, such as "explain".
///
/// # Errors
/// If it was a success, or a component failed in it.
pub fn check_failed(line: &Line, task: &str) -> Result<()> {
    let Line { id, outcome, .. } = line;
    if outcome.success {
        return Err(Error::new(format!("scenario {id} was a success, so there is no failure to {task}")));
    }
    if outcome.cause == Cause::Error {
        let error = outcome.error.as_deref().unwrap_or("it did not say why");
        return Err(Error::new(format!(
            "in scenario {id} a component failed, which says nothing about the driver: {error}"
        )));
    }
    Ok(())
}

/// Checks that a recorded scenario was not driven in real time; `vain` is a clause that says what is in vain if it was.
///
/// # Errors
/// If it was driven in real time.
pub fn check_lockstep(line: &Line, vain: &str) -> Result<()> {
    match line.scenario.mode {
        Mode::Lockstep => Ok(()),
        Mode::Realtime => Err(Error::new(format!(
            "scenario {} was driven in real time, where a drive depends on how fast the machine is, so {vain}; drive it in lockstep and name \
             that drive",
            line.id
        ))),
    }
}

/// Checks that a recorded scenario fails as it did.
///
/// # Errors
/// If it ended with another cause this time.
pub fn check_same_cause(line: &Line, again: &Outcome) -> Result<()> {
    match again.cause == line.outcome.cause {
        true => Ok(()),
        false => Err(Error::new(format!(
            "scenario {} ended with {} when it was recorded and with {} now; `pdk replay` says what is different",
            line.id,
            line.outcome.cause.text(),
            again.cause.text()
        ))),
    }
}

/// Drives scenarios, and returns their outcomes in the same order.
///
/// # Errors
/// If the session cannot go on.
pub fn outcomes(
    session: &mut Session,
    scenarios: Vec<Scenario>,
    progress: &ProgressBar,
) -> Result<Vec<Outcome>> {
    let start = |scenario: Scenario| {
        let name = scenario.default_name();
        session.drive(Drive { scenario, name, trace: None, images_every: 0, skips: None, view: None })
    };
    let tickets: Vec<_> = scenarios.into_iter().map(start).collect();
    let outcome = |ticket| match session.wait(ticket, &mut |_| progress.tick())? {
        Reply::Driven(driven) => Ok(driven.outcome),
        _ => Err(Error::new("driving a scenario gave something else, which is a defect in pdk")),
    };
    tickets.into_iter().map(outcome).collect()
}
