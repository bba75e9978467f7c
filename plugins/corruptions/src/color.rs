//! Corruptions of colour. Each is a function of a pixel alone, but for the contrast's means.

use pdk_sdk::prelude::*;

use crate::suite::corruption;

/// Adds to the brightness.
pub struct Brightness;

impl Component for Brightness {
    fn description() -> Description {
        corruption("brightness", "Adds to the brightness of every pixel, keeping its hue and saturation")
            .mathematics("HSV: V = clip(V + added)")
            .parameter(
                Parameter::by_level("added", [0.1, 0.2, 0.3, 0.4, 0.5], "what is added, of full scale")
                    .range(-1.0, 1.0),
            )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self)
    }
}

impl Perturbation for Brightness {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let added = cx.number("added");
        // The new brightness for each old one, and what colours are multiplied by.
        let table: Vec<(f64, f64)> = (0..256)
            .map(|value| {
                let value = f64::from(value) / 255.0;
                let brightened = (value + added).clamp(0.0, 1.0);
                (brightened * 255.0, if value > 0.0 { brightened / value } else { 0.0 })
            })
            .collect();
        each_pixel(src, dst, |pixel| {
            let most = pixel[0].max(pixel[1]).max(pixel[2]);
            let (brightest, factor) = table[usize::from(most)];
            // Black has no hue: it becomes grey.
            pixel.map(|value| if value == most { brightest as u8 } else { (f64::from(value) * factor) as u8 })
        });
        Ok(())
    }
}

/// Multiplies the saturation and adds to it.
pub struct Saturate;

impl Component for Saturate {
    fn description() -> Description {
        corruption(
            "saturate",
            "Makes colours paler or more vivid; what is added to the saturation of grey makes it red",
        )
        .mathematics("HSV: S = clip(factor S + added)")
        .parameter(
            Parameter::by_level("factor", [0.3, 0.1, 2.0, 5.0, 20.0], "what saturation is multiplied by")
                .range(0.0, 100.0),
        )
        .parameter(
            Parameter::by_level("added", [0.0, 0.0, 0.0, 0.1, 0.2], "what is added then").range(-1.0, 1.0),
        )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self)
    }
}

impl Perturbation for Saturate {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let (factor, added) = (cx.number("factor"), cx.number("added"));
        each_pixel(src, dst, |pixel| {
            let most = pixel[0].max(pixel[1]).max(pixel[2]);
            let least = pixel[0].min(pixel[1]).min(pixel[2]);
            let value = f64::from(most);
            if most == least {
                // Grey has no hue, which counts as red.
                let saturation = if most == 0 { 0.0 } else { added.clamp(0.0, 1.0) };
                let other = (value * (1.0 - saturation)) as u8;
                return [most, other, other];
            }
            let before = (value - f64::from(least)) / value;
            let ratio = (before * factor + added).clamp(0.0, 1.0) / before;
            // What is lacking to the brightest channel grows with the saturation.
            pixel.map(|channel| (value - (value - f64::from(channel)) * ratio + ROUNDING) as u8)
        });
        Ok(())
    }
}

/// What whole numbers may have lost.
const ROUNDING: f64 = 1e-9;

fn each_pixel(src: Frame<'_>, mut dst: FrameMut<'_>, change: impl Fn([u8; 3]) -> [u8; 3]) {
    for (from, to) in src.rows().zip(dst.rows_mut()) {
        for (from, to) in from.chunks_exact(3).zip(to.chunks_exact_mut(3)) {
            to.copy_from_slice(&change([from[0], from[1], from[2]]));
        }
    }
}

/// Takes contrast away.
pub struct Contrast;

impl Component for Contrast {
    fn description() -> Description {
        corruption("contrast", "Draws the values of each channel together about their mean")
            .mathematics("factor (v - mean) + mean, for each channel")
            .parameter(
                Parameter::by_level("factor", [0.4, 0.3, 0.2, 0.1, 0.05], "what is left of the contrast")
                    .range(0.0, 10.0),
            )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self)
    }
}

impl Perturbation for Contrast {
    fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let mut sums = [0u64; 3];
        for pixel in src.rows().flat_map(|row| row.chunks_exact(3)) {
            sums.iter_mut().zip(pixel).for_each(|(sum, &value)| *sum += u64::from(value));
        }
        let (factor, count) = (cx.number("factor"), (src.width() * src.height()) as f64);
        let tables = sums.map(|sum| {
            let mean = sum as f64 / count / 255.0;
            let drawn =
                |value: usize| ((value as f64 / 255.0 - mean) * factor + mean).clamp(0.0, 1.0) * 255.0;
            std::array::from_fn::<u8, 256, _>(|value| drawn(value) as u8)
        });
        for (from, to) in src.rows().zip(dst.rows_mut()) {
            for (from, to) in from.chunks_exact(3).zip(to.chunks_exact_mut(3)) {
                for ((&value, to), table) in from.iter().zip(to).zip(&tables) {
                    *to = table[usize::from(value)];
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{frame, perturbed};

    #[test]
    fn pass_the_test_kit() {
        pdk_sdk::testing::perturbation::<Brightness>();
        pdk_sdk::testing::perturbation::<Saturate>();
        pdk_sdk::testing::perturbation::<Contrast>();
    }

    fn one(pixel: [u8; 3]) -> FrameBuf {
        FrameBuf::from_vec(pixel.to_vec(), 1, 1).unwrap()
    }

    #[test]
    fn colours_keep_their_hue() {
        assert_eq!(perturbed::<Brightness>(&one([100, 50, 0]), 0.0, 1).data(), [125, 62, 0]);
        assert_eq!(perturbed::<Brightness>(&one([0, 0, 0]), 0.0, 1).data(), [25; 3]);
        assert_eq!(perturbed::<Brightness>(&one([200, 100, 50]), 4.0, 1).data(), [255, 127, 63]);
        assert_eq!(perturbed::<Saturate>(&one([200, 100, 0]), 0.0, 1).data(), [200, 170, 140]);
        assert_eq!(perturbed::<Saturate>(&one([200, 150, 100]), 2.0, 1).data(), [200, 100, 0]);
        // What grey becomes where something is added.
        assert_eq!(perturbed::<Saturate>(&one([100; 3]), 4.0, 1).data(), [100, 80, 80]);
    }

    #[test]
    fn contrast_draws_together_about_the_mean() {
        let src = FrameBuf::from_vec([[0, 0, 0], [200, 100, 50]].concat(), 2, 1).unwrap();
        let drawn = perturbed::<Contrast>(&src, 0.0, 1);
        assert_eq!(drawn.data(), [60, 30, 15, 140, 70, 35]);
        assert_eq!(perturbed::<Contrast>(&frame(77, 9, 9), 4.0, 1).data()[0], 77);
    }
}
