//! What goes wrong, in files, components, processes and the machine: a sentence or an outcome, and never the end of a run.

#![allow(clippy::unwrap_used)]

mod bad_input;
mod hostile;
mod interrupt;
mod kills;
mod limits;
mod machine;
mod misbehave;
mod outputs;
mod shared_memory;
