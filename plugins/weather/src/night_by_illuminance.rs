//! Night by illuminance: daylight goes, headlights come on, and the camera exposes longer and amplifies what is left.

use pdk_sdk::ops::light::Light;
use pdk_sdk::ops::sensor::{Sensor, expose};
use pdk_sdk::prelude::*;

use crate::distances::{self, Distances, centre};

/// How high above the road the lamps are, and how far ahead of the camera, in metres.
const LAMPS: [f64; 2] = [0.65, 1.5];
/// Of the light that falls on it, asphalt sends this share of what something upright does back to the vehicle: with the 10 % that it
/// reflects, 15 mcd per m2 and lux, as EN 1436 has dry roads.
const GROUND: f64 = 0.45;
/// What is higher than this above the road, in metres, stands upright.
const UPRIGHT: f64 = 0.3;
/// By night a camera exposes for a picture with this share of the light of that by day.
const AIM: f64 = 0.35;
/// Every this many rows and columns count for the exposure.
const METERED: usize = 4;

/// How the lamps are set.
#[derive(Clone, Copy, PartialEq)]
enum Beam {
    Low,
    High,
    Off,
}

/// Turns day into night.
pub struct NightByIlluminance {
    light: Light,
    distances: Distances,
    beam: Beam,
    /// Where pixels look, for frames of a size.
    directions: Vec<[f32; 3]>,
    /// The illuminance of each pixel for a candela of the lamps.
    lit: Vec<f32>,
    size: [usize; 2],
}

impl Component for NightByIlluminance {
    fn description() -> Description {
        let description = Description::perturbation(
            "night_by_illuminance",
            "Takes the daylight away down to an illuminance, lights the road with headlights, and exposes as a camera does by night, longer and \
             with more noise",
        )
        .family("weather")
        .dynamic()
        .not_default()
        .keeps_geometry()
        .mathematics("light(v) (illuminance + I(direction) g / r^2) / daylight 2^stops, r from the lamps; variance light / n + (read / n)^2, n = full_well / 2^(stops - longer)")
        .drawn_per_frame("noise of the sensor")
        .source("Illuminance by dusk and night as in Bond and Henderson, The conspicuity of emergency vehicle lighting (1963); beam after the test points of UNECE regulation 112; reflection of the road by EN 1436; noise by EMVA 1288; light by IEC 61966-2-1 (sRGB)")
        .parameter(
            Parameter::by_level(
                "illuminance",
                [400.0, 40.0, 3.4, 0.27, 0.002],
                "light that is left besides the headlights: 400 at sunset, 40 in a street with lamps, 3.4 when civil twilight ends, 0.27 under a \
                 full moon, 0.002 under stars",
            )
            .range(0.0, 100_000.0)
            .unit("lx"),
        )
        .parameter(Parameter::choice("beam", &["low", "high", "off"], "how the headlights are set"))
        .parameter(
            Parameter::number("intensity", 25_000.0, "luminous intensity of the headlights where they are brightest")
                .range(0.0, 1_000_000.0)
                .unit("cd"),
        )
        .parameter(
            Parameter::number("daylight", 10_000.0, "illuminance under which the frame was taken").range(1.0, 200_000.0).unit("lx"),
        )
        .parameter(
            Parameter::number("stops", 9.0, "how much more the camera can expose and amplify than by day").range(0.0, 24.0).unit("stops"),
        )
        .parameter(
            Parameter::number("longer", 4.0, "how much of that is a longer exposure, which costs no electrons").range(0.0, 24.0).unit("stops"),
        )
        .parameter(Parameter::number("full_well", 10_000.0, "electrons of white by day").range(10.0, 1_000_000.0).unit("electrons"))
        .parameter(Parameter::number("read", 4.0, "noise of reading the sensor out").range(0.0, 1000.0).unit("electrons"));
        distances::described(description)
    }

    fn new(config: &Config) -> Result<Self> {
        let beam = match config.text("beam") {
            "high" => Beam::High,
            "off" => Beam::Off,
            _ => Beam::Low,
        };
        let distances = Distances::new(config);
        Ok(Self {
            light: Light::new(),
            distances,
            beam,
            directions: Vec::new(),
            lit: Vec::new(),
            size: [0, 0],
        })
    }
}

/// The share of the lamps' intensity in a direction, as tangents to the right and down.
fn share(beam: Beam, right: f64, down: f64) -> f64 {
    let beside = right / 0.35;
    let across = 1.0 / (1.0 + beside * beside);
    let along = match beam {
        Beam::Off => 0.0,
        Beam::High => 1.0 / (1.0 + (down / 0.06) * (down / 0.06)),
        // Dark above the cut-off at the horizon, brightest 0.7 degrees below it, and ever less down to the road before the vehicle.
        Beam::Low if down < 0.0 => 0.015,
        Beam::Low if down < 0.012 => 0.015 + 0.985 * down / 0.012,
        Beam::Low => 0.01 + 0.99 * libm::exp(-(down - 0.012) / 0.03),
    };
    across * along
}

/// The illuminance for a candela of the lamps of a point to the right of the camera, below it and ahead, in metres, as much of it as comes back.
fn lit(beam: Beam, [right, down, ahead]: [f64; 3], camera_height: f64) -> f64 {
    let ahead = ahead - LAMPS[1];
    if ahead < 0.2 {
        // Beside the vehicle and behind its lamps.
        return 0.0;
    }
    let below = down - (camera_height - LAMPS[0]);
    let squared = right * right + below * below + ahead * ahead;
    let back = if camera_height - down > UPRIGHT { 1.0 } else { GROUND };
    share(beam, right / ahead, below / ahead) * back / squared
}

impl NightByIlluminance {
    /// Makes `lit` that of a frame.
    fn light_up(&mut self, width: usize, height: usize, cx: &Context<'_>) -> Result<()> {
        let is_new = self.size != [width, height];
        if is_new {
            self.size = [width, height];
            let places = (0..width * height).map(|place| [place % width, place / width]);
            let view = self.distances.view(self.size);
            let direction = |place| view.direction(centre(place)).map(|side| side as f32);
            self.directions = places.map(direction).collect();
        }
        let stay = self.distances.stay();
        let camera = self.distances.mounting().height;
        let distances = self.distances.of(width, height, cx)?;
        if stay && !is_new {
            return Ok(());
        }
        self.lit.clear();
        self.lit.extend(self.directions.iter().zip(distances).map(|(direction, distance)| {
            lit(self.beam, direction.map(|side| f64::from(side * distance)), camera) as f32
        }));
        Ok(())
    }

    /// By how many stops the camera exposes more.
    fn stops(&self, src: Frame<'_>, [ambient, lamps]: [f32; 2], most: f64) -> f64 {
        let (mut by_day, mut by_night) = (0.0f64, 0.0f64);
        for y in (0..src.height()).step_by(METERED) {
            for (x, pixel) in src.row(y).chunks_exact(3).enumerate().step_by(METERED) {
                let light = self.light.of(pixel[1]);
                by_day += f64::from(light);
                by_night += f64::from((light * (ambient + lamps * self.lit[y * src.width() + x])).min(1.0));
            }
        }
        // A black frame stays black however long it is exposed.
        if by_day <= 0.0 {
            return 0.0;
        }
        libm::log2(AIM * by_day / by_night.max(1e-12)).clamp(0.0, most)
    }
}

impl Perturbation for NightByIlluminance {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        self.light_up(src.width(), src.height(), cx)?;
        let daylight = cx.number("daylight");
        let [ambient, lamps] = ["illuminance", "intensity"].map(|name| (cx.number(name) / daylight) as f32);
        let stops = self.stops(src, [ambient, lamps], cx.number("stops"));
        let gain = libm::exp2(stops) as f32;
        let amplified = (stops - cx.number("longer")).max(0.0);
        let sensor =
            Sensor { white: cx.number("full_well") / libm::exp2(amplified), read: cx.number("read") };
        let factor = |pixel: usize| gain * (ambient + lamps * self.lit[pixel]);
        expose(&self.light, src, dst, sensor, &mut cx.frame_random(), factor);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::ops::light::{from_light, to_light};
    use pdk_sdk::serde_json::json;

    use super::*;
    use crate::test_frames::{even, perturbed};

    #[test]
    fn the_low_beam_keeps_the_test_points_of_the_regulation() {
        // Illuminance on a wall 25 m ahead, at angles down, for a dipped headlight of each 25,000 cd: dazzle above, light on the road below.
        let lux = |degrees: f64| 25_000.0 * share(Beam::Low, 0.0, libm::tan(degrees.to_radians())) / 625.0;
        assert!(lux(-0.57) <= 0.7, "{}", lux(-0.57));
        assert!(lux(0.86) >= 12.0, "{}", lux(0.86));
        assert!(lux(1.72) >= 2.0, "{}", lux(1.72));
        assert!(share(Beam::High, 0.0, 0.0) == 1.0 && share(Beam::Off, 0.0, 0.0) == 0.0);
    }

    #[test]
    fn light_falls_with_the_square_of_the_distance_from_the_lamps() {
        // Straight ahead of the lamps, upright, with the high beam.
        let at = |ahead: f64| lit(Beam::High, [0.0, 1.35 - 0.65, ahead + 1.5], 1.35);
        assert!((at(10.0) * 100.0 - 1.0).abs() < 1e-9 && (at(50.0) * 2500.0 - 1.0).abs() < 1e-9);
        // The road returns less, and what lies behind the lamps nothing.
        assert!(lit(Beam::High, [0.0, 1.35, 30.0], 1.35) < 0.5 * at(28.5));
        assert_eq!(lit(Beam::High, [1.0, 1.0, 1.0], 1.35), 0.0);
    }

    #[test]
    fn a_wall_is_as_bright_as_its_illuminance_says() {
        // Without exposure and noise: 100 lx of 1000, and the lamps on a wall, pixel by pixel.
        let (width, height) = (60, 40);
        let wall = vec![20.0; width * height];
        let given = json!({
            "illuminance": 100, "daylight": 1000, "stops": 0, "full_well": 1_000_000, "read": 0, "intensity": 40_000, "depth": "simulator",
            "camera_pitch": 0, "beam": "high",
        });
        let found = perturbed::<NightByIlluminance>(&given, &even(180, width, height), Some(&wall));
        let focal = 30.0 / libm::tan(37.5f64.to_radians());
        for (x, y) in [(0, 0), (30, 20), (45, 12), (59, 39), (29, 30)] {
            let right = (x as f64 + 0.5 - 30.0) / focal * 20.0;
            let down = (y as f64 + 0.5 - 20.0) / focal * 20.0;
            let (ahead, below) = (18.5, down - 0.7);
            let intensity =
                40_000.0 / (1.0 + (right / ahead / 0.35).powi(2)) / (1.0 + (below / ahead / 0.06).powi(2));
            let back = if 1.35 - down > 0.3 { 1.0 } else { 0.45 };
            let lux = 100.0 + intensity * back / (right * right + below * below + ahead * ahead);
            let expected = 255.0 * from_light((to_light(180.0 / 255.0) * lux / 1000.0).min(1.0));
            let found = found.as_ref().pixel(x, y).map(f64::from);
            assert!(
                found.iter().all(|value| (value - expected).abs() < 2.0),
                "{x} {y}: {found:?} {expected}"
            );
        }
    }

    #[test]
    fn the_camera_exposes_for_what_is_left_up_to_its_limit() {
        let mean = |given: pdk_sdk::serde_json::Value| {
            let found = perturbed::<NightByIlluminance>(&given, &even(150, 80, 60), None);
            found.data().iter().map(|value| to_light(f64::from(*value) / 255.0)).sum::<f64>() / 14_400.0
        };
        let aimed = AIM * to_light(150.0 / 255.0);
        let dusk = mean(json!({"illuminance": 100, "beam": "off"}));
        assert!((dusk / aimed - 1.0).abs() < 0.02, "{dusk} {aimed}");
        // Nine stops are a factor of 512.
        let stars = mean(json!({"illuminance": 0.2, "beam": "off", "read": 0}));
        let left = to_light(150.0 / 255.0) * 0.2 / 10_000.0 * 512.0;
        assert!((stars / left - 1.0).abs() < 0.1, "{stars} {left}");
    }

    #[test]
    fn rules() {
        pdk_sdk::testing::perturbation::<NightByIlluminance>();
        crate::allocations::on_the_first_frames_alone::<NightByIlluminance>();
    }
}
