//! A file of the dataset under all conditions, done by one worker.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use indicatif::ProgressBar;
use pdk_chain::chain::Chain;
use pdk_chain::moment::Moment;
use pdk_components::registry::Registry;
use pdk_labels::Labels;
use pdk_loop::sequences;
use pdk_model::component::ComponentSpec;
use pdk_model::scenario::LARGEST_SEED;
use pdk_sdk::error::{Error, Place, Result};
use pdk_sdk::file;
use pdk_sdk::prelude::{Dataset, Entry, FrameBuf};
use pdk_supervise::calls::{self, Function};
use serde_json::{Value, json};

use crate::conditions::Condition;
use crate::contents::{Contents, LARGEST_LABELS, Role, is_picture};
use crate::labels::{coco, lines, mask, records, table, yolo};
use crate::manifest::Written;
use crate::options::{Format, LabelsOption, Options};
use crate::source::steerings;

/// What all workers share.
pub struct Job<'a> {
    pub registry: &'a Registry,
    pub options: &'a Options,
    pub conditions: &'a [Condition],
    /// Whether each condition moves things, so that its labels are moved.
    pub moves: Vec<bool>,
    /// The folder of the dataset; none for a recording whose frames are not files.
    pub root: Option<PathBuf>,
    pub contents: Contents,
    /// The reader of a recording.
    pub reader: Option<ComponentSpec>,
    /// The number of the frame that a picture is, for recordings.
    pub frames: BTreeMap<String, usize>,
    /// How many frames each file holds that the reader of the recording writes.
    pub held: BTreeMap<String, usize>,
    /// What was there before.
    pub known: BTreeMap<(String, String), Written>,
    /// Moves on with each frame, or each unit without.
    pub progress: &'a ProgressBar,
}

impl Job<'_> {
    /// By how much a unit moves the progress on.
    pub fn steps(&self, unit: &Unit) -> u64 {
        let held = match unit {
            Unit::File(name, _) => self.held.get(name).copied(),
            _ => None,
        };
        held.unwrap_or(0).max(1) as u64
    }

    /// How many pictures a file has that was written.
    pub fn pictures_in(&self, file: &str) -> usize {
        self.held.get(file).copied().unwrap_or_else(|| usize::from(is_picture(file)))
    }
}

/// What is done at a time.
#[derive(Debug, Clone, PartialEq)]
pub enum Unit {
    /// A picture with the labels that belong to it alone, under all conditions.
    Picture(String),
    /// A frame of a recording whose frames are not files, under all conditions.
    Frame(usize),
    /// Any other file, under one condition.
    File(String, usize),
}

/// Takes what was written; true if it was there before.
pub type Report<'a> = &'a mut dyn FnMut(Written, bool);

/// Does units one after the other.
pub struct Worker<'a> {
    pub(super) job: &'a Job<'a>,
    /// A chain for each perturbation, for whatever level and seed.
    pub(super) chains: BTreeMap<String, Chain>,
    pub(super) dataset: Option<Box<dyn Dataset>>,
    /// The reader again, for writing the recording while the other one reads earlier frames.
    pub(super) writer: Option<Box<dyn Dataset>>,
    /// The frames of the recording at which a sequence begins, in order.
    sequences: Vec<usize>,
    /// Frames of the recording before the one at hand, for perturbations that show them; the next frame needs most of them too.
    pub(super) recent: BTreeMap<usize, Rc<Entry>>,
    pub(super) perturbed: FrameBuf,
    /// Frames by which the unit at hand has moved the progress on.
    pub(super) steps: u64,
}

/// A picture with what decides how it is perturbed.
pub(super) struct Situation {
    pub entry: Entry,
    pub seed: u64,
    pub frame: u64,
    /// Whether it is a frame of a recording, which has others before it.
    pub recorded: bool,
}

impl Situation {
    fn moment(&self) -> Moment<'static> {
        Moment::new(self.frame, self.entry.time).alone()
    }

    fn size(&self) -> [usize; 2] {
        [self.entry.frame.width(), self.entry.frame.height()]
    }
}

impl<'a> Worker<'a> {
    /// A worker, which makes instances of its own.
    ///
    /// # Errors
    /// If the dataset cannot be opened.
    pub fn new(job: &'a Job<'a>) -> Result<Self> {
        let dataset = match &job.reader {
            Some(reader) => Some(job.registry.dataset(&reader.name, &reader.parameters)?.0),
            None => None,
        };
        let sequences = dataset.as_ref().map_or_else(Vec::new, |dataset| {
            sequences::starts(&(0..dataset.len()).map(|index| dataset.position(index)).collect::<Vec<_>>())
        });
        Ok(Self {
            job,
            chains: BTreeMap::new(),
            dataset,
            writer: None,
            sequences,
            recent: BTreeMap::new(),
            perturbed: FrameBuf::default(),
            steps: 0,
        })
    }

    /// Does a unit.
    ///
    /// # Errors
    /// If something cannot be read, perturbed, moved or written, with its place.
    pub fn run(&mut self, unit: &Unit, report: Report<'_>) -> Result<()> {
        self.steps = 0;
        match unit {
            Unit::Picture(name) => self.picture(name, report).place(format_args!("`{name}`")),
            Unit::Frame(index) => self.frame(*index, report).place(format_args!("frame {index}")),
            Unit::File(name, condition) => {
                self.other(name, *condition, report).place(format_args!("`{name}`"))
            }
        }?;
        self.job.progress.inc(self.job.steps(unit).saturating_sub(self.steps));
        Ok(())
    }

    /// The chain of a condition, at the beginning of what this seed decides.
    pub(super) fn chain<'c>(
        chains: &'c mut BTreeMap<String, Chain>,
        job: &Job<'_>,
        condition: &Condition,
        seed: u64,
    ) -> Result<&'c mut Chain> {
        let applied = std::slice::from_ref(&condition.applied);
        // All but the level, at which a chain can begin again.
        let key = format!("{:?}", condition.applied.clone().at_level(0.0));
        if !chains.contains_key(&key) {
            chains.insert(key.clone(), Chain::new(job.registry, applied, seed)?);
        }
        let chain = chains.get_mut(&key).ok_or_else(|| Error::new("a chain is lost"))?;
        chain.begin_again(applied, seed);
        Ok(chain)
    }

    pub(super) fn read_frame(&mut self, index: usize) -> Result<Entry> {
        let dataset = self.dataset.as_mut().ok_or_else(|| Error::new("there is no reader for it"))?;
        calls::call_at("the dataset", Function::Read, index as u64, || dataset.read(index))
    }

    fn situation(&mut self, name: &str) -> Result<Situation> {
        if let Some(&index) = self.job.frames.get(name) {
            let entry = self.read_frame(index)?;
            return Ok(Situation { entry, seed: self.job.options.seed, frame: index as u64, recorded: true });
        }
        let frame = pdk_image::read(&self.path(name))?;
        let entry = Entry { frame, ..Entry::default() };
        Ok(Situation { entry, seed: self.seed(name), frame: 0, recorded: false })
    }

    /// What the draws of a picture come from.
    fn seed(&self, name: &str) -> u64 {
        match self.job.frames.contains_key(name) {
            true => self.job.options.seed,
            false => seed_of(self.job.options.seed, name),
        }
    }

    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.job.root.as_deref().unwrap_or(Path::new("")).join(name)
    }

    fn read(&self, name: &str) -> Result<(Vec<u8>, String)> {
        let path = self.path(name);
        let bytes =
            file::read(&path, LARGEST_LABELS).place(format_args!("cannot read {}", path.display()))?;
        let hash = hash(&bytes);
        Ok((bytes, hash))
    }

    /// What was written before and still is there, if it was made of the same.
    fn there(&self, condition: &Condition, file: &str, source: &str) -> Option<Written> {
        let known = self.job.known.get(&(condition.folder.clone(), file.to_owned()))?;
        let path = self.job.options.out.join(&condition.folder).join(file);
        let is_same = known.source == source && hash_of(&path).ok()? == known.blake3;
        is_same.then(|| known.clone())
    }

    /// Makes a file under a condition, unless it is there: `make` writes it beside its place, and then it gets its name. It is not synced: after
    /// a power cut its hash tells.
    pub(super) fn make_file(
        &mut self,
        condition: &Condition,
        (file, source, seed): (&str, &str, Option<u64>),
        report: &mut dyn FnMut(Written, bool),
        make: impl FnOnce(&mut Self, &Path) -> Result<String>,
    ) -> Result<()> {
        if let Some(known) = self.there(condition, file, source) {
            report(known, true);
            return Ok(());
        }
        let path = self.job.options.out.join(&condition.folder).join(file);
        let place = format!("cannot write {}", path.display());
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).place(&place)?;
        }
        let part = file::part_of(&path);
        let blake3 = make(self, &part)?;
        fs::rename(&part, &path).place(&place)?;
        let (condition, file, source) = (condition.folder.clone(), file.to_owned(), source.to_owned());
        report(Written { condition, file, blake3, source, seed }, false);
        Ok(())
    }

    /// Makes a file of these bytes under a condition, unless it is there.
    fn make(
        &mut self,
        condition: &Condition,
        what: (&str, &str, Option<u64>),
        report: &mut dyn FnMut(Written, bool),
        make: impl FnOnce(&mut Self) -> Result<Vec<u8>>,
    ) -> Result<()> {
        self.make_file(condition, what, report, |worker, part| {
            let bytes = make(worker)?;
            fs::write(part, &bytes).place(format_args!("cannot write {}", part.display()))?;
            Ok(hash(&bytes))
        })
    }

    fn picture(&mut self, name: &str, report: Report<'_>) -> Result<()> {
        let job = self.job;
        let (_, source) = self.read(name)?;
        let seed = self.seed(name);
        let mut situation = None;
        let target = job.options.format.renamed(name);
        for condition in job.conditions {
            self.make(condition, (&target, &source, Some(seed)), report, |worker| {
                let situation = worker.needed(name, &mut situation)?;
                worker.perturbed(condition, situation, &target)
            })?;
        }
        let companions = job.contents.companions.get(name).map(Vec::as_slice).unwrap_or_default();
        for companion in companions.iter().filter(|_| job.options.labels != LabelsOption::Drop) {
            let (bytes, source) = self.read(companion)?;
            for (condition, moves) in job.conditions.iter().zip(&job.moves) {
                if !moves || job.options.labels == LabelsOption::Keep {
                    self.make(condition, (companion, &source, None), report, |_| Ok(bytes.clone()))?;
                    continue;
                }
                self.make(condition, (companion, &source, Some(seed)), report, |worker| {
                    let situation = worker.needed(name, &mut situation)?;
                    worker.companion((companion, &bytes), condition, situation)
                })
                .place(format_args!("`{companion}`"))?;
            }
        }
        Ok(())
    }

    /// Reads a picture when it is needed first.
    fn needed<'s>(&mut self, name: &str, situation: &'s mut Option<Situation>) -> Result<&'s Situation> {
        if situation.is_none() {
            *situation = Some(self.situation(name)?);
        }
        situation.as_ref().ok_or_else(|| Error::new("a picture is lost"))
    }

    fn perturbed(&mut self, condition: &Condition, situation: &Situation, target: &str) -> Result<Vec<u8>> {
        self.perturb(condition, situation)?;
        pdk_image::encode(Path::new(target), self.perturbed.as_ref(), self.job.options.quality)
    }

    /// Puts what a picture is under a condition into `perturbed`. Returns how many earlier frames that shows.
    pub(super) fn perturb(&mut self, condition: &Condition, situation: &Situation) -> Result<usize> {
        let [width, height] = situation.size();
        let history = Self::chain(&mut self.chains, self.job, condition, situation.seed)?.history();
        let earlier = self.earlier(situation, history)?;
        let chain = Self::chain(&mut self.chains, self.job, condition, situation.seed)?;
        for (index, entry) in earlier {
            self.perturbed.resize(entry.frame.width(), entry.frame.height());
            let moment = Moment::new(index as u64, entry.time).alone();
            chain.apply(entry.frame.as_ref(), self.perturbed.as_mut(), &moment)?;
        }
        self.perturbed.resize(width, height);
        chain.apply(situation.entry.frame.as_ref(), self.perturbed.as_mut(), &situation.moment())?;
        Ok(history)
    }

    /// The frames before one of a recording, as many as a chain needs; none before a picture that stands alone.
    fn earlier(&mut self, situation: &Situation, history: usize) -> Result<Vec<(usize, Rc<Entry>)>> {
        if history == 0 || !situation.recorded {
            return Ok(Vec::new());
        }
        let index = situation.frame as usize;
        let begins = self.sequences[..self.sequences.partition_point(|begin| *begin <= index)].last();
        let first = index.saturating_sub(history).max(begins.copied().unwrap_or(0));
        // As many as the condition with the longest history needs.
        let most = self.chains.values().map(Chain::history).max().unwrap_or(history);
        self.recent.retain(|earlier, _| (index.saturating_sub(most)..index).contains(earlier));
        (first..index)
            .map(|earlier| {
                let entry = match self.recent.get(&earlier) {
                    Some(entry) => Rc::clone(entry),
                    None => Rc::new(self.read_frame(earlier)?),
                };
                self.recent.insert(earlier, Rc::clone(&entry));
                Ok((earlier, entry))
            })
            .collect()
    }

    fn companion(
        &mut self,
        (name, bytes): (&str, &[u8]),
        condition: &Condition,
        situation: &Situation,
    ) -> Result<Vec<u8>> {
        let Options { visible, outside, .. } = *self.job.options;
        let (size, moment) = (situation.size(), situation.moment());
        let chain = Self::chain(&mut self.chains, self.job, condition, situation.seed)?;
        let mut labels = Labels::new(chain, size, &moment);
        let text = || std::str::from_utf8(bytes).map_err(|_| Error::new("it is not text"));
        match self.job.contents.roles.get(name) {
            Some(Role::Yolo) => Ok(yolo::moved(text()?, size, &mut labels, visible)?.into_bytes()),
            Some(Role::Lines) => Ok(lines::moved(text()?, &mut labels)?.into_bytes()),
            Some(Role::Mask) => mask::moved(bytes, size, &mut labels, outside),
            _ => Ok(bytes.to_vec()),
        }
    }

    /// A frame of a recording, as a picture with its record beside it.
    fn frame(&mut self, index: usize, report: Report<'_>) -> Result<()> {
        let job = self.job;
        let entry = self.read_frame(index)?;
        let seed = job.options.seed;
        let source = hash(entry.frame.data());
        let situation = Situation { entry, seed, frame: index as u64, recorded: true };
        let ending = if job.options.format == Format::Jpeg { "jpg" } else { "png" };
        let (picture, record) = (format!("{index:06}_frame.{ending}"), format!("record_{index:06}.json"));
        for (condition, moves) in job.conditions.iter().zip(&job.moves) {
            self.make(condition, (&picture, &source, Some(seed)), report, |worker| {
                worker.perturbed(condition, &situation, &picture)
            })?;
            if job.options.labels == LabelsOption::Drop {
                continue;
            }
            let Entry { steering, throttle, time, speed, .. } = situation.entry;
            let told = hash(format!("{steering:?} {throttle:?} {time:?} {speed:?}").as_bytes());
            self.make(condition, (&record, &told, Some(seed)), report, |worker| {
                let moved = *moves && job.options.labels == LabelsOption::Move;
                let mirrored = moved && worker.mirrored(condition, &situation)?;
                let steering = if mirrored { -steering } else { steering };
                // A steering or throttle that was not recorded is not a number, which becomes `null`.
                let mut record = json!({
                    "user/mode": "user", "milliseconds": time * 1000.0, "user/angle": steering, "user/throttle": throttle
                });
                if speed.is_finite() {
                    record["enc/speed"] = speed.into();
                }
                Ok(serde_json::to_vec(&record)?)
            })?;
        }
        Ok(())
    }

    fn mirrored(&mut self, condition: &Condition, situation: &Situation) -> Result<bool> {
        let (size, moment) = (situation.size(), situation.moment());
        let chain = Self::chain(&mut self.chains, self.job, condition, situation.seed)?;
        Labels::new(chain, size, &moment).mirrors()
    }

    /// A file that is not a picture, nor belongs to one.
    fn other(&mut self, name: &str, condition: usize, report: Report<'_>) -> Result<()> {
        let job = self.job;
        let (condition, moves) = (&job.conditions[condition], job.moves[condition]);
        let role = job.contents.roles.get(name).copied().unwrap_or(Role::Other);
        let moves = moves && job.options.labels == LabelsOption::Move;
        match role {
            Role::Frames => return self.rewrite(name, condition, moves, report),
            Role::Beside if moves => return self.rewrite(name, condition, moves, report),
            Role::Beside | Role::Other | Role::Fixed => return self.carry(name, condition, report),
            _ => {}
        }
        let (bytes, source) = self.read(name)?;
        let renamed = job.options.format != Format::Same && role == Role::Coco;
        self.make(condition, (name, &source, None), report, |worker| {
            let text = || String::from_utf8(bytes.clone()).map_err(|_| Error::new("it is not text"));
            match role {
                Role::Coco if moves || renamed => worker.coco(name, &text()?, condition, moves),
                Role::Table if moves => worker.table(&text()?, condition).map(String::into_bytes),
                Role::Records if moves => worker.records(name, &text()?, condition).map(String::into_bytes),
                Role::Lengths if moves => {
                    let of = name.trim_end_matches("_manifest");
                    let changed = worker.records(of, &worker.text(of)?, condition)?;
                    // The lines of most files do not change, and then it stays as it is.
                    match changed == worker.text(of)? {
                        true => Ok(bytes.clone()),
                        false => Ok(records::lengths(&text()?, &changed)?.into_bytes()),
                    }
                }
                _ => Ok(bytes.clone()),
            }
        })
    }

    fn text(&self, name: &str) -> Result<String> {
        let path = self.path(name);
        file::read_text(&path, LARGEST_LABELS).place(format_args!("cannot read {}", path.display()))
    }

    fn coco(&mut self, name: &str, text: &str, condition: &Condition, moves: bool) -> Result<Vec<u8>> {
        let job = self.job;
        let mut document: Value = serde_json::from_str(text)?;
        if moves {
            document = coco::moved(&document, job.options.visible, &mut |wanted, size, work| {
                let picture = job.contents.picture_named(wanted, name).ok_or_else(|| {
                    Error::new(format!(
                        "it is not clear which picture `{wanted}` is; write its path in the folder of the dataset as `file_name`"
                    ))
                })?;
                let seed = self.seed(picture);
                let moment = match job.frames.get(picture) {
                    Some(_) => self.situation(picture)?.moment(),
                    None => Moment::new(0, 0.0).alone(),
                };
                let chain = Self::chain(&mut self.chains, job, condition, seed)?;
                work(&mut Labels::new(chain, size, &moment))
            })?;
        }
        for image in document["images"].as_array_mut().into_iter().flatten() {
            if let Some(name) = image["file_name"].as_str() {
                image["file_name"] = job.options.format.renamed(name).into();
            }
        }
        Ok(serde_json::to_vec(&document)?)
    }

    fn table(&mut self, text: &str, condition: &Condition) -> Result<String> {
        let job = self.job;
        let dataset = self.dataset.as_deref_mut().ok_or_else(|| Error::new("there is no reader for it"))?;
        let steering = steerings(dataset);
        let by_frame: BTreeMap<usize, &String> =
            job.frames.iter().map(|(name, frame)| (*frame, name)).collect();
        table::moved(text, &steering, &mut |frame, sides| {
            let picture = by_frame.get(&frame).ok_or_else(|| Error::new("a frame has no picture"))?;
            let situation = self.situation(picture)?;
            let mirrored = self.mirrored(condition, &situation)?;
            for side in sides {
                let file = side.rsplit(['/', '\\']).next().unwrap_or_default();
                let Some(side) = job.contents.picture_named(file, "") else { continue };
                let situation = self.situation(side)?;
                if self.mirrored(condition, &situation)? != mirrored {
                    return Err(Error::new(format!(
                        "only one of `{picture}` and `{side}`, which belong together, is mirrored; use a perturbation that mirrors all frames"
                    )));
                }
            }
            Ok(mirrored)
        })
    }

    fn records(&mut self, name: &str, text: &str, condition: &Condition) -> Result<String> {
        let job = self.job;
        // What moves things mirrors all pictures of a size or none, unless its draws decide it, which are those of the picture.
        records::moved(name, text, &mut |picture| {
            let own = name.rsplit_once('/').map_or(name, |(_, file)| file);
            let number = own.strip_prefix("record_").and_then(|behind| behind.strip_suffix(".json"));
            let of_number = |number: &str| {
                let begins = |found: &&str| {
                    let file = found.rsplit_once('/').map_or(*found, |(_, file)| file);
                    file.split(['_', '.']).next().and_then(|digits| digits.parse::<u64>().ok())
                        == number.parse().ok()
                };
                job.contents.of_role(Role::Picture).find(begins)
            };
            let picture = picture
                .and_then(|picture| job.contents.picture_named(picture, name))
                .or_else(|| number.and_then(of_number));
            let picture =
                picture.ok_or_else(|| Error::new("it is not clear which picture the record belongs to"))?;
            let situation = self.situation(picture)?;
            self.mirrored(condition, &situation)
        })
    }
}

/// What the draws of a file come from: the run's seed and the file's path in the dataset, with `/` between folders.
pub fn seed_of(run_seed: u64, name: &str) -> u64 {
    let key = pdk_sdk::seed::key(run_seed, &format!("corrupt/{name}"), 0);
    let mut first = [0; 8];
    first.copy_from_slice(&key.0[..8]);
    u64::from_le_bytes(first) & LARGEST_SEED
}

fn hash(bytes: &[u8]) -> String {
    blake3::hash(bytes).to_hex().to_string()
}

/// The hash of a file, which may be larger than memory.
pub(super) fn hash_of(path: &Path) -> Result<String> {
    let place = format!("cannot read {}", path.display());
    let (file, _) = file::open(path).place(&place)?;
    let mut hasher = blake3::Hasher::new();
    hasher.update_reader(file).place(&place)?;
    Ok(hasher.finalize().to_hex().to_string())
}
