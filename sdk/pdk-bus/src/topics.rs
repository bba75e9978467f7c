//! The four topics of a bus: what is made of them in iceoryx2, and how frames and messages are sent.

use std::{
    fs,
    io::{self, Write},
    mem::MaybeUninit,
    ops::{Deref, DerefMut},
    os::unix::fs::MetadataExt,
    sync::atomic::{AtomicU64, Ordering},
};

use iceoryx2::{
    config::Config,
    node::Node,
    port::{LoanError, update_connections::UpdateConnections as _},
    sample::Sample,
    sample_mut::SampleMut,
};

use crate::{
    error::{Error, Result},
    message::{ControlMessage, FrameHeader, StateMessage, Topic},
    remedy::remedy,
    removal::shared_memory,
    root::options,
    service::{
        Ipc, MAX_HELD, MAX_LOANS, MAX_SUBSCRIBERS, Payload, QUEUE_LENGTH, TopicPublisher, TopicService,
        TopicSubscriber, create_node, monotonic_nanoseconds, service_name,
    },
};

/// Frames in the shared memory of one topic. All queues together hold the newest [`QUEUE_LENGTH`] frames, as
/// every frame goes to every queue; beside them each subscriber may hold [`MAX_HELD`] older ones, and
/// [`MAX_LOANS`] are being written. One more covers the frame that is in both places while it is handed over.
pub(crate) const FRAMES_PER_TOPIC: usize = QUEUE_LENGTH + MAX_SUBSCRIBERS * MAX_HELD + MAX_LOANS + 1;

/// What iceoryx2 makes.
#[derive(Debug)]
pub(crate) struct Topics {
    pub(crate) raw: FrameTopic,
    pub(crate) perturbed: FrameTopic,
    pub(crate) control: MessageTopic<ControlMessage>,
    pub(crate) state: MessageTopic<StateMessage>,
    // Last, so that the ports are gone when it goes.
    _node: Node<Ipc>,
}

#[derive(Debug)]
pub(crate) struct FrameTopic {
    topic: Topic,
    publisher: TopicPublisher<[u8]>,
    subscriber: TopicSubscriber<[u8]>,
    sent: AtomicU64,
}

#[derive(Debug)]
pub(crate) struct MessageTopic<P: Payload> {
    topic: Topic,
    publisher: TopicPublisher<P>,
    sent: AtomicU64,
}

impl Topics {
    pub(crate) fn create(config: &Config, frame_bytes: usize) -> Result<Self> {
        let node = create_node("pdk-bus", config)?;
        make_private(config)?;
        Ok(Self {
            raw: FrameTopic::create(&node, Topic::Raw, frame_bytes)?,
            perturbed: FrameTopic::create(&node, Topic::Perturbed, frame_bytes)?,
            control: MessageTopic::create(&node, Topic::Control)?,
            state: MessageTopic::create(&node, Topic::State)?,
            _node: node,
        })
    }
}

impl FrameTopic {
    fn create(node: &Node<Ipc>, topic: Topic, frame_bytes: usize) -> Result<Self> {
        let service: TopicService<[u8]> = Payload::create(node, &service_name(topic)?)?;
        let publisher = service
            .publisher_builder()
            .initial_max_slice_len(frame_bytes)
            // The loop needs two at a time; `touch` needs all of them once.
            .max_loaned_samples(FRAMES_PER_TOPIC)
            .override_sample_preallocation(|_| FRAMES_PER_TOPIC)
            .create()
            .map_err(|error| cannot_publish(topic, &error))?;
        touch(&publisher, frame_bytes).map_err(|error| cannot_publish(topic, &error))?;
        let subscriber = service
            .subscriber_builder()
            .buffer_size(1)
            .create()
            .map_err(|error| cannot_publish(topic, &error))?;
        // Else it would be made with the first frame, perhaps after `remove` has deleted the subscriber's part.
        publisher.update_connections().map_err(|error| cannot_publish(topic, &error))?;
        Ok(Self { topic, publisher, subscriber, sent: AtomicU64::new(0) })
    }

    pub(crate) fn loan(&self, header: FrameHeader, frame_bytes: usize) -> Result<FrameLoan<'_>> {
        let mut sample = self.publisher.loan_slice_uninit(frame_bytes).map_err(|error| {
            let remedy = match error {
                LoanError::OutOfMemory | LoanError::ExceedsMaxLoans => {
                    "publish or drop the frames on loan first"
                }
                _ => "the shared memory may be damaged: start the run anew",
            };
            Error::new(format!("no frame to lend on topic `{}` ({error}): {remedy}", self.topic))
        })?;
        *sample.user_header_mut() = header;
        // SAFETY: every byte of the payload is initialised, and every bit pattern is a valid `u8`. `touch` had all
        // frames of this publisher on loan at the same time and wrote each of them from end to end, with the same
        // number of bytes as here. No frame was added since, because the number of frames is fixed
        // (`override_sample_preallocation`), nor resized, because the allocation is static. Bytes in shared memory
        // that were written once stay initialised, whatever is written over them.
        let sample = unsafe { sample.assume_init() };
        Ok(FrameLoan { sample, topic: self })
    }
}

/// Writes every frame of a new publisher once, so that the pages are there before the first step: the loop
/// neither waits for them nor dies of a bus error when something else fills /dev/shm later. `FrameTopic::loan`
/// relies on it.
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
    fn create(node: &Node<Ipc>, topic: Topic) -> Result<Self> {
        let service: TopicService<P> = Payload::create(node, &service_name(topic)?)?;
        let publisher =
            service.publisher_builder().create().map_err(|error| cannot_publish(topic, &error))?;
        Ok(Self { topic, publisher, sent: AtomicU64::new(0) })
    }

    pub(crate) fn send(&self, header: FrameHeader, message: P) -> Result<()> {
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
    /// If the loop holds more than one earlier frame of this topic, or the topic's memory is damaged.
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

fn cannot_publish(topic: Topic, error: &dyn std::error::Error) -> Error {
    Error::new(format!("topic `{topic}` cannot be made ({error}): {}", remedy()))
}

/// iceoryx2 lets every user write to the file in which it counts the nodes. Who has it open can shorten it, on
/// which the next tap crashes; so it gives way to a copy that is this user's alone. Nothing uses it yet except the
/// node of this bus, which does not need it again.
fn make_private(config: &Config) -> Result<()> {
    let prefix = config.global.prefix.to_string();
    for file in shared_memory(|found| found == prefix) {
        let replace = || -> io::Result<()> {
            if fs::metadata(&file)?.mode() & 0o077 == 0 {
                return Ok(());
            }
            let content = fs::read(&file)?;
            if content.is_empty() {
                return Err(io::Error::other("another user has emptied it"));
            }
            let mut copy = file.clone().into_os_string();
            copy.push(".copy");
            options().write(true).create_new(true).open(&copy)?.write_all(&content)?;
            fs::rename(copy, &file)
        };
        replace().map_err(|error| {
            Error::new(format!("{} cannot be made private ({error}): start again", file.display()))
        })?;
    }
    Ok(())
}
