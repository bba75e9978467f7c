//! A program whose output is read, or that reads what is written to it. It never waits for a reader of its messages, and nothing of it stays behind: it is
//! ended when it is dropped, and when this process is killed. Its memory is limited, and it is given up if it writes
//! nothing for too long.

use std::io::{BufReader, Read, Write};
use std::os::unix::process::CommandExt;
use std::process::{Child, ChildStderr, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::process::{Pid, Signal, kill_process_group};

/// Bytes that are kept of what a program says, from the end.
const KEPT: usize = 800;
/// How long a program may take to end once its output has ended.
const GRACE: Duration = Duration::from_secs(5);
/// How long a program may write nothing before it is given up. A frame of the largest size takes seconds.
const PATIENCE: Duration = Duration::from_secs(60);
/// Bytes of address space that a program may take: a decoder of large frames with all of its threads has room.
const MEMORY: u64 = 8 << 30;
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
    pub fn start(mut command: Command) -> std::io::Result<(Self, Output)> {
        command.stdin(Stdio::null()).stdout(Stdio::piped());
        let mut process = Self::spawn(command)?;
        let Some(output) = process.child.stdout.take() else {
            return Err(std::io::Error::other("it has no output"));
        };
        Ok((process, BufReader::new(Patient { output, patience: PATIENCE })))
    }

    /// Starts a program without output, and gives its input. It has to be written on this thread, as output is read.
    ///
    /// # Errors
    /// If it cannot be started.
    pub fn start_with_input(mut command: Command) -> std::io::Result<(Self, Input)> {
        command.stdin(Stdio::piped()).stdout(Stdio::null());
        let mut process = Self::spawn(command)?;
        let Some(input) = process.child.stdin.take() else {
            return Err(std::io::Error::other("it has no input"));
        };
        // A program that does not read must not hold up this thread for ever.
        rustix::io::ioctl_fionbio(&input, true)?;
        Ok((process, Input { input, patience: PATIENCE }))
    }

    fn spawn(mut command: Command) -> std::io::Result<Self> {
        command.stderr(Stdio::piped());
        // What it starts is ended with it, and a signal of the terminal does not reach it before this process.
        command.process_group(0);
        #[cfg(target_os = "linux")]
        limit(&mut command);
        let (sender, all_said) = channel();
        let said = Arc::new(Mutex::new(Vec::new()));
        // From here on every return ends the program.
        let mut process = Self { child: command.spawn()?, said, all_said };
        let Some(errors) = process.child.stderr.take() else {
            return Err(std::io::Error::other("it has no messages"));
        };
        let said = process.said.clone();
        let listener = std::thread::Builder::new().name("messages of a program".to_owned());
        listener.spawn(move || listen(errors, &said, sender))?;
        Ok(process)
    }

    /// Waits for the end of a program whose output has ended, and ends it if it does not come. Returns whether it ended
    /// well, and the last of what it said.
    pub fn finish(&mut self) -> (bool, String) {
        self.finish_within(GRACE)
    }

    /// Waits for the end of a program whose input has ended, which may have work to do, as [`finish`](Self::finish) does.
    pub fn finish_work(&mut self) -> (bool, String) {
        self.finish_within(PATIENCE)
    }

    fn finish_within(&mut self, grace: Duration) -> (bool, String) {
        let begin = Instant::now();
        let _ = self.all_said.recv_timeout(grace);
        let well = loop {
            match self.child.try_wait() {
                Ok(Some(status)) => break status.success(),
                Ok(None) if begin.elapsed() < grace => std::thread::sleep(LOOK),
                _ => break false,
            }
        };
        self.stop();
        (well, self.said())
    }

    /// Ends the program and what it started, if it has not ended.
    pub fn stop(&mut self) {
        // A number that was waited for may belong to another program by now.
        if let (Ok(None), Some(group)) = (self.child.try_wait(), Pid::from_raw(self.child.id() as i32)) {
            // If it has ended already, so much the better.
            let _ = kill_process_group(group, Signal::KILL);
            let _ = self.child.wait();
        }
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

/// The output of a program.
pub type Output = BufReader<Patient>;

/// Reads from a program that is given up if it writes nothing for too long.
pub struct Patient {
    output: ChildStdout,
    patience: Duration,
}

impl Read for Patient {
    fn read(&mut self, into: &mut [u8]) -> std::io::Result<usize> {
        let mut wanted = [PollFd::new(&self.output, PollFlags::IN)];
        match wait(&mut wanted, self.patience)? {
            true => self.output.read(into),
            false => {
                let seconds = self.patience.as_secs();
                Err(std::io::Error::new(
                    std::io::ErrorKind::TimedOut,
                    format!("it wrote nothing for {seconds} seconds"),
                ))
            }
        }
    }
}

/// The input of a program that is given up if it reads nothing for too long.
pub struct Input {
    input: ChildStdin,
    patience: Duration,
}

impl Write for Input {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        loop {
            match self.input.write(bytes) {
                Err(error) if error.kind() == std::io::ErrorKind::WouldBlock => {
                    let mut wanted = [PollFd::new(&self.input, PollFlags::OUT)];
                    if !wait(&mut wanted, self.patience)? {
                        let seconds = self.patience.as_secs();
                        return Err(std::io::Error::new(
                            std::io::ErrorKind::TimedOut,
                            format!("it read nothing for {seconds} seconds"),
                        ));
                    }
                }
                written => return written,
            }
        }
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.input.flush()
    }
}

/// Waits for one of these; false if none comes in time.
fn wait(wanted: &mut [PollFd<'_>], patience: Duration) -> std::io::Result<bool> {
    let limit = Timespec { tv_sec: patience.as_secs() as i64, tv_nsec: patience.subsec_nanos().into() };
    loop {
        match poll(wanted, Some(&limit)) {
            Ok(count) => return Ok(count > 0),
            Err(rustix::io::Errno::INTR) => {}
            Err(error) => return Err(error.into()),
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

/// Has the system end the program when this process ends in any way, and refuse it more memory than it may take.
#[cfg(target_os = "linux")]
fn limit(command: &mut Command) {
    use rustix::io::Errno;
    use rustix::process::{Resource, Rlimit, getpid, getppid, set_parent_process_death_signal, setrlimit};

    let parent = getpid();
    let ask = move || {
        set_parent_process_death_signal(Some(Signal::KILL))?;
        setrlimit(Resource::As, Rlimit { current: Some(MEMORY), maximum: Some(MEMORY) })?;
        // If the parent ended before it was asked for, the signal never comes.
        match getppid() == Some(parent) {
            true => Ok(()),
            false => Err(Errno::SRCH.into()),
        }
    };
    // SAFETY: between fork and exec only what is safe in a signal handler may be done: these are three system calls, and
    // errors that are a number each, which takes no memory.
    unsafe { command.pre_exec(ask) };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_that_writes_nothing_is_given_up() {
        let mut command = Command::new("sleep");
        command.arg("60");
        let (mut process, output) = Process::start(command).unwrap();
        let mut output = output.into_inner();
        output.patience = Duration::from_millis(50);
        let error = output.read(&mut [0; 8]).unwrap_err();
        assert_eq!(error.kind(), std::io::ErrorKind::TimedOut);
        process.stop();
        assert!(process.child.try_wait().unwrap().is_some());
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn a_program_gets_no_more_memory_than_it_may_take() {
        let mut command = Command::new("sh");
        command.args(["-c", "ulimit -v"]);
        let (_process, mut output) = Process::start(command).unwrap();
        let mut said = String::new();
        output.read_to_string(&mut said).unwrap();
        assert_eq!(said.trim(), (MEMORY >> 10).to_string());
    }
}
