//! MCAP files: pictures of ROS 2 and Foxglove, with steering and speed from other topics. Traces of pdk are such files.

use std::io::Read;
use std::path::{Path, PathBuf};

use pdk_sdk::file;
use pdk_sdk::prelude::*;

use crate::bag::{Bag, MAGIC};
use crate::place::{Named, unsuitable};
use crate::topics::Drive;

/// Reads an MCAP file.
pub struct Mcap {
    drive: Drive,
    folder: PathBuf,
    name: PathBuf,
}

impl Component for Mcap {
    fn description() -> Description {
        let doc = "Reads an MCAP file with pictures of ROS 2 or Foxglove";
        let description = Description::dataset("mcap", doc)
            .version(2)
            .source("MCAP format, mcap.dev; Foxglove schemas")
            .parameter(Parameter::path("path", "the file"));
        Drive::parameters().into_iter().fold(description, Description::parameter)
    }

    fn new(config: &Config) -> Result<Self> {
        let path = Path::new(config.text("path"));
        let Named { file: Some(name), folder, path: root } = Named::new(path)? else {
            return Err(unsuitable("it is not an MCAP file"));
        };
        let mut magic = Vec::new();
        file::open(path)?.0.take(MAGIC.len() as u64).read_to_end(&mut magic)?;
        if magic != MAGIC {
            return Err(unsuitable("it does not begin as an MCAP file"));
        }
        let drive = Drive::new(config, Bag::new(vec![folder.path(&name)?]))
            .map_err(|error| error.at(format_args!("MCAP file `{}`", path.display())))?;
        Ok(Self { drive, folder: root, name })
    }
}

impl Dataset for Mcap {
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

    fn form(&self) -> Result<Option<Form>> {
        Ok(Some(self.drive.form(&self.folder, std::slice::from_ref(&self.name), false)))
    }

    fn rewrite(&mut self, wanted: &Rewrite, perturb: &mut Perturb<'_>) -> Result<()> {
        self.drive.rewrite(0, wanted, perturb)
    }
}

#[cfg(test)]
#[path = "mcap_tests.rs"]
mod tests;
