//! A scenario under way: its vehicle, what this senses, and where it is on its road.

use std::time::Duration;

use pdk_adapter::{Deadline, Place, Station, Track};
use pdk_road::traffic;
use pdk_sdk::prelude::{Control, Error, ErrorKind, Result, State};

use crate::axes::Transform;
use crate::blueprint::{Actor, Blueprints};
use crate::ground::Lane;
use crate::options::Options;
use crate::sensors::Sensors;
use crate::server::{Pedals, Server};
use crate::snapshot::{self, Motion};
use crate::stream::Stream;
use crate::traffic::Fleet;

/// So much higher than the road the vehicle is spawned, in metres: one that touches it is refused.
const DROP: f64 = 0.5;
/// It has come to rest when it moves more slowly than this, in metres per second.
const REST: f64 = 0.02;
/// Simulation time for coming to rest, least and most, in seconds.
const SETTLE: (f64, f64) = (0.2, 5.0);
/// How long a camera that was just subscribed to is waited for before another frame is asked for.
const FIRST_FRAME: Duration = Duration::from_millis(250);
/// This many frames are asked for until the first comes.
const FIRST_FRAMES: u32 = 40;
/// A scenario under way.
#[derive(Debug)]
pub struct Stage {
    options: Options,
    track: Track,
    half_width: f64,
    heading: f64,
    fleet: Fleet,
    /// From the middle of the vehicle to its front in metres; that of the simulator `lane` if the server does not tell it.
    front: f64,
    /// The vehicle's number and what it senses.
    ego: Option<(u32, Sensors)>,
    /// The server's number of the scenario's first frame.
    first: u64,
    state: State,
}

impl Stage {
    /// A scenario on a lane; nothing is spawned yet.
    ///
    /// # Errors
    /// If the lane is not a road.
    pub fn new(lane: Lane, options: Options, seed: u64) -> Result<Self> {
        Ok(Self {
            fleet: Fleet::new(options.traffic, &lane, seed)?,
            front: traffic::SIZE[2] / 2.0,
            heading: lane.heading(),
            half_width: lane.half_width,
            track: Track::new(lane.waypoints)?,
            options,
            ego: None,
            first: 0,
            state: State::default(),
        })
    }

    /// The road's centre line.
    pub fn waypoints(&self) -> &[[f64; 3]] {
        self.track.waypoints()
    }

    /// The latest state.
    pub fn state(&self) -> State {
        self.state
    }

    /// What the vehicle senses, once it is there.
    pub fn sensors(&self) -> Option<&Sensors> {
        self.ego.as_ref().map(|(_, sensors)| sensors)
    }

    /// Spawns the vehicle with what it senses, and waits until it stands.
    ///
    /// # Errors
    /// If something cannot be spawned, or does not answer.
    pub fn set_up(
        &mut self,
        station: &mut Station,
        server: &mut Server,
        world: &mut Stream,
        kinds: &Blueprints,
        deadline: &Deadline,
    ) -> Result<State> {
        let [x, height, z] = self.track.waypoints()[0];
        let at = Transform::at([x, height + DROP, z], self.heading);
        let vehicle = kinds.describe(&self.options.vehicle, &[("role_name", "hero".to_owned())])?;
        let vehicle = server.spawn(vehicle, at).map_err(|error| {
            error.at(format_args!("the vehicle cannot start at x {x:.1}, height {height:.1}, z {z:.1}"))
        })?;
        self.front = Actor(&vehicle).extent().map_or(self.front, |[half_length, ..]| half_length);
        let vehicle = server.id_of(&vehicle)?;
        self.fleet.spawn(server, kinds, &self.options.vehicle, self.front)?;

        let sensors = Sensors::mount(station, server, kinds, &self.options, vehicle, deadline)?;
        self.ego = Some((vehicle, sensors));
        self.settle(station, server, world, deadline)
    }

    /// Keeps the streams: whether all of them still stand.
    ///
    /// # Errors
    /// If one that is to be renewed cannot be.
    pub fn keep(&mut self, station: &mut Station, deadline: &Deadline) -> Result<bool> {
        self.ego.as_mut().map_or(Ok(true), |(_, sensors)| sensors.keep(station, deadline))
    }

    /// Subscribes to the streams again, which the server has closed because it had nothing to send over them.
    ///
    /// # Errors
    /// If they cannot be had.
    pub fn subscribe_again(
        &mut self,
        station: &mut Station,
        server: &mut Server,
        deadline: &Deadline,
    ) -> Result<()> {
        self.ego.as_mut().map_or(Ok(()), |(_, sensors)| sensors.subscribe_again(station, server, deadline))
    }

    /// Moves the scenario on by one frame under a control.
    ///
    /// # Errors
    /// If the server does not do what it is asked for.
    pub fn act(
        &mut self,
        control: Control,
        server: &mut Server,
        world: &mut Stream,
        deadline: &Deadline,
    ) -> Result<State> {
        let Some((vehicle, sensors)) = &mut self.ego else {
            return Err(Error::new("it has no scenario yet: call reset first"));
        };
        let number = frames(self.state.time, self.options.mount.camera.rate) + 1;
        let expected = self.first + number;
        self.fleet.place(server, number as f64 / self.options.mount.camera.rate)?;
        server.control(*vehicle, Pedals::of(control.checked()?))?;
        let request = server.tick()?;
        // What belongs to the frame may come before the answer.
        let motion = motion(world, *vehicle, expected, deadline)?;
        sensors.look(expected, deadline)?;
        let frame = server.ticked(request)?;
        check_frame(frame, expected)?;
        let collision = sensors.collided(deadline)?;
        Ok(self.arrive(motion, expected, collision))
    }

    /// Lets the vehicle fall on the road and come to rest, and gives it its speed.
    fn settle(
        &mut self,
        station: &Station,
        server: &mut Server,
        world: &mut Stream,
        deadline: &Deadline,
    ) -> Result<State> {
        let Some((vehicle, sensors)) = &mut self.ego else { return Err(Error::new("nothing was spawned")) };
        let vehicle = *vehicle;
        let rate = self.options.mount.camera.rate;
        server.control(vehicle, Pedals::PARKED)?;
        self.fleet.place(server, 0.0)?;
        // The server does not say when it has taken a subscription: frames are asked for until the first comes.
        let mut tries = 0;
        let mut before = None;
        let (mut frame, mut moves) = loop {
            let request = server.tick()?;
            let told = server.ticked(request)?;
            // What it says may lag behind.
            let frame = before.map_or(told, |before: u64| told.max(before + 1));
            before = Some(frame);
            let patience = Deadline::new(FIRST_FRAME, "answer_seconds");
            let seen = motion(world, vehicle, frame, &patience).and_then(|moves| {
                sensors.look(frame, &patience)?;
                Ok(moves)
            });
            tries += 1;
            match seen {
                Ok(moves) => break (frame, moves),
                Err(error)
                    if error.kind() == ErrorKind::Late
                        && tries < FIRST_FRAMES
                        && deadline.left().is_some() => {}
                Err(error) if error.kind() == ErrorKind::Late => {
                    return Err(deadline.late(station, "sent a first camera frame"));
                }
                Err(error) => return Err(error),
            }
        };
        let began = frame;
        let elapsed = |frame: u64| (frame - began) as f64 / rate;
        let least = self.options.exposure_seconds.max(SETTLE.0);
        while elapsed(frame) < least || (moves.speed() > REST && elapsed(frame) < SETTLE.1) {
            frame += 1;
            moves = next(server, world, (vehicle, sensors), frame, deadline)?;
        }
        let speed = self.options.initial_speed;
        if speed > 0.0 {
            let ahead = [libm::cos(self.heading) * speed, libm::sin(self.heading) * speed, 0.0];
            server.control(vehicle, Pedals::of(Control::default()))?;
            server.set_velocity(vehicle, ahead)?;
            frame += 1;
            moves = next(server, world, (vehicle, sensors), frame, deadline)?;
        }
        // Falling on the road was not a collision.
        sensors.collided(deadline)?;
        self.first = frame;
        Ok(self.arrive(moves, frame, false))
    }

    fn arrive(&mut self, motion: Motion, frame: u64, collision: bool) -> State {
        let Place { cross_track_error, along, progress, finished, .. } = self.track.find(motion.position);
        // From the count, not from a sum: it never drifts.
        let time = (frame - self.first) as f64 / self.options.mount.camera.rate;
        self.state = State {
            time,
            position: motion.position,
            heading: motion.heading,
            speed: motion.speed(),
            cross_track_error,
            progress,
            vehicle_ahead: self.fleet.free_distance(time, along + self.front),
            lane_departure: cross_track_error.abs() >= self.half_width,
            collision,
            finished,
        };
        self.state
    }
}

/// The number of frames in this much time.
fn frames(time: f64, rate: f64) -> u64 {
    (time * rate).round() as u64
}

/// Moves on to a frame: how the vehicle moves in it.
fn next(
    server: &mut Server,
    world: &mut Stream,
    (vehicle, sensors): (u32, &mut Sensors),
    frame: u64,
    deadline: &Deadline,
) -> Result<Motion> {
    let request = server.tick()?;
    check_frame(server.ticked(request)?, frame)?;
    let moves = motion(world, vehicle, frame, deadline)?;
    sensors.look(frame, deadline)?;
    Ok(moves)
}

/// Checks the number that the server gives to a frame. One that lags behind does no harm, because what belongs to the frame is waited for by
/// the right number.
fn check_frame(told: u64, expected: u64) -> Result<()> {
    if told <= expected {
        return Ok(());
    }
    Err(Error::of(
        ErrorKind::Nonsense,
        format!(
            "the server went on to frame {told}, but frame {expected} was expected; another client of CARLA steps the same server: end \
             that one, or set `port` to that of another server"
        ),
    ))
}

/// How the vehicle moves in a frame.
fn motion(world: &mut Stream, vehicle: u32, frame: u64, deadline: &Deadline) -> Result<Motion> {
    loop {
        let (header, body) = world.next(deadline)?;
        if header.frame < frame {
            continue;
        }
        return snapshot::motion(body, vehicle).ok_or_else(|| {
            Error::of(
                ErrorKind::Lost,
                format!("the vehicle is no longer in frame {frame} of the server; another client of CARLA has removed it"),
            )
        });
    }
}
