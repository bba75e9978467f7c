//! Bags of ROS 2: a folder with `metadata.yaml` and files in MCAP or SQLite.

use std::path::{Path, PathBuf};

use pdk_sdk::prelude::*;

use crate::bag::Bag;
use crate::inside::Inside;
use crate::listing::{ends_in, names};
use crate::place::{Named, not_listed, unsuitable};
use crate::topics::Drive;

/// The file that makes a folder a bag.
const METADATA: &str = "metadata.yaml";

/// Reads a bag of ROS 2.
pub struct Rosbag2 {
    drive: Drive,
    folder: Inside,
    root: PathBuf,
    files: Vec<PathBuf>,
}

impl Component for Rosbag2 {
    fn description() -> Description {
        let doc = "Reads a ROS 2 bag: a folder with metadata.yaml and files in MCAP or SQLite";
        let description = Description::dataset("rosbag2", doc)
            .version(2)
            .source("ROS 2, rosbag2_storage_mcap and rosbag2_storage_sqlite3")
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
        let files: Vec<PathBuf> =
            all.iter().filter(|name| ends_in(name, &["mcap", "db3"])).cloned().collect();
        if files.is_empty() {
            let other = all.iter().find(|name| ends_in(name, &["zstd"]));
            return Err(match other {
                Some(other) => Error::new(format!(
                    "{place} is compressed as a file, `{}`; unpack it, such as with `unzstd`, or convert it with `ros2 bag convert`",
                    other.display()
                )),
                None => Error::new(format!("{place} has no files in MCAP or SQLite; copy it again")),
            });
        }
        let metadata = folder.record(Path::new(METADATA)).map_err(|error| error.at(&place))?;
        if files.iter().any(|name| ends_in(name, &["db3"])) && has_packed_messages(&metadata) {
            return Err(Error::new(format!(
                "the messages of {place} are compressed one by one; convert it with `ros2 bag convert`, without compression"
            )));
        }
        let paths = files.iter().map(|name| folder.path(name)).collect::<Result<Vec<_>>>();
        let drive =
            paths.and_then(|paths| Drive::new(config, Bag::new(paths))).map_err(|error| error.at(&place))?;
        Ok(Self { drive, folder, root, files })
    }

    fn input_files(config: &Config) -> Result<Vec<InputFiles>> {
        let Self { folder, files, .. } = Self::new(config)?;
        Ok(vec![folder.input_files([PathBuf::from(METADATA)].into_iter().chain(files))])
    }
}

/// Whether the metadata of a bag says that each message is compressed.
fn has_packed_messages(metadata: &str) -> bool {
    let mode = metadata.lines().find_map(|line| line.trim().strip_prefix("compression_mode:"));
    mode.is_some_and(|mode| mode.trim().trim_matches(['"', '\'']).eq_ignore_ascii_case("message"))
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

    fn form(&self) -> Result<Option<Form>> {
        Ok(Some(self.drive.form(&self.root, &self.files, true)))
    }

    fn rewrite(&mut self, wanted: &Rewrite, perturb: &mut Perturb<'_>) -> Result<()> {
        let number = self.files.iter().position(|name| name.to_string_lossy() == wanted.file);
        let number = number.ok_or_else(|| not_listed(&wanted.file))?;
        self.drive.rewrite(number, wanted, perturb)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::config;
    use pdk_sdk::serde_json::json;

    #[test]
    fn what_is_compressed_is_refused_with_a_remedy() {
        let dir = tempfile::tempdir().unwrap();
        let error = |name: &str, metadata: &str| {
            std::fs::write(dir.path().join(name), "").unwrap();
            std::fs::write(dir.path().join(METADATA), metadata).unwrap();
            Rosbag2::new(&config::<Rosbag2>(json!({"path": dir.path()}))).err().unwrap().to_string()
        };
        assert!(error("a.db3.zstd", "").contains("unpack it"));
        let one_by_one = "rosbag2_bagfile_information:\n  compression_mode: MESSAGE\n";
        assert!(error("a.db3", one_by_one).contains("compressed one by one"));
        assert!(error("a.db3", "  compression_mode: \"\"\n").contains("does not begin as an MCAP file"));
    }
}
