//! The error of a component: one sentence that names the thing, the place and the remedy.

use std::any::Any;
use std::fmt;

use serde::{Deserialize, Serialize};

/// What went wrong: one sentence for the person who runs pdk, and a kind for the program that has to decide what follows.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Error {
    kind: ErrorKind,
    message: String,
}

/// What follows from an error.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ErrorKind {
    /// It did not work, for a reason that only the sentence tells.
    #[default]
    Failed,
    /// It did not answer in time; it may still be at work.
    Late,
    /// The connection or the process is gone: a new one may work.
    Lost,
    /// It answered with something that cannot be, such as a number that is not finite or a frame of the wrong size.
    Nonsense,
    /// The user has to change something before it can work, on this machine at least: a path, a parameter, an installation, a disk that
    /// is full, a port that is taken. It says nothing about a scenario, so it is never an outcome; what one scenario asks for in vain,
    /// such as a road, is [`Failed`](Self::Failed).
    Configuration,
    /// A component panicked: the instance is of no more use.
    Panic,
    /// The file or folder is not of the kind that this component reads, so that another one may read it. Said by dataset readers of
    /// what they do not recognise.
    Unsuitable,
}

impl ErrorKind {
    /// All kinds.
    pub const ALL: [Self; 7] = [
        Self::Failed,
        Self::Late,
        Self::Lost,
        Self::Nonsense,
        Self::Configuration,
        Self::Panic,
        Self::Unsuitable,
    ];
}

/// The result of everything a component does.
pub type Result<T, E = Error> = std::result::Result<T, E>;

impl Error {
    /// An error that says `message`, of which nothing else follows.
    pub fn new(message: impl Into<String>) -> Self {
        Self::of(ErrorKind::Failed, message)
    }

    /// An error of a kind. The numbers that the standard library puts behind errors of the system are left out, because they do not help a user.
    pub fn of(kind: ErrorKind, message: impl Into<String>) -> Self {
        Self { kind, message: without_numbers(message.into()) }
    }

    /// Puts the place before the message: `"{place}: {message}"`. The kind stays.
    pub fn at(self, place: impl fmt::Display) -> Self {
        Self { kind: self.kind, message: format!("{place}: {}", self.message) }
    }

    /// What follows from it.
    pub fn kind(&self) -> ErrorKind {
        self.kind
    }

    /// The sentence.
    pub fn message(&self) -> &str {
        &self.message
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for Error {}

/// The message without ` (os error 2)` and the like.
fn without_numbers(mut message: String) -> String {
    const BEFORE: &str = " (os error ";
    let mut from = 0;
    while let Some(start) = message[from..].find(BEFORE).map(|at| from + at) {
        let digits = start + BEFORE.len();
        let count = message[digits..].bytes().take_while(u8::is_ascii_digit).count();
        match count > 0 && message[digits + count..].starts_with(')') {
            true => message.replace_range(start..digits + count + 1, ""),
            false => from = digits,
        }
    }
    message
}

impl From<String> for Error {
    fn from(message: String) -> Self {
        Self::new(message)
    }
}

impl From<&str> for Error {
    fn from(message: &str) -> Self {
        Self::new(message)
    }
}

/// What the machine lacks, only the user can change.
impl From<&std::io::Error> for ErrorKind {
    fn from(error: &std::io::Error) -> Self {
        use std::io::ErrorKind as Io;
        // The standard library has no kind for the number of files that may be open: of a process, and of the system.
        const TOO_MANY_FILES: [i32; 2] = [24, 23];
        match error.kind() {
            Io::StorageFull
            | Io::QuotaExceeded
            | Io::FileTooLarge
            | Io::ReadOnlyFilesystem
            | Io::PermissionDenied
            | Io::OutOfMemory
            | Io::AddrInUse => Self::Configuration,
            _ if error.raw_os_error().is_some_and(|number| TOO_MANY_FILES.contains(&number)) => {
                Self::Configuration
            }
            _ => Self::Failed,
        }
    }
}

impl From<std::io::Error> for Error {
    fn from(error: std::io::Error) -> Self {
        Self::of(ErrorKind::from(&error), error.to_string())
    }
}

impl From<serde_json::Error> for Error {
    fn from(error: serde_json::Error) -> Self {
        Self::new(error.to_string())
    }
}

/// Names the place of an error where it is passed on.
pub trait Place<T> {
    /// Turns the error into `"{place}: {error}"`. An [`Error`] keeps its kind.
    ///
    /// # Errors
    /// The error of `self`, with its place.
    fn place(self, place: impl fmt::Display) -> Result<T>;
}

impl<T, E: fmt::Display + 'static> Place<T> for std::result::Result<T, E> {
    fn place(self, place: impl fmt::Display) -> Result<T> {
        self.map_err(|error| {
            let any = &error as &dyn Any;
            let of_system = || any.downcast_ref::<std::io::Error>().map(ErrorKind::from);
            let kind = any.downcast_ref::<Error>().map(Error::kind).or_else(of_system).unwrap_or_default();
            Error::of(kind, format!("{place}: {error}"))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_leaves_the_kind_as_it_is() {
        let lost = || Error::of(ErrorKind::Lost, "it is gone");
        assert_eq!(lost().at("frame 3"), Error::of(ErrorKind::Lost, "frame 3: it is gone"));
        assert_eq!(Err::<(), _>(lost()).place("frame 3"), Err(lost().at("frame 3")));
        let plain: Result<(), Error> = Err::<(), _>("it is gone").place("frame 3");
        assert_eq!(plain.unwrap_err().kind(), ErrorKind::Failed);
    }

    #[test]
    fn what_the_machine_lacks_is_for_the_user_to_change() {
        let kind = |number: i32| Error::from(std::io::Error::from_raw_os_error(number)).kind();
        // No file, and a connection that is refused; permission, too many files, a file too large, no space, a read-only disk, a quota,
        // a port.
        assert_eq!([2, 111].map(kind), [ErrorKind::Failed; 2]);
        assert_eq!([13, 24, 23, 27, 28, 30, 122, 98].map(kind), [ErrorKind::Configuration; 8]);
        let full = Err::<(), _>(std::io::Error::from_raw_os_error(28)).place("the cache").unwrap_err();
        assert_eq!(full, Error::of(ErrorKind::Configuration, "the cache: No space left on device"));
    }

    #[test]
    fn numbers_of_system_errors_are_left_out() {
        let error = std::io::Error::from_raw_os_error(111);
        assert!(error.to_string().contains("(os error 111)"));
        let said = Error::new(format!("the server is not running ({error}); start it: {error}"));
        assert_eq!(
            said.message(),
            "the server is not running (Connection refused); start it: Connection refused"
        );
        for kept in ["a (os error )", "a (os error 1", "(os error 2)", " (os error x)"] {
            assert_eq!(Error::new(kept).message(), kept);
        }
    }

    #[test]
    fn kinds_are_written_in_words() {
        let written = serde_json::to_value(ErrorKind::ALL).unwrap();
        let words = ["failed", "late", "lost", "nonsense", "configuration", "panic", "unsuitable"];
        assert_eq!(written, serde_json::json!(words));
    }
}
