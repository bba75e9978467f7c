//! Rolling shutter: rows are read one after the other, so what moves is sheared, and what vibrates wobbles.

use pdk_sdk::prelude::*;

/// Shifts are whole numbers of this fraction of a pixel.
const SUBPIXELS: f64 = 256.0;

/// Reads rows one after the other.
#[derive(Default)]
pub struct RollingShutter {
    /// The profiles of this frame and of the one before.
    profiles: [Vec<i32>; 2],
}

impl Component for RollingShutter {
    fn description() -> Description {
        Description::perturbation(
            "rolling_shutter",
            "Reads the rows of a frame one after the other, so that a turn shears the picture, and the vibration of the mount makes it wobble",
        )
        .family("camera")
        .dynamic()
        .not_default()
        .alters_geometry()
        .history(1)
        .mathematics("frame(x - m readout y / (H dt) - a W sin(2 pi f (t + readout y / H) + phase), y), m the motion to the side since the frame before")
        .drawn_per_sequence("the phase of the vibration")
        .source("Liang, Chang and Chen, Analysis and compensation of rolling shutter effect (2008)")
        .parameter(
            Parameter::by_level("readout", [0.01, 0.02, 0.03, 0.04, 0.05], "how long it takes to read all rows").range(0.0, 1.0).unit("s"),
        )
        .parameter(
            Parameter::by_level("vibration", [0.001, 0.002, 0.005, 0.01, 0.02], "how far the mount vibrates to either side, as a share of the width")
                .range(0.0, 0.2),
        )
        .parameter(Parameter::number("frequency", 35.0, "how often the mount vibrates").range(0.0, 1000.0).unit("Hz"))
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self::default())
    }
}

/// How bright each column is below the horizon, where the picture moves to the side as a whole when the vehicle turns.
fn profile(frame: Frame<'_>, into: &mut Vec<i32>) {
    into.clear();
    into.resize(frame.width(), 0);
    for row in frame.rows().skip(frame.height() / 3).step_by(2) {
        for (sum, pixel) in into.iter_mut().zip(row.chunks_exact(3)) {
            *sum += i32::from(pixel[1]);
        }
    }
}

/// By how many pixels one profile lies to the right of another: the shift at which they differ least, and the vertex of the parabola through
/// the differences around it.
fn shift(before: &[i32], now: &[i32]) -> f64 {
    let width = now.len() as isize;
    let most = width / 8;
    let difference = |shift: isize| -> f64 {
        let (from, to) = (shift.max(0), (width + shift).min(width));
        let sum: i64 =
            (from..to).map(|x| i64::from((now[x as usize] - before[(x - shift) as usize]).abs())).sum();
        sum as f64 / (to - from) as f64
    };
    if most < 2 {
        return 0.0;
    }
    let (mut best, mut least) = (0, difference(0));
    // The nearest first, so that an even picture stands still.
    for reach in 1..=most {
        for shift in [-reach, reach] {
            let found = difference(shift);
            if found < least {
                (best, least) = (shift, found);
            }
        }
    }
    if best.abs() == most {
        return 0.0;
    }
    let (left, right) = (difference(best - 1), difference(best + 1));
    let bend = left + right - 2.0 * least;
    let vertex = if bend > 0.0 { 0.5 * (left - right) / bend } else { 0.0 };
    best as f64 + vertex
}

/// Writes a row that is moved to the right by a number of pixels; what comes in is the pixel at the edge.
fn moved(from: &[u8], to: &mut [u8], pixels: f64) {
    let width = from.len() / 3;
    let pixels = if pixels.is_nan() { 0.0 } else { pixels };
    let whole = pixels.floor();
    let right = ((pixels - whole) * SUBPIXELS).round() as u16;
    let left = SUBPIXELS as u16 - right;
    // The pixels of the result from `first` to `end` lie between two of the row; the others show its edge.
    let first = (whole + 1.0).clamp(0.0, width as f64) as usize;
    let end = (whole + width as f64).clamp(first as f64, width as f64) as usize;
    let start = (first as f64 - whole) as usize;
    let (before, rest) = to.split_at_mut(3 * first);
    let (between, after) = rest.split_at_mut(3 * (end - first));
    before.chunks_exact_mut(3).for_each(|pixel| pixel.copy_from_slice(&from[..3]));
    after.chunks_exact_mut(3).for_each(|pixel| pixel.copy_from_slice(&from[3 * (width - 1)..]));
    if between.is_empty() {
        return;
    }
    let (here, earlier) = (&from[3 * start..], &from[3 * (start - 1)..]);
    for ((to, &here), &earlier) in between.iter_mut().zip(here).zip(earlier) {
        let sum = left * u16::from(here) + right * u16::from(earlier) + 128;
        *to = (sum >> 8) as u8;
    }
}

impl Perturbation for RollingShutter {
    fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let (width, height) = (src.width() as f64, src.height() as f64);
        let readout = cx.number("readout");
        let motion = match cx.history.back(1) {
            Some(before) if cx.time > before.time => {
                let [then, now] = &mut self.profiles;
                profile(before.frame, then);
                profile(src, now);
                shift(then, now) * readout / (cx.time - before.time)
            }
            _ => 0.0,
        };
        let phase = cx.sequence_random().unit();
        let (amplitude, frequency) = (cx.number("vibration") * width, cx.number("frequency"));
        for (y, (to, from)) in dst.rows_mut().zip(src.rows()).enumerate() {
            let down = y as f64 / height;
            let turn = 2.0 * std::f64::consts::PI * (frequency * (cx.time + readout * down) + phase);
            moved(from, to, motion * down + amplitude * libm::sin(turn));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::serde_json::json;

    use super::*;
    use crate::test_frames::{even, perturbed};

    /// A frame with soft stripes that are this far to the right.
    fn stripes(right: f64) -> FrameBuf {
        let mut frame = FrameBuf::new(160, 60);
        for row in frame.as_mut().rows_mut() {
            for (x, pixel) in row.chunks_exact_mut(3).enumerate() {
                let place = x as f64 - right;
                let value = 128.0 + 60.0 * libm::sin(place / 9.0) + 50.0 * libm::sin(place / 23.0 + 1.0);
                pixel.fill(value.round() as u8);
            }
        }
        frame
    }

    #[test]
    fn the_motion_to_the_side_is_found_to_a_quarter_of_a_pixel() {
        let mut profiles = [Vec::new(), Vec::new()];
        for motion in [-11.0, -3.5, 0.0, 1.25, 7.0] {
            profile(stripes(0.0).as_ref(), &mut profiles[0]);
            profile(stripes(motion).as_ref(), &mut profiles[1]);
            let found = shift(&profiles[0], &profiles[1]);
            assert!((found - motion).abs() < 0.25, "{motion}: {found}");
        }
        assert_eq!(shift(&[7; 40], &[7; 40]), 0.0);
    }

    #[test]
    fn a_turn_shears_the_picture_as_far_as_rows_are_late() {
        // Four pixels in a frame, and rows that take half a frame to read.
        let given = json!({"readout": 0.025, "vibration": 0});
        let found = perturbed::<RollingShutter>(&given, 2.0, (5, 0.25), &[stripes(0.0), stripes(4.0)]);
        for (y, row) in found.as_ref().rows().enumerate() {
            let expected = stripes(4.0 + 2.0 * y as f64 / 60.0);
            let worst = row[30..450]
                .iter()
                .zip(&expected.as_ref().row(y)[30..450])
                .map(|(a, b)| a.abs_diff(*b))
                .max();
            assert!(worst.unwrap() <= 4, "row {y}: {worst:?}");
        }
    }

    #[test]
    fn without_motion_and_vibration_nothing_changes() {
        let found = perturbed::<RollingShutter>(
            &json!({"vibration": 0}),
            4.0,
            (5, 0.25),
            &[stripes(0.0), stripes(0.0)],
        );
        assert_eq!(found, stripes(0.0));
        assert_eq!(
            perturbed::<RollingShutter>(&json!({}), 4.0, (5, 0.25), &[even(9, 30, 20)]),
            even(9, 30, 20)
        );
    }

    #[test]
    fn a_row_is_moved_like_its_pixels() {
        let from: Vec<u8> = (0..60u8).map(|value| value.wrapping_mul(37)).collect();
        for step in -130..=130 {
            let pixels = f64::from(step) * 0.3;
            let mut to = [0; 60];
            moved(&from, &mut to, pixels);
            let whole = pixels.floor();
            let right = ((pixels - whole) * SUBPIXELS).round() as u32;
            for (at, &found) in to.iter().enumerate() {
                let place = (at / 3) as isize - whole as isize;
                let value = |x: isize| u32::from(from[3 * x.clamp(0, 19) as usize + at % 3]);
                let sum = (256 - right) * value(place) + right * value(place - 1) + 128;
                assert_eq!(u32::from(found), sum >> 8, "{pixels} {at}");
            }
        }
    }

    #[test]
    fn a_row_is_moved_by_whole_and_by_half_pixels() {
        let from: Vec<u8> = [10, 20, 40, 80].iter().flat_map(|value| [*value; 3]).collect();
        let row = |pixels: f64| {
            let mut to = [0; 12];
            moved(&from, &mut to, pixels);
            [to[0], to[3], to[6], to[9]]
        };
        assert_eq!((row(0.0), row(1.0), row(-2.0)), ([10, 20, 40, 80], [10, 10, 20, 40], [40, 80, 80, 80]));
        assert_eq!((row(0.5), row(-0.5)), ([10, 15, 30, 60], [15, 30, 60, 80]));
    }

    #[test]
    fn rules() {
        pdk_sdk::testing::perturbation::<RollingShutter>();
        crate::allocations::on_the_first_frames_alone::<RollingShutter>();
    }
}
