//! Labels in files, moved.

pub mod coco;
pub mod lines;
pub mod mask;
pub mod records;
pub mod rle;
pub mod table;
mod text;
pub mod yolo;
