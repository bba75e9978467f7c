//! Tests of what outputs become.

use super::*;
use crate::Given;
use pdk_sdk::serde_json::{Value, json};

fn outputs(of: &[(&str, usize)], fields: Value) -> Result<Outputs> {
    let mut given = Given::default();
    for (name, value) in fields.as_object().unwrap() {
        given.set(name, value.clone(), "pilot.toml line 1");
    }
    let names: Vec<_> = of.iter().map(|(name, _)| (*name).to_owned()).collect();
    let sizes: Vec<_> = of.iter().map(|(_, size)| *size).collect();
    Outputs::new(&Described::new(given)?, &names, &sizes, &[])
}

fn slots(of: &[(&str, usize)], fields: Value) -> ((usize, usize), Option<(usize, usize)>) {
    let outputs = outputs(of, fields).unwrap();
    let slot = |source: &Source| (source.output, source.index.unwrap());
    (slot(&outputs.steering), outputs.throttle.as_ref().map(slot))
}

#[test]
fn the_usual_shapes_need_no_description() {
    assert_eq!(slots(&[("out", 2)], json!({})), ((0, 0), Some((0, 1))));
    assert_eq!(slots(&[("out", 1)], json!({})), ((0, 0), None));
    assert_eq!(slots(&[("s", 1), ("t", 1)], json!({})), ((0, 0), Some((1, 0))));
    assert_eq!(slots(&[("throttle", 1), ("angle", 1)], json!({})), ((1, 0), Some((0, 0))));
    let reasons = |of: &[(&str, usize)]| crate::reason::assumptions(&outputs(of, json!({})).unwrap().reasons);
    assert_eq!(reasons(&[("out", 2)]).unwrap(), "steering out[0], throttle out[1]");
    assert_eq!(reasons(&[("angle", 1), ("throttle", 1)]), None);
}

#[test]
fn of_two_numbers_the_one_that_is_left_is_the_other_one() {
    let out = [("out", 2)];
    for (fields, steering, throttle) in [
        (json!({"steering": {"index": 1}}), 1, 0),
        (json!({"steering": {"index": 0}}), 0, 1),
        (json!({"throttle": {"index": 0}}), 1, 0),
        (json!({"throttle": {"scale": 2}}), 0, 1),
        (json!({"steering": {"index": 1}, "throttle": {"index": 0}}), 1, 0),
        (json!({"steering": "out", "throttle": {"output": "out", "index": 0}}), 1, 0),
        (json!({"steering": {"output": "out", "index": 1}, "throttle": "out"}), 1, 0),
    ] {
        assert_eq!(slots(&out, fields.clone()), ((0, steering), Some((0, throttle))), "{fields}");
        let reasons = outputs(&out, fields.clone()).unwrap().reasons;
        let values: Vec<_> = reasons.iter().map(|reason| reason.value.as_str()).collect();
        assert!(values[0].starts_with(&format!("out[{steering}]")), "{fields}: {values:?}");
        assert!(values[1].starts_with(&format!("out[{throttle}]")), "{fields}: {values:?}");
    }
    let outputs = |fields| outputs(&out, fields).unwrap();
    let told = crate::reason::assumptions(&outputs(json!({"steering": {"index": 1}})).reasons);
    assert_eq!(told.unwrap(), "throttle out[0]");
    let constant = outputs(json!({"steering": {"index": 1}, "throttle": 0.25}));
    assert_eq!((constant.steering.index, constant.throttle, constant.constant), (Some(1), None, 0.25));
}

#[test]
fn scale_and_offset_are_reported() {
    let value = |steering: Value| {
        outputs(&[("angle", 1)], json!({"steering": steering})).unwrap().reasons[0].value.clone()
    };
    assert_eq!(value(json!("angle")), "angle");
    assert_eq!(
        value(json!({"output": "angle", "scale": -0.5, "offset": 0.25})),
        "angle times -0.5 plus 0.25"
    );
}

#[test]
fn descriptions_choose_among_several() {
    let two = [("t", 1), ("s", 1)];
    assert_eq!(slots(&two, json!({"steering": "s", "throttle": "t"})), ((1, 0), Some((0, 0))));
    assert_eq!(slots(&two, json!({"throttle": "t"})), ((1, 0), Some((0, 0))));
    assert_eq!(slots(&two, json!({"steering": "s"})), ((1, 0), None));
    assert_eq!(slots(&[("features", 64), ("both", 2)], json!({"steering": "both"})), ((1, 0), Some((1, 1))));
    assert_eq!(slots(&[("many", 64)], json!({"steering": {"output": "many", "index": 7}})), ((0, 7), None));
    assert_eq!(outputs(&[("out", 1)], json!({"throttle": 0.125})).unwrap().constant, 0.125);
}

#[test]
fn a_description_that_does_not_fit_is_an_error_with_its_place_and_a_remedy() {
    let error = |of: &[(&str, usize)], fields: Value| outputs(of, fields).unwrap_err().to_string();
    assert!(
        error(&[("classes", 1000)], json!({}))
            .starts_with("its outputs, with the number of values of each, are `classes` (1000); a driving")
    );
    assert!(error(&[("a", 1), ("b", 1), ("c", 1)], json!({"throttle": "c"})).contains("with `steering`"));
    for (of, fields, expected) in [
        (
            vec![("angle", 1)],
            json!({"steering": "angel"}),
            "`steering` names the output `angel`, which the network does not have; did you mean `angle`?",
        ),
        (
            vec![("a", 3)],
            json!({"steering": "a"}),
            "`steering` is the output `a`, which has 3 numbers; choose one with `index`",
        ),
        (
            vec![("a", 3)],
            json!({"steering": {"output": "a", "index": 3}}),
            "`steering` takes number 3 of the output `a`, which has 3 (from 0)",
        ),
        (
            vec![("a", 20)],
            json!({"steering": {"output": "a", "bins": {"from": -1, "to": 1, "count": 15}}}),
            "`steering` has 15 bins, but the output `a` has 20 numbers",
        ),
        (vec![("a", 1)], json!({"throttle": {"scale": 2}}), "`throttle` names no output"),
    ] {
        let error = error(&of, fields);
        assert!(error.starts_with("pilot.toml line 1: ") && error.contains(expected), "{error}");
    }
}

#[test]
fn numbers_are_scaled_and_clipped_and_bins_have_values() {
    let steering = |rule: Value, numbers: &[f32]| {
        let outputs = outputs(&[("a", numbers.len())], json!({"steering": rule}))?;
        outputs.control(&[numbers.to_vec()]).map(|control| control[0])
    };
    let scaled = json!({"output": "a", "scale": -2.0, "offset": 0.25, "clip": [-0.5, 0.5]});
    assert_eq!(steering(scaled.clone(), &[0.125]), Ok(0.0));
    assert_eq!(steering(scaled.clone(), &[2.0]), Ok(-0.5));
    assert!(outputs(&[("a", 1)], json!({"steering": scaled})).unwrap().steering.is_reversed());
    let bins = |decode: &str| json!({"output": "a", "bins": [-1.0, 0.0, 1.0], "decode": decode});
    assert_eq!(steering(bins("argmax"), &[0.2, 0.4, 0.4]), Ok(0.0), "the first of several");
    assert_eq!(steering(bins("mean"), &[0.25, 0.25, 0.5]), Ok(0.25));
    let softmax = steering(bins("softmax_mean"), &[0.0, 0.0, libm::logf(2.0)]).unwrap();
    assert!((softmax - 0.25).abs() < 1e-7, "{softmax}");
    for decode in ["argmax", "mean", "softmax_mean"] {
        assert!(
            steering(bins(decode), &[0.0, f32::NAN, 1.0])
                .unwrap_err()
                .to_string()
                .contains("its steering is NaN")
        );
    }
}
