//! Wet road: water darkens the ground and mirrors what is above the horizon, by the thickness of its film.

use std::sync::LazyLock;

use pdk_sdk::ops::light::Light;
use pdk_sdk::prelude::*;

use crate::distances::{self, Distances, centre};
use crate::patches::{self, Patches};

/// The refractive index of water.
const INDEX: f64 = 1.333;
/// The share of diffuse light that water reflects back to the ground under it.
const KEPT: f64 = 0.4725;
/// The share of light that the surface of water keeps out, about straight down.
const KEPT_OUT: f64 = 0.02;
/// How far waves incline the water on the road, as a tangent, and the water of puddles.
const RIPPLES: [f64; 2] = [0.05, 0.012];
/// What is higher than this above the road, in metres, or than this share of its distance, is not the road.
const ABOVE: [f32; 2] = [0.12, 0.01];

/// The light of ground under water, by the stored value of dry ground.
static DARK: LazyLock<[f32; 256]> = LazyLock::new(|| {
    let light = Light::new();
    std::array::from_fn(|value| {
        let light = f64::from(light.of(value as u8));
        (light * wet(light)) as f32
    })
});

/// What a pixel of the ground mirrors.
#[derive(Clone, Copy, Default)]
struct Mirror {
    /// The share of light that water reflects at this angle, with waves and in puddles; 0 for what is not ground.
    reflects: [f32; 2],
    /// How much it looks down: the side of a vector of length 1.
    down: f32,
    /// The column and the row that it shows.
    column: u32,
    row: f32,
    /// Its place on the ground, to the right and ahead, in metres.
    place: [f32; 2],
}

/// Puts water on the road.
pub struct WetRoad {
    distances: Distances,
    water: Water,
}

/// What water on the ground shows.
#[derive(Default)]
struct Water {
    light: Light,
    mirrors: Vec<Mirror>,
    /// In each column the sums of the light from the top to each row above the horizon.
    sums: Vec<[f32; 3]>,
    /// How many rows are above the horizon.
    sky: usize,
    size: [usize; 2],
    puddles: Patches,
}

impl Component for WetRoad {
    fn description() -> Description {
        let description = Description::perturbation(
            "wet_road",
            "Puts a film of water on the ground, which is darker then and mirrors what is above the horizon, with puddles if there is much of it",
        )
        .version(2)
        .family("weather")
        .dynamic()
        .not_default()
        .keeps_geometry()
        .mathematics("light(v) + c (light(v) (0.52 / (1 - 0.47 light(v)) - 1) + F(angle) light(mirrored)), c = 1 - exp(-film / texture), 1 in puddles")
        .drawn_per_sequence("where puddles are")
        .source("Darkening by Lekner and Dorf, Why some things are darker when wet (1988); reflection by Fresnel's equations; thickness of films and depth of texture as in Gallaway et al., Tentative pavement and geometric design criteria for minimizing hydroplaning (1975)")
        .parameter(
            Parameter::by_level("film", [0.05, 0.15, 0.4, 0.8, 1.5], "how thick the water is: a damp road up to one under heavy rain")
                .range(0.0, 100.0)
                .unit("mm"),
        )
        .parameter(
            Parameter::by_level("puddles", [0.0, 0.0, 0.02, 0.07, 0.2], "share of the ground that lies under puddles").range(0.0, 1.0),
        )
        .parameter(
            Parameter::number("beside", 5.0, "how far the road reaches to either side of the camera; what lies further away stays dry")
                .range(0.0, 1000.0)
                .unit("m"),
        )
        .parameter(Parameter::number("texture", 0.8, "how deep the texture of the road is, which stands out of thin films").range(0.01, 10.0).unit("mm"));
        distances::described(patches::described(description))
    }

    fn new(config: &Config) -> Result<Self> {
        Ok(Self { distances: Distances::new(config), water: Water::default() })
    }
}

/// The share of unpolarised light that water reflects, by the cosine of the angle from straight down.
fn fresnel(cosine: f64) -> f64 {
    let inside = (1.0 - (1.0 - cosine * cosine) / (INDEX * INDEX)).sqrt();
    let across = (cosine - INDEX * inside) / (cosine + INDEX * inside);
    let along = (inside - INDEX * cosine) / (inside + INDEX * cosine);
    0.5 * (across * across + along * along)
}

/// What is left of the light that a dry surface reflects, as a share, if it is wet; `albedo` is what it reflects dry.
fn wet(albedo: f64) -> f64 {
    (1.0 - KEPT_OUT) * (1.0 - KEPT) / (1.0 - KEPT * albedo.clamp(0.0, 1.0))
}

impl Water {
    /// Where each pixel below the horizon looks after it is mirrored on level ground.
    fn prepare(&mut self, [width, height]: [usize; 2], distances: &Distances) {
        if self.size == [width, height] {
            return;
        }
        self.size = [width, height];
        let (view, camera) = (distances.view(self.size), distances.mounting().height);
        let rises = |y: &usize| view.direction(centre([width / 2, *y]))[1] <= 0.0;
        self.sky = (0..height).take_while(rises).count();
        self.mirrors = (0..width * height)
            .map(|place| {
                let [right, down, ahead] = view.direction(centre([place % width, place / width]));
                if down <= 0.0 {
                    return Mirror::default();
                }
                // The same way, but up. If it leads over the camera, where the frame shows nothing, its own column has what is nearest at its top.
                let over = [(place % width) as f64, f64::NEG_INFINITY];
                let [column, row] = view.towards([right, -down, ahead]).unwrap_or(over);
                Mirror {
                    // Of waves one sees more of the sides that face the camera.
                    reflects: RIPPLES.map(|slope| fresnel((down + slope).min(1.0)) as f32),
                    down: down as f32,
                    column: column.clamp(0.0, width as f64 - 1.0) as u32,
                    row: row as f32,
                    place: [right / down * camera, ahead / down * camera].map(|m| m as f32),
                }
            })
            .collect();
    }

    /// The light of each row above the horizon and of all that are above it.
    fn sum_up(&mut self, src: Frame<'_>) {
        let (width, rows) = (src.width(), self.sky.max(1));
        self.sums.clear();
        self.sums.resize(width * (rows + 1), [0.0; 3]);
        for y in 0..rows {
            for (x, pixel) in src.row(y).chunks_exact(3).enumerate() {
                let above = self.sums[y * width + x];
                self.sums[(y + 1) * width + x] =
                    [0, 1, 2].map(|channel| above[channel] + self.light.of(pixel[channel]));
            }
        }
    }

    /// What is mirrored, over as many rows as waves spread it.
    #[inline]
    fn mirrored(&self, mirror: Mirror, spread: f32) -> [f32; 3] {
        let (width, rows) = (self.size[0], self.sky.max(1));
        let last = (rows - 1) as f32;
        let first = (mirror.row - spread).clamp(0.0, last) as usize;
        let end = (mirror.row + spread).clamp(0.0, last) as usize + 1;
        let at = |row: usize| &self.sums[row * width + mirror.column as usize];
        let (above, below) = (at(first), at(end));
        let share = 1.0 / (end - first) as f32;
        [0, 1, 2].map(|channel| (below[channel] - above[channel]) * share)
    }
}

impl Perturbation for WetRoad {
    fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let (width, height) = (src.width(), src.height());
        let water = &mut self.water;
        water.prepare([width, height], &self.distances);
        water.puddles.draw(cx);
        water.sum_up(src);
        let camera = self.distances.mounting().height as f32;
        let focal = self.distances.view([width, height]).focal;
        let ripples = RIPPLES.map(|slope| (2.0 * slope * focal) as f32);
        // On the plane of the ground nothing stands.
        let stands = !self.distances.stay();
        let distances = self.distances.of(width, height, cx)?;
        let [share, beside] = ["puddles", "beside"].map(|name| cx.number(name) as f32);
        let smooth = -libm::expm1(-cx.number("film") / cx.number("texture")) as f32;
        let (driven, dark) = (patches::driven(cx), &*DARK);
        for (y, (to, from)) in dst.rows_mut().zip(src.rows()).enumerate() {
            for (x, (to, from)) in to.chunks_exact_mut(3).zip(from.chunks_exact(3)).enumerate() {
                let (mirror, distance) = (water.mirrors[y * width + x], distances[y * width + x]);
                // Below the camera as far as the road is, but for rounding, hills and what stands on it.
                let above = if stands { (camera - mirror.down * distance).abs() } else { 0.0 };
                // The edge of the road is not a line.
                let on_road = (beside + 0.5 - mirror.place[0].abs()).clamp(0.0, 1.0);
                if mirror.down <= 0.0
                    || on_road <= 0.0
                    || above > ABOVE[0] + ABOVE[1] * distance.min(camera / mirror.down)
                {
                    to.copy_from_slice(from);
                    continue;
                }
                let puddle = water.puddles.at(mirror.place, driven).cover(share);
                let [waves, still] = mirror.reflects;
                let covered = on_road * (smooth + (1.0 - smooth) * puddle);
                let mirrors = waves + (still - waves) * puddle;
                let spread = ripples[0] + (ripples[1] - ripples[0]) * puddle;
                let mirrored = water.mirrored(mirror, spread);
                for ((to, from), mirrored) in to.iter_mut().zip(from).zip(mirrored) {
                    let dry = water.light.of(*from);
                    let under_water = dark[*from as usize] + mirrors * mirrored;
                    *to = water.light.store(dry + covered * (under_water - dry));
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::ops::light::{from_light, to_light};
    use pdk_sdk::serde_json::{Value, json};

    use super::*;
    use crate::test_frames::{even, perturbed, perturbed_at};

    #[test]
    fn water_reflects_as_fresnel_says() {
        // Straight down 2 %, at 60 degrees 6 %, at 80 degrees 35 %, grazing everything.
        for (degrees, share) in [(0.0, 0.0204), (60.0, 0.0597), (80.0, 0.3479), (90.0, 1.0)] {
            let found = fresnel(libm::cos(f64::to_radians(degrees)));
            assert!((found - share).abs() < 0.002, "{degrees}: {found}");
        }
    }

    #[test]
    fn dark_ground_gets_darker_than_bright_ground() {
        // Lekner and Dorf: an albedo of 0.1 falls to 0.054, one of 0.8 to 0.66.
        assert!((0.1 * wet(0.1) - 0.054).abs() < 0.002 && (0.8 * wet(0.8) - 0.665).abs() < 0.005);
    }

    /// A camera that looks straight ahead: grey sky above a dark road.
    fn scene(sky: u8, road: u8) -> FrameBuf {
        let mut frame = FrameBuf::new(80, 60);
        for (y, row) in frame.as_mut().rows_mut().enumerate() {
            row.fill(if y < 30 { sky } else { road });
        }
        frame
    }

    fn given(more: Value) -> Value {
        let mut given = json!({"camera_pitch": 0, "puddles": 0});
        let more = more.as_object().unwrap().clone();
        given.as_object_mut().unwrap().extend(more);
        given
    }

    #[test]
    fn under_a_thick_film_the_road_shows_the_sky_by_the_angle() {
        let found = perturbed::<WetRoad>(&given(json!({"film": 100})), &scene(200, 60), None);
        let focal = 40.0 / libm::tan(37.5f64.to_radians());
        for y in [31, 40, 59] {
            let (right, down) = (0.5 / focal, (f64::from(y) + 0.5 - 30.0) / focal);
            let light = to_light(60.0 / 255.0);
            let reflects = fresnel(down / (1.0 + down * down + right * right).sqrt() + RIPPLES[0]);
            let expected = 255.0 * from_light(light * wet(light) + reflects * to_light(200.0 / 255.0));
            let seen = found.as_ref().pixel(40, y as usize);
            assert!(
                seen.iter().all(|value| (f64::from(*value) - expected).abs() < 1.0),
                "{y}: {seen:?} {expected}"
            );
        }
        // The sky is as it was.
        assert!((0..30).all(|y| found.as_ref().pixel(7, y) == [200; 3]));
    }

    #[test]
    fn what_is_mirrored_is_as_far_below_the_horizon_as_above_it() {
        // A bright bar in the sky, eight rows above the horizon.
        let mut source = scene(0, 20);
        for y in 20..24 {
            source.as_mut().row_mut(y).fill(255);
        }
        let found = perturbed::<WetRoad>(&given(json!({"film": 100})), &source, None);
        let column: Vec<u8> = (30..60).map(|y| found.as_ref().pixel(40, y)[0]).collect();
        let centre = column
            .iter()
            .enumerate()
            .map(|(y, value)| (y as f64, f64::from(*value)))
            .filter(|(_, v)| *v > 15.0);
        let (sum, weight) =
            centre.fold((0.0, 0.0), |(sum, weight), (y, value)| (sum + y * value, weight + value));
        // Rows 20 to 23 lie 6 to 9 rows above the horizon, so their mirror lies there below it; light falls off downwards.
        assert!((sum / weight - 7.5).abs() < 1.5, "{} {column:?}", sum / weight);
    }

    #[test]
    fn water_below_a_camera_that_looks_down_mirrors_the_upper_edge() {
        // Of the sky only the first row is bright, and the road is black. The horizon is 17 rows below the upper edge.
        let mut source = even(0, 80, 80);
        source.as_mut().row_mut(0)[..120].fill(255);
        let given = json!({"film": 100, "puddles": 0, "camera_pitch": 30, "field_of_view": 90});
        let found = perturbed::<WetRoad>(&given, &source, None);
        // The lowest row looks 75 degrees down, so that what it mirrors leads over the camera; water reflects 2 % and more of it.
        let least = 255.0 * from_light(0.02) - 1.0;
        for x in [5, 20, 35] {
            let seen = f64::from(found.as_ref().pixel(x, 79)[0]);
            assert!((least..1.5 * least).contains(&seen), "{x}: {seen} {least}");
        }
        assert!((45..80).all(|x| found.as_ref().pixel(x, 79) == [0; 3]));
    }

    #[test]
    fn what_stands_on_the_road_stays_dry() {
        let source = scene(200, 60);
        let near = vec![3.0; 80 * 60];
        let found =
            perturbed::<WetRoad>(&given(json!({"film": 1, "depth": "simulator"})), &source, Some(&near));
        // A wall three metres ahead, which meets the road 23 rows below the horizon.
        assert!((30..50).all(|y| found.as_ref().row(y) == source.as_ref().row(y)));
        assert_ne!(found.as_ref().row(53), source.as_ref().row(53));
        let dry = perturbed::<WetRoad>(&given(json!({"film": 0})), &source, None);
        assert_eq!(dry, source);
    }

    #[test]
    fn the_sky_below_the_horizon_stays_dry() {
        // Behind the crest of a hill there is nothing, also where a plane would still have ground.
        let (source, sky) = (scene(200, 60), vec![f32::INFINITY; 80 * 60]);
        let given = given(json!({"film": 1, "depth": "simulator"}));
        assert_eq!(perturbed::<WetRoad>(&given, &source, Some(&sky)), source);
    }

    #[test]
    fn puddles_pass_as_the_vehicle_drives() {
        let source = even(90, 80, 60);
        let at =
            |travelled: f64| perturbed_at::<WetRoad>(&json!({"puddles": 0.3}), &source, None, (3, travelled));
        assert_eq!(at(2.0), at(2.0));
        assert_ne!(at(0.0), at(5.0));
    }

    #[test]
    fn rules() {
        pdk_sdk::testing::perturbation::<WetRoad>();
        crate::allocations::on_the_first_frames_alone::<WetRoad>();
    }
}
