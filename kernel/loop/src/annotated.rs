//! What a frame comes with beside its pixels, if perturbations need it: what they show, and how far away it is.

use pdk_chain::moment::Labels;
use pdk_components::held::Held;
use pdk_sdk::prelude::{Annotations, Camera, Simulator};
use pdk_supervise::calls::Function;

use crate::fault::Fault;
use crate::stages::{Stage, Stopwatch};

/// The annotations of the frame at hand.
#[derive(Default)]
pub struct Annotated {
    /// What the simulator can tell apart, and what each pixel shows.
    labels: Option<(Vec<String>, Vec<u8>)>,
    depth: Option<Vec<f32>>,
}

impl Annotated {
    /// Room for what is needed of frames of this camera.
    ///
    /// # Errors
    /// If the simulator does not tell what it can tell apart.
    pub fn new(
        needed: Annotations,
        camera: Camera,
        simulator: &mut Held<dyn Simulator>,
    ) -> Result<Self, Fault> {
        let pixels = camera.width as usize * camera.height as usize;
        let labels = match needed.labels {
            true => {
                let names = simulator.call(Function::Labels, None, |simulator| Ok(simulator.label_names()));
                Some((names.map_err(Fault::Component)?, vec![0; pixels]))
            }
            false => None,
        };
        Ok(Self { labels, depth: needed.depth.then(|| vec![0.0; pixels]) })
    }

    /// Asks the simulator for what is needed of a frame.
    ///
    /// # Errors
    /// If it fails.
    pub fn look(
        &mut self,
        simulator: &mut Held<dyn Simulator>,
        sequence: u64,
        stopwatch: &mut Stopwatch,
    ) -> Result<(), Fault> {
        if let Some((_, pixels)) = self.labels.as_mut().filter(|(names, _)| !names.is_empty()) {
            stopwatch
                .measure(Stage::Simulator, || {
                    simulator.call(Function::Labels, Some(sequence), |s| s.labels(pixels))
                })
                .map_err(Fault::Component)?;
        }
        if let Some(depth) = self.depth.as_mut() {
            stopwatch
                .measure(Stage::Simulator, || {
                    simulator.call(Function::Depth, Some(sequence), |s| s.depth(depth))
                })
                .map_err(Fault::Component)?;
        }
        Ok(())
    }

    /// What the pixels show.
    pub fn labels(&self) -> Option<Labels<'_>> {
        self.labels.as_ref().map(|(names, pixels)| Labels { names, pixels })
    }

    /// How far away it is, in metres.
    pub fn depth(&self) -> Option<&[f32]> {
        self.depth.as_deref()
    }
}
