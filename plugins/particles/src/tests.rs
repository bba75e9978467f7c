//! What both perturbations have to hold.

use std::marker::PhantomData;
use std::time::Instant;

use pdk_sdk::config::frame_values;
use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::{Map, Value, from_str};
use pdk_sdk::testing::sample_frame;

use crate::raindrops_on_lens::RaindropsOnLens;
use crate::snow_on_lens::SnowOnLens;

/// One instance with its parameters, asked for frames at any time.
pub struct Film<P> {
    instance: P,
    description: Description,
    config: Config,
    names: Vec<String>,
    values: Vec<f64>,
    pub level: f64,
    pub key: Key,
    kind: PhantomData<P>,
}

impl<P: Component + Perturbation> Film<P> {
    /// With the parameters `given` as a JSON object.
    pub fn new(given: &str, level: f64) -> Self {
        let description = P::description();
        let given: Value = from_str(given).unwrap();
        let config = Config::check(&description, given.as_object().unwrap_or(&Map::new())).unwrap();
        let names = description.parameters.iter().map(|p| p.name.clone()).collect();
        let instance = P::new(&config).unwrap();
        let key = Key([3; 32]);
        Self { instance, description, config, names, values: Vec::new(), level, key, kind: PhantomData }
    }

    pub fn render(
        &mut self,
        src: Frame<'_>,
        dst: FrameMut<'_>,
        time: f64,
        map: Option<&[f32]>,
    ) -> Result<()> {
        frame_values(&self.description, &self.config, self.level, &mut self.values);
        let mut cx = Context::new(self.level, 0, time, &self.key).with_values(&self.names, &self.values);
        cx.saliency = map;
        self.instance.apply(src, dst, &cx)
    }

    pub fn at(&mut self, src: &FrameBuf, time: f64) -> FrameBuf {
        let mut dst = FrameBuf::new(src.width(), src.height());
        self.render(src.as_ref(), dst.as_mut(), time, None).unwrap();
        dst
    }
}
