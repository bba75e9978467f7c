//! The vehicle: a kinematic bicycle with limits on how fast it steers and changes speed.

use pdk_sdk::prelude::Control;

/// Distance between the axles in metres.
pub const WHEELBASE: f64 = 2.6;
/// Largest angle of the front wheels in radians: 25 degrees.
pub const LARGEST_STEERING_ANGLE: f64 = 25.0 * std::f64::consts::PI / 180.0;
/// How fast the front wheels turn, in radians per second.
const STEERING_RATE: f64 = 50.0 * std::f64::consts::PI / 180.0;
/// Acceleration at full throttle in metres per second squared.
const ACCELERATION: f64 = 3.0;
/// Deceleration at full brake in metres per second squared.
const BRAKING: f64 = 7.0;
/// Deceleration by rolling resistance in metres per second squared, and by air in the same over the square of the speed.
const ROLLING: f64 = 0.12;
const AIR: f64 = 0.0008;
/// Acceleration of gravity in metres per second squared.
const GRAVITY: f64 = 9.81;
/// Longest step of the integration in seconds.
const STEP: f64 = 0.005;

/// Where the vehicle is and how it moves.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Vehicle {
    /// The middle of the rear axle: x and z in metres.
    rear: [f64; 2],
    /// Heading in radians, clockwise from +z.
    pub heading: f64,
    /// Speed in metres per second, never negative: the vehicle has no reverse gear.
    pub speed: f64,
    /// Angle of the front wheels in radians, positive to the right.
    pub steering_angle: f64,
}

impl Vehicle {
    /// A vehicle whose centre is at `centre`, wheels straight.
    pub fn at(centre: [f64; 2], heading: f64, speed: f64) -> Self {
        let half = WHEELBASE / 2.0;
        let rear = [centre[0] - half * libm::sin(heading), centre[1] - half * libm::cos(heading)];
        Self { rear, heading, speed, steering_angle: 0.0 }
    }

    /// All that a vehicle is: the middle of the rear axle, heading, speed and angle of the front wheels.
    pub fn numbers(&self) -> [f64; 5] {
        let Self { rear: [x, z], heading, speed, steering_angle } = *self;
        [x, z, heading, speed, steering_angle]
    }

    /// The vehicle of these numbers; a speed below zero counts as none.
    pub fn of_numbers([x, z, heading, speed, steering_angle]: [f64; 5]) -> Self {
        Self { rear: [x, z], heading, speed: speed.max(0.0), steering_angle }
    }

    /// The point half-way between the axles.
    pub fn centre(&self) -> [f64; 2] {
        self.ahead(0.0)
    }

    /// The point `distance` metres ahead of the centre.
    pub fn ahead(&self, distance: f64) -> [f64; 2] {
        let reach = WHEELBASE / 2.0 + distance;
        [self.rear[0] + reach * libm::sin(self.heading), self.rear[1] + reach * libm::cos(self.heading)]
    }

    /// Moves on by `duration` seconds under a control, whose values are clamped to -1..1, on a road of that `slope` (rise
    /// over run), in a wind that turns it by `wind` radians per second. The vehicle never gets faster than `speed_limit`, and does not roll backwards.
    pub fn advance(&mut self, control: Control, duration: f64, slope: f64, speed_limit: f64, wind: f64) {
        let steps = (duration / STEP).ceil().max(1.0);
        let dt = duration / steps;
        let target = control.steering.clamp(-1.0, 1.0) * LARGEST_STEERING_ANGLE;
        let throttle = control.throttle.clamp(-1.0, 1.0);
        let pull = GRAVITY * slope / (1.0 + slope * slope).sqrt();
        for _ in 0..steps as usize {
            let turn = (target - self.steering_angle).clamp(-STEERING_RATE * dt, STEERING_RATE * dt);
            let mean_angle = self.steering_angle + turn / 2.0;
            self.steering_angle += turn;
            let push = if throttle >= 0.0 { throttle * ACCELERATION } else { throttle * BRAKING };
            let drag = ROLLING + AIR * self.speed * self.speed + pull;
            let before = self.speed;
            self.speed = (before + (push - drag) * dt).clamp(0.0, speed_limit);
            // Half the turn before the step and half after it keeps circles round.
            let distance = (before + self.speed) / 2.0 * dt;
            let turned = distance * libm::tan(mean_angle) / WHEELBASE + wind * dt;
            let along = self.heading + turned / 2.0;
            self.rear[0] += distance * libm::sin(along);
            self.rear[1] += distance * libm::cos(along);
            self.heading += turned;
        }
        // Only matters to a vehicle that goes round in circles: the heading stays within half a turn of north.
        let turn = 2.0 * std::f64::consts::PI;
        self.heading -= turn * (self.heading / turn).round();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn control(steering: f64, throttle: f64) -> Control {
        Control { steering, throttle }
    }

    #[test]
    fn straight_stays_straight() {
        let mut car = Vehicle::at([3.0, 4.0], 0.0, 8.0);
        (0..300).for_each(|_| car.advance(control(0.0, 0.3), 1.0 / 30.0, 0.0, 20.0, 0.0));
        assert_eq!((car.centre()[0], car.heading), (3.0, 0.0));
        assert!(car.centre()[1] > 80.0);
    }

    #[test]
    fn wind_turns_a_vehicle_that_is_not_steered() {
        let mut car = Vehicle::at([0.0, 0.0], 0.0, 10.0);
        (0..20).for_each(|_| car.advance(control(0.0, 0.0), 0.05, 0.0, 20.0, 0.1));
        assert!((car.heading - 0.1).abs() < 1e-9, "{}", car.heading);
        // Half of the angle on average, over the 10 m of the rear axle, and the whole angle from there to the centre.
        let expected = 0.05 * 10.0 + 0.1 * WHEELBASE / 2.0;
        assert!((car.centre()[0] - expected).abs() < 0.02, "{} {expected}", car.centre()[0]);
    }

    #[test]
    fn the_rear_axle_turns_on_a_circle_of_wheelbase_over_tangent() {
        let mut car = Vehicle::at([0.0, 0.0], 0.0, 5.0);
        // Until the wheels have reached their angle.
        (0..30).for_each(|_| car.advance(control(0.5, 0.1), 1.0 / 30.0, 0.0, 5.0, 0.0));
        assert!((car.steering_angle - 0.5 * LARGEST_STEERING_ANGLE).abs() < 1e-12);
        let radius = WHEELBASE / libm::tan(0.5 * LARGEST_STEERING_ANGLE);
        let middle =
            [car.rear[0] + radius * libm::cos(car.heading), car.rear[1] - radius * libm::sin(car.heading)];
        for _ in 0..200 {
            car.advance(control(0.5, 0.1), 1.0 / 30.0, 0.0, 5.0, 0.0);
            let (dx, dz) = (car.rear[0] - middle[0], car.rear[1] - middle[1]);
            assert!(((dx * dx + dz * dz).sqrt() - radius).abs() < 1e-3);
        }
    }

    #[test]
    fn positive_steering_turns_right_and_the_wheels_need_time() {
        let mut car = Vehicle::at([0.0, 0.0], 0.0, 5.0);
        car.advance(control(1.0, 0.0), 0.1, 0.0, 20.0, 0.0);
        assert!((car.steering_angle - 0.1 * STEERING_RATE).abs() < 1e-12);
        (0..10).for_each(|_| car.advance(control(1.0, 0.0), 0.1, 0.0, 20.0, 0.0));
        assert!(car.heading > 0.0 && car.centre()[0] > 0.0);
    }

    #[test]
    fn speed_stays_between_zero_and_the_limit() {
        let mut car = Vehicle::at([0.0, 0.0], 0.0, 0.0);
        car.advance(control(0.0, -1.0), 1.0, 0.0, 20.0, 0.0);
        assert_eq!((car.speed, car.centre()), (0.0, [0.0, 0.0]));
        car.advance(control(0.0, 1.0), 1.0, 0.0, 20.0, 0.0);
        assert!((car.speed - (ACCELERATION - ROLLING)).abs() < 0.01);
        car.advance(control(0.0, 9.0), 30.0, 0.0, 12.0, 0.0);
        assert_eq!(car.speed, 12.0);
        car.advance(control(0.0, -1.0), 1.0, 0.0, 12.0, 0.0);
        assert!((12.0 - car.speed - BRAKING - ROLLING).abs() < 0.15);
    }

    #[test]
    fn the_step_of_the_integration_does_not_show() {
        let mut coarse = Vehicle::at([0.0, 0.0], 0.3, 8.0);
        let mut fine = coarse;
        for _ in 0..30 {
            coarse.advance(control(0.4, 0.5), 0.1, 0.0, 20.0, 0.0);
            (0..50).for_each(|_| fine.advance(control(0.4, 0.5), 0.002, 0.0, 20.0, 0.0));
        }
        let (a, b) = (coarse.centre(), fine.centre());
        assert!((a[0] - b[0]).abs() < 1e-3 && (a[1] - b[1]).abs() < 1e-3, "{a:?} {b:?}");
    }

    #[test]
    fn slopes_pull() {
        let speed = |slope| {
            let mut car = Vehicle::at([0.0, 0.0], 0.0, 8.0);
            car.advance(control(0.0, 0.0), 1.0, slope, 20.0, 0.0);
            car.speed
        };
        assert!((speed(0.0) - speed(0.1) - 0.98).abs() < 0.02 && speed(-0.1) > 8.5);
    }
}
