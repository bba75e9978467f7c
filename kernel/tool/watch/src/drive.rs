//! The course of a drive, as far as it was seen: what a browser draws as curves and on the map.

use pdk_sdk::prelude::{Control, State};
use serde_json::{Value, json};

use crate::query::{Has, known};

/// Points of a drive that are kept; one of ten minutes at three points a second has fewer.
const MOST: usize = 2000;

/// The course of a drive.
#[derive(Default)]
pub struct Drive {
    /// The number of the scenario.
    pub scenario: Option<u64>,
    /// Another one as soon as points that a browser has are not the first of these any more.
    pub generation: u64,
    points: Vec<(State, Option<Control>)>,
}

impl Drive {
    /// Adds a moment of a scenario. Another scenario begins a new drive.
    pub fn add(&mut self, scenario: u64, state: State, control: Option<Control>) {
        if self.scenario.replace(scenario) != Some(scenario) {
            self.points.clear();
            self.generation += 1;
        }
        self.points.push((state, control));
        if self.points.len() > MOST {
            // Every second one tells the same.
            let mut odd = false;
            self.points.retain(|_| {
                odd = !odd;
                odd
            });
            self.generation += 1;
        }
    }

    /// How many points a browser has already, and those that it lacks.
    pub fn since(&self, has: Option<Has>) -> (usize, Vec<Value>) {
        let from = known(has, self.generation, self.points.len());
        (from, self.points[from..].iter().map(|(state, control)| numbers(state, *control)).collect())
    }
}

/// A moment as the page draws it: time, x, z, cross-track error, steering, speed, progress.
pub fn numbers(state: &State, control: Option<Control>) -> Value {
    let [x, _, z] = state.position;
    let steering = control.map(|control| control.steering);
    json!([state.time, x, z, state.cross_track_error, steering, state.speed, state.progress])
}

/// A centre line as points of x and z; nothing if it cannot be read.
pub fn road(waypoints: &str) -> Value {
    let points = pdk_road::parse(waypoints).unwrap_or_default();
    points.into_iter().map(|[x, _, z]| json!([x, z])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(time: f64) -> State {
        State { time, ..State::default() }
    }

    #[test]
    fn a_browser_gets_the_points_that_it_lacks() {
        let mut drive = Drive::default();
        for step in 0..5 {
            drive.add(3, at(f64::from(step)), Some(Control { steering: 0.5, throttle: 0.0 }));
        }
        let generation = drive.generation;
        assert_eq!(drive.since(None).1.len(), 5);
        let (from, points) = drive.since(Some((generation, 3)));
        assert_eq!(
            (from, points.len(), points[0][0].as_f64(), points[0][4].as_f64()),
            (3, 2, Some(3.0), Some(0.5))
        );
        assert_eq!(drive.since(Some((generation, 5))), (5, Vec::new()));
        // Another scenario is another drive, whatever a browser has.
        drive.add(4, at(0.0), None);
        let (from, points) = drive.since(Some((generation, 1)));
        assert_eq!((from, points.len(), points[0][4].is_null()), (0, 1, true));
    }

    #[test]
    fn a_long_drive_is_thinned_and_sent_anew() {
        let mut drive = Drive::default();
        for step in 0..=MOST as u32 {
            drive.add(0, at(f64::from(step)), None);
        }
        let (from, points) = drive.since(Some((1, MOST)));
        assert_eq!((from, points.len()), (0, MOST / 2 + 1));
        let times: Vec<f64> = points.iter().map(|point| point[0].as_f64().unwrap()).collect();
        assert!(times[0] == 0.0 && times[1] == 2.0 && times.last() == Some(&(MOST as f64)));
    }

    #[test]
    fn points_and_roads_are_numbers() {
        let state = State { time: 1.5, position: [1.0, 9.0, 2.0], progress: 0.25, ..State::default() };
        assert_eq!(numbers(&state, None), json!([1.5, 1.0, 2.0, 0.0, null, 0.0, 0.25]));
        assert_eq!(road("0,0,0@1,0,5"), json!([[0.0, 0.0], [1.0, 5.0]]));
        assert_eq!(road("nonsense"), json!([]));
    }
}
