//! Components: plugins, scripts and networks, as their authors make them and as users install them.

#![allow(clippy::unwrap_used)]

mod abi;
mod drivers;
mod installed;
mod plugins;
mod scripts;
mod ways;
