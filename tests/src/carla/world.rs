//! The world of the CARLA server: what its requests do, and what its sensors see.

use std::collections::BTreeMap;
use std::io::Write;
use std::net::{Shutdown, TcpStream};
use std::time::{Duration, Instant};

use pdk_components::loader::Plugin;
use pdk_model::component::ComponentSpec;
use pdk_road::opendrive::{BEYOND, Map as OpenDrive};
use pdk_sdk::abi::host::Instance;
use pdk_sdk::prelude::{Control, FrameBuf, Scenario, Simulator, State};
use rmpv::Value;
use serde_json::json;

/// What a server does when it comes to a frame of the scenario, counted from the first tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// Closes all connections, and takes new ones.
    Close,
    /// Answers nothing any more.
    Hang,
    /// Sends a part of the answer, and closes.
    HalfAnswer,
    /// Sends a part of a camera's frame.
    HalfFrame,
    /// Answers with what is not MessagePack.
    Garbage,
    /// Answers with 100 MB.
    Huge,
    /// Says that a camera's frame has 100 MB.
    HugeFrame,
    /// Closes all streams, as CARLA does with those over which it has sent nothing for a while.
    CloseStreams,
    /// Says the number of the frame before, and sends the camera's frame late, behind the one before once more.
    Lags,
    /// Goes on by itself, as if another client had asked it to.
    Steps,
}

/// How a server is made.
#[derive(Debug, Clone, Copy)]
pub struct Setup {
    /// The version that it says it has.
    pub version: &'static str,
    /// What it does, and at which tick.
    pub fault: Option<(Fault, u64)>,
    /// The seed of the embedded simulator.
    pub seed: u64,
    /// The port, or 0 for one that is free.
    pub port: u16,
    /// Whether a camera's first frames are dark, for this many frames.
    pub adapts: u64,
    /// How long it answers nothing after it was asked to load a map.
    pub loads: Duration,
}

impl Default for Setup {
    fn default() -> Self {
        Self { version: "0.9.16", fault: None, seed: 0, port: 0, adapts: 0, loads: Duration::ZERO }
    }
}

#[derive(Clone)]
struct Actor {
    parent: u32,
    kind: String,
    description: Value,
    attributes: BTreeMap<String, String>,
    location: [f64; 3],
    rotation: [f64; 3],
    velocity: [f64; 3],
    stream: Option<u32>,
    /// The frames that it has sent.
    frames: u64,
}

struct Drive {
    simulator: Box<dyn Simulator>,
    state: State,
    control: Option<Control>,
    size: [usize; 2],
    /// The vehicle was just given its speed: the next tick only takes it over.
    held: bool,
}

pub(super) struct World {
    pub(super) setup: Setup,
    pub(super) port: u16,
    pub(super) frame: u64,
    pub(super) ticks: u64,
    pub(super) episode: u64,
    pub(super) settings: Vec<Value>,
    pub(super) weather: Vec<Value>,
    /// The weather at the latest frame that it was asked for.
    pub(super) seen_weather: Vec<Value>,
    /// The end of loading a map.
    pub(super) loaded: Instant,
    actors: BTreeMap<u32, Actor>,
    pub(super) next: u32,
    pub(super) document: Option<String>,
    pub(super) town: String,
    drive: Option<Drive>,
    pub(super) calls: Vec<String>,
    pub(super) spawned: Vec<String>,
    pub(super) subscribers: Vec<(u32, TcpStream)>,
    pub(super) hanging: bool,
    /// What the latest frame took here.
    pub(super) own: Duration,
    pub(super) subscriptions: usize,
}

/// The map that a server has from the start: 200 m straight ahead.
const TOWN: &str = r#"<?xml version="1.0"?><OpenDRIVE><header revMajor="1" revMinor="4" name="town"/>
<road name="Road 0" length="200" id="0" junction="-1"><planView><geometry s="0" x="0" y="0" hdg="0" length="200"><line/></geometry></planView>
<lanes><laneSection s="0"><left><lane id="1" type="driving"><width sOffset="0" a="4" b="0" c="0" d="0"/></lane></left>
<center><lane id="0" type="none"/></center><right><lane id="-1" type="driving"><width sOffset="0" a="4" b="0" c="0" d="0"/></lane></right>
</laneSection></lanes></road></OpenDRIVE>"#;

pub(super) fn array(elements: impl Into<Vec<Value>>) -> Value {
    Value::Array(elements.into())
}

pub(super) fn at(value: &Value, index: usize) -> &Value {
    value.as_array().and_then(|elements| elements.get(index)).unwrap_or(&Value::Nil)
}

fn vector(value: &Value) -> [f64; 3] {
    [0, 1, 2].map(|i| at(value, i).as_f64().unwrap())
}

fn good(value: Value) -> Value {
    array([array([1.into(), value])])
}

fn done() -> Value {
    array([array([false.into()])])
}

fn refused(reason: &str) -> Value {
    array([array([0.into(), array([reason.into()])])])
}

impl World {
    pub(super) fn new(setup: Setup, port: u16) -> Self {
        let mut settings: Vec<Value> = vec![
            false.into(),
            false.into(),
            array([false.into()]),
            true.into(),
            Value::F32(0.01),
            10.into(),
            Value::F32(0.0),
            true.into(),
            Value::F32(3000.0),
            Value::F32(2000.0),
        ];
        let dusty = if setup.version == "0.9.13" { 13 } else { 14 };
        if setup.version > "0.9.14" {
            settings.push(true.into());
        }
        let mut world = Self {
            setup,
            port,
            frame: 100,
            ticks: 0,
            episode: 1,
            settings,
            weather: vec![Value::F32(15.0); dusty],
            seen_weather: Vec::new(),
            loaded: Instant::now(),
            actors: BTreeMap::new(),
            next: 24,
            document: None,
            town: "Town01".to_owned(),
            drive: None,
            calls: Vec::new(),
            spawned: Vec::new(),
            subscribers: Vec::new(),
            hanging: false,
            own: Duration::ZERO,
            subscriptions: 0,
        };
        world.populate();
        world
    }

    /// Only the spectator is there.
    fn populate(&mut self) {
        self.actors.clear();
        self.drive = None;
        let place =
            array([array([0.0.into(), 0.0.into(), 0.0.into()]), array([0.0.into(), 0.0.into(), 0.0.into()])]);
        self.spawn(&array([0.into(), "spectator".into(), array([])]), &place, 0);
    }

    /// What stands in it besides the spectator.
    pub(super) fn kinds(&self) -> Vec<String> {
        self.actors
            .values()
            .filter(|actor| actor.kind != "spectator")
            .map(|actor| actor.kind.clone())
            .collect()
    }

    pub(super) fn is_synchronous(&self) -> bool {
        self.settings[0].as_bool() == Some(true)
    }

    pub(super) fn close_streams(&mut self) {
        for (_, stream) in self.subscribers.drain(..) {
            let _ = stream.shutdown(Shutdown::Both);
        }
    }

    /// What goes wrong with this request.
    pub(super) fn fault(&self, name: &str) -> Option<Fault> {
        let (fault, tick) = self.setup.fault?;
        (name == "tick_cue" && self.ticks == tick).then_some(fault)
    }

    fn token(&self, stream: u32) -> Value {
        let mut token = stream.to_le_bytes().to_vec();
        token.extend((self.port + 1).to_le_bytes());
        token.extend([1, 0]);
        token.resize(24, 0);
        Value::Binary(token)
    }

    /// Answers a request; none if there is no such request with this many arguments.
    pub(super) fn answer(&mut self, name: &str, arguments: &[Value]) -> Option<Value> {
        let tokens = self.setup.version != "0.9.13";
        let sockets = usize::from(self.setup.version == "0.9.16");
        let expected = match name {
            "get_sensor_token" if !tokens => return None,
            "get_sensor_token"
            | "set_episode_settings"
            | "destroy_actor"
            | "get_actors_by_id"
            | "set_weather_parameters" => 1,
            "copy_opendrive_to_file" | "spawn_actor" | "apply_control_to_vehicle" | "set_actor_transform" => {
                2
            }
            "set_actor_target_velocity" | "set_actor_simulate_physics" => 2,
            "load_new_episode" => 3,
            "spawn_actor_with_parent" => 4 + sockets,
            _ => 0,
        };
        if arguments.len() != expected {
            return None;
        }
        Some(match name {
            "version" => good(self.setup.version.into()),
            "get_episode_info" => good(array([self.episode.into(), array([self.token(1)])])),
            "get_sensor_token" => good(array([self.token(arguments[0].as_u64()? as u32)])),
            "get_episode_settings" => good(array(self.settings.clone())),
            "set_episode_settings" => {
                let values = arguments[0].as_array()?.clone();
                if values.len() != self.settings.len() {
                    return None;
                }
                self.settings = values;
                good(self.frame.into())
            }
            "get_weather_parameters" => good(array(self.weather.clone())),
            "set_weather_parameters" => {
                let values = arguments[0].as_array()?.clone();
                if values.len() != self.weather.len() {
                    return None;
                }
                self.weather = values;
                done()
            }
            "tick_cue" => {
                let began = Instant::now();
                self.seen_weather.clone_from(&self.weather);
                self.ticks += 1;
                self.step();
                self.own = began.elapsed();
                if self.fault(name) == Some(Fault::Steps) {
                    self.step();
                }
                let lags = self.fault(name) == Some(Fault::Lags);
                good((self.frame - u64::from(lags)).into())
            }
            "get_available_maps" => {
                good(array(["/Game/Carla/Maps/Town01".into(), "/Game/Carla/Maps/Town02".into()]))
            }
            "get_map_info" => {
                let place = |x: f64, y: f64, yaw: f64| {
                    array([
                        array([x.into(), y.into(), 0.5.into()]),
                        array([0.0.into(), yaw.into(), 0.0.into()]),
                    ])
                };
                let name = match self.document {
                    Some(_) => "Carla/Maps/OpenDriveMap".to_owned(),
                    None => format!("Carla/Maps/{0}/{0}", self.town),
                };
                good(array([name.into(), array([place(20.0, 2.0, 0.0), place(150.0, -2.0, 180.0)])]))
            }
            "get_map_data" => good(self.document.as_deref().unwrap_or(TOWN).into()),
            "copy_opendrive_to_file" => {
                self.document = Some(arguments[0].as_str()?.to_owned());
                done()
            }
            "load_new_episode" => {
                let map = arguments[0].as_str()?;
                if map != "OpenDriveMap" {
                    (self.document, self.town) = (None, map.to_owned());
                }
                self.episode += 1;
                self.loaded = Instant::now() + self.setup.loads;
                // A map has a weather of its own.
                self.weather.fill(Value::F32(60.0));
                self.settings[0] = false.into();
                self.populate();
                done()
            }
            "get_actor_definitions" => good(self.definitions()),
            "spawn_actor" => good(self.spawn(&arguments[0], &arguments[1], 0)),
            "spawn_actor_with_parent" => {
                let parent = arguments[2].as_u64()? as u32;
                if !self.actors.contains_key(&parent) {
                    return Some(refused("unable to spawn actor: the parent was not found"));
                }
                good(self.spawn(&arguments[0], &arguments[1], parent))
            }
            "destroy_actor" => match self.actors.remove(&(arguments[0].as_u64()? as u32)) {
                Some(actor) => {
                    if actor.kind == "sensor.camera.rgb" {
                        self.drive = None;
                    }
                    good(true.into())
                }
                None => refused("unable to destroy actor: not found"),
            },
            "get_actors_by_id" => {
                let ids = arguments[0].as_array()?.iter().map(|id| id.as_u64().unwrap() as u32);
                let found: Vec<Value> =
                    ids.filter(|id| self.actors.contains_key(id)).map(|id| self.told(id)).collect();
                good(array(found))
            }
            "apply_control_to_vehicle" => {
                let [throttle, steer, brake] = [0, 1, 2].map(|i| at(&arguments[1], i).as_f64().unwrap());
                let parked = at(&arguments[1], 3).as_bool() == Some(true);
                if let Some(drive) = &mut self.drive {
                    let control = Control { steering: steer, throttle: throttle - brake };
                    drive.control = (!parked).then_some(control);
                }
                done()
            }
            "set_actor_target_velocity" => {
                let [x, y, _] = vector(&arguments[1]);
                self.begin(x.hypot(y));
                if let Some(drive) = &mut self.drive {
                    drive.held = true;
                }
                done()
            }
            "set_actor_transform" => {
                if let Some(actor) = self.actors.get_mut(&(arguments[0].as_u64()? as u32)) {
                    (actor.location, actor.rotation) =
                        (vector(at(&arguments[1], 0)), vector(at(&arguments[1], 1)));
                }
                done()
            }
            "set_actor_simulate_physics" => done(),
            _ => return None,
        })
    }

    fn definitions(&self) -> Value {
        // The first type of attribute is 1 since 0.9.16.
        let first = u32::from(self.setup.version == "0.9.16");
        let attribute = |name: &str, kind: u32, value: &str| {
            array([name.into(), (first + kind).into(), value.into(), array([]), true.into(), false.into()])
        };
        let role = || attribute("role_name", 3, "front");
        let camera = || {
            vec![
                attribute("image_size_x", 1, "800"),
                attribute("image_size_y", 1, "600"),
                attribute("fov", 2, "90.0"),
                attribute("sensor_tick", 2, "0.0"),
                role(),
            ]
        };
        let definition = |number: u32, kind: &str, attributes: Vec<Value>| {
            array([number.into(), kind.into(), kind.replace('.', ",").into(), array(attributes)])
        };
        array([
            definition(1, "vehicle.tesla.model3", vec![attribute("color", 4, "180,180,180"), role()]),
            definition(2, "sensor.camera.rgb", camera()),
            definition(4, "sensor.camera.semantic_segmentation", camera()),
            definition(5, "sensor.camera.depth", camera()),
            definition(3, "sensor.other.collision", vec![role()]),
        ])
    }

    pub(super) fn spawn(&mut self, description: &Value, place: &Value, parent: u32) -> Value {
        let id = self.next;
        self.next += 1;
        let kind = at(description, 1).as_str().unwrap().to_owned();
        let attributes = at(description, 2).as_array().unwrap();
        let text = |value: &Value| value.as_str().unwrap().to_owned();
        let attributes =
            attributes.iter().map(|attribute| (text(at(attribute, 0)), text(at(attribute, 2)))).collect();
        let actor = Actor {
            parent,
            stream: kind.starts_with("sensor.").then_some(id + 1000),
            kind,
            description: description.clone(),
            attributes,
            location: vector(at(place, 0)),
            rotation: vector(at(place, 1)),
            velocity: [0.0; 3],
            frames: 0,
        };
        self.spawned.push(actor.kind.clone());
        self.actors.insert(id, actor);
        self.told(id)
    }

    fn told(&self, id: u32) -> Value {
        let actor = &self.actors[&id];
        let three = |numbers: [f32; 3]| array(numbers.map(Value::F32));
        let mut bounds = vec![three([0.0, 0.0, 0.7]), three([2.4, 1.0, 0.8]), three([0.0; 3])];
        if self.setup.version == "0.9.16" {
            bounds.push(id.into());
        }
        let stream = actor.stream.map_or(Value::Binary(Vec::new()), |stream| self.token(stream));
        array([
            id.into(),
            actor.parent.into(),
            actor.description.clone(),
            array(bounds),
            Value::Binary(vec![10]),
            stream,
        ])
    }

    /// Makes the embedded simulator ready: the road of the document, the camera that was spawned.
    fn begin(&mut self, speed: f64) {
        let find = |kind: &str| self.actors.values().find(|actor| actor.kind.starts_with(kind));
        let (Some(camera), Some(vehicle), Some(document)) =
            (find("sensor.camera.rgb"), find("vehicle."), &self.document)
        else {
            return;
        };
        let number = |name: &str| camera.attributes[name].parse::<f64>().unwrap();
        let rate = at(&self.settings[2], 1).as_f64().map_or(20.0, |delta| 1.0 / delta);
        let parameters = json!({
            "width": number("image_size_x"), "height": number("image_size_y"), "field_of_view": number("fov"),
            "rate": rate, "camera_height": camera.location[2], "camera_pitch": -camera.rotation[0],
            "initial_speed": speed, "oncoming": 0, "straight_ends": 0,
        });
        let [x, y, _] = vehicle.location;
        let lane =
            OpenDrive::read(document).unwrap().follow([y, x], vehicle.rotation[1].to_radians(), 1e4).unwrap();
        let size = [number("image_size_x") as usize, number("image_size_y") as usize];
        let mut simulator = simulator("lane", &parameters);
        let spec = ComponentSpec::new;
        let road = json!({"waypoints": trimmed(&lane.points)});
        let scenario = Scenario { road, seed: self.setup.seed, ..Scenario::new(spec("lane"), spec("carla")) };
        let state = simulator.reset(&scenario, 0).unwrap();
        self.drive = Some(Drive { simulator, state, control: None, size, held: false });
    }

    /// A frame further.
    pub(super) fn step(&mut self) {
        self.frame += 1;
        if self.drive.is_none() {
            self.begin(0.0);
        }
        if let Some(drive) = &mut self.drive {
            if let (Some(control), false) = (drive.control, drive.held) {
                drive.state = drive.simulator.act(control).unwrap();
            }
            drive.held = false;
            let state = drive.state;
            let vehicle = self.actors.values_mut().find(|actor| actor.kind.starts_with("vehicle.")).unwrap();
            let [x, height, z] = state.position;
            (vehicle.location, vehicle.rotation) = ([z, x, height], [0.0, state.heading.to_degrees(), 0.0]);
            vehicle.velocity = [state.heading.cos() * state.speed, state.heading.sin() * state.speed, 0.0];
        }
        let snapshot = self.snapshot();
        self.push(1, &snapshot);
        let sensors: Vec<(u32, Actor)> =
            self.actors.iter().filter(|(_, a)| a.stream.is_some()).map(|(id, a)| (*id, a.clone())).collect();
        for (id, actor) in sensors {
            self.actors.entry(id).and_modify(|actor| actor.frames += 1);
            let stream = actor.stream.unwrap();
            match actor.kind.as_str() {
                "sensor.camera.rgb" => {
                    let message = self.picture(&actor);
                    let half = matches!(self.fault("tick_cue"), Some(Fault::HalfFrame));
                    let huge = matches!(self.fault("tick_cue"), Some(Fault::HugeFrame));
                    if half || huge {
                        let length = if huge { 100_000_000 } else { message.len() as u32 };
                        let part = [&length.to_le_bytes()[..], &message[..message.len() / 2]].concat();
                        self.send(stream, &part);
                    } else if self.fault("tick_cue") == Some(Fault::Lags) {
                        let mut before = message.clone();
                        before[8..16].copy_from_slice(&(self.frame - 1).to_le_bytes());
                        self.push(stream, &before);
                        let (_, socket) = self.subscribers.iter().find(|(id, _)| *id == stream).unwrap();
                        let mut socket = socket.try_clone().unwrap();
                        std::thread::spawn(move || {
                            std::thread::sleep(Duration::from_millis(300));
                            let _ = socket
                                .write_all(&[&(message.len() as u32).to_le_bytes()[..], &message].concat());
                        });
                    } else {
                        self.push(stream, &message);
                    }
                }
                "sensor.camera.semantic_segmentation" | "sensor.camera.depth" => {
                    let message = self.annotated(&actor);
                    self.push(stream, &message);
                }
                "sensor.other.collision"
                    if self.drive.as_ref().is_some_and(|drive| drive.state.collision) =>
                {
                    let mut message = self.header(0);
                    let event = array([
                        self.told(actor.parent),
                        self.told(24),
                        array([100.0.into(), 0.0.into(), 0.0.into()]),
                    ]);
                    rmpv::encode::write_value(&mut message, &event).unwrap();
                    self.push(stream, &message);
                }
                _ => {}
            }
        }
    }

    fn header(&self, kind: u64) -> Vec<u8> {
        let mut bytes = kind.to_le_bytes().to_vec();
        bytes.extend(self.frame.to_le_bytes());
        bytes.extend((self.frame as f64 * 0.05).to_le_bytes());
        bytes.resize(48, 0);
        bytes
    }

    fn snapshot(&self) -> Vec<u8> {
        let mut bytes = self.header(17);
        bytes.extend(self.episode.to_le_bytes());
        bytes.resize(48 + 36, 0);
        for (id, actor) in &self.actors {
            let start = bytes.len();
            bytes.extend(id.to_le_bytes());
            bytes.push(1);
            for number in actor.location.iter().chain(&actor.rotation).chain(&actor.velocity) {
                bytes.extend((*number as f32).to_le_bytes());
            }
            bytes.resize(start + 119, 0);
        }
        bytes
    }

    fn picture(&mut self, actor: &Actor) -> Vec<u8> {
        let mut bytes = self.header(13);
        let number = |name: &str| actor.attributes[name].parse::<f64>().unwrap();
        let size = [number("image_size_x") as usize, number("image_size_y") as usize];
        let mut frame = FrameBuf::new(size[0], size[1]);
        if let Some(drive) = &mut self.drive {
            assert_eq!(drive.size, size);
            drive.simulator.frame(frame.as_mut()).unwrap();
        }
        size.iter().for_each(|length| bytes.extend((*length as u32).to_le_bytes()));
        bytes.extend((number("fov") as f32).to_le_bytes());
        let darker = if actor.frames < self.setup.adapts { 4 } else { 1 };
        let pixel = |rgb: &[u8]| [rgb[2] / darker, rgb[1] / darker, rgb[0] / darker, 255];
        bytes.extend(frame.data().chunks_exact(3).flat_map(pixel));
        bytes
    }

    /// What the pixels show, as a tag in red, or how far away it is, in all colours.
    fn annotated(&mut self, actor: &Actor) -> Vec<u8> {
        let mut bytes = self.header(14);
        let number = |name: &str| actor.attributes[name].parse::<f64>().unwrap();
        let size = [number("image_size_x") as usize, number("image_size_y") as usize];
        let pixels = size[0] * size[1];
        size.iter().for_each(|length| bytes.extend((*length as u32).to_le_bytes()));
        bytes.extend((number("fov") as f32).to_le_bytes());
        let Some(drive) = &mut self.drive else {
            bytes.resize(bytes.len() + 4 * pixels, 0);
            return bytes;
        };
        if actor.kind == "sensor.camera.depth" {
            let mut depth = vec![0.0; pixels];
            drive.simulator.depth(&mut depth).unwrap();
            let largest = f64::from((1 << 24) - 1);
            let colours =
                depth.iter().map(|metres| (f64::from(metres / 1000.0).min(1.0) * largest).round() as u32);
            // In memory blue comes first, and red has the lowest bits.
            bytes.extend(
                colours.flat_map(|number| [(number >> 16) as u8, (number >> 8) as u8, number as u8, 255]),
            );
        } else {
            let names = drive.simulator.label_names();
            let mut labels = vec![0; pixels];
            drive.simulator.labels(&mut labels).unwrap();
            let tags: Vec<u8> = names.iter().map(|name| tag(name, self.setup.version)).collect();
            bytes.extend(labels.iter().flat_map(|label| [0, 0, tags[usize::from(*label)], 255]));
        }
        bytes
    }

    fn push(&mut self, stream: u32, message: &[u8]) {
        let whole = [&(message.len() as u32).to_le_bytes()[..], message].concat();
        self.send(stream, &whole);
    }

    fn send(&mut self, stream: u32, bytes: &[u8]) {
        self.subscribers.retain_mut(|(id, socket)| *id != stream || socket.write_all(bytes).is_ok());
    }
}

/// CARLA's tag for what the embedded simulator calls by this name.
fn tag(name: &str, version: &str) -> u8 {
    let [until_0_9_13, since] = match name {
        "sky" => [13, 11],
        "ground" => [22, 10],
        "road" => [7, 1],
        "marking" => [6, 24],
        "vehicle" => [10, 14],
        "vegetation" => [9, 9],
        "building" => [1, 3],
        "post" => [5, 6],
        "traffic_sign" => [12, 8],
        other => panic!("CARLA has no tag for {other}"),
    };
    if version == "0.9.13" { until_0_9_13 } else { since }
}

/// The lane without what the document has behind the road of the scenario.
fn trimmed(points: &[[f64; 3]]) -> &[[f64; 3]] {
    let mut left = BEYOND;
    let mut end = points.len();
    while end > 2 && left > 0.5 {
        let ([ax, _, az], [bx, _, bz]) = (points[end - 2], points[end - 1]);
        left -= (bx - ax).hypot(bz - az);
        end -= 1;
    }
    &points[..end]
}

/// The simulator of the plugin of this name with these parameters.
///
/// # Panics
/// If it has not been built, or refuses them.
pub fn simulator(name: &str, parameters: &serde_json::Value) -> Box<dyn Simulator> {
    let plugin = Plugin::load(&crate::library(&format!("pdk_{name}"))).unwrap();
    let index = plugin.description.components.iter().position(|component| component.name == name).unwrap();
    match plugin.create(index, parameters.as_object().unwrap()).unwrap() {
        Instance::Simulator(simulator) => simulator,
        other => panic!("`{name}` is a {}", other.kind()),
    }
}
