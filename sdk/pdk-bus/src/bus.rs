//! The publishing side: what the loop owns.

use std::{
    mem::MaybeUninit,
    ops::{Deref, DerefMut},
    sync::atomic::{AtomicU64, Ordering},
    time::{Duration, SystemTime},
};

use iceoryx2::{node::Node, port::LoanError, sample::Sample, sample_mut::SampleMut};

use crate::{
    error::{Error, Result},
    message::{ControlMessage, FORMAT_RGB8, FrameHeader, Stamp, StateMessage, Topic, run_hash},
    service::{
        Ipc, MAX_HELD, MAX_LOANS, MAX_SUBSCRIBERS, Payload, QUEUE_LENGTH, TopicPublisher, TopicService,
        TopicSubscriber, create_node, monotonic_nanoseconds, publisher_node_name, service_name,
    },
};

/// Frames in the shared memory of one topic. All queues together hold the newest [`QUEUE_LENGTH`] frames, as
/// every frame goes to every queue; beside them each subscriber may hold [`MAX_HELD`] older ones, and
/// [`MAX_LOANS`] are being written. One more covers the frame that is in both places while it is handed over.
const FRAMES_PER_TOPIC: usize = QUEUE_LENGTH + MAX_SUBSCRIBERS * MAX_HELD + MAX_LOANS + 1;

/// The four topics of one loop of a run, for publishing.
///
/// One thread's loop owns one bus; the loops of a run differ in their lane number. Dropping the bus takes its
/// topics off the machine, except those that a tap still holds open.
#[derive(Debug)]
pub struct Bus {
    run: String,
    header: FrameHeader,
    raw: FrameTopic,
    perturbed: FrameTopic,
    control: MessageTopic<ControlMessage>,
    state: MessageTopic<StateMessage>,
    // Last, so that the ports are gone when it goes.
    _node: Node<Ipc>,
}

#[derive(Debug)]
struct FrameTopic {
    topic: Topic,
    publisher: TopicPublisher<[u8]>,
    subscriber: TopicSubscriber<[u8]>,
    sent: AtomicU64,
}

#[derive(Debug)]
struct MessageTopic<P: Payload> {
    topic: Topic,
    publisher: TopicPublisher<P>,
    sent: AtomicU64,
}

impl Bus {
    /// Makes the topics `pdk/<run>/<lane>/{raw,perturbed,control,state}` for RGB frames of `width` x `height`
    /// pixels. The shared memory for all frames is taken here: about 27 frames per frame topic.
    ///
    /// `run` has 1 to 64 ASCII letters, digits, `-`, `_` and `.`.
    ///
    /// # Errors
    /// A run id or frame size that cannot be, a lane that another process publishes at this moment, shared
    /// memory that is full or belongs to another user.
    pub fn create(run: &str, lane: u32, width: u32, height: u32) -> Result<Self> {
        let frame_bytes = frame_bytes(width, height)?;
        check_space(run, lane, 2 * FRAMES_PER_TOPIC as u64 * frame_bytes as u64)?;
        let started = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or(Duration::ZERO);
        let node = create_node(&publisher_node_name(run, lane, started)?)?;

        let frames = |topic| FrameTopic::create(&node, run, lane, topic, frame_bytes);
        Ok(Self {
            run: run.to_owned(),
            header: FrameHeader {
                run: run_hash(run),
                lane,
                width,
                height,
                format: FORMAT_RGB8,
                ..Default::default()
            },
            raw: frames(Topic::Raw)?,
            perturbed: frames(Topic::Perturbed)?,
            control: MessageTopic::create(&node, run, lane, Topic::Control)?,
            state: MessageTopic::create(&node, run, lane, Topic::State)?,
            _node: node,
        })
    }

    /// The id of the run.
    pub fn run(&self) -> &str {
        &self.run
    }

    /// The number of the loop within the run.
    pub fn lane(&self) -> u32 {
        self.header.lane
    }

    /// Lends the memory of the next frame on [`Topic::Raw`] or [`Topic::Perturbed`]: `width * height * 3`
    /// bytes, all 0. Two may be on loan per topic; one that is dropped is not sent.
    ///
    /// # Errors
    /// A topic that has no frames, or more than two loans.
    pub fn loan_frame(&self, topic: Topic, stamp: Stamp) -> Result<FrameLoan<'_>> {
        let frames = match topic {
            Topic::Raw => &self.raw,
            Topic::Perturbed => &self.perturbed,
            Topic::Control | Topic::State => {
                return Err(Error::new(format!("topic `{topic}` has no frames: use raw or perturbed")));
            }
        };
        frames.loan(self.stamped(stamp), frame_bytes(self.header.width, self.header.height)?)
    }

    /// Sends what the driver answered to the frame with the same stamp.
    ///
    /// # Errors
    /// Where the topic's memory is damaged.
    pub fn publish_control(&self, stamp: Stamp, message: ControlMessage) -> Result<()> {
        self.control.send(self.stamped(stamp), message)
    }

    /// Sends what the vehicle did.
    ///
    /// # Errors
    /// Where the topic's memory is damaged.
    pub fn publish_state(&self, stamp: Stamp, message: StateMessage) -> Result<()> {
        self.state.send(self.stamped(stamp), message)
    }

    fn stamped(&self, stamp: Stamp) -> FrameHeader {
        let Stamp { scenario, sequence, time } = stamp;
        FrameHeader { scenario, sequence, time, ..self.header }
    }
}

impl FrameTopic {
    fn create(node: &Node<Ipc>, run: &str, lane: u32, topic: Topic, frame_bytes: usize) -> Result<Self> {
        let service: TopicService<[u8]> = Payload::open_or_create(node, &service_name(run, lane, topic)?)?;
        let publisher = service
            .publisher_builder()
            .initial_max_slice_len(frame_bytes)
            // The loop needs two at a time; `touch` needs all of them once.
            .max_loaned_samples(FRAMES_PER_TOPIC)
            .override_sample_preallocation(|_| FRAMES_PER_TOPIC)
            .create()
            .map_err(|error| cannot_publish(run, lane, topic, &error))?;
        touch(&publisher, frame_bytes).map_err(|error| cannot_publish(run, lane, topic, &error))?;
        let subscriber = service
            .subscriber_builder()
            .buffer_size(1)
            .create()
            .map_err(|error| Error::new(format!("the loop cannot read its own topic `{topic}` ({error}): end some taps of lane {lane} of run `{run}`")))?;
        Ok(Self { topic, publisher, subscriber, sent: AtomicU64::new(0) })
    }

    fn loan(&self, header: FrameHeader, frame_bytes: usize) -> Result<FrameLoan<'_>> {
        let mut sample = self.publisher.loan_slice_uninit(frame_bytes).map_err(|error| {
            let remedy = match error {
                LoanError::OutOfMemory | LoanError::ExceedsMaxLoans => {
                    "publish or drop the frames on loan first"
                }
                _ => "the shared memory may be damaged: start the run anew",
            };
            Error::new(format!("no frame to lend on topic `{}` ({error}): {remedy}", self.topic))
        })?;
        // The memory held an earlier frame: what the writer leaves out must not show it.
        sample.payload_mut().fill(MaybeUninit::new(0));
        *sample.user_header_mut() = header;
        // SAFETY: every byte of the payload was written just above.
        let sample = unsafe { sample.assume_init() };
        Ok(FrameLoan { sample, topic: self })
    }
}

/// Writes every frame of a new publisher once, so that the pages are there before the first step: the loop
/// neither waits for them nor dies of a bus error when something else fills /dev/shm later.
fn touch(publisher: &TopicPublisher<[u8]>, frame_bytes: usize) -> Result<(), LoanError> {
    let mut loans = Vec::with_capacity(FRAMES_PER_TOPIC);
    for _ in 0..FRAMES_PER_TOPIC {
        let mut loan = publisher.loan_slice_uninit(frame_bytes)?;
        loan.payload_mut().fill(MaybeUninit::new(0));
        loans.push(loan);
    }
    Ok(())
}

impl<P: Payload + Copy> MessageTopic<P>
where
    P: iceoryx2::prelude::ZeroCopySend,
{
    fn create(node: &Node<Ipc>, run: &str, lane: u32, topic: Topic) -> Result<Self> {
        let service: TopicService<P> = Payload::open_or_create(node, &service_name(run, lane, topic)?)?;
        let publisher =
            service.publisher_builder().create().map_err(|error| cannot_publish(run, lane, topic, &error))?;
        Ok(Self { topic, publisher, sent: AtomicU64::new(0) })
    }

    fn send(&self, header: FrameHeader, message: P) -> Result<()> {
        let failed = |error: &dyn std::error::Error| {
            Error::new(format!(
                "nothing can be sent on topic `{}` ({error}): the shared memory may be damaged, start the run anew",
                self.topic
            ))
        };
        let mut sample = self.publisher.loan_uninit().map_err(|error| failed(&error))?;
        let number = self.sent.fetch_add(1, Ordering::Relaxed);
        *sample.user_header_mut() = FrameHeader { number, sent_at: monotonic_nanoseconds(), ..header };
        sample.write_payload(message).send().map_err(|error| failed(&error))?;
        Ok(())
    }
}

/// The memory of a frame that is to be sent: write the rows, then [`publish`](Self::publish).
#[derive(Debug)]
pub struct FrameLoan<'bus> {
    sample: SampleMut<Ipc, [u8], FrameHeader>,
    topic: &'bus FrameTopic,
}

impl FrameLoan<'_> {
    /// Sends the frame to every tap and returns it, readable, from the same memory.
    ///
    /// # Errors
    /// Where the loop holds more than one earlier frame of this topic, or the topic's memory is damaged.
    pub fn publish(self) -> Result<FrameSample> {
        let Self { mut sample, topic } = self;
        let failed = |error: &dyn std::error::Error| {
            Error::new(format!(
                "a frame cannot be sent on topic `{}` ({error}): drop earlier frames of this topic first",
                topic.topic
            ))
        };
        let number = topic.sent.fetch_add(1, Ordering::Relaxed);
        let header = sample.user_header_mut();
        header.number = number;
        header.sent_at = monotonic_nanoseconds();
        sample.send().map_err(|error| failed(&error))?;
        match topic.subscriber.receive().map_err(|error| failed(&error))? {
            Some(sample) if sample.user_header().number == number => Ok(FrameSample { sample }),
            _ => Err(Error::new(format!(
                "topic `{}` did not give back frame {number}: publish from one thread at a time",
                topic.topic
            ))),
        }
    }
}

impl Deref for FrameLoan<'_> {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        self.sample.payload()
    }
}

impl DerefMut for FrameLoan<'_> {
    fn deref_mut(&mut self) -> &mut [u8] {
        self.sample.payload_mut()
    }
}

/// A frame in shared memory: the rows as bytes, and its header. The memory is not used for another frame
/// before this is dropped; a loop or tap may hold two per topic.
#[derive(Debug)]
pub struct FrameSample {
    pub(crate) sample: Sample<Ipc, [u8], FrameHeader>,
}

impl FrameSample {
    /// Where the frame stands, and its size.
    pub fn header(&self) -> &FrameHeader {
        self.sample.user_header()
    }
}

impl Deref for FrameSample {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        self.sample.payload()
    }
}

fn frame_bytes(width: u32, height: u32) -> Result<usize> {
    let bytes = u64::from(width) * u64::from(height) * 3;
    // The bound keeps the sums over all frames of a topic far from overflow.
    match usize::try_from(bytes) {
        Ok(bytes) if bytes > 0 && bytes <= 1 << 30 => Ok(bytes),
        _ => Err(Error::new(format!(
            "{width}x{height} cannot be the size of a frame on the bus: use 1x1 up to 1 GiB a frame"
        ))),
    }
}

/// Refuses early where the shared memory is too small, as writing to it then ends in a bus error.
fn check_space(run: &str, lane: u32, needed: u64) -> Result<()> {
    let Ok(memory) = rustix::fs::statvfs("/dev/shm") else { return Ok(()) };
    let free = memory.f_bavail * memory.f_frsize;
    if free < needed {
        return Err(Error::new(format!(
            "lane {lane} of run `{run}` needs {} MiB of shared memory and /dev/shm has {} MiB left: use fewer \
             threads or smaller frames, or enlarge it (docker run --shm-size=2g; mount -o remount,size=2g /dev/shm)",
            needed.div_ceil(1 << 20),
            free >> 20
        )));
    }
    Ok(())
}

fn cannot_publish(run: &str, lane: u32, topic: Topic, error: &dyn std::error::Error) -> Error {
    let reason = error.to_string();
    let remedy = if reason.contains("ExceedsMaxSupportedPublishers") {
        "another loop publishes it at this moment: give this run another id, or this loop another lane"
    } else {
        "check that /dev/shm is writable and not full"
    };
    Error::new(format!(
        "topic `{topic}` of lane {lane} of run `{run}` cannot be published ({reason}): {remedy}"
    ))
}
