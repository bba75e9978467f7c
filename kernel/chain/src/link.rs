//! A perturbation in a chain, with what it draws from and what limits it.

use pdk_components::held::Held;
use pdk_components::registry::Registry;
use pdk_model::component::ComponentSpec;
use pdk_model::level::{Level, MAX_INTENSITY};
use pdk_model::level_scale::MeasuredScale;
use pdk_model::perturbation::{AppliedPerturbation, Draws};
use pdk_sdk::config::{self, Config};
use pdk_sdk::describe::{ActsOn, Description, Geometry, Kind};
use pdk_sdk::error::{Error, Result};
use pdk_sdk::history::Recollection;
use pdk_sdk::perturbation::pass;
use pdk_sdk::prelude::{Context, Frame, FrameMut, Key, Perturbation, Signal, Way};
use pdk_sdk::seed;
use pdk_sdk::signals::{Numbers, Passed};
use pdk_supervise::calls::Function;

use crate::attended::Attended;
use crate::mask::{self, Mask};
use crate::moment::Moment;
use crate::part::Part;
use crate::selection::Selector;

/// A perturbation in a chain.
pub struct Link {
    held: Held<dyn Perturbation>,
    level: Level,
    /// The scale that the level is on; none if it is the published one.
    scale: Option<MeasuredScale>,
    parameters: Parameters,
    dice: Dice,
    limits: Limits,
    attended: Option<Attended>,
    /// The frames that it was given before, as many as it asks for.
    history: Recollection,
    /// The signals that it passed on, if it is a fault of a device.
    signals: Passed,
}

/// Its parameters, and their values in a frame.
struct Parameters {
    description: Description,
    config: Config,
    names: Vec<String>,
    values: Vec<f64>,
}

/// What it draws from, and what is drawn for it.
struct Dice {
    /// The component's name.
    name: String,
    /// How many of the same name come before it.
    number: u64,
    key: Key,
    draws: Option<Draws>,
    probability: Option<f64>,
    /// What the probability is drawn from: not what the perturbation itself draws from.
    chance_key: Key,
}

/// What limits it to a part of the drive and to pixels.
struct Limits {
    part: Option<Part>,
    mask: Option<Mask>,
    selector: Option<Selector>,
    /// How much of each pixel is changed if several limit it.
    all: Vec<u8>,
}

impl Link {
    /// The perturbation with this many of the same name before it.
    ///
    /// # Errors
    /// If it does not exist or refuses its parameters.
    pub fn new(registry: &Registry, applied: &AppliedPerturbation, number: u64, seed: u64) -> Result<Self> {
        let AppliedPerturbation { name, parameters, .. } = applied;
        let (instance, config) = registry.perturbation(name, parameters)?;
        let description = registry.catalog().get(Kind::Perturbation, name)?.description.clone();
        if applied.attention.is_some() && description.follows_attention.is_empty() {
            return Err(Error::new(
                "it does not follow saliency maps, so leave `attention` out; `where` limits any perturbation to what a map marks",
            )
            .at(format_args!("perturbation `{name}`")));
        }
        let boxes = applied.during.is_some_and(|during| during.has_box());
        let limited = boxes || applied.region.is_some() || applied.selection.is_some();
        if limited && !description.acts_on.is_frame() {
            let sentence =
                "it does not change frames, so leave `region`, `where` and the box of `during` out";
            return Err(Error::new(sentence).at(format_args!("perturbation `{name}`")));
        }
        let scale = registry.catalog().level_scale(applied)?;
        let frames = if description.acts_on.is_frame() { description.history as usize } else { 0 };
        let component = ComponentSpec { name: name.clone(), parameters: parameters.clone() };
        let mut held = Held::new(Kind::Perturbation, component, instance);
        held.rename(label(applied));
        let dice = Dice::new(applied, &description, number, seed);
        let selection = applied.selection.as_ref();
        let attention = applied.attention.as_ref();
        Ok(Self {
            held,
            level: applied.level.clone(),
            scale,
            limits: Limits {
                part: applied.during.as_ref().map(Part::new),
                mask: applied.region.as_ref().map(Mask::new).transpose()?,
                selector: selection
                    .map(|selection| Selector::new(registry, selection, dice.key_for("where", seed)))
                    .transpose()?,
                all: Vec::new(),
            },
            attended: attention
                .map(|attention| Attended::new(registry, attention, dice.key_for("attention", seed)))
                .transpose()?,
            history: Recollection::of(frames),
            signals: Passed::of(description.history as usize - frames),
            parameters: Parameters {
                names: description.parameters.iter().map(|p| p.name.clone()).collect(),
                description,
                config,
                values: Vec::new(),
            },
            dice,
        })
    }

    /// Makes it the same perturbation at another level, with another seed, at the beginning of a sequence.
    pub fn begin_again(&mut self, applied: &AppliedPerturbation, seed: u64) {
        self.set_level(applied);
        self.history.forget();
        self.signals.forget();
        self.dice.begin_again(seed);
        if let Some(selector) = &mut self.limits.selector {
            selector.begin_again(self.dice.key_for("where", seed));
        }
        if let Some(attended) = &mut self.attended {
            attended.begin_again(self.dice.key_for("attention", seed));
        }
    }

    /// Sets another level.
    pub fn set_level(&mut self, applied: &AppliedPerturbation) {
        if self.level != applied.level {
            self.level = applied.level.clone();
            self.held.rename(label(applied));
        }
    }

    /// What it acts on.
    pub fn acts_on(&self) -> ActsOn {
        self.parameters.description.acts_on
    }

    /// How it is named in errors.
    pub fn label(&self) -> &str {
        self.held.label()
    }

    /// Whether it is set to something for which it needs to know how far away pixels are.
    pub fn needs_depth(&self) -> bool {
        let Parameters { description, config, .. } = &self.parameters;
        description.depth.as_ref().is_some_and(|choice| config.text(&choice.parameter) == choice.option)
    }

    /// What becomes of a signal.
    ///
    /// # Errors
    /// If it fails, with its name.
    pub fn pass(&mut self, given: Numbers, moment: &Moment<'_>) -> Result<Numbers> {
        let Moment { frame_index, time, .. } = *moment;
        let (level, key) = (self.level_of(moment), self.dice.key_of(frame_index));
        let mut passed = given;
        if let Some(level) = level {
            let what = self.acts_on();
            let cx = context((level, moment), &key, self.dice.draws, self.parameters.at(level))
                .with_signals(self.signals.before(frame_index));
            let function = if what == ActsOn::Control { Function::Actuate } else { Function::Observe };
            passed =
                self.held.call(function, Some(frame_index), |instance| pass(instance, what, given, &cx))?;
        }
        self.signals.keep(Signal { frame_index, time, given, passed });
        Ok(passed)
    }

    /// How many frames before a frame it needs.
    pub fn history(&self) -> usize {
        self.parameters.description.history as usize
    }

    /// What selects its pixels in each frame.
    pub fn selector(&self) -> Option<&Selector> {
        self.limits.selector.as_ref()
    }

    /// The maps that it follows.
    pub fn attended(&self) -> Option<&Attended> {
        self.attended.as_ref()
    }

    /// Perturbs `src`; `raw` is the frame before all perturbations, of which maps are made.
    ///
    /// # Errors
    /// If it fails, with its name.
    pub fn apply(
        &mut self,
        raw: Frame<'_>,
        src: Frame<'_>,
        mut dst: FrameMut<'_>,
        moment: &Moment<'_>,
    ) -> Result<()> {
        let Moment { frame_index, .. } = *moment;
        let (level, key) = (self.level_of(moment), self.dice.key_of(frame_index));
        let depth = moment.depth.filter(|_| self.needs_depth());
        let Limits { part, mask, selector, all } = &mut self.limits;
        let labelled = |error: Error| error.at(self.held.label());
        // Also for frames that are spared, so that a map comes from the frame whose turn it is.
        let chosen = selector.as_mut().map(|selector| selector.weights(raw, moment)).transpose();
        let chosen = chosen.map_err(labelled)?;
        let attended = self.attended.as_mut().map(|attended| attended.look(raw, moment)).transpose();
        let attended = attended.map_err(labelled)?;
        let Some(level) = level else {
            dst.copy_from(src);
            self.history.keep(src, frame_index, moment.time);
            return Ok(());
        };
        let cx = context((level, moment), &key, self.dice.draws, self.parameters.at(level));
        let mut cx = match attended {
            Some((now, earlier)) => cx.with_saliency(now, earlier),
            None => cx,
        }
        .with_history(self.history.before(src, frame_index));
        cx.depth = depth;
        // A plugin that leaves pixels out must not show what happened to lie there: that depends on what was computed before.
        dst.rows_mut().for_each(|row| row.fill(0));
        let applied = self
            .held
            .call(Function::Apply, Some(frame_index), |instance| instance.apply(src, dst.reborrow(), &cx));
        // Also a frame that it fails at: the camera has seen it.
        self.history.keep(src, frame_index, moment.time);
        applied?;
        let (width, height) = (src.width(), src.height());
        let within = mask.as_mut().map(|mask| mask.weights(width, height));
        let part = part.as_mut().map(|part| part.weights(moment.time, width, height));
        let [inside, outside] = part.unwrap_or_default();
        let mut limits = [within, chosen, inside, outside].into_iter().flatten();
        let (Some(first), second) = (limits.next(), limits.next()) else { return Ok(()) };
        if second.is_none() {
            mask::restore(src, dst, first);
            return Ok(());
        }
        all.clear();
        all.extend_from_slice(first);
        for limit in second.into_iter().chain(limits) {
            for (weight, &other) in all.iter_mut().zip(limit) {
                *weight = ((u32::from(*weight) * u32::from(other) + 127) / 255) as u8;
            }
        }
        mask::restore(src, dst, all);
        Ok(())
    }

    /// The published level in a frame, which may lie outside 0 to 4 if the level is on another scale; none if the frame is spared.
    fn level_of(&self, moment: &Moment<'_>) -> Option<f64> {
        let spared = self.limits.part.as_ref().is_some_and(|part| part.spares(moment.time))
            || self.dice.spares(moment.frame_index);
        let level = self.level.at(moment.time).filter(|_| !spared)?;
        self.scale.as_ref().map_or(Some(level), |scale| scale.published(level))
    }

    /// Whether it changes only a part of the frame, or follows maps.
    fn is_limited(&self) -> bool {
        let Limits { part, mask, selector, .. } = &self.limits;
        let in_a_part = part.as_ref().is_some_and(Part::has_box);
        in_a_part || mask.is_some() || selector.is_some() || self.attended.is_some()
    }

    /// What it does to the places of things, with what limits it.
    ///
    /// # Errors
    /// If that is not known, with its name.
    pub fn geometry(&self) -> Result<Geometry> {
        let sentence = match self.parameters.description.geometry {
            Geometry::Kept => return Ok(Geometry::Kept),
            Geometry::Moved if !self.is_limited() => return Ok(Geometry::Moved),
            Geometry::Moved => {
                "it moves things in a part of the frame only, so that it is not known where they are"
            }
            Geometry::Altered => "it moves things in a way that it cannot describe",
            Geometry::Undeclared => "it does not say whether it changes where things are",
        };
        Err(Error::new(sentence).at(self.held.label()))
    }

    /// Moves points as it moves the pixels of a frame.
    ///
    /// # Errors
    /// If it cannot say where they go, with its name.
    pub fn move_points(
        &mut self,
        points: &mut [[f64; 2]],
        way: Way,
        size: [usize; 2],
        moment: &Moment<'_>,
    ) -> Result<()> {
        let (Geometry::Moved, Some(level)) = (self.geometry()?, self.level_of(moment)) else {
            return Ok(());
        };
        let key = self.dice.key_of(moment.frame_index);
        let cx = context((level, moment), &key, self.dice.draws, self.parameters.at(level));
        self.held.call(Function::MovePoints, Some(moment.frame_index), |instance| {
            instance.move_points(points, way, size, &cx)
        })
    }

    /// Takes a gradient back from a frame to the picture that it shows: see
    /// [`Perturbation::picture_gradient`](pdk_sdk::perturbation::Perturbation::picture_gradient).
    ///
    /// # Errors
    /// If it cannot, with its name.
    pub fn picture_gradient(
        &mut self,
        of_frame: &[f32],
        size: [usize; 2],
        moment: &Moment<'_>,
        into: &mut [f32],
    ) -> Result<()> {
        if self.is_limited() {
            let sentence = "only a picture that is shown whole can be trained, so leave `region`, `where`, `attention` and boxes out";
            return Err(Error::new(sentence).at(self.held.label()));
        }
        let Some(level) = self.level_of(moment) else { return Ok(()) };
        let key = self.dice.key_of(moment.frame_index);
        let depth = moment.depth.filter(|_| self.needs_depth());
        let mut cx = context((level, moment), &key, self.dice.draws, self.parameters.at(level));
        cx.depth = depth;
        self.held.call(Function::PictureGradient, Some(moment.frame_index), |instance| {
            instance.picture_gradient(of_frame, size, &cx, into)
        })
    }
}

impl Parameters {
    /// Their names and values at a level.
    fn at(&mut self, level: f64) -> (&[String], &[f64]) {
        config::frame_values(&self.description, &self.config, level, &mut self.values);
        (&self.names, &self.values)
    }
}

impl Dice {
    fn new(applied: &AppliedPerturbation, description: &Description, number: u64, seed: u64) -> Self {
        let AppliedPerturbation { name, draws, probability, .. } = applied;
        let nothing = Key([0; 32]);
        // What draws for every frame already keeps its key: it may ask what an earlier frame drew, such as whether that was lost.
        let is_per_frame =
            description.drawn_per_sequence.is_empty() && !description.drawn_per_frame.is_empty();
        let draws = draws.filter(|draws| *draws != Draws::PerFrame || !is_per_frame);
        let mut dice = Self {
            name: name.clone(),
            number,
            key: nothing,
            draws,
            probability: *probability,
            chance_key: nothing,
        };
        dice.begin_again(seed);
        dice
    }

    fn begin_again(&mut self, seed: u64) {
        (self.key, self.chance_key) = (self.key_for("perturbation", seed), self.key_for("probability", seed));
    }

    /// What one of its draws comes from.
    fn key_for(&self, what: &str, seed: u64) -> Key {
        seed::key(seed, &format!("{what}/{}", self.name), self.number)
    }

    /// Whether a frame is not perturbed.
    fn spares(&self, frame_index: u64) -> bool {
        self.probability.is_some_and(|chance| self.chance_key.frame(frame_index).unit() >= chance)
    }

    /// What it draws from in a frame.
    fn key_of(&self, frame_index: u64) -> Key {
        match self.draws {
            Some(Draws::PerFrame) => seed::of_frame(&self.key, frame_index),
            _ => self.key,
        }
    }
}

/// A perturbation as it is named in errors.
fn label(applied: &AppliedPerturbation) -> String {
    format!("perturbation `{}`", applied.short_name())
}

/// What a perturbation knows of a frame, without saliency maps.
fn context<'a>(
    (level, moment): (f64, &Moment<'_>),
    key: &'a Key,
    draws: Option<Draws>,
    (names, values): (&'a [String], &'a [f64]),
) -> Context<'a> {
    // What does not follow from parameters ends where the published levels end.
    let mut cx = Context::new(level.clamp(0.0, MAX_INTENSITY), moment.frame_index, moment.time, key)
        .with_values(names, values);
    (cx.travelled, cx.period, cx.speed) = (moment.travelled, moment.period, moment.speed);
    match draws {
        Some(Draws::PerSequence) => cx.with_stream(0),
        _ => cx,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_draws_for_every_frame_already_keeps_its_key() {
        let mut applied = AppliedPerturbation::new("x", 1.0);
        applied.draws = Some(Draws::PerFrame);
        let plain = || Description::perturbation("x", "x");
        let same = |description: &Description| {
            let dice = Dice::new(&applied, description, 0, 7);
            dice.key_of(1) == dice.key_of(2)
        };
        assert!(same(&plain().drawn_per_frame("whether it is lost")));
        assert!(!same(&plain().drawn_per_sequence("where it is")) && !same(&plain()));
        assert!(!same(&plain().drawn_per_sequence("where it is").drawn_per_frame("the noise")));
    }
}
