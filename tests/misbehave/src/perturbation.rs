//! A perturbation that misbehaves.

use pdk_sdk::prelude::*;

use crate::manner::{Manner, describe};
use crate::process::and_ways;

/// Copies the frame, or misbehaves.
pub struct Misbehaving {
    manner: Manner,
    calls: u8,
}

impl Component for Misbehaving {
    fn description() -> Description {
        let description = Description::perturbation("misbehave", "Misbehaves as told");
        describe(
            description,
            &["new", "drop", "apply"],
            &and_ways(&["leave_pixels", "remember", "mutter", "panic_on_thread"]),
        )
    }

    fn new(config: &Config) -> Result<Self> {
        Ok(Self { manner: Manner::new(config), calls: 0 })
    }
}

impl Perturbation for Misbehaving {
    fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        self.manner.reach_frame("apply", cx.frame_index);
        self.manner.disturb(cx.frame_index);
        self.calls = self.calls.wrapping_add(1);
        let written = if self.manner.is("leave_pixels") { src.height() / 2 } else { src.height() };
        for y in 0..written {
            dst.row_mut(y).copy_from_slice(src.row(y));
        }
        if self.manner.is("mutter") {
            use std::io::Write;
            let mut stdout = std::io::stdout();
            write!(stdout, "a word without a line feed").and_then(|()| stdout.flush())?;
        }
        if self.manner.is("panic_on_thread") {
            let thread = std::thread::spawn(|| panic!("as asked to on a thread"));
            assert!(thread.join().is_err(), "the thread has panicked");
        }
        if self.manner.is("remember") {
            dst.row_mut(0)[0] = self.calls;
        }
        Ok(())
    }
}

impl Drop for Misbehaving {
    fn drop(&mut self) {
        self.manner.reach("drop");
    }
}
