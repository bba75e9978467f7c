//! For tests: programs in place of ffmpeg, and limits of time.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};

/// A program that does what `script` says, in place of ffmpeg. Another process writes it: a file that this one has open
/// for writing is inherited by whatever another test starts meanwhile, and then it cannot be run ("text file busy").
pub fn program(folder: &Path, script: &str) -> PathBuf {
    let (text, path) = (folder.join("script"), folder.join("ffmpeg"));
    std::fs::write(&text, format!("#!/bin/sh\n{script}\n")).unwrap();
    let installed = Command::new("install").args(["-m", "755"]).args([&text, &path]).status().unwrap();
    assert!(installed.success());
    path
}

/// What `work` gives, which may not take longer than this many seconds.
pub fn within<T: Send + 'static>(seconds: u64, work: impl FnOnce() -> T + Send + 'static) -> T {
    let (sender, receiver) = channel();
    std::thread::spawn(move || sender.send(work()));
    receiver
        .recv_timeout(Duration::from_secs(seconds))
        .unwrap_or_else(|_| panic!("it takes more than {seconds} s"))
}

/// Waits until something is so, at most a minute.
pub fn wait_until(what: &str, mut so: impl FnMut() -> bool) {
    let begin = Instant::now();
    while !so() {
        assert!(begin.elapsed() < Duration::from_secs(60), "not so after a minute: {what}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// Whether the process whose number a stand-in has written to a file runs. One that ended and has not been asked for its
/// exit code does not.
#[cfg(target_os = "linux")]
pub fn runs(file: &Path) -> bool {
    let number = std::fs::read_to_string(file).unwrap();
    let state = std::fs::read_to_string(format!("/proc/{}/stat", number.trim()));
    state.is_ok_and(|state| !state.rsplit(')').next().unwrap().trim_start().starts_with(['Z', 'X']))
}
