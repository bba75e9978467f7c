//! A saliency method that misbehaves.

use pdk_sdk::prelude::*;

use crate::manner::{Manner, describe};

/// Finds everything equally important, or misbehaves.
pub struct Misbehaving {
    manner: Manner,
}

impl Component for Misbehaving {
    fn description() -> Description {
        let description = Description::saliency("misbehave", "Misbehaves as told");
        describe(
            description,
            &["new", "drop", "map_size", "map"],
            &["out_of_range", "leave_values", "large_map"],
        )
    }

    fn new(config: &Config) -> Result<Self> {
        Ok(Self { manner: Manner::new(config) })
    }
}

impl Saliency for Misbehaving {
    fn map_size(&mut self, width: usize, height: usize) -> Result<[usize; 2]> {
        self.manner.reach("map_size");
        Ok([if self.manner.is("large_map") { width + 1 } else { width / 2 }, height])
    }

    fn map(&mut self, _frame: Frame<'_>, _cx: &MapContext<'_>, mut out: HeatmapMut<'_>) -> Result<()> {
        self.manner.reach("map");
        match self.manner.how.as_str() {
            "out_of_range" => out.values_mut().fill(2.0),
            "leave_values" => out.row_mut(0).fill(0.5),
            _ => out.values_mut().fill(0.5),
        }
        Ok(())
    }
}

impl Drop for Misbehaving {
    fn drop(&mut self) {
        self.manner.reach("drop");
    }
}
