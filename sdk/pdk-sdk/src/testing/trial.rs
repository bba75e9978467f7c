//! A perturbation at a level, ready to be tried in a test.

use pdk_ops::FrameBuf;
use pdk_seed::Key;
use serde_json::{Map, Value};

use crate::component::Component;
use crate::config::{Config, frame_values};
use crate::describe::Description;
use crate::error::{Error, Result};
use crate::perturbation::{Context, Perturbation};

/// A perturbation at a level, with parameters and a key.
pub struct Trial<P> {
    /// The perturbation itself.
    pub instance: P,
    /// How many earlier frames or signals its description asks for.
    pub history: usize,
    level: f64,
    names: Vec<String>,
    values: Vec<f64>,
    key: Key,
}

impl<P: Component> Trial<P> {
    /// Makes it with the parameters that `given` names; null stands for none.
    ///
    /// # Errors
    /// If the parameters are not those of its description, or it refuses them.
    pub fn new(given: &Value, level: f64, key: Key) -> Result<Self> {
        let description = P::description();
        let (config, values) = at_level(&description, given, level)?;
        Ok(Self {
            instance: P::new(&config)?,
            history: description.history as usize,
            level,
            names: names(description),
            values,
            key,
        })
    }

    /// The instance, and what it gets at a frame beside the pixels. A test adds what else there is, such as a history.
    pub fn at(&mut self, frame_index: u64, time: f64) -> (&mut P, Context<'_>) {
        let cx =
            Context::new(self.level, frame_index, time, &self.key).with_values(&self.names, &self.values);
        (&mut self.instance, cx)
    }
}

/// The parameters that `given` names, and the values of all at a level.
fn at_level(description: &Description, given: &Value, level: f64) -> Result<(Config, Vec<f64>)> {
    let none = Map::new();
    let given = match given {
        Value::Null => &none,
        Value::Object(given) => given,
        _ => return Err(Error::new("the parameters are not an object")),
    };
    let config = Config::check(description, given)?;
    let mut values = Vec::new();
    frame_values(description, &config, level, &mut values);
    Ok((config, values))
}

/// The names of the parameters.
fn names(description: Description) -> Vec<String> {
    description.parameters.into_iter().map(|parameter| parameter.name).collect()
}

impl<P: Component + Perturbation> Trial<P> {
    /// A frame under the perturbation, without a history.
    ///
    /// # Errors
    /// If the perturbation fails.
    pub fn frame(&mut self, source: &FrameBuf, frame_index: u64, time: f64) -> Result<FrameBuf> {
        let (instance, cx) = self.at(frame_index, time);
        let mut target = FrameBuf::new(source.width(), source.height());
        instance.apply(source.as_ref(), target.as_mut(), &cx)?;
        Ok(target)
    }
}
