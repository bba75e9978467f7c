//! `MaxPool`: its gradient goes to the first of the greatest elements under each place of the window.
//!
//! No operator that all backends have scatters by index. So a convolution with one filter for each element of the kernel
//! spreads the elements under the window out, side by side; the first that equals the maximum takes the gradient; and the
//! reversed convolution puts it back where it belongs.

use pdk_sdk::error::{Error, Result};

use super::operator::{Operator, Parts, Rule, given};
use crate::builder::Builder;
use crate::order::greater;
use crate::site::Site;
use crate::tensor::{Element, Tensor};
use crate::values::Fact;
use crate::window::{Window, lengths};

pub const OPERATORS: &[Operator] = &[Operator::new("MaxPool", infer, evaluate, Rule::First(gradient))];

/// The most pairs of an element of the kernel and a place of the window.
const MOST_PAIRS: usize = 1 << 26;

/// The window of a pool.
pub fn window(site: &Site<'_>) -> Result<Window> {
    let image = site.shape(0)?;
    if image.len() < 3 {
        return Err(Error::new("its input has no spatial axes"));
    }
    let kernel = lengths(site, "kernel_shape", image.len() - 2, 0)?;
    let window = Window::over(site, &image[2..], &kernel)?;
    let places: usize = window.output.iter().product();
    if window.taps().saturating_mul(places) > MOST_PAIRS {
        return Err(Error::new(format!(
            "its window of {} elements at {places} places is too large here",
            window.taps()
        )));
    }
    Ok(window)
}

/// The shape of what a pool computes.
pub fn pooled(site: &Site<'_>, window: &Window) -> Result<Fact> {
    let fact = site.fact(0)?;
    Ok(Fact::new(fact.element, fact.shape[..2].iter().chain(&window.output).copied().collect()))
}

fn infer(site: &Site<'_>) -> Result<Vec<Fact>> {
    let values = pooled(site, &window(site)?)?;
    let places = Fact::new(Element::INT64, values.shape.clone());
    Ok(vec![values, places])
}

fn evaluate(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let window = window(site)?;
    let image = given(inputs, 0)?;
    let fact = pooled(site, &window)?;
    let least = fact.element.saturated(f64::NEG_INFINITY);
    let mut values = Tensor::filled(fact.element, &fact.shape, least)?;
    let (input, output): (usize, usize) = (window.input.iter().product(), window.output.iter().product());
    let with_places = site.node.output.get(1).is_some_and(|name| !name.is_empty());
    if with_places && site.int("storage_order", 0) != 0 {
        return Err(Error::new("it counts the places of the greatest by columns, which is not known here"));
    }
    let mut places = Tensor::filled(Element::INT64, &fact.shape, 0.0)?;
    let planes = values.values.chunks_mut(output.max(1)).zip(places.values.chunks_mut(output.max(1)));
    let pairs = window.pairs();
    for ((number, source), (plane, places)) in image.values.chunks(input.max(1)).enumerate().zip(planes) {
        let mut seen = vec![false; plane.len()];
        for &(to, from) in pairs.iter().flatten() {
            let greatest = greater(plane[to], source[from]);
            // The first of those that are equal.
            if !std::mem::replace(&mut seen[to], true) || greatest > plane[to] {
                places[to] = (number * input + from) as f64;
            }
            plane[to] = greatest;
        }
    }
    Ok(vec![values, places])
}

fn gradient(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let window = window(site)?;
    let fact = pooled(site, &window)?;
    let (batch, channels, taps) = (fact.shape[0], fact.shape[1], window.taps());
    let places: usize = window.output.iter().product();
    let element = fact.element;

    // One filter for each element of the kernel, the same for every channel.
    let mut shape = vec![channels * taps, 1];
    shape.extend(&window.kernel);
    let mut filters = Tensor::filled(element, &shape, 0.0)?;
    for filter in 0..channels * taps {
        filters.values[filter * taps + filter % taps] = 1.0;
    }
    let filters = b.constant(&filters)?;
    let spread = b.conv(site.input(0)?, &filters, &window, channels)?;
    let spread = b.reshape(&spread, &[batch * channels, taps, places])?;
    let maximum = b.reshape(site.output(0)?, &[batch * channels, 1, places])?;
    let below = b.mask("Less", &spread, &maximum)?;
    let mut equal = b.complement(&below)?;

    // The zeros around the image are none of its elements.
    let pairs = window.pairs();
    if pairs.iter().any(|joined| joined.len() < places) {
        let mut inside = Tensor::filled(element, &[1, taps, places], 0.0)?;
        for (tap, joined) in pairs.iter().enumerate() {
            joined.iter().for_each(|(to, _)| inside.values[tap * places + to] = 1.0);
        }
        let inside = b.constant(&inside)?;
        equal = b.mul(&equal, &inside)?;
    }

    // How many before it are equal to the maximum as well.
    let earlier: Vec<Vec<f64>> =
        (0..taps).map(|row| (0..taps).map(|column| f64::from(u8::from(column < row))).collect()).collect();
    let earlier = b.along(&equal, 1, &earlier)?;
    let later = b.above(&earlier, 0.5)?;
    let first = b.complement(&later)?;
    let chosen = b.mul(&equal, &first)?;
    let g = b.reshape(g, &[batch * channels, 1, places])?;
    let parts = b.mul(&chosen, &g)?;
    let mut shape = vec![batch, channels * taps];
    shape.extend(&window.output);
    let parts = b.reshape(&parts, &shape)?;
    Ok(vec![(0, b.conv_transpose(&parts, &filters, &window, channels)?)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gradient::{Target, gradients};
    use crate::graph::Graph;
    use crate::testing::{Setting, Sketch, check};

    #[test]
    fn gradients_are_right_for_every_kind_of_window() {
        for case in [
            "max_pool",
            "max_pool/overlap",
            "max_pool/pads",
            "max_pool/ceil",
            "max_pool/one_axis",
            "max_pool/dilations",
        ] {
            check(case);
        }
    }

    #[test]
    fn of_equal_elements_the_first_takes_the_gradient() {
        let mut sketch = Sketch::new(13);
        sketch.input("x", &[1, 1, 2, 3]);
        sketch.node(
            "MaxPool",
            &["x"],
            "y",
            &[("kernel_shape", Setting::Ints(&[2, 2])), ("pads", Setting::Ints(&[0, 0, 0, 1]))],
        );
        let graph = Graph::new(sketch.model(&["y"])).unwrap();
        // Negative, so that the zeros around the image would win where they counted.
        let x = Tensor::floats(&[1, 1, 2, 3], vec![-1.0, -1.0, -2.0, -1.0, -3.0, -2.0]);
        let mut sums = Vec::new();
        for index in 0..3 {
            let gradients = gradients(&graph, Target { value: "y", index }, &["x"], &[]).unwrap();
            let graph = Graph::new(gradients.model).unwrap();
            sums.push(graph.evaluate(&[("x", &x)], &[&gradients.outputs[0]]).unwrap().swap_remove(0).values);
        }
        assert_eq!(sums[0], [1.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(sums[1], [0.0, 1.0, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(sums[2], [0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
    }
}
