//! Tests of the image, on frames whose numbers are known.

use super::*;
use crate::{Declared, Described, Element, Given, Port};
use pdk_sdk::serde_json::{Value, json};

fn eye(shape: &[usize], fields: Value) -> (Eye, usize) {
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
    let plan = Plan::new(&declared, Described::new(given).unwrap()).unwrap();
    (Eye::new(&plan), shape.iter().product())
}

/// A frame of two pixels: `value` and the next two, then the same plus 10.
fn frame(value: u8) -> FrameBuf {
    FrameBuf::from_vec([0, 1, 2, 10, 11, 12].map(|step| value + step).to_vec(), 2, 1).unwrap()
}

fn see(eye: &mut Eye, len: usize, value: u8) -> Vec<f32> {
    let mut values = vec![f32::NAN; len];
    let fitted = eye.fit(frame(value).as_ref()).unwrap();
    eye.see(fitted.as_ref(), &mut values);
    values
}

#[test]
fn axes_are_in_the_order_of_the_layout() {
    for (shape, layout, expected) in [
        (vec![1, 3, 1, 2], "nchw", [20.0, 30.0, 21.0, 31.0, 22.0, 32.0]),
        (vec![1, 1, 2, 3], "nhwc", [20.0, 21.0, 22.0, 30.0, 31.0, 32.0]),
    ] {
        let (mut eye, len) = eye(&shape, json!({"layout": layout}));
        assert_eq!(see(&mut eye, len, 20), expected, "{layout}");
    }
    // Two grey frames, whose luma is the middle of the three.
    for (shape, layout, expected) in [
        (vec![1, 2, 1, 2], "nchw", [21.0, 31.0, 51.0, 61.0]),
        (vec![1, 1, 2, 2], "nhwc", [21.0, 51.0, 31.0, 61.0]),
        (vec![1, 2, 1, 1, 2], "ntchw", [21.0, 31.0, 51.0, 61.0]),
        (vec![1, 2, 1, 2, 1], "nthwc", [21.0, 31.0, 51.0, 61.0]),
        (vec![1, 1, 2, 1, 2], "ncthw", [21.0, 31.0, 51.0, 61.0]),
    ] {
        let (mut eye, len) = eye(&shape, json!({"layout": layout, "frames": 2, "color": "grey"}));
        see(&mut eye, len, 20);
        assert_eq!(see(&mut eye, len, 50), expected, "{layout}");
    }
    // The channels of colour frames in an axis before that of time.
    let (mut eye, len) = eye(&[1, 3, 2, 1, 2], json!({"layout": "ncthw"}));
    see(&mut eye, len, 20);
    let expected = [20, 30, 50, 60, 21, 31, 51, 61, 22, 32, 52, 62].map(|v| v as f32);
    assert_eq!(see(&mut eye, len, 50), expected);
}

#[test]
fn a_stack_has_its_spacing_and_begins_again_when_it_forgets() {
    // Of grey frames, the first pixel of each.
    let firsts = |fields: Value, values: &[u8]| -> Vec<Vec<f32>> {
        let (mut eye, len) = eye(&[1, 3, 1, 2], fields);
        let mut all: Vec<_> = values.iter().map(|value| see(&mut eye, len, *value)).collect();
        eye.forget();
        all.push(see(&mut eye, len, 100));
        all.into_iter().map(|values| values.iter().step_by(2).map(|value| value - 1.0).collect()).collect()
    };
    let stack = |more: Value| {
        let mut fields = json!({"frames": 3, "color": "grey", "layout": "nchw"});
        fields.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        fields
    };
    assert_eq!(
        firsts(stack(json!({})), &[10, 20, 30, 40]),
        [[10.0; 3], [10.0, 10.0, 20.0], [10.0, 20.0, 30.0], [20.0, 30.0, 40.0], [100.0; 3]]
    );
    assert_eq!(
        firsts(stack(json!({"spacing": 2, "order": "newest_first"})), &[10, 20, 30, 40, 50, 60])[2..],
        [[30.0, 10.0, 10.0], [40.0, 20.0, 10.0], [50.0, 30.0, 10.0], [60.0, 40.0, 20.0], [100.0; 3]]
    );
    let zeros = firsts(stack(json!({"start": "zeros"})), &[10, 20]);
    assert_eq!(zeros, [[-1.0, -1.0, 10.0], [-1.0, 10.0, 20.0], [-1.0, -1.0, 100.0]]);
}

#[test]
fn differences_are_of_neighbours() {
    let fields =
        json!({"frames": 3, "differences": "only", "color": "grey", "layout": "nchw", "scale": "0..255"});
    let (mut eye_only, len) = eye(&[1, 2, 1, 2], fields);
    see(&mut eye_only, len, 10);
    see(&mut eye_only, len, 15);
    assert_eq!(see(&mut eye_only, len, 35), [5.0, 5.0, 20.0, 20.0]);
    let fields =
        json!({"frames": 2, "differences": "both", "color": "grey", "layout": "nchw", "scale": "0..255"});
    let (mut eye_both, len) = eye(&[1, 2, 1, 2], fields);
    see(&mut eye_both, len, 10);
    assert_eq!(see(&mut eye_both, len, 15), [16.0, 26.0, 5.0, 5.0]);
}

#[test]
fn the_part_that_is_seen_follows_the_size_of_the_frame() {
    let fields = json!({"frame": [320, 160], "crop": {"top": 60, "bottom": 25}});
    let (mut eye, _) = eye(&[1, 3, 75, 320], fields);
    assert_eq!(eye.part(320, 160).unwrap(), Part { left: 0, top: 60, width: 320, height: 75 });
    assert_eq!(eye.part(160, 80).unwrap(), Part { left: 0, top: 30, width: 160, height: 38 });
    // A frame of half the size is enlarged before it is cut.
    let small = FrameBuf::from_vec(vec![9; 160 * 80 * 3], 160, 80).unwrap();
    assert_eq!(eye.fit(small.as_ref()).unwrap(), FrameBuf::from_vec(vec![9; 320 * 75 * 3], 320, 75).unwrap());
}
