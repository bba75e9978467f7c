//! Readers of recorded datasets.
//!
//! | reader | what it reads |
//! |---|---|
//! | [`Comma2k19`] | segments of comma2k19 |
//! | [`Csv`] | a folder of pictures with a CSV file, such as Udacity's |
//! | [`Folder`] | a folder of images with one record each, such as a DonkeyCar tub of version 1 |
//! | [`LeRobot`] | a recording of LeRobot |
//! | [`Mcap`] | an MCAP file |
//! | [`Pictures`] | a folder of pictures without labels |
//! | [`Rosbag2`] | the folder of a ROS 2 bag with files in MCAP or SQLite |
//! | [`Tub`] | a DonkeyCar tub of version 2 |
//! | [`Video`] | a video, with a CSV file or without |
//!
//! Those of recordings whose frames are not files of their own write them again, with other pictures and all else as it is: files of bags
//! (`bag_copy`, `sqlite_copy`, `message_copy`), videos (`reel`), and what was recorded beside videos (`table_copy`).
//!
//! All follow one rule about faults. What makes the recording unusable as a whole (no such folder, no
//! frames, no index) is an error when the reader is made. What is wrong with one frame (a missing or damaged image,
//! a record without steering) is an error when that frame is read, so that a run can count it, name it and go on.
//! No frame is left out in silence. A recording of another format is [`Unsuitable`](pdk_sdk::error::ErrorKind::Unsuitable), and at most one
//! of the readers finds a recording suitable.

mod bag;
mod bag_copy;
mod cdr;
mod clock;
mod comma2k19;
mod csv;
mod elements;
mod folder;
mod foxglove;
mod inside;
mod label;
mod lerobot;
mod listing;
mod mcap;
mod message;
mod message_copy;
mod mosaic;
mod parquet;
mod pictures;
mod place;
mod protobuf;
mod raw;
mod record;
mod reel;
mod rosbag2;
mod sqlite;
mod sqlite_copy;
mod sqlite_row;
mod table;
mod table_copy;
mod topics;
mod topics_copy;
mod tub;
mod video;

#[cfg(test)]
mod fixture;

pub use comma2k19::Comma2k19;
pub use csv::Csv;
pub use folder::Folder;
pub use lerobot::LeRobot;
pub use mcap::Mcap;
pub use pictures::Pictures;
pub use rosbag2::Rosbag2;
pub use tub::Tub;
pub use video::Video;

pdk_sdk::export! {
    datasets: [
        tub::Tub, folder::Folder, comma2k19::Comma2k19, csv::Csv, lerobot::LeRobot, mcap::Mcap, pictures::Pictures, rosbag2::Rosbag2, video::Video
    ]
}
