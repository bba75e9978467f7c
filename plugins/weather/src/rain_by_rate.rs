//! Rain by rate: drops of the sizes that fall at a rate in millimetres an hour, streaked by their fall and the vehicle's way, and the haze of
//! those that are too far away to be seen.

use pdk_sdk::ops::light::Light;
use pdk_sdk::prelude::*;

use crate::distances::{self, Distances};
use crate::fog_by_visibility::left;

/// Drops in a cubic metre and a millimetre of diameter that have no size, by Marshall and Palmer.
const INTERCEPT: f64 = 8000.0;
/// The smallest drop that is drawn, in millimetres: smaller ones are part of the haze alone.
const SMALLEST: f64 = 1.0;
/// Up to this distance in metres drops are drawn one by one.
const FARTHEST: f64 = 3.0;
/// The nearest that is drawn: nearer ones are out of focus.
const NEAREST: f64 = 0.4;
/// The most drops that are drawn.
const MOST: usize = 4000;

/// Lets it rain.
pub struct RainByRate {
    light: Light,
    distances: Distances,
    /// The distances of all pixels.
    all: Vec<f32>,
}

impl Component for RainByRate {
    fn description() -> Description {
        let description = Description::perturbation(
            "rain_by_rate",
            "Lets it rain at a rate: near drops are streaks in front of what is further away, and the others take contrast from the distance",
        )
        .family("weather")
        .dynamic()
        .not_default()
        .keeps_geometry()
        .mathematics("N(D) = 8000 exp(-4.1 R^-0.21 D) drops per m3 and mm; haze of extinction pi N0 / Lambda^3; streaks of width D and length v T")
        .drawn_per_frame("size and place of each drop")
        .source("Sizes by Marshall and Palmer, The distribution of raindrops with size (1948); fall by Atlas and Ulbrich (1977); streaks as in Garg and Nayar, Vision and rain (2007); haze by Koschmieder's law")
        .parameter(
            Parameter::by_level(
                "rate",
                [1.0, 4.0, 12.0, 35.0, 80.0],
                "how much it rains: slight below 2.5, moderate to 10, heavy to 50, violent above",
            )
            .range(0.0, 300.0)
            .unit("mm/h"),
        )
        .parameter(Parameter::number("exposure", 0.012, "how long the camera exposes, in which a drop becomes a streak").range(0.0001, 0.1).unit("s"))
        .parameter(Parameter::number("speed", 8.0, "how fast the vehicle drives into the rain").range(0.0, 60.0).unit("m/s"))
        .parameter(Parameter::number("sky", 215.0, "grey of the sky that drops and haze show: 0 is black, 255 white").range(0.0, 255.0));
        distances::described(description)
    }

    fn new(config: &Config) -> Result<Self> {
        Ok(Self { light: Light::new(), distances: Distances::new(config), all: Vec::new() })
    }
}

/// The slope of the distribution of sizes, per millimetre.
fn slope(rate: f64) -> f64 {
    4.1 * libm::pow(rate.max(1e-6), -0.21)
}

/// The extinction of rain per metre: twice the area of all drops, since they are large against the wavelength.
fn extinction(rate: f64) -> f64 {
    if rate <= 0.0 {
        return 0.0;
    }
    let slope = slope(rate);
    std::f64::consts::PI * INTERCEPT / (slope * slope * slope) * 1e-6
}

/// How fast a drop of this many millimetres falls, in metres per second.
fn fall(diameter: f64) -> f64 {
    3.778 * libm::pow(diameter, 0.67)
}

/// A streak: where it begins and ends, in pixels, how wide it is, and its share of the exposure at each place.
struct Streak {
    from: [f64; 2],
    to: [f64; 2],
    width: f64,
    distance: f64,
    share: f64,
}

impl RainByRate {
    fn draw(&self, dst: &mut FrameMut<'_>, streak: &Streak, sky: f32) {
        let (width, height) = (dst.width() as f64, dst.height() as f64);
        let [right, down] = [streak.to[0] - streak.from[0], streak.to[1] - streak.from[1]];
        let length = right.abs().max(down.abs());
        let steps = length.ceil().clamp(1.0, 4.0 * height) as usize;
        // A drop that is thinner than a pixel covers a part of it.
        let half = (0.5 * streak.width).max(0.5);
        let cover = (streak.share * (streak.width / (2.0 * half)).min(1.0)).min(1.0) as f32;
        let across = if down.abs() >= right.abs() { [1, 0] } else { [0, 1] };
        for step in 0..steps {
            let part = (step as f64 + 0.5) / steps as f64;
            let place = [streak.from[0] + part * right, streak.from[1] + part * down];
            let reach = half.ceil() as isize;
            for offset in -reach..=reach {
                let x = place[0] + (offset * across[0]) as f64;
                let y = place[1] + (offset * across[1]) as f64;
                if !(x >= 0.0 && y >= 0.0 && x < width && y < height) {
                    continue;
                }
                let (column, row) = (x as usize, y as usize);
                // How much of the pixel the streak covers across.
                let centre = if across[0] == 1 {
                    place[0] - (column as f64 + 0.5)
                } else {
                    place[1] - (row as f64 + 0.5)
                };
                let inside = (half + 0.5 - centre.abs()).clamp(0.0, 1.0) as f32;
                if inside <= 0.0 || self.all[row * dst.width() + column] < streak.distance as f32 {
                    continue;
                }
                let weight = cover * inside;
                for value in &mut dst.row_mut(row)[3 * column..3 * column + 3] {
                    let light = self.light.of(*value);
                    *value = self.light.store(light + (sky - light) * weight);
                }
            }
        }
    }
}

impl Perturbation for RainByRate {
    fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let (width, height) = (src.width(), src.height());
        self.distances.look(width, height, cx)?;
        let rate = cx.number("rate");
        let sky = self.light.of(cx.number("sky").round() as u8);
        let extinction = extinction(rate) as f32;
        self.all.clear();
        for (y, (to, from)) in dst.rows_mut().zip(src.rows()).enumerate() {
            self.all.extend(self.distances.row(y, cx));
            let distances = &self.all[y * width..];
            for ((to, from), distance) in to.chunks_exact_mut(3).zip(from.chunks_exact(3)).zip(distances) {
                let left = left(*distance, extinction);
                for (to, value) in to.iter_mut().zip(from) {
                    *to = self.light.store(self.light.of(*value) * left + sky * (1.0 - left));
                }
            }
        }
        if rate <= 0.0 {
            return Ok(());
        }
        // Drops in the pyramid in front of the camera.
        let focal = self.distances.focal(width);
        let (wide, high) = (width as f64 / focal, height as f64 / focal);
        let volume = wide * high * (FARTHEST * FARTHEST * FARTHEST - NEAREST * NEAREST * NEAREST) / 3.0;
        let slope = slope(rate);
        let per_cubic_metre = INTERCEPT / slope * libm::exp(-slope * SMALLEST);
        let count = ((volume * per_cubic_metre) as usize).min(MOST);
        // Fewer drops than there are stand for all of them, each for as many.
        let each = volume * per_cubic_metre / count.max(1) as f64;
        let (exposure, speed) = (cx.number("exposure"), cx.number("speed"));
        let mut random = cx.frame_random();
        for _ in 0..count {
            let [near, far] = [NEAREST, FARTHEST].map(|distance: f64| distance * distance * distance);
            let distance = libm::cbrt(near + random.unit() * (far - near));
            let diameter = SMALLEST - libm::log1p(-random.unit()) / slope;
            let [x, y] = [random.unit() * width as f64, random.unit() * height as f64];
            let down = fall(diameter) * exposure * focal / distance;
            // The vehicle drives towards it: it moves away from the middle of the picture.
            let growth = speed * exposure / distance;
            let [right, below] = [x - width as f64 / 2.0, y - height as f64 / 2.0];
            let to = [x + right * growth, y + below * growth + down];
            let thick = diameter * 1e-3 * focal / distance;
            let length = libm::hypot(to[0] - x, to[1] - y);
            // A place on the streak is covered for as long as the drop needs to pass by its own length.
            let share = (thick / length.max(thick) * each).min(1.0);
            self.draw(&mut dst, &Streak { from: [x, y], to, width: thick, distance, share }, sky);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::config::frame_values;
    use pdk_sdk::serde_json::{Value, json};

    use super::*;

    fn rained(given: &Value, source: &FrameBuf, depth: Option<&[f32]>) -> FrameBuf {
        let description = RainByRate::description();
        let config = Config::check(&description, given.as_object().unwrap()).unwrap();
        let names: Vec<String> = description.parameters.iter().map(|p| p.name.clone()).collect();
        let (mut values, key) = (Vec::new(), Key([2; 32]));
        frame_values(&description, &config, 2.0, &mut values);
        let mut cx = Context::new(2.0, 0, 0.0, &key).with_values(&names, &values);
        cx.depth = depth;
        let mut out = FrameBuf::new(source.width(), source.height());
        RainByRate::new(&config).unwrap().apply(source.as_ref(), out.as_mut(), &cx).unwrap();
        out
    }

    #[test]
    fn the_extinction_is_the_integral_over_all_sizes() {
        for rate in [1.0, 10.0, 80.0] {
            let slope = slope(rate);
            // Twice the area of a drop, times how many there are, in steps of a micrometre.
            let sum: f64 = (0..30_000)
                .map(|step| {
                    let diameter = (f64::from(step) + 0.5) * 1e-3;
                    let area = std::f64::consts::PI / 4.0 * diameter * diameter * 1e-6;
                    2.0 * area * INTERCEPT * libm::exp(-slope * diameter) * 1e-3
                })
                .sum();
            assert!((extinction(rate) / sum - 1.0).abs() < 1e-3, "{rate}: {} {sum}", extinction(rate));
        }
        // Heavy rain leaves about two kilometres of visibility.
        let visibility = 3.0 / extinction(10.0);
        assert!((1500.0..2500.0).contains(&visibility), "{visibility}");
        assert_eq!(extinction(0.0), 0.0);
    }

    #[test]
    fn more_rain_changes_more_and_none_changes_nothing() {
        let mut source = FrameBuf::new(160, 120);
        source.as_mut().rows_mut().for_each(|row| row.fill(60));
        let changed = |rate: f64| -> u64 {
            let found = rained(&json!({"rate": rate}), &source, None);
            found.data().iter().map(|value| u64::from(value.abs_diff(60))).sum()
        };
        let all = [0.0, 1.0, 4.0, 12.0, 35.0, 80.0].map(changed);
        assert_eq!(all[0], 0);
        assert!(all.windows(2).all(|pair| pair[0] < pair[1]), "{all:?}");
    }

    #[test]
    fn nothing_falls_behind_what_is_near() {
        let mut source = FrameBuf::new(80, 60);
        source.as_mut().rows_mut().for_each(|row| row.fill(60));
        let wall = vec![0.2; 80 * 60];
        let found = rained(&json!({"rate": 80, "depth": "simulator"}), &source, Some(&wall));
        assert!(found.data().iter().all(|value| value.abs_diff(60) <= 1));
    }

    #[test]
    fn rules() {
        pdk_sdk::testing::perturbation::<RainByRate>();
    }
}
