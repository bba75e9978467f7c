//! The chain of perturbations that a frame goes through.

use std::collections::{BTreeMap, BTreeSet};

use pdk_components::registry::Registry;
use pdk_model::perturbation::AppliedPerturbation;
use pdk_model::scenario::Scenario;
use pdk_sdk::describe::{ActsOn, Geometry};
use pdk_sdk::error::{Error, ErrorKind, Result};
use pdk_sdk::prelude::{Annotations, Frame, FrameBuf, FrameMut, Way};
use pdk_sdk::signals::Numbers;

use crate::link::Link;
use crate::moment::Moment;
use crate::selection::Selector;

/// Perturbations applied one after the other.
pub struct Chain {
    links: Vec<Link>,
    /// Those that act on what the driver gets besides the frame, or on controls.
    devices: Vec<Link>,
    /// What lies between two links.
    between: [FrameBuf; 2],
}

impl Chain {
    /// The chain of a drive. Each perturbation draws from a key of its own: the seed, its name, and how many of the same name come before
    /// it; so neither other perturbations nor their order change what it draws.
    ///
    /// # Errors
    /// If a perturbation does not exist or refuses its parameters.
    pub fn of_scenario(registry: &Registry, scenario: &Scenario) -> Result<Self> {
        Self::make(registry, &scenario.perturbations, scenario.seed)
    }

    /// A chain for frames alone, which draws as that of a drive does.
    ///
    /// # Errors
    /// As for [`Chain::of_scenario`], and if a perturbation does not act on frames.
    pub fn new(registry: &Registry, perturbations: &[AppliedPerturbation], seed: u64) -> Result<Self> {
        let chain = Self::make(registry, perturbations, seed)?;
        let Some(link) = chain.devices.first() else { return Ok(chain) };
        let sentence =
            format!("it changes {}, which exists only in drives; leave it out", link.acts_on().text());
        Err(Error::of(ErrorKind::Configuration, sentence).at(link.label()))
    }

    fn make(registry: &Registry, perturbations: &[AppliedPerturbation], seed: u64) -> Result<Self> {
        let mut seen = BTreeMap::new();
        let (mut links, mut devices) = (Vec::with_capacity(perturbations.len()), Vec::new());
        for applied in perturbations {
            let number = seen.entry(applied.name.as_str()).or_insert(0u64);
            let link = Link::new(registry, applied, *number, seed)?;
            if link.acts_on().is_frame() { &mut links } else { &mut devices }.push(link);
            *number += 1;
        }
        Ok(Self { links, devices, between: [FrameBuf::default(), FrameBuf::default()] })
    }

    /// Makes a chain for frames alone that of the same perturbations at other levels, with another seed, at the beginning of a sequence. That
    /// takes less time than to make one, because instances keep what they have prepared. `perturbations` differ in their levels
    /// alone from those that the chain was made of.
    pub fn begin_again(&mut self, perturbations: &[AppliedPerturbation], seed: u64) {
        for (link, applied) in self.links.iter_mut().zip(perturbations) {
            link.begin_again(applied, seed);
        }
    }

    /// Sets other levels in the middle of a sequence; what the chain remembers of it stays. `perturbations` are as for [`Chain::begin_again`].
    pub fn set_levels(&mut self, perturbations: &[AppliedPerturbation]) {
        for (link, applied) in self.links.iter_mut().zip(perturbations) {
            link.set_level(applied);
        }
    }

    /// How many frames before a frame have to go through the chain first, so that it becomes what it becomes in its sequence.
    pub fn history(&self) -> usize {
        self.links.iter().map(Link::history).sum()
    }

    /// What frames have to come with.
    pub fn annotations(&self) -> Annotations {
        let selectors = || self.links.iter().filter_map(Link::selector);
        Annotations {
            labels: selectors().any(Selector::needs_labels),
            depth: selectors().any(Selector::needs_depth) || self.links.iter().any(Link::needs_depth),
        }
    }

    /// What a user should know about the maps that were made, each once.
    pub fn noticed(&self) -> Vec<String> {
        let selected = self.links.iter().filter_map(|link| link.selector()?.noticed());
        let followed = self.links.iter().filter_map(|link| link.attended()?.noticed());
        let noticed: BTreeSet<String> = selected.chain(followed).collect();
        noticed.into_iter().collect()
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

    /// What becomes of a signal at a moment: of what the driver gets besides the frame, or of its control. None if nothing acts on it.
    ///
    /// # Errors
    /// If a perturbation fails, with its name.
    pub fn pass(&mut self, what: ActsOn, given: Numbers, moment: &Moment<'_>) -> Result<Option<Numbers>> {
        let mut links = self.devices.iter_mut().filter(|link| link.acts_on() == what);
        links.try_fold(None, |passed: Option<Numbers>, link| {
            link.pass(passed.unwrap_or(given), moment).map(Some)
        })
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
    /// [`Perturbation::move_points`](pdk_sdk::perturbation::Perturbation::move_points).
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

    /// Takes a gradient back from a frame of `size`, width and height, to the picture that the last perturbation shows: see
    /// [`Perturbation::picture_gradient`](pdk_sdk::perturbation::Perturbation::picture_gradient).
    ///
    /// # Errors
    /// If there is none, or it cannot, with its name.
    pub fn picture_gradient(
        &mut self,
        of_frame: &[f32],
        size: [usize; 2],
        moment: &Moment<'_>,
        into: &mut [f32],
    ) -> Result<()> {
        let none = || Error::new("no perturbation changes the frame, so none shows a picture");
        self.links.last_mut().ok_or_else(none)?.picture_gradient(of_frame, size, moment, into)
    }
}
