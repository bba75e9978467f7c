//! The simulator `lane`: a scenario's road, the vehicle on it, and what its camera sees.

use pdk_sdk::prelude::*;

use crate::autopilot::Autopilot;
use crate::camera::{AHEAD_OF_CENTRE, MOUNTING, Projection};
use crate::conditions::{self, Conditions};
use crate::delay::Delay;
use crate::gusts::Gusts;
use crate::labels::Label;
use crate::light::Light;
use crate::parked::Parked;
use crate::render::{Pose, Renderer, World};
use crate::road::{Layout, Road};
use crate::roadside;
use crate::saved::Saved;
use crate::scene::Scene;
use crate::section::{self, Markings};
use crate::sensor::{self, Sensor};
use crate::things::Shown;
use crate::vehicle::Vehicle;
use crate::wear::Wear;
use pdk_road::traffic::{self, Traffic, Wanted};
use pdk_road::{Located, Point};

/// How far from its last place along the road the vehicle is looked for, in metres, if it does not move faster: so a
/// road that comes close to itself is never mistaken for another part of it.
const SEARCH: f64 = 10.0;

/// How far vehicles may come nearer to each other before it is looked whether they touch, in metres: less than their length.
const CLOSING: f64 = 4.0;

/// From the vehicle's centre to its front in metres.
const FRONT: f64 = traffic::SIZE[2] / 2.0;

/// The embedded simulator.
pub struct Lane {
    camera: Camera,
    initial_speed: f64,
    speed_limit: f64,
    start: Start,
    /// The fastest turn by wind, in radians per second.
    gusts: f64,
    conditions: Conditions,
    traffic: Wanted,
    autopilot: Option<Autopilot>,
    delay: Delay,
    renderer: Renderer,
    drive: Option<Drive>,
}

/// Where the vehicle starts, from the middle of the lane.
#[derive(Clone, Copy)]
struct Start {
    /// Metres to the right.
    offset: f64,
    /// Radians to the right.
    heading: f64,
}

/// A scenario under way.
struct Drive {
    road: Road,
    scene: Scene,
    traffic: Traffic,
    parked: Parked,
    /// What the camera's noise and the wind are drawn by.
    noise: Key,
    wind: Key,
    gusts: Gusts,
    vehicle: Vehicle,
    located: Located,
    /// Frames since the start.
    frames: u64,
    /// The farthest place reached, in metres along the road.
    farthest: f64,
    /// Whether the vehicle touched another one on the way to where it is.
    collided: bool,
}

impl Component for Lane {
    fn description() -> Description {
        let description = Description::simulator("lane", "The embedded simulator: a two-lane road through countryside; nothing to install")
            .version(4)
            .camera([320, 160], 1.0..=4096.0)
            .mounting(MOUNTING, 0.3..=4.0, -10.0..=25.0)
            .parameter(
                Parameter::number("speed_limit", 20.0, "speed that the vehicle never exceeds")
                    .range(0.1, 50.0)
                    .unit("m/s"),
            )
            .parameter(Parameter::choice(
                "markings",
                &Markings::NAMES,
                "the middle line is dashed or solid, or it is dashed and all paint is worn",
            ))
            .parameter(
                Parameter::number(
                    "vehicle_ahead",
                    0.0,
                    "free distance to a vehicle ahead in the same lane at the start; 0 for none",
                )
                .range(0.0, 140.0)
                .unit("m"),
            )
            .parameter(
                Parameter::number(
                    "vehicle_ahead_speed",
                    6.5,
                    "mean speed of the vehicle ahead; it swings by 30 % around it every 14 s",
                )
                .range(0.5, 40.0)
                .unit("m/s"),
            )
            .parameter(
                Parameter::number(
                    "start_offset",
                    0.0,
                    "how far to the right of the middle of the lane the vehicle starts; below 0 to the left",
                )
                .range(-1.5, 1.5)
                .unit("m"),
            )
            .parameter(
                Parameter::number(
                    "start_heading",
                    0.0,
                    "by which angle the vehicle is turned to the right of the road at the start; below 0 to the left",
                )
                .range(-20.0, 20.0)
                .unit("degrees"),
            )
            .parameter(
                Parameter::number(
                    "gusts",
                    0.0,
                    "how fast the strongest gusts of wind from the side turn the vehicle, at 10 m/s or more; 0 for no wind. A gust lasts 1 to 3 s, with 1 to 5 s \
                     between two",
                )
                .range(0.0, 30.0)
                .unit("degrees/s"),
            )
            .parameter(Parameter::boolean(
                "autopilot",
                false,
                "the vehicle drives itself, by what only the simulator knows, and does not heed controls: to record what a network is \
                 to learn from",
            ))
            .parameter(
                Parameter::number(
                    "autopilot_swing",
                    0.0,
                    "how far the autopilot swings about the middle of the lane; it drives at the initial speed where the road allows",
                )
                .range(0.0, 1.8)
                .unit("m"),
            );
        conditions::parameters().into_iter().fold(description, Description::parameter)
    }

    fn new(config: &Config) -> Result<Self> {
        let camera = config.camera();
        let conditions = Conditions::new(config)?;
        let (initial_speed, speed_limit) = (conditions.fixed("initial_speed"), config.number("speed_limit"));
        if initial_speed > speed_limit {
            return Err(Error::new(format!(
                "initial_speed is {initial_speed} m/s, above speed_limit, which is {speed_limit} m/s: lower the \
                 one or raise the other"
            )));
        }
        // The texture is the same in all scenarios; what differs between them comes from the scenario's seed.
        let mut random = pdk_sdk::seed::key(0, "lane texture", 0).sequence();
        let markings = Markings::named(config.text("markings"));
        let mounting = config.mounting();
        let size = [camera.width as usize, camera.height as usize];
        let projection = Projection::new(size[0], size[1], mounting);
        let setting = sensor::Setting {
            noise: conditions.fixed("sensor_noise"),
            exposure: conditions.fixed("auto_exposure"),
            vignetting: conditions.fixed("vignetting"),
        };
        let sensor = Sensor::new(setting, size, &mut pdk_sdk::seed::key(0, "lane sensor", 0).sequence());
        let renderer = Renderer::new((projection, size), markings, conditions.natural(), sensor, &mut random);
        let traffic = Wanted {
            gap: config.number("vehicle_ahead"),
            speed: config.number("vehicle_ahead_speed"),
            oncoming: conditions.fixed("oncoming"),
        };
        let autopilot = config
            .boolean("autopilot")
            .then(|| Autopilot { speed: initial_speed, swing: config.number("autopilot_swing") });
        let delay = Delay::new(conditions.fixed("control_delay"), camera.rate);
        let start = Start {
            offset: config.number("start_offset"),
            heading: config.number("start_heading").to_radians(),
        };
        Ok(Self {
            camera,
            initial_speed,
            speed_limit,
            start,
            gusts: config.number("gusts").to_radians(),
            conditions,
            traffic,
            autopilot,
            delay,
            renderer,
            drive: None,
        })
    }
}

impl Lane {
    /// Whether there is room for one value a pixel.
    fn check_room(&self, given: usize, what: &str) -> Result<()> {
        let pixels = self.camera.width as usize * self.camera.height as usize;
        match given == pixels {
            true => Ok(()),
            false => Err(Error::new(format!(
                "it was given room for {given} {what}, but its frames have {pixels} pixels"
            ))),
        }
    }
}

#[cfg(test)]
impl Lane {
    /// The point of the driven lane this many metres ahead of the vehicle.
    pub fn ahead_on_lane(&self, distance: f64) -> [f64; 2] {
        self.drive.as_ref().map_or([0.0; 2], |d| d.road.path.point_at(d.located.along + distance))
    }
}

impl Simulator for Lane {
    fn camera(&self) -> Camera {
        self.camera
    }

    fn reset(&mut self, scenario: &Scenario, _slot: u32) -> Result<State> {
        let seed = scenario.seed;
        let conditions = self.conditions.draw(seed);
        let layout = Layout {
            segment: conditions.get("segment"),
            straight_ends: conditions.get("straight_ends"),
            crests: conditions.get("crests"),
        };
        let road = Road::new(&scenario.road, seed, layout)?;
        // Each part of a scene has random numbers of its own, so that none changes when another one draws more.
        let random = |component: &str| pdk_sdk::seed::key(seed, component, 0).sequence();
        let length = road.path.length();
        let light = Light::named(&conditions.light);
        let mut scene = Scene::new(&road.path, &light, &mut random("lane scene"));
        let lining = (conditions.get("trees"), conditions.get("signs"));
        roadside::furnish(&mut scene, &road.path, lining, &mut random("lane roadside"));
        scene.wear =
            conditions.natural.then(|| Wear::new(conditions.wear(), length, &mut random("lane wear")));
        let traffic =
            Traffic::lasting(self.traffic, length, FRONT, scenario.duration, &mut random(traffic::KEY));
        let parked = Parked::new(conditions.get("parked"), length, &mut random("lane parked"));
        self.renderer.prepare(&scene, traffic.count() + parked.all().len());
        self.delay.reset();
        let noise = pdk_sdk::seed::key(seed, "lane noise", 0);
        let [dx, dz] = road.path.direction(0);
        let middle = road.path.points()[0];
        let Start { offset, heading } = self.start;
        let start = [middle[0] + offset * dz, middle[1] - offset * dx];
        let vehicle = Vehicle::at(start, libm::atan2(dx, dz) + heading, self.initial_speed);
        let wind = pdk_sdk::seed::key(seed, "lane gusts", 0);
        let gusts = Gusts::new(self.gusts, &wind);
        let located = road.path.locate(vehicle.centre(), 0, 1);
        let collided = traffic.collides(0.0, located.along, located.lateral);
        let (frames, farthest) = (0, 0.0);
        let drive = Drive {
            road,
            scene,
            traffic,
            parked,
            noise,
            wind,
            gusts,
            vehicle,
            located,
            frames,
            farthest,
            collided,
        };
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
        self.renderer.draw(drive.world(self.camera.rate), drive.pose(), (&drive.noise, drive.frames), into);
        Ok(drive.state(self.camera.rate))
    }

    fn label_names(&self) -> Vec<String> {
        Label::NAMES.map(str::to_owned).to_vec()
    }

    fn labels(&mut self, into: &mut [u8]) -> Result<()> {
        let drive = self.drive.as_ref().ok_or_else(not_started)?;
        self.check_room(into.len(), "labels")?;
        self.renderer.label(drive.world(self.camera.rate), drive.pose(), into);
        Ok(())
    }

    fn depth(&mut self, into: &mut [f32]) -> Result<()> {
        let drive = self.drive.as_ref().ok_or_else(not_started)?;
        self.check_room(into.len(), "distances")?;
        self.renderer.depth(drive.world(self.camera.rate), drive.pose(), into);
        Ok(())
    }

    fn act(&mut self, control: Control) -> Result<State> {
        let drive = self.drive.as_mut().ok_or_else(not_started)?;
        for (name, value) in [("steering", control.steering), ("throttle", control.throttle)] {
            if !value.is_finite() {
                return Err(Error::new(format!(
                    "{name} is {value} at {:.2} s, but has to be a number from -1 to 1",
                    drive.frames as f64 / self.camera.rate
                )));
            }
        }
        let slope = drive.road.profile.slope(drive.located.along);
        let before = (drive.vehicle.centre(), drive.located, drive.time(self.camera.rate));
        let control = self.autopilot.map_or(control, |autopilot| {
            let gap = drive.traffic.free_distance(before.2, drive.located.along + FRONT);
            autopilot.control(before.2, &drive.vehicle, (&drive.road.path, drive.located), gap)
        });
        // The wind is the same within a frame.
        let wind = drive.gusts.turn(before.2 + 0.5 / self.camera.rate, drive.vehicle.speed);
        for (control, share) in self.delay.effective(control) {
            if share > 0.0 {
                drive.vehicle.advance(control, share / self.camera.rate, slope, self.speed_limit, wind);
            }
        }
        drive.frames += 1;
        drive.arrive(before, self.camera.rate);
        Ok(drive.state(self.camera.rate))
    }

    fn saved_numbers(&self) -> Vec<SavedNumber> {
        Saved::numbers(&self.delay)
    }

    fn save(&mut self, into: &mut [f64]) -> Result<()> {
        let drive = self.drive.as_ref().ok_or_else(not_started)?;
        let Drive { vehicle, located, farthest, collided, .. } = *drive;
        Saved { vehicle, along: located.along, farthest, collided }.write(&self.delay, into)
    }

    fn restore(&mut self, frame: u64, saved: &[f64]) -> Result<State> {
        let drive = self.drive.as_mut().ok_or_else(not_started)?;
        let Saved { vehicle, along, farthest, collided } = Saved::read(&mut self.delay, saved)?;
        drive.located = drive.find(vehicle.centre(), along, SEARCH);
        // Its times do not go back.
        drive.gusts = Gusts::new(self.gusts, &drive.wind);
        (drive.vehicle, drive.frames, drive.farthest, drive.collided) = (vehicle, frame, farthest, collided);
        Ok(drive.state(self.camera.rate))
    }

    fn waypoints(&self) -> Vec<[f64; 3]> {
        self.drive.as_ref().map(|drive| drive.road.waypoints.clone()).unwrap_or_default()
    }
}

fn not_started() -> Error {
    Error::new("it has no scenario yet: call reset first")
}

impl Drive {
    /// Finds the vehicle on the road again after it has moved from its centre, place and time `before`, and looks whether it
    /// touched another one on the way.
    fn arrive(&mut self, before: (Point, Located, f64), rate: f64) {
        let (centre, from, start) = before;
        let [dx, dz] = [0, 1].map(|axis| self.vehicle.centre()[axis] - centre[axis]);
        let travelled = (dx * dx + dz * dz).sqrt();
        // In a bend the way along the middle can be longer than that of the vehicle.
        self.located = self.find(self.vehicle.centre(), from.along, SEARCH.max(2.0 * travelled));
        self.farthest = self.farthest.max(self.located.along);

        let duration = self.time(rate) - start;
        let parts = ((travelled + traffic::ONCOMING_SPEED * duration) / CLOSING).ceil().max(1.0);
        self.collided = (1..=parts as u32).any(|part| {
            let share = f64::from(part) / parts;
            // The end is exact.
            let between = |a: f64, b: f64| if share == 1.0 { b } else { a + (b - a) * share };
            let along = between(from.along, self.located.along);
            let lateral = between(from.lateral, self.located.lateral);
            self.traffic.collides(between(start, self.time(rate)), along, lateral)
                || self.parked.touches(along, lateral)
        });
    }

    /// Where on the road a point is, no farther than `reach` metres from a place along it.
    fn find(&self, point: Point, along: f64, reach: f64) -> Located {
        let path = &self.road.path;
        path.locate(point, path.segment_at(along - reach), path.segment_at(along + reach) + 1)
    }

    /// Where the camera is.
    fn pose(&self) -> Pose {
        Pose {
            at: self.vehicle.ahead(AHEAD_OF_CENTRE),
            heading: self.vehicle.heading,
            along: self.located.along + AHEAD_OF_CENTRE,
        }
    }

    /// What the camera may see.
    fn world(&self, rate: f64) -> World<'_, impl Iterator<Item = Shown>> {
        let path = &self.road.path;
        let driven = self.traffic.seen(self.time(rate), path.length());
        let driven = driven.map(|seen| Shown { seen, parked: false });
        let parked = self.parked.all().iter().map(|&seen| Shown { seen, parked: true });
        let vehicles = driven.chain(parked);
        World { scene: &self.scene, path, profile: &self.road.profile, vehicles }
    }

    /// Simulation time in seconds; from the count, not from a sum: it never drifts.
    fn time(&self, rate: f64) -> f64 {
        self.frames as f64 / rate
    }

    fn state(&self, rate: f64) -> State {
        let time = self.time(rate);
        let along = self.located.along;
        let [x, z] = self.vehicle.centre();
        let length = self.road.path.length();
        let xte = self.located.lateral;
        let finished = self.farthest >= length - 1e-6;
        State {
            time,
            position: [x, self.road.profile.height(along), z],
            heading: self.vehicle.heading,
            speed: self.vehicle.speed,
            cross_track_error: xte,
            progress: if finished { 1.0 } else { self.farthest / length },
            vehicle_ahead: self.traffic.free_distance(time, along + FRONT),
            // As published: the limit itself is too much.
            lane_departure: xte.abs() >= section::LANE_WIDTH / 2.0,
            collision: self.collided,
            finished,
        }
    }
}
