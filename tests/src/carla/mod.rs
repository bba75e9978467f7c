//! A CARLA server for tests: CARLA's protocol outside, the embedded simulator `lane` inside.
//!
//! It builds its road from the OpenDRIVE document that it is given, its camera from the attributes of the camera that is spawned, and
//! does what its clients see CARLA do: a frame for each tick, answers by number, a stream for each sensor. It can be told to break.

mod world;

use std::io::{BufReader, Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use rmpv::Value;

pub use world::{Fault, Setup, simulator};
use world::{World, array, at};

use crate::server::{Server, Shared};
use crate::stand_in::free_ports;

/// A running server. It ends when it is dropped.
pub struct CarlaServer {
    port: u16,
    server: Server<World>,
}

impl CarlaServer {
    /// Starts one.
    ///
    /// # Panics
    /// If its ports are taken.
    pub fn start(setup: Setup) -> Self {
        let port = if setup.port == 0 { free_ports(2) } else { setup.port };
        let mut server = Server::start(World::new(setup, port), &[(port, answer_all), (port + 1, subscribe)]);
        server.beside(|shared| {
            while !shared.is_over() {
                std::thread::sleep(Duration::from_millis(10));
                let mut world = shared.world();
                if !world.is_synchronous() {
                    world.step();
                }
            }
        });
        Self { port, server }
    }

    /// The port of requests.
    pub fn port(&self) -> u16 {
        self.port
    }

    /// What stands in its world besides the spectator.
    pub fn actors(&self) -> Vec<String> {
        self.server.world().kinds()
    }

    /// Whether it waits for clients.
    pub fn is_synchronous(&self) -> bool {
        self.server.world().is_synchronous()
    }

    /// The first number of its weather, the cloudiness.
    pub fn cloudiness(&self) -> f64 {
        self.server.world().weather[0].as_f64().unwrap()
    }

    /// The cloudiness at the latest frame that it was asked for.
    pub fn seen_cloudiness(&self) -> f64 {
        self.server.world().seen_weather[0].as_f64().unwrap()
    }

    /// The map that is loaded; none if it was generated from a road.
    pub fn town(&self) -> Option<String> {
        let world = self.server.world();
        world.document.is_none().then(|| world.town.clone())
    }

    /// How long it took itself for the latest frame that it was asked for.
    pub fn own_time(&self) -> Duration {
        self.server.world().own
    }

    /// How many subscriptions it got.
    pub fn subscriptions(&self) -> usize {
        self.server.world().subscriptions
    }

    /// The kinds of everything that was spawned, in that order.
    pub fn spawned(&self) -> Vec<String> {
        self.server.world().spawned.clone()
    }

    /// The names of the requests that it got, in their order.
    pub fn calls(&self) -> Vec<String> {
        self.server.world().calls.clone()
    }

    /// Leaves the world as a client does that is killed: waiting for a client, with a vehicle and a sensor on it.
    pub fn abandon(&self) {
        let mut world = self.server.world();
        world.settings[0] = true.into();
        let role = |kind: &str, role: &str| {
            array([1.into(), kind.into(), array([array(["role_name".into(), 4.into(), role.into()])])])
        };
        let place =
            array([array([0.0.into(), 0.0.into(), 0.0.into()]), array([0.0.into(), 0.0.into(), 0.0.into()])]);
        let vehicle = world.spawn(&role("vehicle.tesla.model3", "hero"), &place, 0);
        let parent = at(&vehicle, 0).as_u64().unwrap() as u32;
        world.spawn(&role("sensor.other.collision", "pdk"), &place, parent);
        // This one belongs to another client.
        world.spawn(&role("vehicle.tesla.model3", "autopilot"), &place, 0);
    }
}

fn subscribe(mut stream: TcpStream, server: &Shared<World>) {
    let mut id = [0; 4];
    if stream.read_exact(&mut id).is_ok() {
        let mut world = server.world();
        world.subscriptions += 1;
        world.subscribers.push((u32::from_le_bytes(id), stream));
    }
}

fn answer_all(mut stream: TcpStream, server: &Shared<World>) {
    let mut reader = BufReader::new(stream.try_clone().unwrap());
    while let Ok(request) = rmpv::decode::read_value(&mut reader) {
        let (number, name) = (at(&request, 1).clone(), at(&request, 2).as_str().unwrap().to_owned());
        let mut arguments = at(&request, 3).as_array().unwrap().clone();
        let waits = at(&arguments.remove(0), 0).as_bool() == Some(false);
        let (result, fault, loads) = {
            let mut world = server.world();
            world.calls.push(name.clone());
            let loads = world.loaded.saturating_duration_since(Instant::now());
            (world.answer(&name, &arguments), world.fault(&name), loads)
        };
        // The answer that it begins to load does not wait.
        std::thread::sleep(loads);
        let message = match (&result, waits) {
            (Some(result), true) => array([1.into(), number, Value::Nil, result.clone()]),
            (Some(_), false) => array([
                1.into(),
                number,
                Value::Nil,
                array([array([true.into(), array(["unknown error".into()])])]),
            ]),
            (None, _) => array([1.into(), number, "unknown function".into(), Value::Nil]),
        };
        let mut bytes = Vec::new();
        rmpv::encode::write_value(&mut bytes, &message).unwrap();
        let sent = match fault {
            Some(Fault::Close) => {
                close_all(server);
                return;
            }
            Some(Fault::Hang) => {
                server.world().hanging = true;
                continue;
            }
            Some(Fault::HalfAnswer) => {
                let _ = stream.write_all(&bytes[..bytes.len() / 2]);
                close_all(server);
                return;
            }
            Some(Fault::CloseStreams) => {
                server.world().close_streams();
                stream.write_all(&bytes)
            }
            Some(Fault::Garbage) => stream.write_all(&[0xc1; 200]),
            Some(Fault::Huge) => {
                let huge = [&[0x94, 0x01, 0x00, 0xc0, 0xc6][..], &100_000_000u32.to_be_bytes()].concat();
                stream.write_all(&huge).and_then(|()| stream.write_all(&vec![0; 100_000_000]))
            }
            _ if server.world().hanging => continue,
            _ => stream.write_all(&bytes),
        };
        if sent.is_err() {
            return;
        }
    }
}

fn close_all(server: &Shared<World>) {
    server.close_all();
    server.world().subscribers.clear();
}
