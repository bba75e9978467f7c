//! The publishing side: what the loop owns.

use std::{
    path::Path,
    sync::mpsc::{self, RecvTimeoutError},
    time::Duration,
};

use pdk_model::{control::Control, state::State};

use crate::{
    base::base,
    error::{Error, Result},
    layout::SHARED_MEMORY,
    message::{FORMAT_RGB8, FrameHeader, Stamp, Topic, run_hash},
    root::{Root, living},
    service::config,
    topics::{FRAMES_PER_TOPIC, FrameLoan, Topics},
};

/// How long iceoryx2 may take to make the topics, which takes milliseconds.
const DEADLINE: Duration = Duration::from_secs(10);
/// What shared memory takes at the slowest, in bytes per second of the deadline.
const SLOWEST_MEMORY: u64 = 100 << 20;

/// The four topics of one loop of a run, for publishing.
///
/// One thread's loop owns one bus; the loops of a run differ in their slot number. Dropping the bus takes its
/// topics off the machine. A tap keeps what it has received until then.
#[derive(Debug)]
pub struct Bus {
    run: String,
    header: FrameHeader,
    topics: Topics,
    // Last, so that everything in it is closed when it goes.
    root: Root,
}

impl Bus {
    /// Makes the topics `pdk/{raw,perturbed,control,state}` of a slot of a run, for RGB frames of `width` x
    /// `height` pixels, in a root of their own. The shared memory for all frames is taken and written here: about
    /// 27 frames per frame topic. It takes milliseconds, and gives up after ten seconds (more for very large
    /// frames).
    ///
    /// `run` has 1 to 64 ASCII letters, digits, `-`, `_` and `.`, and no `.` first.
    ///
    /// # Errors
    /// A run id or frame size that cannot be, a slot that another process publishes at this moment, shared
    /// memory that is full, a base that is not this user's alone.
    pub fn create(run: &str, slot: u32, width: u32, height: u32) -> Result<Self> {
        let frame_bytes = frame_bytes(width, height)?;
        let memory = 2 * FRAMES_PER_TOPIC as u64 * frame_bytes as u64;
        check_space(run, slot, memory)?;
        let base = base()?;
        if let Some(other) = living(&base, Some(run))?.iter().find(|other| other.slot == slot) {
            return Err(Error::new(format!(
                "slot {slot} of run `{run}` is published by process {} at this moment: give this run another id, or \
                 this loop another slot",
                other.process
            )));
        }
        let root = Root::create(&base, run, slot)?;
        let config = config(&root.unfinished_config())?;
        let deadline = DEADLINE + Duration::from_secs(memory / SLOWEST_MEMORY);
        let topics = within(deadline, move || Topics::create(&config, frame_bytes))
            .map_err(|error| Error::new(format!("slot {slot} of run `{run}` cannot publish: {error}")))?;
        root.finish()?;
        Ok(Self {
            run: run.to_owned(),
            header: FrameHeader {
                run: run_hash(run),
                slot,
                width,
                height,
                format: FORMAT_RGB8,
                ..Default::default()
            },
            topics,
            root,
        })
    }

    /// The id of the run.
    pub fn run(&self) -> &str {
        &self.run
    }

    /// The number of the loop within the run.
    pub fn slot(&self) -> u32 {
        self.header.slot
    }

    /// The folder of this bus and no other, with which [`remove`](crate::remove) takes it off the machine.
    pub fn root(&self) -> &Path {
        self.root.path()
    }

    /// Announces in a text what the next frames are about, such as the name of the scenario. Whoever lists the runs finds it by
    /// [`SlotTopics::announced`](crate::SlotTopics::announced), until the next announcement.
    ///
    /// # Errors
    /// If the folder of the bus cannot be written.
    pub fn announce(&self, text: &str) -> Result<()> {
        self.root.announce(text).map_err(|error| {
            Error::new(format!(
                "nothing can be announced in {} ({error}): check that it can be written and has space",
                self.root.path().display()
            ))
        })
    }

    /// Lends the memory of the next frame on [`Topic::Raw`] or [`Topic::Perturbed`]: `width * height * 3`
    /// bytes. Two may be on loan per topic; one that is dropped is not sent.
    ///
    /// What the memory holds is unspecified, mostly an earlier frame: **write all of it** before publishing.
    ///
    /// # Errors
    /// A topic that has no frames, or more than two loans.
    pub fn loan_frame(&self, topic: Topic, stamp: Stamp) -> Result<FrameLoan<'_>> {
        let frames = match topic {
            Topic::Raw => &self.topics.raw,
            Topic::Perturbed => &self.topics.perturbed,
            Topic::Control | Topic::State => {
                return Err(Error::new(format!("topic `{topic}` has no frames: use raw or perturbed")));
            }
        };
        frames.loan(self.stamped(stamp), frame_bytes(self.header.width, self.header.height)?)
    }

    /// Sends what the driver answered to the frame with the same stamp.
    ///
    /// # Errors
    /// If the topic's memory is damaged.
    pub fn publish_control(&self, stamp: Stamp, control: Control) -> Result<()> {
        self.topics.control.send(self.stamped(stamp), control.into())
    }

    /// Sends what the vehicle did.
    ///
    /// # Errors
    /// If the topic's memory is damaged.
    pub fn publish_state(&self, stamp: Stamp, state: State) -> Result<()> {
        self.topics.state.send(self.stamped(stamp), state.into())
    }

    fn stamped(&self, stamp: Stamp) -> FrameHeader {
        let Stamp { scenario, sequence, time } = stamp;
        FrameHeader { scenario, sequence, time, ..self.header }
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
fn check_space(run: &str, slot: u32, needed: u64) -> Result<()> {
    let Ok(memory) = rustix::fs::statvfs(SHARED_MEMORY) else { return Ok(()) };
    let free = memory.f_bavail * memory.f_frsize;
    if free < needed {
        return Err(Error::new(format!(
            "slot {slot} of run `{run}` needs {} MiB of shared memory, as each slot with frames of this size does, and /dev/shm \
             has {} MiB left: use fewer workers or smaller frames, or enlarge it (docker run --shm-size=2g; mount -o \
             remount,size=2g /dev/shm; in Kubernetes an emptyDir with medium Memory and a sizeLimit, mounted there)",
            needed.div_ceil(1 << 20),
            free >> 20
        )));
    }
    Ok(())
}

/// Does the work in a thread of its own and waits for it no longer than `deadline`. Work that comes back later
/// finds no receiver for its result and drops it.
fn within<T: Send + 'static>(
    deadline: Duration,
    work: impl FnOnce() -> Result<T> + Send + 'static,
) -> Result<T> {
    let (sender, receiver) = mpsc::sync_channel(0);
    std::thread::Builder::new()
        .name("pdk-bus".into())
        .spawn(move || {
            // Fails if it was too late.
            let _ = sender.send(work());
        })
        .map_err(|error| {
            Error::new(format!("a thread cannot be started ({error}): raise the limit of processes"))
        })?;
    let hung = || format!("the topics did not come up within {} s", deadline.as_secs());
    receiver.recv_timeout(deadline).unwrap_or_else(|error| {
        let reason = match error {
            RecvTimeoutError::Timeout => hung(),
            RecvTimeoutError::Disconnected => "iceoryx2 panicked while making the topics".into(),
        };
        Err(Error::new(format!("{reason}: check that /dev/shm works, and that no other user disturbs it")))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_that_hangs_is_given_up() {
        assert_eq!(within(Duration::from_secs(20), || Ok(5)), Ok(5));
        let (release, hang) = mpsc::channel::<()>();
        let error = within(Duration::from_millis(20), move || {
            let _ = hang.recv();
            Ok(())
        });
        drop(release);
        assert!(error.unwrap_err().message().contains("did not come up within"));
        let failed: Result<()> = within(Duration::from_secs(20), || Err(Error::new("no")));
        assert_eq!(failed, Err(Error::new("no")));
    }
}
