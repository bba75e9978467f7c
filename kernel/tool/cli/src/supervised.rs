//! Verbs that call components do so in a process that this one looks after: a component that crashes, hangs or ends its process
//! is an error with a sentence, whatever it wrote or did not write before.

use std::os::unix::process::CommandExt;
use std::process::{Command, ExitCode};
use std::time::{Duration, Instant};

use pdk_notice::eprintln;
use pdk_sdk::error::{Place, Result};
use pdk_supervise::supervisor::{DEFAULT_MEMORY, End, LOOK, Limits, Supervised};

/// The exit code of a verb that a component ended.
pub const ENDED: u8 = 70;
/// The exit code of a verb that was ended because a component did not come back.
pub const LATE: u8 = 75;

/// How long one call may take: long enough to prepare a clip of many minutes.
const PATIENCE: Duration = Duration::from_secs(600);

/// Runs this very command line in a process of its own, and says how that ended.
///
/// # Errors
/// If it cannot be started.
pub fn run() -> Result<ExitCode> {
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
    let limits = Limits { patience: PATIENCE, memory: DEFAULT_MEMORY };
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
        _ => "",
    };
    eprintln!("pdk: error: {}{remedy}", end.said(&process.calls()));
    Ok(ExitCode::from(code))
}
