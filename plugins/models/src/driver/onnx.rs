//! The driver `onnx`: a steering network in an ONNX file.

use pdk_sdk::ops::resize::resize_linear;
use pdk_sdk::prelude::*;

use crate::engine;
use crate::model_file::{self, Inputs, ModelFile, Source};
use crate::pixels::Pixels;
use crate::selection::{Selection, Slot};
use crate::session::Session;

/// Drives with a network.
///
/// The same model on the same engine gives the same control for the same frame, bit for bit, on any machine and any number of threads.
/// Another engine may round differently in the last digits.
pub struct Onnx {
    /// The file and who runs it, for messages.
    place: String,
    session: Box<dyn Session>,
    model: ModelFile,
    pixels: Pixels,
    selection: Selection,
    throttle: f64,
    inputs: Inputs,
    outputs: Vec<Vec<f32>>,
    resized: FrameBuf,
}

impl Component for Onnx {
    fn description() -> Description {
        let model = Parameter::path(
            "model",
            "the ONNX file: an image in, to whose size frames are resized, steering and maybe throttle out; an input called `speed` \
             gets the speed in m/s; an input called `NAME_in` gets what the output `NAME_out` was at the frame before, and zeros at \
             the first",
        );
        let description = Description::driver("onnx", "Drives with a neural network")
            .family("network")
            .drop_in("models", &["onnx"], "model")
            .parameter(model)
            .parameter(engine::parameter());
        with_reading(description)
    }

    fn new(config: &Config) -> Result<Self> {
        let model = config.text("model");
        Self::open(Source::File(model.into()), model, config)
    }

    fn input_files(config: &Config) -> Result<Vec<InputFiles>> {
        Ok(model_file::weights(config.text("model")))
    }
}

/// Adds the parameters that say how a network reads frames.
pub fn with_pixels(description: Description) -> Description {
    description
        .parameter(Parameter::choice(
            "layout",
            &["auto", "nchw", "nhwc"],
            "where the input's channels are: before or after height and width; auto reads it from the shape",
        ))
        .parameter(Parameter::choice(
            "scale",
            &Pixels::SCALES,
            "the range of pixel values that the network was trained on",
        ))
        .parameter(Parameter::choice(
            "color",
            &["rgb", "bgr"],
            "the order of colours that the network was trained on",
        ))
}

/// Adds the parameters that say how a network reads frames and what its outputs mean.
fn with_reading(description: Description) -> Description {
    with_pixels(description)
        .parameter(Parameter::text(
            "steering_output",
            "the output that steers; left out, the first: alone, or together with the throttle",
        ))
        .parameter(Parameter::text(
            "throttle_output",
            "the output that gives the throttle; left out, the second number or the second output",
        ))
        .parameter(
            Parameter::number("throttle", 0.3, "the throttle for a network that only steers")
                .range(-1.0, 1.0),
        )
}

impl Onnx {
    /// Makes a driver of the model in a file, which messages call `name`.
    ///
    /// # Errors
    /// If it is not a driving model, or the engine cannot run it.
    pub fn open(source: Source, name: &str, config: &Config) -> Result<Self> {
        let place = format!("model `{name}`");
        Self::make(source, &place, config).map_err(|error| error.at(place))
    }

    fn make(source: Source, place: &str, config: &Config) -> Result<Self> {
        let model = ModelFile::read(source, config.text("layout"))?;
        let mut session = engine::open(&model.network(), config.text(engine::PARAMETER))?;
        let sizes = model.try_out(&mut *session, 0.0)?;
        let (steering, throttle) = (config.text("steering_output"), config.text("throttle_output"));
        let selection = model.selection(&sizes, steering, throttle)?;
        Ok(Self {
            place: format!("{place} on {}", session.engine()),
            session,
            pixels: Pixels::new(&model.input, config.text("scale"), config.text("color")),
            selection,
            throttle: config.number("throttle"),
            inputs: model.inputs(),
            outputs: vec![Vec::new(); model.outputs.len()],
            resized: FrameBuf::new(model.input.width, model.input.height),
            model,
        })
    }

    /// One of the numbers that the network gave, within -1 to 1.
    fn output(&self, slot: Slot, what: &str, cx: &DriveContext) -> Result<f64> {
        match self.outputs[slot.output].get(slot.index) {
            Some(value) if value.is_finite() => Ok(f64::from(*value).clamp(-1.0, 1.0)),
            Some(value) => Err(Error::new(format!("its {what} for frame {} is {value}", cx.frame_index))),
            None => Err(Error::new(format!("it gave no {what} for frame {}", cx.frame_index))),
        }
    }

    fn infer(&mut self, frame: Frame<'_>, cx: &DriveContext) -> Result<Control> {
        if self.model.speed.is_some() && !cx.speed.is_finite() {
            return Err(Error::new(
                "it takes the vehicle's speed, which is not known here: datasets do not tell it to a driver",
            ));
        }
        let same_size = (frame.width(), frame.height()) == (self.model.input.width, self.model.input.height);
        if !same_size {
            resize_linear(frame, self.resized.as_mut());
        }
        let frame = if same_size { frame } else { self.resized.as_ref() };
        self.pixels.write(frame, self.inputs.image());
        self.inputs.move_at(cx.speed as f32);
        self.session.run(self.inputs.values(), &mut self.outputs)?;
        self.inputs.remember(&mut self.outputs);
        let steering = self.output(self.selection.steering, "steering", cx)?;
        let throttle = match self.selection.throttle {
            Some(slot) => self.output(slot, "throttle", cx)?,
            None => self.throttle,
        };
        Ok(Control { steering, throttle })
    }
}

impl Driver for Onnx {
    fn reset(&mut self) -> Result<()> {
        self.inputs.forget();
        Ok(())
    }

    fn drive(&mut self, frame: Frame<'_>, cx: &DriveContext) -> Result<Control> {
        self.infer(frame, cx).map_err(|e| e.at(&self.place))
    }

    fn info(&self) -> Vec<(String, String)> {
        self.session.info()
    }
}

#[cfg(test)]
#[path = "onnx_tests.rs"]
mod tests;
