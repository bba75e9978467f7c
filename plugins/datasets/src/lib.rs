//! Readers of recorded datasets: DonkeyCar tubs, folders of images with one record each, and pictures without records.
//!
//! Both readers follow one rule about faults. What makes the recording unusable as a whole (no such folder, no
//! frames, no index) is an error when the reader is made. What is wrong with one frame (a missing or damaged image,
//! a record without steering) is an error when that frame is read, so that a run can count it, name it and go on.
//! No frame is left out in silence.

mod clock;
mod folder;
mod inside;
mod pictures;
mod record;
mod tub;

#[cfg(test)]
mod fixture;

pub use folder::Folder;
pub use pictures::Pictures;
pub use tub::Tub;

pdk_sdk::export! { datasets: [tub::Tub, folder::Folder, pictures::Pictures] }
