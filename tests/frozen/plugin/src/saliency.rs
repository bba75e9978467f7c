//! A saliency method that tells what it is given.

use pdk_sdk::prelude::*;

/// A map of half the frame's size: the brightness of the pixel at each place, and one random number.
pub struct Frozen;

impl Component for Frozen {
    fn description() -> Description {
        Description::saliency("frozen", "Finds bright pixels important")
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self)
    }
}

impl Saliency for Frozen {
    fn map_size(&mut self, width: usize, height: usize) -> Result<[usize; 2]> {
        Ok([width.div_ceil(2), height.div_ceil(2)])
    }

    fn map(&mut self, frame: Frame<'_>, cx: &MapContext<'_>, mut out: HeatmapMut<'_>) -> Result<()> {
        for y in 0..out.height() {
            for (x, value) in out.row_mut(y).iter_mut().enumerate() {
                *value = f32::from(frame.pixel(x * 2, y * 2)[0]) / 255.0;
            }
        }
        out.values_mut()[0] = cx.frame_random().unit() as f32;
        Ok(())
    }
}
