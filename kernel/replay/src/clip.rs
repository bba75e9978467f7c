//! Films a scenario: what the camera saw and what the driver saw side by side, and below it what the vehicle did.

use std::collections::VecDeque;
use std::path::Path;

use image::{ImageBuffer, Rgb, RgbImage, imageops};
use pdk_sdk::error::{Error, Result};
use pdk_sdk::prelude::{Camera, Frame};
use pdk_video::Writer;

use super::compare::short_name;
use super::gauge::{Gauge, fill};
use crate::chain::Spec;
use crate::drive::Outcome;
use crate::picture::{LINE_HEIGHT, draw_text_in};
use crate::record::trace_reader::Step;

/// Widths between which frames are shown, in pixels: smaller ones are enlarged so that there is room for text, larger ones
/// are reduced so that two of them fit on a screen.
const NARROWEST: u32 = 480;
const WIDEST: u32 = 960;
/// Frames are shown no higher than this.
const TALLEST: u32 = 960;

const MARGIN: u32 = 12;
/// Height of the line above the frames.
const HEADER: u32 = LINE_HEIGHT + 8;
/// Thickness of the mark around the frames of a failure.
const MARK: u32 = 6;
/// Seconds before its end in which a failure is marked.
const MARKED_SECONDS: f64 = 1.0;

const BACKGROUND: Rgb<u8> = Rgb([24, 26, 30]);
const INK: Rgb<u8> = Rgb([228, 231, 235]);
const FAILURE: Rgb<u8> = Rgb([214, 48, 49]);
const WHITE: Rgb<u8> = Rgb([255; 3]);

/// A video in the making.
pub struct Clip<'a> {
    path: &'a Path,
    film: Option<Film>,
    /// The first error while frames were written.
    failure: Option<Error>,
}

struct Film {
    writer: Writer,
    layout: Layout,
    title: String,
    perturbations: Vec<Spec>,
    /// What does not change from frame to frame, with the curves as far as they have come.
    base: RgbImage,
    gauges: [Gauge; 4],
    /// Pictures that are not written yet, with their times: only the end says whether they show a failure.
    waiting: VecDeque<(f64, RgbImage)>,
    /// How many wait at most.
    delay: usize,
    /// Frames a second.
    rate: f64,
    /// The number of the next frame.
    next: u64,
}

/// Where things are, in pixels.
#[derive(Clone, Copy)]
struct Layout {
    /// Size of a shown frame.
    shown: (u32, u32),
    /// How many times it is enlarged; 0 where it is reduced.
    factor: u32,
    /// Left edges of the two frames.
    left: [u32; 2],
    /// Size of the video.
    size: (u32, u32),
}

impl Layout {
    fn new(camera: Camera) -> Self {
        let (width, height) = (camera.width.max(1), camera.height.max(1));
        let (shown, factor) = if width > WIDEST || height > TALLEST {
            let scale = (f64::from(WIDEST) / f64::from(width)).min(f64::from(TALLEST) / f64::from(height));
            ([width, height].map(|side| (f64::from(side) * scale).round().max(1.0) as u32).into(), 0)
        } else {
            let factor = NARROWEST.div_ceil(width).min(TALLEST / height).max(1);
            ((width * factor, height * factor), factor)
        };
        let left = [MARGIN, 2 * MARGIN + shown.0];
        // The curves need room beside narrow frames.
        let width = (3 * MARGIN + 2 * shown.0).max(2 * NARROWEST);
        let height = HEADER + shown.1 + MARGIN + LINE_HEIGHT + Gauge::HEIGHT + MARGIN;
        // The encoder takes even sizes.
        Self { shown, factor, left, size: (width.next_multiple_of(2), height.next_multiple_of(2)) }
    }

    /// The top of the text below the frames.
    fn text(&self) -> u32 {
        HEADER + self.shown.1 + MARGIN / 2
    }
}

impl<'a> Clip<'a> {
    /// A video at this path; nothing is there until it is complete.
    pub fn new(path: &'a Path) -> Self {
        Self { path, film: None, failure: None }
    }

    /// Begins the video of a scenario whose record this is.
    ///
    /// # Errors
    /// Where it cannot be written.
    pub fn start(&mut self, camera: Camera, recorded: &Outcome, steps: &[Step]) -> Result<()> {
        let layout = Layout::new(camera);
        let (width, height) = layout.size;
        let writer = Writer::create(self.path, width as usize, height as usize, camera.rate)?;
        let mut base = RgbImage::from_pixel(width, height, BACKGROUND);
        draw_text_in(&mut base, layout.left[0], 4, "what the camera saw", INK);
        let largest = |value: fn(&Step) -> f64| steps.iter().map(value).fold(0.0, |a: f64, b| a.max(b.abs()));
        let speed = (largest(|step| step.state.speed) * 1.1).max(1.0);
        let error = (largest(|step| step.state.cross_track_error) * 1.1).max(0.5);
        let (top, room) = (layout.text() + LINE_HEIGHT, width - 2 * MARGIN);
        let end = recorded.time.max(1.0 / camera.rate);
        let gauges = [
            ("steering", "", -1.0, 1.0),
            ("throttle", "", -1.0, 1.0),
            ("speed", " m/s", 0.0, speed),
            ("cross-track error", " m", -error, error),
        ];
        let mut column = 0;
        let gauges = gauges.map(|(name, unit, from, to)| {
            let gauge = Gauge::new(name, unit, [from, to], end, column, room, [MARGIN, top]);
            gauge.prepare(&mut base);
            column += 1;
            gauge
        });
        let title = format!("scenario {}: {}", recorded.index, short_name(&recorded.scenario));
        let perturbations = recorded.scenario.perturbations.clone();
        let delay = (camera.rate * MARKED_SECONDS).ceil() as usize + 1;
        let waiting = VecDeque::with_capacity(delay + 1);
        let (rate, next) = (camera.rate, 0);
        self.film =
            Some(Film { writer, layout, title, perturbations, base, gauges, waiting, delay, rate, next });
        self.failure = None;
        Ok(())
    }

    /// Adds a frame.
    pub fn step(&mut self, step: &Step, raw: Frame<'_>, perturbed: Frame<'_>) {
        if let Some(film) = &mut self.film
            && self.failure.is_none()
        {
            self.failure = film.step(step, raw, perturbed).err();
        }
    }

    /// Completes the video of a scenario that came to this end.
    ///
    /// # Errors
    /// Where it cannot be written, or there were no frames.
    pub fn finish(&mut self, outcome: &Outcome) -> Result<()> {
        let Some(mut film) = self.film.take() else { return Ok(()) };
        if let Some(failure) = self.failure.take() {
            return Err(failure);
        }
        if film.waiting.is_empty() {
            let error = outcome.error.as_deref().unwrap_or("it has no frames");
            let (index, path) = (outcome.index, self.path.display());
            return Err(Error::new(format!(
                "there is nothing to see of scenario {index} for {path}: {error}"
            )));
        }
        while let Some((time, mut picture)) = film.waiting.pop_front() {
            // Half a millisecond allows for times that are sums of rounded frame times.
            if !outcome.success && time + 0.0005 >= outcome.time - MARKED_SECONDS {
                film.layout.mark(&mut picture, outcome.cause.text());
            }
            film.write(&picture)?;
        }
        film.writer.finish()
    }
}

impl Film {
    fn step(&mut self, step: &Step, raw: Frame<'_>, perturbed: Frame<'_>) -> Result<()> {
        let Step { sequence, state, control, .. } = step;
        // Frames that were skipped in real time: the one before stays.
        for skipped in self.next..*sequence {
            let Some((_, last)) = self.waiting.back() else { break };
            let last = last.clone();
            let mut picture = self.blank()?;
            picture.copy_from_slice(&last);
            self.waiting.push_back((skipped as f64 / self.rate, picture));
        }
        self.next = sequence + 1;
        let values = [control.steering, control.throttle, state.speed, state.cross_track_error];
        for (gauge, value) in self.gauges.iter_mut().zip(values) {
            gauge.draw_curve(&mut self.base, state.time, value);
        }
        let mut picture = self.blank()?;
        picture.copy_from_slice(&self.base);
        for (left, frame) in self.layout.left.into_iter().zip([raw, perturbed]) {
            self.layout.show(&mut picture, left, frame);
        }
        let (left, right) = (self.layout.left[0], self.layout.left[1]);
        draw_text_in(&mut picture, right, 4, &self.seen(state.time), INK);
        draw_text_in(&mut picture, left, self.layout.text(), &self.title, INK);
        let clock = format!("{:.2} s    frame {sequence}", state.time);
        draw_text_in(&mut picture, right, self.layout.text(), &clock, INK);
        for (gauge, value) in self.gauges.iter().zip(values) {
            gauge.draw_value(&mut picture, value);
        }
        self.waiting.push_back((state.time, picture));
        Ok(())
    }

    /// A picture to draw on: the oldest that waits, once it is written.
    fn blank(&mut self) -> Result<RgbImage> {
        match self.waiting.len() < self.delay {
            true => Ok(RgbImage::new(self.base.width(), self.base.height())),
            false => {
                let Some((_, picture)) = self.waiting.pop_front() else {
                    return Err(Error::new("no picture waits to be written, which is a defect in pdk"));
                };
                self.write(&picture)?;
                Ok(picture)
            }
        }
    }

    /// What stands above the perturbed frame: the perturbations with their intensities at this time.
    fn seen(&self, time: f64) -> String {
        let perturbation = |spec: &Spec| match spec.level.at(time) {
            // Intensities that change do so by small steps.
            Some(level) if spec.level.constant().is_none() => format!("{}@{level:.2}", spec.name),
            Some(level) => format!("{}@{level}", spec.name),
            None => format!("{} off", spec.name),
        };
        match self.perturbations.is_empty() {
            true => "what the driver saw".to_owned(),
            false => {
                let perturbations: Vec<_> = self.perturbations.iter().map(perturbation).collect();
                format!("what the driver saw: {}", perturbations.join(" + "))
            }
        }
    }

    fn write(&mut self, picture: &RgbImage) -> Result<()> {
        let frame = Frame::new(picture, picture.width() as usize, picture.height() as usize)?;
        self.writer.push(frame)
    }
}

impl Layout {
    /// Shows a frame with its left edge there.
    fn show(&self, picture: &mut RgbImage, left: u32, frame: Frame<'_>) {
        let (width, height) = (frame.width() as u32, frame.height() as u32);
        if self.factor == 0 {
            // Frames that the loop delivers have no gaps between their rows.
            let view =
                frame.contiguous().and_then(|data| ImageBuffer::<Rgb<u8>, _>::from_raw(width, height, data));
            if let Some(view) = view {
                let reduced =
                    imageops::resize(&view, self.shown.0, self.shown.1, imageops::FilterType::Triangle);
                imageops::replace(picture, &reduced, i64::from(left), i64::from(HEADER));
            }
            return;
        }
        // Enlarged without smoothing: a pixel of a small camera is what the driver saw.
        let row_length = 3 * self.size.0 as usize;
        let factor = self.factor as usize;
        let data: &mut [u8] = picture;
        for (y, row) in frame.rows().enumerate() {
            let first = (HEADER as usize + y * factor) * row_length + 3 * left as usize;
            let length = 3 * self.shown.0 as usize;
            let line = &mut data[first..first + length];
            for (target, pixel) in line.chunks_exact_mut(3 * factor).zip(row.chunks_exact(3)) {
                target.chunks_exact_mut(3).for_each(|copy| copy.copy_from_slice(pixel));
            }
            for copy in 1..factor {
                data.copy_within(first..first + length, first + copy * row_length);
            }
        }
    }

    /// Marks a picture of the last moments before a failure.
    fn mark(&self, picture: &mut RgbImage, cause: &str) {
        let (width, height) = self.shown;
        for left in self.left {
            fill(picture, [left, HEADER], [width, MARK], FAILURE);
            fill(picture, [left, HEADER + height - MARK], [width, MARK], FAILURE);
            fill(picture, [left, HEADER], [MARK, height], FAILURE);
            fill(picture, [left + width - MARK, HEADER], [MARK, height], FAILURE);
        }
        let bottom = HEADER + height - MARK - LINE_HEIGHT - 4;
        fill(picture, [self.left[1], bottom], [width, LINE_HEIGHT + 4], FAILURE);
        draw_text_in(picture, self.left[1] + MARGIN, bottom + 2, cause, WHITE);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_sdk::prelude::{Control, FrameBuf, State};

    #[test]
    fn small_cameras_are_enlarged_and_large_ones_reduced_to_even_sizes() {
        let layout = |width, height| Layout::new(Camera { width, height, rate: 20.0 });
        assert_eq!((layout(80, 60).factor, layout(80, 60).shown), (6, (480, 360)));
        assert_eq!((layout(321, 241).factor, layout(321, 241).shown), (2, (642, 482)));
        assert_eq!((layout(1920, 1080).factor, layout(1920, 1080).shown), (0, (960, 540)));
        for (width, height) in [(80, 60), (321, 241), (640, 481), (961, 333), (1920, 1080)] {
            let Layout { size, left, shown, .. } = layout(width, height);
            assert!(size.0 % 2 == 0 && size.1 % 2 == 0 && left[1] + shown.0 + MARGIN <= size.0);
        }
    }

    #[test]
    fn frames_are_shown_pixel_by_pixel() {
        let layout = Layout::new(Camera { width: 240, height: 2, rate: 20.0 });
        let data: Vec<u8> = (0..240 * 2 * 3).map(|value| (value % 251) as u8).collect();
        let frame = Frame::new(&data, 240, 2).unwrap();
        let mut picture = RgbImage::from_pixel(layout.size.0, layout.size.1, BACKGROUND);
        layout.show(&mut picture, layout.left[1], frame);
        for (x, y) in [(0, 0), (1, 1), (479, 3), (240, 2)] {
            let shown = picture.get_pixel(layout.left[1] + x, HEADER + y).0;
            assert_eq!(shown, frame.pixel(x as usize / 2, y as usize / 2));
        }
        let around =
            [(layout.left[1] - 1, HEADER), (layout.left[1] + 480, HEADER), (layout.left[1], HEADER + 4)];
        assert!(around.iter().all(|&(x, y)| *picture.get_pixel(x, y) == BACKGROUND));
    }

    #[test]
    fn skipped_frames_show_the_one_before_and_the_last_second_of_a_failure_is_red() {
        let path = std::env::temp_dir().join(format!("pdk-clip-{}.mp4", std::process::id()));
        let outcome: Outcome = serde_json::from_value(serde_json::json!({
            "index": 3, "success": false, "cause": "collision", "time": 2.0, "frames": 6, "progress": 0.5,
            "scenario": {"name": "fast", "road": null, "perturbations": [], "duration": 9.0, "seed": null},
            "mean_cross_track_error": 0.0, "max_cross_track_error": 0.0, "digest": "", "telemetry": [],
            "waypoints": "",
        }))
        .unwrap();
        let data = vec![128; 64 * 16 * 3];
        let frame = Frame::new(&data, 64, 16).unwrap();
        let mut clip = Clip::new(&path);
        clip.start(Camera { width: 64, height: 16, rate: 4.0 }, &outcome, &[]).unwrap();
        for sequence in [0, 1, 2, 5, 6, 8] {
            let state = State { time: sequence as f64 / 4.0, ..State::default() };
            let step = Step { sequence, state, control: Control::default(), frame_hash: 0 };
            clip.step(&step, frame, frame);
        }
        clip.finish(&outcome).unwrap();
        let mut reader = pdk_video::Reader::open_file(&path).unwrap();
        let (mut planes, mut marked) = (pdk_video::Yuv420::default(), Vec::new());
        while reader.next(&mut planes).unwrap() {
            let mut picture = FrameBuf::new(planes.width, planes.height);
            planes.to_rgb(picture.as_mut());
            let [red, green, _] = picture.as_ref().pixel(MARGIN as usize + 2, HEADER as usize + 40);
            marked.push(red > green + 50);
        }
        assert_eq!(marked, [false, false, false, false, true, true, true, true, true]);
        // A scenario that failed before its first frame leaves nothing.
        clip.start(Camera { width: 64, height: 16, rate: 4.0 }, &outcome, &[]).unwrap();
        assert!(
            clip.finish(&outcome)
                .unwrap_err()
                .to_string()
                .starts_with("there is nothing to see of scenario 3")
        );
        std::fs::remove_file(path).unwrap();
    }
}
