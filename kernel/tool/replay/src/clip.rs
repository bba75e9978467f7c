//! Films a scenario: what the camera saw and what the driver saw side by side, beside it what its network looked at if that was
//! recorded, and below it what the vehicle did.

use std::path::Path;

use image::{ImageBuffer, Rgb, RgbImage, imageops};
use pdk_loop::protocol::Driven;
use pdk_model::during::During;
use pdk_model::outcome::Outcome;
use pdk_model::perturbation::AppliedPerturbation;
use pdk_preview::text::{LINE_HEIGHT, draw_in};
use pdk_record::trace::reader::{Entry, TraceReader, read_steps};
use pdk_record::trace::step::{ImageTopic, Step};
use pdk_sdk::error::{Error, Result};
use pdk_sdk::prelude::{Frame, FrameBuf};
use pdk_video::Writer;

use crate::gauge::{Gauge, fill, fill_border};
use crate::recorded::Recorded;

/// Widths between which frames are shown, in pixels: smaller ones are enlarged so that there is room for text, larger ones
/// are reduced so that two of them fit on a screen.
const NARROWEST: u32 = 480;
const WIDEST: u32 = 960;
/// Frames are shown no higher than this.
const TALLEST: u32 = 960;

/// Pixels around what is shown.
pub const MARGIN: u32 = 12;
/// Height of the line above the frames.
const HEADER: u32 = LINE_HEIGHT + 8;
/// Thickness of the mark around the frames of a failure.
const MARK: u32 = 6;
/// Thickness of the outline of a box that a perturbation is limited to.
const OUTLINE: u32 = 2;
/// Seconds before its end in which a failure is marked.
pub const MARKED_SECONDS: f64 = 1.0;
/// Seconds for which the last frame of a failure stays.
pub const HELD_SECONDS: f64 = 1.0;

/// Behind everything.
pub const BACKGROUND: Rgb<u8> = Rgb([24, 26, 30]);
/// Of texts.
pub const INK: Rgb<u8> = Rgb([228, 231, 235]);
/// Of the outline of a box that is perturbed, and of one that is left out.
const PERTURBED: Rgb<u8> = Rgb([255, 176, 32]);
/// See [`PERTURBED`].
const LEFT_OUT: Rgb<u8> = Rgb([64, 196, 255]);
/// Of what failed.
pub const FAILURE: Rgb<u8> = Rgb([214, 48, 49]);
const WHITE: Rgb<u8> = Rgb([255; 3]);

/// A video in the making.
struct Film {
    writer: Writer,
    layout: Layout,
    title: String,
    perturbations: Vec<AppliedPerturbation>,
    /// What does not change from frame to frame, with the curves as far as they have come.
    base: RgbImage,
    gauges: [Gauge; 4],
    /// Frames a second.
    rate: f64,
    /// When the scenario failed, in seconds, and how; none if it did not fail.
    failure: Option<(f64, &'static str)>,
    /// The picture that was written last, without a mark.
    last: RgbImage,
    /// The number of the next frame.
    next: u64,
}

/// Where things are, in pixels.
#[derive(Clone, Copy)]
pub struct Layout {
    /// Size of a shown frame.
    pub shown: (u32, u32),
    /// How many times it is enlarged; 0 if it is reduced.
    factor: u32,
    /// How many frames stand side by side.
    panels: u32,
    /// Size of the video.
    pub size: (u32, u32),
}

impl Layout {
    /// The layout for this many frames of this size side by side.
    pub fn new(width: u32, height: u32, panels: u32) -> Self {
        let (width, height) = (width.max(1), height.max(1));
        let (shown, factor) = if width > WIDEST || height > TALLEST {
            let scale = (f64::from(WIDEST) / f64::from(width)).min(f64::from(TALLEST) / f64::from(height));
            ([width, height].map(|side| (f64::from(side) * scale).round().max(1.0) as u32).into(), 0)
        } else {
            let factor = NARROWEST.div_ceil(width).min(TALLEST / height).max(1);
            ((width * factor, height * factor), factor)
        };
        // The curves need room beside narrow frames.
        let width = (MARGIN + panels * (MARGIN + shown.0)).max(2 * NARROWEST);
        let height = HEADER + shown.1 + MARGIN + LINE_HEIGHT + Gauge::HEIGHT + MARGIN;
        // The encoder takes even sizes.
        Self { shown, factor, panels, size: (width.next_multiple_of(2), height.next_multiple_of(2)) }
    }

    /// The left edge of a frame.
    pub fn left(&self, panel: u32) -> u32 {
        MARGIN + panel * (MARGIN + self.shown.0)
    }

    /// The top of the text below the frames.
    pub fn text(&self) -> u32 {
        HEADER + self.shown.1 + MARGIN / 2
    }
}

/// The frames of a scenario that was driven again, from its new trace, in which every frame has its images.
pub struct Frames<'a> {
    path: &'a Path,
    reader: TraceReader,
    step: Option<Step>,
    raw: Option<FrameBuf>,
    attention: Option<FrameBuf>,
}

impl<'a> Frames<'a> {
    /// Opens a trace.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn open(path: &'a Path) -> Result<Self> {
        Ok(Self { path, reader: TraceReader::open(path)?, step: None, raw: None, attention: None })
    }

    /// The next step with its pictures: what the camera saw, what the driver saw, and what its network looked at where that was recorded. None
    /// after the last.
    ///
    /// # Errors
    /// If the trace is damaged, or a step has no pictures.
    pub fn read(&mut self) -> Result<Option<(Step, Vec<FrameBuf>)>> {
        let path = self.path;
        let incomplete = |step: &Step| {
            Error::new(format!("frame {} has no pictures in the trace {}", step.sequence, path.display()))
        };
        for entry in self.reader.by_ref() {
            match entry? {
                Entry::Step(next) => {
                    if let Some(before) = self.step.replace(next) {
                        return Err(incomplete(&before));
                    }
                }
                Entry::Image(image) if image.topic == ImageTopic::Raw => self.raw = Some(image.decode()?),
                Entry::Image(image) if image.topic == ImageTopic::Attention => {
                    self.attention = Some(image.decode()?);
                }
                Entry::Image(image) => {
                    let (Some(step), Some(raw)) = (self.step.take(), self.raw.take()) else { continue };
                    let pictures = [raw, image.decode()?].into_iter().chain(self.attention.take()).collect();
                    return Ok(Some((step, pictures)));
                }
                Entry::Event(_) | Entry::Road(_) => {}
            }
        }
        self.step.as_ref().map_or(Ok(None), |step| Err(incomplete(step)))
    }
}

/// The error of a scenario that left no frames for a video.
pub fn nothing_to_see(path: &Path, recorded: &Recorded, outcome: &Outcome) -> Error {
    let error = outcome.error.as_deref().unwrap_or("it has no frames");
    let (number, path) = (recorded.number, path.display());
    Error::new(format!("there is nothing to see of scenario {number} for {path}: {error}"))
}

/// Writes a video of a scenario that was driven again. If it failed, the frames of the last second are marked and the very last one stays
/// for a second. Nothing is there until it is complete.
///
/// # Errors
/// If there are no frames, or the video cannot be written.
pub fn film(path: &Path, recorded: &Recorded, driven: &Driven, trace: &Path) -> Result<()> {
    let steps = read_steps(trace)?;
    let mut frames = Frames::open(trace)?;
    let mut film: Option<Film> = None;
    while let Some((step, pictures)) = frames.read()? {
        if film.is_none() {
            film = Some(Film::start(path, recorded, driven, &steps, &pictures)?);
        }
        if let Some(film) = &mut film {
            film.step(&step, &pictures)?;
        }
    }
    match film {
        Some(film) => film.finish(&driven.outcome),
        None => Err(nothing_to_see(path, recorded, &driven.outcome)),
    }
}

impl Film {
    /// Begins the video of a scenario with these steps, whose frames stand side by side as these do.
    fn start(
        path: &Path,
        recorded: &Recorded,
        driven: &Driven,
        steps: &[Step],
        pictures: &[FrameBuf],
    ) -> Result<Self> {
        let Driven { outcome, rate, .. } = driven;
        let (width, height) = (pictures[0].width() as u32, pictures[0].height() as u32);
        let layout = Layout::new(width, height, pictures.len() as u32);
        let (width, height) = layout.size;
        let writer = Writer::create(path, width as usize, height as usize, *rate)?;
        let mut base = RgbImage::from_pixel(width, height, BACKGROUND);
        draw_in(&mut base, layout.left(0), 4, "what the camera saw", INK);
        if layout.panels > 2 {
            draw_in(&mut base, layout.left(2), 4, "what its network looked at", INK);
        }
        let largest = |value: fn(&Step) -> f64| steps.iter().map(value).fold(0.0, |a: f64, b| a.max(b.abs()));
        let speed = (largest(|step| step.state.speed) * 1.1).max(1.0);
        let error = (largest(|step| step.state.cross_track_error) * 1.1).max(0.5);
        let (top, room) = (layout.text() + LINE_HEIGHT, width - 2 * MARGIN);
        let end = outcome.time.max(1.0 / rate);
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
        let failure = (!outcome.success).then(|| (outcome.time, outcome.cause.text()));
        Ok(Self {
            writer,
            layout,
            title: format!("scenario {}: {}", recorded.number, recorded.short_name()),
            perturbations: recorded.line.scenario.perturbations.clone(),
            last: base.clone(),
            base,
            gauges,
            rate: *rate,
            failure,
            next: 0,
        })
    }

    /// Adds a frame, and before it those that were skipped in real time: the one before stays.
    fn step(&mut self, step: &Step, pictures: &[FrameBuf]) -> Result<()> {
        let Step { sequence, state, control, .. } = step;
        self.repeat_to(*sequence)?;
        let values = [control.steering, control.throttle, state.speed, state.cross_track_error];
        for (gauge, value) in self.gauges.iter_mut().zip(values) {
            gauge.draw_curve(&mut self.base, state.time, value);
        }
        let seen = self.seen(state.time);
        let picture = &mut self.last;
        picture.copy_from_slice(&self.base);
        for (panel, frame) in (0..self.layout.panels).zip(pictures) {
            self.layout.show(picture, self.layout.left(panel), frame.as_ref());
        }
        for (area, color) in boxes(&self.perturbations, state.time) {
            (0..2).for_each(|panel| self.layout.outline(picture, panel, area, color));
        }
        let (left, right) = (self.layout.left(0), self.layout.left(1));
        draw_in(picture, right, 4, &seen, INK);
        draw_in(picture, left, self.layout.text(), &self.title, INK);
        let clock = format!("{:.2} s    frame {sequence}", state.time);
        draw_in(picture, right, self.layout.text(), &clock, INK);
        for (gauge, value) in self.gauges.iter().zip(values) {
            gauge.draw_value(picture, value);
        }
        self.next = sequence + 1;
        self.write(state.time)
    }

    /// Completes the video of a scenario that came to this end.
    fn finish(mut self, outcome: &Outcome) -> Result<()> {
        self.repeat_to(outcome.frames + outcome.skipped_frames)?;
        if self.failure.is_some() {
            for _ in 0..(self.rate * HELD_SECONDS).round() as u64 {
                self.write(outcome.time)?;
            }
        }
        self.writer.finish()
    }

    /// Shows the last picture again for each frame before this one.
    fn repeat_to(&mut self, sequence: u64) -> Result<()> {
        // Before the first frame there is nothing to show.
        let from = if self.next == 0 { sequence } else { self.next };
        (from..sequence).try_for_each(|skipped| self.write(skipped as f64 / self.rate))
    }

    /// Writes the last picture as that of this time in seconds.
    fn write(&mut self, time: f64) -> Result<()> {
        let (width, height) = (self.last.width() as usize, self.last.height() as usize);
        match self.failure {
            // Half a millisecond allows for times that are sums of rounded frame times.
            Some((end, cause)) if time >= end - MARKED_SECONDS - 0.0005 => {
                let mut picture = self.last.clone();
                (0..self.layout.panels).for_each(|panel| self.layout.mark(&mut picture, panel));
                self.layout.tell(&mut picture, 1, &announced(cause, end - time), FAILURE);
                self.writer.push(Frame::new(&picture, width, height).map_err(Error::new)?)
            }
            _ => self.writer.push(Frame::new(&self.last, width, height).map_err(Error::new)?),
        }
    }

    /// What stands above the perturbed frame: the perturbations with their intensities at this time.
    fn seen(&self, time: f64) -> String {
        let level = |applied: &AppliedPerturbation| match applied.during {
            Some(during) if during.spares(time) => None,
            _ => applied.level.at(time),
        };
        let perturbation = |applied: &AppliedPerturbation| match level(applied) {
            // Intensities that change do so by small steps.
            Some(level) if applied.level.constant().is_none() => format!("{}@{level:.2}", applied.name),
            Some(level) => format!("{}@{level}", applied.name),
            None => format!("{} off", applied.name),
        };
        match self.perturbations.is_empty() {
            true => "what the driver saw".to_owned(),
            false => {
                let perturbations: Vec<_> = self.perturbations.iter().map(perturbation).collect();
                format!("what the driver saw: {}", perturbations.join(" + "))
            }
        }
    }
}

impl Layout {
    /// Shows a frame with its left edge there.
    pub fn show(&self, picture: &mut RgbImage, left: u32, frame: Frame<'_>) {
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

    /// Marks a frame of the last moments before a failure.
    pub fn mark(&self, picture: &mut RgbImage, panel: u32) {
        let (width, height) = self.shown;
        fill_border(picture, [self.left(panel), HEADER], [width, height], MARK, FAILURE);
    }

    /// Outlines a box in shares of a frame.
    fn outline(&self, picture: &mut RgbImage, panel: u32, area: [f64; 4], color: Rgb<u8>) {
        let (width, height) = self.shown;
        let place = |share: f64, all: u32| (share * f64::from(all)).round() as u32;
        let [left, right] = [area[0], area[2]].map(|share| place(share, width));
        let [top, bottom] = [area[1], area[3]].map(|share| place(share, height));
        let (across, down) = ((right - left).max(OUTLINE), (bottom - top).max(OUTLINE));
        let at = [self.left(panel) + left.min(width - across), HEADER + top.min(height - down)];
        fill_border(picture, at, [across, down], OUTLINE, color);
    }

    /// Writes at the lower edge of a frame how it ends.
    pub fn tell(&self, picture: &mut RgbImage, panel: u32, text: &str, color: Rgb<u8>) {
        let (width, height) = self.shown;
        let bottom = HEADER + height - MARK - LINE_HEIGHT - 4;
        fill(picture, [self.left(panel), bottom], [width, LINE_HEIGHT + 4], color);
        draw_in(picture, self.left(panel) + MARGIN, bottom + 2, text, WHITE);
    }
}

/// The boxes that perturbations are limited to at this time, and those that are left out, with the colours of their outlines.
fn boxes(perturbations: &[AppliedPerturbation], time: f64) -> Vec<([f64; 4], Rgb<u8>)> {
    let mut boxes = Vec::new();
    let during = perturbations.iter().filter_map(|applied| applied.during);
    for During { span, except } in during.filter(|during| !during.spares(time)) {
        for (span, color) in [(Some(span), PERTURBED), (except, LEFT_OUT)] {
            let area = span.filter(|span| span.contains(time)).and_then(|span| span.area);
            boxes.extend(area.map(|area| (area, color)).filter(|found| !boxes.contains(found)));
        }
    }
    boxes
}

/// What the mark says this many seconds before a failure, such as "lane departure in 0.8 s"; the cause alone once it has happened.
pub fn announced(cause: &str, seconds: f64) -> String {
    // Less is "in 0.0 s", which is now.
    match seconds < 0.05 {
        true => cause.to_owned(),
        false => format!("{cause} in {seconds:.1} s"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_loop::stages::Times;
    use pdk_model::outcome::Cause;
    use pdk_record::trace::writer::Trace;
    use pdk_sdk::prelude::State;

    #[test]
    fn small_cameras_are_enlarged_and_large_ones_reduced_to_even_sizes() {
        let layout = |width, height| Layout::new(width, height, 2);
        assert_eq!((layout(80, 60).factor, layout(80, 60).shown), (6, (480, 360)));
        assert_eq!((layout(321, 241).factor, layout(321, 241).shown), (2, (642, 482)));
        assert_eq!((layout(1920, 1080).factor, layout(1920, 1080).shown), (0, (960, 540)));
        for (width, height) in [(80, 60), (321, 241), (640, 481), (961, 333), (1920, 1080)] {
            for panels in [2, 3] {
                let layout = Layout::new(width, height, panels);
                let Layout { size, shown, .. } = layout;
                assert!(size.0 % 2 == 0 && size.1 % 2 == 0);
                assert!(layout.left(panels - 1) + shown.0 + MARGIN <= size.0);
            }
        }
    }

    #[test]
    fn frames_are_shown_pixel_by_pixel() {
        let layout = Layout::new(240, 2, 2);
        let data: Vec<u8> = (0..240 * 2 * 3).map(|value| (value % 251) as u8).collect();
        let frame = Frame::new(&data, 240, 2).unwrap();
        let mut picture = RgbImage::from_pixel(layout.size.0, layout.size.1, BACKGROUND);
        layout.show(&mut picture, layout.left(1), frame);
        for (x, y) in [(0, 0), (1, 1), (479, 3), (240, 2)] {
            let shown = picture.get_pixel(layout.left(1) + x, HEADER + y).0;
            assert_eq!(shown, frame.pixel(x as usize / 2, y as usize / 2));
        }
        let around =
            [(layout.left(1) - 1, HEADER), (layout.left(1) + 480, HEADER), (layout.left(1), HEADER + 4)];
        assert!(around.iter().all(|&(x, y)| *picture.get_pixel(x, y) == BACKGROUND));
    }

    /// Steps at four frames a second, and what the two cameras saw of each.
    fn write_trace(path: &Path, sequences: &[u64]) {
        let mut trace = Trace::create(path, &recorded().line.id).unwrap();
        trace.event(0.0, false, "fast").unwrap();
        for &sequence in sequences {
            let state = State { time: sequence as f64 / 4.0, ..State::default() };
            trace.step(&Step { sequence, state, ..Step::default() }).unwrap();
            let data = vec![20 + 10 * sequence as u8; 64 * 16 * 3];
            let frame = Frame::new(&data, 64, 16).unwrap();
            for topic in [ImageTopic::Raw, ImageTopic::Perturbed] {
                trace.image(topic, sequence, state.time, frame).unwrap();
            }
        }
        trace.finish().unwrap();
    }

    fn recorded() -> Recorded {
        let value = serde_json::json!({
            "id": "00".repeat(16), "name": "fast", "images_every": 0, "success": false, "cause": "collision",
            "time": 2.5, "frames": 6, "skipped_frames": 5, "progress": 0.5, "mean_cross_track_error": 0.0,
            "max_cross_track_error": 0.0, "digest": "", "scenario": {
                "simulator": {"name": "lane"}, "driver": {"name": "x"}, "duration": 9.0, "seed": 0,
                "mode": "realtime",
            },
        });
        Recorded { number: 3, line: serde_json::from_value(value).unwrap() }
    }

    fn driven(outcome: &Outcome) -> Driven {
        Driven { outcome: outcome.clone(), rate: 4.0, times: Times::default(), warnings: Vec::new() }
    }

    /// For each frame of a video whether it is marked, and the brightness of what the camera saw.
    fn watch(path: &Path) -> Vec<(bool, u8)> {
        let mut reader = pdk_video::Reader::open_file(path).unwrap();
        let (mut planes, mut seen) = (pdk_video::Yuv420::default(), Vec::new());
        while reader.next(&mut planes).unwrap() {
            let mut picture = FrameBuf::new(planes.width, planes.height);
            planes.to_rgb(picture.as_mut());
            let [red, green, _] = picture.as_ref().pixel(MARGIN as usize + 2, HEADER as usize + 40);
            let [brightness, ..] = picture.as_ref().pixel(MARGIN as usize + 100, HEADER as usize + 60);
            seen.push((red > green + 50, brightness));
        }
        seen
    }

    #[test]
    fn a_failure_is_marked_and_its_last_frame_is_held() {
        let folder = tempfile::tempdir().unwrap();
        let (trace, video) = (folder.path().join("new.mcap"), folder.path().join("clip.mp4"));
        write_trace(&trace, &[0, 1, 2, 5, 6, 8]);
        let recorded = recorded();
        let mut driven = driven(&recorded.line.outcome);
        film(&video, &recorded, &driven, &trace).unwrap();
        let seen = watch(&video);
        // Frames that were skipped show the one before, also those behind the last; then the last frame stays for a second.
        let shown = [0, 1, 2, 2, 2, 5, 6, 6, 8, 8, 8, 8, 8, 8, 8].map(|sequence: u8| 20 + 10 * sequence);
        let brightness: Vec<u8> = seen.iter().map(|(_, brightness)| *brightness).collect();
        assert_eq!(brightness.len(), shown.len());
        assert!(brightness.iter().zip(shown).all(|(is, was)| is.abs_diff(was) < 6), "{brightness:?}");
        // The failure came at 2.5 s, and the second before it begins with frame 6.
        let marked: Vec<bool> = seen.iter().map(|(marked, _)| *marked).collect();
        assert_eq!(marked, [[false; 6].as_slice(), &[true; 9]].concat());

        driven.outcome = Outcome { success: true, cause: Cause::Finished, ..driven.outcome };
        film(&video, &recorded, &driven, &trace).unwrap();
        let seen = watch(&video);
        assert_eq!(seen.len(), 11);
        assert!(seen.iter().all(|(marked, _)| !marked));
    }

    #[test]
    fn boxes_are_outlined_while_they_count() {
        let during = serde_json::json!({
            "from": 1, "to": 3, "box": [0.25, 0.5, 0.75, 1.0], "except": { "from": 2, "to": 4, "box": [0.5, 0.5, 0.5625, 0.625] },
        });
        let applied: AppliedPerturbation =
            serde_json::from_value(serde_json::json!({ "name": "fog_filter", "level": 2, "during": during }))
                .unwrap();
        let applied = [applied.clone(), applied];
        let (perturbed, left_out) =
            (([0.25, 0.5, 0.75, 1.0], PERTURBED), ([0.5, 0.5, 0.5625, 0.625], LEFT_OUT));
        assert_eq!(boxes(&applied, 0.5), []);
        assert_eq!(boxes(&applied, 1.0), [perturbed]);
        assert_eq!(boxes(&applied, 2.5), [perturbed, left_out]);
        assert_eq!(boxes(&applied, 3.5), []);
        let layout = Layout::new(64, 48, 2);
        let mut picture = RgbImage::from_pixel(layout.size.0, layout.size.1, BACKGROUND);
        layout.outline(&mut picture, 1, perturbed.0, PERTURBED);
        let (width, height) = layout.shown;
        let (left, top) = (layout.left(1) + width / 4, HEADER + height / 2);
        for (x, y) in [(0, 0), (1, 40), (width / 2 - 1, height / 2 - 1), (40, height / 2 - 2)] {
            assert_eq!(*picture.get_pixel(left + x, top + y), PERTURBED);
        }
        for (x, y) in [(2, 2), (width / 2 - 3, 40), (width / 2, 0)] {
            assert_eq!(*picture.get_pixel(left + x, top + y), BACKGROUND);
        }
        // One that is as thin as can be, at the edge.
        layout.outline(&mut picture, 0, [0.999, 0.999, 1.0, 1.0], PERTURBED);
        assert_eq!(*picture.get_pixel(layout.left(0) + width - 1, HEADER + height - 1), PERTURBED);
    }

    #[test]
    fn a_failure_is_announced_until_it_happens() {
        assert_eq!(announced("lane departure", 0.8), "lane departure in 0.8 s");
        assert_eq!(announced("lane departure", 0.05), "lane departure in 0.1 s");
        for seconds in [0.04, 0.0, -0.01] {
            assert_eq!(announced("lane departure", seconds), "lane departure");
        }
    }

    #[test]
    fn without_frames_there_is_no_video() {
        let folder = tempfile::tempdir().unwrap();
        let (trace, video) = (folder.path().join("new.mcap"), folder.path().join("clip.mp4"));
        write_trace(&trace, &[]);
        let recorded = recorded();
        let mut driven = driven(&recorded.line.outcome);
        driven.outcome.error = Some("driver `x`: it aborts".to_owned());
        let error = film(&video, &recorded, &driven, &trace).unwrap_err().to_string();
        let expected =
            format!("there is nothing to see of scenario 3 for {}: driver `x`: it aborts", video.display());
        assert_eq!(error, expected);
        // A step without its frames does not make the video shorter.
        let mut incomplete = Trace::create(&trace, &recorded.line.id).unwrap();
        for sequence in [0, 1] {
            incomplete.step(&Step { sequence, ..Step::default() }).unwrap();
        }
        incomplete.finish().unwrap();
        let error = film(&video, &recorded, &driven, &trace).unwrap_err().to_string();
        assert!(error.starts_with("frame 0 has no pictures in the trace "), "{error}");
        assert!(!video.exists());
    }
}
