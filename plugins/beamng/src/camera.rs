//! The camera on the vehicle.
//!
//! A camera that the game updates by itself shows some frame of the past. So this one is never updated by itself: each frame is asked for when
//! the world stands still.

use std::time::Duration;

use pdk_adapter::picture::Order;
use pdk_adapter::{Deadline, Picture};
use pdk_sdk::prelude::{Error, ErrorKind, Result};
use rmpv::Value;

use crate::messages::{Messages, field};
use crate::options::Options;

/// Its name in the game.
pub const NAME: &str = "pdk_camera";
/// How often it is asked whether a frame is ready.
const TICK: Duration = Duration::from_millis(1);

/// The message that opens it. The vehicle faces towards its own -y.
pub fn opening(options: &Options, vehicle: &'static str) -> Vec<(&'static str, Value)> {
    let (width, height) = (options.mount.camera.width, options.mount.camera.height);
    let half =
        libm::tan(options.mount.field_of_view.to_radians() / 2.0) * f64::from(height) / f64::from(width);
    let pitch = options.mount.pitch.to_radians();
    let numbers = |numbers: &[f64]| Value::Array(numbers.iter().copied().map(Value::F64).collect());
    vec![
        ("vid", vehicle.into()),
        ("name", NAME.into()),
        // Negative: only when it is asked.
        ("updateTime", Value::F64(-1.0)),
        ("priority", Value::F64(1.0)),
        ("size", Value::Array(vec![width.into(), height.into()])),
        ("fovY", Value::F64(2.0 * libm::atan(half).to_degrees())),
        ("nearFarPlanes", numbers(&[0.05, 500.0])),
        ("pos", numbers(&[0.0, -options.mount.ahead, options.mount.height])),
        ("dir", numbers(&[0.0, -libm::cos(pitch), -libm::sin(pitch)])),
        ("up", numbers(&[0.0, -libm::sin(pitch), libm::cos(pitch)])),
        ("useSharedMemory", false.into()),
        ("colourShmemName", Value::Nil),
        ("colourShmemSize", (-1).into()),
        ("annotationShmemName", Value::Nil),
        ("annotationShmemSize", (-1).into()),
        ("depthShmemName", Value::Nil),
        ("depthShmemSize", (-1).into()),
        ("renderColours", true.into()),
        ("renderAnnotations", false.into()),
        ("renderInstance", false.into()),
        ("renderDepth", false.into()),
        ("renderTranslucentAsOpaqueDepth", false.into()),
        ("isVisualised", false.into()),
        ("isStreaming", false.into()),
        ("isStatic", false.into()),
        ("isSnappingDesired", false.into()),
        ("isForceInsideTriangle", false.into()),
        ("isDirWorldSpace", false.into()),
        ("integerDepth", true.into()),
    ]
}

/// What it sees now, in place of what it saw.
///
/// # Errors
/// If the game does not render a frame in time, or one of another size.
pub fn look(engine: &mut Messages, mut picture: Picture, deadline: &Deadline) -> Result<Picture> {
    const SEND: &str = "SendAdHocRequestCamera";
    let answer = engine.ask(SEND, vec![("name", NAME.into())], deadline)?;
    // All numbers of Lua are floating-point numbers.
    let Some(request) = field(&answer, "data").as_f64() else {
        return Err(engine.strange(SEND, &answer));
    };
    let request = || vec![("requestId", (request as u64).into())];
    while field(&engine.ask("IsAdHocPollRequestReadyCamera", request(), deadline)?, "data").as_bool()
        != Some(true)
    {
        if deadline.left().is_none() {
            return Err(deadline.late(engine.peer(), "rendered a camera frame"));
        }
        std::thread::sleep(TICK);
    }
    let answer = engine.ask("CollectAdHocPollRequestCamera", request(), deadline)?;
    let colours = match field(field(&answer, "data"), "colour") {
        Value::Binary(bytes) => bytes.as_slice(),
        Value::String(text) => text.as_bytes(),
        _ => &[],
    };
    let Some(order) =
        [Order::Rgba, Order::Rgb].into_iter().find(|order| picture.sent(*order) == colours.len())
    else {
        return Err(Error::of(
            ErrorKind::Nonsense,
            format!(
                "the camera of {} sends {} bytes for a frame, which has {} or {}; does the game run with low graphics settings?",
                engine.peer(),
                colours.len(),
                picture.sent(Order::Rgb),
                picture.sent(Order::Rgba)
            ),
        ));
    };
    picture.take(colours, order);
    Ok(picture)
}
