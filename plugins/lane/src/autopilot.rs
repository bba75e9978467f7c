//! Drives the vehicle by what only the simulator knows, for recording what a network is to learn from.

use std::f64::consts::PI;

use pdk_road::{Located, Path, distance};
use pdk_sdk::prelude::Control;

use crate::vehicle::{LARGEST_STEERING_ANGLE, Vehicle, WHEELBASE};

/// The point it steers towards lies at a fixed distance and farther away the faster it goes: metres, seconds.
const LOOK_AHEAD: f64 = 4.0;
const LOOK_AHEAD_TIME: f64 = 0.5;
/// How hard it goes round bends and brakes before them, in metres per second squared.
const LATERAL_ACCELERATION: f64 = 3.5;
const DECELERATION: f64 = 2.5;
/// Free distance to the vehicle ahead that it keeps: metres when standing, and seconds on top.
const STANDSTILL_GAP: f64 = 4.0;
const TIME_GAP: f64 = 1.2;
/// How far its speed swings, as a share, and how long it takes, in seconds.
const SPEED_SWING: (f64, f64) = (0.2, 11.0);

/// How it drives.
#[derive(Debug, Clone, Copy)]
pub struct Autopilot {
    /// Speed on straight road in metres per second.
    pub speed: f64,
    /// How far it swings about the middle of its lane, in metres.
    pub swing: f64,
}

impl Autopilot {
    /// What it does at a time, at a place on the road, with that free distance to the vehicle ahead.
    pub fn control(
        &self,
        time: f64,
        vehicle: &Vehicle,
        (path, located): (&Path, Located),
        gap: f64,
    ) -> Control {
        let along = located.along;
        let reach = LOOK_AHEAD + LOOK_AHEAD_TIME * vehicle.speed;
        let wave = |period: f64| libm::sin(2.0 * PI * time / period);
        // Two swings whose periods have no common multiple soon, so that places and directions mix.
        let target = path.beside(along + reach, self.swing * (0.7 * wave(7.3) + 0.3 * wave(2.9)));
        let rear = vehicle.ahead(-WHEELBASE / 2.0);
        let (sine, cosine) = (libm::sin(vehicle.heading), libm::cos(vehicle.heading));
        let (dx, dz) = (target[0] - rear[0], target[1] - rear[1]);
        let (right, ahead) = (dx * cosine - dz * sine, dx * sine + dz * cosine);
        let curvature = 2.0 * right / (right * right + ahead * ahead);
        let steering = libm::atan(WHEELBASE * curvature) / LARGEST_STEERING_ANGLE;

        let mut wanted = self.speed * (1.0 + SPEED_SWING.0 * wave(SPEED_SWING.1));
        let sight = vehicle.speed * vehicle.speed / (2.0 * DECELERATION) + 15.0;
        for step in 0..(sight / 4.0) as usize {
            let s = step as f64 * 4.0;
            let [a, b, c] = [-4.0, 0.0, 4.0].map(|off| path.point_at(along + s + off));
            let area = ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).abs();
            let bend = 2.0 * area / (distance(a, b) * distance(b, c) * distance(c, a)).max(1e-9);
            let there = LATERAL_ACCELERATION / bend.max(1e-6);
            wanted = wanted.min((there + 2.0 * DECELERATION * s).sqrt());
        }
        if gap.is_finite() {
            wanted = wanted.min(((gap - STANDSTILL_GAP) / TIME_GAP).max(0.0));
        }
        let throttle = 0.5 * (wanted - vehicle.speed) + 0.05;
        Control { steering: steering.clamp(-1.0, 1.0), throttle: throttle.clamp(-1.0, 1.0) }
    }
}
