//! The simulator `lane`: a scenario's road, the vehicle on it, and what its camera sees.

use pdk_sdk::prelude::*;

use crate::camera;
use crate::path::Located;
use crate::render::{Pose, Renderer};
use crate::road::Road;
use crate::scene::Scene;
use crate::section;
use crate::vehicle::Vehicle;

/// How far from its last place along the road the vehicle is looked for, in metres: so a road that comes close to
/// itself is never mistaken for another part of it.
const SEARCH: f64 = 10.0;

/// The embedded simulator.
pub struct Lane {
    camera: Camera,
    initial_speed: f64,
    speed_limit: f64,
    renderer: Renderer,
    drive: Option<Drive>,
}

/// A scenario under way.
struct Drive {
    road: Road,
    scene: Scene,
    vehicle: Vehicle,
    located: Located,
    /// Frames since the start.
    frames: u64,
    /// The farthest place reached, in metres along the road.
    farthest: f64,
}

impl Component for Lane {
    fn description() -> Description {
        Description::simulator("lane", "A two-lane road through grassland, built in: nothing to install")
            .parameter(
                Parameter::integer("width", 320, "width of the camera's frames")
                    .range(1.0, 4096.0)
                    .unit("px"),
            )
            .parameter(
                Parameter::integer("height", 240, "height of the camera's frames")
                    .range(1.0, 4096.0)
                    .unit("px"),
            )
            .parameter(
                Parameter::number("rate", 30.0, "frames per second of simulation time")
                    .range(1.0, 1000.0)
                    .unit("Hz"),
            )
            .parameter(
                Parameter::number("initial_speed", 8.0, "speed of the vehicle at the start of the road")
                    .range(0.0, 50.0)
                    .unit("m/s"),
            )
            .parameter(
                Parameter::number("speed_limit", 20.0, "speed that the vehicle never exceeds")
                    .range(0.1, 50.0)
                    .unit("m/s"),
            )
    }

    fn new(config: &Config) -> Result<Self> {
        let camera = Camera {
            width: config.integer("width") as u32,
            height: config.integer("height") as u32,
            rate: config.number("rate"),
        };
        let (initial_speed, speed_limit) = (config.number("initial_speed"), config.number("speed_limit"));
        if initial_speed > speed_limit {
            return Err(Error::new(format!(
                "initial_speed is {initial_speed} m/s, above speed_limit, which is {speed_limit} m/s: lower the \
                 one or raise the other"
            )));
        }
        // The texture is the same in all scenarios; what differs between them comes from the scenario's seed.
        let mut random = pdk_sdk::seed::key(0, "lane texture", 0, 0).sequence();
        let renderer = Renderer::new(camera.width as usize, camera.height as usize, &mut random);
        Ok(Self { camera, initial_speed, speed_limit, renderer, drive: None })
    }
}

#[cfg(test)]
impl Lane {
    /// The state, without drawing a frame.
    pub fn state(&self) -> Option<State> {
        self.drive.as_ref().map(|drive| drive.state(self.camera.rate))
    }

    /// The point of the driven lane so many metres ahead of the vehicle.
    pub fn ahead_on_lane(&self, distance: f64) -> [f64; 2] {
        self.drive.as_ref().map_or([0.0; 2], |d| d.road.path.point_at(d.located.along + distance))
    }
}

impl Simulator for Lane {
    fn camera(&self) -> Camera {
        self.camera
    }

    fn reset(&mut self, scenario: &Scenario) -> Result<State> {
        let road = Road::new(&scenario.road, scenario.seed)?;
        let mut random = pdk_sdk::seed::key(scenario.seed, "lane scene", 0, 0).sequence();
        let scene = Scene::new(&road.path, &mut random);
        self.renderer.prepare(&scene);
        let [dx, dz] = road.path.direction(0);
        let start = road.path.points()[0];
        let vehicle = Vehicle::at(start, libm::atan2(dx, dz), self.initial_speed);
        let located = road.path.locate(vehicle.centre(), 0, 1);
        let drive = Drive { road, scene, vehicle, located, frames: 0, farthest: 0.0 };
        let state = drive.state(self.camera.rate);
        self.drive = Some(drive);
        Ok(state)
    }

    fn frame(&mut self, into: FrameMut<'_>) -> Result<State> {
        let drive = self.drive.as_ref().ok_or_else(not_started)?;
        if !self.renderer.fits(&into.as_ref()) {
            return Err(Error::new(format!(
                "it was given a {}x{} frame, but its camera delivers {}x{}",
                into.width(),
                into.height(),
                self.camera.width,
                self.camera.height
            )));
        }
        let pose = Pose { at: drive.vehicle.ahead(camera::AHEAD_OF_CENTRE), heading: drive.vehicle.heading };
        self.renderer.draw(&drive.scene, pose, into);
        Ok(drive.state(self.camera.rate))
    }

    fn act(&mut self, control: Control) -> Result<()> {
        let drive = self.drive.as_mut().ok_or_else(not_started)?;
        for (name, value) in [("steering", control.steering), ("throttle", control.throttle)] {
            if !value.is_finite() {
                return Err(Error::new(format!(
                    "{name} is {value} at {:.2} s, but has to be a number from -1 to 1",
                    drive.frames as f64 / self.camera.rate
                )));
            }
        }
        drive.vehicle.advance(control, 1.0 / self.camera.rate, self.speed_limit);
        drive.frames += 1;
        drive.locate();
        Ok(())
    }

    fn waypoints(&self) -> Vec<[f64; 3]> {
        self.drive.as_ref().map(|drive| drive.road.waypoints.clone()).unwrap_or_default()
    }
}

fn not_started() -> Error {
    Error::new("it has no scenario yet: call reset first")
}

impl Drive {
    /// Finds the vehicle on the road again after it has moved.
    fn locate(&mut self) {
        let path = &self.road.path;
        let from = path.segment_at(self.located.along - SEARCH);
        let to = path.segment_at(self.located.along + SEARCH) + 1;
        self.located = path.locate(self.vehicle.centre(), from, to);
        self.farthest = self.farthest.max(self.located.along);
    }

    fn state(&self, rate: f64) -> State {
        let [x, z] = self.vehicle.centre();
        let length = self.road.path.length();
        let xte = self.located.lateral;
        State {
            // From the count, not from a sum: it never drifts.
            time: self.frames as f64 / rate,
            position: [x, self.road.waypoints[0][1], z],
            heading: self.vehicle.heading,
            speed: self.vehicle.speed,
            cross_track_error: xte,
            progress: (self.farthest / length).min(1.0),
            vehicle_ahead: f64::INFINITY,
            lane_departure: xte.abs() > section::LANE_WIDTH / 2.0,
            collision: false,
            finished: self.farthest >= length - 1e-6,
        }
    }
}
