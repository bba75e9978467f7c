//! Ways to end the process.

/// A way to end the process.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ending {
    /// As a program that is done: what was registered for the end is run.
    Exit,
    /// As after a fatal error, by SIGABRT.
    Abort,
    /// By SIGSEGV, from a write to where there is no memory.
    Segfault,
    /// By SIGKILL, which nothing can catch.
    Kill,
    /// At once and with success: nothing that was registered for the end is run.
    Quit,
}

impl Ending {
    /// The ending with this name.
    pub fn named(name: &str) -> Option<Self> {
        Some(match name {
            "exit" => Self::Exit,
            "abort" => Self::Abort,
            "segfault" => Self::Segfault,
            "kill" => Self::Kill,
            "quit" => Self::Quit,
            _ => return None,
        })
    }
}

/// Ends the process.
pub fn end(ending: Ending) {
    match ending {
        Ending::Exit => std::process::exit(0),
        Ending::Abort => std::process::abort(),
        Ending::Segfault => {
            // The compiler must not know that it is null, or it could leave the write out.
            let nowhere = std::hint::black_box(std::ptr::null_mut::<u8>());
            // SAFETY: none. The processor refuses the write, and the system ends the process, which is what is asked for.
            unsafe { nowhere.write_volatile(1) };
        }
        Ending::Kill => {
            // SAFETY: sends a signal to this process, and touches no memory.
            unsafe { libc::raise(libc::SIGKILL) };
        }
        // SAFETY: ends the process, and touches no memory.
        Ending::Quit => unsafe { libc::_exit(0) },
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::process::ExitStatusExt;
    use std::process::{Command, Stdio};

    use super::*;

    /// Tells the child which ending is its own.
    const ENDING: &str = "MISBEHAVE_TEST_ENDING";

    /// The path of a test of this module, as the program takes it: without the name of the program.
    fn path_of(test: &str) -> String {
        format!("{}::{test}", module_path!().split_once("::").unwrap().1)
    }

    #[test]
    fn every_ending_is_the_one_that_it_is_called() {
        if let Ok(name) = std::env::var(ENDING) {
            end(Ending::named(&name).unwrap());
            unreachable!("{name} has not ended the process");
        }
        for (name, signal) in [
            ("exit", None),
            ("abort", Some(libc::SIGABRT)),
            ("segfault", Some(libc::SIGSEGV)),
            ("kill", Some(libc::SIGKILL)),
            ("quit", None),
        ] {
            let mut child = Command::new(std::env::current_exe().unwrap());
            child.arg("--exact").arg(path_of("every_ending_is_the_one_that_it_is_called"));
            let status =
                child.env(ENDING, name).stdout(Stdio::null()).stderr(Stdio::null()).status().unwrap();
            assert_eq!(status.signal(), signal, "{name}");
            assert_eq!(status.code(), signal.is_none().then_some(0), "{name}");
        }
        assert_eq!(Ending::named("behave"), None);
    }
}
