//! The driver and the simulator `process`: programs of the user's, in any language, with which pdk exchanges frames through shared memory.
//!
//! A [`room`] is where the two meet: a folder, and services of iceoryx2. [`exchange`] carries frames to a driver and its controls back,
//! [`requests`] what a simulator is asked and what it answers; [`modules`] lists the files of a program for the record. Both sides are notified by events, so that neither has to poll. The pages
//! `docs/external-drivers.md` and `docs/external-simulators.md` say how it looks from the other side.

mod driver;
mod exchange;
mod modules;
mod options;
mod requests;
mod room;
mod simulator;

pdk_sdk::export! { drivers: [driver::Process], simulators: [simulator::Process] }
