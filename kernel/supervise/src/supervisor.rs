//! Runs a part of pdk that calls components in a process of its own, and says how that process ended.

use std::fmt;
use std::io;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::process::{Child, Command, ExitStatus};
use std::time::Duration;

use pdk_model::error::ErrorKind;
use rustix::process::{Pid, Signal};

use crate::calls::{Function, Observed, PAGE_VARIABLE, Seen};

/// How long a component may take for one call, unless the user says otherwise.
pub const DEFAULT_PATIENCE: Duration = Duration::from_secs(60);

/// How much memory a process that runs components may take, in MiB, unless the user says otherwise.
pub const DEFAULT_MEMORY: u64 = 4096;

/// The longest time between two looks at a process.
pub const LOOK: Duration = Duration::from_millis(50);

/// What a process that runs components is held to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// How long one call may take.
    pub patience: Duration,
    /// How much memory the process may take, in MiB.
    pub memory: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Self { patience: DEFAULT_PATIENCE, memory: DEFAULT_MEMORY }
    }
}

/// A process under supervision, with all that it starts itself: they form a process group, which ends with it.
pub struct Supervised {
    child: Child,
    calls: Observed,
    limits: Limits,
}

/// Why a process ended, or was ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum End {
    /// It did its work.
    Done(i32),
    /// It left with an exit code that was not asked for.
    Exited(i32),
    /// It closed its output, went on, and was ended.
    Silent,
    /// A signal ended it.
    Signal(i32),
    /// A call took too long.
    Late(Seen, Duration),
    /// It took more memory, in MiB, than it may.
    Memory(u64),
    /// It said what cannot be read, for this reason, and was ended.
    Unreadable(String),
}

impl Supervised {
    /// Starts a process. `group` says whether it gets a process group of its own, which ends with it; else it shares that of
    /// this process, and with it what is typed at the terminal.
    ///
    /// # Errors
    /// If it cannot be started.
    pub fn start(mut command: Command, limits: Limits, group: bool) -> io::Result<Self> {
        let calls = Observed::new()?;
        command.env(PAGE_VARIABLE, calls.number().to_string());
        if group {
            command.process_group(0);
        }
        Ok(Self { child: command.spawn()?, calls, limits })
    }

    /// The process.
    pub fn child(&mut self) -> &mut Child {
        &mut self.child
    }

    /// Looks whether it is over, or has to be ended; none while it may go on.
    ///
    /// # Errors
    /// If the system does not say.
    pub fn look(&mut self) -> io::Result<Option<End>> {
        if let Some(status) = self.child.try_wait()? {
            return Ok(Some(self.ended(status)));
        }
        let limit = |call: &Seen| match call.function {
            // Nothing that a user asked for is done there.
            Function::Load => self.limits.patience.min(DEFAULT_PATIENCE),
            _ => self.limits.patience,
        };
        if let Some(call) = self.calls.calls().into_iter().find(|call| call.lasting > limit(call)) {
            let patience = limit(&call);
            self.kill();
            return Ok(Some(End::Late(call, patience)));
        }
        if resident(self.child.id()).is_some_and(|memory| memory > self.limits.memory) {
            self.kill();
            return Ok(Some(End::Memory(self.limits.memory)));
        }
        Ok(None)
    }

    /// Waits for its end, which it comes to by itself.
    ///
    /// # Errors
    /// If the system does not say.
    pub fn wait(&mut self) -> io::Result<End> {
        let status = self.child.wait()?;
        Ok(self.ended(status))
    }

    fn ended(&self, status: ExitStatus) -> End {
        match (status.code(), status.signal()) {
            (Some(code), _) if self.calls.is_done() => End::Done(code),
            (Some(code), _) => End::Exited(code),
            (None, signal) => End::Signal(signal.unwrap_or_default()),
        }
    }

    /// What it was or is calling.
    pub fn calls(&self) -> Vec<Seen> {
        self.calls.calls()
    }

    /// Ends it at once, with all that it started, and waits for that.
    pub fn kill(&mut self) {
        kill_group(self.child.id());
        // If it is gone already, all is well.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Drop for Supervised {
    fn drop(&mut self) {
        self.kill();
    }
}

/// Ends all processes of the group that a process leads; nothing if it leads none.
pub fn kill_group(leader: u32) {
    if let Some(leader) = i32::try_from(leader).ok().and_then(Pid::from_raw) {
        // There may be none left.
        let _ = rustix::process::kill_process_group(leader, Signal::KILL);
    }
}

/// Whether a signal comes from outside as a rule: from a user who wants an end, a batch system, or a machine that is short of
/// memory. A component that goes wrong is ended by others.
pub fn is_from_outside(signal: i32) -> bool {
    matches!(signal, libc::SIGKILL | libc::SIGTERM | libc::SIGHUP | libc::SIGINT | libc::SIGQUIT)
}

/// The memory that a process has taken, in MiB; none if the system does not say. Files that it has mapped do not count, because the
/// system takes that memory back when others need it.
pub fn resident(process: u32) -> Option<u64> {
    let text = std::fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let kibibytes = |name: &str| -> Option<u64> {
        let line = text.lines().find_map(|line| line.strip_prefix(name))?;
        line.split_whitespace().next()?.parse().ok()
    };
    let files = kibibytes("RssFile:").unwrap_or_default();
    Some(kibibytes("VmRSS:")?.saturating_sub(files) >> 10)
}

impl End {
    /// What kind of failure it is.
    pub fn kind(&self) -> ErrorKind {
        match self {
            End::Late(..) => ErrorKind::Late,
            End::Unreadable(_) => ErrorKind::Nonsense,
            End::Done(_) | End::Exited(_) | End::Silent | End::Signal(_) | End::Memory(_) => ErrorKind::Lost,
        }
    }

    /// What happened, as a sentence without its end; `calls` are those that were in progress.
    pub fn said(&self, calls: &[Seen]) -> String {
        let culprit = match calls {
            [] => "a component".to_owned(),
            calls => calls.iter().map(ToString::to_string).collect::<Vec<_>>().join(" or "),
        };
        match self {
            End::Done(code) | End::Exited(code) => {
                format!("{culprit} ended the process with exit code {code}")
            }
            End::Silent => format!("{culprit} closed the output of the process and did not end it"),
            End::Signal(signal) => format!("{culprit} was ended by {}", SignalName(*signal)),
            End::Late(call, patience) => format!("{call} has not come back for {} s", patience.as_secs_f64()),
            End::Memory(limit) => format!("{culprit} took more than {limit} MiB of memory"),
            End::Unreadable(why) => {
                let culprit = culprit.replacen("a component", "the process of the components", 1);
                format!("{culprit} answered with what cannot be read ({why})")
            }
        }
    }
}

/// A signal as people know it.
struct SignalName(i32);

impl fmt::Display for SignalName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = match self.0 {
            libc::SIGABRT => " (SIGABRT, it aborted)",
            libc::SIGSEGV => " (SIGSEGV, memory that it may not use)",
            libc::SIGBUS => " (SIGBUS, access to memory that does not exist)",
            libc::SIGILL => " (SIGILL, an instruction that the processor does not have)",
            libc::SIGFPE => " (SIGFPE, an impossible calculation)",
            libc::SIGKILL => " (SIGKILL)",
            libc::SIGTERM => " (SIGTERM)",
            _ => "",
        };
        write!(f, "signal {}{name}", self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shell(script: &str) -> Command {
        let mut command = Command::new("sh");
        command.args(["-c", script]);
        command
    }

    #[test]
    fn every_end_has_its_sentence() {
        let end = |script: &str| {
            let mut process = Supervised::start(shell(script), Limits::default(), true).unwrap();
            let end = process.wait().unwrap();
            end.said(&process.calls())
        };
        assert_eq!(end("exit 3"), "a component ended the process with exit code 3");
        assert_eq!(
            end("kill -SEGV $$"),
            "a component was ended by signal 11 (SIGSEGV, memory that it may not use)"
        );
    }

    #[test]
    fn what_it_started_ends_with_it() {
        let mut process =
            Supervised::start(shell("sleep 1000 & echo; wait"), Limits::default(), true).unwrap();
        let leader = process.child().id();
        std::thread::sleep(Duration::from_millis(100));
        let members = || {
            let tasks =
                std::fs::read_dir("/proc").unwrap().filter_map(|e| e.ok()?.file_name().into_string().ok());
            tasks
                .filter_map(|task| std::fs::read_to_string(format!("/proc/{task}/stat")).ok())
                .filter(|stat| {
                    let fields: Vec<_> = stat.rsplit(')').next().unwrap().split_whitespace().collect();
                    // The state, the parent, the group; a zombie is waiting for its parent only.
                    fields[2] == leader.to_string() && fields[0] != "Z"
                })
                .count()
        };
        assert!(members() >= 2);
        process.kill();
        std::thread::sleep(Duration::from_millis(50));
        assert_eq!(members(), 0);
    }

    #[test]
    fn memory_is_measured() {
        let taken = std::hint::black_box(vec![1u8; 32 << 20]);
        assert!(resident(std::process::id()).is_some_and(|memory| (32..1 << 20).contains(&memory)));
        drop(taken);
        assert!(resident(u32::MAX).is_none());
    }

    #[test]
    fn a_mapped_file_is_not_memory_that_was_taken() {
        let program = std::env::current_exe().unwrap();
        let file = std::fs::File::open(program).unwrap();
        let size = file.metadata().unwrap().len() as usize;
        let (pages, mebibytes) = (64, (64 * size) >> 20);
        assert!(mebibytes >= 16, "{size}");
        let before = resident(std::process::id()).unwrap();
        for _ in 0..pages {
            // SAFETY: a new mapping of a whole file, which nothing writes to while it is read.
            let memory = unsafe {
                rustix::mm::mmap(
                    std::ptr::null_mut(),
                    size,
                    rustix::mm::ProtFlags::READ,
                    rustix::mm::MapFlags::SHARED | rustix::mm::MapFlags::POPULATE,
                    &file,
                    0,
                )
            };
            assert!(memory.is_ok());
        }
        let after = resident(std::process::id()).unwrap();
        assert!(
            after < before + mebibytes as u64 / 2,
            "{before} MiB, then {after} MiB with {mebibytes} MiB of files"
        );
    }
}
