//! Processes that call components, and what is known of them when they are gone.
//!
//! A component's code may do anything, so it is only ever called in a process that another one supervises; only the Python package
//! gives that up, which calls perturbations in the interpreter's process.
//!
//! | module | subject |
//! |---|---|
//! | [`calls`] | what this process is calling, noted on a page of shared memory for the one that supervises it |
//! | [`float`] | the floating-point mode, put back after every call |
//! | [`supervisor`] | runs what calls components in a process of its own, and says how that ended |

pub mod calls;
pub mod float;
pub mod supervisor;
