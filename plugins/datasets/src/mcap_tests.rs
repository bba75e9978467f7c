//! Tests of MCAP files that are written here: messages of every kind, chunks, and files that are cut off.

use std::collections::BTreeMap;
use std::path::PathBuf;

use super::*;
use crate::fixture::config;
use crate::foxglove::{CompressedVideo, RawImage, Timestamp};
use ::mcap::records::MessageHeader;
use ::mcap::{WriteOptions, Writer};
use pdk_sdk::serde_json::{Value, json};
use prost::Message;
use tempfile::TempDir;

/// A message in little-endian CDR.
struct Fields(Vec<u8>);

impl Fields {
    fn new() -> Self {
        Self(vec![0, 1, 0, 0])
    }

    fn put(mut self, bytes: &[u8]) -> Self {
        let padded = (self.0.len() - 4).next_multiple_of(bytes.len().max(1)) + 4;
        self.0.resize(padded, 0);
        self.0.extend_from_slice(bytes);
        self
    }

    fn header(self, seconds: i32) -> Self {
        self.put(&seconds.to_le_bytes()).put(&7u32.to_le_bytes()).bytes(b"camera\0")
    }

    fn bytes(self, bytes: &[u8]) -> Self {
        let mut fields = self.put(&(bytes.len() as u32).to_le_bytes());
        fields.0.extend_from_slice(bytes);
        fields
    }
}

fn image(number: u8) -> Vec<u8> {
    let fields = Fields::new().header(i32::from(number)).put(&2u32.to_le_bytes()).put(&4u32.to_le_bytes());
    let fields = fields.bytes(b"bgr8\0").put(&[0]).put(&12u32.to_le_bytes());
    fields.bytes(&[number, 1, 2].repeat(8)).0
}

/// Writes messages, given as topic, schema, encoding, nanoseconds and content.
fn write(folder: &TempDir, messages: &[(&str, &str, &str, u64, Vec<u8>)]) -> PathBuf {
    let path = folder.path().join("drive.mcap");
    let options = WriteOptions::new().chunk_size(Some(200)).compression(Some(::mcap::Compression::Zstd));
    let mut writer = Writer::with_options(std::fs::File::create(&path).unwrap(), options).unwrap();
    for (sequence, (topic, schema, encoding, time, data)) in messages.iter().enumerate() {
        let schema = writer.add_schema(schema, "", b"").unwrap();
        let channel_id = writer.add_channel(schema, topic, encoding, &BTreeMap::new()).unwrap();
        let header =
            MessageHeader { channel_id, sequence: sequence as u32, log_time: *time, publish_time: *time };
        writer.write_to_known_channel(&header, data).unwrap();
    }
    writer.finish().unwrap();
    path
}

fn open(path: &std::path::Path, given: Value) -> Result<Mcap> {
    let mut given = given;
    given["path"] = json!(path);
    Mcap::new(&config::<Mcap>(given))
}

fn drive() -> Vec<(&'static str, &'static str, &'static str, u64, Vec<u8>)> {
    let mut messages = Vec::new();
    for number in 0..6u8 {
        let time = 1_700_000_000_000_000_000 + u64::from(number) * 100_000_000;
        messages.push(("/camera", "sensor_msgs/msg/Image", "cdr", time, image(number)));
        let float = Fields::new().put(&(f32::from(number) / 10.0).to_le_bytes()).0;
        messages.push(("/steer", "std_msgs/msg/Float32", "cdr", time + 20_000_000, float));
        let drive = Fields::new()
            .header(0)
            .put(&0.2f32.to_le_bytes())
            .put(&0f32.to_le_bytes())
            .put(&3f32.to_le_bytes());
        let drive = drive.put(&0f32.to_le_bytes()).put(&0f32.to_le_bytes()).0;
        messages.push((
            "/drive",
            "ackermann_msgs/msg/AckermannDriveStamped",
            "cdr",
            time + 30_000_000,
            drive,
        ));
    }
    messages
}

#[test]
fn pictures_have_the_numbers_that_are_nearest_in_time() {
    let folder = TempDir::new().unwrap();
    let path = write(&folder, &drive());
    let missing = open(&path, json!({})).err().unwrap().to_string();
    assert!(
        missing.contains("topic /drive (steering_angle)") && missing.contains("counted to the left"),
        "{missing}"
    );
    let mut mcap = open(&path, json!({"full_lock": -1})).unwrap();
    assert_eq!((mcap.len(), mcap.name(3).as_str()), (6, "/camera 3"));
    assert!((mcap.position(3).time - 0.3).abs() < 1e-9);
    for index in [5, 0, 3, 2] {
        let entry = mcap.read(index).unwrap();
        assert_eq!(
            (entry.frame.width(), entry.frame.height(), &entry.frame.data()[..3]),
            (4, 2, &[2, 1, index as u8][..])
        );
        assert!((entry.time - index as f64 / 10.0).abs() < 1e-9);
        // That with the most of a drive is guessed.
        assert!((entry.steering + 0.2).abs() < 1e-6 && (entry.speed - 3.0).abs() < 1e-6);
    }
    let told = mcap.info();
    assert!(
        told.iter().any(|(what, how)| what == "steering" && how.contains("topic /drive, steering_angle")),
        "{told:?}"
    );

    let mut mcap =
        open(&path, json!({"steering": "/steer", "full_lock": -0.5, "clock": "header", "speed": "none"}))
            .unwrap();
    let entry = mcap.read(4).unwrap();
    assert!((entry.steering + 0.8).abs() < 1e-6 && entry.speed.is_nan());
    assert_eq!(entry.time, 4.0);
    let far =
        open(&path, json!({"tolerance": 0.01, "full_lock": -1})).unwrap().read(0).unwrap_err().to_string();
    assert!(far.contains("topic /drive has no message within 0.01 s"), "{far}");
    let wrong = open(&path, json!({"steering": "/stear"})).err().unwrap().to_string();
    assert!(wrong.contains("there is no topic `/stear`") && wrong.contains("/steer"), "{wrong}");
    let beyond = open(&path, json!({"steering": "/steer", "full_lock": 0.1})).err().unwrap().to_string();
    assert!(beyond.contains("set `full_lock`"), "{beyond}");
}

#[test]
fn the_topic_of_the_steering_is_guessed_by_its_name_before_its_kind() {
    let folder = TempDir::new().unwrap();
    let twist = |turn: f64| {
        let zeros = (0..5).fold(Fields::new(), |fields, _| fields.put(&0f64.to_le_bytes()));
        zeros.put(&turn.to_le_bytes()).0
    };
    let float = |value: f64| Fields::new().put(&value.to_le_bytes()).0;
    let camera = || ("/camera", "sensor_msgs/msg/Image", "cdr", 0, image(0));
    let steering = |messages: &[(&str, &str, &str, u64, Vec<u8>)], given: Value| {
        let path = write(&folder, messages);
        open(&path, given).and_then(|mut mcap| Ok(mcap.read(0)?.steering)).map_err(|error| error.to_string())
    };
    let moves = |name: &'static str, turn: f64| (name, "geometry_msgs/msg/Twist", "cdr", 0, twist(turn));
    let angle = ("/vehicle/steering_angle", "std_msgs/msg/Float64", "cdr", 0, float(0.5));
    // The name says more than the kind.
    assert_eq!(steering(&[camera(), moves("/gps/vel", 0.0), angle.clone()], json!({})), Ok(0.5));
    assert_eq!(steering(&[camera(), moves("/cmd_vel", 0.25)], json!({"full_lock": -0.5})), Ok(-0.5));
    let several = steering(&[camera(), moves("/cmd_vel", 0.25), moves("/gps/vel", 0.0)], json!({}));
    assert!(several.unwrap_err().contains("several topics could be the steering (/cmd_vel, /gps/vel)"));
    // A number that is not finite costs the frames that need it, and nothing else.
    let range = ("/range", "std_msgs/msg/Float64", "cdr", 0, float(f64::NAN));
    assert_eq!(steering(&[camera(), angle.clone(), range], json!({})), Ok(0.5));
    let broken = ("/steer", "std_msgs/msg/Float64", "cdr", 0, float(f64::NAN));
    let error = steering(&[camera(), broken], json!({})).unwrap_err();
    assert!(error.contains("topic `/steer`") && error.contains("not finite"), "{error}");
}

#[test]
fn a_file_that_ends_early_is_read_as_far_as_it_goes() {
    let folder = TempDir::new().unwrap();
    let path = write(&folder, &drive());
    let whole = std::fs::read(&path).unwrap();
    let mut lengths = Vec::new();
    for length in (0..whole.len()).step_by(23) {
        std::fs::write(&path, &whole[..length]).unwrap();
        if let Ok(mut mcap) = open(&path, json!({"full_lock": -1})) {
            assert!((0..mcap.len()).all(|index| mcap.read(index).is_ok() || mcap.read(index).is_err()));
            lengths.push(mcap.len());
        }
    }
    assert!(
        lengths.is_sorted() && lengths.contains(&6) && lengths.first().is_some_and(|first| *first < 6),
        "{lengths:?}"
    );
    let mut damaged = whole.clone();
    for at in (60..whole.len()).step_by(7) {
        damaged[at] ^= 0xff;
        std::fs::write(&path, &damaged).unwrap();
        // Whatever it is taken for, nothing panics and nothing takes memory without end.
        if let Ok(mut mcap) = open(&path, json!({"full_lock": -1})) {
            (0..mcap.len().min(10)).for_each(|index| drop(mcap.read(index)));
        }
        damaged[at] ^= 0xff;
    }
}

#[test]
fn messages_of_foxglove_are_read() {
    let folder = TempDir::new().unwrap();
    let timestamp = Some(Timestamp { seconds: 5, nanos: 0 });
    let raw =
        RawImage { timestamp, width: 2, height: 1, encoding: "mono8".to_owned(), step: 2, data: vec![7, 9] };
    let path = write(&folder, &[("/raw", "foxglove.RawImage", "protobuf", 1, raw.encode_to_vec())]);
    let mut mcap = open(&path, json!({})).unwrap();
    let entry = mcap.read(0).unwrap();
    assert_eq!(entry.frame.data(), [7, 7, 7, 9, 9, 9]);
    assert!(entry.steering.is_nan() && entry.time == 0.0);

    let video = CompressedVideo { timestamp, data: vec![0, 0, 1, 9], format: "h265".to_owned() };
    let path =
        write(&folder, &[("/video", "foxglove.CompressedVideo", "protobuf", 1, video.encode_to_vec())]);
    let error = open(&path, json!({})).unwrap().read(0).unwrap_err().to_string();
    assert!(error.contains("begins with pictures that need earlier ones"), "{error}");
}

#[test]
fn what_is_not_such_a_file_is_left_to_other_readers() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a.mcap");
    std::fs::write(&path, "text").unwrap();
    assert_eq!(open(&path, json!({})).err().unwrap().kind(), ErrorKind::Unsuitable);
    assert_eq!(open(folder.path(), json!({})).err().unwrap().kind(), ErrorKind::Unsuitable);
    let path = write(&folder, &[("/text", "std_msgs/msg/String", "cdr", 1, vec![0, 1, 0, 0])]);
    let error = open(&path, json!({})).err().unwrap();
    assert!(error.message().contains("/text (std_msgs/msg/String in cdr)"), "{error}");
}
