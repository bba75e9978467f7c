//! The same input gives the same bytes.

#![allow(clippy::unwrap_used)]

mod determinism;
mod digests;
mod identity;
mod processors;
mod unchanged;
