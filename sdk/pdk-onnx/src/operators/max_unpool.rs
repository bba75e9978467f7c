//! `MaxUnpool`: puts what a `MaxPool` kept back to where it came from.

use pdk_sdk::error::{Error, Result};

use super::inputs::{deciding, taken};
use super::operator::{Operator, Rule};
use super::positions::{index, lengths, strides};
use crate::site::Site;
use crate::tensor::{Tensor, elements, shape_text};
use crate::values::Fact;
use crate::window;

pub const OPERATORS: &[Operator] = &[Operator::new("MaxUnpool", infer, evaluate, Rule::Unknown)];

/// The shape that the pool had as its input, as far as it follows from the window. The indices count in it.
fn pooled(site: &Site<'_>) -> Result<Vec<usize>> {
    let shape = site.shape(0)?;
    if shape.len() < 3 || site.shape(1)? != shape {
        return Err(Error::new(format!(
            "its indices {} do not fit its input {}, which needs spatial axes",
            shape_text(site.shape(1)?),
            shape_text(shape)
        )));
    }
    let axes = shape.len() - 2;
    let kernel = window::lengths(site, "kernel_shape", axes, 0)?;
    let (strides, pads) =
        (window::lengths(site, "strides", axes, 1)?, window::lengths(site, "pads", 2 * axes, 0)?);
    let length = |axis: usize| {
        let steps = shape[axis + 2].checked_sub(1)?.checked_mul(strides[axis])?;
        let pads = pads[axis].checked_add(pads[axes + axis])?;
        steps.checked_add(kernel[axis])?.checked_sub(pads)
    };
    let spatial: Option<Vec<_>> = (0..axes).map(length).collect();
    let spatial = spatial.filter(|_| !kernel.contains(&0));
    let spatial = spatial.ok_or_else(|| Error::new("its window leaves nothing to put its input into"))?;
    let pooled = [&shape[..2], &spatial].concat();
    elements(&pooled)?;
    Ok(pooled)
}

fn infer(site: &Site<'_>) -> Result<Vec<Fact>> {
    let pooled = pooled(site)?;
    let shape = match deciding(site, 2)? {
        None => pooled,
        Some(shape) => {
            let shape = lengths(&shape.to_ints(), "output shape")?;
            if shape.len() != pooled.len() {
                return Err(Error::new(format!("its output shape {shape:?} has another number of axes")));
            }
            shape
        }
    };
    Ok(vec![Fact::new(site.fact(0)?.element, shape)])
}

fn evaluate(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let (pooled, fact) = (pooled(site)?, infer(site)?.swap_remove(0));
    let (input, indices) = (taken(site, inputs, 0)?, taken(site, inputs, 1)?);
    let mut result = Tensor::filled(fact.element, &fact.shape, 0.0)?;
    let (count, within) = (pooled.iter().product::<usize>(), strides(&pooled));
    let to = strides(&fact.shape);
    for (&value, number) in input.values.iter().zip(indices.to_ints()) {
        let place = usize::try_from(number).ok().filter(|&place| place < count);
        let at = place.map(|place| -> Vec<usize> {
            within.iter().zip(&pooled).map(|(stride, length)| place / stride % length).collect()
        });
        let at = at.filter(|at| at.iter().zip(&fact.shape).all(|(at, length)| at < length));
        let at = at.ok_or_else(|| {
            Error::new(format!("its index {number} is outside of {}", shape_text(&fact.shape)))
        })?;
        result.values[index(&to, &at)] = value;
    }
    Ok(vec![result])
}

#[cfg(test)]
mod tests {
    use crate::tensor::Tensor;
    use crate::testing::Setting::Ints;
    use crate::testing::computed;

    fn unpooled(shape: &[usize], index: i64, kernel: &[i64], size: Option<&[i64]>) -> Option<Vec<usize>> {
        let result = computed(11, |s| {
            let x = s.drawn(shape, -1.0, 1.0);
            let indices = vec![index; shape.iter().product()];
            let indices = Tensor { shape: shape.to_vec(), ..Tensor::ints(&indices) };
            let indices = s.weights("indices", indices);
            let size = size.map_or(String::new(), |size| s.ints(size));
            s.node("MaxUnpool", &[&x, &indices, &size], "y", &[("kernel_shape", Ints(kernel))]);
        });
        result.ok().map(|result| result.shape)
    }

    #[test]
    fn indices_and_windows_that_do_not_fit_are_errors() {
        let image = &[1, 1, 2, 2];
        assert_eq!(unpooled(image, 8, &[2, 2], None).unwrap(), [1, 1, 3, 3]);
        assert_eq!(unpooled(image, 8, &[2, 2], Some(&[1, 1, 5, 4])).unwrap(), [1, 1, 5, 4]);
        for (shape, index, kernel, size) in [
            (&image[..], 9, &[2, 2][..], None),
            (image, -1, &[2, 2], None),
            (image, 8, &[2, 2], Some(&[1, 1, 2, 3][..])),
            (image, 0, &[2, 2], Some(&[1, 1, 3])),
            (image, 0, &[2, 2], Some(&[1, 1, -3, 3])),
            (image, 0, &[2], None),
            (image, 0, &[0, 2], None),
            (image, 0, &[], None),
            (image, 0, &[-2, 2], None),
            (image, 0, &[i64::MAX, i64::MAX], None),
            (&[1, 1, 0, 2], 0, &[2, 2], None),
            (&[1, 2], 0, &[2, 2], None),
        ] {
            assert_eq!(unpooled(shape, index, kernel, size), None, "{shape:?} {index} {kernel:?} {size:?}");
        }
    }
}
