//! A network under attack: how it steers at a frame, and how that changes with each of the frame's bytes.

use pdk_network::field;
use pdk_sdk::prelude::*;

use crate::backward::Backward;
use crate::engine;
use crate::model_file;
use crate::saliency::viewer::Viewer;

/// Adds the parameters that say which network is attacked.
pub fn parameters(description: Description) -> Description {
    let description = description
        .parameter(
            Parameter::path(
                "model",
                "the ONNX file of the network that is attacked, or the name of a network that is part of pdk; it need not be the driver",
            )
            .role(Role::Network),
        )
        .parameter(engine::parameter());
    let mut description = field::parameters(description);
    // For a perturbation, `region` is a modifier and `frame`, in Python, the number of the frame. The file beside the model says both as well.
    description.parameters.retain(|parameter| !["region", "frame"].contains(&parameter.name.as_str()));
    description.parameter(
        Parameter::number(
            "speed",
            8.0,
            "the speed that is given to a network with a speed input where the real one is not known, as for pictures",
        )
        .unit("m/s")
        .range(0.0, 100.0)
        .role(Role::Speed),
    )
}

/// The files beside the model that belong to it.
pub fn files(config: &Config) -> Vec<InputFiles> {
    model_file::files_beside(config.text("model"))
}

/// A network under attack. One that remembers is asked as at the first frame, when it remembers nothing.
pub struct Attacked {
    viewer: Viewer,
    backward: Option<Backward>,
}

impl Attacked {
    /// Opens the network, with its gradient or without.
    ///
    /// # Errors
    /// If the file is not a driving model, or a gradient is asked for and there is none.
    pub fn open(config: &Config, with_gradient: bool) -> Result<Self> {
        let place = |error: Error| error.at(format_args!("model `{}`", config.text("model")));
        let viewer = Viewer::open(config).map_err(place)?;
        let backward = match with_gradient {
            true => {
                let Viewer { model, eye, engine, .. } = &viewer;
                let backward = Backward::of(&model.source, &model.plan, eye, viewer.explained(), engine);
                Some(backward.map_err(|error| {
                    place(Error::new(format!(
                        "{error}; use the perturbation square_attack, which needs none"
                    )))
                })?)
            }
            false => None,
        };
        Ok(Self { viewer, backward })
    }

    /// From now on, the network gets this speed, or the assumed one if it is not known.
    pub fn move_at(&mut self, speed: Option<f64>) {
        self.viewer.move_at(speed);
    }

    /// How it steers at a frame.
    ///
    /// # Errors
    /// If the engine fails, or the steering is not finite.
    pub fn steering(&mut self, frame: Frame<'_>) -> Result<f64> {
        let steer = |viewer: &mut Viewer| {
            let fitted = viewer.fit(frame)?;
            viewer.answer(fitted.as_ref())
        };
        steer(&mut self.viewer).map_err(|error| error.at(&self.viewer.place))
    }

    /// How it steers at a frame, and how that changes with each of the frame's bytes, row by row.
    ///
    /// # Errors
    /// If the engine fails, a number is not finite, or the network was opened without its gradient.
    pub fn gradient(&mut self, frame: Frame<'_>) -> Result<(f64, Vec<f32>)> {
        let Self { viewer, backward } = self;
        let (speed, place) = (viewer.speed(), &viewer.place);
        let found = match backward {
            Some(backward) => backward.run(&mut viewer.eye, frame, speed),
            None => Err(Error::new("it was opened without its gradient")),
        };
        found.map_err(|error| error.at(place))
    }
}
