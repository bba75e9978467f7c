//! The chain of perturbations that a frame goes through.

use std::collections::BTreeMap;

use pdk_model::level::Level;
use pdk_model::perturbation::{AppliedPerturbation, Draws};
use pdk_model::scenario::Scenario;
use pdk_sdk::config::{self, Config};
use pdk_sdk::describe::{Description, Geometry, Kind};
use pdk_sdk::error::{Error, Result};
use pdk_sdk::history::Recollection;
use pdk_sdk::prelude::{Annotations, Context, Frame, FrameBuf, FrameMut, Key, Perturbation, Way};
use pdk_sdk::seed;

use crate::maps::Attended;
use crate::mask::{self, Mask};
use crate::moment::Moment;
use crate::selection::Selector;
use pdk_components::registry::Registry;
use pdk_supervise::calls::{self, Function};

/// Perturbations applied one after the other.
pub struct Chain {
    links: Vec<Link>,
    /// What lies between two links.
    between: [FrameBuf; 2],
}

struct Link {
    /// As it is named in errors.
    label: String,
    /// The component's name.
    name: String,
    /// How many of the same name come before it.
    number: u64,
    /// None only while it is dropped.
    instance: Option<Box<dyn Perturbation>>,
    description: Description,
    config: Config,
    names: Vec<String>,
    values: Vec<f64>,
    level: Level,
    key: Key,
    probability: Option<f64>,
    /// What the probability is drawn from: not what the perturbation itself draws from.
    chance_key: Key,
    draws: Option<Draws>,
    mask: Option<Mask>,
    selector: Option<Selector>,
    attended: Option<Attended>,
    /// The frames that it was given before, as many as it asks for.
    history: Recollection,
    /// How much of each pixel is changed where both limit it.
    weights: Vec<u8>,
}

impl Chain {
    /// The chain of a scenario.
    ///
    /// # Errors
    /// As for [`Chain::new`].
    pub fn of_scenario(registry: &Registry, scenario: &Scenario) -> Result<Self> {
        Self::new(registry, &scenario.perturbations, scenario.seed)
    }

    /// Makes the instances. Each draws from a key of its own: the seed, its name, and how many of the same name come before
    /// it; so neither other perturbations nor their order change what it draws.
    ///
    /// # Errors
    /// If a perturbation does not exist or refuses its parameters.
    pub fn new(registry: &Registry, perturbations: &[AppliedPerturbation], seed: u64) -> Result<Self> {
        let mut seen = BTreeMap::new();
        let mut links = Vec::with_capacity(perturbations.len());
        for applied in perturbations {
            let (instance, config) = registry.perturbation(&applied.name, &applied.parameters)?;
            let description = registry.catalog().get(Kind::Perturbation, &applied.name)?.description.clone();
            if applied.attention.is_some() && description.follows_attention.is_empty() {
                return Err(Error::new(
                    "it does not follow saliency maps, so leave `attention` out; `where` limits any perturbation to what a map marks",
                )
                .at(format_args!("perturbation `{}`", applied.name)));
            }
            let number = seen.entry(applied.name.as_str()).or_insert(0u64);
            let key = |what: &str| key(seed, what, &applied.name, *number);
            links.push(Link {
                label: label(applied),
                name: applied.name.clone(),
                number: *number,
                instance: Some(instance),
                names: description.parameters.iter().map(|p| p.name.clone()).collect(),
                history: Recollection::of(description.history as usize),
                description,
                config,
                values: Vec::new(),
                level: applied.level.clone(),
                key: key("perturbation"),
                probability: applied.probability,
                chance_key: key("probability"),
                draws: applied.draws,
                mask: applied.region.as_ref().map(Mask::new).transpose()?,
                selector: match &applied.selection {
                    Some(selection) => Some(Selector::new(registry, selection, key("where"))?),
                    None => None,
                },
                attended: match &applied.attention {
                    Some(attention) => Some(Attended::new(registry, attention, key("attention"))?),
                    None => None,
                },
                weights: Vec::new(),
            });
            *number += 1;
        }
        Ok(Self { links, between: [FrameBuf::default(), FrameBuf::default()] })
    }

    /// Makes it the chain of the same perturbations at other levels, with another seed, at the beginning of a sequence. That
    /// takes less time than to make one, because instances keep what they have prepared. `perturbations` differ in their levels
    /// alone from those that the chain was made of.
    pub fn begin_again(&mut self, perturbations: &[AppliedPerturbation], seed: u64) {
        for (link, applied) in self.links.iter_mut().zip(perturbations) {
            if link.level != applied.level {
                link.level = applied.level.clone();
                link.label = label(applied);
            }
            link.history.forget();
            let key = |what: &str| key(seed, what, &link.name, link.number);
            (link.key, link.chance_key) = (key("perturbation"), key("probability"));
            if let Some(selector) = &mut link.selector {
                selector.begin_again(key("where"));
            }
            if let Some(attended) = &mut link.attended {
                attended.begin_again(key("attention"));
            }
        }
    }

    /// How many frames before a frame have to go through the chain first, so that it becomes what it becomes in its sequence.
    pub fn history(&self) -> usize {
        self.links.iter().map(|link| link.description.history as usize).sum()
    }

    /// What frames have to come with.
    pub fn annotations(&self) -> Annotations {
        let selectors = || self.links.iter().filter_map(|link| link.selector.as_ref());
        Annotations {
            labels: selectors().any(Selector::needs_labels),
            depth: selectors().any(Selector::needs_depth),
        }
    }

    /// What a user should know about the maps that were made, each once.
    pub fn noticed(&self) -> Vec<String> {
        let selected = self.links.iter().filter_map(|link| link.selector.as_ref()?.noticed());
        let mut noticed: Vec<String> =
            selected.chain(self.links.iter().filter_map(|link| link.attended.as_ref()?.noticed())).collect();
        noticed.sort();
        noticed.dedup();
        noticed
    }

    /// Writes the perturbed `src` to `dst`; without perturbations it is a copy.
    ///
    /// # Errors
    /// If a perturbation fails, with its name.
    pub fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, moment: &Moment<'_>) -> Result<()> {
        let Some((last, earlier)) = self.links.split_last_mut() else {
            dst.copy_from(src);
            return Ok(());
        };
        if !earlier.is_empty() {
            self.between.iter_mut().for_each(|frame| frame.resize(src.width(), src.height()));
        }
        let [from, to] = &mut self.between;
        for (position, link) in earlier.iter_mut().enumerate() {
            let input = if position == 0 { src } else { from.as_ref() };
            link.apply(src, input, to.as_mut(), moment)?;
            std::mem::swap(from, to);
        }
        let input = if earlier.is_empty() { src } else { from.as_ref() };
        last.apply(src, input, dst, moment)
    }

    /// Whether it moves things.
    ///
    /// # Errors
    /// If one of the perturbations does not say what it does to the places of things, with its name.
    pub fn moves(&self) -> Result<bool> {
        let mut moves = false;
        for link in &self.links {
            moves |= link.geometry()? == Geometry::Moved;
        }
        Ok(moves)
    }

    /// Moves points as [`Chain::apply`] moves the pixels of a frame of `size`, width and height, at the same moment: see
    /// [`Perturbation::move_points`].
    ///
    /// # Errors
    /// If a perturbation cannot say where they go, with its name.
    pub fn move_points(
        &mut self,
        points: &mut [[f64; 2]],
        way: Way,
        size: [usize; 2],
        moment: &Moment<'_>,
    ) -> Result<()> {
        match way {
            Way::ToPerturbed => {
                self.links.iter_mut().try_for_each(|link| link.move_points(points, way, size, moment))
            }
            Way::ToSource => {
                self.links.iter_mut().rev().try_for_each(|link| link.move_points(points, way, size, moment))
            }
        }
    }
}

/// A perturbation as it is named in errors.
fn label(applied: &AppliedPerturbation) -> String {
    format!("perturbation `{}`", applied.short_name())
}

/// What one of the draws of a perturbation comes from.
fn key(seed: u64, what: &str, name: &str, number: u64) -> Key {
    seed::key(seed, &format!("{what}/{name}"), number)
}

impl Link {
    /// Perturbs `src`; `raw` is the frame before all perturbations, of which maps are made.
    fn apply(
        &mut self,
        raw: Frame<'_>,
        src: Frame<'_>,
        mut dst: FrameMut<'_>,
        moment: &Moment<'_>,
    ) -> Result<()> {
        let Moment { frame_index, .. } = *moment;
        let (level, key) = (self.level_of(moment), self.key_of(frame_index));
        // Also for frames that are spared, so that a map comes from the frame whose turn it is.
        let chosen = match &mut self.selector {
            Some(selector) => Some(selector.weights(raw, moment).map_err(|error| error.at(&self.label))?),
            None => None,
        };
        let attended = match &mut self.attended {
            Some(attended) => Some(attended.look(raw, moment).map_err(|error| error.at(&self.label))?),
            None => None,
        };
        let Some(level) = level else {
            dst.copy_from(src);
            self.history.keep(src, frame_index, moment.time);
            return Ok(());
        };
        config::frame_values(&self.description, &self.config, level, &mut self.values);
        let cx = context((level, moment), &key, self.draws, (&self.names, &self.values));
        let cx = match attended {
            Some((now, earlier)) => cx.with_saliency(now, earlier),
            None => cx,
        }
        .with_history(self.history.before(src, frame_index));
        // A plugin that leaves pixels out must not show what happened to lie there: that depends on what was computed before.
        dst.rows_mut().for_each(|row| row.fill(0));
        let Some(instance) = &mut self.instance else { return Ok(()) };
        let applied = calls::call_at(&self.label, Function::Apply, frame_index, || {
            instance.apply(src, dst.reborrow(), &cx)
        });
        // Also a frame that it fails at: the camera has seen it.
        self.history.keep(src, frame_index, moment.time);
        applied.map_err(|error| error.at(&self.label))?;
        let within = self.mask.as_mut().map(|mask| mask.weights(src.width(), src.height()));
        match (within, chosen) {
            (Some(weights), None) | (None, Some(weights)) => mask::restore(src, dst, weights),
            (Some(within), Some(chosen)) => {
                let both = within
                    .iter()
                    .zip(chosen)
                    .map(|(&a, &b)| ((u32::from(a) * u32::from(b) + 127) / 255) as u8);
                self.weights.clear();
                self.weights.extend(both);
                mask::restore(src, dst, &self.weights);
            }
            (None, None) => {}
        }
        Ok(())
    }
}

impl Link {
    /// The intensity in a frame; none if it is spared.
    fn level_of(&self, moment: &Moment<'_>) -> Option<f64> {
        let Moment { frame_index, time, .. } = *moment;
        let spared =
            self.probability.is_some_and(|chance| self.chance_key.frame(frame_index).unit() >= chance);
        self.level.at(time).filter(|_| !spared)
    }

    /// What it draws from in a frame.
    fn key_of(&self, frame_index: u64) -> Key {
        match self.draws {
            Some(Draws::PerFrame) => seed::of_frame(&self.key, frame_index),
            _ => self.key,
        }
    }

    /// What it does to the places of things, with what limits it.
    ///
    /// # Errors
    /// If that is not known, with its name.
    fn geometry(&self) -> Result<Geometry> {
        let limited = self.mask.is_some() || self.selector.is_some() || self.attended.is_some();
        let sentence = match self.description.geometry {
            Geometry::Kept => return Ok(Geometry::Kept),
            Geometry::Moved if !limited => return Ok(Geometry::Moved),
            Geometry::Moved => {
                "it moves things in a part of the frame only, so that it is not known where they are"
            }
            Geometry::Altered => "it moves things in a way that it cannot describe",
            Geometry::Undeclared => "it does not say whether it changes where things are",
        };
        Err(Error::new(sentence).at(&self.label))
    }

    /// Moves points as it moves the pixels of a frame.
    fn move_points(
        &mut self,
        points: &mut [[f64; 2]],
        way: Way,
        size: [usize; 2],
        moment: &Moment<'_>,
    ) -> Result<()> {
        let (Geometry::Moved, Some(level)) = (self.geometry()?, self.level_of(moment)) else {
            return Ok(());
        };
        config::frame_values(&self.description, &self.config, level, &mut self.values);
        let key = self.key_of(moment.frame_index);
        let cx = context((level, moment), &key, self.draws, (&self.names, &self.values));
        let Some(instance) = &mut self.instance else { return Ok(()) };
        calls::call_at(&self.label, Function::MovePoints, moment.frame_index, || {
            instance.move_points(points, way, size, &cx)
        })
        .map_err(|error| error.at(&self.label))
    }
}

/// What a perturbation knows of a frame, without saliency maps.
fn context<'a>(
    (level, moment): (f64, &Moment<'_>),
    key: &'a Key,
    draws: Option<Draws>,
    (names, values): (&'a [String], &'a [f64]),
) -> Context<'a> {
    let mut cx = Context::new(level, moment.frame_index, moment.time, key).with_values(names, values);
    cx.travelled = moment.travelled;
    match draws {
        Some(Draws::PerSequence) => cx.with_stream(0),
        _ => cx,
    }
}

impl Drop for Link {
    /// What a component does at its end is noted as well.
    fn drop(&mut self) {
        if let Some(instance) = self.instance.take() {
            calls::call(&self.label, Function::Drop, || drop(instance));
        }
    }
}
