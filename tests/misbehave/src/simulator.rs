//! A simulator that misbehaves.

use std::hash::{BuildHasher, RandomState};

use pdk_sdk::prelude::*;

use crate::manner::{Manner, describe};
use crate::process::and_ways;

/// Frames of the road.
const ROAD: u64 = 20;
/// Frames per second.
const RATE: f64 = 20.0;
/// Most states that are wrong are so from this frame on.
const WRONG_FROM: u64 = 3;

/// A road of one second, straight ahead; or misbehaves.
pub struct Misbehaving {
    manner: Manner,
    step: u64,
    /// Whether the vehicle leaves its lane in this drive.
    departs: bool,
}

impl Misbehaving {
    fn state(&self) -> State {
        let step = self.step as f64;
        let mut state = State {
            time: step / RATE,
            position: [0.0, 0.0, step],
            speed: RATE,
            progress: step / ROAD as f64,
            finished: self.step >= ROAD,
            ..State::default()
        };
        match self.manner.how.as_str() {
            "no_number" => state.position[2] = f64::NAN,
            "stand_still" => (state.time, state.finished) = (0.0, false),
            _ => {}
        }
        // Not from the start, so that there is something before it.
        if self.step >= WRONG_FROM {
            match self.manner.how.as_str() {
                "draw" => state.lane_departure = self.departs,
                "infinite_speed" => state.speed = f64::INFINITY,
                "huge_speed" => state.speed = 1e200,
                "huge_position" => state.position[0] = 1e308,
                "huge_error" => state.cross_track_error = 1e308,
                "huge_heading" => state.heading = -1e300,
                "too_far" => state.progress = 5.0,
                "before_the_start" => state.progress = -1e300,
                "time_falls" => state.time = 0.0,
                "time_jumps" => state.time = 1e5,
                "huge_time" => state.time = 1e308,
                _ => {}
            }
        }
        state
    }
}

impl Component for Misbehaving {
    fn description() -> Description {
        let functions = ["new", "camera", "reset", "waypoints", "act", "drop", "frame"];
        let own = [
            "no_camera",
            "large_camera",
            "endless_camera",
            "slow_camera",
            "fast_camera",
            "no_number",
            "infinite_speed",
            "huge_speed",
            "huge_position",
            "huge_error",
            "huge_heading",
            "too_far",
            "before_the_start",
            "stand_still",
            "time_falls",
            "time_jumps",
            "huge_time",
            "refuse_first_slot",
            "refuse_every_slot",
            "draw",
        ];
        describe(Description::simulator("misbehave", "Misbehaves as told"), &functions, &and_ways(&own))
    }

    fn new(config: &Config) -> Result<Self> {
        Ok(Self { manner: Manner::new(config), step: 0, departs: false })
    }
}

impl Simulator for Misbehaving {
    fn camera(&self) -> Camera {
        self.manner.reach("camera");
        let usual = Camera { width: 32, height: 24, rate: RATE };
        match self.manner.how.as_str() {
            "no_camera" => Camera { width: 0, height: 0, ..usual },
            "large_camera" => Camera { width: 1 << 14, height: 1 << 14, ..usual },
            "endless_camera" => Camera { width: u32::MAX, height: u32::MAX, ..usual },
            "slow_camera" => Camera { rate: 1e-300, ..usual },
            "fast_camera" => Camera { rate: 1e300, ..usual },
            _ => usual,
        }
    }

    fn reset(&mut self, scenario: &Scenario, slot: u32) -> Result<State> {
        self.manner.reach("reset");
        if self.manner.is("refuse_every_slot") || self.manner.is("refuse_first_slot") && slot == 0 {
            return Err(Error::of(ErrorKind::Configuration, format!("the port of slot {slot} is taken")));
        }
        self.step = 0;
        // In one scenario of four, the vehicle leaves its lane every other time. What is drawn is not the scenario's.
        let luck = RandomState::new().hash_one(0);
        self.departs = self.manner.is("draw") && scenario.seed.is_multiple_of(4) && luck.is_multiple_of(2);
        Ok(self.state())
    }

    fn frame(&mut self, mut into: FrameMut<'_>) -> Result<State> {
        self.manner.reach_frame("frame", self.step);
        self.manner.disturb(self.step);
        for row in into.rows_mut() {
            row.fill((self.step * 10) as u8);
        }
        Ok(self.state())
    }

    fn act(&mut self, control: Control) -> Result<State> {
        self.manner.reach_frame("act", self.step);
        // A perturbation that makes frames brighter has the driver of this plugin steer more. One that gives no throttle is a bad one.
        self.departs |= self.manner.is("draw") && (control.steering > 0.09 || control.throttle == 0.0);
        self.step += 1;
        Ok(self.state())
    }

    fn waypoints(&self) -> Vec<[f64; 3]> {
        self.manner.reach("waypoints");
        vec![[0.0; 3], [0.0, 0.0, ROAD as f64]]
    }
}

impl Drop for Misbehaving {
    fn drop(&mut self) {
        self.manner.reach("drop");
    }
}
