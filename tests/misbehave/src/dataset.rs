//! A dataset reader that misbehaves.

use pdk_sdk::prelude::*;

use crate::manner::{Manner, describe};

/// A recording of four small frames, or misbehaves.
pub struct Misbehaving {
    manner: Manner,
}

impl Component for Misbehaving {
    fn description() -> Description {
        let description = Description::dataset("misbehave", "Misbehaves as told");
        let description =
            describe(description, &["new", "len", "name", "drop", "read"], &["empty", "no_number"]);
        description.parameter(Parameter::path("path", "not read").optional())
    }

    fn new(config: &Config) -> Result<Self> {
        // Lets the other readers have what was not meant for this one.
        if !config.text("path").is_empty() {
            return Err(Error::new("it reads no files"));
        }
        Ok(Self { manner: Manner::new(config) })
    }
}

impl Dataset for Misbehaving {
    fn len(&self) -> usize {
        self.manner.reach("len");
        if self.manner.is("empty") { 0 } else { 4 }
    }

    fn name(&self, index: usize) -> String {
        self.manner.reach_frame("name", index as u64);
        format!("made up {index}")
    }

    fn read(&mut self, index: usize) -> Result<Entry> {
        self.manner.reach_frame("read", index as u64);
        let mut frame = FrameBuf::new(8, 6);
        frame.as_mut().rows_mut().for_each(|row| row.fill(index as u8 * 50));
        let steering = if self.manner.is("no_number") { f64::INFINITY } else { 0.25 };
        Ok(Entry { frame, steering, throttle: 0.5, time: index as f64 / 20.0, ..Entry::default() })
    }
}

impl Drop for Misbehaving {
    fn drop(&mut self) {
        self.manner.reach("drop");
    }
}
