//! Bags of ROS 2: a folder with `metadata.yaml` and MCAP files.

use std::path::{Path, PathBuf};

use pdk_sdk::prelude::*;

use crate::bag::Bag;
use crate::inside::Inside;
use crate::listing::{ends_in, names};
use crate::place::{Named, unsuitable};
use crate::topics::Drive;

/// The file that makes a folder a bag.
const METADATA: &str = "metadata.yaml";

/// Reads a bag of ROS 2.
pub struct Rosbag2 {
    drive: Drive,
    folder: Inside,
    files: Vec<PathBuf>,
}

impl Component for Rosbag2 {
    fn description() -> Description {
        let doc = "Reads a ROS 2 bag: a folder with metadata.yaml and MCAP files";
        let description = Description::dataset("rosbag2", doc)
            .source("ROS 2, rosbag2_storage_mcap")
            .parameter(Parameter::path("path", "the folder"));
        Drive::parameters().into_iter().fold(description, Description::parameter)
    }

    fn new(config: &Config) -> Result<Self> {
        let path = Path::new(config.text("path"));
        let Named { folder, path: root, file: None } = Named::new(path)? else {
            return Err(unsuitable("it is not the folder of a ROS 2 bag"));
        };
        if !root.join(METADATA).is_file() {
            return Err(unsuitable("it has no metadata.yaml, as a ROS 2 bag has"));
        }
        let place = format!("ROS 2 bag `{}`", path.display());
        let all = names(&root).map_err(|error| error.at(&place))?;
        let files: Vec<PathBuf> = all.iter().filter(|name| ends_in(name, &["mcap"])).cloned().collect();
        if files.is_empty() {
            let other = all.iter().find(|name| ends_in(name, &["db3", "zstd", "sqlite3"]));
            return Err(match other {
                Some(other) => Error::new(format!(
                    "{place} is stored as `{}`, and pdk reads bags with MCAP files; convert it with `ros2 bag convert`, or with \
                     `rosbags-convert --dst-storage mcap`",
                    other.display()
                )),
                None => Error::new(format!("{place} has no MCAP files; copy it again")),
            });
        }
        let paths = files.iter().map(|name| folder.path(name)).collect::<Result<Vec<_>>>();
        let drive =
            paths.and_then(|paths| Drive::new(config, Bag::new(paths))).map_err(|error| error.at(&place))?;
        Ok(Self { drive, folder, files })
    }

    fn input_files(config: &Config) -> Result<Vec<InputFiles>> {
        let Self { folder, files, .. } = Self::new(config)?;
        Ok(vec![folder.input_files([PathBuf::from(METADATA)].into_iter().chain(files))])
    }
}

impl Dataset for Rosbag2 {
    fn len(&self) -> usize {
        self.drive.len()
    }

    fn name(&self, index: usize) -> String {
        self.drive.name(index)
    }

    fn read(&mut self, index: usize) -> Result<Entry> {
        self.drive.read(index)
    }

    fn position(&self, index: usize) -> Position {
        self.drive.position(index)
    }

    fn info(&self) -> Vec<(String, String)> {
        self.drive.info()
    }
}
