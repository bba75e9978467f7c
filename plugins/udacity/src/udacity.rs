//! The simulator `udacity`: puts the vehicle at the start of its road, and drives it.

use std::time::{Duration, Instant};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use pdk_adapter::{Deadline, Station, Track, ends};
use pdk_sdk::model::failure::FailureCriteria;
use pdk_sdk::prelude::*;

use crate::clock::Clock;
use crate::event::{Number, Packet};
use crate::number;
use crate::options::{Build, Options, describe};
use crate::server::Server;

/// Farther than this from the start of the road it is not there, in metres.
const AT_START: f64 = 2.0;
/// Telemetry in which it has to stand, one after the other.
const STANDING_FRAMES: u32 = 3;
/// Where the vehicle of the road-generating build starts, in its coordinates, if it does not say that itself.
const START: [f64; 3] = [125.0, 1.9, 25.0];
/// Slower than this the stock build is not braked before a scenario, in metres a second: braking at rest means to drive backwards there.
const BRAKED: f64 = 1.0;
/// Slower than this a driver does not brake, in metres a second: below 5 miles an hour (2.24 m/s), throttle below 0 is that of the reverse
/// gear, and the speed is that of the frame before.
const REVERSED: f64 = 2.3;

/// The adapter.
pub struct Udacity {
    options: Options,
    link: Option<Link>,
    drive: Option<Drive>,
}

/// The connection to a simulator.
struct Link {
    server: Server,
    /// The start of its vehicle, in its coordinates.
    home: Option<[f64; 3]>,
}

/// A scenario under way.
struct Drive {
    criteria: FailureCriteria,
    /// Where a scenario says how the road is.
    track: Option<Track>,
    /// Where that begins, in the simulator's coordinates.
    start: [f64; 3],
    clock: Clock,
    /// How much was hit before the scenario began, where the simulator counts.
    hits: f64,
    state: State,
    /// The encoded picture that belongs to the state.
    picture: Vec<u8>,
}

/// What is taken from telemetry.
struct Telemetry {
    speed: f64,
    cross_track_error: Option<f64>,
    position: Option<[f64; 3]>,
    hit: Hit,
    /// The road that is there, if it says so.
    track: Option<String>,
    /// Whether it has nothing that only the road-generating build tells.
    stock: bool,
    picture: Vec<u8>,
}

enum Hit {
    Nothing,
    Something,
    Count(f64),
}

/// What a packet says.
enum Heard {
    Telemetry(Telemetry),
    /// A person drives with the keys.
    Manual,
    NoPicture(String),
    Nothing,
}

impl Component for Udacity {
    fn description() -> Description {
        let description =
            Description::simulator("udacity", "Udacity's self-driving-car simulator, which connects to pdk");
        describe(description.version(2))
    }

    fn new(config: &Config) -> Result<Self> {
        Ok(Self { options: Options::read(config)?, link: None, drive: None })
    }
}

impl Simulator for Udacity {
    fn camera(&self) -> Camera {
        self.options.camera
    }

    fn reset(&mut self, scenario: &Scenario, slot: u32) -> Result<State> {
        self.drive = None;
        let road = pdk_adapter::road(&scenario.road)?;
        if road.is_some() && self.options.build == Build::Stock {
            return Err(Error::new(
                "the stock build of the simulator takes no roads; leave `road` out, or set build=road_generating",
            ));
        }
        let mut link = self.connected(slot)?;
        let drive = link.start(&self.options, road, scenario.failure)?;
        let state = drive.state;
        (self.link, self.drive) = (Some(link), Some(drive));
        Ok(state)
    }

    fn frame(&mut self, into: FrameMut<'_>) -> Result<State> {
        let (Some(drive), Some(link)) = (&self.drive, &self.link) else { return Err(not_started()) };
        pdk_adapter::picture::decode(&drive.picture, link.server.peer(), into)?;
        Ok(drive.state)
    }

    fn act(&mut self, control: Control) -> Result<State> {
        let (Some(drive), Some(link)) = (&mut self.drive, &mut self.link) else { return Err(not_started()) };
        let deadline = self.options.settings.answering();
        // What came while the driver was at work shows a world without this control. It is looked at, because it may say
        // that the vehicle hit something, and not shown.
        if link.catch_up(drive, &self.options, &deadline)? {
            return Ok(drive.state);
        }
        if self.options.build == Build::Stock {
            drive.clock.asked(Instant::now());
        }
        link.steer(unreversed(control, drive.state.speed), &deadline)?;
        let telemetry = link.telemetry(&self.options, &deadline)?;
        drive.go_on(telemetry, &self.options, link.server.peer())?;
        // If several came at once, the driver gets the newest.
        if !ends(&drive.state, &drive.criteria) {
            link.catch_up(drive, &self.options, &deadline)?;
        }
        Ok(drive.state)
    }

    fn waypoints(&self) -> Vec<[f64; 3]> {
        let track = self.drive.as_ref().and_then(|drive| drive.track.as_ref());
        track.map(|track| track.waypoints().to_vec()).unwrap_or_default()
    }

    fn info(&self) -> Vec<(String, String)> {
        let link = self.link.iter();
        link.map(|link| ("simulator".to_owned(), link.server.peer().to_owned())).collect()
    }
}

fn not_started() -> Error {
    Error::new("it has no scenario yet: call reset first")
}

impl Udacity {
    /// The connection, made anew if there is none, or the simulator has closed it since the last scenario.
    fn connected(&mut self, slot: u32) -> Result<Link> {
        let kept = self.link.take().filter(|link| link.server.station.slot() == slot);
        let kept = kept.and_then(|mut link| link.forget_what_came().is_ok().then_some(link));
        match kept {
            Some(link) => Ok(link),
            None => {
                let station = Station::new(&self.options.settings, slot)?;
                Ok(Link { server: Server::open(station, &self.options.settings.starting())?, home: None })
            }
        }
    }
}

impl Drop for Udacity {
    fn drop(&mut self) {
        if let Some(mut link) = self.link.take() {
            // It would drive on under the last control.
            let soon = Deadline::new(Duration::from_millis(200), "answer_seconds");
            let _ = link.steer(Control::default(), &soon);
            link.server.close();
        }
    }
}

impl Link {
    /// Puts the vehicle at the start of the road, and waits until it stands there.
    fn start(
        &mut self,
        options: &Options,
        road: Option<Vec<[f64; 3]>>,
        criteria: FailureCriteria,
    ) -> Result<Drive> {
        let deadline = options.settings.answering();
        if options.build == Build::Stock {
            // It says nothing but in answer to a command, except at first.
            self.steer(Control::default(), &deadline)?;
        }
        let first = self.telemetry(options, &deadline)?;
        if first.stock && options.build == Build::RoadGenerating {
            return Err(mistake(format!(
                "{} does not report roads, so it is the stock build; set build=stock, or start the road-generating one",
                self.server.peer()
            )));
        }
        // Where the road begins that is there, for the vehicle may be anywhere on it: it may have been driven before this connection.
        let begins = || pdk_road::parse(first.track.as_deref()?).ok()?.first().copied();
        let home = *self.home.get_or_insert_with(|| begins().or(first.position).unwrap_or(START));
        let (track, text) = match road {
            Some(points) => {
                let [x, y, z] = points[0];
                let text = print(&points, home);
                (
                    Some(Track::new(points.iter().map(|[px, py, pz]| [px - x, py - y, pz - z]).collect())?),
                    Some(text),
                )
            }
            // Built again, so that the vehicle is put at its start.
            None => (None, first.track.filter(|track| track.contains('@'))),
        };
        if options.build == Build::RoadGenerating {
            self.server.send("reset", &[], &deadline)?;
            if let Some(text) = &text {
                self.server.send("track", &[("track_string", text)], &deadline)?;
            }
        }
        let telemetry = self.stand(options, text.as_deref(), track.is_some().then_some(home), &deadline)?;
        let mut drive = Drive {
            criteria,
            track,
            start: home,
            clock: Clock::new(options.camera.rate, Instant::now()),
            hits: if let Hit::Count(count) = telemetry.hit { count } else { 0.0 },
            state: State::default(),
            picture: Vec::new(),
        };
        drive.go_on(telemetry, options, self.server.peer())?;
        Ok(drive)
    }

    /// Waits until the vehicle has stood at the start for a while, on this road.
    fn stand(
        &mut self,
        options: &Options,
        road: Option<&str>,
        start: Option<[f64; 3]>,
        deadline: &Deadline,
    ) -> Result<Telemetry> {
        let began = Instant::now();
        let mut standing = 0;
        let mut speed = 0.0;
        loop {
            if options.build == Build::Stock {
                // Each telemetry is the answer to a command.
                let throttle = if speed > BRAKED { -1.0 } else { 0.0 };
                self.steer(Control { steering: 0.0, throttle }, deadline)?;
            }
            // As long as telemetry comes, the message in the end is about where the vehicle is.
            let telemetry = self.telemetry(options, &options.settings.answering())?;
            speed = telemetry.speed;
            let away = match (telemetry.position, start) {
                (Some([x, _, z]), Some(start)) => ((x - start[0]).powi(2) + (z - start[2]).powi(2)).sqrt(),
                _ => 0.0,
            };
            let built = match (&telemetry.track, road) {
                (Some(there), Some(wanted)) => there == wanted,
                _ => true,
            };
            let stands = built && speed.abs() < options.standing_speed && away < AT_START;
            standing = if stands { standing + 1 } else { 0 };
            if standing >= STANDING_FRAMES && began.elapsed().as_secs_f64() >= options.settle {
                return Ok(telemetry);
            }
            if deadline.left().is_none() {
                let road = if built { "" } else { ", and its road is another one than it was given" };
                return Err(Error::of(
                    ErrorKind::Late,
                    format!(
                        "{} has not put its vehicle to rest at the start of the road within {} s: it is {away:.1} m away at {speed:.2} m/s{road}; if \
                         it is only slow, raise `answer_seconds`",
                        self.server.peer(),
                        options.settings.answer.as_secs_f64()
                    ),
                ));
            }
        }
    }

    fn steer(&mut self, control: Control, deadline: &Deadline) -> Result<()> {
        let [steering, throttle] = control.numbers().map(number::write);
        self.server.send("steer", &[("steering_angle", &steering), ("throttle", &throttle)], deadline)
    }

    /// Waits for the next telemetry.
    fn telemetry(&mut self, options: &Options, deadline: &Deadline) -> Result<Telemetry> {
        let mut what = "sent telemetry";
        loop {
            let heard = self.server.next(deadline, what, |packet| taken(packet, options))?;
            match heard {
                Heard::Telemetry(telemetry) => return Ok(telemetry),
                Heard::Manual => {
                    what = "sent a picture, only telemetry without one, as if a person drives with the keys,";
                    if options.build == Build::Stock {
                        self.server.send("manual", &[], deadline)?;
                    }
                }
                Heard::NoPicture(why) => return Err(self.no_picture(&why)),
                Heard::Nothing => {}
            }
        }
    }

    /// Takes all telemetry that has come already, until one ends the scenario; whether one did.
    fn catch_up(&mut self, drive: &mut Drive, options: &Options, deadline: &Deadline) -> Result<bool> {
        while deadline.left().is_some()
            && let Some(heard) = self.server.take(deadline, |packet| taken(packet, options))?
        {
            match heard {
                Heard::Telemetry(telemetry) => {
                    drive.go_on(telemetry, options, self.server.peer())?;
                    if ends(&drive.state, &drive.criteria) {
                        return Ok(true);
                    }
                }
                Heard::NoPicture(why) => return Err(self.no_picture(&why)),
                Heard::Manual | Heard::Nothing => {}
            }
        }
        drive.clock.caught_up();
        Ok(false)
    }

    fn no_picture(&self, why: &str) -> Error {
        Error::of(
            ErrorKind::Nonsense,
            format!("{} sends telemetry without a picture that can be used ({why})", self.server.peer()),
        )
    }

    /// Takes what has come since the last scenario.
    fn forget_what_came(&mut self) -> Result<()> {
        let deadline = Deadline::new(Duration::from_millis(500), "answer_seconds");
        while self.server.take(&deadline, |_| ())?.is_some() && deadline.left().is_some() {}
        Ok(())
    }
}

/// Takes what is of use from a packet.
fn taken(packet: Packet<'_>, options: &Options) -> Heard {
    let told = match packet {
        Packet::Telemetry(told) => told,
        Packet::Manual => return Heard::Manual,
        Packet::Ping(_) | Packet::Connect | Packet::Close | Packet::Other => return Heard::Nothing,
    };
    let picture = match STANDARD.decode(told.image.unwrap_or_default().as_bytes()) {
        Ok(picture) if picture.is_empty() => return Heard::NoPicture("it is empty".to_owned()),
        Ok(picture) => picture,
        Err(error) => return Heard::NoPicture(error.to_string()),
    };
    let position = match (told.pos_x, told.pos_y, told.pos_z) {
        (Number(Some(x)), Number(Some(y)), Number(Some(z))) => Some([x, y, z]),
        _ => None,
    };
    let stock = told.hit.is_none() && told.track.is_none() && told.cte.0.is_none() && position.is_none();
    let hit = match told.hit.as_deref() {
        None | Some("none" | "") => Hit::Nothing,
        Some(text) => number::read(text).map_or(Hit::Something, Hit::Count),
    };
    Heard::Telemetry(Telemetry {
        speed: told.speed.0.unwrap_or(f64::NAN) * options.build.speed_scale(),
        cross_track_error: told.cte.0,
        position,
        hit,
        track: told.track.filter(|track| !track.is_empty()).map(|track| track.to_string()),
        stock,
        picture,
    })
}

impl Drive {
    /// Takes the next telemetry.
    fn go_on(&mut self, telemetry: Telemetry, options: &Options, peer: &str) -> Result<()> {
        let Telemetry { speed, cross_track_error, position, hit, picture, .. } = telemetry;
        let position = position.map(|position| std::array::from_fn(|axis| position[axis] - self.start[axis]));
        let place = position.zip(self.track.as_mut()).map(|(position, track)| track.find(position));
        let cross_track_error = match cross_track_error.or(place.map(|place| place.cross_track_error)) {
            Some(error) => error,
            // It knows of no road.
            None if options.build == Build::Stock => 0.0,
            None => {
                return Err(mistake(format!(
                    "{peer} sends no cross-track error, and no position on a road that is known, so pdk cannot judge whether its vehicle keeps its \
                     lane; give the scenario a road, or set build=stock to drive without that"
                )));
            }
        };
        self.state = State {
            time: self.clock.heard(Instant::now()),
            position: position.unwrap_or_default(),
            heading: place.map(|place| place.heading).unwrap_or_default(),
            speed,
            cross_track_error,
            progress: place.map(|place| place.progress).unwrap_or_default(),
            lane_departure: cross_track_error.abs() >= options.lane_departure,
            collision: match hit {
                Hit::Nothing => false,
                Hit::Something => true,
                Hit::Count(count) => count > self.hits,
            },
            finished: place.is_some_and(|place| place.finished),
            ..State::default()
        };
        self.picture = picture;
        Ok(())
    }
}

/// A driver's control for a vehicle that is this fast, without driving backwards.
fn unreversed(control: Control, speed: f64) -> Control {
    match speed > REVERSED {
        true => control,
        false => Control { throttle: control.throttle.max(0.0), ..control },
    }
}

/// The points as the simulator takes them, with the first of them at `start`, in its own coordinates, to a hundredth of a millimetre.
fn print(points: &[[f64; 3]], start: [f64; 3]) -> String {
    let first = points.first().copied().unwrap_or_default();
    let moved = |point: &[f64; 3]| {
        let [x, y, z] = std::array::from_fn(|axis| point[axis] - first[axis] + start[axis]);
        format!("{x:.5},{y:.5},{z:.5}")
    };
    points.iter().map(moved).collect::<Vec<_>>().join("@")
}

fn mistake(sentence: String) -> Error {
    Error::of(ErrorKind::Configuration, sentence)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn throttle_below_0_is_not_sent_to_a_vehicle_that_would_drive_backwards() {
        for (speed, throttle, sent) in [
            (10.0, -0.7, -0.7),
            (2.4, -0.7, -0.7),
            (2.2, -0.7, 0.0),
            (0.0, -1.0, 0.0),
            (-3.0, -1.0, 0.0),
            (f64::NAN, -1.0, 0.0),
            (0.0, 0.4, 0.4),
        ] {
            let control = unreversed(Control { steering: 0.3, throttle }, speed);
            assert_eq!(control, Control { steering: 0.3, throttle: sent }, "{speed} {throttle}");
        }
    }

    #[test]
    fn roads_begin_where_the_vehicle_stands() {
        let points = [[1.0, 0.0, 2.0], [1.0, 0.5, 12.0]];
        assert_eq!(print(&points, START), "125.00000,1.90000,25.00000@125.00000,2.40000,35.00000");
    }
}
