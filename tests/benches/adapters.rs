//! What the adapters add to a frame, at 320x240: from a control to the picture that follows it, less the time that the simulator takes;
//! and what the way to a driver in another process and back takes.
//!
//! ```sh
//! cargo build --release && cargo bench --bench adapters
//! ```
//!
//! The simulators here answer each control at once, with the same picture of a road each time; what they need for that is measured by
//! themselves.

// A benchmark may fail like a test.
#![allow(clippy::unwrap_used)]

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use image::ImageEncoder;
use image::codecs::jpeg::JpegEncoder;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use pdk_components::registry::Registry;
use pdk_components::search_path::SearchPath;
use pdk_model::component::ComponentSpec;
use pdk_sdk::prelude::*;
use pdk_tests::beamng::{self, BeamNgGame};
use pdk_tests::carla::{CarlaServer, Setup};
use pdk_tests::pictures;
use pdk_tests::stand_in::free_ports;
use pdk_tests::{repository, target_folder, temp};
use serde_json::{Value, json};
use tungstenite::Message;

const WIDTH: u32 = 320;
const HEIGHT: u32 = 240;
const FRAMES: usize = 2000;

fn picture(png: bool) -> String {
    let picture = pictures::road(WIDTH, HEIGHT, 1);
    let mut bytes = Vec::new();
    let color = image::ExtendedColorType::Rgb8;
    match png {
        true => PngEncoder::new_with_quality(&mut bytes, CompressionType::Fast, FilterType::Sub)
            .write_image(&picture, WIDTH, HEIGHT, color)
            .unwrap(),
        false => {
            JpegEncoder::new_with_quality(&mut bytes, 75).encode(&picture, WIDTH, HEIGHT, color).unwrap()
        }
    }
    STANDARD.encode(bytes)
}

/// A Donkey simulator that answers each control at once; what it needs for an answer goes to `own`.
fn donkey(port: u16, png: bool, own: Sender<Duration>) {
    let (mut stream, _) = TcpListener::bind(("127.0.0.1", port)).unwrap().accept().unwrap();
    stream.set_nodelay(true).unwrap();
    stream.write_all(b"{\"msg_type\":\"car_loaded\"}\n").unwrap();
    let picture = picture(png);
    let mut part = [0; 8142];
    let mut frames = 0;
    while let Ok(length @ 1..) = stream.read(&mut part) {
        let began = Instant::now();
        if !part[..length].windows(9).any(|part| part == b"\"control\"") {
            continue;
        }
        frames += 1;
        let time = f64::from(frames) / 20.0;
        let line = format!(
            "{{\"msg_type\":\"telemetry\",\"steering_angle\":0,\"throttle\":0,\"speed\":0,\"image\":\"{picture}\",\"hit\":\"none\",\"pos_x\":51,\
             \"pos_y\":0.6,\"pos_z\":50,\"time\":{time},\"lap\":0,\"sector\":0,\"sector\":1,\"done\":false,\"cte\":0.05,\"maxSector\":139}}\n"
        );
        if stream.write_all(line.as_bytes()).is_err() {
            return;
        }
        let _ = own.send(began.elapsed());
    }
}

/// The stock build of the Udacity simulator, which answers each command at once.
fn udacity(port: u16, own: Sender<Duration>) {
    let stream = loop {
        match TcpStream::connect(("127.0.0.1", port)) {
            Ok(stream) => break stream,
            Err(_) => std::thread::sleep(Duration::from_millis(10)),
        }
    };
    stream.set_nodelay(true).unwrap();
    let url = format!("ws://127.0.0.1:{port}/socket.io/?EIO=4&transport=websocket");
    let (mut socket, _) = tungstenite::client(url, stream).unwrap();
    let telemetry = json!(["telemetry", {
        "steering_angle": "0.0000", "throttle": "0.0000", "speed": "0.0000", "image": picture(false)
    }]);
    let packet = format!("42{telemetry}");
    socket.send(Message::text(packet.clone())).unwrap();
    while let Ok(message) = socket.read() {
        let began = Instant::now();
        if !message.to_text().is_ok_and(|text| text.starts_with("42[\"steer\"")) {
            continue;
        }
        if socket.send(Message::text(packet.clone())).is_err() {
            return;
        }
        let _ = own.send(began.elapsed());
    }
}

/// What the simulator needed for the latest frame: what came before was for the start.
fn last_of(own: &Receiver<Duration>) -> impl FnMut() -> Duration + '_ {
    || {
        let mut latest = own.recv().unwrap();
        while let Ok(later) = own.try_recv() {
            latest = later;
        }
        latest
    }
}

/// Drives, and prints median and 99th percentile of what the adapter adds.
fn measure(
    registry: &Registry,
    what: &str,
    parameters: Value,
    road: Value,
    mut own: impl FnMut() -> Duration,
) {
    let name = parameters["name"].as_str().unwrap().to_owned();
    let mut values = parameters.as_object().unwrap().clone();
    values.remove("name");
    let (mut simulator, _) = registry.simulator(&name, &values).unwrap();
    let component = ComponentSpec::new;
    let scenario = Scenario { road, ..Scenario::new(component("x"), component("y")) };
    simulator.reset(&scenario, 0).unwrap();
    let mut frame = FrameBuf::new(WIDTH as usize, HEIGHT as usize);
    let mut added = Vec::with_capacity(FRAMES);
    for _ in 0..FRAMES {
        let began = Instant::now();
        simulator.act(Control { steering: 0.125, throttle: 0.5 }).unwrap();
        simulator.frame(frame.as_mut()).unwrap();
        added.push(began.elapsed().saturating_sub(own()));
    }
    added.sort();
    let milliseconds = |share: f64| added[((FRAMES - 1) as f64 * share) as usize].as_secs_f64() * 1000.0;
    println!("{what:<28} median {:.3} ms, 99 % {:.3} ms", milliseconds(0.5), milliseconds(0.99));
}

/// A driver that answers without looking.
const ANSWER_PYTHON: &str = "import pdk_driver\npdk_driver.serve(lambda frame, context: (0.0, 0.2))\n";
const ANSWER_CPP: &str = r#"
#include "pdk_driver.h"
int main() {
    pdk_driver *driver = pdk_driver_open(nullptr);
    pdk_frame frame;
    while (driver != nullptr && pdk_driver_next(driver, &frame) == 1 && pdk_driver_answer(driver, 0.0, 0.2) == 1) {}
    pdk_driver_close(driver);
}
"#;

/// The commands of drivers in other processes, as far as this machine has what they need.
fn external_drivers(folder: &Path) -> Vec<(&'static str, Value)> {
    let mut found = Vec::new();
    let works = |command: &mut Command| command.status().is_ok_and(|status| status.success());
    if works(Command::new("python3").args(["-c", "import iceoryx2, numpy"]).stderr(Stdio::null())) {
        let script = folder.join("answer.py");
        std::fs::write(&script, ANSWER_PYTHON).unwrap();
        let path = format!("PYTHONPATH={}", repository().join("sdk/python").display());
        found.push(("a driver in Python", json!(["env", path, "python3", script])));
    } else {
        println!("a driver in Python: not measured, since python3 has no iceoryx2 and numpy");
    }
    let (source, program) = (folder.join("answer.cpp"), folder.join("answer"));
    std::fs::write(&source, ANSWER_CPP).unwrap();
    let mut compile = Command::new("c++");
    compile.arg("-O2").arg("-I").arg(repository().join("sdk/pdk-driver-c/include")).arg(&source);
    compile.arg("-L").arg(target_folder()).arg("-lpdkdriver");
    compile.arg(format!("-Wl,-rpath,{}", target_folder().display())).arg("-o").arg(&program);
    match works(&mut compile) {
        true => found.push(("a driver in C++", json!([program]))),
        false => println!("a driver in C++: not measured, since c++ cannot compile it"),
    }
    found
}

/// Asks a driver in another process, and prints what the way to it and back takes.
fn measure_driver(registry: &Registry, what: &str, command: &Value) {
    let values = json!({"command": command, "start_seconds": 40}).as_object().unwrap().clone();
    let (mut driver, _) = registry.driver("process", &values).unwrap();
    let frame = FrameBuf::new(WIDTH as usize, HEIGHT as usize);
    driver.reset().unwrap();
    let mut took = Vec::with_capacity(FRAMES);
    for frame_index in 0..FRAMES as u64 {
        let cx = DriveContext { frame_index, time: frame_index as f64 / 20.0, speed: 8.0 };
        let began = Instant::now();
        driver.drive(frame.as_ref(), &cx).unwrap();
        took.push(began.elapsed());
    }
    // The first frame waits for the program.
    took.remove(0);
    let total: Duration = took.iter().sum();
    took.sort();
    let microseconds = |share: f64| took[((took.len() - 1) as f64 * share) as usize].as_secs_f64() * 1e6;
    println!(
        "{what:<28} median {:.0} us, 99 % {:.0} us, {:.0} frames a second",
        microseconds(0.5),
        microseconds(0.99),
        took.len() as f64 / total.as_secs_f64()
    );
}

fn main() {
    let search = SearchPath::default();
    let registry = pdk_tests::registry(&search);
    println!("added to a frame of {WIDTH}x{HEIGHT}, over {FRAMES} frames:");
    for (what, encoding) in [("donkey, JPEG", "jpg"), ("donkey, PNG", "png")] {
        let port = free_ports(1);
        let (sender, own) = channel();
        std::thread::spawn(move || donkey(port, encoding == "png", sender));
        let parameters = json!({
            "name": "donkey", "build": "road_generating", "port": port, "width": WIDTH, "height": HEIGHT, "settle_seconds": 0,
            "encoding": encoding
        });
        measure(&registry, what, parameters, Value::Null, last_of(&own));
    }
    let port = free_ports(1);
    let (sender, own) = channel();
    std::thread::spawn(move || udacity(port, sender));
    let parameters = json!({
        "name": "udacity", "build": "stock", "port": port, "width": WIDTH, "height": HEIGHT, "settle_seconds": 0
    });
    measure(&registry, "udacity, JPEG", parameters, Value::Null, last_of(&own));

    let server = CarlaServer::start(Setup::default());
    let parameters = json!({"name": "carla", "port": server.port(), "width": WIDTH, "height": HEIGHT});
    measure(&registry, "carla", parameters, Value::Null, || server.own_time());

    let game = BeamNgGame::start(beamng::Setup::default());
    let parameters = json!({"name": "beamng", "port": game.port(), "width": WIDTH, "height": HEIGHT});
    let road = json!({"angles": [0, 5, -5, 0]});
    measure(&registry, "beamng", parameters, road, || game.own_time());

    println!("from a frame of {WIDTH}x{HEIGHT} to the answer of a driver in another process:");
    let folder = temp();
    for (what, command) in external_drivers(folder.path()) {
        measure_driver(&registry, what, &command);
    }
}
