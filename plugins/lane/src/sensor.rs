//! What a camera makes of the light: exposure, vignetting and noise.

use pdk_sdk::prelude::{FrameMut, Key, Random};

use crate::room::byte;
use crate::simd::{padded, vectorised};

/// How a camera is set; see the parameters of the same names.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Setting {
    /// Standard deviation in medium grey if nothing is amplified, of 255.
    pub noise: f64,
    /// How far exposure makes up for the brightness of a scene, from 0 to 1.
    pub exposure: f64,
    /// The share of the light that the corners lose.
    pub vignetting: f64,
}

/// The mean brightness that exposure aims at, and its limits as factors.
const AIM: f64 = 105.0;
const AMPLIFICATION: (f64, f64) = (0.7, 3.0);
/// Every this many pixels and rows count for the exposure.
const METERED: usize = 6;
/// Standard normal values that are kept; a row of noise begins anywhere among them.
const KEPT: usize = 1 << 16;
/// The share of the noise's variance that is there in the dark, from reading the sensor out.
const READING: f32 = 0.12;

/// A camera's sensor for one frame size.
#[derive(Debug)]
pub struct Sensor {
    setting: Setting,
    width: usize,
    /// How much light of the middle is left at each value of a row, by its distance from the middle column alone; and for each
    /// squared unit of the distance from the middle row.
    across: Vec<f32>,
    falls: f32,
    height: usize,
    /// Normal values, those of one row's length more than begin a row.
    noise: Vec<f32>,
}

impl Sensor {
    /// The sensor; nothing if it changes nothing.
    pub fn new(setting: Setting, [width, height]: [usize; 2], random: &mut Random) -> Option<Self> {
        let Setting { noise, exposure, vignetting } = setting;
        if noise == 0.0 && exposure == 0.0 && vignetting == 0.0 {
            return None;
        }
        // The corner is one unit away from the middle.
        let unit = ((width * width + height * height) as f64).sqrt() / 2.0;
        let across = (0..width).flat_map(|x| {
            let off = (x as f64 + 0.5 - width as f64 / 2.0) / unit;
            [(1.0 - vignetting * off * off) as f32; 3]
        });
        let mut across: Vec<f32> = across.collect();
        across.resize(padded(width * 3), 1.0);
        Some(Self {
            setting,
            width,
            across,
            falls: (vignetting / (unit * unit)) as f32,
            height,
            noise: if noise > 0.0 { kept_noise(KEPT + padded(width * 3), random) } else { Vec::new() },
        })
    }

    /// Changes a frame into what the camera delivers; `key` is that of the scenario.
    pub fn expose(&self, frame: &mut FrameMut<'_>, key: &Key, number: u64) {
        let gain = self.gain(frame);
        let noise = self.setting.noise as f32;
        let mut random = key.frame(number);
        for (y, row) in frame.rows_mut().enumerate() {
            let off = y as f32 + 0.5 - self.height as f32 / 2.0;
            let lost = self.falls * off * off;
            if self.noise.is_empty() {
                amplify(gain, lost, &self.across, row);
            } else {
                let first = random.next_u32() as usize % KEPT;
                let values = &self.noise[first..first + self.width * 3];
                // What is amplified is noise too.
                expose_row((gain, lost, noise * noise / 128.0), &self.across, values, row);
            }
        }
    }

    /// What brightness is multiplied with.
    fn gain(&self, frame: &FrameMut<'_>) -> f32 {
        if self.setting.exposure == 0.0 {
            return 1.0;
        }
        let frame = frame.as_ref();
        let (mut sum, mut count) = (0u64, 0u64);
        // The sky counts a third of what lies below.
        for y in (METERED / 2..frame.height()).step_by(METERED) {
            let weight = if y * 5 < frame.height() * 2 { 1 } else { 3 };
            for pixel in frame.row(y).chunks_exact(3).step_by(METERED) {
                let [r, g, b] = [pixel[0], pixel[1], pixel[2]].map(u64::from);
                sum += weight * (r * 54 + g * 183 + b * 19);
                count += weight * 256;
            }
        }
        if count == 0 {
            return 1.0;
        }
        let mean = (sum as f64 / count as f64).max(1.0);
        libm::pow(AIM / mean, self.setting.exposure).clamp(AMPLIFICATION.0, AMPLIFICATION.1) as f32
    }
}

/// Normal values, each correlated with its neighbours of the same colour: a sensor measures one colour per pixel and interpolates the others.
fn kept_noise(count: usize, random: &mut Random) -> Vec<f32> {
    let raw: Vec<f32> = (0..count + 6).map(|_| random.normal() as f32).collect();
    let norm = 1.0 / (0.5f32 * 0.5 + 2.0 * 0.25 * 0.25).sqrt();
    let mixed = |i: usize| 0.25 * raw[i] + 0.5 * raw[i + 3] + 0.25 * raw[i + 6];
    (0..count).map(|i| mixed(i) * norm).collect()
}

/// Brightness towards the upper end is compressed, as films and cameras do, so that little is burnt out.
#[inline(always)]
fn toned(value: f32) -> f32 {
    const KNEE: f32 = 180.0;
    let over = (value - KNEE).max(0.0);
    value - over + over / (1.0 + over * (1.0 / 75.0))
}

vectorised! {
    fn amplify / amplify_avx2 / amplify_avx512(gain: f32, lost: f32, across: &[f32], row: &mut [u8]) {
        for (value, across) in row.iter_mut().zip(across) {
            *value = byte(tone_where_needed(f32::from(*value) * (gain * (across - lost)), gain));
        }
    }
}

/// What is not amplified needs no room at the upper end.
#[inline(always)]
fn tone_where_needed(value: f32, gain: f32) -> f32 {
    if gain > 1.0 { toned(value) } else { value }
}

vectorised! {
    fn expose_row / expose_row_avx2 / expose_row_avx512(light: (f32, f32, f32), across: &[f32], noise: &[f32], row: &mut [u8]) {
        let (gain, lost, variance) = light;
        let count = row.len();
        let (across, noise) = (&across[..count], &noise[..count]);
        for i in 0..count {
            // As many photons as light: the noise of what is there grows as its root, and is amplified with it.
            let light = f32::from(row[i]) * (across[i] - lost);
            let spread = ((light + READING * 128.0) * variance).sqrt();
            row[i] = byte(tone_where_needed((light + spread * noise[i]) * gain, gain));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_sdk::prelude::FrameBuf;

    use crate::simd::portably;

    fn sensor(noise: f64, exposure: f64, vignetting: f64) -> Option<Sensor> {
        Sensor::new(Setting { noise, exposure, vignetting }, [64, 48], &mut Key([1; 32]).sequence())
    }

    fn grey(value: u8) -> FrameBuf {
        FrameBuf::from_vec(vec![value; 64 * 48 * 3], 64, 48).unwrap()
    }

    fn exposed(sensor: &Sensor, mut frame: FrameBuf, number: u64) -> FrameBuf {
        sensor.expose(&mut frame.as_mut(), &Key([2; 32]), number);
        frame
    }

    fn statistics(frame: &FrameBuf) -> (f64, f64) {
        let values: Vec<f64> = frame.data().iter().map(|value| f64::from(*value)).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let variance = values.iter().map(|value| (value - mean) * (value - mean)).sum::<f64>();
        (mean, (variance / values.len() as f64).sqrt())
    }

    #[test]
    fn a_perfect_camera_is_none() {
        assert!(sensor(0.0, 0.0, 0.0).is_none() && sensor(0.0, 0.0, 0.1).is_some());
    }

    #[test]
    fn noise_is_as_strong_as_asked_for_and_weaker_in_the_dark() {
        let sensor = sensor(6.0, 0.0, 0.0).unwrap();
        let (mean, medium) = statistics(&exposed(&sensor, grey(128), 0));
        assert!((mean - 128.0).abs() < 0.5 && (medium - 6.3).abs() < 0.4, "{mean} {medium}");
        let (_, dark) = statistics(&exposed(&sensor, grey(30), 0));
        assert!((2.0..4.5).contains(&dark), "{dark}");
        // Each frame has noise of its own, always the same.
        assert_eq!(exposed(&sensor, grey(128), 7), exposed(&sensor, grey(128), 7));
        assert_ne!(exposed(&sensor, grey(128), 7), exposed(&sensor, grey(128), 8));
    }

    #[test]
    fn exposure_brightens_the_dark_and_its_noise() {
        let sensor = sensor(4.0, 0.6, 0.0).unwrap();
        let (mean, spread) = statistics(&exposed(&sensor, grey(20), 0));
        assert!(mean > 45.0 && mean < 70.0, "{mean}");
        assert!(spread > 4.0, "{spread}");
        let (bright, _) = statistics(&exposed(&sensor, grey(230), 0));
        assert!(bright < 190.0, "{bright}");
    }

    #[test]
    fn corners_lose_light() {
        let frame = exposed(&sensor(0.0, 0.0, 0.4).unwrap(), grey(200), 0);
        let (corner, middle) = (frame.as_ref().pixel(0, 0)[0], frame.as_ref().pixel(32, 24)[0]);
        assert!((119..=124).contains(&corner) && middle == 200, "{corner} {middle}");
    }

    #[test]
    fn every_processor_exposes_alike() {
        let gradient = || {
            let values = (0..64 * 48 * 3).map(|i| (i % 251) as u8).collect();
            FrameBuf::from_vec(values, 64, 48).unwrap()
        };
        for sensor in [sensor(5.0, 0.6, 0.3), sensor(0.0, 1.0, 0.3)].map(Option::unwrap) {
            let found = exposed(&sensor, gradient(), 3);
            assert_eq!(found, portably(|| exposed(&sensor, gradient(), 3)));
        }
    }
}
