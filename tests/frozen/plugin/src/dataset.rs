//! A dataset reader that makes its frames up.

use pdk_sdk::prelude::*;

/// A recording of five frames, of which the fourth cannot be read.
pub struct Frozen;

impl Component for Frozen {
    fn description() -> Description {
        Description::dataset("frozen", "A made up recording")
            .parameter(Parameter::path("path", "read by nobody").optional())
    }

    fn new(config: &Config) -> Result<Self> {
        // Lets the other readers have what was not meant for this one.
        if !config.text("path").is_empty() {
            return Err(Error::new("it reads no files"));
        }
        Ok(Self)
    }
}

impl Dataset for Frozen {
    fn len(&self) -> usize {
        5
    }

    fn name(&self, index: usize) -> String {
        format!("frozen {index}")
    }

    fn read(&mut self, index: usize) -> Result<Entry> {
        if index == 3 {
            return Err(Error::of(ErrorKind::Lost, "this one is gone"));
        }
        let mut frame = FrameBuf::new(8, 6);
        for (y, row) in frame.as_mut().rows_mut().enumerate() {
            row.fill((index * 40 + y) as u8);
        }
        Ok(Entry { frame, steering: 0.125 * index as f64, throttle: 0.5, time: index as f64 / 20.0 })
    }
}
