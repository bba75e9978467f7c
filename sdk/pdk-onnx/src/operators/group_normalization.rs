//! `GroupNormalization`, `MeanVarianceNormalization` and `RMSNormalization`.

use pdk_sdk::error::{Error, Result};

use super::normalization::{epsilon, first_axis, standardize};
use super::operator::{Operator, Rule, check_broadcast, given, same};
use super::reduce::fold;
use crate::site::{Site, axes};
use crate::tensor::{Tensor, shape_text};
use crate::values::Fact;

pub const OPERATORS: &[Operator] = &[
    Operator::new("GroupNormalization", infer_groups, evaluate_groups, Rule::Unknown),
    Operator::new("MeanVarianceNormalization", infer_moments, evaluate_moments, Rule::Unknown),
    Operator::new("RMSNormalization", infer_rms, evaluate_rms, Rule::Unknown),
];

/// The number of groups of channels, and of channels for each factor and term: before version 21 there is one for each group.
pub fn groups(site: &Site<'_>) -> Result<(usize, usize)> {
    let shape = site.shape(0)?;
    let channels = *shape.get(1).ok_or_else(|| Error::new("its input has no channels"))?;
    let count = site.int("num_groups", 0);
    let count = usize::try_from(count).ok().filter(|&count| count > 0 && channels % count == 0);
    let count = count
        .ok_or_else(|| Error::new(format!("its {channels} channels do not make `num_groups` groups")))?;
    let factors = if site.opset() < 21 { count } else { channels };
    for place in 1..3 {
        if site.shape(place)? != [factors] {
            return Err(Error::new(format!(
                "its input {} has the shape {}, but has to have {factors} numbers",
                place + 1,
                shape_text(site.shape(place)?)
            )));
        }
    }
    Ok((count, channels / factors.max(1)))
}

fn infer_groups(site: &Site<'_>) -> Result<Vec<Fact>> {
    groups(site)?;
    same(site)
}

fn evaluate_groups(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let (count, share) = groups(site)?;
    let [x, scale, bias] = [given(inputs, 0)?, given(inputs, 1)?, given(inputs, 2)?];
    let channels = x.shape[1];
    let plane: usize = x.shape[2..].iter().product();
    let (mut result, _) = standardize(x, channels / count * plane, epsilon(site));
    for (place, values) in result.values.chunks_mut(plane.max(1)).enumerate() {
        let factor = place % channels / share;
        values.iter_mut().for_each(|value| *value = *value * scale.values[factor] + bias.values[factor]);
    }
    Ok(vec![result])
}

/// The axes over which values get mean 0 and variance 1.
fn joined(site: &Site<'_>) -> Result<Vec<usize>> {
    axes(site.ints("axes").unwrap_or(&[0, 2, 3]), site.shape(0)?.len())
}

fn infer_moments(site: &Site<'_>) -> Result<Vec<Fact>> {
    joined(site)?;
    same(site)
}

fn evaluate_moments(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    const EPSILON: f64 = 1e-9;
    let (x, joined) = (given(inputs, 0)?, joined(site)?);
    let dims = x.shape.iter().enumerate();
    let kept: Vec<_> = dims.map(|(axis, &dim)| if joined.contains(&axis) { 1 } else { dim }).collect();
    let count = joined.iter().map(|&axis| x.shape[axis]).product::<usize>() as f64;
    let mean = fold(x, &kept, 0.0, |sum, x| sum + x / count)?;
    let mut values = x.values.iter();
    let mut centred = Tensor::from_fn(x.element, &x.shape, |at| {
        values.next().copied().unwrap_or_default() - mean.broadcast_at(at)
    })?;
    let variance = fold(&centred, &kept, 0.0, |sum, x| sum + x * x / count)?;
    let mut values = centred.values.into_iter();
    centred.values = Vec::new();
    let scaled = Tensor::from_fn(x.element, &x.shape, |at| {
        values.next().unwrap_or_default() / (libm::sqrt(variance.broadcast_at(at)) + EPSILON)
    });
    Ok(vec![scaled?])
}

fn infer_rms(site: &Site<'_>) -> Result<Vec<Fact>> {
    first_axis(site)?;
    check_broadcast(site, 1)?;
    same(site)
}

fn evaluate_rms(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    infer_rms(site)?;
    let (x, scale, epsilon) = (given(inputs, 0)?, given(inputs, 1)?, epsilon(site));
    let block: usize = x.shape[first_axis(site)?..].iter().product();
    let size =
        |block: &[f64]| libm::sqrt(block.iter().map(|x| x * x).sum::<f64>() / block.len() as f64 + epsilon);
    let sizes: Vec<f64> = x.values.chunks(block.max(1)).map(size).collect();
    let mut values = x.values.iter().enumerate();
    let scaled = Tensor::from_fn(x.element, &x.shape, |at| {
        let Some((place, value)) = values.next() else { return 0.0 };
        value / sizes[place / block.max(1)] * scale.broadcast_at(at)
    });
    Ok(vec![scaled?])
}

#[cfg(test)]
mod tests {
    use crate::graph::Graph;
    use crate::tensor::Tensor;
    use crate::testing::{Setting, Sketch, fault};

    #[test]
    fn groups_have_factors_of_their_own_before_version_21_and_channels_after() {
        let x = Tensor::floats(&[1, 4, 1], vec![1.0, 3.0, 5.0, 9.0]);
        for (opset, scale, expected) in [
            (18, vec![1.0, 2.0], [-1.0, 1.0, -2.0, 2.0]),
            (21, vec![1.0, 2.0, 3.0, 4.0], [-1.0, 2.0, -3.0, 4.0]),
        ] {
            let mut sketch = Sketch::new(opset);
            sketch.input("x", &[1, 4, 1]);
            let bias = sketch.weights("bias", Tensor::floats(&[scale.len()], vec![0.0; scale.len()]));
            let scale = sketch.weights("scale", Tensor::floats(&[scale.len()], scale));
            let settings = [("num_groups", Setting::Int(2)), ("epsilon", Setting::Float(0.0))];
            sketch.node("GroupNormalization", &["x", &scale, &bias], "y", &settings);
            let graph = Graph::new(sketch.model(&["y"])).unwrap();
            assert_eq!(graph.evaluate(&[("x", &x)], &["y"]).unwrap()[0].values, expected);
        }
    }

    #[test]
    fn values_are_divided_by_the_root_of_the_mean_of_their_squares() {
        let mut sketch = Sketch::new(23);
        sketch.input("x", &[2, 2]);
        let scale = sketch.weights("scale", Tensor::floats(&[2], vec![1.0, 2.0]));
        sketch.node("RMSNormalization", &["x", &scale], "y", &[("epsilon", Setting::Float(1.0))]);
        let graph = Graph::new(sketch.model(&["y"])).unwrap();
        let root = libm::sqrt(8.0);
        let x = Tensor::floats(&[2, 2], vec![root, root, 0.0, 4.0]);
        let y = graph.evaluate(&[("x", &x)], &["y"]).unwrap().swap_remove(0).values;
        for (found, expected) in y.iter().zip([root / 3.0, root / 1.5, 0.0, 8.0 / 3.0]) {
            assert!((found - expected).abs() < 1e-12, "{y:?}");
        }
    }

    #[test]
    fn damaged_models_are_refused() {
        let groups = |count| [("num_groups", Setting::Int(count))];
        for count in [0, -1, 3, i64::MIN] {
            let error = fault(21, "GroupNormalization", &[&[1, 4, 2], &[4], &[4]], &groups(count));
            assert!(error.contains("its 4 channels do not make"), "{error}");
        }
        let shapes: [&[&[usize]]; 4] =
            [&[&[4], &[4], &[4]], &[&[1, 4], &[4], &[3]], &[&[1, 4], &[2], &[2]], &[&[1, 4], &[4]]];
        for shapes in shapes {
            assert!(!fault(21, "GroupNormalization", shapes, &groups(2)).is_empty());
        }
        assert!(fault(13, "MeanVarianceNormalization", &[&[1, 2]], &[]).contains("outside the 2 axes"));
        assert!(fault(23, "RMSNormalization", &[&[2], &[1, 2]], &[]).contains("does not go together"));
        assert!(fault(23, "RMSNormalization", &[&[2]], &[]).contains("its input 2 is missing"));
        assert!(fault(23, "RMSNormalization", &[&[], &[]], &[]).contains("outside the 0 axes"));
    }
}
