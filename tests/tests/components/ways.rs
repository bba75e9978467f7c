//! What the plugin `misbehave` can do to its process does what it is called. The tests stand beside its code; they are run here, so
//! that the plugin is built for tests only.

#[allow(dead_code)]
#[path = "../../misbehave/src/ending.rs"]
mod ending;
#[allow(dead_code)]
#[path = "../../misbehave/src/process.rs"]
mod process;
