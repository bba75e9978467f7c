//! Checks a verdict: whether it agrees with itself and with its suite, and whether drives that are drawn from it come out as it says.

use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

use indicatif::ProgressBar;
use pdk_components::catalog::Catalog;
use pdk_components::hash;
use pdk_model::component::ComponentSpec;
use pdk_model::scenario::{Mode, Scenario, ScenarioId};
use pdk_pipeline::readers;
use pdk_record::ledger::Line;
use pdk_record::settle::{self, Settler};
use pdk_replay::parts;
use pdk_replay::recorded::Recorded;
use pdk_sdk::error::{Error, ErrorKind, Result};
use pdk_session::session::{Session, Ticket};
use serde::Serialize;
use serde_json::Value;

use crate::driven::{self, driven_by};
use crate::loaded::Loaded;
use crate::probes;
use crate::recording::RecordingRecord;
use crate::role::Role;
use crate::step::step;
use crate::stretch::Stretch;
use crate::verdict::{Entry, Verdict};

/// How a verdict is verified.
#[derive(Debug, Clone)]
pub struct Wanted {
    /// How many entries are driven again.
    pub probes: usize,
    /// A text that goes into the draw.
    pub draw: String,
    /// The one entry that is repeated instead of those that are drawn, by its id.
    pub only: Option<ScenarioId>,
    /// Files that may take the place of those that the verdict names, if they have the same content.
    pub files: Vec<PathBuf>,
    /// Whether programs that the verdict names may be started.
    pub trust: bool,
}

/// What a verification found.
#[derive(Debug, Serialize)]
pub struct Verified {
    /// How many entries the verdict has.
    pub entries: usize,
    /// The places of those that were driven again, from 0.
    pub probes: Vec<usize>,
    /// What is not as the verdict says, a sentence each.
    pub refuted: Vec<String>,
    /// For some shares of false entries, with which probability these probes would have found one.
    pub chances: Vec<(f64, f64)>,
    /// What is different since the verdict was made, a clause each.
    pub changes: Vec<String>,
}

/// The shares of false entries of which a verification says how likely they are found.
const SHARES: [f64; 3] = [0.01, 0.05, 0.1];

/// Makes sure that a suite is that of a verdict.
///
/// # Errors
/// If it is another one.
pub fn check_suite(verdict: &Verdict, loaded: &Loaded) -> Result<()> {
    let (was, suite) = (&verdict.suite, &loaded.suite);
    if was.blake3 == loaded.hash {
        return Ok(());
    }
    let what = match (was.name == suite.name, was.version == suite.version) {
        (true, true) => "its contents differ".to_owned(),
        (true, false) => format!("it has version {} and not {}", suite.version, was.version),
        _ => format!("it is called `{}`", suite.name),
    };
    Err(Error::new(format!(
        "the suite {} is not that of the verdict, which is `{}` version {} (BLAKE3 {}): {what}; name the right one with --suite",
        loaded.named(),
        was.name,
        was.version,
        was.blake3
    )))
}

/// Verifies a verdict. The session is over afterwards.
///
/// # Errors
/// If it cannot be verified here: a file is missing or another one, or the machine has another engine.
pub fn verify(
    verdict: &Verdict,
    loaded: &mut Loaded,
    mut session: Session,
    wanted: &Wanted,
    bar: &ProgressBar,
) -> Result<Verified> {
    check_suite(verdict, loaded)?;
    let catalog = session.catalog().clone();
    loaded.open(&catalog, &mut |dataset| readers::recording(&mut session, dataset))?;
    check_recordings(verdict, loaded)?;
    let mut refuted = verdict.contradictions(loaded, &catalog)?;
    let entries = verdict.entries.len();
    if !refuted.is_empty() {
        // What contradicts itself need not be driven.
        return Ok(Verified {
            entries,
            probes: Vec::new(),
            refuted,
            chances: Vec::new(),
            changes: Vec::new(),
        });
    }
    let chances = |count: usize| -> Vec<(f64, f64)> {
        // A share of nothing is still one entry.
        let wrong = |share: f64| (libm::ceil(share * entries as f64) as usize).max(1);
        SHARES.iter().map(|share| (*share, probes::found(entries, wrong(*share), count))).collect()
    };
    let named = |content: &String| {
        [Role::Old, Role::New]
            .iter()
            .any(|role| verdict.driver(*role).files.values().any(|known| known == content))
    };
    for file in &wanted.files {
        if !named(&hash::of(file)?) {
            return Err(Error::of(
                ErrorKind::Configuration,
                format!(
                    "--file {} has the content of none of the files that the verdict names; leave it out",
                    file.display()
                ),
            ));
        }
    }
    let mut drivers = BTreeMap::new();
    for role in [Role::Old, Role::New] {
        drivers.insert(role, located(verdict, role, &wanted.files)?);
    }
    let mut settler = Settled { catalog: &catalog, noted: Vec::new(), contents: BTreeMap::new() };
    let mut scenarios = Vec::with_capacity(entries);
    for (place, entry) in verdict.entries.iter().enumerate() {
        let Some(driver) = drivers.get(&entry.driver) else { continue };
        let step = step(loaded, entry.series, entry.number)?;
        let mut scenario = driven_by(&step, (driver, entry.repeat), &catalog)?;
        check_engine(&catalog, &scenario, &verdict.settled)?;
        settler.scenario(&mut scenario);
        loaded.opened.note_content(&mut scenario);
        if scenario.id() != entry.id {
            files_are_those_of_the_verdict(verdict, entry.driver, &scenario)?;
            refuted.push(format!(
                "entry {place}, {} with the {} driver, has the id {}, but the suite and the driver give {}",
                step.title(),
                entry.driver.text(),
                entry.id,
                scenario.id()
            ));
        }
        scenarios.push((step.title(), scenario));
    }
    check_repeatable(&catalog, &scenarios)?;
    check_programs(&catalog, &scenarios, wanted.trust)?;
    let changes = verdict.changes(&catalog);
    let places = match (refuted.is_empty(), &wanted.only) {
        (false, _) => Vec::new(),
        (true, Some(id)) => vec![entry_of(verdict, id)?],
        (true, None) => probes::drawn(&verdict.root, &wanted.draw, entries, wanted.probes),
    };
    refuted.extend(repeat(&mut session, (verdict, loaded), &scenarios, &places, bar)?);
    // What was chosen by a person says nothing about the others.
    let chances = if wanted.only.is_some() { Vec::new() } else { chances(places.len()) };
    Ok(Verified { entries, probes: places, refuted, chances, changes })
}

/// The place of an entry with this id.
fn entry_of(verdict: &Verdict, id: &ScenarioId) -> Result<usize> {
    verdict.entries.iter().position(|entry| entry.id == *id).ok_or_else(|| {
        Error::new(format!(
            "the verdict has no scenario with the id {id}; its `entries` have the ids that there are"
        ))
    })
}

/// Makes sure that the recordings are those of a verdict.
fn check_recordings(verdict: &Verdict, loaded: &Loaded) -> Result<()> {
    for RecordingRecord { reader, blake3 } in &verdict.recordings {
        let here = loaded.opened.recordings.iter().find(|recording| recording.reader == *reader);
        if here.is_none_or(|recording| recording.blake3 != *blake3) {
            return Err(Error::of(
                ErrorKind::Configuration,
                format!(
                    "the recording `{reader}` is not that of the verdict, which has the BLAKE3 {blake3}; put the right one in its place"
                ),
            ));
        }
    }
    Ok(())
}

/// The driver of a verdict with its files where they are here.
fn located(verdict: &Verdict, role: Role, given: &[PathBuf]) -> Result<ComponentSpec> {
    let record = verdict.driver(role);
    let mut component = record.component.clone();
    for (named, wanted) in &record.files {
        // A component that is made from a file of the user's is found by its name.
        if *named == component.name {
            continue;
        }
        let path = Path::new(named);
        let has = |path: &Path| hash::of(path).is_ok_and(|found| found == *wanted);
        if has(path) {
            continue;
        }
        let Some(other) = given.iter().find(|file| has(file)) else {
            let state = if path.exists() { "has another content" } else { "is not there" };
            return Err(Error::of(
                ErrorKind::Configuration,
                format!(
                    "the {} driver needs the file {named} with the BLAKE3 {wanted}, which {state}; name the file with --file",
                    role.text()
                ),
            ));
        };
        for value in component.parameters.values_mut().filter(|value| value.as_str() == Some(named)) {
            *value = Value::from(other.to_string_lossy());
        }
    }
    Ok(component)
}

/// The error if a driver's files are the reason why an id is another one.
fn files_are_those_of_the_verdict(verdict: &Verdict, role: Role, scenario: &Scenario) -> Result<()> {
    for (named, wanted) in &verdict.driver(role).files {
        if *named == scenario.driver.name && scenario.files.get(named) != Some(wanted) {
            let sentence = format!(
                "the {} driver `{named}` of this machine is made from another file than that of the verdict, which has the BLAKE3 {wanted}; \
                 name the folder of that file with --drop-ins",
                role.text()
            );
            return Err(Error::of(ErrorKind::Configuration, sentence));
        }
    }
    Ok(())
}

/// Makes sure that this machine has the engine with which was driven.
fn check_engine(catalog: &Catalog, scenario: &Scenario, settled: &[(String, String)]) -> Result<()> {
    settle::check(catalog, scenario).map_err(|error| {
        let had: Vec<String> = settled.iter().map(|(parameter, value)| format!("{parameter} {value}")).collect();
        Error::of(
            ErrorKind::Configuration,
            format!(
                "the verdict cannot be verified on this machine, because it computes networks differently ({error}); use a machine with {}",
                had.join(", ")
            ),
        )
    })
}

/// Refuses drives that no simulator repeats.
fn check_repeatable(catalog: &Catalog, scenarios: &[(String, Scenario)]) -> Result<()> {
    for (_, scenario) in scenarios.iter().filter(|(_, scenario)| Stretch::of(scenario).is_none()) {
        let entry = catalog.get(pdk_sdk::describe::Kind::Simulator, &scenario.simulator.name)?;
        if scenario.mode == Mode::Realtime || !entry.description.clock.is_stepped() {
            return Err(Error::of(
                ErrorKind::Configuration,
                format!(
                    "the drives of this verdict are in real time in the simulator `{}`, so no drive comes out exactly like another and none \
                     can be verified; let a gate decide anew",
                    scenario.simulator.name
                ),
            ));
        }
    }
    Ok(())
}

/// Refuses programs that a verdict from elsewhere would start.
fn check_programs(catalog: &Catalog, scenarios: &[(String, Scenario)], trust: bool) -> Result<()> {
    let recorded: Vec<Recorded> = scenarios
        .iter()
        .map(|(name, scenario)| Recorded {
            number: 0,
            line: Line {
                id: scenario.id(),
                name: name.clone(),
                scenario: scenario.clone(),
                images_every: 0,
                outcome: Default::default(),
            },
        })
        .collect();
    let programs = parts::programs(&recorded, catalog);
    if trust || programs.is_empty() {
        return Ok(());
    }
    Err(Error::of(
        ErrorKind::Configuration,
        format!(
            "the verdict would have this run with your rights: {}; if you know where it comes from and trust it, add --trust",
            programs.join("; ")
        ),
    ))
}

/// Settles scenarios as a run does.
struct Settled<'a> {
    catalog: &'a Catalog,
    noted: Vec<(String, String)>,
    contents: BTreeMap<String, String>,
}

impl Settled<'_> {
    fn scenario(&mut self, scenario: &mut Scenario) {
        let Self { catalog, noted, contents } = self;
        Settler { catalog, wanted: BTreeMap::new(), settled: noted, contents }.scenario(scenario);
    }
}

/// Gives entries to their drivers again, and says which come out differently.
fn repeat(
    session: &mut Session,
    (verdict, loaded): (&Verdict, &Loaded),
    scenarios: &[(String, Scenario)],
    places: &[usize],
    bar: &ProgressBar,
) -> Result<Vec<String>> {
    let mut tickets: HashMap<Ticket, (usize, &Entry, &str, &Scenario)> = HashMap::new();
    let mut ordered = places.to_vec();
    // Blocks of one driver together, since a worker keeps it from one to the next.
    ordered.sort_by_key(|place| verdict.entries.get(*place).map(|entry| entry.driver));
    for place in ordered {
        let (Some(entry), Some((title, scenario))) = (verdict.entries.get(place), scenarios.get(place))
        else {
            continue;
        };
        tickets.insert(driven::submit(session, scenario, title), (place, entry, title, scenario));
    }
    bar.set_length(places.len() as u64);
    let among = tickets.keys().copied().collect();
    let mut wrong: BTreeMap<usize, String> = BTreeMap::new();
    while let Some((ticket, answer)) = session.next(&among, &mut |_| bar.tick())? {
        bar.inc(1);
        let Some((place, entry, title, scenario)) = tickets.remove(&ticket) else { continue };
        let came = driven::came(scenario, answer?).map_err(|error| {
            error.at(format_args!("nothing can be verified, because a component failed in `{title}`"))
        })?;
        let step = step(loaded, entry.series, entry.number)?;
        let again = Entry::new(loaded, &step, (entry.driver, entry.repeat), entry.id, &came);
        if again != *entry {
            let text = format!(
                "entry {place}, {title} with the {} driver: the verdict says {}, and it came to {}",
                entry.driver.text(),
                entry.said(),
                again.said()
            );
            wrong.insert(place, text);
        }
    }
    bar.finish_and_clear();
    Ok(wrong.into_values().collect())
}
