//! Writes a scenario's trace on a thread of its own, so that encoding images does not slow the loop.

use std::cell::RefCell;
use std::path::Path;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;

use pdk_model::scenario::ScenarioId;
use pdk_sdk::error::{Error, Result};
use pdk_sdk::prelude::{Frame, FrameBuf};

use pdk_record::trace::step::{ImageTopic, Step};
use pdk_record::trace::writer::Trace;

use crate::protocol::Drive;

/// Messages that go to the writer together: waking its thread costs the loop more than everything else here.
const BATCH: usize = 32;
/// Batches that may wait for the writer; when they are that many, the loop waits too and nothing is lost.
const QUEUE: usize = 16;
/// Images among them, far fewer because of their size: 50 MB at 1920x1080.
const IMAGES: usize = 8;

/// The loop's end of the recorder.
pub struct Recorder {
    sender: Option<SyncSender<Vec<Message>>>,
    /// Messages that have not been sent yet.
    batch: RefCell<Vec<Message>>,
    /// Batches that were written and can be filled again.
    spare_batches: Receiver<Vec<Message>>,
    /// Frames that can be filled: all [`IMAGES`] of them, less those that wait to be written.
    spare: Receiver<FrameBuf>,
    finished: Receiver<Result<()>>,
    thread: Option<JoinHandle<()>>,
}

enum Message {
    Start(Box<Result<Trace>>),
    Step(Step),
    Image { topic: ImageTopic, sequence: u64, time: f64, frame: FrameBuf },
    Event { time: f64, failure: bool, text: String },
    Road(String),
    Finish,
}

impl Recorder {
    /// Starts the thread.
    ///
    /// # Errors
    /// If the system has no thread left.
    pub fn new() -> Result<Self> {
        let (sender, messages) = sync_channel(QUEUE);
        let (give_back, spare) = sync_channel(IMAGES);
        // There is room for all of them, and `spare` is there to receive.
        for _ in 0..IMAGES {
            let _ = give_back.send(FrameBuf::default());
        }
        let (give_batch_back, spare_batches) = sync_channel(QUEUE);
        let (finish, finished) = sync_channel(1);
        let thread = std::thread::Builder::new()
            .name("recorder".into())
            .spawn(move || write_traces(&messages, &give_batch_back, &give_back, &finish))
            .map_err(|error| Error::new(format!("cannot start the recorder's thread ({error})")))?;
        let batch = RefCell::new(Vec::with_capacity(BATCH));
        Ok(Self { sender: Some(sender), batch, spare_batches, spare, finished, thread: Some(thread) })
    }

    /// Starts the trace of a scenario. Its file is opened here, before components are called: one that closes files that are not
    /// its own, such as standard output, must not come between.
    pub fn start(&self, path: &Path, scenario: &ScenarioId) {
        self.send(Message::Start(Box::new(Trace::create(path, scenario))));
    }

    /// Adds what one step of the loop did.
    pub fn step(&self, step: Step) {
        self.send(Message::Step(step));
    }

    /// Adds a copy of a frame, once a buffer is free for it.
    pub fn image(&self, topic: ImageTopic, sequence: u64, time: f64, frame: Frame<'_>) {
        // Fails only where the thread is gone, which `finish` reports.
        let Ok(mut copy) = self.spare.recv() else { return };
        copy.resize(frame.width(), frame.height());
        copy.as_mut().copy_from(frame);
        self.send(Message::Image { topic, sequence, time, frame: copy });
        // The next image may wait for this one's buffer.
        self.flush();
    }

    /// Adds something that happened.
    pub fn event(&self, time: f64, failure: bool, text: &str) {
        self.send(Message::Event { time, failure, text: text.to_owned() });
    }

    /// Adds the centre line of the driven lane.
    pub fn road(&self, waypoints: String) {
        self.send(Message::Road(waypoints));
    }

    /// Completes the trace: it is on the disk when this returns.
    ///
    /// # Errors
    /// The first thing that went wrong since [`Recorder::start`].
    pub fn finish(&self) -> Result<()> {
        self.send(Message::Finish);
        self.flush();
        self.finished.recv().unwrap_or_else(|_| Err(Error::new("the recorder's thread ended early")))
    }

    fn send(&self, message: Message) {
        let full = {
            let mut batch = self.batch.borrow_mut();
            batch.push(message);
            batch.len() >= BATCH
        };
        if full {
            self.flush();
        }
    }

    /// Hands everything over to the writer.
    fn flush(&self) {
        let empty = self.spare_batches.try_recv().unwrap_or_else(|_| Vec::with_capacity(BATCH));
        let batch = self.batch.replace(empty);
        // Fails only where the thread is gone, which `finish` reports.
        if let Some(sender) = &self.sender {
            let _ = sender.send(batch);
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
    batches: &Receiver<Vec<Message>>,
    give_batch_back: &SyncSender<Vec<Message>>,
    give_back: &SyncSender<FrameBuf>,
    finish: &SyncSender<Result<()>>,
) {
    let mut trace: Option<Result<Trace>> = None;
    for mut batch in batches {
        for message in batch.drain(..) {
            // After an error the rest of the scenario is read but not written; the error waits for `Finish`.
            let result = match (message, &mut trace) {
                (Message::Start(started), _) => {
                    trace = Some(*started);
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
                (Message::Step(step), Some(Ok(trace))) => trace.step(&step),
                (Message::Road(waypoints), Some(Ok(trace))) => trace.road(&waypoints),
                (Message::Image { topic, sequence, time, frame }, trace) => {
                    let result = match trace {
                        Some(Ok(trace)) => trace.image(topic, sequence, time, frame.as_ref()),
                        _ => Ok(()),
                    };
                    // Written or not, it goes back, or the loop would wait for it. Fails only where the loop is gone.
                    let _ = give_back.send(frame);
                    result
                }
                (Message::Event { time, failure, text }, Some(Ok(trace))) => {
                    trace.event(time, failure, &text)
                }
                _ => Ok(()),
            };
            if let Err(error) = result {
                trace = Some(Err(error));
            }
        }
        // The pool is full where the loop was ahead: then this batch is one too many.
        let _ = give_batch_back.try_send(batch);
    }
}

/// Writes a trace in the place of one that was not completed, so that equal failures leave equal records.
pub fn write_trace(drive: &Drive, id: &ScenarioId, message: &str) -> Result<()> {
    let Some(path) = &drive.trace else { return Ok(()) };
    let mut trace = Trace::create(path, id)?;
    trace.event(0.0, false, &drive.name)?;
    trace.event(0.0, true, message)?;
    trace.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// All images are written and none of the buffers is lost, also where a trace cannot be written.
    #[test]
    fn few_images_wait_at_a_time() {
        let folder = std::env::temp_dir().join(format!("pdk-recorder-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let recorder = Recorder::new().unwrap();
        let frame = FrameBuf::new(64, 48);
        let scenario = |file: &str| {
            recorder.start(&folder.join(file), &"00".repeat(16).parse().unwrap());
            for sequence in 0..4 * IMAGES as u64 {
                recorder.image(ImageTopic::Raw, sequence, sequence as f64, frame.as_ref());
            }
            recorder.finish()
        };
        assert!(scenario("missing/trace.mcap").is_err());
        for file in ["first.mcap", "second.mcap"] {
            scenario(file).unwrap();
            let images = pdk_record::trace::reader::TraceReader::open(&folder.join(file)).unwrap().count();
            assert_eq!(images, 4 * IMAGES);
        }
        // Every buffer is back before the trace is complete.
        assert_eq!(recorder.spare.try_iter().count(), IMAGES);
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
