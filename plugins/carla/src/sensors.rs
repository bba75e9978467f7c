//! What is fixed to the vehicle: its cameras, and what tells that it hits something.

use std::time::Duration;

use pdk_adapter::{Deadline, Station};
use pdk_sdk::prelude::{Annotations, Error, ErrorKind, FrameMut, Result};
use rmpv::Value;

use crate::annotation;
use crate::axes::Transform;
use crate::blueprint::{Actor, Blueprints, ROLE};
use crate::camera::Camera;
use crate::collisions::Collisions;
use crate::options::Options;
use crate::server::{Server, Version};
use crate::stream::Token;
use crate::value::{element, text};

/// The camera that the driver sees through.
const CAMERA: &str = "sensor.camera.rgb";
/// A subscription that was renewed is given so long to reach the server.
const RENEWED: Duration = Duration::from_millis(100);

/// The streams of everything that a vehicle senses.
#[derive(Debug)]
pub struct Sensors {
    version: Version,
    size: [u32; 2],
    camera: Camera,
    labels: Option<Camera>,
    depth: Option<Camera>,
    collisions: Collisions,
}

impl Sensors {
    /// Fixes the sensors to a vehicle and subscribes to what they see.
    ///
    /// # Errors
    /// If one cannot be had.
    pub fn mount(
        station: &mut Station,
        server: &mut Server,
        kinds: &Blueprints,
        options: &Options,
        vehicle: u32,
        deadline: &Deadline,
    ) -> Result<Self> {
        if let Some((name, _)) = options.camera_attributes.iter().find(|(name, _)| !kinds.has(CAMERA, name)) {
            return Err(Error::of(
                ErrorKind::Configuration,
                format!(
                    "`camera_attributes` says `{name}`, but the camera of CARLA {} has no such attribute",
                    server.version()
                ),
            ));
        }
        let size = [options.mount.camera.width, options.mount.camera.height];
        let mut camera = |kind: &str| {
            let description = kinds.describe(kind, &attributes(options))?;
            let camera = server.spawn_on(description, place(options), vehicle)?;
            let token = server.token(stream_of(&camera)?)?;
            Camera::subscribe(station, token, size, deadline)
        };
        let Annotations { labels, depth } = options.annotations;
        let (seen, labels, depth) = (
            camera(CAMERA)?,
            labels.then(|| camera(annotation::LABELS)).transpose()?,
            depth.then(|| camera(annotation::DEPTH)).transpose()?,
        );
        let description = kinds.describe("sensor.other.collision", &[("role_name", ROLE.to_owned())])?;
        let collisions = server.spawn_on(description, Transform::default(), vehicle)?;
        let token = server.token(stream_of(&collisions)?)?;
        let collisions = Collisions::subscribe(station, token, deadline)?;
        Ok(Self { version: server.version(), size, camera: seen, labels, depth, collisions })
    }

    fn cameras(&mut self) -> impl Iterator<Item = &mut Camera> {
        std::iter::once(&mut self.camera).chain(&mut self.labels).chain(&mut self.depth)
    }

    /// Keeps the streams: whether all of them still stand.
    ///
    /// # Errors
    /// If one that is to be renewed cannot be.
    pub fn keep(&mut self, station: &mut Station, deadline: &Deadline) -> Result<bool> {
        if !self.cameras().all(|camera| camera.stream().is_open()) || !self.collisions.is_open() {
            return Ok(false);
        }
        self.collisions.renew(station, deadline)?;
        Ok(true)
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
        let size = self.size;
        for camera in self.cameras() {
            let token = server.token(camera.stream().token())?;
            *camera = Camera::subscribe(station, token, size, deadline)?;
        }
        let token = server.token(self.collisions.token())?;
        self.collisions = Collisions::subscribe(station, token, deadline)?;
        // The server does not say when it has taken a subscription.
        std::thread::sleep(RENEWED);
        Ok(())
    }

    /// Waits until all cameras have sent the frame of this number.
    ///
    /// # Errors
    /// If one does not, or sends another one.
    pub fn look(&mut self, frame: u64, deadline: &Deadline) -> Result<()> {
        self.cameras().try_for_each(|camera| camera.look(frame, deadline))
    }

    /// Whether the vehicle has hit something since this was asked last.
    ///
    /// # Errors
    /// If the stream ends, or brings something else.
    pub fn collided(&mut self, deadline: &Deadline) -> Result<bool> {
        self.collisions.look(deadline)
    }

    /// Writes the latest frame.
    ///
    /// # Errors
    /// If it is of another size.
    pub fn write(&self, into: FrameMut<'_>) -> Result<()> {
        self.camera.write(into)
    }

    /// Writes what the pixels of the latest frame show.
    ///
    /// # Errors
    /// If this was not asked for before the scenario, or another number of pixels is asked for.
    pub fn labels(&self, into: &mut [u8]) -> Result<()> {
        let camera = self.labels.as_ref().ok_or_else(unasked)?;
        annotation::labels(camera.pixels(), self.version, into)
    }

    /// Writes how far away the pixels of the latest frame are, in metres.
    ///
    /// # Errors
    /// As for labels.
    pub fn depth(&self, into: &mut [f32]) -> Result<()> {
        let camera = self.depth.as_ref().ok_or_else(unasked)?;
        annotation::depth(camera.pixels(), into)
    }
}

/// Where the cameras are on the vehicle.
fn place(options: &Options) -> Transform {
    Transform {
        location: [options.mount.ahead, 0.0, options.mount.height],
        rotation: [-options.mount.pitch, 0.0, 0.0],
    }
}

/// What is set about the cameras. What one of them does not have is left out for it, such as the exposure of one that sees distances.
fn attributes(options: &Options) -> Vec<(&str, String)> {
    let own = [
        ("image_size_x", options.mount.camera.width.to_string()),
        ("image_size_y", options.mount.camera.height.to_string()),
        ("fov", options.mount.field_of_view.to_string()),
        // A frame of the camera for each of the simulator's.
        ("sensor_tick", "0.0".to_owned()),
        ("role_name", ROLE.to_owned()),
    ];
    let further = options.camera_attributes.iter().map(|(name, value)| (name.as_str(), value.clone()));
    own.into_iter().chain(further).collect()
}

fn unasked() -> Error {
    Error::new("it has no camera for this; request what is needed besides frames before `reset`")
}

fn stream_of(actor: &Value) -> Result<Token> {
    Actor(actor).stream().ok_or_else(|| {
        let kind = text(element(element(actor, 2), 1));
        Error::of(ErrorKind::Nonsense, format!("the server has spawned `{kind}` without a stream"))
    })
}
