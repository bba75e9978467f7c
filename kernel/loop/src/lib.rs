//! The loop: a scenario is driven, or frames of a dataset are evaluated, in a process that calls components.
//!
//! | module | subject |
//! |---|---|
//! | [`loop_process`] | the process that calls components; `engine` keeps them |
//! | [`protocol`] | what it and those who give it work say to each other, on [`lines`] |
//! | [`drive`] | one scenario around the loop, on `motion`, `annotated`, `pace` and `pictures`; `fault` says whose an error is |
//! | [`judge`], [`way`] | says when a scenario is over and measures it; how far a vehicle has driven |
//! | `evaluate` | frames of datasets; [`sequences`] says where a recording begins anew, [`recorded`] how what was recorded is written |
//! | [`recorder`], [`recent`] | the trace, and the last frames of failures |
//! | [`announced`] | what those who watch a drive learn of it besides its topics |
//! | [`stages`] | how long it takes |
//! | `environment` | what a component changed of its process, put back |

mod annotated;
pub mod announced;
pub mod drive;
mod engine;
mod environment;
mod evaluate;
mod fault;
pub mod judge;
pub mod lines;
pub mod loop_process;
mod motion;
mod pace;
mod pictures;
pub mod protocol;
pub mod recent;
pub mod recorded;
pub mod recorder;
pub mod sequences;
pub mod stages;
pub mod way;
