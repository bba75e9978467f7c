//! A script as a perturbation.

use std::borrow::Cow;
use std::path::Path;

use mlua::{AnyUserData, Function, Lua, LuaString, Table, Value};
use pdk_components::registry::Script;
use pdk_sdk::config::{Config, frame_values};
use pdk_sdk::describe::{Description, Kind, ParameterType};
use pdk_sdk::driver::{Control, DriveContext};
use pdk_sdk::error::{Error, Place, Result};
use pdk_sdk::file;
use pdk_sdk::mask::Mask;
use pdk_sdk::model::level::DEFAULT_LEVEL;
use pdk_sdk::ops::color::grey;
use pdk_sdk::ops::{Frame, FrameMut};
use pdk_sdk::perturbation::{Context, Perturbation, Way};
use pdk_sdk::saliency::{HeatmapMut, MapContext};
use pdk_sdk::seed::Key;
use pdk_sdk::signals::Numbers;

use crate::absent::{self, Reached};
use crate::chunk::LARGEST_SCRIPT;
use crate::declaration::{
    self, CONTEXT, CONTROL, Declaration, EARLIER, OBSERVATION, PARAMETER, PERTURBATION,
};
use crate::failure::type_of;
use crate::glance::{Glance, glance};
use crate::history::ScriptHistory;
use crate::image::{ImageClass, LuaImage};
use crate::limits::Limits;
use crate::points::Points;
use crate::random::{LuaRandom, RANDOM};
use crate::sandbox::Sandbox;
use crate::signals::{ScriptSignal, returned_nothing};
use crate::types::Declare;
use crate::unknown;

/// What the script of a perturbation sees besides Luau's own library, in the order of the type definition file.
pub fn perturbation_api() -> Vec<&'static dyn Declare> {
    vec![&PERTURBATION, &PARAMETER, &CONTEXT, &EARLIER, &CONTROL, &OBSERVATION, &ImageClass, &RANDOM]
}

/// The text of a script.
pub struct Source<'a> {
    /// What errors call it.
    script: String,
    text: Cow<'a, [u8]>,
    /// The name of the perturbation where the script gives none.
    stem: &'a str,
}

impl<'a> Source<'a> {
    /// Reads a script.
    ///
    /// # Errors
    /// If it is a file that cannot be read.
    pub fn of(script: Script<'a>) -> Result<Self> {
        match script {
            Script::File(path) => Self::read(path),
            Script::BuiltIn(script) => Ok(Self {
                script: script.path().display().to_string(),
                text: Cow::Borrowed(script.source.as_bytes()),
                stem: script.name,
            }),
        }
    }

    /// Reads the script in a file.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn read(path: &'a Path) -> Result<Self> {
        // The error about a script that is too large comes from where it is compiled.
        let text = file::read(path, 16 * LARGEST_SCRIPT as u64).place(path.display())?;
        let stem = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
        Ok(Self { script: path.display().to_string(), text: Cow::Owned(text), stem })
    }

    /// What it is by its text.
    pub(crate) fn glance(&self) -> Glance {
        glance(&self.text)
    }

    /// The error of one that has what a component has, and returns nothing.
    pub(crate) fn without_return(&self) -> Error {
        match declaration::read(&Value::Nil, self.stem) {
            Err(error) => error.at(&self.script),
            Ok(_) => unreachable!("nothing is not a table"),
        }
    }
}

/// What a script turned out to be.
pub(crate) enum Returned {
    /// It returned a table with `apply`.
    Perturbation(Box<Declaration>),
    /// It reached for what only pipelines have.
    Pipeline,
    /// It returned this.
    Other(Value),
}

/// Reads the description of the perturbation in a script.
///
/// # Errors
/// If it is not a valid script, or is something other than a perturbation.
pub fn description(source: &Source<'_>) -> Result<Description> {
    let machine = Machine::new(Limits::of_perturbation()?)?;
    let declaration = machine.declare(&source.script, &source.text, source.stem)?;
    Ok(declaration.description)
}

/// Finds out what a script is.
///
/// # Errors
/// If the script fails, or it returns a table that is meant as a perturbation and is not a valid one.
pub(crate) fn look_at(source: &Source<'_>) -> Result<Returned> {
    let machine = Machine::new(Limits::of_perturbation()?)?;
    machine.look_at(&source.script, &source.text, source.stem)
}

/// Makes an instance of the perturbation in a script. `config` has been checked against its description.
///
/// # Errors
/// As [`description`].
pub fn open(source: &Source<'_>, config: &Config) -> Result<LuaPerturbation> {
    let Source { script, text, stem } = source;
    LuaPerturbation::new(script, text, stem, config.clone(), Limits::of_perturbation()?)
}

/// A virtual machine for the script of a perturbation.
struct Machine {
    sandbox: Sandbox,
    reached: Reached,
}

impl Machine {
    fn new(limits: Limits) -> Result<Self> {
        let mut reached = Reached::default();
        let sandbox = Sandbox::with_api(limits, |lua| {
            reached = absent::install(lua)?;
            Ok(())
        })?;
        Ok(Self { sandbox, reached })
    }

    /// Runs a script, which may be anything.
    fn look_at(&self, script: &str, source: &[u8], stem: &str) -> Result<Returned> {
        let chunk = self.sandbox.load(script, source)?;
        self.reached.forget();
        let returned = match self.sandbox.call(script, &chunk, ()) {
            Err(_) if self.reached.get() => return Ok(Returned::Pipeline),
            returned => returned?,
        };
        match &returned {
            Value::Table(table) if declaration::is_meant(table)? => {
                let declaration = declaration::read(&returned, stem).map_err(|error| error.at(script))?;
                Ok(Returned::Perturbation(Box::new(declaration)))
            }
            _ => Ok(Returned::Other(returned)),
        }
    }

    /// Runs a script, which has to be a perturbation.
    fn declare(&self, script: &str, source: &[u8], stem: &str) -> Result<Declaration> {
        match self.look_at(script, source, stem)? {
            Returned::Perturbation(declaration) => Ok(*declaration),
            Returned::Pipeline => Err(Error::new(format!(
                "is a pipeline, but a perturbation is expected here; run it with `pdk run {script}`, or move it elsewhere"
            ))
            .at(script)),
            Returned::Other(returned) => declaration::read(&returned, stem).map_err(|error| error.at(script)),
        }
    }
}

/// A perturbation written in Lua, in a virtual machine of its own.
pub struct LuaPerturbation {
    pub(super) script: String,
    description: Description,
    config: Config,
    pub(super) apply: Function,
    /// How it moves points, if it says so.
    points: Option<Points>,
    /// What it changes that is not a frame.
    signal: ScriptSignal,
    /// The image of the latest frame, used again for frames of the same size.
    image: Option<AnyUserData>,
    cx: ScriptContext,
    /// The parameters' values of the frame at hand.
    values: Vec<f64>,
    /// The limits before the size of the frame counts.
    limits: Limits,
    pub(super) sandbox: Sandbox,
}

impl LuaPerturbation {
    /// Makes an instance from the text of a script. `script` is its name in errors, and `stem` the name of the
    /// perturbation where the script gives none.
    ///
    /// # Errors
    /// If it is not a valid script or returns something other than a perturbation.
    pub fn new(script: &str, source: &[u8], stem: &str, config: Config, limits: Limits) -> Result<Self> {
        let machine = Machine::new(limits)?;
        let Declaration { description, apply, points } = machine.declare(script, source, stem)?;
        let sandbox = machine.sandbox;
        let cx = sandbox.make(script, |lua| ScriptContext::new(lua, &description, &config))?;
        let signal = sandbox.make(script, |lua| ScriptSignal::new(lua, description.acts_on))?;
        Ok(Self {
            script: script.to_owned(),
            description,
            config,
            apply,
            points,
            signal,
            image: None,
            cx,
            values: Vec::new(),
            limits,
            sandbox,
        })
    }

    /// What the script says about itself.
    pub fn description(&self) -> &Description {
        &self.description
    }

    /// An image of the size of `src` with its pixels.
    fn image_of(&mut self, src: Frame<'_>) -> Result<AnyUserData> {
        let mut latest = self.image.take();
        if let Some(image) = &latest {
            let pixels = image.borrow::<LuaImage>().place(&self.script)?;
            if (pixels.width(), pixels.height()) != (src.width(), src.height()) {
                drop(pixels);
                latest = None;
            }
        }
        self.sandbox.set_limits(
            &self.script,
            self.limits.for_frame(src.width(), src.height(), self.description.history as usize),
        )?;
        let image = self.sandbox.make(&self.script, |lua| match latest {
            Some(image) => {
                image.borrow_mut::<LuaImage>()?.frame_mut()?.copy_from(src);
                Ok(image)
            }
            None => {
                let mut pixels = LuaImage::for_frames(lua, src.width(), src.height())?;
                pixels.frame_mut()?.copy_from(src);
                lua.create_userdata(pixels)
            }
        })?;
        self.image = Some(image.clone());
        Ok(image)
    }
}

impl LuaPerturbation {
    /// The values that the chain has computed, which may go beyond those of the published levels; alone, those of the intensity.
    fn take_values(&mut self, cx: &Context<'_>) {
        if cx.values().len() == self.description.parameters.len() {
            self.values.clear();
            self.values.extend_from_slice(cx.values());
        } else {
            frame_values(&self.description, &self.config, cx.intensity, &mut self.values);
        }
    }

    /// Lets the script change a copy of a frame.
    fn run(&mut self, src: Frame<'_>, cx: &Context<'_>) -> Result<AnyUserData> {
        self.take_values(cx);
        let image = self.image_of(src)?;
        self.sandbox.make(&self.script, |lua| self.cx.set(lua, cx, &self.values))?;
        let returned = self.sandbox.call(&self.script, &self.apply, (&image, &self.cx.table))?;
        match &returned {
            Value::Nil => {}
            Value::UserData(returned) if *returned == image => {}
            other => {
                let function = if self.description.kind == Kind::Mask { "mask" } else { "apply" };
                return Err(Error::new(format!(
                    "`{function}` returns {}, but has to change `image` in place and return nothing",
                    type_of(other)
                ))
                .at(&self.script));
            }
        }
        Ok(image)
    }
}

impl LuaPerturbation {
    /// Lets the script change a signal.
    fn pass(&mut self, given: Numbers, cx: &Context<'_>) -> Result<Numbers> {
        self.take_values(cx);
        self.sandbox.set_limits(&self.script, self.limits)?;
        self.sandbox.make(&self.script, |lua| {
            self.signal.set(given)?;
            self.cx.set(lua, cx, &self.values)?;
            self.cx.history.set_signals(lua, &cx.signals, &self.signal)
        })?;
        let returned = self.sandbox.call(&self.script, &self.apply, (&self.signal.table, &self.cx.table))?;
        returned_nothing(&returned, &self.script)?;
        self.signal.get().map_err(|error| error.at(&self.script))
    }
}

impl Perturbation for LuaPerturbation {
    fn observe(&mut self, observation: DriveContext, cx: &Context<'_>) -> Result<DriveContext> {
        let [time, speed] = self.pass(observation.numbers(), cx)?;
        Ok(DriveContext { time, speed, ..observation })
    }

    fn actuate(&mut self, control: Control, cx: &Context<'_>) -> Result<Control> {
        Ok(Control::from_numbers(self.pass(control.numbers(), cx)?))
    }

    fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let image = self.run(src, cx)?;
        let pixels = image.borrow::<LuaImage>().place(&self.script)?;
        dst.copy_from(pixels.frame().place(&self.script)?);
        Ok(())
    }

    fn move_points(
        &mut self,
        points: &mut [[f64; 2]],
        way: Way,
        size: [usize; 2],
        cx: &Context<'_>,
    ) -> Result<()> {
        self.take_values(cx);
        let moves = self.points.as_ref().ok_or_else(|| {
            Error::new("it does not say where it moves things; add move_point = function(x, y, width, height, cx) ... end")
                .at(&self.script)
        })?;
        // The frames of the history stay where `apply` has put them.
        let history = self.description.history as usize;
        self.sandbox.set_limits(&self.script, self.limits.for_frame(size[0], size[1], history))?;
        self.sandbox.make(&self.script, |lua| self.cx.set(lua, cx, &self.values))?;
        moves.apply((&self.sandbox, &self.script), points, way, size, &self.cx.table)
    }
}

/// A mask makes a picture of the frame, whose brightness says how much of each pixel is perturbed.
impl Mask for LuaPerturbation {
    fn weights(&mut self, frame: Frame<'_>, cx: &MapContext<'_>, mut out: HeatmapMut<'_>) -> Result<()> {
        // Masks have no intensity; parameters that follow one have the value of the middle.
        let context = Context::new(DEFAULT_LEVEL, cx.frame_index, cx.time, cx.key);
        let image = self.run(frame, &context)?;
        let pixels = image.borrow::<LuaImage>().place(&self.script)?;
        let picture = pixels.frame().place(&self.script)?;
        for (y, row) in picture.rows().enumerate() {
            for (value, pixel) in out.row_mut(y).iter_mut().zip(row.chunks_exact(3)) {
                *value = f32::from(grey(pixel[0], pixel[1], pixel[2])) / 255.0;
            }
        }
        Ok(())
    }
}

/// The table `cx`, set anew for every frame.
struct ScriptContext {
    table: Table,
    intensity: LuaString,
    frame_index: LuaString,
    time: LuaString,
    period: LuaString,
    frame_random: (LuaString, AnyUserData),
    sequence_random: (LuaString, AnyUserData),
    parameters: Vec<(LuaString, ParameterValue)>,
    history: ScriptHistory,
}

/// Where the value of a parameter comes from.
enum ParameterValue {
    /// From the values of the frame.
    Number,
    /// From the configuration.
    Fixed(Value),
}

impl ScriptContext {
    fn new(lua: &Lua, description: &Description, config: &Config) -> mlua::Result<Self> {
        let parameters = description.parameters.iter().map(|parameter| {
            let value = match &parameter.kind {
                ParameterType::Number { .. } | ParameterType::Integer { .. } => ParameterValue::Number,
                ParameterType::Boolean => {
                    ParameterValue::Fixed(Value::Boolean(config.boolean(&parameter.name)))
                }
                ParameterType::Choice { .. }
                | ParameterType::Text
                | ParameterType::Path
                | ParameterType::Json => {
                    ParameterValue::Fixed(Value::String(lua.create_string(config.text(&parameter.name))?))
                }
            };
            Ok((lua.create_string(&parameter.name)?, value))
        });
        let random = |name| -> mlua::Result<_> {
            let random = LuaRandom(Key::default().sequence());
            Ok((lua.create_string(name)?, lua.create_userdata(random)?))
        };
        let names: Vec<String> = CONTEXT
            .names()
            .map(str::to_owned)
            .chain(description.parameters.iter().map(|parameter| parameter.name.clone()))
            .collect();
        let table = lua.create_table()?;
        table.set_metatable(Some(unknown::closed(lua, "cx", "field", names, kept_in_context)?))?;
        Ok(Self {
            parameters: parameters.collect::<mlua::Result<_>>()?,
            intensity: lua.create_string("intensity")?,
            frame_index: lua.create_string("frame_index")?,
            time: lua.create_string("time")?,
            period: lua.create_string("period")?,
            frame_random: random("frame_random")?,
            sequence_random: random("sequence_random")?,
            history: ScriptHistory::new(lua, &table)?,
            table,
        })
    }

    fn set(&mut self, lua: &Lua, cx: &Context<'_>, values: &[f64]) -> mlua::Result<()> {
        self.history.set(lua, &cx.history)?;
        let table = &self.table;
        table.raw_set(&self.intensity, cx.intensity)?;
        table.raw_set(&self.frame_index, cx.frame_index as f64)?;
        table.raw_set(&self.time, cx.time)?;
        table.raw_set(&self.period, cx.period)?;
        for ((name, kind), value) in self.parameters.iter().zip(values) {
            match kind {
                ParameterValue::Number => table.raw_set(name, *value)?,
                ParameterValue::Fixed(value) => table.raw_set(name, value)?,
            }
        }
        self.frame_random.1.borrow_mut::<LuaRandom>()?.0 = cx.frame_random();
        self.sequence_random.1.borrow_mut::<LuaRandom>()?.0 = cx.sequence_random();
        for (name, random) in [&self.frame_random, &self.sequence_random] {
            table.raw_set(name, random)?;
        }
        Ok(())
    }
}

/// The error of something that is left in `cx` for the next frame, or of a misspelt parameter.
fn kept_in_context(owner: &str, sort: &str, name: &Value, _: &[String]) -> mlua::Error {
    mlua::Error::runtime(format!(
        "{owner} has no {sort} {} and gets none, because a frame must not depend on those before it; use a local variable",
        unknown::shown(name)
    ))
}

#[cfg(test)]
pub(super) mod tests;
