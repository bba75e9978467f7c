//! Maps of recorded frames, kept on disk: making one may take a thousand runs of the network, and recordings are looked at again.
//!
//! A file's name is a hash of all that its map depends on: the network, who runs it, the method with its parameters, the frame,
//! and the method's other inputs. So a file is never out of date. It is written under another name and renamed when it is
//! whole. One that cannot be read, and a folder that cannot be written to, cost time and nothing else.

use std::fs;
use std::path::{Path, PathBuf};

use pdk_onnx::field::{ImageAxis, Look};
use pdk_sdk::prelude::*;
use pdk_sdk::serde_json;

use super::grid::Grid;
use super::viewer::Viewer;

/// The folder never holds more bytes than this for long: the oldest maps make room.
const ROOM: u64 = 1 << 30;

/// Changes with the format of the files.
const FORMAT: &[u8] = b"pdk map 2";

/// Where the maps of a method and a network are kept.
pub struct Kept {
    folder: PathBuf,
    /// What all maps depend on.
    base: blake3::Hash,
}

impl Kept {
    /// For a method with its parameters; none if the network's weights lie in files of their own, whose content is not known
    /// here, or if there is no folder.
    pub fn new(description: &Description, config: &Config, viewer: &Viewer) -> Option<Self> {
        let folder = pdk_sdk::cache::cache().ok()?.folder.join("maps");
        make_room(&folder, ROOM);
        Self::within(folder, description, config, viewer)
    }

    fn within(folder: PathBuf, description: &Description, config: &Config, viewer: &Viewer) -> Option<Self> {
        let graph = viewer.model.proto.graph.as_ref()?;
        if graph.initializer.iter().any(|tensor| !tensor.external_data.is_empty()) {
            return None;
        }
        let network = blake3::hash(&viewer.model.source.content().ok()?);
        // The same grid, however large the map is that is made of it, and wherever the network lies.
        let mut parameters = config.values().clone();
        for name in ["size", "model", "engine", "speed"] {
            parameters.shift_remove(name);
        }
        // The fields of the description, wherever they were given.
        parameters.extend(viewer.model.plan.described.given.values());
        let Description { name, version, .. } = description;
        let text = serde_json::to_string(&(name, version, parameters, viewer.runs_on())).ok()?;
        let mut hasher = blake3::Hasher::new();
        hasher.update(FORMAT).update(network.as_bytes()).update(text.as_bytes());
        Some(Self { folder, base: hasher.finalize() })
    }

    /// The grid of a frame in the size of the model's image: the one that is kept, or else a new one, which is kept then.
    ///
    /// # Errors
    /// That of `make`.
    pub fn find_or_make(
        &self,
        frame: Frame<'_>,
        speed: f64,
        cx: &MapContext<'_>,
        make: impl FnOnce() -> Result<Grid>,
    ) -> Result<Grid> {
        let mut hasher = blake3::Hasher::new();
        hasher.update(self.base.as_bytes()).update(&cx.key.0).update(&cx.frame_index.to_le_bytes());
        hasher.update(&speed.to_le_bytes());
        frame.rows().for_each(|row| {
            hasher.update(row);
        });
        let name = hasher.finalize().to_hex();
        let folder = self.folder.join(&name[..2]);
        let file = folder.join(&name[2..]);
        if let Some(grid) = fs::read(&file).ok().and_then(|bytes| read(&bytes)) {
            return Ok(grid);
        }
        let grid = make()?;
        let partial = folder.join(format!("{}.{}.partial", &name[2..], std::process::id()));
        let made = pdk_sdk::cache::make(&self.folder).and_then(|()| fs::create_dir_all(&folder));
        let written = made.and_then(|()| fs::write(&partial, write(&grid)));
        if written.and_then(|()| fs::rename(&partial, &file)).is_err() {
            // The map is there all the same; nothing may stay of what was not written to its end.
            let _ = fs::remove_file(&partial);
        }
        Ok(grid)
    }
}

/// If the files in the folders of this one hold more bytes than `most`, removes the oldest ones until they hold half of that, so
/// that it is not needed again soon.
fn make_room(folder: &Path, most: u64) {
    let entries = |folder: &Path| fs::read_dir(folder).into_iter().flatten().flatten();
    let files = entries(folder).flat_map(|part| entries(&part.path()));
    let mut files: Vec<_> = files
        .filter_map(|file| {
            let data = file.metadata().ok().filter(fs::Metadata::is_file)?;
            Some((data.modified().ok()?, file.path(), data.len()))
        })
        .collect();
    let mut held: u64 = files.iter().map(|(_, _, length)| length).sum();
    if held <= most {
        return;
    }
    files.sort();
    for (_, file, length) in files {
        if held <= most / 2 {
            break;
        }
        // Another process may have removed it already.
        let _ = fs::remove_file(file);
        held -= length;
    }
}

/// A grid as bytes: rows, columns, where its cells look, values, and a checksum of all that.
fn write(grid: &Grid) -> Vec<u8> {
    let mut bytes: Vec<u8> =
        [grid.rows, grid.columns].iter().flat_map(|n| (*n as u64).to_le_bytes()).collect();
    for Look { along, start, step, size } in grid.looks {
        bytes.push(u8::from(along == ImageAxis::Width));
        bytes.extend([start, step, size].iter().flat_map(|number| number.to_le_bytes()));
    }
    bytes.extend(grid.values.iter().flat_map(|value| value.to_le_bytes()));
    let checksum = blake3::hash(&bytes);
    bytes.extend(checksum.as_bytes());
    bytes
}

fn read(bytes: &[u8]) -> Option<Grid> {
    let (mut rest, checksum) = bytes.split_at_checked(bytes.len().checked_sub(blake3::OUT_LEN)?)?;
    if blake3::hash(rest).as_bytes() != checksum {
        return None;
    }
    let mut take = |length: usize| {
        let (taken, behind) = rest.split_at_checked(length)?;
        rest = behind;
        Some(taken)
    };
    let mut side = || Some(u64::from_le_bytes(take(8)?.try_into().ok()?) as usize);
    let (rows, columns) = (side()?, side()?);
    let mut look = || {
        let along = if take(1)? == [1] { ImageAxis::Width } else { ImageAxis::Height };
        let mut number = || Some(f64::from_le_bytes(take(8)?.try_into().ok()?));
        Some(Look { along, start: number()?, step: number()?, size: number()? })
    };
    let looks = [look()?, look()?];
    let values: Vec<f64> =
        rest.chunks_exact(8).filter_map(|value| Some(f64::from_le_bytes(value.try_into().ok()?))).collect();
    (rows.checked_mul(columns) == Some(values.len())).then_some(Grid { rows, columns, values, looks })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::saliency::viewer::parameters;
    use serde_json::json;

    fn grid(value: f64) -> Grid {
        let look = |along| Look { along, start: 3.5, step: -2.0, size: 7.0 };
        let looks = [ImageAxis::Height, ImageAxis::Width].map(look);
        Grid { rows: 2, columns: 3, values: vec![0.0, -1.5, value, 1e-300, f64::MAX, 0.1], looks }
    }

    #[test]
    fn a_grid_is_read_as_it_was_written_and_damage_is_noticed() {
        let bytes = write(&grid(0.25));
        assert_eq!(read(&bytes), Some(grid(0.25)));
        for place in 0..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[place] ^= 1;
            assert_eq!(read(&damaged), None, "{place}");
            assert_eq!(read(&bytes[..place]), None, "{place}");
        }
    }

    #[test]
    fn the_oldest_maps_make_room() {
        let folder = tempfile::tempdir().unwrap();
        let now = std::time::SystemTime::now();
        for age in 0..10 {
            let part = folder.path().join(format!("{}", age % 3));
            fs::create_dir_all(&part).unwrap();
            let file = fs::File::create(part.join(format!("{age}"))).unwrap();
            file.set_len(100).unwrap();
            file.set_modified(now - std::time::Duration::from_secs(age)).unwrap();
        }
        let left = || {
            let files = (0..10).filter(|age| folder.path().join(format!("{}/{age}", age % 3)).exists());
            files.collect::<Vec<_>>()
        };
        make_room(folder.path(), 1000);
        assert_eq!(left().len(), 10);
        make_room(folder.path(), 999);
        assert_eq!(left(), [0, 1, 2, 3]);
        make_room(&folder.path().join("none"), 0);
    }

    #[test]
    fn a_map_is_made_once_for_all_that_it_depends_on() {
        let folder = tempfile::tempdir().unwrap();
        let description = parameters(Description::saliency("test", "x"));
        let open = |explain: &str| {
            let given = json!({"model": "dave2", "explain": explain});
            let config = Config::check(&description, given.as_object().unwrap()).unwrap();
            let viewer = Viewer::open(&config).unwrap();
            Kept::within(folder.path().to_owned(), &description, &config, &viewer).unwrap()
        };
        let (dark, key) = (FrameBuf::new(200, 66), Key([1; 32]));
        let mut bright = dark.clone();
        bright.as_mut().rows_mut().for_each(|row| row.fill(200));
        let steering = open("steering");
        let ask = |kept: &Kept, frame: &FrameBuf, speed: f64, index: u64, value: f64| {
            let cx = MapContext { recorded: true, ..MapContext::new(index, 0.0, &key) };
            kept.find_or_make(frame.as_ref(), speed, &cx, || Ok(grid(value))).unwrap().values[2]
        };
        assert_eq!(ask(&steering, &dark, 8.0, 0, 1.0), 1.0);
        assert_eq!(ask(&steering, &dark, 8.0, 0, 2.0), 1.0);
        assert_eq!(ask(&open("steering"), &dark, 8.0, 0, 3.0), 1.0);
        assert_eq!(ask(&steering, &bright, 8.0, 0, 4.0), 4.0);
        assert_eq!(ask(&steering, &dark, 7.0, 0, 5.0), 5.0);
        assert_eq!(ask(&steering, &dark, 8.0, 1, 6.0), 6.0);
        assert_eq!(ask(&open("throttle"), &dark, 8.0, 0, 7.0), 7.0);
        let other = MapContext::new(0, 0.0, &key);
        let failed = steering.find_or_make(dark.as_ref(), 9.0, &other, || Err(Error::new("broken")));
        assert_eq!(failed.unwrap_err().message(), "broken");
        assert_eq!(ask(&steering, &dark, 9.0, 0, 8.0), 8.0);
    }
}
