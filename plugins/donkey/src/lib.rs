//! The simulator `donkey`: the adapter to the simulator of the Donkey car, in the current build (sdsandbox) and in the one that builds
//! roads from points.
//!
//! The simulator is a TCP server. What it sends ends with a line feed; what it is sent may have none, holds no brace but its own two,
//! and has to come alone, since one of the builds takes each part that it receives for one whole message. [`wire`] keeps to that,
//! [`message`] reads what comes, [`menu`] leads from a new connection to a car on the road, [`telemetry`] says how it stands there, and
//! [`donkey`] drives it.

mod donkey;
mod end;
mod lap;
mod menu;
mod message;
mod options;
mod road;
mod telemetry;
mod wire;

pdk_sdk::export! { simulators: [donkey::Donkey] }
