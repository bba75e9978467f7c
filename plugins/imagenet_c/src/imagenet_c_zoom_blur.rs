//! Zoom blur: the mean of enlargements.

use pdk_sdk::ops::float::Image;
use pdk_sdk::prelude::*;

use crate::enlarge::enlarge;
use crate::suite::corruption;

/// Averages the frame with its enlargements.
#[derive(Default)]
pub struct ZoomBlur {
    image: Image,
    sum: Image,
}

impl Component for ZoomBlur {
    fn description() -> Description {
        corruption("zoom_blur", "Averages the frame with its enlargements about the middle")
            .mathematics("(v + sum of its zooms by 1 + i step, i < count) / (count + 1)")
            .parameter(
                Parameter::by_level("count", [12.0, 16.0, 11.0, 13.0, 11.0], "number of enlargements")
                    .range(0.0, 200.0),
            )
            .parameter(
                Parameter::by_level("step", [0.01, 0.01, 0.02, 0.02, 0.03], "from one factor to the next")
                    .range(0.0, 1.0),
            )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self::default())
    }
}

impl Perturbation for ZoomBlur {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        self.image.read(src);
        let count = cx.integer("count").max(0);
        // As the package counts: by what is left of the step after it was added to 1.
        let step = (1.0 + cx.number("step")) - 1.0;
        let (line, share) = (src.width() * 3, 1.0 / (count + 1) as f32);
        self.sum.clone_from(&self.image);
        for number in 0..count {
            let factor = 1.0 + number as f64 * step;
            let values = &mut self.sum.values;
            enlarge(&self.image, factor, |y, row| {
                values[y * line..][..line].iter_mut().zip(row).for_each(|(sum, value)| *sum += value);
            });
        }
        self.sum.values.iter_mut().for_each(|value| *value *= share);
        self.sum.write(dst);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::stays_grey;

    #[test]
    fn passes_the_test_kit() {
        pdk_sdk::testing::perturbation::<ZoomBlur>();
    }

    #[test]
    fn a_grey_frame_stays_grey() {
        stays_grey::<ZoomBlur>(&[4.0], 99..=101);
    }
}
