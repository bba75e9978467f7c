//! What publisher and tap share: names, the quality of service, the node of this process, the clock.

use std::{fmt::Debug, sync::Once};

use iceoryx2::{
    config::Config,
    node::{Node, NodeBuilder, node_name::NodeName},
    port::{publisher::Publisher, subscriber::Subscriber},
    prelude::{
        FilePath, IceoryxSend, LogLevel, Path, SemanticString, ServiceName, SignalHandlingMode,
        set_log_level_from_env_or,
    },
    service::{
        builder::publish_subscribe::PublishSubscribeOpenError as OpenError, ipc_threadsafe,
        port_factory::publish_subscribe::PortFactory,
    },
};
use rustix::time::{ClockId, clock_gettime};

use crate::{
    base::BASE_VARIABLE,
    error::{Error, Result},
    message::{ControlMessage, FrameHeader, StateMessage, Topic},
    remedy::remedy,
};

/// Ports of this variant may move between threads; they speak with those of `ipc::Service` as well.
pub(crate) type Ipc = ipc_threadsafe::Service;
pub(crate) type TopicPublisher<P> = Publisher<Ipc, P, FrameHeader>;
pub(crate) type TopicSubscriber<P> = Subscriber<Ipc, P, FrameHeader>;

/// Subscribers per topic: the loop's own and seven taps.
pub(crate) const MAX_SUBSCRIBERS: usize = 8;
/// Messages that wait for a tap before it loses the oldest.
pub(crate) const QUEUE_LENGTH: usize = 8;
/// Frames that one subscriber may hold at the same time.
pub(crate) const MAX_HELD: usize = 2;
/// Frames per topic that the loop may have on loan at the same time.
pub(crate) const MAX_LOANS: usize = 2;

/// `pdk/<topic>`: the root says of which run and slot.
pub(crate) fn service_name(topic: Topic) -> Result<ServiceName> {
    ServiceName::new(&format!("pdk/{topic}")).map_err(|error| {
        Error::new(format!("topic `{topic}` cannot be named ({error}): report this as a defect"))
    })
}

/// The payload of a topic: `[u8]` or one of the fixed messages.
pub(crate) trait Payload: Debug + IceoryxSend + 'static {
    /// Creates the topic.
    fn create(node: &Node<Ipc>, name: &ServiceName) -> Result<TopicService<Self>>;

    /// Opens the topic; `None` if it is not there, or not there yet.
    fn open(node: &Node<Ipc>, name: &ServiceName) -> Result<Option<TopicService<Self>>>;
}

/// One topic, opened: makes its ports.
pub(crate) type TopicService<P> = PortFactory<Ipc, P, FrameHeader>;

// The builders of slices and of sized payloads are different types with the same methods.
macro_rules! payloads {
    ($($payload:ty),*) => {$(
        impl Payload for $payload {
            fn create(node: &Node<Ipc>, name: &ServiceName) -> Result<TopicService<Self>> {
                node.service_builder(name)
                    .publish_subscribe::<Self>()
                    .user_header::<FrameHeader>()
                    .max_publishers(1)
                    .max_subscribers(MAX_SUBSCRIBERS)
                    .max_nodes(MAX_SUBSCRIBERS + 4)
                    .subscriber_max_buffer_size(QUEUE_LENGTH)
                    .subscriber_max_borrowed_samples(MAX_HELD)
                    .history_size(0)
                    // The oldest message gives way: a slow tap never holds up the loop.
                    .enable_safe_overflow(true)
                    .create()
                    .map_err(|error| cannot_open(name, &error))
            }

            fn open(node: &Node<Ipc>, name: &ServiceName) -> Result<Option<TopicService<Self>>> {
                let opened = node
                    .service_builder(name)
                    .publish_subscribe::<Self>()
                    .user_header::<FrameHeader>()
                    .open();
                match opened {
                    Ok(service) => Ok(Some(service)),
                    // The last three pass by themselves: the topic is being made or removed right now.
                    Err(
                        OpenError::DoesNotExist
                        | OpenError::HangsInCreation
                        | OpenError::IsMarkedForDestruction
                        | OpenError::Interrupt,
                    ) => Ok(None),
                    Err(error) => Err(cannot_open(name, &error)),
                }
            }
        }
    )*};
}

payloads!([u8], ControlMessage, StateMessage);

fn cannot_open(name: &ServiceName, error: &dyn std::error::Error) -> Error {
    let reason = error.to_string();
    let remedy =
        if reason.contains("Incompatible") || reason.contains("DoesNotSupport") || reason.contains("Version")
        {
            "the process at the other end was built against another pdk-bus or iceoryx2, use the same version"
                .to_owned()
        } else if reason.contains("ExceedsMaxNumberOfNodes") {
            "too many processes use it, end some of the taps".to_owned()
        } else {
            remedy()
        };
    Error::new(format!("topic `{name}` cannot be opened ({reason}): {remedy}"))
}

/// What iceoryx2 adds to the root at the longest: `/`, the prefix, the hash of the type and the two ports of a
/// connection, with a suffix. It is a file in /dev/shm, but its path is made with the root and checked.
const ROOM_FOR_FILES: usize = 1 + 17 + 40 + 1 + 39 + 1 + 39 + ".connection".len();

/// Reads iceoryx2's configuration of a bus.
pub(crate) fn config(file: &std::path::Path) -> Result<Config> {
    // It reports most failures twice: as an error, which we word ourselves, and as a log line.
    static QUIET: Once = Once::new();
    QUIET.call_once(|| set_log_level_from_env_or(LogLevel::Fatal));
    let path = FilePath::new(file.as_os_str().as_encoded_bytes()).ok();
    let path = path.filter(|path| path.path().len() + ROOM_FOR_FILES <= Path::max_len()).ok_or_else(|| {
        Error::new(format!(
            "{} is too long or has unusual characters: name a shorter folder for the bus with {BASE_VARIABLE}, or \
             give the run a shorter id",
            file.display()
        ))
    })?;
    Config::from_file(&path).map_err(|error| {
        Error::new(format!(
            "{} cannot be read ({error}): start the run again, and the tap with the same version of pdk",
            file.display()
        ))
    })
}

/// Registers this process, which also clears up after taps that were killed.
pub(crate) fn create_node(name: &str, config: &Config) -> Result<Node<Ipc>> {
    let failed = |error: &dyn std::error::Error| {
        Error::new(format!(
            "the bus cannot register this process in {} ({error}): check that it can be written and has space; else {}",
            config.global.root_path(),
            remedy()
        ))
    };
    NodeBuilder::new()
        .name(&NodeName::new(name).map_err(|error| failed(&error))?)
        .config(config)
        // Ctrl-C belongs to the program, not to the bus.
        .signal_handling_mode(SignalHandlingMode::Disabled)
        .create::<Ipc>()
        .map_err(|error| failed(&error))
}

/// Nanoseconds of the monotonic clock: the same clock in every process of the machine.
pub fn monotonic_nanoseconds() -> u64 {
    let now = clock_gettime(ClockId::Monotonic);
    // Both parts are non-negative on this clock, and the sum lasts for 584 years of uptime.
    now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn the_clock_moves_forward() {
        let before = monotonic_nanoseconds();
        std::thread::sleep(Duration::from_millis(2));
        assert!(monotonic_nanoseconds() - before >= 2_000_000);
    }
}
