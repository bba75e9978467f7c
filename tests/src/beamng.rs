//! A BeamNG.tech for tests: its protocol outside, the embedded simulator `lane` inside.
//!
//! It builds its road from the prefab that it is given, and its camera from what is said about it. Its vehicle turns the other way round than
//! the first try of the adapter assumes, as one never knows.

use std::collections::BTreeSet;
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
    /// Sends a message whose content is not a map.
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
    /// Whether the gears of its vehicle have numbers: 1 is the first gear then, and else parking.
    pub manual: bool,
    /// Whether its vehicle stays in the shift mode `arcade`.
    pub arcade: bool,
    /// Bytes of a pixel.
    pub channels: usize,
    /// How often it has to be asked whether a picture is ready before one is.
    pub asks: u32,
    /// How much its vehicle is damaged with every step.
    pub wear: f64,
}

impl Default for Setup {
    fn default() -> Self {
        Self {
            protocol: "v1.27",
            fault: None,
            port: 0,
            manual: false,
            arcade: false,
            channels: 4,
            asks: 0,
            wear: 0.001,
        }
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
    /// The request for a picture that is under way: its number, and how often it has still to be asked about.
    picture: Option<(u64, u32)>,
    loaded: bool,
    hanging: bool,
    calls: Vec<String>,
    /// How long it took itself for the latest frame, from the control to the picture that was sent, and whether it is still at it.
    own: Duration,
    busy: bool,
}

/// The shift modes by their numbers.
const ARCADE: u64 = 2;
const REALISTIC_AUTOMATIC: u64 = 3;

/// What the official client says about a camera, field by field.
const CAMERA_FIELDS: [&str; 31] = [
    "vid",
    "name",
    "updateTime",
    "priority",
    "size",
    "fovY",
    "nearFarPlanes",
    "pos",
    "dir",
    "up",
    "useSharedMemory",
    "colourShmemName",
    "colourShmemSize",
    "annotationShmemName",
    "annotationShmemSize",
    "depthShmemName",
    "depthShmemSize",
    "renderColours",
    "renderAnnotations",
    "renderInstance",
    "renderDepth",
    "renderTranslucentAsOpaqueDepth",
    "isVisualised",
    "isStreaming",
    "isStatic",
    "isSnappingDesired",
    "isForceInsideTriangle",
    "isDirWorldSpace",
    "integerDepth",
    "type",
    "_id",
];

struct Drive {
    simulator: Box<dyn Simulator>,
    state: State,
    /// What the vehicle was told last; what a message leaves out stays.
    pedals: [f64; 4],
    mode: u64,
    gear: u64,
    /// How fast it drives backwards, and how far it has.
    back: (f64, f64),
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
    /// If its ports are taken.
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
            picture: None,
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
            // The client may have the picture before the server has recorded how long it took.
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
                let names: BTreeSet<_> =
                    request.as_map().unwrap().iter().map(|(name, _)| name.as_str().unwrap()).collect();
                assert_eq!(names, BTreeSet::from(CAMERA_FIELDS));
                assert!(field(request, "updateTime").as_f64().unwrap() < 0.0);
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
                (drive.mode, drive.gear) = (ARCADE, 1);
                drive.turned = (heading - drive.state.heading).cos() > 0.999;
                Ok(("Teleported", vec![("success", true.into())]))
            }
            "SetShiftMode" => {
                let arcade = self.setup.arcade;
                let drive = self.drive.as_mut().ok_or("there is no vehicle")?;
                drive.mode = if arcade { ARCADE } else { field(request, "mode").as_u64().unwrap() };
                plain("ShiftModeSet")
            }
            "Control" => {
                let drive = self.drive.as_mut().ok_or("there is no vehicle")?;
                for (value, name) in
                    drive.pedals.iter_mut().zip(["throttle", "brake", "steering", "parkingbrake"])
                {
                    *value = field(request, name).as_f64().unwrap_or(*value);
                }
                drive.gear = field(request, "gear").as_u64().unwrap_or(drive.gear);
                plain("Controlled")
            }
            "Step" => {
                self.steps += 1;
                assert!(self.paused);
                let Setup { manual, wear, .. } = self.setup;
                if let Some(drive) = &mut self.drive {
                    drive.step(self.rate, manual);
                    drive.damage += if drive.state.collision { 1000.0 } else { wear };
                }
                plain("Stepped")
            }
            "SensorRequest" => {
                let manual = self.setup.manual;
                let drive = self.drive.as_ref().ok_or("there is no vehicle")?;
                let data = field(request, "sensors").as_map().unwrap().iter().map(|(name, sensor)| {
                    let value = match field(sensor, "type").as_str().unwrap() {
                        "State" => map(vec![("state", drive.told())]),
                        "Damage" => map(vec![("damage", Value::F64(drive.damage))]),
                        "Electrics" => {
                            let gear = if manual { Value::F64(0.0) } else { "P".into() };
                            map(vec![("values", map(vec![("gear", gear)]))])
                        }
                        other => panic!("there is no sensor {other}"),
                    };
                    (name.clone(), value)
                });
                Ok(("SensorData", vec![("data", Value::Map(data.collect()))]))
            }
            // By itself, this camera has taken no picture.
            "PollCamera" => Ok(("PollCamera", vec![("data", map(Vec::new()))])),
            "SendAdHocRequestCamera" => {
                assert_eq!(field(request, "name"), field(self.camera.as_ref().unwrap(), "name"));
                self.picture = Some((self.steps, self.setup.asks));
                // A number of Lua.
                Ok(("SendAdHocRequestCamera", vec![("data", Value::F64(self.steps as f64))]))
            }
            "IsAdHocPollRequestReadyCamera" => {
                let (number, asks) = self.picture.as_mut().ok_or("there is no request")?;
                assert_eq!(field(request, "requestId").as_u64(), Some(*number));
                let ready = *asks == 0;
                *asks = asks.saturating_sub(1);
                Ok(("IsAdHocPollRequestReadyCamera", vec![("data", ready.into())]))
            }
            "CollectAdHocPollRequestCamera" => {
                let (number, asks) = self.picture.take().ok_or("there is no request")?;
                assert_eq!((field(request, "requestId").as_u64(), asks), (Some(number), 0));
                let drive = self.drive.as_mut().ok_or("there is no vehicle")?;
                let [width, height] =
                    numbers(field(self.camera.as_ref().ok_or("there is no camera")?, "size"));
                let mut frame = FrameBuf::new(width as usize, height as usize);
                drive.simulator.frame(frame.as_mut()).unwrap();
                let channels = self.setup.channels;
                let rgba = |rgb: &[u8]| [rgb[0], rgb[1], rgb[2], 255];
                let pixels =
                    frame.data().chunks_exact(3).flat_map(|rgb| rgba(rgb).into_iter().take(channels));
                let colour = Value::Binary(pixels.collect());
                Ok(("CollectAdHocPollRequestCamera", vec![("data", map(vec![("colour", colour)]))]))
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
        let mut simulator = crate::carla::simulator("lane", &parameters);
        let spec = ComponentSpec::new;
        let road = json!({"waypoints": self.waypoints});
        let scenario = Scenario { road, ..Scenario::new(spec("lane"), spec("beamng")) };
        let state = simulator.reset(&scenario, 0).unwrap();
        self.drive = Some(Drive {
            simulator,
            state,
            pedals: [0.0; 4],
            mode: ARCADE,
            gear: 1,
            back: (0.0, 0.0),
            turned: false,
            damage: 0.0,
        });
    }
}

impl Drive {
    /// A frame further, by the gearbox.
    fn step(&mut self, rate: f64, manual: bool) {
        let [throttle, brake, steering, parking] = self.pedals;
        if parking > 0.0 {
            return;
        }
        let (speed, way) = &mut self.back;
        if self.mode == ARCADE && brake > 0.0 && self.state.speed < 0.05 {
            // A brake that is held at rest shifts into reverse and accelerates.
            *speed += 4.0 * brake / rate;
            *way += *speed / rate;
            return;
        }
        *speed = 0.0;
        let forward = self.mode == ARCADE || self.gear == if manual { 1 } else { 2 };
        assert!(forward || self.mode == REALISTIC_AUTOMATIC);
        let throttle = if forward { throttle } else { 0.0 };
        self.state = self.simulator.act(Control { steering, throttle: throttle - brake }).unwrap();
    }

    /// What the sensor `State` says.
    fn told(&self) -> Value {
        let [x, height, z] = self.state.position;
        let way = if self.turned { 1.0 } else { -1.0 };
        let (sine, cosine) = self.state.heading.sin_cos();
        let vector = |numbers: [f64; 3]| Value::Array(numbers.map(Value::F64).to_vec());
        let (back_speed, back) = self.back;
        let speed = self.state.speed - back_speed;
        map(vec![
            ("pos", vector([x - back * sine, z - back * cosine, height])),
            ("dir", vector([way * sine, way * cosine, 0.0])),
            ("vel", vector([speed * sine, speed * cosine, 0.0])),
        ])
    }
}

/// The middle of the right lane of a prefab's road, without what it has beyond its ends.
fn lane_of(prefab: &str) -> Vec<[f64; 3]> {
    let objects: Vec<serde_json::Value> =
        prefab.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let road =
        objects.iter().find(|object| object["class"] == "DecalRoad" && object["nodes"][0][3] == 8.0).unwrap();
    assert!(objects.iter().any(|object| object["class"] == "BeamNGVehicle"));
    assert!(objects.iter().all(|object| object["persistentId"].is_string()));
    let group = objects.iter().find(|object| object["class"] == "SimGroup").unwrap();
    assert!(group["groupPosition"].is_string() && group["noAutoReload"] == true, "{group}");
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
