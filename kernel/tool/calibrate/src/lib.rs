//! Measures scales on which a level means the same for every perturbation.
//!
//! A perturbation is applied to frames at many published levels, also beyond the published ones, where its parameters go on in straight
//! lines. What it costs there is a [`Curve`](curve::Curve) over the level, and a scale says at which published level it costs what a level
//! of the scale stands for. How far the parameters of a perturbation reach on the scale is part of the result: what it cannot reach is
//! not on the scale.

#![forbid(unsafe_code)]

pub mod cost;
pub mod costs;
pub mod curve;
pub mod measure;
