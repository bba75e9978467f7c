//! The driver `lane_keeper`: steers by what it sees of the lane markings, without learning and without a map.

use pdk_sdk::prelude::*;

use crate::camera;
use crate::lines::{FEWEST_ROWS, LaneFinder, LaneShape};
use crate::vehicle::{LARGEST_STEERING_ANGLE, WHEELBASE};

/// From the camera back to the rear axle in metres: pure pursuit counts from there.
const CAMERA_TO_REAR_AXLE: f64 = camera::AHEAD_OF_CENTRE + WHEELBASE / 2.0;
/// The point it steers towards lies at a fixed distance and further away the faster it goes: metres, seconds, bounds.
const LOOK_AHEAD: f64 = 3.0;
const LOOK_AHEAD_TIME: f64 = 0.5;
const LOOK_AHEAD_RANGE: (f64, f64) = (5.0, 14.0);
/// What remains of the steering after each frame without a lane.
const STEERING_DECAY: f64 = 0.92;
/// After this many frames without a lane it forgets where the lane was, and looks for it straight ahead.
const FRAMES_TO_FORGET: u32 = 10;
/// Throttle per metre per second below the target speed.
const SPEED_GAIN: f64 = 0.5;
/// Throttle where the speed is not known, and where no lane is seen.
const UNKNOWN_SPEED_THROTTLE: f64 = 0.1;
const LOST_THROTTLE: f64 = 0.0;

/// Keeps to the lane between a white line on the right and a dashed yellow one on the left.
///
/// It looks at the frame alone and knows how the camera is mounted. It steers by pure pursuit towards the lane's centre
/// some metres ahead, and slows down for bends. If it sees no lane, it holds its last steering, which decays to
/// straight, and rolls.
pub struct LaneKeeper {
    target_speed: f64,
    gain: f64,
    lateral_acceleration: f64,
    wander: f64,
    finder: LaneFinder,
    expected: LaneShape,
    steering: f64,
    frames_without_lane: u32,
}

impl Component for LaneKeeper {
    fn description() -> Description {
        Description::driver(
            "lane_keeper",
            "Follows lane markings by classical image processing and pure pursuit",
        )
        .source("Coulter, \"Implementation of the pure pursuit path tracking algorithm\" (1992)")
        .parameter(
            Parameter::number("target_speed", 8.0, "speed on straight road").range(0.5, 40.0).unit("m/s"),
        )
        .parameter(
            Parameter::number("gain", 1.0, "factor on the steering angle; more than 1 steers harder")
                .range(0.1, 5.0),
        )
        .parameter(
            Parameter::number(
                "lateral_acceleration",
                2.5,
                "sideways acceleration it accepts in bends: it slows down to stay below it",
            )
            .range(0.1, 20.0)
            .unit("m/s^2"),
        )
        .parameter(
            Parameter::number(
                "wander",
                0.0,
                "how far it swings about the middle of the lane, to record what a network has to learn to correct",
            )
            .range(0.0, 1.8)
            .unit("m"),
        )
    }

    fn new(config: &Config) -> Result<Self> {
        Ok(Self {
            target_speed: config.number("target_speed"),
            gain: config.number("gain"),
            lateral_acceleration: config.number("lateral_acceleration"),
            wander: config.number("wander"),
            finder: LaneFinder::new(1, 1),
            expected: LaneShape::default(),
            steering: 0.0,
            frames_without_lane: 0,
        })
    }
}

impl LaneKeeper {
    /// Its aim, in metres to the right of the lane's centre: two swings whose periods have no common
    /// multiple soon, so that places and directions mix.
    fn swing(&self, time: f64) -> f64 {
        if self.wander == 0.0 || !time.is_finite() {
            return 0.0;
        }
        let swing = |period: f64| libm::sin(2.0 * std::f64::consts::PI * time / period);
        self.wander * (0.7 * swing(7.3) + 0.3 * swing(2.9))
    }
}

impl Driver for LaneKeeper {
    fn reset(&mut self) -> Result<()> {
        self.expected = LaneShape::default();
        self.steering = 0.0;
        self.frames_without_lane = 0;
        Ok(())
    }

    fn drive(&mut self, frame: Frame<'_>, cx: &DriveContext) -> Result<Control> {
        let size = (frame.width(), frame.height());
        if self.finder.size() != size {
            self.finder = LaneFinder::new(size.0, size.1);
        }
        if self.finder.rows() < FEWEST_ROWS {
            return Err(Error::new(format!(
                "it cannot make out a lane in frames of {}x{} pixels: use larger ones, such as 320x240",
                size.0, size.1
            )));
        }
        let Some(lane) = self.finder.find(frame, self.expected) else {
            self.frames_without_lane += 1;
            if self.frames_without_lane >= FRAMES_TO_FORGET {
                self.expected = LaneShape::default();
            }
            self.steering *= STEERING_DECAY;
            return Ok(Control { steering: self.steering, throttle: LOST_THROTTLE });
        };
        self.frames_without_lane = 0;
        self.expected = lane.shape;

        let speed = if cx.speed.is_finite() { cx.speed } else { self.target_speed };
        let reach = (LOOK_AHEAD + LOOK_AHEAD_TIME * speed).clamp(LOOK_AHEAD_RANGE.0, LOOK_AHEAD_RANGE.1);
        let ahead = (reach - CAMERA_TO_REAR_AXLE).min(lane.farthest);
        let (right, from_axle) = (lane.shape.at(ahead) + self.swing(cx.time), ahead + CAMERA_TO_REAR_AXLE);
        let curvature = 2.0 * right / (right * right + from_axle * from_axle);
        let angle = libm::atan(WHEELBASE * curvature) * self.gain;
        self.steering = (angle / LARGEST_STEERING_ANGLE).clamp(-1.0, 1.0);

        let throttle = if cx.speed.is_finite() {
            let bend = (2.0 * lane.shape.bend).abs().max(curvature.abs()).max(1e-6);
            let target = self.target_speed.min((self.lateral_acceleration / bend).sqrt());
            (SPEED_GAIN * (target - cx.speed)).clamp(-1.0, 1.0)
        } else {
            UNKNOWN_SPEED_THROTTLE
        };
        Ok(Control { steering: self.steering, throttle })
    }
}
