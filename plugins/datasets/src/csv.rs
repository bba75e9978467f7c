//! Folders of pictures with a CSV file: a row for each frame, with the picture and what was recorded.
//!
//! Udacity's simulator writes such a folder: `driving_log.csv`, with or without a header, and the pictures in `IMG`, whose paths are those
//! of the machine that recorded them.

use std::collections::BTreeMap;
use std::path::{Component as Part, Path, PathBuf};

use pdk_sdk::prelude::*;

use crate::clock::Clock;
use crate::inside::Inside;
use crate::label::{Label, Units};
use crate::listing::{is_picture, last_number, names};
use crate::place::{Named, beyond, unsuitable};
use crate::record::Record;
use crate::table::{Columns, Table, only_table};

/// Folders in which pictures lie beside a table.
const FOLDERS: [&str; 7] = ["", "IMG", "images", "img", "frames", "imgs", "data"];

/// Reads a folder of pictures with a CSV file.
pub struct Csv {
    folder: Inside,
    rows: Vec<Row>,
    table: PathBuf,
    told: Vec<(String, String)>,
}

/// A frame.
struct Row {
    /// The picture's name in the folder.
    picture: PathBuf,
    label: Result<Label>,
    time: Result<f64>,
}

impl Component for Csv {
    fn description() -> Description {
        let doc = "Reads a folder of pictures with a CSV file, such as Udacity's driving_log.csv";
        let description = Description::dataset("csv", doc)
            .source("Udacity, \"Self-driving car simulator\", for driving_log.csv")
            .parameter(Parameter::path("path", "the folder, or its CSV file"));
        let speed = ["auto", "m/s", "km/h", "mph"];
        let speed_doc =
            "the unit of the recorded speed; `auto` is mph for Udacity's driving_log.csv, and else m/s";
        let units = Units::parameters("m/s").into_iter().map(|parameter| match parameter.name.as_str() {
            "speed_unit" => Parameter::choice("speed_unit", &speed, speed_doc),
            _ => parameter,
        });
        let parameters = Table::parameters(&["image"]).into_iter().chain(units).chain(Clock::parameters());
        parameters.fold(description, Description::parameter)
    }

    fn new(config: &Config) -> Result<Self> {
        let path = Path::new(config.text("path"));
        let Named { folder, path: root, file } = Named::new(path)?;
        let place = format!("recording `{}`", path.display());
        let name = match file {
            Some(file) if crate::listing::ends_in(&file, &["csv"]) => file,
            Some(_) => return Err(unsuitable("it is not a CSV file")),
            None => match only_table(&root, config).map_err(|error| error.at(&place))? {
                Some(table) => table,
                None => return Err(unsuitable("it has no CSV file")),
            },
        };
        let table = Table::read(&folder, &name).map_err(|error| error.at(&place))?;
        Self::from_table(config, folder, &root, &table).map_err(|error| error.at(&place))
    }

    fn input_files(config: &Config) -> Result<Vec<InputFiles>> {
        let Self { folder, rows, table, .. } = Self::new(config)?;
        Ok(vec![folder.input_files([table].into_iter().chain(rows.into_iter().map(|row| row.picture)))])
    }
}

impl Csv {
    fn from_table(config: &Config, folder: Inside, root: &Path, table: &Table) -> Result<Self> {
        let columns = table.columns(config)?;
        if columns == Columns::default()
            && ["image", "steering"].iter().all(|name| config.text(name).is_empty())
        {
            return Err(Error::new(format!(
                "no column of `{}` has a name that is known; name those with the pictures and the steering by `image` and `steering`, such \
                 as `image=1`",
                table.name.display()
            )));
        }
        let pictures = Pictures::find(&folder, root)?;
        let (found, how) = pictures.of_rows(&folder, table, &columns)?;
        let mut told = vec![("frames".to_owned(), how)];
        let units = units(config, table)?;
        let (labels, columns_told) = table.labels(&columns, &units)?;
        told.extend(columns_told);

        let times = table.times(&columns, config);
        let recorded: Vec<Option<f64>> = match &times {
            Some(times) => times.since.clone(),
            None => vec![None; table.len()],
        };
        let record =
            |time: Option<f64>| Record { milliseconds: time.map(|time| time * 1e3), ..Record::default() };
        let clock = Clock::new(
            config,
            recorded.iter().find(|time| time.is_some()).map(|time| record(*time)).as_ref(),
        );
        let how = match (&clock, times) {
            (Clock::Recorded { .. }, Some(times)) => times.how,
            _ => format!("{} frames a second", config.number("rate")),
        };
        told.push(("time".to_owned(), how));
        let rows = found.into_iter().zip(labels).enumerate().map(|(index, (picture, label))| Row {
            picture,
            label,
            time: clock.time(index, &record(recorded[index])).map_err(|error| error.at(table.place(index))),
        });
        Ok(Self { folder, rows: rows.collect(), table: table.name.clone(), told })
    }
}

/// The units that the configuration asks for. The simulator of Udacity gives miles an hour.
fn units(config: &Config, table: &Table) -> Result<Units> {
    if config.text("speed_unit") != "auto" {
        return Units::new(config);
    }
    let mut values = config.values().clone();
    let unit = if table.is_udacity { "mph" } else { "m/s" };
    values.insert("speed_unit".to_owned(), unit.into());
    values.retain(|name, _| matches!(name.as_str(), "full_lock" | "speed_unit"));
    let description =
        Units::parameters("m/s").into_iter().fold(Description::dataset("csv", ""), Description::parameter);
    Units::new(&Config::check(&description, &values)?)
}

/// The pictures that lie beside a table.
struct Pictures {
    /// In the order of their names.
    all: Vec<PathBuf>,
    /// By the last number in their names; none if two have the same.
    numbered: BTreeMap<u64, Option<PathBuf>>,
}

impl Pictures {
    fn find(folder: &Inside, root: &Path) -> Result<Self> {
        let mut all = Vec::new();
        for sub in FOLDERS {
            let inside = Path::new(sub);
            if root.join(inside).is_dir() && folder.may_read(inside) {
                all.extend(
                    names(&root.join(inside))?
                        .into_iter()
                        .filter(|name| is_picture(name))
                        .map(|name| inside.join(name)),
                );
            }
        }
        let mut numbered = BTreeMap::new();
        for picture in &all {
            if let Some(number) = last_number(picture) {
                let only = numbered.entry(number).or_insert_with(|| Some(picture.clone()));
                if only.as_ref() != Some(picture) {
                    *only = None;
                }
            }
        }
        Ok(Self { all, numbered })
    }

    /// The picture of each row, and how it was found.
    fn of_rows(&self, folder: &Inside, table: &Table, columns: &Columns) -> Result<(Vec<PathBuf>, String)> {
        let rows = table.len();
        let Some(column) = columns.image else {
            return match (self.all.len() == rows, self.all.is_empty()) {
                (true, _) => Ok((
                    self.all.clone(),
                    format!("{rows} pictures in the order of their names, one for each row"),
                )),
                (false, true) => Err(unsuitable("it has a CSV file and no pictures")),
                (false, false) => Err(Error::new(format!(
                    "`{}` has {rows} rows and no column with the pictures, of which there are {}; name the column by `image`",
                    table.name.display(),
                    self.all.len()
                ))),
            };
        };
        let title = table.title(column);
        // Numbers of frames, in place of names.
        let numbers: Vec<Option<u64>> = (0..rows).map(|row| table.cell(row, column).parse().ok()).collect();
        if numbers.iter().all(Option::is_some) {
            let found = numbers.iter().flatten().map(|number| match self.numbered.get(number) {
                Some(Some(picture)) => picture.clone(),
                _ => PathBuf::from(number.to_string()),
            });
            let found: Vec<PathBuf> = found.collect();
            if found.iter().any(|name| is_picture(name)) {
                return Ok((found, format!("{rows}, by the numbers in {title}")));
            }
            return Err(unsuitable(
                "its CSV file has numbers of frames, and no pictures have them in their names",
            ));
        }
        let found: Vec<PathBuf> = (0..rows).map(|row| resolve(folder, table.cell(row, column))).collect();
        match found.iter().any(|name| exists(folder, name)) {
            true => Ok((found, format!("{rows}, by the names in {title}"))),
            false if self.all.is_empty() => Err(unsuitable("it has a CSV file and no pictures")),
            false => Err(Error::new(format!(
                "none of the pictures that {title} of `{}` names is in the folder, the first being `{}`; name the column by `image`",
                table.name.display(),
                table.cell(0, column)
            ))),
        }
    }
}

fn exists(folder: &Inside, name: &Path) -> bool {
    folder.path(name).is_ok_and(|path| path.is_file())
}

/// The file of a name in a table: where it says if that is inside the folder, or else by its last part, since recordings are moved and
/// their tables keep the paths of another machine.
fn resolve(folder: &Inside, name: &str) -> PathBuf {
    let name = name.replace('\\', "/");
    let path = Path::new(&name);
    let last = path.file_name().map(PathBuf::from).unwrap_or_default();
    let relative = path.components().all(|part| matches!(part, Part::Normal(_) | Part::CurDir));
    if relative && !path.as_os_str().is_empty() {
        for sub in FOLDERS {
            let place = Path::new(sub).join(path);
            if exists(folder, &place) {
                return place;
            }
        }
    }
    let beside = FOLDERS.iter().map(|sub| Path::new(sub).join(&last)).find(|place| exists(folder, place));
    // What is nowhere is reported by its own name when it is read.
    beside.unwrap_or_else(|| path.to_owned())
}

impl Dataset for Csv {
    fn len(&self) -> usize {
        self.rows.len()
    }

    fn name(&self, index: usize) -> String {
        let name = self.rows.get(index).map(|row| row.picture.display().to_string()).unwrap_or_default();
        if name.is_empty() { format!("row {}", index + 1) } else { name }
    }

    fn read(&mut self, index: usize) -> Result<Entry> {
        let row = self.rows.get(index).ok_or_else(|| beyond(index, self.rows.len()))?;
        let label = row.label.clone()?;
        Ok(Entry {
            frame: pdk_image::read(&self.folder.path(&row.picture)?)?,
            steering: label.steering,
            throttle: label.throttle,
            time: row.time.clone()?,
            speed: label.speed,
        })
    }

    fn position(&self, index: usize) -> Position {
        let time = self.rows.get(index).and_then(|row| row.time.as_ref().ok());
        Position { part: 0, number: index as u64, time: time.copied().unwrap_or(f64::NAN) }
    }

    fn info(&self) -> Vec<(String, String)> {
        self.told.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{self, config};
    use pdk_sdk::serde_json::{Value, json};
    use tempfile::TempDir;

    fn folder(pictures: &[&str], table: (&str, &str)) -> TempDir {
        let dir = TempDir::new().unwrap();
        for (index, name) in pictures.iter().enumerate() {
            let path = dir.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            fixture::image(&path, 16 + 8 * index as u32, 8);
        }
        std::fs::write(dir.path().join(table.0), table.1).unwrap();
        dir
    }

    fn open(dir: &TempDir, given: Value) -> Result<Csv> {
        let mut given = given;
        given["path"] = json!(dir.path());
        Csv::new(&config::<Csv>(given))
    }

    #[test]
    fn rows_are_frames_with_their_labels_and_times() {
        let table = "timestamp,filename,steering,throttle,speed\n10,b.png,-0.5,0.25,3\n10.1,a.png,1,0,4\n12,c.png,0,0,5\n";
        let dir = folder(&["images/a.png", "images/b.png"], ("labels.csv", table));
        let mut csv = open(&dir, json!({})).unwrap();
        assert_eq!((csv.len(), csv.name(0), csv.position(2).time), (3, "images/b.png".to_owned(), 2.0));
        let entry = csv.read(0).unwrap();
        assert_eq!((entry.frame.width(), entry.steering, entry.throttle, entry.speed), (24, -0.5, 0.25, 3.0));
        assert!((csv.read(1).unwrap().time - 0.1).abs() < 1e-9);
        assert!(csv.read(2).unwrap_err().message().contains("c.png` does not exist"));
        assert!(
            csv.info().contains(&("time".to_owned(), "column `timestamp`, in s".to_owned())),
            "{:?}",
            csv.info()
        );
        let files = Csv::input_files(&config::<Csv>(json!({"path": dir.path()}))).unwrap().remove(0);
        assert_eq!(files.names, ["labels.csv", "images/b.png", "images/a.png", "c.png"].map(PathBuf::from));
        // The file itself can be named.
        let file = config::<Csv>(json!({"path": dir.path().join("labels.csv")}));
        assert_eq!(Csv::new(&file).unwrap().len(), 3);
    }

    #[test]
    fn the_log_of_udacity_is_read_where_it_was_moved_to() {
        let rows = "C:\\sim\\IMG\\center_1.png,C:\\sim\\IMG\\left_1.png,C:\\sim\\IMG\\right_1.png,0.5,0.75,0.25,10\n\
                    /home/x/IMG/center_2.png, /home/x/IMG/left_2.png, /home/x/IMG/right_2.png,-1,0,0,20\n";
        let dir =
            folder(&["IMG/center_1.png", "IMG/center_2.png", "IMG/left_1.png"], ("driving_log.csv", rows));
        let mut csv = open(&dir, json!({})).unwrap();
        let entry = csv.read(0).unwrap();
        assert_eq!((entry.frame.width(), entry.steering, entry.throttle), (16, 0.5, 0.5));
        assert!((entry.speed - 4.4704).abs() < 1e-12);
        assert_eq!((csv.read(1).unwrap().time, csv.name(1).as_str()), (0.05, "IMG/center_2.png"));
        let mut left = open(&dir, json!({"image": "left", "speed_unit": "m/s"})).unwrap();
        let entry = left.read(0).unwrap();
        assert_eq!((entry.frame.width(), entry.speed), (32, 10.0));
    }

    #[test]
    fn frames_are_found_by_their_numbers_or_their_order() {
        let dir = folder(&["img_0009.png", "img_0010.png"], ("l.csv", "frame,angle\n10,5\n9,-25\n"));
        let error = open(&dir, json!({})).err().unwrap().to_string();
        assert!(error.contains("goes from -25 to 5") && error.contains("set `full_lock`"), "{error}");
        let mut csv = open(&dir, json!({"full_lock": 25})).unwrap();
        assert_eq!((csv.name(0).as_str(), csv.read(0).unwrap().steering), ("img_0010.png", 0.2));
        let mut csv = open(&dir, json!({"full_lock": 25, "image": "none"})).unwrap();
        assert_eq!((csv.name(0).as_str(), csv.read(0).unwrap().steering), ("img_0009.png", 0.2));
    }

    #[test]
    fn nothing_outside_the_folder_is_read() {
        let dir = folder(&["in/a.png", "out/a.png", "out/b.png"], ("x.csv", "image\n"));
        std::fs::write(dir.path().join("in/l.csv"), "image,angle\n../out/b.png,0\n/etc/passwd,0\na.png,0\n")
            .unwrap();
        let mut csv = Csv::new(&config::<Csv>(json!({"path": dir.path().join("in")}))).unwrap();
        assert!(csv.read(0).unwrap_err().message().contains("is outside the dataset's folder"));
        assert!(csv.read(1).is_err() && csv.read(2).is_ok());
        let files =
            Csv::input_files(&config::<Csv>(json!({"path": dir.path().join("in")}))).unwrap().remove(0);
        assert_eq!(files.names, ["l.csv", "a.png"].map(PathBuf::from));
    }

    #[test]
    fn what_is_not_such_a_folder_is_left_to_other_readers() {
        let kind = |dir: &TempDir| open(dir, json!({})).err().unwrap().kind();
        assert_eq!(kind(&folder(&[], ("a.txt", ""))), ErrorKind::Unsuitable);
        assert_eq!(kind(&folder(&[], ("a.csv", "frame,steering\n0,0\n"))), ErrorKind::Unsuitable);
        let unnamed = open(&folder(&["a.png"], ("a.csv", "a.png,0.5\n")), json!({})).err().unwrap();
        assert!(unnamed.message().contains("such as `image=1`"), "{unnamed}");
        let two = folder(&["a.png"], ("a.csv", "image\na.png\n"));
        std::fs::write(two.path().join("b.csv"), "x").unwrap();
        assert!(open(&two, json!({})).err().unwrap().message().contains("has 2 CSV files"));
        assert_eq!(open(&two, json!({"table": "a.csv"})).unwrap().len(), 1);
    }
}
