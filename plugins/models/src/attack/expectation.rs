//! What may happen to a frame between an attack and the network, so that the attack survives it: the mean over drawn changes takes the place of the frame as
//! it is (expectation over transformation).
//!
//! Each change moves the frame, blurs it, scales its values and adds noise, in this order. Its gradient goes back through all four exactly, but for the
//! rounding to whole bytes, which counts as if it were not there.

use pdk_sdk::prelude::*;

use super::network::Attacked;

/// The option by which the mean is taken over changes.
const CHANGES: &str = "changes";

/// How far a drawn change goes at most.
#[derive(Debug, Clone, Copy)]
struct Limits {
    shift: i64,
    blur: f64,
    brightness: f64,
    noise: f64,
}

/// A network under attack, behind changes that are drawn.
pub struct Expectation {
    network: Attacked,
    draws: usize,
    limits: Limits,
    drawn: Vec<Change>,
    changed: FrameBuf,
    values: Vec<f32>,
    scratch: Vec<f32>,
}

/// A change of a frame that was drawn.
struct Change {
    right: isize,
    down: isize,
    /// The weights of a pixel and of its neighbours to one side, by distance.
    kernel: Vec<f32>,
    gain: f32,
    noise: Vec<f32>,
}

/// Adds the parameters that say over what the mean is taken.
pub fn parameters(description: Description) -> Description {
    let limit = |name: &str, default: f64, most: f64, unit: &str, doc: &str| {
        Parameter::number(name, default, doc).range(0.0, most).unit(unit).only_for("expectation", CHANGES)
    };
    description
        .parameter(Parameter::choice(
            "expectation",
            &["none", CHANGES],
            "over what the steering and its gradient are averaged: over nothing, so that the network sees the frame as it is, or over drawn changes of it, so that \
             the attack survives such changes",
        ))
        .parameter(
            Parameter::integer("changes", 8, "over how many drawn changes of a frame the mean is taken")
                .range(1.0, 1000.0)
                .only_for("expectation", CHANGES),
        )
        .parameter(limit("shift", 2.0, 100.0, "pixels", "how far a drawn change moves the frame at most along each axis, rounded down"))
        .parameter(limit("blur", 1.0, 20.0, "pixels", "the largest standard deviation of the Gaussian blur of a drawn change"))
        .parameter(limit("brightness", 0.2, 1.0, "", "by which share a drawn change makes all values greater or smaller at most"))
        .parameter(limit("noise", 8.0, 255.0, "grey levels of 255", "the standard deviation of the noise of a drawn change"))
}

impl Expectation {
    /// As the parameters say.
    pub fn of(config: &Config, network: Attacked) -> Self {
        Self {
            network,
            // 0 if they have no effect.
            draws: config.integer("changes") as usize,
            limits: Limits {
                shift: config.number("shift") as i64,
                blur: config.number("blur"),
                brightness: config.number("brightness"),
                noise: config.number("noise"),
            },
            drawn: Vec::new(),
            changed: FrameBuf::default(),
            values: Vec::new(),
            scratch: Vec::new(),
        }
    }

    /// Draws the changes for a frame of this size, which stay the same for all that is tried on it.
    pub fn start(&mut self, width: usize, height: usize, speed: Option<f64>, random: &mut Random) {
        self.network.move_at(speed);
        self.changed.resize(width, height);
        self.drawn.clear();
        self.drawn.extend((0..self.draws).map(|_| Change::draw(&self.limits, width * height * 3, random)));
    }

    /// The mean steering over the changes of a frame.
    ///
    /// # Errors
    /// If the network fails.
    pub fn steering(&mut self, frame: Frame<'_>) -> Result<f64> {
        let Self { network, drawn, changed, values, scratch, .. } = self;
        if drawn.is_empty() {
            return network.steering(frame);
        }
        let mut sum = 0.0;
        for change in drawn.iter() {
            change.apply(frame, values, scratch, changed.as_mut());
            sum += network.steering(changed.as_ref())?;
        }
        Ok(sum / drawn.len() as f64)
    }

    /// The mean steering over the changes of a frame, and how it changes with each of the frame's bytes, row by row.
    ///
    /// # Errors
    /// If the network fails.
    pub fn gradient(&mut self, frame: Frame<'_>) -> Result<(f64, Vec<f32>)> {
        let Self { network, drawn, changed, values, scratch, .. } = self;
        if drawn.is_empty() {
            return network.gradient(frame);
        }
        let (mut steering, mut mean) = (0.0, vec![0.0; frame.width() * frame.height() * 3]);
        let share = 1.0 / drawn.len() as f64;
        for change in drawn.iter() {
            change.apply(frame, values, scratch, changed.as_mut());
            let (found, mut gradient) = network.gradient(changed.as_ref())?;
            change.back(&mut gradient, values, scratch, frame.width());
            steering += found * share;
            mean.iter_mut().zip(&gradient).for_each(|(mean, slope)| *mean += slope * share as f32);
        }
        Ok((steering, mean))
    }
}

impl Change {
    fn draw(limits: &Limits, count: usize, random: &mut Random) -> Self {
        let mut shift =
            || (random.uniform(-1.0, 1.0) * (limits.shift as f64 + 0.5)).round_ties_even() as isize;
        let [right, down] =
            [shift(), shift()].map(|far| far.clamp(-limits.shift as isize, limits.shift as isize));
        let kernel = kernel(random.unit() * limits.blur);
        let gain = 1.0 + random.uniform(-1.0, 1.0) * limits.brightness;
        let noise = (0..count).map(|_| (random.normal() * limits.noise) as f32).collect();
        Self { right, down, kernel, gain: gain as f32, noise }
    }

    /// Writes what becomes of a frame. The values before they are held to the range of a byte stay for [`Self::back`].
    fn apply(&self, frame: Frame<'_>, values: &mut Vec<f32>, scratch: &mut Vec<f32>, mut into: FrameMut<'_>) {
        let (width, height) = (frame.width(), frame.height());
        values.clear();
        for y in 0..height {
            let row = frame.row(shifted(y, self.down, height));
            for x in 0..width {
                let at = shifted(x, self.right, width) * 3;
                values.extend(row[at..at + 3].iter().map(|byte| f32::from(*byte)));
            }
        }
        blur(values, scratch, width, &self.kernel, Direction::There);
        values.iter_mut().zip(&self.noise).for_each(|(value, noise)| *value = *value * self.gain + noise);
        for (y, row) in values.chunks_exact(width * 3).enumerate() {
            let bytes = into.row_mut(y).iter_mut().zip(row);
            bytes.for_each(|(byte, value)| *byte = value.round_ties_even().clamp(0.0, 255.0) as u8);
        }
    }

    /// Turns the gradient with respect to what came out into the one with respect to the frame. `values` are those that [`Self::apply`] left.
    fn back(&self, gradient: &mut [f32], values: &[f32], scratch: &mut Vec<f32>, width: usize) {
        for (slope, value) in gradient.iter_mut().zip(values) {
            *slope *= if (0.0..=255.0).contains(value) { self.gain } else { 0.0 };
        }
        blur(gradient, scratch, width, &self.kernel, Direction::Back);
        scratch.clear();
        scratch.extend_from_slice(gradient);
        gradient.fill(0.0);
        let height = gradient.len() / 3 / width;
        for (at, slope) in scratch.iter().enumerate() {
            let (y, x, channel) = (at / 3 / width, at / 3 % width, at % 3);
            let from = shifted(y, self.down, height) * width + shifted(x, self.right, width);
            gradient[from * 3 + channel] += slope;
        }
    }
}

/// The place that a pixel is taken from; beyond the edge, that is the edge.
fn shifted(at: usize, by: isize, length: usize) -> usize {
    at.saturating_add_signed(-by).min(length - 1)
}

/// The weights of a Gaussian blur, by distance.
fn kernel(deviation: f64) -> Vec<f32> {
    let reach = (deviation * 3.0) as usize;
    if reach == 0 {
        return vec![1.0];
    }
    let weight = |far: usize| libm::exp(-((far * far) as f64) / (2.0 * deviation * deviation));
    let sum = 1.0 + 2.0 * (1..=reach).map(weight).sum::<f64>();
    (0..=reach).map(|far| (weight(far) / sum) as f32).collect()
}

/// Which way a blur is gone.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Direction {
    /// From a picture to the blurred one.
    There,
    /// From the gradient with respect to the blurred picture to that with respect to the picture.
    Back,
}

/// Blurs along both axes. Beyond the edge lies what is at the edge.
fn blur(values: &mut [f32], scratch: &mut Vec<f32>, width: usize, kernel: &[f32], direction: Direction) {
    if kernel.len() == 1 {
        return;
    }
    let height = values.len() / 3 / width;
    for (length, stride) in [(width, 3), (height, width * 3)] {
        scratch.clear();
        scratch.resize(values.len(), 0.0);
        for to in 0..values.len() {
            let at = to / stride % length;
            let line = to - at * stride;
            for (far, weight) in kernel.iter().enumerate() {
                let sides = [at.saturating_sub(far), (at + far).min(length - 1)];
                for side in &sides[..if far == 0 { 1 } else { 2 }] {
                    let from = line + side * stride;
                    match direction {
                        Direction::There => scratch[to] += weight * values[from],
                        Direction::Back => scratch[from] += weight * values[to],
                    }
                }
            }
        }
        values.copy_from_slice(scratch);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawn(limits: Limits, count: usize) -> Change {
        Change::draw(&limits, count, &mut Key([9; 32]).frame(0))
    }

    fn frame(width: usize, height: usize) -> FrameBuf {
        let mut frame = FrameBuf::new(width, height);
        Key([3; 32]).frame(1).fill(frame.as_mut().data_mut());
        // Away from both ends, so that nothing is held.
        frame.as_mut().data_mut().iter_mut().for_each(|byte| *byte = 64 + *byte / 2);
        frame
    }

    fn applied(change: &Change, frame: &FrameBuf) -> Vec<f32> {
        let (mut values, mut scratch) = (Vec::new(), Vec::new());
        let mut into = FrameBuf::new(frame.width(), frame.height());
        change.apply(frame.as_ref(), &mut values, &mut scratch, into.as_mut());
        for (value, byte) in values.iter().zip(into.data()) {
            assert!((value - f32::from(*byte)).abs() <= 0.5, "{value} {byte}");
        }
        values
    }

    #[test]
    fn the_gradient_goes_back_as_differences_say() {
        let (width, height) = (9, 7);
        let limits = Limits { shift: 3, blur: 1.5, brightness: 0.2, noise: 4.0 };
        let drawn = drawn(limits, width * height * 3);
        let change = Change { right: 2, down: -1, kernel: kernel(0.8), ..drawn };
        let frame = frame(width, height);
        let before = applied(&change, &frame);
        let weights: Vec<f32> = (0..before.len()).map(|at| (at * 29 % 17) as f32 - 8.0).collect();
        let mut gradient = weights.clone();
        change.back(&mut gradient, &before, &mut Vec::new(), width);
        for (at, slope) in gradient.iter().enumerate() {
            let mut moved = frame.clone();
            moved.as_mut().data_mut()[at] += 10;
            let after = applied(&change, &moved);
            let difference: f32 =
                after.iter().zip(&before).zip(&weights).map(|((a, b), weight)| (a - b) * weight).sum();
            assert!((slope - difference / 10.0).abs() < 1e-3, "{at}: {slope} {}", difference / 10.0);
        }
    }

    #[test]
    fn what_is_held_at_an_end_has_no_slope() {
        let change = Change { right: 0, down: 0, kernel: vec![1.0], gain: 2.0, noise: vec![0.0; 6] };
        let frame = FrameBuf::from_vec(vec![10, 127, 128, 200, 0, 255], 2, 1).unwrap();
        let mut values = Vec::new();
        change.apply(frame.as_ref(), &mut values, &mut Vec::new(), FrameBuf::new(2, 1).as_mut());
        let mut gradient = vec![1.0; 6];
        change.back(&mut gradient, &values, &mut Vec::new(), 2);
        assert_eq!(gradient, [2.0, 2.0, 0.0, 0.0, 2.0, 0.0]);
    }

    #[test]
    fn changes_stay_within_their_limits() {
        let mut random = Key([5; 32]).frame(0);
        let limits = Limits { shift: 2, blur: 1.0, brightness: 0.1, noise: 3.0 };
        let changes: Vec<_> = (0..200).map(|_| Change::draw(&limits, 300, &mut random)).collect();
        for far in -2..=2 {
            assert!(
                changes.iter().any(|change| change.right == far)
                    && changes.iter().any(|change| change.down == far)
            );
        }
        for change in &changes {
            assert!(change.right.abs() <= 2 && change.down.abs() <= 2 && (change.gain - 1.0).abs() <= 0.1);
            let sum = change.kernel[0] + 2.0 * change.kernel[1..].iter().sum::<f32>();
            assert!((sum - 1.0).abs() < 1e-5, "{sum}");
        }
        let none = drawn(Limits { shift: 0, blur: 0.0, brightness: 0.0, noise: 0.0 }, 63);
        let frame = frame(7, 3);
        assert!(
            applied(&none, &frame).iter().zip(frame.data()).all(|(value, byte)| *value == f32::from(*byte))
        );
    }
}
