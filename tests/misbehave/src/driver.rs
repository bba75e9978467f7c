//! A driver that misbehaves.

use pdk_sdk::prelude::*;

use crate::manner::{Manner, describe};
use crate::process::and_ways;

/// Drives straight on, or misbehaves.
pub struct Misbehaving {
    manner: Manner,
}

impl Component for Misbehaving {
    fn description() -> Description {
        let description = Description::driver("misbehave", "Misbehaves as told");
        describe(description, &["new", "reset", "drop", "drive"], &and_ways(&["no_number", "wild", "idle"]))
    }

    fn new(config: &Config) -> Result<Self> {
        Ok(Self { manner: Manner::new(config) })
    }
}

impl Driver for Misbehaving {
    fn reset(&mut self) -> Result<()> {
        self.manner.reach("reset");
        Ok(())
    }

    fn drive(&mut self, frame: Frame<'_>, cx: &DriveContext) -> Result<Control> {
        self.manner.reach_frame("drive", cx.frame_index);
        self.manner.disturb(cx.frame_index);
        // Depends on the frame, so that a test sees when it saw another one.
        let brightness = f64::from(frame.pixel(frame.width() / 2, frame.height() / 2)[0]) / 2550.0;
        let steering = match self.manner.how.as_str() {
            "no_number" => f64::NAN,
            "wild" => 1e9,
            _ => brightness,
        };
        Ok(Control { steering, throttle: if self.manner.is("idle") { 0.0 } else { 0.3 } })
    }
}

impl Drop for Misbehaving {
    fn drop(&mut self) {
        self.manner.reach("drop");
    }
}
