//! The cells of recurrent networks: what one step makes of its input and of the state before.

use pdk_sdk::error::{Error, Result};

use super::activations::softsign;
use super::functions::{sigmoid, softplus};
use crate::order::{self, cut};
use crate::site::Site;

/// The kind of a recurrent network.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    Lstm,
    Gru,
    Rnn,
}

impl Kind {
    /// The number of blocks in its weights.
    pub fn gates(self) -> usize {
        match self {
            Self::Lstm => 4,
            Self::Gru => 3,
            Self::Rnn => 1,
        }
    }

    /// Its activations, unless others are named.
    fn activations(self) -> &'static [&'static str] {
        match self {
            Self::Lstm => &["Sigmoid", "Tanh", "Tanh"],
            Self::Gru => &["Sigmoid", "Tanh"],
            Self::Rnn => &["Tanh"],
        }
    }
}

/// What a step leaves for the next one.
pub struct State {
    pub hidden: Vec<f64>,
    /// The memory of an LSTM; empty for others.
    pub cell: Vec<f64>,
}

/// A function with its two settings.
#[derive(Clone, Copy)]
struct Activation {
    function: fn(f64, f64, f64) -> f64,
    alpha: f64,
    beta: f64,
    /// The largest absolute value of what goes in, if there is one.
    clip: Option<f64>,
}

impl Activation {
    fn apply(&self, x: f64) -> f64 {
        let x = self.clip.map_or(x, |clip| order::clip(x, -clip, clip));
        (self.function)(x, self.alpha, self.beta)
    }
}

/// A function by name, and the defaults of the settings that it has.
type Known = (&'static str, fn(f64, f64, f64) -> f64, Option<f64>, Option<f64>);

const ACTIVATIONS: [Known; 11] = [
    ("relu", |x, _, _| cut(x), None, None),
    ("tanh", |x, _, _| libm::tanh(x), None, None),
    ("sigmoid", |x, _, _| sigmoid(x), None, None),
    ("softsign", |x, _, _| softsign(x), None, None),
    ("softplus", |x, _, _| softplus(x), None, None),
    ("affine", |x, a, b| a * x + b, Some(1.0), Some(0.0)),
    ("leakyrelu", |x, a, _| if x < 0.0 { a * x } else { x }, Some(0.01), None),
    ("thresholdedrelu", |x, a, _| if x > a { x } else { 0.0 }, Some(1.0), None),
    ("scaledtanh", |x, a, b| a * libm::tanh(b * x), Some(1.0), Some(1.0)),
    ("hardsigmoid", |x, a, b| (a * x + b).clamp(0.0, 1.0), Some(0.2), Some(0.5)),
    ("elu", |x, a, _| if x < 0.0 { a * libm::expm1(x) } else { x }, Some(1.0), None),
];

/// The activations of all directions, in order.
fn activations(site: &Site<'_>, kind: Kind, directions: usize) -> Result<Vec<Activation>> {
    let count = kind.activations().len() * directions;
    let names = match site.texts("activations").filter(|names| !names.is_empty()) {
        Some(names) if names.len() == count => names,
        Some(names) => {
            return Err(Error::new(format!("it names {} activations, but needs {count}", names.len())));
        }
        None => kind.activations().repeat(directions),
    };
    let clip = site.optional_float("clip");
    if let Some(clip) = clip.filter(|clip| clip.is_nan() || *clip < 0.0) {
        return Err(Error::new(format!("its `clip` is {clip}, but cannot be negative")));
    }
    // The settings are listed for those activations alone that have them.
    let mut alphas = site.floats("activation_alpha").unwrap_or_default().iter();
    let mut betas = site.floats("activation_beta").unwrap_or_default().iter();
    let setting = |default: Option<f64>, given: &mut std::slice::Iter<'_, f32>| match default {
        Some(default) => given.next().map_or(default, |&value| f64::from(value)),
        None => 0.0,
    };
    let mut found = Vec::with_capacity(count);
    for name in names {
        let known = ACTIVATIONS.iter().find(|(known, ..)| known.eq_ignore_ascii_case(name));
        let &(_, function, alpha, beta) = known.ok_or_else(|| {
            Error::new(format!("its activation `{name}` is not known; use one such as Tanh or Sigmoid"))
        })?;
        let (alpha, beta) = (setting(alpha, &mut alphas), setting(beta, &mut betas));
        found.push(Activation { function, alpha, beta, clip });
    }
    Ok(found)
}

/// One direction of a recurrent network.
pub struct Cell {
    kind: Kind,
    activations: Vec<Activation>,
    /// Whether an LSTM forgets as much as it lets in.
    coupled: bool,
    /// Whether a GRU multiplies the state before it resets it.
    linear_before_reset: bool,
    pub hidden: usize,
    pub input: usize,
    /// A block of rows for each gate.
    pub weights: Vec<f64>,
    /// The same for the state before.
    pub recurrent: Vec<f64>,
    /// A number for each row of the weights, then for each of those of the state; nothing for zeros.
    pub bias: Option<Vec<f64>>,
    /// The weights of the memory in the three gates of an LSTM.
    pub peepholes: Option<Vec<f64>>,
}

impl Cell {
    /// A direction without weights.
    pub fn new(site: &Site<'_>, kind: Kind, direction: usize, directions: usize) -> Result<Self> {
        let count = kind.activations().len();
        let activations = activations(site, kind, directions)?.split_off(direction * count);
        Ok(Self {
            kind,
            activations,
            coupled: site.int("input_forget", 0) != 0,
            linear_before_reset: site.int("linear_before_reset", 0) != 0,
            hidden: 0,
            input: 0,
            weights: Vec::new(),
            recurrent: Vec::new(),
            bias: None,
            peepholes: None,
        })
    }

    /// Takes the state one step on.
    pub fn step(&self, x: &[f64], state: &mut State) {
        match self.kind {
            Kind::Lstm => self.step_lstm(x, state),
            Kind::Gru => self.step_gru(x, state),
            Kind::Rnn => {
                let sums = add(self.of_input(0, x), &self.of_state(0, &state.hidden));
                state.hidden = sums.into_iter().map(|sum| self.activations[0].apply(sum)).collect();
            }
        }
    }

    /// What a gate makes of the input.
    fn of_input(&self, gate: usize, x: &[f64]) -> Vec<f64> {
        let rows = gate * self.hidden..(gate + 1) * self.hidden;
        let bias = |row: usize| self.bias.as_ref().map_or(0.0, |bias| bias[row]);
        rows.map(|row| bias(row) + dot(&self.weights[row * self.input..], x)).collect()
    }

    /// What a gate makes of the state.
    fn of_state(&self, gate: usize, state: &[f64]) -> Vec<f64> {
        let rows = gate * self.hidden..(gate + 1) * self.hidden;
        let behind = self.kind.gates() * self.hidden;
        let bias = |row: usize| self.bias.as_ref().map_or(0.0, |bias| bias[behind + row]);
        rows.map(|row| bias(row) + dot(&self.recurrent[row * self.hidden..], state)).collect()
    }

    /// The gates of an LSTM are, in the order of its weights: in, out, forget, cell. Its peepholes are for the first three.
    fn step_lstm(&self, x: &[f64], state: &mut State) {
        let sum = |gate| add(self.of_input(gate, x), &self.of_state(gate, &state.hidden));
        let [input, output, forget, candidate] = [sum(0), sum(1), sum(2), sum(3)];
        let [gate, inner, outer] = [self.activations[0], self.activations[1], self.activations[2]];
        for place in 0..self.hidden {
            let peep = |gate: usize, memory: f64| {
                self.peepholes.as_ref().map_or(0.0, |weights| weights[gate * self.hidden + place] * memory)
            };
            let before = state.cell[place];
            let taken = gate.apply(input[place] + peep(0, before));
            let kept = if self.coupled { 1.0 - taken } else { gate.apply(forget[place] + peep(2, before)) };
            let memory = kept * before + taken * inner.apply(candidate[place]);
            let shown = gate.apply(output[place] + peep(1, memory));
            state.cell[place] = memory;
            state.hidden[place] = shown * outer.apply(memory);
        }
    }

    /// The gates of a GRU are, in the order of its weights: update, reset, hidden.
    fn step_gru(&self, x: &[f64], state: &mut State) {
        let [gate, inner] = [self.activations[0], self.activations[1]];
        let opened = |place: usize| -> Vec<f64> {
            let sums = add(self.of_input(place, x), &self.of_state(place, &state.hidden));
            sums.into_iter().map(|sum| gate.apply(sum)).collect()
        };
        let [update, reset] = [opened(0), opened(1)];
        let of_state = match self.linear_before_reset {
            true => multiply(self.of_state(2, &state.hidden), &reset),
            false => self.of_state(2, &multiply(state.hidden.clone(), &reset)),
        };
        let candidates = add(self.of_input(2, x), &of_state);
        for ((hidden, candidate), update) in state.hidden.iter_mut().zip(candidates).zip(update) {
            *hidden = (1.0 - update) * inner.apply(candidate) + update * *hidden;
        }
    }
}

/// The product of a row, which may be followed by others, with a vector.
fn dot(row: &[f64], x: &[f64]) -> f64 {
    row.iter().zip(x).map(|(a, b)| a * b).sum()
}

fn add(mut a: Vec<f64>, b: &[f64]) -> Vec<f64> {
    a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
    a
}

fn multiply(mut a: Vec<f64>, b: &[f64]) -> Vec<f64> {
    a.iter_mut().zip(b).for_each(|(a, b)| *a *= b);
    a
}
