//! The kernel of pdk: it loads components, routes frames through perturbations, hands out seeds, and keeps the ledger.
//!
//! Everything else is beside it: what drives scenarios (`pdk-session`), scripts (`pdk-lua`, `pdk-pipeline`), what reads records
//! (`pdk-report`, `pdk-replay`) and the command line (`pdk`). The kernel names no component, no plugin and no verb.
//!
//! | module | subject |
//! |---|---|
//! | [`installation`] | where the parts of pdk itself lie |
//! | [`search_path`] | where components are looked for |
//! | [`registry`] | finds components and makes instances of them; [`loader`] opens libraries |
//! | [`inspection`] | opens libraries in a process that dies afterwards, before they are opened where they are needed |
//! | [`catalog`] | what there is, as plain data that can be sent to another process |
//! | [`chain`] | the perturbations that a frame goes through, each with a key of its own; `mask` limits them to a region, `selection` to what a saliency map marks |
//! | [`maps`] | the saliency maps of a sequence: when one is made, and how long it is used; `motion` moves it with the image |
//! | [`view`] | what a driver's network looks at, as pictures |
//! | [`moment`] | what is known of a frame besides its pixels |
//! | [`modifiers`] | what every perturbation takes besides its own parameters |
//! | [`calls`] | what this process is calling, told to the one that supervises it |
//! | [`float`] | the floating-point mode, put back after every call |
//! | [`supervisor`] | runs what calls components in a process of its own, and says how that ended |
//! | [`directory`] | the folder of a run |
//! | [`ledger`] | one line an outcome, append-only, on [`lines`] |
//! | [`manifest`] | what was run; `inputs` makes one hash of the files of a dataset and the like |
//! | [`settle`] | what a scenario leaves to the machine, put into it |
//! | [`merge`] | runs in parts, and their records put together |
//! | [`output`] | lines and progress bars for people |
//!
//! Two rules hold throughout. A component is only ever called in a process that another one supervises, since its code may do
//! anything; only the Python package gives that up, which calls perturbations in the interpreter's process. And what decides an outcome is a value (`pdk_model::scenario::Scenario`): nothing is drawn from a clock, a counter or
//! a place in a list.

pub mod calls;
pub mod catalog;
pub mod chain;
mod description;
pub mod directory;
mod edges;
pub mod elf;
pub mod float;
mod hash;
mod inputs;
pub mod inspection;
pub mod installation;
pub mod ledger;
pub mod lines;
pub mod loader;
pub mod manifest;
pub mod maps;
mod mask;
pub mod merge;
pub mod modifiers;
pub mod moment;
mod motion;
pub mod output;
mod reading;
pub mod registry;
pub mod search_path;
mod selection;
pub mod settle;
pub mod suggest;
pub mod supervisor;
pub mod view;

pub use description::check as check_description;
