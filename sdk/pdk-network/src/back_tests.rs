//! Gradients with respect to frames against differences of what the network gets.

use pdk_sdk::prelude::FrameBuf;
use pdk_sdk::serde_json::{Value, json};

use super::*;
use crate::{Declared, Described, Element, Given, Plan, Port};

fn eye(shape: &[usize], fields: &Value) -> Eye {
    let port = |name: &str, shape: &[usize]| Port {
        name: name.to_owned(),
        element: Element::Float32,
        shape: Some(shape.iter().map(|dim| Ok(*dim)).collect()),
    };
    let declared = Declared { inputs: vec![port("image", shape)], outputs: vec![port("steering", &[1, 1])] };
    let mut given = Given::default();
    for (name, value) in fields.as_object().unwrap() {
        given.set(name, value.clone(), "a test");
    }
    Eye::new(&Plan::new(&declared, Described::new(given).unwrap()).unwrap())
}

/// The weighted sum of the numbers that a network gets for a frame, and how much they can add up to.
fn sum(eye: &mut Eye, frame: &FrameBuf, weights: &[f32]) -> f64 {
    let mut numbers = vec![0.0; weights.len()];
    let fitted = eye.fit(frame.as_ref()).unwrap();
    eye.see_first(fitted.as_ref(), &mut numbers);
    numbers.iter().zip(weights).map(|(number, weight)| f64::from(*number) * f64::from(*weight)).sum()
}

/// How far the gradient of a weighted sum is from differences over `reach` on both sides: the root of the mean square, relative to that of the gradient. The
/// weights are smooth, so that the rounding of bytes matters little.
fn error(shape: &[usize], fields: &Value, [width, height]: [usize; 2], color: [u8; 3], reach: u8) -> f64 {
    let mut eye = eye(shape, fields);
    let weights: Vec<f32> =
        (0..shape.iter().product()).map(|at: usize| 1.0 + 0.5 * libm::sinf(at as f32 * 0.37)).collect();
    let mut frame = FrameBuf::new(width, height);
    for (x, y) in (0..width * height).map(|at| (at % width, at / width)) {
        let shade = (x * 7 + y * 11) as u8 % 16;
        frame.as_mut().set_pixel(x, y, color.map(|value| value + shade));
    }
    let gradient = eye.back(frame.as_ref(), &weights).unwrap();
    assert_eq!(gradient.len(), width * height * 3);
    let largest = gradient.iter().fold(0.0f64, |most, value| most.max(f64::from(value.abs())));
    assert!(largest > 0.0, "{fields}");
    let (mut apart, mut whole) = (0.0f64, 0.0f64);
    for (at, &slope) in gradient.iter().enumerate() {
        let mut moved = |by: i16| {
            let mut moved = frame.clone();
            let mut view = moved.as_mut();
            let value = &mut view.data_mut()[at];
            *value = (i16::from(*value) + by) as u8;
            sum(&mut eye, &moved, &weights)
        };
        let difference =
            (moved(i16::from(reach)) - moved(-i16::from(reach))) / f64::from(2 * u16::from(reach));
        apart += (difference - f64::from(slope)).powi(2);
        whole += f64::from(slope).powi(2);
    }
    (apart / whole).sqrt()
}

const COLOR: [u8; 3] = [90, 130, 110];

#[test]
fn every_filter_is_passed_backwards() {
    for filter in crate::resize::NAMES {
        for (shape, size) in [([1, 3, 6, 8], [16, 12]), ([1, 3, 6, 8], [19, 13]), ([1, 3, 9, 12], [8, 6])] {
            let fields = json!({"resize": filter, "scale": "-1..1", "mean": 0.1, "std": [0.5, 1.0, 2.0]});
            let far = error(&shape, &fields, size, COLOR, 60);
            // Both passes of some filters round to bytes.
            assert!(far < 0.1, "{filter} {size:?} to {shape:?}: {far}");
        }
    }
}

#[test]
fn every_colour_is_passed_backwards() {
    for color in crate::color::NAMES {
        let channels = if color == "grey" { 1 } else { 3 };
        // Hue is rounded to two degrees, and curved.
        let (reach, allowed) = if color == "hsv" { (12, 0.12) } else { (60, 0.03) };
        let far = error(&[1, channels, 4, 5], &json!({"color": color}), [5, 4], [70, 170, 110], reach);
        assert!(far < allowed, "{color}: {far}");
    }
}

#[test]
fn crops_sizes_and_stacks_are_passed_backwards() {
    for (shape, fields) in [
        (vec![1, 3, 4, 5], json!({"crop": {"top": 3, "left": 1}})),
        (vec![1, 3, 4, 5], json!({"frame": [20, 16], "region": [0.1, 0.25, 1.0, 0.9], "resize": "area"})),
        (vec![1, 4, 5, 9], json!({"layout": "nhwc", "frames": 3, "color": "rgb"})),
        (vec![1, 3, 4, 5, 3], json!({"layout": "nthwc", "frames": 3, "start": "zeros"})),
        (vec![1, 6, 4, 5], json!({"frames": 2, "differences": "both", "color": "rgb"})),
    ] {
        let far = error(&shape, &fields, [10, 8], COLOR, 60);
        assert!(far < 0.05, "{fields}: {far}");
    }
}

#[test]
fn differences_alone_do_not_change_with_a_frame_that_stands_alone() {
    let of = |fields: Value| eye(&[1, 3, 4, 5], &fields).first_matters();
    assert!(!of(json!({"frames": 2, "differences": "only", "color": "rgb"})));
    assert!(of(json!({"frames": 2, "differences": "only", "color": "rgb", "start": "zeros"})));
    assert!(of(json!({})));
}
