//! Frames to another process and controls back.
//!
//! A bus of its own carries the frames, on its topic `perturbed`. Beside it lie the services `pdk/answer` (publish-subscribe, `PdkControl` with
//! the header `PdkFrameHeader` of the frame that is answered) and the events `pdk/frame-event` and `pdk/answer-event`.

use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::ZeroCopySend;
use iceoryx2::service::ipc_threadsafe::Service;
use pdk_adapter::Deadline;
use pdk_bus::{FrameHeader, Stamp, Topic};
use pdk_sdk::prelude::*;

use crate::room::{LOOK, Room, failed, named};

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
    answer_event: Listener<Service>,
    // Last, so that everything in it is closed when it goes.
    room: Room,
    size: (usize, usize),
}

impl Exchange {
    /// Makes the services, for frames of this size. `name` is that of the folder that they are found in.
    ///
    /// # Errors
    /// Where shared memory cannot be used.
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
        let (frame_event, answer_event) =
            (room.notifier("pdk/frame-event")?, room.listener("pdk/answer-event")?);
        Ok(Self { answers, frame_event, answer_event, room, size: (width, height) })
    }

    /// Whether it is for frames of this size.
    pub fn fits(&self, frame: &Frame<'_>) -> bool {
        self.size == (frame.width(), frame.height())
    }

    /// Where the other process meets it.
    pub fn room(&self) -> &Room {
        &self.room
    }

    /// Sends a frame.
    ///
    /// # Errors
    /// Where shared memory was damaged.
    pub fn send(&self, frame: Frame<'_>, stamp: Stamp, speed: f64) -> Result<()> {
        let (width, height) = self.size;
        // Before the frame, so that it is there with it.
        let state = State { time: stamp.time, speed, ..State::default() };
        self.room.bus.publish_state(stamp, state).map_err(|error| failed(&error))?;
        let mut loan = self.room.bus.loan_frame(Topic::Perturbed, stamp).map_err(|error| failed(&error))?;
        FrameMut::new(&mut loan, width, height)?.copy_from(frame);
        loan.publish().map_err(|error| failed(&error))?;
        // Where nobody listens yet, whoever comes looks for the frame first.
        let _ = self.frame_event.notify();
        Ok(())
    }

    /// Waits for the answer to the frame with this stamp. `look` is asked now and then whether the other process is still there.
    ///
    /// # Errors
    /// That of `look`, or where no answer comes in time.
    pub fn answer(
        &self,
        stamp: Stamp,
        deadline: &Deadline,
        who: &str,
        mut look: impl FnMut() -> Result<()>,
    ) -> Result<Control> {
        loop {
            while let Some(answer) = self.answers.receive().map_err(|error| failed(&error))? {
                let header = answer.user_header();
                // One that comes too late is for another frame.
                if (header.scenario, header.sequence) == (stamp.scenario, stamp.sequence) {
                    let Answer { steering, throttle } = *answer.payload();
                    return Ok(Control { steering, throttle });
                }
            }
            let Some(left) = deadline.left() else { return Err(deadline.late(who, "answered a frame")) };
            look()?;
            self.answer_event.timed_wait(|_| {}, left.min(LOOK)).map_err(|error| failed(&error))?;
        }
    }
}
