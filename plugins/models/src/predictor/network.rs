//! The predictor `network`: what a network in an ONNX file makes of a frame, by the names of its outputs.

use pdk_sdk::ops::resize::resize_linear;
use pdk_sdk::prelude::*;
use tract_onnx::pb::tensor_shape_proto::dimension;
use tract_onnx::pb::type_proto;

use crate::driver::with_pixels;
use crate::engine;
use crate::model_file::{self, Inputs, ModelFile, Source};
use crate::pixels::Pixels;
use crate::session::Session;

/// Gives the outputs of a network.
///
/// The same model on the same engine gives the same outputs for the same frame, bit for bit, on any machine and any number of threads.
pub struct Network {
    /// The file and who runs it, for messages.
    place: String,
    session: Box<dyn Session>,
    model: ModelFile,
    pixels: Pixels,
    inputs: Inputs,
    outputs: Vec<Vec<f32>>,
    /// The places of the outputs that are not a memory, with their shapes.
    given: Vec<(usize, Vec<usize>)>,
    resized: FrameBuf,
}

impl Component for Network {
    fn description() -> Description {
        let model = Parameter::path(
            "model",
            "the ONNX file: an image in, to whose size frames are resized; what comes out is for a metric; an input called `NAME_in` \
             gets what the output `NAME_out` was at the frame before, and zeros at the first",
        );
        let description = Description::predictor("network", "Gives the outputs of a neural network by name")
            .family("network")
            .parameter(model)
            .parameter(engine::parameter());
        with_pixels(description)
    }

    fn new(config: &Config) -> Result<Self> {
        let name = config.text("model");
        let place = format!("model `{name}`");
        Self::open(name, &place, config).map_err(|error| error.at(place))
    }

    fn input_files(config: &Config) -> Result<Vec<InputFiles>> {
        Ok(model_file::weights(config.text("model")))
    }
}

impl Network {
    fn open(path: &str, place: &str, config: &Config) -> Result<Self> {
        let model = ModelFile::read(Source::File(path.into()), config.text("layout"))?;
        if model.speed.is_some() {
            return Err(Error::new(
                "it takes the vehicle's speed, which is not known here; give a network that takes a picture alone",
            ));
        }
        let mut session = engine::open(&model.network(), config.text(engine::PARAMETER))?;
        let sizes = model.try_out(&mut *session, 0.0)?;
        let remembered = |output: &usize| model.memories.iter().any(|memory| memory.output == *output);
        let given = (0..model.outputs.len())
            .filter(|output| !remembered(output))
            .map(|output| (output, shape(&model, output, sizes[output])))
            .collect();
        Ok(Self {
            place: format!("{place} on {}", session.engine()),
            session,
            pixels: Pixels::new(&model.input, config.text("scale"), config.text("color")),
            inputs: model.inputs(),
            outputs: vec![Vec::new(); model.outputs.len()],
            given,
            resized: FrameBuf::new(model.input.width, model.input.height),
            model,
        })
    }

    fn infer(&mut self, frame: Frame<'_>) -> Result<Vec<Output>> {
        let same_size = (frame.width(), frame.height()) == (self.model.input.width, self.model.input.height);
        if !same_size {
            resize_linear(frame, self.resized.as_mut());
        }
        let frame = if same_size { frame } else { self.resized.as_ref() };
        self.pixels.write(frame, self.inputs.image());
        self.session.run(self.inputs.values(), &mut self.outputs)?;
        let output = |(place, shape): &(usize, Vec<usize>)| {
            let values = self.outputs[*place].clone();
            // A network may give another number of values for each frame, such as boxes.
            let fits = shape.iter().product::<usize>() == values.len();
            Output {
                name: self.model.outputs[*place].clone(),
                shape: if fits { shape.clone() } else { with_open_first(shape, values.len()) },
                values,
            }
        };
        let outputs = self.given.iter().map(output).collect();
        self.inputs.remember(&mut self.outputs);
        Ok(outputs)
    }
}

/// The shape of an output, from what the file declares and the number of its values.
fn shape(model: &ModelFile, output: usize, count: usize) -> Vec<usize> {
    let declared = || {
        let value = model.proto.graph.as_ref()?.output.get(output)?;
        let type_proto::Value::TensorType(tensor) = value.r#type.as_ref()?.value.as_ref()?;
        let side = |dim: &tract_onnx::pb::tensor_shape_proto::Dimension| match dim.value {
            Some(dimension::Value::DimValue(length)) => usize::try_from(length).ok(),
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
        Ok(())
    }

    fn predict(&mut self, frame: Frame<'_>, _: &DriveContext) -> Result<Vec<Output>> {
        self.infer(frame).map_err(|error| error.at(&self.place))
    }

    fn info(&self) -> Vec<(String, String)> {
        self.session.info()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::Pilot;
    use pdk_sdk::serde_json::{Map, Value, json};

    fn network(path: &std::path::Path) -> Network {
        let given: Map<String, Value> =
            json!({"model": path, "engine": "tract", "scale": "0..1"}).as_object().unwrap().clone();
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
