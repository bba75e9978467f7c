//! Luau scripts: perturbations and pipelines written in Lua.
//!
//! A script runs in a [`Sandbox`]: a virtual machine without files, processes, network, clock or ambient random
//! numbers, with a memory limit and a time budget. What a script can call is registered in tables of [`api`], from
//! which the type definitions for editors are generated as well ([`types`]).
//!
//! | module | subject |
//! |---|---|
//! | [`sandbox`] | the virtual machine and its limits |
//! | `watchdog` | ends calls that use up their time |
//! | `failure` | turns whatever a script raises into one sentence |
//! | `arithmetic` | mathematical functions that give the same bits everywhere |
//! | `power` | refuses the uses of `^` that would not |
//! | [`api`] | how functions and classes are registered and documented |
//! | `arguments` | the arguments of host functions, checked |
//! | [`image`] | the image a script edits, and the operations on it |
//! | [`random`] | the random numbers a script draws |
//! | [`declaration`] | the table by which a script describes its perturbation |
//! | [`perturbation`] | a script as a perturbation |
//! | [`kept`] | what a script keeps from one frame to the next, found when it is checked |
//! | [`types`] | the type definition file |

pub mod api;
mod arguments;
mod arithmetic;
pub mod declaration;
mod failure;
pub mod image;
pub mod kept;
pub mod perturbation;
mod power;
pub mod random;
pub mod sandbox;
pub mod types;
mod watchdog;

pub use api::{ApiClass, ApiFunction, ApiMethod, ApiProperty, ApiRecord, ApiTable};
pub use kept::Kept;
pub use perturbation::{LuaPerturbation, create, description, open};
pub use sandbox::{Limits, Sandbox};
pub use watchdog::without_clock;
