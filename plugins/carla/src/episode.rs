//! The connection to a server, its map, and leaving both as they were found.

use std::time::Duration;

use pdk_adapter::{Deadline, Settings, Station};
use pdk_road::opendrive;
use pdk_sdk::prelude::{Error, ErrorKind, Result, Scenario, State};

use crate::axes::{self, Transform};
use crate::blueprint::{Actor, ROLE};
use crate::ground::{Ground, Lane};
use crate::options::Options;
use crate::server::{EpisodeSettings, GENERATED, Server};
use crate::snapshot;
use crate::stage::Stage;
use crate::stream::Stream;

/// How long it is looked whether another client steps a server that waits for its clients.
const WATCH: Duration = Duration::from_millis(500);
/// How often it is looked whether a map is there.
const TICK: Duration = Duration::from_millis(50);
/// How long taking leave may take for each answer.
const LEAVE: Duration = Duration::from_secs(1);

/// What is loaded.
#[derive(Debug, PartialEq)]
enum Loaded {
    /// A road of its own.
    Own(Vec<[f64; 3]>),
    /// A map, with the places where it recommends to start.
    Map { name: String, starts: Vec<Transform>, document: String },
}

/// A server as a worker uses it: connected, with a map, and with a scenario under way.
#[derive(Debug)]
pub struct Episode {
    station: Station,
    /// None while and after it takes leave.
    server: Option<Server>,
    world: Option<Stream>,
    loaded: Option<Loaded>,
    /// The map that was found, for roads that name none.
    home: String,
    /// How many worlds it has loaded.
    worlds: u64,
    stage: Option<Stage>,
}

impl Episode {
    /// Connects to the server of a slot, and removes what a worker that was killed has left there.
    ///
    /// # Errors
    /// If the server is not there or no CARLA, or another client uses it.
    pub fn open(settings: &Settings, slot: u32, deadline: &Deadline) -> Result<Self> {
        let mut station = Station::new(settings, slot)?;
        let opened = Self::greet(&mut station, deadline);
        let (mut server, mut world) = opened.map_err(|error| station.blame(error))?;
        let mut found = server.episode_settings()?;
        if found.is_synchronous() {
            found = abandoned(&station, &mut server, &mut world, found)?;
        }
        let weather = server.weather()?;
        server.keep(found, weather)?;
        let (home, _) = server.map()?;
        Ok(Self {
            server: Some(server),
            station,
            world: Some(world),
            loaded: None,
            home,
            worlds: 0,
            stage: None,
        })
    }

    fn greet(station: &mut Station, deadline: &Deadline) -> Result<(Server, Stream)> {
        let mut server = Server::open(station, deadline)?;
        let world = subscribe(station, &mut server, deadline)?;
        Ok((server, world))
    }

    /// The slot whose server this is.
    pub fn slot(&self) -> u32 {
        self.station.slot()
    }

    /// How many worlds the server has loaded for this worker.
    pub fn worlds(&self) -> u64 {
        self.worlds
    }

    /// What is known of the server.
    pub fn info(&self) -> Vec<(String, String)> {
        let version = self.server.as_ref().map(|server| ("version", server.version().to_string()));
        let map = self.loaded.as_ref().map(|loaded| match loaded {
            Loaded::Own(_) => ("map", "a road of the scenario's own".to_owned()),
            Loaded::Map { name, .. } => ("map", name.clone()),
        });
        version.into_iter().chain(map).map(|(name, value)| (name.to_owned(), value)).collect()
    }

    /// Whether the connection still stands.
    pub fn is_open(&mut self) -> bool {
        self.server.as_mut().is_some_and(Server::is_open)
    }

    /// Puts a vehicle at the start of a scenario.
    ///
    /// # Errors
    /// If the server does not do what it is asked for.
    pub fn begin(&mut self, scenario: &Scenario, options: &Options, deadline: &Deadline) -> Result<State> {
        let begun = self.prepare(scenario, options, deadline);
        begun.map_err(|error| self.station.blame(error))
    }

    /// The scenario under way.
    pub fn stage(&self) -> Option<&Stage> {
        self.stage.as_ref()
    }

    /// Moves the scenario on by one frame.
    ///
    /// # Errors
    /// If there is none, or the server does not do what it is asked for.
    pub fn step(
        &mut self,
        step: impl FnOnce(&mut Stage, &mut Server, &mut Stream) -> Result<State>,
    ) -> Result<State> {
        let Self { station, server, world, stage, .. } = self;
        let (Some(server), Some(world), Some(stage)) = (server, world, stage) else {
            return Err(not_started());
        };
        // The server closes streams over which it has sent nothing for a while, as when a driver is slow.
        let deadline = station.settings().answering();
        if !world.is_open() || !stage.keep(station, &deadline)? {
            *world = subscribe(station, server, &deadline)?;
            stage.subscribe_again(station, server, &deadline)?;
        }
        step(stage, server, world).map_err(|error| station.blame(error))
    }

    fn prepare(&mut self, scenario: &Scenario, options: &Options, deadline: &Deadline) -> Result<State> {
        self.stage = None;
        self.server.as_mut().map_or(Ok(()), Server::clear)?;
        let ground = Ground::read(&scenario.road, scenario.seed)?;
        self.load(&ground, deadline)?;
        let Self { station, server, world, loaded, stage, .. } = self;
        let (Some(server), Some(world)) = (server, world) else {
            return Err(not_started());
        };
        let lane = match (&ground, loaded) {
            (Ground::Map { start, length, .. }, Some(Loaded::Map { name, starts, document })) => {
                let Some(at) = starts.get(*start) else {
                    return Err(Error::new(format!(
                        "the map {name} has {} places to start from, so there is no number {start}",
                        starts.len()
                    )));
                };
                let [x, _, z] = axes::position(at.location);
                Lane::of_map(document, [x, z], axes::heading(at.rotation[1]), *length)
                    .map_err(|error| error.at(format_args!("map {name}")))?
            }
            (_, Some(Loaded::Own(waypoints))) => Lane::own(waypoints),
            _ => return Err(not_started()),
        };
        let settings = server.episode_settings()?.stepped(options.mount.camera.rate);
        server.set_episode_settings(&settings)?;
        if !options.weather.is_unchanged() {
            let mut weather = server.kept_weather().to_vec();
            options.weather.put_into(&mut weather);
            server.set_weather(&weather)?;
        }
        let blueprints = server.blueprints()?;
        let begun = stage.insert(Stage::new(lane, options.clone(), scenario.seed)?);
        begun.set_up(station, server, world, &blueprints, deadline)
    }

    /// Loads the map of a scenario, if it is not loaded already.
    fn load(&mut self, ground: &Ground, deadline: &Deadline) -> Result<()> {
        let Self { station, server, world, loaded, home, worlds, .. } = self;
        let Some(server) = server else { return Err(not_started()) };
        let is_there = match (ground, &*loaded) {
            (Ground::Own(waypoints), Some(Loaded::Own(there))) => waypoints == there,
            (Ground::Map { name, .. }, Some(Loaded::Map { name: there, .. })) => {
                name.as_ref().unwrap_or(&*home) == there
            }
            _ => false,
        };
        if is_there {
            return Ok(());
        }
        *loaded = None;
        let (before, _) = server.episode()?;
        let changes = match ground {
            Ground::Own(waypoints) => {
                server.load_document(&opendrive::write(waypoints, "pdk"))?;
                true
            }
            Ground::Map { name, .. } => {
                let map = name.as_ref().unwrap_or(&*home);
                // Of the same name is also the map of every road that was loaded since.
                let changes = server.map()?.0 != *map || (map == GENERATED && *worlds > 0);
                if changes {
                    let maps = server.maps()?;
                    if !maps.contains(map) {
                        let maps = maps.join(", ");
                        return Err(Error::new(match name {
                            Some(name) => format!("{station} has no map `{name}`; it has {maps}"),
                            None => format!(
                                "the road has no `map`, and the map that {station} had before is no longer there: it was generated from a \
                                 road; give the road a `map`, one of {maps}"
                            ),
                        }));
                    }
                    server.load(map)?;
                }
                changes
            }
        };
        if changes {
            *worlds += 1;
            // While it loads, it may refuse to answer, or answer only afterwards.
            station.wait(deadline, "loaded the map", || match server.episode() {
                Ok((number, _)) if number != before => Ok(Some(())),
                Err(error) if !matches!(error.kind(), ErrorKind::Failed | ErrorKind::Late) => Err(error),
                _ => {
                    std::thread::sleep(TICK);
                    Ok(None)
                }
            })?;
            server.forget()?;
            // A map comes with a weather of its own.
            let weather = server.kept_weather().to_vec();
            server.set_weather(&weather)?;
            *world = Some(subscribe(station, server, deadline)?);
        }
        *loaded = Some(match ground {
            Ground::Own(waypoints) => Loaded::Own(waypoints.clone()),
            Ground::Map { .. } => {
                let (name, starts) = server.map()?;
                Loaded::Map { name, starts, document: server.map_document()? }
            }
        });
        Ok(())
    }
}

impl Drop for Episode {
    fn drop(&mut self) {
        if let Some(server) = self.server.take() {
            server.leave(LEAVE);
        }
    }
}

/// Subscribes to the state of the world.
fn subscribe(station: &mut Station, server: &mut Server, deadline: &Deadline) -> Result<Stream> {
    let (_, token) = server.episode()?;
    let token = server.token(token)?;
    Stream::subscribe(station, token, "the state of the world", snapshot::SIZES, deadline)
}

/// A server that waits for clients: one that another client steps is left alone; one that a worker of pdk has left so, when it was killed,
/// is cleared, and goes on by its own clock afterwards.
fn abandoned(
    station: &Station,
    server: &mut Server,
    world: &mut Stream,
    settings: EpisodeSettings,
) -> Result<EpisodeSettings> {
    let watch = Deadline::new(WATCH, "answer_seconds");
    if world.next(&watch).is_ok() {
        return Err(Error::of(
            ErrorKind::Configuration,
            format!(
                "{station} is stepped by another client; end that one, or set `port` to that of another server"
            ),
        ));
    }
    let request = server.tick()?;
    let (_, body) = world.next(&station.settings().answering())?;
    let ids: Vec<u32> = snapshot::actors(body).map(|(id, _)| id).collect();
    server.ticked(request)?;
    let actors = server.actors(&ids)?;
    let ours = actors.iter().map(Actor).filter(|actor| actor.role() == ROLE);
    let mut left: Vec<u32> = ours.flat_map(|actor| [actor.id(), actor.parent()]).flatten().collect();
    // What is fixed to a vehicle goes first.
    left.sort_unstable_by(|a, b| b.cmp(a));
    left.dedup();
    for actor in left {
        match server.destroy(actor) {
            // It has gone meanwhile.
            Err(error) if error.kind() != ErrorKind::Failed => return Err(error),
            _ => {}
        }
    }
    let free = settings.free();
    server.set_episode_settings(&free)?;
    Ok(free)
}

fn not_started() -> Error {
    Error::new("it has no scenario yet: call reset first")
}
