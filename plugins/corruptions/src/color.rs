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
        each_color(src, dst, |[hue, saturation, value]| [hue, saturation, (value + added).clamp(0.0, 1.0)]);
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
        each_color(src, dst, |[hue, saturation, value]| {
            [hue, (saturation * factor + added).clamp(0.0, 1.0), value]
        });
        Ok(())
    }
}

/// Changes hue, saturation and value of every pixel, each from 0 to 1. Fractions of grey levels are dropped, so a result that is whole
/// but for rounding counts as what rounding makes of it: the steps are those of scikit-image.
fn each_color(src: Frame<'_>, mut dst: FrameMut<'_>, change: impl Fn([f64; 3]) -> [f64; 3]) {
    // Pixels often repeat their neighbour.
    let (mut last, mut changed) = ([0; 3], to_bytes(change([0.0; 3])));
    for (from, to) in src.rows().zip(dst.rows_mut()) {
        for (from, to) in from.chunks_exact(3).zip(to.chunks_exact_mut(3)) {
            let pixel = [from[0], from[1], from[2]];
            if pixel != last {
                (last, changed) = (pixel, to_bytes(change(to_hsv(pixel))));
            }
            to.copy_from_slice(&changed);
        }
    }
}

/// Hue, saturation and value of a pixel.
fn to_hsv(pixel: [u8; 3]) -> [f64; 3] {
    let [r, g, b] = pixel.map(|value| f64::from(value) / 255.0);
    let (most, least) = (r.max(g).max(b), r.min(g).min(b));
    let delta = most - least;
    if delta == 0.0 {
        return [0.0, 0.0, most];
    }
    let sixth = if b == most {
        4.0 + (r - g) / delta
    } else if g == most {
        2.0 + (b - r) / delta
    } else {
        (g - b) / delta
    };
    let hue = sixth / 6.0;
    [if hue < 0.0 { hue + 1.0 } else { hue }, delta / most, most]
}

/// The pixel of a hue, a saturation and a value, its fractions dropped.
fn to_bytes([hue, saturation, value]: [f64; 3]) -> [u8; 3] {
    let sector = (hue * 6.0).floor();
    let place = hue * 6.0 - sector;
    let p = value * (1.0 - saturation);
    let q = value * (1.0 - place * saturation);
    let t = value * (1.0 - (1.0 - place) * saturation);
    let rgb = match sector as u32 % 6 {
        0 => [value, t, p],
        1 => [q, value, p],
        2 => [p, value, t],
        3 => [p, q, value],
        4 => [t, p, value],
        _ => [value, p, q],
    };
    rgb.map(|channel| (channel.clamp(0.0, 1.0) * 255.0) as u8)
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
        let close = |found: FrameBuf, wanted: [u8; 3]| {
            let near = found.data().iter().zip(wanted).all(|(found, wanted)| found.abs_diff(wanted) <= 1);
            assert!(near, "{:?} {wanted:?}", found.data());
        };
        close(perturbed::<Brightness>(&one([100, 50, 0]), 0.0, 1), [125, 62, 0]);
        close(perturbed::<Brightness>(&one([0, 0, 0]), 0.0, 1), [25; 3]);
        close(perturbed::<Brightness>(&one([200, 100, 50]), 4.0, 1), [255, 127, 63]);
        close(perturbed::<Saturate>(&one([200, 100, 0]), 0.0, 1), [200, 170, 140]);
        close(perturbed::<Saturate>(&one([10, 100, 200]), 2.0, 1), [0, 94, 200]);
        close(perturbed::<Saturate>(&one([200, 150, 100]), 2.0, 1), [200, 100, 0]);
        // What grey becomes where something is added.
        close(perturbed::<Saturate>(&one([100; 3]), 4.0, 1), [100, 80, 80]);
    }

    #[test]
    fn contrast_draws_together_about_the_mean() {
        let src = FrameBuf::from_vec([[0, 0, 0], [200, 100, 50]].concat(), 2, 1).unwrap();
        let drawn = perturbed::<Contrast>(&src, 0.0, 1);
        assert_eq!(drawn.data(), [60, 30, 15, 140, 70, 35]);
        assert_eq!(perturbed::<Contrast>(&frame(77, 9, 9), 4.0, 1).data()[0], 77);
    }
}
