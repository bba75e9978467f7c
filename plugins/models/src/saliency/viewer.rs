//! A model as saliency methods see it: frames in, one number out.

use pdk_sdk::ops::resize::resize_linear;
use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::json;

use crate::driver::with_pixels;
use crate::engine;
use crate::model_file::{Inputs, Layout, ModelFile, Source};
use crate::pixels::Pixels;
use crate::session::Session;
use crate::trained;

/// A model whose output is explained. One that remembers is asked as at the first frame, when it remembers nothing.
pub struct Viewer {
    /// The file and who runs it, for messages.
    pub place: String,
    pub model: ModelFile,
    pub engine: String,
    session: Box<dyn Session>,
    pixels: Pixels,
    /// The output that is explained, by its place and name.
    output: (usize, String),
    /// Which of its numbers.
    number: usize,
    /// The speed that the network is told, and the one that it is told where nobody knows it.
    speed: f32,
    assumed_speed: f32,
    inputs: Inputs,
    outputs: Vec<Vec<f32>>,
    resized: FrameBuf,
}

/// What every method takes.
pub fn parameters(description: Description) -> Description {
    let description = description
        .example(json!({"model": "dave2"}))
        .parameter(Parameter::path("model", "the ONNX file whose view is shown, which the driver `onnx` takes; or the name of a network that is part of pdk"))
        .parameter(engine::parameter());
    with_pixels(description)
        .parameter(Parameter::text("output", "the output that is explained, by name; left out, the one that steers"))
        .parameter(
            Parameter::integer("number", 0, "which of the output's numbers is explained, from 0; of steering and throttle, 0 is the \
                                             steering")
                .range(0.0, 1e6),
        )
        .parameter(
            Parameter::number("speed", 8.0, "the speed that a network which takes one is told where it is not known, as for recorded frames").unit("m/s").range(0.0, 100.0),
        )
        .parameter(Parameter::choice(
            "size",
            &["frame", "layer"],
            "how large the map is: as the frame, over which its cells are laid by where they look, or one value for each cell, unless the frame has fewer pixels than \
             the layer has cells",
        ))
}

/// Where the model of this name is: in a file, or part of this plugin.
fn source(name: &str) -> Source {
    match trained::content(name) {
        Some(content) => Source::BuiltIn(content.into()),
        None => Source::File(name.into()),
    }
}

impl Viewer {
    /// Opens the model and runs it once.
    ///
    /// # Errors
    /// Where the file is no driving model, or has no such output.
    pub fn open(config: &Config) -> Result<Self> {
        let model = ModelFile::read(source(config.text("model")), config.text("layout"))?;
        let engine = config.text(engine::PARAMETER).to_owned();
        let mut session = engine::open(&model.network(), &engine)?;
        let speed = config.number("speed") as f32;
        let sizes = model.try_out(&mut *session, speed)?;
        let output = match config.text("output") {
            "" => model.selection(&sizes, "", "")?.steering.output,
            name => model.outputs.iter().position(|output| output == name).ok_or_else(|| {
                let names: Vec<_> = model.outputs.iter().map(|output| format!("`{output}`")).collect();
                Error::new(format!("it has no output `{name}`; its outputs are {}", names.join(", ")))
            })?,
        };
        let (name, number) = (model.outputs[output].clone(), config.integer("number") as usize);
        if number >= sizes[output] {
            return Err(Error::new(format!(
                "its output `{name}` has the numbers 0 to {}, so there is no {number}",
                sizes[output].saturating_sub(1)
            )));
        }
        Ok(Self {
            place: format!("model `{}` on {}", config.text("model"), session.engine()),
            pixels: Pixels::new(&model.input, config.text("scale"), config.text("color")),
            resized: FrameBuf::new(model.input.width, model.input.height),
            output: (output, name),
            engine,
            session,
            number,
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

    /// The output that is explained, by name, and which of its numbers.
    pub fn target(&self) -> (&str, usize) {
        (&self.output.1, self.number)
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

    /// The speed that a network which takes one is told.
    pub fn speed(&self) -> f32 {
        self.speed
    }

    /// What the network gives for a frame in the size of its image.
    ///
    /// # Errors
    /// Where the engine fails, or the number is not finite.
    pub fn answer(&mut self, frame: Frame<'_>) -> Result<f64> {
        self.pixels.write(frame, self.inputs.image());
        self.inputs.move_at(self.speed);
        self.session.run(self.inputs.values(), &mut self.outputs)?;
        match self.outputs[self.output.0].get(self.number) {
            Some(value) if value.is_finite() => Ok(f64::from(*value)),
            _ => Err(Error::new(format!(
                "its output `{}` is not a finite number for this frame",
                self.output.1
            ))),
        }
    }
}
