//! The embedded simulator: what the stand-ins drive in.

use std::path::Path;

use pdk_components::loader::Plugin;
use pdk_model::component::ComponentSpec;
use pdk_sdk::abi::host::Instance;
use pdk_sdk::prelude::*;
use serde_json::{Map, Value, json};

/// The embedded simulator with its vehicle at rest and without traffic, so that time may pass before the start.
pub struct World {
    plugin: Plugin,
    simulator: Option<Box<dyn Simulator>>,
    size: (u32, u32),
    rate: f64,
    waypoints: Vec<[f64; 3]>,
    seeds: Vec<(Vec<[f64; 3]>, u64)>,
    /// The state of the vehicle.
    pub state: State,
    /// Controls since the start.
    pub controls: u64,
}

impl World {
    /// Loads the plugin beside this program. `seeds` names a `scenarios.jsonl`.
    pub fn new(seeds: Option<&Path>, rate: f64) -> Self {
        let folder = std::env::current_exe().unwrap().parent().unwrap().to_owned();
        let plugin =
            Plugin::load(&folder.join(format!("libpdk_lane.{}", std::env::consts::DLL_EXTENSION))).unwrap();
        let seeds = seeds.map(|file| std::fs::read_to_string(file).unwrap()).unwrap_or_default();
        let seed = |line: &str| {
            let line: Value = serde_json::from_str(line).unwrap();
            let scenario = &line["scenario"];
            (
                pdk_road::read(&scenario["road"]).unwrap().unwrap_or_default(),
                scenario["seed"].as_u64().unwrap(),
            )
        };
        Self {
            plugin,
            simulator: None,
            size: (320, 240),
            rate,
            waypoints: vec![[0.0; 3], [0.0, 0.0, 200.0]],
            seeds: seeds.lines().map(seed).collect(),
            state: State::default(),
            controls: 0,
        }
    }

    /// Sets the size of the pictures; they come with the next start.
    pub fn resize(&mut self, width: u32, height: u32) {
        if self.size != (width, height) {
            (self.size, self.simulator) = ((width, height), None);
        }
    }

    /// Builds a road, and puts the vehicle at its start.
    pub fn build(&mut self, waypoints: Vec<[f64; 3]>) {
        self.waypoints = waypoints;
        self.start();
    }

    /// Puts the vehicle at the start.
    pub fn start(&mut self) {
        let (width, height) = self.size;
        if self.simulator.is_none() {
            let parameters: Map<String, Value> = json!({
                "width": width, "height": height, "rate": self.rate, "initial_speed": 0, "oncoming": 0,
                "straight_ends": 0
            })
            .as_object()
            .unwrap()
            .clone();
            let components = &self.plugin.description.components;
            let index = components.iter().position(|component| component.name == "lane").unwrap();
            match self.plugin.create(index, &parameters).unwrap() {
                Instance::Simulator(simulator) => self.simulator = Some(simulator),
                _ => panic!("it is not a simulator"),
            }
        }
        let seed = self
            .seeds
            .iter()
            .find(|(waypoints, _)| *waypoints == self.waypoints)
            .map_or(0, |(_, seed)| *seed);
        let component = ComponentSpec::new;
        let scenario = Scenario {
            road: json!({ "waypoints": self.waypoints }),
            seed,
            ..Scenario::new(component("lane"), component("stand_in"))
        };
        self.state = self.simulator.as_mut().unwrap().reset(&scenario, 0).unwrap();
        self.controls = 0;
    }

    /// What the camera sees.
    pub fn look(&mut self) -> FrameBuf {
        if self.simulator.is_none() {
            self.start();
        }
        let mut frame = FrameBuf::new(self.size.0 as usize, self.size.1 as usize);
        self.simulator.as_mut().unwrap().frame(frame.as_mut()).unwrap();
        frame
    }

    /// Moves on by a frame. While the adapter holds the vehicle at the start, no time passes; a driver that wants to stand there learns
    /// the time.
    pub fn go_on(&mut self, control: Control, held: bool) {
        if self.simulator.is_none() {
            self.start();
        }
        if self.controls == 0 && held {
            return;
        }
        self.controls += 1;
        self.state = self.simulator.as_mut().unwrap().act(control).unwrap();
    }
}
