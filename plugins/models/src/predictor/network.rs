//! The predictor `network`: what a network in an ONNX file makes of a frame, by the names of its outputs.

use pdk_network::plan::Fill;
use pdk_network::reason::{ASSUMED, assumptions};
use pdk_network::{Eye, Given, Inputs, field};
use pdk_onnx::proto::DimensionProto;
use pdk_sdk::prelude::*;

use crate::engine;
use crate::model_file::{self, ModelFile, Source};
use crate::session::Session;

/// Gives the outputs of a network.
///
/// The same model on the same engine gives the same outputs for the same frame, bit for bit, on any machine and any number of threads.
pub struct Network {
    /// The file and who runs it, for messages.
    place: String,
    session: Box<dyn Session>,
    model: ModelFile,
    eye: Eye,
    inputs: Inputs,
    outputs: Vec<Vec<f32>>,
    /// The places of the outputs that are not a memory, with their shapes.
    given: Vec<(usize, Vec<usize>)>,
}

impl Component for Network {
    fn description() -> Description {
        let model = Parameter::path(
            "model",
            "the ONNX file: images and maybe further inputs in; what comes out is for a metric. A file beside it, such as pilot.toml beside \
             pilot.onnx, describes what goes in with the fields that are parameters here; a parameter overrides its field",
        );
        let description = Description::predictor("network", "Gives the outputs of a neural network by name")
            .family("network")
            .parameter(model)
            .parameter(engine::parameter());
        field::input_parameters(description)
    }

    fn new(config: &Config) -> Result<Self> {
        let name = config.text("model");
        let place = format!("model `{name}`");
        Self::open(name, &place, config).map_err(|error| error.at(place))
    }

    fn input_files(config: &Config) -> Result<Vec<InputFiles>> {
        Ok(model_file::files_beside(config.text("model")))
    }
}

impl Network {
    fn open(path: &str, place: &str, config: &Config) -> Result<Self> {
        let model = ModelFile::read(Source::File(path.into()), Given::of(config, Some(path.as_ref()))?)?;
        if model.plan.inputs.iter().any(|input| input.fill == Fill::Controls) {
            return Err(Error::new(
                "it takes the controls before, and a predictor gives none; describe that input as constants, or use the driver `onnx`",
            ));
        }
        let mut session = engine::open(&model.network(), config.text(engine::PARAMETER))?;
        let sizes = model.sizes(&mut *session, 0.0)?;
        let states: Vec<usize> = model.plan.states().collect();
        let given = (0..sizes.len())
            .filter(|output| !states.contains(output))
            .map(|output| (output, shape(&model, output, sizes[output])))
            .collect();
        Ok(Self {
            place: format!("{place} on {}", session.engine()),
            session,
            eye: Eye::new(&model.plan),
            inputs: Inputs::new(&model.plan),
            outputs: model.room(),
            given,
            model,
        })
    }

    fn infer(&mut self, frame: Frame<'_>, cx: &DriveContext) -> Result<Vec<Output>> {
        let fitted = self.eye.fit(frame)?;
        self.eye.see(fitted.as_ref(), self.inputs.image());
        self.inputs.move_at(cx.speed)?;
        self.session.run(self.inputs.values(), &mut self.outputs)?;
        let output = |(place, shape): &(usize, Vec<usize>)| {
            let values = self.outputs[*place].clone();
            // A network may give another number of values for each frame, such as boxes.
            let fits = shape.iter().product::<usize>() == values.len();
            Output {
                name: self.model.plan.outputs[*place].clone(),
                shape: if fits { shape.clone() } else { with_open_first(shape, values.len()) },
                values,
            }
        };
        let outputs = self.given.iter().map(output).collect();
        // It gives no control.
        self.inputs.remember(&self.outputs, [0.0; 2]);
        Ok(outputs)
    }
}

/// The shape of an output, from what the file declares and the number of its values.
fn shape(model: &ModelFile, output: usize, count: usize) -> Vec<usize> {
    let declared = || {
        let tensor = model.proto.graph.as_ref()?.output.get(output)?.tensor_type()?;
        let side = |dim: &DimensionProto| match dim.dim_value {
            Some(length) => usize::try_from(length).ok(),
            // The batch is one frame.
            _ => Some(1),
        };
        tensor.shape.as_ref()?.dim.iter().map(side).collect::<Option<Vec<usize>>>()
    };
    declared().filter(|shape| shape.iter().product::<usize>() == count).unwrap_or_else(|| vec![count])
}

/// A shape of another number of values, which differs in its first axis that is not the batch.
fn with_open_first(shape: &[usize], count: usize) -> Vec<usize> {
    let rest: usize = shape.iter().skip(1).product();
    match rest > 0 && count.is_multiple_of(rest) && shape.len() > 1 {
        true => std::iter::once(count / rest).chain(shape[1..].iter().copied()).collect(),
        false => vec![count],
    }
}

impl Predictor for Network {
    fn reset(&mut self) -> Result<()> {
        self.inputs.forget();
        self.eye.forget();
        Ok(())
    }

    fn predict(&mut self, frame: Frame<'_>, cx: &DriveContext) -> Result<Vec<Output>> {
        self.infer(frame, cx).map_err(|error| error.at(&self.place))
    }

    fn info(&self) -> Vec<(String, String)> {
        let mut info = self.session.info();
        info.extend(assumptions(&self.model.plan.reasons).map(|assumed| (ASSUMED.to_owned(), assumed)));
        info
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::Pilot;
    use pdk_sdk::serde_json::{Map, Value, json};

    fn network(path: &std::path::Path) -> Network {
        let given: Map<String, Value> =
            json!({"model": path, "engine": "pdk", "scale": "0..1"}).as_object().unwrap().clone();
        Network::new(&Config::check(&Network::description(), &given).unwrap()).unwrap()
    }

    #[test]
    fn outputs_have_names_and_shapes() {
        let pilot = Pilot::new(&["1", "3", "4", "6"]);
        let file = pilot.file();
        let mut network = network(file.path());
        let frame = FrameBuf::new(12, 8);
        let outputs = network.predict(frame.as_ref(), &DriveContext::default()).unwrap();
        assert!(!outputs.is_empty());
        for output in &outputs {
            assert_eq!(output.shape.iter().product::<usize>(), output.values.len(), "{}", output.name);
        }
        assert_eq!(outputs, network.predict(frame.as_ref(), &DriveContext::default()).unwrap());
    }

    #[test]
    fn an_output_that_grows_has_its_count_first() {
        assert_eq!(with_open_first(&[1, 4], 12), [3, 4]);
        assert_eq!(with_open_first(&[5, 4], 0), [0, 4]);
        assert_eq!(with_open_first(&[7], 3), [3]);
        assert_eq!(with_open_first(&[2, 4], 7), [7]);
    }
}
