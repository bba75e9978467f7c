//! Recordings of LeRobot, versions 2 and 3: numbers in Parquet files, pictures in videos, and what they are in `meta/info.json`.
//!
//! In version 2 each episode has a file of numbers and a video. In version 3 files hold several episodes, and `meta/episodes` says where the
//! video of each begins.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::{self, Value};
use pdk_video::{Recoding, Video};

use crate::elements::{Element, choose, elements};
use crate::inside::Inside;
use crate::label::{Label, Units, pedals, range};
use crate::listing::{ends_in, names};
use crate::parquet::columns;
use crate::place::{Named, beyond, not_listed, unsuitable};
use crate::reel::{self, Reel};

/// The file that says what a recording of LeRobot holds.
pub const INFO: &str = "meta/info.json";
/// Episodes of version 2 are in folders of this many, if nothing else is said.
const CHUNK: u64 = 1000;
/// Frames from one that can be decoded alone to the next, as LeRobot writes videos, so that any of them is soon read.
const KEYS: u32 = 2;
/// More episodes than this are not believed.
const MOST: u64 = 1 << 22;
/// The words by which steering, throttle, brake and speed are known.
const WORDS: [(&str, &[&str]); 4] = [
    ("steering", &["steer"]),
    ("throttle", &["throttle", "gas", "accel"]),
    ("brake", &["brake"]),
    ("speed", &["speed"]),
];

/// Reads a recording of LeRobot.
pub struct LeRobot {
    folder: Inside,
    frames: Vec<Frame>,
    videos: Vec<PathBuf>,
    /// The files besides the videos.
    files: Vec<PathBuf>,
    camera: String,
    /// Other features with videos.
    others: Vec<String>,
    root: PathBuf,
    /// Frames a second.
    rate: f64,
    told: Vec<(String, String)>,
    reel: Reel,
}

struct Frame {
    episode: u64,
    /// Its number in the episode.
    number: u64,
    /// Seconds since the episode began.
    time: f64,
    label: Result<Label>,
    /// The number of its video.
    video: usize,
    /// Its time in the video.
    at: f64,
}

impl Component for LeRobot {
    fn description() -> Description {
        let doc = "Reads a recording of LeRobot: meta/info.json, Parquet files and videos";
        let element = |name: &str, what: &str| {
            let doc = format!(
                "the {what}: a feature, or FEATURE:NAME or FEATURE:NUMBER for one of its numbers, such as action:0; found by its name if it \
                 is not set, and `none` for none"
            );
            Parameter::text(name, &doc)
        };
        let description = Description::dataset("lerobot", doc)
            .version(2)
            .source("LeRobot, LeRobotDataset of versions 2.0, 2.1 and 3.0")
            .parameter(Parameter::path("path", "the folder"))
            .parameter(Parameter::text(
                "camera",
                "the feature with the pictures; found by its type if it is not set",
            ))
            .parameter(element("steering", "steering"))
            .parameter(element("throttle", "throttle"))
            .parameter(element("brake", "brake, which counts against the throttle"))
            .parameter(element("speed", "speed"));
        Units::parameters("m/s").into_iter().fold(description, Description::parameter)
    }

    fn new(config: &Config) -> Result<Self> {
        let path = Path::new(config.text("path"));
        let Named { folder, path: root, file: None } = Named::new(path)? else {
            return Err(unsuitable("it is not the folder of a recording of LeRobot"));
        };
        if !root.join(INFO).is_file() {
            return Err(unsuitable(format_args!("it has no {INFO}, as a recording of LeRobot has")));
        }
        Self::of_folder(config, folder, &root)
            .map_err(|error| error.at(format_args!("LeRobot recording `{}`", path.display())))
    }

    fn input_files(config: &Config) -> Result<Vec<InputFiles>> {
        let Self { folder, videos, files, .. } = Self::new(config)?;
        Ok(vec![folder.input_files(files.into_iter().chain(videos))])
    }
}

/// Where the pictures of an episode are: the video, and when they begin in it.
type Begin = (PathBuf, f64);

impl LeRobot {
    fn of_folder(config: &Config, folder: Inside, root: &Path) -> Result<Self> {
        let text = folder.record(Path::new(INFO))?;
        let info: Value = serde_json::from_str(&text)
            .map_err(|error| Error::new(format!("{INFO} is not JSON ({error}); copy it again")))?;
        let rate = info["fps"].as_f64().filter(|rate| *rate > 0.0);
        let rate = rate.ok_or_else(|| Error::new(format!("{INFO} has no `fps`; copy it again")))?;
        let version =
            info["codebase_version"].as_str().unwrap_or_default().trim_start_matches('v').to_owned();
        let camera = camera(&info, config.text("camera"))?;
        let mut files = vec![PathBuf::from(INFO)];
        let (tables, begins) = match version.split('.').next() {
            Some("2") => of_version_2(&info, &camera)?,
            Some("3") => of_version_3(&folder, root, &info, &camera, &mut files)?,
            _ => {
                return Err(Error::new(format!(
                    "it is of version `{version}`, and versions 2 and 3 are read; convert it with LeRobot"
                )));
            }
        };
        files.extend(tables.iter().cloned());

        let known = elements(&info["features"]);
        let chosen = WORDS.map(|(what, words)| choose(&known, config.text(what), what, words));
        let [steering, throttle, brake, speed] = chosen;
        let chosen = [steering?, throttle?, brake?, speed?];
        let mut wanted = vec!["episode_index", "frame_index", "timestamp"];
        for element in chosen.iter().flatten() {
            if !wanted.contains(&&*element.feature) {
                wanted.push(&element.feature);
            }
        }
        let place = |element: &Element| wanted.iter().position(|name| *name == element.feature);
        let mut raw: Vec<(u64, u64, f64, [f64; 4])> = Vec::new();
        for table in &tables {
            for row in columns(&folder.path(table)?, &wanted)? {
                let first = |place: usize| row[place].first().copied().unwrap_or(f64::NAN);
                let values = chosen.each_ref().map(|element| {
                    let value = element
                        .as_ref()
                        .and_then(|element| row[place(element)?].get(element.number).copied());
                    value.unwrap_or(f64::NAN)
                });
                raw.push((first(0) as u64, first(1) as u64, first(2), values));
            }
        }
        let units = Units::new(config)?;
        let told = told(&raw, &chosen, &units, &camera, begins.len())?;
        let mut videos: Vec<PathBuf> = Vec::new();
        let mut numbers: BTreeMap<&PathBuf, usize> = BTreeMap::new();
        let mut frames = Vec::with_capacity(raw.len());
        for (episode, number, time, [steering, throttle, brake, speed]) in raw {
            let Some((video, from)) = begins.get(&episode) else {
                return Err(Error::new(format!(
                    "a frame is of episode {episode}, which has no video; copy it again"
                )));
            };
            let video = *numbers.entry(video).or_insert_with(|| {
                videos.push(video.clone());
                videos.len() - 1
            });
            let label = pedals(throttle, brake).map(|throttle| Label {
                steering: units.steering(steering),
                throttle,
                speed: units.speed(speed),
            });
            frames.push(Frame { episode, number, time, label, video, at: from + time });
        }
        let is_other = |(name, what): &(&String, &Value)| what["dtype"] == "video" && **name != camera;
        let features = info["features"].as_object().into_iter().flatten();
        let others = features.filter(is_other).map(|(name, _)| name.clone()).collect();
        let root = root.to_owned();
        Ok(Self { folder, frames, videos, files, camera, others, root, rate, told, reel: Reel::default() })
    }
}

/// The feature with the pictures.
fn camera(info: &Value, given: &str) -> Result<String> {
    let features = info["features"].as_object();
    let of = |kind: &str| -> Vec<&String> {
        let all = features.into_iter().flatten();
        all.filter(|(_, feature)| feature["dtype"] == kind).map(|(name, _)| name).collect()
    };
    let (videos, pictures) = (of("video"), of("image"));
    if let Some(camera) = videos.iter().find(|name| name.as_str() == given) {
        return Ok((*camera).clone());
    }
    if !given.is_empty() {
        let known: Vec<&str> = videos.iter().map(|name| name.as_str()).collect();
        return Err(Error::new(format!(
            "there is no video `{given}` for `camera`; the videos are {}",
            known.join(", ")
        )));
    }
    let front = videos.iter().find(|name| name.to_lowercase().contains("front"));
    match (front.or(videos.first()), pictures.first()) {
        (Some(camera), _) => Ok((*camera).clone()),
        (None, Some(picture)) => Err(Error::new(format!(
            "its pictures `{picture}` lie within the Parquet files, and pdk reads videos; record it with videos, as LeRobot does unless it is \
             told otherwise"
        ))),
        (None, None) => Err(Error::new(format!("{INFO} names no feature with the `dtype` `video`"))),
    }
}

/// A path of the pattern with numbers in it, as Python would format it.
fn formatted(pattern: &str, camera: &str, numbers: &[(&str, u64)]) -> PathBuf {
    let mut text = pattern.replace("{video_key}", camera);
    for (name, number) in numbers {
        text = text.replace(&format!("{{{name}}}"), &number.to_string());
        for digits in 1..=9 {
            let written = format!("{number:0digits$}");
            text = text.replace(&format!("{{{name}:0{digits}d}}"), &written);
        }
    }
    PathBuf::from(text)
}

fn pattern<'a>(info: &'a Value, name: &str) -> Result<&'a str> {
    info[name].as_str().ok_or_else(|| Error::new(format!("{INFO} has no `{name}`; copy it again")))
}

/// The tables, and where the pictures of each episode begin.
type Layout = (Vec<PathBuf>, BTreeMap<u64, Begin>);

fn of_version_2(info: &Value, camera: &str) -> Result<Layout> {
    let (data, video) = (pattern(info, "data_path")?, pattern(info, "video_path")?);
    let count = info["total_episodes"].as_u64().filter(|count| (1..MOST).contains(count));
    let count =
        count.ok_or_else(|| Error::new(format!("{INFO} does not say how many episodes there are")))?;
    let chunk = info["chunks_size"].as_u64().unwrap_or(CHUNK).max(1);
    let (mut tables, mut begins) = (Vec::new(), BTreeMap::new());
    for episode in 0..count {
        let numbers = [("episode_index", episode), ("episode_chunk", episode / chunk)];
        tables.push(formatted(data, camera, &numbers));
        begins.insert(episode, (formatted(video, camera, &numbers), 0.0));
    }
    Ok((tables, begins))
}

fn of_version_3(
    folder: &Inside,
    root: &Path,
    info: &Value,
    camera: &str,
    files: &mut Vec<PathBuf>,
) -> Result<Layout> {
    let video = pattern(info, "video_path")?;
    let own = ["chunk_index", "file_index", "from_timestamp"].map(|what| format!("videos/{camera}/{what}"));
    let wanted = ["episode_index", &own[0], &own[1], &own[2]];
    let mut begins = BTreeMap::new();
    for table in tables(root, Path::new("meta/episodes"))? {
        for row in columns(&folder.path(&table)?, &wanted)? {
            let [episode, chunk, file, from] =
                [0, 1, 2, 3].map(|place| row[place].first().copied().unwrap_or_default());
            let numbers = [("chunk_index", chunk as u64), ("file_index", file as u64)];
            begins.insert(episode as u64, (formatted(video, camera, &numbers), from));
        }
        files.push(table);
    }
    Ok((tables(root, Path::new("data"))?, begins))
}

/// The Parquet files in the folders of a folder, in the order of their names.
fn tables(root: &Path, inside: &Path) -> Result<Vec<PathBuf>> {
    let mut tables = Vec::new();
    for chunk in names(&root.join(inside))? {
        let chunk = inside.join(chunk);
        if root.join(&chunk).is_dir() {
            let own = names(&root.join(&chunk))?.into_iter().filter(|name| ends_in(name, &["parquet"]));
            tables.extend(own.map(|name| chunk.join(name)));
        }
    }
    match tables.is_empty() {
        true => Err(Error::new(format!("`{}` has no Parquet files; copy it again", inside.display()))),
        false => Ok(tables),
    }
}

/// What the reader reports about the recording.
fn told(
    raw: &[(u64, u64, f64, [f64; 4])],
    chosen: &[Option<Element>; 4],
    units: &Units,
    camera: &str,
    episodes: usize,
) -> Result<Vec<(String, String)>> {
    let mut told = vec![("frames".to_owned(), format!("{} in {episodes} episodes, of {camera}", raw.len()))];
    let (low, high) = range(raw.iter().map(|(.., values)| values[0]));
    for ((what, _), element) in WORDS.iter().zip(chosen) {
        let how = match (element, *what) {
            (None, "brake") => continue,
            (None, _) => "not recorded, or not found by its name".to_owned(),
            (Some(element), "steering") if low <= high => {
                format!("{element}, {}", units.describe_steering(low, high)?)
            }
            (Some(element), "speed") => format!("{element}, in {}", units.speed_name()),
            (Some(element), _) => element.to_string(),
        };
        told.push(((*what).to_owned(), how));
    }
    Ok(told)
}

impl Dataset for LeRobot {
    fn len(&self) -> usize {
        self.frames.len()
    }

    fn name(&self, index: usize) -> String {
        let name = |frame: &Frame| format!("episode {} frame {}", frame.episode, frame.number);
        self.frames.get(index).map(name).unwrap_or_default()
    }

    fn read(&mut self, index: usize) -> Result<Entry> {
        let frame = self.frames.get(index).ok_or_else(|| beyond(index, self.frames.len()))?;
        let label = frame.label.clone()?;
        let path = self.folder.path(&self.videos[frame.video])?;
        let camera = &self.camera;
        let open =
            || Video::open(&path).map_err(|error| error.at(format_args!("video `{}`", path.display())));
        let picture = self.reel.read(&path, open, |video| {
            shown_at(video, frame.at, 0.5 / self.rate).ok_or_else(|| {
                Error::new(format!("the video of {camera} has no frame at {} s; copy it again", frame.at))
            })
        })?;
        Ok(Entry {
            frame: picture,
            steering: label.steering,
            throttle: label.throttle,
            time: frame.time,
            speed: label.speed,
        })
    }

    fn position(&self, index: usize) -> Position {
        match self.frames.get(index) {
            Some(frame) => Position { part: frame.episode, number: frame.number, time: frame.time },
            None => Position { part: 0, number: index as u64, time: f64::NAN },
        }
    }

    fn info(&self) -> Vec<(String, String)> {
        self.told.clone()
    }

    fn form(&self) -> Result<Option<Form>> {
        let Some(first) = self.videos.first() else { return Ok(None) };
        // All have the same codec.
        let stored = Recoding::of(&self.folder.path(first)?)?.describe();
        let mut counts = vec![0; self.videos.len()];
        self.frames.iter().for_each(|frame| counts[frame.video] += 1);
        let file = |(name, frames): (&PathBuf, usize)| FormFile {
            name: name.to_string_lossy().into_owned(),
            frames,
            stored: stored.clone(),
        };
        let mut notes = Vec::new();
        if !self.others.is_empty() {
            notes.push(format!(
                "the videos of {} are carried over as they are; `camera` of the reader chooses the feature",
                self.others.join(", ")
            ));
        }
        Ok(Some(Form {
            folder: self.root.clone(),
            files: self.videos.iter().zip(counts).map(file).collect(),
            whole: true,
            unturned: Some("it lies in Parquet files, and statistics of it beside them".to_owned()),
            undropped: Some("they lie in Parquet files with the times of the frames".to_owned()),
            notes,
        }))
    }

    fn rewrite(&mut self, wanted: &Rewrite, perturb: &mut Perturb<'_>) -> Result<()> {
        let number = self.videos.iter().position(|name| name.to_string_lossy() == wanted.file);
        let number = number.ok_or_else(|| not_listed(&wanted.file))?;
        let mut video = Video::open(&self.folder.path(&self.videos[number])?)?;
        // A frame of the video that is not in the tables is as the one before it.
        let mut recorded = vec![None; video.count() as usize];
        for (index, frame) in self.frames.iter().enumerate().filter(|(_, frame)| frame.video == number) {
            if let Some(place) = shown_at(&video, frame.at, 0.5 / self.rate) {
                recorded[place as usize] = Some(index);
            }
        }
        let first = recorded.iter().flatten().next().copied().unwrap_or_default();
        let before = |frame: u32| recorded[..=frame as usize].iter().rev().flatten().next().copied();
        reel::rewrite(&mut video, &wanted.into, Some(KEYS), &|frame| before(frame).unwrap_or(first), perturb)
    }
}

/// The frame of a video that begins nearest to a time, and not farther from it than this.
fn shown_at(video: &Video, time: f64, tolerance: f64) -> Option<u32> {
    let (mut low, mut high) = (0, video.count());
    while low < high {
        let middle = low + (high - low) / 2;
        match video.time(middle) < time {
            true => low = middle + 1,
            false => high = middle,
        }
    }
    let near = |frame: &u32| (video.time(*frame) - time).abs();
    let around = (low.saturating_sub(1)..=low).filter(|frame| *frame < video.count());
    around.min_by(|a, b| near(a).total_cmp(&near(b))).filter(|frame| near(frame) <= tolerance)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::config;
    use pdk_sdk::serde_json::json;

    #[test]
    fn paths_are_formatted_as_python_does() {
        let numbers = [("episode_index", 7), ("episode_chunk", 0)];
        let pattern = "videos/chunk-{episode_chunk:03d}/{video_key}/episode_{episode_index:06d}.mp4";
        assert_eq!(formatted(pattern, "cam", &numbers), Path::new("videos/chunk-000/cam/episode_000007.mp4"));
        assert_eq!(formatted("{episode_index}", "", &[("episode_index", 12)]), Path::new("12"));
    }

    #[test]
    fn the_camera_is_the_one_in_front_or_the_first() {
        let video = json!({"dtype": "video"});
        let info = json!({"features": {"a": {"dtype": "float32"}, "cam.left": video, "cam.front": video}});
        assert_eq!(camera(&info, "").unwrap(), "cam.front");
        assert_eq!(camera(&info, "cam.left").unwrap(), "cam.left");
        assert!(camera(&info, "a").unwrap_err().message().contains("the videos are cam.left, cam.front"));
        let pictures = json!({"features": {"cam": {"dtype": "image"}}});
        assert!(camera(&pictures, "").unwrap_err().message().contains("within the Parquet files"));
    }

    #[test]
    fn another_folder_and_a_damaged_one_are_different_errors() {
        let dir = tempfile::tempdir().unwrap();
        let open = || LeRobot::new(&config::<LeRobot>(json!({"path": dir.path()}))).err().unwrap();
        assert_eq!(open().kind(), ErrorKind::Unsuitable);
        std::fs::create_dir(dir.path().join("meta")).unwrap();
        let error = |info: Value| {
            std::fs::write(dir.path().join(INFO), info.to_string()).unwrap();
            open().to_string()
        };
        let features = json!({"cam": {"dtype": "video"}});
        assert!(error(json!({})).contains("has no `fps`"));
        let old = json!({"fps": 10, "codebase_version": "v1.6", "features": features});
        assert!(error(old).contains("version `1.6`"));
        let mut info =
            json!({"fps": 10, "codebase_version": "v2.1", "features": features, "total_episodes": 1});
        assert!(error(info.clone()).contains("has no `data_path`"));
        (info["data_path"], info["video_path"]) = (json!("../out.parquet"), json!("v.mp4"));
        assert!(error(info.clone()).contains("does not exist"));
        std::fs::write(dir.path().join("d.parquet"), "PAR1 and nothing else").unwrap();
        info["data_path"] = json!("d.parquet");
        assert!(error(info).contains("is not a Parquet file, or is damaged"));
    }
}
