//! Quantised networks against the rules of their operators, with and without vector instructions.

use super::lanes::{Level, limited};
use super::*;
use crate::tensor::{Element, Tensor};
use crate::testing::Setting::{Int, Ints};
use crate::testing::{Setting, Sketch, numbers};

/// Whole numbers of a type, of which some are its least and its greatest one.
fn integers(element: Element, shape: &[usize], seed: u64) -> Tensor {
    let (low, high) = if element == Element::UINT8 { (0.0, 255.0) } else { (-128.0, 127.0) };
    let drawn = numbers(seed, shape.iter().product());
    let values =
        drawn.iter().map(|value| (low + (value * 0.6 + 0.5) * (high - low)).round().clamp(low, high));
    Tensor { element, shape: shape.to_vec(), values: values.collect() }
}

fn floats(values: &[f64], shape: &[usize]) -> Tensor {
    Tensor::floats(shape, values.iter().map(|&value| f64::from(value as f32)).collect())
}

/// What a program computes of `x` on each kind of processor, how many steps it has, and what the rules compute.
fn each(s: &Sketch, shape: &[usize]) -> (Vec<f32>, usize, Vec<f32>) {
    let x: Vec<f32> = numbers(9, shape.iter().product()).iter().map(|&x| x as f32).collect();
    let graph = Graph::new(s.model(&["y"])).unwrap();
    let tensor = Tensor::floats(shape, x.iter().map(|&x| f64::from(x)).collect());
    let expected = graph.evaluate(&[("x", &tensor)], &["y"]).unwrap().swap_remove(0);
    // Weights are packed for a kind of processor too.
    let run = |level: Level| {
        limited(level, || {
            let mut program = Program::new(graph.clone()).unwrap();
            let mut outputs = [Vec::new()];
            program.run(std::slice::from_ref(&x), &mut outputs).unwrap();
            let first = outputs.clone();
            // Memory is used again.
            program.run(std::slice::from_ref(&x), &mut outputs).unwrap();
            assert_eq!(outputs, first, "{level:?}");
            let [output] = outputs;
            (output, program.steps.len())
        })
    };
    let (found, steps) = run(Level::Vnni);
    for level in [Level::Portable, Level::Avx, Level::Avx512] {
        assert_eq!(run(level).0, found, "{level:?}");
    }
    assert_eq!(found.len(), expected.values.len());
    (found, steps, expected.values.iter().map(|&value| value as f32).collect())
}

/// Adds `QuantizeLinear` from `x` to `q`, and returns the names of its scale and its zero point.
fn quantize(s: &mut Sketch, element: Element) -> [String; 2] {
    let zero = if element == Element::UINT8 { 119.0 } else { -7.0 };
    let scale = s.weights("x scale", floats(&[1.0 / 120.0], &[]));
    let zero = s.weights("x zero", Tensor { element, shape: Vec::new(), values: vec![zero] });
    s.node("QuantizeLinear", &["x", &scale, &zero], "q", &[]);
    [scale, zero]
}

const TYPES: [Element; 2] = [Element::UINT8, Element::INT8];

/// Shapes of images and kernels, with the group and other settings.
type Shapes = (&'static [usize], &'static [usize], i64, &'static [(&'static str, Setting<'static>)]);

const CONVOLUTIONS: &[Shapes] = &[
    (&[1, 3, 17, 29], &[24, 3, 5, 5], 1, &[("strides", Ints(&[2, 2]))]),
    (&[2, 5, 7, 9], &[36, 5, 3, 3], 1, &[("pads", Ints(&[1, 1, 1, 1]))]),
    (&[1, 64, 3, 20], &[64, 64, 3, 3], 1, &[]),
    (&[1, 6, 11, 23], &[6, 1, 3, 3], 6, &[("pads", Ints(&[1, 0, 1, 2])), ("strides", Ints(&[1, 2]))]),
    (&[1, 4, 9, 40], &[2, 4, 3, 3], 1, &[("dilations", Ints(&[2, 2]))]),
    (&[1, 6, 5, 5], &[9, 2, 3, 3], 3, &[]),
    (&[1, 7, 1, 1], &[33, 7, 1, 1], 1, &[]),
    (&[1, 3, 19], &[17, 3, 4], 1, &[]),
    (&[1, 3, 9, 67], &[9, 3, 3, 5], 1, &[("pads", Ints(&[1, 1, 1, 1])), ("strides", Ints(&[2, 2]))]),
];

#[test]
fn quantised_convolutions_are_exact_on_every_processor() {
    for (case, &(image, kernel, group, settings)) in CONVOLUTIONS.iter().enumerate() {
        for (types, per_filter) in [([0, 1], true), ([1, 0], true), ([0, 0], false), ([1, 1], false)] {
            let [x, w] = types.map(|number: usize| TYPES[number]);
            let filters = kernel[0];
            let mut s = Sketch::new(21);
            s.input("x", image);
            let [scale, zero] = quantize(&mut s, x);
            let weights = s.weights("w", integers(w, kernel, case as u64));
            let each = if per_filter { vec![filters] } else { Vec::new() };
            let count: usize = each.iter().product();
            let scales = numbers(4, count).iter().map(|value| 0.002 + 0.001 * value).collect::<Vec<_>>();
            let scales = s.weights("w scale", floats(&scales, &each));
            let zeros = s.weights("w zero", Tensor { shape: each, ..integers(w, &[count], 5) });
            let bias = numbers(6, filters).iter().map(|value| (value * 5e3).round()).collect();
            let bias = s.weights("b", Tensor { element: Element::INT32, shape: vec![filters], values: bias });
            let y_scale = s.weights("y scale", floats(&[0.05], &[1]));
            let y_zero = s.weights("y zero", Tensor { element: x, shape: vec![1], values: vec![10.0] });
            let mut all = settings.to_vec();
            all.push(("group", Int(group)));
            let inputs = ["q", &scale, &zero, &weights, &scales, &zeros, &y_scale, &y_zero, &bias];
            s.node("QLinearConv", &inputs, "c", &all);
            s.node("Cast", &["c"], "y", &[("to", Int(1))]);
            let (found, _, expected) = self::each(&s, image);
            assert_eq!(found, expected, "QLinearConv {case} {types:?}");
            assert!(found.iter().any(|value| *value != found[0]), "QLinearConv {case} {types:?}");

            let mut s = Sketch::new(21);
            s.input("x", image);
            let [_, zero] = quantize(&mut s, x);
            let weights = s.weights("w", integers(w, kernel, case as u64));
            let zeros = s.weights("w zero", integers(w, &[filters], 5));
            s.node("ConvInteger", &["q", &weights, &zero, &zeros], "c", &all);
            s.node("Cast", &["c"], "y", &[("to", Int(1))]);
            let (found, _, expected) = self::each(&s, image);
            assert_eq!(found, expected, "ConvInteger {case} {types:?}");
        }
    }
}

const PRODUCTS: &[[&[usize]; 2]] = &[
    [&[5, 13], &[13, 40]],
    [&[1, 65], &[65, 7]],
    [&[3, 2, 6], &[6, 33]],
    [&[2, 1, 9, 8], &[3, 8, 1]],
    [&[7], &[7, 9]],
    [&[4, 7], &[7]],
];

#[test]
fn quantised_products_are_exact_on_every_processor() {
    for (case, &[left, right]) in PRODUCTS.iter().enumerate() {
        for (types, per_column) in [([0, 1], true), ([1, 0], false), ([0, 0], false), ([1, 1], true)] {
            let [x, w] = types.map(|number: usize| TYPES[number]);
            let columns = if right.len() == 1 { 1 } else { right[right.len() - 1] };
            // Lists of factors would belong to rows there.
            let per_column = per_column && right.len() == 2;
            let each = if per_column { vec![columns] } else { Vec::new() };
            let count: usize = each.iter().product();
            for is_scaled in [true, false] {
                let mut s = Sketch::new(21);
                s.input("x", left);
                let [scale, zero] = quantize(&mut s, x);
                let weights = s.weights("w", integers(w, right, case as u64));
                let scales = numbers(4, count).iter().map(|value| 0.004 + 0.002 * value).collect::<Vec<_>>();
                let scales = s.weights("w scale", floats(&scales, &each));
                let zeros = s.weights("w zero", Tensor { shape: each.clone(), ..integers(w, &[count], 5) });
                let y_scale = s.weights("y scale", floats(&[0.02], &[]));
                let y_zero = s.weights("y zero", Tensor { element: x, shape: Vec::new(), values: vec![3.0] });
                match is_scaled {
                    true => {
                        let inputs = ["q", &scale, &zero, &weights, &scales, &zeros, &y_scale, &y_zero];
                        s.node("QLinearMatMul", &inputs, "p", &[]);
                    }
                    false => s.node("MatMulInteger", &["q", &weights, &zero, &zeros], "p", &[]),
                }
                s.node("Cast", &["p"], "y", &[("to", Int(1))]);
                let (found, _, expected) = self::each(&s, left);
                assert_eq!(found, expected, "{case} {types:?} scaled: {is_scaled}");
            }
        }
    }
}

#[test]
fn products_of_what_is_quantised_while_the_graph_runs_are_exact() {
    let mut s = Sketch::new(21);
    s.input("x", &[9, 9]);
    s.split("DynamicQuantizeLinear", &["x"], &["q", "scale", "zero"], &[]);
    let zero = s.weights("w zero", Tensor { element: Element::UINT8, shape: Vec::new(), values: vec![90.0] });
    s.node("MatMulInteger", &["q", "q", "zero", &zero], "p", &[]);
    s.node("Cast", &["p"], "f", &[("to", Int(1))]);
    s.node("Mul", &["f", "scale"], "y", &[]);
    let (found, _, expected) = each(&s, &[9, 9]);
    assert_eq!(found, expected);
}

#[test]
fn floats_are_quantised_as_the_rules_say() {
    for element in [2, 3, 4, 5].map(Element) {
        for (scales, axis) in
            [(&[0.03][..], 0), (&[0.1, 0.007, 1.0], 1), (&[0.013; 7], -1), (&[0.02, 3.0], 0)]
        {
            let shape: &[usize] = if scales.len() == 1 { &[] } else { &[scales.len()] };
            let (low, high) = element.range().unwrap();
            let zeros = numbers(2, scales.len()).iter().map(|value| (value * 30.0 + 30.0).round()).collect();
            let mut s = Sketch::new(21);
            s.input("x", &[2, 3, 7]);
            let scales = s.weights("scale", floats(scales, shape));
            let zeros = s.weights("zero", Tensor { element, shape: shape.to_vec(), values: zeros });
            s.node("QuantizeLinear", &["x", &scales, &zeros], "q", &[("axis", Int(axis))]);
            s.node("Cast", &["q"], "whole", &[("to", Int(1))]);
            s.node("DequantizeLinear", &["q", &scales, &zeros], "back", &[("axis", Int(axis))]);
            s.node("Concat", &["whole", "back"], "y", &[("axis", Int(0))]);
            let graph = Graph::new(s.model(&["y"])).unwrap();
            let special = [0.0, -0.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, 1e-40, -1e-40];
            let ties = (-6..28).map(|half| half as f32 * 0.5 * 0.03);
            let x: Vec<f32> = special.into_iter().chain(ties).collect();
            let tensor = Tensor::floats(&[2, 3, 7], x.iter().map(|&x| f64::from(x)).collect());
            let expected = graph.evaluate(&[("x", &tensor)], &["y"]).unwrap().swap_remove(0);
            let mut program = Program::new(graph).unwrap();
            for level in [Level::Portable, Level::Avx, Level::Avx512, Level::Vnni] {
                let mut found = [Vec::new()];
                limited(level, || program.run(std::slice::from_ref(&x), &mut found).unwrap());
                let bits = |value: f32| value.to_bits();
                let expected: Vec<u32> = expected.values.iter().map(|&value| bits(value as f32)).collect();
                let found: Vec<u32> = found[0].iter().map(|&value| bits(value)).collect();
                assert_eq!(found, expected, "{element} {axis} {level:?}, from {low} to {high}");
            }
        }
    }
}

/// Between `DequantizeLinear` and `QuantizeLinear`.
#[derive(Clone, Copy, Debug, PartialEq)]
enum End {
    Quantised,
    CutAndQuantised,
    Floats,
}

/// Adds `DequantizeLinear` of constant weights.
fn weights(s: &mut Sketch, shape: &[usize], axis: i64, count: usize) -> String {
    let each = [count];
    let weights = s.weights("w", integers(Element::INT8, shape, 3));
    let scales = numbers(4, count).iter().map(|value| 0.002 + 0.001 * value).collect::<Vec<_>>();
    let scales = s.weights("w scale", floats(&scales, &each));
    let zeros = s.weights("w zero", Tensor::filled(Element::INT8, &each, 0.0).unwrap());
    s.node("DequantizeLinear", &[&weights, &scales, &zeros], "weights", &[("axis", Int(axis))]);
    "weights".into()
}

/// Adds what follows a sum `c`.
fn finish(s: &mut Sketch, end: End) {
    let last = match end {
        End::Floats => return s.node("Identity", &["c"], "y", &[]),
        End::CutAndQuantised => {
            s.node("Relu", &["c"], "r", &[]);
            "r"
        }
        End::Quantised => "c",
    };
    let scale = s.weights("y scale", floats(&[0.01], &[]));
    let zero = s.weights("y zero", Tensor { element: Element::INT8, shape: Vec::new(), values: vec![-20.0] });
    s.node("QuantizeLinear", &[last, &scale, &zero], "d", &[]);
    s.node("Cast", &["d"], "y", &[("to", Int(1))]);
}

/// What is computed in integers differs from what is computed in floats only near ties, by one.
fn compare(s: &Sketch, shape: &[usize], end: End, steps: usize, name: &str) {
    let (found, count, expected) = each(s, shape);
    assert_eq!(count, steps, "{name} {end:?}");
    let pairs = || found.iter().zip(&expected);
    if end == End::Floats {
        let largest = expected.iter().fold(0.0f32, |largest, value| largest.max(value.abs()));
        let far = pairs().fold(0.0f32, |far, (a, b)| far.max((a - b).abs()));
        assert!(far <= 1e-6 * largest, "{name} {end:?}: {far:e} of {largest}");
        return;
    }
    let other = pairs().filter(|(a, b)| a != b).count();
    assert!(pairs().all(|(a, b)| (a - b).abs() <= 1.0), "{name} {end:?}");
    assert!(other * 100 <= found.len(), "{name} {end:?}: {other} of {} differ", found.len());
}

#[test]
fn sums_of_dequantised_integers_are_computed_in_integers() {
    for end in [End::Quantised, End::CutAndQuantised, End::Floats] {
        // `Cast`, or `Identity`, the sum, and `QuantizeLinear` before it.
        let steps = 3;
        for (case, &(image, kernel, group, settings)) in CONVOLUTIONS.iter().enumerate() {
            for has_integer_bias in [true, false] {
                let mut s = Sketch::new(21);
                s.input("x", image);
                let [scale, zero] = quantize(&mut s, Element::UINT8);
                s.node("DequantizeLinear", &["q", &scale, &zero], "f", &[]);
                let weights = weights(&mut s, kernel, 0, kernel[0]);
                let bias = match has_integer_bias {
                    true => {
                        let scale = numbers(4, kernel[0]);
                        let factor = |value: f64| (0.002 + 0.001 * value) / 120.0;
                        let scale: Vec<f64> = scale.into_iter().map(factor).collect();
                        let scale = s.weights("b scale", floats(&scale, &[kernel[0]]));
                        let values =
                            numbers(6, kernel[0]).iter().map(|value| (value * 5e3).round()).collect();
                        let integers = Tensor { element: Element::INT32, shape: vec![kernel[0]], values };
                        let integers = s.weights("b", integers);
                        s.node("DequantizeLinear", &[&integers, &scale], "bias", &[("axis", Int(0))]);
                        "bias".to_owned()
                    }
                    false => s.drawn(&[kernel[0]], -1.0, 1.0),
                };
                let mut all = settings.to_vec();
                all.push(("group", Int(group)));
                s.node("Conv", &["f", &weights, &bias], "c", &all);
                finish(&mut s, end);
                compare(&s, image, end, steps, &format!("convolution {case}"));
            }
        }
        for (case, &[left, right]) in PRODUCTS.iter().enumerate().filter(|(_, [_, right])| right.len() == 2) {
            let mut s = Sketch::new(21);
            s.input("x", left);
            let [scale, zero] = quantize(&mut s, Element::INT8);
            s.node("DequantizeLinear", &["q", &scale, &zero], "f", &[]);
            let weights = weights(&mut s, right, 1, right[1]);
            s.node("MatMul", &["f", &weights], "c", &[]);
            finish(&mut s, end);
            compare(&s, left, end, steps, &format!("product {case}"));
        }
        for is_turned in [0, 1] {
            let mut s = Sketch::new(21);
            s.input("x", &[3, 50]);
            let [scale, zero] = quantize(&mut s, Element::UINT8);
            s.node("DequantizeLinear", &["q", &scale, &zero], "f", &[]);
            let shape: &[usize] = if is_turned == 1 { &[10, 50] } else { &[50, 10] };
            let weights = weights(&mut s, shape, 1 - is_turned, 10);
            let bias = s.drawn(&[10], -1.0, 1.0);
            s.node("Gemm", &["f", &weights, &bias], "c", &[("transB", Int(is_turned))]);
            finish(&mut s, end);
            compare(&s, &[3, 50], end, steps, "Gemm");
        }
        let mut s = Sketch::new(21);
        s.input("x", &[2, 9, 9]);
        let [scale, zero] = quantize(&mut s, Element::UINT8);
        s.node("DequantizeLinear", &["q", &scale, &zero], "f", &[]);
        s.node("MatMul", &["f", "f"], "c", &[]);
        finish(&mut s, end);
        compare(&s, &[2, 9, 9], end, steps, "product with itself");
    }
}

/// A convolution `c` of `x` as quantised integers, and the names of their scale and zero point.
fn convolution() -> (Sketch, [String; 2]) {
    let mut s = Sketch::new(21);
    s.input("x", &[1, 3, 9, 9]);
    let [scale, zero] = quantize(&mut s, Element::UINT8);
    s.node("DequantizeLinear", &["q", &scale, &zero], "f", &[]);
    let weights = weights(&mut s, &[8, 3, 3, 3], 0, 8);
    s.node("Conv", &["f", &weights], "c", &[]);
    (s, [scale, zero])
}

/// A sum that something else needs too stays what it is.
#[test]
fn sums_that_are_used_twice_stay_floats() {
    let (mut s, [scale, zero]) = convolution();
    s.node("QuantizeLinear", &["c", &scale, &zero], "d", &[]);
    s.node("DequantizeLinear", &["d", &scale, &zero], "e", &[]);
    s.node("Sub", &["c", "e"], "y", &[]);
    let (found, steps, expected) = each(&s, &[1, 3, 9, 9]);
    // The quantisation of `x`, the sum, both others, and the difference.
    assert_eq!(steps, 5);
    // Within half a step, or one for a tie, if nothing is saturated; and the sums are those of integers.
    assert!(found.iter().zip(&expected).all(|(a, b)| (a - b).abs() <= 1.1 / 120.0), "{found:?} {expected:?}");
}

#[test]
fn extremes_decide_how_floats_are_quantised_while_the_graph_runs() {
    let special = [f32::NAN, -0.0, 3.0, -7.5, 1e-40];
    for (low, high) in [(-1.0, 2.0), (0.5, 3.0), (-3.0, -0.1), (0.0, 0.0)] {
        for count in 0..special.len() {
            let mut s = Sketch::new(21);
            s.input("x", &[3, 41]);
            s.split("DynamicQuantizeLinear", &["x"], &["q", "scale", "zero"], &[]);
            s.node("Cast", &["q"], "bytes", &[("to", Int(1))]);
            s.node("Cast", &["zero"], "whole zero", &[("to", Int(1))]);
            let one = s.ints(&[1]);
            for name in ["bytes", "scale", "whole zero"] {
                let flat = s.ints(&[-1]);
                s.node(
                    "Reshape",
                    &[name, if name == "bytes" { &flat } else { &one }],
                    &format!("flat {name}"),
                    &[],
                );
            }
            s.node("Concat", &["flat bytes", "flat scale", "flat whole zero"], "y", &[("axis", Int(0))]);
            let mut x: Vec<f32> =
                numbers(7, 123).iter().map(|x| (low + (x * 0.5 + 0.5) * (high - low)) as f32).collect();
            x[50..50 + count].copy_from_slice(&special[..count]);
            let graph = Graph::new(s.model(&["y"])).unwrap();
            let tensor = Tensor::floats(&[3, 41], x.iter().map(|&x| f64::from(x)).collect());
            let expected = graph.evaluate(&[("x", &tensor)], &["y"]).unwrap().swap_remove(0);
            let expected: Vec<f32> = expected.values.iter().map(|&value| value as f32).collect();
            let mut program = Program::new(graph).unwrap();
            for level in [Level::Portable, Level::Avx, Level::Avx512, Level::Vnni] {
                let mut found = [Vec::new()];
                limited(level, || program.run(std::slice::from_ref(&x), &mut found).unwrap());
                assert_eq!(found[0], expected, "{low} to {high}, {count} {level:?}");
            }
        }
    }
}

/// With a negative scale, `Relu` cuts the other end.
#[test]
fn a_cut_before_a_negative_scale_is_kept() {
    let (mut s, _) = convolution();
    s.node("Relu", &["c"], "r", &[]);
    let scale = s.weights("y scale", floats(&[-0.01], &[]));
    let zero = s.weights("y zero", Tensor { element: Element::INT8, shape: Vec::new(), values: vec![20.0] });
    s.node("QuantizeLinear", &["r", &scale, &zero], "d", &[]);
    s.node("Cast", &["d"], "y", &[("to", Int(1))]);
    let (found, _, expected) = each(&s, &[1, 3, 9, 9]);
    assert!(expected.contains(&20.0) && expected.iter().any(|value| *value < 0.0));
    assert!(found.iter().zip(&expected).all(|(a, b)| (a - b).abs() <= 1.0), "{found:?} {expected:?}");
}

/// Zero points that are not integers of 8 bits, and shapes without elements, are left to the rules.
#[test]
fn odd_zero_points_and_empty_shapes_are_computed_as_the_rules_say() {
    for (zero, element) in [(70_000.0, Element::INT32), (0.5, Element::FLOAT), (-300.0, Element::INT32)] {
        let mut s = Sketch::new(21);
        s.input("x", &[4, 5]);
        quantize(&mut s, Element::UINT8);
        let weights = s.weights("w", integers(Element::INT8, &[5, 3], 1));
        let zero = s.weights("odd", Tensor { element, shape: Vec::new(), values: vec![zero] });
        s.node("MatMulInteger", &["q", &weights, &zero], "p", &[]);
        s.node("Cast", &["p"], "y", &[("to", Int(1))]);
        let (found, _, expected) = each(&s, &[4, 5]);
        assert_eq!(found, expected);
    }
    for (kept, right) in [(0, &[5, 3][..]), (4, &[5, 0]), (4, &[5, 3])] {
        let mut s = Sketch::new(21);
        s.input("x", &[4, 5]);
        let [scale, zero] = quantize(&mut s, Element::UINT8);
        let (start, end) = (s.ints(&[0]), s.ints(&[kept]));
        s.node("Slice", &["q", &start, &end], "part", &[]);
        s.node("DequantizeLinear", &["part", &scale, &zero], "f", &[]);
        let weights = weights(&mut s, right, 1, right[1]);
        s.node("MatMul", &["f", &weights], "c", &[]);
        finish(&mut s, End::Quantised);
        let (found, _, expected) = each(&s, &[4, 5]);
        assert_eq!(found, expected, "{kept} {right:?}");
    }
}

/// A product of one number and 1, with what is added to it.
fn with_bias(scale: f64, bias: f64, depth: usize, end: End) -> (Vec<f32>, Vec<f32>) {
    let mut s = Sketch::new(21);
    s.input("x", &[1, depth]);
    let scale = s.weights("scale", floats(&[scale], &[]));
    let zero = s.weights("zero", Tensor { element: Element::UINT8, shape: Vec::new(), values: vec![0.0] });
    s.node("QuantizeLinear", &["x", &scale, &zero], "q", &[]);
    s.node("DequantizeLinear", &["q", &scale, &zero], "f", &[]);
    let ones = s.weights("ones", Tensor::filled(Element::UINT8, &[depth, 1], 255.0).unwrap());
    s.node("DequantizeLinear", &[&ones, &scale, &zero], "weights", &[]);
    let bias = s.weights("bias", floats(&[bias], &[1]));
    s.node("Gemm", &["f", "weights", &bias], "c", &[]);
    finish(&mut s, end);
    let (found, _, expected) = each(&s, &[1, depth]);
    (found, expected)
}

#[test]
fn what_is_added_keeps_its_fraction_and_no_sum_wraps() {
    for bias in [0.4, -0.4, 1.0, 1000.0] {
        for (scale, depth) in [(1.0, 3), (1e-3, 20_000), (1e-3, 33_100)] {
            for end in [End::Floats, End::Quantised, End::CutAndQuantised] {
                let (found, expected) = with_bias(scale, bias, depth, end);
                let far = (found[0] - expected[0]).abs();
                // Sums that might wrap are left to floats.
                let relative = if depth > 3 { 1e-3 } else { 1e-6 };
                let tolerance = if end == End::Floats { relative * expected[0].abs() } else { 1.0 };
                assert!(far <= tolerance, "{bias} {scale} {depth} {end:?}: {found:?} {expected:?}");
            }
        }
    }
}

#[test]
fn biases_of_a_wrong_length_are_refused() {
    let mut s = Sketch::new(21);
    s.input("x", &[1, 3, 9, 9]);
    let [scale, zero] = quantize(&mut s, Element::UINT8);
    let weights = s.weights("w", integers(Element::INT8, &[8, 3, 3, 3], 1));
    let w_zero = s.weights("w zero", Tensor { element: Element::INT8, shape: Vec::new(), values: vec![0.0] });
    let bias = s.weights("b", Tensor { element: Element::INT32, shape: vec![1], values: vec![7.0] });
    let inputs = ["q", &scale, &zero, &weights, &scale, &w_zero, &scale, &zero, &bias];
    s.node("QLinearConv", &inputs, "y", &[]);
    let mut program = Program::new(Graph::new(s.model(&["y"])).unwrap()).unwrap();
    let error = program.run(&[vec![0.0; 243]], &mut [Vec::new()]).unwrap_err().to_string();
    assert!(error.contains("does not have a number for each of the 8 filters"), "{error}");
}

/// Files may declare other shapes than their nodes have.
#[test]
fn matrices_of_a_wrong_rank_are_refused() {
    let mut s = Sketch::new(21);
    s.input("x", &[3, 50]);
    let [scale, zero] = quantize(&mut s, Element::UINT8);
    s.node("DequantizeLinear", &["q", &scale, &zero], "f", &[]);
    let weights = s.weights("w", integers(Element::INT8, &[50], 1));
    let w_zero = s.weights("w zero", Tensor { element: Element::INT8, shape: Vec::new(), values: vec![0.0] });
    s.node("DequantizeLinear", &[&weights, &scale, &w_zero], "g", &[]);
    s.node("Gemm", &["f", "g"], "y", &[("transB", Int(1))]);
    let mut model = s.model(&["y"]);
    let output = &mut model.graph.as_mut().unwrap().output[0];
    *output = crate::proto::ValueInfoProto::tensor("y", Element::FLOAT.0, &[3, 10]);
    let result = Graph::new(model).and_then(Program::new);
    assert!(result.is_err());
}
