//! The verdict of a gate as a file that anyone can check: what was driven, what came of it in checksums, and what follows.

use std::collections::BTreeMap;
use std::path::Path;

use pdk_components::catalog::Catalog;
use pdk_components::hash;
use pdk_model::canonical::canonical;
use pdk_model::component::ComponentSpec;
use pdk_model::scenario::ScenarioId;
use pdk_record::manifest::ComponentRecord;
use pdk_sdk::error::{Error, Place, Result};
use pdk_sdk::file;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::came::{Came, Ending};
use crate::judge::{Decision, Judge, Seen};
use crate::loaded::Loaded;
use crate::merkle;
use crate::recording::RecordingRecord;
use crate::repeats::{self, Drove};
use crate::requirement::Kind;
use crate::role::Role;
use crate::series::Series;
use crate::step::{Step, steps};

/// The version of the format.
const FORMAT: u32 = 1;
/// Bytes of a file that may be a verdict.
const LARGEST: u64 = 256 << 20;

/// The verdict of a gate.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    /// The version of the format.
    pub format: u32,
    /// The version of pdk.
    pub pdk: String,
    /// The suite.
    pub suite: SuiteRecord,
    /// The old driver.
    pub old: DriverRecord,
    /// The new driver.
    pub new: DriverRecord,
    /// The recordings of the suite.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub recordings: Vec<RecordingRecord>,
    /// What scenarios left to the machine, such as the engine of networks, and what it was.
    pub settled: Vec<(String, String)>,
    /// The components with which was driven, with the hashes of their files.
    pub components: Vec<ComponentRecord>,
    /// What follows.
    pub decision: Decision,
    /// What was driven, in the order in which it was looked at.
    pub entries: Vec<Entry>,
    /// The Merkle root over all of the above: the first leaf is the verdict without its entries, the others are the entries.
    pub root: String,
}

/// A suite in a verdict.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct SuiteRecord {
    /// Its name.
    pub name: String,
    /// Its version.
    pub version: u32,
    /// How the command line named it.
    pub named: String,
    /// The hash of its contents.
    pub blake3: String,
}

/// A driver in a verdict.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DriverRecord {
    /// As the command line named it.
    pub named: String,
    /// The driver with its parameters, as scenarios have it.
    pub component: ComponentSpec,
    /// Its files, each with the BLAKE3 hash of its content; a driver that is made from a file of the user's has its name as a key.
    pub files: BTreeMap<String, String>,
}

/// A scenario that was driven, and what came of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Entry {
    /// Where the scenario comes from.
    pub series: Series,
    /// Its number there, from 0.
    pub number: usize,
    /// Who drove.
    pub driver: Role,
    /// Which drive of the same scenario it is, from 0.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub repeat: u64,
    /// The id of the scenario.
    pub id: ScenarioId,
    /// How it ended.
    pub cause: Ending,
    /// The measure of a requirement about one; none if it was not measured, or the drive did not come to its end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub measured: Option<f64>,
    /// The checksum of the outcome.
    pub checksum: String,
}

fn is_zero(number: &u64) -> bool {
    *number == 0
}

impl Entry {
    /// What came of a scenario of a suite; `driven` is who drove, and which drive of the scenario it is.
    pub fn new(loaded: &Loaded, step: &Step, driven: (Role, u64), id: ScenarioId, came: &Came) -> Self {
        let (driver, repeat) = driven;
        let required = loaded.suite.required();
        let measured = match step.series {
            Series::Requirement(place) => match required.get(place).map(|requirement| &requirement.kind) {
                Some(Kind::Measure { measure, .. }) => came.measured(measure),
                _ => None,
            },
            _ => None,
        };
        let Step { series, number, .. } = step;
        Self {
            series: *series,
            number: *number,
            driver,
            repeat,
            id,
            cause: came.ending(),
            measured,
            checksum: came.checksum(&id),
        }
    }

    /// Whether the driver failed.
    pub fn failed(&self) -> bool {
        self.cause.failed()
    }

    /// All that came of the scenario, in a clause.
    pub fn said(&self) -> String {
        let measured = self.measured.map(|measured| format!(", the measure {measured}")).unwrap_or_default();
        format!("{}{measured} with the checksum {}", self.cause.text(), self.checksum)
    }
}

/// What came of a step, by the entries of its drives.
pub fn seen(old: Option<&[Entry]>, new: &[Entry]) -> Seen {
    let drove = |entries: &[Entry]| Drove(entries.iter().map(Entry::failed).collect());
    let measured = new.iter().map(|entry| entry.measured).collect();
    Seen { old: old.map(drove), new: drove(new), measured }
}

impl Verdict {
    /// Puts the root over a verdict.
    pub fn sealed(mut self) -> Self {
        self.format = FORMAT;
        self.root = self.own_root();
        self
    }

    /// The root that it should have.
    fn own_root(&self) -> String {
        let mut head = serde_json::to_value(self).unwrap_or_default();
        if let Some(fields) = head.as_object_mut() {
            fields.retain(|name, _| name != "entries" && name != "root");
        }
        let entry = |entry: &Entry| canonical(&serde_json::to_value(entry).unwrap_or_default());
        let leaves: Vec<String> =
            std::iter::once(canonical(&head)).chain(self.entries.iter().map(entry)).collect();
        merkle::root(&leaves)
    }

    /// Reads a verdict; whether it is true is for others to say.
    ///
    /// # Errors
    /// If it cannot be read, or is not one.
    pub fn read(path: &Path) -> Result<Self> {
        let shown = path.display();
        let text = file::read_text(path, LARGEST).place(format_args!("cannot read the verdict {shown}"))?;
        let value: Value = serde_json::from_str(&text)
            .map_err(|error| Error::new(format!("{shown} is not a verdict of `pdk gate` ({error})")))?;
        match value["format"].as_u64() {
            Some(format) if format == u64::from(FORMAT) => {}
            Some(other) => {
                return Err(Error::new(format!(
                    "{shown} has format {other}, and this version of pdk knows format {FORMAT}; use the pdk that it was made with, {}",
                    value["pdk"]
                )));
            }
            None => {
                return Err(Error::new(format!(
                    "{shown} is not a verdict of `pdk gate`; name a {}",
                    pdk_record::directory::VERDICT
                )));
            }
        }
        let verdict: Self = serde_json::from_value(value.clone())
            .map_err(|error| Error::new(format!("{shown} is not a verdict of `pdk gate` ({error})")))?;
        match serde_json::to_value(&verdict)? == value {
            true => Ok(verdict),
            false => Err(Error::new(format!(
                "{shown} holds something that a verdict does not have, so its root says nothing about that; use the file as `pdk gate` wrote it"
            ))),
        }
    }

    /// What is wrong with a verdict in itself, or with what it says of a suite: its root, which scenarios it has, and what follows from
    /// them. Whether the outcomes are true takes drives.
    ///
    /// # Errors
    /// If the suite cannot be drawn from.
    pub fn contradictions(&self, loaded: &Loaded, catalog: &Catalog) -> Result<Vec<String>> {
        let mut wrong = Vec::new();
        if self.root != self.own_root() {
            wrong.push("its root is not that of its contents, so it was edited or is damaged".to_owned());
        }
        let mut judge = Judge::new(loaded);
        let mut rest = self.entries.as_slice();
        for step in steps(loaded) {
            if judge.is_over() {
                break;
            }
            let step = step?;
            let most = repeats::most(&loaded.suite, &step.scenario, catalog)?;
            let old =
                if step.is_pair() { drives(&mut rest, &step, Role::Old, most).map(Some) } else { Some(None) };
            let (Some(old), Some(new)) = (old, drives(&mut rest, &step, Role::New, most)) else {
                wrong.push(format!(
                    "it does not have the scenarios of the suite in their order: `{}` is missing",
                    step.title()
                ));
                return Ok(wrong);
            };
            judge.look(&step, &seen(old, new));
        }
        if !rest.is_empty() {
            wrong.push(format!(
                "it has {} entries, but was decided after {} of them",
                self.entries.len(),
                self.entries.len() - rest.len()
            ));
        }
        if judge.decide() != self.decision {
            wrong.push("its decision does not follow from its entries".to_owned());
        }
        Ok(wrong)
    }

    /// What is different of the components since the verdict was made, a clause each.
    pub fn changes(&self, catalog: &Catalog) -> Vec<String> {
        let mut changes: Vec<String> = Vec::new();
        for was in &self.components {
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

    /// What its entries are, for sentences.
    pub fn unit(&self) -> &'static str {
        if self.recordings.is_empty() { "drives" } else { "blocks" }
    }

    /// The driver that has this role.
    pub fn driver(&self, role: Role) -> &DriverRecord {
        match role {
            Role::Old => &self.old,
            Role::New => &self.new,
        }
    }
}

/// Takes the entries of a step by one driver from the beginning of these: as many as it takes until its verdict is stable. None if they are
/// not there.
fn drives<'a>(rest: &mut &'a [Entry], step: &Step, role: Role, most: u64) -> Option<&'a [Entry]> {
    let mut drove = Drove::default();
    for (place, entry) in rest.iter().enumerate() {
        let fits = (entry.series, entry.number, entry.driver, entry.repeat)
            == (step.series, step.number, role, place as u64);
        if !fits {
            return None;
        }
        drove.0.push(entry.failed());
        if drove.0.len() as u64 >= Drove::at_first(most) && drove.is_over(most) {
            let (taken, left) = rest.split_at(place + 1);
            *rest = left;
            return Some(taken);
        }
    }
    None
}
