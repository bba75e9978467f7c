//! Where pdk meets a program: a bus of its own, and the services beside its topics.
//!
//! The folder of the bus is what the program opens. It holds the configuration for iceoryx2, and a lock that is held for as long as pdk is
//! there.

use std::path::Path;
use std::time::Duration;

use iceoryx2::config::Config;
use iceoryx2::node::{Node, NodeBuilder};
use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::prelude::{FilePath, PortFactory as _, SemanticString, ServiceName, SignalHandlingMode};
use iceoryx2::service::ipc_threadsafe::Service;
use iceoryx2::service::port_factory::event::PortFactory;
use pdk_adapter::Deadline;
use pdk_adapter::process::{Launch, Launched, command_line};
use pdk_bus::Bus;
use pdk_sdk::prelude::*;

/// How long a wait lasts before it is looked whether the program is still there.
pub const LOOK: Duration = Duration::from_millis(50);

/// How often the first message is sent, until it has been answered: a program that comes late has not seen it.
pub const AGAIN: Duration = Duration::from_millis(100);

/// A bus with a node for further services.
pub struct Room {
    pub node: Node<Service>,
    // Last, so that everything in it is closed when it takes its files away.
    pub bus: Bus,
}

impl Room {
    /// Makes a bus for frames of this size. `name` is that of the folder in which its folder is found.
    ///
    /// # Errors
    /// If shared memory cannot be used.
    pub fn new(name: &str, width: usize, height: usize) -> Result<Self> {
        // There is one in a process; the number tells those of other processes apart.
        let bus = Bus::create(name, std::process::id(), width as u32, height as u32)
            .map_err(|error| failed(&error))?;
        let file = bus.root().join("iceoryx2.toml");
        let path = FilePath::new(file.as_os_str().as_encoded_bytes()).map_err(|error| failed(&error))?;
        let config = Config::from_file(&path).map_err(|error| failed(&error))?;
        let node = NodeBuilder::new()
            .config(&config)
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<Service>()
            .map_err(|error| failed(&error))?;
        Ok(Self { node, bus })
    }

    /// The folder that the program opens.
    pub fn folder(&self) -> &Path {
        self.bus.root()
    }

    /// Starts the program of a command, which finds the room by a variable; nothing if the command is empty.
    ///
    /// # Errors
    /// If there is no such program.
    pub fn launch(&self, what: &'static str, command: &[String]) -> Result<Option<Launched>> {
        if command.is_empty() {
            return Ok(None);
        }
        let folder = self.folder().to_string_lossy();
        let environment = [("PDK_EXCHANGE", folder.as_ref())];
        let launch = Launch { what, parameter: "command", words: command, environment: &environment };
        Launched::start(&launch).map(Some)
    }

    /// Tells the program that there is something new.
    ///
    /// # Errors
    /// If shared memory cannot be used.
    pub fn bell(&self, name: &str) -> Result<Bell> {
        let service = self.node.service_builder(&named(name)?).event().create();
        let service = service.map_err(|error| failed(&error))?;
        let notifier = service.notifier_builder().create().map_err(|error| failed(&error))?;
        Ok(Bell { notifier, service })
    }

    /// Hears that the program has something new.
    ///
    /// # Errors
    /// If shared memory cannot be used.
    pub fn listener(&self, name: &str) -> Result<Listener<Service>> {
        let service = self.node.service_builder(&named(name)?).event().create();
        service.map_err(|error| failed(&error))?.listener_builder().create().map_err(|error| failed(&error))
    }
}

/// What the program listens to.
pub struct Bell {
    notifier: Notifier<Service>,
    service: PortFactory<Service>,
}

impl Bell {
    /// Notifies the listeners.
    pub fn ring(&self) {
        // If there is no listener yet, the next one looks for itself first.
        let _ = self.notifier.notify();
    }

    /// Whether there is a listener.
    pub fn is_heard(&self) -> bool {
        self.service.dynamic_config().number_of_listeners() > 0
    }
}

/// The name of a room: that of an exchange for programs that run already, or one of this process alone.
pub fn room_name(what: &str, exchange: &str, command: &[String]) -> String {
    match command.is_empty() {
        true => format!("{what}-{exchange}"),
        false => format!("{what}-{}", std::process::id()),
    }
}

/// What users call the program.
pub fn who(what: &str, exchange: &str, command: &[String]) -> String {
    match command.is_empty() {
        false => format!("the {what} `{}`", command_line(command)),
        true => format!("the {what} of the exchange `{exchange}`"),
    }
}

/// The error if the time is over and no program is at an exchange, so that waiting longer would not help.
pub fn absent(what: &str, exchange: &str, deadline: &Deadline) -> Error {
    Error::of(
        ErrorKind::Late,
        format!(
            "no {what} is at the exchange `{exchange}`, which was waited for {:.1} s; start one, in Python with pdk_{what}.serve(..., \
             exchange=\"{exchange}\"), or let pdk start it with `command`",
            deadline.elapsed().as_secs_f64()
        ),
    )
}

/// The name of a service.
///
/// # Errors
/// If it cannot be one.
pub fn named(name: &str) -> Result<ServiceName> {
    ServiceName::new(name).map_err(|error| failed(&error))
}

/// What went wrong between pdk and the program.
pub fn failed(error: &dyn std::fmt::Display) -> Error {
    Error::new(format!("the exchange with the program failed: {error}"))
}
