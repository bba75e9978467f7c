//! Opens a record and drives its scenarios again.

use std::cell::RefCell;
use std::collections::{BTreeSet, HashMap};
use std::path::{Path, PathBuf};

use indicatif::ProgressBar;
use pdk_components::catalog::Catalog;
use pdk_loop::protocol::{Drive, Driven};
use pdk_model::component::ComponentSpec;
use pdk_model::scenario::Scenario;
use pdk_preview::method;
use pdk_record::directory::{RESULTS, RunDirectory, SCENARIOS};
use pdk_record::ledger::{self, Line};
use pdk_record::located::Located;
use pdk_record::manifest::Manifest;
use pdk_record::trace::reader::{Owner, read_recorded, read_steps};
use pdk_record::trace::step::Step;
use pdk_sdk::describe::Kind;
use pdk_sdk::error::{Error, Place, Result};
use pdk_session::interrupt::{self, Wish};
use pdk_session::session::{Reply, Session, Ticket};

use crate::clip::film;
use crate::compare::{Compared, Finding, compare};
use crate::pair::{self, Taken};
use crate::parts::{self, Further};
use crate::recorded::{Recorded, select};
use crate::shrink::{self, Shrunk};
use crate::why::{self, Why};

/// Recorded scenarios to replay.
pub struct Replay {
    directory: RunDirectory,
    manifest: Manifest,
    /// The scenarios in the order of their numbers.
    scenarios: Vec<Recorded>,
    cut_off: bool,
}

/// What replays came to.
#[derive(Debug)]
pub struct Replayed {
    /// What there is to say of each scenario, in order.
    pub scenarios: Vec<Compared>,
    /// Frames that were driven.
    pub frames: u64,
    /// Wall time of driving in seconds.
    pub wall_seconds: f64,
    /// What was noticed, such as a component that changed the working directory, one sentence each.
    pub warnings: Vec<String>,
}

impl Replay {
    /// Opens the record of a run. `wanted` names scenarios by numbers or ids, as for [`select`]; if it is empty, all are wanted.
    ///
    /// # Errors
    /// If the folder holds no scenarios of the closed loop, is damaged, or has no wanted scenario.
    pub fn open(folder: &Path, wanted: &[String]) -> Result<Self> {
        let directory = RunDirectory::open(folder)?;
        let shown = folder.display();
        let empty =
            || Error::new(format!("{shown} holds no scenarios: its run ended before the first was over"));
        if !folder.join(SCENARIOS).is_file() {
            return Err(match folder.join(RESULTS).is_file() {
                true => Error::new(format!(
                    "{shown} holds results of pdk.evaluate only; what can be replayed are the scenarios of pdk.drive"
                )),
                false => empty(),
            });
        }
        let manifest = directory.manifest()?.ok_or_else(|| {
            Error::new(format!("{shown} lost its manifest while it was opened; wait until nothing deletes or moves the record"))
        })?;
        let (lines, cut_off) = ledger::read(&directory)?;
        if lines.is_empty() {
            return Err(empty());
        }
        let located = Located::new(folder, &manifest);
        let mut scenarios = select(lines, wanted, &shown.to_string())?;
        for recorded in &mut scenarios {
            recorded.line.scenario = located.scenario(&recorded.line.scenario)?;
        }
        let manifest = located.manifest(manifest);
        Ok(Self { directory, manifest, scenarios, cut_off })
    }

    /// The number of scenarios.
    pub fn count(&self) -> usize {
        self.scenarios.len()
    }

    /// The lines of the scenarios, with their files where they are as seen from here.
    pub fn lines(&self) -> impl Iterator<Item = &Line> {
        self.scenarios.iter().map(|recorded| &recorded.line)
    }

    /// The manifest.
    pub fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    /// Whether the last line of the ledger is cut off, so that its scenario is left out.
    pub fn cut_off(&self) -> bool {
        self.cut_off
    }

    /// Where the record has components from that are not in the catalog; see [`Further`].
    ///
    /// # Errors
    /// If a file cannot be read.
    pub fn further(&self, catalog: &Catalog, trusted: bool) -> Result<Further> {
        Further::new(&self.manifest, &self.scenarios, catalog, trusted)
    }

    /// The programs that the components of the scenarios start, a clause each.
    pub fn programs(&self, catalog: &Catalog) -> Vec<String> {
        parts::programs(&self.scenarios, catalog)
    }

    /// What is different of pdk, the components and their files since the record was made, one clause each.
    ///
    /// # Errors
    /// If a component that the scenarios need is missing, or one of its files cannot be read.
    pub fn changes(&self, session: &mut Session) -> Result<Vec<String>> {
        let catalog = session.catalog().clone();
        let session = RefCell::new(session);
        let mut info = |driver: &_| session.borrow_mut().make(Kind::Driver, driver).map(|made| made.info);
        let mut inputs = |kind, component: &_| session.borrow_mut().input_files(kind, component);
        parts::changes(&self.manifest, &self.scenarios, &catalog, &mut info, &mut inputs)
    }

    /// A sentence about each simulator that does not wait for the driver.
    fn own_clock(&self, catalog: &Catalog) -> Vec<String> {
        let names: BTreeSet<&str> =
            self.scenarios.iter().map(|recorded| recorded.line.scenario.simulator.name.as_str()).collect();
        let own = |name: &&str| {
            catalog.get(Kind::Simulator, name).is_ok_and(|entry| !entry.description.clock.is_stepped())
        };
        let said = |name| {
            format!(
                "simulator `{name}` has its own clock, so no drive comes out exactly like another: differences are to be expected"
            )
        };
        names.into_iter().filter(own).map(said).collect()
    }

    /// Refuses simulators that do not wait for the driver; `vain` is a clause that says what is in vain with them.
    fn check_clock(&self, session: &Session, vain: &str) -> Result<()> {
        match self.own_clock(session.catalog()).first() {
            Some(sentence) => Err(Error::new(sentence.clone()).at(vain)),
            None => Ok(()),
        }
    }

    /// Drives the scenarios again and compares; `film` is the video to write of the one or two scenarios that there are then. The session
    /// is over afterwards. Ctrl-C ends it as it ends a run, so that the traces in the temporary folder do not stay.
    ///
    /// # Errors
    /// If the session cannot go on, or the video cannot be written. A damaged trace is reported for its scenario.
    pub fn drive(&self, session: Session, film: Option<&Film>, progress: &ProgressBar) -> Result<Replayed> {
        interrupt::watch()?;
        let folder = tempfile::Builder::new()
            .prefix("pdk-replay-")
            .tempdir()
            .place("cannot make a temporary folder; name a place for it with TMPDIR")?;
        // It ends before the folder goes, as its workers write there.
        let mut session = session;
        let own_clock = self.own_clock(session.catalog());
        let replayed =
            Driving { replay: self, session: &mut session, folder: folder.path(), film }.drive(progress);
        let troubles = session.end();
        let replayed = replayed.map(|mut replayed| {
            replayed.warnings.extend(troubles);
            replayed.warnings.extend(own_clock);
            replayed
        });
        progress.finish_and_clear();
        let shown = folder.path().to_owned();
        if let Err(error) = folder.close() {
            pdk_notice::eprintln!(
                "pdk: warning: cannot remove the temporary folder {} ({error})",
                shown.display()
            );
        }
        match interrupt::wish() {
            Wish::None => replayed,
            // Whatever it was at, that is why it did not come to its end.
            Wish::Finish | Wish::Drop => replayed.map_err(|error| {
                Error::of(error.kind(), "the replay was interrupted; the record is as it was before")
            }),
        }
    }
}

impl Replay {
    /// Shrinks the first of the scenarios, and films what is left where a video is wanted. The session is over afterwards.
    ///
    /// # Errors
    /// If there is no failure, its drives do not repeat themselves, the session cannot go on, or the video cannot be written.
    pub fn shrink(
        &self,
        mut session: Session,
        limits: shrink::Limits,
        clip: Option<&Path>,
        progress: &ProgressBar,
    ) -> Result<Shrunk> {
        interrupt::watch()?;
        let Some(recorded) = self.scenarios.first() else {
            return Err(Error::new("there is no scenario to shrink"));
        };
        self.check_clock(&session, "nothing can be shrunk")?;
        let shrunk = shrink::shrink(&mut session, &recorded.line, limits, progress)?;
        if let Some(clip) = clip {
            film_all(session, &[(&shrunk.scenario, clip)], progress)?;
        }
        Ok(shrunk)
    }

    /// Finds out why the first of the scenarios failed, and films both drives that prove it if `clips` names their videos. The session is over
    /// afterwards.
    ///
    /// # Errors
    /// If there is no failure, its drives do not repeat themselves, the session cannot go on, or a video cannot be written.
    pub fn why(
        &self,
        mut session: Session,
        clips: Option<[&Path; 2]>,
        progress: &ProgressBar,
    ) -> Result<Why> {
        interrupt::watch()?;
        let Some(recorded) = self.scenarios.first() else {
            return Err(Error::new("there is no scenario to explain"));
        };
        self.check_clock(&session, "a cause cannot be proven")?;
        let why = why::why(&mut session, &recorded.line, progress)?;
        if let Some([sufficient, necessary]) = clips {
            let films = [(&why.sufficient.scenario, sufficient), (&why.necessary.scenario, necessary)];
            film_all(session, &films, progress)?;
        }
        Ok(why)
    }
}

/// Drives scenarios once more and films them. The session is over afterwards.
fn film_all(mut session: Session, films: &[(&Scenario, &Path)], progress: &ProgressBar) -> Result<()> {
    let folder = tempfile::Builder::new()
        .prefix("pdk-film-")
        .tempdir()
        .place("cannot make a temporary folder; name a place for it with TMPDIR")?;
    for (number, (scenario, clip)) in (0..).zip(films) {
        let trace = folder.path().join(format!("{number}.mcap"));
        let (scenario, name) = ((*scenario).clone(), scenario.default_name());
        let ticket = session.drive(Drive {
            scenario: scenario.clone(),
            name: name.clone(),
            trace: Some(trace.clone()),
            images_every: 1,
            skips: None,
            view: None,
        });
        let Reply::Driven(driven) = session.wait(ticket, &mut |_| progress.tick())? else {
            return Err(Error::new("driving a scenario gave something else, which is a defect in pdk"));
        };
        let outcome = driven.outcome.clone();
        let line = Line { id: scenario.id(), name, scenario, images_every: 1, outcome };
        film(clip, &Recorded { number, line }, &driven, &trace)?;
    }
    // The session ends before the folder goes, as its workers write there.
    drop(session);
    Ok(())
}

/// A video that is wanted.
#[derive(Debug)]
pub struct Film {
    /// Where it goes.
    pub path: PathBuf,
    /// The saliency method that shows what the driver's network looks at beside what the driver saw, as the user names it: empty for
    /// the one that is used if none is named.
    pub saliency: Option<String>,
}

/// Scenarios while they are driven.
struct Driving<'a> {
    replay: &'a Replay,
    session: &'a mut Session,
    /// Where the new traces go.
    folder: &'a Path,
    film: Option<&'a Film>,
}

impl Driving<'_> {
    fn drive(self, progress: &ProgressBar) -> Result<Replayed> {
        let scenarios = &self.replay.scenarios;
        let before = (self.session.frames(), self.session.performance());
        let mut compared = Vec::with_capacity(scenarios.len());
        let mut tickets: HashMap<Ticket, &Recorded> = HashMap::with_capacity(scenarios.len());
        for recorded in scenarios {
            // Read again when there is something to compare with: all traces together may be large.
            match self.recorded_steps(recorded) {
                Ok(steps) => {
                    let driver = &recorded.line.scenario.driver;
                    let view = self.view(driver)?;
                    let ticket = self.session.drive(Drive {
                        scenario: recorded.line.scenario.clone(),
                        name: recorded.line.name.clone(),
                        trace: Some(self.new_trace(recorded)),
                        images_every: u64::from(self.film.is_some()),
                        skips: recorded.skips(&steps),
                        view,
                    });
                    tickets.insert(ticket, recorded);
                    progress.inc_length(recorded.line.outcome.frames);
                }
                Err(error) => compared.push(Compared::new(recorded, 0, Finding::Unreadable(error))),
            }
        }
        let mut tick = |frames: u64| progress.set_position(frames - before.0);
        let among = tickets.keys().copied().collect();
        let mut beside: Vec<(&Recorded, Box<Driven>)> = Vec::new();
        while let Some((ticket, answer)) = self.session.next(&among, &mut tick)? {
            let Some(recorded) = tickets.remove(&ticket) else { continue };
            let Reply::Driven(driven) = answer? else {
                return Err(Error::new("driving a scenario gave something else, which is a defect in pdk"));
            };
            compared.push(self.compare(recorded, &driven)?);
            if self.shows_two() {
                beside.push((recorded, driven));
            }
        }
        self.film_beside(beside)?;
        compared.sort_by_key(|compared| compared.number);
        let performance = self.session.performance();
        Ok(Replayed {
            scenarios: compared,
            frames: performance.times.steps - before.1.times.steps,
            wall_seconds: performance.wall_seconds - before.1.wall_seconds,
            warnings: performance.noticed().collect(),
        })
    }

    /// Whether the film shows two scenarios beside each other.
    fn shows_two(&self) -> bool {
        self.film.is_some() && self.replay.scenarios.len() == 2
    }

    /// Films two scenarios beside each other, in the order of their numbers.
    fn film_beside(&self, mut beside: Vec<(&Recorded, Box<Driven>)>) -> Result<()> {
        beside.sort_by_key(|(recorded, _)| recorded.number);
        let traces: Vec<PathBuf> = beside.iter().map(|(recorded, _)| self.new_trace(recorded)).collect();
        let taken: Vec<Taken<'_>> = beside
            .iter()
            .zip(&traces)
            .map(|((recorded, driven), trace)| Taken { recorded, driven, trace })
            .collect();
        match (self.film, taken.as_slice()) {
            (Some(Film { path, .. }), [first, second]) => pair::film(path, [first, second]),
            (Some(_), _) if self.shows_two() => Err(Error::new(
                "a scenario cannot be compared with its record, so there is nothing to put beside the other one; choose one with --scenario N",
            )),
            _ => Ok(()),
        }
    }

    /// The saliency method that shows in the film what a driver looks at; none if the film shows no such thing.
    fn view(&self, driver: &ComponentSpec) -> Result<Option<ComponentSpec>> {
        let Some(text) = self.film.and_then(|film| film.saliency.as_ref()) else { return Ok(None) };
        let catalog = self.session.catalog();
        method::of_driver(catalog, driver, &method::named(catalog, text)?).map(Some)
    }

    /// The steps of a scenario's trace in the record.
    fn recorded_steps(&self, Recorded { line, .. }: &Recorded) -> Result<Vec<Step>> {
        let trace = self.replay.directory.trace_path(&line.id);
        read_recorded(&trace, Owner::of(line)).map(|(steps, _)| steps)
    }

    fn new_trace(&self, recorded: &Recorded) -> PathBuf {
        self.folder.join(format!("{}.mcap", recorded.number))
    }

    fn compare(&self, recorded: &Recorded, driven: &Driven) -> Result<Compared> {
        let steps = match self.recorded_steps(recorded) {
            Ok(steps) => steps,
            Err(error) => return Ok(Compared::new(recorded, 0, Finding::Unreadable(error))),
        };
        let path = self.new_trace(recorded);
        if !path.is_file() {
            return Err(Error::new(format!(
                "scenario {} left no trace in {}; workers from elsewhere have to share that folder: name one that they do with TMPDIR",
                recorded.number,
                self.folder.display()
            )));
        }
        let again = read_steps(&path)?;
        match self.film {
            // The trace is needed until the other one is there.
            Some(_) if self.shows_two() => return compare(recorded, &steps, &driven.outcome, &again),
            Some(Film { path: clip, .. }) => film(clip, recorded, driven, &path)?,
            None => {}
        }
        // What is compared is not needed any more, and traces of many scenarios may be more than the disk has room for.
        std::fs::remove_file(&path).place(path.display())?;
        compare(recorded, &steps, &driven.outcome, &again)
    }
}
