//! Frames to another process and controls back.
//!
//! A bus of its own carries the frames, on its topic `perturbed`. Beside it lie the services `pdk/answer` (publish-subscribe, `PdkControl` with
//! the header `PdkFrameHeader` of the frame that is answered) and the events `pdk/frame-event` and `pdk/answer-event`.

use std::path::Path;
use std::time::Duration;

use iceoryx2::config::Config;
use iceoryx2::identifiers::UniquePublisherId;
use iceoryx2::node::{Node, NodeBuilder};
use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::{
    FilePath, PortFactory as _, SemanticString, ServiceName, SignalHandlingMode, ZeroCopySend,
};
use iceoryx2::service::ipc_threadsafe::Service;
use iceoryx2::service::port_factory::event::PortFactory;
use pdk_adapter::Deadline;
use pdk_bus::{Bus, FrameHeader, Stamp, Topic};
use pdk_sdk::prelude::*;

/// How long a wait lasts before it is looked whether the other process is still there.
const LOOK: Duration = Duration::from_millis(50);

/// The numbers of a control, in the order of `Control::NUMBERS`.
#[repr(C)]
#[derive(Debug, Clone, Copy, ZeroCopySend)]
#[type_name("PdkControl")]
struct Answer {
    steering: f64,
    throttle: f64,
}

/// This side of it.
pub struct Exchange {
    answers: Subscriber<Service, Answer, FrameHeader>,
    frame_event: Notifier<Service>,
    /// The service of that event, which knows who listens.
    frames: PortFactory<Service>,
    answer_event: Listener<Service>,
    _node: Node<Service>,
    /// The scenario that was answered last, and who answers it.
    answering: Option<(u64, UniquePublisherId)>,
    // Last, so that everything in it is closed when it takes its files away.
    bus: Bus,
    size: (usize, usize),
}

impl Exchange {
    /// Makes the services, for frames of this size. `name` is that of the folder that they are found in.
    ///
    /// # Errors
    /// Where shared memory cannot be used.
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
        let named = |name: &str| ServiceName::new(name).map_err(|error| failed(&error));
        let answers = node
            .service_builder(&named("pdk/answer")?)
            .publish_subscribe::<Answer>()
            .user_header::<FrameHeader>()
            .max_publishers(2)
            .max_subscribers(2)
            .subscriber_max_buffer_size(4)
            .enable_safe_overflow(true)
            .create()
            .map_err(|error| failed(&error))?;
        let answers = answers.subscriber_builder().create().map_err(|error| failed(&error))?;
        let event = |name: &str| {
            let service = node.service_builder(&named(name)?).event().create();
            service.map_err(|error| failed(&error))
        };
        let frames = event("pdk/frame-event")?;
        let frame_event = frames.notifier_builder().create().map_err(|error| failed(&error))?;
        let answer_event =
            event("pdk/answer-event")?.listener_builder().create().map_err(|error| failed(&error))?;
        Ok(Self {
            answers,
            frame_event,
            frames,
            answer_event,
            _node: node,
            answering: None,
            bus,
            size: (width, height),
        })
    }

    /// Whether it is for frames of this size.
    pub fn fits(&self, frame: &Frame<'_>) -> bool {
        self.size == (frame.width(), frame.height())
    }

    /// The folder that the other process opens.
    pub fn folder(&self) -> &Path {
        self.bus.root()
    }

    /// Whether a driver is at the other end.
    pub fn has_listeners(&self) -> bool {
        self.frames.dynamic_config().number_of_listeners() > 0
    }

    /// Sends a frame.
    ///
    /// # Errors
    /// Where shared memory was damaged.
    pub fn send(&self, frame: Frame<'_>, stamp: Stamp, speed: f64) -> Result<()> {
        let (width, height) = self.size;
        // Before the frame, so that it is there with it.
        let state = State { time: stamp.time, speed, ..State::default() };
        self.bus.publish_state(stamp, state).map_err(|error| failed(&error))?;
        let mut loan = self.bus.loan_frame(Topic::Perturbed, stamp).map_err(|error| failed(&error))?;
        FrameMut::new(&mut loan, width, height)?.copy_from(frame);
        loan.publish().map_err(|error| failed(&error))?;
        // Where nobody listens yet, whoever comes looks for the frame first.
        let _ = self.frame_event.notify();
        Ok(())
    }

    /// Waits for the answer to the frame with this stamp. `look` is asked now and then whether the other process is still there.
    ///
    /// # Errors
    /// That of `look`, or where no answer comes in time, or those of two drivers.
    pub fn answer(
        &mut self,
        stamp: Stamp,
        deadline: &Deadline,
        who: &str,
        mut look: impl FnMut(&Self) -> Result<()>,
    ) -> Result<Control> {
        loop {
            while let Some(answer) = self.answers.receive().map_err(|error| failed(&error))? {
                let header = answer.user_header();
                if header.scenario == stamp.scenario {
                    let by = (stamp.scenario, answer.header().publisher_id());
                    let before = self.answering.replace(by);
                    if before.is_some_and(|before| before.0 == by.0 && before.1 != by.1) {
                        return Err(Error::of(
                            ErrorKind::Nonsense,
                            format!(
                                "two programs answer as {who}; end one of them, or give each an exchange of its own"
                            ),
                        ));
                    }
                }
                // One that comes too late is for another frame.
                if (header.scenario, header.sequence) == (stamp.scenario, stamp.sequence) {
                    let Answer { steering, throttle } = *answer.payload();
                    return Ok(Control { steering, throttle });
                }
            }
            let Some(left) = deadline.left() else { return Err(deadline.late(who, "answered a frame")) };
            look(self)?;
            self.answer_event.timed_wait(|_| {}, left.min(LOOK)).map_err(|error| failed(&error))?;
        }
    }
}

fn failed(error: &dyn std::fmt::Display) -> Error {
    Error::new(format!("the exchange with the driver's process failed: {error}"))
}
