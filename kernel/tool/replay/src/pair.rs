//! Films two scenarios beside each other, such as one that two drivers drove: what each driver saw, and below it how it steered and where it
//! was in its lane.

use std::path::Path;

use image::{Rgb, RgbImage};
use pdk_loop::protocol::Driven;
use pdk_preview::text::{LINE_HEIGHT, draw_in};
use pdk_record::trace::reader::read_steps;
use pdk_record::trace::step::Step;
use pdk_sdk::error::{Error, Result};
use pdk_sdk::prelude::{Frame, FrameBuf};
use pdk_video::Writer;

use crate::clip::{
    BACKGROUND, FAILURE, Frames, HELD_SECONDS, INK, Layout, MARGIN, MARKED_SECONDS, announced, nothing_to_see,
};
use crate::gauge::Gauge;
use crate::recorded::Recorded;

/// Behind what says that a drive came to the end of its road.
const DONE: Rgb<u8> = Rgb([36, 110, 70]);
/// Pixels of a letter, with which texts are cut to the width of a frame.
const LETTER: u32 = 8;

/// A scenario that was driven again.
pub struct Taken<'a> {
    /// The scenario.
    pub recorded: &'a Recorded,
    /// What came of it.
    pub driven: &'a Driven,
    /// Its new trace, in which every frame has its images.
    pub trace: &'a Path,
}

/// One of the two.
struct Side<'a> {
    taken: &'a Taken<'a>,
    frames: Frames<'a>,
    /// What comes next.
    next: Option<(Step, Vec<FrameBuf>)>,
    /// What is shown: the step, and what the driver saw.
    shown: (Step, FrameBuf),
    /// Its steering and its cross-track error.
    gauges: [Gauge; 2],
}

/// Writes a video of two scenarios beside each other. The last frame of the shorter one stays until the other one ends, and a failure is
/// marked from a second before. Nothing is there until it is complete.
///
/// # Errors
/// If one has no frames, their cameras differ, or the video cannot be written.
pub fn film(path: &Path, both: [&Taken<'_>; 2]) -> Result<()> {
    let rate = both[0].driven.rate;
    if both[1].driven.rate != rate {
        return Err(Error::new(format!(
            "scenarios {} and {} have {rate} and {} frames a second, so they cannot be shown beside each other; choose two of the same simulator",
            both[0].recorded.number, both[1].recorded.number, both[1].driven.rate
        )));
    }
    let mut opened = Vec::new();
    for taken in both {
        let mut frames = Frames::open(taken.trace)?;
        let Some((step, mut pictures)) = frames.read()? else {
            return Err(nothing_to_see(path, taken.recorded, &taken.driven.outcome));
        };
        opened.push((taken, frames, step, pictures.swap_remove(1)));
    }
    let size = |frame: &FrameBuf| (frame.width() as u32, frame.height() as u32);
    let (width, height) = size(&opened[0].3);
    if size(&opened[1].3) != (width, height) {
        return Err(Error::new(format!(
            "the cameras of scenarios {} and {} have different sizes, so they cannot be shown beside each other; choose two of the same camera",
            both[0].recorded.number, both[1].recorded.number
        )));
    }
    let layout = Layout::new(width, height, 2);
    let (width, height) = layout.size;
    let mut base = RgbImage::from_pixel(width, height, BACKGROUND);
    let mut largest: f64 = 0.5;
    for taken in both {
        let errors = read_steps(taken.trace)?.into_iter().map(|step| step.state.cross_track_error.abs());
        largest = largest.max(1.1 * errors.fold(0.0, f64::max));
    }
    let seconds = both.map(|taken| taken.driven.outcome.time).into_iter().fold(1.0 / rate, f64::max);
    let place = [MARGIN, layout.text() + LINE_HEIGHT];
    let room = width - 2 * MARGIN;
    let mut sides = Vec::new();
    for (panel, (taken, mut frames, step, seen)) in (0..).zip(opened) {
        let error = [-largest, largest];
        let gauges = [
            Gauge::new("steering", "", [-1.0, 1.0], seconds, 2 * panel, room, place),
            Gauge::new("cross-track error", " m", error, seconds, 2 * panel + 1, room, place),
        ];
        gauges.iter().for_each(|gauge| gauge.prepare(&mut base));
        let fits = (layout.shown.0 / LETTER) as usize;
        let driver: String = taken.recorded.line.scenario.driver.to_string().chars().take(fits).collect();
        draw_in(&mut base, layout.left(panel), 4, &driver, INK);
        let next = frames.read()?;
        let mut side = Side { taken, frames, next, shown: (step, seen), gauges };
        side.draw(&mut base);
        sides.push(side);
    }
    let mut writer = Writer::create(path, width as usize, height as usize, rate)?;
    for number in 0..frames_of(both, rate) {
        let mut picture = RgbImage::new(0, 0);
        for side in &mut sides {
            side.go_to(number, &mut base)?;
        }
        picture.clone_from(&base);
        let time = number as f64 / rate;
        for (panel, side) in (0..).zip(&sides) {
            side.show(&mut picture, &layout, panel, time);
        }
        draw_in(&mut picture, layout.left(0), layout.text(), &both[0].recorded.short_name(), INK);
        let clock = format!("{time:.2} s    frame {number}");
        draw_in(&mut picture, layout.left(1), layout.text(), &clock, INK);
        writer.push(Frame::new(&picture, width as usize, height as usize).map_err(Error::new)?)?;
    }
    writer.finish()
}

/// How many frames the video has: as many as the longer scenario, and a second more if one failed.
fn frames_of(both: [&Taken<'_>; 2], rate: f64) -> u64 {
    let frames = both.map(|taken| taken.driven.outcome.frames + taken.driven.outcome.skipped_frames);
    let failed = both.iter().any(|taken| !taken.driven.outcome.success);
    let held = if failed { (rate * HELD_SECONDS).round() as u64 } else { 0 };
    frames[0].max(frames[1]) + held
}

impl Side<'_> {
    /// Goes on to the last step that is not after this frame.
    fn go_to(&mut self, number: u64, base: &mut RgbImage) -> Result<()> {
        while self.next.as_ref().is_some_and(|(step, _)| step.sequence <= number) {
            if let Some((step, mut pictures)) = self.next.take() {
                self.shown = (step, pictures.swap_remove(1));
                self.draw(base);
            }
            self.next = self.frames.read()?;
        }
        Ok(())
    }

    fn values(&self) -> [f64; 2] {
        let step = &self.shown.0;
        [step.control.steering, step.state.cross_track_error]
    }

    /// Goes on with the curves.
    fn draw(&mut self, base: &mut RgbImage) {
        let (values, time) = (self.values(), self.shown.0.state.time);
        for (gauge, value) in self.gauges.iter_mut().zip(values) {
            gauge.draw_curve(base, time, value);
        }
    }

    /// Shows what the driver sees at this time, and how it ends.
    fn show(&self, picture: &mut RgbImage, layout: &Layout, panel: u32, time: f64) {
        layout.show(picture, layout.left(panel), self.shown.1.as_ref());
        for (gauge, value) in self.gauges.iter().zip(self.values()) {
            gauge.draw_value(picture, value);
        }
        let outcome = &self.taken.driven.outcome;
        // Half a millisecond allows for times that are sums of rounded frame times.
        let left = outcome.time - time - 0.0005;
        if !outcome.success && left <= MARKED_SECONDS {
            layout.mark(picture, panel);
            layout.tell(picture, panel, &announced(outcome.cause.text(), left), FAILURE);
        } else if outcome.success && left <= 0.0 {
            layout.tell(picture, panel, outcome.cause.text(), DONE);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_loop::stages::Times;
    use pdk_record::trace::step::ImageTopic;
    use pdk_record::trace::writer::Trace;
    use pdk_sdk::prelude::State;

    fn recorded(number: u64, cause: &str, frames: u64, time: f64) -> Recorded {
        let value = serde_json::json!({
            "id": "00".repeat(16), "name": "fog@2", "images_every": 0, "success": cause == "finished", "cause": cause,
            "time": time, "frames": frames, "progress": 0.5, "mean_cross_track_error": 0.0, "max_cross_track_error": 0.0, "digest": "",
            "scenario": {"simulator": {"name": "lane"}, "driver": {"name": format!("driver{number}")}, "duration": 9.0, "seed": 0},
        });
        Recorded { number, line: serde_json::from_value(value).unwrap() }
    }

    /// Steps at four frames a second, of which the driver saw frames of this brightness.
    fn write_trace(path: &Path, recorded: &Recorded, brightness: u8, width: usize) {
        let mut trace = Trace::create(path, &recorded.line.id).unwrap();
        for sequence in 0..recorded.line.outcome.frames {
            let state = State { time: sequence as f64 / 4.0, ..State::default() };
            trace.step(&Step { sequence, state, ..Step::default() }).unwrap();
            let data = vec![brightness + 8 * sequence as u8; width * 16 * 3];
            let frame = Frame::new(&data, width, 16).unwrap();
            for topic in [ImageTopic::Raw, ImageTopic::Perturbed] {
                trace.image(topic, sequence, state.time, frame).unwrap();
            }
        }
        trace.finish().unwrap();
    }

    fn driven(recorded: &Recorded) -> Driven {
        let outcome = recorded.line.outcome.clone();
        Driven { outcome, rate: 4.0, times: Times::default(), warnings: Vec::new() }
    }

    /// For each frame of a video and each of the two cameras whether it is marked, and its brightness.
    fn watch(path: &Path) -> Vec<[(bool, u8); 2]> {
        let mut reader = pdk_video::Reader::open_file(path).unwrap();
        let (mut planes, mut seen) = (pdk_video::Yuv420::default(), Vec::new());
        let layout = Layout::new(64, 16, 2);
        while reader.next(&mut planes).unwrap() {
            let mut picture = FrameBuf::new(planes.width, planes.height);
            planes.to_rgb(picture.as_mut());
            let of = |panel: u32| {
                let left = layout.left(panel) as usize;
                let [red, green, _] = picture.as_ref().pixel(left + 2, 60);
                (red > green + 50, picture.as_ref().pixel(left + 100, 60)[0])
            };
            seen.push([of(0), of(1)]);
        }
        seen
    }

    #[test]
    fn both_are_shown_to_the_end_of_the_longer_one_and_failures_are_marked() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let (one, two) = (recorded(1, "lane_departure", 6, 1.5), recorded(2, "finished", 10, 2.5));
        write_trace(&at("one"), &one, 20, 64);
        write_trace(&at("two"), &two, 120, 64);
        let (of_one, of_two) = (driven(&one), driven(&two));
        let taken = |recorded, driven, trace| Taken { recorded, driven, trace };
        let (first, second) = (at("one"), at("two"));
        film(&at("clip.mp4"), [&taken(&one, &of_one, &first), &taken(&two, &of_two, &second)]).unwrap();
        let seen = watch(&at("clip.mp4"));
        // Ten frames, and a second more.
        assert_eq!(seen.len(), 14);
        for (number, [left, right]) in seen.iter().enumerate() {
            let brightness = |first: u8, last: usize| first + 8 * number.min(last) as u8;
            assert!(left.1.abs_diff(brightness(20, 5)) < 6, "{number}: {left:?}");
            assert!(right.1.abs_diff(brightness(120, 9)) < 6, "{number}: {right:?}");
            // A second before the failure at 1.5 s.
            assert_eq!((left.0, right.0), (number >= 2, false), "{number}");
        }
    }

    #[test]
    fn cameras_of_different_sizes_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let (one, two) = (recorded(1, "finished", 3, 1.0), recorded(2, "finished", 3, 1.0));
        write_trace(&at("one"), &one, 20, 64);
        write_trace(&at("two"), &two, 20, 32);
        let (of_one, of_two) = (driven(&one), driven(&two));
        let (first, second) = (at("one"), at("two"));
        let both = [
            &Taken { recorded: &one, driven: &of_one, trace: &first },
            &Taken { recorded: &two, driven: &of_two, trace: &second },
        ];
        let error = film(&at("clip.mp4"), both).unwrap_err().to_string();
        assert!(error.contains("the cameras of scenarios 1 and 2 have different sizes"), "{error}");
        assert!(!at("clip.mp4").exists());
    }
}
