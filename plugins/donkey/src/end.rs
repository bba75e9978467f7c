//! What the road-generating build means by `done`.

/// The build reports `done` beyond this cross-track error in metres, whatever pdk's own limit is, and at the end of the road.
const LEFT: f64 = 2.0;

/// Tells the end of the road from a lane that was left, of which telemetry reports both as `done`.
#[derive(Debug, Default)]
pub struct End {
    /// Whether `done` is about the lane: a car that comes back to it has not reached the end.
    left: bool,
}

impl End {
    /// Takes the next telemetry, and returns whether the road is over. `arrived` is whether the car is at the end of a road that is known.
    pub fn is_reached(&mut self, done: bool, cross_track_error: f64, arrived: bool) -> bool {
        self.left = done && (self.left || cross_track_error.abs() > LEFT);
        done && (arrived || !self.left)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn done_beyond_2_m_is_not_the_end_of_the_road() {
        let mut end = End::default();
        assert!(!end.is_reached(false, 1.0, false) && !end.is_reached(true, -2.5, false));
        // Whether the build takes it back or not.
        assert!(!end.is_reached(true, 1.0, false));
        assert!(!end.is_reached(false, 1.0, false) && end.is_reached(true, 1.0, false));
    }

    #[test]
    fn at_the_end_of_a_known_road_done_is_the_end_however_far_the_car_is_from_its_lane() {
        let mut end = End::default();
        assert!(end.is_reached(true, 2.5, true) && !end.is_reached(false, 2.5, true));
    }
}
