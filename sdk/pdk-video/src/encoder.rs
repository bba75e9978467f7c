//! Encodes frames as H.264, with one quantiser for all of them.

use openh264::OpenH264API;
use openh264::encoder::{
    BitRate, Complexity, EncoderConfig, FrameRate, IntraFramePeriod, Profile, QpRange, RateControlMode,
    VuiConfig,
};
use openh264::formats::YUVSlices;
use pdk_sdk::error::Place;
use pdk_sdk::prelude::*;

use crate::convert::Yuv420;
use crate::reader::START_CODE;

/// The quantiser of every frame, of 0 (best) to 51: noise and fine structure are what a perturbation is looked at for.
const QUANTISER: u8 = 20;
/// The smallest side in pixels that the encoder takes, and the longest of the longer and of the shorter side.
const SHORTEST: usize = 16;
const LONGEST: (usize, usize) = (3840, 2160);

/// Encodes frames of one size, one after the other.
pub struct Encoder {
    encoder: openh264::encoder::Encoder,
    width: usize,
    height: usize,
    frames: u64,
    planes: Yuv420,
}

/// The units of a frame, without start codes.
pub struct Units {
    /// The parameter sets of the sequence and of the picture, if they come with it.
    pub parameters: [Option<Vec<u8>>; 2],
    /// The picture.
    pub slices: Vec<Vec<u8>>,
    /// Whether it can be decoded alone.
    pub alone: bool,
}

impl Encoder {
    /// The codec and the quality, for people and manifests.
    pub fn describe() -> String {
        format!("H.264 with quantiser {QUANTISER}, which is lossy")
    }

    /// An encoder whose frames can be decoded alone every `keys` frames; with 0 only the first and those that are asked for.
    ///
    /// # Errors
    /// If the size cannot be encoded, or the encoder does not start.
    pub fn new(width: usize, height: usize, rate: f64, keys: u32) -> Result<Self> {
        check_size(width, height)?;
        // Says only which level of the standard the file claims; what noise takes at this quantiser, and no more than the
        // highest level allows.
        let bits = (width as f64 * height as f64 * rate * 2.0).clamp(100_000.0, 240_000_000.0) as u32;
        // In this mode the quantiser is chosen by the frame, and here it has no choice. So nothing depends on how long
        // encoding takes.
        let config = EncoderConfig::new()
            .rate_control_mode(RateControlMode::Bufferbased)
            .bitrate(BitRate::from_bps(bits))
            .qp(QpRange::new(QUANTISER, QUANTISER))
            .max_frame_rate(FrameRate::from_hz(rate as f32))
            .intra_frame_period(IntraFramePeriod::from_num_frames(keys))
            .complexity(Complexity::Low)
            .profile(Profile::Main)
            .vui(VuiConfig::bt601())
            .skip_frames(false)
            .scene_change_detect(false)
            .adaptive_quantization(false)
            .background_detection(false)
            .num_threads(1);
        let encoder = openh264::encoder::Encoder::with_api_config(OpenH264API::from_source(), config)
            .place("the H.264 encoder does not start")?;
        Ok(Self { encoder, width, height, frames: 0, planes: Yuv420::default() })
    }

    /// Width and height of the frames.
    pub fn size(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    /// Encodes the next frame, which has the size of all; with `alone` so that it can be decoded alone.
    ///
    /// # Errors
    /// If it cannot be encoded.
    pub fn encode(&mut self, frame: Frame<'_>, alone: bool) -> Result<Units> {
        let (width, height) = (self.width, self.height);
        if alone && self.frames > 0 {
            self.encoder.force_intra_frame();
        }
        self.planes.fill(frame);
        let [luma, blue, red] = self.planes.planes();
        let source = YUVSlices::new((luma, blue, red), (width, height), (width, width / 2, width / 2));
        let stream = self.encoder.encode(&source).place("the frame cannot be encoded")?;
        let mut units = Units { parameters: [None, None], slices: Vec::new(), alone: false };
        for layer in (0..stream.num_layers()).filter_map(|number| stream.layer(number)) {
            for unit in (0..layer.nal_count()).filter_map(|number| layer.nal_unit(number)) {
                let unit = without_start_code(unit);
                // The kinds of ITU-T H.264, table 7-1.
                match unit.first().map_or(0, |byte| byte & 31) {
                    7 => units.parameters[0] = Some(unit.to_vec()),
                    8 => units.parameters[1] = Some(unit.to_vec()),
                    kind @ (1 | 5) => {
                        units.alone |= kind == 5;
                        units.slices.push(unit.to_vec());
                    }
                    _ => {}
                }
            }
        }
        if units.slices.is_empty() {
            return Err(Error::new(format!("the encoder left out frame {}", self.frames)));
        }
        self.frames += 1;
        Ok(units)
    }
}

impl Units {
    /// All of them as a stream has them (ITU-T H.264, annex B).
    pub fn to_stream(&self) -> Vec<u8> {
        let all = self.parameters.iter().flatten().chain(&self.slices);
        all.flat_map(|unit| START_CODE.iter().chain(unit)).copied().collect()
    }
}

/// Makes sure that frames of this size can be encoded.
///
/// # Errors
/// If they cannot.
pub fn check_size(width: usize, height: usize) -> Result<()> {
    let even = [width, height].map(|side| side.next_multiple_of(2).max(SHORTEST));
    if even != [width, height] {
        let [w, h] = even;
        return Err(Error::new(format!(
            "{width} x {height} cannot be encoded: H.264 needs an even width and height from {SHORTEST} pixels; pad or \
             scale the frames to {w} x {h}"
        )));
    }
    if width.max(height) > LONGEST.0 || width.min(height) > LONGEST.1 {
        let (long, short) = LONGEST;
        return Err(Error::new(format!(
            "{width} x {height} cannot be encoded: the encoder takes at most {long} x {short}; scale the frames"
        )));
    }
    Ok(())
}

fn without_start_code(unit: &[u8]) -> &[u8] {
    match unit {
        [0, 0, 0, 1, unit @ ..] | [0, 0, 1, unit @ ..] => unit,
        unit => unit,
    }
}
