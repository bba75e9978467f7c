//! A program whose output is read. It never waits for a reader of its messages, and nothing of it stays behind: it is
//! ended when it is dropped, and when this process is killed.

use std::io::{BufReader, Read};
use std::process::{Child, ChildStderr, ChildStdout, Command, Stdio};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Bytes that are kept of what a program says, from the end.
const KEPT: usize = 800;
/// How long a program may take to end once its output has ended.
const GRACE: Duration = Duration::from_secs(5);
/// How often is looked whether it has ended.
const LOOK: Duration = Duration::from_millis(5);

/// A running program.
pub struct Process {
    child: Child,
    said: Arc<Mutex<Vec<u8>>>,
    /// Has no sender any more when everything that the program says has been read.
    all_said: Receiver<()>,
}

impl Process {
    /// Starts a program without input, and gives its output. It has to be read on this thread, because on Linux the program
    /// ends with the thread that started it.
    ///
    /// # Errors
    /// If it cannot be started.
    pub fn start(mut command: Command) -> std::io::Result<(Self, BufReader<ChildStdout>)> {
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        #[cfg(target_os = "linux")]
        end_with_this_process(&mut command);
        let (sender, all_said) = channel();
        let said = Arc::new(Mutex::new(Vec::new()));
        // From here on the program is ended on every way out.
        let mut process = Self { child: command.spawn()?, said, all_said };
        let (Some(output), Some(errors)) = (process.child.stdout.take(), process.child.stderr.take()) else {
            return Err(std::io::Error::other("it has no output"));
        };
        let said = process.said.clone();
        let listener = std::thread::Builder::new().name("messages of a program".to_owned());
        listener.spawn(move || listen(errors, &said, sender))?;
        Ok((process, BufReader::new(output)))
    }

    /// Waits for the end of a program whose output has ended, and ends it where it does not come. Returns whether it ended
    /// well, and the last of what it said.
    pub fn finish(&mut self) -> (bool, String) {
        let begin = Instant::now();
        let _ = self.all_said.recv_timeout(GRACE);
        let well = loop {
            match self.child.try_wait() {
                Ok(Some(status)) => break status.success(),
                Ok(None) if begin.elapsed() < GRACE => std::thread::sleep(LOOK),
                _ => break false,
            }
        };
        self.stop();
        (well, self.said())
    }

    /// Ends the program, if it has not ended.
    pub fn stop(&mut self) {
        // If it has ended already, so much the better.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }

    /// The last whole lines of what the program said.
    fn said(&self) -> String {
        let said = self.said.lock().unwrap_or_else(PoisonError::into_inner);
        let text = String::from_utf8_lossy(&said);
        match (said.len() < KEPT, text.split_once('\n')) {
            (false, Some((_, whole))) if !whole.trim().is_empty() => whole.to_owned(),
            _ => text.into_owned(),
        }
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.stop();
    }
}

/// Keeps the last of what a program says. `_all` is dropped at the end, which tells that this is all.
fn listen(mut errors: ChildStderr, said: &Mutex<Vec<u8>>, _all: Sender<()>) {
    let mut bytes = [0; 4096];
    loop {
        match errors.read(&mut bytes) {
            Ok(0) => return,
            Ok(length) => {
                let mut said = said.lock().unwrap_or_else(PoisonError::into_inner);
                said.extend_from_slice(&bytes[..length]);
                let surplus = said.len().saturating_sub(KEPT);
                said.drain(..surplus);
            }
            Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
            Err(_) => return,
        }
    }
}

/// Has the system end the program when this process ends in any way.
#[cfg(target_os = "linux")]
fn end_with_this_process(command: &mut Command) {
    use std::os::unix::process::CommandExt;

    use rustix::io::Errno;
    use rustix::process::{Signal, getpid, getppid, set_parent_process_death_signal};

    let parent = getpid();
    let ask = move || {
        set_parent_process_death_signal(Some(Signal::KILL))?;
        // If the parent ended before it was asked for, the signal never comes.
        match getppid() == Some(parent) {
            true => Ok(()),
            false => Err(Errno::SRCH.into()),
        }
    };
    // SAFETY: between fork and exec only what is safe in a signal handler may be done: these are two system calls, and
    // errors that are a number each, which takes no memory.
    unsafe { command.pre_exec(ask) };
}
