//! The adapter `carla`: scenarios in CARLA 0.9.13 to 0.9.16, without CARLA's own client library.
//!
//! CARLA is a server. Requests and answers go over one connection, as MessagePack-RPC ([`rpc`], [`server`]); what its sensors see and the
//! state of the world come over a further connection each ([`stream`], [`snapshot`]). The adapter builds the road of the scenario
//! ([`ground`]) or loads a map, and puts a vehicle with cameras on it ([`blueprint`], [`sensors`], [`stage`]). The server stands still between two
//! frames: it gets the request to advance by one step, and then has sent everything that belongs to it. Whatever ends this process, the server is
//! left as it was found ([`will`]).
//!
//! CARLA's axes are x ahead, y to the right, z up, with yaw clockwise in degrees ([`axes`]): its x is our z, its y our x, its z our height.

mod annotation;
mod axes;
mod blueprint;
mod camera;
mod carla;
mod collisions;
mod episode;
mod ground;
mod options;
mod rpc;
mod sensors;
mod server;
mod snapshot;
mod stage;
mod stream;
mod traffic;
mod value;
mod weather;
mod will;

pdk_sdk::export! {
    simulators: [carla::Carla],
}
