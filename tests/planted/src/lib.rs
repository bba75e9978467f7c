//! A plugin for the tests with a driver that fails for a cause that is known, and a perturbation that causes it: what `pdk why` has to find.

use std::ops::Range;

use pdk_sdk::prelude::*;

/// Drives straight on, but leaves the road once it has seen a planted box black in each of the planted frames.
struct Planted {
    frames: Range<u64>,
    columns: Range<usize>,
    rows: Range<usize>,
    seen: u64,
}

impl Component for Planted {
    fn description() -> Description {
        let side = |name: &str, doc: &str| Parameter::integer(name, 0, doc);
        [
            side("first", "The first planted frame"),
            side("last", "The last planted frame"),
            side("left", "The first column of the box"),
            side("top", "The first row of the box"),
            side("right", "The column behind the box"),
            side("bottom", "The row below the box"),
        ]
        .into_iter()
        .fold(
            Description::driver("planted", "Leaves the road if a planted box is black in all planted frames")
                .dynamic(),
            Description::parameter,
        )
    }

    fn new(config: &Config) -> Result<Self> {
        let number = |name: &str| config.integer(name).unsigned_abs();
        let place = |name: &str| number(name) as usize;
        Ok(Self {
            frames: number("first")..number("last") + 1,
            columns: place("left")..place("right"),
            rows: place("top")..place("bottom"),
            seen: 0,
        })
    }
}

impl Driver for Planted {
    fn reset(&mut self) -> Result<()> {
        self.seen = 0;
        Ok(())
    }

    fn drive(&mut self, frame: Frame<'_>, cx: &DriveContext) -> Result<Control> {
        let (columns, rows) = (self.columns.clone(), self.rows.clone());
        let black = |y: usize| frame.row(y)[3 * columns.start..3 * columns.end].iter().all(|byte| *byte == 0);
        if self.frames.contains(&cx.frame_index) && rows.into_iter().all(black) {
            self.seen += 1;
        }
        let fails = self.seen == self.frames.end - self.frames.start;
        Ok(Control { steering: if fails { 1.0 } else { 0.0 }, throttle: 0.3 })
    }
}

/// Makes frames black.
struct Blackout;

impl Component for Blackout {
    fn description() -> Description {
        Description::perturbation("blackout", "Makes frames black").not_default()
    }

    fn new(_: &Config) -> Result<Self> {
        Ok(Self)
    }
}

impl Perturbation for Blackout {
    fn apply(&mut self, _: Frame<'_>, mut dst: FrameMut<'_>, _: &Context<'_>) -> Result<()> {
        (0..dst.height()).for_each(|y| dst.row_mut(y).fill(0));
        Ok(())
    }
}

pdk_sdk::export! {
    perturbations: [Blackout],
    drivers: [Planted],
}
