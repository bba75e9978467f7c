//! A simulator that remembers what it is told.

use pdk_sdk::prelude::*;

/// Frames per second.
const RATE: f64 = 20.0;

/// A road of one second; the state tells what the scenario said and how it was steered.
pub struct Frozen {
    steps: u32,
    seed: u64,
    steered: f64,
}

impl Frozen {
    fn state(&self) -> State {
        State {
            time: f64::from(self.steps) / RATE,
            position: [self.seed as f64, 0.5, f64::from(self.steps)],
            heading: self.steered,
            speed: 7.0,
            cross_track_error: -0.25,
            progress: f64::from(self.steps) / RATE,
            vehicle_ahead: 40.0,
            finished: f64::from(self.steps) >= RATE,
            ..State::default()
        }
    }
}

impl Component for Frozen {
    fn description() -> Description {
        Description::simulator("frozen", "Remembers what it is told")
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self { steps: 0, seed: 0, steered: 0.0 })
    }
}

impl Simulator for Frozen {
    fn camera(&self) -> Camera {
        Camera { width: 33, height: 17, rate: RATE }
    }

    fn reset(&mut self, scenario: &Scenario, _slot: u32) -> Result<State> {
        (self.steps, self.steered) = (0, 0.0);
        // A road of its own, in its own terms.
        self.seed = scenario.road.get("number").and_then(|n| n.as_u64()).unwrap_or(scenario.seed % 1000);
        Ok(self.state())
    }

    fn frame(&mut self, mut into: FrameMut<'_>) -> Result<State> {
        for (y, row) in into.rows_mut().enumerate() {
            row.fill((y as u32 * 10 + self.steps) as u8);
        }
        Ok(self.state())
    }

    fn act(&mut self, control: Control) -> Result<State> {
        self.steps += 1;
        self.steered += control.steering;
        Ok(self.state())
    }

    fn waypoints(&self) -> Vec<[f64; 3]> {
        vec![[0.0, 0.5, 0.0], [0.25, 0.5, RATE]]
    }
}
