//! Which frames of a scenario go into its trace as images: one in this many, and the last ones of a failure.

use pdk_bus::FrameSample;
use pdk_chain::moment::Moment;
use pdk_chain::view::View;
use pdk_record::trace::step::ImageTopic;
use pdk_sdk::prelude::{Camera, Frame};

use crate::fault::Fault;
use crate::recent::Recent;
use crate::recorder::Recorder;

/// A frame as the camera and as the driver saw it.
pub struct Seen<'a> {
    /// Its number.
    pub sequence: u64,
    /// Simulation time in seconds.
    pub time: f64,
    /// What the camera saw.
    pub raw: Frame<'a>,
    /// What the driver saw.
    pub perturbed: Frame<'a>,
    /// What is known about it.
    pub moment: &'a Moment<'a>,
}

/// The images of a scenario.
#[derive(Default)]
pub struct Pictures {
    /// Number and time of the last frame, and the frame as camera and driver saw it, which stays in shared memory until the next one.
    last: Option<(u64, f64, [FrameSample; 2])>,
    /// The number of the latest image that was recorded.
    recorded: Option<u64>,
}

impl Pictures {
    /// Records a frame if it is one in `every`; `view` shows what the driver's network looks at.
    ///
    /// # Errors
    /// If the view fails.
    pub fn record(
        &mut self,
        seen: &Seen<'_>,
        every: u64,
        recorder: &Recorder,
        recent: &mut Recent,
        view: Option<&mut View>,
    ) -> Result<(), Fault> {
        let Seen { sequence, time, raw, perturbed, moment } = *seen;
        if every > 0 && sequence.is_multiple_of(every) {
            recorder.image(ImageTopic::Raw, sequence, time, raw);
            if let Some(view) = view {
                let picture = view.picture(perturbed, moment).map_err(Fault::Component)?;
                recorder.image(ImageTopic::Attention, sequence, time, picture.as_ref());
            }
            // It comes last, so that a reader of the trace has the other ones by then.
            recorder.image(ImageTopic::Perturbed, sequence, time, perturbed);
            self.recorded = Some(sequence);
        }
        // If every image is written, none is left for the end.
        if every != 1 {
            recent.look(sequence, time, raw, perturbed);
        }
        Ok(())
    }

    /// Keeps a frame until the next one.
    pub fn keep(&mut self, sequence: u64, time: f64, frames: [FrameSample; 2]) {
        self.last = Some((sequence, time, frames));
    }

    /// Records the last frame and those some seconds before it, as far as they are not recorded yet.
    pub fn record_last(&self, recorder: &Recorder, camera: Camera, recent: &Recent) {
        let Some((sequence, time, [raw, perturbed])) = &self.last else { return };
        let later = |sequence: u64| self.recorded.is_none_or(|last| sequence > last);
        for pair in recent.before_the_end(*sequence, *time) {
            if later(pair.sequence) {
                recorder.image(ImageTopic::Raw, pair.sequence, pair.time, pair.raw.as_ref());
                recorder.image(ImageTopic::Perturbed, pair.sequence, pair.time, pair.perturbed.as_ref());
            }
        }
        if later(*sequence) {
            let (width, height) = (camera.width as usize, camera.height as usize);
            for (topic, sample) in [(ImageTopic::Raw, raw), (ImageTopic::Perturbed, perturbed)] {
                // It was a frame of this size when it was published.
                if let Ok(frame) = Frame::new(sample, width, height) {
                    recorder.image(topic, *sequence, *time, frame);
                }
            }
        }
    }
}
