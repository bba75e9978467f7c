//! How far away pixels are: as the simulator knows it, or on the plane of the ground.

use pdk_sdk::camera::Mounting;
use pdk_sdk::prelude::*;

/// The camera of the embedded simulator, behind the windscreen of a car.
const MOUNTING: Mounting = Mounting { field_of_view: 75.0, height: 1.35, pitch: 8.0 };

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
    /// How much longer the way to each pixel is than its distance along the optical axis, for frames of this size.
    ways: Vec<f32>,
    /// On the plane of the ground.
    ground: Vec<f32>,
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
        .mounting(MOUNTING, 0.1..=10.0, -45.0..=45.0)
        .parameter(
            Parameter::number("beyond", 1000.0, "how far away everything above the horizon is on the plane of the ground; what is further away counts as that far, too")
                .range(1.0, 100_000.0)
                .unit("m"),
        )
}

impl Distances {
    /// As the parameters say.
    pub fn new(config: &Config) -> Self {
        Self {
            source: if config.text("depth") == "simulator" { Source::Simulator } else { Source::Ground },
            mounting: config.mounting(),
            beyond: config.number("beyond"),
            ways: Vec::new(),
            ground: Vec::new(),
            size: [0, 0],
        }
    }

    /// The focal length in pixels of frames that are this wide.
    pub fn focal(&self, width: usize) -> f64 {
        width as f64 / 2.0 / libm::tan(self.mounting.field_of_view.to_radians() / 2.0)
    }

    /// Makes [`Distances::row`] that of a frame of this size.
    ///
    /// # Errors
    /// If the simulator's depths are wanted and there are none, such as for a picture.
    pub fn look(&mut self, width: usize, height: usize, cx: &Context<'_>) -> Result<()> {
        if self.source == Source::Simulator && cx.depth.is_none_or(|depth| depth.len() != width * height) {
            return Err(Error::new(
                "it needs to know how far away pixels are, and only simulators tell; set `depth=ground`",
            ));
        }
        if self.size != [width, height] {
            self.size = [width, height];
            self.prepare(width, height);
        }
        Ok(())
    }

    fn prepare(&mut self, width: usize, height: usize) {
        let focal = self.focal(width);
        let pitch = self.mounting.pitch.to_radians();
        let (sine, cosine) = (libm::sin(pitch), libm::cos(pitch));
        (self.ways, self.ground) = (Vec::with_capacity(width * height), Vec::with_capacity(width * height));
        for y in 0..height {
            let v = (y as f64 + 0.5 - height as f64 / 2.0) / focal;
            // How far below the camera a point is that lies one metre ahead along the optical axis.
            let down = sine + v * cosine;
            let depth = if down > 0.0 { self.mounting.height / down } else { f64::INFINITY };
            for x in 0..width {
                let u = (x as f64 + 0.5 - width as f64 / 2.0) / focal;
                let way = (1.0 + u * u + v * v).sqrt();
                self.ways.push(way as f32);
                self.ground.push((depth * way).min(self.beyond) as f32);
            }
        }
    }

    /// Calls a function with the distance of each pixel of a row.
    #[inline]
    pub fn row<'a>(&'a self, y: usize, cx: &'a Context<'_>) -> impl Iterator<Item = f32> + 'a {
        let [width, _] = self.size;
        let span = y * width..(y + 1) * width;
        let depth = cx.depth.filter(|_| self.source == Source::Simulator).map(|depth| &depth[span.clone()]);
        let (ways, ground) = (&self.ways[span.clone()], &self.ground[span]);
        (0..width).map(move |x| depth.map_or(ground[x], |depth| depth[x] * ways[x]))
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
        found.look(100, 101, &cx).unwrap();
        assert!((found.focal(100) - 50.0).abs() < 1e-9);
        for (y, expected) in
            [(0, 50.0), (50, 50.0), (75, 2.0 / 0.5 * 1.25f64.sqrt()), (100, 2.0 * 2f64.sqrt())]
        {
            let middle: Vec<f32> = found.row(y, &cx).skip(49).take(2).collect();
            let across = (1.0 + 0.01f64 * 0.01).sqrt();
            let way = |distance: f64| if distance >= 50.0 { 50.0 } else { distance * across };
            assert!(
                middle.iter().all(|found| (f64::from(*found) - way(expected)).abs() < 1e-3),
                "{y}: {middle:?}"
            );
        }
    }

    #[test]
    fn a_simulators_depths_are_along_the_axis_and_ways_are_longer() {
        let mut found = distances(&json!({"depth": "simulator", "field_of_view": 90}));
        let key = Key([1; 32]);
        let mut cx = Context::new(2.0, 0, 0.0, &key);
        let error = found.look(4, 2, &cx).unwrap_err().to_string();
        assert!(error.contains("set `depth=ground`"), "{error}");
        let depth = [10.0, 10.0, 10.0, f32::INFINITY, 1.0, 1.0, 1.0, 1.0];
        cx.depth = Some(&depth);
        found.look(4, 2, &cx).unwrap();
        let row: Vec<f32> = found.row(0, &cx).collect();
        let way = |u: f32, v: f32| 10.0 * (1.0 + u * u + v * v).sqrt();
        assert!(
            (row[0] - way(0.75, 0.25)).abs() < 1e-4 && (row[1] - way(0.25, 0.25)).abs() < 1e-4,
            "{row:?}"
        );
        assert_eq!(row[3], f32::INFINITY);
    }
}
