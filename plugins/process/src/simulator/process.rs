//! The simulator `process`.

use pdk_adapter::process::Launched;
use pdk_adapter::{Deadline, Track};
use pdk_road::LANE_WIDTH;
use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::{Value, json};

use crate::options::Options;
use crate::requests::{Requests, Wait, nonsense};
use crate::room::{absent, room_name, who};

/// A program of the user's.
pub struct Process {
    options: Options,
    camera: Camera,
    /// Started with the first scenario.
    program: Option<Program>,
    drive: Drive,
}

/// The program. The process ends first.
struct Program {
    process: Option<Launched>,
    requests: Requests,
    who: String,
    /// The exchange of one that runs already.
    exchange: Option<String>,
    options: (std::time::Duration, std::time::Duration),
    /// Whether it has said that it is ready.
    is_ready: bool,
}

/// The scenario under way.
#[derive(Default)]
struct Drive {
    /// Where the road is known.
    track: Option<Track>,
    /// How often the vehicle was moved on.
    steps: u64,
    state: State,
}

impl Component for Process {
    fn description() -> Description {
        let description = Description::simulator(
            "process",
            "A program of yours, in any language, that gets controls and gives states and pictures through shared memory",
        )
        .version(2);
        Options::describe(description, "simulator").camera([320, 240], 8.0..=8192.0)
    }

    fn new(config: &Config) -> Result<Self> {
        Ok(Self {
            options: Options::read(config)?,
            camera: config.camera(),
            program: None,
            drive: Drive::default(),
        })
    }

    fn input_files(config: &Config) -> Result<Vec<InputFiles>> {
        Options::input_files(config)
    }
}

impl Simulator for Process {
    fn camera(&self) -> Camera {
        self.camera
    }

    fn reset(&mut self, scenario: &Scenario, slot: u32) -> Result<State> {
        let road = pdk_adapter::road(&scenario.road)?;
        let program = match &mut self.program {
            Some(program) => program,
            None => self.program.insert(Program::start(&self.options, self.camera)?),
        };
        let request = json!({ "reset": { "scenario": scenario, "slot": slot, "waypoints": road } });
        // It was there: what ends it now is the scenario.
        let reply = program.ask(&request).map_err(|error| match error.kind() {
            ErrorKind::Lost | ErrorKind::Late => Error::new(error.message()),
            _ => error,
        })?;
        let waypoints = match &reply["waypoints"] {
            Value::Null => road,
            told => {
                Some(points(told).ok_or_else(|| nonsense(&program.who, &format!("the waypoints {told}")))?)
            }
        };
        self.drive = Drive { track: waypoints.map(Track::new).transpose()?, ..Drive::default() };
        self.drive.follow(&reply, self.camera, &program.who)
    }

    fn frame(&mut self, into: FrameMut<'_>) -> Result<State> {
        self.program.as_mut().ok_or_else(not_started)?.frame(into)?;
        Ok(self.drive.state)
    }

    fn act(&mut self, control: Control) -> Result<State> {
        let program = self.program.as_mut().ok_or_else(not_started)?;
        let reply = program.ask(&json!({ "act": control }))?;
        self.drive.steps += 1;
        self.drive.follow(&reply, self.camera, &program.who)
    }

    fn waypoints(&self) -> Vec<[f64; 3]> {
        self.drive.track.as_ref().map(|track| track.waypoints().to_vec()).unwrap_or_default()
    }
}

fn not_started() -> Error {
    Error::new("it is used before `reset`, which is a defect in pdk")
}

impl Program {
    /// Starts it, and waits until it is ready for this camera.
    fn start(options: &Options, camera: Camera) -> Result<Self> {
        let Options { command, exchange, start, answer, .. } = options;
        let requests = Requests::new(&room_name("simulator", exchange, command))?;
        let process = requests.room().launch("simulator", command)?;
        let who = who("simulator", exchange, command);
        let exchange = command.is_empty().then(|| exchange.clone());
        let mut program =
            Self { process, requests, who, exchange, options: (*start, *answer), is_ready: false };
        program.ask(&json!({ "hello": { "camera": camera } }))?;
        program.is_ready = true;
        Ok(program)
    }

    fn ask(&mut self, request: &Value) -> Result<Value> {
        let Self { process, requests, who, exchange, options, is_ready } = self;
        let mut look = || process.as_mut().map_or(Ok(()), Launched::check);
        let deadline = match is_ready {
            true => Deadline::new(options.1, "answer_seconds"),
            false => Deadline::new(options.0, "start_seconds"),
        };
        let asked = requests.ask(request, !*is_ready, Wait { deadline, who, look: &mut look });
        asked.map_err(|error| match (error.kind(), exchange) {
            (ErrorKind::Late, Some(exchange)) if !requests.is_heard() => {
                absent("simulator", exchange, &deadline)
            }
            _ => error,
        })
    }

    fn frame(&mut self, into: FrameMut<'_>) -> Result<()> {
        let Self { process, requests, who, options, .. } = self;
        let mut look = || process.as_mut().map_or(Ok(()), Launched::check);
        let deadline = Deadline::new(options.1, "answer_seconds");
        requests.frame(&json!({ "frame": {} }), into, Wait { deadline, who, look: &mut look })
    }
}

impl Drive {
    /// Takes the state that a reply tells. What it leaves out follows from the road and from how often the vehicle was moved on.
    fn follow(&mut self, reply: &Value, camera: Camera, who: &str) -> Result<State> {
        let told = &reply["state"];
        let wrong = |name: &str| nonsense(who, &format!("the {name} {}", told[name]));
        let number = |name: &str| match &told[name] {
            Value::Null => Ok(None),
            value => value.as_f64().map(Some).ok_or_else(|| wrong(name)),
        };
        let flag = |name: &str| match &told[name] {
            Value::Null => Ok(None),
            value => value.as_bool().map(Some).ok_or_else(|| wrong(name)),
        };
        let position = points(&json!([told["position"]])).ok_or_else(|| wrong("position"))?[0];
        let place = self.track.as_mut().map(|track| {
            if self.steps == 0 {
                track.stand(position);
            }
            track.find(position)
        });
        let follows = |name: &str, value: Option<f64>| {
            value.ok_or_else(|| {
                Error::new(format!(
                    "{who} does not tell the {name}, and the scenario has no road from which it would follow; tell it, or give the \
                     scenario a road"
                ))
            })
        };
        let told_or = |name: &str, known: Option<f64>| number(name)?.map_or_else(|| follows(name, known), Ok);
        let heading = told_or("heading", place.map(|place| place.heading))?;
        let speed = number("speed")?.ok_or_else(|| wrong("speed"))?;
        let cross_track_error = told_or("cross_track_error", place.map(|place| place.cross_track_error))?;
        // At the edge of the lane, as in the other simulators.
        let has_departed = cross_track_error.abs() >= LANE_WIDTH / 2.0;
        self.state = State {
            time: number("time")?.unwrap_or(self.steps as f64 / camera.rate),
            position,
            heading,
            speed,
            cross_track_error,
            progress: told_or("progress", place.map(|place| place.progress))?,
            vehicle_ahead: number("vehicle_ahead")?.unwrap_or(f64::INFINITY),
            lane_departure: flag("lane_departure")?.unwrap_or(has_departed),
            collision: flag("collision")?.unwrap_or(false),
            finished: flag("finished")?.unwrap_or(place.is_some_and(|place| place.finished)),
        };
        Ok(self.state)
    }
}

/// Points `[x, height, z]`; none if it is something else.
fn points(value: &Value) -> Option<Vec<[f64; 3]>> {
    let point = |value: &Value| {
        let numbers = value.as_array()?.iter().map(Value::as_f64).collect::<Option<Vec<f64>>>()?;
        <[f64; 3]>::try_from(numbers).ok()
    };
    value.as_array()?.iter().map(point).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERA: Camera = Camera { width: 64, height: 48, rate: 20.0 };

    #[test]
    fn what_is_not_told_follows_from_the_road() {
        let road = vec![[0.0, 0.0, 0.0], [0.0, 0.0, 100.0]];
        let mut drive = Drive { track: Some(Track::new(road).unwrap()), ..Drive::default() };
        let start = drive.follow(&json!({ "state": { "position": [1.5, 0, 0], "speed": 8 } }), CAMERA, "it");
        assert_eq!(start.unwrap().heading, 0.0);
        drive.steps = 2;
        let told = json!({ "state": { "position": [1.5, 0, 25], "speed": 8 } });
        let state = drive.follow(&told, CAMERA, "it").unwrap();
        assert_eq!((state.time, state.speed, state.vehicle_ahead), (0.1, 8.0, f64::INFINITY));
        assert!((state.cross_track_error - 1.5).abs() < 1e-9 && (state.progress - 0.25).abs() < 1e-9);
        let told = json!({ "state": {
            "time": 7, "position": [1.5, 0, 25], "heading": 1, "speed": 8, "cross_track_error": -3, "progress": 0.5,
            "vehicle_ahead": 4, "lane_departure": true, "collision": true, "finished": true,
        } });
        let state = drive.follow(&told, CAMERA, "it").unwrap();
        assert_eq!(
            (state.time, state.heading, state.cross_track_error, state.progress),
            (7.0, 1.0, -3.0, 0.5)
        );
        assert_eq!((state.vehicle_ahead, state.flags()), (4.0, [true; 3]));
    }

    #[test]
    fn a_vehicle_2_m_from_the_centre_of_its_lane_has_left_it_unless_the_program_says_otherwise() {
        let road = vec![[0.0, 0.0, 0.0], [0.0, 0.0, 100.0]];
        for (x, told, departed) in [
            (1.9, json!({}), false),
            (2.1, json!({}), true),
            (-2.1, json!({}), true),
            // Its own cross-track error counts, not the one of the road.
            (0.0, json!({"cross_track_error": -2.5}), true),
            (2.1, json!({"cross_track_error": 0.5}), false),
            (2.1, json!({"lane_departure": false}), false),
            (0.0, json!({"lane_departure": true}), true),
        ] {
            let mut state = json!({"position": [x, 0, 0], "speed": 8});
            state.as_object_mut().unwrap().extend(told.as_object().unwrap().clone());
            let mut drive = Drive { track: Some(Track::new(road.clone()).unwrap()), ..Drive::default() };
            let found = drive.follow(&json!({ "state": state }), CAMERA, "it").unwrap();
            assert_eq!(found.lane_departure, departed, "{state}");
        }
        let told =
            json!({"position": [0, 0, 0], "speed": 8, "heading": 0, "cross_track_error": 3, "progress": 0});
        assert!(Drive::default().follow(&json!({ "state": told }), CAMERA, "it").unwrap().lane_departure);
    }

    #[test]
    fn what_cannot_be_is_named() {
        let said = |state: Value| {
            Drive::default().follow(&json!({ "state": state }), CAMERA, "it").unwrap_err().to_string()
        };
        assert_eq!(said(json!({})), "it answered with the position null");
        assert_eq!(said(json!({"position": [0, 1]})), "it answered with the position [0,1]");
        assert_eq!(
            said(json!({"position": [0, 0, 0]})),
            "it does not tell the heading, and the scenario has no road from which it \
                                                          would follow; tell it, or give the scenario a road"
        );
        let speed = json!({"position": [0, 0, 0], "heading": 0, "speed": "fast"});
        assert_eq!(said(speed), "it answered with the speed \"fast\"");
    }
}
