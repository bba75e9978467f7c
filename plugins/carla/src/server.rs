//! The requests of CARLA's server that the adapter makes.

use std::fmt;
use std::str::FromStr;
use std::time::Duration;

use pdk_adapter::Deadline;
use pdk_adapter::{Connection, Settings, Station};
use pdk_sdk::prelude::{Control, Error, ErrorKind, Result};
use rmpv::Value;

use crate::axes::Transform;
use crate::blueprint::{Actor, Blueprints};
use crate::rpc::{LONGEST, Rpc, request};
use crate::stream::Token;
use crate::value::{array, bytes, element, elements, float, id, number, text, vector};
use crate::will::Will;

/// The name of a map that the server generates from a road. It has only the latest one.
pub const GENERATED: &str = "OpenDriveMap";
/// All layers of a map.
const ALL_LAYERS: u32 = 65_535;
/// How CARLA makes the ground of an OpenDRIVE map: a point every metre, pieces of 50 m, no walls at the edges of the road, which would
/// turn a departure from the lane into a collision, 0.6 m of additional width, smooth, visible, with ways for pedestrians.
const GROUND: [f64; 4] = [1.0, 50.0, 0.0, 0.6];

const DESTROY: &str = "destroy_actor";
const SET_SETTINGS: &str = "set_episode_settings";
const SET_WEATHER: &str = "set_weather_parameters";

/// The version of a server.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Version([u32; 3]);

impl Version {
    /// The versions that the adapter speaks, first and last.
    pub const SPOKEN: [Self; 2] = [Self([0, 9, 13]), Self([0, 9, 16])];

    /// Since then a sensor's token has to be asked for.
    const TOKENS: Self = Self([0, 9, 14]);
    /// Since then what pixels show has the tags of Cityscapes.
    pub const CITYSCAPES: Self = Self([0, 9, 14]);
    /// Since then an actor can be fixed to a named place of another.
    const SOCKETS: Self = Self([0, 9, 16]);
}

impl fmt::Display for Version {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self([a, b, c]) = self;
        write!(f, "{a}.{b}.{c}")
    }
}

impl FromStr for Version {
    type Err = ();

    /// What comes behind the third number, as in `0.9.15-dirty`, does not matter.
    fn from_str(text: &str) -> Result<Self, ()> {
        let mut parts = text.splitn(3, '.').map(|part| {
            let digits = part.find(|c: char| !c.is_ascii_digit()).unwrap_or(part.len());
            part[..digits].parse().map_err(|_| ())
        });
        let mut next = || parts.next().ok_or(())?;
        Ok(Self([next()?, next()?, next()?]))
    }
}

/// A server that speaks one of these versions.
#[derive(Debug)]
pub struct Server {
    rpc: Rpc,
    version: Version,
    settings: Settings,
    /// What was spawned and not taken away yet, in that order.
    actors: Vec<u32>,
    /// What is put back in the end.
    found: Option<(EpisodeSettings, Vec<f64>)>,
    will: Will,
}

impl Server {
    /// Connects to the server of a station and asks for its version.
    ///
    /// # Errors
    /// If it is not there, is no CARLA, or another version than those that the adapter speaks.
    pub fn open(station: &mut Station, deadline: &Deadline) -> Result<Self> {
        let socket = station.connect(0, deadline)?;
        let settings = station.settings().clone();
        let mut rpc = Rpc::new(Connection::new(socket, station.to_string(), LONGEST)?);
        // The port of a server's streams says nothing either.
        let answer =
            rpc.call("version", Vec::new(), &settings.answering()).map_err(|error| station.unknown(error))?;
        let [first, last] = Version::SPOKEN;
        match text(&answer).parse() {
            Ok(version) if (first..=last).contains(&version) => {
                let will = Will::new(&station.connect(0, deadline)?)?;
                Ok(Self { rpc, version, settings, actors: Vec::new(), found: None, will })
            }
            _ => Err(Error::of(
                ErrorKind::Configuration,
                format!(
                    "{station} has version {answer}, but the adapter speaks {first} to {last}; start one of these"
                ),
            )),
        }
    }

    /// Its version.
    pub fn version(&self) -> Version {
        self.version
    }

    /// Whether the connection still stands.
    pub fn is_open(&mut self) -> bool {
        self.rpc.is_open()
    }

    /// These settings and this weather are to be put back in the end, however that comes.
    ///
    /// # Errors
    /// If that cannot be arranged.
    pub fn keep(&mut self, settings: EpisodeSettings, weather: Vec<f64>) -> Result<()> {
        self.found = Some((settings, weather));
        self.arrange()
    }

    /// The weather that is put back in the end.
    pub fn kept_weather(&self) -> &[f64] {
        self.found.as_ref().map_or(&[], |(_, weather)| weather)
    }

    /// Takes leave: takes away what was spawned and puts back what was found. No answer may take longer than `limit`. To a server that
    /// does not answer, or whose connection is of no use any more, the will says all of it: one that only hangs reads it later.
    pub fn leave(mut self, limit: Duration) {
        self.settings.answer = self.settings.answer.min(limit);
        let left = self.clear().and_then(|()| self.put_back());
        let Self { rpc, will, .. } = self;
        match left {
            Err(error) if error.kind() != ErrorKind::Failed => will.speak(),
            _ => drop(will),
        }
        rpc.close();
    }

    /// Puts back the weather and the settings that were found.
    fn put_back(&mut self) -> Result<()> {
        let Some((settings, weather)) = self.found.take() else { return Ok(()) };
        match self.set_weather(&weather) {
            // Settings are put back all the same.
            Err(error) if error.kind() != ErrorKind::Failed => return Err(error),
            _ => {}
        }
        self.set_episode_settings(&settings.restored())
    }

    /// Takes away everything that was spawned; what is fixed to another one goes first.
    ///
    /// # Errors
    /// If the server is gone or late; an actor that it does not know any more is taken away already.
    pub fn clear(&mut self) -> Result<()> {
        while let Some(actor) = self.actors.last() {
            match self.destroy(*actor) {
                Err(error) if error.kind() != ErrorKind::Failed => return Err(error),
                _ => self.actors.pop(),
            };
        }
        self.arrange()
    }

    /// Nothing is there any more that was spawned: another map has been loaded.
    ///
    /// # Errors
    /// If what is put back cannot be arranged.
    pub fn forget(&mut self) -> Result<()> {
        self.actors.clear();
        self.arrange()
    }

    /// Arranges the requests that are sent if this process is ended from outside.
    fn arrange(&mut self) -> Result<()> {
        let mut words = Vec::new();
        for (number, actor) in (0..).zip(self.actors.iter().rev()) {
            words.extend(request(number, DESTROY, false, vec![(*actor).into()]));
        }
        if let Some((settings, weather)) = &self.found {
            words.extend(request(u32::MAX - 1, SET_WEATHER, false, vec![weather_value(weather)]));
            words.extend(request(u32::MAX, SET_SETTINGS, false, vec![array(settings.restored().0)]));
        }
        self.will.write(&words)
    }

    /// Notes what was spawned.
    fn spawned(&mut self, actor: Value) -> Result<Value> {
        let id = self.id_of(&actor)?;
        self.actors.push(id);
        self.arrange()?;
        Ok(actor)
    }

    fn call(&mut self, name: &str, arguments: Vec<Value>) -> Result<Value> {
        self.rpc.call(name, arguments, &self.settings.answering())
    }

    /// An answer that is not what it should be.
    fn strange(&self, name: &str) -> Error {
        Error::of(
            ErrorKind::Nonsense,
            format!("{} answers `{name}` with what CARLA {} does not", self.rpc.peer(), self.version),
        )
    }

    /// The number of the episode, and the stream of the world's state.
    pub fn episode(&mut self) -> Result<(u64, Token)> {
        const NAME: &str = "get_episode_info";
        let answer = self.call(NAME, Vec::new())?;
        let number = element(&answer, 0).as_u64();
        let token = Token::read(bytes(element(element(&answer, 1), 0)));
        number.zip(token).ok_or_else(|| self.strange(NAME))
    }

    /// The token with which a stream is to be had.
    pub fn token(&mut self, token: Token) -> Result<Token> {
        const NAME: &str = "get_sensor_token";
        if self.version < Version::TOKENS {
            return Ok(token);
        }
        let answer = self.call(NAME, vec![token.stream.into()])?;
        Token::read(bytes(element(&answer, 0))).ok_or_else(|| self.strange(NAME))
    }

    /// The settings of the episode.
    pub fn episode_settings(&mut self) -> Result<EpisodeSettings> {
        const NAME: &str = "get_episode_settings";
        let answer = self.call(NAME, Vec::new())?;
        match answer {
            Value::Array(values) if values.len() >= 6 => Ok(EpisodeSettings(values)),
            _ => Err(self.strange(NAME)),
        }
    }

    /// Sets them.
    pub fn set_episode_settings(&mut self, settings: &EpisodeSettings) -> Result<()> {
        self.call(SET_SETTINGS, vec![array(settings.0.clone())]).map(drop)
    }

    /// Asks for the next frame; its number comes with [`Server::ticked`].
    pub fn tick(&mut self) -> Result<u32> {
        self.rpc.send("tick_cue", Vec::new(), &self.settings.answering())
    }

    /// The number of the frame that was asked for.
    pub fn ticked(&mut self, request: u32) -> Result<u64> {
        const NAME: &str = "tick_cue";
        let answer = self.rpc.answer(request, NAME, &self.settings.answering())?;
        answer.as_u64().ok_or_else(|| self.strange(NAME))
    }

    /// The names of the maps, without their folders.
    pub fn maps(&mut self) -> Result<Vec<String>> {
        let answer = self.call("get_available_maps", Vec::new())?;
        Ok(elements(&answer).iter().map(|name| last_part(text(name)).to_owned()).collect())
    }

    /// The name of the map that is loaded, and the places where it recommends to start.
    pub fn map(&mut self) -> Result<(String, Vec<Transform>)> {
        let answer = self.call("get_map_info", Vec::new())?;
        let three = |value: &Value| [0, 1, 2].map(|i| number(element(value, i)).unwrap_or_default());
        let places = elements(element(&answer, 1)).iter();
        let places = places.map(|place| Transform {
            location: three(element(place, 0)),
            rotation: three(element(place, 1)),
        });
        Ok((last_part(text(element(&answer, 0))).to_owned(), places.collect()))
    }

    /// The map that is loaded, as OpenDRIVE.
    pub fn map_document(&mut self) -> Result<String> {
        let answer = self.call("get_map_data", Vec::new())?;
        Ok(text(&answer).to_owned())
    }

    /// Begins to load a map.
    pub fn load(&mut self, map: &str) -> Result<()> {
        self.call("load_new_episode", vec![map.into(), true.into(), ALL_LAYERS.into()]).map(drop)
    }

    /// Begins to load a map that is given as OpenDRIVE.
    pub fn load_document(&mut self, document: &str) -> Result<()> {
        let mut parameters: Vec<Value> = GROUND.map(Value::F64).to_vec();
        parameters.extend([true.into(), true.into(), true.into()]);
        self.call("copy_opendrive_to_file", vec![document.into(), array(parameters)])?;
        self.load(GENERATED)
    }

    /// Everything that can be spawned.
    pub fn blueprints(&mut self) -> Result<Blueprints> {
        self.call("get_actor_definitions", Vec::new()).map(Blueprints::new)
    }

    /// Spawns an actor, which comes back.
    pub fn spawn(&mut self, description: Value, at: Transform) -> Result<Value> {
        let actor = self.call("spawn_actor", vec![description, at.value()])?;
        self.spawned(actor)
    }

    /// Spawns an actor that is fixed to another one.
    pub fn spawn_on(&mut self, description: Value, at: Transform, parent: u32) -> Result<Value> {
        let mut arguments = vec![description, at.value(), parent.into(), 0.into()];
        if self.version >= Version::SOCKETS {
            arguments.push("".into());
        }
        let actor = self.call("spawn_actor_with_parent", arguments)?;
        self.spawned(actor)
    }

    /// Takes an actor away.
    pub fn destroy(&mut self, actor: u32) -> Result<()> {
        self.call(DESTROY, vec![actor.into()]).map(drop)
    }

    /// Actors by their numbers.
    pub fn actors(&mut self, ids: &[u32]) -> Result<Vec<Value>> {
        let ids: Vec<Value> = ids.iter().map(|&id| id.into()).collect();
        let answer = self.call("get_actors_by_id", vec![array(ids)])?;
        match answer {
            Value::Array(actors) => Ok(actors),
            _ => Err(self.strange("get_actors_by_id")),
        }
    }

    /// Controls a vehicle.
    pub fn control(&mut self, vehicle: u32, pedals: Pedals) -> Result<()> {
        self.call("apply_control_to_vehicle", control_arguments(vehicle, pedals)).map(drop)
    }

    /// Gives a vehicle a velocity, in CARLA's axes in metres per second.
    pub fn set_velocity(&mut self, vehicle: u32, velocity: [f64; 3]) -> Result<()> {
        self.call("set_actor_target_velocity", vec![vehicle.into(), vector(velocity)]).map(drop)
    }

    /// Lets an actor move by itself or not.
    pub fn set_physics(&mut self, actor: u32, moves: bool) -> Result<()> {
        self.call("set_actor_simulate_physics", vec![actor.into(), moves.into()]).map(drop)
    }

    /// Puts actors somewhere, all in one go.
    pub fn place(&mut self, actors: &[(u32, Transform)]) -> Result<()> {
        const NAME: &str = "set_actor_transform";
        let deadline = self.settings.answering();
        let mut sent = Vec::with_capacity(actors.len());
        for (actor, at) in actors {
            sent.push(self.rpc.send(NAME, vec![(*actor).into(), at.value()], &deadline)?);
        }
        sent.into_iter().try_for_each(|number| self.rpc.answer(number, NAME, &deadline).map(drop))
    }

    /// The numbers of the weather.
    pub fn weather(&mut self) -> Result<Vec<f64>> {
        const NAME: &str = "get_weather_parameters";
        let answer = self.call(NAME, Vec::new())?;
        let numbers: Option<Vec<f64>> = elements(&answer).iter().map(number).collect();
        numbers.filter(|numbers| numbers.len() >= 13).ok_or_else(|| self.strange(NAME))
    }

    /// Sets them.
    pub fn set_weather(&mut self, numbers: &[f64]) -> Result<()> {
        self.call(SET_WEATHER, vec![weather_value(numbers)]).map(drop)
    }

    /// The number of an actor that was spawned.
    pub fn id_of(&self, actor: &Value) -> Result<u32> {
        Actor(actor).id().ok_or_else(|| self.strange("spawn_actor"))
    }
}

/// What a vehicle's pedals and wheel do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pedals {
    /// 0 to 1.
    pub throttle: f64,
    /// -1 (left) to 1 (right).
    pub steer: f64,
    /// 0 to 1.
    pub brake: f64,
    /// Whether the hand brake is on.
    pub hand_brake: bool,
}

impl Pedals {
    /// Standing still.
    pub const PARKED: Self = Self { throttle: 0.0, steer: 0.0, brake: 1.0, hand_brake: true };

    /// What a driver's control means.
    pub fn of(control: Control) -> Self {
        Self {
            throttle: control.throttle.max(0.0),
            steer: control.steering,
            brake: (-control.throttle).max(0.0),
            hand_brake: false,
        }
    }
}

fn control_arguments(vehicle: u32, pedals: Pedals) -> Vec<Value> {
    let Pedals { throttle, steer, brake, hand_brake } = pedals;
    let numbers = [throttle, steer, brake].map(float);
    let rest = [hand_brake.into(), false.into(), false.into(), 0.into()];
    vec![vehicle.into(), Value::Array(numbers.into_iter().chain(rest).collect())]
}

fn weather_value(numbers: &[f64]) -> Value {
    Value::Array(numbers.iter().map(|&number| float(number)).collect())
}

/// The settings of an episode, as many as the server has.
#[derive(Debug, Clone, PartialEq)]
pub struct EpisodeSettings(Vec<Value>);

impl EpisodeSettings {
    /// Whether the server waits for its clients.
    pub fn is_synchronous(&self) -> bool {
        self.0[0].as_bool() == Some(true)
    }

    /// The same, with the types that CARLA's own client uses: some come as 32 bits and go back as 64.
    fn typed(&self) -> Self {
        let value = |(place, value): (usize, &Value)| match place {
            2 => match number(element(value, 1)) {
                Some(delta) => array([true.into(), Value::F64(delta)]),
                None => array([false.into()]),
            },
            4 => number(value).map_or_else(|| value.clone(), Value::F64),
            _ => value.clone(),
        };
        Self(self.0.iter().enumerate().map(value).collect())
    }

    /// The same, but the server waits for its clients, renders, and each of its frames lasts `1 / rate` seconds.
    pub fn stepped(&self, rate: f64) -> Self {
        let Self(mut values) = self.typed();
        let delta = 1.0 / rate;
        values[0] = true.into();
        values[1] = false.into();
        values[2] = array([true.into(), Value::F64(delta)]);
        // A frame has to fit into the steps of the physics.
        let (step, steps) = (number(&values[4]).unwrap_or(0.01), id(&values[5]).unwrap_or(10));
        if step * f64::from(steps) < delta {
            values[4] = Value::F64((delta / 16.0).max(step));
            values[5] = 16.into();
        }
        Self(values)
    }

    /// The same, but the server goes on by its own clock.
    pub fn free(&self) -> Self {
        let Self(mut values) = self.typed();
        values[0] = false.into();
        values[2] = array([false.into()]);
        Self(values)
    }

    /// The same value in the form that is sent back to the server.
    pub fn restored(&self) -> Self {
        self.typed()
    }
}

fn last_part(name: &str) -> &str {
    name.rsplit('/').next().unwrap_or(name)
}

#[cfg(test)]
#[path = "server_tests.rs"]
mod tests;
