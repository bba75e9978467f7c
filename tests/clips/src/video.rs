//! From canvases to an MP4 file: laid over green, turned into luma and chroma, encoded as H.264.

use std::io::{Cursor, Error, Result};

use openh264::OpenH264API;
use openh264::encoder::{
    BitRate, Complexity, Encoder, EncoderConfig, FrameRate, Profile, QpRange, RateControlMode, VuiConfig,
};
use openh264::formats::YUVBuffer;
use pdk_video::mp4::Mp4;

use crate::canvas::{Canvas, SIZE};

/// The screen: far from grey, so that transparency has many steps.
pub const GREEN: [f32; 3] = [0.0, 0.86, 0.10];

/// Ticks per second in the file.
const TIMESCALE: u32 = 30_000;

/// Encodes frames, of which there are this many a second, as an MP4 file.
pub fn encode(frames: impl Iterator<Item = Canvas>, rate: u32, quantiser: u8) -> Result<Vec<u8>> {
    // Every frame gets the same quantiser, so nothing depends on how long encoding takes.
    let config = EncoderConfig::new()
        .rate_control_mode(RateControlMode::Quality)
        .bitrate(BitRate::from_bps(100_000_000))
        .qp(QpRange::new(quantiser, quantiser))
        .max_frame_rate(FrameRate::from_hz(rate as f32))
        .complexity(Complexity::High)
        .profile(Profile::High)
        .vui(VuiConfig::bt601())
        .skip_frames(false)
        .scene_change_detect(false)
        .adaptive_quantization(false)
        .background_detection(false)
        .num_threads(1);
    let mut encoder = Encoder::with_api_config(OpenH264API::from_source(), config).map_err(Error::other)?;
    let mut file: Option<Mp4<Cursor<Vec<u8>>>> = None;
    for canvas in frames {
        let picture = YUVBuffer::from_vec(planes(&canvas), SIZE.0, SIZE.1);
        let stream = encoder.encode(&picture).map_err(Error::other)?;
        let units = units(&stream.to_vec());
        let kind = |unit: &[u8]| unit.first().map_or(0, |byte| byte & 31);
        let writer = match &mut file {
            Some(writer) => writer,
            None => {
                let set = |wanted: u8| units.iter().find(|unit| kind(unit) == wanted).cloned();
                let (Some(sequence), Some(picture)) = (set(7), set(8)) else {
                    return Err(Error::other("the encoder gives no parameter sets"));
                };
                let mut writer = Mp4::begin(Cursor::new(Vec::new()), TIMESCALE).map_err(Error::other)?;
                writer.describe(SIZE.0 as u16, SIZE.1 as u16, &sequence, &picture).map_err(Error::other)?;
                file.insert(writer)
            }
        };
        let mut bytes = Vec::new();
        // Parameter sets are in the file's header.
        for unit in units.iter().filter(|unit| matches!(kind(unit), 1 | 5)) {
            bytes.extend_from_slice(&(unit.len() as u32).to_be_bytes());
            bytes.extend_from_slice(unit);
        }
        let alone = units.iter().any(|unit| kind(unit) == 5);
        writer.add(&bytes, TIMESCALE / rate, alone).map_err(Error::other)?;
    }
    let writer = file.ok_or_else(|| Error::other("a clip has frames"))?;
    Ok(writer.finish().map_err(Error::other)?.into_inner())
}

/// The units of a stream, without the start codes between them.
fn units(stream: &[u8]) -> Vec<Vec<u8>> {
    let starts: Vec<usize> =
        stream.windows(3).enumerate().filter(|(_, w)| w == &[0, 0, 1]).map(|(i, _)| i).collect();
    let ends = starts.iter().skip(1).copied().chain([stream.len()]);
    let unit = |(start, end): (&usize, usize)| {
        let mut unit = stream[start + 3..end].to_vec();
        // A unit never ends with zeros: they belong to the next start code.
        while unit.last() == Some(&0) {
            unit.pop();
        }
        unit
    };
    starts.iter().zip(ends).map(unit).collect()
}

/// Red, green and blue of a pixel over the screen, 0 to 1.
pub fn over_green(pixel: &[f32; 4]) -> [f32; 3] {
    [0, 1, 2].map(|c| pixel[c] + GREEN[c] * (1.0 - pixel[3]))
}

/// Luma and chroma of a canvas over the screen, as ITU-R BT.601 has them. A chroma sample lies on an even column, between
/// two rows.
fn planes(canvas: &Canvas) -> Vec<u8> {
    let (width, height) = SIZE;
    let colours: Vec<[f32; 3]> = canvas.pixels().iter().map(over_green).collect();
    let luma = |[r, g, b]: [f32; 3]| 0.299 * r + 0.587 * g + 0.114 * b;
    let byte = |value: f32| (value + 0.5).clamp(0.0, 255.0) as u8;
    let mut planes: Vec<u8> = colours.iter().map(|&colour| byte(16.0 + 219.0 * luma(colour))).collect();
    for (channel, scale) in [(2, 112.0 / 0.886), (0, 112.0 / 0.701)] {
        for y in (0..height).step_by(2) {
            for x in (0..width).step_by(2) {
                let mut sum = 0.0;
                for (column, weight) in [(x.saturating_sub(1), 0.25), (x, 0.5), (x + 1, 0.25)] {
                    for row in [y, y + 1] {
                        let colour = colours[row * width + column];
                        sum += weight * 0.5 * (colour[channel] - luma(colour));
                    }
                }
                planes.push(byte(128.0 + scale * sum));
            }
        }
    }
    planes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::CLIPS;
    use pdk_video::{Opened, Reader, Yuv420};

    /// The luma of the first `count` frames of a file as [`encode`] writes it.
    fn lumas(file: &[u8], count: u32) -> Vec<Vec<u8>> {
        let size = file.len() as u64;
        let opened = Reader::open(Box::new(Cursor::new(file.to_vec())), size, false).unwrap();
        let Opened::Frames(mut reader) = opened else { panic!("it is another codec") };
        let mut planes = Yuv420::default();
        let mut luma = || {
            assert!(reader.next(&mut planes).unwrap());
            planes.planes()[0].to_vec()
        };
        (0..count).map(|_| luma()).collect()
    }

    #[test]
    fn the_clips_in_the_repository_are_what_this_program_draws() {
        for clip in &CLIPS {
            let path = format!("{}/../../scripts/overlays/{}.mp4", env!("CARGO_MANIFEST_DIR"), clip.name);
            let file = std::fs::read(&path).unwrap();
            let effect = clip.effect();
            let decoded = lumas(&file, 25);
            assert_eq!(decoded.len(), 25, "{path}");
            for number in [0, 7, 21, 24] {
                let drawn = planes(&clip.frame(effect.as_ref(), number));
                let differences = decoded[number].iter().zip(&drawn).map(|(a, b)| u64::from(a.abs_diff(*b)));
                let mean = differences.sum::<u64>() as f64 / (SIZE.0 * SIZE.1) as f64;
                println!("{} {number}: {mean:.2}", clip.name);
                assert!(mean < 3.0, "{path}, frame {number}: {mean} off; write the clips again");
            }
        }
    }
}
