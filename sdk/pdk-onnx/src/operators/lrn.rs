//! `LRN`: each element divided by a power of what its neighbours in other channels hold.

use pdk_sdk::error::{Error, Result};

use super::operator::{Operator, Rule, given, same};
use crate::site::Site;
use crate::tensor::Tensor;
use crate::values::Fact;

pub const OPERATORS: &[Operator] = &[Operator::new("LRN", infer, evaluate, Rule::Unknown)];

/// The number of channels that are summed.
pub fn size(site: &Site<'_>) -> Result<usize> {
    if site.shape(0)?.len() < 2 {
        return Err(Error::new("its input has no channels"));
    }
    let size = site.int("size", 0);
    usize::try_from(size)
        .ok()
        .filter(|&size| size > 0)
        .ok_or_else(|| Error::new(format!("its `size` is {size}, but has to be at least 1")))
}

fn infer(site: &Site<'_>) -> Result<Vec<Fact>> {
    size(site)?;
    same(site)
}

fn evaluate(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let (x, size) = (given(inputs, 0)?, size(site)?);
    let (alpha, beta, bias) = (site.float("alpha", 1e-4), site.float("beta", 0.75), site.float("bias", 1.0));
    let (before, behind) = ((size - 1) / 2, size / 2);
    let channels = x.shape[1];
    let plane: usize = x.shape[2..].iter().product();
    let mut result = x.clone();
    let images = result.values.chunks_mut((channels * plane).max(1));
    for (image, source) in images.zip(x.values.chunks((channels * plane).max(1))) {
        for (place, value) in image.iter_mut().enumerate() {
            let (channel, pixel) = (place / plane, place % plane);
            let around = channel.saturating_sub(before)..channel.saturating_add(behind + 1).min(channels);
            let sum: f64 = around.map(|channel| source[channel * plane + pixel]).map(|x| x * x).sum();
            *value /= libm::pow(bias + alpha / size as f64 * sum, beta);
        }
    }
    Ok(vec![result])
}

#[cfg(test)]
mod tests {
    use crate::graph::Graph;
    use crate::tensor::Tensor;
    use crate::testing::{Setting, Sketch, fault};

    #[test]
    fn an_even_number_of_channels_has_one_more_behind_than_before() {
        let mut sketch = Sketch::new(13);
        sketch.input("x", &[1, 3, 1]);
        let settings = [
            ("size", Setting::Int(2)),
            ("alpha", Setting::Float(2.0)),
            ("beta", Setting::Float(1.0)),
            ("bias", Setting::Float(0.0)),
        ];
        sketch.node("LRN", &["x"], "y", &settings);
        let graph = Graph::new(sketch.model(&["y"])).unwrap();
        let y = graph.evaluate(&[("x", &Tensor::floats(&[1, 3, 1], vec![1.0, 2.0, 4.0]))], &["y"]).unwrap();
        assert_eq!(y[0].values, [0.2, 0.1, 0.25]);
    }

    #[test]
    fn damaged_models_are_refused() {
        let size = |size| [("size", Setting::Int(size))];
        assert!(fault(13, "LRN", &[&[3]], &size(3)).contains("its input has no channels"));
        for wrong in [0, -1, i64::MIN] {
            assert!(fault(13, "LRN", &[&[1, 3, 2]], &size(wrong)).contains("has to be at least 1"));
        }
    }
}
