//! The reading side: what a viewer, a recorder or a driver in another process opens.

use std::{
    collections::BTreeMap,
    io::Read,
    path::{Path, PathBuf},
    time::{Duration, Instant, SystemTime},
};

use iceoryx2::port::ReceiveError;

use crate::{
    base::base,
    error::{Error, Result},
    layout::{ANNOUNCEMENT_FILE, LATEST, check_run_id},
    link::{Link, Message},
    message::Topic,
    root::{LivingRoot, living, options},
};

/// How often a tap looks for a run that is not there yet, or for another loop in place of one that ended.
const LOOK_AGAIN: Duration = Duration::from_millis(20);
/// A waiting tap polls: at first giving way to other threads, then sleeping longer and longer up to this.
const LONGEST_SLEEP: Duration = Duration::from_micros(500);
const FIRST_SLEEP: Duration = Duration::from_micros(20);
const POLLS_BEFORE_SLEEP: u32 = 50;
/// Bytes of an announcement that are read.
const LARGEST_ANNOUNCEMENT: u64 = 16 << 20;

/// A run that is publishing at this moment.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RunTopics {
    /// The run id.
    pub run: String,
    /// When the newest of its loops started.
    pub started: SystemTime,
    /// Its loops, by ascending slot.
    pub slots: Vec<SlotTopics>,
}

/// A loop that is publishing at this moment.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SlotTopics {
    /// The number of the loop within the run.
    pub slot: u32,
    /// The process that runs it.
    pub process: u32,
    /// The folder of its bus.
    pub root: PathBuf,
}

impl SlotTopics {
    /// What the loop announced last ([`Bus::announce`](crate::Bus::announce)); none if it has not announced anything or has ended.
    pub fn announced(&self) -> Option<String> {
        let mut text = String::new();
        let file = options().open(self.root.join(ANNOUNCEMENT_FILE)).ok()?;
        file.take(LARGEST_ANNOUNCEMENT).read_to_string(&mut text).ok()?;
        Some(text)
    }
}

/// A reader of one topic of one loop.
///
/// Up to seven taps read a topic at the same time, each with a queue of eight messages that loses the oldest
/// when it is full; [`lost`](Self::lost) counts those.
///
/// If a loop has ended or died and another takes its slot in the same run, the tap goes on with that one: after
/// the last message of the old comes the first that the new one sends once the tap has found it. Then the numbers
/// in the headers start again, and frames may be of another size.
#[derive(Debug)]
pub struct Tap {
    base: PathBuf,
    run: String,
    slot: u32,
    topic: Topic,
    link: Link,
    looked: Instant,
    expected: Option<u64>,
    lost: u64,
}

impl Tap {
    /// The runs that publish at this moment, the one that started last first.
    ///
    /// # Errors
    /// If the base is not this user's alone, or cannot be read.
    pub fn list() -> Result<Vec<RunTopics>> {
        list_below(&base()?)
    }

    /// Opens a topic of a slot of a run, or of the [`LATEST`] run that has this slot. If there is none yet,
    /// waits for it up to `timeout`: a tap may be started before its run.
    ///
    /// # Errors
    /// No such run within `timeout`, too many taps, a base that is not this user's alone.
    pub fn open(run: &str, slot: u32, topic: Topic, timeout: Duration) -> Result<Self> {
        let base = base()?;
        if run != LATEST {
            check_run_id(run)?;
        }
        let start = Instant::now();
        loop {
            if let Some(found) = find(&base, Some(run).filter(|run| *run != LATEST), slot)?
                && let Some(link) = Link::open(&found.path, topic)?
            {
                let looked = Instant::now();
                return Ok(Self { base, run: found.run, slot, topic, link, looked, expected: None, lost: 0 });
            }
            let left = timeout.saturating_sub(start.elapsed());
            if left.is_zero() {
                return Err(nothing_to_tap(&base, run, slot, topic, timeout));
            }
            std::thread::sleep(left.min(LOOK_AGAIN));
        }
    }

    /// The id of the run: the real one where [`LATEST`] was asked for.
    pub fn run(&self) -> &str {
        &self.run
    }

    /// The number of the loop within the run.
    pub fn slot(&self) -> u32 {
        self.slot
    }

    /// The topic.
    pub fn topic(&self) -> Topic {
        self.topic
    }

    /// How many messages were sent since the first one received that this tap was too slow for. Those that a loop
    /// sent before the tap found it do not count.
    pub fn lost(&self) -> u64 {
        self.lost
    }

    /// The oldest message that waits; if none does, waits for one up to `timeout`. `None` after that.
    ///
    /// # Errors
    /// If the caller holds two frames already, or the next loop in this slot cannot be tapped.
    pub fn receive(&mut self, timeout: Duration) -> Result<Option<Message>> {
        let start = Instant::now();
        let mut polls = 0;
        let mut sleep = FIRST_SLEEP;
        loop {
            if let Some(message) = self.try_receive()? {
                return Ok(Some(message));
            }
            if self.looked.elapsed() >= LOOK_AGAIN
                && let Some(message) = self.follow()?
            {
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

    /// Whether the loop behind the topic has ended or died, and no other has taken its slot; messages may still
    /// wait.
    ///
    /// # Errors
    /// If the base cannot be read.
    pub fn is_over(&self) -> Result<bool> {
        Ok(!self.link.is_alive() && find(&self.base, Some(&self.run), self.slot)?.is_none())
    }

    /// Goes over to the next loop in this slot if there is one, unless a message of the old one is left.
    fn follow(&mut self) -> Result<Option<Message>> {
        self.looked = Instant::now();
        if self.link.is_alive() {
            return Ok(None);
        }
        // Between the last look into the queue and its death it may have sent more.
        if let Some(message) = self.try_receive()? {
            return Ok(Some(message));
        }
        if let Some(next) = find(&self.base, Some(&self.run), self.slot)?
            && let Some(link) = Link::open(&next.path, self.topic)?
        {
            self.link = link;
            self.expected = None;
        }
        Ok(None)
    }

    fn try_receive(&mut self) -> Result<Option<Message>> {
        let message = self.link.receive().map_err(|error| {
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
            self.lost += number.saturating_sub(self.expected.unwrap_or(number));
            self.expected = Some(number + 1);
        }
        Ok(message)
    }
}

/// The newest loop of a slot, in one run or in any.
fn find(base: &Path, run: Option<&str>, slot: u32) -> Result<Option<LivingRoot>> {
    Ok(living(base, run)?.into_iter().find(|root| root.slot == slot))
}

fn list_below(base: &Path) -> Result<Vec<RunTopics>> {
    let mut runs: BTreeMap<String, RunTopics> = BTreeMap::new();
    // The newest first, so the first of each run says when it started.
    for LivingRoot { run, slot, path, process, started } in living(base, None)? {
        let started = SystemTime::UNIX_EPOCH + started;
        let entry = runs.entry(run.clone()).or_insert(RunTopics { run, started, slots: Vec::new() });
        entry.slots.push(SlotTopics { slot, process, root: path });
    }
    let mut runs: Vec<_> = runs.into_values().collect();
    runs.iter_mut().for_each(|run| run.slots.sort_by_key(|slot| slot.slot));
    runs.sort_by(|a, b| b.started.cmp(&a.started).then_with(|| a.run.cmp(&b.run)));
    Ok(runs)
}

fn nothing_to_tap(base: &Path, run: &str, slot: u32, topic: Topic, timeout: Duration) -> Error {
    let running = match list_below(base) {
        Ok(runs) if !runs.is_empty() => {
            let names: Vec<_> = runs.iter().map(|found| format!("`{}`", found.run)).collect();
            format!("running now: {}", names.join(", "))
        }
        _ => format!("no run publishes below {} at this moment", base.display()),
    };
    let wanted = if run == LATEST { "any run".into() } else { format!("run `{run}`") };
    Error::new(format!(
        "topic `{topic}` of slot {slot} of {wanted} did not appear within {:.1} s ({running}): start the run, or \
         name another",
        timeout.as_secs_f64()
    ))
}
