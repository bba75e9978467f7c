//! The way of a frame through perturbations.
//!
//! | module | subject |
//! |---|---|
//! | [`chain`] | the perturbations that a frame goes through, each a `link` with a key of its own; `mask` limits them to a region, `part` to a span of time, `selection` to what a saliency map marks, and `attended` has the maps that a perturbation follows |
//! | [`maps`] | the saliency maps of a sequence: when one is made, and how long it is used; `motion` moves it with the image |
//! | [`view`] | what a driver's network looks at, as pictures |
//! | [`moment`] | what is known of a frame besides its pixels |

mod attended;
pub mod chain;
mod link;
pub mod maps;
mod mask;
pub mod moment;
mod part;
mod selection;
pub mod view;
