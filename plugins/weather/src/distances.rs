//! How far away pixels are: as the simulator knows it, or on the plane of the ground.

use pdk_sdk::camera::Mounting;
use pdk_sdk::ground::View;
use pdk_sdk::ops::light::{Light, PIXELS, fade};
use pdk_sdk::prelude::*;

/// How far away the sky of a simulator is, in metres, so that nothing is infinite.
const SKY: f32 = 100_000.0;

/// Where distances come from.
#[derive(Clone, Copy, PartialEq)]
enum Source {
    Ground,
    Simulator,
}

/// The distances of a frame's pixels from the camera, in metres.
pub struct Distances {
    source: Source,
    mounting: Mounting,
    beyond: f64,
    /// For frames of this size the distances on the plane of the ground, or, if the simulator has them, how much longer the way to each pixel
    /// is than its distance along the optical axis.
    table: Vec<f32>,
    /// As the simulator has them for the latest frame.
    seen: Vec<f32>,
    size: [usize; 2],
}

/// Adds the parameters that say where distances come from.
pub fn described(description: Description) -> Description {
    description
        .parameter(Parameter::choice(
            "depth",
            &["ground", "simulator"],
            "where distances come from: ground: what is below the horizon lies on a plane, and all above it is `beyond` away; simulator: as \
             the simulator knows them",
        ))
        .depth_with("depth", "simulator")
        .mounting(Mounting::WINDSCREEN, 0.1..=10.0, -45.0..=45.0)
        .parameter(
            Parameter::number("beyond", 150.0, "how far away everything above the horizon is, and the furthest that the ground is")
                .range(1.0, 100_000.0)
                .unit("m")
                .only_for("depth", "ground"),
        )
}

/// The place of a pixel's centre.
pub fn centre(pixel: [usize; 2]) -> [f64; 2] {
    pixel.map(|side| side as f64 + 0.5)
}

impl Distances {
    /// As the parameters say.
    pub fn new(config: &Config) -> Self {
        Self {
            source: if config.text("depth") == "simulator" { Source::Simulator } else { Source::Ground },
            mounting: config.mounting(),
            beyond: config.number("beyond"),
            table: Vec::new(),
            seen: Vec::new(),
            size: [0, 0],
        }
    }

    /// Where the camera is mounted.
    pub fn mounting(&self) -> Mounting {
        self.mounting
    }

    /// Whether they are the same for all frames of a size.
    pub fn stay(&self) -> bool {
        self.source == Source::Ground
    }

    /// Where the pixels of frames of a size look.
    pub fn view(&self, size: [usize; 2]) -> View {
        self.mounting.view(size)
    }

    /// The distances of a frame of this size, row by row.
    ///
    /// # Errors
    /// If the simulator's depths are wanted and there are none, such as for a picture.
    pub fn of(&mut self, width: usize, height: usize, cx: &Context<'_>) -> Result<&[f32]> {
        if self.size != [width, height] {
            self.size = [width, height];
            self.prepare(width, height);
        }
        if self.source == Source::Ground {
            return Ok(&self.table);
        }
        let Some(depth) = cx.depth.filter(|depth| depth.len() == width * height) else {
            return Err(Error::new(
                "it needs to know how far away pixels are, and only simulators tell; set `depth=ground`",
            ));
        };
        self.seen.clear();
        self.seen.extend(depth.iter().zip(&self.table).map(|(depth, way)| (depth * way).min(SKY)));
        Ok(&self.seen)
    }

    fn prepare(&mut self, width: usize, height: usize) {
        let (view, source) = (self.view([width, height]), self.source);
        let (camera, beyond) = (self.mounting.height, self.beyond);
        let of = |place: [usize; 2]| match source {
            Source::Simulator => view.stretch(centre(place)) as f32,
            Source::Ground => {
                let [_, down, _] = view.direction(centre(place));
                let distance = if down > 0.0 { camera / down } else { f64::INFINITY };
                distance.min(beyond) as f32
            }
        };
        self.table.clear();
        self.table.extend((0..width * height).map(|place| of([place % width, place / width])));
    }
}

/// Koschmieder's law: over the distance of each pixel light is lost to an extinction per metre, and that of the air takes its place.
pub fn haze(
    light: &Light,
    src: Frame<'_>,
    dst: &mut FrameMut<'_>,
    distances: &[f32],
    extinction: f32,
    air: [f32; 3],
) {
    for ((to, from), distances) in dst.rows_mut().zip(src.rows()).zip(distances.chunks_exact(src.width())) {
        light.change(from, to, |first, lights| {
            let mut left = [0.0; PIXELS];
            let left = &mut left[..lights.len() / 3];
            fade(&distances[first / 3..], extinction, left);
            for (pixel, left) in lights.chunks_exact_mut(3).zip(left) {
                for (light, air) in pixel.iter_mut().zip(air) {
                    *light = *light * *left + air * (1.0 - *left);
                }
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::serde_json::{Map, json};

    use super::*;

    fn distances(given: &pdk_sdk::serde_json::Value) -> Distances {
        let description = described(Description::perturbation("haze", "Haze"));
        Distances::new(&Config::check(&description, given.as_object().unwrap_or(&Map::new())).unwrap())
    }

    #[test]
    fn the_ground_is_as_far_away_as_it_is_on_a_plane() {
        // A camera that looks straight ahead, two metres above the ground: a pixel at 45 degrees down sees the ground 2 m ahead.
        let given = json!({"camera_height": 2, "camera_pitch": 0, "field_of_view": 90, "beyond": 50});
        let mut found = distances(&given);
        let key = Key([1; 32]);
        let cx = Context::new(2.0, 0, 0.0, &key);
        assert!((found.view([100, 101]).focal - 50.0).abs() < 1e-9);
        let all = found.of(100, 101, &cx).unwrap();
        for (y, expected) in
            [(0, 50.0), (50, 50.0), (75, 2.0 / 0.5 * 1.25f64.sqrt()), (100, 2.0 * 2f64.sqrt())]
        {
            let across = (1.0 + 0.01f64 * 0.01).sqrt();
            let way = if expected >= 50.0 { 50.0 } else { expected * across };
            for found in &all[y * 100 + 49..][..2] {
                assert!((f64::from(*found) - way).abs() < 1e-3, "{y}: {found} {way}");
            }
        }
    }

    #[test]
    fn a_camera_that_looks_down_sees_the_horizon_above_the_middle() {
        let view = distances(&json!({"camera_pitch": 45, "field_of_view": 90})).view([101, 101]);
        // The upper edge of a square frame looks straight ahead, the middle 45 degrees down.
        let [right, down, ahead] = view.direction(centre([50, 0]));
        assert!(right.abs() < 1e-9 && down.abs() < 0.01 && ahead > 0.99);
        let [_, down, ahead] = view.direction(centre([50, 50]));
        assert!((down - 0.5f64.sqrt()).abs() < 1e-9 && (ahead - down).abs() < 1e-9);
    }

    #[test]
    fn a_simulators_depths_are_along_the_axis_and_ways_are_longer() {
        let mut found = distances(&json!({"depth": "simulator", "field_of_view": 90}));
        let key = Key([1; 32]);
        let mut cx = Context::new(2.0, 0, 0.0, &key);
        let error = found.of(4, 2, &cx).unwrap_err().to_string();
        assert!(error.contains("set `depth=ground`"), "{error}");
        let depth = [10.0, 10.0, 10.0, f32::INFINITY, 1.0, 1.0, 1.0, 1.0];
        cx.depth = Some(&depth);
        let row = found.of(4, 2, &cx).unwrap();
        let way = |u: f32, v: f32| 10.0 * (1.0 + u * u + v * v).sqrt();
        assert!(
            (row[0] - way(0.75, 0.25)).abs() < 1e-4 && (row[1] - way(0.25, 0.25)).abs() < 1e-4,
            "{row:?}"
        );
        assert_eq!(row[3], SKY);
    }
}
