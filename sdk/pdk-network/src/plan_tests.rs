//! Tests of what inputs get.

use super::*;
use crate::{Given, Inputs};
use pdk_sdk::serde_json::{Value, json};

/// A port; a dimension of 0 is left open.
fn port(name: &str, shape: &[usize]) -> Port {
    let dims = shape.iter().map(|dim| if *dim == 0 { Err("batch".to_owned()) } else { Ok(*dim) });
    Port { name: name.to_owned(), element: Element::Float32, shape: Some(dims.collect()) }
}

fn plan_of(inputs: &[Port], fields: Value) -> Result<Plan> {
    let outputs = vec![port("steering", &[1, 1]), port("h_out", &[1, 4])];
    let mut given = Given::default();
    for (name, value) in fields.as_object().unwrap() {
        given.set(name, value.clone(), "pilot.toml line 1");
    }
    Plan::new(&Declared { inputs: inputs.to_vec(), outputs }, Described::new(given)?)
}

fn plan(shape: &[usize], fields: Value) -> Result<Plan> {
    plan_of(&[port("image", shape)], fields)
}

fn error(shape: &[usize], fields: Value) -> String {
    plan(shape, fields).unwrap_err().to_string()
}

#[test]
fn layout_size_and_stack_follow_from_the_shape() {
    let image = |shape: &[usize], fields: Value| plan(shape, fields).unwrap().image;
    let nchw = image(&[0, 3, 4, 6], json!({}));
    assert_eq!((nchw.layout, nchw.channels, nchw.height, nchw.width), ("nchw", 3, 4, 6));
    assert_eq!(nchw.shape, [1, 3, 4, 6]);
    assert_eq!(image(&[1, 4, 6, 1], json!({})).layout, "nhwc");
    assert_eq!(image(&[1, 3, 4, 3], json!({"layout": "nhwc"})).width, 4);
    let stack = image(&[1, 9, 4, 6], json!({"frames": 3}));
    assert_eq!((stack.channels, stack.frames, stack.slots), (3, 3, 3));
    let time = image(&[1, 20, 12, 16, 3], json!({}));
    assert_eq!((time.layout, time.frames, time.channels), ("nthwc", 20, 3));
    assert_eq!(image(&[1, 3, 8, 12, 16], json!({})).layout, "ncthw");
    let open = image(&[1, 3, 0, 0], json!({"image_size": [200, 66]}));
    assert_eq!((open.width, open.height), (200, 66));
    let differences = image(&[1, 2, 4, 6], json!({"frames": 3, "differences": "only", "color": "grey"}));
    assert_eq!((differences.slots, differences.channels), (2, 1));
}

#[test]
fn what_a_frame_goes_through_is_reported_as_it_was_given() {
    let fields =
        json!({"crop": {"top": 0.4}, "resize": "pil_bilinear", "scale": "0..1", "mean": [0.5, 0.25, 0.5]});
    let reasons = plan(&[1, 3, 4, 6], fields).unwrap().reasons;
    for (field, value) in [("crop", r#"{"top":0.4}"#), ("resize", "pil_bilinear"), ("mean", "[0.5,0.25,0.5]")]
    {
        let reason = reasons.iter().find(|reason| reason.subject == field).unwrap();
        assert_eq!((reason.value.as_str(), reason.why.as_str()), (value, "pilot.toml line 1 says so"));
    }
    assert!(reasons.iter().all(|reason| reason.subject != "std"), "{reasons:?}");
}

#[test]
fn what_is_only_a_convention_is_reported() {
    let assumed = |shape: &[usize], fields: Value| plan(shape, fields).unwrap().assumptions();
    assert_eq!(assumed(&[1, 3, 4, 6], json!({})).unwrap(), "color rgb, scale 0..255");
    assert_eq!(assumed(&[1, 3, 4, 6], json!({"scale": "0..1"})).unwrap(), "color rgb");
    assert_eq!(assumed(&[1, 3, 4, 6], json!({"scale": "0..1", "color": "bgr"})), None);
    let speed = [port("image", &[1, 3, 4, 6]), port("speed", &[1, 1])];
    let fields = json!({"scale": "0..1", "color": "rgb"});
    assert_eq!(plan_of(&speed, fields).unwrap().assumptions().unwrap(), "input speed the speed in m/s");
}

#[test]
fn a_description_that_contradicts_the_file_is_an_error_with_its_place_and_a_remedy() {
    let expected = "its input `image` has the shape (batch, 10), but has to be an image: (1, channels, height, width) or (1, height, width, channels) \
                    with 1 or 3 channels, or a stack of such";
    assert_eq!(error(&[0, 10], json!({})), expected);
    assert!(error(&[1, 9, 4, 6], json!({})).ends_with("; if it stacks frames, set `frames`"));
    assert!(error(&[8, 3, 5, 6], json!({})).contains("several frames at once"));
    assert!(error(&[1, 3, 4, 3], json!({})).contains("set `layout` to nchw or nhwc"));
    assert!(error(&[1, 3, 0, 0], json!({})).contains("without a fixed height and width; set `image_size`"));
    assert!(error(&[1, 3, 99_999_999, 6], json!({})).contains("larger than"));
    for (shape, fields, expected) in [
        (
            vec![1, 3, 5, 6],
            json!({"layout": "nhwc"}),
            "`layout` is nhwc, but the input `image` has the shape (1, 3, 5, 6), and its channels would have to be 1 or 3",
        ),
        (
            vec![1, 3, 5, 6],
            json!({"layout": "nthwc"}),
            "`layout` is nthwc, but the input `image` has the shape (1, 3, 5, 6); leave it out",
        ),
        (vec![1, 3, 5, 6], json!({"image_size": [200, 66]}), "`image_size` is [200, 66], but the input"),
        (
            vec![1, 3, 5, 6],
            json!({"dtype": "uint8"}),
            "`dtype` is uint8, but the network's input `image` is float32; leave it out",
        ),
        (
            vec![1, 3, 5, 6],
            json!({"mean": [1, 2], "scale": "0..1"}),
            "`mean` has 2 numbers, but a frame has 3 channels",
        ),
        (
            vec![1, 4, 5, 6, 3],
            json!({"frames": 3}),
            "`frames` is 3, but the image has the shape (1, 4, 5, 6, 3); set 4 frames",
        ),
        (
            vec![1, 3, 5, 6],
            json!({"inputs": {"imgae": "image"}}),
            "`inputs` names the input `imgae`, which the network does not have; there is only `image`",
        ),
        (
            vec![1, 3, 5, 6],
            json!({"state": {"image": "steerin"}}),
            "`state` names the output `steerin`, which the network does not have; did you mean `steering`?",
        ),
    ] {
        let error = error(&shape, fields);
        assert!(error.starts_with("pilot.toml line 1: ") || error.contains("there is only"), "{error}");
        assert!(error.contains(expected.split("; there is only").next().unwrap()), "{error}");
    }
    let grey = error(&[1, 3, 5, 6], json!({"color": "grey", "layout": "nchw"}));
    assert!(
        grey.contains("its channels would have to be 1; correct `layout`, `color` or `frames`"),
        "{grey}"
    );
}

#[test]
fn further_inputs_get_what_names_say_or_what_is_described() {
    let image = || port("image", &[1, 3, 4, 6]);
    let plan = plan_of(&[image(), port("speed", &[1, 1]), port("h_in", &[0, 4])], json!({})).unwrap();
    assert_eq!(plan.inputs[1].fill, Fill::Speed(Speed::PLAIN));
    assert_eq!((plan.inputs[2].fill.clone(), &plan.inputs[2].shape), (Fill::State(1), &vec![1, 4]));
    let fields = json!({"inputs": {"command": [0, 0, 1], "past": "controls"}, "state": {"hidden": "h_out"}});
    let ports = [port("command", &[1, 3]), image(), port("past", &[1, 4]), port("hidden", &[1, 4])];
    let plan = plan_of(&ports, fields).unwrap();
    assert_eq!(plan.image.place, 1);
    let mut inputs = Inputs::new(&plan);
    inputs.move_at(f64::NAN).unwrap();
    assert_eq!(inputs.values()[0], [0.0, 0.0, 1.0]);
    for (control, expected) in
        [(0.25, [0.0, 0.0, 0.25, 0.5]), (0.75, [0.25, 0.5, 0.75, 0.5]), (1.0, [0.75, 0.5, 1.0, 0.5])]
    {
        inputs.remember(&[vec![control], vec![control; 4]], [f64::from(control), 0.5]);
        assert_eq!(inputs.values()[2], expected);
        assert_eq!(inputs.values()[3], [control; 4]);
    }
    inputs.forget();
    assert_eq!((&inputs.values()[2], &inputs.values()[3]), (&vec![0.0; 4], &vec![0.0; 4]));
    let error = |ports: &[Port], fields: Value| plan_of(ports, fields).unwrap_err().to_string();
    let two = error(&[image(), port("mirror", &[1, 2])], json!({}));
    assert!(two.starts_with("its inputs are `image` (1, 3, 4, 6), `mirror` (1, 2), and nothing says what `mirror` gets; describe it"), "{two}");
    let three = error(&[image(), port("command", &[1, 3])], json!({"inputs": {"command": [1, 2]}}));
    assert!(
        three.contains(
            "line 1: `inputs`: its input `command` has the shape (1, 3), but is given 2 numbers; give it 3"
        ),
        "{three}"
    );
    let whole = Port { element: Element::Other(7), ..port("command", &[1]) };
    assert!(
        error(&[image(), whole], json!({"inputs": {"command": 1}}))
            .contains("is int64, but pdk gives float32")
    );
}

#[test]
fn a_speed_that_is_not_known_is_an_error_unless_one_is_assumed() {
    let ports = [port("image", &[1, 3, 4, 6]), port("v", &[1, 1])];
    let speed = |fields: Value, speed: f64| {
        let mut inputs = Inputs::new(&plan_of(&ports, fields).unwrap());
        inputs.move_at(speed).map(|()| inputs.values()[1][0])
    };
    let plain = json!({"inputs": {"v": {"value": "speed", "unit": "km/h"}}});
    assert_eq!(speed(plain.clone(), 10.0), Ok(36.0));
    let error = speed(plain, f64::NAN).unwrap_err().to_string();
    assert!(error.contains("inputs = { v = { value = \"speed\", assumed = 8 } }"), "{error}");
    let assumed = json!({"inputs": {"v": {"value": "speed", "assumed": 5, "scale": 0.1}}});
    assert_eq!(speed(assumed, f64::NAN), Ok(0.5));
}
