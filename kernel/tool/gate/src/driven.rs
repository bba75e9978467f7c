//! How the scenario of a step is given to a driver, in a run and afterwards.

use pdk_components::catalog::Catalog;
use pdk_loop::protocol::Drive;
use pdk_model::component::ComponentSpec;
use pdk_model::scenario::{Mode, Scenario};
use pdk_pipeline::program::frames_of;
use pdk_sdk::describe::Kind;
use pdk_sdk::error::{Error, Result};
use pdk_session::session::{Reply, Session, Ticket};

use crate::came::{BlockOutcome, Came};
use crate::step::Step;
use crate::stretch::Stretch;

/// The scenario of a step with a driver in it; `driven` also says which drive of the same scenario it is.
///
/// # Errors
/// If there is no such simulator.
pub fn driven_by(step: &Step, driven: (&ComponentSpec, u64), catalog: &Catalog) -> Result<Scenario> {
    let (driver, repeat) = driven;
    let mut scenario = step.scenario.clone();
    scenario.driver = driver.clone();
    // The seed stays, so all drives of a scenario have the same luck where the simulator gives it.
    scenario.repeat += repeat;
    // A simulator with its own clock does not wait.
    if Stretch::of(&scenario).is_none()
        && !catalog.get(Kind::Simulator, &scenario.simulator.name)?.description.clock.is_stepped()
    {
        scenario.mode = Mode::Realtime;
    }
    Ok(scenario)
}

/// Gives a scenario to a session, which does not record it.
pub fn submit(session: &mut Session, scenario: &Scenario, name: &str) -> Ticket {
    match Stretch::of(scenario) {
        Some(stretch) => session.evaluate(stretch.job(scenario)),
        None => session.drive(Drive {
            scenario: scenario.clone(),
            name: name.to_owned(),
            trace: None,
            images_every: 0,
            skips: None,
            view: None,
        }),
    }
}

/// What a scenario came to that was given to a session.
///
/// # Errors
/// If a component failed.
pub fn came(scenario: &Scenario, reply: Reply) -> Result<Came> {
    let came = match (Stretch::of(scenario), reply) {
        (Some(stretch), reply) => Came::Block(BlockOutcome::of(&stretch, &frames_of(reply)?)?),
        (None, Reply::Driven(driven)) => Came::Drive(Box::new(driven.outcome)),
        (None, _) => {
            return Err(Error::new("driving a scenario gave something else, which is a defect in pdk"));
        }
    };
    match came.error() {
        Some(error) => Err(Error::new(error)),
        None => Ok(came),
    }
}
