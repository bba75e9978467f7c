//! Graphs of operators that are drawn at random.

use super::Setting::{Float, Int, Ints};
use super::cases::weigh;
use super::{Sketch, numbers};
use crate::graph::Graph;
use crate::proto::ModelProto;

/// Draws.
struct Dice {
    numbers: Vec<f64>,
    next: usize,
}

impl Dice {
    fn below(&mut self, bound: usize) -> usize {
        self.next += 1;
        ((self.numbers[self.next % self.numbers.len()] + 1.0) / 2.0 * bound as f64) as usize % bound
    }
}

/// A graph with the input `x`, an image of two channels, and the output `target`, one number.
///
/// # Panics
/// If the graph is put together wrongly.
pub fn random(seed: u64, opset: i64) -> ModelProto {
    let mut dice = Dice { numbers: numbers(seed + 1, 512), next: 0 };
    let mut sketch = Sketch::new(opset);
    sketch.input("x", &[1, 2, 6, 7]);
    let mut values = vec!["x".to_owned()];
    for step in 0..9 {
        let from = values[values.len() - 1 - dice.below(values.len().min(2))].clone();
        let to = format!("v{step}");
        let shape = match Graph::new(sketch.model(&[])).and_then(|graph| graph.fact(&from).cloned()) {
            Ok(fact) => fact.shape,
            Err(error) => panic!("graph {seed}: {error}"),
        };
        add(&mut sketch, &mut dice, &from, &to, &shape, &values);
        values.push(to);
    }
    // Everything counts, also what no later node took.
    let rows: Vec<String> = values[1..]
        .iter()
        .enumerate()
        .map(|(place, value)| {
            let row = format!("row{place}");
            sketch.node("Flatten", &[value], &row, &[("axis", Int(1))]);
            row
        })
        .collect();
    let rows: Vec<&str> = rows.iter().map(String::as_str).collect();
    sketch.node("Concat", &rows, "y", &[("axis", Int(1))]);
    weigh(sketch, "random")
}

/// Adds one operator that takes an image.
fn add(s: &mut Sketch, dice: &mut Dice, from: &str, to: &str, shape: &[usize], values: &[String]) {
    let [channels, height, width] = [shape[1], shape[2], shape[3]];
    let simple = [
        "Relu",
        "LeakyRelu",
        "Elu",
        "Tanh",
        "Sigmoid",
        "Neg",
        "Abs",
        "Softplus",
        "HardSigmoid",
        "Identity",
        "Dropout",
        "Sin",
    ];
    match dice.below(14) {
        0..=2 => s.node(simple[dice.below(simple.len())], &[from], to, &[]),
        3 => {
            let filters = 1 + dice.below(3);
            let kernel = [1 + dice.below(height.min(3)), 1 + dice.below(width.min(3))];
            let weights = s.drawn(&[filters, channels, kernel[0], kernel[1]], -1.0, 1.0);
            let pads =
                [dice.below(2) as i64, dice.below(2) as i64, dice.below(2) as i64, dice.below(2) as i64];
            let strides = [1 + dice.below(2) as i64, 1 + dice.below(2) as i64];
            s.node("Conv", &[from, &weights], to, &[("pads", Ints(&pads)), ("strides", Ints(&strides))]);
        }
        4 => {
            let weights = s.drawn(&[channels, 2, 2, 2], -0.5, 0.5);
            s.node("ConvTranspose", &[from, &weights], to, &[]);
        }
        5 => {
            let kernel = [1 + dice.below(height.min(2)) as i64, 1 + dice.below(width.min(3)) as i64];
            let operator = if dice.below(2) == 0 { "MaxPool" } else { "AveragePool" };
            s.node(operator, &[from], to, &[("kernel_shape", Ints(&kernel))]);
        }
        6 => {
            let weights: Vec<_> = (0..4).map(|_| s.drawn(&[channels], 0.5, 1.5)).collect();
            s.node(
                "BatchNormalization",
                &[from, &weights[0], &weights[1], &weights[2], &weights[3]],
                to,
                &[("epsilon", Float(0.01))],
            );
        }
        7 => {
            // A value of another shape takes part by its mean.
            let other = &values[dice.below(values.len())];
            let mean = format!("{to}_mean");
            s.with_ints(18, "ReduceMean", other, &mean, ("axes", &[1, 2, 3]), &[]);
            s.node(["Add", "Sub", "Mul"][dice.below(3)], &[from, &mean], to, &[]);
        }
        8 => {
            s.node("Tanh", &[from], &format!("{to}_tanh"), &[]);
            s.node("Concat", &[from, &format!("{to}_tanh")], to, &[("axis", Int(1 + dice.below(3) as i64))]);
        }
        9 => {
            let pads = [
                0,
                0,
                dice.below(3) as i64,
                dice.below(2) as i64,
                0,
                0,
                dice.below(2) as i64,
                dice.below(2) as i64,
            ];
            s.with_ints(11, "Pad", from, to, ("pads", &pads), &[]);
        }
        10 => {
            let weights = s.drawn(&[width, 1 + dice.below(5)], -1.0, 1.0);
            s.node("MatMul", &[from, &weights], to, &[]);
        }
        11 => s.node("Transpose", &[from], to, &[("perm", Ints(&[0, 1, 3, 2]))]),
        12 => s.node("Softmax", &[from], to, &[("axis", Int(3))]),
        _ => {
            let half = s.drawn(&[1], 1.5, 2.5);
            s.node("Tanh", &[from], &format!("{to}_bounded"), &[]);
            s.node("Exp", &[&format!("{to}_bounded")], &format!("{to}_exp"), &[]);
            s.node(["Div", "Mul"][dice.below(2)], &[&format!("{to}_exp"), &half], &format!("{to}_part"), &[]);
            s.node(["Sqrt", "Log"][dice.below(2)], &[&format!("{to}_part")], to, &[]);
        }
    }
}
