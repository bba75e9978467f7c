//! The simulator `udacity`: the adapter to Udacity's self-driving-car simulator, as it comes and in the build that takes roads.
//!
//! Here pdk is the server: the simulator connects to it, with Socket.IO over a WebSocket. Its address says version 4 of Engine.IO, and
//! what it speaks is version 3: it is greeted without asking, sends pings itself, and never says hello. [`server`] speaks that, as
//! soon as [`door`] has let the simulator in, [`event`] reads what comes, [`number`] copes with the ways in which computers around the world write numbers, and [`udacity`] drives.

mod client;
mod clock;
mod door;
mod event;
mod http;
mod number;
mod options;
mod polling;
mod server;
mod udacity;

pdk_sdk::export! { simulators: [udacity::Udacity] }
