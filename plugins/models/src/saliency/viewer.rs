//! A model as saliency methods and attacks see it: frames in, a number out.

use pdk_network::outputs::Source as Number;
use pdk_network::region::Part;
use pdk_network::{Eye, Given, Inputs, field};
use pdk_onnx::objective::{OBJECTIVE, Objective};
use pdk_onnx::{Target, model};
use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::json;

use crate::driver::{built_in, trained};
use crate::engine;
use crate::model_file::{ModelFile, Source};
use crate::session::Session;

/// A model of which a number is explained, the steering unless the parameter `explain` says otherwise. One that remembers is asked as at the first frame, when it remembers nothing.
pub struct Viewer {
    /// The file and who runs it, for messages.
    pub place: String,
    pub model: ModelFile,
    pub engine: String,
    session: Box<dyn Session>,
    pub eye: Eye,
    explained: Explained,
    /// The speed that goes into the network, and the one that stands in for it if it is not known.
    speed: f64,
    assumed_speed: f64,
    inputs: Inputs,
    outputs: Vec<Vec<f32>>,
}

/// The parameter that names what is explained.
const EXPLAIN: &str = "explain";

/// What is explained.
struct Explained {
    /// What messages call it.
    name: String,
    /// Where it comes from.
    number: Number,
    /// All numbers that drive, or this one if the network does not drive.
    all: Vec<Number>,
}

/// What a method takes that explains one number.
pub fn parameters(description: Description) -> Description {
    common_parameters(description).parameter(
        Parameter::text(
            EXPLAIN,
            "which number is explained: `steering`, `throttle`, or any other that the network computes, in the words of `pdk gradient --of`: `scores[17]` for \
             a class, `boxes[0,4,*]` for the greatest of a row, `max(scores)`; left out, the steering",
        )
        .role(Role::Explained),
    )
}

/// What every method takes.
pub fn common_parameters(description: Description) -> Description {
    let description = description
        .example(json!({"model": "dave2"}))
        .parameter(Parameter::path("model", "the ONNX file whose view is shown, which the driver `onnx` takes; or the name of a network that is part of pdk").role(Role::Network))
        .parameter(engine::parameter());
    field::parameters(description)
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
    match built_in::content(name) {
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
        let source = source(config.text("model"));
        let given = match &source {
            Source::File(path) => Given::of(config, Some(path))?,
            Source::BuiltIn(_) => {
                let mut given = Given::of(config, None)?;
                trained::own_description(config.text("model"), &mut given);
                given
            }
        };
        let mut model = ModelFile::read(source, given)?;
        let name = match config.text(EXPLAIN) {
            "" => "steering",
            given => given,
        };
        let drives = ["steering", "throttle"].contains(&name);
        if !drives {
            compute_only(name, &mut model)?;
        }
        let engine = config.text(engine::PARAMETER).to_owned();
        let mut session = engine::open(&model.network(), &engine)?;
        let speed = config.number("speed");
        let explained = match drives {
            true => Explained::driving(name, &model, &mut *session, config)?,
            false => Explained::of(name, Number::plain(0), Vec::new()),
        };
        Ok(Self {
            place: format!("model `{}` on {}", config.text("model"), session.engine()),
            eye: Eye::new(&model.plan),
            explained,
            engine,
            session,
            speed,
            assumed_speed: speed,
            inputs: Inputs::new(&model.plan),
            outputs: model.room(),
            model,
        })
    }

    /// Who runs the network, with the version.
    pub fn runs_on(&self) -> String {
        self.session.engine()
    }

    /// Tells the network this speed from now on, or the assumed one if it is not known.
    pub fn move_at(&mut self, speed: Option<f64>) {
        self.speed = speed.unwrap_or(self.assumed_speed);
    }

    /// Where the number that is explained comes from.
    pub fn explained(&self) -> &Number {
        &self.explained.number
    }

    /// The name of the output that the explained number comes from.
    pub fn explained_output(&self) -> &str {
        &self.model.plan.outputs[self.explained().output]
    }

    /// The number that is explained, for its gradient.
    ///
    /// # Errors
    /// If it is read from bins, which have none.
    pub fn target(&self) -> Result<Target<'_>> {
        self.target_of(self.explained())
    }

    /// Whether what is explained falls when its number grows.
    pub fn is_reversed(&self) -> bool {
        self.explained().is_reversed()
    }

    /// All numbers that drive: steering, and throttle if the network gives one. Of a network that does not drive, the number that is explained.
    ///
    /// # Errors
    /// As for [`Self::target`].
    pub fn driving(&self) -> Result<Vec<Target<'_>>> {
        self.explained.all.iter().map(|number| self.target_of(number)).collect()
    }

    fn target_of(&self, number: &Number) -> Result<Target<'_>> {
        let value = &self.model.plan.outputs[number.output];
        match number.index {
            Some(index) => Ok(Target { value, index }),
            None => Err(Error::new(format!(
                "its output `{value}` holds bins, and the choice of one has no gradient; eigen-cam, rise and occlusion work without one"
            ))),
        }
    }

    /// The place and axes of the image among the network's inputs.
    pub fn image(&self) -> (usize, usize, usize) {
        let image = &self.model.plan.image;
        let axis = |letter| image.axis(letter).unwrap_or_default();
        (image.place, axis('h'), axis('w'))
    }

    /// How many numbers the image has.
    pub fn image_len(&self) -> usize {
        self.model.plan.image.shape.iter().product()
    }

    /// The part of a frame that the model sees; none if it sees all.
    ///
    /// # Errors
    /// If nothing is left of the frame.
    pub fn part(&self, width: usize, height: usize) -> Result<Option<Part>> {
        if self.eye.sees_all() { Ok(None) } else { self.eye.part(width, height).map(Some) }
    }

    /// Width and height of the model's image.
    pub fn size(&self) -> (usize, usize) {
        self.eye.size()
    }

    /// What the model sees of the frame, in the size of its image.
    ///
    /// # Errors
    /// If nothing is left of the frame.
    pub fn fit(&mut self, frame: Frame<'_>) -> Result<FrameBuf> {
        self.eye.fit(frame)
    }

    /// Writes the numbers that the model gets for a frame in the size of its image.
    pub fn numbers(&self, frame: Frame<'_>, values: &mut [f32]) {
        self.eye.see_first(frame, values);
    }

    /// The least and the greatest number that a pixel can become.
    pub fn range(&self) -> (f32, f32) {
        self.eye.range()
    }

    /// The speed for a network with a speed input.
    pub fn speed(&self) -> f64 {
        self.speed
    }

    /// What the network gives for a frame in the size of its image.
    ///
    /// # Errors
    /// If the engine fails, or the number is not finite.
    pub fn answer(&mut self, frame: Frame<'_>) -> Result<f64> {
        self.eye.see_first(frame, self.inputs.image());
        self.inputs.move_at(self.speed)?;
        self.session.run(self.inputs.values(), &mut self.outputs)?;
        let Explained { name, number, .. } = &self.explained;
        match number.of(&self.outputs[number.output]) {
            Some(value) if value.is_finite() => Ok(value),
            Some(value) => Err(Error::of(ErrorKind::Nonsense, format!("its {name} is {value}"))),
            None => Err(Error::new(format!("it gave no {name}"))),
        }
    }
}

impl Explained {
    fn of(name: &str, number: Number, others: Vec<Number>) -> Self {
        let all = [number.clone()].into_iter().chain(others).collect();
        Self { name: name.to_owned(), number, all }
    }

    /// The steering or the throttle of a network, which is run once.
    fn driving(name: &str, model: &ModelFile, session: &mut dyn Session, config: &Config) -> Result<Self> {
        let drives = model.control(&model.sizes(session, config.number("speed"))?).map_err(|error| {
            // Attacks, and methods that explain all numbers together, have no such parameter.
            let can_name_another = config.values().contains_key(EXPLAIN);
            match model.plan.described.steering.is_none() && can_name_another {
                true => Error::new(format!(
                    "{error}; if the network does not drive, name the number to explain with `{EXPLAIN}`"
                )),
                false => error,
            }
        })?;
        match (name, drives.throttle) {
            ("throttle", Some(throttle)) => Ok(Self::of(name, throttle, vec![drives.steering])),
            ("throttle", None) => Err(Error::new(
                "it gives no throttle, so only its steering can be explained; leave `explain` out",
            )),
            (_, throttle) => Ok(Self::of(name, drives.steering, throttle.into_iter().collect())),
        }
    }
}

/// Leaves a model that computes nothing but one number, in the words of [`Objective`].
fn compute_only(number: &str, model: &mut ModelFile) -> Result<()> {
    let graph = model.source.graph()?;
    let computed =
        Objective::parse(number, &graph).and_then(|objective| objective.graph(&graph)).map_err(|error| {
            Error::new(format!("explain: {error}; `steering` and `throttle` are known by these names"))
        })?;
    model.source = Source::BuiltIn(model::encode(&computed).into());
    model.plan.outputs = vec![OBJECTIVE.to_owned()];
    Ok(())
}
