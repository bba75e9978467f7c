//! Videos, with what was recorded in a CSV file beside them, by the number of the frame or by time; or without labels.

use std::path::{Path, PathBuf};

use pdk_sdk::prelude::*;
use pdk_video::{Video as Decoder, Yuv420};

use crate::inside::Inside;
use crate::label::{Label, Units};
use crate::listing::{ends_in, is_picture, names};
use crate::place::{Named, beyond, not_listed, unsuitable};
use crate::reel;
use crate::table::{Columns, Table, Times, only_table};

/// How the names of videos end.
const ENDINGS: [&str; 8] = ["mp4", "mov", "m4v", "mkv", "webm", "avi", "qt", "mp4v"];

/// Reads a video.
pub struct Video {
    folder: Inside,
    root: PathBuf,
    name: PathBuf,
    /// Whether the video was named, and not its folder.
    is_named: bool,
    table: Option<Log>,
    decoder: Decoder,
    picture: Yuv420,
    labels: Vec<Result<Label>>,
    told: Vec<(String, String)>,
}

/// What was recorded beside a video.
struct Log {
    table: Table,
    /// The column with the steering.
    steering: Option<usize>,
    /// The row of each frame.
    rows: Vec<Option<usize>>,
}

impl Component for Video {
    fn description() -> Description {
        let doc = "Reads a video, with labels from a CSV file beside it or without";
        let offset = "what is added to the times of the CSV file, so that 0 is the first frame; with `auto` its first row is the first \
                      frame if its times do not begin within the video";
        let description = Description::dataset("video", doc)
            .version(2)
            .parameter(Parameter::path("path", "the video, or a folder with one"))
            .parameter(Parameter::text("offset", offset).unit("s"))
            .parameter(
                Parameter::number("tolerance", 0.05, "how far a row may be from its frame, with time stamps")
                    .range(0.0, 1e6)
                    .unit("s"),
            )
            .parameter(Parameter::text(
                "first_frame",
                "the number of the first frame in the CSV file, 0 or 1; guessed if it is not set",
            ));
        let parameters = Table::parameters(&["frame"]).into_iter().chain(Units::parameters("m/s"));
        parameters.fold(description, Description::parameter)
    }

    fn new(config: &Config) -> Result<Self> {
        let path = Path::new(config.text("path"));
        let Named { folder, path: root, file } = Named::new(path)?;
        let place = format!("video `{}`", path.display());
        let is_named = file.is_some();
        let name = match file {
            Some(file) if ends_in(&file, &ENDINGS) => file,
            Some(_) => return Err(unsuitable("its name does not end as that of a video")),
            None => only_video(&root)?,
        };
        let decoder =
            folder.path(&name).and_then(|path| Decoder::open(&path)).map_err(|error| error.at(&place))?;
        let table = match (is_named, config.text("table").is_empty()) {
            // Beside a video that is named lie others, perhaps, with tables of their own.
            (true, true) => Some(name.with_extension("csv")).filter(|table| root.join(table).is_file()),
            _ => only_table(&root, config).map_err(|error| error.at(&place))?,
        };
        let mut video = Self {
            folder,
            root,
            name,
            is_named,
            labels: vec![Ok(Label::NONE); decoder.count() as usize],
            told: vec![("frames".to_owned(), format!("{}, {}", decoder.count(), decoder.decoder()))],
            decoder,
            table: None,
            picture: Yuv420::default(),
        };
        match table {
            Some(table) => video.label(config, &table).map_err(|error| error.at(&place))?,
            None => video.told.push((
                "labels".to_owned(),
                "none, because there is no CSV file beside the video".to_owned(),
            )),
        }
        Ok(video)
    }

    fn input_files(config: &Config) -> Result<Vec<InputFiles>> {
        let Self { folder, name, table, .. } = Self::new(config)?;
        Ok(vec![folder.input_files([name].into_iter().chain(table.map(|log| log.table.name)))])
    }
}

impl Video {
    /// Takes the labels from a CSV file.
    fn label(&mut self, config: &Config, name: &Path) -> Result<()> {
        let table = Table::read(&self.folder, name)?;
        let columns = table.columns(config)?;
        let (labels, told) = table.labels(&columns, &Units::new(config)?)?;
        let (rows, how) = self.rows(config, &table, &columns)?;
        let found = rows.iter().filter(|row| row.is_some()).count();
        if found == 0 {
            return Err(Error::new(format!(
                "no row of `{}` belongs to a frame ({how}); name the column by `frame` or `timestamp`, or set `offset`",
                name.display()
            )));
        }
        self.told.push(("labels".to_owned(), format!("{how}; {found} of {} frames have one", rows.len())));
        self.told.extend(told);
        self.labels = rows.iter().map(|row| row.map_or(Ok(Label::NONE), |row| labels[row].clone())).collect();
        self.table = Some(Log { table, steering: columns.steering, rows });
        Ok(())
    }

    /// The row of each frame, and how it was found.
    fn rows(
        &self,
        config: &Config,
        table: &Table,
        columns: &Columns,
    ) -> Result<(Vec<Option<usize>>, String)> {
        let count = self.decoder.count() as usize;
        let mut rows = vec![None; count];
        if let Some(column) = columns.frame {
            let numbers: Vec<Option<u64>> =
                (0..table.len()).map(|row| table.cell(row, column).parse().ok()).collect();
            if let Some(row) = numbers.iter().position(Option::is_none) {
                return Err(Error::new(format!(
                    "{}: {} holds `{}`, which is not the number of a frame",
                    table.place(row),
                    table.title(column),
                    table.cell(row, column)
                )));
            }
            let known = || numbers.iter().flatten().copied();
            let first = match config.text("first_frame") {
                "" => u64::from(
                    !known().any(|number| number == 0) && known().any(|number| number == count as u64),
                ),
                "0" => 0,
                "1" => 1,
                other => {
                    return Err(Error::new(format!("first_frame is `{other}`; write 0 or 1")));
                }
            };
            for (row, number) in known().enumerate() {
                let place = number.checked_sub(first).and_then(|place| usize::try_from(place).ok());
                if let Some(frame) = place.and_then(|place| rows.get_mut(place)) {
                    *frame = Some(row);
                }
            }
            return Ok((
                rows,
                format!("by the numbers in {}, the first frame being {first}", table.title(column)),
            ));
        }
        if let Some(Times { since, begin, how }) = table.times(columns, config) {
            let times: Vec<_> = since.into_iter().map(|time| Some(begin + time?)).collect();
            let end = self.decoder.time(self.decoder.count());
            let first = times.iter().flatten().copied().reduce(f64::min).unwrap_or_default();
            let offset = match config.text("offset") {
                "" | "auto" if (0.0..=end).contains(&first) => 0.0,
                "" | "auto" => -first,
                given => given
                    .parse::<f64>()
                    .map_err(|_| Error::new(format!("offset is `{given}`; write a number of seconds")))?,
            };
            let mut sorted: Vec<(f64, usize)> = times
                .iter()
                .enumerate()
                .filter_map(|(row, time)| Some((time.as_ref()? + offset, row)))
                .collect();
            sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
            let tolerance = config.number("tolerance");
            for (frame, row) in rows.iter_mut().enumerate() {
                *row = nearest(&sorted, self.decoder.time(frame as u32), tolerance);
            }
            return Ok((
                rows,
                format!("by the nearest time in {how} plus {offset} s, at most {tolerance} s away"),
            ));
        }
        if table.len() == count {
            return Ok(((0..count).map(Some).collect(), "one row for each frame, in order".to_owned()));
        }
        Err(Error::new(format!(
            "`{}` has {} rows for {count} frames, and no column with numbers of frames or times; name it by `frame` or `timestamp`",
            table.name.display(),
            table.len()
        )))
    }
}

/// Of values with their times in order, the nearest to a time that is not too far away.
pub fn nearest<T: Copy>(sorted: &[(f64, T)], time: f64, tolerance: f64) -> Option<T> {
    let behind = sorted.partition_point(|(at, _)| *at < time);
    let around = sorted[behind.saturating_sub(1)..(behind + 1).min(sorted.len())].iter();
    let near = around.min_by(|a, b| (a.0 - time).abs().total_cmp(&(b.0 - time).abs()))?;
    // A time in seconds is not exact to the last digit.
    ((near.0 - time).abs() <= tolerance + 1e-9).then_some(near.1)
}

/// The video of a folder.
fn only_video(root: &Path) -> Result<PathBuf> {
    let names = names(root)?;
    let videos: Vec<&PathBuf> = names.iter().filter(|name| ends_in(name, &ENDINGS)).collect();
    match videos[..] {
        [] => Err(unsuitable("it has no video")),
        _ if names.iter().any(|name| is_picture(name)) => Err(unsuitable("it has pictures beside its video")),
        [video] => Ok(video.clone()),
        [first, ..] => Err(Error::new(format!(
            "it has {} videos; name one, such as {}",
            videos.len(),
            root.join(first).display()
        ))),
    }
}

impl Dataset for Video {
    fn len(&self) -> usize {
        self.labels.len()
    }

    fn name(&self, index: usize) -> String {
        format!("{} frame {index}", self.name.display())
    }

    fn read(&mut self, index: usize) -> Result<Entry> {
        let label = self.labels.get(index).cloned().ok_or_else(|| beyond(index, self.labels.len()))??;
        let frame = index as u32;
        self.decoder.seek(frame)?;
        if !self.decoder.next(&mut self.picture)? {
            return Err(Error::new("the video ends before this frame; it is damaged, so copy it again"));
        }
        let mut rgb = FrameBuf::new(self.picture.width, self.picture.height);
        self.picture.to_rgb(rgb.as_mut());
        Ok(Entry {
            frame: rgb,
            steering: label.steering,
            throttle: label.throttle,
            time: self.decoder.time(frame),
            speed: label.speed,
        })
    }

    fn position(&self, index: usize) -> Position {
        Position { part: 0, number: index as u64, time: self.decoder.time(index as u32) }
    }

    fn info(&self) -> Vec<(String, String)> {
        self.told.clone()
    }

    fn form(&self) -> Result<Option<Form>> {
        let name = |name: &Path| name.to_string_lossy().into_owned();
        let stored = self.decoder.recoding()?.describe();
        let mut files = vec![FormFile { name: name(&self.name), frames: self.labels.len(), stored }];
        if let Some(log) = &self.table {
            files.push(FormFile { name: name(&log.table.name), frames: 0, stored: String::new() });
        }
        let mut notes = Vec::new();
        if self.decoder.has_sound() {
            notes.push(format!("the sound of `{}` is left out", self.name.display()));
        }
        let folder = self.root.clone();
        Ok(Some(Form { folder, files, whole: !self.is_named, notes, ..Form::default() }))
    }

    fn rewrite(&mut self, wanted: &Rewrite, perturb: &mut Perturb<'_>) -> Result<()> {
        if wanted.file == self.name.to_string_lossy() {
            return reel::rewrite(&mut self.decoder, &wanted.into, None, &|frame| frame as usize, perturb);
        }
        let Some(Log { table, steering, rows }) =
            self.table.as_ref().filter(|log| wanted.file == log.table.name.to_string_lossy())
        else {
            return Err(not_listed(&wanted.file));
        };
        let text = self.folder.catalog(&table.name)?;
        let written = match steering {
            None => text,
            Some(column) => {
                let frames = frames_of(rows, table.len());
                table.with_other_sign(&text, *column, &|row| wanted.mirrors(frames[row]))?
            }
        };
        Ok(std::fs::write(&wanted.into, written)?)
    }
}

/// The frame of each row of a table; of one that has none, that of the row before it.
fn frames_of(rows: &[Option<usize>], count: usize) -> Vec<usize> {
    let mut frames = vec![None; count];
    for (frame, row) in rows.iter().enumerate() {
        if let Some(own) = row.and_then(|row| frames.get_mut(row)) {
            *own = own.or(Some(frame));
        }
    }
    let mut before = 0;
    let of_row = |frame: Option<usize>| {
        before = frame.unwrap_or(before);
        before
    };
    frames.into_iter().map(of_row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::config;
    use pdk_sdk::serde_json::{Value, json};
    use pdk_video::Writer;
    use tempfile::TempDir;

    /// A video of ten frames at ten a second, each brighter than the one before.
    fn folder(table: Option<&str>) -> TempDir {
        let dir = TempDir::new().unwrap();
        let mut writer = Writer::create(dir.path().join("drive.mp4"), 32, 16, 10.0).unwrap();
        for number in 0..10u8 {
            let frame = FrameBuf::from_vec(vec![20 + 20 * number; 32 * 16 * 3], 32, 16).unwrap();
            writer.push(frame.as_ref()).unwrap();
        }
        writer.finish().unwrap();
        if let Some(table) = table {
            std::fs::write(dir.path().join("drive.csv"), table).unwrap();
        }
        dir
    }

    fn open(dir: &TempDir, given: Value) -> Result<Video> {
        let mut given = given;
        given["path"] = json!(dir.path());
        Video::new(&config::<Video>(given))
    }

    #[test]
    fn frames_are_read_in_any_order_with_their_times() {
        let dir = folder(None);
        let mut video = open(&dir, json!({})).unwrap();
        assert_eq!((video.len(), video.position(5)), (10, Position { part: 0, number: 5, time: 0.5 }));
        for index in [9, 0, 5, 5, 4] {
            let entry = video.read(index).unwrap();
            assert!(entry.frame.data()[0].abs_diff(20 + 20 * index as u8) <= 3, "{index}");
            assert!((entry.time - index as f64 / 10.0).abs() < 1e-9 && entry.steering.is_nan());
        }
        assert!(video.read(10).is_err());
        let files = Video::input_files(&config::<Video>(json!({"path": dir.path()}))).unwrap().remove(0);
        assert_eq!(files.names, [PathBuf::from("drive.mp4")]);
    }

    #[test]
    fn rows_belong_to_frames_by_number_time_or_order() {
        let steering = |table: &str, given: Value| -> Result<Vec<f64>> {
            let mut video = open(&folder(Some(table)), given)?;
            (0..10).map(|index| Ok(video.read(index)?.steering)).collect()
        };
        let by_number = steering("frame,steering\n3,0.3\n0,0.5\n", json!({})).unwrap();
        assert_eq!((by_number[0], by_number[3]), (0.5, 0.3));
        assert!(by_number[1].is_nan());
        let from_one = (1..=10).map(|n| format!("{n},0.{n}\n")).collect::<String>();
        let from_one = steering(&format!("frame,steering\n{from_one}"), json!({})).unwrap();
        assert_eq!((from_one[0], from_one[8]), (0.1, 0.9));
        // The camera began at 1000 s; the rows come at another rate.
        let by_time = steering("time,steering\n1000,0.1\n1000.12,0.2\n1000.33,0.3\n", json!({})).unwrap();
        assert_eq!((by_time[0], by_time[1], by_time[3]), (0.1, 0.2, 0.3));
        assert!(by_time[2].is_nan() && by_time[4].is_nan());
        // Labels that begin within the video belong to its later frames, in whole milliseconds as well.
        for (name, offset) in [("time_ms", json!({})), ("timestampMs", json!({"offset": 0}))] {
            let late = (5..10).map(|n| format!("{n}00,0.{n}\n")).collect::<String>();
            let late = steering(&format!("{name},steering\n{late}"), offset).unwrap();
            assert!(late[..5].iter().all(|label| label.is_nan()), "{name}: {late:?}");
            assert_eq!(late[5..], [0.5, 0.6, 0.7, 0.8, 0.9], "{name}");
        }
        let wide = steering("time,steering\n0,0.1\n", json!({"tolerance": 100})).unwrap();
        assert_eq!(wide, [0.1; 10]);
        let in_order: String = (0..10).map(|n| format!("0.{n}\n")).collect();
        assert_eq!(steering(&format!("steering\n{in_order}"), json!({})).unwrap()[7], 0.7);
        for (table, reason) in [
            ("steering\n0.1\n", "has 1 rows for 10 frames"),
            ("frame,steering\n77,0\n", "no row of `drive.csv` belongs to a frame"),
            ("frame,steering\nx,0\n", "`x`, which is not the number of a frame"),
            ("frame,steering\n1,40\n", "set `full_lock`"),
        ] {
            let error = steering(table, json!({})).unwrap_err().to_string();
            assert!(error.contains(reason), "{error}");
        }
    }
}
