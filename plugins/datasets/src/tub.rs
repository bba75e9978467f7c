//! DonkeyCar tubs, version 2.
//!
//! A tub is a folder with `manifest.json`, catalogs of one JSON record a line, and the images. The manifest has one
//! JSON value a line; the last of them lists the catalogs and the indexes that the user has deleted. Deleting leaves
//! record and image in place, so images without a record are nothing unusual in a tub, and the records alone say which
//! frames there are.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use pdk_sdk::error::Place;
use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::{self, Map, Value};

use crate::clock::Clock;
use crate::inside::Inside;
use crate::place::{MISSING, unsuitable};
use crate::record::Record;

/// The file that lists the catalogs.
const MANIFEST: &str = "manifest.json";
/// The folder of the images.
const IMAGES: &str = "images";

/// Reads a DonkeyCar tub, version 2.
pub struct Tub {
    folder: Inside,
    rows: Vec<Row>,
    catalogs: Vec<String>,
    clock: Clock,
}

/// One record of the catalogs.
struct Row {
    /// The image's file name; the record's place in its catalog if there is none.
    name: String,
    /// What it says, or what is wrong with it.
    record: Result<Record>,
    /// The number of the drive that it belongs to.
    part: u64,
}

impl Component for Tub {
    fn description() -> Description {
        let description =
            Description::dataset("tub", "Reads a DonkeyCar tub, version 2 (a folder with manifest.json)")
                .version(2)
                .source("DonkeyCar documentation, \"Tub file format\"")
                .parameter(Parameter::path("path", "the folder of the tub"));
        Clock::parameters().into_iter().fold(description, Description::parameter)
    }

    fn new(config: &Config) -> Result<Self> {
        let root = Path::new(config.text("path"));
        let place = format!("tub `{}`", root.display());
        if !root.join(MANIFEST).exists() {
            let what = if root.exists() {
                "it has no manifest.json, so it is not a tub of version 2"
            } else {
                MISSING
            };
            return Err(unsuitable(what));
        }
        let folder = Inside::new(root).map_err(|e| e.at(&place))?;
        let manifest = Manifest::read(&folder).map_err(|e| e.at(&place))?;
        let mut rows = Vec::new();
        for catalog in &manifest.catalogs {
            let lines = folder.catalog(Path::new(catalog)).map_err(|e| e.at(&place))?;
            for (number, line) in lines.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
                rows.extend(row(catalog, number + 1, line, &manifest.deleted));
            }
        }
        if rows.is_empty() {
            return Err(Error::new(format!("{place} has no records that are not deleted")));
        }
        number_parts(&mut rows);
        let clock = Clock::new(config, rows.iter().find_map(|row| row.record.as_ref().ok()));
        Ok(Self { folder, rows, catalogs: manifest.catalogs, clock })
    }

    fn input_files(config: &Config) -> Result<Vec<InputFiles>> {
        let Self { folder, rows, catalogs, .. } = Self::new(config)?;
        let catalogs = catalogs.into_iter().map(PathBuf::from);
        let images = rows.iter().map(|row| Path::new(IMAGES).join(&row.name));
        Ok(vec![folder.input_files([PathBuf::from(MANIFEST)].into_iter().chain(catalogs).chain(images))])
    }
}

impl Dataset for Tub {
    fn len(&self) -> usize {
        self.rows.len()
    }

    fn name(&self, index: usize) -> String {
        self.rows.get(index).map(|row| row.name.clone()).unwrap_or_default()
    }

    fn read(&mut self, index: usize) -> Result<Entry> {
        let row = self.rows.get(index).ok_or_else(|| {
            Error::new(format!("the tub has {} frames, so there is no frame {index}", self.rows.len()))
        })?;
        let record = row.record.clone()?;
        Ok(Entry {
            frame: pdk_image::read(&self.folder.path(&Path::new(IMAGES).join(&row.name))?)?,
            steering: record.steering,
            throttle: record.throttle,
            speed: record.speed,
            time: self.clock.time(index, &record).map_err(|e| e.at(&row.name))?,
        })
    }

    fn position(&self, index: usize) -> Position {
        let unknown = Position { part: 0, number: index as u64, time: f64::NAN };
        let Some(row) = self.rows.get(index) else { return unknown };
        let Ok(record) = &row.record else { return Position { part: row.part, ..unknown } };
        Position {
            part: row.part,
            number: record.number.unwrap_or(index as u64),
            time: self.clock.time(index, record).unwrap_or(f64::NAN),
        }
    }
}

/// Numbers the drives: a new one begins wherever the session changes.
fn number_parts(rows: &mut [Row]) {
    let (mut part, mut session) = (0, None);
    for row in rows {
        // A record that cannot be read does not name its session.
        if let Ok(record) = &row.record {
            part += u64::from(session.as_ref().is_some_and(|before| *before != record.session));
            session = Some(record.session.clone());
        }
        row.part = part;
    }
}

/// What the manifest says about the records.
struct Manifest {
    catalogs: Vec<String>,
    deleted: BTreeSet<u64>,
}

impl Manifest {
    fn read(folder: &Inside) -> Result<Self> {
        let text = folder.catalog(Path::new(MANIFEST))?;
        let listing = text
            .lines()
            .filter_map(|line| serde_json::from_str::<Map<String, Value>>(line).ok())
            .find(|object| object.contains_key("paths"))
            .ok_or_else(|| {
                Error::new(
                    "manifest.json has no line that lists the catalogs under `paths`, so this is not a tub of version 2; \
                     the dataset `folder` reads folders with a record_N.json for each image",
                )
            })?;
        let texts = |value: &Value| -> Option<Vec<String>> {
            value.as_array()?.iter().map(|item| item.as_str().map(str::to_owned)).collect()
        };
        let catalogs = texts(&listing["paths"])
            .ok_or_else(|| Error::new("`paths` in manifest.json has to be a list of file names"))?;
        let deleted = match listing.get("deleted_indexes") {
            None => BTreeSet::new(),
            Some(value) => {
                value.as_array().and_then(|items| items.iter().map(Value::as_u64).collect()).ok_or_else(
                    || Error::new("`deleted_indexes` in manifest.json has to be a list of whole numbers"),
                )?
            }
        };
        Ok(Self { catalogs, deleted })
    }
}

/// A line of a catalog; nothing if the user has deleted the record.
fn row(catalog: &str, number: usize, line: &str, deleted: &BTreeSet<u64>) -> Option<Row> {
    let place = format!("{catalog} line {number}");
    let json = match serde_json::from_str::<Map<String, Value>>(line).place(&place) {
        Ok(json) => json,
        Err(error) => return Some(Row { name: place, record: Err(error), part: 0 }),
    };
    if json.get("_index").and_then(Value::as_u64).is_some_and(|index| deleted.contains(&index)) {
        return None;
    }
    let record = Record::from_json(&json).map_err(|e| e.at(&place));
    Some(match json.get("cam/image_array").and_then(Value::as_str) {
        Some(name) => Row { name: name.to_owned(), record, part: 0 },
        None => {
            let error = Error::new(format!("{place}: the record names no image (`cam/image_array`)"));
            Row { name: place, record: Err(error), part: 0 }
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{self, config};
    use pdk_sdk::serde_json::json;
    use tempfile::TempDir;

    /// A tub with one record for each line of `records`, and images 0 to 3 in different sizes.
    fn tub(records: &[&str], listing: Value) -> TempDir {
        let dir = TempDir::new().unwrap();
        let root = dir.path();
        std::fs::create_dir(root.join("images")).unwrap();
        for n in 0..4 {
            fixture::jpeg(&root.join(format!("images/{n}.jpg")), 16 + 8 * n, 8);
        }
        let manifest =
            format!("[\"cam/image_array\"]\n[\"image_array\"]\n{{}}\n{{\"created_at\": 1.0}}\n{listing}\n");
        std::fs::write(root.join("manifest.json"), manifest).unwrap();
        std::fs::write(root.join("catalog_0.catalog"), records.join("\n")).unwrap();
        dir
    }

    fn listing(deleted: &[u64]) -> Value {
        json!({"paths": ["catalog_0.catalog"], "current_index": 4, "deleted_indexes": deleted})
    }

    fn record(n: u64) -> String {
        json!({"_index": n, "_timestamp_ms": 1000 + 50 * n, "cam/image_array": format!("{n}.jpg"),
               "user/angle": n as f64 / 10.0, "user/throttle": 0.5})
        .to_string()
    }

    fn open(dir: &TempDir) -> Result<Tub> {
        Tub::new(&config::<Tub>(json!({"path": dir.path()})))
    }

    #[test]
    fn frames_come_in_the_order_of_the_catalog_without_the_deleted() {
        let records: Vec<_> = (0..4).map(record).collect();
        let dir = tub(&records.iter().map(String::as_str).collect::<Vec<_>>(), listing(&[1]));
        let mut tub = open(&dir).unwrap();
        assert_eq!(tub.len(), 3);
        assert_eq!((0..3).map(|i| tub.name(i)).collect::<Vec<_>>(), ["0.jpg", "2.jpg", "3.jpg"]);
        let files = Tub::input_files(&config::<Tub>(json!({"path": dir.path()}))).unwrap().remove(0);
        let names = ["manifest.json", "catalog_0.catalog", "images/0.jpg", "images/2.jpg", "images/3.jpg"]
            .map(PathBuf::from);
        assert_eq!((files.folder.as_path(), files.names.as_slice()), (dir.path(), names.as_slice()));
        let entry = tub.read(1).unwrap();
        assert_eq!((entry.frame.width(), entry.frame.height()), (32, 8));
        assert_eq!((entry.steering, entry.throttle, entry.time), (0.2, 0.5, 0.1));
        assert_eq!(tub.read(2).unwrap().frame.width(), 40);
        assert!(tub.read(3).unwrap_err().message().contains("has 3 frames"));
    }

    #[test]
    fn a_position_has_the_recorded_number_and_time_and_the_drive() {
        let with_session = |n: u64, session: &str| {
            let mut json: Value = pdk_sdk::serde_json::from_str(&record(n)).unwrap();
            json["_session_id"] = json!(session);
            json.to_string()
        };
        let records = [with_session(0, "a"), with_session(1, "a"), "damaged".into(), with_session(3, "b")];
        let dir = tub(&records.iter().map(String::as_str).collect::<Vec<_>>(), listing(&[1]));
        let tub = open(&dir).unwrap();
        assert_eq!(tub.position(0), Position { part: 0, number: 0, time: 0.0 });
        assert!(tub.position(1).part == 0 && tub.position(1).time.is_nan());
        assert_eq!(tub.position(2), Position { part: 1, number: 3, time: 0.15 });
    }

    #[test]
    fn a_faulty_frame_is_its_own_error_and_leaves_the_others_alone() {
        let missing = record(9);
        let records = [
            &record(0),
            r#"{"_index": 1, "cam/image_array": "1.jpg", "user/throttle": 0.5}"#,
            r#"{"_index": 2, "user/angle": 0.1, "user/throttle": 0.5}"#,
            missing.as_str(),
            r#"{"_index": 3, "cam/im"#,
            r#"{"_index": 1, "cam/image_array": "1.jpg", "user/angle": 0.1, "user/throttle": 0.5}"#,
        ];
        let dir = tub(&records, listing(&[]));
        let mut tub = open(&dir).unwrap();
        assert_eq!(tub.len(), 6);
        assert!(tub.read(0).is_ok());
        let mut error = |index: usize| tub.read(index).unwrap_err().to_string();
        assert_eq!(error(1), "catalog_0.catalog line 2: the record has no `user/angle`");
        assert_eq!(error(2), "catalog_0.catalog line 3: the record names no image (`cam/image_array`)");
        assert!(error(3).contains("9.jpg") && error(3).contains("does not exist"), "{}", error(3));
        assert!(error(4).starts_with("catalog_0.catalog line 5: "), "{}", error(4));
        assert!(error(5).starts_with("1.jpg: the record has no time"), "{}", error(5));
        assert_eq!(tub.name(1), "1.jpg");
        assert_eq!(tub.name(4), "catalog_0.catalog line 5");
    }

    #[test]
    fn an_unusable_tub_is_refused_as_a_whole() {
        let error = |dir: &TempDir| open(dir).err().unwrap().to_string();
        let all = record(0);
        assert!(error(&tub(&[&all], listing(&[0]))).ends_with("has no records that are not deleted"));
        assert!(error(&tub(&[], listing(&[]))).contains("has no records"));
        assert!(error(&tub(&[&all], json!({}))).contains("is not a tub of version 2"));
        assert!(error(&tub(&[&all], json!({"paths": "x"}))).contains("`paths`"));
        assert!(error(&tub(&[&all], json!({"paths": ["lost.catalog"]}))).contains("lost.catalog"));
        let deleted = json!({"paths": ["catalog_0.catalog"], "deleted_indexes": ["a"]});
        assert!(error(&tub(&[&all], deleted)).contains("`deleted_indexes`"));
        let empty = TempDir::new().unwrap();
        assert!(error(&empty).contains("manifest.json"));
        assert_eq!(open(&empty).err().unwrap().kind(), ErrorKind::Unsuitable);
        let none = Tub::new(&config::<Tub>(json!({"path": "/no/such/place"}))).err().unwrap();
        assert_eq!(none.message(), "there is no such file or folder");
    }

    #[test]
    fn a_real_drive_is_read_from_end_to_end() {
        let Some(path) = fixture::shared("tub") else { return };
        let mut tub = Tub::new(&config::<Tub>(json!({"path": path}))).unwrap();
        assert_eq!(tub.len(), 400);
        let mut before = 0.0;
        let reading = std::time::Instant::now();
        for index in 0..tub.len() {
            let entry = tub.read(index).unwrap();
            assert_eq!((entry.frame.width(), entry.frame.height()), (160, 120));
            assert!(entry.time >= before && entry.steering.abs() <= 1.0);
            before = entry.time;
        }
        println!("{:.3} ms a frame", reading.elapsed().as_secs_f64() * 1e3 / tub.len() as f64);
        assert_eq!(tub.name(0), "0_cam_image_array_.jpg");
        assert!((tub.read(0).unwrap().steering - 0.298_603_977_537_060_4).abs() < 1e-15);
    }
}
