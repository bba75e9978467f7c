//! Records: continued, replayed, merged, checked and shown.

#![allow(clippy::unwrap_used)]

mod browser;
mod export;
mod inputs;
mod moved;
mod received;
mod replay;
mod report;
mod resume;
mod shard;
mod watch;
