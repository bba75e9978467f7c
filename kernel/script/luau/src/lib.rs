//! Luau scripts: perturbations and pipelines written in Lua.
//!
//! A script runs in a [`Sandbox`]: a virtual machine without files, processes, network, clock or ambient random
//! numbers, with a memory limit and a time budget. What a script can call is registered in tables of [`api`], from
//! which the type definitions for editors are generated as well ([`types`]).
//!
//! | module | subject |
//! |---|---|
//! | [`sandbox`] | the virtual machine |
//! | [`limits`] | how much memory and time a script may use |
//! | `watchdog` | ends calls that use up their time, or that the user wants to stop |
//! | `bounds` | keeps Luau's own library within the time limit |
//! | `chunk` | compiles the text of a script |
//! | [`modules`] | `require`, for pipelines; `places` finds the files |
//! | `failure` | turns whatever a script raises into one sentence |
//! | `arithmetic` | mathematical functions that give the same bits everywhere |
//! | `tokens` | the text of a script without comments |
//! | `power` | refuses the uses of `^` that would not |
//! | [`api`] | how functions and classes are registered |
//! | [`types`] | the type definition file, written from what is registered |
//! | [`unknown`] | names that are not there |
//! | `arguments` | the arguments of host functions, checked |
//! | `buffers` | the bytes of Luau's buffers, in place |
//! | [`image`] | the image a script edits, and the operations on it |
//! | [`random`] | the random numbers a script draws |
//! | [`declaration`] | the table by which a script describes its perturbation |
//! | `signals` | how a perturbation in a script changes controls, and what the driver gets besides the frame |
//! | `points` | how a perturbation in a script moves points |
//! | `glance` | what a script is by its text, without running it |
//! | `absent` | what pipelines have and perturbations do not |
//! | [`perturbation`] | a script as a perturbation |
//! | [`kept`] | what a script keeps from one frame to the next, found when it is checked |
//! | [`scripts`] | components from scripts, for the registry |

mod absent;
pub mod api;
mod arguments;
mod arithmetic;
mod bounds;
mod buffers;
mod chunk;
pub mod declaration;
mod failure;
mod glance;
mod history;
pub mod image;
pub mod kept;
pub mod limits;
pub mod modules;
pub mod perturbation;
mod places;
mod points;
mod power;
pub mod random;
pub mod sandbox;
pub mod scripts;
mod signals;
mod tokens;
pub mod types;
pub mod unknown;
mod watchdog;

pub use api::{ApiClass, ApiField, ApiFunction, ApiMethod, ApiProperty, ApiRecord, ApiTable};
pub use kept::Kept;
pub use limits::Limits;
pub use modules::Modules;
pub use perturbation::{LuaPerturbation, description, open, perturbation_api};
pub use random::LuaRandom;
pub use sandbox::Sandbox;
pub use scripts::LuaScripts;
pub use types::{Declare, definitions};
pub use watchdog::{Stop, is_interrupted, without_clock};
