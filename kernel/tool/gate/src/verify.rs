//! Checks a verdict: whether it agrees with itself and with its suite, and whether drives that are drawn from it come out as it says.

use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

use indicatif::ProgressBar;
use pdk_components::catalog::Catalog;
use pdk_components::hash;
use pdk_loop::protocol::Drive;
use pdk_model::component::ComponentSpec;
use pdk_model::scenario::{Mode, Scenario};
use pdk_record::ledger::Line;
use pdk_record::manifest::ComponentRecord;
use pdk_record::settle::{self, Settler};
use pdk_replay::parts;
use pdk_replay::recorded::Recorded;
use pdk_sdk::error::{Error, ErrorKind, Result};
use pdk_session::session::{Reply, Session, Ticket};
use serde::Serialize;
use serde_json::Value;

use crate::gate::driven_by;
use crate::loaded::Loaded;
use crate::probes;
use crate::role::Role;
use crate::step::step;
use crate::verdict::{Entry, Verdict, checksum};

/// How a verdict is verified.
#[derive(Debug, Clone)]
pub struct Wanted {
    /// How many entries are driven again.
    pub probes: usize,
    /// A text that goes into the draw.
    pub draw: String,
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
    loaded: &Loaded,
    mut session: Session,
    wanted: &Wanted,
    bar: &ProgressBar,
) -> Result<Verified> {
    check_suite(verdict, loaded)?;
    let mut refuted = verdict.contradictions(loaded)?;
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
    let catalog = session.catalog().clone();
    let mut drivers = BTreeMap::new();
    for role in [Role::Old, Role::New] {
        drivers.insert(role, located(verdict, role, &wanted.files)?);
    }
    let mut settler = Settled { catalog: &catalog, noted: Vec::new(), contents: BTreeMap::new() };
    let mut scenarios = Vec::with_capacity(entries);
    for (place, entry) in verdict.entries.iter().enumerate() {
        let Some(driver) = drivers.get(&entry.driver) else { continue };
        let step = step(loaded, entry.series, entry.number)?;
        let mut scenario = driven_by(&step, driver, &catalog)?;
        check_engine(&catalog, &scenario, &verdict.settled)?;
        settler.scenario(&mut scenario);
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
    let changes = changes(&verdict.components, &catalog);
    let places = match refuted.is_empty() {
        true => probes::drawn(&verdict.root, &wanted.draw, entries, wanted.probes),
        false => Vec::new(),
    };
    refuted.extend(drive(&mut session, verdict, &scenarios, &places, bar)?);
    let chances = chances(places.len());
    Ok(Verified { entries, probes: places, refuted, chances, changes })
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
    for (_, scenario) in scenarios {
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

/// What is different of the components since the verdict was made, a clause each.
fn changes(components: &[ComponentRecord], catalog: &Catalog) -> Vec<String> {
    let mut changes: Vec<String> = Vec::new();
    for was in components {
        let Ok(entry) = catalog.get(was.kind, &was.name) else { continue };
        let is = entry.description.version;
        let code = catalog.code_of(entry);
        let changed = match &code.blake3 {
            Some(hash) => *hash != was.file.blake3,
            None => hash::of(&code.file).is_ok_and(|hash| hash != was.file.blake3),
        };
        if is != was.version {
            changes.push(format!(
                "the version of the {} `{}` was {} and is {is}",
                was.kind, was.name, was.version
            ));
        } else if changed {
            changes.push(format!("the file of the {} `{}` is a different one", was.kind, was.name));
        }
    }
    changes.dedup();
    changes
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

/// Drives entries again, and says which come out differently.
fn drive(
    session: &mut Session,
    verdict: &Verdict,
    scenarios: &[(String, Scenario)],
    places: &[usize],
    bar: &ProgressBar,
) -> Result<Vec<String>> {
    let mut tickets: HashMap<Ticket, (usize, &Entry)> = HashMap::new();
    for place in places {
        let (Some(entry), Some((title, scenario))) = (verdict.entries.get(*place), scenarios.get(*place))
        else {
            continue;
        };
        let drive = Drive {
            scenario: scenario.clone(),
            name: title.clone(),
            trace: None,
            images_every: 0,
            skips: None,
            view: None,
        };
        tickets.insert(session.drive(drive), (*place, entry));
    }
    bar.set_length(places.len() as u64);
    let among = tickets.keys().copied().collect();
    let mut wrong: BTreeMap<usize, String> = BTreeMap::new();
    while let Some((ticket, answer)) = session.next(&among, &mut |_| bar.tick())? {
        bar.inc(1);
        let Some((place, entry)) = tickets.remove(&ticket) else { continue };
        let Reply::Driven(driven) = answer? else {
            return Err(Error::new("driving a scenario gave something else, which is a defect in pdk"));
        };
        let outcome = &driven.outcome;
        if let Some(error) = &outcome.error {
            return Err(Error::new(format!("nothing can be verified, because a component failed: {error}")));
        }
        let (again, title) =
            (checksum(&entry.id, outcome), scenarios.get(place).map_or("", |(title, _)| title.as_str()));
        if again != entry.checksum || outcome.cause != entry.cause {
            let text = format!(
                "entry {place}, {title} with the {} driver: the verdict says {} with the checksum {}, and it came to {} with {again}",
                entry.driver.text(),
                entry.cause.text(),
                entry.checksum,
                outcome.cause.text()
            );
            wrong.insert(place, text);
        }
    }
    bar.finish_and_clear();
    Ok(wrong.into_values().collect())
}
