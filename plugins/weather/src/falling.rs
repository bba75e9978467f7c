//! What falls through the air in front of the camera: streaks of what is near, and the haze of all of it.

use pdk_sdk::ops::light::Light;
use pdk_sdk::prelude::*;

use crate::distances::{self, Distances};

/// Up to this distance in metres drops and flakes are drawn one by one.
const FARTHEST: f64 = 3.0;
/// The nearest that is drawn: nearer ones are out of focus.
const NEAREST: f64 = 0.6;
/// The most that are drawn.
const MOST: usize = 3000;

/// What falls at a rate: how much of it there is, by size, and how it moves. Sizes count by the water in them: a flake is as large as the
/// drop that it melts to.
pub struct Kind {
    /// How many there are in a cubic metre and a millimetre of size that have no size, at a rate in mm/h.
    pub intercept: fn(f64) -> f64,
    /// The slope of the logarithm of their number, per millimetre.
    pub slope: fn(f64) -> f64,
    /// The smallest that is drawn, in millimetres: smaller ones are part of the haze alone.
    pub smallest: f64,
    /// The diameter of one of a size, both in millimetres.
    pub diameter: fn(f64) -> f64,
    /// How fast one of a diameter in millimetres falls, in metres per second.
    pub fall: fn(f64) -> f64,
}

impl Kind {
    /// The extinction per metre: twice the area of everything that is in the air, since it is large against the wavelength.
    pub fn extinction(&self, rate: f64) -> f64 {
        if rate <= 0.0 {
            return 0.0;
        }
        let (intercept, slope) = ((self.intercept)(rate), (self.slope)(rate));
        // Up to 20 times the mean size.
        const STEPS: u32 = 2000;
        let step = 20.0 / slope / f64::from(STEPS);
        let areas = (0..STEPS).map(|number| {
            let size = (f64::from(number) + 0.5) * step;
            let diameter = (self.diameter)(size);
            diameter * diameter * libm::exp(-slope * size)
        });
        2.0 * std::f64::consts::FRAC_PI_4 * 1e-6 * intercept * step * areas.sum::<f64>()
    }
}

/// Adds the parameters of anything that falls.
pub fn described(description: Description) -> Description {
    let description = description
        .parameter(
            Parameter::number(
                "exposure",
                0.012,
                "how long the camera exposes, in which what falls becomes a streak",
            )
            .range(0.0001, 0.1)
            .unit("s"),
        )
        .parameter(
            Parameter::number("speed", 8.0, "how fast the vehicle drives into it")
                .range(0.0, 60.0)
                .unit("m/s"),
        )
        .parameter(
            Parameter::number(
                "sky",
                215.0,
                "grey of the sky that streaks and haze show: 0 is black, 255 white",
            )
            .range(0.0, 255.0),
        );
    distances::described(description)
}

/// Draws what falls.
pub struct Curtain {
    light: Light,
    distances: Distances,
    /// The extinction, and for which rate.
    extinction: (f64, f64),
}

/// A streak: where it begins and ends, in pixels, how wide it is, how far away, and how much of its light each place gets.
struct Streak {
    from: [f64; 2],
    to: [f64; 2],
    width: f64,
    distance: f64,
    share: f64,
}

impl Curtain {
    /// As the parameters say.
    pub fn new(config: &Config) -> Self {
        Self { light: Light::new(), distances: Distances::new(config), extinction: (0.0, 0.0) }
    }

    /// Lets it fall at the rate of the context's parameter `rate`.
    ///
    /// # Errors
    /// If the simulator's depths are wanted and there are none.
    pub fn draw(
        &mut self,
        kind: &Kind,
        src: Frame<'_>,
        mut dst: FrameMut<'_>,
        cx: &Context<'_>,
    ) -> Result<()> {
        let (width, height, rate) = (src.width(), src.height(), cx.number("rate"));
        if self.extinction.0 != rate {
            self.extinction = (rate, kind.extinction(rate));
        }
        let focal = self.distances.view([width, height]).focal;
        let distances = self.distances.of(width, height, cx)?;
        let sky = self.light.of(cx.number("sky").round() as u8);
        distances::haze(&self.light, src, &mut dst, distances, self.extinction.1 as f32, [sky; 3]);
        if rate <= 0.0 {
            return Ok(());
        }
        // What is in the pyramid in front of the camera.
        let [near, far] = [NEAREST, FARTHEST].map(|distance: f64| distance * distance * distance);
        let (wide, high) = (width as f64 / focal, height as f64 / focal);
        let slope = (kind.slope)(rate);
        let all = wide * high * (far - near) / 3.0 * (kind.intercept)(rate) / slope
            * libm::exp(-slope * kind.smallest);
        let count = (all as usize).min(MOST);
        // If there is more of it than is drawn, each streak stands for several.
        let each = all / count.max(1) as f64;
        let (exposure, speed) = (cx.number("exposure"), cx.number("speed"));
        let mut random = cx.frame_random();
        for _ in 0..count {
            let distance = libm::cbrt(near + random.unit() * (far - near));
            let diameter = (kind.diameter)(kind.smallest - libm::log1p(-random.unit()) / slope);
            let [x, y] = [random.unit() * width as f64, random.unit() * height as f64];
            let down = (kind.fall)(diameter) * exposure * focal / distance;
            // The vehicle drives towards it: it moves away from the middle of the picture.
            let growth = speed * exposure / distance;
            let [right, below] = [x - width as f64 / 2.0, y - height as f64 / 2.0];
            let to = [x + right * growth, y + below * growth + down];
            let thick = diameter * 1e-3 * focal / distance;
            let length = libm::hypot(to[0] - x, to[1] - y);
            // A place on the streak is covered for as long as the drop needs to pass by its own length.
            let share = thick / length.max(thick) * each;
            // One that stands for more than it can cover is larger.
            let larger = share.max(1.0).sqrt();
            let to = [x + (to[0] - x) * larger, y + (to[1] - y) * larger];
            let streak = Streak { from: [x, y], to, width: thick * larger, distance, share: share.min(1.0) };
            draw(&self.light, &mut dst, distances, &streak, sky);
        }
        Ok(())
    }
}

/// Draws a streak of the sky's light in front of what is further away: each of its pixels once, by how much of it the streak covers.
fn draw(light: &Light, dst: &mut FrameMut<'_>, distances: &[f32], streak: &Streak, sky: f32) {
    let size = [dst.width(), dst.height()];
    let way = [0, 1].map(|axis| streak.to[axis] - streak.from[axis]);
    let middle = [0, 1].map(|axis| 0.5 * (streak.from[axis] + streak.to[axis]));
    let (along, across) = if way[1].abs() >= way[0].abs() { (1, 0) } else { (0, 1) };
    let slope = if way[along] == 0.0 { 0.0 } else { way[across] / way[along] };
    // It is as long as it is wide at least. If it is thinner or shorter than a pixel, it covers a part of it.
    let length = way[along].abs().max(streak.width);
    let [half_length, half_width] = [length, streak.width].map(|size| 0.5 * size.max(1.0));
    let part = length / (2.0 * half_length) * streak.width / (2.0 * half_width);
    let cover = (streak.share * part).min(1.0) as f32;
    // The pixels between two places on an axis that are in the frame.
    let pixels =
        |from: f64, to: f64, axis: usize| from.floor() as usize..(to.ceil() as usize).min(size[axis]);
    let [begin, end] = [middle[along] - half_length, middle[along] + half_length];
    for step in pixels(begin, end, along) {
        let inside_along = end.min(step as f64 + 1.0) - begin.max(step as f64);
        let place = middle[across] + (step as f64 + 0.5 - middle[along]) * slope;
        let [first, last] = [place - half_width, place + half_width];
        for side in pixels(first, last, across) {
            let inside_across = last.min(side as f64 + 1.0) - first.max(side as f64);
            let mut pixel = [0; 2];
            (pixel[along], pixel[across]) = (step, side);
            let [column, row] = pixel;
            if distances[row * size[0] + column] < streak.distance as f32 {
                continue;
            }
            let weight = cover * (inside_along * inside_across) as f32;
            for value in &mut dst.row_mut(row)[3 * column..3 * column + 3] {
                let before = light.of(*value);
                *value = light.store(before + (sky - before) * weight);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_frames::even;

    /// The light that a streak adds to a black frame in each pixel, as a share of that of the sky.
    fn drawn(from: [f64; 2], to: [f64; 2], width: f64, share: f64) -> Vec<Vec<f64>> {
        let (light, mut frame) = (Light::new(), even(0, 200, 20));
        let streak = Streak { from, to, width, distance: 1.0, share };
        draw(&light, &mut frame.as_mut(), &[2.0; 200 * 20], &streak, 1.0);
        let lights = |row: &[u8]| row.chunks(3).map(|pixel| f64::from(light.of(pixel[0]))).collect();
        frame.as_ref().rows().map(lights).collect()
    }

    #[test]
    fn a_streak_covers_each_of_its_pixels_once_however_long_it_is() {
        for (from, to) in
            [([3.3, 10.2], [190.7, 10.8]), ([12.4, -300.0], [12.4, 300.0]), ([5.5, 2.0], [9.5, 9.7])]
        {
            let seen = drawn(from, to, 2.0, 0.25);
            let is_steep = (to[1] - from[1]).abs() > (to[0] - from[0]).abs();
            let lines: Vec<f64> = match is_steep {
                true => seen.iter().map(|row| row.iter().sum()).collect(),
                false => (0..200).map(|x| seen.iter().map(|row| row[x]).sum()).collect(),
            };
            let (first, last) = if is_steep { (from[1], to[1]) } else { (from[0], to[0]) };
            for (line, sum) in lines.iter().enumerate() {
                // Two pixels wide, a quarter of the light, and at the ends the part of the pixel that it reaches into.
                let inside = (last.min(line as f64 + 1.0) - first.max(line as f64)).max(0.0);
                assert!((sum - 0.5 * inside).abs() < 0.02, "{from:?} {line}: {sum}, {inside}");
            }
        }
    }

    #[test]
    fn what_is_smaller_than_a_pixel_adds_as_much_light_as_its_area() {
        for place in [[20.5, 10.5], [20.9, 10.1], [33.0, 7.0]] {
            let sum: f64 = drawn(place, [place[0], place[1] + 0.2], 0.5, 1.0).iter().flatten().sum();
            assert!((sum - 0.25).abs() < 0.02, "{place:?}: {sum}");
        }
        assert!(drawn([-5.0, -5.0], [-4.0, -2.0], 1.0, 1.0).iter().flatten().all(|light| *light == 0.0));
    }
}
