//! The image a script edits.
//!
//! A script reaches single pixels through `image.pixels`, a Luau buffer, and everything that works on the whole image
//! through methods, which are the kernels of `pdk-ops`. They stand in tables of [`Operation`], a file for each subject.

pub mod argument;
mod blurs;
mod class;
mod color;
mod drawing;
mod geometry;
mod noises;
pub mod operation;
mod pixels;
mod workspaces;

pub use class::{IMAGE, ImageClass, operations};
pub use operation::Operation;
pub use pixels::LuaImage;

#[cfg(test)]
mod tests;
