//! Stored values as light, and back: the curve of sRGB (IEC 61966-2-1). What happens before a camera stores a value, such as exposure and
//! haze, happens to light.

use std::sync::OnceLock;

use crate::frame::CHANNELS;
use crate::simd::vectorised;
use crate::table::look_up_row;

/// Steps of light that are told apart: so many that the darkest stored values keep a distance of five steps.
const STEPS: usize = 1 << 14;
/// The most pixels that [`Light::change`] works on at a time.
pub const PIXELS: usize = 64;
const BLOCK: usize = PIXELS * CHANNELS;

/// The curve as tables, which all of a process share: it takes half a millisecond to make them.
#[derive(Debug, Clone, Copy)]
pub struct Light(&'static Tables);

#[derive(Debug)]
struct Tables {
    linear: [f32; 256],
    stored: Vec<u8>,
}

impl Default for Light {
    fn default() -> Self {
        Self::new()
    }
}

impl Light {
    /// The tables.
    pub fn new() -> Self {
        static TABLES: OnceLock<Tables> = OnceLock::new();
        Self(TABLES.get_or_init(|| {
            Tables {
                linear: std::array::from_fn(|value| to_light(value as f64 / 255.0) as f32),
                stored: (0..=STEPS)
                    .map(|step| (255.0 * from_light(step as f64 / STEPS as f64)).round() as u8)
                    .collect(),
            }
        }))
    }

    /// The light of a stored value: 0 to 1.
    #[inline]
    pub fn of(&self, value: u8) -> f32 {
        self.0.linear[value as usize]
    }

    /// How a camera stores light. What is above 1 is clipped; what is not a number becomes black.
    #[inline]
    pub fn store(&self, light: f32) -> u8 {
        self.0.stored[step(light) as usize]
    }

    /// Multiplies the light of values by the same factor, stored as [`store`](Self::store) does.
    pub fn scale(&self, from: &[u8], to: &mut [u8], factor: f32) {
        look_up_row(from, to, &std::array::from_fn(|value| self.store(self.of(value as u8) * factor)));
    }

    /// Changes the light of values, [`PIXELS`] at a time at most: `change` gets the number of the first value and the lights, which are stored as
    /// [`store`](Self::store) does.
    #[inline]
    pub fn change(&self, from: &[u8], to: &mut [u8], mut change: impl FnMut(usize, &mut [f32])) {
        let (mut lights, mut steps) = ([0.0; BLOCK], [0; BLOCK]);
        for (number, (from, to)) in from.chunks(BLOCK).zip(to.chunks_mut(BLOCK)).enumerate() {
            let (lights, steps) = (&mut lights[..from.len()], &mut steps[..from.len()]);
            for (light, value) in lights.iter_mut().zip(from) {
                *light = self.of(*value);
            }
            change(number * BLOCK, lights);
            find_steps(lights, steps);
            for (to, step) in to.iter_mut().zip(steps) {
                *to = self.0.stored[*step as usize];
            }
        }
    }
}

/// The step that is nearest to a light.
#[inline(always)]
fn step(light: f32) -> u32 {
    // Unlike `clamp`, this makes a number of what is none.
    #[allow(clippy::manual_clamp)]
    let clipped = (light * STEPS as f32 + 0.5).max(0.0).min(STEPS as f32);
    clipped as i32 as u32
}

vectorised! {
    fn find_steps / find_steps_avx2 (lights: &[f32], steps: &mut [u32]) {
        for (to, light) in steps.iter_mut().zip(lights) {
            *to = step(*light);
        }
    }
}

vectorised! {
    /// What is left of light after each of these distances, at an extinction: `e^(-extinction distance)`, to a millionth of it.
    pub fn fade / fade_avx2 (distances: &[f32], extinction: f32, left: &mut [f32]) {
        for (left, distance) in left.iter_mut().zip(distances) {
            *left = decay(extinction * distance);
        }
    }
}

/// `e^-x` for what is not below 0: a power of two, and a Taylor series for the rest.
#[inline(always)]
fn decay(x: f32) -> f32 {
    /// The logarithm of two in two parts, of which the first has so few digits that its products are exact.
    const LN_2: [f32; 2] = [0.693_359_4, -2.121_944_4e-4];
    /// Adding this to a number rounds it, and leaves the whole number in the lower bits.
    const SHIFT: f32 = 12_582_912.0;
    // Behind this, less than the smallest normal number is left.
    #[allow(clippy::manual_clamp)] // what is not a number has to become one
    let x = x.max(0.0).min(87.0);
    let shifted = x * std::f32::consts::LOG2_E + SHIFT;
    let halvings = shifted - SHIFT;
    let rest = -((x - halvings * LN_2[0]) - halvings * LN_2[1]);
    let series = 1.0
        + rest
            * (1.0
                + rest
                    * (1.0 / 2.0
                        + rest * (1.0 / 6.0 + rest * (1.0 / 24.0 + rest * (1.0 / 120.0 + rest / 720.0)))));
    let power = (127i32 - (shifted.to_bits() as i32 - SHIFT.to_bits() as i32)) << 23;
    series * f32::from_bits(power as u32)
}

/// The light of a stored value, both from 0 to 1.
pub fn to_light(stored: f64) -> f64 {
    if stored <= 0.04045 { stored / 12.92 } else { libm::pow((stored + 0.055) / 1.055, 2.4) }
}

/// The stored value of light, both from 0 to 1.
pub fn from_light(light: f64) -> f64 {
    if light <= 0.003_130_8 { 12.92 * light } else { 1.055 * libm::pow(light, 1.0 / 2.4) - 0.055 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::with_each;

    #[test]
    fn values_are_changed_one_like_the_other_with_all_instructions() {
        let light = Light::new();
        // Whole blocks and a rest.
        let from: Vec<u8> = (0..2 * BLOCK + 31).map(|place| (place * 89 % 256) as u8).collect();
        let gain = |place: usize| [0.3, 1.0, 2.5, -1.0, f32::NAN, f32::INFINITY][place % 6];
        let expected: Vec<u8> = (0..from.len()).map(|i| light.store(light.of(from[i]) * gain(i))).collect();
        with_each(|instructions| {
            let mut to = vec![0; from.len()];
            light.change(&from, &mut to, |first, lights| {
                for (place, light) in lights.iter_mut().enumerate() {
                    *light *= gain(first + place);
                }
            });
            assert_eq!(to, expected, "{instructions:?}");
        });
    }

    #[test]
    fn light_is_scaled_as_it_is_changed() {
        let light = Light::new();
        let from: Vec<u8> = (0..=255).collect();
        for factor in [0.0, 0.3, 1.0, 1.7, f32::NAN] {
            with_each(|instructions| {
                let (mut scaled, mut changed) = ([0; 256], [0; 256]);
                light.scale(&from, &mut scaled, factor);
                light.change(&from, &mut changed, |_, lights| {
                    lights.iter_mut().for_each(|light| *light *= factor)
                });
                assert_eq!(scaled, changed, "{factor} {instructions:?}");
            });
        }
    }

    #[test]
    fn light_fades_as_the_exponential_says_with_all_instructions() {
        let distances: Vec<f32> = (0..40_001).map(|step| step as f32 * 0.25).collect();
        for extinction in [0.0, 0.001, 0.03, 1.0] {
            let mut results = Vec::new();
            with_each(|_| {
                let mut left = vec![0.0; distances.len()];
                fade(&distances, extinction, &mut left);
                results.push(left);
            });
            assert!(results.iter().all(|left| left == &results[0]));
            for (distance, left) in distances.iter().zip(&results[0]) {
                let exact = libm::exp(-f64::from(extinction * distance));
                assert!(
                    (f64::from(*left) - exact).abs() <= 1e-6 * exact + 2e-38,
                    "{distance} {left} {exact}"
                );
            }
        }
        let mut left = [0.0; 3];
        fade(&[f32::INFINITY, f32::NAN, -1.0], 1.0, &mut left);
        assert!(left[0] < 1e-37 && left[1] == 1.0 && left[2] == 1.0, "{left:?}");
    }

    #[test]
    fn every_stored_value_comes_back() {
        let light = Light::new();
        for value in 0..=255u8 {
            assert_eq!(light.store(light.of(value)), value);
            assert!((from_light(to_light(f64::from(value) / 255.0)) * 255.0 - f64::from(value)).abs() < 1e-3);
        }
    }

    #[test]
    fn light_is_stored_as_the_formula_says_to_within_one() {
        let light = Light::new();
        for step in 0..=100_000 {
            let amount = f64::from(step) / 100_000.0;
            let exact = 255.0 * from_light(amount);
            assert!((f64::from(light.store(amount as f32)) - exact).abs() <= 0.65, "{amount}");
        }
        assert_eq!(
            [-1.0, 0.0, 1.0, 7.0, f32::INFINITY, f32::NAN].map(|l| light.store(l)),
            [0, 0, 255, 255, 255, 0]
        );
    }
}
