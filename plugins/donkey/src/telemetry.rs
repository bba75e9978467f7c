//! What the simulator tells about a car on the road.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use crate::menu;
use crate::message::{Message, Number};
use crate::options::{Build, Options};

/// What is taken from telemetry.
pub struct Telemetry {
    pub build: Option<Build>,
    pub speed: f64,
    pub cross_track_error: Option<f64>,
    pub position: Option<[f64; 3]>,
    pub heading: Option<f64>,
    pub time: Option<f64>,
    pub hit: bool,
    pub done: Option<bool>,
    pub nodes: Option<(f64, f64)>,
}

/// What a message says to a car on the road.
pub enum Heard {
    Telemetry(Telemetry),
    Menu,
    NoPicture(String),
    Nothing,
}

/// Takes what is of use from a message, and the encoded picture.
pub fn take(message: &Message<'_>, options: &Options, picture: &mut Vec<u8>) -> Heard {
    match message.msg_type.as_ref() {
        "telemetry" => {}
        "scene_selection_ready" => return Heard::Menu,
        _ => return Heard::Nothing,
    }
    let Some(image) = &message.image else { return Heard::NoPicture("there is none".to_owned()) };
    picture.clear();
    if let Err(error) = STANDARD.decode_vec(image.as_bytes(), picture) {
        return Heard::NoPicture(error.to_string());
    }
    let number = |number: Option<Number>| number.map(|Number(value)| value);
    let scale = options.build.scale();
    let position = match (message.pos_x, message.pos_y, message.pos_z) {
        (Some(Number(x)), Some(Number(y)), Some(Number(z))) => Some([x, y, z].map(|axis| axis * scale)),
        _ => None,
    };
    Heard::Telemetry(Telemetry {
        build: menu::build(message),
        speed: number(message.speed).unwrap_or(f64::NAN) * scale,
        cross_track_error: number(message.cte),
        position,
        heading: number(message.yaw).map(f64::to_radians),
        time: number(message.time),
        hit: message.hit.as_ref().is_some_and(|hit| hit != "none" && !hit.is_empty()),
        done: message.done,
        nodes: number(message.active_node).zip(number(message.total_nodes)),
    })
}
