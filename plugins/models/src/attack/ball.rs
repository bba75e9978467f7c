//! What an attack may do to a frame: all changes up to a size, by one of two norms.

use pdk_sdk::prelude::*;

/// How the size of a change is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Norm {
    /// The largest change of a value.
    Largest,
    /// The root of the mean square over all values.
    MeanSquare,
}

/// Adds the parameter that says how large a change may be, in the same levels for all attacks.
pub fn epsilon(description: Description, doc: &str) -> Description {
    description.parameter(
        Parameter::by_level("epsilon", [1.0, 2.0, 4.0, 8.0, 16.0], doc)
            .range(0.0, 255.0)
            .unit("grey levels of 255"),
    )
}

/// Adds the parameters that say how large a change may be, and by which norm.
pub fn parameters(description: Description) -> Description {
    epsilon(
        description,
        "the size of the change: with `norm=linf` no value changes by more than this, rounded down; with `norm=l2` the root of the mean square of \
         all changes is at most this",
    )
    .parameter(Parameter::choice(
        "norm",
        &["linf", "l2"],
        "how the size of the change is measured: linf by its largest value, l2 by the root of the mean square over all values",
    ))
}

impl Norm {
    /// As the parameter says.
    pub fn of(config: &Config) -> Self {
        if config.text("norm") == "l2" { Self::MeanSquare } else { Self::Largest }
    }
}

/// All changes of a frame that are allowed: in grey levels, a value for each byte.
#[derive(Debug, Clone, Copy)]
pub struct Ball {
    norm: Norm,
    /// The largest change, or the largest root of the sum of squares.
    radius: f64,
}

impl Ball {
    /// The changes of `count` values of a size.
    pub fn new(norm: Norm, epsilon: f64, count: usize) -> Self {
        let radius = match norm {
            Norm::Largest => epsilon.floor(),
            Norm::MeanSquare => epsilon * (count as f64).sqrt(),
        };
        Self { norm, radius }
    }

    /// Whether no change of a byte is allowed.
    pub fn is_empty(&self) -> bool {
        self.radius < 1.0
    }

    /// A change that is drawn: each value evenly within the radius, and with the other norm scaled to a share of it.
    pub fn draw(&self, random: &mut Random, change: &mut [f32]) {
        change.iter_mut().for_each(|value| *value = random.uniform(-1.0, 1.0) as f32);
        let scale = match self.norm {
            Norm::Largest => self.radius,
            Norm::MeanSquare => random.unit() * self.radius / length(change).max(f64::MIN_POSITIVE),
        };
        change.iter_mut().for_each(|value| *value *= scale as f32);
    }

    /// Goes a share of the radius along a gradient, to the side with this sign: by the signs of its values, or along it.
    pub fn climb(&self, change: &mut [f32], gradient: &[f32], side: f64, share: f64) {
        let step = side * share * self.radius;
        match self.norm {
            Norm::Largest => {
                for (value, slope) in change.iter_mut().zip(gradient) {
                    // A slope of zero has no side.
                    *value += if *slope == 0.0 { 0.0 } else { (step as f32).copysign(step as f32 * slope) };
                }
            }
            Norm::MeanSquare => {
                let scale = step / length(gradient).max(f64::MIN_POSITIVE);
                for (value, slope) in change.iter_mut().zip(gradient) {
                    *value += (scale * f64::from(*slope)) as f32;
                }
            }
        }
    }

    /// Takes a change back to what is allowed, and to what the bytes of the frame can hold.
    pub fn keep(&self, change: &mut [f32], frame: Frame<'_>) {
        let radius = self.radius as f32;
        for (value, byte) in change.iter_mut().zip(frame.rows().flatten()) {
            let (low, high) = (-f32::from(*byte), 255.0 - f32::from(*byte));
            *value = match self.norm {
                Norm::Largest => value.clamp(low.max(-radius), high.min(radius)),
                Norm::MeanSquare => value.clamp(low, high),
            };
        }
        if self.norm == Norm::MeanSquare {
            let length = length(change);
            if length > self.radius {
                let scale = self.radius / length;
                change.iter_mut().for_each(|value| *value = (f64::from(*value) * scale) as f32);
            }
        }
    }

    /// Writes the frame with a change that was kept, in whole bytes that are within the ball too: with the mean square the change is made smaller until
    /// rounding does not take it out.
    pub fn write(&self, change: &[f32], frame: Frame<'_>, mut into: FrameMut<'_>) {
        let scale = match self.norm {
            Norm::Largest => 1.0,
            Norm::MeanSquare => self.rounded_scale(change),
        };
        let mut change = change.iter();
        for (to, from) in into.rows_mut().zip(frame.rows()) {
            for ((to, from), change) in to.iter_mut().zip(from).zip(&mut change) {
                *to = (f32::from(*from) + rounded(*change, scale)).clamp(0.0, 255.0) as u8;
            }
        }
    }

    /// The largest factor, by halving, with which the rounded change is within the radius.
    fn rounded_scale(&self, change: &[f32]) -> f32 {
        let fits = |scale: f32| {
            let squares: f64 =
                change.iter().map(|value| f64::from(rounded(*value, scale))).map(|value| value * value).sum();
            squares <= self.radius * self.radius
        };
        let (mut low, mut high) = (0.0, 1.0);
        if fits(high) {
            return high;
        }
        for _ in 0..12 {
            let middle = (low + high) / 2.0;
            if fits(middle) { low = middle } else { high = middle }
        }
        low
    }
}

/// A scaled value, rounded to the nearest whole number.
fn rounded(value: f32, scale: f32) -> f32 {
    (value * scale).round_ties_even()
}

/// The root of the sum of squares.
fn length(values: &[f32]) -> f64 {
    values.iter().map(|value| f64::from(*value) * f64::from(*value)).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(key: u8) -> FrameBuf {
        let mut frame = FrameBuf::new(20, 10);
        Key([key; 32]).frame(0).fill(frame.as_mut().data_mut());
        frame
    }

    fn gradient(key: u8) -> Vec<f32> {
        let mut random = Key([key; 32]).frame(1);
        (0..600).map(|_| random.uniform(-1.0, 1.0) as f32).collect()
    }

    /// How far two frames are apart, by both norms.
    fn apart(a: &FrameBuf, b: &FrameBuf) -> [f64; 2] {
        let far = || a.data().iter().zip(b.data()).map(|(a, b)| f64::from(a.abs_diff(*b)));
        let squares: f64 = far().map(|value| value * value).sum();
        [far().fold(0.0, f64::max), (squares / a.data().len() as f64).sqrt()]
    }

    #[test]
    fn rounded_frames_are_within_the_ball() {
        for (place, norm) in [Norm::Largest, Norm::MeanSquare].into_iter().enumerate() {
            for epsilon in [0.4, 1.0, 1.5, 3.3, 16.0, 200.0] {
                let before = frame(3);
                let ball = Ball::new(norm, epsilon, 600);
                let (mut change, mut after) = (vec![0.0; 600], frame(4));
                ball.draw(&mut Key([1; 32]).frame(0), &mut change);
                for step in 0..6 {
                    ball.climb(&mut change, &gradient(step), if step < 3 { 1.0 } else { -1.0 }, 0.4);
                    ball.keep(&mut change, before.as_ref());
                    ball.write(&change, before.as_ref(), after.as_mut());
                    let far = apart(&before, &after)[place];
                    assert!(far <= epsilon + 1e-12, "{norm:?} {epsilon}: {far}");
                    // Rounding takes little away.
                    let wanted = match norm {
                        Norm::Largest => {
                            change.iter().fold(0.0, |most, value| f64::max(most, value.abs().into()))
                        }
                        Norm::MeanSquare => length(&change) / 600f64.sqrt(),
                    };
                    assert!(far > 0.9 * wanted - 1.0, "{norm:?} {epsilon}: {far} of {wanted}");
                }
            }
        }
    }

    #[test]
    fn a_step_goes_by_signs_or_along_the_gradient() {
        let mut change = vec![0.0; 4];
        Ball::new(Norm::Largest, 8.0, 4).climb(&mut change, &[2.0, -0.1, 0.0, 1e-9], -1.0, 0.5);
        assert_eq!(change, [-4.0, 4.0, 0.0, -4.0]);
        let mut change = vec![0.0; 4];
        // A radius of 8 times the root of 4.
        Ball::new(Norm::MeanSquare, 8.0, 4).climb(&mut change, &[3.0, -4.0, 0.0, 0.0], 1.0, 0.5);
        assert_eq!(change, [4.8, -6.4, 0.0, 0.0]);
    }
}
