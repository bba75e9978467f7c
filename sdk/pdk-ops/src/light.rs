//! Stored values as light, and back: the curve of sRGB (IEC 61966-2-1). What happens before a camera stores a value, such as exposure and
//! haze, happens to light.

use std::sync::OnceLock;

/// Steps of light that are told apart: so many that the darkest stored values keep a distance of five steps.
const STEPS: usize = 1 << 14;

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
        let step = (light * STEPS as f32 + 0.5) as usize;
        self.0.stored[step.min(STEPS)]
    }
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
