//! Programs against the rules of operators in 64-bit floats.

use super::*;
use crate::tensor::Tensor;
use crate::testing::{CASES, OPSETS, Setting, Sketch};

#[test]
fn programs_compute_what_the_rules_say() {
    for case in CASES {
        for opset in OPSETS.into_iter().filter(|opset| case.opsets.contains(opset)) {
            let graph = Graph::new(case.model(opset)).unwrap();
            let x = case.x();
            let expected = graph.evaluate(&[("x", &x)], &["target"]).unwrap().swap_remove(0);
            let mut program = Program::new(graph).unwrap_or_else(|error| panic!("{}: {error}", case.name));
            let input: Vec<f32> = x.values.iter().map(|&value| value as f32).collect();
            let mut outputs = vec![Vec::new()];
            for _ in 0..2 {
                program.run(std::slice::from_ref(&input), &mut outputs).unwrap();
                let (found, expected) = (f64::from(outputs[0][0]), expected.values[0]);
                assert!(
                    (found - expected).abs() < 1e-5 * (1.0 + expected.abs()),
                    "{} {opset}: {found} {expected}",
                    case.name
                );
            }
        }
    }
}

/// What a program computes of `x`, and what the rules compute, as 32-bit floats.
fn both(sketch: &Sketch, x: &Tensor) -> [Vec<f32>; 2] {
    let single = |values: &[f64]| -> Vec<f32> { values.iter().map(|&value| value as f32).collect() };
    let graph = Graph::new(sketch.model(&["y"])).unwrap();
    let expected = graph.evaluate(&[("x", x)], &["y"]).unwrap().swap_remove(0);
    let mut outputs = vec![Vec::new()];
    Program::new(graph).unwrap().run(&[single(&x.values)], &mut outputs).unwrap();
    [outputs.swap_remove(0), single(&expected.values)]
}

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|value| if value.is_nan() { f32::NAN } else { *value }.to_bits()).collect()
}

#[test]
fn programs_round_to_each_type_as_the_rules_do() {
    let x = Tensor::floats(&[6], vec![1000.25, -3.5, 0.1, 70000.0, -1e-9, 255.75]);
    for number in [1, 2, 3, 4, 5, 6, 7, 10, 12, 13, 16, 17, 18, 19, 20, 21, 22] {
        for operator in ["Add", "Mul", "ReduceProd", "CumSum", "Neg", "Identity"] {
            let mut s = Sketch::new(13);
            s.input("x", &[6]);
            s.node("Cast", &["x"], "c", &[("to", Setting::Int(number))]);
            match operator {
                "Add" | "Mul" => s.node(operator, &["c", "c"], "r", &[]),
                "CumSum" => {
                    let axis = s.ints(&[0]);
                    s.node(operator, &["c", &axis], "r", &[]);
                }
                _ => s.node(operator, &["c"], "r", &[]),
            }
            s.node("Cast", &["r"], "y", &[("to", Setting::Int(1))]);
            let [found, expected] = both(&s, &x);
            let same = |(found, expected): (&f32, &f32)| {
                bits(&[*found]) == bits(&[*expected]) || (found - expected).abs() <= 1e-6 * expected.abs()
            };
            let all = found.iter().zip(&expected).all(same);
            assert!(all, "{operator} of {}: {found:?} {expected:?}", Element(number as i32));
        }
    }
}

#[test]
fn programs_choose_zeros_and_what_is_not_a_number_as_the_rules_do() {
    let special =
        [0.0, -0.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1.5, -1.5, 0.375, -0.375, 0.625, -0.625];
    let x = Tensor::floats(&[1, 1, special.len()], special.to_vec());
    let unary = ["Relu", "LeakyRelu", "Neg", "Abs", "Sqrt", "Round", "Floor", "Ceil", "Reciprocal"];
    let paired = ["Max", "Min", "Add", "Sub", "Mul", "Div"];
    for operator in unary.into_iter().chain(paired).chain(["Clip", "MaxPool"]) {
        for shift in 0..special.len() {
            let mut s = Sketch::new(13);
            s.input("x", &x.shape);
            let number =
                |s: &mut Sketch, name: &str, value| s.weights(name, Tensor::floats(&[], vec![value]));
            if paired.contains(&operator) {
                let mut turned = special.to_vec();
                turned.rotate_left(shift);
                let other = s.weights("other", Tensor::floats(&x.shape, turned));
                s.node(operator, &["x", &other], "y", &[]);
            } else if operator == "Clip" {
                let bounds = [number(&mut s, "low", 0.0), number(&mut s, "high", special[shift])];
                s.node(operator, &["x", &bounds[0], &bounds[1]], "y", &[]);
            } else if operator == "MaxPool" {
                s.node(operator, &["x"], "y", &[("kernel_shape", Setting::Ints(&[3]))]);
            } else {
                s.node(operator, &["x"], "y", &[]);
            }
            let [found, expected] = both(&s, &x);
            assert_eq!(bits(&found), bits(&expected), "{operator} {shift}: {found:?} {expected:?}");
        }
    }
}

#[test]
fn rectifiers_and_bounds_keep_what_is_not_a_number() {
    let x = Tensor::floats(&[4], vec![f64::NAN, -0.0, -2.0, 2.0]);
    for (operator, expected) in [
        ("Relu", [0.0, 0.0, 2.0]),
        ("Clip", [-0.0, -1.0, 1.0]),
        ("Celu", [0.0, f64::from(-0.864_664_7f32), 2.0]),
    ] {
        let mut s = Sketch::new(13);
        s.input("x", &[4]);
        let bounds = [("low", -1.0), ("high", 1.0)]
            .map(|(name, value)| s.weights(name, Tensor::floats(&[], vec![value])));
        match operator {
            "Clip" => s.node("Clip", &["x", &bounds[0], &bounds[1]], "y", &[]),
            _ => s.node(operator, &["x"], "y", &[]),
        }
        for found in both(&s, &x) {
            assert!(found[0].is_nan(), "{operator}: {found:?}");
            assert_eq!(bits(&found[1..2]), bits(&[expected[0] as f32]), "{operator}: {found:?}");
            let near = |(found, expected): (&f32, &f64)| (f64::from(*found) - expected).abs() < 1e-6;
            assert!(found[1..].iter().zip(&expected).all(near), "{operator}: {found:?}");
        }
    }
}

/// The shape of `x`, and what adds the nodes.
type Movement = (&'static [usize], fn(&mut Sketch));

#[test]
fn elements_are_moved_as_the_rules_move_them() {
    let movements: [Movement; 4] = [
        (&[2, 3], |s| {
            let condition = Tensor { element: Element::BOOL, ..Tensor::ints(&[1, 0, 1]) };
            let condition = s.weights("condition", condition);
            s.node("Compress", &["x", &condition], "y", &[("axis", Setting::Int(1))]);
        }),
        (&[2], |s| {
            let (indices, depth) = (s.ints(&[2, -1, 9]), s.ints(&[4]));
            s.node("OneHot", &[&indices, &depth, "x"], "y", &[]);
        }),
        (&[1, 1, 2, 2], |s| {
            let places = Tensor { shape: vec![1, 1, 2, 2], ..Tensor::ints(&[0, 3, 9, 12]) };
            let places = s.weights("places", places);
            s.node(
                "MaxUnpool",
                &["x", &places],
                "y",
                &[("kernel_shape", Setting::Ints(&[2, 2])), ("strides", Setting::Ints(&[2, 2]))],
            );
        }),
        (&[2, 3], |s| {
            let places = Tensor { shape: vec![1, 3], ..Tensor::ints(&[1, 0, -1]) };
            let places = s.weights("places", places);
            let updates = s.drawn(&[1, 3], -1.0, 1.0);
            s.node("ScatterElements", &["x", &places, &updates], "y", &[]);
        }),
    ];
    for (shape, build) in movements {
        let mut s = Sketch::new(13);
        s.input("x", shape);
        build(&mut s);
        let x = Tensor::floats(shape, (0..shape.iter().product()).map(|at: usize| at as f64 - 1.5).collect());
        let [found, expected] = both(&s, &x);
        assert_eq!(found, expected, "{shape:?}");
    }
}

/// `Relu` behind a sum gives the same bits whether it is a step of its own, as where the sum is an output too, or not.
#[test]
fn relu_is_computed_with_the_sum_before_it() {
    // What is multiplied, its weights, and the number of those that are added.
    let sums: [(&str, &[usize], &[usize], usize); 6] = [
        ("Conv", &[1, 3, 20, 60], &[24, 3, 5, 5], 24),
        ("Conv", &[1, 3, 20, 40], &[2, 3, 3, 3], 2),
        ("Conv", &[2, 4, 5, 6], &[33, 4, 3, 3], 33),
        ("ConvTranspose", &[1, 4, 9, 12], &[4, 5, 3, 3], 5),
        ("Gemm", &[3, 40], &[40, 21], 21),
        ("Gemm", &[1, 40], &[40, 100], 1),
    ];
    for (operator, shape, weights, addends) in sums {
        let tensor = |seed, shape: &[usize]| {
            Tensor::floats(shape, crate::testing::numbers(seed, shape.iter().product()))
        };
        let program = |outputs: &[&str]| {
            let mut s = Sketch::new(13);
            s.input("x", shape);
            let parts = [s.weights("w", tensor(1, weights)), s.weights("b", tensor(2, &[addends]))];
            let attributes: &[_] = if addends == 1 { &[("alpha", Setting::Float(-0.5))] } else { &[] };
            s.node(operator, &["x", &parts[0], &parts[1]], "sum", attributes);
            s.node("Relu", &["sum"], "y", &[]);
            Program::new(Graph::new(s.model(outputs)).unwrap()).unwrap()
        };
        let x: Vec<f32> = tensor(3, shape).values.iter().map(|&value| value as f32).collect();
        let (mut together, mut apart) = (program(&["y"]), program(&["y", "sum"]));
        assert_eq!([together.steps.len(), apart.steps.len()], [1, 2], "{operator}");
        let (mut one, mut two) = (vec![Vec::new()], vec![Vec::new(); 2]);
        together.run(std::slice::from_ref(&x), &mut one).unwrap();
        apart.run(&[x], &mut two).unwrap();
        assert!(two[1].iter().any(|sum| *sum < 0.0) && two[0].iter().any(|sum| *sum > 0.0), "{operator}");
        assert_eq!(bits(&one[0]), bits(&two[0]), "{operator} of {shape:?}");
    }
}
