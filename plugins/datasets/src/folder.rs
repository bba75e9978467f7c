//! Folders of images with one record each.
//!
//! The published format: images `N_text.jpg` (or `.jpeg`, `.png`) and beside each a `record_N.json` with `user/angle`
//! and `user/throttle`, N being a whole number. DonkeyCar tubs of version 1 have the same form, and so has what `pdk corrupt --plain`
//! writes.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use pdk_sdk::error::Place;
use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::{self, Map, Value};

use crate::clock::Clock;
use crate::inside::Inside;
use crate::place::{MISSING, unsuitable};
use crate::record::Record;

/// Reads a folder of images with one record each.
pub struct Folder {
    folder: Inside,
    rows: Vec<Row>,
    clock: Clock,
}

/// A frame, or one half of it where the other is missing.
struct Row {
    /// The file name of the image; of the record if there is not an image.
    name: String,
    files: Files,
}

/// The files of a frame, by name.
enum Files {
    Pair { record: String },
    ImageAlone,
    RecordAlone,
    Unclear { number: u64 },
}

impl Component for Folder {
    fn description() -> Description {
        let doc = "Reads a folder of images N_text.jpg or .png with a record_N.json beside each";
        let description = Description::dataset("folder", doc)
            .version(2)
            .source("the dataset format of PerturbationDrive; DonkeyCar tub, version 1")
            .parameter(Parameter::path("path", "the folder"));
        Clock::parameters().into_iter().fold(description, Description::parameter)
    }

    fn new(config: &Config) -> Result<Self> {
        let root = Path::new(config.text("path"));
        let place = format!("dataset folder `{}`", root.display());
        if !root.exists() {
            return Err(unsuitable(MISSING));
        }
        let folder = Inside::new(root).map_err(|e| unsuitable(e.message()))?;
        let rows = rows(root).map_err(|e| e.at(&place))?;
        if !rows
            .iter()
            .any(|row| matches!(row.files, Files::Pair { .. } | Files::RecordAlone | Files::Unclear { .. }))
        {
            return Err(unsuitable(
                "it has no frames of a folder of records: images N_text.jpg, .jpeg or .png with a record_N.json beside each",
            ));
        }
        let first = rows.iter().find_map(|row| match &row.files {
            Files::Pair { record } => read_record(&folder, record).ok(),
            _ => None,
        });
        let clock = Clock::new(config, first.as_ref());
        Ok(Self { folder, rows, clock })
    }

    fn input_files(config: &Config) -> Result<Vec<InputFiles>> {
        let Self { folder, rows, .. } = Self::new(config)?;
        let names = rows.into_iter().flat_map(|Row { name, files }| match files {
            Files::Pair { record } => vec![PathBuf::from(name), PathBuf::from(record)],
            Files::ImageAlone | Files::RecordAlone | Files::Unclear { .. } => vec![PathBuf::from(name)],
        });
        Ok(vec![folder.input_files(names)])
    }
}

impl Dataset for Folder {
    fn len(&self) -> usize {
        self.rows.len()
    }

    fn name(&self, index: usize) -> String {
        self.rows.get(index).map(|row| row.name.clone()).unwrap_or_default()
    }

    fn read(&mut self, index: usize) -> Result<Entry> {
        let Row { name, files } = self.rows.get(index).ok_or_else(|| {
            Error::new(format!("the folder has {} frames, so there is no frame {index}", self.rows.len()))
        })?;
        let record = match files {
            Files::Pair { record } => read_record(&self.folder, record)?,
            Files::ImageAlone => {
                let expected = match image_number(name) {
                    Some(number) => format!("record_{number}.json beside it"),
                    None => "record, because its name does not start with a number".to_owned(),
                };
                return Err(Error::new(format!("the image `{name}` has no {expected}")));
            }
            Files::RecordAlone => {
                return Err(Error::new(format!(
                    "the record `{name}` has no image with its number beside it"
                )));
            }
            Files::Unclear { number } => {
                return Err(Error::new(format!(
                    "`{name}`: several images or several records have the number {number}, so it is not clear which \
                     belong together; leave one of each"
                )));
            }
        };
        Ok(Entry {
            frame: pdk_image::read(&self.folder.path(Path::new(name))?)?,
            steering: record.steering,
            throttle: record.throttle,
            speed: record.speed,
            time: self.clock.time(index, &record).map_err(|e| e.at(name))?,
        })
    }

    fn position(&self, index: usize) -> Position {
        let unknown = Position { part: 0, number: index as u64, time: f64::NAN };
        let Some(Row { name, files: Files::Pair { record } }) = self.rows.get(index) else { return unknown };
        let record = read_record(&self.folder, record).ok();
        Position {
            number: image_number(name).unwrap_or(index as u64),
            time: record.and_then(|record| self.clock.time(index, &record).ok()).unwrap_or(f64::NAN),
            ..unknown
        }
    }
}

/// The files that share a number.
#[derive(Default)]
struct Numbered {
    images: Vec<String>,
    records: Vec<String>,
}

/// All frames by number, then the images without a number.
fn rows(root: &Path) -> Result<Vec<Row>> {
    let mut names = Vec::new();
    for entry in std::fs::read_dir(root).place("cannot list it")? {
        names.push(entry.place("cannot list it")?.file_name().to_string_lossy().into_owned());
    }
    // The order in which a folder lists its files is not defined.
    names.sort();
    let mut numbered: BTreeMap<u64, Numbered> = BTreeMap::new();
    let mut unnumbered = Vec::new();
    for name in names {
        if let Some(number) = record_number(&name) {
            numbered.entry(number).or_default().records.push(name);
        } else if is_image(&name) {
            match image_number(&name) {
                Some(number) => numbered.entry(number).or_default().images.push(name),
                None => unnumbered.push(Row { name, files: Files::ImageAlone }),
            }
        }
    }
    let rows = numbered.into_iter().flat_map(|(number, Numbered { images, records })| {
        let names = if images.is_empty() { records.clone() } else { images.clone() };
        let row = |name| {
            let files = match (images.len(), records.as_slice()) {
                (0, _) => Files::RecordAlone,
                (_, []) => Files::ImageAlone,
                (1, [record]) => Files::Pair { record: record.clone() },
                _ => Files::Unclear { number },
            };
            Row { name, files }
        };
        names.into_iter().map(row).collect::<Vec<_>>()
    });
    Ok(rows.chain(unnumbered).collect())
}

/// N of `record_N.json`.
fn record_number(name: &str) -> Option<u64> {
    digits(name.strip_prefix("record_")?.strip_suffix(".json")?)
}

/// N of `N_text.jpg` or `N.jpg`.
fn image_number(name: &str) -> Option<u64> {
    digits(name.split(['_', '.']).next()?)
}

/// A whole number of nothing but digits; `parse` alone would take a sign.
fn digits(text: &str) -> Option<u64> {
    text.bytes().all(|b| b.is_ascii_digit()).then(|| text.parse().ok())?
}

fn is_image(name: &str) -> bool {
    Path::new(name).extension().and_then(|e| e.to_str()).is_some_and(|extension| {
        ["jpg", "jpeg", "png"].iter().any(|known| extension.eq_ignore_ascii_case(known))
    })
}

fn read_record(folder: &Inside, name: &str) -> Result<Record> {
    let place = format!("record `{name}`");
    let text = folder.record(Path::new(name)).map_err(|e| e.at(&place))?;
    let json: Map<String, Value> = serde_json::from_str(&text).place(&place)?;
    Record::from_json(&json).map_err(|e| e.at(&place))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{self, config};
    use pdk_sdk::serde_json::json;
    use tempfile::TempDir;

    fn open(path: &Path) -> Result<Folder> {
        Folder::new(&config::<Folder>(json!({"path": path})))
    }

    fn record(dir: &TempDir, number: &str, content: Value) {
        std::fs::write(dir.path().join(format!("record_{number}.json")), content.to_string()).unwrap();
    }

    fn control(steering: f64) -> Value {
        json!({"user/angle": steering, "user/throttle": 0.25, "user/mode": "user"})
    }

    #[test]
    fn frames_are_sorted_by_number_and_paired_with_their_record() {
        let dir = TempDir::new().unwrap();
        for (index, name) in
            ["10_cam.jpg", "9_cam-image_array_.JPEG", "0100_x_y.png", "2.jpg"].iter().enumerate()
        {
            fixture::image(&dir.path().join(name), 16 + 8 * index as u32, 8);
        }
        for (number, steering) in [("10", 0.1), ("9", 0.9), ("100", 1.0), ("2", 0.2)] {
            record(&dir, number, control(steering));
        }
        std::fs::write(dir.path().join("notes.txt"), "not a frame").unwrap();
        let mut folder = open(dir.path()).unwrap();
        let names: Vec<_> = (0..folder.len()).map(|i| folder.name(i)).collect();
        assert_eq!(names, ["2.jpg", "9_cam-image_array_.JPEG", "10_cam.jpg", "0100_x_y.png"]);
        let entry = folder.read(1).unwrap();
        assert_eq!((entry.steering, entry.throttle, entry.time), (0.9, 0.25, 0.05));
        assert_eq!(entry.frame.width(), 24);
        assert_eq!(folder.read(3).unwrap().frame.width(), 32);
        assert!(folder.read(4).unwrap_err().message().contains("has 4 frames"));
        assert_eq!(folder.position(2), Position { part: 0, number: 10, time: 0.1 });
    }

    #[test]
    fn a_faulty_frame_is_its_own_error_and_leaves_the_others_alone() {
        let dir = TempDir::new().unwrap();
        for name in [
            "0_a.png",
            "1_a.png",
            "2_a.png",
            "2_b.png",
            "3_a.png",
            "4_a.png",
            "7_a.png",
            "preview.png",
            "+6_a.png",
        ] {
            fixture::image(&dir.path().join(name), 8, 8);
        }
        for number in ["0", "2", "5", "7", "07"] {
            record(&dir, number, control(0.0));
        }
        record(&dir, "3", json!({"user/throttle": 0.0}));
        std::fs::write(dir.path().join("record_4.json"), "{\"user/angle\": 0.").unwrap();
        let mut folder = open(dir.path()).unwrap();
        assert_eq!(folder.len(), 10);
        assert!(folder.read(0).is_ok());
        let mut error = |index: usize| folder.read(index).unwrap_err().to_string();
        assert_eq!(error(1), "the image `1_a.png` has no record_1.json beside it");
        assert!(
            error(2).starts_with("`2_a.png`: several images") && error(3).starts_with("`2_b.png`: several")
        );
        assert!(error(4).contains("record_3.json") && error(4).ends_with("the record has no `user/angle`"));
        assert!(error(5).contains("record_4.json"), "{}", error(5));
        assert_eq!(error(6), "the record `record_5.json` has no image with its number beside it");
        assert!(error(7).starts_with("`7_a.png`: several images or several records have the number 7"));
        assert!(error(8).starts_with("the image `+6_a.png` has no record, because"));
        assert!(error(9).starts_with("the image `preview.png` has no record, because"));
        let files = Folder::input_files(&config::<Folder>(json!({"path": dir.path()}))).unwrap().remove(0);
        let names: Vec<String> = files.names.iter().map(|name| name.display().to_string()).collect();
        assert_eq!(names.len(), 13, "{names:?}");
        assert!(names.contains(&"record_0.json".to_owned()) && !names.contains(&"record_2.json".to_owned()));
    }

    #[test]
    fn times_are_taken_from_the_records_where_they_have_them() {
        let dir = TempDir::new().unwrap();
        for number in 0..3u64 {
            fixture::image(&dir.path().join(format!("{number}_a.png")), 8, 8);
            let content = json!({"user/angle": 0, "user/throttle": 0, "milliseconds": 700 + 100 * number});
            record(&dir, &number.to_string(), content);
        }
        assert_eq!(open(dir.path()).unwrap().read(2).unwrap().time, 0.2);
        let by_rate = json!({"path": dir.path(), "clock": "rate", "rate": 50});
        let mut folder = Folder::new(&config::<Folder>(by_rate)).unwrap();
        assert_eq!(folder.read(2).unwrap().time, 0.04);
    }

    #[test]
    fn a_folder_without_frames_is_refused_as_a_whole() {
        let dir = TempDir::new().unwrap();
        std::fs::write(dir.path().join("notes.txt"), "").unwrap();
        assert!(open(dir.path()).err().unwrap().message().contains("has no frames"));
        let file = dir.path().join("notes.txt");
        assert!(open(&file).err().unwrap().message().ends_with("it is not a folder"));
        assert_eq!(open(Path::new("/no/such/place")).err().unwrap().message(), MISSING);
    }
}
