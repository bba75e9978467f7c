//! A program that pdk starts, such as a simulator, and that ends with pdk whatever happens.

use std::io::{PipeWriter, Read};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, Command};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use pdk_sdk::prelude::{Error, ErrorKind, Result};
use rustix::process::{Pid, Signal, kill_process, kill_process_group};

/// How long a program may take to end by itself when it is asked to.
const LEAVE: Duration = Duration::from_secs(2);
/// How much of what it wrote last is kept, in bytes.
const KEPT: usize = 2000;
/// How much of that is quoted in an error, in characters.
const QUOTED: usize = 300;
/// How much of a command is quoted, in characters.
const NAMED: usize = 100;

/// Runs the program in its own process group, with a guard beside it that waits for the end of this process: when the pipe that is its
/// standard input is closed, which the system does at any end of this process, the guard kills the group.
const GUARDED: &str = r#"exec 3<&0 </dev/null
(read -r _ <&3; kill -KILL 0) >/dev/null 2>&1 &
exec 3<&-
exec "$@""#;

/// What is to be started.
#[derive(Debug, Clone, Copy)]
pub struct Launch<'a> {
    /// What it is, such as "simulator".
    pub what: &'static str,
    /// The parameter that names it.
    pub parameter: &'static str,
    /// The program and its arguments.
    pub words: &'a [String],
    /// Variables of its environment, besides those of this process.
    pub environment: &'a [(&'a str, &'a str)],
}

/// A program that was started here. It ends, with all that it started itself, when this is dropped and at any end of this process.
#[derive(Debug)]
pub struct Launched {
    what: &'static str,
    /// The command, as it is named to users.
    command: String,
    child: Child,
    /// While it is open, the guard waits.
    _leash: PipeWriter,
    /// What it wrote last.
    said: Arc<Mutex<Vec<u8>>>,
}

impl Launched {
    /// Starts a program.
    ///
    /// # Errors
    /// If there is no such program, or the system cannot start it.
    pub fn start(launch: &Launch<'_>) -> Result<Self> {
        let Launch { what, parameter, words, environment } = *launch;
        let mistake = |sentence| Error::of(ErrorKind::Configuration, sentence);
        let [program, arguments @ ..] = words else {
            return Err(mistake(format!("`{parameter}` names no program")));
        };
        if !is_there(program) {
            let remedy = match program.contains(' ') && arguments.is_empty() {
                true => format!(
                    "write `{parameter}` as a list of the program and its arguments, such as [\"python3\", \"pilot.py\"]"
                ),
                false => format!("correct `{parameter}`"),
            };
            return Err(mistake(format!(
                "cannot start the {what}: there is no program `{program}`; {remedy}"
            )));
        }
        let cannot = |error: std::io::Error| {
            Error::of(ErrorKind::Configuration, format!("cannot start `{program}`: {error}"))
        };
        let (wait, leash) = std::io::pipe().map_err(cannot)?;
        let (output, input) = std::io::pipe().map_err(cannot)?;
        let mut command = Command::new("/bin/sh");
        command.args(["-c", GUARDED, "guard", program]).args(arguments);
        command.envs(environment.iter().copied());
        command.stdin(wait).stdout(input.try_clone().map_err(cannot)?).stderr(input).process_group(0);
        let child = command.spawn().map_err(cannot)?;
        // The other ends of the pipes are the program's alone.
        drop(command);
        let said = Arc::new(Mutex::new(Vec::new()));
        let kept = Arc::clone(&said);
        std::thread::Builder::new()
            .name("program-output".into())
            .spawn(move || keep_last(output, &kept))
            .map_err(cannot)?;
        Ok(Self { what, command: command_line(words), child, _leash: leash, said })
    }

    /// Says that it has ended, if it has.
    ///
    /// # Errors
    /// How it ended, and what it wrote last.
    pub fn check(&mut self) -> Result<()> {
        match self.child.try_wait() {
            Ok(None) => Ok(()),
            Ok(Some(status)) => {
                // Its last words may still be on their way.
                std::thread::sleep(Duration::from_millis(50));
                Err(Error::of(
                    ErrorKind::Lost,
                    format!("the {} `{}` ended ({status}){}", self.what, self.command, self.last_words()),
                ))
            }
            Err(error) => Err(Error::new(format!("cannot look after `{}`: {error}", self.command))),
        }
    }

    /// The number of its process.
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    fn last_words(&self) -> String {
        let said = self.said.lock().unwrap_or_else(PoisonError::into_inner);
        let text = String::from_utf8_lossy(&said);
        match last_lines(&text) {
            lines if lines.is_empty() => ", and wrote nothing".to_owned(),
            lines => format!(", and wrote last: {lines}"),
        }
    }
}

impl Drop for Launched {
    fn drop(&mut self) {
        let group = i32::try_from(self.child.id()).ok().and_then(Pid::from_raw);
        if let Some(leader) = group
            && matches!(self.child.try_wait(), Ok(None))
            && kill_process(leader, Signal::TERM).is_ok()
        {
            let asked = Instant::now();
            while asked.elapsed() < LEAVE && matches!(self.child.try_wait(), Ok(None)) {
                std::thread::sleep(Duration::from_millis(5));
            }
        }
        // What it started itself, and the guard. There may be none left.
        if let Some(group) = group {
            let _ = kill_process_group(group, Signal::KILL);
        }
        let _ = self.child.wait();
    }
}

/// A program with its arguments as it is named to users: `python3 pilot.py`.
pub fn command_line(words: &[String]) -> String {
    let text = words.iter().flat_map(|word| word.split_whitespace()).collect::<Vec<_>>().join(" ");
    match text.char_indices().nth(NAMED) {
        Some((end, _)) => format!("{} ...", &text[..end]),
        None => text,
    }
}

/// The last lines of a text, as many as are quoted. Lines that only underline another one are left out; of one that is too long by itself
/// it is the end.
fn last_lines(text: &str) -> String {
    let mut room = QUOTED;
    let mut kept = Vec::new();
    for line in text.lines().rev().map(str::trim) {
        if !line.contains(|c: char| !matches!(c, '^' | '~' | ' ')) {
            continue;
        }
        let length = line.chars().count();
        if length > room {
            if kept.is_empty() {
                kept.push(format!("... {}", line.chars().skip(length - room).collect::<String>()));
            }
            break;
        }
        room -= length;
        kept.push(line.to_owned());
    }
    kept.reverse();
    kept.join(" / ")
}

/// Whether a program can be started: a file if it is a path, else one in a folder of `PATH`.
fn is_there(program: &str) -> bool {
    if program.contains('/') {
        return Path::new(program).is_file();
    }
    let path = std::env::var_os("PATH").unwrap_or_default();
    std::env::split_paths(&path).any(|folder| folder.join(program).is_file())
}

/// Reads until the end, and keeps the last bytes.
fn keep_last(mut output: impl Read, kept: &Mutex<Vec<u8>>) {
    let mut part = [0; 4096];
    while let Ok(length @ 1..) = output.read(&mut part) {
        let mut kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
        kept.extend_from_slice(&part[..length]);
        let excess = kept.len().saturating_sub(KEPT);
        kept.drain(..excess);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn start(words: &[&str]) -> Result<Launched> {
        let words: Vec<String> = words.iter().map(|&word| word.to_owned()).collect();
        Launched::start(&Launch {
            what: "simulator",
            parameter: "launch",
            words: &words,
            environment: &[("COLOR", "red")],
        })
    }

    fn shell(script: &str) -> Launched {
        start(&["sh", "-c", script]).unwrap()
    }

    /// The members of a process group that are not only waiting for their parent.
    fn members(group: u32) -> usize {
        let ids = std::fs::read_dir("/proc")
            .unwrap()
            .filter_map(|entry| entry.unwrap().file_name().into_string().ok());
        ids.filter_map(|id| std::fs::read_to_string(format!("/proc/{id}/stat")).ok())
            .filter(|stat| {
                let fields: Vec<_> = stat.rsplit(')').next().unwrap().split_whitespace().collect();
                fields[2] == group.to_string() && fields[0] != "Z"
            })
            .count()
    }

    fn comes_true(mut done: impl FnMut() -> bool) -> bool {
        let began = Instant::now();
        while !done() {
            if began.elapsed() > Duration::from_secs(5) {
                return false;
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        true
    }

    #[test]
    fn what_cannot_be_started_is_named() {
        let error = start(&["/no/such/program"]).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Configuration);
        assert!(error.message().contains("`/no/such/program`"));
        assert!(start(&["no-such-program"]).is_err());
    }

    #[test]
    fn lines_are_quoted_whole_and_from_the_end() {
        let long = "x".repeat(250);
        let traceback = format!(
            "{long}\n  File \"pilot.py\", line 3\n    net(frame)\n    ~~~^^^^^^^\nValueError: my network broke\n"
        );
        assert_eq!(
            last_lines(&traceback),
            "File \"pilot.py\", line 3 / net(frame) / ValueError: my network broke"
        );
        assert_eq!(last_lines(&"y".repeat(1000)), format!("... {}", "y".repeat(QUOTED)));
        assert_eq!(last_lines(" \n^^^\n"), "");
        let words = ["python3".to_owned(), "pilot.py".to_owned(), "a\nb".to_owned()];
        assert_eq!(command_line(&words), "python3 pilot.py a b");
        assert!(command_line(&["z".repeat(500)]).ends_with("z ..."));
    }

    #[test]
    fn an_early_end_is_reported_with_the_last_output() {
        let mut ended = shell("echo cannot open $COLOR display >&2; exit 3");
        assert!(comes_true(|| ended.check().is_err()));
        let error = ended.check().unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Lost);
        assert!(error.message().contains("exit status: 3"), "{error}");
        assert!(error.message().ends_with("wrote last: cannot open red display"), "{error}");
    }

    #[test]
    fn what_it_started_ends_with_it_even_where_it_does_not_listen() {
        let simulator = shell("trap '' TERM; sleep 1000 & sleep 1000 & wait; sleep 1000");
        let group = simulator.id();
        // Two that sleep, their shell and the guard.
        assert!(comes_true(|| members(group) == 4), "{}", members(group));
        drop(simulator);
        assert!(comes_true(|| members(group) == 0));
    }

    /// The guard sees the end of the pipe, however it is closed.
    #[test]
    fn it_ends_when_the_process_that_started_it_is_gone() {
        let mut simulator = shell("sleep 1000 & exec sleep 1000");
        let group = simulator.id();
        assert!(comes_true(|| members(group) == 3));
        let (_, other) = std::io::pipe().unwrap();
        drop(std::mem::replace(&mut simulator._leash, other));
        assert!(comes_true(|| members(group) == 0));
    }
}
