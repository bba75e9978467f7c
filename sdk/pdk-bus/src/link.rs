//! A tap's connection to one bus: opens a topic in a root, beside other taps and what is left of killed ones.

use std::{
    fs::{self, File, TryLockError},
    io::ErrorKind,
    os::unix::fs::MetadataExt,
    path::Path,
    time::{Duration, Instant, SystemTime},
};

use iceoryx2::{node::Node, port::ReceiveError};

use pdk_model::{control::Control, state::State};

use crate::{
    error::{Error, Result},
    layout::{CONFIG_FILE, TAPS_FILE, prefix},
    message::{ControlMessage, FrameHeader, StateMessage, Topic},
    removal::{delete, shared_memory},
    root::{Watch, options},
    service::{Ipc, Payload, TopicService, TopicSubscriber, config, create_node, service_name},
    topics::FrameSample,
};

/// How long a tap waits for others that are being opened, which takes milliseconds each.
const TURN: Duration = Duration::from_secs(5);
const NEXT_TRY: Duration = Duration::from_millis(1);
/// A file that has not been finished after this time was given up by its process.
const HALF_MADE: Duration = Duration::from_millis(500);

/// One message of a topic.
#[derive(Debug)]
pub enum Message {
    /// From [`Topic::Raw`] or [`Topic::Perturbed`]: a view of the shared memory, not a copy.
    Frame(FrameSample),
    /// From [`Topic::Control`].
    Control(FrameHeader, Control),
    /// From [`Topic::State`].
    State(FrameHeader, State),
}

impl Message {
    /// Where the message stands in the experiment.
    pub fn header(&self) -> &FrameHeader {
        match self {
            Self::Frame(frame) => frame.header(),
            Self::Control(header, _) | Self::State(header, _) => header,
        }
    }
}

/// An open topic of a bus.
#[derive(Debug)]
pub(crate) struct Link {
    port: Port,
    watch: Watch,
    // Last, so that the ports are gone when it goes.
    _node: Node<Ipc>,
}

#[derive(Debug)]
enum Port {
    Frame(TopicSubscriber<[u8]>),
    Control(TopicSubscriber<ControlMessage>),
    State(TopicSubscriber<StateMessage>),
}

impl Link {
    /// Opens a topic of the bus with this root; `None` where the bus is gone.
    pub(crate) fn open(root: &Path, topic: Topic) -> Result<Option<Self>> {
        let Ok(watch) = Watch::open(root) else { return Ok(None) };
        let Some(turn) = take_turn(root)? else { return Ok(None) };
        clear_half_made(root);
        let opened = connect(root, topic);
        // Not left to the closing of the file, which a process that another thread is just starting may have open too.
        let _ = turn.unlock();
        // Who deleted the bus meanwhile did not know of the files just made.
        if !root.join(CONFIG_FILE).exists() {
            drop(opened);
            delete(&[root.to_owned()])?;
            return Ok(None);
        }
        Ok(opened?.map(|(node, port)| Self { port, watch, _node: node }))
    }

    /// Whether the owner of the bus lives.
    pub(crate) fn is_alive(&self) -> bool {
        self.watch.is_alive()
    }

    /// The oldest message that waits.
    pub(crate) fn receive(&self) -> Result<Option<Message>, ReceiveError> {
        Ok(match &self.port {
            Port::Frame(port) => port.receive()?.map(|sample| Message::Frame(FrameSample { sample })),
            Port::Control(port) => {
                port.receive()?.map(|s| Message::Control(*s.user_header(), (*s.payload()).into()))
            }
            Port::State(port) => {
                port.receive()?.map(|s| Message::State(*s.user_header(), (*s.payload()).into()))
            }
        })
    }
}

/// Waits until no other tap of the bus is being opened; `None` where the bus is gone.
fn take_turn(root: &Path) -> Result<Option<File>> {
    let path = root.join(TAPS_FILE);
    let failed = |reason: &dyn std::fmt::Display| {
        Error::new(format!(
            "{} cannot be locked ({reason}): end the tap that is being opened all the time, if there is one",
            path.display()
        ))
    };
    let turn = match options().write(true).create(true).truncate(false).open(&path) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        turn => turn.map_err(|error| failed(&error))?,
    };
    let start = Instant::now();
    loop {
        match turn.try_lock() {
            Ok(()) => return Ok(Some(turn)),
            Err(TryLockError::WouldBlock) if start.elapsed() < TURN => std::thread::sleep(NEXT_TRY),
            Err(TryLockError::WouldBlock) => return Err(failed(&format!("for {} s", TURN.as_secs()))),
            Err(TryLockError::Error(error)) => return Err(failed(&error)),
        }
    }
}

/// Deletes the shared memory that taps were making when they were killed: iceoryx2 marks it as unreadable or has
/// not given it a size, and may wait for ever for it to be completed. Only taps make shared memory in a complete
/// bus, and it is the caller's turn. Taps in other languages do not wait for their turn, so they get some time.
fn clear_half_made(root: &Path) {
    let Some(prefix) = prefix(root) else { return };
    let start = Instant::now();
    loop {
        let mut is_clear = true;
        for file in shared_memory(|found| found == prefix) {
            let Ok(found) = fs::metadata(&file) else { continue };
            if found.len() > 0 && found.mode() & 0o400 != 0 {
                continue;
            }
            let made = found.modified().unwrap_or(SystemTime::UNIX_EPOCH);
            if SystemTime::now().duration_since(made).is_ok_and(|age| age < HALF_MADE) {
                is_clear = false;
            } else {
                // Another may be at it.
                let _ = fs::remove_file(&file);
            }
        }
        if is_clear || start.elapsed() > 2 * HALF_MADE {
            return;
        }
        std::thread::sleep(NEXT_TRY);
    }
}

fn connect(root: &Path, topic: Topic) -> Result<Option<(Node<Ipc>, Port)>> {
    fn subscribe<P: Payload + ?Sized>(node: &Node<Ipc>, topic: Topic) -> Result<Option<TopicSubscriber<P>>> {
        let service: TopicService<P> = match P::open(node, &service_name(topic)?)? {
            Some(service) => service,
            None => return Ok(None),
        };
        service.subscriber_builder().create().map(Some).map_err(|error| {
            Error::new(format!(
                "topic `{topic}` cannot be tapped ({error}): end another tap of it first, seven are possible"
            ))
        })
    }

    let node = create_node("pdk-tap", &config(&root.join(CONFIG_FILE))?)?;
    let port = match topic {
        Topic::Raw | Topic::Perturbed => subscribe(&node, topic)?.map(Port::Frame),
        Topic::Control => subscribe(&node, topic)?.map(Port::Control),
        Topic::State => subscribe(&node, topic)?.map(Port::State),
    };
    Ok(port.map(|port| (node, port)))
}
