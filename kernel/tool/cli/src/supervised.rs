//! Verbs that call components do so in a process that this one looks after: a component that crashes, hangs or ends its process
//! is an error with a sentence, whatever it wrote or did not write before.

use std::os::unix::process::CommandExt;
use std::process::{Command, ExitCode};
use std::time::{Duration, Instant};

use pdk_notice::eprintln;
use pdk_sdk::error::{Place, Result};
use pdk_supervise::supervisor::{DEFAULT_MEMORY, End, LOOK, Limits, Supervised};

/// How much more memory a process may take for each processor after the first, in MiB: verbs work on a frame on each of them.
const MEMORY_EACH: u64 = 1024;

/// The exit code of a verb that a component ended.
pub const ENDED: u8 = 70;
/// The exit code of a verb that was ended because a component did not come back.
pub const LATE: u8 = 75;

/// How long one call may take: long enough to prepare a clip of many minutes.
const PATIENCE: Duration = Duration::from_secs(600);

/// How much memory a verb may take.
#[derive(Clone, Copy, Default, clap::Args)]
pub struct Memory {
    /// How much memory the process with the components may take, in MiB [default: 4096, and 1024 more for each processor after the first]
    #[arg(long, value_name = "MIB", value_parser = clap::value_parser!(u64).range(1..))]
    memory: Option<u64>,
}

impl Memory {
    /// Of the process of the verb, in MiB.
    fn of_process(self) -> u64 {
        self.memory.unwrap_or_else(|| usual(std::thread::available_parallelism().map_or(1, usize::from)))
    }

    /// Of a worker that it starts, in MiB.
    pub fn of_worker(self) -> u64 {
        self.memory.unwrap_or(DEFAULT_MEMORY)
    }
}

/// How much memory a verb may take with this many processors, in MiB.
fn usual(processors: usize) -> u64 {
    DEFAULT_MEMORY + MEMORY_EACH * (processors as u64).saturating_sub(1)
}

/// Runs this very command line in a process of its own, and says how that ended. `memory` is none for a verb without the option.
///
/// # Errors
/// If it cannot be started.
pub fn run(memory: Option<Memory>) -> Result<ExitCode> {
    let executable = std::env::current_exe().place("cannot find the pdk executable")?;
    let mut command = Command::new(executable);
    command.args(std::env::args_os().skip(1));
    // SAFETY: between fork and exec it makes one system call, and touches no memory.
    unsafe {
        command.pre_exec(|| {
            let end = rustix::process::Signal::KILL;
            Ok(rustix::process::set_parent_process_death_signal(Some(end))?)
        });
    }
    let limits = Limits { patience: PATIENCE, memory: memory.unwrap_or_default().of_process() };
    let mut process =
        Supervised::start(command, limits, false).place("cannot start a process for components")?;
    let started = Instant::now();
    let end = loop {
        if let Some(end) = process.look().place("cannot look after the process of the components")? {
            break end;
        }
        // Short commands are waited for closely.
        std::thread::sleep((started.elapsed() / 20).clamp(Duration::from_millis(1), LOOK));
    };
    let code = match end {
        End::Done(code) => return Ok(ExitCode::from(code as u8)),
        End::Late(..) => LATE,
        End::Exited(_) | End::Silent | End::Signal(_) | End::Memory(_) | End::Unreadable(_) => ENDED,
    };
    let remedy = match end {
        End::Exited(_) => " (a component has to return an error instead of ending its process)",
        End::Memory(_) if memory.is_some() => " (the limit is raised with --memory MIB)",
        _ => "",
    };
    eprintln!("pdk: error: {}{remedy}", end.said(&process.calls()));
    Ok(ExitCode::from(code))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_verb_may_take_more_memory_on_more_processors() {
        assert_eq!([1, 2, 40].map(usual), [4096, 5120, 44032]);
        let given = Memory { memory: Some(300) };
        assert_eq!((given.of_process(), given.of_worker()), (300, 300));
        assert_eq!(Memory::default().of_worker(), DEFAULT_MEMORY);
    }
}
