//! What needs more than one module: clips from the file to the frame, and everything that can be wrong with one.

use std::io::Cursor;
use std::path::{Path, PathBuf};

use image::codecs::gif::GifEncoder;
use image::{Delay, Rgba, RgbaImage};
use pdk_sdk::perturbation::check;
use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::{Value, json};
use pdk_sdk::testing::{Trial, sample_frame};
use pdk_video::mp4::{Indexed, Mp4, index};
use pdk_video::{Opened, Reader, Yuv420};

use crate::clip::{Clip, some_pictures};
use crate::dynamic_lightning_filter::DynamicLightning;
use crate::dynamic_object_overlay::DynamicObject;
use crate::dynamic_rain_filter::DynamicRain;
use crate::dynamic_smoke_filter::DynamicSmoke;
use crate::dynamic_snow_filter::DynamicSnow;
use crate::dynamic_sun_filter::DynamicSun;
use crate::key::Matte;
use crate::overlay::Overlay;
use crate::player::{Loop, Motion, Player, frame_at};
use crate::prepare::{self, Settings};
use crate::published::*;
use crate::scale::Fit;
use crate::static_lightning_filter::StaticLightning;
use crate::static_object_overlay::StaticObject;
use crate::static_rain_filter::StaticRain;
use crate::static_smoke_filter::StaticSmoke;
use crate::static_snow_filter::StaticSnow;
use crate::static_sun_filter::StaticSun;
use crate::store::{Layer, Store};

const SUN: &[u8] = include_bytes!("../../../scripts/overlays/sun.mp4");
const GREEN: [u8; 4] = [0, 200, 30, 255];
const PLAIN: Settings = Settings { key: None, fit: Fit::Cover, seconds: 30.0 };

/// A recording of the test data, if there is one.
fn recording(name: &str) -> Option<PathBuf> {
    let data = std::env::var_os("PDK_TEST_DATA")
        .map(PathBuf::from)
        .unwrap_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared"));
    let file = data.join("data").join(name);
    if !file.is_file() {
        eprintln!("skipped: no {}; PDK_TEST_DATA can name the folder", file.display());
        return None;
    }
    Some(file)
}

/// The first `frames` frames of a clip of one scene, again and again if it has fewer.
fn remuxed(clip: &[u8], frames: u32) -> Vec<u8> {
    let size = clip.len() as u64;
    let Indexed::Own(index) = index(&mut Cursor::new(clip), size).unwrap() else { panic!("another codec") };
    let Opened::Frames(mut reader) = Reader::open(Box::new(Cursor::new(clip.to_vec())), size, false).unwrap()
    else {
        panic!("another codec")
    };
    let mut picture = Yuv420::default();
    reader.next(&mut picture).unwrap();
    let [sequence, parameters] = &index.parameters[..] else { panic!("two parameter sets") };
    let mut writer = Mp4::begin(Cursor::new(Vec::new()), 30_000).unwrap();
    writer.describe(picture.width as u16, picture.height as u16, sequence, parameters).unwrap();
    let duration = (reader.time(1) * 30_000.0).round() as u32;
    for frame in 0..frames {
        let sample = index.samples[frame as usize % index.samples.len()];
        let bytes = &clip[sample.at as usize..][..sample.length as usize];
        writer.add(bytes, duration, sample.alone).unwrap();
    }
    writer.finish().unwrap().into_inner()
}

/// A GIF in which a dark square moves to the right before `screen`, by four pixels a frame.
fn gif(frames: usize, screen: [u8; 4]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = GifEncoder::new(&mut bytes);
    for number in 0..frames as u32 {
        let picture = RgbaImage::from_fn(48, 32, |x, y| {
            let inside = x.wrapping_sub(10 + 4 * number % 24) < 8 && (12..20).contains(&y);
            Rgba(if inside { [20, 20, 20, 255] } else { screen })
        });
        let delay = Delay::from_numer_denom_ms(40, 1);
        encoder.encode_frame(image::Frame::from_parts(picture, 0, 0, delay)).unwrap();
    }
    drop(encoder);
    bytes
}

fn file(folder: &Path, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, bytes).unwrap();
    path
}

/// Applies a perturbation as the kernel would.
fn apply<P: Component + Perturbation>(
    given: Value,
    intensity: f64,
    time: f64,
    src: Frame<'_>,
) -> Result<FrameBuf> {
    let mut trial = Trial::<P>::new(&given, intensity, Key([8; 32]))?;
    let (instance, cx) = trial.at(0, time);
    let mut dst = FrameBuf::new(src.width(), src.height());
    instance.apply(src, dst.as_mut(), &cx)?;
    Ok(dst)
}

fn overlaid(clip: &Path) -> Result<FrameBuf> {
    apply::<Overlay>(json!({"clip": clip.to_str()}), 4.0, 0.5, sample_frame(64, 48).as_ref())
}

/// The sentence with which a clip is refused.
fn refusal(name: &str, bytes: &[u8]) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = file(folder.path(), name, bytes);
    let sentence = overlaid(&path).unwrap_err().to_string();
    let place = format!("clip `{}`: ", path.display());
    sentence.strip_prefix(&place).unwrap_or_else(|| panic!("{sentence}")).to_owned()
}

/// All frames of a store.
fn layers(store: &mut Store) -> Vec<Layer> {
    let mut layer = Layer::default();
    (0..store.index().places.len())
        .map(|frame| {
            store.read(frame, &mut layer).unwrap();
            layer.clone()
        })
        .collect()
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn the_published_overlays_keep_the_rules_of_perturbations() {
    pdk_sdk::testing::perturbation::<DynamicRain>();
    pdk_sdk::testing::perturbation::<DynamicSnow>();
    pdk_sdk::testing::perturbation::<DynamicSmoke>();
    pdk_sdk::testing::perturbation::<DynamicObject>();
    pdk_sdk::testing::perturbation::<DynamicSun>();
    pdk_sdk::testing::perturbation::<DynamicLightning>();
    pdk_sdk::testing::perturbation::<StaticRain>();
    pdk_sdk::testing::perturbation::<StaticSnow>();
    pdk_sdk::testing::perturbation::<StaticSmoke>();
    pdk_sdk::testing::perturbation::<StaticObject>();
    pdk_sdk::testing::perturbation::<StaticSun>();
    pdk_sdk::testing::perturbation::<StaticLightning>();
}

#[test]
fn a_clip_of_the_user_keeps_the_rules_of_perturbations() {
    let folder = tempfile::tempdir().unwrap();
    let path = file(folder.path(), "square.gif", &gif(12, GREEN));
    for more in [
        json!({}),
        json!({"fit": "stretch", "loop": "ping-pong", "rate": 12.5, "key": "#00c81e"}),
        json!({"loop": "repeat"}),
    ] {
        let mut given = more;
        given["clip"] = path.to_str().into();
        let description = Overlay::description();
        let config = Config::check(&description, given.as_object().unwrap()).unwrap();
        let mut make = |config: &Config| Ok(Box::new(Overlay::new(config)?) as Box<dyn Perturbation>);
        check(&description, &config, &mut make).unwrap();
    }
}

#[test]
fn the_clips_of_our_own_can_be_named_too() {
    pdk_sdk::testing::perturbation::<Overlay>();
    let error = apply::<Overlay>(json!({"clip": "built-in:hail"}), 4.0, 0.0, sample_frame(8, 8).as_ref());
    assert!(error.unwrap_err().to_string().starts_with("there is no clip `built-in:hail`; there are rain,"));
}

#[test]
fn all_but_static_smoke_and_the_users_own_are_in_the_published_set() {
    let left_out = [Overlay::description(), StaticSmoke::description()];
    assert!(left_out.iter().all(|description| !description.default));
    let published = [
        DynamicRain::description(),
        DynamicSnow::description(),
        DynamicSmoke::description(),
        DynamicObject::description(),
        DynamicSun::description(),
        DynamicLightning::description(),
        StaticRain::description(),
        StaticSnow::description(),
        StaticObject::description(),
        StaticSun::description(),
        StaticLightning::description(),
    ];
    assert!(published.iter().all(|description| description.default && description.family == "overlay"));
    let moving = published.iter().filter(|description| description.temporal == Temporal::Dynamic);
    assert!(moving.eq(&published[..6]));
}

/// The mean squared difference from the source at twenty intensities.
fn strengths<P: Component + Perturbation>() -> Vec<f64> {
    let src = sample_frame(160, 120);
    let strength = |step: i32| {
        let out = apply::<P>(json!({}), f64::from(step) / 5.0, 0.0, src.as_ref()).unwrap();
        let squares = src.data().iter().zip(out.data()).map(|(a, b)| f64::from(a.abs_diff(*b)).powi(2));
        squares.sum::<f64>() / src.data().len() as f64
    };
    (0..=20).map(strength).collect()
}

#[test]
fn the_effect_grows_with_the_intensity() {
    for (name, strengths) in [
        ("rain", strengths::<DynamicRain>()),
        ("snow", strengths::<StaticSnow>()),
        ("smoke", strengths::<DynamicSmoke>()),
        ("birds", strengths::<StaticObject>()),
        ("sun", strengths::<DynamicSun>()),
        ("lightning", strengths::<StaticLightning>()),
    ] {
        assert!(strengths[0] > 0.5, "{name}: {strengths:?}");
        assert!(strengths.windows(2).all(|pair| pair[0] < pair[1]), "{name}: {strengths:?}");
    }
}

#[test]
fn moving_overlays_move_and_standing_ones_stand() {
    let src = sample_frame(160, 120);
    let at = |time: f64| apply::<DynamicRain>(json!({}), 4.0, time, src.as_ref()).unwrap();
    assert_ne!(at(0.0), at(1.0 / 30.0));
    // The clip is three seconds long.
    assert_eq!(at(0.4), at(3.4));
    let still = |time: f64| apply::<StaticRain>(json!({}), 4.0, time, src.as_ref()).unwrap();
    assert_eq!(still(0.0), still(1.7));
}

/// The clips of our own with the description of what moves.
fn own_clips() -> [(&'static str, Description); 6] {
    [
        ("rain", DynamicRain::description()),
        ("snow", DynamicSnow::description()),
        ("smoke", DynamicSmoke::description()),
        ("birds", DynamicObject::description()),
        ("sun", DynamicSun::description()),
        ("lightning", DynamicLightning::description()),
    ]
}

/// What is known of the frames of a clip of our own, at a small size.
fn own_index(name: &str, cache: &Path) -> crate::store::Index {
    let clip = clip(name).unwrap();
    let settings = Settings { key: Some([0, 219, 26]), ..PLAIN };
    prepare::open(&clip, &clip.hash().unwrap(), &settings, (64, 36), cache).unwrap().index().clone()
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn the_descriptions_say_how_long_the_loops_are_and_how_often_they_show_something() {
    let folder = tempfile::tempdir().unwrap();
    for (name, description) in own_clips() {
        let index = own_index(name, folder.path());
        let seconds = format!("a loop of {} s", index.frames as f64 / index.rate);
        assert!(description.doc.contains(&seconds), "{name}: {seconds}");
        // A tenth of a percent of the frame and more is something.
        let showing = index.coverage[..index.frames].iter().filter(|&&alpha| alpha > 0.255).count();
        let percent = (100 * showing + index.frames / 2) / index.frames;
        let expected = if percent == 100 { "%".to_owned() } else { format!("in {percent} % of which") };
        assert_eq!(description.doc.contains(&expected), percent < 100, "{name}: {percent} %");
    }
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn standing_overlays_have_many_pictures() {
    let folder = tempfile::tempdir().unwrap();
    for (name, _) in own_clips() {
        let index = own_index(name, folder.path());
        let frame =
            |key: u8| frame_at(&index, Motion::Stands, (0.0, None), &mut Key([key; 32]).sequence()).first;
        let mut frames: Vec<usize> = (0..40).map(frame).collect();
        frames.sort_unstable();
        frames.dedup();
        assert!(frames.len() > 24, "{name}: {} of 40 differ", frames.len());
    }
}

#[test]
fn published_overlays_can_be_stretched_and_looped_too() {
    let src = sample_frame(60, 90);
    let with = |given: Value| apply::<DynamicRain>(given, 4.0, 1.0, src.as_ref()).unwrap();
    let plain = with(json!({}));
    for given in [json!({"fit": "stretch"}), json!({"loop": "ping-pong"}), json!({"rate": 7})] {
        assert_ne!(with(given.clone()), plain, "{given}");
    }
    assert_eq!(with(json!({"fit": "cover", "loop": "repeat"})), plain);
    let still = |given: Value| apply::<StaticSun>(given, 4.0, 1.0, src.as_ref());
    assert_ne!(still(json!({"fit": "stretch"})).unwrap(), still(json!({})).unwrap());
    assert!(still(json!({"loop": "repeat"})).is_err());
}

#[test]
fn birds_keep_above_the_horizon_unless_told_otherwise() {
    let src = FrameBuf::from_vec(vec![200; 160 * 80 * 3], 160, 80).unwrap();
    let lowest = |given: Value, time: f64| {
        let out = apply::<DynamicObject>(given, 4.0, time, src.as_ref()).unwrap();
        let seen = |y: usize| (0..160).any(|x| out.as_ref().pixel(x, y)[0] < 150);
        (0..80).rev().find(|&y| seen(y)).unwrap_or_default()
    };
    for step in 0..20 {
        let time = f64::from(step) * 0.2;
        let [usual, lower] = [json!({}), json!({"horizon": 0.8})].map(|given| lowest(given, time));
        assert!((1..26).contains(&usual), "{time}: row {usual}");
        assert!((30..64).contains(&lower), "{time}: row {lower}");
    }
}

#[test]
fn the_sun_lowers_exposure_and_contrast() {
    let half = [20u8; 160 * 40 * 3].into_iter().chain([180; 160 * 40 * 3]).collect();
    let src = FrameBuf::from_vec(half, 160, 80).unwrap();
    let at = |given: Value, y: usize| {
        apply::<DynamicSun>(given, 4.0, 0.0, src.as_ref()).unwrap().as_ref().pixel(2, y)[2]
    };
    let plain = json!({"darker": 0, "veil": 0});
    assert!(at(plain.clone(), 79).abs_diff(180) < 12, "{}", at(plain, 79));
    assert!(at(json!({}), 79) < 150 && at(json!({}), 1) > 28, "{} {}", at(json!({}), 79), at(json!({}), 1));
}

#[test]
fn rain_comes_faster_to_a_vehicle_that_drives_faster() {
    let src = sample_frame(96, 48);
    let after = |metres: Option<f64>| {
        let mut trial = Trial::<DynamicRain>::new(&json!({}), 4.0, Key([8; 32])).unwrap();
        let (instance, mut cx) = trial.at(20, 1.0);
        cx.travelled = metres;
        let mut dst = FrameBuf::new(96, 48);
        instance.apply(src.as_ref(), dst.as_mut(), &cx).unwrap();
        dst
    };
    // Ten metres in a second is what the clip is drawn for.
    assert_eq!(after(None), after(Some(10.0)));
    assert_ne!(after(None), after(Some(20.0)));
    // At standstill it shows what it shows after half the time at that speed.
    let half = apply::<DynamicRain>(json!({}), 4.0, 0.5, src.as_ref()).unwrap();
    assert_eq!(after(Some(0.0)), half);
}

#[test]
fn the_square_of_a_clip_lies_where_it_belongs_and_the_screen_is_gone() {
    let folder = tempfile::tempdir().unwrap();
    for (name, key) in [("green.gif", GREEN), ("blue.gif", [20, 30, 220, 255])] {
        let path = file(folder.path(), name, &gif(1, key));
        let src = FrameBuf::from_vec(vec![200; 48 * 32 * 3], 48, 32).unwrap();
        let out = apply::<Overlay>(json!({"clip": path.to_str()}), 4.0, 0.0, src.as_ref()).unwrap();
        for y in 0..32 {
            for x in 0..48 {
                let inside = (10..18).contains(&x) && (12..20).contains(&y);
                let expected = if inside { 20 } else { 200u8 };
                let pixel = out.as_ref().pixel(x, y);
                assert!(pixel.iter().all(|v| v.abs_diff(expected) <= 4), "{name} {x} {y}: {pixel:?}");
            }
        }
    }
}

#[test]
fn a_file_that_is_not_a_clip_is_rejected_in_one_sentence() {
    assert_eq!(
        refusal("a.mp4", b"Dear diary,\ntoday"),
        "it is a text file, not a video, whatever its name says"
    );
    assert_eq!(refusal("a.mp4", b""), "the file is empty");
    assert!(refusal("a.gif", &gif(3, [90, 90, 90, 255])).starts_with("it is not a green-screen clip: "));
    assert!(refusal("a.png", b"\x89PNG\r\n\x1a\nbroken").starts_with("it is cut off"));
    let whole = gif(5, GREEN);
    assert!(refusal("a.gif", &whole[..whole.len() / 2]).starts_with("it is damaged or cut off"));
    let folder = tempfile::tempdir().unwrap();
    let absent = folder.path().join("clip.mp4");
    let error = overlaid(&absent).unwrap_err().to_string();
    assert_eq!(error, format!("clip `{}`: it does not exist", absent.display()));
    assert!(overlaid(folder.path()).unwrap_err().to_string().contains("the folder has no pictures"));
    let error =
        apply::<Overlay>(json!({"clip": "x.mp4", "key": "greenish"}), 4.0, 0.0, sample_frame(8, 8).as_ref());
    assert!(error.unwrap_err().to_string().ends_with("has to be a colour such as #05c142, or auto"));
}

#[test]
fn a_clip_that_is_cut_off_anywhere_is_refused() {
    for length in (20..SUN.len()).step_by(SUN.len() / 23) {
        let sentence = refusal("a.mp4", &SUN[..length]);
        assert!(sentence.starts_with("it is cut off: its frames or their index"), "at {length}: {sentence}");
    }
    // Index first, as for streaming: what is missing are frames.
    let faststart = index_first(SUN);
    assert!(overlaid(&file(tempfile::tempdir().unwrap().path(), "whole.mp4", &faststart)).is_ok());
    for length in (6000..faststart.len()).step_by(faststart.len() / 11) {
        let sentence = refusal("a.mp4", &faststart[..length]);
        assert!(sentence.starts_with("it is cut off"), "at {length}: {sentence}");
    }
}

/// The same clip with the index before the frames.
fn index_first(clip: &[u8]) -> Vec<u8> {
    let mut boxes = Vec::new();
    let mut at = 0;
    while at < clip.len() {
        let length = u32::from_be_bytes(clip[at..at + 4].try_into().unwrap()) as usize;
        boxes.push(&clip[at..at + length]);
        at += length;
    }
    let found = |name: &[u8]| boxes.iter().find(|b| &b[4..8] == name).unwrap().to_vec();
    let (header, mut index, frames) = (found(b"ftyp"), found(b"moov"), found(b"mdat"));
    // Every place in the file moves by the length of the index.
    let table = index.windows(4).position(|w| w == b"stco").unwrap() + 8;
    let entries = u32::from_be_bytes(index[table..table + 4].try_into().unwrap()) as usize;
    let moved = index.len() as u32;
    for entry in index[table + 4..].chunks_exact_mut(4).take(entries) {
        let place = u32::from_be_bytes((&*entry).try_into().unwrap()) + moved;
        entry.copy_from_slice(&place.to_be_bytes());
    }
    [header, index, frames].concat()
}

#[test]
fn damage_in_the_index_never_ends_the_process() {
    let index = SUN.windows(4).rposition(|w| w == b"moov").unwrap() - 4;
    let mut random = Key([5; 32]).sequence();
    for _ in 0..400 {
        let mut damaged = SUN.to_vec();
        for _ in 0..=random.below(3) {
            let at = index + random.below((SUN.len() - index) as u32) as usize;
            damaged[at] = random.next_u32() as u8;
        }
        let input = Box::new(Cursor::new(damaged.clone()));
        // Whether it can be read or not, it comes back.
        if let Ok(Opened::Frames(mut frames)) = Reader::open(input, damaged.len() as u64, true) {
            let _ = frames.next(&mut Yuv420::default());
        }
    }
}

#[test]
fn other_codecs_are_left_to_ffmpeg() {
    let codec_of = |from: &[u8], to: &[u8]| {
        let at = SUN.windows(from.len()).rposition(|w| w == from).unwrap();
        let mut other = SUN.to_vec();
        other[at..at + to.len()].copy_from_slice(to);
        match Reader::open(Box::new(Cursor::new(other)), SUN.len() as u64, true)
            .unwrap_or_else(|e| panic!("{e}"))
        {
            Opened::OtherCodec(codec) => codec,
            Opened::Frames(_) => panic!("it was opened"),
        }
    };
    assert_eq!(codec_of(b"avc1", b"av01"), "AV1");
    // High 4:4:4 Predictive.
    let (profile, other) = ([b"avcC" as &[u8], &[1, 100]].concat(), [b"avcC" as &[u8], &[1, 244]].concat());
    assert!(codec_of(&profile, &other).starts_with("H.264 in profile 244"));
}

#[test]
fn clips_of_one_and_two_frames_work() {
    let folder = tempfile::tempdir().unwrap();
    for frames in [1, 2] {
        overlaid(&file(folder.path(), &format!("{frames}.mp4"), &remuxed(SUN, frames))).unwrap();
        overlaid(&file(folder.path(), &format!("{frames}.gif"), &gif(frames as usize, GREEN))).unwrap();
    }
}

#[test]
fn of_a_clip_of_ten_minutes_the_first_half_minute_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let path = file(folder.path(), "long.mp4", &remuxed(SUN, 18_000));
    let clip = Clip::Path(path);
    let store = prepare::open(&clip, &clip.hash().unwrap(), &PLAIN, (64, 48), folder.path()).unwrap();
    let index = store.index();
    assert_eq!((index.frames, index.places.len()), (900, 915));
    assert!((index.rate - 30.0).abs() < 1e-9);
}

#[test]
fn pictures_in_a_folder_and_a_still_picture_are_clips_too() {
    let folder = tempfile::tempdir().unwrap();
    let frames = folder.path().join("frames");
    std::fs::create_dir(&frames).unwrap();
    for i in 0..3u32 {
        let picture =
            RgbaImage::from_fn(20, 10, |x, _| Rgba(if x / 5 == i { [9, 9, 9, 255] } else { GREEN }));
        picture.save(frames.join(format!("{i}.png"))).unwrap();
    }
    std::fs::write(frames.join("notes.txt"), "no picture").unwrap();
    let clip = Clip::Path(frames.clone());
    let before = clip.hash().unwrap();
    let mut store = prepare::open(&clip, &before, &PLAIN, (20, 10), folder.path()).unwrap();
    let index = store.index().clone();
    assert_eq!((index.frames, index.rate), (3, 30.0));
    for (i, layer) in layers(&mut store).iter().enumerate() {
        let opaque: Vec<bool> = layer.planes().1[..20].iter().map(|&alpha| alpha > 128).collect();
        assert_eq!(opaque, (0..20).map(|x| x / 5 == i).collect::<Vec<_>>());
    }
    std::fs::remove_file(frames.join("2.png")).unwrap();
    assert_ne!(clip.hash().unwrap(), before);
    overlaid(&frames.join("0.png")).unwrap();
}

#[test]
fn a_damaged_cache_is_made_anew() {
    let folder = tempfile::tempdir().unwrap();
    let clip = Clip::Path(file(folder.path(), "square.gif", &gif(12, GREEN)));
    let hash = clip.hash().unwrap();
    let cache = folder.path().join("cache");
    let open = || prepare::open(&clip, &hash, &PLAIN, (30, 20), &cache).unwrap();
    let expected = layers(&mut open());
    let mut files = std::fs::read_dir(&cache).unwrap().map(|entry| entry.unwrap().path());
    let stored = files.find(|path| path.extension().is_some_and(|ending| ending == "clip")).unwrap();
    let whole = std::fs::read(&stored).unwrap();
    for damaged in [whole[..whole.len() / 2].to_vec(), vec![7; 500], Vec::new()] {
        std::fs::write(&stored, damaged).unwrap();
        assert_eq!(layers(&mut open()), expected);
    }
    assert_eq!(std::fs::read(&stored).unwrap(), whole);
}

#[test]
fn damage_while_a_clip_plays_is_repaired() {
    let folder = tempfile::tempdir().unwrap();
    let path = file(folder.path(), "own.gif", &gif(12, GREEN));
    let given = json!({"clip": path.to_str(), "loop": "repeat"});
    let src = sample_frame(37, 23);
    let mut trial = Trial::<Overlay>::new(&given, 4.0, Key([8; 32])).unwrap();
    let mut at = |time: f64| trial.frame(&src, 0, time).unwrap();
    let (first, second) = (at(0.0), at(0.04));
    let clip = Clip::Path(path);
    let mut damaged = 0;
    for entry in std::fs::read_dir(crate::cache::folder().unwrap()).unwrap() {
        let stored = entry.unwrap().path();
        if Store::open(&stored).is_ok_and(|store| (store.index().width, store.index().height) == (37, 23)) {
            let length = std::fs::metadata(&stored).unwrap().len() as usize;
            std::fs::write(&stored, vec![0; length]).unwrap();
            damaged += 1;
        }
    }
    assert!(damaged > 0 && clip.hash().is_ok());
    assert_eq!((at(0.0), at(0.04)), (first, second));
}

#[test]
fn threads_that_want_the_same_clip_at_once_get_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let clip = Clip::Path(file(folder.path(), "square.gif", &gif(12, GREEN)));
    let hash = clip.hash().unwrap();
    let all: Vec<Vec<Layer>> = std::thread::scope(|scope| {
        let open = || layers(&mut prepare::open(&clip, &hash, &PLAIN, (40, 30), folder.path()).unwrap());
        let threads: Vec<_> = (0..4).map(|_| scope.spawn(open)).collect();
        threads.into_iter().map(|thread| thread.join().unwrap()).collect()
    });
    assert!(all.iter().all(|layers| layers == &all[0] && layers.len() == 15));
}

#[test]
fn the_fade_leads_from_the_end_to_the_beginning() {
    let folder = tempfile::tempdir().unwrap();
    let clip = Clip::Path(file(folder.path(), "square.gif", &gif(12, GREEN)));
    let mut store = prepare::open(&clip, &clip.hash().unwrap(), &PLAIN, (48, 32), folder.path()).unwrap();
    assert!((store.index().rate - 25.0).abs() < 1e-9);
    let layers = layers(&mut store);
    let distance = |a: &Layer, b: &Layer| -> u64 {
        a.planes().1.iter().zip(b.planes().1).map(|(a, b)| u64::from(a.abs_diff(*b))).sum()
    };
    // Twelve frames; the last three fade into the first three.
    for i in 0..3 {
        let (from, to, mixed) = (&layers[9 + i], &layers[i], &layers[12 + i]);
        let whole = distance(from, to) as f64;
        assert!((distance(from, mixed) as f64 / whole - (i + 1) as f64 / 4.0).abs() < 0.02);
        assert!((distance(mixed, to) as f64 / whole - (3 - i) as f64 / 4.0).abs() < 0.02);
    }
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn a_recorded_clip_with_frames_out_of_order_is_read_whole() {
    let Some(path) = recording("overlays/birds.mp4") else { return };
    let clip = Clip::Path(path);
    let Matte::Screen(screen) = prepare::matte(&clip, &PLAIN).unwrap() else { panic!("no screen") };
    let rgb = screen.rgb();
    println!("screen {rgb:?}");
    assert!(rgb.iter().zip([5.0, 193.0, 66.0]).all(|(a, b)| (a - b).abs() < 3.0), "{rgb:?}");
    let folder = tempfile::tempdir().unwrap();
    let mut store = prepare::open(&clip, &clip.hash().unwrap(), &PLAIN, (320, 180), folder.path()).unwrap();
    // Its edit list cuts two frames off at the beginning and one at the end, as ffmpeg does too, and shortens the last one.
    let index = store.index();
    assert_eq!((index.frames, index.durations.len()), (88, 88));
    assert_eq!(
        (index.durations[0], index.durations[86], index.durations[87]),
        (33_333_333, 33_333_333, 4_433_333)
    );
    // Frames in the wrong order would jump to and fro: each is nearer to the next one than to the one after that.
    let layers = layers(&mut store);
    let distance = |a: &Layer, b: &Layer| -> u64 {
        a.planes().1.iter().zip(b.planes().1).map(|(a, b)| u64::from(a.abs_diff(*b))).sum()
    };
    let nearer = (0..86)
        .filter(|&i| distance(&layers[i], &layers[i + 1]) < distance(&layers[i], &layers[i + 2]))
        .count();
    assert!(nearer >= 84, "{nearer} of 86");
    let mut shown = 0;
    for layer in &layers {
        let (colours, alphas) = layer.planes();
        let covered = alphas.iter().filter(|&&alpha| alpha > 0).count();
        assert!(covered < 6000, "{covered} pixels show");
        shown += covered;
        // Dark birds: nowhere is green above the other colours.
        assert!(colours.chunks(3).all(|c| i32::from(c[1]) <= i32::from(c[0].max(c[2])) + 8));
    }
    assert!(shown > 91 * 100, "{shown}");
}

#[test]
fn a_recording_of_a_road_is_not_taken_for_a_green_screen() {
    let Some(path) = recording("road/solidWhiteRight.mp4") else { return };
    let error = overlaid(&path).unwrap_err().to_string();
    assert!(error.contains("it is not a green-screen clip"), "{error}");
    let clip = Clip::Path(path);
    assert!((1..=5).contains(&some_pictures(&clip, 5).unwrap().len()));
}

/// Prints how long a frame takes: `cargo test --release -p pdk-overlay -- --ignored --nocapture speed`.
#[test]
#[ignore = "measures and checks nothing"]
fn speed_of_playing() {
    for (width, height) in [(320, 240), (1280, 720)] {
        for (name, clip) in [
            ("rain", include_bytes!("../../../scripts/overlays/rain.mp4") as &'static [u8]),
            ("smoke", include_bytes!("../../../scripts/overlays/smoke.mp4")),
            ("birds", include_bytes!("../../../scripts/overlays/birds.mp4")),
        ] {
            let settings = Settings { key: Some([0, 219, 26]), ..PLAIN };
            let motion = Motion::Runs { end: Loop::Repeat, rate: None };
            let mut player = Player::new(Clip::BuiltIn(name, clip), settings, motion).unwrap();
            let (key, src) = (Key([8; 32]), sample_frame(width, height));
            let mut dst = FrameBuf::new(width, height);
            let names = ["opacity".to_owned()];
            let mut play = |frame: u64| {
                let cx = Context::new(3.0, frame, frame as f64 / 30.0, &key).with_values(&names, &[0.8]);
                let begin = std::time::Instant::now();
                player.apply(src.as_ref(), dst.as_mut(), &cx).unwrap();
                begin.elapsed().as_secs_f64() * 1e3
            };
            let first = play(0);
            let mut times: Vec<f64> = (1..200).map(&mut play).collect();
            times.sort_by(f64::total_cmp);
            println!(
                "{name} {width}x{height}: first {first:.0} ms, then {:.3} ms (worst {:.3})",
                times[times.len() / 2],
                times[times.len() - 1]
            );
        }
    }
}
