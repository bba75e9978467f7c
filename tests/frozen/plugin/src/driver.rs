//! A driver that steers by what it is told.

use pdk_sdk::prelude::*;

/// Steers by the frame's brightness, its number and the speed, times `gain`.
pub struct Frozen {
    gain: f64,
    frames: u32,
}

impl Component for Frozen {
    fn description() -> Description {
        Description::driver("frozen", "Steers by what it is told")
            .parameter(Parameter::number("gain", 1.0, "factor on the steering").range(-2.0, 2.0))
    }

    fn new(config: &Config) -> Result<Self> {
        Ok(Self { gain: config.number("gain"), frames: 0 })
    }
}

impl Driver for Frozen {
    fn reset(&mut self) -> Result<()> {
        self.frames = 0;
        Ok(())
    }

    fn drive(&mut self, frame: Frame<'_>, cx: &DriveContext) -> Result<Control> {
        self.frames += 1;
        let brightness = f64::from(frame.pixel(frame.width() - 1, frame.height() - 1)[0]) / 2550.0;
        let steering = self.gain * (brightness + cx.time / 100.0 + cx.frame_index as f64 / 1000.0);
        // Nobody knows it in a recording.
        let speed = if cx.speed.is_nan() { 0.0 } else { cx.speed };
        Ok(Control { steering, throttle: (f64::from(self.frames) + speed) / 1000.0 })
    }

    fn info(&self) -> Vec<(String, String)> {
        vec![("made with".to_owned(), "the first SDK".to_owned())]
    }
}
