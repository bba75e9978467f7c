//! The Udacity simulator: a client that says version 4 of Engine.IO in its address and speaks version 3, as the Unity library does.

use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use pdk_sdk::prelude::Control;
use serde_json::{Value, json};
use tungstenite::{Message, WebSocket};

use crate::fault::Fault;
use crate::world::World;
use crate::{Options, picture};

/// How a connection ended: whether there is to be another one, and after how long.
type End = Option<Duration>;

/// A connection.
struct Session<'a> {
    socket: WebSocket<TcpStream>,
    world: &'a mut World,
    options: &'a mut Options,
    control: Control,
    track: &'a mut String,
    /// Commands since the vehicle was put at the start.
    commands: u64,
}

/// Connects again and again, as the simulator does.
pub fn run(mut options: Options) {
    let mut world = World::new(options.seeds.as_deref(), options.rate.unwrap_or(20.0));
    world.resize(320, 160);
    world.start();
    // The next client finds the road of the one before.
    let mut track = String::new();
    loop {
        let connected = match options.polls {
            Some(version) => connect_by_polling(options.port, version),
            None => connect(options.port, ""),
        };
        let Some(mut socket) = connected else {
            std::thread::sleep(Duration::from_millis(10));
            continue;
        };
        // Before the greeting, as the library does.
        if options.polls.is_none() {
            let _ = socket.send(Message::text("2"));
        }
        let mut session = Session {
            socket,
            world: &mut world,
            options: &mut options,
            control: Control::default(),
            track: &mut track,
            commands: 0,
        };
        match session.serve() {
            Some(pause) => {
                drop(session);
                std::thread::sleep(pause);
            }
            None => return,
        }
    }
}

/// A WebSocket.
fn connect(port: u16, more: &str) -> Option<WebSocket<TcpStream>> {
    let stream = TcpStream::connect(("127.0.0.1", port)).ok()?;
    stream.set_nodelay(true).unwrap();
    let url = format!("ws://127.0.0.1:{port}/socket.io/?EIO=4&transport=websocket{more}");
    tungstenite::client(url, stream).ok().map(|(socket, _)| socket)
}

/// Long polling, and then a WebSocket, as clients of Socket.IO connect unless they are told otherwise.
fn connect_by_polling(port: u16, version: u8) -> Option<WebSocket<TcpStream>> {
    let ask = |request: String| {
        let mut stream = TcpStream::connect(("127.0.0.1", port)).ok()?;
        stream.write_all(request.as_bytes()).ok()?;
        Some(stream)
    };
    let answer = |mut stream: TcpStream| {
        let mut text = String::new();
        stream.read_to_string(&mut text).ok()?;
        let (head, body) = text.split_once("\r\n\r\n")?;
        assert!(head.starts_with("HTTP/1.1 200 OK\r\n"), "{head}");
        Some(body.to_owned())
    };
    let path = format!("/socket.io/?EIO={version}&transport=polling&t=1.5");
    let get = |sid: &str| format!("GET {path}{sid} HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n");
    let opened = answer(ask(get(""))?)?;
    // Version 3 writes the length of a packet before it.
    let packet = match version {
        3 => {
            let (length, packet) = opened.split_once(':').unwrap();
            assert_eq!(length.parse(), Ok(packet.len()));
            packet
        }
        _ => &opened,
    };
    let opened: Value = serde_json::from_str(packet.strip_prefix('0').unwrap()).unwrap();
    assert_eq!(opened["upgrades"], json!(["websocket"]), "{opened}");
    let sid = format!("&sid={}", opened["sid"].as_str().unwrap());
    let held = ask(get(&sid))?;
    if version == 4 {
        // It asks for the namespace while it still polls.
        let post = format!("POST {path}{sid} HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 2\r\n\r\n40");
        assert_eq!(answer(ask(post)?)?, "ok");
    }
    let mut socket = connect(port, &sid)?;
    socket.send(Message::text("2probe")).ok()?;
    assert_eq!(socket.read().ok()?, Message::text("3probe"));
    assert_eq!(answer(held)?, if version == 3 { "1:6" } else { "6" });
    socket.send(Message::text("5")).ok()?;
    let connected = socket.read().ok()?.into_text().unwrap();
    assert!(
        if version == 3 { connected == "40" } else { connected.starts_with("40{\"sid\":\"") },
        "{connected}"
    );
    Some(socket)
}

impl Session<'_> {
    fn is_stock(&self) -> bool {
        self.options.build == "stock"
    }

    fn serve(&mut self) -> End {
        // The stock build answers, and begins by answering twice; the other one goes by the clock.
        if self.is_stock() {
            for _ in 0..2 {
                if let Some(end) = self.tell() {
                    return end;
                }
            }
        }
        let period = Duration::from_secs_f64(1.0 / self.options.rate.unwrap_or(20.0));
        let mut due = Instant::now();
        loop {
            if !self.is_stock() {
                if due <= Instant::now() {
                    self.world.go_on(self.control, is_held(self.control));
                    if let Some(end) = self.tell() {
                        return end;
                    }
                    // From now on: on a machine that is too busy for its rate it becomes slower, and goes on listening.
                    due = Instant::now() + period;
                }
                let left = due.saturating_duration_since(Instant::now()).max(Duration::from_millis(1));
                self.socket.get_ref().set_read_timeout(Some(left)).unwrap();
            }
            match self.socket.read() {
                Ok(Message::Text(text)) => {
                    if let Some(event) = text.strip_prefix("42")
                        && let Some(end) = self.take(&serde_json::from_str(event).unwrap())
                    {
                        return end;
                    }
                }
                Ok(_) => {}
                Err(tungstenite::Error::Io(error))
                    if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
                Err(_) => return Some(Duration::from_millis(10)),
            }
        }
    }

    fn take(&mut self, event: &Value) -> Option<End> {
        let text =
            |name: &str| event[1][name].as_str().unwrap_or_else(|| panic!("{event} has no text `{name}`"));
        assert!(event[1].is_object(), "{event}");
        match event[0].as_str().unwrap() {
            "steer" => {
                // As a computer reads it that is set to German: a point separates thousands.
                let number = |name: &str| match self.options.german {
                    true => text(name).replace('.', "").replace(',', ".").parse::<f64>().unwrap(),
                    false => text(name).replace(',', "").parse::<f64>().unwrap(),
                };
                self.control = Control { steering: number("steering_angle"), throttle: number("throttle") };
                self.commands += 1;
                if self.is_stock() {
                    self.world.go_on(self.control, is_held(self.control));
                    return self.tell();
                }
            }
            "manual" if self.is_stock() => return self.tell(),
            "reset" => self.control = Control::default(),
            "track" => {
                let points = pdk_road::parse(text("track_string")).unwrap();
                let home = self.options.home;
                // The vehicle starts there and nowhere else, so a road that begins in another place would be built without it.
                let [dx, dz] = [0, 2].map(|axis| points[0][axis] - home[axis]);
                if dx * dx + dz * dz > 0.01 {
                    return None;
                }
                *self.track = text("track_string").to_owned();
                self.world.build(
                    points.iter().map(|point| std::array::from_fn(|axis| point[axis] - home[axis])).collect(),
                );
                self.control = Control::default();
            }
            _ => {}
        }
        None
    }

    fn tell(&mut self) -> Option<End> {
        let image = picture::encode(&self.world.look(), false);
        let state = self.world.state;
        let number = |number: f64| {
            let text = format!("{number:.4}");
            if self.options.german { text.replace('.', ",") } else { text }
        };
        let mut told = json!({
            "steering_angle": number(self.control.steering * 25.0),
            "throttle": number(self.control.throttle),
            "speed": number(if self.is_stock() { state.speed * 2.236_936_29 } else { state.speed }),
            "image": image,
        });
        if !self.is_stock() {
            let at: [f64; 3] = std::array::from_fn(|axis| state.position[axis] + self.options.home[axis]);
            told["hit"] = json!(if state.collision { "vehicle" } else { "none" });
            told["cte"] = json!(number(state.cross_track_error));
            told["track"] = json!(self.track);
            for (name, value) in ["pos_x", "pos_y", "pos_z"].into_iter().zip(at) {
                told[name] = json!(number(value));
            }
        }
        let packet = format!("42{}", json!(["telemetry", told]));
        let fault =
            if self.world.controls > 0 { self.options.faults.after(self.world.controls) } else { None };
        match fault {
            None | Some(Fault::Freeze(_)) => {
                if let Some(Fault::Freeze(pause)) = fault {
                    std::thread::sleep(pause);
                }
                // If the other end is gone, reading says so.
                let _ = self.socket.send(Message::text(packet));
                None
            }
            Some(Fault::Close(pause)) => Some(Some(pause)),
            Some(Fault::Die) => std::process::exit(3),
            Some(Fault::Hang) => loop {
                std::thread::sleep(Duration::from_secs(1000));
            },
            Some(Fault::Half) => {
                // A frame that says that it is longer than what comes.
                let stream = self.socket.get_mut();
                let _ = stream.write_all(&[0x81, 0xfe, 0xff, 0xff, 1, 2, 3, 4]);
                let _ = stream.write_all(&packet.as_bytes()[..packet.len() / 2]);
                Some(Some(Duration::from_millis(10)))
            }
            Some(Fault::Garbage) => {
                let _ = self.socket.send(Message::text("220 mail.example.org ESMTP ready"));
                None
            }
            Some(Fault::Huge) => {
                told["speed"] = json!("1e160");
                let _ = self.socket.send(Message::text(format!("42{}", json!(["telemetry", told]))));
                None
            }
            Some(Fault::Back) => panic!("this simulator does not tell the time"),
            Some(Fault::Flood) => {
                let _ = self.socket.send(Message::text("A".repeat(100 << 20)));
                None
            }
        }
    }
}

/// Whether this may be what the adapter sends to hold the vehicle: this protocol has no brake of its own.
fn is_held(control: Control) -> bool {
    control.steering == 0.0 && control.throttle <= 0.0
}
