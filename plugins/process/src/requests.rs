//! What a simulator in another process is asked, and what it answers.
//!
//! Requests and replies are JSON, on `pdk/request` and `pdk/reply`; pictures come on `pdk/frame`. Every message has the header
//! `PdkFrameHeader`, in which `sequence` is the number of the request, and a reply has that of its request. The events are
//! `pdk/request-event` and `pdk/reply-event`.

use std::time::Instant;

use iceoryx2::port::listener::Listener;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::AllocationStrategy;
use iceoryx2::service::ipc_threadsafe::Service;
use pdk_adapter::Deadline;
use pdk_bus::FrameHeader;
use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::{self, Value};

use crate::room::{AGAIN, Bell, LOOK, Room, failed, named};

/// Bytes of a request for which memory is taken at the beginning. More is taken where a road needs it.
const REQUEST: usize = 1 << 14;

/// The requests to one program.
pub struct Requests {
    requests: Publisher<Service, [u8], FrameHeader>,
    replies: Subscriber<Service, [u8], FrameHeader>,
    frames: Subscriber<Service, [u8], FrameHeader>,
    request_event: Bell,
    reply_event: Listener<Service>,
    /// How many requests there were.
    count: u64,
    // Last, so that everything in it is closed when it goes.
    room: Room,
}

/// A wait for an answer: until when, by whom, and how it is looked whether that is still there.
pub struct Wait<'a> {
    pub deadline: Deadline,
    pub who: &'a str,
    pub look: &'a mut dyn FnMut() -> Result<()>,
}

impl Requests {
    /// Makes the services. `name` is that of the folder that they are found in.
    ///
    /// # Errors
    /// If shared memory cannot be used.
    pub fn new(name: &str) -> Result<Self> {
        // Pictures come on a topic of the program's, so the bus needs no memory for frames.
        let room = Room::new(name, 1, 1)?;
        let topic = |name: &str| {
            room.node
                .service_builder(&named(name)?)
                .publish_subscribe::<[u8]>()
                .user_header::<FrameHeader>()
                .max_publishers(2)
                .max_subscribers(2)
                .subscriber_max_buffer_size(2)
                .enable_safe_overflow(true)
                .create()
                .map_err(|error| failed(&error))
        };
        let requests = topic("pdk/request")?
            .publisher_builder()
            .initial_max_slice_len(REQUEST)
            .allocation_strategy(AllocationStrategy::PowerOfTwo)
            .create()
            .map_err(|error| failed(&error))?;
        let hear = |name: &str| topic(name)?.subscriber_builder().create().map_err(|error| failed(&error));
        let (replies, frames) = (hear("pdk/reply")?, hear("pdk/frame")?);
        let (request_event, reply_event) =
            (room.bell("pdk/request-event")?, room.listener("pdk/reply-event")?);
        Ok(Self { requests, replies, frames, request_event, reply_event, count: 0, room })
    }

    /// Where the program meets it.
    pub fn room(&self) -> &Room {
        &self.room
    }

    /// Whether a program is at the other end.
    pub fn is_heard(&self) -> bool {
        self.request_event.is_heard()
    }

    /// Asks, and returns the reply. If `fresh`, the program may still be starting, and is asked again and again.
    ///
    /// # Errors
    /// What the program says went wrong, that of `wait.look`, or if no reply comes in time.
    pub fn ask(&mut self, request: &Value, fresh: bool, mut wait: Wait<'_>) -> Result<Value> {
        self.exchange(request, fresh, &mut wait, |_| Ok(()))?
            .ok_or_else(|| nonsense(wait.who, "a picture where none was asked for"))
    }

    /// Asks for the picture of the present state.
    ///
    /// # Errors
    /// As [`Requests::ask`], or if the picture has another size.
    pub fn frame(&mut self, request: &Value, mut into: FrameMut<'_>, mut wait: Wait<'_>) -> Result<()> {
        let (width, height) = (into.width(), into.height());
        let who = wait.who;
        let take = |pixels: &[u8]| {
            let frame = Frame::new(pixels, width, height).map_err(|_| {
                let sentence =
                    format!("a picture of {} bytes; the camera has {width} x {height} x 3", pixels.len());
                nonsense(who, &sentence)
            })?;
            into.copy_from(frame);
            Ok(())
        };
        match self.exchange(request, false, &mut wait, take)? {
            None => Ok(()),
            Some(_) => Err(nonsense(who, "no picture where one was asked for")),
        }
    }

    /// Sends a request until it is answered: with a reply, which is returned, or with a picture, which is taken.
    fn exchange(
        &mut self,
        request: &Value,
        fresh: bool,
        wait: &mut Wait<'_>,
        mut take: impl FnMut(&[u8]) -> Result<()>,
    ) -> Result<Option<Value>> {
        self.count += 1;
        let text = serde_json::to_vec(request)?;
        self.send(&text)?;
        let mut sent = Instant::now();
        loop {
            while let Some(picture) = self.frames.receive().map_err(|error| failed(&error))? {
                if picture.user_header().sequence == self.count {
                    return take(picture.payload()).map(|()| None);
                }
            }
            while let Some(reply) = self.replies.receive().map_err(|error| failed(&error))? {
                // One that comes too late is for another request.
                if reply.user_header().sequence == self.count {
                    return read(reply.payload(), wait.who).map(Some);
                }
            }
            let Some(left) = wait.deadline.left() else {
                return Err(wait.deadline.late(wait.who, "answered"));
            };
            (wait.look)()?;
            if fresh && sent.elapsed() >= AGAIN {
                sent = Instant::now();
                self.send(&text)?;
            }
            self.reply_event.timed_wait(|_| {}, left.min(LOOK)).map_err(|error| failed(&error))?;
        }
    }

    fn send(&self, text: &[u8]) -> Result<()> {
        let mut sample = self.requests.loan_slice_uninit(text.len()).map_err(|error| failed(&error))?;
        *sample.user_header_mut() = FrameHeader { sequence: self.count, ..FrameHeader::default() };
        sample.write_from_slice(text).send().map_err(|error| failed(&error))?;
        self.request_event.ring();
        Ok(())
    }
}

/// A reply, or the error that it tells.
fn read(text: &[u8], who: &str) -> Result<Value> {
    let reply: Value = serde_json::from_slice(text)
        .map_err(|error| nonsense(who, &format!("what is not JSON ({error})")))?;
    match reply["error"].as_str() {
        None => Ok(reply),
        Some(message) => Err(Error::new(format!("{who} failed: {message}"))),
    }
}

/// An answer that cannot be.
pub fn nonsense(who: &str, what: &str) -> Error {
    Error::of(ErrorKind::Nonsense, format!("{who} answered with {what}"))
}
