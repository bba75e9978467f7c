//! The connections to a running BeamNG.tech, and a scenario in it.

use std::time::Duration;

use pdk_adapter::{Connection, Deadline, Picture, Place, Settings, Station, Track};
use pdk_sdk::prelude::{Control, Error, ErrorKind, FrameMut, Result, Scenario, State};
use pdk_sdk::serde_json::{self, json};
use rmpv::Value;

use crate::camera;
use crate::messages::{LONGEST, Messages, field, three};
use crate::options::Options;
use crate::scenery;

/// The names of what is put into the game.
const NAME: &str = "pdk";
const VEHICLE: &str = "pdk_ego";
/// So much above the ground the vehicle is put, in metres.
const DROP: f64 = 0.3;
/// It has come to rest when it moves more slowly than this, in metres per second, after at most this many seconds of simulation time.
const REST: f64 = 0.05;
const SETTLE: f64 = 5.0;
/// The cosine of the angle by which it may face another way than the road.
const FACING: f64 = 0.98;
/// The shift mode `realistic_automatic`, by BeamNG's number: gears shift by themselves, and a held brake only brakes. In the default mode,
/// `arcade`, a brake that is held at rest shifts into reverse and accelerates.
const AUTOMATIC: u64 = 3;
/// The numbers of the forward gear: drive for gearboxes whose gears have letters, and the first gear for the others.
const DRIVE: u64 = 2;
const FIRST: u64 = 1;
/// How long taking leave may take for each answer.
const LEAVE: Duration = Duration::from_secs(5);

/// A running game as a worker uses it.
#[derive(Debug)]
pub struct Session {
    station: Station,
    options: Options,
    engine: Messages,
    vehicle: Option<Messages>,
    /// The scenario's file in the game.
    path: Option<Value>,
    drive: Option<Drive>,
}

#[derive(Debug)]
struct Drive {
    track: Track,
    frames: u64,
    /// The damage at the start.
    worn: f64,
    state: State,
    picture: Picture,
}

/// How the vehicle moves.
#[derive(Debug, Clone, Copy)]
struct Motion {
    position: [f64; 3],
    direction: [f64; 3],
    /// Along the direction, so negative for a vehicle that drives backwards.
    speed: f64,
    damage: f64,
}

impl Session {
    /// Connects to the game of a slot.
    ///
    /// # Errors
    /// If it is not there, or another version.
    pub fn open(settings: &Settings, options: &Options, slot: u32, deadline: &Deadline) -> Result<Self> {
        let mut station = Station::new(settings, slot)?;
        let engine = station.connect(0, deadline).and_then(|socket| {
            let connection = Connection::new(socket, station.to_string(), LONGEST)?;
            let opened = Messages::open(connection, &options.protocol, &settings.answering());
            opened.map_err(|error| station.unknown(error))
        });
        let engine = engine.map_err(|error| station.blame(error))?;
        Ok(Self { station, options: options.clone(), engine, vehicle: None, path: None, drive: None })
    }

    /// The slot whose game this is.
    pub fn slot(&self) -> u32 {
        self.station.slot()
    }

    /// Whether the connection still stands.
    pub fn is_open(&mut self) -> bool {
        self.engine.is_open()
    }

    /// Puts a vehicle at the start of a scenario.
    ///
    /// # Errors
    /// If the game does not do what it is asked for.
    pub fn begin(&mut self, scenario: &Scenario, deadline: &Deadline) -> Result<State> {
        let begun = self.prepare(scenario, deadline);
        begun.map_err(|error| self.station.blame(error))
    }

    /// Moves the scenario on by one frame.
    ///
    /// # Errors
    /// If the game does not do what it is asked for.
    pub fn act(&mut self, control: Control) -> Result<State> {
        let stepped = self.step(control.checked()?);
        stepped.map_err(|error| self.station.blame(error))
    }

    /// The latest state.
    ///
    /// # Errors
    /// If there is no scenario.
    pub fn state(&self) -> Result<State> {
        self.drive.as_ref().map(|drive| drive.state).ok_or_else(not_started)
    }

    /// The road's centre line.
    pub fn waypoints(&self) -> Vec<[f64; 3]> {
        self.drive.as_ref().map(|drive| drive.track.waypoints().to_vec()).unwrap_or_default()
    }

    /// Writes the latest frame.
    ///
    /// # Errors
    /// If there is none, or it is of another size.
    pub fn write(&self, into: FrameMut<'_>) -> Result<()> {
        self.drive.as_ref().ok_or_else(not_started)?.picture.write(into)
    }

    fn ask(&mut self, what: &str, fields: Vec<(&str, Value)>, expected: &str) -> Result<Value> {
        self.engine.call(what, fields, expected, &self.station.settings().answering())
    }

    fn ask_vehicle(&mut self, what: &str, fields: Vec<(&str, Value)>, expected: &str) -> Result<Value> {
        let deadline = self.station.settings().answering();
        match &mut self.vehicle {
            Some(vehicle) => vehicle.call(what, fields, expected, &deadline),
            None => Err(not_started()),
        }
    }

    fn prepare(&mut self, scenario: &Scenario, deadline: &Deadline) -> Result<State> {
        let waypoints = match pdk_adapter::road(&scenario.road)? {
            Some(waypoints) => waypoints,
            None => pdk_adapter::random_road(scenario.seed, "beamng road")?,
        };
        let mut track = Track::new(waypoints)?;
        let answering = self.station.settings().answer;
        self.tidy(|| Deadline::new(answering, "answer_seconds"))?;
        self.load(track.waypoints(), deadline)?;
        let motion = self.settle(track.waypoints())?;
        track.restart();
        let picture = Picture::new(self.options.mount.camera.width, self.options.mount.camera.height);
        let picture = self.look(picture)?;
        let mut drive = Drive { track, frames: 0, worn: motion.damage, state: State::default(), picture };
        let state = drive.arrive(motion, &self.options);
        self.drive = Some(drive);
        Ok(state)
    }

    /// Writes the scenario, loads it, and connects to its vehicle.
    fn load(&mut self, waypoints: &[[f64; 3]], deadline: &Deadline) -> Result<()> {
        let options = self.options.clone();
        let [x, height, z] = waypoints[0];
        let car = scenery::vehicle(VEHICLE, &options.vehicle, [x, options.ground + height + DROP, z]);
        let prefab = scenery::prefab(NAME, waypoints, options.ground, &options.materials, &car);
        let file = format!("levels/{}/scenarios/{NAME}/{NAME}.prefab.json", options.level);
        let info = json!({
            "name": NAME, "description": "A scenario of pdk", "difficulty": 0, "authors": "pdk", "lapConfig": [], "forceNoCountDown": true,
            "vehicles": {VEHICLE: {"playerUsable": true, "startFocus": true}}, "prefabs": [file],
        });
        let fields = vec![
            ("level", options.level.as_str().into()),
            ("name", NAME.into()),
            ("prefab", prefab.into()),
            ("info", of_json(&info)),
            ("json", true.into()),
            ("noAutoReload", true.into()),
        ];
        let path = field(&self.ask("CreateScenario", fields, "CreateScenario")?, "result").clone();
        self.path = Some(path.clone());
        let fields = vec![("path", path), ("precompileShaders", true.into())];
        self.engine.call("LoadScenario", fields, "MapLoaded", deadline)?;
        let fields = vec![("restrict_actions", true.into())];
        self.engine.call("StartScenario", fields, "ScenarioStarted", deadline)?;
        self.ask("SetPhysicsDeterministic", vec![("speedFactor", Value::Nil)], "SetPhysicsDeterministic")?;
        self.ask("FPSLimit", vec![("fps", options.pace().per_second.into())], "SetFPSLimit")?;
        self.ask("Pause", Vec::new(), "Paused")?;

        let connected =
            self.ask("StartVehicleConnection", vec![("vid", VEHICLE.into())], "StartVehicleConnection")?;
        let port = field(&connected, "result").as_u64().and_then(|port| u16::try_from(port).ok());
        let Some(port) = port else { return Err(self.engine.strange("StartVehicleConnection", &connected)) };
        let socket = self.station.connect_to(port, deadline)?;
        let connection = Connection::new(socket, format!("the vehicle of {}", self.station), LONGEST)?;
        self.vehicle = Some(Messages::open(connection, &options.protocol, deadline)?);
        self.ask("OpenCamera", camera::opening(&options, VEHICLE), "OpenedCamera").map(drop)
    }

    /// Turns the vehicle along the road, and lets it come to rest.
    fn settle(&mut self, waypoints: &[[f64; 3]]) -> Result<Motion> {
        let ([ax, height, az], [bx, _, bz]) = (waypoints[0], waypoints[1]);
        let heading = libm::atan2(bx - ax, bz - az);
        let position = [ax, az, self.options.ground + height + DROP];
        let along = |motion: &Motion| {
            let [dx, dy, _] = motion.direction;
            (dx * libm::sin(heading) + dy * libm::cos(heading)) / libm::hypot(dx, dy).max(1e-9)
        };
        let parked = vec![
            ("parkingbrake", 1.into()),
            ("throttle", 0.into()),
            ("brake", 1.into()),
            ("steering", 0.into()),
            ("gear", self.forward_gear()?.into()),
        ];
        let mut motion = self.motion()?;
        // Which way round a turn goes differs between releases: where one faces backwards, it is the other.
        for turn in [heading, -heading] {
            let [x, y, z, w] = scenery::facing(turn);
            let fields = vec![
                ("vehicle", VEHICLE.into()),
                ("pos", vector(position)),
                ("rot", Value::Array([x, y, z, w].map(Value::F64).to_vec())),
                ("reset", true.into()),
                ("safe_spawn", false.into()),
            ];
            self.ask("Teleport", fields, "Teleported")?;
            // A vehicle that was reset may be in the default mode again.
            self.ask_vehicle("SetShiftMode", vec![("mode", AUTOMATIC.into())], "ShiftModeSet")?;
            self.ask_vehicle("Control", parked.clone(), "Controlled")?;
            motion = self.advance()?;
            if along(&motion) >= FACING {
                break;
            }
        }
        if along(&motion) < FACING {
            return Err(Error::of(
                ErrorKind::Nonsense,
                format!(
                    "the vehicle was put along the road, but faces {:?} and not {:.0} degrees",
                    motion.direction,
                    heading.to_degrees()
                ),
            ));
        }
        let most = (SETTLE * self.options.mount.camera.rate).ceil() as u32;
        for _ in 0..most {
            motion = self.advance()?;
            if motion.speed.abs() < REST {
                break;
            }
        }
        let free = vec![
            ("parkingbrake", 0.into()),
            ("throttle", 0.into()),
            ("brake", 0.into()),
            ("steering", 0.into()),
        ];
        self.ask_vehicle("Control", free, "Controlled")?;
        Ok(motion)
    }

    fn step(&mut self, control: Control) -> Result<State> {
        let pedals = vec![
            ("steering", Value::F64(control.steering)),
            ("throttle", Value::F64(control.throttle.max(0.0))),
            ("brake", Value::F64((-control.throttle).max(0.0))),
        ];
        self.ask_vehicle("Control", pedals, "Controlled")?;
        let motion = self.advance()?;
        let mut drive = self.drive.take().ok_or_else(not_started)?;
        drive.picture = self.look(drive.picture)?;
        drive.frames += 1;
        let state = drive.arrive(motion, &self.options);
        self.drive = Some(drive);
        Ok(state)
    }

    /// A frame further.
    fn advance(&mut self) -> Result<Motion> {
        let count = self.options.pace().steps;
        self.ask("Step", vec![("count", count.into()), ("ack", true.into())], "Stepped")?;
        self.motion()
    }

    fn motion(&mut self) -> Result<Motion> {
        let answer = self.sense(&["State", "Damage"])?;
        let data = field(&answer, "data");
        let state = field(field(data, "State"), "state");
        let damage = field(field(data, "Damage"), "damage").as_f64().unwrap_or_default();
        let parts = (three(field(state, "pos")), three(field(state, "dir")), three(field(state, "vel")));
        let (Some([x, y, z]), Some(direction), Some(velocity)) = parts else {
            return Err(self.engine.strange("SensorRequest", &answer));
        };
        let speed = forward_speed(direction, velocity);
        Ok(Motion { position: [x, z - self.options.ground, y], direction, speed, damage })
    }

    /// The number of the gear in which the vehicle drives forwards: a gearbox whose gears have letters has parking for 1 and drive for 2, one
    /// whose gears have numbers has the first gear for 1.
    fn forward_gear(&mut self) -> Result<u64> {
        let answer = self.sense(&["Electrics"])?;
        let values = field(field(field(&answer, "data"), "Electrics"), "values");
        Ok(if field(values, "gear").is_number() { FIRST } else { DRIVE })
    }

    /// What sensors of these types say, each under the name of its type.
    fn sense(&mut self, types: &[&str]) -> Result<Value> {
        let sensor = |kind: &&str| ((*kind).into(), Value::Map(vec![("type".into(), (*kind).into())]));
        let sensors = Value::Map(types.iter().map(sensor).collect());
        self.ask_vehicle("SensorRequest", vec![("sensors", sensors)], "SensorData")
    }

    /// What the camera sees now, in place of what it saw.
    fn look(&mut self, picture: Picture) -> Result<Picture> {
        camera::look(&mut self.engine, picture, &self.station.settings().answering())
    }

    /// Ends the scenario before. Each call has a deadline of its own; what the game refuses, because it is not there any more, need
    /// not be ended.
    fn tidy(&mut self, deadline: impl Fn() -> Deadline) -> Result<()> {
        (self.drive, self.vehicle) = (None, None);
        let Some(path) = self.path.take() else { return Ok(()) };
        for (what, fields, expected) in [
            ("CloseCamera", vec![("name", camera::NAME.into())], "ClosedCamera"),
            ("StopScenario", Vec::new(), "ScenarioStopped"),
            ("DeleteScenario", vec![("path", path)], "DeleteScenario"),
        ] {
            match self.engine.call(what, fields, expected, &deadline()) {
                Err(error) if error.kind() != ErrorKind::Failed => return Err(error),
                _ => {}
            }
        }
        Ok(())
    }
}

impl Drop for Session {
    /// Leaves the game as it was found; what cannot be put back is left as it is, because there is no remedy.
    fn drop(&mut self) {
        let limit = || Deadline::new(LEAVE, "answer_seconds");
        if self.path.is_none() {
            return;
        }
        // A game that is gone or hangs does not answer the rest either.
        let mut answers = self.tidy(limit).is_ok();
        for (what, expected) in [
            ("SetPhysicsNonDeterministic", "SetPhysicsNonDeterministic"),
            ("RemoveFPSLimit", "RemovedFPSLimit"),
            ("Resume", "Resumed"),
        ] {
            if answers && let Err(error) = self.engine.call(what, Vec::new(), expected, &limit()) {
                answers = error.kind() == ErrorKind::Failed;
            }
        }
    }
}

impl Drive {
    fn arrive(&mut self, motion: Motion, options: &Options) -> State {
        let Place { cross_track_error, progress, finished, .. } = self.track.find(motion.position);
        let [dx, dy, _] = motion.direction;
        self.state = State {
            time: options.pace().time(self.frames),
            position: motion.position,
            heading: libm::atan2(dx, dy),
            speed: motion.speed,
            cross_track_error,
            progress,
            lane_departure: cross_track_error.abs() >= pdk_road::LANE_WIDTH / 2.0,
            collision: motion.damage > self.worn + options.collision_damage,
            finished,
            ..State::default()
        };
        self.state
    }
}

/// The part of a velocity along a direction, in metres per second.
fn forward_speed(direction: [f64; 3], velocity: [f64; 3]) -> f64 {
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    dot(direction, velocity) / dot(direction, direction).sqrt().max(1e-9)
}

fn vector(numbers: [f64; 3]) -> Value {
    Value::Array(numbers.map(Value::F64).to_vec())
}

/// JSON as MessagePack.
fn of_json(value: &serde_json::Value) -> Value {
    match value {
        serde_json::Value::Null => Value::Nil,
        serde_json::Value::Bool(set) => (*set).into(),
        serde_json::Value::Number(number) => match number.as_i64() {
            Some(whole) => whole.into(),
            None => Value::F64(number.as_f64().unwrap_or_default()),
        },
        serde_json::Value::String(text) => text.as_str().into(),
        serde_json::Value::Array(elements) => Value::Array(elements.iter().map(of_json).collect()),
        serde_json::Value::Object(fields) => {
            Value::Map(fields.iter().map(|(name, value)| (name.as_str().into(), of_json(value))).collect())
        }
    }
}

fn not_started() -> Error {
    Error::new("it has no scenario yet: call reset first")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_vehicle_that_drives_backwards_has_a_negative_speed() {
        for (direction, velocity, speed) in [
            ([0.0, -1.0, 0.0], [0.0, -3.0, 0.0], 3.0),
            ([0.0, -1.0, 0.0], [0.0, 3.0, 0.0], -3.0),
            // Drifting sideways is not driving.
            ([0.0, 2.0, 0.0], [5.0, 1.0, 0.0], 1.0),
            ([0.0; 3], [5.0, 1.0, 0.0], 0.0),
        ] {
            assert_eq!(forward_speed(direction, velocity), speed);
        }
    }
}
