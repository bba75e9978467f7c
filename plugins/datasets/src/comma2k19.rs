//! The layout of comma2k19: a folder for each minute of a route, with a stream of H.265 and arrays of numpy.
//!
//! ```text
//! Chunk_1/b0c9d2329ad1606b|2018-08-02--08-34-47/40/video.hevc
//!                                                  global_pose/frame_times
//!                                                  processed_log/CAN/steering_angle/{t,value}
//!                                                  processed_log/CAN/speed/{t,value}
//! ```
//!
//! All times count from the start of the device, so minutes of a route that follow each other are one sequence.

use std::path::{Path, PathBuf};

use pdk_sdk::error::Place as _;
use pdk_sdk::file;
use pdk_sdk::prelude::*;
use pdk_truth::npy;
use pdk_video::Video;

use crate::inside::Inside;
use crate::label::{Label, range};
use crate::listing::names;
use crate::place::{Named, beyond, not_listed, unsuitable};
use crate::reel::{self, Reel};
use crate::video::nearest;

/// The video of a segment, which marks its folder.
pub const VIDEO: &str = "video.hevc";
/// When the frames of the video were taken.
const TIMES: &str = "global_pose/frame_times";
const STEERING: &str = "processed_log/CAN/steering_angle";
const SPEED: &str = "processed_log/CAN/speed";
/// Folders between the one that is named and a segment: those of all chunks, a chunk, a route.
const DEEPEST: usize = 3;
/// Bytes of an array.
const LARGEST_ARRAY: u64 = 1 << 28;
/// How the steering is recorded, for people.
const UNIT: &str = "degrees of the steering wheel";

/// Reads segments of comma2k19.
pub struct Comma2k19 {
    folder: Inside,
    root: PathBuf,
    segments: Vec<Segment>,
    /// Where the frames of each segment begin, and the number of all.
    starts: Vec<usize>,
    labels: Vec<Result<Label>>,
    told: Vec<(String, String)>,
    reel: Reel,
}

/// A minute of a route.
struct Segment {
    /// Its folder in the one that was named.
    name: PathBuf,
    /// The number of its route.
    route: u64,
    /// When its frames were taken, in seconds after the first frame of the route.
    times: Vec<f64>,
}

/// Numbers with their times, in the order of these.
type Series = Vec<(f64, f64)>;

impl Component for Comma2k19 {
    fn description() -> Description {
        let doc = "Reads comma2k19: folders of segments with video.hevc and arrays of numpy";
        let full_lock = "the recorded angle that is full steering to the right, in degrees of the steering wheel, such as -450; \
                         negative because the log counts to the left. It has to be set";
        Description::dataset("comma2k19", doc)
            .version(2)
            .source("Schafer, Santana, Haden and Biasini, A Commute in Data: The comma2k19 Dataset (2018)")
            .parameter(Parameter::path(
                "path",
                "the folder of a segment, of a route, of a chunk, or of all chunks",
            ))
            .parameter(Parameter::number("full_lock", 0.0, full_lock))
            .parameter(
                Parameter::number("tolerance", 0.05, "how far a message of the car may be from its frame")
                    .range(0.0, 1e6)
                    .unit("s"),
            )
    }

    fn new(config: &Config) -> Result<Self> {
        let path = Path::new(config.text("path"));
        let Named { folder, path: root, file: None } = Named::new(path)? else {
            return Err(unsuitable("it is not a folder with segments of comma2k19"));
        };
        let mut found = Vec::new();
        find(&root, Path::new(""), DEEPEST, &mut found)?;
        if found.is_empty() {
            return Err(unsuitable(format_args!(
                "it has no folder with {VIDEO} and {TIMES}, as comma2k19 has"
            )));
        }
        Self::of_segments(config, folder, root, found)
            .map_err(|error| error.at(format_args!("comma2k19 `{}`", path.display())))
    }

    fn input_files(config: &Config) -> Result<Vec<InputFiles>> {
        let Self { folder, segments, .. } = Self::new(config)?;
        let arrays =
            [STEERING, SPEED].iter().flat_map(|name| ["t", "value"].map(|part| format!("{name}/{part}")));
        let names: Vec<String> = [VIDEO, TIMES].map(str::to_owned).into_iter().chain(arrays).collect();
        let of_segment =
            |segment: &Segment| names.iter().map(|name| segment.name.join(name)).collect::<Vec<_>>();
        let all = segments.iter().flat_map(of_segment).filter(|name| folder.path(name).is_ok());
        let all: Vec<PathBuf> = all.collect();
        Ok(vec![folder.input_files(all)])
    }
}

/// The folders of segments in a folder.
fn find(root: &Path, inside: &Path, deeper: usize, found: &mut Vec<PathBuf>) -> Result<()> {
    let here = root.join(inside);
    if here.join(VIDEO).is_file() && here.join(TIMES).is_file() {
        found.push(inside.to_owned());
        return Ok(());
    }
    if deeper == 0 {
        return Ok(());
    }
    for name in names(&here)? {
        if here.join(&name).is_dir() {
            find(root, &inside.join(&name), deeper - 1, found)?;
        }
    }
    Ok(())
}

impl Comma2k19 {
    fn of_segments(config: &Config, folder: Inside, root: PathBuf, found: Vec<PathBuf>) -> Result<Self> {
        let tolerance = config.number("tolerance");
        let mut segments: Vec<Segment> = Vec::new();
        let (mut starts, mut steering, mut raw) = (vec![0], Vec::new(), Vec::new());
        let (mut route, mut origin) = (0, 0.0);
        for name in found {
            let times = array(&folder, &name.join(TIMES))?;
            let Some(&first) = times.first() else {
                return Err(Error::new(format!(
                    "`{}` has no frames; copy it again",
                    name.join(TIMES).display()
                )));
            };
            match segments.last() {
                Some(before) if before.name.parent() == name.parent() => {}
                before => (route, origin) = (before.map_or(0, |_| route + 1), first),
            }
            let steerings = series(&folder, &name.join(STEERING))?;
            let speeds = series(&folder, &name.join(SPEED))?;
            if let Some(all) = &steerings {
                steering.extend(all.iter().map(|(_, angle)| *angle));
            }
            for time in &times {
                raw.push((value(&steerings, *time, tolerance), value(&speeds, *time, tolerance)));
            }
            let times: Vec<f64> = times.into_iter().map(|time| time - origin).collect();
            starts.push(starts.last().copied().unwrap_or_default() + times.len());
            segments.push(Segment { name, route, times });
        }
        let (full_lock, told) = full_lock(config.number("full_lock"), &steering)?;
        let labels = raw.into_iter().map(|(steering, speed)| {
            Ok(Label { steering: steering? / full_lock, throttle: f64::NAN, speed: speed? })
        });
        let frames = format!(
            "{} in {} segments of {} routes, H.265 decoded by ffmpeg",
            labels.len(),
            segments.len(),
            route + 1
        );
        let told = [("frames", frames), ("steering", told), ("speed", "in m/s, if recorded".to_owned())];
        Ok(Self {
            labels: labels.collect(),
            folder,
            root,
            segments,
            starts,
            told: told.map(|(name, what)| (name.to_owned(), what)).into(),
            reel: Reel::default(),
        })
    }

    /// The number of the segment of a frame, and that of the frame in it.
    fn place(&self, index: usize) -> Option<(usize, usize)> {
        let number = self.starts.partition_point(|start| *start <= index).checked_sub(1)?;
        (number < self.segments.len()).then(|| (number, index - self.starts[number]))
    }
}

/// The recorded steering that is full steering to the right, and what the reader reports about it.
fn full_lock(given: f64, recorded: &[f64]) -> Result<(f64, String)> {
    if recorded.is_empty() {
        return Ok((1.0, "not recorded".to_owned()));
    }
    let (low, high) = range(recorded.iter().copied());
    let range = format!("{low} to {high} {UNIT}");
    if given == 0.0 {
        return Err(Error::new(format!(
            "the recorded steering is {range}, counted to the left; set `full_lock` to the angle that is full steering to the right, such \
             as -450 for a wheel that turns by 450 degrees to each side"
        )));
    }
    match [low, high].into_iter().find(|angle| (angle / given).abs() > 1.0) {
        Some(angle) => Err(Error::new(format!(
            "the recorded steering is {range}, and {angle} is beyond full_lock = {given}; set `full_lock` to a larger angle, negative because \
             the log counts to the left"
        ))),
        None => Ok((given, format!("{range}, divided by full_lock = {given}"))),
    }
}

fn array(folder: &Inside, name: &Path) -> Result<Vec<f64>> {
    let path = folder.path(name)?;
    let bytes = file::read(&path, LARGEST_ARRAY).place(format_args!("cannot read `{}`", path.display()))?;
    Ok(npy::read(&bytes).place(format_args!("`{}`", path.display()))?.values)
}

/// What the car said, with the times; none if it was not recorded.
fn series(folder: &Inside, name: &Path) -> Result<Option<Series>> {
    let (times, values) = (name.join("t"), name.join("value"));
    if folder.path(&times).is_err() && folder.path(&values).is_err() {
        return Ok(None);
    }
    let (times, values) = (array(folder, &times)?, array(folder, &values)?);
    if times.len() != values.len() {
        return Err(Error::new(format!(
            "`{}` has {} times and {} values; copy it again",
            name.display(),
            times.len(),
            values.len()
        )));
    }
    let mut series: Series =
        times.into_iter().zip(values).filter(|(time, value)| (time + value).is_finite()).collect();
    series.sort_by(|a, b| a.0.total_cmp(&b.0));
    Ok(Some(series))
}

/// The value nearest to a time; not a number if it was not recorded at all.
fn value(series: &Option<Series>, time: f64, tolerance: f64) -> Result<f64> {
    let Some(series) = series else { return Ok(f64::NAN) };
    nearest(series, time, tolerance).ok_or_else(|| {
        Error::new(format!("the car said nothing within {tolerance} s of this frame; set `tolerance`"))
    })
}

impl Dataset for Comma2k19 {
    fn len(&self) -> usize {
        self.labels.len()
    }

    fn name(&self, index: usize) -> String {
        let name = |(segment, frame): (usize, usize)| {
            format!("{} frame {frame}", self.segments[segment].name.join(VIDEO).display())
        };
        self.place(index).map(name).unwrap_or_default()
    }

    fn read(&mut self, index: usize) -> Result<Entry> {
        let label = self.labels.get(index).cloned().ok_or_else(|| beyond(index, self.labels.len()))??;
        let (segment, frame) = self.place(index).ok_or_else(|| beyond(index, self.labels.len()))?;
        let segment = &self.segments[segment];
        let (path, time) = (self.folder.path(&segment.name.join(VIDEO))?, segment.times[frame]);
        let open = || stream(&path, segment);
        let picture = self.reel.read(&path, open, |_| Ok(frame as u32))?;
        Ok(Entry {
            frame: picture,
            steering: label.steering,
            throttle: label.throttle,
            time,
            speed: label.speed,
        })
    }

    fn position(&self, index: usize) -> Position {
        match self.place(index) {
            Some((segment, frame)) => {
                let segment = &self.segments[segment];
                Position { part: segment.route, number: index as u64, time: segment.times[frame] }
            }
            None => Position { part: 0, number: index as u64, time: f64::NAN },
        }
    }

    fn info(&self) -> Vec<(String, String)> {
        self.told.clone()
    }

    fn form(&self) -> Result<Option<Form>> {
        let mut files = Vec::new();
        // All have the same codec.
        let mut stored = None;
        for segment in &self.segments {
            let name = segment.name.join(VIDEO);
            let stored = match &mut stored {
                Some(stored) => stored,
                none => none.insert(stream(&self.folder.path(&name)?, segment)?.recoding()?.describe()),
            };
            let name = name.to_string_lossy().into_owned();
            files.push(FormFile { name, frames: segment.times.len(), stored: stored.clone() });
            let steering = segment.name.join(STEERING).join("value");
            if self.folder.path(&steering).is_ok() {
                let name = steering.to_string_lossy().into_owned();
                files.push(FormFile { name, frames: 0, stored: String::new() });
            }
        }
        let undropped = Some("they are arrays beside others that need them".to_owned());
        Ok(Some(Form { folder: self.root.clone(), files, whole: true, undropped, ..Form::default() }))
    }

    fn rewrite(&mut self, wanted: &Rewrite, perturb: &mut Perturb<'_>) -> Result<()> {
        let own = |segment: &Segment| Path::new(&wanted.file).starts_with(&segment.name);
        let number = self.segments.iter().position(own).ok_or_else(|| not_listed(&wanted.file))?;
        let (segment, start) = (&self.segments[number], self.starts[number]);
        if segment.name.join(VIDEO) == Path::new(&wanted.file) {
            let mut video = stream(&self.folder.path(Path::new(&wanted.file))?, segment)?;
            return reel::rewrite(&mut video, &wanted.into, None, &|frame| start + frame as usize, perturb);
        }
        let value = Path::new(&wanted.file);
        if value != segment.name.join(STEERING).join("value") {
            return Err(not_listed(&wanted.file));
        }
        // Times of the car count from the start of the device, those of the frames from the first frame of the route.
        let frames = array(&self.folder, &segment.name.join(TIMES))?;
        let times = array(&self.folder, &segment.name.join(STEERING).join("t"))?;
        let mirrored = |number: usize| {
            let time = times.get(number).copied().unwrap_or_default();
            let behind = frames.partition_point(|frame| *frame < time);
            let around = behind.saturating_sub(1)..(behind + 1).min(frames.len());
            let near = |frame: &usize| (frames[*frame] - time).abs();
            let nearest = around.min_by(|a, b| near(a).total_cmp(&near(b)));
            wanted.mirrors(start + nearest.unwrap_or_default())
        };
        let path = self.folder.path(value)?;
        let content =
            file::read(&path, LARGEST_ARRAY).place(format_args!("cannot read `{}`", path.display()))?;
        Ok(std::fs::write(&wanted.into, npy::with_other_sign(&content, &mirrored)?)?)
    }
}

/// The video of a segment.
fn stream(path: &Path, segment: &Segment) -> Result<Video> {
    Video::with_times(path, "a stream of H.265", ends(&segment.times))
}

/// Times of frames after the first one, and when the last one ends, which is as late as if it lasted as long as the one before it.
fn ends(times: &[f64]) -> Vec<f64> {
    let first = times.first().copied().unwrap_or_default();
    let last = times.last().copied().unwrap_or_default();
    let step = times.len().checked_sub(2).map_or(0.05, |before| last - times[before]);
    times.iter().map(|time| time - first).chain([last - first + step]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::config;
    use pdk_sdk::serde_json::{Value, json};
    use tempfile::TempDir;

    /// An array as numpy writes it.
    fn save(path: &Path, values: &[f64]) {
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        let mut head = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({},), }}", values.len());
        head += &" ".repeat(63 - (10 + head.len()) % 64);
        head.push('\n');
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((head.len() as u16).to_le_bytes());
        bytes.extend(head.as_bytes());
        bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
        std::fs::write(path, bytes).unwrap();
    }

    /// A chunk of two routes, the first with two segments; the videos have no frames.
    fn chunk() -> TempDir {
        let dir = TempDir::new().unwrap();
        for (segment, start) in [("a|1/9", 100.0), ("a|1/10", 100.2), ("b|2/0", 7.0)] {
            let folder = dir.path().join(segment);
            let times: Vec<f64> = (0..4).map(|number| start + f64::from(number) * 0.05).collect();
            save(&folder.join(TIMES), &times);
            save(&folder.join(STEERING).join("t"), &times);
            save(&folder.join(STEERING).join("value"), &[-90.0, 0.0, 45.0, 1.0]);
            std::fs::write(folder.join(VIDEO), "").unwrap();
        }
        dir
    }

    fn open(path: &Path, given: Value) -> Result<Comma2k19> {
        let mut given = given;
        given["path"] = json!(path);
        Comma2k19::new(&config::<Comma2k19>(given))
    }

    #[test]
    fn segments_of_a_route_follow_each_other_in_the_order_of_their_numbers() {
        let dir = chunk();
        let all = open(dir.path(), json!({"full_lock": -450})).unwrap();
        assert_eq!((all.len(), all.name(5).as_str()), (12, "a|1/10/video.hevc frame 1"));
        let position = |index| (all.position(index).part, (all.position(index).time * 100.0).round());
        assert_eq!([0, 3, 4, 8, 11].map(position), [(0, 0.0), (0, 15.0), (0, 20.0), (1, 0.0), (1, 15.0)]);
        let steering = |index: usize| all.labels[index].as_ref().unwrap().steering;
        assert_eq!([0, 1, 2].map(steering), [0.2, 0.0, -0.1]);
        assert!(all.labels[0].as_ref().unwrap().speed.is_nan());
        let told = all.info()[1].1.clone();
        assert_eq!(told, "-90 to 45 degrees of the steering wheel, divided by full_lock = -450");
        let files =
            Comma2k19::input_files(&config::<Comma2k19>(json!({"path": dir.path(), "full_lock": -450})));
        assert_eq!(files.unwrap()[0].names.len(), 12);
        assert_eq!(open(&dir.path().join("a|1/10"), json!({"full_lock": -450})).unwrap().len(), 4);
    }

    #[test]
    fn the_angle_of_full_steering_has_to_be_given() {
        let dir = chunk();
        let error = |given| open(dir.path(), given).err().unwrap();
        assert_eq!(error(json!({})).kind(), ErrorKind::Failed);
        assert!(error(json!({})).message().contains("set `full_lock` to the angle"), "{}", error(json!({})));
        assert!(error(json!({"full_lock": -45})).message().contains("-90 is beyond full_lock = -45"));
        let other = TempDir::new().unwrap();
        assert_eq!(open(other.path(), json!({})).err().unwrap().kind(), ErrorKind::Unsuitable);
    }

    #[test]
    fn arrays_that_do_not_fit_are_named() {
        let dir = chunk();
        save(&dir.path().join("a|1/9").join(STEERING).join("value"), &[1.0]);
        let error = open(dir.path(), json!({"full_lock": -450})).err().unwrap();
        assert!(error.message().contains("steering_angle` has 4 times and 1 values"), "{error}");
    }
}
