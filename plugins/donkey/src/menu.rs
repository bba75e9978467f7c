//! From a new connection to a car on the road.

use pdk_adapter::{Deadline, Station};
use pdk_sdk::prelude::*;

use crate::message::Message;
use crate::options::{Build, Options};
use crate::wire::Wire;

/// What a message tells while a car is waited for.
enum Said {
    /// The menu is shown.
    Menu,
    /// These scenes can be loaded.
    Scenes(Vec<String>),
    /// The version of the protocol.
    Version(String),
    /// The car is on the road.
    Car,
    /// The car's looks are asked for.
    Looks,
    /// The car drives already, in this build.
    Telemetry(Option<Build>),
    /// Nothing of use.
    Nothing,
}

/// Connects, and leads the simulator to a car on the road, with the camera and the looks that are wanted. Returns the version of its
/// protocol with it; empty if it does not tell.
///
/// # Errors
/// If it is not there, is another build, or has no such scene.
pub fn open(station: Station, options: &Options) -> Result<(Wire, String)> {
    let starting = options.settings.starting();
    let mut wire = Wire::open(station, &starting)?;
    let mut version = String::new();
    let led = match options.build {
        Build::Current => choose_scene(&mut wire, options, &starting, &mut version),
        Build::RoadGenerating => await_car(&mut wire, options, &starting),
    };
    // A simulator speaks first. What has said nothing at all may be something else.
    led.map_err(|error| if wire.has_spoken() { error } else { wire.station.unknown(error) })?;
    let answering = options.settings.answering();
    wire.send("car_config", &options.car_fields, &answering)?;
    wire.send("cam_config", &options.camera_fields, &answering)?;
    Ok((wire, version))
}

fn choose_scene(wire: &mut Wire, options: &Options, deadline: &Deadline, version: &mut String) -> Result<()> {
    let mut chosen = false;
    let mut left = false;
    loop {
        match wire.next(deadline, "shown its menu of scenes", said)? {
            Said::Menu => {
                wire.send("get_protocol_version", &[], deadline)?;
                wire.send("get_scene_names", &[], deadline)?;
            }
            Said::Version(said) => *version = said,
            Said::Scenes(scenes) if scenes.contains(&options.scene) => {
                wire.send("load_scene", &[("scene_name", options.scene.clone())], deadline)?;
                chosen = true;
            }
            Said::Scenes(scenes) => {
                return Err(mistake(format!(
                    "{} has no scene `{}`; it has {}: set `scene` to one of them",
                    wire.station,
                    options.scene,
                    scenes.join(", ")
                )));
            }
            Said::Car if chosen => return Ok(()),
            // Another client has chosen a scene before.
            Said::Car if !left => {
                wire.send("exit_scene", &[], deadline)?;
                left = true;
            }
            Said::Looks => wire.send("car_config", &options.car_fields, deadline)?,
            Said::Telemetry(Some(Build::RoadGenerating)) => return Err(other_build(wire, options.build)),
            Said::Car | Said::Telemetry(_) | Said::Nothing => {}
        }
    }
}

fn await_car(wire: &mut Wire, options: &Options, deadline: &Deadline) -> Result<()> {
    loop {
        match wire.next(deadline, "loaded its scene", said)? {
            Said::Car | Said::Telemetry(Some(Build::RoadGenerating)) => return Ok(()),
            Said::Menu | Said::Scenes(_) | Said::Telemetry(Some(Build::Current)) => {
                return Err(other_build(wire, options.build));
            }
            Said::Looks => wire.send("car_config", &options.car_fields, deadline)?,
            Said::Version(_) | Said::Telemetry(None) | Said::Nothing => {}
        }
    }
}

/// The error where the simulator is another build than this one, which the user has set.
pub fn other_build(wire: &Wire, build: Build) -> Error {
    let [current, road_generating] = Build::NAMES;
    let other = match build {
        Build::Current => road_generating,
        Build::RoadGenerating => current,
    };
    mistake(format!("{} is another build than `build` says; set build={other}", wire.station))
}

fn said(message: &Message<'_>) -> Said {
    match message.msg_type.as_ref() {
        "scene_selection_ready" => Said::Menu,
        "scene_names" => Said::Scenes(message.scene_names.clone()),
        "protocol_version" => Said::Version(message.version.clone().unwrap_or_default()),
        "car_loaded" => Said::Car,
        "need_car_config" => Said::Looks,
        "telemetry" => Said::Telemetry(build(message)),
        _ => Said::Nothing,
    }
}

/// The build that sends such telemetry; none if it does not show.
pub fn build(message: &Message<'_>) -> Option<Build> {
    match (message.max_sector, message.total_nodes) {
        (Some(_), None) => Some(Build::RoadGenerating),
        (None, Some(_)) => Some(Build::Current),
        _ => None,
    }
}

fn mistake(sentence: String) -> Error {
    Error::of(ErrorKind::Configuration, sentence)
}
