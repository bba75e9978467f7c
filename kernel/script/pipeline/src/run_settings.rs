//! What can be set for every run. The list in this file is the only description of it: `--set`, the flags of `pdk run` and `pdk session`,
//! the names that `pdk.settings` refuses, and the keyword arguments of the Python package follow from it.

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::path::PathBuf;
use std::time::Duration;

use pdk_model::component::ENGINE;
use pdk_model::scenario::parse_seed;
use pdk_model::shard::Shard;
use pdk_sdk::error::{Error, Result};
use pdk_session::connection::Pool;
use pdk_supervise::supervisor::{DEFAULT_MEMORY, DEFAULT_PATIENCE, Limits};

/// Something that can be set for every run.
pub struct Setting {
    /// Its name in `--set` and in Python.
    pub name: &'static str,
    /// What it is, as a part of a sentence.
    pub meaning: &'static str,
    /// What stands behind that in help; may be empty.
    pub details: &'static str,
    /// The short flag and a second long one, for those that have them.
    pub also: &'static [(char, &'static str)],
    /// What stands for its value in help; none for a switch, which has no value.
    pub value_name: Option<&'static str>,
    /// Its type in Python.
    pub python: &'static str,
    read: fn(&mut RunSettings, &OsStr) -> Result<()>,
}

/// Writes [`RunSettings`], its defaults and [`RUN_SETTINGS`] from a list of `field: type = default, form, "meaning", "details"`, with the
/// short flag and a second long one for those that have them.
macro_rules! run_settings {
    ($($name:ident: $type:ty = $default:expr, $form:ident, $meaning:literal, $details:literal
        $(, $short:literal $alias:literal)?;)*) => {
        /// The settings of a run.
        #[derive(Debug, Clone, PartialEq)]
        pub struct RunSettings {
            $(#[doc = $meaning] pub $name: $type,)*
        }

        impl Default for RunSettings {
            fn default() -> Self {
                Self { $($name: $default,)* }
            }
        }

        /// All of them.
        pub static RUN_SETTINGS: &[Setting] = &[$(Setting {
            name: stringify!($name),
            meaning: $meaning,
            details: $details,
            also: &[$(($short, $alias))?],
            value_name: $form.value_name,
            python: $form.python,
            read: |settings, text| {
                settings.$name = ($form.read)(text)?;
                Ok(())
            },
        },)*];
    };
}

run_settings! {
    seed: u64 = 0, SEED, "the seed that all random numbers come from", " [default: 0]";
    workers: Option<usize> = None, WORKERS, "how many scenarios or frames are computed at the same time",
        " [default: one for each processor; one for a simulator that pdk does not start]";
    out: Option<PathBuf> = None, FOLDER, "the folder of the record", " [default: runs/NAME-N]", 'o' "output";
    engine: Option<String> = None, TEXT, "the engine for networks that do not set one, such as onnxruntime", "";
    patience: Duration = DEFAULT_PATIENCE, SECONDS, "how many seconds one call of a component may take", " [default: 60]";
    memory: u64 = DEFAULT_MEMORY, MEBIBYTES, "how much memory a worker may take, in MiB", " [default: 4096]";
    pool: Option<String> = None, COMMAND, "a command that provides workers, in the place of this machine's",
        " (see docs/worker-protocol.md)";
    shard: Option<Shard> = None, SHARD, "which part of the scenarios and frames is computed, such as 1/8",
        "; `pdk merge` puts the parts together";
    keep_errors: bool = false, SWITCH,
        "whether a run that is continued keeps the scenarios in which a component failed", " instead of driving them again";
}

/// How a setting is written.
struct Form<T> {
    value_name: Option<&'static str>,
    python: &'static str,
    read: fn(&OsStr) -> Result<T>,
}

const SEED: Form<u64> =
    Form { value_name: Some("SEED"), python: "int", read: |text| parse_seed(&text.to_string_lossy()) };

/// More workers than this are a mistake.
const MOST_WORKERS: usize = 1024;

const WORKERS: Form<Option<usize>> = Form {
    value_name: Some("WORKERS"),
    python: "int",
    read: |text| {
        let workers = parsed(text).filter(|workers| (1..=MOST_WORKERS).contains(workers));
        workers.map(Some).ok_or_else(|| wrong(text, &format!("a whole number from 1 to {MOST_WORKERS}")))
    },
};

const FOLDER: Form<Option<PathBuf>> = Form {
    value_name: Some("DIR"),
    python: "str | PathLike[str]",
    read: |text| Ok(Some(PathBuf::from(text))),
};

const TEXT: Form<Option<String>> =
    Form { value_name: Some("TEXT"), python: "str", read: |text| written(text).map(Some) };

/// An empty one is none, so that a variable of the shell can be left empty.
const COMMAND: Form<Option<String>> = Form {
    value_name: Some("COMMAND"),
    python: "str",
    read: |text| Ok(Some(written(text)?).filter(|command| !command.is_empty())),
};

const SECONDS: Form<Duration> = Form {
    value_name: Some("SECONDS"),
    python: "float",
    read: |text| {
        let seconds = parsed(text).filter(|&seconds: &f64| seconds > 0.0);
        let duration = seconds.and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
        duration.ok_or_else(|| wrong(text, "a positive number of seconds"))
    },
};

const MEBIBYTES: Form<u64> = Form {
    value_name: Some("MIB"),
    python: "int",
    read: |text| {
        parsed(text).filter(|&memory: &u64| memory > 0).ok_or_else(|| wrong(text, "a positive number of MiB"))
    },
};

const SHARD: Form<Option<Shard>> = Form {
    value_name: Some("3/8"),
    python: "str",
    read: |text| match text.is_empty() {
        true => Ok(None),
        false => written(text)?.parse().map(Some),
    },
};

const SWITCH: Form<bool> = Form {
    value_name: None,
    python: "bool",
    read: |text| parsed(text).ok_or_else(|| wrong(text, "true or false")),
};

fn parsed<T: std::str::FromStr>(text: &OsStr) -> Option<T> {
    text.to_str()?.parse().ok()
}

fn written(text: &OsStr) -> Result<String> {
    text.to_str().map(str::to_owned).ok_or_else(|| wrong(text, "a text in UTF-8"))
}

fn wrong(text: &OsStr, expected: &str) -> Error {
    Error::new(format!("`{}` is not {expected}", text.display()))
}

impl Setting {
    /// Its long flag.
    pub fn flag(&self) -> String {
        self.name.replace('_', "-")
    }

    /// What help says about it.
    pub fn help(&self) -> String {
        let (first, rest) = self.meaning.split_at(1);
        format!("{}{rest}{}", first.to_uppercase(), self.details)
    }

    /// Whether it can have this value.
    ///
    /// # Errors
    /// If not, with what it has to be.
    pub fn check(&self, text: &OsStr) -> Result<()> {
        (self.read)(&mut RunSettings::default(), text)
    }
}

impl RunSettings {
    /// Gives a setting a value.
    ///
    /// # Errors
    /// If it cannot have this value.
    pub fn set(&mut self, setting: &Setting, text: &OsStr) -> Result<()> {
        (setting.read)(self, text)
    }

    /// Where workers come from.
    pub fn pool(&self) -> Pool {
        match (&self.pool, self.workers) {
            (Some(command), _) => Pool::Command(command.clone()),
            (None, Some(workers)) => Pool::Here(workers),
            (None, None) => Pool::Usual,
        }
    }

    /// What workers are held to.
    pub fn limits(&self) -> Limits {
        Limits { patience: self.patience, memory: self.memory }
    }

    /// What takes the place of the defaults of components, by parameter.
    pub fn wanted(&self) -> BTreeMap<&'static str, &str> {
        self.engine.iter().map(|engine| (ENGINE, engine.as_str())).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A default that help names is the default.
    #[test]
    fn help_names_the_defaults() {
        for setting in RUN_SETTINGS {
            let named = setting.details.strip_prefix(" [default: ").and_then(|rest| rest.strip_suffix(']'));
            let mut set = RunSettings::default();
            // A sentence is not a default that could be read.
            if let Some(default) = named.filter(|default| default.parse::<f64>().is_ok()) {
                set.set(setting, OsStr::new(default)).unwrap();
            }
            assert_eq!(set, RunSettings::default(), "{}", setting.name);
        }
    }
}
