//! What goes wrong, and when.

use std::time::Duration;

/// What goes wrong.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Fault {
    Close(Duration),
    Die,
    Hang,
    Half,
    Garbage,
    Flood,
    /// A speed that no vehicle has.
    Huge,
    /// A time that has passed.
    Back,
    Freeze(Duration),
}

/// What is to go wrong.
#[derive(Debug)]
pub struct Faults {
    fault: Option<Fault>,
    /// After how many controls of a drive.
    pub at: u64,
    /// How often it still goes wrong.
    pub left: u64,
}

impl Default for Faults {
    fn default() -> Self {
        Self { fault: None, at: 20, left: 1 }
    }
}

impl Faults {
    /// Reads the name of a fault.
    pub fn name(&mut self, text: &str) {
        let (name, seconds) = text.split_once(':').unwrap_or((text, "0"));
        self.fault = Some(match name {
            "close" => Fault::Close(Duration::from_secs_f64(seconds.parse().unwrap())),
            "die" => Fault::Die,
            "hang" => Fault::Hang,
            "half" => Fault::Half,
            "garbage" => Fault::Garbage,
            "flood" => Fault::Flood,
            "huge" => Fault::Huge,
            "back" => Fault::Back,
            "freeze" => Fault::Freeze(Duration::from_secs_f64(seconds.parse().unwrap())),
            other => panic!("there is no fault {other}"),
        });
    }

    /// What goes wrong after this many controls of a drive.
    pub fn after(&mut self, controls: u64) -> Option<Fault> {
        if self.left == 0 || controls != self.at {
            return None;
        }
        self.left -= u64::from(self.fault.is_some());
        self.fault
    }
}
