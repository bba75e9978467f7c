//! Runs the built `pdk` and looks at how it ended.

use std::ffi::OsStr;
use std::io::{Read, Seek, Write};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

/// Nothing that a test waits for takes longer, even on a busy machine. Waits end with what they wait for, so the limit costs no time.
pub const LIMIT: Duration = Duration::from_secs(900);

/// A command line of `pdk`.
pub struct Pdk {
    command: Command,
    /// What `--set` says, each key once.
    settings: Vec<(String, String)>,
}

/// How a process ended.
#[derive(Debug)]
pub struct Finished {
    /// The exit code; none if a signal ended it.
    pub code: Option<i32>,
    /// What it wrote to standard output.
    pub stdout: String,
    /// What it wrote to standard error.
    pub stderr: String,
}

impl Pdk {
    /// `pdk` with these arguments, in an environment of its own: no plugins or scripts of the user's.
    pub fn new<S: AsRef<OsStr>>(arguments: impl IntoIterator<Item = S>) -> Self {
        let mut command = Command::new(crate::built("pdk"));
        command.args(arguments);
        Self { command, settings: Vec::new() }.clean()
    }

    /// Another program, such as a shell that starts `pdk`.
    pub fn program(program: &str) -> Self {
        Self { command: Command::new(program), settings: Vec::new() }.clean()
    }

    fn clean(mut self) -> Self {
        for variable in ["PDK_PLUGIN_PATH", "PDK_SCRIPT_SECONDS", "PDK_SCRIPT_MEGABYTES", "MISBEHAVE"] {
            self.command.env_remove(variable);
        }
        self.command.env("XDG_DATA_HOME", crate::nothing()).stdin(Stdio::null());
        // A shell starts what it runs in the background with SIGINT ignored, and every child inherits that.
        // SAFETY: between fork and exec, `signal` is safe to call and touches no memory.
        unsafe {
            self.command.pre_exec(|| {
                libc::signal(libc::SIGINT, libc::SIG_DFL);
                Ok(())
            });
        }
        self
    }

    /// Adds an argument.
    pub fn arg(mut self, argument: impl AsRef<OsStr>) -> Self {
        self.command.arg(argument);
        self
    }

    /// Adds arguments.
    pub fn args<S: AsRef<OsStr>>(mut self, arguments: impl IntoIterator<Item = S>) -> Self {
        self.command.args(arguments);
        self
    }

    /// Adds `--set KEY=VALUE` at the end, in the place of an earlier value of this key.
    pub fn set(mut self, key: &str, value: impl std::fmt::Display) -> Self {
        self.settings.retain(|(known, _)| known != key);
        self.settings.push((key.to_owned(), value.to_string()));
        self
    }

    /// Adds the plugin whose only work is to misbehave.
    pub fn misbehave(self) -> Self {
        self.arg("--plugins").arg(crate::test_library("misbehave"))
    }

    /// Sets an environment variable.
    pub fn env(mut self, name: &str, value: impl AsRef<OsStr>) -> Self {
        self.command.env(name, value);
        self
    }

    /// Takes everything out of the environment: there is no home, and nothing says where anything is.
    pub fn bare(mut self) -> Self {
        self.command.env_clear();
        self
    }

    /// Runs it as the user with this number, which only root can.
    pub fn user(mut self, number: u32) -> Self {
        self.command.uid(number).gid(number);
        self
    }

    /// Gives it a text as its standard input, which ends behind that.
    ///
    /// # Panics
    /// If there is no place for a file.
    pub fn input(self, text: &str) -> Self {
        let mut file = tempfile::tempfile().unwrap();
        file.write_all(text.as_bytes()).unwrap();
        file.rewind().unwrap();
        self.stdin(file)
    }

    /// Gives it something as its standard input.
    pub fn stdin(mut self, input: impl Into<Stdio>) -> Self {
        self.command.stdin(input);
        self
    }

    /// Sets the working directory.
    pub fn folder(mut self, folder: &Path) -> Self {
        self.command.current_dir(folder);
        self
    }

    /// Starts it, with its output in pipes.
    ///
    /// # Panics
    /// If it cannot be started.
    pub fn spawn(mut self) -> Child {
        for (key, value) in &self.settings {
            self.command.arg("--set").arg(format!("{key}={value}"));
        }
        self.command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
    }

    /// Runs it to its end.
    ///
    /// # Panics
    /// If it has not ended after [`LIMIT`].
    pub fn run(self) -> Finished {
        let what = format!("{:?} {:?}", self.command, self.settings);
        let mut child = self.spawn();
        let (stdout, stderr) = (collect(child.stdout.take()), collect(child.stderr.take()));
        let started = Instant::now();
        let status = loop {
            if let Some(status) = child.try_wait().unwrap() {
                break status;
            }
            if started.elapsed() > LIMIT {
                child.kill().unwrap();
                panic!("{what} has not ended after {} s", LIMIT.as_secs());
            }
            std::thread::sleep(Duration::from_millis(2));
        };
        Finished { code: status.code(), stdout: stdout.join().unwrap(), stderr: stderr.join().unwrap() }
    }

    /// Runs it to its end, which has to be a good one.
    ///
    /// # Panics
    /// If its exit code is not 0.
    pub fn succeed(self) -> Finished {
        let finished = self.run();
        assert_eq!(finished.code, Some(0), "{}{}", finished.stdout, finished.stderr);
        finished
    }

    /// Runs it to its end, which has to be an error: one sentence on standard error that contains all of `parts`.
    /// Returns the sentence.
    ///
    /// # Panics
    /// If it ends otherwise.
    pub fn fail(self, code: i32, parts: &[&str]) -> String {
        let finished = self.run();
        assert_eq!(finished.code, Some(code), "{}{}", finished.stdout, finished.stderr);
        let errors: Vec<_> =
            finished.stderr.lines().filter_map(|line| line.strip_prefix("pdk: error: ")).collect();
        assert_eq!(errors.len(), 1, "not one sentence: {}", finished.stderr);
        for part in parts {
            assert!(errors[0].contains(part), "`{}` does not say `{part}`", errors[0]);
        }
        assert!(!finished.stderr.contains("panicked at kernel"), "{}", finished.stderr);
        assert!(!finished.stderr.contains("RUST_BACKTRACE"), "{}", finished.stderr);
        errors[0].to_owned()
    }
}

fn collect(pipe: Option<impl Read + Send + 'static>) -> std::thread::JoinHandle<String> {
    std::thread::spawn(move || {
        let mut bytes = Vec::new();
        if let Some(mut pipe) = pipe {
            pipe.read_to_end(&mut bytes).unwrap();
        }
        String::from_utf8_lossy(&bytes).into_owned()
    })
}

impl Finished {
    /// Standard output as JSON.
    ///
    /// # Panics
    /// If it is none.
    pub fn json(&self) -> Value {
        serde_json::from_str(&self.stdout)
            .unwrap_or_else(|error| panic!("{error}: {}{}", self.stdout, self.stderr))
    }
}

/// Writes a pipeline to a folder and returns its path.
///
/// # Panics
/// If it cannot be written.
pub fn pipeline(folder: &Path, source: &str) -> PathBuf {
    let path = folder.join("pipeline.lua");
    std::fs::write(&path, source).unwrap();
    path
}

/// The lines of a file, each of which has to be complete JSON.
///
/// # Panics
/// If the file cannot be read or a line is not.
pub fn json_lines(path: &Path) -> Vec<Value> {
    let text = std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    assert!(text.is_empty() || text.ends_with('\n'), "{} ends within a line", path.display());
    text.lines().map(|line| serde_json::from_str(line).unwrap_or_else(|e| panic!("{e}: {line}"))).collect()
}

/// A JSON file.
///
/// # Panics
/// If the file cannot be read or is not JSON.
pub fn json_file(path: &Path) -> Value {
    let text = std::fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    serde_json::from_slice(&text).unwrap()
}

/// Compares results with those of a plain program in `tests/metrics`, if Python has what that needs. Its output is printed.
pub fn compare_in_python(program: &str, arguments: &[&Path]) {
    let python = std::env::var("PDK_TEST_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let has = Command::new(&python).args(["-c", "import numpy, PIL"]).stderr(Stdio::null()).status();
    if !has.is_ok_and(|status| status.success()) {
        return eprintln!("skipped: {python} has no numpy and pillow (set PDK_TEST_PYTHON)");
    }
    let file = crate::repository().join("tests/metrics").join(program);
    let plain = Command::new(&python).arg(file).arg(crate::built("pdk")).args(arguments).output().unwrap();
    println!("{}", String::from_utf8_lossy(&plain.stdout));
    assert!(plain.status.success(), "{plain:?}");
}
