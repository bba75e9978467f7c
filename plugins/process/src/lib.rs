//! The driver `process`: a program of the user's, in any language, which gets frames and gives controls through shared memory.
//!
//! [`exchange`] is what both sides share: one topic for frames, one for answers, and an event for each, so that nobody has to poll. The page
//! `docs/external-drivers.md` says how it looks from the other side.

mod driver;
mod exchange;

pdk_sdk::export! { drivers: [driver::Process] }
