//! `Conv`: its gradient is a transposed convolution with the same weights. That of the weights is a convolution of its input with the
//! gradient.

use pdk_sdk::error::{Error, Result};

use super::inputs::optional;
use super::operator::{Operator, Parts, Rule, given};
use crate::builder::Builder;
use crate::site::Site;
use crate::tensor::{Tensor, shape_text};
use crate::values::Fact;
use crate::window::Window;

pub const OPERATORS: &[Operator] = &[Operator::new("Conv", infer, evaluate, Rule::First(gradient))];

/// The window and the number of groups.
pub fn window(site: &Site<'_>) -> Result<(Window, usize)> {
    window_over(site, site.shape(0)?, site.shape(1)?)
}

/// The window and the number of groups for an input and weights of these shapes.
pub fn window_over(site: &Site<'_>, image: &[usize], weights: &[usize]) -> Result<(Window, usize)> {
    let fits = |group| weights[1].checked_mul(group) == Some(image[1]) && weights[0].is_multiple_of(group);
    let group = group(site, image, weights, fits)?;
    Ok((Window::over(site, &image[2..], &weights[2..])?, group))
}

/// The number of groups of a convolution or of its reverse; `fits` says whether the channels of its weights fit that number.
pub fn group(
    site: &Site<'_>,
    image: &[usize],
    weights: &[usize],
    fits: impl Fn(usize) -> bool,
) -> Result<usize> {
    let group = usize::try_from(site.int("group", 1)).unwrap_or(0);
    if image.len() >= 3 && image.len() == weights.len() && group > 0 && fits(group) {
        return Ok(group);
    }
    Err(Error::new(format!(
        "its weights {} with group {group} do not fit its input {}",
        shape_text(weights),
        shape_text(image)
    )))
}

/// Checks that the bias, if there is one, has a number for each filter.
pub fn check_bias(site: &Site<'_>, filters: usize) -> Result<()> {
    if site.optional(2).is_none() || site.shape(2)? == [filters] {
        return Ok(());
    }
    let found = shape_text(site.shape(2)?);
    Err(Error::new(format!("its bias has the shape {found}, but there are {filters} filters")))
}

fn infer(site: &Site<'_>) -> Result<Vec<Fact>> {
    let (window, _) = window(site)?;
    let filters = site.shape(1)?[0];
    check_bias(site, filters)?;
    let shape = [site.shape(0)?[0], filters].into_iter().chain(window.output).collect();
    Ok(vec![Fact::new(site.fact(0)?.element, shape)])
}

fn evaluate(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    Ok(vec![convolve(site, given(inputs, 0)?, given(inputs, 1)?, optional(inputs, 2))?])
}

/// The convolution of an image with weights, with a number for each filter that is added.
pub fn convolve(site: &Site<'_>, image: &Tensor, weights: &Tensor, bias: Option<&Tensor>) -> Result<Tensor> {
    let (window, group) = window_over(site, &image.shape, &weights.shape)?;
    let (channels, filters, depth) = (image.shape[1], weights.shape[0], weights.shape[1]);
    let shape: Vec<_> = [image.shape[0], filters].into_iter().chain(window.output.iter().copied()).collect();
    let mut result = Tensor::filled(image.element, &shape, 0.0)?;
    if bias.is_some_and(|bias| bias.values.len() != filters) {
        return Err(Error::new(format!("its bias does not have a number for each of the {filters} filters")));
    }
    let (input, output): (usize, usize) = (window.input.iter().product(), window.output.iter().product());
    let pairs = window.pairs();
    for (n, planes) in result.values.chunks_mut((filters * output).max(1)).enumerate() {
        for (filter, plane) in planes.chunks_mut(output.max(1)).enumerate() {
            plane.fill(bias.map_or(0.0, |bias| bias.values[filter]));
            for channel in 0..depth {
                let source = n * channels + filter / (filters / group) * depth + channel;
                let source = &image.values[source * input..][..input];
                let kernel = &weights.values[(filter * depth + channel) * pairs.len()..];
                for (weight, joined) in kernel.iter().zip(&pairs) {
                    for &(to, from) in joined {
                        plane[to] += weight * source[from];
                    }
                }
            }
        }
    }
    Ok(result)
}

fn gradient(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let (window, group) = window(site)?;
    let mut parts = Vec::new();
    if b.wants(site, 0) {
        parts.push((0, b.conv_transpose(g, site.input(1)?, &window, group)?));
    }
    if b.wants(site, 1) {
        parts.push((1, of_weights(b, site.input(0)?, g, &window, group)?));
    }
    if b.wants(site, 2) {
        parts.push((2, of_bias(b, g)?));
    }
    Ok(parts)
}

/// The gradient of the weights that lead from `image` to something whose gradient is `g`. Each weight joins an element of `image` to
/// one of `g` for each place of the window, so this is a convolution whose window is all of `g`: strides and dilations change their roles, and
/// so do batch and channels.
pub fn of_weights(b: &mut Builder, image: &str, g: &str, window: &Window, group: usize) -> Result<String> {
    let shape = b.shape(image)?;
    let (batch, depth) = (shape[0], shape[1] / group);
    let spatial = || 2..shape.len();
    // [batch, group, depth, ...] becomes [depth, group * batch, ...].
    let parted: Vec<_> = [batch, group, depth].into_iter().chain(shape[2..].iter().copied()).collect();
    let image = b.reshape(image, &parted)?;
    let order: Vec<_> = [2, 1, 0].into_iter().chain(spatial().map(|axis| axis + 1)).collect();
    let image = b.transpose(&image, &order)?;
    let joined: Vec<_> = [depth, group * batch].into_iter().chain(shape[2..].iter().copied()).collect();
    let image = b.reshape(&image, &joined)?;
    let exchange: Vec<_> = [1, 0].into_iter().chain(spatial()).collect();
    let g = b.transpose(g, &exchange)?;
    let over = Window {
        output: window.kernel.clone(),
        kernel: window.output.clone(),
        strides: window.dilations.clone(),
        dilations: window.strides.clone(),
        ..window.clone()
    };
    let weights = b.conv(&image, &g, &over, group)?;
    b.transpose(&weights, &exchange)
}

/// The gradient of a number for each channel that is added to something whose gradient is `g`.
pub fn of_bias(b: &mut Builder, g: &str) -> Result<String> {
    let shape = b.shape(g)?;
    let axes: Vec<_> = (0..shape.len()).filter(|&axis| axis != 1).collect();
    let sum = b.sum(g, &axes)?;
    b.reshape(&sum, &[shape[1]])
}

#[cfg(test)]
mod tests {
    use crate::testing::check;

    #[test]
    fn gradients_are_right_for_every_kind_of_window() {
        for case in [
            "conv",
            "conv/groups",
            "conv/strides",
            "conv/dilations",
            "conv/same",
            "conv/one_axis",
            "conv/three_axes",
        ] {
            check(case);
        }
    }
}
