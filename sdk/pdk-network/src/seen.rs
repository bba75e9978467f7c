//! Turns the numbers of an image back into a picture: what the network sees, for people.

use pdk_sdk::error::{Error, Result};
use pdk_sdk::ops::hsv::hsv_to_rgb;
use pdk_sdk::prelude::{Frame, FrameBuf};

use crate::color::Color;
use crate::described::Differences;
use crate::eye::Eye;
use crate::numbers::Numbers;
use crate::plan::Plan;
use crate::resize::{Filter, Resizer};

/// Pixels between two pictures.
const GAP: usize = 8;

/// The frame beside what the network sees of it: each place of a stack below the one before, and numbers back in red, green and blue.
/// Differences are grey where nothing changed.
///
/// # Errors
/// If nothing is left of the frame.
pub fn picture(plan: &Plan, frame: Frame<'_>) -> Result<FrameBuf> {
    let mut eye = Eye::new(plan);
    let fitted = eye.fit(frame)?;
    let mut values = vec![0.0; plan.image.shape.iter().product()];
    eye.see(fitted.as_ref(), &mut values);
    let slots: Vec<FrameBuf> =
        (0..plan.image.slots).map(|slot| slot_of(plan, &values, slot)).collect::<Result<_>>()?;
    // Small images are shown larger, pixel by pixel.
    let (width, height) = eye.size();
    let times = (frame.height() / (height * slots.len()).max(1)).clamp(1, 4);
    let tall = slots.len() * (height * times + GAP) - GAP;
    let mut sheet = FrameBuf::new(frame.width() + GAP + width * times, tall.max(frame.height()));
    paste(frame, &mut sheet, 0, 0);
    for (place, slot) in slots.iter().enumerate() {
        let mut large = FrameBuf::new(width * times, height * times);
        let to = [width * times, height * times];
        Resizer::new(Filter::Nearest, [width, height], to).resize(slot.as_ref(), large.as_mut());
        paste(large.as_ref(), &mut sheet, frame.width() + GAP, place * (height * times + GAP));
    }
    Ok(sheet)
}

/// A place of the stack as a picture.
fn slot_of(plan: &Plan, values: &[f32], slot: usize) -> Result<FrameBuf> {
    let image = &plan.image;
    let described = &plan.described;
    let numbers = Numbers::new(plan.scale, &described.mean, &described.std, image.channels);
    let stride =
        |letter: char| image.axis(letter).map(|axis| image.shape[axis + 1..].iter().product::<usize>());
    let [across, down, deep] = ['w', 'h', 'c'].map(|letter| stride(letter).unwrap_or_default());
    let next = stride('t').unwrap_or(deep * image.channels);
    let is_difference = match described.differences {
        Differences::None => false,
        Differences::Only => true,
        Differences::Both => slot > 0,
    };
    let (low, high) = numbers.range();
    let mut bytes = Vec::with_capacity(image.width * image.height * 3);
    for y in 0..image.height {
        for x in 0..image.width {
            let at = |channel: usize| {
                values[slot * next + y * down + x * across + channel.min(image.channels - 1) * deep]
            };
            bytes.extend(match is_difference {
                true => [0, 1, 2]
                    .map(|channel| (127.5 + 127.5 * at(channel) / (high - low)).round_ties_even() as u8),
                false => {
                    let channels =
                        [0, 1, 2].map(|channel| numbers.byte(channel.min(image.channels - 1), at(channel)));
                    rgb(plan.color, channels)
                }
            });
        }
    }
    FrameBuf::from_vec(bytes, image.width, image.height).map_err(|error| Error::new(error.to_string()))
}

/// Bytes in a network's colours as red, green and blue.
fn rgb(color: Color, [a, b, c]: [u8; 3]) -> [u8; 3] {
    match color {
        Color::Rgb | Color::Grey => [a, b, c],
        Color::Bgr => [c, b, a],
        Color::Hsv => hsv_to_rgb([a.min(179), b, c]),
        Color::Yuv => {
            let [y, u, v] = [f64::from(a), f64::from(b) - 128.0, f64::from(c) - 128.0];
            [y + v / 0.877, y - 0.395 * u - 0.581 * v, y + u / 0.492].map(|value| (value + 0.5) as u8)
        }
    }
}

fn paste(from: Frame<'_>, into: &mut FrameBuf, left: usize, top: usize) {
    let mut into = into.as_mut();
    for (y, row) in from.rows().enumerate() {
        into.row_mut(top + y)[left * 3..][..row.len()].copy_from_slice(row);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Declared, Described, Element, Given, Port};
    use pdk_sdk::serde_json::{Value, json};

    fn plan(shape: &[usize], fields: Value) -> Plan {
        let port = |name: &str, shape: &[usize]| Port {
            name: name.to_owned(),
            element: Element::Float32,
            shape: Some(shape.iter().map(|dim| Ok(*dim)).collect()),
        };
        let declared =
            Declared { inputs: vec![port("image", shape)], outputs: vec![port("steering", &[1, 1])] };
        let mut given = Given::default();
        for (name, value) in fields.as_object().unwrap() {
            given.set(name, value.clone(), "a test");
        }
        Plan::new(&declared, Described::new(given).unwrap()).unwrap()
    }

    #[test]
    fn what_a_network_sees_is_the_frame_again_in_its_colours() {
        let bytes: Vec<u8> = (0..8 * 8 * 3).map(|i| (60 + i * 37 % 120) as u8).collect();
        let frame = Frame::new(&bytes, 8, 8).unwrap();
        for color in ["rgb", "bgr", "yuv", "hsv"] {
            let fields = json!({"color": color, "scale": "0..1", "mean": [0.4, 0.5, 0.6], "std": 0.2});
            let sheet = picture(&plan(&[1, 3, 8, 8], fields), frame).unwrap();
            assert_eq!((sheet.width(), sheet.height()), (8 + GAP + 8, 8));
            for (x, y) in [(0, 0), (3, 5), (7, 7)] {
                let (before, after) = (frame.pixel(x, y), sheet.as_ref().pixel(8 + GAP + x, y));
                let far = before.iter().zip(after).map(|(a, b)| a.abs_diff(b)).max().unwrap();
                assert!(far <= 8, "{color} at {x}, {y}: {before:?} {after:?}");
            }
        }
        let stack = json!({"frames": 2, "differences": "both", "color": "rgb", "scale": "0..1"});
        let sheet = picture(&plan(&[1, 6, 8, 8], stack), frame).unwrap();
        assert_eq!(sheet.height(), 8 + GAP + 8);
        assert_eq!(sheet.as_ref().pixel(8 + GAP, 8 + GAP), [128; 3], "nothing has changed");
    }
}
