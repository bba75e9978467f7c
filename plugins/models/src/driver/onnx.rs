//! The driver `onnx`: a steering network in an ONNX file.

use pdk_network::reason::ASSUMED;
use pdk_network::{Eye, Given, Inputs, Outputs, Plan, field};
use pdk_sdk::prelude::*;

use crate::backward::Backward;
use crate::engine;
use crate::model_file::{self, ModelFile, Source};
use crate::session::Session;

/// Drives with a network.
///
/// The same model on the same engine gives the same control for the same frame, bit for bit, on any machine and any number of threads.
/// Another engine may round differently in the last digits.
pub struct Onnx {
    /// The file and who runs it, for messages.
    place: String,
    session: Box<dyn Session>,
    eye: Eye,
    inputs: Inputs,
    outputs: Outputs,
    /// The numbers that the network gave last.
    numbers: Vec<Vec<f32>>,
    /// Conventions that nothing confirms.
    assumed: Option<String>,
    /// What the gradient is built from, when it is asked for, and the gradient.
    source: Source,
    plan: Plan,
    engine: String,
    backward: Option<Backward>,
}

impl Component for Onnx {
    fn description() -> Description {
        let model = Parameter::path(
            "model",
            "the ONNX file: images and maybe further inputs in, steering and maybe throttle out. A file beside it, such as pilot.toml \
             beside pilot.onnx, describes them with the fields that are parameters here; a parameter overrides its field",
        );
        let description = Description::driver("onnx", "Drives with a neural network")
            // Version 2 resizes as OpenCV does in the outermost rows too, and says what it assumes.
            .version(2)
            .family("network")
            .drop_in("models", &["onnx"], "model")
            .parameter(model)
            .parameter(engine::parameter());
        field::parameters(description)
    }

    fn new(config: &Config) -> Result<Self> {
        let model = config.text("model");
        let given = Given::of(config, Some(model.as_ref())).map_err(|error| error.at(place(model)))?;
        Self::open(Source::File(model.into()), model, given, config.text(engine::PARAMETER))
    }

    fn input_files(config: &Config) -> Result<Vec<InputFiles>> {
        Ok(model_file::files_beside(config.text("model")))
    }
}

/// A model in messages.
fn place(name: &str) -> String {
    format!("model `{name}`")
}

impl Onnx {
    /// Makes a driver of a model, which messages call `name`, and of what describes it.
    ///
    /// # Errors
    /// If it is not a driving model, or the engine cannot run it.
    pub fn open(source: Source, name: &str, given: Given, engine: &str) -> Result<Self> {
        let place = place(name);
        Self::make(source, &place, given, engine).map_err(|error| error.at(place))
    }

    fn make(source: Source, place: &str, given: Given, engine: &str) -> Result<Self> {
        let model = ModelFile::read(source, given)?;
        let mut session = engine::open(&model.network(), engine)?;
        let outputs = model.try_out(&mut *session, 0.0)?;
        let reasons = [model.plan.reasons.as_slice(), &outputs.reasons].concat();
        Ok(Self {
            place: format!("{place} on {}", session.engine()),
            session,
            eye: Eye::new(&model.plan),
            inputs: Inputs::new(&model.plan),
            outputs,
            numbers: model.room(),
            assumed: pdk_network::reason::assumptions(&reasons),
            source: model.source,
            plan: model.plan,
            engine: engine.to_owned(),
            backward: None,
        })
    }

    fn infer(&mut self, frame: Frame<'_>, cx: &DriveContext) -> Result<Control> {
        self.inputs.move_at(cx.speed)?;
        let fitted = self.eye.fit(frame)?;
        self.eye.see(fitted.as_ref(), self.inputs.image());
        self.session.run(self.inputs.values(), &mut self.numbers)?;
        let control = self.outputs.control(&self.numbers);
        let control = control.map_err(|error| error.at(format_args!("frame {}", cx.frame_index)))?;
        self.inputs.remember(&self.numbers, control);
        let [steering, throttle] = control.map(|number| number.clamp(-1.0, 1.0));
        Ok(Control { steering, throttle })
    }
}

impl Onnx {
    /// The steering at a frame that counts as the first, and its gradient.
    fn steering_and_gradient(&mut self, frame: Frame<'_>, speed: f64) -> Result<(f64, Vec<f32>)> {
        let Self { source, plan, eye, outputs, engine, backward, .. } = self;
        let backward = match backward {
            Some(backward) => backward,
            None => backward.insert(Backward::of(source, plan, eye, &outputs.steering, engine)?),
        };
        backward.run(eye, frame, speed)
    }
}

impl Driver for Onnx {
    fn reset(&mut self) -> Result<()> {
        self.inputs.forget();
        self.eye.forget();
        Ok(())
    }

    fn drive(&mut self, frame: Frame<'_>, cx: &DriveContext) -> Result<Control> {
        self.infer(frame, cx).map_err(|e| e.at(&self.place))
    }

    fn gradient(&mut self, frame: Frame<'_>, cx: &DriveContext, into: &mut [f32]) -> Result<f64> {
        let (steering, gradient) =
            self.steering_and_gradient(frame, cx.speed).map_err(|error| error.at(&self.place))?;
        into.copy_from_slice(&gradient);
        Ok(steering)
    }

    fn info(&self) -> Vec<(String, String)> {
        let mut info = self.session.info();
        info.extend(self.assumed.iter().map(|assumed| (ASSUMED.to_owned(), assumed.clone())));
        info
    }
}

#[cfg(test)]
#[path = "described_tests.rs"]
mod described_tests;
#[cfg(test)]
#[path = "onnx_tests.rs"]
mod tests;
