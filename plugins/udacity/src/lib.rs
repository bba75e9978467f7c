//! The simulator `udacity`: the adapter to Udacity's self-driving-car simulator, as it comes and in the build that takes roads.
//!
//! Here pdk is the server: the simulator connects to it, with Socket.IO over a WebSocket. Its address says version 4 of Engine.IO, and
//! what it speaks is version 3: it is greeted without asking, sends pings itself, and never says hello. [`server`] speaks that,
//! [`event`] reads what comes, [`number`] copes with the ways in which computers around the world write numbers, and [`simulator`] drives.

mod event;
mod number;
mod options;
mod server;
mod simulator;

pdk_sdk::export! { simulators: [simulator::Udacity] }
