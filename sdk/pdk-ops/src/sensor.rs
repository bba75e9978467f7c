//! The sensor of a camera: light becomes electrons, of which it counts a number that varies, and reading them out adds noise (EMVA 1288).

use crate::frame::{CHANNELS, Frame, FrameMut};
use crate::light::Light;
use crate::noise::{NORMAL_SCALE, each_block};
use crate::simd::vectorised;
use pdk_seed::Random;

/// How many electrons a sensor counts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sensor {
    /// Electrons of the light that is stored as white; infinite for a sensor without noise.
    pub white: f64,
    /// Standard deviation that reading out adds, in electrons.
    pub read: f64,
}

/// Stores the light of each value, multiplied by a factor of its pixel, with the noise of a sensor. Pixels are numbered row by row.
///
/// # Panics
/// If the sizes differ.
pub fn expose(
    light: &Light,
    src: Frame<'_>,
    dst: FrameMut<'_>,
    sensor: Sensor,
    random: &mut Random,
    factor: impl Fn(usize) -> f32,
) {
    // The variance of the counted number is the number, so that of its light is the light per electron.
    let per_electron = (1.0 / sensor.white) as f32;
    let read = (sensor.read / sensor.white) as f32;
    let mut place = 0;
    each_block(src, dst, random, |from, normal, to| {
        light.change(from, to, |first, lights| {
            for light in &mut *lights {
                *light *= factor(place / CHANNELS);
                place += 1;
            }
            add_noise(lights, &normal[first..], per_electron, read);
        });
    });
}

vectorised! {
    fn add_noise / add_noise_avx2 (lights: &mut [f32], normal: &[i16], per_electron: f32, read: f32) {
        for (light, normal) in lights.iter_mut().zip(normal) {
            let deviation = (*light * per_electron + read * read).sqrt();
            *light += f32::from(*normal) * NORMAL_SCALE * deviation;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::FrameBuf;
    use crate::light::to_light;
    use pdk_seed::Key;

    /// The mean and the variance of the light that is stored of an even frame.
    fn moments(value: u8, sensor: Sensor, factor: f32) -> [f64; 2] {
        let src = FrameBuf::from_vec(vec![value; 400 * 300 * 3], 400, 300).unwrap();
        let mut dst = FrameBuf::new(400, 300);
        expose(&Light::new(), src.as_ref(), dst.as_mut(), sensor, &mut Key([3; 32]).frame(1), |_| factor);
        let lights: Vec<f64> = dst.data().iter().map(|value| to_light(f64::from(*value) / 255.0)).collect();
        let mean = lights.iter().sum::<f64>() / lights.len() as f64;
        [mean, lights.iter().map(|light| (light - mean) * (light - mean)).sum::<f64>() / lights.len() as f64]
    }

    #[test]
    fn the_variance_is_that_of_the_electrons_and_of_reading_them_out() {
        for (value, factor, white, read) in
            [(150u8, 1.0f32, 2000.0, 0.0), (200, 0.5, 400.0, 8.0), (120, 2.0, 900.0, 30.0)]
        {
            let light = to_light(f64::from(value) / 255.0) * f64::from(factor);
            let expected = light / white + (read / white) * (read / white);
            let [mean, variance] = moments(value, Sensor { white, read }, factor);
            assert!((mean - light).abs() < 0.003, "{value}: {mean} {light}");
            assert!((variance / expected - 1.0).abs() < 0.05, "{value}: {variance} {expected}");
        }
    }

    #[test]
    fn a_sensor_without_noise_stores_the_light() {
        let src = FrameBuf::from_vec((0..=255).cycle().take(31 * 17 * 3).collect(), 31, 17).unwrap();
        let mut dst = FrameBuf::new(31, 17);
        let (light, sensor) = (Light::new(), Sensor { white: f64::INFINITY, read: 5.0 });
        expose(&light, src.as_ref(), dst.as_mut(), sensor, &mut Key([3; 32]).frame(1), |_| 1.0);
        assert_eq!(dst, src);
        // Each pixel has its own factor.
        let numbered = |pixel: usize| (pixel % 7) as f32 / 7.0;
        expose(&light, src.as_ref(), dst.as_mut(), sensor, &mut Key([3; 32]).frame(1), numbered);
        for (place, (found, from)) in dst.data().iter().zip(src.data()).enumerate() {
            assert_eq!(*found, light.store(light.of(*from) * numbered(place / 3)));
        }
    }
}
