//! `pdk.search`: a strategy proposes candidates, a function of the pipeline evaluates them, and the results go back to the strategy.
//!
//! Which candidates there are, and in which order, follows from the request and the seed. Results are handed over in the order of the
//! candidates, whenever they come, and a strategy does not let a candidate depend on how many it was told at once. A candidate
//! that was evaluated before is answered with that result.
//!
//! | module | subject |
//! |---|---|
//! | [`request`] | what the pipeline writes |
//! | [`strategy`] | the strategy: a component in a process of its own, or a table of functions |
//! | [`verdict`] | what became of a candidate, read from what functions return and from outcomes |
//! | [`trials`] | the candidates so far: which are new, which wait, which the strategy has yet to hear of |
//! | [`conduct`] | the search from its start to its end |
//! | [`results`] | what a search found, as a value and as a table |

pub mod conduct;
mod request;
mod results;
mod strategy;
mod trials;
mod verdict;
