//! `pdk check FILE.lua`: what the author of a perturbation in Lua runs.

use std::path::Path;

use pdk_lua::perturbation::Source;
use pdk_lua::{Kept, LuaPerturbation};
use pdk_sdk::config::{Config, frame_values};
use pdk_sdk::describe::Description;
use pdk_sdk::error::{Error, Result};
use pdk_sdk::history::Recollection;
use pdk_sdk::perturbation;
use pdk_sdk::prelude::{Context, FrameBuf, Key, Perturbation};
use pdk_sdk::testing::sample_frame;
use pdk_terminal::shell;

use super::super::show::folder_of;
use super::{Arguments, LOADING, Report, known, parameters, report, step};

/// How many frames of a sequence are compared with the same frames alone.
const FRAMES: u64 = 12;
/// Frames per second of that sequence.
const RATE: f64 = 20.0;
/// The size of its frames: odd, so that halves and thirds of it are not whole numbers.
const SIZE: (usize, usize) = (67, 41);
/// Sizes that find most mistakes: lines of single pixels and odd sides.
const SIZES: [(usize, usize); 8] = [(1, 1), (1, 9), (9, 1), (2, 3), (5, 5), (17, 3), (33, 31), (129, 65)];

/// Whether a file is a script.
pub fn is_script(file: &Path) -> bool {
    file.extension().is_some_and(|ending| ending == "lua")
}

/// Takes each step from number `skipped` on, and reports it.
pub fn work(arguments: &Arguments, skipped: usize) {
    let Some(description) = step(LOADING, || load(arguments)) else { return };
    report(&Report::Carries {
        name: arguments.plugin.file_name().unwrap_or_default().to_string_lossy().into_owned(),
        version: description.version.to_string(),
        components: vec![format!("{} `{}`", description.kind, description.name)],
    });
    if skipped == 0
        && let Some(note) = unsaid(&description, &arguments.plugin)
    {
        report(&Report::Note(note));
    }
    let mut number = 0;
    // `known` has refused what cannot be read.
    let Ok(all) = parameters(&description, &arguments.values) else { return };
    for (parameters, name) in all {
        type Check = fn(&Script<'_>) -> Result<()>;
        // Of what does not change frames, the rules of any perturbation say all of it.
        let of_frames = description.acts_on.is_frame();
        let checks: [(&str, bool, Check); 3] = [
            ("at odd sizes, twice", of_frames, |script| script.sizes()),
            ("alone and in a sequence", of_frames, |script| script.sequence()),
            ("as any perturbation", true, |script| script.rules()),
        ];
        for (what, _, check) in checks.into_iter().filter(|(_, applies, _)| *applies) {
            number += 1;
            if number > skipped {
                step(&format!("{name} {what}"), || {
                    let config = Config::check(&description, &parameters)?;
                    let file = &arguments.plugin;
                    check(&Script { file, description: &description, config: &config })
                });
            }
        }
    }
}

fn load(arguments: &Arguments) -> Result<Description> {
    let description = pdk_lua::description(&Source::read(&arguments.plugin)?)?;
    known(std::slice::from_ref(&description), arguments)?;
    Ok(description)
}

/// What the pages about a perturbation have and this one does not say, as a sentence.
fn unsaid(description: &Description, file: &Path) -> Option<String> {
    let fields = [
        ("family", &description.family),
        ("mathematics", &description.mathematics),
        ("source", &description.source),
    ];
    let missing: Vec<_> =
        fields.iter().filter(|(_, text)| text.is_empty()).map(|(name, _)| format!("`{name}`")).collect();
    let missing = match missing.as_slice() {
        [] => return None,
        [one] => one.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    };
    let folder = folder_of(file).to_string_lossy();
    let [folder, name] = [&*folder, description.name.as_str()].map(shell::quoted);
    let them = if missing.contains(' ') { "them" } else { "it" };
    Some(format!(
        "`{}` does not say its {missing}; add {them}, and `pdk --plugins {folder} show {name}` shows {them}",
        description.name
    ))
}

/// A perturbation in Lua with parameters.
struct Script<'a> {
    file: &'a Path,
    description: &'a Description,
    config: &'a Config,
}

impl Script<'_> {
    fn make(&self) -> Result<LuaPerturbation> {
        pdk_lua::open(&Source::read(self.file)?, self.config)
    }

    /// Computes a frame of a sequence, after the frames before it that it asks for: those that `earlier` makes.
    fn frame(
        &self,
        script: &mut LuaPerturbation,
        source: &FrameBuf,
        intensity: f64,
        index: u64,
        earlier: impl Fn(u64) -> FrameBuf,
    ) -> Result<FrameBuf> {
        let mut kept = Recollection::of(self.description.history as usize);
        for index in index.saturating_sub(u64::from(self.description.history))..index {
            kept.keep(earlier(index).as_ref(), index, index as f64 / RATE);
        }
        let names: Vec<String> = self.description.parameters.iter().map(|p| p.name.clone()).collect();
        let (mut values, key) = (Vec::new(), Key([5; 32]));
        frame_values(self.description, self.config, intensity, &mut values);
        let cx = Context::new(intensity, index, index as f64 / RATE, &key)
            .with_values(&names, &values)
            .with_history(kept.before(source.as_ref(), index));
        let mut result = FrameBuf::new(source.width(), source.height());
        script.apply(source.as_ref(), result.as_mut(), &cx)?;
        Ok(result)
    }

    /// It works at every size, and two instances give the same bytes.
    fn sizes(&self) -> Result<()> {
        for (width, height) in SIZES {
            for intensity in [0.0, 2.0, 4.0] {
                let place = format!("at {width}x{height} and level {intensity}");
                let source = sample_frame(width, height);
                let once = self
                    .frame(&mut self.make()?, &source, intensity, 3, |_| source.clone())
                    .map_err(|e| e.at(&place))?;
                let again = self
                    .frame(&mut self.make()?, &source, intensity, 3, |_| source.clone())
                    .map_err(|e| e.at(&place))?;
                if once != again {
                    return Err(Error::new(
                        "a frame comes out differently the second time; does it depend on the text of a table or function, \
                         or on the order in which pairs visits keys that are tables?",
                    )
                    .at(place));
                }
            }
        }
        Ok(())
    }

    /// Every frame of a sequence is what it is alone; if it is not, what the script keeps is named.
    fn sequence(&self) -> Result<()> {
        let mut script = self.make()?;
        // Every frame shows something else, so that one that holds a part of an earlier one is found.
        let source = |index: u64| {
            let mut source = sample_frame(SIZE.0, SIZE.1);
            let shift = (index * 23) as u8;
            source.as_mut().data_mut().iter_mut().for_each(|value| *value = value.wrapping_add(shift));
            source
        };
        let mut kept = vec![script.kept()?];
        // In order, then the first again.
        for index in (0..FRAMES).chain([0]) {
            let picture = source(index);
            let found = self.frame(&mut script, &picture, 2.0, index, source)?;
            kept.push(script.kept()?);
            if self.frame(&mut self.make()?, &picture, 2.0, index, source)? != found {
                return Err(Error::new(format!(
                    "frame {index} comes out differently after others than alone{}; a frame may depend on the image and on \
                     cx alone: use cx.frame_index, cx.time and the random streams, or a variable inside of `apply`",
                    because(&kept)
                )));
            }
        }
        // What was made for the first frame and stayed is a cache.
        let changes = kept[kept.len() - 3].changes(&kept[kept.len() - 2]);
        if !changes.is_empty() {
            report(&Report::Note(format!(
                "{} kept from one frame to the next; the result must not depend on it, and in {FRAMES} frames it did not",
                listed(&changes)
            )));
        }
        Ok(())
    }

    /// What any perturbation has to hold.
    fn rules(&self) -> Result<()> {
        let mut make = |config: &Config| {
            Ok(Box::new(pdk_lua::open(&Source::read(self.file)?, config)?) as Box<dyn Perturbation>)
        };
        perturbation::check(self.description, self.config, &mut make)
    }
}

/// Names what changed with the last frame.
fn because(kept: &[Kept]) -> String {
    let changes = match kept {
        [.., before, last] => before.changes(last),
        _ => Vec::new(),
    };
    // A frame may also depend on what stayed, such as a first image.
    let changes = match (changes.is_empty(), kept) {
        (true, [first, .., last]) => first.changes(last),
        _ => changes,
    };
    if changes.is_empty() { String::new() } else { format!(", because {} kept", listed(&changes)) }
}

/// The first few changes, with the verb.
fn listed(changes: &[String]) -> String {
    const MOST: usize = 3;
    let names = changes.iter().take(MOST).cloned().collect::<Vec<_>>().join(", ");
    match changes.len() {
        1 => format!("{names} is"),
        count if count > MOST => format!("{names} and {} more are", count - MOST),
        _ => format!("{names} are"),
    }
}
