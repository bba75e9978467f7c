//! Writes a scenario's trace on a thread of its own, so that encoding images does not slow the loop.

use std::path::PathBuf;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;

use pdk_sdk::error::{Error, Result};
use pdk_sdk::prelude::{Control, Frame, FrameBuf, State};

use crate::record::trace::{ImageTopic, Trace};

/// Messages that may wait for the writer; when they are that many, the loop waits too and nothing is lost.
const QUEUE: usize = 256;

/// The loop's end of the recorder.
pub struct Recorder {
    sender: Option<SyncSender<Message>>,
    /// Frames that were written and can be filled again.
    spare: Receiver<FrameBuf>,
    finished: Receiver<Result<()>>,
    thread: Option<JoinHandle<()>>,
}

enum Message {
    Start(PathBuf),
    Step { sequence: u64, state: State, control: Control, frame_hash: u64 },
    Image { topic: ImageTopic, sequence: u64, time: f64, frame: FrameBuf },
    Event { time: f64, failure: bool, text: String },
    Finish,
}

impl Recorder {
    /// Starts the thread.
    ///
    /// # Errors
    /// Where the system has no thread left.
    pub fn new() -> Result<Self> {
        let (sender, messages) = sync_channel(QUEUE);
        let (give_back, spare) = sync_channel(QUEUE);
        let (finish, finished) = sync_channel(1);
        let thread = std::thread::Builder::new()
            .name("recorder".into())
            .spawn(move || write_traces(&messages, &give_back, &finish))
            .map_err(|error| Error::new(format!("cannot start the recorder's thread ({error})")))?;
        Ok(Self { sender: Some(sender), spare, finished, thread: Some(thread) })
    }

    /// Starts the trace of a scenario.
    pub fn start(&self, path: PathBuf) {
        self.send(Message::Start(path));
    }

    /// Adds what one step of the loop did.
    pub fn step(&self, sequence: u64, state: State, control: Control, frame_hash: u64) {
        self.send(Message::Step { sequence, state, control, frame_hash });
    }

    /// Adds a copy of a frame.
    pub fn image(&self, topic: ImageTopic, sequence: u64, time: f64, frame: Frame<'_>) {
        let mut copy = self.spare.try_recv().unwrap_or_default();
        copy.resize(frame.width(), frame.height());
        copy.as_mut().copy_from(frame);
        self.send(Message::Image { topic, sequence, time, frame: copy });
    }

    /// Adds something that happened.
    pub fn event(&self, time: f64, failure: bool, text: &str) {
        self.send(Message::Event { time, failure, text: text.to_owned() });
    }

    /// Completes the trace.
    ///
    /// # Errors
    /// The first thing that went wrong since [`Recorder::start`].
    pub fn finish(&self) -> Result<()> {
        self.send(Message::Finish);
        self.finished.recv().unwrap_or_else(|_| Err(Error::new("the recorder's thread ended early")))
    }

    fn send(&self, message: Message) {
        // Fails only where the thread is gone, which `finish` reports.
        if let Some(sender) = &self.sender {
            let _ = sender.send(message);
        }
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        self.sender = None;
        if let Some(thread) = self.thread.take() {
            // A panic of the thread has been reported by `finish`.
            let _ = thread.join();
        }
    }
}

fn write_traces(
    messages: &Receiver<Message>,
    give_back: &SyncSender<FrameBuf>,
    finish: &SyncSender<Result<()>>,
) {
    let mut trace: Option<Result<Trace>> = None;
    for message in messages {
        // After an error the rest of the scenario is read but not written; the error waits for `Finish`.
        let result = match (message, &mut trace) {
            (Message::Start(path), _) => {
                trace = Some(Trace::create(&path));
                Ok(())
            }
            (Message::Finish, _) => {
                let result = match trace.take() {
                    Some(trace) => trace.and_then(Trace::finish),
                    None => Ok(()),
                };
                if finish.send(result).is_err() {
                    return;
                }
                Ok(())
            }
            (Message::Step { sequence, state, control, frame_hash }, Some(Ok(trace))) => {
                trace.step(sequence, &state, control, frame_hash)
            }
            (Message::Image { topic, sequence, time, frame }, Some(Ok(trace))) => {
                let result = trace.image(topic, sequence, time, frame.as_ref());
                // The pool is full where the loop was ahead: then this frame is one too many.
                let _ = give_back.try_send(frame);
                result
            }
            (Message::Event { time, failure, text }, Some(Ok(trace))) => trace.event(time, failure, &text),
            _ => Ok(()),
        };
        if let Err(error) = result {
            trace = Some(Err(error));
        }
    }
}
