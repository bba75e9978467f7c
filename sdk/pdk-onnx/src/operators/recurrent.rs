//! `LSTM`, `GRU` and `RNN`: the sequences that recurrent networks read, forwards or backwards. Their cells are in
//! `recurrent_cells`.

use pdk_sdk::error::{Error, Result};

use super::inputs::optional;
use super::operator::{Operator, Rule, given};
use super::recurrent_cells::{Cell, Kind, State};
use crate::site::Site;
use crate::tensor::{Tensor, elements, shape_text};
use crate::values::Fact;

pub const OPERATORS: &[Operator] = &[
    Operator::new("LSTM", |site| infer(site, Kind::Lstm), |s, x| evaluate(s, x, Kind::Lstm), Rule::Unknown),
    Operator::new("GRU", |site| infer(site, Kind::Gru), |s, x| evaluate(s, x, Kind::Gru), Rule::Unknown),
    Operator::new("RNN", |site| infer(site, Kind::Rnn), |s, x| evaluate(s, x, Kind::Rnn), Rule::Unknown),
];

/// The sizes of a recurrent network.
struct Plan {
    /// For each direction whether it reads backwards.
    backwards: Vec<bool>,
    steps: usize,
    batch: usize,
    input: usize,
    hidden: usize,
    /// Whether the batch is the first axis of all values.
    batch_first: bool,
}

impl Plan {
    /// Checks the shapes of what goes in. Those of inputs that are left out are nothing.
    fn new(site: &Site<'_>, kind: Kind, shapes: &[Option<&[usize]>]) -> Result<Self> {
        let shape = |place: usize| shapes.get(place).copied().flatten();
        let needed = |place: usize| match shape(place) {
            Some(&[a, b, c]) => Ok([a, b, c]),
            Some(other) => Err(Error::new(format!(
                "its input {} has the shape {}, but needs 3 axes",
                place + 1,
                shape_text(other)
            ))),
            None => Err(Error::new(format!("its input {} is missing", place + 1))),
        };
        let backwards = match site.text("direction", "forward") {
            "forward" => vec![false],
            "reverse" => vec![true],
            "bidirectional" => vec![false, true],
            other => {
                return Err(Error::new(format!(
                    "its direction is `{other}`; use forward, reverse or bidirectional"
                )));
            }
        };
        let batch_first = match site.int("layout", 0) {
            0 => false,
            1 => true,
            other => return Err(Error::new(format!("its layout is {other}; use 0 or 1"))),
        };
        let [x, recurrent] = [needed(0)?, needed(2)?];
        let (steps, batch) = if batch_first { (x[1], x[0]) } else { (x[0], x[1]) };
        let plan = Self { backwards, steps, batch, input: x[2], hidden: recurrent[2], batch_first };
        if let Some(size) = site.optional_int("hidden_size")
            && usize::try_from(size) != Ok(plan.hidden)
        {
            return Err(Error::new(format!(
                "its `hidden_size` is {size}, but its weights are for {}",
                plan.hidden
            )));
        }
        let (hidden, directions) = (plan.hidden, plan.backwards.len());
        let rows = hidden.checked_mul(kind.gates());
        let rows = rows.filter(|rows| *rows <= usize::MAX / 2);
        let rows = rows.ok_or_else(|| Error::new("its weights are too large"))?;
        let expected = [
            (1, vec![directions, rows, plan.input]),
            (2, vec![directions, rows, hidden]),
            (3, vec![directions, 2 * rows]),
            (4, vec![batch]),
            (5, plan.state_shape()),
            (6, plan.state_shape()),
            (7, vec![directions, hidden.saturating_mul(3)]),
        ];
        needed(1)?;
        let count = if kind == Kind::Lstm { 8 } else { 6 };
        for (place, expected) in expected.into_iter().filter(|(place, _)| *place < count) {
            if let Some(found) = shape(place)
                && found != expected
            {
                let (found, expected) = (shape_text(found), shape_text(&expected));
                let place = place + 1;
                return Err(Error::new(format!(
                    "its input {place} has the shape {found}, but {expected} is needed"
                )));
            }
        }
        Ok(plan)
    }

    fn state_shape(&self) -> Vec<usize> {
        let directions = self.backwards.len();
        match self.batch_first {
            true => vec![self.batch, directions, self.hidden],
            false => vec![directions, self.batch, self.hidden],
        }
    }

    fn sequence_shape(&self) -> Vec<usize> {
        let directions = self.backwards.len();
        match self.batch_first {
            true => vec![self.batch, self.steps, directions, self.hidden],
            false => vec![self.steps, directions, self.batch, self.hidden],
        }
    }

    /// The start of what goes in at a step.
    fn input_at(&self, step: usize, item: usize) -> usize {
        let row = if self.batch_first { item * self.steps + step } else { step * self.batch + item };
        row * self.input
    }

    /// The start of the state of a direction.
    fn state_at(&self, direction: usize, item: usize) -> usize {
        let row = match self.batch_first {
            true => item * self.backwards.len() + direction,
            false => direction * self.batch + item,
        };
        row * self.hidden
    }

    /// The start of what comes out at a step.
    fn output_at(&self, step: usize, direction: usize, item: usize) -> usize {
        let directions = self.backwards.len();
        let row = match self.batch_first {
            true => (item * self.steps + step) * directions + direction,
            false => (step * directions + direction) * self.batch + item,
        };
        row * self.hidden
    }
}

fn infer(site: &Site<'_>, kind: Kind) -> Result<Vec<Fact>> {
    let shapes = (0..site.node.input.len())
        .map(|place| site.optional(place).map(|_| site.shape(place)).transpose())
        .collect::<Result<Vec<_>>>()?;
    let plan = Plan::new(site, kind, &shapes)?;
    for direction in 0..plan.backwards.len() {
        Cell::new(site, kind, direction, plan.backwards.len())?;
    }
    let element = site.fact(0)?.element;
    let state = Fact::new(element, plan.state_shape());
    let mut facts = vec![Fact::new(element, plan.sequence_shape()), state.clone()];
    if kind == Kind::Lstm {
        facts.push(state);
    }
    Ok(facts)
}

/// The number of steps of each sequence of a batch.
fn lengths(plan: &Plan, given: Option<&Tensor>) -> Result<Vec<usize>> {
    let Some(given) = given else { return Ok(vec![plan.steps; plan.batch]) };
    let length = |length: i64| {
        usize::try_from(length).ok().filter(|length| *length <= plan.steps).ok_or_else(|| {
            Error::new(format!("one of its sequences has {length} steps, but there are 0 to {}", plan.steps))
        })
    };
    given.to_ints().into_iter().map(length).collect()
}

fn evaluate(site: &Site<'_>, inputs: &[Option<&Tensor>], kind: Kind) -> Result<Vec<Tensor>> {
    let shapes: Vec<_> = inputs.iter().map(|input| input.map(|tensor| tensor.shape.as_slice())).collect();
    let plan = Plan::new(site, kind, &shapes)?;
    let x = given(inputs, 0)?;
    let optional = |place: usize| optional(inputs, place);
    let lengths = lengths(&plan, optional(4))?;
    // Steps behind the end of a sequence are 0.
    let mut sequence = Tensor::filled(x.element, &plan.sequence_shape(), 0.0)?;
    let mut last = Tensor::filled(x.element, &plan.state_shape(), 0.0)?;
    let mut last_cell = last.clone();
    let part = |tensor: Option<&'_ Tensor>, direction: usize| -> Option<Vec<f64>> {
        let tensor = tensor?;
        let length = elements(&tensor.shape[1..]).ok()?;
        Some(tensor.values[direction * length..][..length].to_vec())
    };
    for (direction, &backwards) in plan.backwards.iter().enumerate() {
        let mut cell = Cell::new(site, kind, direction, plan.backwards.len())?;
        cell.hidden = plan.hidden;
        cell.input = plan.input;
        cell.weights = part(optional(1), direction).unwrap_or_default();
        cell.recurrent = part(optional(2), direction).unwrap_or_default();
        cell.bias = part(optional(3), direction);
        cell.peepholes = part(optional(7).filter(|_| kind == Kind::Lstm), direction);
        for (item, &length) in lengths.iter().enumerate() {
            let start = plan.state_at(direction, item)..plan.state_at(direction, item) + plan.hidden;
            let initial = |place| {
                optional(place)
                    .map_or_else(|| vec![0.0; plan.hidden], |tensor| tensor.values[start.clone()].to_vec())
            };
            let cell_state = if kind == Kind::Lstm { initial(6) } else { Vec::new() };
            let mut state = State { hidden: initial(5), cell: cell_state };
            for step in 0..length {
                let step = if backwards { length - 1 - step } else { step };
                cell.step(&x.values[plan.input_at(step, item)..][..plan.input], &mut state);
                sequence.values[plan.output_at(step, direction, item)..][..plan.hidden]
                    .copy_from_slice(&state.hidden);
            }
            last.values[start.clone()].copy_from_slice(&state.hidden);
            if kind == Kind::Lstm {
                last_cell.values[start].copy_from_slice(&state.cell);
            }
        }
    }
    let mut outputs = vec![sequence, last];
    if kind == Kind::Lstm {
        outputs.push(last_cell);
    }
    Ok(outputs)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::graph::Graph;
    use crate::proto::AttributeProto;
    use crate::testing::Setting::{Float, Int, Text};
    use crate::testing::{Setting, Sketch, numbers};

    /// A network that reads 3 steps of 2 sequences, with 4 inputs and 5 hidden numbers.
    fn network(
        operator: &str,
        outputs: &[&str],
        settings: &[(&str, Setting<'_>)],
        lengths: Option<&[i64]>,
        directions: usize,
    ) -> Sketch {
        let gates = match operator {
            "LSTM" => 4,
            "GRU" => 3,
            _ => 1,
        };
        let mut sketch = Sketch::new(14);
        sketch.input("x", &[3, 2, 4]);
        let w = sketch.drawn(&[directions, gates * 5, 4], -1.0, 1.0);
        let r = sketch.drawn(&[directions, gates * 5, 5], -1.0, 1.0);
        let b = sketch.drawn(&[directions, 2 * gates * 5], -1.0, 1.0);
        let lengths = lengths.map(|lengths| sketch.ints(lengths)).unwrap_or_default();
        let h = sketch.drawn(&[directions, 2, 5], -1.0, 1.0);
        sketch.split(operator, &["x", &w, &r, &b, &lengths, &h], outputs, settings);
        sketch
    }

    fn x() -> Tensor {
        Tensor::floats(&[3, 2, 4], numbers(5, 24))
    }

    fn error(sketch: &Sketch) -> String {
        let graph = Graph::new(sketch.model(&["y"])).unwrap();
        graph.fact("y").unwrap_err().to_string()
    }

    #[test]
    fn both_directions_are_those_that_each_reads_alone() {
        for operator in ["LSTM", "GRU", "RNN"] {
            let sketch =
                network(operator, &["y", "h"], &[("direction", Text("bidirectional"))], Some(&[2, 3]), 2);
            let graph = Graph::new(sketch.model(&["y", "h"])).unwrap();
            let found = graph.evaluate(&[("x", &x())], &["y", "h"]).unwrap();
            let (y, h) = (&found[0], &found[1]);
            assert_eq!([y.shape.as_slice(), &h.shape], [&[3, 2, 2, 5][..], &[2, 2, 5]], "{operator}");
            // [step, direction, item]
            let at = |step: usize, direction: usize, item: usize| {
                &y.values[((step * 2 + direction) * 2 + item) * 5..][..5]
            };
            let last = |direction: usize, item: usize| &h.values[(direction * 2 + item) * 5..][..5];
            assert_eq!(at(2, 0, 0), [0.0; 5], "{operator}: behind the end");
            assert_eq!(at(1, 0, 0), last(0, 0), "{operator}");
            assert_eq!(at(2, 0, 1), last(0, 1), "{operator}");
            assert_eq!(at(0, 1, 0), last(1, 0), "{operator}");
            assert_ne!(at(0, 0, 0), at(0, 1, 0), "{operator}");
        }
    }

    #[test]
    fn each_output_may_be_left_out() {
        for outputs in [&["", "y"][..], &["", "", "y"], &["y"], &["", "y", ""]] {
            let sketch = network("LSTM", outputs, &[("clip", Float(0.5)), ("input_forget", Int(1))], None, 1);
            let graph = Graph::new(sketch.model(&["y"])).unwrap();
            let found = graph.evaluate(&[("x", &x())], &["y"]).unwrap();
            assert_eq!(found[0].shape, graph.fact("y").unwrap().shape, "{outputs:?}");
        }
        // An input that is left out behind an output that is left out stays out.
        let mut sketch = network("RNN", &["", "h"], &[], None, 1);
        sketch.node("Clip", &["h", "", ""], "y", &[]);
        let graph = Graph::new(sketch.model(&["y", "h"])).unwrap();
        let found = graph.evaluate(&[("x", &x())], &["y", "h"]).unwrap();
        assert_eq!(found[0], found[1]);
    }

    #[test]
    fn activations_are_applied_by_name() {
        let plain = |name: &str, alpha: Option<f32>| {
            let mut sketch = network("RNN", &["y"], &[], None, 1);
            let name = AttributeProto {
                name: "activations".into(),
                strings: vec![name.into()],
                ..Default::default()
            };
            sketch.push_attribute(name);
            let alpha = AttributeProto {
                name: "activation_alpha".into(),
                floats: alpha.into_iter().collect(),
                ..Default::default()
            };
            sketch.push_attribute(alpha);
            sketch
        };
        let value = |name, alpha| {
            let graph = Graph::new(plain(name, alpha).model(&["y"])).unwrap();
            graph.evaluate(&[("x", &x())], &["y"]).unwrap()[0].values.clone()
        };
        let (line, relu, leaky) = (value("Affine", None), value("Relu", None), value("leakyrelu", Some(0.5)));
        for place in 0..5 {
            assert_eq!(relu[place], line[place].max(0.0));
            assert_eq!(leaky[place], line[place].max(0.5 * line[place]));
        }
        assert!(error(&plain("Cube", None)).contains("its activation `Cube` is not known"));
    }

    #[test]
    fn shapes_and_settings_that_do_not_fit_are_refused() {
        for (settings, expected) in [
            (&[("direction", Text("up"))][..], "its direction is `up`"),
            (&[("layout", Int(2))], "its layout is 2"),
            (&[("layout", Int(1))], "its input 6 has the shape (1, 2, 5), but (3, 1, 5) is needed"),
            (&[("hidden_size", Int(-1))], "its `hidden_size` is -1, but its weights are for 5"),
            (&[("direction", Text("bidirectional"))], "its input 2 has the shape (1, 15, 4)"),
        ] {
            let error = error(&network("GRU", &["y"], settings, None, 1));
            assert!(error.contains(expected), "{error}");
        }
        let graph = network("GRU", &["y"], &[], Some(&[-1, 9]), 1).model(&["y"]);
        let error = Graph::new(graph).unwrap().evaluate(&[("x", &x())], &["y"]).unwrap_err().to_string();
        assert!(error.contains("one of its sequences has -1 steps"), "{error}");
        let mut sketch = Sketch::new(14);
        sketch.input("x", &[4]);
        sketch.node("LSTM", &["x"], "y", &[]);
        sketch.node("LSTM", &["x", "x", "x"], "z", &[]);
        let graph = Graph::new(sketch.model(&["y", "z"])).unwrap();
        assert!(graph.fact("y").unwrap_err().to_string().contains("needs 3 axes"));
        assert!(graph.fact("z").unwrap_err().to_string().contains("needs 3 axes"));
    }
}
