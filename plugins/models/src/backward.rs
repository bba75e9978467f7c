//! The gradient of a network's steering with respect to the bytes of a frame.

use pdk_network::outputs::Source as Number;
use pdk_network::{Eye, Inputs, Plan};
use pdk_onnx::{Target, gradients, model};
use pdk_sdk::prelude::*;

use crate::engine;
use crate::model_file::Source;
use crate::session::{Graph, Network, Session};

/// The graph that computes the steering and its gradient. A network that remembers is asked as at the first frame, when it remembers nothing.
pub struct Backward {
    session: Box<dyn Session>,
    inputs: Inputs,
    outputs: Vec<Vec<f32>>,
    steering: Number,
}

impl Backward {
    /// Builds it from a network's graph, on an engine.
    ///
    /// # Errors
    /// If an operator has no gradient, the steering is a choice, or it does not change with a frame that counts as the first.
    pub fn of(source: &Source, plan: &Plan, eye: &Eye, steering: &Number, engine: &str) -> Result<Self> {
        if !eye.first_matters() {
            return Err(Error::new(
                "its image holds nothing but differences of frames, and there are none at the first frame, so it has no gradient",
            ));
        }
        let value = &plan.outputs[steering.output];
        let Some(index) = steering.index else {
            return Err(Error::new(format!(
                "its output `{value}` holds bins, and the choice of one has no gradient"
            )));
        };
        let image = &plan.inputs[plan.image.place].name;
        let built = gradients(&source.graph()?, Target { value, index }, &[image], &[value])?;
        let bytes = model::encode(&built.model);
        let inputs = plan.inputs.iter().map(Into::into).collect();
        Ok(Self {
            session: engine::open(&Network { graph: Graph::Memory(&bytes), inputs }, engine)?,
            inputs: Inputs::new(plan),
            outputs: vec![Vec::new(); built.outputs.len()],
            steering: steering.clone(),
        })
    }

    /// The steering at a frame and a speed, and its gradient: row by row, three numbers a pixel.
    ///
    /// # Errors
    /// If the engine fails, or a number is not finite.
    pub fn run(&mut self, eye: &mut Eye, frame: Frame<'_>, speed: f64) -> Result<(f64, Vec<f32>)> {
        let fitted = eye.fit(frame)?;
        eye.see_first(fitted.as_ref(), self.inputs.image());
        self.inputs.move_at(speed)?;
        self.session.run(self.inputs.values(), &mut self.outputs)?;
        let (Some(value), Some(of_numbers)) = (self.outputs.first(), self.outputs.last()) else {
            return Err(Error::new("the graph of its gradient gives nothing"));
        };
        let mut gradient = eye.back(frame, of_numbers)?;
        let slope = self.steering.slope() as f32;
        gradient.iter_mut().for_each(|value| *value *= slope);
        let steering = self.steering.of(value).filter(|steering| steering.is_finite());
        match steering.filter(|_| gradient.iter().all(|value| value.is_finite())) {
            Some(steering) => Ok((steering, gradient)),
            None => Err(Error::of(
                ErrorKind::Nonsense,
                "its steering or the gradient of it is not a finite number",
            )),
        }
    }
}
