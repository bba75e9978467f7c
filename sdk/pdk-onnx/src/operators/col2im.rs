//! `Col2Im`: sums the columns that windows over an image gave back into that image.

use pdk_sdk::error::{Error, Result};

use super::inputs::{deciding, taken};
use super::operator::{Operator, Rule};
use super::positions::lengths;
use crate::site::Site;
use crate::tensor::{Tensor, shape_text};
use crate::values::Fact;
use crate::window::{LONGEST, Window};

pub const OPERATORS: &[Operator] = &[Operator::new("Col2Im", infer, evaluate, Rule::Unknown)];

/// The window over the image, and the number of the image's channels.
fn window(site: &Site<'_>) -> Result<(Window, usize)> {
    let list = |place: usize, what: &str| -> Result<Vec<usize>> {
        let tensor = deciding(site, place)?;
        let tensor = tensor.ok_or_else(|| Error::new(format!("its input {} is missing", place + 1)))?;
        lengths(&tensor.to_ints(), what)
    };
    let (image, block) = (list(1, "image shape")?, list(2, "block shape")?);
    let is_large = image.iter().chain(&block).any(|&length| length as i64 > LONGEST);
    let columns = site.shape(0)?;
    let unfit = || {
        Error::new(format!(
            "its columns {} do not fit blocks of {} over an image of {}",
            shape_text(columns),
            shape_text(&block),
            shape_text(&image)
        ))
    };
    let &[_, depth, places] = columns else { return Err(unfit()) };
    if is_large || image.is_empty() || image.len() != block.len() {
        return Err(unfit());
    }
    let window = Window::over(site, &image, &block)?;
    let product = |list: &[usize]| list.iter().try_fold(1usize, |product, &dim| product.checked_mul(dim));
    match product(&block).filter(|&taps| depth % taps == 0) {
        Some(taps) if product(&window.output) == Some(places) => Ok((window, depth / taps)),
        _ => Err(unfit()),
    }
}

fn infer(site: &Site<'_>) -> Result<Vec<Fact>> {
    let (window, channels) = window(site)?;
    let fact = site.fact(0)?;
    let shape = [fact.shape[0], channels].into_iter().chain(window.input).collect();
    Ok(vec![Fact::new(fact.element, shape)])
}

fn evaluate(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let ((window, _), fact) = (window(site)?, infer(site)?.swap_remove(0));
    let columns = taken(site, inputs, 0)?;
    let mut result = Tensor::filled(fact.element, &fact.shape, 0.0)?;
    let (plane, places): (usize, usize) = (window.input.iter().product(), window.output.iter().product());
    let block = (window.taps() * places).max(1);
    // Without columns there is nothing to add, and the pairs of a large window would be many.
    if columns.values.is_empty() || plane == 0 {
        return Ok(vec![result]);
    }
    let pairs = window.pairs();
    for (plane, columns) in result.values.chunks_mut(plane).zip(columns.values.chunks(block)) {
        for (row, joined) in columns.chunks(places).zip(&pairs) {
            for &(from, to) in joined {
                plane[to] += row[from];
            }
        }
    }
    Ok(vec![result])
}

#[cfg(test)]
mod tests {
    use crate::testing::Setting::Ints;
    use crate::testing::computed;

    #[test]
    fn columns_and_blocks_that_do_not_fit_are_errors() {
        let summed = |columns: &[usize], image: &[i64], block: &[i64], strides: &[i64]| {
            let result = computed(18, |s| {
                let columns = s.drawn(columns, -1.0, 1.0);
                let (image, block) = (s.ints(image), s.ints(block));
                s.node("Col2Im", &[&columns, &image, &block], "y", &[("strides", Ints(strides))]);
            });
            result.ok().map(|result| result.shape)
        };
        let large = i64::MAX;
        assert_eq!(summed(&[1, 8, 4], &[3, 3], &[2, 2], &[1, 1]).unwrap(), [1, 2, 3, 3]);
        assert_eq!(summed(&[0, 8, 4], &[3, 3], &[2, 2], &[1, 1]).unwrap(), [0, 2, 3, 3]);
        for (columns, image, block, strides) in [
            (&[1, 8, 5][..], &[3, 3][..], &[2, 2][..], &[1, 1][..]),
            (&[1, 7, 4], &[3, 3], &[2, 2], &[1, 1]),
            (&[8, 4], &[3, 3], &[2, 2], &[1, 1]),
            (&[1, 8, 4], &[3, 3], &[2], &[1, 1]),
            (&[1, 8, 4], &[], &[], &[]),
            (&[1, 8, 4], &[3, -3], &[2, 2], &[1, 1]),
            (&[1, 8, 4], &[3, 3], &[0, 2], &[1, 1]),
            (&[1, 8, 4], &[3, 3], &[4, 4], &[1, 1]),
            (&[1, 8, 4], &[3, 3], &[2, 2], &[0, 1]),
            (&[1, 8, 4], &[3, 3], &[2, 2], &[1]),
            (&[1, 8, 4], &[3, 3], &[large, large], &[1, 1]),
            (&[1, 8, 4], &[large, large], &[2, 2], &[1, 1]),
            (&[1, 8, 4], &[3, 3], &[2, 2], &[large, large]),
        ] {
            assert_eq!(summed(columns, image, block, strides), None, "{columns:?} {image:?} {block:?}");
        }
    }
}
