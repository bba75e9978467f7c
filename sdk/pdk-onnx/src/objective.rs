//! What a gradient is taken of, in a few words: one number, a sum, a mean or a loss of outputs.
//!
//! The words are added to the graph as nodes that compute a single number. A loss compares a value with a target, which becomes
//! a further input of the graph.

use std::collections::HashSet;
use std::fmt;

use pdk_sdk::error::{Error, Result};

use crate::attributes::int;
use crate::builder::Builder;
use crate::gradient::{Gradients, Target, float_shape, gradients};
use crate::graph::Graph;
use crate::proto::ModelProto;
use crate::tensor::{Element, Tensor, shape_text};
use crate::weights::weights;

/// The name of the number in the graph, which is the first output.
pub const OBJECTIVE: &str = "objective";

/// What all weights of a graph are called.
pub const WEIGHTS: &str = "weights";

/// How a value becomes one number.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Measure {
    /// Its only element.
    Only,
    /// Its element at this place, in row-major order.
    At(usize),
    /// Its element at this place on each axis; on axes without one, the greatest.
    On(Vec<Option<usize>>),
    Sum,
    Mean,
    Greatest,
    SquaredError,
    AbsoluteError,
    CrossEntropy,
}

/// A word, and what it stands for.
const MEASURES: &[(&str, Measure, &str)] = &[
    ("sum", Measure::Sum, "the sum of all its numbers"),
    ("mean", Measure::Mean, "their mean"),
    ("max", Measure::Greatest, "the greatest of them"),
    ("squared_error", Measure::SquaredError, "the mean of the squared differences from a target"),
    ("absolute_error", Measure::AbsoluteError, "the mean of the absolute differences from a target"),
    (
        "cross_entropy",
        Measure::CrossEntropy,
        "the cross-entropy of scores (before softmax) with target probabilities",
    ),
];

impl Measure {
    fn has_target(&self) -> bool {
        matches!(self, Self::SquaredError | Self::AbsoluteError | Self::CrossEntropy)
    }
}

#[derive(Debug, Clone, PartialEq)]
struct Term {
    factor: f64,
    measure: Measure,
    value: String,
}

/// What a gradient is taken of.
#[derive(Debug, Clone, PartialEq)]
pub struct Objective {
    terms: Vec<Term>,
}

impl Objective {
    /// Reads what is meant by `text`: terms that are joined by ` + ` and ` - `, each with a factor before ` * ` if need be. A term is a
    /// value of the graph, `VALUE` if it has one number or `VALUE[PLACE]`, or a measure of one: `sum(VALUE)`, `mean(VALUE)`, `max(VALUE)`,
    /// `squared_error(VALUE)`, `absolute_error(VALUE)`, `cross_entropy(VALUE)`. A place is counted in row-major order, or given for each axis,
    /// where `*` takes the greatest number along it. Such as `steering`, `probabilities[3]`, `boxes[0,4,*]` or `squared_error(steering) + 0.1 *
    /// mean(throttle)`.
    ///
    /// # Errors
    /// If it says something else, or names a value that the graph does not have.
    pub fn parse(text: &str, graph: &Graph) -> Result<Self> {
        let mut terms = Vec::new();
        let mut sign = 1.0;
        let mut words = Vec::new();
        // Names of values contain signs, but no blanks.
        for word in text.split_whitespace().chain([""]) {
            if !matches!(word, "+" | "-" | "") {
                words.push(word);
                continue;
            }
            if words.is_empty() && terms.is_empty() && word == "-" {
                sign = -sign;
                continue;
            }
            terms.push(term(sign, &words, graph).map_err(|error| error.at(format!("`{text}`")))?);
            words.clear();
            sign = if word == "-" { -1.0 } else { 1.0 };
        }
        Ok(Self { terms })
    }

    /// The only number that a graph computes.
    ///
    /// # Errors
    /// If it has several outputs, or its output several numbers.
    pub fn only(graph: &Graph) -> Result<Self> {
        match graph.outputs() {
            [one] if graph.fact(one)?.shape.iter().product::<usize>() == 1 => Self::parse(one, graph),
            outputs => {
                let shown = |name: &String| match graph.fact(name) {
                    Ok(fact) => format!("`{name}` {}", shape_text(&fact.shape)),
                    Err(_) => format!("`{name}`"),
                };
                let outputs: Vec<_> = outputs.iter().map(shown).collect();
                Err(Error::new(format!(
                    "it computes {}, which is more than one number; name one, such as VALUE[0], or a measure of all, such as sum(VALUE)",
                    outputs.join(", ")
                )))
            }
        }
    }

    /// Adds nodes that compute the number, as the value [`OBJECTIVE`], and inputs for the targets: `target`, or `target/VALUE` if
    /// there are several.
    ///
    /// # Errors
    /// If a value has no numbers, or several where one is meant.
    fn add_to(&self, graph: Graph) -> Result<Graph> {
        let mut b = Builder::new(graph, HashSet::new());
        let several = self.terms.iter().filter(|term| term.measure.has_target()).count() > 1;
        let mut sum: Option<String> = None;
        for Term { factor, measure, value } in &self.terms {
            let target = match measure.has_target() {
                true => {
                    let name = if several { format!("target/{value}") } else { "target".to_owned() };
                    // Two losses of one value have one target.
                    if !b.graph.inputs().any(|input| input == name) || !several {
                        b.graph.add_input(&name, b.graph.fact(value)?.clone())?;
                    }
                    name
                }
                false => String::new(),
            };
            let number = number(&mut b, measure, value, &target)?;
            let number = b.scale(&number, *factor)?;
            sum = Some(match sum {
                None => number,
                Some(sum) => b.binary("Add", &sum, &number)?,
            });
        }
        let sum = sum.ok_or_else(|| Error::new("an objective has at least one term"))?;
        b.named("Identity", &[&sum], OBJECTIVE)?;
        Ok(b.graph)
    }

    /// A graph whose only output is the number, [`OBJECTIVE`].
    ///
    /// # Errors
    /// If a value has no numbers, or several where one is meant, or the number is a loss, which needs a target.
    pub fn graph(&self, graph: &Graph) -> Result<ModelProto> {
        match self.terms.iter().find(|term| term.measure.has_target()) {
            Some(_) => Err(Error::new(format!(
                "`{self}` is a loss, which needs a target; name a number without one"
            ))),
            None => self.add_to(graph.clone())?.model(&[OBJECTIVE]),
        }
    }

    /// A model that computes the number and its gradients with respect to `of`: the inputs of the graph, any values, or weights. Its
    /// first output is [`OBJECTIVE`], then come the gradients in the order of `of`.
    ///
    /// # Errors
    /// As for [`gradients`].
    pub fn gradients(&self, graph: &Graph, of: &[&str]) -> Result<Gradients> {
        let graph = self.add_to(graph.clone())?;
        gradients(&graph, Target { value: OBJECTIVE, index: 0 }, of, &[OBJECTIVE])
    }
}

/// The values that gradients are taken with respect to, by what `names` say: a value, a node for its first output, or `weights` for all
/// weights of floats from which the outputs have a gradient. Without names, all inputs of floats.
///
/// # Errors
/// If something has another name, or there are no weights.
pub fn values<'a>(graph: &'a Graph, names: &[String]) -> Result<Vec<&'a str>> {
    let floats = |name: &&str| graph.fact(name).is_ok_and(|fact| fact.element.is_float());
    if names.is_empty() {
        return Ok(graph.inputs().filter(floats).collect());
    }
    let mut values: Vec<&str> = Vec::new();
    for name in names {
        let node = || graph.nodes().iter().find(|node| node.name == *name)?.output.first();
        // First, so that it stands for all weights even if one of them has this name.
        if name == WEIGHTS {
            let weights = weights(graph);
            if weights.is_empty() {
                return Err(Error::new(format!(
                    "it has no weights of floats from which its outputs have a gradient; name inputs or values instead of `{WEIGHTS}`"
                )));
            }
            values.extend(weights);
        } else if let Some(value) = graph.values.name(name).or_else(|| node().map(String::as_str)) {
            values.push(value);
        } else {
            return Err(Error::new(format!(
                "there is no value or node `{name}`; `{WEIGHTS}` names all weights, and the inputs are {}",
                graph.inputs().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ")
            )));
        }
    }
    Ok(values)
}

/// One term.
fn term(sign: f64, words: &[&str], graph: &Graph) -> Result<Term> {
    let (factor, text) = match words {
        [factor, "*", rest] => {
            let factor: f64 =
                factor.parse().map_err(|_| Error::new(format!("`{factor}` is not a number")))?;
            if !factor.is_finite() {
                return Err(Error::new(format!("the factor {factor} is not finite")));
            }
            (sign * factor, *rest)
        }
        [text] => (sign, *text),
        [] => return Err(Error::new("a term is missing")),
        _ => {
            return Err(Error::new(format!(
                "`{}` is not a term; write VALUE, VALUE[PLACE] or MEASURE(VALUE), with a factor before ` * ` if need be",
                words.join(" ")
            )));
        }
    };
    let (measure, value) = measured(text, graph);
    graph.fact(value).map_err(|error| {
        let values: Vec<_> = graph.outputs().iter().map(|name| format!("`{name}`")).collect();
        Error::new(format!("{error}; the outputs are {}", values.join(", ")))
    })?;
    Ok(Term { factor, measure, value: value.to_owned() })
}

/// The measure and the value that a term names. A name of a value is taken as it stands, whatever is in it.
fn measured<'a>(text: &'a str, graph: &Graph) -> (Measure, &'a str) {
    if graph.fact(text).is_ok() {
        return (Measure::Only, text);
    }
    if let Some((value, place)) = text.strip_suffix(']').and_then(|text| text.rsplit_once('['))
        && let Some(at) = place_of(place)
    {
        return (at, value);
    }
    let inner = text.strip_suffix(')').and_then(|text| text.split_once('('));
    let known = inner.and_then(|(word, value)| {
        let (_, measure, _) = MEASURES.iter().find(|(name, ..)| *name == word)?;
        Some((measure.clone(), value))
    });
    known.unwrap_or((Measure::Only, text))
}

/// The place in brackets: one number, or for each axis one or a star.
fn place_of(text: &str) -> Option<Measure> {
    if let Ok(place) = text.parse() {
        return Some(Measure::At(place));
    }
    let axis = |part: &str| if part == "*" { Some(None) } else { part.parse().ok().map(Some) };
    text.split(',').map(axis).collect::<Option<_>>().map(Measure::On)
}

/// Adds the nodes of a measure.
fn number(b: &mut Builder, measure: &Measure, value: &str, target: &str) -> Result<String> {
    let shape = float_shape(&b.graph, value)?.to_vec();
    let count: usize = shape.iter().product();
    if count == 0 {
        return Err(Error::new(format!("`{value}` has no numbers")));
    }
    let all = |b: &mut Builder, a: &str, divisor: usize| {
        let flat = b.reshape(a, &[count_of(b, a)?])?;
        let sum = b.sum(&flat, &[0])?;
        let sum = b.reshape(&sum, &[])?;
        b.scale(&sum, 1.0 / divisor as f64)
    };
    match measure {
        Measure::Only if count > 1 => Err(Error::new(format!(
            "`{value}` has {count} numbers; name one, such as {value}[0], or a measure of all, such as sum({value})"
        ))),
        Measure::Only => element(b, value, 0),
        Measure::At(place) => {
            if *place >= count {
                return Err(Error::new(format!(
                    "`{value}` has {count} numbers, from {value}[0] to {value}[{}]",
                    count - 1
                )));
            }
            element(b, value, *place)
        }
        Measure::On(places) => {
            let fits = |(place, dim): (&Option<usize>, &usize)| place.is_none_or(|place| place < *dim);
            if places.len() != shape.len() || !places.iter().zip(&shape).all(fits) {
                return Err(Error::new(format!(
                    "`{value}` has the shape {}; give a place on each axis, from 0, or * for the greatest along it",
                    shape_text(&shape)
                )));
            }
            let mut part = value.to_owned();
            for (axis, place) in places.iter().enumerate() {
                if let Some(place) = place {
                    part = b.slice(&part, axis, *place, place + 1)?;
                }
            }
            greatest(b, &part)
        }
        Measure::Greatest => greatest(b, value),
        Measure::Sum => all(b, value, 1),
        Measure::Mean => all(b, value, count),
        Measure::SquaredError | Measure::AbsoluteError => {
            let difference = b.binary("Sub", value, target)?;
            let size = match measure {
                Measure::SquaredError => b.mul(&difference, &difference)?,
                _ => b.unary("Abs", &difference)?,
            };
            all(b, &size, count)
        }
        Measure::CrossEntropy => {
            let Some((last, classes)) = shape.len().checked_sub(1).map(|last| (last, shape[last])) else {
                return Err(Error::new(format!(
                    "`{value}` is one number, but cross_entropy needs one for each class"
                )));
            };
            let logarithms = b.node("LogSoftmax", &[value], vec![int("axis", last as i64)])?;
            let product = b.mul(&logarithms, target)?;
            let sum = all(b, &product, count / classes)?;
            b.unary("Neg", &sum)
        }
    }
}

/// The number at a place of a value, in row-major order.
fn element(b: &mut Builder, value: &str, place: usize) -> Result<String> {
    let flat = b.reshape(value, &[count_of(b, value)?])?;
    let place =
        b.constant(&Tensor { element: Element::INT64, shape: Vec::new(), values: vec![place as f64] })?;
    b.node("Gather", &[&flat, &place], vec![int("axis", 0)])
}

/// The greatest number of a value.
fn greatest(b: &mut Builder, value: &str) -> Result<String> {
    let flat = b.reshape(value, &[count_of(b, value)?])?;
    // Without axes, all of them are reduced.
    b.node("ReduceMax", &[&flat], vec![int("keepdims", 0)])
}

fn count_of(b: &Builder, value: &str) -> Result<usize> {
    Ok(b.shape(value)?.iter().product())
}

/// The words for help texts: a line for each form of a term.
pub fn help() -> String {
    let forms = [
        ("VALUE", "its only number"),
        ("VALUE[PLACE]", "the number at this place, in row-major order"),
        ("VALUE[PLACE,PLACE]", "the number at this place on each axis; * takes the greatest along one"),
    ];
    let measures = MEASURES.iter().map(|(name, _, meaning)| (format!("{name}(VALUE)"), *meaning));
    let forms = forms.iter().map(|(form, meaning)| ((*form).to_owned(), *meaning)).chain(measures);
    forms.map(|(form, meaning)| format!("  {form:<22} {meaning}\n")).collect()
}

impl fmt::Display for Objective {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (place, Term { factor, measure, value }) in self.terms.iter().enumerate() {
            let sign = match (place, *factor < 0.0) {
                (0, false) => "",
                (0, true) => "- ",
                (_, false) => " + ",
                (_, true) => " - ",
            };
            f.write_str(sign)?;
            if factor.abs() != 1.0 {
                write!(f, "{} * ", factor.abs())?;
            }
            match measure {
                Measure::Only => write!(f, "{value}")?,
                Measure::At(place) => write!(f, "{value}[{place}]")?,
                Measure::On(places) => {
                    let place =
                        |place: &Option<usize>| place.map_or("*".to_owned(), |place| place.to_string());
                    write!(f, "{value}[{}]", places.iter().map(place).collect::<Vec<_>>().join(","))?;
                }
                measure => {
                    let word =
                        MEASURES.iter().find(|(_, known, _)| known == measure).map_or("", |(name, ..)| name);
                    write!(f, "{word}({value})")?;
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{OPSETS, Sketch, differences, numbers, relative_error};

    fn graph(opset: i64) -> Graph {
        let mut sketch = Sketch::new(opset);
        sketch.input("x", &[2, 3]);
        let w = sketch.drawn(&[3, 4], -1.0, 1.0);
        sketch.node("MatMul", &["x", &w], "scores", &[]);
        sketch.node("Tanh", &["scores"], "a-b", &[]);
        let v = sketch.drawn(&[4, 1], -1.0, 1.0);
        sketch.node("MatMul", &["a-b", &v], "steering:0", &[]);
        Graph::new(sketch.model(&["scores", "a-b", "steering:0"])).unwrap()
    }

    /// The value of an objective and its gradients, computed from the model that is built, and by differences.
    fn compared(text: &str, opset: i64) -> f64 {
        let graph = graph(opset);
        let objective = Objective::parse(text, &graph).unwrap_or_else(|error| panic!("{text}: {error}"));
        assert_eq!(objective.to_string(), text);
        let built =
            objective.gradients(&graph, &["x", "w0"]).unwrap_or_else(|error| panic!("{text}: {error}"));
        assert_eq!(built.outputs, ["objective", "gradient/x", "gradient/w0"], "{text}");
        let derived = Graph::new(built.model).unwrap();
        let x = Tensor::floats(&[2, 3], numbers(5, 6));
        let w = (*graph.constant("w0").unwrap().unwrap()).clone();
        let targets: Vec<_> = derived
            .inputs()
            .filter(|name| *name != "x")
            .map(|name| {
                let shape = derived.fact(name).unwrap().shape.clone();
                (name.to_owned(), Tensor::floats(&shape, numbers(9, shape.iter().product())))
            })
            .collect();
        let computed = |x: &Tensor, w: &Tensor, name: &str| {
            let mut given = vec![("x", x), ("w0", w)];
            given.extend(targets.iter().map(|(name, target)| (name.as_str(), target)));
            derived.evaluate(&given, &[name]).unwrap().swap_remove(0)
        };
        for (place, value) in [&x, &w].into_iter().enumerate() {
            let exact = computed(&x, &w, &built.outputs[1 + place]);
            let moved = |moved: &Tensor| {
                let (x, w) = if place == 0 { (moved, &w) } else { (&x, moved) };
                Ok(computed(x, w, OBJECTIVE).values[0])
            };
            let differences = differences(value, 0..value.values.len(), 1e-6, moved).unwrap();
            let error = relative_error(&exact.values, &differences);
            assert!(error < 1e-6, "{text} at version {opset}: {error:e}");
        }
        computed(&x, &w, OBJECTIVE).values[0]
    }

    #[test]
    fn each_measure_and_their_sums_have_the_gradients_that_central_differences_show() {
        for opset in OPSETS {
            for text in [
                "steering:0[1]",
                "a-b[5]",
                "sum(scores)",
                "mean(a-b)",
                "squared_error(steering:0)",
                "absolute_error(a-b)",
                "cross_entropy(scores)",
                "max(scores)",
                "scores[1,2]",
                "scores[1,*]",
                "scores[*,3] - scores[*,*]",
                "- steering:0[0] + 0.5 * mean(a-b) - 2 * sum(scores)",
                "squared_error(steering:0) + cross_entropy(scores)",
            ] {
                compared(text, opset);
            }
        }
    }

    #[test]
    fn inputs_layers_and_weights_can_be_named() {
        let graph = graph(13);
        let named = |names: &[&str]| {
            let names: Vec<_> = names.iter().map(|name| (*name).to_owned()).collect();
            values(&graph, &names).map(|values| values.join(" ")).map_err(|error| error.to_string())
        };
        assert_eq!(named(&[]).unwrap(), "x");
        assert_eq!(named(&["matmul_0", "a-b"]).unwrap(), "scores a-b");
        assert_eq!(named(&["weights", "x"]).unwrap(), "w0 w1 x");
        assert!(named(&["y"]).unwrap_err().contains("no value or node `y`"));
        let error = Objective::only(&graph).unwrap_err().to_string();
        assert!(error.contains("`scores` (2, 4), `a-b` (2, 4), `steering:0` (2, 1)"), "{error}");
    }

    #[test]
    fn a_sum_is_the_sum_of_its_terms() {
        let parts = compared("steering:0[0]", 13) + 0.5 * compared("mean(a-b)", 13);
        let whole = compared("steering:0[0] + 0.5 * mean(a-b)", 13);
        assert!((parts - whole).abs() < 1e-12, "{parts} and {whole}");
    }

    #[test]
    fn what_is_not_an_objective_is_an_error_that_says_why() {
        let graph = graph(13);
        for (text, part) in [
            ("", "a term is missing"),
            ("scores[0] +", "a term is missing"),
            ("steer", "there is no value `steer`"),
            ("steer", "the outputs are `scores`, `a-b`, `steering:0`"),
            ("x * scores[0]", "`x` is not a number"),
            ("inf * scores[0]", "not finite"),
            ("scores[0] scores[1]", "is not a term"),
            ("median(scores)", "there is no value `median(scores)`"),
        ] {
            let error = Objective::parse(text, &graph).unwrap_err().to_string();
            assert!(error.contains(part), "{text}: {error}");
        }
        for (text, part) in [
            ("scores", "has 8 numbers; name one, such as scores[0]"),
            ("scores[8]", "from scores[0] to scores[7]"),
            ("scores[0,4]", "has the shape (2, 4); give a place on each axis"),
            ("scores[0,*,0]", "has the shape (2, 4); give a place on each axis"),
        ] {
            let objective = Objective::parse(text, &graph).unwrap();
            let error = objective.gradients(&graph, &["x"]).err().unwrap().to_string();
            assert!(error.contains(part), "{text}: {error}");
        }
    }

    #[test]
    fn the_graph_of_a_number_has_it_as_its_only_output() {
        let graph = graph(13);
        let x = Tensor::floats(&[2, 3], numbers(5, 6));
        let computed = |text: &str| {
            let built = Graph::new(Objective::parse(text, &graph)?.graph(&graph)?)?;
            assert_eq!(built.outputs(), [OBJECTIVE]);
            Ok::<_, Error>(built.evaluate(&[("x", &x)], &[OBJECTIVE])?[0].values[0])
        };
        let scores = graph.evaluate(&[("x", &x)], &["scores"]).unwrap()[0].values.clone();
        let greatest = |values: &[f64]| values.iter().copied().fold(f64::MIN, f64::max);
        assert_eq!(computed("scores[1,2]").unwrap(), scores[6]);
        assert_eq!(computed("scores[1,*]").unwrap(), greatest(&scores[4..]));
        assert_eq!(computed("max(scores)").unwrap(), greatest(&scores));
        let loss = computed("mean(scores) + squared_error(a-b)").unwrap_err().to_string();
        assert!(loss.contains("is a loss, which needs a target"), "{loss}");
    }

    #[test]
    fn cross_entropy_is_the_logarithm_of_the_number_of_classes_for_equal_scores() {
        let mut sketch = Sketch::new(13);
        sketch.input("x", &[1, 5]);
        sketch.node("Identity", &["x"], "scores", &[]);
        let graph = Graph::new(sketch.model(&["scores"])).unwrap();
        let objective = Objective::parse("cross_entropy(scores)", &graph).unwrap();
        let built = objective.gradients(&graph, &["x"]).unwrap();
        let derived = Graph::new(built.model).unwrap();
        let scores = Tensor::floats(&[1, 5], vec![0.7; 5]);
        let target = Tensor::floats(&[1, 5], vec![0.0, 0.0, 1.0, 0.0, 0.0]);
        let [value, gradient] = &derived
            .evaluate(&[("x", &scores), ("target", &target)], &["objective", "gradient/x"])
            .unwrap()[..]
        else {
            panic!("two values were asked for")
        };
        assert!((value.values[0] - libm::log(5.0)).abs() < 1e-12);
        assert!(relative_error(&gradient.values, &[0.2, 0.2, -0.8, 0.2, 0.2]) < 1e-12);
    }
}
