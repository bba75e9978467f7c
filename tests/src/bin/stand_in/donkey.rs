//! The Donkey simulator: a TCP server.

use std::io::{Read, Write};
use std::net::{Shutdown, TcpStream};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use pdk_sdk::prelude::Control;
use serde_json::{Value, json};

use crate::fault::Fault;
use crate::world::World;
use crate::{Options, picture};

/// The road-generating build reads so much at a time.
const PART: usize = 8142;

/// How a connection ended.
enum End {
    /// The other end hung up, or a fault has it hang up: there may be another one after so long.
    Closed(Duration),
    Quit,
}

/// A connection with a car.
struct Session<'a> {
    stream: TcpStream,
    /// What was received, a part each. A thread of its own receives, however busy this one is, as in the simulator.
    parts: Receiver<Vec<u8>>,
    world: &'a mut World,
    options: &'a mut Options,
    /// What is left of the last part.
    rest: String,
    has_car: bool,
    png: bool,
    control: Control,
}

/// Serves one client after the other.
pub fn run(mut options: Options) {
    let mut world = World::new(options.seeds.as_deref(), options.rate.unwrap_or(20.0));
    loop {
        let listener = pdk_tests::stand_in::listen(options.port);
        let (stream, _) = listener.accept().unwrap();
        stream.set_nodelay(true).unwrap();
        let (sender, parts) = channel();
        let mut receiver = stream.try_clone().unwrap();
        std::thread::spawn(move || {
            let mut part = [0; PART];
            while let Ok(length @ 1..) = receiver.read(&mut part) {
                if sender.send(part[..length].to_vec()).is_err() {
                    return;
                }
            }
        });
        let mut session = Session {
            stream,
            parts,
            world: &mut world,
            options: &mut options,
            rest: String::new(),
            has_car: false,
            png: false,
            control: Control::default(),
        };
        let end = session.serve();
        // Both threads have it open.
        let _ = session.stream.shutdown(Shutdown::Both);
        drop(session);
        match end {
            End::Closed(pause) => {
                if !pause.is_zero() {
                    drop(listener);
                    std::thread::sleep(pause);
                }
            }
            End::Quit => return,
        }
    }
}

impl Session<'_> {
    fn is_current(&self) -> bool {
        self.options.build != "road_generating"
    }

    fn serve(&mut self) -> End {
        if self.is_current() {
            self.send(&json!({"msg_type": "scene_selection_ready", "loaded": "1"}));
        } else {
            self.load();
        }
        let mut due = Instant::now();
        loop {
            let mut left = Duration::from_secs(3600);
            if let Some(rate) = self.options.rate {
                if due <= Instant::now() {
                    if self.has_car {
                        self.world.go_on(self.control, is_held(self.control));
                        if let Some(end) = self.tell() {
                            return end;
                        }
                    }
                    // From now on: on a machine that is too busy for its rate it becomes slower, and goes on listening.
                    due = Instant::now() + Duration::from_secs_f64(1.0 / rate);
                }
                left = due.saturating_duration_since(Instant::now());
            }
            match self.parts.recv_timeout(left) {
                Ok(part) => {
                    let text = String::from_utf8_lossy(&part).into_owned();
                    for message in self.messages(&text) {
                        if let Some(end) = self.take(&message) {
                            return end;
                        }
                    }
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return End::Closed(Duration::ZERO),
            }
        }
    }

    /// The messages in a part, by the rules of the build.
    fn messages(&mut self, part: &str) -> Vec<Value> {
        let texts: Vec<String> = if self.is_current() {
            // Taken apart behind each opening brace; a piece is whole if it ends with a closing one.
            let all = std::mem::take(&mut self.rest) + part;
            let mut pieces: Vec<String> =
                all.split('{').filter(|piece| !piece.is_empty()).map(|piece| format!("{{{piece}")).collect();
            if let Some(last) = pieces.pop_if(|piece| !piece.ends_with('}')) {
                self.rest = last;
            }
            pieces
        } else {
            // The simulator takes each part for one message, and loses two that come together. On a machine that is busy enough,
            // any two may: here they are only told.
            let parts: Vec<&str> = part.split("}{").collect();
            let last = parts.len() - 1;
            if last > 0 {
                eprintln!("stand-in: {} messages came together", parts.len());
            }
            let braced = |(i, part): (usize, &&str)| {
                format!("{}{part}{}", if i > 0 { "{" } else { "" }, if i < last { "}" } else { "" })
            };
            parts.iter().enumerate().map(braced).collect()
        };
        texts
            .iter()
            .filter_map(|text| {
                let message = serde_json::from_str(text);
                if let Err(error) = &message {
                    eprintln!("stand-in: dropped a message of {} bytes ({error})", text.len());
                }
                message.ok()
            })
            .collect()
    }

    fn take(&mut self, message: &Value) -> Option<End> {
        let text =
            |name: &str| message[name].as_str().unwrap_or_else(|| panic!("{message} has no text `{name}`"));
        let number = |name: &str| text(name).parse::<f64>().unwrap();
        match text("msg_type") {
            "get_scene_names" => {
                self.send(
                    &json!({"scene_names": ["generated_road", "generated_track"], "msg_type": "scene_names"}),
                );
            }
            "get_protocol_version" => self.send(&json!({"msg_type": "protocol_version", "version": "2"})),
            "load_scene" => self.load(),
            "exit_scene" => {
                self.has_car = false;
                self.send(&json!({"msg_type": "scene_selection_ready", "loaded": "1"}));
            }
            "car_config" => _ = (text("body_style"), number("body_r"), text("car_name")),
            "cam_config" => {
                let size = |name: &str| number(name) as u32;
                if size("img_w") > 0 && size("img_h") > 0 {
                    self.world.resize(size("img_w"), size("img_h"));
                }
                self.png = text("img_enc") == "PNG";
                _ = ["fov", "fish_eye_x", "fish_eye_y", "offset_x", "offset_y", "offset_z", "rot_x"]
                    .map(number);
            }
            "reset_car" => {
                self.world.start();
                self.control = Control::default();
            }
            "regen_road" if self.is_current() => {
                _ = [number("road_style"), number("rand_seed"), number("turn_increment")]
            }
            "regen_road" => {
                let points = pdk_road::parse(text("wayPoints")).unwrap();
                let home = self.options.home;
                let moved = points.iter().map(|point| std::array::from_fn(|axis| point[axis] - home[axis]));
                self.world.build(moved.collect());
                self.control = Control::default();
            }
            "control" => {
                let (throttle, brake) = (number("throttle"), number("brake"));
                let throttle = if brake > 0.0 { -brake } else { throttle };
                self.control = Control { steering: number("steering"), throttle };
                if self.options.rate.is_none() && self.has_car {
                    self.world.go_on(self.control, is_held(self.control));
                    return self.tell();
                }
            }
            "quit_app" | "disconnect" => return Some(End::Quit),
            other => eprintln!("stand-in: does not know `{other}`"),
        }
        None
    }

    fn load(&mut self) {
        self.world.start();
        self.has_car = true;
        self.send(&json!({"msg_type": "car_loaded"}));
    }

    /// Sends telemetry, unless something goes wrong.
    fn tell(&mut self) -> Option<End> {
        let line = self.telemetry();
        // What goes wrong does so in the middle of a drive.
        let fault =
            if self.world.controls > 0 { self.options.faults.after(self.world.controls) } else { None };
        let Some(fault) = fault else {
            self.write(line.as_bytes());
            return None;
        };
        match fault {
            Fault::Close(pause) => Some(End::Closed(pause)),
            Fault::Die => std::process::exit(3),
            Fault::Hang => loop {
                std::thread::sleep(Duration::from_secs(1000));
            },
            Fault::Half => {
                self.write(&line.as_bytes()[..line.len() / 2]);
                Some(End::Closed(Duration::ZERO))
            }
            Fault::Garbage => {
                self.write(b"220 mail.example.org ESMTP ready\r\n");
                None
            }
            Fault::Huge => {
                self.write(with(&line, "speed", "1e160").as_bytes());
                None
            }
            Fault::Back => {
                self.write(with(&line, "time", "0").as_bytes());
                None
            }
            Fault::Freeze(pause) => {
                std::thread::sleep(pause);
                None
            }
            Fault::Flood => {
                self.write(br#"{"msg_type":"telemetry","image":""#);
                for _ in 0..100 {
                    self.write(&[b'A'; 1 << 20]);
                }
                None
            }
        }
    }

    /// Telemetry, laid out as the build does.
    fn telemetry(&mut self) -> String {
        let image = picture::encode(&self.world.look(), self.png);
        let state = self.world.state;
        let home = self.options.home;
        let scale = if self.is_current() { 8.0 } else { 1.0 };
        let at: [f64; 3] = std::array::from_fn(|axis| (state.position[axis] + home[axis]) / scale);
        let numbers = |number: f64| match self.options.german {
            true => number.to_string().replace('.', ","),
            false => number.to_string(),
        };
        let common = format!(
            r#""msg_type":"telemetry","steering_angle":{},"throttle":{},"speed":{},"image":"{image}","hit":"{}","pos_x":{},"pos_y":{},"pos_z":{},"time":{},"cte":{}"#,
            numbers(self.control.steering),
            numbers(self.control.throttle),
            numbers(state.speed / scale),
            if state.collision { "vehicle" } else { "none" },
            numbers(at[0]),
            numbers(at[1]),
            numbers(at[2]),
            numbers(state.time),
            numbers(state.cross_track_error),
        );
        let node = (state.progress * 100.0) as u32;
        match self.is_current() {
            true => format!(
                "{{{common},\"yaw\":{},\"activeNode\":{},\"totalNodes\":100}}\n",
                numbers(state.heading.to_degrees()),
                node % 100
            ),
            false => format!(
                "{{{common},\"lap\":0,\"sector\":0,\"sector\":{node},\"done\":{},\"maxSector\":100}}\n",
                state.finished || state.lane_departure
            ),
        }
    }

    fn send(&mut self, message: &Value) {
        self.write(format!("{message}\n").as_bytes());
    }

    /// If the other end is gone, reading says so.
    fn write(&mut self, bytes: &[u8]) {
        let _ = self.stream.write_all(bytes);
    }
}

/// A message with another number in the place of this field's.
fn with(message: &str, field: &str, number: &str) -> String {
    let name = format!("\"{field}\":");
    let (before, rest) = message.split_once(&name).unwrap();
    format!("{before}{name}{number}{}", &rest[rest.find(',').unwrap()..])
}

/// Whether this is what the adapter sends to hold the vehicle: the whole brake, and nothing else.
fn is_held(control: Control) -> bool {
    (control.steering, control.throttle) == (0.0, -1.0)
}
