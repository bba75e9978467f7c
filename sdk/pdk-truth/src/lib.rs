//! What pictures show, from the files in which people keep it, and how outputs of a network are compared with it pixel by pixel.
//!
//! | module | what |
//! |---|---|
//! | [`beside`] | finds the file that belongs to a picture |
//! | [`coco`], [`yolo`] | boxes around objects |
//! | [`segments`] | a class for each pixel, in PNG |
//! | [`distances`] | a distance for each pixel, in PNG or in files of numpy |
//! | [`taken`] | what is taken from the outputs of a predictor |

pub mod beside;
pub mod coco;
pub mod distances;
mod map;
pub mod npy;
pub mod segments;
pub mod taken;
pub mod yolo;
