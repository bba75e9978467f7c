//! Partial frames are what a decoder makes of a stream that lacks the end of a frame: compared with ffmpeg's.

use std::io::Write;
use std::process::{Command, Stdio};

use pdk_chain::chain::Chain;
use pdk_chain::moment::Moment;
use pdk_components::registry::Registry;
use pdk_components::search_path::SearchPath;
use pdk_model::component::ComponentSpec;
use pdk_model::perturbation::AppliedPerturbation;
use pdk_sdk::prelude::{Control, FrameBuf, Scenario};
use serde_json::{Map, Value};

const SIZE: [usize; 2] = [320, 240];
/// Rows of a macroblock. In MPEG-2 each row of them is a slice.
const MACROBLOCK: usize = 16;
/// The picture that is damaged, the last one.
const DAMAGED: usize = 5;

/// What ffmpeg makes of its input; none without ffmpeg.
fn ffmpeg(arguments: &[&str], input: &[u8]) -> Option<Vec<u8>> {
    let mut child = Command::new("ffmpeg")
        .args(["-nostdin", "-v", "quiet"])
        .args(arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .ok()?;
    let mut stdin = child.stdin.take().unwrap();
    let input = input.to_vec();
    let writer = std::thread::spawn(move || stdin.write_all(&input).unwrap());
    let output = child.wait_with_output().unwrap();
    writer.join().unwrap();
    assert!(output.status.success(), "ffmpeg {arguments:?} failed");
    Some(output.stdout)
}

/// Frames of a drive on the embedded simulator, one after the other.
fn drive(registry: &Registry) -> Vec<u8> {
    let size =
        [("width", SIZE[0]), ("height", SIZE[1])].map(|(name, side)| (name.to_owned(), Value::from(side)));
    let (mut simulator, _) = registry.simulator("lane", &Map::from_iter(size)).unwrap();
    let [simulated, driver] = ["lane", "lane_keeper"].map(ComponentSpec::new);
    simulator.reset(&Scenario { seed: 1, ..Scenario::new(simulated, driver) }, 0).unwrap();
    let mut frame = FrameBuf::new(SIZE[0], SIZE[1]);
    let mut all = Vec::new();
    for number in 0..=20 + DAMAGED {
        simulator.frame(frame.as_mut()).unwrap();
        simulator.act(Control { steering: 0.0, throttle: 0.6 }).unwrap();
        // The vehicle has to move, or all frames are the same.
        if number >= 20 {
            all.extend_from_slice(frame.data());
        }
    }
    all
}

fn decoded(stream: &[u8]) -> Vec<FrameBuf> {
    // Without its filter across the edges of blocks that were lost.
    let options = ["-flags", "output_corrupt", "-ec", "guess_mvs", "-f", "mpegvideo", "-i", "-"];
    let arguments = [&options[..], &["-f", "rawvideo", "-pix_fmt", "rgb24", "-"]].concat();
    let pixels = ffmpeg(&arguments, stream).unwrap();
    let frames = pixels.chunks_exact(3 * SIZE[0] * SIZE[1]);
    frames.map(|frame| FrameBuf::from_vec(frame.to_vec(), SIZE[0], SIZE[1]).unwrap()).collect()
}

/// The stream without the slices of the damaged picture from one on.
fn without_slices(stream: &[u8], from: usize) -> Vec<u8> {
    let starts: Vec<usize> =
        (0..stream.len() - 3).filter(|at| stream[*at..].starts_with(&[0, 0, 1])).collect();
    let (mut kept, mut pictures) = (stream[..starts[0]].to_vec(), 0);
    for (number, start) in starts.iter().enumerate() {
        let end = starts.get(number + 1).copied().unwrap_or(stream.len());
        let code = usize::from(stream[start + 3]);
        pictures += usize::from(code == 0);
        // Slices have the codes of their rows from 1 on.
        let is_lost = pictures == DAMAGED + 1 && (from + 1..0xb0).contains(&code);
        if !is_lost {
            kept.extend_from_slice(&stream[*start..end]);
        }
    }
    kept
}

/// The row from which on a frame is the one before; none if it is not made of both like that.
fn cut(found: &FrameBuf, before: &FrameBuf, now: &FrameBuf) -> Option<usize> {
    let (found, before, now) = (found.as_ref(), before.as_ref(), now.as_ref());
    let lost = (0..SIZE[1]).rev().take_while(|y| found.row(*y) == before.row(*y)).count();
    let cut = SIZE[1] - lost;
    (0..cut).all(|y| found.row(y) == now.row(y)).then_some(cut)
}

/// The frame as `partial_frames` makes it of both.
fn partial(registry: &Registry, seed: u64, before: &FrameBuf, now: &FrameBuf) -> FrameBuf {
    let perturbation = AppliedPerturbation::parse("partial_frames@4,partial=1,missing=1").unwrap();
    let mut chain = Chain::new(registry, &[perturbation], seed).unwrap();
    let mut target = FrameBuf::new(SIZE[0], SIZE[1]);
    for (number, frame) in [(0, before), (1, now)] {
        chain.apply(frame.as_ref(), target.as_mut(), &Moment::new(number, number as f64 / 20.0)).unwrap();
    }
    target
}

#[test]
fn a_decoder_fills_the_rows_that_are_missing_as_partial_frames_do() {
    let registry = pdk_tests::registry(&SearchPath::default());
    let size = format!("{}x{}", SIZE[0], SIZE[1]);
    let raw = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", size.as_str(), "-i", "-"];
    let coded = ["-c:v", "mpeg2video", "-q:v", "2", "-bf", "0", "-g", "100", "-f", "mpeg2video", "-"];
    let Some(stream) = ffmpeg(&[&raw[..], &coded[..]].concat(), &drive(&registry)) else {
        eprintln!("skipped: there is no ffmpeg");
        return;
    };
    let clean = decoded(&stream);
    assert_eq!(clean.len(), DAMAGED + 1);
    let (before, now) = (&clean[DAMAGED - 1], &clean[DAMAGED]);
    for from in [4, 8, 11] {
        let found = &decoded(&without_slices(&stream, from))[DAMAGED];
        // ffmpeg gives up the last slice that came as well, since no start code follows it.
        let cut = cut(found, before, now)
            .unwrap_or_else(|| panic!("slices from {from} on are not the frame before"));
        assert!(
            ((from - 1) * MACROBLOCK..=from * MACROBLOCK).contains(&cut),
            "slices from {from} on: row {cut}"
        );
        let same = (0..2000).any(|seed| partial(&registry, seed, before, now) == *found);
        assert!(same, "no partial frame is what ffmpeg makes of a stream without the slices from {from} on");
    }
}
