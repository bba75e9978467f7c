//! Predictors: networks that say something about a frame other than how to steer, such as what it shows.

use pdk_abi::{PredictorFunctionsRef, Sink, empty, load};
use pdk_ops::Frame;
use serde::{Deserialize, Serialize};

use super::driver::DriveContext;
use crate::abi::convert::{self, Crosses};
use crate::abi::host::call::{Object, call, collect};
use crate::abi::plugin::call::{functions, put};
use crate::config::Config;
use crate::describe::Description;
use crate::error::{Error, ErrorKind, Result};
use crate::testing::sample::{Make, ensure, sample_frame};

/// Looks at a frame and gives values by name: scores of classes, boxes, a map. A metric says how good they are.
pub trait Predictor: Send {
    /// Forgets everything about earlier frames. Called before each sequence.
    ///
    /// # Errors
    /// If the predictor cannot start over.
    fn reset(&mut self) -> Result<()> {
        Ok(())
    }

    /// What the predictor makes of a frame: the same names in the same order for every frame.
    ///
    /// # Errors
    /// If the predictor cannot use the frame, for instance because of its size.
    fn predict(&mut self, frame: Frame<'_>, cx: &DriveContext) -> Result<Vec<Output>>;

    /// What was decided when the instance was made and is not among its parameters, such as the library that runs a
    /// network: names and values for the record.
    fn info(&self) -> Vec<(String, String)> {
        Vec::new()
    }
}

/// Values under a name.
#[derive(Debug, Clone, PartialEq)]
pub struct Output {
    /// The name.
    pub name: String,
    /// How many values there are along each axis.
    pub shape: Vec<usize>,
    /// The values, those of the last axis next to each other.
    pub values: Vec<f32>,
}

/// How the values of an output are to be read.
#[derive(Serialize, Deserialize)]
struct Shape {
    name: String,
    shape: Vec<usize>,
}

/// How the values of these outputs are to be read.
fn shapes(outputs: &[Output]) -> Vec<Shape> {
    outputs
        .iter()
        .map(|Output { name, shape, .. }| Shape { name: name.clone(), shape: shape.clone() })
        .collect()
}

/// Numbers as the machine has them.
fn bytes(values: &[f32]) -> &[u8] {
    // SAFETY: the same memory; any bytes are bytes.
    unsafe { std::slice::from_raw_parts(values.as_ptr().cast(), size_of_val(values)) }
}

/// Outputs from their shapes and the bytes of all their values; none if these do not belong together.
fn read_outputs(shapes: Vec<Shape>, bytes: &[u8]) -> Option<Vec<Output>> {
    let mut values =
        bytes.chunks_exact(size_of::<f32>()).map(|value| value.try_into().map(f32::from_ne_bytes));
    let mut outputs = Vec::with_capacity(shapes.len());
    for Shape { name, shape } in shapes {
        let count = shape.iter().try_fold(1_usize, |count, side| count.checked_mul(*side))?;
        let values: Vec<f32> = values.by_ref().take(count).collect::<std::result::Result<_, _>>().ok()?;
        if values.len() != count {
            return None;
        }
        outputs.push(Output { name, shape, values });
    }
    (values.next().is_none() && bytes.len().is_multiple_of(size_of::<f32>())).then_some(outputs)
}

functions! { Predictor as PredictorFunctions:
    fn reset(component, _) {
        component.reset()
    }
    fn predict(
        component,
        _,
        frame: *const pdk_abi::Frame,
        context: *const pdk_abi::DriveContext,
        outputs: *const Sink,
        values: *const Sink
    ) {
        let found = component.predict(convert::source(frame)?, &DriveContext::read(context))?;
        put(outputs, &serde_json::to_string(&shapes(&found))?);
        let sink = load(values, empty());
        found.iter().for_each(|output| sink.put(bytes(&output.values)));
        Ok(())
    }
    fn info(component, _, info: *const Sink) {
        put(info, &serde_json::to_string(&component.info())?);
        Ok(())
    }
}

/// An instance in a plugin.
pub(crate) struct Host {
    object: Object<PredictorFunctionsRef>,
    info: Vec<(String, String)>,
}

impl Host {
    pub(crate) fn new(object: Object<PredictorFunctionsRef>) -> Result<Self> {
        let Object { pointer, functions, .. } = object;
        // SAFETY: both sinks live through the call.
        let info = collect(|text, error| unsafe { functions.info()(pointer, text, error) })?;
        Ok(Self { object, info: serde_json::from_str(&info)? })
    }
}

impl Predictor for Host {
    fn reset(&mut self) -> Result<()> {
        let Object { pointer, functions, .. } = self.object;
        // SAFETY: the sink lives through the call.
        call(|error| unsafe { functions.reset()(pointer, error) })
    }

    fn predict(&mut self, frame: Frame<'_>, cx: &DriveContext) -> Result<Vec<Output>> {
        let Object { pointer, functions, .. } = self.object;
        let (frame, context) = (convert::frame(frame), cx.raw());
        let mut values = Vec::new();
        let sink = convert::sink(&mut values);
        // SAFETY: everything lives through the call.
        let shapes = collect(|outputs, error| unsafe {
            functions.predict()(pointer, &frame, &context, outputs, &sink, error)
        })?;
        read_outputs(serde_json::from_str(&shapes)?, &values).ok_or_else(|| {
            Error::of(ErrorKind::Nonsense, "its outputs have another number of values than their shapes say")
        })
    }

    fn info(&self) -> Vec<(String, String)> {
        self.info.clone()
    }
}

/// Checks that a predictor gives the same outputs for the same frame after a reset, and the same names and shapes for another one.
///
/// # Errors
/// The first check that fails.
pub fn check(_: &Description, config: &Config, make: Make<'_, dyn Predictor>) -> Result<()> {
    let mut predictor = make(config)?;
    let mut predict = |width: usize, height: usize| {
        predictor.reset()?;
        predictor.predict(sample_frame(width, height).as_ref(), &DriveContext::default())
    };
    let (first, second) = (predict(160, 120)?, predict(160, 120)?);
    let bits = |outputs: &[Output]| -> Vec<u32> {
        outputs.iter().flat_map(|output| output.values.iter().map(|value| value.to_bits())).collect()
    };
    ensure(!first.is_empty(), || "it gives no outputs".to_owned())?;
    ensure(bits(&first) == bits(&second), || "the same frame gives other values after a reset".to_owned())?;
    let names = |outputs: &[Output]| outputs.iter().map(|output| output.name.clone()).collect::<Vec<_>>();
    ensure(names(&first) == names(&predict(320, 240)?), || {
        "another frame gives outputs of other names".to_owned()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outputs_cross_as_they_are_and_others_are_refused() {
        let output = |name: &str, shape: &[usize], values: &[f32]| Output {
            name: name.into(),
            shape: shape.into(),
            values: values.into(),
        };
        let outputs = vec![
            output("a", &[1, 2], &[0.5, f32::INFINITY]),
            output("b", &[], &[-1.0]),
            output("c", &[0], &[]),
        ];
        let values: Vec<u8> = outputs.iter().flat_map(|output| bytes(&output.values)).copied().collect();
        assert_eq!(read_outputs(shapes(&outputs), &values).unwrap(), outputs);
        for wrong in [&values[..8], &values[..11], &[values.clone(), vec![0; 4]].concat()] {
            assert!(read_outputs(shapes(&outputs), wrong).is_none());
        }
        assert!(read_outputs(shapes(&[output("a", &[usize::MAX, 2], &[])]), &values).is_none());
    }
}
