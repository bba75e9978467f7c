//! A BeamNG.tech for tests: its protocol outside, the embedded simulator `lane` inside.
//!
//! It builds its road from the prefab that it is given, and its camera from what is said about it. Its vehicle turns the other way round than
//! the first try of the adapter assumes, as one never knows.

use std::io::{BufReader, Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use pdk_model::component::ComponentSpec;
use pdk_road::{LANE_WIDTH, Path};
use pdk_sdk::prelude::{Control, FrameBuf, Scenario, Simulator, State};
use rmpv::Value;
use serde_json::json;

use crate::server::{Server, Shared};
use crate::stand_in::free_ports;

/// What a game does at some step, counted from the first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// Closes all connections, and takes new ones.
    Close,
    /// Answers nothing any more.
    Hang,
    /// Sends a part of the answer, and closes.
    Half,
    /// Sends a message whose content is no map.
    Garbage,
    /// Announces 100 MB and sends them.
    Huge,
}

/// How a game is made.
#[derive(Debug, Clone, Copy)]
pub struct Setup {
    /// The version of its protocol.
    pub protocol: &'static str,
    /// What it does, and at which step.
    pub fault: Option<(Fault, u64)>,
    /// The port of the engine; that of the vehicle is the next one. 0 for two that are free.
    pub port: u16,
}

impl Default for Setup {
    fn default() -> Self {
        Self { protocol: "v1.27", fault: None, port: 0 }
    }
}

/// A running game. It ends when it is dropped.
pub struct BeamNgGame {
    port: u16,
    server: Server<World>,
}

struct World {
    setup: Setup,
    port: u16,
    steps: u64,
    paused: bool,
    waypoints: Vec<[f64; 3]>,
    rate: f64,
    camera: Option<Value>,
    drive: Option<Drive>,
    loaded: bool,
    hanging: bool,
    calls: Vec<String>,
    /// How long it took itself for the latest frame, from the control to the picture that was sent, and whether it is still at it.
    own: Duration,
    busy: bool,
}

struct Drive {
    simulator: Box<dyn Simulator>,
    state: State,
    control: Option<Control>,
    /// Whether the vehicle faces along the road.
    turned: bool,
    damage: f64,
}

fn field<'a>(map: &'a Value, key: &str) -> &'a Value {
    let entries = map.as_map().map_or(&[][..], Vec::as_slice);
    entries.iter().find(|(name, _)| name.as_str() == Some(key)).map_or(&Value::Nil, |(_, value)| value)
}

fn numbers<const N: usize>(value: &Value) -> [f64; N] {
    std::array::from_fn(|i| value.as_array().unwrap()[i].as_f64().unwrap())
}

fn map(fields: Vec<(&str, Value)>) -> Value {
    Value::Map(fields.into_iter().map(|(name, value)| (name.into(), value)).collect())
}

impl BeamNgGame {
    /// Starts one.
    ///
    /// # Panics
    /// Where its ports are taken.
    pub fn start(setup: Setup) -> Self {
        let port = if setup.port == 0 { free_ports(2) } else { setup.port };
        let world = World {
            setup,
            port,
            steps: 0,
            paused: false,
            waypoints: Vec::new(),
            rate: 20.0,
            camera: None,
            drive: None,
            loaded: false,
            hanging: false,
            calls: Vec::new(),
            own: Duration::ZERO,
            busy: false,
        };
        Self { port, server: Server::start(world, &[(port, answer_all), (port + 1, answer_all)]) }
    }

    /// The port of the engine.
    pub fn port(&self) -> u16 {
        self.port
    }

    /// The names of the requests that it got, in their order.
    pub fn calls(&self) -> Vec<String> {
        self.server.world().calls.clone()
    }

    /// How many steps it has taken for its client.
    pub fn steps(&self) -> u64 {
        self.server.world().steps
    }

    /// Whether it is as it was before anybody came: running, without a scenario or a camera.
    pub fn is_untouched(&self) -> bool {
        let world = self.server.world();
        !world.paused && !world.loaded && world.camera.is_none()
    }

    /// How long it took itself for the latest frame, from the control to the picture.
    pub fn own_time(&self) -> Duration {
        loop {
            // Whoever has the picture may be faster than it says what that took.
            let world = self.server.world();
            if !world.busy {
                return world.own;
            }
            drop(world);
            std::thread::yield_now();
        }
    }
}

fn answer_all(mut stream: TcpStream, game: &Shared<World>) {
    let mut reader = BufReader::new(stream.try_clone().unwrap());
    let mut length = [0; 4];
    while reader.read_exact(&mut length).is_ok() {
        let began = Instant::now();
        let mut bytes = vec![0; u32::from_be_bytes(length) as usize];
        if reader.read_exact(&mut bytes).is_err() {
            return;
        }
        let request = rmpv::decode::read_value(&mut &bytes[..]).unwrap();
        let what = field(&request, "type").as_str().unwrap().to_owned();
        let (answer, fault) = {
            let mut world = game.world();
            world.busy = true;
            world.calls.push(what.clone());
            (world.answer(&what, &request), world.fault(&what))
        };
        let mut fields = vec![("_id".into(), field(&request, "_id").clone())];
        match answer {
            Ok((kind, more)) => {
                fields.push(("type".into(), kind.into()));
                fields.extend(more.into_iter().map(|(name, value)| (name.into(), value)));
            }
            Err(problem) => fields.push(("bngError".into(), problem.into())),
        }
        let mut bytes = Vec::new();
        rmpv::encode::write_value(&mut bytes, &Value::Map(fields)).unwrap();
        let message = [&(bytes.len() as u32).to_be_bytes()[..], &bytes].concat();
        let sent = match fault {
            Some(Fault::Close) => {
                game.close_all();
                return;
            }
            Some(Fault::Half) => {
                let _ = stream.write_all(&message[..message.len() / 2]);
                game.close_all();
                return;
            }
            Some(Fault::Hang) => {
                game.world().hanging = true;
                continue;
            }
            Some(Fault::Garbage) => stream.write_all(&[&[0, 0, 0, 50][..], &[0xc1; 50]].concat()),
            Some(Fault::Huge) => stream
                .write_all(&100_000_000u32.to_be_bytes())
                .and_then(|()| stream.write_all(&vec![0; 100_000_000])),
            None if game.world().hanging => continue,
            None => stream.write_all(&message),
        };
        game.world().took(&what, began.elapsed());
        if sent.is_err() {
            return;
        }
    }
}

type Answer = Result<(&'static str, Vec<(&'static str, Value)>), String>;

impl World {
    /// A request took so long; the first of a frame is its control.
    fn took(&mut self, what: &str, time: Duration) {
        if what == "Control" {
            self.own = Duration::ZERO;
        }
        self.own += time;
        self.busy = false;
    }

    fn fault(&self, what: &str) -> Option<Fault> {
        let (fault, step) = self.setup.fault?;
        (what == "Step" && self.steps == step).then_some(fault)
    }

    fn answer(&mut self, what: &str, request: &Value) -> Answer {
        let plain = |kind| Ok((kind, Vec::new()));
        match what {
            "Hello" => Ok(("Hello", vec![("protocolVersion", self.setup.protocol.into())])),
            "CreateScenario" => {
                self.waypoints = lane_of(field(request, "prefab").as_str().unwrap());
                let vehicles = field(field(request, "info"), "vehicles");
                assert!(field(vehicles, "pdk_ego").is_map(), "{vehicles}");
                Ok(("CreateScenario", vec![("result", "/levels/smallgrid/scenarios/pdk/pdk.json".into())]))
            }
            "LoadScenario" => {
                self.loaded = true;
                plain("MapLoaded")
            }
            "StartScenario" => plain("ScenarioStarted"),
            "StopScenario" => {
                (self.loaded, self.drive) = (false, None);
                plain("ScenarioStopped")
            }
            "DeleteScenario" => plain("DeleteScenario"),
            "SetPhysicsDeterministic" => plain("SetPhysicsDeterministic"),
            "SetPhysicsNonDeterministic" => plain("SetPhysicsNonDeterministic"),
            "FPSLimit" => {
                // Three steps of the game are a frame.
                self.rate = field(request, "fps").as_f64().unwrap() / 3.0;
                plain("SetFPSLimit")
            }
            "RemoveFPSLimit" => plain("RemovedFPSLimit"),
            "Pause" => {
                self.paused = true;
                plain("Paused")
            }
            "Resume" => {
                self.paused = false;
                plain("Resumed")
            }
            "StartVehicleConnection" if self.loaded => {
                let vehicle = field(request, "vid").clone();
                Ok(("StartVehicleConnection", vec![("vid", vehicle), ("result", (self.port + 1).into())]))
            }
            "OpenCamera" => {
                self.camera = Some(request.clone());
                self.begin();
                plain("OpenedCamera")
            }
            "CloseCamera" => {
                self.camera = None;
                plain("ClosedCamera")
            }
            "Teleport" => {
                let [_, _, z, w] = numbers(field(request, "rot"));
                let drive = self.drive.as_mut().ok_or("there is no vehicle")?;
                // Its turns are counter-clockwise, and it faces back before.
                let heading = std::f64::consts::PI - 2.0 * f64::atan2(z, w);
                drive.turned = (heading - drive.state.heading).cos() > 0.999;
                Ok(("Teleported", vec![("success", true.into())]))
            }
            "Control" => {
                let drive = self.drive.as_mut().ok_or("there is no vehicle")?;
                let number = |name| field(request, name).as_f64();
                let parked = number("parkingbrake").is_some();
                let throttle = number("throttle").unwrap() - number("brake").unwrap();
                let steering = number("steering").unwrap();
                drive.control = (!parked).then_some(Control { steering, throttle });
                plain("Controlled")
            }
            "Step" => {
                self.steps += 1;
                assert!(self.paused);
                if let Some(drive) = &mut self.drive
                    && let Some(control) = drive.control
                {
                    drive.state = drive.simulator.act(control).unwrap();
                    drive.damage += if drive.state.collision { 100.0 } else { 0.001 };
                }
                plain("Stepped")
            }
            "SensorRequest" => {
                let drive = self.drive.as_ref().ok_or("there is no vehicle")?;
                let [x, height, z] = drive.state.position;
                let way = if drive.turned { 1.0 } else { -1.0 };
                let (sine, cosine) = drive.state.heading.sin_cos();
                let vector = |numbers: [f64; 3]| Value::Array(numbers.map(Value::F64).to_vec());
                let speed = drive.state.speed;
                let state = map(vec![
                    ("pos", vector([x, z, height])),
                    ("dir", vector([way * sine, way * cosine, 0.0])),
                    ("vel", vector([speed * sine, speed * cosine, 0.0])),
                ]);
                let damage = map(vec![("damage", Value::F64(drive.damage))]);
                Ok(("SensorData", vec![("data", map(vec![("state", state), ("damage", damage)]))]))
            }
            "PollCamera" => {
                let drive = self.drive.as_mut().ok_or("there is no vehicle")?;
                let [width, height] =
                    numbers(field(self.camera.as_ref().ok_or("there is no camera")?, "size"));
                let mut frame = FrameBuf::new(width as usize, height as usize);
                drive.simulator.frame(frame.as_mut()).unwrap();
                let pixels =
                    frame.data().chunks_exact(3).flat_map(|rgb| [rgb[0], rgb[1], rgb[2], 255]).collect();
                Ok(("PollCamera", vec![("data", map(vec![("colour", Value::Binary(pixels))]))]))
            }
            other => Err(format!("unknown request {other}")),
        }
    }

    /// Makes the embedded simulator ready: the road of the prefab, the camera that was opened.
    fn begin(&mut self) {
        let camera = self.camera.as_ref().unwrap();
        let [width, height] = numbers(field(camera, "size"));
        let half = (field(camera, "fovY").as_f64().unwrap() / 2.0).to_radians().tan() * width / height;
        let [_, y, z] = numbers(field(camera, "dir"));
        let [_, _, above] = numbers(field(camera, "pos"));
        let parameters = json!({
            "width": width, "height": height, "rate": self.rate, "field_of_view": 2.0 * half.atan().to_degrees(),
            "camera_height": above, "camera_pitch": f64::atan2(-z, -y).to_degrees(), "initial_speed": 0, "oncoming": 0,
            "straight_ends": 0,
        });
        let mut simulator = crate::carla::lane_simulator(&parameters);
        let spec = ComponentSpec::new;
        let road = json!({"waypoints": self.waypoints});
        let scenario = Scenario { road, ..Scenario::new(spec("lane"), spec("beamng")) };
        let state = simulator.reset(&scenario, 0).unwrap();
        self.drive = Some(Drive { simulator, state, control: None, turned: false, damage: 0.0 });
    }
}

/// The middle of the right lane of a prefab's road, without what it has beyond its ends.
fn lane_of(prefab: &str) -> Vec<[f64; 3]> {
    let objects: Vec<serde_json::Value> =
        prefab.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let road =
        objects.iter().find(|object| object["class"] == "DecalRoad" && object["nodes"][0][3] == 8.0).unwrap();
    assert!(objects.iter().any(|object| object["class"] == "BeamNGVehicle"));
    let number = |value: &serde_json::Value| value.as_f64().unwrap();
    let nodes: Vec<_> =
        road["nodes"].as_array().unwrap().iter().map(|node| [number(&node[0]), number(&node[1])]).collect();
    let path = Path::through(&nodes, 0.25);
    let (start, end) = (15.0, path.length() - 15.0);
    let count = ((end - start) / 2.0).ceil();
    (0..=count as u32)
        .map(|i| {
            let [x, z] = path.beside(start + f64::from(i) / count * (end - start), LANE_WIDTH / 2.0);
            [x, 0.0, z]
        })
        .collect()
}
