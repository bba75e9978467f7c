//! Frames to another process and controls back.
//!
//! A bus of its own carries the frames, on its topic `perturbed`. Beside it lie the services `pdk/answer` (publish-subscribe, `PdkControl` with
//! the header `PdkFrameHeader` of the frame that is answered) and the events `pdk/frame-event` and `pdk/answer-event`.

use iceoryx2::identifiers::UniquePublisherId;
use iceoryx2::port::listener::Listener;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::ZeroCopySend;
use iceoryx2::service::ipc_threadsafe::Service;
use pdk_adapter::Deadline;
use pdk_bus::{FrameHeader, Stamp, Topic};
use pdk_sdk::prelude::*;

use crate::room::{Bell, LOOK, Room, failed, named};

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
    frame_event: Bell,
    answer_event: Listener<Service>,
    /// The scenario that was answered last, and who answers it.
    answering: Option<(u64, UniquePublisherId)>,
    // Last, so that everything in it is closed when it goes.
    room: Room,
    size: (usize, usize),
}

impl Exchange {
    /// Makes the services, for frames of this size. `name` is that of the folder that they are found in.
    ///
    /// # Errors
    /// If shared memory cannot be used.
    pub fn new(name: &str, width: usize, height: usize) -> Result<Self> {
        let room = Room::new(name, width, height)?;
        let answers = room
            .node
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
        let (frame_event, answer_event) = (room.bell("pdk/frame-event")?, room.listener("pdk/answer-event")?);
        Ok(Self { answers, frame_event, answer_event, answering: None, room, size: (width, height) })
    }

    /// Whether it is for frames of this size.
    pub fn fits(&self, frame: &Frame<'_>) -> bool {
        self.size == (frame.width(), frame.height())
    }

    /// Where the other process meets it.
    pub fn room(&self) -> &Room {
        &self.room
    }

    /// Whether a driver is at the other end.
    pub fn is_heard(&self) -> bool {
        self.frame_event.is_heard()
    }

    /// Sends a frame.
    ///
    /// # Errors
    /// If shared memory was damaged.
    pub fn send(&self, frame: Frame<'_>, stamp: Stamp, speed: f64) -> Result<()> {
        let (width, height) = self.size;
        // Before the frame, so that it is there with it.
        let state = State { time: stamp.time, speed, ..State::default() };
        self.room.bus.publish_state(stamp, state).map_err(|error| failed(&error))?;
        let mut loan = self.room.bus.loan_frame(Topic::Perturbed, stamp).map_err(|error| failed(&error))?;
        FrameMut::new(&mut loan, width, height).map_err(Error::new)?.copy_from(frame);
        loan.publish().map_err(|error| failed(&error))?;
        self.frame_event.ring();
        Ok(())
    }

    /// Waits for the answer to the frame with this stamp. `look` is asked now and then whether the other process is still there.
    ///
    /// # Errors
    /// That of `look`, or if no answer comes in time, or those of two drivers.
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
