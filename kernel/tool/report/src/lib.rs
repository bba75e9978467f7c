//! One page about a run of pdk: HTML that needs nothing besides itself, no network and no other file. And the record of a run in
//! the shape of the published tool.
//!
//! Two halves that meet in plain data, [`Run`]: [`record`] reads a record, with its traces, and [`render`] makes the page. Equal data
//! make equal pages. Whatever users have written is escaped when the page is made, so data may hold anything.
//!
//! ```text
//! manifest, ledger, results, traces, times ── record ──► Run ── render ──► HTML
//! ledger, traces ── published ──► JSON
//! ```
//!
//! | module | subject |
//! |---|---|
//! | [`record`] | what a page says, read from the folder of a run |
//! | [`published`] | scenarios in the JSON shape of the published tool |
//! | [`telemetry`] | which steps of a scenario are shown |
//! | [`tables`], [`figures`] | tables as plain data and pictures as files, for papers and other programs |
//! | `view` | what a page is about, as plain data |
//! | `page` | puts the page together; `overview`, `closed_loop`, `offline`, `search` and `strategies` make its parts |
//! | `tracks`, `heat`, `curve`, `scatter`, `road` | estimates, heat maps, curves, points and roads as pictures; `color` has their colours |
//! | `tally`, `conclusions`, `compare` | how scenarios went together, how sure what follows from it is, and how two drivers differ |
//! | [`named`] | what tables call drivers |
//! | `text` | numbers, dates and addresses |
//!
//! A trace that is missing or damaged does not end a page: its scenario is shown without its path, and the page and a warning say
//! so. It does end an export, which others take for complete.

mod closed_loop;
mod color;
mod compare;
mod conclusions;
mod curve;
pub mod figures;
mod heat;
pub mod named;
mod offline;
mod overview;
mod page;
pub mod published;
pub mod record;
mod road;
mod scatter;
mod search;
mod strategies;
pub mod tables;
mod tally;
mod tasks;
pub mod telemetry;
mod text;
mod tracks;
mod view;

pub use page::{render, style};
pub use view::*;
