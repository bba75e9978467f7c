//! What a recorded scenario needs, for the verbs that drive it again. A record may come from anyone: nothing that it names is loaded or
//! started unless it is installed, has been loaded before, or the user agrees.

use std::path::{Path, PathBuf};

use pdk_components::search_path::SearchPath;
use pdk_notice::eprintln;
use pdk_replay::replay::Replay;
use pdk_sdk::error::{Error, ErrorKind, Result};
use pdk_session::connection::Pool;
use pdk_session::session::Session;
use pdk_supervise::supervisor::Limits;

use super::Global;

/// The scenario that a verb works on.
#[derive(clap::Args)]
pub struct Chosen {
    /// The folder of the record
    #[arg(value_name = "RUN")]
    pub record: PathBuf,
    /// The scenario, by its number, its id or the beginning of that
    #[arg(long, value_name = "N|ID")]
    pub scenario: String,
}

/// How a record is driven again.
pub struct Driving<'a> {
    /// The verb, which is part of the name of the run on its topics.
    pub verb: &'static str,
    /// The folder of the record.
    pub record: &'a Path,
    /// Where workers come from.
    pub pool: Pool,
    /// What the processes with components are held to.
    pub limits: Limits,
    /// Whether the user agrees to whatever the record names.
    pub trust: bool,
}

/// A session with all components that a record needs, also those that are only where the record has them from; and where they are looked for.
///
/// # Errors
/// If the record names something that is not run without the user's word; the sentence lists all of it.
pub fn session(global: &Global, replay: &Replay, driving: Driving<'_>) -> Result<(Session, SearchPath)> {
    let Driving { verb, record, pool, limits, trust } = driving;
    let start = |search| global.session(verb, pool.clone(), limits, search);
    let said = |asks: &[String]| {
        for asked in asks.iter().filter(|_| trust) {
            eprintln!("pdk: warning: the record has this run: {asked}");
        }
    };
    let mut search = global.search_path();
    let mut session = start(search.clone())?;
    let further = replay.further(session.catalog(), trust)?;
    let mut asks = further.asks;
    said(&asks);
    if further.places != SearchPath::default() && (trust || asks.is_empty()) {
        drop(session);
        search.plugins.extend(further.places.plugins);
        search.drop_ins.extend(further.places.drop_ins);
        session = start(search.clone())?;
    }
    let remedy = if asks.is_empty() { "" } else { ", or name the folder of what you know with --plugins" };
    let programs = replay.programs(session.catalog());
    said(&programs);
    asks.extend(programs);
    if trust || asks.is_empty() {
        return Ok((session, search));
    }
    Err(Error::of(
        ErrorKind::Configuration,
        format!(
            "the record {} would have this run with your rights: {}; if you know where the record comes from and trust it, add --trust{remedy}",
            record.display(),
            asks.join("; ")
        ),
    ))
}

/// The record of one scenario, and what [`session`] gives for it. It warns of what is different since then, and says what may come of that.
///
/// # Errors
/// As for [`session`], and if there is no such scenario.
pub fn open(
    global: &Global,
    scenario: &str,
    driving: Driving<'_>,
    consequence: &str,
) -> Result<(Replay, Session, SearchPath)> {
    let replay = Replay::open(driving.record, &[scenario.to_owned()])?;
    let (mut session, search) = session(global, &replay, driving)?;
    for change in replay.changes(&mut session)? {
        eprintln!("pdk: warning: since the run was recorded, {change}, so it may {consequence}");
    }
    Ok((replay, session, search))
}
