//! A run in the browser, while it goes on and afterwards: a server on the loopback interface, with a token in its address.
//!
//! | module | subject |
//! |---|---|
//! | [`server`] | addresses and what is answered to them |
//! | `live` | what a loop drives at this moment, from its topics |
//! | `drive` | the course of that drive |
//! | `recorded` | what the record holds: scenarios, their traces and clips |
//!
//! A browser says in its `query` what it has, and gets what it lacks.
//!
//! Topics are looked at only while a browser asks, some times a second. A tap that falls behind loses messages and never holds up the
//! loop, so neither does a slow browser.

mod drive;
mod live;
mod query;
mod recorded;
pub mod server;

pub use server::{Server, start};
