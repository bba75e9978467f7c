//! What publisher and tap share: names, the quality of service, the node of this process, the clock.

use std::{ffi::OsStr, fmt::Debug, sync::OnceLock, time::Duration};

use iceoryx2::{
    config::Config,
    node::{Node, NodeBuilder, NodeCreationFailure, NodeState, NodeView, node_name::NodeName},
    port::{publisher::Publisher, subscriber::Subscriber},
    prelude::{
        CallbackProgression, IceoryxSend, LogLevel, Path, SemanticString, ServiceName, SignalHandlingMode,
        set_log_level_from_env_or,
    },
    service::{
        builder::publish_subscribe::PublishSubscribeOpenError as OpenError, ipc_threadsafe,
        port_factory::publish_subscribe::PortFactory,
    },
};
use rustix::{
    fs::{Access, access},
    io::Errno,
    time::{ClockId, clock_gettime},
};

use crate::{
    error::{Error, Result},
    message::{ControlMessage, FrameHeader, StateMessage, Topic},
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

/// The first word of the node name of a publishing loop; the rest is run, lane and start time.
const PUBLISHER_NODE: &str = "pdk-run";
/// The run id that stands for the run that started last.
pub const LATEST: &str = "latest";
/// The longest run id: it has to fit into a node name beside lane and start time.
pub(crate) const MAX_RUN_ID: usize = 64;

/// `pdk/<run>/<lane>/<topic>`
pub(crate) fn service_name(run: &str, lane: u32, topic: Topic) -> Result<ServiceName> {
    check_run_id(run)?;
    ServiceName::new(&format!("pdk/{run}/{lane}/{topic}"))
        .map_err(|error| Error::new(format!("run id `{run}` cannot name a topic ({error}): choose another")))
}

/// Run and lane of a service name, if it is one of ours.
pub(crate) fn parse_service_name(name: &str) -> Option<(&str, u32, Topic)> {
    let mut parts = name.strip_prefix("pdk/")?.split('/');
    let parsed = (parts.next()?, parts.next()?.parse().ok()?, parts.next()?.parse().ok()?);
    parts.next().is_none().then_some(parsed)
}

fn check_run_id(run: &str) -> Result<()> {
    let allowed = |byte: u8| byte.is_ascii_alphanumeric() || b"-_.".contains(&byte);
    if run.is_empty() || run == LATEST || run.len() > MAX_RUN_ID || !run.bytes().all(allowed) {
        return Err(Error::new(format!(
            "`{run}` cannot be a run id: use 1 to {MAX_RUN_ID} ASCII letters, digits, `-`, `_` and `.`, but not `{LATEST}`"
        )));
    }
    Ok(())
}

/// The name of the node of a publishing loop: from it a tap learns which runs live and which is the latest.
pub(crate) fn publisher_node_name(run: &str, lane: u32, started: Duration) -> Result<NodeName> {
    check_run_id(run)?;
    NodeName::new(&format!("{PUBLISHER_NODE}/{run}/{lane}/{}", started.as_nanos()))
        .map_err(|error| Error::new(format!("run id `{run}` cannot name a loop ({error}): choose another")))
}

/// When the loop behind a living node started (since the Unix epoch), if it publishes `run` and `lane`.
pub(crate) fn publisher_start(node: &NodeState<Ipc>, run: &str, lane: u32) -> Option<(Duration, u32)> {
    let NodeState::Alive(node) = node else { return None };
    let details = node.details().as_ref()?;
    let mut parts = details.name().as_str().split('/');
    let ours = parts.next() == Some(PUBLISHER_NODE)
        && parts.next() == Some(run)
        && parts.next()?.parse() == Ok(lane);
    let started = Duration::from_nanos(parts.next()?.parse().ok()?);
    let process = u32::try_from(details.process_id().value()).ok()?;
    ours.then_some((started, process))
}

/// The payload of a topic: `[u8]` or one of the fixed messages.
pub(crate) trait Payload: Debug + IceoryxSend + 'static {
    /// Opens the topic, or creates it where it is not there yet.
    fn open_or_create(node: &Node<Ipc>, name: &ServiceName) -> Result<TopicService<Self>>;

    /// Opens the topic; `None` where it is not there, or not there yet.
    fn open(node: &Node<Ipc>, name: &ServiceName) -> Result<Option<TopicService<Self>>>;
}

/// One topic, opened: makes its ports.
pub(crate) type TopicService<P> = PortFactory<Ipc, P, FrameHeader>;

// The builders of slices and of sized payloads are different types with the same methods.
macro_rules! payloads {
    ($($payload:ty),*) => {$(
        impl Payload for $payload {
            fn open_or_create(node: &Node<Ipc>, name: &ServiceName) -> Result<TopicService<Self>> {
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
                    .open_or_create()
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
    let remedy = if reason.contains("InsufficientPermissions") {
        permission_remedy()
    } else if reason.contains("Incompatible")
        || reason.contains("DoesNotSupport")
        || reason.contains("Version")
    {
        "the process at the other end was built against another pdk-bus or iceoryx2, use the same version"
            .into()
    } else if reason.contains("ExceedsMaxNumberOfNodes") {
        "too many processes use it, end some of the taps".into()
    } else {
        "check that /dev/shm is writable and not full".into()
    };
    Error::new(format!("topic `{name}` cannot be opened ({reason}): {remedy}"))
}

pub(crate) fn permission_remedy() -> String {
    format!(
        "the bus of this machine belongs to another user, so run as that user, or give pdk and its taps a folder \
         of their own with {ROOT_VARIABLE}=/tmp/pdk-$USER"
    )
}

/// The environment variable that moves the bus's folder away from iceoryx2's default, `/tmp/iceoryx2`: an
/// absolute path. Only processes with the same folder see each other.
pub const ROOT_VARIABLE: &str = "PDK_BUS_DIR";

/// iceoryx2's configuration, with the folder from [`ROOT_VARIABLE`] where it is set.
pub(crate) fn config() -> Result<&'static Config> {
    static CONFIG: OnceLock<Result<Config>> = OnceLock::new();
    let config = CONFIG.get_or_init(|| {
        // It reports most failures twice: as an error, which we word ourselves, and as a log line.
        set_log_level_from_env_or(LogLevel::Fatal);
        let mut config = Config::global_config().clone();
        if let Some(folder) = std::env::var_os(ROOT_VARIABLE) {
            config.global.set_root_path(&root_path(&folder)?);
        }
        Ok(config)
    });
    config.as_ref().map_err(Error::clone)
}

/// The rest of the path of a file in the folder: `services/` and a hash.
const ROOM_FOR_FILES: usize = 100;

fn root_path(folder: &OsStr) -> Result<Path> {
    let bytes = folder.as_encoded_bytes();
    let path = Path::new(bytes).ok().filter(|_| bytes.starts_with(b"/"));
    path.filter(|path| path.len() + ROOM_FOR_FILES <= Path::max_len()).ok_or_else(|| {
        Error::new(format!(
            "{ROOT_VARIABLE}={} cannot be the folder of the bus: use a short absolute path like /tmp/pdk-$USER",
            folder.display()
        ))
    })
}

/// Registers this process, which also removes what dead ones left.
pub(crate) fn create_node(name: &NodeName) -> Result<Node<Ipc>> {
    let config = config()?;
    NodeBuilder::new()
        .name(name)
        .config(config)
        // Ctrl-C belongs to the program, not to the bus.
        .signal_handling_mode(SignalHandlingMode::Disabled)
        .create::<Ipc>()
        .map_err(|error| {
            let folder = config.global.root_path().to_string();
            let theirs = access(folder.as_str(), Access::WRITE_OK | Access::EXEC_OK) == Err(Errno::ACCESS);
            let remedy = if theirs || error == NodeCreationFailure::InsufficientPermissions {
                permission_remedy()
            } else {
                "check that it exists or can be made, and has space".into()
            };
            Error::new(format!("the bus cannot register this process in {folder} ({error}): {remedy}"))
        })
}

/// Removes the shared memory and files of processes that were killed before they could do so themselves, and
/// returns how many loops and taps that were. What belongs to another user stays.
///
/// # Errors
/// Where the list of processes cannot be read.
pub fn cleanup_dead() -> Result<usize> {
    let mut removed = 0;
    Node::<Ipc>::list(config()?, |node| {
        if let NodeState::Dead(dead) = node
            // Another process may be at the same work; then it is its removal, not ours.
            && dead.try_remove_stale_resources().is_ok()
        {
            removed += 1;
        }
        CallbackProgression::Continue
    })
    .map_err(|error| {
        Error::new(format!("leftovers of killed runs cannot be listed ({error}): {}", permission_remedy()))
    })?;
    Ok(removed)
}

/// Nanoseconds of the monotonic clock: the same clock in every process of the machine.
pub fn monotonic_nanoseconds() -> u64 {
    let now = clock_gettime(ClockId::Monotonic);
    // Both parts are non-negative on this clock, and the sum lasts for 584 years of uptime.
    now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn service_names_are_read_back() {
        let name = service_name("2026-11-20_a.1", 3, Topic::Perturbed).unwrap();
        assert_eq!(name.as_str(), "pdk/2026-11-20_a.1/3/perturbed");
        assert_eq!(parse_service_name(name.as_str()), Some(("2026-11-20_a.1", 3, Topic::Perturbed)));
        for foreign in
            ["pdk/run/0", "pdk/run/0/raw/more", "pdk/run/x/raw", "other/run/0/raw", "pdk/run/0/depth"]
        {
            assert_eq!(parse_service_name(foreign), None, "{foreign}");
        }
    }

    #[test]
    fn run_ids_that_cannot_name_a_topic_are_refused() {
        for run in ["", LATEST, "a/b", "a b", "ü", &"x".repeat(MAX_RUN_ID + 1)] {
            let error = service_name(run, 0, Topic::Raw).unwrap_err();
            assert!(error.message().contains("cannot be a run id"), "{error}");
        }
        let longest = "x".repeat(MAX_RUN_ID);
        service_name(&longest, u32::MAX, Topic::Perturbed).unwrap();
        publisher_node_name(&longest, u32::MAX, Duration::MAX).unwrap();
    }

    #[test]
    fn a_folder_is_absolute_and_short() {
        assert_eq!(root_path(OsStr::new("/tmp/pdk-me")).unwrap().to_string(), "/tmp/pdk-me");
        for folder in ["", "relative", "~/bus", &format!("/{}", "x".repeat(200))] {
            let error = root_path(OsStr::new(folder)).unwrap_err();
            assert!(error.message().contains("cannot be the folder of the bus"), "{error}");
        }
    }

    #[test]
    fn the_clock_moves_forward() {
        let before = monotonic_nanoseconds();
        std::thread::sleep(Duration::from_millis(2));
        assert!(monotonic_nanoseconds() - before >= 2_000_000);
    }
}
