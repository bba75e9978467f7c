//! The reading side: what a viewer, a recorder or a driver in another process opens.

use std::{
    collections::BTreeMap,
    time::{Duration, Instant, SystemTime},
};

use iceoryx2::{
    node::{Node, node_name::NodeName},
    port::ReceiveError,
    prelude::{CallbackProgression, PortFactory as _, Service as _},
    service::ServiceListError,
};

use crate::{
    bus::FrameSample,
    error::{Error, Result},
    message::{ControlMessage, FrameHeader, StateMessage, Topic},
    service::{
        Ipc, LATEST, Payload, TopicService, TopicSubscriber, config, create_node, parse_service_name,
        permission_remedy, publisher_start, service_name,
    },
};

/// How often a tap looks for a run that is not there yet.
const LOOK_AGAIN: Duration = Duration::from_millis(20);
/// A waiting tap polls: at first giving way to other threads, then sleeping longer and longer up to this.
const LONGEST_SLEEP: Duration = Duration::from_micros(500);
const FIRST_SLEEP: Duration = Duration::from_micros(20);
const POLLS_BEFORE_SLEEP: u32 = 50;

/// A run that is publishing at this moment.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RunTopics {
    /// The run id.
    pub run: String,
    /// When its first loop started.
    pub started: SystemTime,
    /// The process that runs it.
    pub process: u32,
    /// The numbers of its loops, ascending.
    pub lanes: Vec<u32>,
}

/// One message of a topic.
#[derive(Debug)]
pub enum Message {
    /// From [`Topic::Raw`] or [`Topic::Perturbed`]: a view of the shared memory, not a copy.
    Frame(FrameSample),
    /// From [`Topic::Control`].
    Control(FrameHeader, ControlMessage),
    /// From [`Topic::State`].
    State(FrameHeader, StateMessage),
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

/// A reader of one topic of one loop.
///
/// Up to seven taps read a topic at the same time, each with a queue of eight messages that loses the oldest
/// when it is full; [`lost`](Self::lost) counts those.
#[derive(Debug)]
pub struct Tap {
    run: String,
    lane: u32,
    topic: Topic,
    port: Port,
    expected: Option<u64>,
    lost: u64,
    // Last, so that the ports are gone when it goes.
    _node: Node<Ipc>,
}

#[derive(Debug)]
enum Port {
    Frame(TopicService<[u8]>, TopicSubscriber<[u8]>),
    Control(TopicService<ControlMessage>, TopicSubscriber<ControlMessage>),
    State(TopicService<StateMessage>, TopicSubscriber<StateMessage>),
}

impl Tap {
    /// The runs that publish at this moment, the one that started last first.
    ///
    /// # Errors
    /// Where the list of topics cannot be read.
    pub fn list() -> Result<Vec<RunTopics>> {
        let mut runs: BTreeMap<(String, u32), (Duration, Vec<u32>)> = BTreeMap::new();
        Ipc::list(config()?, |service| {
            let name = service.static_details.name().as_str();
            if let Some((run, lane, Topic::Raw)) = parse_service_name(name) {
                let nodes = service.dynamic_details.iter().flat_map(|details| &details.nodes);
                for (started, process) in nodes.filter_map(|node| publisher_start(node, run, lane)) {
                    let entry = runs.entry((run.to_owned(), process)).or_insert((started, Vec::new()));
                    entry.0 = entry.0.min(started);
                    entry.1.push(lane);
                }
            }
            CallbackProgression::Continue
        })
        .map_err(|error| {
            let remedy = match error {
                ServiceListError::InsufficientPermissions => permission_remedy(),
                ServiceListError::InternalError => "try again".into(),
            };
            Error::new(format!("the topics of running pipelines cannot be listed ({error}): {remedy}"))
        })?;

        let mut runs: Vec<_> = runs
            .into_iter()
            .map(|((run, process), (started, mut lanes))| {
                lanes.sort_unstable();
                RunTopics { run, started: SystemTime::UNIX_EPOCH + started, process, lanes }
            })
            .collect();
        runs.sort_by(|a, b| b.started.cmp(&a.started).then_with(|| a.run.cmp(&b.run)));
        Ok(runs)
    }

    /// Opens a topic of a run, or of the [`LATEST`] run that has this lane. Where there is none yet, waits for
    /// it up to `timeout`: a tap may be started before its run.
    ///
    /// # Errors
    /// No such run within `timeout`, too many taps, shared memory of another user.
    pub fn open(run: &str, lane: u32, topic: Topic, timeout: Duration) -> Result<Self> {
        let node = create_node(&NodeName::new("pdk-tap").map_err(|error| Error::new(error.to_string()))?)?;
        let deadline = Instant::now() + timeout;
        loop {
            let found = match run {
                LATEST => {
                    Self::list()?.into_iter().find(|found| found.lanes.contains(&lane)).map(|found| found.run)
                }
                _ => Some(run.to_owned()),
            };
            if let Some(run) = found
                && let Some(port) = Port::open(&node, &run, lane, topic)?
            {
                return Ok(Self { run, lane, topic, port, expected: None, lost: 0, _node: node });
            }
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Err(nothing_to_tap(run, lane, topic, timeout));
            }
            std::thread::sleep(left.min(LOOK_AGAIN));
        }
    }

    /// The id of the run: the real one where [`LATEST`] was asked for.
    pub fn run(&self) -> &str {
        &self.run
    }

    /// The number of the loop within the run.
    pub fn lane(&self) -> u32 {
        self.lane
    }

    /// The topic.
    pub fn topic(&self) -> Topic {
        self.topic
    }

    /// How many messages were sent since the first one received that this tap was too slow for.
    pub fn lost(&self) -> u64 {
        self.lost
    }

    /// The oldest message that waits; where none does, waits for one up to `timeout`. `None` after that.
    ///
    /// # Errors
    /// Where the caller holds two frames already.
    pub fn receive(&mut self, timeout: Duration) -> Result<Option<Message>> {
        let start = Instant::now();
        let mut polls = 0;
        let mut sleep = FIRST_SLEEP;
        loop {
            if let Some(message) = self.try_receive()? {
                return Ok(Some(message));
            }
            let left = timeout.saturating_sub(start.elapsed());
            if left.is_zero() {
                return Ok(None);
            }
            if polls < POLLS_BEFORE_SLEEP {
                polls += 1;
                std::thread::yield_now();
            } else {
                std::thread::sleep(sleep.min(left));
                sleep = (sleep * 2).min(LONGEST_SLEEP);
            }
        }
    }

    /// Whether the loop behind the topic has ended or died; messages may still wait.
    ///
    /// # Errors
    /// Where the state of the other process cannot be read.
    pub fn is_over(&self) -> Result<bool> {
        let mut alive = false;
        let see = |node| {
            alive |= publisher_start(&node, &self.run, self.lane).is_some();
            if alive { CallbackProgression::Stop } else { CallbackProgression::Continue }
        };
        let seen = match &self.port {
            Port::Frame(service, _) => service.nodes(see),
            Port::Control(service, _) => service.nodes(see),
            Port::State(service, _) => service.nodes(see),
        };
        seen.map_err(|error| {
            Error::new(format!(
                "it cannot be seen whether lane {} of run `{}` is alive ({error}): {}",
                self.lane,
                self.run,
                permission_remedy()
            ))
        })?;
        Ok(!alive)
    }

    fn try_receive(&mut self) -> Result<Option<Message>> {
        let received = match &self.port {
            Port::Frame(_, port) => {
                port.receive().map(|sample| sample.map(|sample| Message::Frame(FrameSample { sample })))
            }
            Port::Control(_, port) => {
                port.receive().map(|sample| sample.map(|s| Message::Control(*s.user_header(), *s.payload())))
            }
            Port::State(_, port) => {
                port.receive().map(|sample| sample.map(|s| Message::State(*s.user_header(), *s.payload())))
            }
        };
        let message = received.map_err(|error| {
            let remedy = match error {
                ReceiveError::ExceedsMaxBorrows => "drop the frames received before",
                _ => "open the tap again",
            };
            Error::new(format!(
                "topic `{}` of run `{}` cannot be read ({error}): {remedy}",
                self.topic, self.run
            ))
        })?;
        if let Some(message) = &message {
            let number = message.header().number;
            // A loop that was killed and started anew counts from 0 again.
            self.lost += number.saturating_sub(self.expected.unwrap_or(number));
            self.expected = Some(number + 1);
        }
        Ok(message)
    }
}

impl Port {
    fn open(node: &Node<Ipc>, run: &str, lane: u32, topic: Topic) -> Result<Option<Self>> {
        fn subscribe<P: Payload + ?Sized>(
            node: &Node<Ipc>,
            run: &str,
            lane: u32,
            topic: Topic,
        ) -> Result<Option<(TopicService<P>, TopicSubscriber<P>)>> {
            let Some(service) = P::open(node, &service_name(run, lane, topic)?)? else { return Ok(None) };
            let subscriber = service.subscriber_builder().create().map_err(|error| {
                Error::new(format!(
                    "topic `{topic}` of lane {lane} of run `{run}` cannot be tapped ({error}): end another tap of \
                     it first, seven are possible"
                ))
            })?;
            Ok(Some((service, subscriber)))
        }

        Ok(match topic {
            Topic::Raw | Topic::Perturbed => {
                subscribe(node, run, lane, topic)?.map(|(service, port)| Self::Frame(service, port))
            }
            Topic::Control => {
                subscribe(node, run, lane, topic)?.map(|(service, port)| Self::Control(service, port))
            }
            Topic::State => {
                subscribe(node, run, lane, topic)?.map(|(service, port)| Self::State(service, port))
            }
        })
    }
}

fn nothing_to_tap(run: &str, lane: u32, topic: Topic, timeout: Duration) -> Error {
    let running = match Tap::list() {
        Ok(runs) if !runs.is_empty() => {
            let names: Vec<_> = runs.iter().map(|found| format!("`{}`", found.run)).collect();
            format!("running now: {}", names.join(", "))
        }
        _ => "no run publishes at this moment".into(),
    };
    let wanted = if run == LATEST { "any run".into() } else { format!("run `{run}`") };
    Error::new(format!(
        "topic `{topic}` of lane {lane} of {wanted} did not appear within {:.1} s ({running}): start the run, or \
         name another",
        timeout.as_secs_f64()
    ))
}
