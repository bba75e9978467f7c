//! Networks that make of an image another image, or a map of it: what their files take, and how they are run.

use pdk_network::{Eye, Given, Inputs};
use pdk_sdk::prelude::*;

use crate::engine;
use crate::model_file::{ModelFile, Source};
use crate::session::Session;

/// A network that takes one image.
pub struct PictureNetwork {
    /// The file and who runs it, for messages.
    pub place: String,
    /// Width and height of its image.
    pub size: [usize; 2],
    layout: &'static str,
    session: Box<dyn Session>,
    eye: Eye,
    inputs: Inputs,
    outputs: Vec<Vec<f32>>,
}

/// The inputs of every such network.
pub fn parameters(description: Description) -> Description {
    description
        .parameter(Parameter::path(
            "model",
            "the ONNX file: an image of one or three channels in, and the result as its first output",
        ))
        .parameter(engine::parameter())
        .parameter(Parameter::choice(
            "layout",
            &["auto", "nchw", "nhwc"],
            "where the channels are: before or after height and width; auto reads it from the input's shape",
        ))
        .parameter(Parameter::choice(
            "scale",
            &["0..255", "0..1", "-1..1"],
            "the range of pixel values that the network was trained on",
        ))
        .parameter(Parameter::choice(
            "color",
            &["rgb", "bgr"],
            "the order of colours that the network was trained on",
        ))
        .parameter(
            Parameter::integer("width", 256, "width of the network's image if the file leaves it open")
                .range(1.0, 4096.0)
                .unit("px"),
        )
        .parameter(
            Parameter::integer("height", 256, "height of the network's image if the file leaves it open")
                .range(1.0, 4096.0)
                .unit("px"),
        )
}

/// What the parameters say about the image, in the fields of a description.
fn given(config: &Config) -> Given {
    let mut given = Given::default();
    given.set("resize", "linear".into(), "the kind of network");
    given.set("scale", config.value("scale").clone(), "the parameters");
    if config.text("layout") != "auto" {
        given.set("layout", config.value("layout").clone(), "the parameters");
    }
    // A network of one channel takes grey, whatever the order of colours is.
    if config.text("color") == "bgr" {
        given.set("color", config.value("color").clone(), "the parameters");
    }
    given
}

impl PictureNetwork {
    /// Opens the network that `model` names and runs it once.
    ///
    /// # Errors
    /// If it is not such a network, or the engine cannot run it.
    pub fn open(config: &Config) -> Result<Self> {
        Self::of(Source::File(config.text("model").into()), config)
    }

    /// Opens a network, which messages call by `model`, and runs it once.
    ///
    /// # Errors
    /// As for [`Self::open`].
    pub fn of(source: Source, config: &Config) -> Result<Self> {
        let name = config.text("model");
        let open = || {
            let size = [config.integer("width") as usize, config.integer("height") as usize];
            let model = ModelFile::read_at(source, given(config), size)?;
            if model.plan.states().next().is_some() {
                return Err(Error::new(
                    "it remembers frames, which only a driver can; export it without the inputs `NAME_in`",
                ));
            }
            let mut session = engine::open(&model.network(), config.text(engine::PARAMETER))?;
            let mut outputs = model.room();
            let inputs = Inputs::new(&model.plan);
            session.run(inputs.values(), &mut outputs)?;
            Ok(Self {
                place: format!("model `{name}` on {}", session.engine()),
                size: [model.plan.image.width, model.plan.image.height],
                layout: model.plan.image.layout,
                session,
                eye: Eye::new(&model.plan),
                inputs,
                outputs,
            })
        };
        open().map_err(|error: Error| error.at(format_args!("model `{name}`")))
    }

    /// Runs the network on a frame of any size, and gives the values of its first output.
    ///
    /// # Errors
    /// If the engine fails, or a value is not a number.
    pub fn run(&mut self, frame: Frame<'_>) -> Result<&[f32]> {
        let fitted = self.eye.fit(frame).map_err(|error| error.at(&self.place))?;
        self.eye.see_first(fitted.as_ref(), self.inputs.image());
        let ran = self.session.run(self.inputs.values(), &mut self.outputs);
        ran.map_err(|error| error.at(&self.place))?;
        match self.outputs[0].iter().all(|value| value.is_finite()) {
            true => Ok(&self.outputs[0]),
            false => Err(Error::of(ErrorKind::Nonsense, "its result holds numbers that are not finite")
                .at(&self.place)),
        }
    }

    /// How many numbers its result has for each pixel of its image.
    ///
    /// # Errors
    /// If that is not a whole number.
    pub fn channels(&self) -> Result<usize> {
        let [width, height] = self.size;
        let values = self.outputs[0].len();
        match values.is_multiple_of(width * height) && values > 0 {
            true => Ok(values / (width * height)),
            false => Err(Error::new(format!(
                "its result has {values} numbers, which cannot be a picture of {width}x{height} like its input; export it with a \
                 result as large as its image"
            ))
            .at(&self.place)),
        }
    }

    /// Where the number of a channel and a pixel is in its result of this many channels.
    pub fn at(&self, channel: usize, pixel: usize, channels: usize) -> usize {
        match self.layout {
            "nhwc" => pixel * channels + channel,
            _ => channel * self.size[0] * self.size[1] + pixel,
        }
    }
}
