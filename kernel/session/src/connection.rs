//! A session's end of the conversation with a worker, or with a pool of them.

use std::collections::BTreeMap;
use std::io;
use std::os::unix::process::CommandExt;
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::sync::mpsc::Sender;
use std::time::{Duration, Instant};

use pdk_notice::eprintln;
use pdk_sdk::error::{Error, ErrorKind, Place, Result};
use pdk_supervise::supervisor::kill_group;

use pdk_loop::lines::{self, Found};
use pdk_loop::protocol::{FromWorker, Hello, Job, Ready, ToWorker, VERSION};

/// Where workers come from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Pool {
    /// This machine: this many processes of this executable, a slot each.
    Here(usize),
    /// The same, as many as there are processors. Scenarios whose simulator the user has started are all driven by the first one, for
    /// who has started one simulator has one.
    Usual,
    /// A program that speaks the worker protocol, with as many slots as it says; a shell runs the command.
    Command(String),
}

impl Pool {
    /// How many connections there are at most.
    pub fn connections(&self) -> usize {
        match self {
            Self::Here(workers) => (*workers).max(1),
            Self::Usual => std::thread::available_parallelism().map_or(1, usize::from),
            Self::Command(_) => 1,
        }
    }

    /// Whether a connection is a process of this machine with one slot.
    pub fn is_here(&self) -> bool {
        matches!(self, Self::Here(_) | Self::Usual)
    }

    fn command(&self) -> Result<Command> {
        match self {
            Self::Here(_) | Self::Usual => {
                let mut command =
                    Command::new(std::env::current_exe().place("cannot find the pdk executable")?);
                command.arg("worker");
                Ok(command)
            }
            Self::Command(line) => {
                let mut command = Command::new("sh");
                command.args(["-c", &listened_to(&written_out(line))]);
                Ok(command)
            }
        }
    }

    /// As it is named in errors.
    pub fn name(&self) -> String {
        match self {
            Self::Here(_) | Self::Usual => "a worker".to_owned(),
            Self::Command(line) => format!("the pool `{line}`"),
        }
    }
}

/// The pool that the Python package has, by its short name, and what the shell runs for it.
const RAY: (&str, &str) = ("ray", r#"exec "${PDK_PYTHON:-python3}" -m pdk_perturb.ray"#);

/// A command in which the short name of a pool is written out.
fn written_out(line: &str) -> String {
    match line.trim_start().strip_prefix(RAY.0) {
        Some(rest) if rest.is_empty() || rest.starts_with(char::is_whitespace) => format!("{}{rest}", RAY.1),
        _ => line.to_owned(),
    }
}

/// More slots than this are a mistake.
const MOST_SLOTS: u32 = 1 << 16;

/// What the shell runs for a command, so that the output ends when the command closes it: the shell itself keeps no copy, which it would
/// do if it waited for the command in the usual way.
fn listened_to(line: &str) -> String {
    // The shell gives what it does not wait for another input, unless told.
    format!("exec 3<&0\n(\n{line}\n) <&3 3<&- &\nexec >&- <&- 3<&-\nwait $!")
}

/// What a slot is at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Slot {
    /// It can be given a job.
    Free,
    /// It does the job of this number.
    Busy(u64),
    /// It is given nothing any more, since its machine cannot do what it was given.
    Out,
}

/// A process at the other end, with the slots it has.
pub struct Connection {
    child: Child,
    input: Option<ChildStdin>,
    /// Which connection it is, over the whole session.
    pub number: u64,
    /// The number of its first slot.
    pub first_slot: u32,
    /// What each slot is at, once the process has said how many there are.
    pub slots: Option<Vec<Slot>>,
    /// When it was opened.
    pub opened: Instant,
    /// Whether the user has been told that it is waited for.
    pub told: bool,
    /// How often the version of its protocol has grown.
    minor: u32,
    /// Whether the user has been told that it says what is not known here.
    left_out: bool,
}

impl Connection {
    /// Starts a process and says hello. What it says comes as events.
    ///
    /// # Errors
    /// If it cannot be started.
    pub fn open<E: Send + 'static>(
        pool: &Pool,
        hello: &Hello,
        number: u64,
        first_slot: u32,
        events: Sender<E>,
        wrap: impl Fn(u64, Found<FromWorker>) -> E + Send + 'static,
    ) -> Result<Self> {
        let mut command = pool.command()?;
        // A group of its own: what is typed at the terminal is for the session, which ends its workers itself.
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).process_group(0);
        let mut child = command.spawn().place(format_args!("{} cannot be started", pool.name()))?;
        let (Some(mut input), Some(output)) = (child.stdin.take(), child.stdout.take()) else {
            return Err(Error::new(format!("{} has no input or output", pool.name())));
        };
        std::thread::Builder::new()
            .name("worker-output".into())
            .spawn(move || lines::read_all(output, &events, |found| wrap(number, found)))
            .place("cannot start a thread")?;
        // If it is gone already, its end is noticed like any other.
        let _ = lines::write(&mut input, &ToWorker::Hello(hello.clone()));
        Ok(Self {
            child,
            input: Some(input),
            number,
            first_slot,
            slots: None,
            opened: Instant::now(),
            told: false,
            minor: 0,
            left_out: false,
        })
    }

    /// Takes the answer to hello. Slots of these numbers are given nothing.
    ///
    /// # Errors
    /// If the other end speaks another version.
    pub fn ready(&mut self, ready: &Ready, pool: &Pool, out: &BTreeMap<u32, Error>) -> Result<()> {
        if ready.protocol != VERSION {
            return Err(Error::new(format!(
                "{} speaks version {} of the worker protocol, and this pdk version {VERSION}; use the same pdk at both ends",
                pool.name(),
                ready.protocol
            )));
        }
        self.minor = ready.minor;
        let version = env!("CARGO_PKG_VERSION");
        if ready.pdk != version {
            eprintln!(
                "pdk: warning: {} is of pdk {}, and this is pdk {version}; it is used, but results may differ from those of this pdk",
                pool.name(),
                ready.pdk
            );
        }
        if ready.slots == 0 {
            return Err(Error::new(format!(
                "{} says that it has no slots; it needs at least one",
                pool.name()
            )));
        }
        if ready.slots > MOST_SLOTS {
            return Err(Error::new(format!(
                "{} says that it has {} slots; it may have at most {MOST_SLOTS}",
                pool.name(),
                ready.slots
            )));
        }
        let first = self.first_slot;
        let slot = |number: u32| if out.contains_key(&(first + number)) { Slot::Out } else { Slot::Free };
        self.slots = Some((0..ready.slots).map(slot).collect());
        Ok(())
    }

    /// A slot that has nothing to do.
    pub fn free_slot(&self) -> Option<usize> {
        self.slots.as_ref()?.iter().position(|slot| *slot == Slot::Free)
    }

    /// Whether a message of this name is one that the other end knows and this one does not, which is left out.
    pub fn leaves_out(&mut self, message: &str, pool: &Pool) -> bool {
        let unknown = self.slots.is_some() && !FromWorker::NAMES.contains(&message);
        if unknown && !std::mem::replace(&mut self.left_out, true) {
            eprintln!(
                "pdk: warning: {} says `{message}`, which this pdk does not know and leaves out",
                pool.name()
            );
        }
        unknown
    }

    /// Gives a slot a job.
    ///
    /// # Errors
    /// If the other end does not have this work.
    pub fn give(&mut self, slot: usize, job: &Job, pool: &Pool) -> Result<()> {
        if let Some((since, what)) = job.work.came_later().filter(|(since, _)| *since > self.minor) {
            let sentence = format!(
                "{} speaks version {VERSION}.{} of the worker protocol, and {what} came with version {VERSION}.{since}; use a later pdk there",
                pool.name(),
                self.minor
            );
            return Err(Error::of(ErrorKind::Configuration, sentence));
        }
        if let Some(slots) = &mut self.slots {
            slots[slot] = Slot::Busy(job.number);
        }
        if let Some(input) = &mut self.input {
            // As above.
            let _ = lines::write(input, &ToWorker::Job(Box::new(job.clone())));
        }
        Ok(())
    }

    /// Notes that a job is done.
    pub fn release(&mut self, number: u64) {
        for slot in self.slots.iter_mut().flatten().filter(|slot| **slot == Slot::Busy(number)) {
            *slot = Slot::Free;
        }
    }

    /// Takes the slot out that does this job; its number, if there is one.
    pub fn take_out(&mut self, job: u64) -> Option<u32> {
        let slots = self.slots.as_mut()?;
        let place = slots.iter().position(|slot| *slot == Slot::Busy(job))?;
        slots[place] = Slot::Out;
        Some(self.first_slot + place as u32)
    }

    /// Whether it is there and can be given nothing any more.
    pub fn is_out(&self) -> bool {
        self.slots.as_ref().is_some_and(|slots| slots.iter().all(|slot| *slot == Slot::Out))
    }

    /// The jobs that its slots are busy with.
    pub fn jobs(&self) -> Vec<u64> {
        let busy = |slot: &Slot| match slot {
            Slot::Busy(number) => Some(*number),
            Slot::Free | Slot::Out => None,
        };
        self.slots.iter().flatten().filter_map(busy).collect()
    }

    /// Says that there are no more jobs.
    pub fn close(&mut self) {
        self.input = None;
    }

    /// Waits until it has left, and ends it if it does not. How it ended by itself; none if it did not.
    pub fn wait(&mut self, limit: Duration) -> Option<ExitStatus> {
        let until = Instant::now() + limit;
        loop {
            match self.child.try_wait() {
                Ok(Some(status)) => return Some(status),
                Ok(None) if Instant::now() < until => std::thread::sleep(Duration::from_millis(1)),
                Ok(None) | Err(_) => {
                    let _: io::Result<()> = self.kill();
                    return None;
                }
            }
        }
    }

    /// Ends it at once, with all of its group.
    fn kill(&mut self) -> io::Result<()> {
        self.input = None;
        kill_group(self.child.id());
        self.child.kill()?;
        self.child.wait().map(drop)
    }
}

impl Drop for Connection {
    fn drop(&mut self) {
        // It may have ended already.
        let _ = self.kill();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pool_of_the_python_package_has_a_short_name() {
        assert_eq!(written_out("ray"), RAY.1);
        assert_eq!(written_out(" ray --slots 3"), format!("{} --slots 3", RAY.1));
        for other in ["rays", "./ray", "ray-pool 3", "python3 pool.py ray"] {
            assert_eq!(written_out(other), other);
        }
    }
}
