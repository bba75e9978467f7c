//! The time from a control to its effect: computing, a bus, and what moves wheels and brakes.

use std::collections::VecDeque;

use pdk_sdk::prelude::Control;

/// Controls that were given and have no effect yet.
#[derive(Debug)]
pub struct Delay {
    /// Whole steps of the delay, and the part of a step that is left.
    steps: usize,
    part: f64,
    /// The controls of the last steps, the oldest first: one more than whole steps.
    given: VecDeque<Control>,
}

impl Delay {
    /// A delay of this many seconds where a step takes `1 / rate`.
    pub fn new(seconds: f64, rate: f64) -> Self {
        let all = seconds * rate;
        // A delay of whole steps is one, however it is written.
        let steps = (all + 1e-9).floor();
        let part = if all - steps < 1e-9 { 0.0 } else { all - steps };
        let mut delay = Self { steps: steps as usize, part, given: VecDeque::new() };
        delay.reset();
        delay
    }

    /// Begins anew: until the first control has an effect, the vehicle rolls straight on.
    pub fn reset(&mut self) {
        self.given.clear();
        self.given.resize(self.steps + 1, Control { steering: 0.0, throttle: 0.0 });
    }

    /// The controls that were given and have no effect yet, the oldest first; none if there is no delay.
    pub fn waiting(&self) -> impl Iterator<Item = Control> {
        self.given.iter().copied().filter(|_| self.steps > 0 || self.part > 0.0)
    }

    /// Has these controls on their way, as many as there are.
    pub fn put(&mut self, waiting: impl Iterator<Item = Control>) {
        self.given.iter_mut().zip(waiting).for_each(|(given, control)| *given = control);
    }

    /// Takes the control of a step, and returns what has an effect in it: each with its share of the step, in order.
    pub fn effective(&mut self, control: Control) -> [(Control, f64); 2] {
        // Never longer than it was made: nothing is allocated.
        let before = self.given.pop_front().unwrap_or(control);
        self.given.push_back(control);
        let now = self.given.front().copied().unwrap_or(control);
        [(before, self.part), (now, 1.0 - self.part)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The steering that has an effect in each step, averaged over it, where steering is 1, 2, 3 and so on.
    fn effects(seconds: f64) -> Vec<f64> {
        let mut delay = Delay::new(seconds, 20.0);
        (1..=6)
            .map(|step| {
                let given = Control { steering: f64::from(step), throttle: 0.0 };
                delay.effective(given).iter().map(|(control, share)| control.steering * share).sum()
            })
            .collect()
    }

    #[test]
    fn controls_have_their_effect_later() {
        assert_eq!(effects(0.0), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        assert_eq!(effects(0.05), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
        assert_eq!(effects(0.15), [0.0, 0.0, 0.0, 1.0, 2.0, 3.0]);
        let half = effects(0.075);
        assert!(
            half.iter().zip([0.0, 0.5, 1.5, 2.5, 3.5, 4.5]).all(|(a, b)| (a - b).abs() < 1e-9),
            "{half:?}"
        );
        let mut delay = Delay::new(0.1, 20.0);
        delay.effective(Control { steering: 1.0, throttle: 1.0 });
        delay.reset();
        for _ in 0..2 {
            assert_eq!(delay.effective(Control { steering: 2.0, throttle: 0.0 })[1].0.steering, 0.0);
        }
    }
}
