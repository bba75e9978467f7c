//! How outputs become a control.

use pdk_sdk::error::{Error, Result};

use crate::described::Described;
use crate::reading::refuse_unknown;
use crate::reason::Reason;
use crate::rule::{Decode, Rule, Throttle};

/// The throttle of a network that only steers, if nothing else is set.
const THROTTLE: f64 = 0.3;

/// What outputs that steer are called, or a part of it; and those that give the throttle.
const NAMES: [&[&str]; 2] = [&["steer", "angle"], &["throttle", "accel", "gas"]];

/// A number of a control, and the output that it comes from.
#[derive(Debug, Clone, PartialEq)]
pub struct Source {
    /// The output, by its place.
    pub output: usize,
    /// Which of its numbers; none if all of them are bins.
    pub index: Option<usize>,
    rule: Rule,
}

impl Source {
    /// The only number of an output, as it is.
    pub fn plain(output: usize) -> Self {
        Self { output, index: Some(0), rule: Rule::plain("") }
    }

    /// Whether the control falls when the output's number grows.
    pub fn is_reversed(&self) -> bool {
        self.rule.scale < 0.0
    }

    /// By how much the control grows with the output's number.
    pub fn slope(&self) -> f64 {
        self.rule.scale
    }

    /// The value of the outputs; none if a number is missing.
    fn value(&self, outputs: &[Vec<f32>]) -> Option<f64> {
        self.of(&outputs[self.output])
    }

    /// The value of the numbers of its output; none if one is missing.
    pub fn of(&self, numbers: &[f32]) -> Option<f64> {
        let raw = match (&self.rule.bins, self.index) {
            (None, index) => f64::from(*numbers.get(index.unwrap_or(0))?),
            (Some(bins), _) if bins.len() != numbers.len() => return None,
            (Some(_), _) if numbers.iter().any(|number| !number.is_finite()) => f64::NAN,
            (Some(bins), _) => match self.rule.decode {
                Decode::Argmax => {
                    let first_greatest =
                        (0..bins.len()).rev().max_by(|a, b| numbers[*a].total_cmp(&numbers[*b]));
                    bins[first_greatest?]
                }
                Decode::Mean => mean(bins, numbers.iter().map(|number| f64::from(*number))),
                Decode::SoftmaxMean => {
                    let greatest = numbers.iter().copied().fold(f32::NEG_INFINITY, f32::max);
                    mean(
                        bins,
                        numbers.iter().map(|number| libm::exp(f64::from(*number) - f64::from(greatest))),
                    )
                }
            },
        };
        let value = raw * self.rule.scale + self.rule.offset;
        Some(match self.rule.clip {
            Some([low, high]) if !value.is_nan() => value.clamp(low, high),
            _ => value,
        })
    }
}

/// The mean of values by weights.
fn mean(values: &[f64], weights: impl Iterator<Item = f64> + Clone) -> f64 {
    let sum: f64 = weights.clone().sum();
    values.iter().zip(weights).map(|(value, weight)| value * weight).sum::<f64>() / sum
}

/// How the outputs of a network become a control.
#[derive(Debug, Clone, PartialEq)]
pub struct Outputs {
    /// Where the steering comes from.
    pub steering: Source,
    /// Where the throttle comes from; none if it is constant.
    pub throttle: Option<Source>,
    /// The throttle if it is constant.
    pub constant: f64,
    /// What is known, and why.
    pub reasons: Vec<Reason>,
}

impl Outputs {
    /// Joins what was described with the outputs: their names, how many numbers each has, and which of them are state, which are not
    /// guessed to drive.
    ///
    /// # Errors
    /// If an output that is named is not there or does not fit, or nothing says which one steers.
    pub fn new(described: &Described, names: &[String], sizes: &[usize], states: &[usize]) -> Result<Self> {
        let outputs = Known { described, names, sizes };
        let open: Vec<usize> = (0..names.len()).filter(|output| !states.contains(output)).collect();
        let mut reasons = Vec::new();
        let mut steering = described.steering.clone();
        let (mut throttle, mut constant) = match &described.throttle {
            None => (None, None),
            Some(Throttle::Output(rule)) => (Some(rule.clone()), None),
            Some(Throttle::Constant(number)) => (None, Some(*number)),
        };
        let named = |rule: &Option<Rule>| rule.as_ref().is_some_and(|rule| !rule.output.is_empty());
        let why = |field: &str| {
            described.given.get(field).map_or(String::new(), |(_, place)| format!("{place} says so"))
        };
        let (given_steering, given_throttle) = (named(&steering), named(&throttle));
        if !given_steering {
            let guess = outputs.guess(&open, throttle.as_ref().filter(|_| given_throttle))?;
            let rule = steering.get_or_insert_with(|| Rule::plain(""));
            let said = [rule.index, throttle.as_ref().and_then(|rule| rule.index)];
            let indices = if guess.is_pair { of_pair(said).map(Some) } else { said };
            // Why a number of a pair is the one, and whether that is a convention.
            let because = |place: usize, field: &str| match said[place].filter(|_| guess.is_pair) {
                Some(_) => (why(field), false),
                None if guess.is_pair && said[1 - place].is_some() => {
                    ("it is the other number".to_owned(), true)
                }
                None => (guess.why.to_owned(), guess.is_assumed),
            };
            rule.output.clone_from(&names[guess.steering]);
            rule.index = indices[0].filter(|_| rule.bins.is_none());
            let (cause, is_assumed) = because(0, "steering");
            reasons.push(reason("steering", slot(rule), cause, is_assumed));
            if let Some(output) = guess.throttle.filter(|_| !given_throttle && constant.is_none()) {
                let rule = throttle.get_or_insert_with(|| Rule::plain(""));
                rule.output.clone_from(&names[output]);
                rule.index = indices[1].filter(|_| rule.bins.is_none());
                let (cause, is_assumed) = because(1, "throttle");
                reasons.push(reason("throttle", slot(rule), cause, is_assumed));
            }
        } else if let Some(rule) = &mut steering {
            let mut invented = None;
            let size = names.iter().position(|name| *name == rule.output).map(|place| sizes[place]);
            if size == Some(2) && rule.bins.is_none() {
                let beside =
                    throttle.as_mut().filter(|other| other.output == rule.output && other.bins.is_none());
                let said = [rule.index, beside.as_ref().and_then(|other| other.index)];
                let [first, second] = of_pair(said);
                rule.index = Some(first);
                match beside {
                    Some(other) => other.index = Some(second),
                    None if said[0].is_none() => {
                        invented = Some(Rule { index: Some(second), ..Rule::plain(&rule.output) });
                    }
                    None => {}
                }
            }
            reasons.push(reason("steering", outputs.called(rule), why("steering"), false));
            if let Some(rule) = invented.filter(|_| throttle.is_none() && constant.is_none()) {
                reasons.push(reason("throttle", slot(&rule), "it is beside the steering".to_owned(), true));
                throttle = Some(rule);
            }
        }
        if let Some(rule) = throttle.as_ref().filter(|_| given_throttle) {
            reasons.push(reason("throttle", outputs.called(rule), why("throttle"), false));
        }
        if throttle.as_ref().is_some_and(|rule| rule.output.is_empty()) {
            return Err(described.given.wrong(
                "throttle",
                "names no output, and the network gives none besides the steering; set `output`",
            ));
        }
        if throttle.is_none() {
            let given = constant.is_some();
            let number = *constant.get_or_insert(THROTTLE);
            let why = if given { why("throttle") } else { "the network only steers".to_owned() };
            reasons.push(reason("throttle", number.to_string(), why, false));
        }
        let steering = steering.ok_or_else(|| Error::new("it has no outputs"))?;
        Ok(Self {
            steering: outputs.source("steering", steering)?,
            throttle: throttle.map(|rule| outputs.source("throttle", rule)).transpose()?,
            constant: constant.unwrap_or(THROTTLE),
            reasons,
        })
    }

    /// Steering and throttle of outputs, not yet held to the range of a control.
    ///
    /// # Errors
    /// If a number is missing or not finite.
    pub fn control(&self, outputs: &[Vec<f32>]) -> Result<[f64; 2]> {
        let steering = finite(self.steering.value(outputs), "steering")?;
        let throttle = match &self.throttle {
            Some(source) => finite(source.value(outputs), "throttle")?,
            None => self.constant,
        };
        Ok([steering, throttle])
    }
}

fn finite(value: Option<f64>, what: &str) -> Result<f64> {
    match value {
        Some(value) if value.is_finite() => Ok(value),
        Some(value) => Err(Error::new(format!("its {what} is {value}"))),
        None => Err(Error::new(format!("it gave no {what}"))),
    }
}

fn reason(subject: &str, value: String, why: String, assumed: bool) -> Reason {
    Reason { subject: subject.to_owned(), value, why, assumed }
}

/// An output, and which of its numbers if it is known.
fn slot(rule: &Rule) -> String {
    match rule.index {
        Some(index) => format!("{}[{index}]", rule.output),
        None => rule.output.clone(),
    }
}

/// Which numbers of a pair steer and give the throttle, if a description says it of one, of both or of none: what it leaves open is the
/// other number, and the first steers.
fn of_pair(said: [Option<usize>; 2]) -> [usize; 2] {
    let other = |index: usize| usize::from(index == 0);
    match said {
        [Some(steering), Some(throttle)] => [steering, throttle],
        [Some(steering), None] => [steering, other(steering)],
        [None, Some(throttle)] => [other(throttle), throttle],
        [None, None] => [0, 1],
    }
}

/// What is guessed.
struct Guess {
    /// The output that steers, and the one that gives the throttle.
    steering: usize,
    throttle: Option<usize>,
    /// Whether they are one output of two numbers.
    is_pair: bool,
    why: &'static str,
    is_assumed: bool,
}

/// The only output steers.
fn only(steering: usize) -> Guess {
    Guess { steering, throttle: None, is_pair: false, why: "it is the only output", is_assumed: false }
}

/// The outputs that there are.
struct Known<'a> {
    described: &'a Described,
    names: &'a [String],
    sizes: &'a [usize],
}

impl Known<'_> {
    /// The error about outputs of which it is not clear what they are.
    fn wrong(&self, open: &[usize], what: &str) -> Error {
        let outputs: Vec<_> =
            open.iter().map(|&output| format!("`{}` ({})", self.names[output], self.sizes[output])).collect();
        Error::new(format!(
            "its outputs, with the number of values of each, are {}; {what}",
            outputs.join(", ")
        ))
    }

    /// Guesses which of the open outputs drive.
    fn guess(&self, open: &[usize], throttle: Option<&Rule>) -> Result<Guess> {
        if let Some(rule) = throttle {
            let others: Vec<usize> =
                open.iter().copied().filter(|&output| self.names[output] != rule.output).collect();
            let [steering] = others[..] else {
                return Err(self.wrong(open, "name the one that steers with `steering`"));
            };
            let why = "it is the only one besides the throttle";
            return Ok(Guess { steering, throttle: None, is_pair: false, why, is_assumed: false });
        }
        let sizes: Vec<usize> = open.iter().map(|&output| self.sizes[output]).collect();
        let binned = |rule: Option<&Rule>| rule.is_some_and(|rule| rule.bins.is_some());
        let has_bins = binned(self.described.steering.as_ref());
        match (open, sizes.as_slice()) {
            (&[one], _) if has_bins => Ok(only(one)),
            (&[one], [1]) => Ok(only(one)),
            (&[one], [2]) => {
                let why = "of two numbers the first steers, by convention";
                Ok(Guess { steering: one, throttle: Some(one), is_pair: true, why, is_assumed: true })
            }
            (&[first, second], [1, 1]) => {
                let is = |output: usize, what: usize| {
                    let name = self.names[output].to_lowercase();
                    NAMES[what].iter().any(|part| name.contains(part))
                };
                let (swapped, known) = match () {
                    () if is(first, 0) || is(second, 1) => (false, true),
                    () if is(second, 0) || is(first, 1) => (true, true),
                    () => (false, false),
                };
                let (steering, throttle) = if swapped { (second, first) } else { (first, second) };
                let why = if known { "their names say so" } else { "of two outputs the first steers, by convention" };
                Ok(Guess { steering, throttle: Some(throttle), is_pair: false, why, is_assumed: !known })
            }
            _ => Err(self.wrong(
                open,
                "a driving model has one output of steering and throttle, one of steering alone, or one of each; name them with `steering` and \
                 `throttle`, with an `index`, or with `bins` if they are categories; a network that plans is described by `waypoints`",
            )),
        }
    }

    /// An output as people write it.
    fn called(&self, rule: &Rule) -> String {
        let mut called = match (rule.index, &rule.bins) {
            (None, Some(bins)) => format!("{}, {} bins", rule.output, bins.len()),
            _ => slot(rule),
        };
        if rule.scale != 1.0 {
            called += &format!(" times {}", rule.scale);
        }
        if rule.offset != 0.0 {
            called += &format!(" plus {}", rule.offset);
        }
        called
    }

    /// Checks a rule against the output that it names.
    fn source(&self, field: &str, rule: Rule) -> Result<Source> {
        let given = &self.described.given;
        refuse_unknown(
            given,
            field,
            &rule.output,
            "output",
            self.names.iter().map(String::as_str).collect::<Vec<_>>(),
        )?;
        let output = self.names.iter().position(|name| *name == rule.output).unwrap_or_default();
        let (name, size) = (&rule.output, self.sizes[output]);
        match (&rule.bins, rule.index) {
            (Some(bins), _) if bins.len() != size => Err(given.wrong(
                field,
                format_args!("has {} bins, but the output `{name}` has {size} numbers; write as many bins", bins.len()),
            )),
            (Some(_), _) => Ok(Source { output, index: None, rule }),
            (None, Some(index)) if index >= size => Err(given.wrong(
                field,
                format_args!("takes number {index} of the output `{name}`, which has {size} (from 0); correct `index`"),
            )),
            (None, None) if size != 1 => Err(given.wrong(
                field,
                format_args!("is the output `{name}`, which has {size} numbers; choose one with `index`, or give their `bins` if they are categories"),
            )),
            (None, index) => Ok(Source { output, index: Some(index.unwrap_or(0)), rule }),
        }
    }
}

#[cfg(test)]
#[path = "outputs_tests.rs"]
mod tests;
