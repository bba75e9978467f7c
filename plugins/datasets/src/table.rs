//! CSV files: their rows, and which column is what. What a user does not say is guessed from the names of the columns, and told.

use std::path::{Path, PathBuf};

use pdk_sdk::error::Place;
use pdk_sdk::prelude::*;

use crate::inside::Inside;
use crate::label::{Label, Units, pedals, range};

/// More rows than this are not believed.
const MOST: usize = 1 << 22;

/// The columns of Udacity's simulator, which writes no header.
const UDACITY: [&str; 7] = ["center", "left", "right", "steering", "throttle", "brake", "speed"];

/// A CSV file.
#[derive(Debug, Clone)]
pub struct Table {
    /// Its name in the folder.
    pub name: PathBuf,
    /// The names of its columns; empty if it has no header.
    header: Vec<String>,
    /// Its rows with their places in the file.
    pub(crate) rows: Vec<(::csv::Position, ::csv::StringRecord)>,
    /// What is between two cells.
    pub(crate) separator: char,
    /// Whether it is the log of Udacity's simulator.
    pub is_udacity: bool,
}

/// What a column can be, with the names by which it is known, the likeliest first.
const KNOWN: [(&str, &[&str]); 7] = [
    (
        "image",
        &[
            "image",
            "imagepath",
            "imagefile",
            "imagefilename",
            "filename",
            "file",
            "camimagearray",
            "center",
            "centre",
            "centerimage",
            "img",
            "path",
            "picture",
            "frame",
            "frameid",
            "frameindex",
            "framenumber",
        ],
    ),
    (
        "steering",
        &[
            "steering",
            "steeringangle",
            "angle",
            "userangle",
            "steer",
            "steeringcommand",
            "steeringwheelangle",
        ],
    ),
    ("throttle", &["throttle", "userthrottle", "accelerator", "gas", "acceleratorpedal"]),
    ("brake", &["brake", "brakes", "brakepedal"]),
    ("speed", &["speed", "velocity", "vehiclespeed", "carspeed"]),
    (
        "timestamp",
        &[
            "timestamp",
            "time",
            "stamp",
            "times",
            "seconds",
            "t",
            "timestampms",
            "timestampus",
            "timestampns",
            "timems",
            "timeus",
            "timens",
            "milliseconds",
            "microseconds",
            "nanoseconds",
        ],
    ),
    ("frame", &["frame", "frameid", "frameindex", "framenumber", "index"]),
];

/// The columns of a table, by their places.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Columns {
    /// The picture: its path, its name or its number.
    pub image: Option<usize>,
    /// The number of the frame, for videos.
    pub frame: Option<usize>,
    /// The time.
    pub timestamp: Option<usize>,
    /// The steering.
    pub steering: Option<usize>,
    throttle: Option<usize>,
    brake: Option<usize>,
    speed: Option<usize>,
}

/// The times of the rows.
#[derive(Debug, PartialEq)]
pub struct Times {
    /// The time of each row in seconds since `begin`; none if its cell is empty or not a number.
    pub since: Vec<Option<f64>>,
    /// What the others are counted from: with whole numbers the time of the first row, else 0.
    pub begin: f64,
    /// What is known of them.
    pub how: String,
}

/// What was recorded in each row, and what is known of the columns.
pub type Labels = (Vec<Result<Label>>, Vec<(String, String)>);

impl Table {
    /// The parameters that name columns; `first` is the one by which rows belong to frames.
    pub fn parameters(first: &[&str]) -> Vec<Parameter> {
        let column = |name: &str| {
            let doc = match name {
                "image" => "the column with the picture's path, name or number",
                "frame" => "the column with the frame's number in the video",
                "steering" => "the column with the steering",
                "throttle" => "the column with the throttle",
                "brake" => "the column with the brake, which counts against the throttle",
                "speed" => "the column with the speed",
                _ => "the column with the time",
            };
            Parameter::text(
                name,
                &format!(
                    "{doc}: its name, or its number from 1; guessed if it is not set, and `none` for none"
                ),
            )
        };
        let names = first.iter().chain(&["steering", "throttle", "brake", "speed", "timestamp"]);
        let table = Parameter::text("table", "the CSV file, if the folder has several");
        let unit =
            "the unit of the time; `auto` goes by the name of the column, then by the size of the numbers";
        let unit = Parameter::choice("time_unit", &["auto", "s", "ms", "us", "ns"], unit);
        names.map(|name| column(name)).chain([table, unit]).collect()
    }

    /// Reads a CSV file of a folder.
    ///
    /// # Errors
    /// If it cannot be read, or has no rows.
    pub fn read(folder: &Inside, name: &Path) -> Result<Self> {
        let place = format!("`{}`", name.display());
        let text = folder.catalog(name).map_err(|error| error.at(&place))?;
        Self::parse(name, &text).map_err(|error| error.at(&place))
    }

    fn parse(name: &Path, text: &str) -> Result<Self> {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        // The separator that the first line has most of.
        let first = text.lines().next().unwrap_or_default();
        let separators = [',', ';', '\t'];
        let separator = separators
            .into_iter()
            .max_by_key(|separator| (first.matches(*separator).count(), *separator == ','))
            .unwrap_or(',');
        let mut reader = ::csv::ReaderBuilder::new()
            .delimiter(separator as u8)
            .has_headers(false)
            .flexible(true)
            .trim(::csv::Trim::All)
            .comment(Some(b'#'))
            .from_reader(text.as_bytes());
        let mut rows = Vec::new();
        for row in reader.records() {
            let row = row.place("it is not a CSV file")?;
            let place = row.position().cloned().unwrap_or_else(::csv::Position::new);
            rows.push((place, row));
            if rows.len() > MOST {
                return Err(Error::new(format!("it has more than {MOST} rows; cut it into parts")));
            }
        }
        let is_header = |row: &::csv::StringRecord| {
            row.iter().all(|cell| cell.parse::<f64>().is_err()) && row.iter().any(|cell| !cell.is_empty())
        };
        let header = match rows.first() {
            Some((_, row)) if is_header(row) => rows.remove(0).1.iter().map(str::to_owned).collect(),
            _ => Vec::new(),
        };
        let mut table = Self { name: name.to_owned(), header, rows, separator, is_udacity: false };
        let log = table.rows.first().is_some_and(|(_, row)| {
            row.len() == UDACITY.len()
                && row.iter().take(3).all(|cell| crate::listing::is_picture(Path::new(cell)))
                && row.iter().skip(3).all(|cell| cell.parse::<f64>().is_ok())
        });
        let named =
            table.header.iter().map(|name| plain(name)).eq(UDACITY.iter().map(|name| (*name).to_owned()));
        table.is_udacity = log && (table.header.is_empty() || named);
        if table.is_udacity {
            table.header = UDACITY.iter().map(|name| (*name).to_owned()).collect();
        }
        match table.rows.is_empty() {
            true => Err(Error::new("it has no rows")),
            false => Ok(table),
        }
    }

    /// How many rows it has.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// A cell of a row; empty if the row is shorter.
    pub fn cell(&self, row: usize, column: usize) -> &str {
        self.rows.get(row).and_then(|(_, row)| row.get(column)).unwrap_or_default()
    }

    /// Names the place of a row.
    pub fn place(&self, row: usize) -> String {
        let line = self.rows.get(row).map_or(0, |(place, _)| place.line());
        format!("{} line {line}", self.name.display())
    }

    /// How a column is called.
    pub fn title(&self, column: usize) -> String {
        match self.header.get(column) {
            Some(name) => format!("column `{name}`"),
            None => format!("column {}", column + 1),
        }
    }

    /// Finds the columns: those that the configuration names, and the others by their names.
    ///
    /// # Errors
    /// If there is no column of a name that the configuration gives.
    pub fn columns(&self, config: &Config) -> Result<Columns> {
        let find = |what: &str| -> Result<Option<usize>> {
            let given = config.text(what);
            if given == "none" || config.value(what).is_null() {
                return Ok(None);
            }
            if !given.is_empty() {
                return self.named(given).map(Some);
            }
            let names = KNOWN.iter().find(|(known, _)| *known == what).map_or(&[][..], |(_, names)| names);
            let header: Vec<String> = self.header.iter().map(|name| plain(name)).collect();
            Ok(names.iter().find_map(|name| header.iter().position(|title| title == name)))
        };
        Ok(Columns {
            image: find("image")?,
            frame: find("frame")?,
            timestamp: find("timestamp")?,
            steering: find("steering")?,
            throttle: find("throttle")?,
            brake: find("brake")?,
            speed: find("speed")?,
        })
    }

    pub(crate) fn named(&self, given: &str) -> Result<usize> {
        if let Some(place) = self.header.iter().position(|name| name == given) {
            return Ok(place);
        }
        let width = self.rows.iter().map(|(_, row)| row.len()).max().unwrap_or_default();
        match given.parse::<usize>() {
            Ok(number) if (1..=width).contains(&number) => Ok(number - 1),
            _ => Err(Error::new(format!(
                "`{}` has no column `{given}`; {}",
                self.name.display(),
                match self.header.is_empty() {
                    true => format!("it has no header, so name columns by numbers from 1 to {width}"),
                    false => format!("its columns are {}", self.header.join(", ")),
                }
            ))),
        }
    }

    /// What was recorded in each row, and what is known of the columns.
    ///
    /// # Errors
    /// If the steering goes beyond what the units say.
    pub fn labels(&self, columns: &Columns, units: &Units) -> Result<Labels> {
        let mut told = Vec::new();
        let mut tell = |what: &str, column: Option<usize>, how: String| {
            let how = if how.is_empty() { how } else { format!(", {how}") };
            told.push((
                what.to_owned(),
                column.map_or("not recorded".to_owned(), |column| self.title(column) + &how),
            ));
        };
        let steering = columns.steering.map(|column| self.range(column)).filter(|(low, high)| low <= high);
        let how = match steering {
            Some((low, high)) => units.describe_steering(low, high)?,
            None => String::new(),
        };
        tell("steering", columns.steering, how);
        tell("throttle", columns.throttle, String::new());
        if columns.brake.is_some() {
            tell("brake", columns.brake, "counted against the throttle".to_owned());
        }
        tell("speed", columns.speed, format!("in {}", units.speed_name()));
        let labels = (0..self.len()).map(|row| {
            let value = |what: &str, column: Option<usize>| match column {
                None => Ok(f64::NAN),
                Some(column) => self.number(row, column).map_err(|error| error.at(what)),
            };
            Ok(Label {
                steering: units.steering(value("steering", columns.steering)?),
                throttle: pedals(value("throttle", columns.throttle)?, value("brake", columns.brake)?)
                    .map_err(|error| error.at(self.place(row)))?,
                speed: units.speed(value("speed", columns.speed)?),
            })
        });
        Ok((labels.collect(), told))
    }

    /// The smallest and the largest number of a column; what is not a number does not count.
    fn range(&self, column: usize) -> (f64, f64) {
        let numbers = (0..self.len()).filter_map(|row| self.cell(row, column).parse::<f64>().ok());
        range(numbers.filter(|number| number.is_finite()))
    }

    /// A number; not a number if the cell is empty.
    ///
    /// # Errors
    /// If it holds something else.
    pub fn number(&self, row: usize, column: usize) -> Result<f64> {
        match self.cell(row, column) {
            "" => Ok(f64::NAN),
            cell => match cell.parse::<f64>() {
                Ok(number) if number.is_finite() => Ok(number),
                _ => Err(Error::new(format!(
                    "{}: {} holds `{}`, which is not a number",
                    self.place(row),
                    self.title(column),
                    cell.chars().take(40).collect::<String>()
                ))),
            },
        }
    }

    /// The time of each row; none if there is no such column.
    pub fn times(&self, columns: &Columns, config: &Config) -> Option<Times> {
        let column = columns.timestamp?;
        let (unit, scale) = match config.text("time_unit") {
            "auto" => self.guess_unit(column),
            given => UNITS.into_iter().find(|(name, _)| *name == given).unwrap_or(UNITS[0]),
        };
        // Counted from the first before it is scaled: the time since 1970 in nanoseconds has more digits than a number holds.
        let whole = |row: usize| self.cell(row, column).parse::<i128>().ok();
        let first = (0..self.len()).find_map(whole);
        let exact = first.filter(|_| (0..self.len()).all(|row| whole(row).is_some()));
        let time = |row: usize| match exact {
            Some(first) => whole(row).map(|time| time.saturating_sub(first) as f64 / scale),
            None => self.number(row, column).ok().filter(|time| !time.is_nan()).map(|time| time / scale),
        };
        let since = (0..self.len()).map(time).collect();
        let begin = exact.map_or(0.0, |first| first as f64 / scale);
        Some(Times { since, begin, how: format!("{}, in {unit}", self.title(column)) })
    }

    fn guess_unit(&self, column: usize) -> (&'static str, f64) {
        let title = self.header.get(column).map(|name| name.trim().to_lowercase()).unwrap_or_default();
        let by_name =
            [("ms", 1), ("milliseconds", 1), ("us", 2), ("microseconds", 2), ("ns", 3), ("nanoseconds", 3)];
        let ends = |ending: &str| {
            title == ending
                || title.ends_with(&format!("_{ending}"))
                || title.ends_with(&format!("({ending})"))
        };
        // Such as `timestampMs` and `timestamp [ms]`.
        let short = plain(&title);
        let is_time_in = |unit: &str| {
            short.strip_suffix(unit).is_some_and(|stem| ["timestamp", "time", "stamp"].contains(&stem))
        };
        if let Some((_, place)) = by_name.into_iter().find(|(unit, _)| ends(unit) || is_time_in(unit)) {
            return UNITS[place];
        }
        // The time since 1970 has another size in each unit.
        let (_, highest) = self.range(column);
        match highest {
            time if time > 1e17 => UNITS[3],
            time if time > 1e14 => UNITS[2],
            time if time > 1e11 => UNITS[1],
            _ => UNITS[0],
        }
    }
}

/// Units of time, with how many a second has.
const UNITS: [(&str, f64); 4] = [("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9)];

/// A name without what people write differently.
fn plain(name: &str) -> String {
    name.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect()
}

/// The CSV file of a folder: the one that the configuration names, or the only one.
///
/// # Errors
/// If there are several, and none is named.
pub fn only_table(folder: &Path, config: &Config) -> Result<Option<PathBuf>> {
    let given = config.text("table");
    if !given.is_empty() {
        return Ok(Some(PathBuf::from(given)));
    }
    let mut tables = crate::listing::names(folder)?;
    tables.retain(|name| crate::listing::ends_in(name, &["csv"]));
    match &tables[..] {
        [] => Ok(None),
        [table] => Ok(Some(table.clone())),
        [first, ..] => Err(Error::new(format!(
            "it has {} CSV files; name the one with the labels by `table`, such as `table={}`",
            tables.len(),
            first.display()
        ))),
    }
}

#[cfg(test)]
#[path = "table_tests.rs"]
mod tests;
