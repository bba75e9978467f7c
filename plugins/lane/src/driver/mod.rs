//! The driver of this crate.

mod lane_keeper;

pub use lane_keeper::LaneKeeper;
