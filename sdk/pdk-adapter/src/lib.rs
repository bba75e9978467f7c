//! What adapters to simulators share. A simulator is a program of its own, which may be slow to start, hang, end, or not be there
//! at all; an adapter is the component that speaks its protocol.
//!
//! | module | for |
//! |---|---|
//! | [`settings`] | the parameters that every adapter has: where the simulator is, how it is started, how long to wait |
//! | [`station`] | the simulator of one worker: its port, its process, and the connection to it |
//! | [`process`] | a simulator that pdk starts, and that ends with pdk whatever happens |
//! | [`deadline`] | no wait without an end, and an error that says what was waited for |
//! | [`connection`] | messages over TCP: limits on time and size, and what is wrong in a sentence |
//! | [`mount`] | the camera, for simulators in which the adapter fixes one to the vehicle |
//! | [`picture`] | pictures that come as raw pixels |
//! | [`track`] | cross-track error, progress and heading from the road and the position, where the simulator does not tell them |
//!
//! An adapter is a [`Simulator`](pdk_sdk::prelude::Simulator) whose `new` reads [`Settings`] and connects to nothing: pdk makes
//! simulators only to ask for their camera, too. In `reset` it makes a [`Station`] for the slot, connects, and waits
//! until the vehicle stands at the start of the road. Between scenarios it keeps the station, and connects again where the connection
//! was closed meanwhile.
//!
//! In the middle of a scenario it returns the error that it is given: [`Lost`](pdk_sdk::prelude::ErrorKind::Lost) where the connection or
//! the process is gone, [`Late`](pdk_sdk::prelude::ErrorKind::Late) where nothing comes in time,
//! [`Nonsense`](pdk_sdk::prelude::ErrorKind::Nonsense) where something else comes than the protocol says. The instance is dropped then. After
//! the first two the scenario is driven again from its beginning, with a new instance, which starts the simulator again or waits until it is
//! back.

#![forbid(unsafe_code)]

pub mod connection;
pub mod deadline;
pub mod mount;
pub mod picture;
pub mod port;
pub mod process;
pub mod settings;
pub mod station;
pub mod track;

pub use connection::Connection;
pub use deadline::Deadline;
pub use mount::Mount;
pub use picture::Picture;
pub use settings::Settings;
pub use station::Station;
pub use track::{Place, Track};

use pdk_road::{LANE_WIDTH, MapBox, NODES, Road, SEGMENT};
use pdk_sdk::model::failure::FailureCriteria;
use pdk_sdk::prelude::{Error, Result, State};
use pdk_sdk::serde_json::Value;

/// The waypoints `[x, height, z]` in metres of a scenario's road, at least two; none if the road is null, which leaves it to the
/// simulator. It is written as for every simulator: angles, or waypoints.
///
/// # Errors
/// If it is written otherwise; that is the outcome of this scenario, and not a mistake in the set-up.
pub fn road(road: &Value) -> Result<Option<Vec<[f64; 3]>>> {
    match pdk_road::read(road).map_err(Error::new)? {
        Some(points) if points.len() < 2 => {
            Err(Error::new(format!("the road has {} waypoints, but needs at least 2", points.len())))
        }
        road => Ok(road),
    }
}

/// The largest angle of a random road in degrees, which is that of the published study.
const RANDOM_ANGLE: i32 = 35;
/// The smallest radius of a bend of a random road in metres.
const SMALLEST_RADIUS: f64 = 8.0;

/// The waypoints `[x, height, z]` in metres of a road with random angles that can be driven, for scenarios without a road. `purpose` keeps
/// the roads of one simulator apart from those of another.
///
/// # Errors
/// If the seed gives no such road.
pub fn random_road(seed: u64, purpose: &str) -> Result<Vec<[f64; 3]>> {
    let mut random = pdk_sdk::seed::key(seed, purpose, 0).sequence();
    for _ in 0..1000 {
        let angles = pdk_road::random_angles(&mut random, NODES, RANDOM_ANGLE);
        let road = Road::from_angles(&angles, &[SEGMENT; NODES]).map_err(Error::new)?;
        let valid = pdk_road::check(&road, 2.0 * LANE_WIDTH, &MapBox::default())
            .and_then(|()| pdk_road::check_bends(&road, SMALLEST_RADIUS));
        if valid.is_ok() {
            return Ok(road.waypoints.into_iter().map(|[x, z]| [x, 0.0, z]).collect());
        }
    }
    Err(Error::new(format!("seed {seed} gives no road that can be driven; take another one")))
}

/// Whether a scenario with these criteria ends with this state. A simulator with its own clock goes on while the driver is at work;
/// among the states that came meanwhile the adapter gives the first one that ends the scenario, else the newest.
pub fn ends(state: &State, criteria: &FailureCriteria) -> bool {
    state.collision || state.finished || criteria.departed(state)
}

// The example in the README compiles.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
