//! `ConvTranspose`: its gradient is a convolution with the same weights. That of the weights is one of the gradient with its input.

use pdk_sdk::error::Result;

use super::conv;
use super::inputs::optional;
use super::operator::{Operator, Parts, Rule, given};
use crate::builder::Builder;
use crate::site::Site;
use crate::tensor::Tensor;
use crate::values::Fact;
use crate::window::Window;

pub const OPERATORS: &[Operator] = &[Operator::new("ConvTranspose", infer, evaluate, Rule::First(gradient))];

/// The window of the convolution that this one reverses, and the number of groups.
pub fn window(site: &Site<'_>) -> Result<(Window, usize)> {
    let (image, weights) = (site.shape(0)?, site.shape(1)?);
    let group = conv::group(site, image, weights, |group| weights[0] == image[1] && image[1] % group == 0)?;
    Ok((Window::under(site, &image[2..], &weights[2..])?, group))
}

fn infer(site: &Site<'_>) -> Result<Vec<Fact>> {
    let (window, group) = window(site)?;
    let filters = site.shape(1)?[1].saturating_mul(group);
    conv::check_bias(site, filters)?;
    let shape = [site.shape(0)?[0], filters].into_iter().chain(window.input).collect();
    Ok(vec![Fact::new(site.fact(0)?.element, shape)])
}

fn evaluate(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let (window, group) = window(site)?;
    let (image, weights) = (given(inputs, 0)?, given(inputs, 1)?);
    let mut result = Tensor::filled(image.element, site.output_shape()?, 0.0)?;
    let (input, output): (usize, usize) = (window.output.iter().product(), window.input.iter().product());
    let (channels, depth) = (image.shape[1], weights.shape[1]);
    let pairs = window.pairs();
    for (n, planes) in result.values.chunks_mut((depth * group * output).max(1)).enumerate() {
        for (filter, plane) in planes.chunks_mut(output.max(1)).enumerate() {
            plane.fill(optional(inputs, 2).map_or(0.0, |bias| bias.values[filter]));
            let (in_group, place) = (channels / group, filter % depth);
            for channel in filter / depth * in_group..(filter / depth + 1) * in_group {
                let source = &image.values[(n * channels + channel) * input..][..input];
                let kernel = &weights.values[(channel * depth + place) * pairs.len()..];
                for (weight, joined) in kernel.iter().zip(&pairs) {
                    for &(from, to) in joined {
                        plane[to] += weight * source[from];
                    }
                }
            }
        }
    }
    Ok(vec![result])
}

fn gradient(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let (window, group) = window(site)?;
    let mut parts = Vec::new();
    if b.wants(site, 0) {
        parts.push((0, b.conv(g, site.input(1)?, &window, group)?));
    }
    if b.wants(site, 1) {
        parts.push((1, conv::of_weights(b, g, site.input(0)?, &window, group)?));
    }
    if b.wants(site, 2) {
        parts.push((2, conv::of_bias(b, g)?));
    }
    Ok(parts)
}

#[cfg(test)]
mod tests {
    use crate::testing::check;

    #[test]
    fn gradients_are_right_for_every_kind_of_window() {
        for case in [
            "conv_transpose",
            "conv_transpose/groups",
            "conv_transpose/strides",
            "conv_transpose/output_shape",
        ] {
            check(case);
        }
    }
}
