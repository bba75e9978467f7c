//! The adapter `beamng`: scenarios in BeamNG.tech, stepped frame by frame.
//!
//! BeamNG.tech is a server with two kinds of connections, one to the game engine and one to each vehicle. Over both go MessagePack maps behind
//! their length ([`messages`]). The road of a scenario is drawn on the ground of a level ([`scenery`]); the game stands still between two frames.
//!
//! BeamNG's axes are x to the right, y ahead, z up: its x is ours, its y our z, its z our height.

mod beamng;
mod camera;
mod messages;
mod options;
mod scenery;
mod session;

pdk_sdk::export! {
    simulators: [beamng::BeamNg],
}
