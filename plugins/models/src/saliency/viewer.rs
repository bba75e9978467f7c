//! A model as saliency methods see it: frames in, steering or throttle out.

use pdk_onnx::Target;
use pdk_sdk::ops::resize::resize_linear;
use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::json;

use crate::driver::{self, with_pixels};
use crate::engine;
use crate::model_file::{Inputs, Layout, ModelFile, Source};
use crate::pixels::Pixels;
use crate::selection::{Selection, Slot};
use crate::session::Session;

/// A model whose output is explained. One that remembers is asked as at the first frame, when it remembers nothing.
pub struct Viewer {
    /// The file and who runs it, for messages.
    pub place: String,
    pub model: ModelFile,
    pub engine: String,
    session: Box<dyn Session>,
    pixels: Pixels,
    /// The number that is explained.
    explained: Slot,
    /// All numbers that drive.
    driving: Vec<Slot>,
    /// The speed that goes into the network, and the one that stands in for it if it is not known.
    speed: f32,
    assumed_speed: f32,
    inputs: Inputs,
    outputs: Vec<Vec<f32>>,
    resized: FrameBuf,
}

/// What a method takes that explains one number.
pub fn parameters(description: Description) -> Description {
    common_parameters(description).parameter(
        Parameter::choice("explain", &["steering", "throttle"], "which number is explained")
            .role(Role::Explained),
    )
}

/// What every method takes.
pub fn common_parameters(description: Description) -> Description {
    let description = description
        .example(json!({"model": "dave2"}))
        .parameter(Parameter::path("model", "the ONNX file whose view is shown, which the driver `onnx` takes; or the name of a network that is part of pdk").role(Role::Network))
        .parameter(engine::parameter());
    with_pixels(description)
        .parameter(Parameter::text("steering_output", "the output that steers, as for the driver `onnx`"))
        .parameter(Parameter::text("throttle_output", "the output that gives the throttle, as for the driver `onnx`"))
        .parameter(
            Parameter::number("speed", 8.0, "the speed that is given to a network with a speed input if the real one is not known, as for recorded frames").unit("m/s").range(0.0, 100.0).role(Role::Speed),
        )
        .parameter(Parameter::choice(
            "size",
            &["frame", "layer"],
            "how large the map is: as the frame, over which its cells are laid by where they look, or one value for each cell, unless the frame has fewer pixels than \
             the layer has cells",
        ).role(Role::Resolution))
}

/// Where the model of this name is: in a file, or part of this plugin.
fn source(name: &str) -> Source {
    match driver::content(name) {
        Some(content) => Source::BuiltIn(content.into()),
        None => Source::File(name.into()),
    }
}

impl Viewer {
    /// Opens the model and runs it once.
    ///
    /// # Errors
    /// If the file is not a driving model, or has no such output.
    pub fn open(config: &Config) -> Result<Self> {
        let model = ModelFile::read(source(config.text("model")), config.text("layout"))?;
        let engine = config.text(engine::PARAMETER).to_owned();
        let mut session = engine::open(&model.network(), &engine)?;
        let speed = config.number("speed") as f32;
        let sizes = model.try_out(&mut *session, speed)?;
        let Selection { steering, throttle } =
            model.selection(&sizes, config.text("steering_output"), config.text("throttle_output"))?;
        let explained = match config.text("explain") {
            "throttle" => throttle.ok_or_else(|| {
                Error::new("it gives no throttle, so only its steering can be explained; leave `explain` out")
            })?,
            _ => steering,
        };
        Ok(Self {
            place: format!("model `{}` on {}", config.text("model"), session.engine()),
            pixels: Pixels::new(&model.input, config.text("scale"), config.text("color")),
            resized: FrameBuf::new(model.input.width, model.input.height),
            explained,
            driving: [steering].into_iter().chain(throttle).collect(),
            engine,
            session,
            speed,
            assumed_speed: speed,
            inputs: model.inputs(),
            outputs: vec![Vec::new(); model.outputs.len()],
            model,
        })
    }

    /// Who runs the network, with the version.
    pub fn runs_on(&self) -> String {
        self.session.engine()
    }

    /// Tells the network this speed from now on, or the assumed one where it is not known.
    pub fn move_at(&mut self, speed: Option<f64>) {
        self.speed = speed.map_or(self.assumed_speed, |speed| speed as f32);
    }

    /// The number that is explained.
    pub fn target(&self) -> Target<'_> {
        self.target_at(self.explained)
    }

    /// All numbers that drive: steering, and throttle if the network gives one.
    pub fn driving(&self) -> Vec<Target<'_>> {
        self.driving.iter().map(|slot| self.target_at(*slot)).collect()
    }

    fn target_at(&self, Slot { output, index }: Slot) -> Target<'_> {
        Target { value: &self.model.outputs[output], index }
    }

    /// The place and axes of the image among the network's inputs.
    pub fn image(&self) -> (usize, usize, usize) {
        match self.model.input.layout {
            Layout::Nchw => (self.model.image, 2, 3),
            Layout::Nhwc => (self.model.image, 1, 2),
        }
    }

    /// Width and height of the model's image.
    pub fn size(&self) -> (usize, usize) {
        (self.model.input.width, self.model.input.height)
    }

    /// The frame in the size of the model's image.
    pub fn fit(&mut self, frame: Frame<'_>) -> FrameBuf {
        if (frame.width(), frame.height()) == self.size() {
            self.resized.as_mut().copy_from(frame);
        } else {
            resize_linear(frame, self.resized.as_mut());
        }
        self.resized.clone()
    }

    /// Writes the numbers that the model gets for a frame in the size of its image.
    pub fn numbers(&self, frame: Frame<'_>, values: &mut [f32]) {
        self.pixels.write(frame, values);
    }

    /// The least and the greatest number that a pixel can become.
    pub fn range(&self) -> (f32, f32) {
        self.pixels.range()
    }

    /// The speed for a network with a speed input.
    pub fn speed(&self) -> f32 {
        self.speed
    }

    /// What the network gives for a frame in the size of its image.
    ///
    /// # Errors
    /// If the engine fails, or the number is not finite.
    pub fn answer(&mut self, frame: Frame<'_>) -> Result<f64> {
        self.pixels.write(frame, self.inputs.image());
        self.inputs.move_at(self.speed);
        self.session.run(self.inputs.values(), &mut self.outputs)?;
        match self.outputs[self.explained.output].get(self.explained.index) {
            Some(value) if value.is_finite() => Ok(f64::from(*value)),
            _ => Err(Error::new(format!(
                "its output `{}` is not a finite number for this frame",
                self.model.outputs[self.explained.output]
            ))),
        }
    }
}
