//! The simulator `donkey`: puts the car at the start of its road, and drives it.

use std::time::{Duration, Instant};

use pdk_adapter::{Deadline, Station, Track, ends};
use pdk_sdk::model::failure::FailureCriteria;
use pdk_sdk::prelude::*;

use crate::end::End;
use crate::lap::Lap;
use crate::menu;
use crate::options::{Build, Options, describe};
use crate::road::{self, Road};
use crate::telemetry::{Heard, Telemetry, take};
use crate::wire::{ROOM, Wire};

/// Farther than this from the place of the start it is not there, in metres.
const AT_START: f64 = 1.0;
/// By how much the simulator's cross-track error and that of the road that it was given may differ, in metres, and in how much
/// telemetry one after the other: more than that, and it has built another road.
const SAME_ROAD: (f64, u32) = (2.0, 5);
/// Telemetry in which it has to stand, one after the other.
const STANDING_FRAMES: u32 = 3;

/// The adapter.
pub struct Donkey {
    options: Options,
    link: Option<Link>,
    drive: Option<Drive>,
}

/// The connection to a simulator with a car on the road.
struct Link {
    wire: Wire,
    version: String,
    /// Where the car stands at the start, in the simulator's coordinates, and which build sends that.
    home: Option<[f64; 3]>,
    build: Option<Build>,
}

/// A scenario under way.
struct Drive {
    criteria: FailureCriteria,
    /// Where a scenario says how the road is.
    track: Option<Track>,
    /// Telemetry, one after the other, in which the road seems to be another one.
    elsewhere: u32,
    began: Instant,
    /// The simulator's time at the start.
    time: Option<f64>,
    lap: Lap,
    end: End,
    state: State,
    /// The encoded picture that belongs to the state.
    picture: Vec<u8>,
}

impl Component for Donkey {
    fn description() -> Description {
        describe(Description::simulator("donkey", "The simulator of the Donkey car, over TCP").version(2))
    }

    fn new(config: &Config) -> Result<Self> {
        Ok(Self { options: Options::read(config)?, link: None, drive: None })
    }
}

impl Simulator for Donkey {
    fn camera(&self) -> Camera {
        self.options.camera
    }

    fn reset(&mut self, scenario: &Scenario, slot: u32) -> Result<State> {
        self.drive = None;
        let road = Road::read(&scenario.road, self.options.build)?;
        let mut link = self.connected(slot)?;
        let drive = link.start(&self.options, &road, scenario.failure)?;
        let state = drive.state;
        (self.link, self.drive) = (Some(link), Some(drive));
        Ok(state)
    }

    fn frame(&mut self, into: FrameMut<'_>) -> Result<State> {
        let (Some(drive), Some(link)) = (&self.drive, &self.link) else { return Err(not_started()) };
        pdk_adapter::picture::decode(&drive.picture, &link.wire.station, into)?;
        Ok(drive.state)
    }

    fn act(&mut self, control: Control) -> Result<State> {
        let (Some(drive), Some(link)) = (&mut self.drive, &mut self.link) else { return Err(not_started()) };
        let deadline = self.options.settings.answering();
        // What came while the driver was at work shows a world without this control. It is looked at, because it may say
        // that the car hit something, and not shown.
        while link.wire.has_message()? && deadline.left().is_some() {
            if link.hear(&self.options, drive, &deadline)? && ends(&drive.state, &drive.criteria) {
                return Ok(drive.state);
            }
        }
        link.control(control, &deadline)?;
        while !link.hear(&self.options, drive, &deadline)? {}
        // If several came at once, the driver gets the newest.
        while !ends(&drive.state, &drive.criteria) && link.wire.has_message()? && deadline.left().is_some() {
            link.hear(&self.options, drive, &deadline)?;
        }
        Ok(drive.state)
    }

    fn waypoints(&self) -> Vec<[f64; 3]> {
        let track = self.drive.as_ref().and_then(|drive| drive.track.as_ref());
        track.map(|track| track.waypoints().to_vec()).unwrap_or_default()
    }

    fn info(&self) -> Vec<(String, String)> {
        let Some(link) = &self.link else { return Vec::new() };
        let mut info = vec![("simulator".to_owned(), link.wire.station.to_string())];
        if !link.version.is_empty() {
            info.push(("version of the protocol".to_owned(), link.version.clone()));
        }
        info
    }
}

fn not_started() -> Error {
    Error::new("it has no scenario yet: call reset first")
}

impl Donkey {
    /// The connection, made anew if there is none, or the simulator has closed it since the last scenario.
    fn connected(&mut self, slot: u32) -> Result<Link> {
        let kept = self.link.take().filter(|link| link.wire.station.slot() == slot);
        let kept = kept.and_then(|mut link| link.forget_what_came().is_ok().then_some(link));
        match kept {
            Some(link) => Ok(link),
            None => {
                let station = Station::new(&self.options.settings, slot)?;
                let (wire, version) = menu::open(station, &self.options)?;
                Ok(Link { wire, version, home: None, build: None })
            }
        }
    }
}

impl Drop for Donkey {
    fn drop(&mut self) {
        let Some(mut link) = self.link.take() else { return };
        // The next client finds a car that stands, and the menu. If the simulator is gone, that is all right too.
        let soon = Deadline::new(Duration::from_millis(200), "answer_seconds");
        let said = link.brake(&soon);
        if said.is_ok() && self.options.build == Build::Current {
            let _ = link.wire.send("exit_scene", &[], &soon);
        }
        link.wire.close();
    }
}

impl Link {
    /// Puts the car at the start of the road, and waits until it stands there.
    fn start(&mut self, options: &Options, road: &Road, criteria: FailureCriteria) -> Result<Drive> {
        let deadline = options.settings.answering();
        self.brake(&deadline)?;
        let telemetry = self.telemetry(&deadline, options)?.0;
        if self.build.is_none() {
            // The first thing that a new car tells is where it stands.
            (self.home, self.build) = (telemetry.position, telemetry.build);
            if self.build.is_some_and(|build| build != options.build) {
                return Err(menu::other_build(&self.wire, options.build));
            }
        }
        self.wire.keep_apart();
        self.wire.send("reset_car", &[], &deadline)?;
        self.wire.keep_apart();
        let track = self.build_road(road, &deadline)?;
        let (telemetry, picture) = self.stand(options, &deadline)?;
        let mut drive = Drive {
            criteria,
            track,
            elsewhere: 0,
            began: Instant::now(),
            time: telemetry.time,
            lap: Lap::default(),
            end: End::default(),
            state: State::default(),
            picture,
        };
        drive.state = drive.judged(&telemetry, options, self.home.unwrap_or_default(), &self.wire)?;
        Ok(drive)
    }

    /// Has the simulator build the scenario's road; where it goes is known then.
    fn build_road(&mut self, road: &Road, deadline: &Deadline) -> Result<Option<Track>> {
        match road {
            Road::Given => Ok(None),
            Road::Generated(fields) => {
                self.wire.send("regen_road", fields, deadline)?;
                Ok(None)
            }
            Road::Points(points) => {
                let home = self.home.ok_or_else(|| {
                    mistake(format!(
                        "{} does not say where its car stands, so no road can begin there",
                        self.wire.station
                    ))
                })?;
                self.wire.send("regen_road", &[("wayPoints", road::print(points, home, ROOM))], deadline)?;
                let [x, y, z] = points[0];
                Track::new(points.iter().map(|[px, py, pz]| [px - x, py - y, pz - z]).collect()).map(Some)
            }
        }
    }

    /// Brakes until the car has stood at the start for a while.
    fn stand(&mut self, options: &Options, deadline: &Deadline) -> Result<(Telemetry, Vec<u8>)> {
        let began = Instant::now();
        let mut standing = 0;
        let mut before: Option<f64> = None;
        loop {
            // As long as telemetry comes, the message in the end is about where the car is.
            let each = options.settings.answering();
            self.wire.keep_apart();
            self.brake(&each)?;
            let (telemetry, picture) = self.newest_telemetry(&each, options)?;
            // Its clock begins anew when it does what it was told: whatever stood before that stood on another road.
            if telemetry.time.zip(before).is_some_and(|(now, before)| now < before) {
                standing = 0;
            }
            before = telemetry.time;
            let away = match (telemetry.position, self.home) {
                (Some(position), Some(home)) => ground_distance(position, home),
                _ => 0.0,
            };
            let stands = telemetry.speed.abs() < options.standing_speed
                && away < AT_START
                && telemetry.done != Some(true);
            standing = if stands { standing + 1 } else { 0 };
            let settled = standing >= STANDING_FRAMES && began.elapsed().as_secs_f64() >= options.settle;
            // The camera takes on its size some frames after it was told to. If it never does, the first frame says so.
            let late = deadline.left().is_none();
            if settled && (late || has_size(&picture, options.camera)) {
                return Ok((telemetry, picture));
            }
            if late {
                let done =
                    if telemetry.done == Some(true) { ", and it reports that the road is over" } else { "" };
                return Err(Error::of(
                    ErrorKind::Late,
                    format!(
                        "{} has not put its car to rest at the start of the road within {} s: it is {away:.1} m away at {:.2} m/s{done}; if it \
                         is only slow, raise `answer_seconds`",
                        self.wire.station,
                        options.settings.answer.as_secs_f64(),
                        telemetry.speed
                    ),
                ));
            }
        }
    }

    fn brake(&mut self, deadline: &Deadline) -> Result<()> {
        let fields = [("steering", "0"), ("throttle", "0"), ("brake", "1")];
        self.wire.send("control", &fields.map(|(name, value)| (name, value.to_owned())), deadline)
    }

    fn control(&mut self, control: Control, deadline: &Deadline) -> Result<()> {
        let fields = [
            ("steering", control.steering.to_string()),
            // Throttle below zero would drive backwards.
            ("throttle", control.throttle.max(0.0).to_string()),
            ("brake", (-control.throttle).max(0.0).to_string()),
        ];
        self.wire.send("control", &fields, deadline)
    }

    /// Waits for the next telemetry.
    fn telemetry(&mut self, deadline: &Deadline, options: &Options) -> Result<(Telemetry, Vec<u8>)> {
        loop {
            let mut picture = Vec::new();
            let heard =
                self.wire.next(deadline, "sent telemetry", |message| take(message, options, &mut picture))?;
            if let Some(telemetry) = self.checked(heard)? {
                return Ok((telemetry, picture));
            }
        }
    }

    /// Waits for telemetry. If several came already, takes the last: the others may be from before the last thing that was sent.
    fn newest_telemetry(&mut self, deadline: &Deadline, options: &Options) -> Result<(Telemetry, Vec<u8>)> {
        let mut newest = self.telemetry(deadline, options)?;
        while self.wire.has_message()? && deadline.left().is_some() {
            newest = self.telemetry(deadline, options)?;
        }
        Ok(newest)
    }

    /// Takes the next message of a scenario under way; whether it was telemetry.
    fn hear(&mut self, options: &Options, drive: &mut Drive, deadline: &Deadline) -> Result<bool> {
        let heard = self
            .wire
            .next(deadline, "sent telemetry", |message| take(message, options, &mut drive.picture))?;
        let Some(telemetry) = self.checked(heard)? else { return Ok(false) };
        drive.state = drive.judged(&telemetry, options, self.home.unwrap_or_default(), &self.wire)?;
        Ok(true)
    }

    /// The telemetry among what was heard.
    fn checked(&self, heard: Heard) -> Result<Option<Telemetry>> {
        match heard {
            Heard::Telemetry(telemetry) => Ok(Some(telemetry)),
            Heard::Nothing => Ok(None),
            Heard::Menu => Err(Error::of(
                ErrorKind::Lost,
                format!(
                    "{} has left its scene and shows the menu; another program may have used it",
                    self.wire.station
                ),
            )),
            Heard::NoPicture(why) => Err(Error::of(
                ErrorKind::Nonsense,
                format!("{} sends telemetry without a picture that can be used ({why})", self.wire.station),
            )),
        }
    }

    /// Takes what has come since the last scenario.
    fn forget_what_came(&mut self) -> Result<()> {
        let deadline = Deadline::new(Duration::from_millis(500), "answer_seconds");
        while self.wire.has_message()? && deadline.left().is_some() {
            if self
                .wire
                .next(&deadline, "sent telemetry", |message| message.msg_type == "scene_selection_ready")?
            {
                return Err(Error::of(ErrorKind::Lost, "the simulator shows its menu"));
            }
        }
        Ok(())
    }
}

impl Drive {
    /// The state that telemetry tells.
    fn judged(
        &mut self,
        telemetry: &Telemetry,
        options: &Options,
        home: [f64; 3],
        wire: &Wire,
    ) -> Result<State> {
        let position =
            telemetry.position.map(|position| std::array::from_fn(|axis| position[axis] - home[axis]));
        let place = position.zip(self.track.as_mut()).map(|(position, track)| track.find(position));
        let Some(cross_track_error) =
            telemetry.cross_track_error.or(place.map(|place| place.cross_track_error))
        else {
            return Err(mistake(format!(
                "{} sends no cross-track error, and no position on a road that is known, so pdk cannot judge whether its car keeps its lane; \
                 choose a scene with a path, and have extended telemetry sent",
                wire.station
            )));
        };
        // It loses a message that it reads together with another one.
        let differs = place.is_some_and(|place| {
            (place.cross_track_error.abs() - cross_track_error.abs()).abs() > SAME_ROAD.0
        });
        self.elsewhere = if differs { self.elsewhere + 1 } else { 0 };
        if self.elsewhere >= SAME_ROAD.1 {
            return Err(Error::of(
                ErrorKind::Lost,
                format!("{} drives on another road than it was given", wire.station),
            ));
        }
        let time = match (telemetry.time, self.time) {
            (Some(now), Some(start)) => now - start,
            _ => self.began.elapsed().as_secs_f64(),
        };
        let lap = telemetry.nodes.map(|(node, nodes)| self.lap.go_on(node, nodes));
        let arrived = place.is_some_and(|place| place.finished);
        let finished = match telemetry.done {
            Some(done) => self.end.is_reached(done, cross_track_error, arrived),
            None => arrived || lap == Some(1.0),
        };
        let progress = match finished {
            true => 1.0,
            false => place.map(|place| place.progress).or(lap).unwrap_or_default(),
        };
        let heading = telemetry.heading.or(place.map(|place| place.heading)).unwrap_or_default();
        Ok(State {
            time,
            position: position.unwrap_or_default(),
            heading,
            speed: telemetry.speed,
            cross_track_error,
            progress,
            lane_departure: cross_track_error.abs() >= options.lane_departure,
            collision: telemetry.hit,
            finished,
            ..State::default()
        })
    }
}

/// Whether a picture has the size that the camera was told to have.
fn has_size(picture: &[u8], camera: Camera) -> bool {
    pdk_image::decode(picture)
        .is_ok_and(|picture| (picture.width(), picture.height()) == (camera.width, camera.height))
}

fn ground_distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    let (dx, dz) = (a[0] - b[0], a[2] - b[2]);
    (dx * dx + dz * dz).sqrt()
}

fn mistake(sentence: String) -> Error {
    Error::of(ErrorKind::Configuration, sentence)
}
