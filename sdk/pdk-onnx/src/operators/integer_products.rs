//! `ConvInteger`, `MatMulInteger`, `QLinearConv` and `QLinearMatMul`: convolutions and products of 8-bit integers.

use pdk_sdk::error::{Error, Result};

use super::conv;
use super::inputs::{optional, single};
use super::matmul;
use super::operator::{Operator, Rule, given};
use crate::site::Site;
use crate::tensor::{Element, Tensor, broadcast, shape_text};
use crate::values::Fact;

pub const OPERATORS: &[Operator] = &[
    Operator::new("ConvInteger", infer_conv, evaluate_conv, Rule::Unknown),
    Operator::new("MatMulInteger", infer_matmul, evaluate_matmul, Rule::Unknown),
    Operator::new("QLinearConv", infer_linear_conv, evaluate_linear_conv, Rule::Zero),
    Operator::new("QLinearMatMul", infer_linear_matmul, evaluate_linear_matmul, Rule::Zero),
];

/// Where factors of a stack of matrices belong if they are a list.
#[derive(Clone, Copy)]
enum Line {
    /// To its rows.
    Rows,
    /// To its columns.
    Columns,
}

/// Checks that what goes in at these places are integers of 8 bits.
fn check_bytes(site: &Site<'_>, places: [usize; 2]) -> Result<()> {
    for place in places {
        let element = site.fact(place)?.element;
        if !matches!(element.0, 2 | 3) {
            let place = place + 1;
            return Err(Error::new(format!(
                "its input {place} is {element}, but has to be UINT8 or INT8; quantize it first"
            )));
        }
    }
    Ok(())
}

fn does_not_fit(what: &str, found: &[usize], matrices: &[usize]) -> Error {
    let (found, matrices) = (shape_text(found), shape_text(matrices));
    Error::new(format!("its {what} of the shape {found} does not fit {matrices}"))
}

/// Applies a function to each element and to the factor that belongs to it.
fn along(
    values: &Tensor,
    factors: &Tensor,
    line: Line,
    what: &str,
    f: impl Fn(f64, f64) -> f64,
) -> Result<Tensor> {
    let shape = match (line, factors.shape.as_slice()) {
        (Line::Rows, &[rows]) if values.shape.len() > 1 => vec![rows, 1],
        (_, [1]) => Vec::new(),
        (_, shape) => shape.to_vec(),
    };
    if broadcast(&[&values.shape, &shape]).ok().as_ref() != Some(&values.shape) {
        return Err(does_not_fit(what, &factors.shape, &values.shape));
    }
    let factors = Tensor { element: factors.element, shape, values: factors.values.clone() };
    let mut each = values.values.iter().copied();
    Tensor::from_fn(values.element, &values.shape, |at| {
        f(each.next().unwrap_or_default(), factors.broadcast_at(at))
    })
}

/// Applies a function to each element and to the factor of its channel along the first or second axis.
fn by_channel(
    values: &Tensor,
    factors: &Tensor,
    axis: usize,
    what: &str,
    f: impl Fn(f64, f64) -> f64,
) -> Result<Tensor> {
    let channels = values.shape.get(axis).copied().unwrap_or(0);
    let shared = matches!(factors.shape.as_slice(), [] | [1]);
    if !shared && factors.shape != [channels] {
        return Err(does_not_fit(what, &factors.shape, &values.shape));
    }
    let mut each = values.values.iter().copied();
    Tensor::from_fn(values.element, &values.shape, |at| {
        f(each.next().unwrap_or_default(), factors.values[if shared { 0 } else { at[axis] }])
    })
}

/// The convolution of centred integers, in 32 bits.
fn sums(
    site: &Site<'_>,
    [image, weights]: [&Tensor; 2],
    [image_zero, weights_zero]: [Option<&Tensor>; 2],
    bias: Option<&Tensor>,
) -> Result<Tensor> {
    let zero = image_zero.map_or(Ok(0.0), |zero| single(zero, "zero point"))?;
    let image = Tensor { values: image.values.iter().map(|x| x - zero).collect(), ..image.clone() };
    let weights = match weights_zero {
        Some(zeros) => by_channel(weights, zeros, 0, "zero point", |w, zero| w - zero)?,
        None => weights.clone(),
    };
    let sums = conv::convolve(site, &image, &weights, bias)?;
    Ok(Tensor { element: Element::INT32, ..sums }.rounded())
}

/// The products of centred matrices, in 32 bits.
fn products([a, b]: [&Tensor; 2], [a_zero, b_zero]: [Option<&Tensor>; 2]) -> Result<Tensor> {
    let centred = |matrix: &Tensor, zeros: Option<&Tensor>, line| match zeros {
        Some(zeros) => along(matrix, zeros, line, "zero point", |value, zero| value - zero),
        None => Ok(matrix.clone()),
    };
    let (a, b) = (centred(a, a_zero, Line::Rows)?, centred(b, b_zero, Line::Columns)?);
    matmul::multiply(&Tensor { element: Element::INT32, ..a }, &Tensor { element: Element::INT32, ..b })
}

fn convolved_shape(site: &Site<'_>, image: usize, weights: usize) -> Result<Vec<usize>> {
    let (image, weights) = (site.shape(image)?, site.shape(weights)?);
    let (window, _) = conv::window_over(site, image, weights)?;
    Ok([image[0], weights[0]].into_iter().chain(window.output).collect())
}

fn infer_conv(site: &Site<'_>) -> Result<Vec<Fact>> {
    check_bytes(site, [0, 1])?;
    Ok(vec![Fact::new(Element::INT32, convolved_shape(site, 0, 1)?)])
}

fn evaluate_conv(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let zeros = [optional(inputs, 2), optional(inputs, 3)];
    Ok(vec![sums(site, [given(inputs, 0)?, given(inputs, 1)?], zeros, None)?])
}

fn infer_matmul(site: &Site<'_>) -> Result<Vec<Fact>> {
    check_bytes(site, [0, 1])?;
    Ok(vec![Fact::new(Element::INT32, matmul::result_shape(site.shape(0)?, site.shape(1)?)?)])
}

fn evaluate_matmul(_: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let (a, b) = (given(inputs, 0)?, given(inputs, 1)?);
    let product = products([a, b], [optional(inputs, 2), optional(inputs, 3)])?;
    Ok(vec![Tensor { shape: matmul::result_shape(&a.shape, &b.shape)?, ..product }])
}

/// The type of an operator that quantizes what it computes, whose zero point is input 8.
fn quantized(site: &Site<'_>) -> Result<Element> {
    check_bytes(site, [0, 3])?;
    check_bytes(site, [7, 7])?;
    Ok(site.fact(7)?.element)
}

fn infer_linear_conv(site: &Site<'_>) -> Result<Vec<Fact>> {
    Ok(vec![Fact::new(quantized(site)?, convolved_shape(site, 0, 3)?)])
}

/// A sum as a small integer. Runtimes compute with 32-bit floats here, which decides at a tie.
fn requantize(sum: f64, factor: f64, zero: f64, element: Element) -> f64 {
    let scaled = f64::from(sum as f32 * factor as f32).round_ties_even();
    element.saturated(scaled + zero)
}

fn evaluate_linear_conv(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let [image, weights, zeros] = [given(inputs, 0)?, given(inputs, 3)?, given(inputs, 7)?];
    let sums = sums(site, [image, weights], [optional(inputs, 2), optional(inputs, 5)], optional(inputs, 8))?;
    let x_scale = single(given(inputs, 1)?, "factor")? as f32;
    let y_scale = single(given(inputs, 6)?, "factor")? as f32;
    let (element, zero) = (zeros.element, single(zeros, "zero point")?);
    let result = by_channel(&sums, given(inputs, 4)?, 1, "factor", |sum, scale| {
        requantize(sum, f64::from(x_scale * scale as f32 / y_scale), zero, element)
    })?;
    Ok(vec![Tensor { element, ..result }])
}

fn infer_linear_matmul(site: &Site<'_>) -> Result<Vec<Fact>> {
    Ok(vec![Fact::new(quantized(site)?, matmul::result_shape(site.shape(0)?, site.shape(3)?)?)])
}

fn evaluate_linear_matmul(_: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let [a, b, zeros] = [given(inputs, 0)?, given(inputs, 3)?, given(inputs, 7)?];
    let sums = products([a, b], [optional(inputs, 2), optional(inputs, 5)])?;
    let ones = Tensor::filled(Element::FLOAT, &sums.shape, 1.0)?;
    let times = |a: f64, b: f64| f64::from(a as f32 * b as f32);
    let factors = along(&ones, given(inputs, 1)?, Line::Rows, "factor", times)?;
    let factors = along(&factors, given(inputs, 4)?, Line::Columns, "factor", times)?;
    let factors = along(&factors, given(inputs, 6)?, Line::Rows, "factor", |factor, scale| {
        f64::from(factor as f32 / scale as f32)
    })?;
    let nothing = Tensor::filled(Element::FLOAT, &sums.shape, 0.0)?;
    let offsets = along(&nothing, zeros, Line::Rows, "zero point", |_, zero| zero)?;
    let numbers = sums.values.iter().zip(&factors.values).zip(&offsets.values);
    let values =
        numbers.map(|((&sum, &factor), &zero)| requantize(sum, factor, zero, zeros.element)).collect();
    Ok(vec![Tensor { element: zeros.element, shape: matmul::result_shape(&a.shape, &b.shape)?, values }])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::computed;

    const BYTE: Element = Element::UINT8;

    /// What an operator computes from constants, each of one number throughout.
    fn of_constants(operator: &str, inputs: &[(Element, &[usize], f64)]) -> Result<Tensor> {
        computed(21, |s| {
            let names = inputs.iter().enumerate().map(|(place, &(element, shape, value))| {
                s.weights(&format!("w{place}"), Tensor::filled(element, shape, value).unwrap())
            });
            let names: Vec<String> = names.collect();
            let names: Vec<&str> = names.iter().map(String::as_str).collect();
            s.node(operator, &names, "y", &[]);
        })
    }

    #[test]
    fn zero_points_are_taken_off_and_results_saturate() {
        let (f, i) = (Element::FLOAT, Element::INT8);
        let found = of_constants(
            "MatMulInteger",
            &[(BYTE, &[2, 3], 5.0), (i, &[3, 4], -7.0), (BYTE, &[2], 3.0), (i, &[4], 1.0)],
        );
        assert_eq!(found.unwrap(), Tensor::filled(Element::INT32, &[2, 4], -48.0).unwrap());
        let found = of_constants("MatMulInteger", &[(BYTE, &[3], 5.0), (BYTE, &[3], 2.0)]).unwrap();
        assert_eq!(found, Tensor { element: Element::INT32, shape: Vec::new(), values: vec![30.0] });
        let found = of_constants(
            "ConvInteger",
            &[(BYTE, &[1, 1, 3], 255.0), (BYTE, &[2, 1, 3], 255.0), (BYTE, &[], 1.0), (BYTE, &[2], 1.0)],
        );
        assert_eq!(found.unwrap().values, [193548.0; 2]);
        let linear = |value: f64, bias: f64| {
            of_constants(
                "QLinearConv",
                &[
                    (BYTE, &[1, 1, 1], value),
                    (f, &[], 0.5),
                    (BYTE, &[], 0.0),
                    (i, &[2, 1, 1], 1.0),
                    (f, &[2], 1.0),
                    (i, &[2], 0.0),
                    (f, &[], 1.0),
                    (BYTE, &[], 10.0),
                    (Element::INT32, &[2], bias),
                ],
            )
        };
        // 5 halves lie between 2 and 3, of which 2 is even.
        assert_eq!(linear(5.0, 0.0).unwrap().values, [12.0; 2]);
        assert_eq!(linear(5.0, 1e6).unwrap().values, [255.0; 2]);
        assert_eq!(linear(5.0, -1e6).unwrap().values, [0.0; 2]);
    }

    #[test]
    fn shapes_and_types_that_do_not_fit_are_refused() {
        let error = |operator, inputs: &[_]| of_constants(operator, inputs).unwrap_err().to_string();
        let (x, w): ((_, &[usize], _), (_, &[usize], _)) = ((BYTE, &[1, 1, 3], 1.0), (BYTE, &[2, 1, 3], 1.0));
        assert!(error("ConvInteger", &[(Element::FLOAT, &[1, 1, 3], 1.0), w]).contains("is FLOAT"));
        assert!(error("ConvInteger", &[(BYTE, &[], 1.0), w]).contains("do not fit its input ()"));
        assert!(error("ConvInteger", &[x]).contains("its input 2 is missing"));
        assert!(error("ConvInteger", &[x, w, (BYTE, &[2], 1.0)]).contains("has to be one number"));
        assert!(error("ConvInteger", &[x, w, (BYTE, &[], 1.0), (BYTE, &[3], 1.0)]).contains("zero point"));
        let (a, b): ((_, &[usize], _), (_, &[usize], _)) = ((BYTE, &[2, 3], 1.0), (BYTE, &[3, 4], 1.0));
        assert!(error("MatMulInteger", &[a, a]).contains("do not go together"));
        assert!(error("MatMulInteger", &[a, (BYTE, &[], 1.0)]).contains("do not go together"));
        assert!(error("MatMulInteger", &[a, b, (BYTE, &[5], 1.0)]).contains("zero point"));
        assert!(error("MatMulInteger", &[a, b, (BYTE, &[0], 1.0)]).contains("zero point"));
        assert!(error("MatMulInteger", &[a, b, (BYTE, &[1, 1, 1, 1], 1.0)]).contains("zero point"));
        assert!(error("QLinearMatMul", &[a, (Element::FLOAT, &[], 1.0)]).contains("its input 4 is missing"));
        assert!(error("QLinearConv", &[x, x, x, w]).contains("its input 8 is missing"));
    }
}
