//! What a page about a run says, read from its record.

mod clips;
mod closed_loop;
mod offline;
mod read;
mod search;
mod setup;
mod tasks;
mod times;
mod traces;
mod under_way;

pub use read::{Read, cut_off_warning, read, read_all, scenarios};
