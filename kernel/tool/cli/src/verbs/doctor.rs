//! `pdk doctor`: what is installed, what is missing, what to do.

mod engines;
mod simulator;

use std::path::Path;

use pdk_components::installation;
use pdk_components::product;
use pdk_components::registry::Registry;
use pdk_components::search_path::{self, PATH_VARIABLE};
use pdk_lua::LuaScripts;
use pdk_notice::println;
use pdk_pipeline::settings::Override;
use pdk_sdk::SDK_VERSION;
use pdk_sdk::abi::pdk_abi;
use pdk_sdk::cache::{self, Cache};
use pdk_sdk::describe::Kind;
use pdk_sdk::error::{Error, Result};
use serde_json::json;

use super::{Global, print_json};

/// Arguments of `pdk doctor`
#[derive(clap::Args)]
pub struct Arguments {
    /// Connect to this simulator, drive ten frames, and say what was found
    #[arg(long, value_name = "NAME")]
    simulator: Option<String>,
    /// Set a parameter of the simulator, such as its port
    #[arg(long = "set", value_name = "PARAMETER=VALUE", requires = "simulator")]
    values: Vec<Override>,
}

/// One thing that was looked at.
struct Finding {
    subject: &'static str,
    state: State,
    text: String,
}

#[derive(Clone, Copy, PartialEq)]
enum State {
    Good,
    /// Works, but something could be better.
    Note,
    Bad,
}

impl State {
    fn mark(self) -> &'static str {
        match self {
            State::Good => "ok  ",
            State::Note => "note",
            State::Bad => "BAD ",
        }
    }
}

/// Looks at everything that pdk needs. Fails where something does not work.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    if let Some(name) = &arguments.simulator {
        let findings = simulator::examine(&global.registry()?, name, &arguments.values)?;
        return print(global, &findings);
    }
    let search = global.search_path();
    let version = format!(
        "pdk {}, for plugins of version {} of the interface, SDK {SDK_VERSION}",
        env!("CARGO_PKG_VERSION"),
        pdk_abi::VERSION
    );
    let mut findings = vec![Finding { subject: "version", state: State::Good, text: version }, libraries()];
    // If a part of pdk is missing there are no components, and that has been said.
    match Registry::discover(&search, Box::new(LuaScripts::new(&search))) {
        Ok(registry) => {
            findings.push(components(&registry));
            findings.extend(engines::findings(&registry));
            findings.extend(registry.refused().iter().map(|error| Finding {
                subject: "left out",
                state: State::Bad,
                text: error.to_string(),
            }));
            findings.extend(registry.skipped().iter().map(|skipped| Finding {
                subject: "left out",
                state: State::Note,
                text: skipped.clone(),
            }));
        }
        Err(error) if installation::libraries().is_ok() => {
            findings.push(Finding { subject: "components", state: State::Bad, text: error.to_string() });
        }
        Err(_) => {}
    }
    findings.extend([sdk(), plugin_folders(), cache_folder(), routing(), video(), ffmpeg()]);
    findings.extend(variables());
    print(global, &findings)
}

/// Prints what was found. Fails where something does not work.
fn print(global: &Global, findings: &[Finding]) -> Result<()> {
    if global.json {
        let list: Vec<_> = findings
            .iter()
            .map(|f| json!({ "subject": f.subject, "state": f.state.mark().trim().to_lowercase(), "text": f.text }))
            .collect();
        print_json(&json!(list))?;
    } else {
        for finding in findings {
            println!("{} {:<10} {}", finding.state.mark(), finding.subject, finding.text);
        }
    }
    match findings.iter().filter(|finding| finding.state == State::Bad).count() {
        0 => Ok(()),
        bad => Err(Error::new(format!("{bad} of the points above need attention"))),
    }
}

/// The executable and the libraries that belong to it.
fn libraries() -> Finding {
    let place = installation::libraries().and_then(|_| {
        let (executable, libraries) = (installation::executable_folder()?, installation::library_folder()?);
        Ok(format!(
            "{} libraries in {} for pdk in {}",
            product::get().plugins.len(),
            libraries.display(),
            executable.display()
        ))
    });
    finding("libraries", place)
}

/// What is good if it is there and bad if it is an error.
fn finding(subject: &'static str, found: Result<String>) -> Finding {
    match found {
        Ok(text) => Finding { subject, state: State::Good, text },
        Err(error) => Finding { subject, state: State::Bad, text: error.to_string() },
    }
}

fn components(registry: &Registry) -> Finding {
    let counts: Vec<_> = Kind::ALL
        .into_iter()
        .map(|kind| (kind, registry.catalog().of_kind(kind).count()))
        .filter(|(_, count)| *count > 0)
        .map(|(kind, count)| kind.counted(count))
        .collect();
    let text = format!("{} from {} plugins", counts.join(", "), registry.plugins().len());
    Finding { subject: "components", state: State::Good, text }
}

/// Only those who write plugins in Rust need it.
fn sdk() -> Finding {
    match installation::sdk() {
        Ok(folder) => Finding {
            subject: "sdk",
            state: State::Good,
            text: format!("its source for plugins is in {}", folder.display()),
        },
        Err(error) => Finding { subject: "sdk", state: State::Note, text: error.to_string() },
    }
}

fn plugin_folders() -> Finding {
    let text = match search_path::user_folder() {
        Some(folder) => {
            format!("your own go to {} with `pdk plugin add FILE`, or use --plugins DIR", folder.display())
        }
        None => format!(
            "there is no folder for your own, because neither HOME nor XDG_DATA_HOME is set; use --plugins DIR or {PATH_VARIABLE}"
        ),
    };
    Finding { subject: "plugins", state: State::Good, text }
}

/// Where prepared clips are kept.
fn cache_folder() -> Finding {
    let found = cache::cache();
    if let Ok(Cache { folder, temporary: true }) = &found {
        return Finding {
            subject: "cache",
            state: State::Note,
            text: format!(
                "prepared clips are kept in {}, because there is no home folder that can be written to; {} can name another",
                folder.display(),
                cache::VARIABLE
            ),
        };
    }
    finding("cache", found.map(|cache| format!("prepared clips are kept in {}", cache.folder.display())))
}

/// How fast H.264 is.
fn video() -> Finding {
    match pdk_video::has_assembly() {
        true => Finding {
            subject: "video",
            state: State::Good,
            text: "H.264 is built in, with assembly".to_owned(),
        },
        false => Finding {
            subject: "video",
            state: State::Note,
            text: "H.264 is built in without assembly, so videos and the first use of a clip take longer; install nasm, then \
                   `cargo clean --release -p openh264-sys2 -p pdk-video` and build pdk again"
                .to_owned(),
        },
    }
}

/// The environment variables that are meant for pdk or one of its plugins, such as the place of a library.
fn variables() -> Vec<Finding> {
    let mut variables: Vec<_> = std::env::vars_os()
        .map(|(name, value)| (name.to_string_lossy().into_owned(), value))
        .filter(|(name, value)| name.starts_with("PDK_") && !value.is_empty())
        .collect();
    variables.sort();
    let finding = |(name, value): (String, std::ffi::OsString)| {
        let path = Path::new(&value);
        // The folders of the search path have been looked into, and that of the cache is made when it is needed.
        let missing =
            name != PATH_VARIABLE && name != cache::VARIABLE && path.is_absolute() && !path.exists();
        let (state, remark) = match missing {
            true => (State::Bad, ", which does not exist; correct or unset it"),
            false => (State::Good, ""),
        };
        Finding { subject: "variable", state, text: format!("{name} is {}{remark}", path.display()) }
    };
    variables.into_iter().map(finding).collect()
}

/// Publishes and reads back a frame.
fn routing() -> Finding {
    let attempt = || -> Result<(), pdk_bus::Error> {
        let run = format!("doctor-{}", std::process::id());
        let bus = pdk_bus::Bus::create(&run, 0, 32, 32)?;
        bus.loan_frame(pdk_bus::Topic::Raw, pdk_bus::Stamp::default())?.publish().map(|_| ())
    };
    match attempt() {
        Ok(()) => Finding {
            subject: "routing",
            state: State::Good,
            text: "frames go through shared memory".to_owned(),
        },
        Err(error) => Finding { subject: "routing", state: State::Bad, text: error.to_string() },
    }
}

fn ffmpeg() -> Finding {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let found =
        std::env::split_paths(&path).map(|folder| folder.join("ffmpeg")).find(|file| is_program(file));
    match found {
        Some(file) => Finding { subject: "ffmpeg", state: State::Good, text: file.display().to_string() },
        None => Finding {
            subject: "ffmpeg",
            state: State::Note,
            text: "not on the PATH; needed only for video in other codecs than H.264".to_owned(),
        },
    }
}

#[cfg(unix)]
fn is_program(file: &Path) -> bool {
    use std::os::unix::fs::PermissionsExt;
    file.metadata().is_ok_and(|metadata| metadata.is_file() && metadata.permissions().mode() & 0o111 != 0)
}

#[cfg(not(unix))]
fn is_program(file: &Path) -> bool {
    file.is_file()
}
